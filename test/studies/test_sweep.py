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

"""`collision_sim sweep` from end to end: outcomes, interruptions, dead workers, a cluster."""

import csv
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from collision_sim import cli, Scene
from collision_sim.studies import cluster, sweep
from collision_sim.studies.outcomes import outcome, Plan, VOLATILE
import pytest

ROOT = Path(__file__).resolve().parents[2]
SCENE = """\
gravity: [0, 0, -9.81]
particles: {count: 20, box: {min: [-1, -1, 0.2], max: [1, 1, 0.6]}, velocity: {sphere: 1.0}}
restitution: 0.5
friction: {dry: 0.0, wet: 0.0}
colliders: [{name: ground, shape: plane}]
stepping: {dt: 0.01}
"""
VARIED = ['--vary', 'restitution=0.1:0.9:5', '--vary', 'gravity.2=-9.81,-1.62', '--repeat', '2',
          '--ledger']      # as all here, so that they share the compiled kernels
FEW = ['--vary', 'restitution=0.1,0.5', '--steps', '3', '--ledger']


@pytest.fixture
def scene(tmp_path):
    """Give the path of a scene."""
    path = tmp_path / 'my.yaml'
    path.write_text(SCENE)
    return str(path)


def swept(*words):
    """Sweep with the command line; the exit code."""
    return cli.main(['sweep', *map(str, words)])


def table(path):
    """Rows of a CSV table without what depends on where they were run."""
    with open(path, newline='') as file:
        return [{name: cell for name, cell in row.items() if name not in VOLATILE}
                for row in csv.DictReader(file)]


def build(particles, **sections):
    """Make a scene of particles over a ground without friction."""
    return Scene.from_dict({
        'particles': particles, 'friction': {'dry': 0.0, 'wet': 0.0},
        'colliders': [{'name': 'ground', 'shape': 'plane'}], 'stepping': {'dt': 0.01}, **sections})


def fatal_once(scene, plan):
    """Do as `outcome`; the process of the first run with restitution 0.5 dies."""
    mark = Path(os.environ['SWEEP_MARK'])
    if scene.restitution == 0.5 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return outcome(scene, plan)


def fatal(scene, plan):
    """Do as `outcome`; processes die of restitution 0.5."""
    if scene.restitution == 0.5:
        os.kill(os.getpid(), signal.SIGKILL)
    return outcome(scene, plan)


def test_outcome_of_a_fall():
    """One particle rests and one falls for 0.2 s: z = 1 - g t^2 / 2, m g, a half touches."""
    row = outcome(build({'position': [[0, 0, 0], [2, 0, 1]]}), Plan(duration=0.2, ledger=True))
    assert row['error'] is None and (row['steps'], row['particles']) == (20, 2)
    fall, speed = 9.81 * 0.2 ** 2 / 2, 9.81 * 0.2
    assert {name: row[name] for name in row if name.startswith('position')} == pytest.approx({
        'position.x.mean': 1, 'position.x.std': 1, 'position.x.min': 0, 'position.x.max': 2,
        'position.y.mean': 0, 'position.y.std': 0, 'position.y.min': 0, 'position.y.max': 0,
        'position.z.mean': (1 - fall) / 2, 'position.z.std': (1 - fall) / 2, 'position.z.min': 0,
        'position.z.max': 1 - fall}, abs=1e-14)
    assert {name: row[name] for name in ('velocity.z.min', 'speed.mean', 'speed.max', 'time',
                                         'energy.start', 'energy.end', 'momentum.end.z')
            } == pytest.approx({
                'velocity.z.min': -speed, 'speed.mean': speed / 2, 'speed.max': speed,
                'time': 0.2, 'energy.start': 9.81, 'energy.end': 9.81, 'momentum.end.z': -speed})
    assert (row['in_contact'], row['depth.max'], row['counters.contacts']) == (0.5, 0, 20)
    assert abs(row['ledger.residual']) < 1e-14 and abs(row['ledger.momentum_residual']) < 1e-14
    assert row['run_time'] > 0 and row['ns_per_particle_step'] > 0


def test_outcome_without_steps_and_without_particles():
    """With dt = 0 nothing moves: the depth is that of the start. None at all: no statistics."""
    row = outcome(build({'position': [[0, 0, -0.25], [0, 0, 1]]}, stepping={'dt': 0}), Plan(1.0))
    assert (row['depth.max'], row['steps'], row['in_contact']) == (0.25, 0, 0)
    assert not any(name.startswith('ledger') for name in row)
    row = outcome(build({'position': []}), Plan(steps=2, ledger=True))
    assert row['error'] is None and row['particles'] == 0 and 'speed.mean' not in row


