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
A case: a scene and a program of calls, and what comes of playing it.

A case is a plain mapping, so that it can be written to YAML, shrunk and pasted into a test:

- scene: as in a scene file; files: names and texts of the mesh files it reads, if any;
- ledger, contacts: whether they are kept;
- calls: a list of mappings of one entry. `step: n` takes n steps; `move: {name: [position,
  orientation]}` moves colliders over the next step, all at once; `place: {name: [...]}` teleports
  them; `set: {path: value}` changes parameters, all at once.
"""

import copy
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
import tempfile

from collision_sim import kinematics, Scene, Simulation, tables
from distances import distance
import numpy as np

UPRIGHT = [0.0, 0.0, 0.0, 1.0]
# Scripted poses are laid out for so many steps at once: for 64, which is nothing when compiled,
# plain Python takes longer than for all else in a step. And so what comes between is tried, too.
kinematics.AHEAD = 4


@dataclass(eq=False)
class Step:
    """
    One step of a run: states before and after it.

    x0, v0, x, v (N, 3); poses0, poses: of each collider (position, orientation) before and after;
    counters: how much each has grown; contacts, balance: of this step, None where not kept; scene:
    with the parameters that held.
    """

    x0: np.ndarray
    v0: np.ndarray
    x: np.ndarray
    v: np.ndarray
    poses0: list
    poses: list
    counters: dict
    contacts: object
    balance: object
    scene: Scene

    @cached_property
    def gaps(self):
        """Distances (C, 2, N) of the particles to each collider before and after [m]."""
        radius = self.scene.particles.radius
        return np.array([(distance(collider, before, self.x0) - radius,
                          distance(collider, after, self.x) - radius)
                         for collider, before, after in zip(
                             self.scene.colliders, self.poses0, self.poses)]
                        ).reshape(-1, 2, len(self.x))


def read(case):
    """Give the Scene of a case."""
    files = case.get('files')
    if not files:
        return Scene.from_dict(case['scene'])
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            (Path(folder) / name).write_text(text)
        return Scene.from_dict(case['scene'], folder)


class Remembered:
    """
    A function of arrays that keeps its last answers.

    A case is played a dozen times, and to build a mesh without the compiler takes ten times as
    long as to play it. The answers are copied into the tables of a simulation (mesh_build.joined).
    """

    def __init__(self, function, count=8):
        self.function, self.count, self.answers = function, count, {}

    def __call__(self, *arrays):
        """Return the answer for these arrays."""
        key = tuple((np.shape(array), np.asarray(array).tobytes()) for array in arrays)
        if key not in self.answers:
            if len(self.answers) == self.count:
                del self.answers[next(iter(self.answers))]
            self.answers[key] = self.function(*arrays)
        return self.answers[key]


if not isinstance(tables.mesh_arrays, Remembered):
    tables.mesh_arrays = Remembered(tables.mesh_arrays)


def simulate(case, **options):
    """Give the Simulation of a case before its first call."""
    options = {'contacts': case.get('contacts', True), 'ledger': case.get('ledger', False),
               **options}
    return Simulation(read(case), **options)


def call(sim, name, value):
    """Make one call of the program but `step`."""
    if name == 'move':
        sim.move_colliders(list(value), *([pose[k] for pose in value.values()] for k in (0, 1)))
    elif name == 'place':
        for collider, (position, orientation) in value.items():
            sim.place_collider(collider, position, orientation)
    else:
        sim.set_parameters(list(value.items()))


def play(case, sim=None, **options):
    """Give the Steps of a case, one for each single step."""
    sim = sim or simulate(case, **options)
    return [step for name, value in calls(case) for step in _play(sim, name, value)]


def calls(case):
    """Give the calls of a case as (name, value) pairs."""
    return [entry for one in case['calls'] for entry in one.items()]


def _play(sim, name, value):
    if name != 'step':
        call(sim, name, value)
        return
    for _ in range(value):
        x0, v0, counters, poses = state(sim)
        sim.step()
        x, v, after, poses1 = state(sim)
        yield Step(x0, v0, x, v, poses, poses1,
                   {key: after[key] - count for key, count in counters.items()},
                   sim.contacts if sim.record_contacts else None,
                   sim.ledger.last if sim.ledger else None, sim.scene)


def state(sim):
    """Give copies of places and velocities, the counters and the poses of the colliders."""
    return (sim.position.copy(), sim.velocity.copy(), sim.counters,
            [sim.collider_pose(collider.name) for collider in sim.scene.colliders])


def single_steps(case):
    """Give the case with each step by itself, so that calls can be put between them."""
    return {**case, 'calls': [entry for name, value in calls(case) for entry in (
        [{name: value}] if name != 'step' else [{'step': 1} for _ in range(value)])]}


def changed(case, **sections):
    """Give a deep copy of a case in which sections of the scene are others; None: absent."""
    case = copy.deepcopy(case)
    for key, value in sections.items():
        if value is None:
            case['scene'].pop(key, None)
        else:
            case['scene'][key] = value
    return case


def particles(case):
    """Give the count of particles of a case."""
    return len(case['scene']['particles']['position'])


def each(case, key, default):
    """Give a value of each particle, (N,)."""
    value = case['scene']['particles'].get(key, default)
    return np.broadcast_to(np.asarray(value, dtype=float), particles(case))


def stepping(case, key, default):
    """Give a value of the section `stepping`."""
    return case['scene'].get('stepping', {}).get(key, default)


def method(case):
    """Give the method of stepping."""
    return stepping(case, 'method', 'collision_then_contact')


def acts(case, name):
    """Say which colliders a call of that name acts on."""
    return {collider for key, value in calls(case) if key == name for collider in value}
