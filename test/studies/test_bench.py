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

"""`collision_sim bench`: the works are those described, the tables are whole; nothing is timed."""

import argparse
import csv
import json

from collision_sim import cli, Scene, Simulation
from collision_sim.studies import bench, bench_features, bench_machine, bench_peers, bench_works
from collision_sim.studies.bench_peers import Code, OWN, Row
from collision_sim.studies.bench_report import peer_table, remarks, Report
from collision_sim.studies.bench_tables import aligned, figure, size
from collision_sim.studies.bench_works import WORKS
from collision_sim.studies.peers import of_numpy, of_own, worker
from collision_sim.studies.peers.job import Job, Unable
import numpy as np
import pytest

MISSING = Code('missing', 'no_such_toolkit', 'of_nothing')


def job(work, count, folder):
    """Give a work for one thread."""
    return Job(work, WORKS[work].scene(count, folder), 1, '')


def touched(scene, steps, count):
    """Give the particles in contact in each step, as shares."""
    sim = Simulation(scene)
    shares = []
    for _ in range(steps):
        sim.step()
        shares.append(len(np.unique(sim.contacts.particle)) / count)
    return np.array(shares)


@pytest.mark.jit
def test_contacts_of_work_1_are_sparse(tmp_path):
    """Of the comparison in the field: 0.042 contacts a particle-step, on all three colliders."""
    scene = WORKS['1'].scene(2000, tmp_path)
    assert 0.036 < touched(scene, WORKS['1'].steps, 2000).mean() < 0.048
    sim, met = Simulation(scene), set()
    for _ in range(WORKS['1'].steps):
        sim.step()
        met |= set(sim.contacts.collider.tolist())
    assert met == {0, 1, 2}
    assert sim.counters['fail_safes'] == sim.counters['unplaced'] == 0


def test_work_1_starts_outside(tmp_path):
    """Points start outside of all colliders, and the peers place the box as the scene moves it."""
    scene = WORKS['1'].scene(500, tmp_path)
    sim = Simulation(scene)
    assert sim.clearance().min() > 0.0
    poses = bench_works.block_poses(12)
    sim.step(12)
    position, orientation = sim.collider_pose('block')
    np.testing.assert_allclose(position, poses[-1, :3], atol=1e-12)
    np.testing.assert_allclose(2.0 * orientation[2] * orientation[3], poses[-1, 4], atol=1e-12)


@pytest.mark.parametrize('work', ['1-rest', '1-slide'])
def test_every_particle_is_in_contact(work, tmp_path):
    """At rest, or sliding all the time: v = v0 - mu g t, x = v0 t - mu g t^2 / 2."""
    count, steps = 20, 60
    scene = WORKS[work].scene(count, tmp_path)
    assert (touched(scene, steps, count) == 1.0).all()
    sim, time = Simulation(scene), steps * bench_works.DT
    start = sim.position.copy()
    sim.step(steps)
    speed = bench_works.SLIDING if work == '1-slide' else 0.0
    slowing = bench_works.FRICTION * bench_works.GRAVITY if speed else 0.0
    np.testing.assert_allclose(sim.velocity, [[speed - slowing * time, 0.0, 0.0]] * count,
                               atol=1e-12)
    way = speed * time - 0.5 * slowing * time ** 2
    np.testing.assert_allclose(sim.position - start, [[way, 0.0, 0.0]] * count,
                               atol=slowing * time * bench_works.DT)
    assert speed >= slowing * WORKS[work].steps * bench_works.DT    # slides to the end of a run


