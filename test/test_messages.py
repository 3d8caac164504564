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

import struct

from collision_sim.ros.messages import (Marker, marker_array, PointCloudWriter, PoseArrayWriter,
                                        read_pose, read_pose_array)
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


def pose_stamped(frame=b'world\0', numbers=(1, 2, 3, 0, 0, 0, 1)):
    data = struct.pack('<iII', -3, 7, len(frame)) + frame
    data += bytes(-len(data) % 8) + struct.pack('<7d', *numbers)
    return b'\0\1\0\0' + data


@pytest.mark.parametrize('frame', FRAMES)
def test_pose(frame):
    pose = read_pose(pose_stamped(frame.encode() + b'\0'))
    assert pose == (-3, 7, frame, (1, 2, 3), (0, 0, 0, 1))


def test_pose_is_taken_as_rclpy_takes_it():
    """Behind its end anything may follow, and a frame may hold anything."""
    assert read_pose(pose_stamped() + b'more').position == (1, 2, 3)
    assert read_pose(pose_stamped(b'wor\0ld\0')).frame_id == 'wor'
    assert read_pose(pose_stamped(b'\xff\xfe')).frame_id == '\ufffd\ufffd'
    assert read_pose(pose_stamped(b'')).frame_id == ''


def test_changed_bytes_of_a_pose_give_a_pose_or_value_error():
    random = np.random.default_rng(0)
    refused = 0
    for _ in range(5000):
        message = bytearray(pose_stamped())
        for k in random.integers(0, len(message), random.integers(1, 4)):
            message[k] = random.integers(256)
        try:
            pose = read_pose(bytes(message[:random.integers(len(message) + 1)]))
            assert len(pose.position) + len(pose.orientation) == 7
        except ValueError:
            refused += 1
    assert 4000 < refused < 5000


@pytest.mark.parametrize('read', [read_pose, read_pose_array])
@pytest.mark.parametrize('length', [0, 1, 3, 4, 10, 20, 30, 60])
def test_short_messages_are_refused(read, length):
    message = {read_pose: pose_stamped(),
               read_pose_array: PoseArrayWriter('world', 3).message(0, 0, np.zeros((3, 3)))}[read]
    with pytest.raises(ValueError):
        read(message[:length])


@pytest.mark.parametrize('read', [read_pose, read_pose_array])
def test_big_endian_is_refused(read):
    with pytest.raises(ValueError, match='little-endian'):
        read(b'\0\0' + pose_stamped()[2:])


def test_point_cloud():
    writer = PointCloudWriter('world', 1)
    message = writer.message(0, 0, np.array([[1.0, 2.0, 3.0]]), np.array([[4.0, 5.0, 6.0]]))
    assert message.endswith(np.arange(1, 7, dtype='<f4').tobytes() + b'\1')


def test_lists_of_markers_need_no_list():
    """What is given as floats or as a view is laid out as the message has it."""
    rows = np.arange(12.0).reshape(4, 3)
    one = Marker(points=rows[::2], colors=np.ones((2, 4)))
    other = Marker(points=rows[::2].tolist(), colors=np.ones((2, 4), 'f4'))
    assert marker_array(0, 0, 'world', [one]) == marker_array(0, 0, 'world', [other])
