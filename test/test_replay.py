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

"""`collision_sim run --poses`: recorded poses move the colliders, the same way each time."""

import os
from pathlib import Path
import random

from collision_sim import cli, load_scene, Simulation
from collision_sim.checks import SceneError
from collision_sim.core.pose_stream import PoseStream
import numpy as np
import pytest
import yaml

pytest.importorskip('rosbags', reason="needs pip install 'collision_sim[record]'")

from collision_sim.bags import read_bag  # noqa: E402, I100
from collision_sim.ros.arrivals import Arrivals  # noqa: E402
from rosbags.rosbag2 import CompressionMode  # noqa: E402
from small_bags import (pose_message, POSE_STAMPED, read_messages, SECOND,  # noqa: E402
                        START, STORAGES, swing, TYPES, write_bag, write_swing)

ROOT = Path(__file__).resolve().parents[1]
DEMO = ROOT / 'collision_sim' / 'scenes' / 'demo.yaml'


@pytest.fixture
def scene(tmp_path):
    """Give the path of the demo with few particles, all of them where the paddle swings."""
    demo = yaml.safe_load(DEMO.read_text())
    demo['particles'] = {**demo['particles'], 'count': 30,
                         'box': {'min': [-0.8, 0.3, 0.1], 'max': [0.8, 0.7, 0.6]}}
    path = tmp_path / 'small.yaml'
    path.write_text(yaml.safe_dump(demo))
    return str(path)


@pytest.fixture
def final(scene, tmp_path, capsys):
    """Give a function that runs the scene with a bag; it gives the final state and the output."""
    def run(bag, *words, duration='1.0'):
        path = tmp_path / 'final.npz'
        assert cli.main(['run', scene, '--poses', str(bag), '--duration', duration,
                         '--out', str(path), *words]) == 0
        state = np.load(path)
        return np.hstack([state['position'], state['velocity']]), capsys.readouterr().out
    return run


def seconds_of(stamp):
    """Give the seconds since the start of a stamp [ns], or those seconds as they are."""
    return stamp if isinstance(stamp, float) else (stamp - START) / SECOND


def by_hand(scene, poses, delay=0.1, duration=1.0):
    """Give the final state of a simulation whose paddle follows poses by calls of this test."""
    sim, stream = Simulation(load_scene(scene), contacts=False), PoseStream(delay=delay)
    poses = list(poses)
    for _ in range(round(duration / sim.dt)):
        time = sim.time + sim.dt
        while poses and poses[0][0] <= START + round(time * SECOND):
            _, stamp, position = poses.pop(0)
            stream.add(seconds_of(stamp), position, (0.0, 0.0, 0.0, 1.0))
        if stream.newest is not None:
            track = stream.sample([time])
            if track.teleport[0]:
                sim.place_collider('paddle', track.position[0], track.orientation[0])
            sim.move_collider('paddle', *(part[0] for part in track[:3]))
        sim.step()
    return np.hstack([sim.position, sim.velocity])


@pytest.mark.parametrize('storage', STORAGES)
def test_a_replay_equals_a_paddle_moved_by_hand(scene, final, storage, tmp_path):
    """Bit for bit, each time, whatever is recorded meanwhile; the paddle matters."""
    bag = write_swing(tmp_path / 'swing', storage)
    first, out = final(bag)
    assert 'poses of paddle   30 taken\n' in out
    np.testing.assert_array_equal(first, by_hand(scene, swing()))
    assert np.abs(first - by_hand(scene, [])).max() > 0.1
    again, _ = final(bag, '--record', str(tmp_path / 'out.mcap'), '--rate', '17')
    np.testing.assert_array_equal(first, again)


def test_one_file_of_a_bag_is_a_bag(final, tmp_path):
    """The .mcap and the .db3 in a folder, without its metadata, their messages packed or not."""
    bags = [write_swing(tmp_path / f'{storage}_{mode}', storage, mode)
            for storage in STORAGES for mode in (None, CompressionMode.MESSAGE)]
    states = [final(path)[0] for bag in bags
              for path in (bag, *(file for file in bag.iterdir() if file.suffix != '.yaml'))]
    assert len(states) == 8
    for state in states[1:]:
        np.testing.assert_array_equal(state, states[0])


