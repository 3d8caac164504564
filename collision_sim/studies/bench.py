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
`collision_sim bench`: run times of known works, beside other toolkits, and what features cost.

Writes bench.csv, features.csv, events.csv and bench.md.
"""

import argparse
import math
import os
from pathlib import Path
import sys
from tempfile import TemporaryDirectory

from collision_sim.listener import heard
from collision_sim.studies import bench_events, bench_features, bench_machine, bench_peers
from collision_sim.studies.bench_report import Report
from collision_sim.studies.bench_tables import write_csv
from collision_sim.studies.bench_works import moves, WORKS
from collision_sim.studies.drafts import write_text
from tqdm import tqdm

DESCRIPTION = """\
Measure known works in ns a particle-step and as a share of the memory bandwidth, the time to the
first step of a warm start, the memory of a particle, what each feature of a scene costs, and the
events a second of hard balls that go from collision to collision (`exact` with pairs).
With --peers, toolkits that are installed do the same works in turn with this one; what is missing
or cannot do a work is listed with the reason. Ctrl-C ends the measurements and shows what is
done. Let the machine do nothing else meanwhile."""
EPILOG = """\
works:
""" + '\n'.join(f'  {name:8s} {work.title}' for name, work in WORKS.items()) + """

examples:
  collision_sim bench --quick                       # some minutes
  collision_sim bench --peers --out bench           # half an hour
  collision_sim bench --parts works --works 1 2 --sizes 1e4 1e5 --threads 1 2
  collision_sim bench --parts works --peers warp taichi"""
PARTS = ('start', 'works', 'features', 'events')
SIZES, QUICK_SIZES = (10 ** 3, 10 ** 4, 10 ** 5, 10 ** 6), (10 ** 3, 10 ** 4)
REPEATS, QUICK_REPEATS = 7, 2
FEATURES, QUICK_FEATURES = 10 ** 5, 5000    # particles of the scene of features
MEMORY = 10 ** 6, 2 * 10 ** 6               # particles; the memory of one is the difference
FAILED = 1


def whole(text):
    """Read a positive whole number, 1e5 included."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not (1.0 <= value < math.inf and value == int(value)):
        raise argparse.ArgumentTypeError(f'{text!r} is not a positive whole number')
    return int(value)


def add_arguments(parser):
    """Declare the options."""
    parser.description, parser.epilog = DESCRIPTION, EPILOG
    names = sorted({code.package for code in bench_peers.PEERS})
    parser.add_argument('--parts', nargs='+', choices=PARTS, default=PARTS, metavar='PART',
                        help=f'some of {", ".join(PARTS)} (default all)')
    parser.add_argument('--works', nargs='+', choices=WORKS, default=list(WORKS), metavar='WORK',
                        help='some of the works below (default all)')
    parser.add_argument('--sizes', nargs='+', type=whole, metavar='N',
                        help='numbers of particles (default 1e3 1e4 1e5 1e6)')
    parser.add_argument('--threads', nargs='+', type=whole, default=[os.cpu_count() or 1],
                        metavar='N', help='most threads to use (default: one for each core)')
    parser.add_argument('--repeats', type=whole, metavar='N',
                        help=f'turns, of which the best counts (default {REPEATS})')
    parser.add_argument('--peers', nargs='*', choices=names, metavar='PEER',
                        help=f'beside other toolkits: some of {", ".join(names)} (default all)')
    parser.add_argument('--quick', action='store_true',
                        help='fewer particles and turns, for a first look')
    parser.add_argument('--out', type=Path, metavar='DIR',
                        help='folder for bench.csv, features.csv, events.csv and bench.md')


def codes_of(arguments, work):
    """Give the codes to measure a work with, that of this package first."""
    ours = tuple(code for code in bench_peers.OURS if code is bench_peers.OWN
                 or not arguments.quick and (code is bench_peers.FUSED or moves(work)))
    if arguments.peers is None:
        return ours
    return ours + tuple(code for code in bench_peers.PEERS
                        if not arguments.peers or code.package in arguments.peers)


def measure(arguments, report, folder):
    """Measure all that is asked for, into the report."""
    quick = arguments.quick
    repeats = arguments.repeats or (QUICK_REPEATS if quick else REPEATS)
    for threads in arguments.threads:
        report.rates[threads] = bench_machine.bandwidth(threads)
    if 'start' in arguments.parts:
        report.start = bench_machine.warm_start()
        report.memory = bench_machine.bytes_a_particle(*MEMORY)
    if 'works' in arguments.parts:
        measure_works(arguments, repeats, report, folder)
    if 'features' in arguments.parts:
        count = QUICK_FEATURES if quick else FEATURES
        report.features = bench_features.measure(count, arguments.threads[-1], repeats, folder)
    if 'events' in arguments.parts:
        counts = bench_events.QUICK_SIZES if quick else bench_events.SIZES
        report.events = bench_events.measure(arguments.sizes or counts, repeats)


def measure_works(arguments, repeats, report, folder):
    """Measure the works, with a progress bar."""
    counts = arguments.sizes or (QUICK_SIZES if arguments.quick else SIZES)
    codes = {work: codes_of(arguments, work) for work in arguments.works}
    total = len(counts) * len(arguments.threads) * sum(map(len, codes.values())) * (repeats + 1)
    with tqdm(total=total, unit='turn', disable=None, leave=False) as bar:
        for work in arguments.works:
            for count in counts:
                for threads in arguments.threads:
                    report.rows += bench_peers.measure(work, count, codes[work], threads, repeats,
                                                       folder, report.rates[threads], bar)


def write(folder, report):
    """Write the files."""
    for name, rows in (('bench.csv', report.rows), ('features.csv', report.features),
                       ('events.csv', report.events)):
        if rows:
            write_csv(folder / name, rows)
    write_text(folder / 'bench.md', report.text() + '\n')


def run(arguments):
    """Measure, print and write; the exit code: 1 if a work of this package failed."""
    report, code = Report(), 0
    if arguments.out:
        arguments.out.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as folder:
        try:
            measure(arguments, report, Path(folder))
        except KeyboardInterrupt:
            print('interrupted; showing what is done', file=sys.stderr)
            code = heard()
    print(report.text())
    if arguments.out:
        write(arguments.out, report)
    failed = [row for row in report.rows if row.code == bench_peers.OWN.name and not row.best]
    return code or (FAILED if failed else 0)
