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

"""The refinement of dt behind the report and the advice: all ways to step a case, over many dt."""

import csv
from io import StringIO
from typing import NamedTuple

from collision_sim.core.interrupts import held
from collision_sim.studies.drafts import draft_of, write_whole
from collision_sim.studies.errors import Answer, measure, Row, settings
from collision_sim.studies.warming import compile_kernels, refusal
import numpy as np
from tqdm import tqdm


class Extent(NamedTuple):
    """
    How much to measure.

    Attributes
    ----------
    particles : int
        Of the built-in cases.
    steps : tuple of int
        Between two times of comparison, one run each.
    repeats : int
        Runs of which the run time is the median.

    """

    particles: int
    steps: tuple
    repeats: int


def geometric(first, last, count):
    """Give so many whole numbers from the first to the last, in equal ratios."""
    return tuple(np.unique(np.geomspace(first, last, count).round().astype(int)).tolist())


EXACT_STEPS = (1, 3, 8)
FULL = Extent(512, geometric(1, 1040, 10), 5)
QUICK = Extent(128, geometric(7, 250, 5), 3)


class Table:
    """
    Measurements, each written to a file at once where there is one.

    The file takes the place of another one as soon as it has a head, and has whole rows only.

    Parameters
    ----------
    path : str or Path, optional
        Of the file.

    """

    def __init__(self, path=None):
        self.rows, self.refusals, self._file = [], {}, None
        if path:
            with draft_of(path) as draft:
                self._file = open(draft, 'wb', buffering=0)
                self._write(Row._fields)

    def _write(self, cells):
        if self._file:
            line = StringIO()
            csv.writer(line, lineterminator='\n').writerow(cells)
            write_whole(self._file, line.getvalue().encode())

    def add(self, row):
        """Keep a measurement."""
        with held():
            self.rows.append(row)
            self._write(row)


def steps_of(setting, extent):
    """Give the steps to measure; few for `exact`, whose error does not depend on them."""
    return EXACT_STEPS if setting.method == 'exact' else extent.steps


def refine(cases, extent, table):
    """
    Measure all ways to step the cases, with a progress bar.

    Parameters
    ----------
    cases : list of case.Case
        What to run.
    extent : Extent
        How much of it.
    table : Table
        Filled row by row, so that an interruption keeps what is done.

    """
    ways = [(case, setting) for case in cases for setting in settings(case)]
    compile_kernels(ways)
    runs = sum(len(steps_of(setting, extent)) for _, setting in ways)
    answers = {case.name: Answer(case) for case in cases}
    with tqdm(total=runs, unit='run', disable=None, leave=False) as bar:
        for case, setting in ways:
            bar.set_description(f'{case.name}, {setting.method}')
            reason = refusal(case.scene, setting)
            if reason:
                table.refusals[case.name, setting] = reason
            for steps in steps_of(setting, extent):
                if not reason:
                    table.add(measure(case, answers[case.name], setting, steps, extent.repeats))
                bar.update()