def test_outcomes_that_fail():
    """What is not finite, and what the method refuses, is an outcome with its error."""
    fast = {'position': [[0, 0, 1]], 'velocity': [1e308, 0, 0]}
    row = outcome(build(fast, stepping={'dt': 10}), Plan(steps=2, ledger=True))
    assert row['error'].startswith('FloatingPointError: ') and 'frozen, 1 times' in row['error']
    assert 'speed.mean' not in row
    row = outcome(None, Plan(steps=1))
    assert row['error'].startswith('AttributeError')


def test_a_table(scene, tmp_path, capsys):
    """Rows in the order of the grid, with the values, repeat and seed; nothing else is left."""
    out = tmp_path / 'a.csv'
    assert swept(scene, *VARIED, '--steps', 3, '--out', out) == 0
    rows = table(out)
    assert [(row['restitution'], row['gravity.2'], row['repeat'], row['seed']) for row in rows] \
        == [(x, g, r, r) for x in ('0.1', '0.3', '0.5', '0.7', '0.9')
            for g in ('-9.81', '-1.62') for r in '01']
    assert {row['steps'] for row in rows} == {'3'} and {row['error'] for row in rows} == {''}
    assert rows[0]['position.x.mean'] != rows[1]['position.x.mean']
    assert capsys.readouterr().out == f'20 runs: {out}\n'
    assert sorted(path.name for path in tmp_path.iterdir()) == ['a.csv', 'my.yaml']
    assert swept(scene, *VARIED, '--steps', 3, '--out', tmp_path / 'b.csv', '--jobs', 1) == 0
    assert table(tmp_path / 'b.csv') == rows


@pytest.mark.parametrize('words, key', [
    (['--vary', 'restitution=0.5,2'], 'restitution: 2'), (['--vary', 'wind=1'], 'wind'),
    (['--vary', 'particles.velocity=[0,0,0]', '--vary', 'particles.position=[[0,0,1]]',
      '--vary', 'particles.count=null'], 'particles'),
    (['--scheduler', 'host'], "--scheduler: 'host'")])
def test_sweeps_that_are_refused(words, key, scene, tmp_path, capsys, monkeypatch):
    """One line that names the key, exit code 2, no file, and nothing was run."""
    monkeypatch.setattr(sweep, 'Pool', None)
    assert swept(scene, *words, '--out', tmp_path / 'a.csv') == 2
    error = capsys.readouterr().err
    assert error.startswith(f'collision_sim: {key}') and error.count('\n') == 1
    assert [path.name for path in tmp_path.iterdir()] == ['my.yaml']


@pytest.mark.parametrize('words', [
    ['--vary', 'a'], ['--repeat', '0'], ['--steps', '-1'], ['--out', 'a.txt'], ['--jobs', 'x'],
    ['--out', '/no/such/a.csv'], ['--jobs', '1', '--scheduler', 'tcp://a:1']])
def test_words_that_are_refused(words, scene, capsys):
    """As argparse does."""
    with pytest.raises(SystemExit) as stop:
        swept(scene, *words)
    assert stop.value.code == 2 and 'error: ' in capsys.readouterr().err


def test_repeats_that_would_be_the_same(tmp_path, capsys):
    """Refused where nothing is drawn at random."""
    (tmp_path / 'still.yaml').write_text('particles: {position: [[0, 0, 1]]}')
    assert swept(tmp_path / 'still.yaml', '--repeat', 2, '--out', tmp_path / 'a.csv') == 2
    assert '--repeat: 2' in capsys.readouterr().err


def test_a_worker_that_dies(scene, tmp_path, monkeypatch, capsys):
    """Its run is done again, and the table is that of a sweep without deaths."""
    monkeypatch.setenv('SWEEP_MARK', str(tmp_path / 'mark'))
    assert swept(scene, *FEW, '--out', tmp_path / 'a.csv') == 0
    monkeypatch.setattr(sweep, 'outcome', fatal_once)
    assert swept(scene, *FEW, '--out', tmp_path / 'b.csv') == 0
    assert (tmp_path / 'mark').exists()
    assert table(tmp_path / 'a.csv') == table(tmp_path / 'b.csv')
    monkeypatch.setattr(sweep, 'outcome', fatal)
    assert swept(scene, *FEW, '--out', tmp_path / 'c.csv', '--jobs', 1) == 1
    good, bad = table(tmp_path / 'c.csv')
    assert good == table(tmp_path / 'a.csv')[0]
    assert bad['error'].startswith('the process died (Killed)') and bad['restitution'] == '0.5'
    assert '1 of them failed' in capsys.readouterr().err


