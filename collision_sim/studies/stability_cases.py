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
What a case of the stability report is, and the scenes it is made of.

The scenes share few sets of features, because each set compiles its own kernels: both kinds of
friction are always there, at 0 unless a case asks for more, and so are all shapes, far away. That
is the same bit for bit as without them. Where impacts are looked for along the path, whose kernels
take longest to compile, something moves, too: the last of the far colliders, with the velocity 0.
"""

from dataclasses import dataclass, field
import math
import time
from typing import Callable, Mapping, NamedTuple

from collision_sim.scene import Scene
from collision_sim.simulation import Simulation
import numpy as np

G = 9.81
EPSILON = 2.0 ** -52
WEIGHTLESS = (0.0, 0.0, 0.0)
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
AWAY = [0.0, 0.0, -1e15]
FAR = [{'name': 'far_sphere', 'shape': 'sphere', 'radius': 1, 'position': AWAY},
       {'name': 'far_box', 'shape': 'box', 'size': [1, 1, 1], 'position': AWAY},
       {'name': 'far_capsule', 'shape': 'capsule', 'radius': 1, 'length': 1, 'position': AWAY},
       {'name': 'far_cylinder', 'shape': 'cylinder', 'radius': 1, 'length': 1, 'position': AWAY},
       {'name': 'far_plane', 'shape': 'plane', 'point': AWAY}]

PATIENCE = 20.0         # s of run time after which steps that are watched are given up

FIRST_TWO = ('single_pass', 'multi_pass')
GAINS = ('a bounce answers the mean velocity of the step and so gains the energy g v dt; large '
         'where g dt is not small against v')
HOPS = ('with restitution they answer the -g dt / 2 of a step at rest with a hop, as the lecture '
        'warns of the block on the incline')


class TooSlow(Exception):
    """Steps took more than PATIENCE; its argument is the run time [s]."""


class Check(NamedTuple):
    """One criterion: what is measured and its unit; it holds while figure <= bound."""

    what: str
    figure: float
    bound: float

    @property
    def holds(self):
        """Whether the figure keeps its bound; NaN does not."""
        return bool(self.figure <= self.bound)


@dataclass(frozen=True)
class Case:
    """
    A case of the report.

    Attributes
    ----------
    name : str
        Group and parameters.
    measure : callable
        From a method to a list of Check, the one that the case is about first. All must hold.
    flaw : str
        Why the first check is expected to fail; empty where it is not. The others must hold.
    flawed : tuple of str or None
        The methods that have the flaw; None: all.
    absent : mapping of str to str
        Methods to which the case does not apply, and why.

    """

    name: str
    measure: Callable
    flaw: str = ''
    flawed: tuple | None = None
    absent: Mapping = field(default_factory=dict)

    def expects_failure(self, method):
        """Whether the first check is expected to fail with a method."""
        return bool(self.flaw) and (self.flawed is None or method in self.flawed)


def build(method, colliders, position, velocity=(0.0, 0.0, 0.0), *, gravity=(0.0, 0.0, -G),
          dt=1 / 240, eps=0.0, dry=0.0, wet=0.0, form='exponential', detection='end_of_step',
          **sections):
    """
    Make a simulation.

    Parameters
    ----------
    method, detection : str
        Of the stepping.
    colliders : list of dict
        As in a scene.
    position, velocity : (3,) or (N, 3) float [m], [m/s]
        Of the particles.
    gravity : (3,) float [m/s^2]
        Acceleration of free fall.
    dt : float [s]
        Length of a step.
    eps, dry, wet : float [-], [-], [s/m]
        Restitution and coefficients of friction.
    form : str
        Of wet friction.
    **sections
        Further sections of the scene.

    Returns
    -------
    Simulation

    """
    far = [*FAR[:-1], {**FAR[-1], 'motion': {}}] if detection == 'trajectory' else FAR
    return Simulation(Scene.from_dict({
        'gravity': list(gravity), 'restitution': eps,
        'friction': {'dry': dry, 'wet': {'coefficient': wet, 'form': form}},
        'particles': {'position': np.atleast_2d(np.asarray(position, dtype=float)),
                      'velocity': velocity},
        'colliders': [*colliders, *far],
        'stepping': {'dt': dt, 'method': method, 'detection': detection}, **sections}))


def plane(normal=(0.0, 0.0, 1.0), point=(0.0, 0.0, 0.0), name='ground', **keys):
    """Give a half space; particles stay on the side that the normal points to."""
    return {'name': name, 'shape': 'plane', 'point': list(point), 'normal': list(normal), **keys}


def sphere(radius=1.0, position=(0.0, 0.0, 0.0), name='ball', **keys):
    """Give a ball, or with `inside` a bowl."""
    return {'name': name, 'shape': 'sphere', 'radius': radius, 'position': list(position), **keys}


def box(size=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0), name='box', **keys):
    """Give a box by its edge lengths."""
    return {'name': name, 'shape': 'box', 'size': list(size), 'position': list(position), **keys}


def incline(angle):
    """Give a plane that rises towards +x at an angle [rad]."""
    return plane((-math.sin(angle), 0.0, math.cos(angle)))


def wedge(half_angle, **keys):
    """Give two planes that make a groove along y, open upwards."""
    c, s = math.cos(half_angle), math.sin(half_angle)
    return [plane((c, 0.0, s), name='left', **keys), plane((-c, 0.0, s), name='right', **keys)]


def track(sim, steps, before_step=None):
    """
    Take steps one by one.

    Parameters
    ----------
    sim : Simulation
        Its state changes.
    steps : int
        How many.
    before_step : callable or None
        Called with the number of each step before it is taken.

    Returns
    -------
    x, v : (steps + 1, N, 3) float64 [m], [m/s]
        Positions and velocities, those at the start included.
    clear : (steps + 1, N) float64 [m]
        Signed distance to the nearest collider.

    Raises
    ------
    TooSlow
        After PATIENCE.

    """
    begin = math.inf        # starts after the first step, in which the kernels are compiled
    rows = [(sim.position.copy(), sim.velocity.copy(), sim.clearance())]
    for k in range(steps):
        if before_step:
            before_step(k)
        sim.step()
        rows.append((sim.position.copy(), sim.velocity.copy(), sim.clearance()))
        begin = min(begin, time.perf_counter())
        if time.perf_counter() - begin > PATIENCE:
            raise TooSlow(time.perf_counter() - begin)
    return tuple(np.array(column) for column in zip(*rows))


def speed(velocity):
    """Size of velocities along the last axis."""
    return np.sqrt(np.square(velocity).sum(axis=-1))


def outside(x, clear):
    """Nobody is inside a collider by more than the rounding of a position."""
    depth = -np.min(clear)
    return Check('depth inside / m', float(depth), 64 * EPSILON * float(1.0 + np.abs(x).max()))


def at_most(what, figures, bound):
    """Give the check that the largest of some figures keeps a bound; NaN does not."""
    return Check(what, float(np.max(figures)), float(bound))
