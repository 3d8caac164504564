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

"""The key of the cache: what a function is made from, no more and no less."""

import ast
import os
from pathlib import Path
import shutil
import subprocess
import sys

import collision_sim
from collision_sim.core import stamps
from collision_sim.core.jit import entry, kernel
import numpy as np
import pytest

LENGTH = 'core/vectors.py', 'return sqrt(square)', 'return 2.0 * sqrt(square)'
CHANGES = {     # file, what is there, what is put there instead
    'a comment at its top': ('core/vectors.py', 'from math', '# Here begins it.\nfrom math'),
    'a docstring': ('core/vectors.py', '"""Euclidean length', '"""The length'),
    'a comment elsewhere': ('core/exact.py', '\nimport', '\n# Others.\nimport'),
    'a function it does not use': ('core/vectors.py', '\n\n@formula\ndef dot',
                                   '\n\ndef _two():\n    return 2\n\n\n@formula\ndef dot'),
    'what is above its own': ('core/shapes.py', '\n@formula\ndef sphere',
                              '\n# A ball.\n\n\n@formula\ndef sphere'),
}
SPHERE = """
from numba.core import event
class Names(event.Listener):
    def on_start(self, event):
        print('compiled', event.data['dispatcher'].py_func.__name__)
    def on_end(self, event):
        pass
event.register('numba:compile', Names())
from collision_sim.core.shapes import sphere
print(sphere((0.0, 3.0, 4.0), 1.0)[0])
"""
SCALE, TABLE = 2.0, np.arange(3.0)


@pytest.fixture
def package(tmp_path):
    """Give a copy of the package, and a function that runs code with it: the lines it prints."""
    folder = tmp_path / 'collision_sim'
    shutil.copytree(Path(collision_sim.__file__).parent, folder,
                    ignore=shutil.ignore_patterns('__pycache__'))
    environment = {**os.environ, 'PYTHONPATH': str(tmp_path), 'PYTHONDONTWRITEBYTECODE': '1',
                   'NUMBA_CACHE_DIR': str(tmp_path / 'cache')}

    def run():
        return subprocess.run([sys.executable, '-c', SPHERE], env=environment, check=True,
                              cwd=tmp_path, capture_output=True, text=True).stdout.splitlines()
    return folder, run


def change(folder, name, old, new):
    source = (folder / name).read_text()
    assert old in source
    (folder / name).write_text(source.replace(old, new, 1))


def test_fields_count_in_their_order():
    """What is compiled finds a field of a NamedTuple by its number, which no bytecode says."""
    for path in Path(stamps.__file__).parent.glob('*.py'):
        lines = sum(stamps.FIELD.fullmatch(line) is not None
                    for line in path.read_bytes().splitlines())
        classes = [node for node in ast.walk(ast.parse(path.read_text()))
                   if isinstance(node, ast.ClassDef)
                   and [getattr(base, 'id', None) for base in node.bases] == ['NamedTuple']]
        assert lines >= len(classes) + sum(isinstance(line, ast.AnnAssign)
                                           for node in classes for line in node.body), path


@pytest.mark.jit
def test_what_a_function_does_not_use_recompiles_nothing(package):
    """One after the other; at the end a change that counts."""
    folder, run = package
    assert run()[-1] == '4.0' and run() == ['4.0']
    for change_of in CHANGES.values():
        change(folder, *change_of)
        assert run() == ['4.0'], change_of
    change(folder, *LENGTH)
    lines = run()
    assert 'compiled sphere' in lines and lines[-1] == '9.0'


@kernel
def scaled(x):
    """Give a multiple."""
    return SCALE * x


@entry
def summed(x):
    """Give a sum."""
    return scaled(x) + TABLE[1]


def stamp_with(monkeypatch, name, value):
    """Give the stamp of `summed` where a global value is another one."""
    monkeypatch.setattr(stamps, '_nodes', {})
    with monkeypatch.context() as patch:
        patch.setitem(summed_function().__globals__, name, value)
        return stamps.stamp(summed_function(), {})


def summed_function():
    return getattr(summed, 'py_func', summed)


@pytest.mark.jit
def test_values_count(monkeypatch):
    """Constants and arrays anywhere in what it calls, and how it is compiled."""
    before = stamp_with(monkeypatch, 'SCALE', 2.0)
    assert before == stamp_with(monkeypatch, 'TABLE', np.arange(3.0))
    for name, value in (('SCALE', 3.0), ('SCALE', 2), ('TABLE', np.arange(3)),
                        ('TABLE', np.array([0.0, 1.5, 2.0])), ('scaled', np.sqrt)):
        assert stamp_with(monkeypatch, name, value) != before, name
    assert stamps.stamp(summed_function(), {'fastmath': True}) != before


@pytest.mark.jit
def test_what_is_called_by_address_is_not_part_of_the_caller():
    """But of the one who opens it."""
    from collision_sim.core.opening import open_meshes
    from collision_sim.core.shapes import distances
    used, opened = ({function.__name__ for function in stamps.uses(each.py_func)}
                    for each in (distances, open_meshes))
    assert '_distance_to_mesh' in used and 'mesh_distance' not in used
    assert 'mesh_distance' in opened


@pytest.mark.jit
def test_all_that_is_compiled_into_an_entry_counts():
    """As Numba tells it, where nothing comes from the cache."""
    code = """
import tempfile
from numba import config
config.CACHE_DIR = tempfile.mkdtemp()
from numba.core import event
open_ones, compiled = [], set()
class Notes(event.Listener):
    def on_start(self, event):
        function = event.data['dispatcher'].py_func
        open_ones.append(function)
        compiled.add((open_ones[0], function))
    def on_end(self, event):
        open_ones.pop()
event.register('numba:compile', Notes())
import collision_sim
from collision_sim.core import stamps
scene = collision_sim.Scene.from_dict({'colliders': [{'name': 'ground', 'shape': 'plane'}]})
collision_sim.Simulation(scene).clearance()
ours = [pair for pair in compiled if pair[1].__module__.startswith('collision_sim')]
print(len(ours), [pair for pair in ours if pair[1] not in stamps.uses(pair[0])])
"""
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    count, missing = done.stdout.split(maxsplit=1)
    assert int(count) > 10 and missing == '[]\n'


def test_overloads_are_found_by_their_names():
    """A Python function has its overload beside it, with its name and an underscore."""
    folder = Path(stamps.__file__).parent
    for path in folder.glob('*.py'):
        lines = path.read_text().splitlines()
        for k, line in enumerate(lines):
            if '@overload(' in line:
                name = line.split('(')[1].split(')')[0]
                assert f'def _{name}(' in lines[k + 1], f'{path.name}:{k + 2}'