@pytest.mark.jit
def test_an_interrupted_sweep_goes_on(scene, tmp_path, capsys):
    """Ctrl-C after some runs, kill -9 after some more: the table is that of a whole sweep."""
    out, whole, kept = tmp_path / 'a.csv', tmp_path / 'whole.csv', b''
    words, journal = [scene, *VARIED, '--duration', '100'], Path(f'{out}.partial')
    assert swept(*words, '--out', whole) == 0
    for end, code, runs in ((signal.SIGINT, 130, 4), (signal.SIGKILL, -signal.SIGKILL, 8)):
        process = subprocess.Popen([sys.executable, '-m', 'collision_sim.cli', 'sweep', *words,
                                    '--jobs', '1', '--out', out],
                                   cwd=ROOT, start_new_session=True, stderr=subprocess.PIPE)
        while not journal.exists() or journal.read_bytes().count(b'\n') <= runs:
            assert process.poll() is None
            time.sleep(0.005)
        if end == signal.SIGINT:
            os.killpg(process.pid, end)         # as a terminal does
        else:
            process.kill()
        _, error = process.communicate()
        assert process.returncode == code
        assert (b'the same command goes on' in error) == (end == signal.SIGINT)
        assert b'Traceback' not in error and not out.exists()
        assert journal.read_bytes().startswith(kept)
        kept = journal.read_bytes()
        assert runs < kept.count(b'\n') < 21
    capsys.readouterr()
    assert swept(scene, *FEW, '--out', out) == 2        # another sweep
    assert '--restart' in capsys.readouterr().err and journal.read_bytes() == kept
    assert swept(*words, '--out', out) == 0
    assert table(out) == table(whole) and not journal.exists()


@pytest.fixture(scope='module')
def two_workers():
    """Give a Dask cluster on this machine: a scheduler here, two workers in processes."""
    distributed = pytest.importorskip('distributed')
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True,
                                  dashboard_address=None) as found:
        yield found


@pytest.mark.jit
def test_a_cluster_and_a_worker_that_is_killed(two_workers, scene, tmp_path, monkeypatch):
    """Killed after three runs: all rows are there, and those of a sweep on this machine."""
    words, killed, keep = [scene, *VARIED, '--duration', '20'], [], sweep.Journal.add

    def kill_after_three(journal, index, row):
        keep(journal, index, row)
        if len(journal.rows) == 3:
            os.kill(row['worker'], signal.SIGKILL)
            killed.append(row['worker'])
    assert swept(*words, '--out', tmp_path / 'a.csv') == 0
    monkeypatch.setattr(sweep.Journal, 'add', kill_after_three)
    assert swept(*words, '--out', tmp_path / 'b.csv', '--scheduler',
                 two_workers.scheduler_address) == 0
    assert table(tmp_path / 'b.csv') == table(tmp_path / 'a.csv')
    with open(tmp_path / 'b.csv', newline='') as file:
        workers = [int(row['worker']) for row in csv.DictReader(file)]
    assert 1 <= workers.count(killed[0]) < 20 and os.getpid() not in workers


@pytest.mark.jit
def test_a_cluster_that_cannot_run(two_workers, monkeypatch):
    """Another version there is refused; so is a run that Dask itself cannot do."""
    address = two_workers.scheduler_address
    with cluster.Cluster(address) as place:
        with pytest.raises(OSError, match='ZeroDivisionError'):
            list(place.each(divmod, [(0, (1, 0))]))
    monkeypatch.setattr(cluster, 'version', os.getpid)
    with pytest.raises(ValueError, match='same collision_sim'):
        cluster.Cluster(address)


def test_no_scheduler_and_no_dask(monkeypatch):
    """An address where nobody answers, and a missing library, are said in clear words."""
    monkeypatch.setattr(cluster, 'PATIENCE', 0.2)
    if cluster.find_spec('distributed'):
        with pytest.raises(OSError, match='tcp://127.0.0.1:9'):
            cluster.Cluster('tcp://127.0.0.1:9')
    monkeypatch.setattr(cluster, 'find_spec', lambda name: None)
    with pytest.raises(ValueError, match=r"pip install 'collision_sim\[sweep\]'"):
        cluster.Cluster('tcp://127.0.0.1:9')
