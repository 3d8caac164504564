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

"""The report from end to end on a small refinement, and its parts on rows made by hand."""

import csv
from math import inf, nan

from collision_sim import cli
from collision_sim import scene as scenes
from collision_sim.processes import start
from collision_sim.studies import figures, own_scene, refinement, report, warming
from collision_sim.studies.cases import all_cases
from collision_sim.studies.errors import Row, SAMPLES, Setting
from collision_sim.studies.orders import fits
from collision_sim.studies.refinement import Extent, geometric, steps_of, Table
from collision_sim.studies.summary import agrees, summary
import numpy as np
import pytest

pytest.importorskip('matplotlib')

TINY = Extent(16, (9, 21, 52), 1)
WAY = Setting('collision_then_contact', 'end_of_step', 'ballistic')
FEW = (WAY, WAY._replace(method='single_pass'))
SCENE = """\
particles: {position: [[0, 0, 0.2], [0.1, 0, 0.31]], velocity: [0.3, 0, 0]}
restitution: 0.6
friction: {dry: 0.0, wet: 0.0}
colliders:
  - {name: ground, shape: plane}
  - {name: ball, shape: sphere, radius: 1, position: [0, 0, -100]}
stepping: {dt: 0.01}
"""


def a_row(name='bounce', setting=WAY, dt=0.01, error=0.01, run_time=1e-6, failure=''):
    """Make a row by hand."""
    return Row(name, *setting, 16, dt, 24, error, error, 0.0, 0.0, run_time, run_time * dt, 3,
               failure)


@pytest.fixture
def tiny(monkeypatch):
    """Make the refinement small: three cases, two ways to step, three dt; compiled here only."""
    wanted = ('bounce', 'incline_slide', 'incline_stick')
    monkeypatch.setattr(report, 'all_cases', lambda count: [
        case for case in all_cases(count) if case.name in wanted])
    monkeypatch.setattr(report, 'QUICK', TINY)
    monkeypatch.setattr(refinement, 'settings', lambda case: list(FEW))
    monkeypatch.setattr(refinement, 'compile_kernels', lambda ways: None)


def read(path):
    """Read the table that was written."""
    with open(path, newline='') as file:
        return list(csv.DictReader(file))


@pytest.mark.jit
def test_report_from_end_to_end(tiny, tmp_path, capsys):
    """Bounces are of order 1, slides exact, and the stick creeps with the first method only."""
    assert cli.main(['report', '--quick', '--out', str(tmp_path)]) == 0
    rows = read(tmp_path / 'errors.csv')
    assert len(rows) == 3 * len(FEW) * len(TINY.steps)
    assert list(rows[0]) == list(Row._fields)
    for name in ('bounce', 'incline_slide', 'incline_stick'):
        assert (tmp_path / f'{name}.png').read_bytes().startswith(b'\x89PNG')
    text = (tmp_path / 'summary.md').read_text()
    assert '6 of 6 fitted orders are those of theory within 0.15.' in text
    assert 'summary.md' in capsys.readouterr().out
    slides = [float(row['error']) for row in rows if row['scene'] == 'incline_slide']
    assert max(slides) < 1e-12
    stuck = {row['method']: float(row['error']) for row in rows if row['scene'] == 'incline_stick'}
    assert stuck['collision_then_contact'] == 0.0 < stuck['single_pass']


@pytest.mark.jit
def test_ctrl_c_keeps_what_is_done(tiny, tmp_path, monkeypatch):
    """After four rows an interrupt: four rows in the file, a figure, a summary, exit code 130."""
    measure, done = refinement.measure, []

    def interrupted(*arguments):
        if len(done) == 4:
            raise KeyboardInterrupt
        done.append(measure(*arguments))
        return done[-1]
    monkeypatch.setattr(refinement, 'measure', interrupted)
    assert cli.main(['report', '--quick', '--out', str(tmp_path)]) == 130
    assert len(read(tmp_path / 'errors.csv')) == 4
    assert [path.name for path in tmp_path.glob('*.png')] == ['bounce.png']
    text = (tmp_path / 'summary.md').read_text()
    assert 'Bounce train' in text and 'Slide down' not in text


def test_ctrl_c_before_the_first_row(tiny, tmp_path, monkeypatch):
    """An interrupt at once leaves a table without rows and a summary without scenes."""
    def interrupted(*arguments):
        raise KeyboardInterrupt
    monkeypatch.setattr(refinement, 'measure', interrupted)
    monkeypatch.setattr(refinement, 'refusal', lambda *arguments: '')
    assert cli.main(['report', '--quick', '--out', str(tmp_path)]) == 130
    assert read(tmp_path / 'errors.csv') == []
    assert list(tmp_path.glob('*.png')) == []
    assert (tmp_path / 'summary.md').is_file()