@pytest.mark.parametrize('count', [1, 7, 27, 1000, 1001, 4321])
def test_packing(count):
    """Balls fill PACKING of their box, inside of it, and none overlaps another."""
    position, velocity, size_of_box = bench_works.pack(count)
    volume = count * 4.0 / 3.0 * np.pi * bench_works.RADIUS ** 3
    assert volume / size_of_box.prod() == pytest.approx(0.2)
    assert (np.abs(position) <= size_of_box / 2 - bench_works.RADIUS + 1e-12).all() or count < 27
    apart = np.linalg.norm(position[:, None] - position[None, :300], axis=2)
    apart[np.arange(min(count, 300)), np.arange(min(count, 300))] = np.inf
    assert apart.min() >= 2.0 * bench_works.RADIUS - 1e-12
    np.testing.assert_allclose(np.linalg.norm(velocity, axis=1), bench_works.SPEED)


def test_torus(tmp_path):
    """5000 triangles, closed and turned outwards: the volume is that of its polygons."""
    points, triangles = bench_works.torus()
    assert len(triangles) == 5000
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    assert len(np.unique(edges, axis=0)) == len(edges)
    assert {*map(tuple, edges.tolist())} == {*map(tuple, edges[:, ::-1].tolist())}
    volume = np.linalg.det(points[triangles]).sum() / 6.0
    exact = 2.0 * np.pi ** 2 * bench_works.RING * bench_works.TUBE ** 2
    assert 0.98 * exact < volume < exact
    bench_works.write_torus(tmp_path / 'torus.obj')
    lines = (tmp_path / 'torus.obj').read_text().split('\n')
    assert [sum(line.startswith(key) for line in lines) for key in 'vf'] == [2500, 5000]


@pytest.mark.jit
def test_a_quarter_is_near_the_torus(tmp_path):
    """About a quarter of the particle-steps of work 3 are near it, and some meet it."""
    runner = of_own.runner(job('3', 500, tmp_path))
    runner.run(WORKS['3'].steps)
    assert len(runner.sim.scene.particles.position) == 500
    figures = runner.figures()
    assert 0.2 < figures['near'] < 0.3
    assert figures['contacts'] > 0.001


@pytest.mark.jit
def test_pairs_of_work_2(tmp_path):
    """Of the comparison in the field: 0.036 touching pairs a particle-step."""
    runner = of_own.runner(job('2', 1000, tmp_path))
    runner.run(WORKS['2'].steps)
    assert 0.03 < runner.figures()['contacts'] < 0.042


@pytest.mark.jit
@pytest.mark.parametrize('work', ['1', '1-rest', '1-slide', '2'])
def test_numpy_does_the_same_work(work, tmp_path):
    """Means over the particles agree within the band of the work."""
    if work == '2':
        pytest.importorskip('scipy')
    outcomes = []
    for module in (of_own, of_numpy):
        runner = module.runner(job(work, 1000, tmp_path))
        runner.run(WORKS[work].steps)
        outcomes.append(worker.outcome(runner))
        runner.begin()
        np.testing.assert_array_equal(runner.state()[0], runner.job.position)
    own, other = outcomes
    assert bench_peers.difference(other, own, WORKS[work].band) == ''


@pytest.mark.jit
def test_the_box_is_moved_as_its_script_moves_it(tmp_path):
    """Pose by pose, handed over at each step; only work 1 has a box that moves."""
    told, scripted = (of_own.runner(Job('1', WORKS['1'].scene(200, tmp_path), 1, variant))
                      for variant in ('moved', ''))
    for steps in (7, WORKS['1'].steps):
        for runner in (told, scripted):
            runner.begin()
            runner.run(steps)
        for one, other in zip(*(runner.sim.collider_pose('block') for runner in (told, scripted))):
            np.testing.assert_allclose(one, other, atol=1e-12)
    own, other = worker.outcome(scripted), worker.outcome(told)
    assert bench_peers.difference(other, own, WORKS['1'].band) == ''
    words = argparse.Namespace(quick=False, peers=None)
    assert [work for work in WORKS if bench_peers.MOVED in bench.codes_of(words, work)] == [
        '1', '1-rest', '1-slide']


