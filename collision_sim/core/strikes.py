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
The collision stage of particles with springs: it comes before the springs' forces of the step.

A collision changes the velocity at the start of the step, and with it what the springs do within
the step. So the candidates are laid out, who collides gets another velocity, and the candidates
are laid out anew from there (the order of Guendelman, Bridson and Fedkiw 2003): an elastic
collision then keeps the energy that the springs' integrator keeps. To add the change of velocity
to a candidate as it is would be right for forces that do not change within the step; on a spring
of frequency w it brings the relative energy 2 (w dt)^2 with each bounce.
"""

from collision_sim.core.broad_phase import radius_at
from collision_sim.core.detection import detect, foremost
from collision_sim.core.jit import entry, kernel
from collision_sim.core.mesh_way import ANSWERS
from collision_sim.core.response import collide
from collision_sim.core.rules import Here
from collision_sim.core.stepping import BLOCK
from collision_sim.core.threads import CLAIMED, ENTERED, fetch_add, LEFT
from collision_sim.core.vectors import add_scaled
import numpy as np


@kernel
def _strike_block(world, everyone, answers, block):
    """Collision stage of a block of particles; writes the velocities of those that collide."""
    u, end, x, v = world.candidates.u, world.poses.shape[0] - 1, world.x, world.v
    for i in range(block * BLOCK, min((block + 1) * BLOCK, x.shape[1])):
        here = Here(0, 0, end, block, i, radius_at(world.radius, i), everyone, answers,
                    everyone[:0])
        x0, v0 = (x[0, i], x[1, i], x[2, i]), (v[0, i], v[1, i], v[2, i])
        mean = (u[0, i], u[1, i], u[2, i])
        x1 = add_scaled(x0, world.rules.flight.dt, mean)
        touch, inside = detect(world, here, x0, x1, v0, mean, True)
        if inside > 1:
            touch, _, _, _ = foremost(world, here, touch, x0, x1, v0, mean)
        if inside and touch.hit:
            after = collide(world, here, touch, v0)
            v[0, i], v[1, i], v[2, i] = after


@entry
def strike_blocks(posted, counters, world):
    """
    Collision stage of all particles, each with one collider at most.

    Parameters
    ----------
    posted, counters : (1,), (SHARED,) int64
        Of threads.share.
    world : world.World
        With one step; velocities are written.

    """
    everyone = np.arange(world.table.shape[0])
    answers = np.empty((0, ANSWERS))
    fetch_add(posted, 0, 1)
    fetch_add(counters, ENTERED, 1)
    block = fetch_add(counters, CLAIMED, 1)
    while block < world.accounts.shape[0]:
        _strike_block(world, everyone, answers, block)
        block = fetch_add(counters, CLAIMED, 1)
    fetch_add(counters, LEFT, 1)
