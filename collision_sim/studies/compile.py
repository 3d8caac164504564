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
`collision_sim compile`: compiles beforehand what scenes need, as for an image or before a lesson.

What is compiled is kept in Numba's cache on disk, so all that has to be done is to take steps, in
processes of their own: of the scenes that are asked for, or of small ones that need all there is.
"""

from importlib.util import find_spec
import os
from pathlib import Path
import sys
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import NamedTuple

from collision_sim.core import jit
from collision_sim.core.stepping import step_blocks
from collision_sim.preparing import prepare
from collision_sim.scene import load_scene, Scene, shipped_scenes
from collision_sim.studies.processes import Pool
from numba import config
from numba.core import event
from tqdm import tqdm

DESCRIPTION = """\
Compiles what the steps of scenes need and keeps it in Numba's cache, where every program of this
user on such a machine finds it. Without a scene: all modules there are, whatever a scene needs.
What is there already is not compiled again."""
EPILOG = """\
examples:
  collision_sim compile                         # all modules, once after installing
  collision_sim compile demo my.yaml
  NUMBA_CACHE_DIR=/opt/numba collision_sim compile      # in an image; set it there at a run, too

shipped scenes: """
FAILED = 1

BALLS = {'position': [[0.0, 0.0, 0.5], [0.04, 0.0, 0.5], [1.0, 0.0, 0.0]], 'radius': 0.05}
SIZES = {**BALLS, 'radius': [0.05, 0.05, 0.1]}
GROUND = {'name': 'ground', 'shape': 'plane'}
BASE = {'particles': {'position': [[0.0, 0.0, 0.5], [1.0, 0.0, 0.0]]}, 'colliders': [GROUND]}
SPRINGS = {'pairs': [[0, 1]], 'stiffness': 10.0, 'damping': 0.1}
MOVED = {'name': 'moved', 'shape': 'box', 'size': [1, 1, 1], 'position': [5, 0, 0]}
TETRAHEDRON = 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n'


def _stepping(**values):
    return {'stepping': values}


# Scenes that need the modules, the most expensive ones first.
MODULES = {
    'steps': BASE,
    'exact': {**BASE, **_stepping(method='exact')},
    'pairs': {**BASE, 'particles': BALLS, 'pairs': {'restitution': 0.5}},
    'pairs of different sizes': {**BASE, 'particles': SIZES, 'pairs': {'restitution': 0.5}},
    'pairs, paths': {**BASE, 'particles': BALLS, 'pairs': {'restitution': 0.5},
                     **_stepping(detection='trajectory')},
    'meshes': {**BASE, 'colliders': [{'name': 'mesh', 'shape': 'mesh', 'file': 'mesh.obj'}]},
    'paths': {**BASE, **_stepping(detection='trajectory')},
    'second order': {**BASE, **_stepping(method='second_order_contact')},
    'springs': {**BASE, 'springs': SPRINGS},
    'implicit springs': {**BASE, 'springs': {**SPRINGS, 'solver': 'implicit'}},
    'poses': {**BASE, 'colliders': [GROUND, {**MOVED, 'topic': 'moved/pose'}]},
    'scripts': {**BASE, 'colliders': [GROUND, {**MOVED, 'motion': {
        'angular_velocity': [0, 0, 1]}}]},
    'scripts, exact': {**BASE, 'colliders': [GROUND, {**MOVED, 'motion': {
        'angular_velocity': [0, 0, 1]}}], **_stepping(method='exact')},
    'many colliders': {**BASE, 'colliders': [
        {'name': f'ball_{k}', 'shape': 'sphere', 'radius': 0.1, 'position': [k, 5.0, 0.0]}
        for k in range(60)]},
    'many particles': {**BASE, 'particles': {
        'count': 5000, 'box': {'min': [-1, -1, 1], 'max': [1, 1, 2]}}},
    'ledger': BASE,
    'ledger, exact': {**BASE, **_stepping(method='exact')},
    'ledger, pairs': {**BASE, 'particles': BALLS, 'pairs': {'restitution': 0.5}},
    'ledger, springs': {**BASE, 'springs': SPRINGS},
}


class Done(NamedTuple):
    """What preparing took: functions compiled and lost, seconds; what was raised, or ''."""

    compiled: int
    lost: int
    seconds: float
    error: str


class _Count(event.Listener):
    """Counts what is compiled."""

    def __init__(self):
        self.count = 0

    def on_start(self, event):
        """Count it."""
        self.count += 1

    def on_end(self, event):
        """Do nothing."""


def add_arguments(parser):
    """Declare the options."""
    parser.description, parser.epilog = DESCRIPTION, EPILOG + ', '.join(shipped_scenes())
    parser.add_argument('scenes', nargs='*', metavar='SCENE',
                        help='a YAML file, or the name of a shipped scene; none: all modules')


def run(arguments):
    """
    Compile, and say what was compiled, how long it took and where it is.

    Returns
    -------
    code : int
        0 where all is in the cache now, else FAILED.

    """
    if config.DISABLE_JIT:
        return _refuse('NUMBA_DISABLE_JIT is set, so nothing is ever compiled')
    folder = _folder()
    if folder is None:
        return _refuse('no folder for the cache can be written to; set NUMBA_CACHE_DIR to one')
    scenes = [(name, load_scene(name), False) for name in arguments.scenes] or _modules()
    began = perf_counter()
    results = _prepare_all(scenes)
    compiled = sum(done.compiled for done in results.values())
    if compiled:
        print(f'{compiled} functions compiled in {perf_counter() - began:.1f} s')
    else:
        print(f'everything is there (looked for {perf_counter() - began:.1f} s)')
    print(f'cache: {folder}')
    return _judge(results)


def _folder():
    """Give the folder of the cache, None where there is none."""
    return step_blocks.stats.cache_path


def _refuse(why):
    print(f'collision_sim: {why}', file=sys.stderr)
    return FAILED


def _modules():
    """Give the scenes of all modules, by name, and whether with a ledger."""
    with TemporaryDirectory() as folder:
        (Path(folder) / 'mesh.obj').write_text(TETRAHEDRON)
        return [(name, Scene.from_dict(scene, folder), name.startswith('ledger'))
                for name, scene in MODULES.items()
                if name != 'implicit springs' or find_spec('scipy')]


def _prepare_all(scenes):
    """Prepare scenes, with a progress bar; a Done for each name."""
    results, calls = {}, [(name, (scene, ledger)) for name, scene, ledger in scenes]
    count = min(os.cpu_count() or 1, len(calls))
    with Pool(count) as pool, tqdm(total=len(calls), desc='compiling', unit='scene', leave=False,
                                   disable=None) as bar:
        for name, done, reason in pool.each(_prepare, calls):
            results[name] = done = done or Done(0, 0, 0.0, reason)
            if done.compiled:
                tqdm.write(f'{name}: {done.compiled} functions, {done.seconds:.1f} s')
                sys.stdout.flush()
            bar.update()
    return results


def _prepare(scene, ledger):
    """Prepare a scene in this process; raises nothing."""
    began, count, error = perf_counter(), _Count(), ''
    lost = jit.KernelCache.lost
    try:
        with event.install_listener('numba:compile', count):
            prepare(scene, ledger)
    except Exception as raised:
        error = f'{type(raised).__name__}: {raised}'
    return Done(count.count, jit.KernelCache.lost - lost, perf_counter() - began, error)


def _judge(results):
    """Say what has gone wrong; the exit code."""
    code = 0
    for name, done in results.items():
        if done.error:
            code = _refuse(f'{name}: {done.error}')
    lost = sum(done.lost for done in results.values())
    if lost:
        code = _refuse(f'{lost} functions could not be written to the cache')
    return code
