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

"""Poses of many colliders, taken and played together: to the last bit as one by one."""

from math import nan
import struct

from collision_sim import Scene
from collision_sim.core.pose_stream import PoseError
from collision_sim.ros.messages import ENCAPSULATION, read_pose, read_poses, SECOND
from collision_sim.ros.pose_streams import PoseStreams
import numpy as np
import pytest

EPOCH = 1_700_000_000 * SECOND + 123_456_789    # ns
NAMES = ['a', 'b', 'c']


def serialized(stamp, position, orientation, frame=b'world', nanoseconds=None):
    seconds, rest = divmod(stamp, SECOND)
    data = struct.pack('<iII', seconds, rest if nanoseconds is None else nanoseconds,
                       len(frame) + 1) + frame + b'\0'
    return ENCAPSULATION + data + bytes(-len(data) % 8) + struct.pack(
        '<7d', *position, *orientation)


def random_message(rng, now, k):
    """Most are good; the others are wrong, or laid out otherwise, in one of many ways."""
    stamp = now - int(rng.uniform(0.0, 0.03) * SECOND)
    orientation = rng.normal(size=4)
    orientation *= (1.0 + rng.uniform(-9e-4, 9e-4)) / np.linalg.norm(orientation)
    position = np.array([k, 0.0, 0.5]) + 0.1 * rng.normal(size=3)
    good = stamp, position, orientation
    return {
        0: lambda: serialized(stamp, position * [1, nan, 1], orientation),
        1: lambda: serialized(stamp, position * 1e8, orientation),
        2: lambda: serialized(stamp, position, 0.0 * orientation),
        3: lambda: serialized(stamp, position, 1.01 * orientation),
        4: lambda: serialized(stamp + 2 * SECOND, position, orientation),
        5: lambda: serialized(stamp - 2 * SECOND, position, orientation),
        6: lambda: serialized(*good, nanoseconds=SECOND),
        7: lambda: serialized(0, position, orientation),
        8: lambda: serialized(stamp, position + 5.0, orientation),
        9: lambda: serialized(*good, frame=b'map'),
        10: lambda: serialized(*good, frame=b'earth'),
        11: lambda: serialized(*good)[:-1],
        12: lambda: serialized(*good) + b'more',
        13: lambda: b'\0\0' + serialized(*good)[2:],
    }.get(int(rng.integers(0, 100)), lambda: serialized(*good))()


@pytest.fixture
def make():
    """Give a function that makes the streams of three colliders."""
    colliders = [{'name': name, 'shape': 'sphere', 'radius': 1, 'topic': name} for name in NAMES]
    scene = Scene.from_dict({'particles': {'position': [[9, 9, 9]]}, 'colliders': colliders})
    return lambda: PoseStreams(scene, 'world', lambda stamp: (stamp - EPOCH) / SECOND)


def take_one_by_one(streams, which, messages, times):
    dropped = []
    for k, message, time in zip(which, messages, times):
        try:
            streams.add_message(NAMES[k], message, int(time))
        except PoseError as error:
            dropped.append((NAMES[k], str(error)))
    return dropped


def test_poses_taken_and_played_together(make):
    rng, together, alone, refused = np.random.default_rng(0), make(), make(), 0
    for tick in range(300):
        now = EPOCH + tick * SECOND // 60
        which = np.sort(rng.integers(0, 3, size=rng.integers(0, 9))).tolist()
        times = now + np.sort(rng.integers(0, SECOND // 100, size=len(which)))
        messages = [random_message(rng, int(time), k) for k, time in zip(which, times)]
        dropped = [(name, str(error)) for name, error
                   in together.add_messages(which, messages, times)]
        assert dropped == take_one_by_one(alone, which, messages, times)
        refused += len(dropped)
        ends = tick / 60 + np.arange(1, 5) / 240
        names, position, orientation, twist, teleport = together._play(ends)
        assert names == [name for name in NAMES if alone._streams[name].newest is not None]
        for j, name in enumerate(names):
            track = alone._streams[name].sample(ends)
            for one, other in zip(track, (position[j], orientation[j], twist[j], teleport[j])):
                np.testing.assert_array_equal(one, other)
        if tick == 150:
            together.forget()
            alone.forget()
    assert together.dropped == alone.dropped and 100 < refused
    assert {reason for _, reason in alone.dropped} == {
        'not_finite', 'too_far', 'zero_quaternion', 'not_unit', 'future', 'stale', 'stamp',
        'backwards', 'frame', 'malformed'}


def test_a_repeated_stamp_is_dropped_where_it_comes(make):
    """Also between two poses that are taken."""
    streams, upright = make(), (0, 0, 0, 1)
    stamps = np.array([10, 20, 20, 30, 15, 40]) * SECOND // 1000 + EPOCH
    messages = [serialized(int(stamp), (0.001 * n, 0, 0), upright)
                for n, stamp in enumerate(stamps)]
    dropped = streams.add_messages([1] * 6, messages, np.full(6, EPOCH))
    assert [(name, error.reason) for name, error in dropped] == [
        ('b', 'repeated'), ('b', 'backwards')]
    assert streams._streams['b'].newest_pose.position[0] == 0.005
    assert streams._streams['a'].newest is None


def test_while_held_the_newest_pose_counts(make):
    streams = make()
    streams.hold()
    messages = [serialized(EPOCH + n * SECOND, (n, 0, 0), (0, 0, 0, 1)) for n in range(3)]
    assert not streams.add_messages([0, 0, 2], messages, np.full(3, EPOCH))
    assert [held.is_new for held in streams._held.values()] == [True, False, True]


@pytest.mark.parametrize('frame', ['world', 'a', 'base_link', 'wörld'])
def test_messages_of_one_frame_are_read_together(frame):
    rng = np.random.default_rng(0)
    messages = [serialized(n * SECOND + 7 * n, rng.normal(size=3), rng.normal(size=4),
                           frame.encode()) for n in range(-2, 5)]
    seconds, nanoseconds, poses = read_poses(messages, frame)
    for n, message in enumerate(messages):
        pose = read_pose(message)
        assert (seconds[n], nanoseconds[n]) == pose[:2] and pose.frame_id == frame
        assert tuple(poses[n]) == pose.position + pose.orientation
    assert read_poses([*messages, messages[0][:-1]], frame) is None
    assert read_poses(messages, frame[:-1] + '.') is None
    assert read_poses([b'\0\0' + message[2:] for message in messages], frame) is None
