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

"""
NumPy arrays <-> the bytes of ROS messages (CDR, little endian); needs no ROS.

Building pose objects one by one takes some 3 us a particle, laying them out with NumPy some 5 ns.
"""

import struct

import numpy as np

ENCAPSULATION = b'\x00\x01\x00\x00'     # plain CDR, little endian; offsets count from its end
POSE = 7                                # float64 of a geometry_msgs/Pose
CLOUD_FIELDS = ('x', 'y', 'z', 'vx', 'vy', 'vz')


class PoseArrayWriter:
    """
    Lays out geometry_msgs/PoseArray for a fixed number of particles; orientations are upright.

    Parameters
    ----------
    frame_id : str
        Of the header; ends at a NUL, as in every ROS string.
    count : int
        Poses a message.

    """

    def __init__(self, frame_id, count):
        """Lay out what is the same in every message."""
        frame = frame_id.split('\0')[0].encode() + b'\0'
        head = bytearray(8) + struct.pack('<I', len(frame)) + frame
        head += bytes(-len(head) % 4) + struct.pack('<I', count)
        if count:
            head += bytes(-len(head) % 8)
        self._buffer = bytearray(ENCAPSULATION + head + bytes(8 * POSE * count))
        self._poses = np.ndarray((count, POSE), '<f8', self._buffer,
                                 len(ENCAPSULATION) + len(head))
        self._poses[:, 6] = 1.0

    def message(self, seconds, nanoseconds, position):
        """
        Give the message.

        Parameters
        ----------
        seconds, nanoseconds : int
            Stamp of the header.
        position : (count, 3) float64 [m]
            Of the particles.

        Returns
        -------
        message : bytes
            Serialized, as rclpy publishes and subscribes raw.

        """
        struct.pack_into('<iI', self._buffer, len(ENCAPSULATION), seconds, nanoseconds)
        self._poses[:, :3] = position
        return bytes(self._buffer)


def read_pose_array(message):
    """
    Take a serialized geometry_msgs/PoseArray apart.

    Parameters
    ----------
    message : bytes
        Plain CDR, little endian.

    Returns
    -------
    seconds, nanoseconds : int
    frame_id : str
    poses : (n, 7) float64
        Position [m] and orientation x, y, z, w; a read-only view of the message.

    Raises
    ------
    ValueError
        For another encapsulation, or a message that ends too early.

    """
    body = memoryview(message)[len(ENCAPSULATION):]
    if bytes(message[:2]) != ENCAPSULATION[:2]:
        raise ValueError('not plain little-endian CDR: %s' % bytes(message[:4]).hex())
    try:
        seconds, nanoseconds, length = struct.unpack_from('<iII', body)
        offset = 12 + length
        frame_id = bytes(body[12:offset]).rstrip(b'\0').decode(errors='replace')
        offset += -offset % 4
        count, = struct.unpack_from('<I', body, offset)
    except struct.error as error:
        raise ValueError('too short: %s' % error) from None
    offset += 4
    offset += -offset % 8 if count else 0
    poses = np.frombuffer(body, '<f8', POSE * count, offset).reshape(count, POSE)
    return seconds, nanoseconds, frame_id, poses


def cloud_points(position, velocity):
    """Points of a sensor_msgs/PointCloud2: (N, 6) float32, as CLOUD_FIELDS."""
    points = np.empty((len(position), len(CLOUD_FIELDS)), dtype='<f4')
    points[:, :3] = position
    points[:, 3:] = velocity
    return points
