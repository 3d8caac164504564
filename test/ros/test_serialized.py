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

"""Message bytes laid out by NumPy against those of rclpy."""

from collision_sim.ros.messages import PoseArrayWriter, read_pose_array
import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion  # noqa: E402, I100
from rclpy.serialization import deserialize_message, serialize_message  # noqa: E402

FRAMES = ['', 'a', 'wo', 'map', 'odom', 'world', 'bäse', 'a_link_f', 'a_link_fr']


def built(seconds, nanoseconds, frame, position):
    message = PoseArray()
    message.header.stamp.sec = seconds
    message.header.stamp.nanosec = nanoseconds
    message.header.frame_id = frame
    message.poses = [Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(w=1.0))
                     for x, y, z in position.tolist()]
    return message


@pytest.mark.parametrize('frame', FRAMES)
@pytest.mark.parametrize('count', [0, 1, 2, 7, 1000])
def test_pose_array_equals_rclpy_outside_padding(count, frame):
    """Rclpy leaves padding undefined: bytes may differ only where ours are zero."""
    position = np.random.default_rng(0).normal(size=(count, 3))
    expected = built(-1, 7, frame, position)
    ours = PoseArrayWriter(frame, count).message(-1, 7, position)
    theirs = serialize_message(expected)
    assert deserialize_message(ours, PoseArray) == expected
    assert len(ours) == len(theirs)
    different = [k for k in range(len(ours)) if ours[k] != theirs[k]]
    end_of_frame = 16 + len(frame.encode()) + 1
    padding = set(range(end_of_frame, len(ours) - 56 * count))
    padding -= set(range(-(-end_of_frame // 4) * 4, -(-end_of_frame // 4) * 4 + 4))
    assert set(different) <= padding and not any(ours[k] for k in different)


def test_reads_what_rclpy_writes():
    position = np.random.default_rng(1).normal(size=(5, 3))
    message = serialize_message(built(3, 4, 'world', position))
    seconds, nanoseconds, frame, poses = read_pose_array(message)
    assert (seconds, nanoseconds, frame) == (3, 4, 'world')
    np.testing.assert_array_equal(poses[:, :3], position)