def test_poses_are_not_known_before_they_are_received(scene, final, tmp_path):
    """Late by 0.2 s, twice the delay: the paddle coasts and catches up, as by hand."""
    late = [(received + SECOND // 5, stamp, position) for received, stamp, position in swing()]
    late[0] = (START, *late[0][1:])
    bag = write_bag(tmp_path / 'late', [(received, pose_message(stamp, position))
                                        for received, stamp, position in late])
    state, _ = final(bag)
    np.testing.assert_array_equal(state, by_hand(scene, late))
    assert np.abs(state - by_hand(scene, swing())).max() > 0.0


def test_without_a_stamp_it_is_when_a_pose_was_received(scene, final, tmp_path):
    """A zero stamp means when the pose was sent, as far as its arrival tells, as for the node."""
    bag = write_bag(tmp_path / 'unstamped', [(received, pose_message(0, position))
                                             for received, _, position in swing()])
    state, _ = final(bag)
    arrivals = Arrivals()
    sent = [(received, arrivals.sent(seconds_of(received)), position)
            for received, _, position in swing()]
    np.testing.assert_array_equal(state, by_hand(scene, sent))


def test_bad_poses_are_dropped_and_counted(final, tmp_path):
    """By reason; the rest moves the paddle as if they had not been there."""
    good = [(received, pose_message(stamp, position)) for received, stamp, position in swing()]
    at = START + SECOND // 2 + SECOND // 200        # between two good ones
    place = (0.0, 0.5, 0.1)
    bad = {
        'frame': pose_message(at, place, frame='odom'),
        'not_finite': pose_message(at, (np.nan, 0.5, 0.1)),
        'not_unit': pose_message(at, place, (0.0, 0.0, 0.0, 2.0)),
        'zero_quaternion': pose_message(at, place, (0.0, 0.0, 0.0, 0.0)),
        'backwards': pose_message(at - SECOND // 10, place),
        'stale': pose_message(at - SECOND, place),
        'future': pose_message(at + 2 * SECOND, place),
        'malformed': pose_message(at, place)[:40],
    }
    bag = write_bag(tmp_path / 'bad', sorted([*good, *((at, message) for message in bad.values())],
                                             key=lambda one: one[0]))
    state, out = final(bag)
    expected, _ = final(write_bag(tmp_path / 'good', good))
    np.testing.assert_array_equal(state, expected)
    line, = [line for line in out.splitlines() if line.startswith('poses of paddle')]
    assert line.startswith('poses of paddle   30 taken, ')
    assert sorted(line.split(', ')[1:]) == sorted(f'1 dropped: {reason}' for reason in bad)


def test_the_frame_is_an_option(final, tmp_path):
    """Poses in another frame than world are taken where that is asked for."""
    bag = write_bag(tmp_path / 'lab', [(received, pose_message(stamp, position, frame='lab'))
                                       for received, stamp, position in swing()])
    assert 'poses of paddle   0 taken, 30 dropped: frame' in final(bag)[1]
    state, out = final(bag, '--frame-id', 'lab')
    assert 'poses of paddle   30 taken\n' in out
    np.testing.assert_array_equal(state, final(write_swing(tmp_path / 'world'))[0])


def test_the_delay_is_an_option(scene, final, tmp_path):
    """As that of a PoseStream."""
    state, _ = final(write_swing(tmp_path / 'swing'), '--pose-delay', '0.25')
    np.testing.assert_array_equal(state, by_hand(scene, swing(), delay=0.25))


def test_a_run_lasts_until_the_last_pose_is_played(scene, tmp_path, capsys):
    """Received 1.5 s after the start of the bag, played 0.25 s later."""
    bag = write_bag(tmp_path / 'two', [(START, pose_message(0, (0.0, 0.5, 0.1))),
                                       (START + 3 * SECOND // 2, pose_message(0, (1, 0.5, 0.1)))])
    assert cli.main(['run', scene, '--poses', str(bag), '--pose-delay', '0.25']) == 0
    assert 'simulated time    1.75 s in 420 steps' in capsys.readouterr().out


def test_what_was_recorded_shows_the_poses(final, tmp_path):
    """A recording of a replay: the marker of the paddle swings, 0.1 s late."""
    out = tmp_path / 'out.mcap'
    final(write_swing(tmp_path / 'swing'), '--record', str(out), '--topics', 'colliders')
    times, places = [], []
    for received, data in read_messages(out)['/collision_sim/colliders']:
        message = TYPES.deserialize_cdr(data, 'visualization_msgs/msg/MarkerArray')
        place, = [m.pose.position.x for m in message.markers if m.ns == 'colliders/paddle']
        times.append(received / SECOND)
        places.append(place)
    times, places = np.array(times), np.array(places)
    expected = 0.4 * np.sin(2 * np.pi * (times - 0.1))
    known = (times > 0.3) & (times < 0.9)       # three stamps before, and one after
    assert known.sum() > 30
    np.testing.assert_allclose(places[known], expected[known], atol=1e-3)


# --- bags that are refused -------------------------------------------------------------------


def broken(bag, change):
    """Change the bytes of the one storage file of a bag."""
    path, = [file for file in bag.iterdir() if file.suffix != '.yaml']
    path.write_bytes(change(path.read_bytes()))
    return bag


def piped(bag):
    """Put a pipe in the place of the storage file of a bag."""
    path, = [file for file in bag.iterdir() if file.suffix != '.yaml']
    path.unlink()
    os.mkfifo(path)
    return bag


BAD_BAGS = {
    'missing': lambda folder: folder / 'missing.mcap',
    'no bag': lambda folder: DEMO,
    'an empty file': lambda folder: (folder / 'empty.mcap').touch() or folder / 'empty.mcap',
    'a text': lambda folder: (folder / 'a.mcap').write_text('hello') and folder / 'a.mcap',
    'a folder without a bag': lambda folder: folder,
    'a pipe': lambda folder: os.mkfifo(folder / 'a.mcap') or folder / 'a.mcap',
    'a device': lambda folder: (folder / 'a.db3').symlink_to('/dev/zero') or folder / 'a.db3',
    'a pipe in a folder': lambda folder: piped(write_swing(folder / 'bag_with_b.mcap')),
    'a truncated mcap': lambda folder: broken(write_swing(folder / 'b'), lambda b: b[:-100]),
    'a truncated db3': lambda folder: broken(write_swing(folder / 'b', 'sqlite3'),
                                             lambda b: b[:5000]),
    'another type': lambda folder: write_bag(
        folder / 'b', [(START, bytes(20))], kind='geometry_msgs/msg/PoseArray'),
    'another topic': lambda folder: write_bag(folder / 'b', [], topic='/robot/pose'),
}


@pytest.mark.parametrize('name', BAD_BAGS)
def test_bags_that_are_refused(name, scene, tmp_path, capsys):
    """Exit code 2 and one line that says why, before anything is written."""
    bag, out = BAD_BAGS[name](tmp_path), tmp_path / 'out.mcap'
    assert cli.main(['run', scene, '--poses', str(bag), '--record', str(out)]) == 2
    err = capsys.readouterr().err
    assert err.startswith('collision_sim: ') and len(err.strip().splitlines()) == 1
    assert str(bag)[-20:] in err or 'b.mcap' in err
    assert not list(tmp_path.glob('out.mcap*'))
    if name == 'another topic':
        assert f'/robot/pose ({POSE_STAMPED})' in err and '/paddle/pose' in err
    if name == 'another type':
        assert '/paddle/pose (geometry_msgs/msg/PoseArray)' in err


def test_poses_for_a_scene_without_topics(tmp_path, capsys):
    """Nobody would move: refused."""
    assert cli.main(['run', 'incline', '--poses', str(write_swing(tmp_path / 'swing'))]) == 2
    assert 'no collider of the scene has a topic' in capsys.readouterr().err


@pytest.mark.parametrize('storage', STORAGES)
def test_mutated_bags(storage, tmp_path):
    """Whatever the bytes: messages or one of the two errors, never anything else."""
    bag, rng = write_swing(tmp_path / 'swing', storage), random.Random(0)
    path, = [file for file in bag.iterdir() if file.suffix != '.yaml']
    whole, refused = path.read_bytes(), 0
    for _ in range(200):
        data = bytearray(whole)
        for _ in range(rng.choice([1, 3, 30])):
            data[rng.randrange(len(data))] = rng.randrange(256)
        path.write_bytes(data[:rng.choice([len(data), rng.randrange(len(data))])])
        try:
            read_bag(str(rng.choice([bag, path])), ['/paddle/pose'], POSE_STAMPED)
        except (SceneError, OSError):
            refused += 1
    assert 0 < refused < 200
