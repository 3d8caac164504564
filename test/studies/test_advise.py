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

"""The advice on tables made by hand, and from end to end on a small scene."""

from collision_sim import cli
from collision_sim.studies import advise, refinement
from collision_sim.studies.choice import cheapest, most_accurate
from collision_sim.studies.errors import Row, Setting
import pytest

ONE = Setting('collision_then_contact', 'end_of_step', 'ballistic')
TWO = Setting('single_pass', 'end_of_step', 'ballistic')
SCENE = """\
particles: {position: [[0, 0, 0.2], [0.1, 0, 0.31]]}
restitution: 0.6
friction: {dry: 0.0, wet: 0.0}
colliders:
  - {name: ground, shape: plane}
  - {name: ball, shape: sphere, radius: 1, position: [0, 0, -100]}
stepping: {dt: 0.01}
"""


def a_row(setting, dt, error, run_time, failure=''):
    """Make a row by hand."""
    return Row('my', *setting, 1, dt, 24, error, error, 0.0, 0.0, run_time, run_time * dt, 3,
               failure)


ROWS = [
    a_row(ONE, 0.1, 3e-2, 1e-6), a_row(ONE, 0.01, 3e-3, 1e-5), a_row(ONE, 0.001, 3e-4, 1e-4),
    a_row(TWO, 0.1, 9e-2, 5e-7), a_row(TWO, 0.01, 9e-3, 5e-6), a_row(TWO, 0.001, 9e-4, 5e-5),
    a_row(TWO, 0.0001, 1e-9, 1e-7, 'not finite')]


@pytest.mark.parametrize(('error', 'setting', 'dt'), [
    (0.2, TWO, 0.1), (5e-2, ONE, 0.1), (5e-3, ONE, 0.01), (1e-3, TWO, 0.001), (5e-4, ONE, 0.001)])
def test_cheapest_that_meets_an_error(error, setting, dt):
    """The least run time of those below the error; failures do not count."""
    best = cheapest(ROWS, error)
    assert (best.setting, best.dt) == (setting, dt)


@pytest.mark.parametrize(('run_time', 'setting', 'dt'), [
    (6e-7, TWO, 0.1), (2e-6, ONE, 0.1), (8e-6, TWO, 0.01), (6e-5, TWO, 0.001), (1.0, ONE, 0.001)])
def test_most_accurate_within_a_run_time(run_time, setting, dt):
    """The least error of those that are fast enough; failures do not count."""
    best = most_accurate(ROWS, run_time)
    assert (best.setting, best.dt) == (setting, dt)


def test_of_equally_accurate_ones_the_cheaper():
    """Where all are exact the largest dt is the one."""
    rows = [a_row(ONE, 0.1, 0.0, 1e-6), a_row(ONE, 0.01, 0.0, 1e-5)]
    assert most_accurate(rows, 1.0).dt == 0.1


def test_nothing_meets_it():
    """Too small an error, or too short a run time, has no answer."""
    assert cheapest(ROWS, 1e-6) is None
    assert most_accurate(ROWS, 1e-8) is None
    assert cheapest([], 1.0) is None


def test_table_of_a_decision():
    """The table has the row that each way to step would be chosen by, cheapest first."""
    best, table = advise.decide(ROWS, 1e-2, None)
    assert best == ROWS[4]
    assert table == [ROWS[4], ROWS[1]]
    best, table = advise.decide(ROWS, None, 6e-7)
    assert best == ROWS[3]
    assert table == [ROWS[3], ROWS[0]]           # the second is too slow: its fastest


def test_table_where_nothing_meets_it():
    """Then it has what comes nearest."""
    best, table = advise.decide(ROWS, 1e-6, None)
    assert best is None
    assert table == [ROWS[5], ROWS[2]]


def test_lines_mark_the_choice():
    """A line tells dt, error and the run time of all particles for the duration."""
    lines = list(advise.lines(ROWS[:2], ROWS[1], 1000, 0.5))
    assert len(lines) == 3
    assert lines[2].endswith('<- chosen') and not lines[1].endswith('chosen')
    assert lines[2].split()[3:7] == ['0.01', '3.00e-03', '5', 'ms']


@pytest.mark.parametrize(('text', 'value'), [
    ('2ms', 2e-3), ('500us', 5e-4), ('500 µs', 5e-4), ('0.01', 0.01), ('1e-3s', 1e-3),
    ('7ns', 7e-9)])
def test_budget(text, value):
    """Times with their units."""
    assert advise.budget(text) == pytest.approx(value)


@pytest.mark.parametrize('words', [
    ['--budget', '2 parsecs'], ['--budget', '0ms'], ['--budget', '-1ms'], ['--error', '0'],
    ['--error', 'nan'], ['--error', 'small'], [], ['--error', '1', '--budget', '1ms'],
    ['--error', '1e-3', '--duration', 'inf']])
def test_words_that_are_refused(words, capsys):
    """One aim, and a positive one; else exit code 2 and no traceback."""
    with pytest.raises(SystemExit) as stop:
        cli.main(['advise', 'rain', *words])
    assert stop.value.code == 2
    assert 'error:' in capsys.readouterr().err


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """Give a small scene, and make the refinement small."""
    monkeypatch.setattr(refinement, 'settings', lambda case: [ONE, TWO])
    monkeypatch.setattr(refinement, 'compile_kernels', lambda ways: None)
    monkeypatch.setattr(advise, 'EXTENT', refinement.Extent(0, (2, 8, 32), 1))
    path = tmp_path / 'my.yaml'
    path.write_text(SCENE)
    return str(path)


@pytest.mark.jit
def test_advice_for_an_error(scene, capsys):
    """A bounce to 2 cm: prints the table and the lines for the scene, which meet the error."""
    assert cli.main(['advise', scene, '--error', '0.02', '--duration', '0.4']) == 0
    out = capsys.readouterr().out
    assert out.count('<- chosen') == 1
    assert 'stepping: {dt: ' in out and 'The reference is ' in out
    chosen = next(line for line in out.splitlines() if 'chosen' in line)
    assert float(chosen.split()[4]) <= 0.02


@pytest.mark.jit
def test_advice_for_a_budget(scene, capsys):
    """With time enough the most accurate is chosen; of what is measured here the finest dt."""
    assert cli.main(['advise', scene, '--budget', '1s', '--duration', '0.4']) == 0
    chosen = next(line for line in capsys.readouterr().out.splitlines() if 'chosen' in line)
    assert float(chosen.split()[3]) == pytest.approx(0.4 / (24 * 32), rel=0.01)


@pytest.mark.jit
def test_advice_that_cannot_be_given(scene, capsys):
    """An error that nothing meets: says so, shows the nearest, exit code 1."""
    assert cli.main(['advise', scene, '--error', '1e-13', '--duration', '0.4']) == 1
    out = capsys.readouterr().out
    assert 'Nothing that was measured meets that' in out and 'chosen' not in out
