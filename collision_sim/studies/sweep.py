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

"""`collision_sim sweep`: many runs of a scene over a grid of values, and one table of outcomes."""

import argparse
import os
import sys

from collision_sim.checks import SceneError
from collision_sim.scene import shipped_scenes
from collision_sim.studies import outcome_table
from collision_sim.studies.cluster import Cluster
from collision_sim.studies.grid import axis, Grid
from collision_sim.studies.journal import fingerprint, Journal
from collision_sim.studies.outcomes import compile_kernels, outcome, Plan, version
from collision_sim.studies.processes import Pool
from collision_sim.studies.run import seconds
import numba
from tqdm import tqdm

DESCRIPTION = """\
Run a scene with every combination of some values, and write one table: a row a run with the
values, the state at the end (mean, std, min, max), energy, momentum, counters and run time. All
values are checked before the first run. A run that fails is a row with its error.

Whatever ends a sweep (Ctrl-C, a crash), the same command goes on where it stopped: finished runs
are kept in FILE.partial until the table is written."""
EPILOG = """\
examples:
  collision_sim sweep rain --vary restitution=0.1:0.9:9 --vary friction.dry=0,0.1,0.5 --repeat 10
  collision_sim sweep my.yaml --vary stepping.dt=1e-4:1e-2:5:log --vary colliders.ball.radius=1,2
  collision_sim sweep my.yaml --vary 'gravity=[0,0,-9.81],[0,0,-1.62]' --duration 60 --ledger
  collision_sim sweep my.yaml --repeat 1000 --scheduler tcp://host:8786 --out seeds.parquet

a cluster: `dask scheduler` on one machine, `dask worker tcp://host:8786` on the others, all with
collision_sim[sweep] in one version, in a network that you trust. Particle and mesh files are read
here. After Ctrl-C the workers end the runs that they have begun.

exit codes: 0; 1 if runs failed; 2 if something is refused; 130 after Ctrl-C."""
FAILED = 1


def whole(text):
    """Read a positive whole number of the command line."""
    if not (text.isascii() and text.isdecimal() and int(text) > 0):
        raise argparse.ArgumentTypeError(f'{text!r} is not a positive whole number')
    return int(text)


def table_file(text):
    """Read the name of the file for the table."""
    if os.path.splitext(text)[1] not in outcome_table.FORMATS:
        formats = ' or '.join(outcome_table.FORMATS)
        raise argparse.ArgumentTypeError(f'{text!r} does not end in {formats}')
    if not os.path.isdir(os.path.dirname(text) or '.'):
        raise argparse.ArgumentTypeError(f'the folder of {text!r} does not exist')
    return text


def add_arguments(parser):
    """Declare the options."""
    parser.description, parser.epilog = DESCRIPTION, EPILOG
    parser.add_argument('scene', help='a YAML file or one of the shipped scenes '
                                      f'{", ".join(shipped_scenes())}')
    parser.add_argument('--vary', type=axis, action='append', default=[], metavar='PATH=VALUES',
                        help='a value of the scene by its path, such as colliders.ball.radius or '
                             'gravity.2 (entry 2 of the list); VALUES: first:last:count in equal '
                             'differences, first:last:count:log in equal ratios, or a,b,c as in '
                             'YAML; may be repeated, the last one varies fastest')
    parser.add_argument('--repeat', type=whole, default=1, metavar='N',
                        help='runs of each combination, with the seeds particles.seed, '
                             'particles.seed + 1, ... (default 1)')
    extent = parser.add_mutually_exclusive_group()
    extent.add_argument('--duration', type=seconds, default=5.0, metavar='S',
                        help='simulated time of a run in s (default 5)')
    extent.add_argument('--steps', type=whole, metavar='N', help='steps of a run instead')
    parser.add_argument('--out', type=table_file, default='outcomes.csv', metavar='FILE',
                        help='.csv or .parquet for the table (default outcomes.csv)')
    parser.add_argument('--ledger', action='store_true',
                        help='keep the accounts of energy and momentum, too')
    parser.add_argument('--restart', action='store_true',
                        help='forget what is done of an interrupted sweep')
    place = parser.add_mutually_exclusive_group()
    place.add_argument('--jobs', type=whole, metavar='N',
                       help='runs at the same time on this machine (default: all cores)')
    place.add_argument('--scheduler', metavar='ADDRESS',
                       help='run on the Dask cluster of the scheduler at tcp://host:port')
    parser.add_argument('--threads', type=whole, default=1, metavar='N',
                        help='of each run (default 1)')