def test_rows_are_written_at_once(tmp_path):
    """A row can be read from the file as soon as it is added."""
    table = Table(tmp_path / 'errors.csv')
    table.add(a_row(error=0.25))
    assert [row['error'] for row in read(tmp_path / 'errors.csv')] == ['0.25']


def test_a_refused_way_is_said_to_be(tiny, tmp_path, monkeypatch):
    """A way to step that the scene refuses has no rows, and its reason is in the summary."""
    monkeypatch.setattr(refinement, 'refusal', lambda scene, setting: 'method: too hard')
    assert cli.main(['report', '--quick', '--out', str(tmp_path)]) == 0
    assert read(tmp_path / 'errors.csv') == []
    table = Table()
    case = all_cases(16)[0]
    table.refusals[case.name, WAY] = 'method: too hard'
    table.add(a_row(case.name, FEW[1]))
    assert f'{WAY.label} does not apply: method: too hard' in summary([case], table)


@pytest.mark.jit
def test_own_scene(tiny, tmp_path):
    """The summary of a user's scene says what the reference is; the bounces are of order 1."""
    (tmp_path / 'my.yaml').write_text(SCENE)
    out = tmp_path / 'out'
    assert cli.main(['report', str(tmp_path / 'my.yaml'), '--quick', '--duration', '0.5',
                     '--out', str(out)]) == 0
    rows = read(out / 'errors.csv')
    assert {row['scene'] for row in rows} == {'my'}
    assert 'The reference is ' in (out / 'summary.md').read_text()
    errors = [float(row['error']) for row in rows if row['method'] == WAY.method]
    assert errors[-1] < 0.5 * errors[0] < 0.05
    assert (out / 'my.png').is_file()


def test_converged_reference(tmp_path, monkeypatch):
    """Without the exact method a fine run is the reference, and bounds its own error."""
    monkeypatch.setattr(own_scene, 'METHODS', ('single_pass', 'collision_then_contact'))
    (tmp_path / 'my.yaml').write_text(SCENE)
    case, scene = own_scene.own_case(str(tmp_path / 'my.yaml'), 0.5, 8)
    assert 'converged run (collision_then_contact, trajectory, ballistic' in case.why
    assert 0.0 < case.uncertainty < 4.0 * 2.5 * case.duration / (SAMPLES * 8 * 8)
    assert len(scene.particles.position) == 2
    position, _ = case.reference(None)
    height = scene.particles.position[:, 2]         # before the first hit it is a free fall
    first = case.duration / SAMPLES
    np.testing.assert_allclose(position[0, :, 2], height - 0.5 * 9.81 * first ** 2, atol=1e-12)


@pytest.mark.jit
def test_exact_reference(tmp_path):
    """The exact method as the reference is right to rounding, by the closed form of a bounce."""
    if 'exact' not in scenes.METHODS:
        pytest.skip('no such method yet')
    (tmp_path / 'my.yaml').write_text(SCENE)
    case, _ = own_scene.own_case(str(tmp_path / 'my.yaml'), 0.4, 8)
    assert 'The reference is the exact method' in case.why
    assert case.uncertainty < 1e-12
    fall, late = np.sqrt(2.0 * 0.2 / 9.81), 0.4     # before the second hit
    up = 0.6 * 9.81 * fall
    expected = up * (late - fall) - 0.5 * 9.81 * (late - fall) ** 2
    assert case.reference(None)[0][-1, 0, 2] == pytest.approx(expected, abs=1e-12)


def test_of_many_particles_some_are_chosen(tmp_path):
    """A scene of 1000 particles is compared on MOST of them, from first to last."""
    (tmp_path / 'many.yaml').write_text(
        'particles: {count: 1000, box: {min: [0, 0, 1], max: [1, 1, 2]}, seed: 3}\n')
    mapping, scene = own_scene.read(str(tmp_path / 'many.yaml'))
    chosen = np.array(mapping['particles']['position'])
    assert len(chosen) == own_scene.MOST == len(mapping['particles']['mass'])
    np.testing.assert_array_equal(chosen[[0, -1]], scene.particles.position[[0, -1]])


def test_refinement_is_over_three_decades():
    """The full refinement covers more than three decades of dt, and the quick one 1.5."""
    for extent, decades in ((refinement.FULL, 3.0), (refinement.QUICK, 1.5)):
        assert np.log10(max(extent.steps) / min(extent.steps)) > decades
        assert list(extent.steps) == sorted(set(extent.steps))
    assert geometric(1, 8, 4) == (1, 2, 4, 8)


