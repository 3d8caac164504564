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

"""The command line: help, errors of the user, exit codes, and `run`."""

import csv
import os
import signal
import subprocess
import sys

from collision_sim import cli
from collision_sim.studies import run as run_module
import numpy as np
import pytest

SCENE = """\
particles: {position: [[0, 0, 1], [0.5, 0, 2]], velocity: [1, 0, 0]}
restitution: 0.5
friction: {dry: 0.0, wet: 0.0}
colliders: [{name: ground, shape: plane}]
stepping: {dt: 0.001}
"""


@pytest.fixture
def scene(tmp_path):
    """Give the path of a small scene."""
    path = tmp_path / 'my.yaml'
    path.write_text(SCENE)
    return str(path)


@pytest.mark.parametrize('command', [[], *([name] for name in cli.COMMANDS)],
                         ids=lambda command: ' '.join(command) or 'all')
def test_help(command, capsys):
    """Each help names the program, says what there is and has an example."""
    with pytest.raises(SystemExit) as stop:
        cli.main([*command, '--help'])
    assert stop.value.code == 0
    out = capsys.readouterr().out
    assert out.startswith(' '.join(['usage: collision_sim', *command]))
    assert 'example' in out


def test_help_loads_no_subcommand():
    """`--help` needs no Numba, no tqdm and no matplotlib, so it is quick."""
    code = ('import sys; from collision_sim import cli\n'
            'try: cli.main(["--help"])\nexcept SystemExit: pass\n'
            'print([name for name in ("numba", "tqdm", "matplotlib") if name in sys.modules])')
    out = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert out.stdout.endswith('[]\n')


@pytest.mark.parametrize('words', [[], ['fly'], ['run'], ['run', 'demo', '--duration', '-1'],
                                   ['run', 'demo', '--out', 'state.txt'],
                                   ['run', 'demo', '--out', '/no/such/folder/state.npz']])
def test_words_that_are_refused(words, capsys):
    """Exit code 2 and what is wrong, as argparse does."""
    with pytest.raises(SystemExit) as stop:
        cli.main(words)
    assert stop.value.code == 2
    assert 'error:' in capsys.readouterr().err


@pytest.mark.parametrize('command', [['run'], ['report', '--quick'], ['advise', '--error', '1']],
                         ids=lambda command: command[0])
@pytest.mark.parametrize('text', [None, 'restitution: 2\n', 'particles: [\n', ''])
def test_scene_that_is_not_as_it_should_be(command, text, tmp_path, capsys, monkeypatch):
    """A missing or bad scene: one line on stderr, exit code 2, no traceback."""
    monkeypatch.chdir(tmp_path)
    if command[0] == 'report':
        pytest.importorskip('matplotlib')
    path = tmp_path / 'my.yaml'
    if text is not None:
        path.write_text(text)
    assert cli.main([*command, str(path)]) == 2
    err = capsys.readouterr().err
    assert err.startswith('collision_sim: ') and 'Traceback' not in err
    assert len(err.strip().splitlines()) == 1


def test_run_says_what_happened(scene, capsys):
    """1 s of two drops: counters, energy and time; free fall until the first hit."""
    assert cli.main(['run', scene, '--duration', '0.3']) == 0
    out = capsys.readouterr().out
    for name in ('particles         2', 'simulated time    0.3 s in 300 steps', 'real-time factor',
                 'energy', 'collisions        0'):
        assert name in out


@pytest.mark.parametrize('suffix', ['npz', 'csv'])
def test_run_writes_the_state(scene, suffix, tmp_path):
    """Positions and velocities at the end: x = x0 + v t, z = z0 - g t^2 / 2."""
    path = tmp_path / f'state.{suffix}'
    assert cli.main(['run', scene, '--duration', '0.3', '--out', str(path)]) == 0
    if suffix == 'npz':
        state = np.load(path)
        position, velocity = state['position'], state['velocity']
        assert state['time'] == pytest.approx(0.3)
    else:
        with open(path, newline='') as file:
            head, *rows = csv.reader(file)
        assert head == ['x', 'y', 'z', 'vx', 'vy', 'vz']
        position, velocity = np.split(np.array(rows, dtype=float), 2, axis=1)
    fall = 0.5 * 9.81 * 0.3 ** 2
    np.testing.assert_allclose(position, [[0.3, 0, 1 - fall], [0.8, 0, 2 - fall]], atol=1e-12)
    np.testing.assert_allclose(velocity, [[1.0, 0.0, -9.81 * 0.3]] * 2, atol=1e-12)