def checked(grid, plan):
    """Build the scene of every run, so that each value is checked; the fingerprint of all."""
    with tqdm(grid.runs, desc='checking', unit='run', leave=False, disable=None) as runs:
        word = fingerprint((grid.scene(run) for run in runs), version(),
                           grid.runs,
                           plan._replace(threads=1))
    if grid.runs[-1].repeat and not grid.draws():
        raise SceneError('--repeat', grid.runs[-1].repeat + 1,
                         'must be 1 where a scene draws nothing at random: all repeats would be '
                         'the same')
    return word


def kernels(grid, todo):
    """Give one run for each kernel: numbers change it by being 0 or not only."""
    found = {}
    for k in todo:
        values = grid.runs[k].values.values()
        found.setdefault(tuple(bool(value) if isinstance(value, (int, float)) else repr(value)
                               for value in values), k)
    return found.values()


def calls(grid, plan, todo):
    """Give the arguments of some runs, each when it is asked for."""
    return ((k, (grid.scene(grid.runs[k]), plan)) for k in todo)


def run_all(place, grid, plan, todo):
    """Yield the index and the row of each run, as they end."""
    for k, row, reason in place.each(outcome, calls(grid, plan, todo)):
        run = grid.runs[k]
        yield k, {**run.values, 'repeat': run.repeat, 'seed': grid.seed(run), 'error': None,
                  **(row or {'error': reason})}


def carry_out(place, grid, plan, journal):
    """Do the runs that are not in the journal yet, with a progress bar."""
    todo = [k for k in range(len(grid.runs)) if k not in journal.rows]
    with tqdm(total=len(grid.runs), initial=len(journal.rows), unit='run', disable=None,
              leave=False) as bar:
        if isinstance(place, Pool):     # one process compiles, the others take it from the disk
            bar.set_description('compiling')
            for _ in place.each(compile_kernels, calls(grid, plan, kernels(grid, todo))):
                pass
            bar.set_description()
        for k, row in run_all(place, grid, plan, todo):
            journal.add(k, row)
            bar.update()


def workplace(arguments, runs):
    """Give the cluster or the processes that do so many runs."""
    if arguments.scheduler:
        return Cluster(arguments.scheduler)
    jobs = arguments.jobs or max(numba.config.NUMBA_NUM_THREADS // arguments.threads, 1)
    return Pool(min(jobs, runs))


def run(arguments):
    """Sweep; the exit code."""
    outcome_table.require(arguments.out)
    plan = Plan(None if arguments.steps else arguments.duration, arguments.steps,
                arguments.threads, arguments.ledger)
    grid = Grid(arguments.scene, arguments.vary, arguments.repeat)
    word, runs = checked(grid, plan), len(grid.runs)
    with Journal(f'{arguments.out}.partial', word, arguments.restart) as journal:
        try:
            with workplace(arguments, runs - len(journal.rows)) as place:
                carry_out(place, grid, plan, journal)
        except BaseException:
            journal.leave(runs)
            raise
        rows = [journal.rows[k] for k in range(runs)]
        outcome_table.write(arguments.out, rows)
        journal.remove()
    return summed_up(arguments.out, rows)


def summed_up(path, rows):
    """Say what became of the runs; the exit code."""
    failures = [row['error'] for row in rows if row['error']]
    print(f'{len(rows)} runs: {path}')
    if failures:
        print(f'{len(failures)} of them failed, the first with: {failures[0]}', file=sys.stderr)
    return FAILED if failures else 0