def test_other_work_is_told():
    """A result outside of the band is named, with both figures; NaN is outside."""
    own = {'height': 1.0, 'drift': 0.0, 'energy': 2.0}
    assert bench_peers.difference({**own, 'height': 1.09}, own, 0.1) == ''
    assert 'mean height 1.2, not 1' in bench_peers.difference({**own, 'height': 1.2}, own, 0.1)
    assert 'energy' in bench_peers.difference({**own, 'energy': float('nan')}, own, 0.1)


def test_what_a_toolkit_cannot_do(tmp_path):
    with pytest.raises(Unable, match='meshes'):
        of_numpy.runner(Job('3', None, 1, ''))


def test_worker(tmp_path, capfd, monkeypatch):
    """A worker says how the state is after a run and then run times, or why there is none."""
    requests = iter(['\n', '\n'])
    monkeypatch.setattr(worker.sys, 'stdin', requests)
    replies = tmp_path / 'replies'
    with open(replies, 'w') as file:
        worker.serve(job('1-rest', 10, tmp_path), 'of_numpy', file)
    outcome, *times = map(json.loads, replies.read_text().splitlines())
    assert outcome['precision'] == 'f64' and outcome['height'] == 0.0
    assert len(times) == 2 and all(time > 0.0 for line in times for time in line)


def rows(code, count, best, note='', own=10.0):
    """Give a row as measured."""
    return Row('1', count, code, 'f64' if best else '', 2, 1 if best else None, 3 if best else 0,
               best, best, 0.5 if best else None, best / own if best else None, None, None, note)


def test_tables():
    """Columns line up; peers stand beside us with ratios, remarks below."""
    found = [rows(OWN.name, 1000, 10.0), rows('fast', 1000, 5.0), rows('none', 1000, None, 'why'),
             rows(OWN.name, 10000, 10.0), rows('fast', 10000, 25.0, 'differs'),
             rows('none', 10000, None, 'why')]
    table, = peer_table(found)
    lines = table.splitlines()
    assert len(lines) == 4 and len({len(line) for line in lines}) == 1
    assert '5 (0.5)' in table and '25 (2.5)*' in table
    assert remarks(found) == ['- none, 1e3, 1e4: why\n- fast, 1e4: differs']
    assert peer_table(found[::3]) == []
    report = Report()
    report.rows, report.rates = found, {2: 5e10}
    text = report.text()
    assert '## Work 1' in text and '50 GB/s' in text and '50 %' in text


@pytest.mark.parametrize(('value', 'text'), [
    (None, ''), (3.14159, '3.14'), (123456.0, '123456'), (0.04211, '0.0421')])
def test_figures(value, text):
    assert figure(value) == text


def test_sizes():
    assert [size(count) for count in (1000, 10 ** 6, 2500, 100)] == ['1e3', '1e6', '2500', '100']
    assert aligned(['a', 'bc'], [['x', '1'], ['long', '22']]).splitlines() == [
        '| a    | bc |', '| ---- | -- |', '| x    |  1 |', '| long | 22 |']


def test_missing_peers_are_reported(tmp_path):
    """A toolkit that is not installed is listed as such and takes no turns."""
    process = bench_peers.Process(MISSING, '1', 10, 1, tmp_path)
    assert not process.goes_on
    found = bench_peers.row(process, process, '1', 10, 1e9)
    assert (found.note, found.best, found.runs) == ('not installed', None, 0)
    process.close()


@pytest.mark.parametrize('code', [Code('broken', 'numpy', 'of_nothing'),
                                  Code('unable', 'numpy', 'of_numpy')])
def test_refusals_are_reported(code, tmp_path):
    """A code that fails or cannot do a work says why, in one line."""
    process = bench_peers.Process(code, '3', 10, 1, tmp_path)
    process.close()
    assert process.outcome['refused'].count('\n') == 0
    assert 'mesh' in process.outcome['refused'] or 'of_nothing' in process.outcome['refused']


def test_bandwidth():
    """Some bytes a second, from whatever size."""
    assert bench_machine.bandwidth(2, size=2 ** 16) > 0.0


