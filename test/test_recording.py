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

"""`collision_sim run --record` and `--out --every`: what is in the files, and interruptions."""

import csv
import os
from pathlib import Path
import random
import re
import resource
import signal
import subprocess
import sys
import time

from collision_sim import cli
from collision_sim.ros.messages import read_pose_array
from collision_sim.studies.run import Periodic
import numpy as np
import pytest
import yaml

pytest.importorskip('rosbags', reason="needs pip install 'collision_sim[record]'")

from rosbags.interfaces import QosDurability  # noqa: E402, I100
from rosbags.rosbag2 import Reader  # noqa: E402
from small_bags import read_messages, SECOND, TYPES  # noqa: E402

ROOT = Path(__file__).resolve().parents[1]
PATIENCE = 120.0        # s; nothing is asserted about how long something takes
TOPICS = {'/collision_sim/particles': 'geometry_msgs/msg/PoseArray',
          '/collision_sim/contacts': 'visualization_msgs/msg/MarkerArray',
          '/collision_sim/colliders': 'visualization_msgs/msg/MarkerArray',
          '/collision_sim/cloud': 'sensor_msgs/msg/PointCloud2'}
ALL = 'particles,contacts,colliders,cloud'


@pytest.fixture
def scene(tmp_path):
    """Give the path of the demo with few particles."""
    demo = yaml.safe_load((ROOT / 'collision_sim' / 'scenes' / 'demo.yaml').read_text())
    demo['particles'] = {**demo['particles'], 'count': 30,
                         'box': {'min': [-0.9, -0.9, 0.1], 'max': [0.9, 0.9, 0.6]}}
    path = tmp_path / 'small.yaml'
    path.write_text(yaml.safe_dump(demo))
    return str(path)


@pytest.mark.parametrize('period', [4.0, 4.8, 1.0, 0.3, 1 / 3, 2.5, 1e-3, 240 / 59.94])
def test_what_is_periodic_is_due_at_the_last_step_before_its_time(period):
    """Once a period, at the start too, and never twice after the same step."""
    done = []
    one = Periodic(lambda: done.append(one.due), period)
    while one.due <= 1000:
        one.do()
    times = np.floor(np.arange(0, 1001 / period) * period + 1e-6)
    assert done == [step for step in np.unique(times).astype(int).tolist() if step <= 1000]


def test_a_recording_holds_what_there_was(scene, tmp_path):
    """Its particles are the states of --every, bit for bit; all topics are there."""
    bag, states = tmp_path / 'out.mcap', tmp_path / 'states.npz'
    assert cli.main(['run', scene, '--duration', '0.5', '--record', str(bag), '--topics', ALL,
                     '--rate', '50', '--out', str(states), '--every', '0.02',
                     '--frame-id', 'map']) == 0
    states, messages = np.load(states), read_messages(bag)
    assert states['position'].shape == states['velocity'].shape == (26, 30, 3)
    steps = np.floor(np.arange(26) * 4.8 + 1e-6)        # of 1/240 s, every 0.02 s
    np.testing.assert_allclose(states['time'], steps / 240, rtol=1e-15)
    assert {topic: len(found) for topic, found in messages.items()} == dict.fromkeys(TOPICS, 26)
    for k, (received, message) in enumerate(messages['/collision_sim/particles']):
        seconds, nanoseconds, frame, poses = read_pose_array(message)
        assert seconds * SECOND + nanoseconds == received == round(states['time'][k] * SECOND)
        assert frame == 'map'
        np.testing.assert_array_equal(poses[:, :3], states['position'][k])
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        'out.mcap', 'small.yaml', 'states.npz']


