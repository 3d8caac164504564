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

"""The summary of a report in Markdown: orders as fitted and by theory, and what to choose."""

from math import inf

from collision_sim.studies.choice import cheapest
from collision_sim.studies.orders import fits, in_words
import numba
import numpy as np

CLOSE = 0.15                # how far a fitted order may be from that of theory
ERRORS = (1e-2, 1e-3, 1e-4, 1e-6)   # m; of the table of what to choose
HOW = """\
Errors are those of the position, RMS over particles and times. An order is the slope of log(error)
over log(dt), over the finest errors that tell it: below 2 % of the size of the scene, above
rounding and the error of the reference. *rounding*: all errors are below 1e-10 of that size. Run
times are those of one thread, the median of several runs of all particles at once."""


def agrees(order, theory):
    """Whether a fitted order is that of theory; None where one of them is missing."""
    if order is None or theory is None:
        return None
    return order == theory if inf in (order, theory) else abs(order - theory) <= CLOSE


def table(head, lines):
    """Give lines of a table in Markdown."""
    rule = ['---'] * len(head)
    return [f'| {" | ".join(map(str, line))} |' for line in (head, rule, *lines)]


def finest(rows):
    """Give the row of the smallest dt."""
    return min(rows, key=lambda row: row.dt)


def failures(rows):
    """Say at which dt what failed."""
    failed = sorted((row for row in rows if row.failure), key=lambda row: row.dt)
    if not failed:
        return ''
    return f'dt ≥ {failed[0].dt:.2g} s: {failed[-1].failure}' if len(failed) > 1 \
        else f'dt = {failed[0].dt:.2g} s: {failed[0].failure}'


def scene_lines(case, rows, orders, refusals):
    """Give the part of one scene: a line for each way to step."""
    lines = []
    for (name, setting), (over_time, end) in orders.items():
        line = [row for row in rows if (row.scene, row.setting) == (name, setting)]
        if name == case.name:
            last, theory = finest(line), case.theory(setting)
            mark = ' **≠**' if agrees(over_time, theory) is False else ''
            lines.append([setting.label, in_words(over_time) + mark, in_words(end),
                          in_words(theory), f'{last.error:.1e}', f'{last.energy:+.1e}',
                          f'{max(row.penetration for row in line):.0e}',
                          f'{1e9 * last.run_time_step:.3g}', failures(line)])
    head = ['method', 'order', 'order at the end', 'theory', 'error at the finest dt [m]',
            'energy, relative', 'deepest [m]', 'ns per particle and step', 'failures']
    refused = [f'{setting.label} does not apply: {reason}'
               for (name, setting), reason in refusals.items() if name == case.name]
    return [f'## {case.title}', '', f'![]({case.name}.png)', '', case.why, '',
            *table(head, lines), '', *refused, '']


def choice_lines(cases, rows):
    """Give the table of what to choose for which error."""
    lines = []
    for case in cases:
        cells = [case.title]
        for error in ERRORS:
            best = cheapest([row for row in rows if row.scene == case.name], error)
            cells.append(f'{best.setting.label}, dt = {best.dt:.2g} s, '
                         f'{1e6 * best.run_time:.3g} µs' if best else '–')
        lines.append(cells)
    return ['## What to choose', '', 'The cheapest of what was measured, for an error; with its '
            'run time for one particle and simulated second.', '',
            *table(['scene', *(f'{error:g} m' for error in ERRORS)], lines), '']


def verdict(cases, orders):
    """Say how many fitted orders are those of theory, and which are not."""
    theories = {case.name: case.theory for case in cases}
    answers = {key: agrees(order, theories[key[0]](key[1])) for key, (order, _) in orders.items()}
    known = [answer for answer in answers.values() if answer is not None]
    if not known:
        return []
    wrong = [f'{name}: {setting.label}' for (name, setting), answer in answers.items()
             if answer is False]
    return [f'{sum(known)} of {len(known)} fitted orders are those of theory within {CLOSE}.',
            *(['Not those of: ' + '; '.join(wrong) + '.'] if wrong else []), '']


def summary(cases, measured):
    """
    Write the summary.

    Parameters
    ----------
    cases : list of case.Case
        Those that were measured, at least in part.
    measured : refinement.Table
        Rows and refusals.

    Returns
    -------
    text : str
        Markdown.

    """
    orders = fits(cases, measured.rows)
    lines = ['# Error against run time', '', HOW, '',
             f'Numba {numba.__version__}, NumPy {np.__version__}.', '', *verdict(cases, orders),
             *choice_lines(cases, measured.rows)]
    for case in cases:
        lines += scene_lines(case, measured.rows, orders, measured.refusals)
    return '\n'.join(lines)
