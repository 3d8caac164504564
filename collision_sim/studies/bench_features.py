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
What each feature of a scene costs: the same scene without it, with it but neutral, and in use.

The scene without is the base, whose kernel has nothing of the feature. The base is measured twice,
as if it were another one: the difference is the noise.
"""

from concurrent.futures import ProcessPoolExecutor
import multiprocessing
import os
from statistics import median
from time import perf_counter
from typing import NamedTuple

from collision_sim.scene import Scene
from collision_sim.simulation import Simulation
from collision_sim.studies.bench_works import BALL, BLOCK, GROUND, write_torus
from tqdm import tqdm

BASE, AGAIN = 'base', 'base again'
NEUTRAL, USED = 'neutral', 'in use'
STEPS = 240
UP = 16.0               # m; height that the points start below: a fifth of them lands in a run
STILL = {'linear_velocity': [0.0, 0.0, 0.0], 'angular_velocity': [0.0, 0.0, 0.0]}
FIXED = {key: value for key, value in BLOCK.items() if key != 'motion'}
FAR = [0.0, 0.0, -1000.0]
MANY = 100              # boxes
TINY, SMALL = 1e-7, 0.01        # m; radii of particles that never meet, and that do


class Feature(NamedTuple):
    """
    A scene beside the base.

    Attributes
    ----------
    name, state : str
        What differs, and how: NEUTRAL or USED.
    sections : dict
        Of the scene, in place of those of the base.
    options : dict
        Of the Simulation.
    why : str
        What the state is.

    """

    name: str
    state: str
    sections: dict
    options: dict
    why: str


class Row(NamedTuple):
    """A measurement: best, median [ns a particle-step]; ratio: to the base; contacts: a step."""

    feature: str
    state: str
    why: str
    best: float
    median: float
    ratio: float
    contacts: float


def base(count):
    """Give the scene that has nothing: points fall past a ball and a box on the ground."""
    box = {'min': [-2.0, -2.0, 1.5], 'max': [2.0, 2.0, UP]}
    return {'particles': {'count': count, 'box': box}, 'colliders': [GROUND, BALL, FIXED]}


def features(count):
    """List the scenes beside the base, for so many particles."""
    particles = base(count)['particles']
    return [*_laws(), *_forces(), *_sizes(particles), *_colliders(), *_outputs(),
            *_coupled(particles, count)]


def _feature(name, state, why, **sections):
    return Feature(name, state, sections, {}, why)


def _laws():
    yield _feature('restitution', NEUTRAL, '0', restitution=0.0)
    yield _feature('restitution', USED, '0.5', restitution=0.5)
    yield _feature('dry friction', NEUTRAL, '0', friction={'dry': 0.0})
    yield _feature('dry friction', USED, '0.3', friction={'dry': 0.3})
    yield _feature('wet friction', NEUTRAL, '0', friction={'wet': 0.0})
    yield _feature('wet friction', USED, '2 s/m', friction={'wet': 2.0})


def _forces():
    yield _feature('linear drag', NEUTRAL, '0', drag={'linear': 0.0})
    yield _feature('linear drag', USED, '0.5/s', drag={'linear': 0.5})
    yield _feature('quadratic drag', NEUTRAL, '0', drag={'quadratic': 0.0})
    yield _feature('quadratic drag', USED, '0.1/m', drag={'quadratic': 0.1})


def _sizes(particles):
    yield _feature('radius', NEUTRAL, '0', particles={**particles, 'radius': 0.0})
    yield _feature('radius', USED, '1 cm', particles={**particles, 'radius': SMALL})


def _colliders():
    yield _with('moving collider', NEUTRAL, 'topic, not moved', {**FIXED, 'topic': 'block/pose'})
    yield _with('moving collider', NEUTRAL, 'script, velocity 0', {**FIXED, 'motion': STILL})
    yield _with('moving collider', USED, 'moves and turns', BLOCK)
    capsule = {'name': 'capsule', 'shape': 'capsule', 'radius': 0.2, 'length': 0.5}
    cylinder = {'name': 'cylinder', 'shape': 'cylinder', 'radius': 0.2, 'length': 0.5}
    for state, why, places in ((NEUTRAL, 'far away', (FAR, FAR)),
                               (USED, 'near', ([1.0, 1.0, 0.5], [1.0, -1.0, 0.5]))):
        yield _with('two more shapes', state, why, FIXED,
                    *({**shape, 'position': place}
                      for shape, place in zip((capsule, cylinder), places)))
    mesh = {'name': 'torus', 'shape': 'mesh', 'file': 'torus.obj', 'scale': 0.5}
    yield _with('mesh', NEUTRAL, 'far away', FIXED, {**mesh, 'position': FAR})
    yield _with('mesh', USED, 'near', FIXED, {**mesh, 'position': [0.0, 1.0, 0.3]})
    for state, why, middle in ((NEUTRAL, 'far away', FAR), (USED, 'near', [0.0, 0.0, 0.1])):
        yield _with(f'{MANY} boxes', state, why, *_boxes(middle))


def _with(name, state, why, *others):
    """Give the base with other colliders than the box, which is the first of them."""
    return _feature(name, state, why, colliders=[GROUND, BALL, *others])


def _boxes(middle):
    """Give the box of the base and many small ones in a square about a place."""
    yield FIXED
    for k in range(MANY):
        place = [0.4 * (k % 10) - 1.8 + middle[0], 0.4 * (k // 10) - 1.8 + middle[1], middle[2]]
        yield {'name': f'box_{k}', 'shape': 'box', 'size': [0.1, 0.1, 0.1], 'position': place}


def _outputs():
    yield Feature('contacts', USED, {}, {'contacts': True}, 'recorded')
    yield Feature('ledger', USED, {}, {'ledger': True}, 'kept')
    yield _feature('detection', USED, 'trajectory', stepping={'detection': 'trajectory'})


def _coupled(particles, count):
    balls = ({**particles, 'radius': size} for size in (TINY, SMALL))
    for state, why, each in zip((NEUTRAL, USED), ('radii too small to meet', '1 cm'), balls):
        yield _feature('pairs', state, why, particles=each, pairs={'restitution': 0.5})
    yield _feature('springs', NEUTRAL, 'one',
                   springs={'pairs': [[0, 1]], 'stiffness': 100.0, 'damping': 0.1})
    yield _feature('springs', USED, 'half as many as particles', springs={
        'pairs': [[k, k + 1] for k in range(0, count - 1, 2)], 'stiffness': 100.0,
        'damping': 0.1})


def build(feature, count, threads, folder):
    """Give the simulation of a feature."""
    scene = Scene.from_dict({**base(count), **feature.sections}, folder)
    return Simulation(scene, **{'contacts': False, 'threads': threads, **feature.options})


def _compile(feature, count, folder):
    build(feature, count, 1, folder).step()


def compile_all(rows, count, folder):
    """Compile what is missing in the cache, on all cores, with a progress bar."""
    with ProcessPoolExecutor(os.cpu_count(), multiprocessing.get_context('spawn')) as pool:
        jobs = [pool.submit(_compile, feature, count, folder) for feature in rows]
        for job in tqdm(jobs, desc='compiling', disable=None, leave=False):
            job.result()


def run_time(sim, steps):
    """Give the run time of some steps from the start [s]."""
    sim.reset()
    began = perf_counter()
    for _ in range(steps):
        sim.step()
    return perf_counter() - began


def measure(count, threads, repeats, folder, steps=STEPS):
    """
    Measure the base and all features, in turn.

    Parameters
    ----------
    count : int
        Of the particles.
    threads : int
        Most to use.
    repeats : int
        Turns.
    folder : Path
        For files of the scenes.
    steps : int
        Of one run.

    Returns
    -------
    rows : list of Row
        The base first, then the base again.

    """
    write_torus(folder / 'torus.obj')
    scenes = [Feature(name, '', {}, {}, '') for name in (BASE, AGAIN)] + features(count)
    compile_all(scenes[1:], count, folder)
    sims = [build(feature, count, threads, folder) for feature in scenes]
    times = [[] for _ in sims]
    with tqdm(total=repeats * len(sims), unit='run', disable=None, leave=False) as bar:
        for _ in range(repeats):
            for feature, sim, found in zip(scenes, sims, times):
                bar.set_description(f'{feature.name} {feature.why}'.strip())
                found.append(run_time(sim, steps))
                bar.update()
    return [_row(feature, sim, found, min(times[0]), steps)
            for feature, sim, found in zip(scenes, sims, times)]


def _row(feature, sim, times, reference, steps):
    taken = steps * len(sim.position)
    touched = (sim.counters['collisions'] + sim.counters['contacts']) / taken
    return Row(feature.name, feature.state, feature.why, 1e9 * min(times) / taken,
               1e9 * median(times) / taken, min(times) / reference, touched)
