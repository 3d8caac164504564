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

"""
The stability report: stiff and extreme cases, each with a criterion and the figure measured.

`collision_sim stability`, or `python -m collision_sim.studies.stability`. The cases are those of
stability_laws, stability_shapes and stability_motion.
"""

import argparse
from collections import Counter
import csv
from fnmatch import fnmatch
import os
import sys
import time
from typing import NamedTuple

from collision_sim import scene
from collision_sim.studies import stability_laws, stability_motion, stability_shapes
from collision_sim.studies.drafts import draft_of
from collision_sim.studies.processes import Pool
from collision_sim.studies.stability_cases import PATIENCE, TooSlow
from tqdm import tqdm

PASS, FAIL, NOT_APPLICABLE = 'pass', 'FAIL', 'n/a'
EXPECTED_FAIL, UNEXPECTED_PASS = 'expected fail', 'UNEXPECTED PASS'
PART = 12       # cases that a process takes on at once
VERDICTS = (PASS, EXPECTED_FAIL, NOT_APPLICABLE, UNEXPECTED_PASS, FAIL)

DESCRIPTION = """\
Run stiff and extreme cases with every method. Each measures a figure that must keep a bound; where
a method is known to break one, the table says "expected fail" and the notes below it say why.
The exit code is 1 if anything else fails. "UNEXPECTED PASS" does not fail: it says that a note is
out of date. "n/a": the case does not apply to the method, or the method refuses the scene."""
EXAMPLE = """\
example:
  collision_sim stability --method collision_then_contact --case 'wet*' --csv stability.csv"""


class Row(NamedTuple):
    """A line of the table; measured, figure and bound are empty where nothing was measured."""

    case: str
    method: str
    measured: str
    figure: float | str
    bound: float | str
    verdict: str
    note: str


def judge(case, method):
    """
    Measure a case with a method.

    Parameters
    ----------
    case : stability_cases.Case
        What to measure.
    method : str
        One of scene.METHODS.

    Returns
    -------
    Row
        With the figure of the first check that fails, else of the first check of the case.

    """
    if method in case.absent:
        return Row(case.name, method, '', '', '', NOT_APPLICABLE, case.absent[method])
    try:
        first, *others = case.measure(method)
    except scene.SceneError as refusal:
        return Row(case.name, method, '', '', '', NOT_APPLICABLE, f'refused: {refusal}')
    except TooSlow as slow:
        return Row(case.name, method, 'run time / s', *slow.args, PATIENCE, FAIL, '')
    expected = case.expects_failure(method)
    failing = [check for check in others if not check.holds]
    shown = failing[0] if failing and (expected or first.holds) else first
    if failing or not (first.holds or expected):
        verdict = FAIL
    elif expected:
        verdict = UNEXPECTED_PASS if first.holds else EXPECTED_FAIL
    else:
        verdict = PASS
    return Row(case.name, method, *shown, verdict, case.flaw if verdict == EXPECTED_FAIL else '')


def all_cases():
    """Give all cases of the report."""
    return [case for module in (stability_laws, stability_shapes, stability_motion)
            for case in module.cases()]


def judge_part(cases, method):
    """Judge some cases with a method."""
    return [judge(case, method) for case in cases]


def judge_parts(parts, jobs):
    """Judge parts (cases, method) in so many processes, or in this one; yield as they end."""
    if jobs == 1:
        yield from (judge_part(*part) for part in parts)
        return
    with Pool(min(jobs, len(parts))) as pool:
        for _, rows, reason in pool.each(judge_part, enumerate(parts)):
            if rows is None:
                raise RuntimeError(reason)
            yield rows


