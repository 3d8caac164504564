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

"""`collision_sim advise`: the cheapest method and dt for an error, or the best for a run time."""

import argparse
import math
import re

from collision_sim.scene import shipped_scenes
from collision_sim.studies.choice import cheapest, most_accurate
from collision_sim.studies.own_scene import own_case
from collision_sim.studies.refinement import geometric, QUICK, refine, Table
from collision_sim.studies.run import seconds

DESCRIPTION = """\
Sweeps methods and dt on a scene, and advises the cheapest one that meets an error, or the most
accurate one within a run time. Prints the table that it decided from: for each way to step the one
dt that counts. Colliders that follow a topic stand still."""
EPILOG = """\
examples:
  collision_sim advise my.yaml --error 1e-3     # m, RMS over particles and time
  collision_sim advise my.yaml --budget 2ms     # for each of the scene's stepping.dt"""
UNITS = {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'µs': 1e-6, 'ns': 1e-9}
EXTENT = QUICK._replace(steps=geometric(1, 320, 9))
UNMET = 1


def budget(text):
    """Read a run time such as 2ms [s]."""
    found = re.fullmatch(r'([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*([a-zµ]*)', text)
    try:
        value = float(found[1]) * UNITS[found[2] or 's']
    except (KeyError, TypeError, ValueError):
        value = 0.0
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f'{text!r} is not a time such as 2ms, 500us, 0.01s')
    return value


def metres(text):
    """Read an error [m]."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f'{text!r} is not a positive number of metres')
    return value


def add_arguments(parser):
    """Declare the options."""
    parser.description, parser.epilog = DESCRIPTION, EPILOG
    parser.add_argument('scene', help='a YAML file or one of the shipped scenes '
                                      f'{", ".join(shipped_scenes())}')
    aim = parser.add_mutually_exclusive_group(required=True)
    aim.add_argument('--error', type=metres, metavar='M',
                     help='largest error of the position in m, RMS over particles and time')
    aim.add_argument('--budget', type=budget, metavar='TIME',
                     help="longest run time, of one thread, for the scene's stepping.dt of "
                          'simulated time, such as 2ms')
    parser.add_argument('--duration', type=seconds, default=1.0, metavar='S',
                        help='simulated time to compare over in s (default 1)')


def decide(rows, error, run_time):
    """
    Choose a row, and for each way to step the row that stands for it.

    Parameters
    ----------
    rows : list of errors.Row
        Of one scene.
    error : float [m] or None
        Largest that will do.
    run_time : float [s] or None
        Longest that will do, per particle and simulated second, where there is no error.

    Returns
    -------
    best : errors.Row or None
        None where none will do.
    table : list of errors.Row
        Of each way to step what would be chosen, or what comes nearest to that.

    """
    def choose(some):
        return cheapest(some, error) if error else most_accurate(some, run_time)

    def nearest(some):
        return min(some, key=lambda row: (bool(row.failure),
                                          row.error if error else row.run_time))
    ways = {}
    for row in rows:
        ways.setdefault(row.setting, []).append(row)
    table = [choose(some) or nearest(some) for some in ways.values()]
    return choose(rows), sorted(table, key=lambda row: row.run_time)


def lines(table, best, particles, duration):
    """Give the lines of the table; run times for all particles and `duration` [s]."""
    each = particles * duration
    head = f'run time per {duration:g} s'
    yield f'{"method":24s}{"detection":13s}{"flight":18s}{"dt [s]":>10s}{"error [m]":>11s}' \
          f'{head:>29s}'
    for row in table:
        mark = '  <- chosen' if row == best else f'  {row.failure}' if row.failure else ''
        method, detection, flight = row.setting
        if method == 'exact':
            detection = flight = ''
        yield f'{method:24s}{detection:13s}{flight:18s}{row.dt:10.3g}{row.error:11.2e}' \
              f'{1e3 * row.run_time * each:26.4g} ms{mark}'


def run(arguments):
    """Sweep, decide and print; the exit code."""
    case, scene = own_case(arguments.scene, arguments.duration, max(EXTENT.steps))
    particles, dt = max(len(scene.particles.position), 1), scene.stepping.dt or 1.0
    table = Table()
    refine([case], EXTENT, table)
    limit = arguments.budget and arguments.budget / (particles * dt)
    best, shown = decide(table.rows, arguments.error, limit)
    print(case.why)
    print(f'{particles} particles, {case.duration:g} s; run times of one thread.\n')
    print('\n'.join(lines(shown, best, particles, dt)))
    if best is None:
        print('\nNothing that was measured meets that; the table shows what comes nearest.')
        return UNMET
    print(f'\nstepping: {{dt: {best.dt:.4g}, method: {best.method}'
          + ('' if best.method == 'exact' else
             f', detection: {best.detection}, flight: {best.flight}') + '}')
    return 0