def test_a_recording_says_what_its_messages_are(scene, tmp_path):
    """Types and definitions are in the file; rosbags takes every message apart by them."""
    bag = str(tmp_path / 'out.mcap')
    assert cli.main(['run', scene, '--duration', '0.2', '--record', bag, '--topics', ALL]) == 0
    with Reader(bag) as reader:
        assert {c.topic: c.msgtype for c in reader.connections} == TOPICS
        assert all('MSG: std_msgs/Header' in c.msgdef.data for c in reader.connections)
        kept = {c.topic for c in reader.connections for qos in c.ext.offered_qos_profiles
                if qos.durability == QosDurability.TRANSIENT_LOCAL}
        assert kept == {'/collision_sim/colliders'}
        found = {}
        for connection, _, data in reader.messages():
            message = TYPES.deserialize_cdr(data, connection.msgtype)
            found.setdefault(connection.topic.split('/')[-1], []).append(message)
    assert len(found['particles'][-1].poses) == found['cloud'][-1].width == 30
    assert {marker.ns for marker in found['colliders'][-1].markers} == {
        f'colliders/{name}' for name in ('ground', 'walls', 'ball', 'rotor', 'paddle')}
    turns = [marker.pose.orientation.z for message in found['colliders']
             for marker in message.markers if marker.ns == 'colliders/rotor']
    assert np.all(np.diff(turns) > 0.0)
    assert any(len(message.markers[0].points) for message in found['contacts'])


def test_colliders_that_stand_still_are_written_once(tmp_path):
    """As the node does, which keeps that message for those who come later."""
    path = tmp_path / 'still.yaml'
    path.write_text('particles: {position: [[0, 0, 1]]}\nrestitution: 0.5\n'
                    'friction: {dry: 0.0, wet: 0.0}\n'
                    'colliders: [{name: ground, shape: plane}]\nstepping: {dt: 0.001}\n')
    bag = str(tmp_path / 'out.mcap')
    assert cli.main(['run', str(path), '--duration', '0.1', '--record', bag,
                     '--topics', 'particles,colliders']) == 0
    messages = read_messages(bag)
    assert len(messages['/collision_sim/colliders']) == 1
    assert len(messages['/collision_sim/particles']) == 7


def test_csv_of_states_over_time(scene, tmp_path):
    """A row a particle and time, with the numbers of the .npz."""
    csv_path, npz_path = tmp_path / 'states.csv', tmp_path / 'states.npz'
    for path in (csv_path, npz_path):
        assert cli.main(['run', scene, '--duration', '0.1', '--out', str(path),
                         '--every', '0.03']) == 0
    with open(csv_path, newline='') as file:
        head, *rows = csv.reader(file)
    assert head == ['time', 'particle', 'x', 'y', 'z', 'vx', 'vy', 'vz']
    rows, states = np.array(rows, dtype=float), np.load(npz_path)
    np.testing.assert_array_equal(rows[:, 0], np.repeat(states['time'], 30))
    np.testing.assert_array_equal(rows[:, 1], np.tile(np.arange(30), 4))
    np.testing.assert_array_equal(rows[:, 2:5], states['position'].reshape(-1, 3))
    np.testing.assert_array_equal(rows[:, 5:], states['velocity'].reshape(-1, 3))


@pytest.mark.parametrize('words, said', [
    (['--every', '0.1'], '--every: 0.1: must come with --out'),
    (['--record', 'there.mcap'], "--record: 'there.mcap': must not be a folder"),
    (['--record', 'killed.mcap'], "--record: 'killed.mcap.draft': must not be there"),
])
def test_what_a_run_refuses(words, said, scene, tmp_path, monkeypatch, capsys):
    """Exit code 2 and the reason; nothing is written or overwritten."""
    monkeypatch.chdir(tmp_path)
    for name in ('there.mcap', 'killed.mcap.draft'):
        (tmp_path / name).mkdir()
    before = sorted(tmp_path.iterdir())
    assert cli.main(['run', scene, '--duration', '0.1', *words]) == 2
    assert capsys.readouterr().err.startswith(f'collision_sim: {said}')
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize('words', [
    ['--record', 'out.bag'], ['--record', '/no/such/folder/out.mcap'], ['--topics', 'particle'],
    ['--rate', '0'], ['--rate', 'nan'], ['--every', '0'], ['--pose-delay', '-1'],
    ['--pose-timeout', '61']], ids=' '.join)
def test_options_that_are_refused(words, capsys):
    """As argparse does: exit code 2 and the option."""
    with pytest.raises(SystemExit) as stop:
        cli.main(['run', 'demo', *words])
    assert stop.value.code == 2
    assert f'argument {words[0]}' in capsys.readouterr().err