def test_scenes_of_features(tmp_path):
    """All are scenes; base and neutral ones differ from the base in one feature only."""
    bench_works.write_torus(tmp_path / 'torus.obj')
    found = bench_features.features(6)
    assert len({(feature.name, feature.why) for feature in found}) == len(found)
    for feature in found:
        assert feature.state in (bench_features.NEUTRAL, bench_features.USED)
        assert len(feature.sections) + len(feature.options) in (1, 2)
        scene = Scene.from_dict({**bench_features.base(6), **feature.sections}, tmp_path)
        assert len(scene.particles.position) == 6


@pytest.mark.parametrize('words', [['--sizes', '0'], ['--sizes', '1.5'], ['--threads', 'two'],
                                   ['--works', '9'], ['--peers', 'nobody'], ['--parts', 'all']])
def test_words_that_are_refused(words, capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main(['bench', *words])
    assert stop.value.code == 2
    assert 'error:' in capsys.readouterr().err


@pytest.mark.jit
def test_quick(tmp_path, capsys, monkeypatch):
    """The command with tiny sizes: tables, files, and a missing peer with the reason."""
    monkeypatch.setattr(bench_peers, 'PEERS', (MISSING, bench_peers.PEERS[0]))
    monkeypatch.setattr(bench_machine, 'LEAST', 2 ** 16)
    monkeypatch.setattr(bench_machine, 'CACHES', 0)
    words = ['--quick', '--parts', 'works', '--works', '1', '1-rest', '--sizes', '100', '--peers',
             '--repeats', '1', '--threads', '1', '--out', str(tmp_path / 'out')]
    assert cli.main(['bench', *words]) == 0
    out = capsys.readouterr().out
    assert 'not installed' in out and 'numpy' in out and 'GB/s' in out
    assert (tmp_path / 'out' / 'bench.md').read_text().strip() == out.strip()
    with open(tmp_path / 'out' / 'bench.csv', newline='') as file:
        lines = list(csv.DictReader(file))
    assert [line['code'] for line in lines] == [OWN.name, 'missing', 'numpy'] * 2
    assert all(float(line['ratio']) > 0.0 for line in lines if line['code'] != 'missing')


@pytest.mark.jit
def test_features(tmp_path, monkeypatch):
    """A table with the base twice, and a row for each scene; a neutral feature changes nothing."""
    chosen = [feature for feature in bench_features.features(50)
              if feature.name == 'restitution']
    monkeypatch.setattr(bench_features, 'features', lambda count: chosen)
    monkeypatch.setattr(bench_features, 'compile_all', lambda rows, count, folder: None)
    found = bench_features.measure(50, 1, 1, tmp_path, steps=240)
    assert [row.feature for row in found[:2]] == [bench_features.BASE, bench_features.AGAIN]
    assert len(found) == 2 + len(chosen)
    assert found[0].ratio == 1.0
    assert found[2].contacts == found[1].contacts == found[0].contacts


@pytest.mark.jit
def test_interrupted(capsys, monkeypatch):
    """Ctrl-C: what is done is shown, exit code 130."""
    def stop(*arguments):
        raise KeyboardInterrupt
    monkeypatch.setattr(bench_peers, 'measure', stop)
    monkeypatch.setattr(bench_machine, 'bandwidth', lambda threads: 1e10)
    assert cli.main(['bench', '--parts', 'works', '--quick']) == 130
    captured = capsys.readouterr()
    assert '10 GB/s' in captured.out and 'interrupted' in captured.err


def test_a_work_that_fails_is_a_failure(capsys, monkeypatch):
    """Exit code 1 where this package could not do a work."""
    monkeypatch.setattr(bench_peers, 'measure',
                        lambda *arguments: [rows(OWN.name, 1000, None, 'why')])
    monkeypatch.setattr(bench_machine, 'bandwidth', lambda threads: 1e10)
    words = ['bench', '--parts', 'works', '--works', '1', '--sizes', '1e3']
    assert cli.main(words) == bench.FAILED
    assert '- collision_sim, 1e3: why' in capsys.readouterr().out
