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
Compile what the steps of a scene need, or load it, without touching a simulation that is in use.

What happens at a first touch is called here too: that of two particles, and of a pose that comes
from outside.
"""

from dataclasses import replace
import time

from collision_sim.core.pose_table import prepare as prepare_streams
from collision_sim.core.threads import prepare_waiting
from collision_sim.kinematics import Kinematics
from collision_sim.particles import Particles
from collision_sim.simulation import Simulation
import numpy as np


def prepare(scene, ledger=False):
    """
    Make all kernels ready that a simulation of a scene may need.

    Parameters
    ----------
    scene : Scene
        Left as it is.
    ledger : bool
        Whether accounts of energy are kept.

    Returns
    -------
    duration : float [s]
        Of a step, once its kernels are ready.

    """
    simulation = Simulation(scene, ledger=ledger)
    simulation.step()
    simulation.clearance()
    duration = min(_timed(simulation.step) for _ in range(3))   # others may hold up one of them
    if len(simulation._accounts) > 1:       # blocks, for several threads
        prepare_waiting()
    if scene.pairs:
        Simulation(_met(scene), ledger=ledger).step()
    follows = [collider.name for collider in scene.colliders if collider.topic is not None]
    if follows:
        prepare_streams()
        colliders = Kinematics(scene)
        position, orientation = colliders.pose(follows[0])
        colliders.move(follows[:1], [position], [orientation], None, 1.0)
    return duration


def _timed(call):
    """Return how long a call takes [s]."""
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def _met(scene):
    """Give the scene with two particles that touch, of different radii if it has such."""
    radii = np.unique(np.atleast_1d(scene.particles.radius))
    radius = float(radii[-1:].sum()) or 1.0
    position = np.array([[0.0, 0.0, 0.0], [0.5 * radius, 0.0, 0.0]])
    sizes = radius if radii.size < 2 else np.array([radius, 0.5 * radius])
    return replace(scene, springs=None, particles=Particles(
        position, np.zeros((2, 3)), np.ones(2) if np.ndim(scene.particles.mass) else 1.0, sizes))