@pytest.mark.parametrize('option', ['--record', '--poses'])
def test_without_rosbags(option, monkeypatch, capsys):
    """Says what to install."""
    monkeypatch.setattr('collision_sim.recording.find_spec', lambda name: None)
    assert cli.main(['run', 'demo', option, 'out.mcap']) == 2
    assert capsys.readouterr().err == (f"collision_sim: {option}: 'rosbags': must be installed: "
                                       "pip install 'collision_sim[record]'\n")


# --- interruptions ---------------------------------------------------------------------------


@pytest.fixture
def start(scene, tmp_path):
    """Start an endless run in a process; give it and its output files when it has written."""
    running = []

    def run(*words):
        process = subprocess.Popen(
            [sys.executable, '-m', 'collision_sim.cli', 'run', scene, '--duration', '1e6',
             '--rate', '240', '--record', 'out.mcap', *words],
            cwd=tmp_path, env={**os.environ, 'PYTHONPATH': str(ROOT)}, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        running.append(process)
        draft = tmp_path / 'out.mcap.draft' / 'out.mcap.draft.mcap'
        end = time.monotonic() + PATIENCE
        while not draft.exists() or draft.stat().st_size < 100_000:
            assert process.poll() is None and time.monotonic() < end, process.communicate()
            time.sleep(0.02)
        time.sleep(random.uniform(0.0, 0.5))
        return process, tmp_path / 'out.mcap', draft

    yield run
    for process in running:
        process.kill()
        process.communicate()


@pytest.mark.jit
def test_a_full_disk(scene, tmp_path):
    """The reason and the draft, which stays; a limit of the size of a file stands for the disk."""
    process = subprocess.run(
        [sys.executable, '-m', 'collision_sim.cli', 'run', scene, '--duration', '1e6',
         '--record', 'out.mcap', '--topics', 'particles'],
        cwd=tmp_path, env={**os.environ, 'PYTHONPATH': str(ROOT)}, capture_output=True, text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (4_000_000, 4_000_000)))
    assert process.returncode == 2
    assert process.stderr == "collision_sim: [Errno 27] File too large: 'out.mcap.draft'\n"
    assert (tmp_path / 'out.mcap.draft').exists() and not (tmp_path / 'out.mcap').exists()


def whole_steps(messages):
    """Check that the messages are those of steps 0, 1, 2, ... on each topic; how many steps."""
    counts = {len(found) for found in messages.values()}
    for found in messages.values():
        expected = [round(k / 240 * SECOND) for k in range(len(found))]
        assert [received for received, _ in found] == expected
    return min(counts), max(counts)


@pytest.mark.parametrize('signals', [[signal.SIGINT], [signal.SIGTERM], [signal.SIGINT] * 2],
                         ids=['SIGINT', 'SIGTERM', 'SIGINT twice'])
def test_an_interrupted_run_leaves_what_it_has(start, signals):
    """The bag holds every message up to the time that is printed, the table every state."""
    process, bag, draft = start('--out', 'states.csv', '--every', '0.1')
    for number in signals:
        process.send_signal(number)
        time.sleep(random.uniform(0.0, 0.01))
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 128 + signals[0] and 'Traceback' not in err
    steps = int(re.search(r'in (\d+) steps', out)[1])
    assert whole_steps(read_messages(bag)) == (steps + 1, steps + 1)
    assert not draft.parent.exists()
    rows = (bag.parent / 'states.csv').read_text().splitlines()
    assert len(rows) == 1 + 30 * (steps // 24 + 1)


def test_a_killed_run_leaves_a_readable_file(start):
    """The messages are there but for those of the last part, which had not been written."""
    process, bag, draft = start()
    size = draft.stat().st_size
    while draft.stat().st_size == size:     # a part is being written: that is not the moment
        time.sleep(1e-3)
    time.sleep(0.03)
    process.kill()
    process.wait()
    fewest, most = whole_steps(read_messages(draft))
    assert most - fewest <= 1 and fewest > 100 and not bag.exists()
