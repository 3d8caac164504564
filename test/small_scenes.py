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
Small scenes for the tests of the core, and how to measure an order of convergence.

Both kinds of friction are always there, at 0 unless a test says otherwise: that is the same as no
friction bit for bit (test_absent.py), and tests then share the compiled kernels. For the same
reason scenes with a shape of their own get far away colliders of all shapes (`FAR`).
"""

from collision_sim import Scene, Simulation
import numpy as np

G = 9.81
EPSILON = 2.0 ** -52
METHODS = ('single_pass', 'multi_pass', 'collision_then_contact', 'second_order_contact')
FIRST_ORDER, STAGED = METHODS[:3], METHODS[2:]      # on curved surfaces; with a collision stage
FLIGHTS = ('ballistic', 'symplectic_euler')
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
FAR = [{'name': 'far_plane', 'shape': 'plane', 'point': [0, 0, -1e9]},
       {'name': 'far_sphere', 'shape': 'sphere', 'radius': 1, 'position': [0, 0, -1e9]},
       {'name': 'far_box', 'shape': 'box', 'size': [1, 1, 1], 'position': [0, 0, -1e9]},
       {'name': 'far_capsule', 'shape': 'capsule', 'radius': 1, 'length': 1,
        'position': [0, 0, -1e9]},
       {'name': 'far_cylinder', 'shape': 'cylinder', 'radius': 1, 'length': 1,
        'position': [0, 0, -1e9]}]


def simulate(colliders, position, velocity=(0.0, 0.0, 0.0), *, gravity=(0.0, 0.0, -G), dt=1 / 240,
             method='collision_then_contact', flight='ballistic', restitution=0.0, friction=None,
             stepping=None, particles=None, contacts=True, threads=None, ledger=False, **sections):
    """Make a simulation of the particles at `position`, (3,) or (N, 3), in a scene."""
    position = np.atleast_2d(np.asarray(position, dtype=float))
    scene = {
        'gravity': list(gravity),
        'particles': {'position': position, 'velocity': velocity, **(particles or {})},
        'restitution': restitution,
        'friction': {'dry': 0.0, 'wet': 0.0, **(friction or {})},
        'colliders': list(colliders),
        'stepping': {'dt': dt, 'method': method, 'flight': flight, **(stepping or {})},
        **sections}
    return Simulation(Scene.from_dict(scene), contacts=contacts, threads=threads, ledger=ledger)


def plane(normal=(0.0, 0.0, 1.0), point=(0.0, 0.0, 0.0), name='ground', **keys):
    """Give a half space; particles stay on the side that the normal points to."""
    return {'name': name, 'shape': 'plane', 'point': list(point), 'normal': list(normal), **keys}


def sphere(radius=1.0, position=(0.0, 0.0, 0.0), name='ball', **keys):
    """Give a ball, or with `inside` a bowl."""
    return {'name': name, 'shape': 'sphere', 'radius': radius, 'position': list(position), **keys}


def box(size=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0), name='box', **keys):
    """Give a box by its edge lengths."""
    return {'name': name, 'shape': 'box', 'size': list(size), 'position': list(position), **keys}


def incline(angle, **keys):
    """Give a plane that rises towards +x at an angle [rad]."""
    return plane((-np.sin(angle), 0.0, np.cos(angle)), **keys)


def root_mean_square(errors):
    """Root mean square of an array of errors."""
    return float(np.sqrt(np.mean(np.square(errors))))


def order(steps, errors):
    """Order of convergence: slope of log(error) over log(dt) by regression."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def swinging_wall(eps):
    """
    Particles that fall with 2 m/s on a wall that oscillates with 0.05 m at 1.3 Hz, weightless.

    Returns
    -------
    wall : dict
        The collider.
    start : (100, 3) float64 [m]
    after : (100,) float64 [m/s]
        T23: V - eps (v - V) with the velocity V of the wall at the hit.
    place : callable
        Height of each particle [m] at a time [s] after its hit.

    """
    amplitude, frequency, count = 0.05, 1.3, 100
    phase = 2.0 * np.pi * frequency
    start = np.zeros((count, 3))
    start[:, 2] = 0.5 + 0.2 * np.arange(count) / count
    hit = np.full(count, 0.2)
    for _ in range(50):     # Newton: z - 2 t = A sin(w t)
        gap = start[:, 2] - 2.0 * hit - amplitude * np.sin(phase * hit)
        hit -= gap / (-2.0 - amplitude * phase * np.cos(phase * hit))
    speed = amplitude * phase * np.cos(phase * hit)
    after = speed - eps * (-2.0 - speed)
    swing = {'axis': [0, 0, 1], 'amplitude': amplitude, 'frequency': frequency}
    return (plane(motion={'oscillate': swing}), start, after,
            lambda time: amplitude * np.sin(phase * hit) + after * (time - hit))
