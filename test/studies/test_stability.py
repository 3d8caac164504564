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

"""The stability report: verdicts, exit code, table, and a fast sample of its cases."""

import argparse
import csv

from collision_sim import scene
from collision_sim.studies import stability, stability_cases
from collision_sim.studies.stability_cases import (at_most, build, Case, Check, EPSILON, outside,
                                                   plane)
import numpy as np
import pytest

HOLDS, BREAKS = Check('figure', 0.5, 1.0), Check('figure', 2.0, 1.0)


def measure_ok(method):
    """Give a figure that keeps its bound."""
    return [HOLDS]


def measure_broken(method):
    """Give a figure that breaks its bound."""
    return [BREAKS]


def report(*words, cases=None):
    """Exit code of the command with some arguments."""
    parser = argparse.ArgumentParser()
    stability.add_arguments(parser)
    return stability.run(parser.parse_args(words), cases)


def named(pattern):
    """Give the cases of the report whose names begin so."""
    return [case for case in stability.all_cases() if case.name.startswith(pattern)]


@pytest.mark.parametrize(('checks', 'flaw', 'verdict', 'figure'), [
    ([HOLDS], '', stability.PASS, 0.5), ([BREAKS], '', stability.FAIL, 2.0),
    ([Check('nan', float('nan'), 1.0)], '', stability.FAIL, None),
    ([HOLDS, BREAKS], '', stability.FAIL, 2.0), ([BREAKS], 'known', stability.EXPECTED_FAIL, 2.0),
    ([HOLDS], 'known', stability.UNEXPECTED_PASS, 0.5),
    ([HOLDS, BREAKS], 'known', stability.FAIL, 2.0),
    ([BREAKS, Check('other', 3.0, 1.0)], 'known', stability.FAIL, 3.0)])
def test_verdicts(checks, flaw, verdict, figure):
    """A flaw excuses the first check only; NaN keeps no bound; the figure is the one failing."""
    row = stability.judge(Case('case', lambda method: checks, flaw), scene.METHODS[0])
    assert row.verdict == verdict
    assert row.figure == figure or figure is None


def test_a_flaw_of_one_method_excuses_no_other():
    case = Case('case', measure_broken, 'known', ('single_pass', ))
    assert stability.judge(case, 'single_pass').verdict == stability.EXPECTED_FAIL
    assert stability.judge(case, 'multi_pass').verdict == stability.FAIL


def test_not_applicable():
    """What does not apply is not measured; what a method refuses is told with its words."""
    absent = Case('case', measure_broken, absent={'single_pass': 'no such thing'})
    row = stability.judge(absent, 'single_pass')
    assert (row.verdict, row.note, row.figure) == (stability.NOT_APPLICABLE, 'no such thing', '')
    refused = Case('case', lambda method: build(method, [plane()], (0.0, 0.0, 0.0), dt=-1.0))
    row = stability.judge(refused, 'single_pass')
    assert row.verdict == stability.NOT_APPLICABLE
    assert 'stepping.dt' in row.note


def test_too_slow(monkeypatch):
    """Steps that take too long are a fail, with the time they took."""
    monkeypatch.setattr(stability_cases, 'PATIENCE', 0.0)
    case, = named('dt = 0.1 s, drop')
    row = stability.judge(case, scene.METHODS[0])
    assert (row.verdict, row.measured) == (stability.FAIL, 'run time / s')
    assert row.figure > 0.0


def test_exit_codes(capsys, tmp_path):
    """1 on a fail that is not expected, 0 with expected ones, 2 where no case fits."""
    ok, broken = Case('ok', measure_ok), Case('broken', measure_broken)
    known = Case('known', measure_broken, 'it is known to')
    one = ('--method', 'single_pass', '--jobs', '1')
    assert report(*one, cases=[ok, known]) == 0
    assert 'expected fail: it is known to' in capsys.readouterr().out
    path = tmp_path / 'table.csv'
    assert report(*one, '--csv', str(path), cases=[ok, broken, known]) == 1
    text = capsys.readouterr().out
    assert '3 cases, 1 methods: 1 pass, 1 expected fail, 0 n/a, 0 UNEXPECTED PASS, 1 FAIL' in text
    with open(path) as file:
        rows = list(csv.DictReader(file))
    assert [row['case'] for row in rows] == ['ok', 'broken', 'known']
    assert [float(row['figure']) for row in rows] == [0.5, 2.0, 2.0]
    assert report(*one, '--case', 'b*', cases=[ok, broken, known]) == 1
    assert report(*one, '--case', 'o*', cases=[ok, broken, known]) == 0
    assert report('--method', 'single_pass', '--jobs', '2', cases=[ok, broken]) == 1
    assert report('--case', 'no such case') == 2


def test_unknown_method(capsys):
    with pytest.raises(SystemExit):
        report('--method', 'magic')
    assert 'single_pass' in capsys.readouterr().err


def test_there_are_enough_cases():
    """At least 40, with names of their own, each group of the extremes among them."""
    names = [case.name for case in stability.all_cases()]
    assert len(names) == len(set(names)) >= 40
    for part in ('wet linear', 'wet capped', 'wet exponential', 'dry', 'eps', 'dt', 'drag',
                 'speed', 'wall', 'coordinates', 'denormal', 'wedge', 'start', 'plates',
                 'ball teleports', 'rest 1e6'):
        assert any(name.startswith(part) for name in names)


@pytest.mark.parametrize('strength', ['2.5', '1000', '1e+09'])
def test_the_uncapped_wet_form_fails(strength):
    """Where D |dv_N| > 1 it reverses the velocity: measured, by every method, and explained."""
    case, = named(f'wet linear, D|dv_N| = {strength}')
    for method in scene.METHODS[:3]:
        row = stability.judge(case, method)
        assert row.verdict == stability.EXPECTED_FAIL
        # the hit alone reverses 3 m/s to -3 (D|dv_N| - 1)
        assert row.figure >= 3.0 * (float(strength) - 1.0) * (1.0 - 4 * EPSILON)
        assert 'reverses' in row.note


@pytest.mark.jit
def test_sample(capsys):
    """A fast part of the report, end to end: nothing fails unexpectedly, all is measured."""
    for pattern in ('wet*', 'dry, mu = *', 'start*', 'wedge*gravity*', 'coordinates*'):
        assert report('--method', 'multi_pass', '--method', 'collision_then_contact',
                      '--jobs', '1', '--case', pattern) == 0
        assert ' 0 n/a, 0 UNEXPECTED PASS, 0 FAIL' in capsys.readouterr().out


@pytest.mark.jit
def test_figures_can_fail():
    """A particle 1 nm inside and a NaN among the figures break their bounds."""
    sim = build('multi_pass', [plane()], (0.0, 0.0, 1.0))
    assert outside(sim.position, sim.clearance()).holds
    sim.position[0, 2] = -1e-9
    assert not outside(sim.position, sim.clearance()).holds
    assert not at_most('nan', np.array([0.0, np.nan]), 1.0).holds
