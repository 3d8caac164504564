# Copyright 2026 collision_sim developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Tests of the message bytes that need no ROS; test/ros compares them with rclpy's."""

from collision_sim.ros.messages import cloud_points, PoseArrayWriter, read_pose_array
import numpy as np
import pytest

FRAMES = ['', 'a', 'wo', 'map', 'odom', 'world', 'bäse', 'a_link_fr']


@pytest.mark.parametrize('frame', FRAMES)
@pytest.mark.parametrize('count', [0, 1, 2, 7, 1000])
def test_pose_array_round_trip(count, frame):
    position = np.random.default_rng(0).normal(size=(count, 3))
    writer = PoseArrayWriter(frame, count)
    writer.message(1, 2, position + 1.0)
    message = writer.message(-3, 999_999_999, position)
    seconds, nanoseconds, frame_id, poses = read_pose_array(message)
    assert (seconds, nanoseconds, frame_id) == (-3, 999_999_999, frame)
    np.testing.assert_array_equal(poses[:, :3], position)
    np.testing.assert_array_equal(poses[:, 3:], np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)))


def test_messages_are_reproducible_and_independent():
    writer = PoseArrayWriter('world', 2)
    first = writer.message(0, 0, np.zeros((2, 3)))
    second = writer.message(0, 0, np.ones((2, 3)))
    assert first == PoseArrayWriter('world', 2).message(0, 0, np.zeros((2, 3)))
    assert first != second


def test_frame_ends_at_a_nul():
    message = PoseArrayWriter('wor\0ld', 0).message(0, 0, np.zeros((0, 3)))
    assert read_pose_array(message)[2] == 'wor'


@pytest.mark.parametrize('length', [0, 3, 4, 10, 20, 30, 60])
def test_short_messages_are_refused(length):
    message = PoseArrayWriter('world', 3).message(0, 0, np.zeros((3, 3)))
    with pytest.raises(ValueError):
        read_pose_array(message[:length])


def test_big_endian_is_refused():
    message = PoseArrayWriter('world', 1).message(0, 0, np.zeros((1, 3)))
    with pytest.raises(ValueError, match='little-endian'):
        read_pose_array(b'\0\0' + message[2:])


def test_cloud_points():
    points = cloud_points(np.array([[1.0, 2.0, 3.0]]), np.array([[4.0, 5.0, 6.0]]))
    assert points.tobytes() == np.arange(1, 7, dtype='<f4').tobytes()
