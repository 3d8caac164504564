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

"""Bags for the tests, written with rosbags as any user would, and bags read back."""

import math

import numpy as np
from rosbags.rosbag2 import CompressionFormat, Reader, StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND      # ns; of the bags, on the clock of a robot
STORAGES = {'sqlite3': StoragePlugin.SQLITE3, 'mcap': StoragePlugin.MCAP}
TYPES = get_typestore(Stores.ROS2_JAZZY)
POSE_STAMPED = 'geometry_msgs/msg/PoseStamped'


def pose_message(stamp, position, orientation=(0.0, 0.0, 0.0, 1.0), frame='world'):
    """Serialize a PoseStamped; stamp in ns, 0 for none."""
    kind = TYPES.types
    header = kind['std_msgs/msg/Header'](
        kind['builtin_interfaces/msg/Time'](*divmod(stamp, SECOND)), frame)
    pose = kind['geometry_msgs/msg/Pose'](
        kind['geometry_msgs/msg/Point'](*map(float, position)),
        kind['geometry_msgs/msg/Quaternion'](*map(float, orientation)))
    return bytes(TYPES.serialize_cdr(kind[POSE_STAMPED](header, pose), POSE_STAMPED))


def swing(duration=1.0, rate=30.0, amplitude=0.4, seed=0):
    """
    Give what a program that swings the paddle of the demo sends, with jitter and latency.

    Returns
    -------
    poses : list of (int [ns], int [ns], tuple [m])
        When each was received, its stamp and its position.

    """
    rng = np.random.default_rng(seed)
    poses = []
    for k in range(round(duration * rate)):
        time = k / rate + rng.uniform(0.0, 5e-3)
        stamp = START + round(time * SECOND)
        received = stamp + round(rng.uniform(1e-3, 4e-3) * SECOND)
        poses.append((received if k else START, stamp if k else START,
                      (amplitude * math.sin(2.0 * math.pi * time), 0.5, 0.1)))
    return poses


def write_bag(path, messages, topic='/paddle/pose', kind=POSE_STAMPED, storage='mcap',
              compression=None):
    """Write a bag folder of (time [ns], serialized message)."""
    writer = Writer(path, version=9, storage_plugin=STORAGES[storage])
    if compression is not None:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection(topic, kind, typestore=TYPES)
        for time, message in messages:
            writer.write(connection, time, message)
    return path


def write_swing(path, storage='mcap', compression=None):
    """Write a bag of the swinging paddle."""
    return write_bag(path, [(received, pose_message(stamp, position))
                            for received, stamp, position in swing()],
                     storage=storage, compression=compression)


def read_messages(path):
    """Read a bag: topic to list of (time [ns], serialized message)."""
    found = {}
    with Reader(path) as reader:
        for connection in reader.connections:
            found[connection.topic] = []
        for connection, time, message in reader.messages():
            found[connection.topic].append((time, bytes(message)))
    return found
