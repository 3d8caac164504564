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
`collision_sim report`: error against run time.

Writes errors.csv, a figure for each scene and summary.md.
"""

from pathlib import Path
import sys

from collision_sim.listener import heard
from collision_sim.scene import load_scene, shipped_scenes
from collision_sim.studies import figures
from collision_sim.studies.cases import all_cases
from collision_sim.studies.drafts import draft_of, write_text
from collision_sim.studies.own_scene import own_case
from collision_sim.studies.refinement import FULL, QUICK, refine, Table
from collision_sim.studies.run import seconds
from collision_sim.studies.summary import summary

DESCRIPTION = """\
Error against run time, for every method, detection and flight, over many dt. Without a scene on
scenes whose answer is known in closed form; with one, on it: the reference is then the exact
method or, failing that, a converged run, and the summary says which. Colliders that follow a topic
stand still. Ctrl-C ends the measurements; what is done is drawn and summed up."""
EPILOG = """\
examples:
  collision_sim report --quick                  # 2 minutes
  collision_sim report --out report             # 20 minutes
  collision_sim report my.yaml --duration 2 --out my_report"""


def add_arguments(parser):
    """Declare the options."""
    parser.description, parser.epilog = DESCRIPTION, EPILOG
    parser.add_argument('scene', nargs='?', help='a YAML file or one of the shipped scenes '
                        f'{", ".join(shipped_scenes())}')
    parser.add_argument('--out', type=Path, default=Path('report'), metavar='DIR',
                        help='folder for errors.csv, the figures and summary.md (default report)')
    parser.add_argument('--quick', action='store_true',
                        help='fewer dt, particles and runs; without the scene with drag, '
                             'which needs kernels of its own')
    parser.add_argument('--duration', type=seconds, default=1.0, metavar='S',
                        help='simulated time of your own scene in s (default 1)')


def write(folder, cases, table):
    """Write the figures and the summary of what has been measured."""
    done = [case for case in cases if any(row.scene == case.name for row in table.rows)]
    for case in done:
        rows = [row for row in table.rows if row.scene == case.name]
        with draft_of(folder / f'{case.name}.png') as draft:
            figures.draw(draft, case, rows)
    write_text(folder / 'summary.md', summary(done, table))


def run(arguments):
    """Measure, draw and sum up; the exit code."""
    figures.require()
    extent = QUICK if arguments.quick else FULL
    if arguments.scene is not None:
        load_scene(arguments.scene)         # before there is a folder
    arguments.out.mkdir(parents=True, exist_ok=True)
    table, cases, code = Table(arguments.out / 'errors.csv'), [], 0
    try:
        if arguments.scene is None:
            cases = [case for case in all_cases(extent.particles)
                     if not (arguments.quick and case.scene.get('drag'))]
        else:
            cases = [own_case(arguments.scene, arguments.duration, max(extent.steps))[0]]
        refine(cases, extent, table)
    except KeyboardInterrupt:
        print('interrupted; writing what is done', file=sys.stderr)
        code = heard()
    write(arguments.out, cases, table)
    print(f'{len(table.rows)} measurements: {arguments.out / "summary.md"}')
    return code