def test_exact_is_swept_over_few_dt():
    """The error of `exact` does not depend on dt: a few are enough."""
    assert steps_of(WAY._replace(method='exact'), refinement.FULL) == refinement.EXACT_STEPS
    assert steps_of(WAY, refinement.FULL) == refinement.FULL.steps


@pytest.mark.parametrize(('order', 'theory', 'answer'), [
    (1.1, 1.0, True), (1.2, 1.0, False), (inf, inf, True), (inf, 1.0, False), (2.0, inf, False),
    (None, 1.0, None), (1.0, None, None)])
def test_agreement(order, theory, answer):
    """Orders agree within 0.15, or if both are rounding."""
    assert agrees(order, theory) is answer


def test_orders_leave_out_failures():
    """Failed runs have no part in the fit, wherever their error lies."""
    case = all_cases(16)[0]
    rows = [a_row(dt=dt, error=0.1 * dt) for dt in (1e-2, 3e-3, 1e-3, 3e-4)]
    rows.append(a_row(dt=1e-4, error=0.019, failure='3 of 16 lost'))
    (order, end), = fits([case], rows).values()
    assert order == pytest.approx(1.0, abs=1e-12) == end


def test_summary_names_failures():
    """A failure is in the table with its dt, and a wrong order is marked."""
    case, table = all_cases(16)[0], Table()
    for dt in (1e-2, 3e-3, 1e-3, 3e-4):
        table.add(a_row(dt=dt, error=10.0 * dt ** 2))
    table.add(a_row(dt=0.05, error=nan, failure='not finite'))
    text = summary([case], table)
    assert 'dt = 0.05 s: not finite' in text
    assert '2.00 **≠**' in text
    assert '0 of 1 fitted orders are those of theory' in text


def test_failures_are_drawn(tmp_path, monkeypatch):
    """A failed run is a cross at its error, or at the upper edge where that is not a number."""
    from matplotlib.axes import Axes
    drawn, plot = [], Axes.plot

    def record(self, *arguments, **keys):
        drawn.append((arguments, keys))
        return plot(self, *arguments, **keys)
    monkeypatch.setattr(Axes, 'plot', record)
    rows = [a_row(dt=dt, error=0.1 * dt, run_time=1e-8 / dt) for dt in (1e-2, 3e-3, 1e-3)]
    rows.append(a_row(dt=0.05, error=0.4, run_time=2e-7, failure='3 of 16 lost'))
    rows.append(a_row(dt=0.1, error=nan, run_time=1e-7, failure='not finite'))
    figures.draw(tmp_path / 'bounce.png', all_cases(16)[0], rows)
    crosses = [(x, y) for (x, y, *_), keys in drawn if keys.get('marker') == 'x']
    assert [(pytest.approx(0.2), 0.4), (pytest.approx(0.1), 0.98)] == sorted(crosses, reverse=True)
    assert (tmp_path / 'bounce.png').stat().st_size > 10_000


def test_without_matplotlib(tmp_path, monkeypatch):
    """Nothing is measured where the figures could not be drawn; the message says what to do."""
    monkeypatch.setattr(figures, 'find_spec', lambda name: None)
    with pytest.raises(SystemExit) as stop:
        cli.main(['report', '--out', str(tmp_path / 'out')])
    assert "pip install 'collision_sim[report]'" in str(stop.value.code)
    assert not (tmp_path / 'out').exists()


@pytest.mark.jit
def test_compiling_in_another_process():
    """A process steps each scene that it is given once, and says when it is done."""
    scene = all_cases(16)[0].scene
    worker = start('collision_sim.studies.warming', [(scene, WAY), (scene, FEW[1])])
    try:
        assert [worker.stdout.readline().strip() for _ in range(2)] == [b'done', b'done']
        assert worker.wait() == 0
    finally:
        worker.kill()
        worker.wait()
        worker.stdin.close()
        worker.stdout.close()


def test_kernels_are_told_apart():
    """Motion, pairs, meshes and some ways to step need modules; drag and more passes do not."""
    bounce, oblique, wall, drag, *_ = all_cases(16)
    assert len({warming.kernel(case, WAY) for case in (bounce, oblique, drag)}) == 1
    assert warming.kernel(bounce, FEW[1]) == warming.kernel(bounce, WAY)
    pairs, mesh = (bounce._replace(scene={**bounce.scene, **more}) for more in (
        {'pairs': {}}, {'colliders': [{'shape': 'mesh'}]}))
    needed = [warming.kernel(case, WAY) for case in (bounce, wall, pairs, mesh)] + [
        warming.kernel(bounce, WAY._replace(**way)) for way in (
            {'method': 'exact'}, {'method': 'second_order_contact'}, {'detection': 'trajectory'})]
    assert len(set(needed)) == len(needed)
