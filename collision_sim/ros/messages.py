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
NumPy arrays <-> the bytes of ROS messages (plain CDR, little endian); needs no ROS.

Building pose objects one by one takes some 3 us a particle, laying them out with NumPy some 5 ns.
Every function and class names the message that it writes or reads. Padding is zero, so that equal
values are equal bytes. Strings end at a NUL, as everywhere in ROS.
"""

from functools import lru_cache
import struct
from typing import NamedTuple

import numpy as np

ENCAPSULATION = b'\x00\x01\x00\x00'     # plain CDR, little endian; offsets count from its end
KIND = np.void(ENCAPSULATION[:2])       # what follows is for options
SECOND = 1_000_000_000                  # ns
POSE = 7                                # float64 of a geometry_msgs/Pose
CLOUD_FIELDS = ('x', 'y', 'z', 'vx', 'vy', 'vz')
FLOAT32 = 7                             # datatype of a sensor_msgs/PointField
UPRIGHT = (0.0, 0.0, 0.0, 1.0)          # quaternion x, y, z, w

# Of a visualization_msgs/Marker: actions and types.
ADD, DELETE, DELETEALL = 0, 2, 3
CUBE, SPHERE, CYLINDER, LINE_LIST, SPHERE_LIST, TRIANGLE_LIST = 1, 2, 3, 5, 7, 11


# --- writing ---------------------------------------------------------------------------------


class _Writer:
    """The bytes of one message, value after value in the order of its definition."""

    def __init__(self):
        self.data = bytearray(ENCAPSULATION)

    def align(self, size):
        """Every number starts at a multiple of its size."""
        self.data += bytes((len(ENCAPSULATION) - len(self.data)) % size)

    def numbers(self, kind, *values):
        """Numbers of one kind, a letter of the module struct."""
        self.align(struct.calcsize(kind))
        self.data += struct.pack('<%d%s' % (len(values), kind), *values)

    def string(self, text):
        data = text.split('\0')[0].encode() + b'\0'
        self.numbers('I', len(data))
        self.data += data

    def sequence(self, rows):
        """Sequence of what is a row of equal little-endian numbers each."""
        self.numbers('I', len(rows))
        if len(rows):
            self.align(rows.itemsize)
            self.data += rows.tobytes()

    def header(self, seconds, nanoseconds, frame_id):
        self.numbers('i', seconds)
        self.numbers('I', nanoseconds)
        self.string(frame_id)


class _ParticlesWriter:
    """Lays out messages of a fixed number of rows, one a particle, that differ in little else."""

    def __init__(self, writer, count, columns, kind, tail=b''):
        """Take what comes before the rows, and their number, width and kind; and what follows."""
        if count:
            writer.align(np.dtype(kind).itemsize)
        start = len(writer.data)
        size = count * columns * np.dtype(kind).itemsize
        self._buffer = bytearray(writer.data + bytes(size) + tail)
        self._rows = np.ndarray((count, columns), kind, self._buffer, start)

    def _stamped(self, seconds, nanoseconds):
        struct.pack_into('<iI', self._buffer, len(ENCAPSULATION), seconds, nanoseconds)
        return bytes(self._buffer)


class PoseArrayWriter(_ParticlesWriter):
    """
    Lays out geometry_msgs/PoseArray for a fixed number of particles; orientations are upright.

    Parameters
    ----------
    frame_id : str
        Of the header.
    count : int
        Poses a message.

    """

    def __init__(self, frame_id, count):
        """Lay out what is the same in every message."""
        writer = _Writer()
        writer.header(0, 0, frame_id)
        writer.numbers('I', count)
        super().__init__(writer, count, POSE, '<f8')
        self._rows[:, 3:] = UPRIGHT

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
        self._rows[:, :3] = position
        return self._stamped(seconds, nanoseconds)


class PointCloudWriter(_ParticlesWriter):
    """
    Lays out sensor_msgs/PointCloud2 for a fixed number of particles: float32, as CLOUD_FIELDS.

    Parameters
    ----------
    frame_id : str
        Of the header.
    count : int
        Points a message.

    """

    def __init__(self, frame_id, count):
        """Lay out what is the same in every message."""
        writer = _Writer()
        point = 4 * len(CLOUD_FIELDS)       # bytes
        writer.header(0, 0, frame_id)
        writer.numbers('I', 1, count)       # height, width
        writer.numbers('I', len(CLOUD_FIELDS))
        for k, name in enumerate(CLOUD_FIELDS):
            writer.string(name)
            writer.numbers('I', 4 * k)      # offset
            writer.numbers('B', FLOAT32)
            writer.numbers('I', 1)          # count
        writer.numbers('?', False)          # is_bigendian
        writer.numbers('I', point, point * count, point * count)    # a point, a row, all
        super().__init__(writer, count, len(CLOUD_FIELDS), '<f4', tail=b'\1')   # is_dense

    def message(self, seconds, nanoseconds, position, velocity):
        """
        Give the message.

        Parameters
        ----------
        seconds, nanoseconds : int
            Stamp of the header.
        position, velocity : (count, 3) float64 [m], [m/s]
            Of the particles.

        Returns
        -------
        message : bytes
            Serialized, as rclpy publishes and subscribes raw.

        """
        self._rows[:, :3] = position
        self._rows[:, 3:] = velocity
        return self._stamped(seconds, nanoseconds)


class Marker(NamedTuple):
    """
    What varies in the visualization_msgs/Marker of this package.

    Attributes
    ----------
    namespace, number : str, int
        A marker replaces the one of the same namespace and number.
    action, kind : int
        ADD, DELETE or DELETEALL; CUBE, SPHERE, ...
    scale : (3,) float [m]
    color : (4,) float [-]
        Red, green, blue, alpha; of what has no `colors`.
    position, orientation : (3,), (4,) float [m], [-]
        Quaternion x, y, z, w.
    lifetime : float [s]
        0: for ever.
    points, colors : (n, 3) float64 [m], (n, 4) float32 [-]
        Of a list.

    """

    namespace: str = ''
    number: int = 0
    action: int = ADD
    kind: int = 0
    scale: tuple = (0.0, 0.0, 0.0)
    color: tuple = (0.0, 0.0, 0.0, 0.0)
    position: tuple = (0.0, 0.0, 0.0)
    orientation: tuple = UPRIGHT
    lifetime: float = 0.0
    points: np.ndarray = np.empty((0, 3))
    colors: np.ndarray = np.empty((0, 4), 'f4')


def marker_array(seconds, nanoseconds, frame_id, markers):
    """
    Lay out a visualization_msgs/MarkerArray.

    Parameters
    ----------
    seconds, nanoseconds : int
        Stamp of the headers.
    frame_id : str
        Of the headers.
    markers : sequence of Marker
        In the order in which they are drawn.

    Returns
    -------
    message : bytes
        Serialized, as rclpy publishes and subscribes raw.

    """
    writer = _Writer()
    writer.numbers('I', len(markers))
    for marker in markers:
        writer.header(seconds, nanoseconds, frame_id)
        _write_marker(writer, marker)
    return bytes(writer.data)


def _write_marker(writer, marker):
    """Write a marker from behind its header on."""
    writer.string(marker.namespace)
    writer.numbers('i', marker.number, marker.kind, marker.action)
    writer.numbers('d', *marker.position, *marker.orientation, *marker.scale)
    writer.numbers('f', *marker.color)
    writer.numbers('I', *divmod(round(marker.lifetime * SECOND), SECOND))
    writer.numbers('?', False)              # frame_locked
    writer.sequence(np.asarray(marker.points, '<f8'))
    writer.sequence(np.asarray(marker.colors, '<f4'))
    writer.string('')                       # texture_resource
    writer.header(0, 0, '')                 # texture: header, format, data
    writer.string('')
    writer.numbers('I', 0, 0)               # ... uv_coordinates
    writer.string('')                       # text
    writer.string('')                       # mesh_resource
    writer.string('')                       # mesh_file: filename, data
    writer.numbers('I', 0)
    writer.numbers('?', False)              # mesh_use_embedded_materials


# --- reading ---------------------------------------------------------------------------------


class PoseStamped(NamedTuple):
    """A geometry_msgs/PoseStamped: stamp, frame, position [m] and orientation x, y, z, w."""

    seconds: int
    nanoseconds: int
    frame_id: str
    position: tuple
    orientation: tuple


def read_pose(message):
    """
    Take a serialized geometry_msgs/PoseStamped apart; its numbers may be any, NaN included.

    Parameters
    ----------
    message : bytes
        Plain CDR, little endian.

    Returns
    -------
    pose : PoseStamped

    Raises
    ------
    ValueError
        For another encapsulation, or a message that ends too early.

    """
    try:
        seconds, nanoseconds, frame_id, offset = _read_header(message)
        numbers = struct.unpack_from('<7d', message, offset + -offset % 8 + len(ENCAPSULATION))
    except struct.error as error:
        raise ValueError('too short: %s' % error) from None
    return PoseStamped(seconds, nanoseconds, frame_id, numbers[:3], numbers[3:])


def read_poses(messages, frame_id):
    """
    Take many serialized geometry_msgs/PoseStamped apart, if all are of one frame.

    Parameters
    ----------
    messages : sequence of bytes
        Not empty.
    frame_id : str
        Of that frame.

    Returns
    -------
    seconds, nanoseconds : (n,) int64
        Stamps.
    poses : (n, 7) float64
        Position [m] and orientation x, y, z, w.

    None instead of all where `read_pose` may say otherwise of a message.

    """
    layout, frame = _pose_layout(frame_id)
    if {len(message) for message in messages} != {layout.itemsize}:
        return None
    table = np.frombuffer(b''.join(messages), layout)
    if (table['kind'] != KIND).any() or (table['frame'] != frame).any():
        return None
    return (table['seconds'].astype(np.int64), table['nanoseconds'].astype(np.int64),
            table['pose'].astype(np.float64))


@lru_cache(maxsize=8)
def _pose_layout(frame_id):
    """Layout of a geometry_msgs/PoseStamped as a record, and the bytes of its frame."""
    writer = _Writer()
    writer.header(0, 0, frame_id)
    frame = np.array(bytes(writer.data[12:]), dtype=f'V{len(writer.data) - 12}')
    writer.align(8)
    start = len(writer.data)
    return np.dtype({
        'names': ['kind', 'seconds', 'nanoseconds', 'frame', 'pose'],
        'formats': ['V2', '<i4', '<u4', frame.dtype, ('<f8', POSE)],
        'offsets': [0, 4, 8, 12, start], 'itemsize': start + 8 * POSE}), frame


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
    try:
        seconds, nanoseconds, frame_id, offset = _read_header(message)
        offset += -offset % 4
        count, = struct.unpack_from('<I', message, offset + len(ENCAPSULATION))
    except struct.error as error:
        raise ValueError('too short: %s' % error) from None
    offset += 4
    offset += -offset % 8 if count else 0
    poses = np.frombuffer(message, '<f8', POSE * count, offset + len(ENCAPSULATION))
    return seconds, nanoseconds, frame_id, poses.reshape(count, POSE)


def _read_header(message):
    """Stamp and frame of a header, and the offset of its end from that of the encapsulation."""
    if message[:2] != ENCAPSULATION[:2]:
        raise ValueError('not plain little-endian CDR: %s' % message[:4].hex())
    start = len(ENCAPSULATION)
    seconds, nanoseconds, length = struct.unpack_from('<iII', message, start)
    end = 12 + length
    frame_id = message[start + 12:start + end].split(b'\0')[0].decode(errors='replace')
    return seconds, nanoseconds, frame_id, end
