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

"""The report of `collision_sim bench` in Markdown."""

import os
import platform

from collision_sim.studies import bench_events, bench_peers
from collision_sim.studies.bench_tables import aligned, figure, size
from collision_sim.studies.bench_works import WORKS
import numba
import numpy as np

ABOUT_EVENTS = (f'Balls of restitution 1 that fill a box to {bench_events.PACKING:g}, without '
                'gravity, by `exact`; on one thread. Fixed steps are those of '
                '`collision_then_contact` on the same balls in the same run.')


class Report:
    """What has been measured, so that an interruption keeps it."""

    def __init__(self):
        self.rows, self.features, self.events, self.rates = [], [], [], {}
        self.start = self.memory = None

    def text(self):
        """Give the report in Markdown."""
        return '\n\n'.join(self._sections())

    def _sections(self):
        yield '# Run times\n\n' + machine()
        if self.rates:
            yield '## Machine, start and memory\n\n' + '\n'.join(self._facts())
        for work, about in WORKS.items():
            rows = [row for row in self.rows if row.work == work]
            if rows:
                yield '\n\n'.join([f'## {about.title}', own_table(rows), moved(about),
                                   *peer_table(rows), *remarks(rows)])
        if self.features:
            yield f'## What each feature costs\n\n{feature_table(self.features)}'
        if self.events:
            yield ('## Hard balls from collision to collision\n\n'
                   f'{bench_events.table(self.events)}\n\n{ABOUT_EVENTS}')

    def _facts(self):
        for threads, rate in self.rates.items():
            yield f'- memory bandwidth, {threads} threads: {rate / 1e9:.3g} GB/s'
        if self.start:
            yield (f'- first step of a warm start: {self.start.stepped:.3g} s after the start of '
                   f'the process (imported {self.start.imported:.3g} s, scene loaded '
                   f'{self.start.loaded:.3g} s)')
        if self.memory:
            yield f'- memory: {self.memory:.0f} bytes a particle at most, contacts included'


def machine():
    """Say what was measured where."""
    return (f'Python {platform.python_version()}, Numba {numba.__version__}, NumPy '
            f'{np.__version__}, {os.cpu_count()} cores. Run times are wall time in ns a '
            'particle-step: the best of several turns, and their median.')


def own_table(rows):
    """Give the figures of this package for one work."""
    calls = {bench_peers.OWN.name: 'a step each', bench_peers.FUSED.name: 'all steps in one',
             bench_peers.MOVED.name: 'a step each, with the pose of the box'}
    rows = [row for row in rows if row.code in calls]
    shows_near = any(row.near is not None for row in rows)
    head = ['particles', 'threads', 'calls', 'best [ns]', 'to a step each', 'median [ns]',
            'bandwidth', 'contacts a particle-step', *(['near the mesh'] if shows_near else [])]
    lines = [[size(row.particles), figure(row.threads), calls[row.code], figure(row.best),
              figure(row.ratio), figure(row.median),
              f'{100 * row.share:.0f} %' if row.share else '', figure(row.contacts),
              *([figure(row.near)] if shows_near else [])]
             for row in rows]
    return aligned(head, lines)


def moved(work):
    """Say what the share of the memory bandwidth is of."""
    return (f'The share of the memory bandwidth is that of {work.moved} bytes a particle-step '
            f'({work.why}); above 100 % these are in a cache.')


def peer_table(rows):
    """Give the times of all codes for one work, in brackets over ours, if there are others."""
    names = list(dict.fromkeys(row.code for row in rows if row.best))
    if not set(names) - {code.name for code in bench_peers.OURS}:
        return []
    columns = list(dict.fromkeys((row.particles, row.threads) for row in rows))
    found = {(row.code, row.particles, row.threads): row for row in rows}
    lines = []
    for name in names:
        line = [found[name, *column] for column in columns if (name, *column) in found]
        lines.append([name, first(row.precision for row in line),
                      first(figure(row.used) for row in line), *map(cell, line)])
    many = len({most for _, most in columns}) > 1
    head = ['code', 'precision', 'threads',
            *(size(count) + (f', {most} threads' if many else '') for count, most in columns)]
    return [aligned(head, lines)]


def remarks(rows):
    """Give the remarks, each with the sizes that it is about."""
    sizes = {}
    for row in rows:
        if row.note:
            sizes.setdefault((row.code, row.note), {})[size(row.particles)] = None
    lines = [f'- {code}, {", ".join(found)}: {note}' for (code, note), found in sizes.items()]
    return ['\n'.join(lines)] if lines else []


def first(words):
    """Give the first word that is there, '' if none is."""
    return next(filter(None, words), '')


def cell(row):
    """Give a run time, and in brackets its ratio to ours; '*' where there is a remark."""
    if row.best is None:
        return '–'
    ratio = f' ({figure(row.ratio)})' if row.ratio else ''
    return figure(row.best) + ratio + ('*' if row.note else '')


def feature_table(rows):
    """Give what the features cost."""
    head = ['feature', 'state', '', 'best [ns]', 'median [ns]', 'best, to the base',
            'contacts a particle-step']
    return aligned(head, [[row.feature, row.state, row.why, figure(row.best), figure(row.median),
                           f'{row.ratio:.2f}', figure(row.contacts)] for row in rows])
