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

"""What is compiled: where it comes from, and that it is never older than its source."""

import os
from pathlib import Path
import shutil
import subprocess
import sys

import collision_sim
from collision_sim.core.jit import entry, inlined, kernel
from collision_sim.core.shapes import signed_distance
from numba import njit, types
import numpy as np
import pytest
from small_scenes import box, simulate, sphere

RADIUS = 'from collision_sim.core.shapes import sphere; print(sphere((0.0, 3.0, 4.0), 1.0)[0])'


@pytest.mark.jit
def test_a_change_in_one_file_renews_what_others_make_of_it(tmp_path):
    """A ball's distance comes from shapes.py; the length it is made with is in vectors.py."""
    package = tmp_path / 'collision_sim'
    shutil.copytree(Path(collision_sim.__file__).parent, package,
                    ignore=shutil.ignore_patterns('__pycache__'))
    environment = {**os.environ, 'PYTHONPATH': str(tmp_path),
                   'NUMBA_CACHE_DIR': str(tmp_path / 'cache')}

    def distance():
        return float(subprocess.run([sys.executable, '-c', RADIUS], env=environment, check=True,
                                    cwd=tmp_path, capture_output=True, text=True).stdout)

    assert distance() == 4.0
    cached = {path: path.stat().st_mtime_ns for path in (tmp_path / 'cache').rglob('*.nb[ic]')}
    assert cached and distance() == 4.0
    assert cached == {path: path.stat().st_mtime_ns for path in cached}
    vectors = package / 'core' / 'vectors.py'
    source = vectors.read_text()
    vectors.write_text(source.replace('return sqrt(square)', 'return 2.0 * sqrt(square)'))
    assert vectors.read_text() != source
    assert distance() == 9.0


WARM = """
import sys
from collision_sim.core.shapes import sphere
print(sphere((0.0, 3.0, 4.0), 1.0))
print('numba.np.arraymath' in sys.modules)
import numba
print(numba.njit(lambda x: x ** 2)(3.0))
print('numba.np.arraymath' in sys.modules)
"""


@pytest.mark.jit
def test_what_is_cached_needs_no_compiler_and_does_not_keep_others_from_it():
    """Numba takes a third of a second to get ready to compile: a warm start goes without."""
    cold, warm = [subprocess.run([sys.executable, '-c', WARM], check=True, capture_output=True,
                                 text=True).stdout.splitlines() for _ in range(2)]
    assert cold[0] == warm[0] and cold[2] == warm[2] == '9.0'
    assert warm[1] == 'False' and warm[3] == 'True'


STORED = """
import sys
from collision_sim.core.shapes import sphere
print(sphere((0.0, 3.0, 4.0), 1.0)[0])
"""
DAMAGES = {
    'empty': lambda content: b'',
    'cut': lambda content: content[:len(content) // 2],
    'changed': lambda content: content[:-9] + bytes(255 - byte for byte in content[-9:]),
    'foreign': lambda content: b'no cache of ours',
}


@pytest.mark.jit
def test_a_damaged_cache_is_compiled_anew(tmp_path):
    """Index or data, empty, cut or changed: the same answer, no word, and a whole cache again."""
    environment = {**os.environ, 'PYTHONPATH': str(Path(collision_sim.__file__).parents[1]),
                   'NUMBA_CACHE_DIR': str(tmp_path)}

    def run():
        done = subprocess.run([sys.executable, '-c', STORED], env=environment, text=True,
                              capture_output=True)
        assert (done.returncode, done.stdout, done.stderr) == (0, '4.0\n', '')
    run()
    for suffix in ('nbi', 'nbc'):
        for damage in DAMAGES.values():
            files = list(tmp_path.rglob(f'shapes.sphere-*.{suffix}'))
            assert files
            for file in files:
                file.write_bytes(damage(file.read_bytes()))
            run()
    whole = {file: file.stat().st_mtime_ns for file in tmp_path.rglob('*.nb[ic]')}
    run()
    assert whole == {file: file.stat().st_mtime_ns for file in whole}


@pytest.mark.jit
def test_no_place_for_a_cache(tmp_path):
    """A folder that cannot be written to, here a file: it compiles, and says nothing."""
    (tmp_path / 'file').write_text('')
    environment = {**os.environ, 'PYTHONPATH': str(Path(collision_sim.__file__).parents[1]),
                   'NUMBA_CACHE_DIR': str(tmp_path / 'file'),
                   'NUMBA_CACHE_LOCATOR_CLASSES': 'UserProvidedCacheLocator'}
    done = subprocess.run([sys.executable, '-c', STORED], env=environment, text=True,
                          capture_output=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, '4.0\n', '')


@kernel
def doubled(x):
    """Give twice a number."""
    return 2.0 * x


@inlined
def quadrupled(x):
    """Give four times a number."""
    return doubled(doubled(x))


@entry
def four_times(x):
    """Give four times a number, to Python."""
    return quadrupled(x)


@pytest.mark.jit
def test_what_an_inlined_kernel_calls_is_not_inlined_by_force():
    """Else one decorator may double the time that compiling takes."""
    assert four_times(1.5) == 6.0
    for function in (doubled, quadrupled):      # else they are in the cache only
        function.compile((types.float64,))
    forced = [[result.fndesc.inline for result in function.overloads.values()]
              for function in (doubled, quadrupled, four_times)]
    assert forced == [[False], [True], [False]]


@njit
def height(present, table, poses, point):
    """Call a kernel of the simulation's from a function that is none of its entries."""
    return signed_distance(present, table, poses, 0, 0, point)[0]


@pytest.mark.jit
def test_kernels_of_an_entry_are_its_own():
    """Others get theirs, though LLVM may have changed how those of an entry are called."""
    balls = [sphere(0.1, (k, 5.0, 0.0), f'ball_{k}') for k in range(12)]
    sim = simulate([box((1.0, 2.0, 3.0)), *balls], np.array([[0.0, 0.0, 2.0]]))
    sim.step()
    assert height(sim._rules.present, sim._table, sim._colliders.now, (0.0, 4.0, 5.5)) == 5.0


MINE = """
from typing import NamedTuple
class Mine(NamedTuple):
    x: float
"""
REFERRED = """
from collision_sim.core.reference import refer
{}
print(refer(value).x)
"""


@pytest.mark.jit
def test_types_of_another_program_do_not_spoil_the_cache(tmp_path):
    """The index of a function names the types it is compiled for: a program may not have them."""
    (tmp_path / 'mine.py').write_text(MINE)
    root = str(Path(collision_sim.__file__).parents[1])
    for path, value in ((f'{root}:{tmp_path}', 'from mine import Mine\nvalue = Mine(2.0)'),
                        (root, 'from typing import NamedTuple\n'
                               'value = NamedTuple("Other", [("x", float)])(2.0)')):
        environment = {**os.environ, 'PYTHONPATH': path,
                       'NUMBA_CACHE_DIR': str(tmp_path / 'cache')}
        done = subprocess.run([sys.executable, '-c', REFERRED.format(value)], env=environment,
                              cwd='/', capture_output=True, text=True)
        assert done.stdout == '2.0\n', done.stderr
