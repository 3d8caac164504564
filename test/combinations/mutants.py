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
Faults put in on purpose, and how long it takes to find them.

Each is a change of a few words in a copy of the package. A failure counts where it holds for the
package as it is: so faults that are known, and not mended yet, find nothing here.
"""

import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile
import time

import collision_sim
from replay import replay
from scenes import draw

HERE = Path(__file__).parent
# What it is called, file below collision_sim, words and what stands there instead.
MUTANTS = (
    ('a radius left out of the grid', 'core/broad_phase.py',
     '256.0 * EPSILON * abs(place) + reach', '256.0 * EPSILON * abs(place)'),
    ('an impulse recorded twice', 'core/response.py',
     'log[b, row, CHANGE + d] = dv[d]', 'log[b, row, CHANGE + d] = 2.0 * dv[d]'),
    ('the last collider comes first', 'core/detection.py',
     'if phi_k < phi:', 'if True:'),
    ('of two that are as deep the first acts alone', 'core/response.py',
     'if inside > 1:', 'if inside > 9:'),
    ('a sweep margin without the move', 'core/trajectory.py',
     'return length(move) + (min(angle, 2.0)', 'return 0.0 * length(move) + (min(angle, 2.0)'),
    ('friction that drives', 'core/impulses.py',
     'return add_scaled(after, factor - 1.0, tangential), False',
     'return add_scaled(after, 1.0 - factor, tangential), False'),
    ('restitution applied twice', 'core/laws.py',
     'return -(1.0 + restitution) * np.minimum(v_n, 0.0)',
     'return -(1.0 + restitution) * (1.0 + restitution) * np.minimum(v_n, 0.0)'),
    ('a length of the code itself', 'core/detection.py',
     'return ROUNDING * (largest(x0) +', 'return 1e-9 + ROUNDING * (largest(x0) +'),
    ('wind that blows the other way', 'core/flight.py',
     'mean = g * (dt * e2) + wind * (k * dt * e2)', 'mean = g * (dt * e2) - wind * (k * dt * e2)'),
    ('a ledger that forgets the work of a collider', 'core/ledger.py',
     'ledger.rows[here.block, first] += weight * work',
     'ledger.rows[here.block, first] += 0.5 * weight * work'),
    ('scripts that are a step late', 'simulation.py',
     'first = self._count if self._since == 0.0', 'first = self._count - 1 if self._since == 0.0'),
    ('a long cylinder with short normals', 'core/shapes.py',
     'cap = rho - radius, sz * point[2] - half',
     'cap = rho - radius, sz * point[2] - 0.9 * half'),
    ('a turn about the wrong point', 'core/motion.py',
     'return add(linear, cross(angular, subtract(point, origin(poses, row, c))))',
     'return add(linear, cross(angular, point))'),
    ('a pair that shares by the wrong masses', 'core/pair_collisions.py',
     'change(stage, j, add_scaled(column(v, j), -matter.inverse[j] / total, dv), 0.0)',
     'change(stage, j, add_scaled(column(v, j), -matter.inverse[i] / total, dv), 0.0)'),
    ('a particle that starts the step without its radius', 'core/detection.py',
     'return signed_distance(rules.present, table, poses, row, c, point)[0] - here.radius',
     'return signed_distance(rules.present, table, poses, row, c, point)[0]'),
    ('a turn that is only rounding steps over a surface', 'core/trajectory.py',
     'return 2.0 * above / (root - slope)', 'return (slope + root) / bend'),
    ('a particle falls into a seam', 'core/paths.py',
     'if abs(rate) <= rounding and face == 0 and side > 0.0:', 'if False:'),
    ('a counter that a reset keeps', 'simulation.py',
     'self._accounts[:] = 0\n', 'self._accounts[:] *= 1\n'),
)


def check():
    """Raise ValueError if the words of a mutant do not stand once in its file."""
    for name, file, words, _ in MUTANTS:
        times = (Path(collision_sim.__file__).parent / file).read_text().count(words)
        if times != 1:
            raise ValueError(f'{name}: {words!r} stands {times} times in {file}, not once')


def hunt(seed, minutes):
    """Search for each mutant; 1 if one is not found within some minutes."""
    check()
    missed = 0
    for name, file, words, others in MUTANTS:
        with tempfile.TemporaryDirectory() as folder:
            _write(Path(folder), file, words, others)
            start = time.monotonic()
            found = _search(folder, seed, 60.0 * minutes)
            spent = time.monotonic() - start
        missed += found is None
        print(f'{name}: ' + (f'{found} after {spent:.0f} s' if found else
                             f'not found in {spent:.0f} s'), flush=True)
    return 1 if missed else 0


def _write(folder, file, words, others):
    """Write a copy of the package in which words of a file are others."""
    copy = folder / 'collision_sim'
    shutil.copytree(Path(collision_sim.__file__).parent, copy,
                    ignore=shutil.ignore_patterns('__pycache__'))
    (copy / file).write_text((copy / file).read_text().replace(words, others))


def _search(folder, seed, seconds):
    """Search with the package of a folder for what does not fail here; how it failed."""
    code = (f'import sys; sys.path[:0] = [{folder!r}, {str(HERE)!r}]; import mutants; '
            f'mutants.report({seed}, {seconds})')
    with subprocess.Popen([sys.executable, '-c', code], stdout=subprocess.PIPE, text=True,
                          env={**os.environ, 'NUMBA_DISABLE_JIT': '1'}) as process:
        for line in process.stdout:
            number, check, spent, problem = line.rstrip().split(' ', 3)
            key = [seed, int(number)]
            if replay(draw(key), check, key) is None:
                process.kill()
                return f'case {number}, {spent} s of the process, {check}: {problem}'
    return None


def report(seed, seconds):
    """Say of each failure its case, its check and what is wrong."""
    from itertools import count

    from search import search

    def tell(done, found):
        if found:
            print(found.seed[1], found.check, f'{found.after:.0f}', found.problem, flush=True)

    search(seed, seconds, count(), tell=tell, shrinks=0)