def measure(cases, methods, jobs):
    """
    Judge each case with each method, with a progress bar where a terminal shows it.

    Parameters
    ----------
    cases : list of Case
        What to measure.
    methods : sequence of str
        Some of scene.METHODS.
    jobs : int
        Processes that share the work, most of which is compiling the kernels.

    Returns
    -------
    rows : list of Row
        By case, then by method.

    """
    # neighbours share kernels; two processes that need one at once would both compile it
    order = [*methods[::2], *methods[1::2]]
    parts = [(cases[k:k + PART], method) for k in range(0, len(cases), PART) for method in order]
    rows = {}
    with tqdm(total=len(cases) * len(methods), disable=None, leave=False, unit='case') as bar:
        for part in judge_parts(parts, jobs):
            rows |= {(row.case, row.method): row for row in part}
            bar.update(len(part))
    return [rows[case.name, method] for case in cases for method in methods]


def _number(value):
    return value if isinstance(value, str) else f'{value + 0.0:.3g}'     # + 0.0: no minus zero


def table(rows):
    """Give the rows in columns, and the notes that explain them, as text."""
    head = Row('case', 'method', 'measured', 'figure', 'bound', 'verdict', '')
    lines = [[row.case, row.method, row.measured, _number(row.figure), _number(row.bound),
              row.verdict] for row in (head, *rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    text = ['  '.join(cell.rjust(width) if k in (3, 4) else cell.ljust(width)
                      for k, (cell, width) in enumerate(zip(line, widths))).rstrip()
            for line in lines]
    notes = {(row.verdict, row.note): row.method for row in rows if row.note}
    text += ['', *(f'{verdict}: {note}' for verdict, note in notes)] if notes else []
    return '\n'.join(text)


def summary(rows, seconds):
    """Count the verdicts in one line."""
    counts = Counter(row.verdict for row in rows)
    parts = ', '.join(f'{counts[verdict]} {verdict}' for verdict in VERDICTS)
    cases, methods = len({row.case for row in rows}), len({row.method for row in rows})
    return f'{cases} cases, {methods} methods: {parts}; {seconds:.0f} s'


def write_csv(path, rows):
    """Write the rows to a file."""
    with draft_of(path) as draft, open(draft, 'w', newline='') as file:
        writer = csv.writer(file)
        writer.writerow(Row._fields)
        writer.writerows(rows)


def add_arguments(parser):
    """
    Add what `collision_sim stability` takes.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Of the command; gets its description and an example too.

    """
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.description, parser.epilog = DESCRIPTION, EXAMPLE
    parser.add_argument('--method', action='append', choices=scene.METHODS,
                        help='a method; may be repeated (default: all)')
    parser.add_argument('--case', metavar='PATTERN', default='*',
                        help="cases whose name fits, such as 'wall*' (default: all)")
    parser.add_argument('--jobs', type=int, metavar='N', default=os.cpu_count(),
                        help='processes that share the work (default: one for each core)')
    parser.add_argument('--csv', metavar='FILE', help='write the table to a file, too')


def run(arguments, cases=None):
    """
    Measure, print the table and tell whether all is well.

    Parameters
    ----------
    arguments : argparse.Namespace
        As of `add_arguments`.
    cases : list of Case, optional
        Other cases than those of the report.

    Returns
    -------
    code : int
        Exit code: 1 if anything failed that was not expected to, 2 if no case fits.

    """
    if arguments.csv and not os.path.isdir(os.path.dirname(arguments.csv) or '.'):
        raise scene.SceneError('--csv', arguments.csv, 'must be in a folder that exists')
    begin = time.perf_counter()
    chosen = [case for case in cases or all_cases() if fnmatch(case.name, arguments.case)]
    if not chosen:
        print(f'no case fits {arguments.case!r}', file=sys.stderr)
        return 2
    rows = measure(chosen, arguments.method or scene.METHODS, arguments.jobs)
    if arguments.csv:
        write_csv(arguments.csv, rows)
    print(table(rows))
    print('\n' + summary(rows, time.perf_counter() - begin))
    return int(any(row.verdict == FAIL for row in rows))


def main():
    """Run from the command line."""
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return run(parser.parse_args())


if __name__ == '__main__':
    sys.exit(main())
