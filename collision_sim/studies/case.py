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
What a scene with a known answer consists of, and the pieces that several of them share.

All scenes hold a plane and a ball, if need be far away, and both kinds of friction, if need be 0:
so they share their compiled kernels.
"""

from collections.abc import Callable
from math import inf
from typing import NamedTuple

import numpy as np

G = 9.81
GOLDEN = 0.5 * (5.0 ** 0.5 - 1.0)
FAR = [{'name': 'far_plane', 'shape': 'plane', 'point': [0, 0, -1e6]},
       {'name': 'far_ball', 'shape': 'sphere', 'radius': 1.0, 'position': [0, 0, -1e6]}]
FIRST_TWO = ('single_pass', 'multi_pass')


class Case(NamedTuple):
    """
    A scene and its answer.

    Attributes
    ----------
    name, title : str
        For file names, and for people.
    scene : dict
        As in a file; how to step is put in by who runs it.
    duration : float [s]
        From the start to the end of the comparison.
    reference : callable
        Times (T,) [s] -> positions and velocities, two arrays (T, N, 3) [m], [m/s].
    theory : callable
        Setting -> expected order of the position error; inf: exact to rounding; None: unknown.
    why : str
        What that order comes from.
    scale : float [m]
        Size of the scene.
    lost : float [m]
        Who is further off than that at the end is lost.
    uncertainty : float [m]
        Error of the reference itself, RMS.

    """

    name: str
    title: str
    scene: dict
    duration: float
    reference: Callable
    theory: Callable
    why: str
    scale: float = 1.0
    lost: float = 1.0
    uncertainty: float = 0.0


def spread(count, low, high, seed=0):
    """Numbers between low and high, evenly spread; another order for another seed."""
    return low + (high - low) * np.mod(GOLDEN * (np.arange(count) + 0.5) + 0.37 * seed, 1.0)


def columns(*parts):
    """Join x, y, z, each a number or an array, to vectors (..., 3)."""
    return np.stack(np.broadcast_arrays(*parts), axis=-1).astype(float)


def plane(normal=(0.0, 0.0, 1.0), name='ground', **keys):
    """Give a half space through the origin."""
    return {'name': name, 'shape': 'plane', 'normal': list(normal), **keys}


def scene(colliders, position, velocity=(0.0, 0.0, 0.0), *, gravity=G, dry=0.0, **sections):
    """Make a scene of particles and colliders in a common form."""
    shapes = {collider['shape'] for collider in colliders}
    return {'gravity': [0.0, 0.0, -gravity],
            'particles': {'position': position, 'velocity': velocity},
            'friction': {'dry': dry, 'wet': 0.0},
            'colliders': colliders + [far for far in FAR if far['shape'] not in shapes],
            **sections}


def by_method(usual, first_two=None, second_order=None, euler=1.0):
    """
    Give the orders of a scene.

    Parameters
    ----------
    usual : float
        Order of `collision_then_contact`.
    first_two : float, optional
        Order of `single_pass` and `multi_pass` where it is another one.
    second_order : float, optional
        Order of `second_order_contact` where it is another one.
    euler : float
        The most that symplectic Euler leaves of it.

    Returns
    -------
    theory : callable
        Of a Setting, as Case.theory.

    """
    def theory(setting):
        if setting.method == 'exact':
            return inf
        order = usual
        if setting.method in FIRST_TWO and first_two is not None:
            order = first_two
        if setting.method == 'second_order_contact' and second_order is not None:
            order = second_order
        return min(order, euler) if setting.flight == 'symplectic_euler' else order
    return theory


def bounces(times, height, eps):
    """Height and velocity of drops that bounce (T01): v1 = sqrt(2 g h), eps v1, eps^2 v1, ..."""
    t = times[:, None]
    speed = np.sqrt(2.0 * G * height)
    start, up = -speed / G, speed * np.ones_like(t)      # as if thrown up before
    z = v = 0.0 * up
    while (start < times[-1]).any():
        s = t - start
        z = np.where(s >= 0.0, up * s - 0.5 * G * s ** 2, z)
        v = np.where(s >= 0.0, up - G * s, v)
        start, up = start + 2.0 * up[0] / G, eps * up
    return z, v


def slide(start, velocity, deceleration, carrier=0.0):
    """
    Straight slides that friction stops.

    Parameters
    ----------
    start, velocity : (N, 3) float [m], [m/s]
        At time 0, the velocity relative to what carries.
    deceleration : float [m/s^2]
        Of that velocity.
    carrier : float or (3,) [m/s]
        Velocity of what carries.

    Returns
    -------
    reference : callable
        As Case.reference.

    """
    speed = np.linalg.norm(velocity, axis=1)
    stop = speed / deceleration

    def reference(times):
        t = np.minimum(times[:, None], stop)
        path = t - 0.5 * deceleration * t ** 2 / speed
        share = 1.0 - t / stop
        ride = np.asarray(carrier) * times[:, None, None]
        return (start + velocity * path[..., None] + ride,
                velocity * share[..., None] + np.asarray(carrier))
    return reference