def test_run_of_a_shard(scene, tmp_path, capsys):
    """The second of two shards has the second particle; a third one is refused."""
    path = tmp_path / 'state.npz'
    words = ['run', scene, '--duration', '0.3', '--out', str(path), '--shard']
    assert cli.main([*words, '2/2']) == 0
    assert 'particles         1\n' in capsys.readouterr().out
    np.testing.assert_allclose(np.load(path)['position'][0, :2], [0.8, 0.0], atol=1e-12)
    for shard in ('3/2', 'two', ''):
        assert cli.main([*words, shard]) == 2
        err = capsys.readouterr().err
        assert err == f'collision_sim: shard: {shard!r}: must be k/n with k from 1 to n\n'


@pytest.fixture
def signals():
    """Restore what signals do after a test that ends a run by one."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_in_a_run(number, scene, signals, tmp_path, monkeypatch, capsys):
    """It ends the run: what there is is printed and written; exit code 128 and its number."""
    step = run_module.Simulation.step

    def interrupted(self, n=1):
        if 0.1 < self.time < 0.11:
            os.kill(os.getpid(), number)
        step(self, n)
    monkeypatch.setattr(run_module.Simulation, 'step', interrupted)
    path = tmp_path / 'state.npz'
    assert cli.main(['run', scene, '--duration', '0.5', '--out', str(path)]) == 128 + number
    assert 'simulated time    0.1' in capsys.readouterr().out
    assert 0.1 < np.load(path)['time'] < 0.2


def test_ctrl_c_elsewhere(scene, monkeypatch, capsys):
    """An interrupt while a scene is read: exit code 130, no traceback."""
    def interrupted(name):
        raise KeyboardInterrupt
    monkeypatch.setattr(run_module, 'load_scene', interrupted)
    assert cli.main(['run', scene]) == 130
    assert capsys.readouterr().err == 'collision_sim: interrupted\n'


@pytest.mark.parametrize(('words', 'said'), [
    (['--duration', '1e308'], '--duration: 1e+308: must be at most 1e+12 s'),
    (['--out', 'x.csv', '--every', '1e-300'], '--every: 1e-300: must be at least a step, 0.001 s'),
    (['--out', 'x.csv', '--every', '1e-4'], '--every: 0.0001: must be at least a step, 0.001 s')])
def test_durations_without_bounds(words, said, scene, tmp_path, monkeypatch, capsys):
    """What would never end, or fill the disk, is refused before there is a file."""
    monkeypatch.chdir(tmp_path)
    assert cli.main(['run', scene, *words]) == 2
    assert capsys.readouterr().err.startswith(f'collision_sim: {said}')
    assert not (tmp_path / 'x.csv').exists()


def test_too_little_memory(scene, monkeypatch, capsys):
    """Exit code 2 and what NumPy says, no traceback."""
    def full(self, n=1):
        raise MemoryError('Unable to allocate 9 TiB')
    monkeypatch.setattr(run_module.Simulation, 'step', full)
    assert cli.main(['run', scene]) == 2
    assert capsys.readouterr().err == (
        'collision_sim: not enough memory: Unable to allocate 9 TiB\n')


def test_no_steps(tmp_path, capsys):
    """A scene with dt = 0 stands still, and says so."""
    path = tmp_path / 'still.yaml'
    path.write_text(SCENE.replace('0.001', '0.0'))
    assert cli.main(['run', str(path)]) == 0
    assert 'simulated time    0 s in 0 steps' in capsys.readouterr().out


def test_warnings_about_a_scene_take_a_line(tmp_path, capsys):
    """What is left out of a mesh is said as an error would be, and the run goes on."""
    (tmp_path / 'a.obj').write_text('v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 2\n')
    (tmp_path / 'a.yaml').write_text('colliders: [{name: a, shape: mesh, file: a.obj}]')
    assert cli.main(['run', str(tmp_path / 'a.yaml'), '--duration', '0.01']) == 0
    assert capsys.readouterr().err == (
        "collision_sim: warning: colliders.a.file: 'a.obj': 1 faces without area are left out; "
        'the first is 1\n')
