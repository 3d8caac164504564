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

"""Particles of a simulation that collide event by event: the scratch of core/event_loop.py."""

from math import ceil

from collision_sim.core.contact_solver import make_pile, make_work
from collision_sim.core.event_cells import lay_out_grid
from collision_sim.core.event_loop import BEATS, step_gas
from collision_sim.core.event_state import (CLOCK, Gas, Grid, Heap, Impulses, make_states,
                                            NUMBERS, RADIUS)
from collision_sim.core.extrapolation import ROWS
from collision_sim.core.joint import make_room
from collision_sim.core.meeting import MET
from collision_sim.core.mesh_way import ANSWERS
from collision_sim.core.pairs import Matter
from collision_sim.core.reference import refer
from collision_sim.core.rules import NONE
from collision_sim.core.shapes import RESTITUTION
from collision_sim.core.surfaces import FACES
from collision_sim.core.world import refer_world
from collision_sim.tables import collider_table, pair_row
import numpy as np

MOST_CONTACTS = 1 << 16     # at once, beside SPARE
SPARE = 256
SWEEPS = 20                 # over the contacts for each of the scene's iterations
STRETCH = 64.0              # radii, or sizes of the whole, that particles go in a stretch at most


class EventPairs:
    """
    Particles that collide with each other by the method `exact`.

    Parameters
    ----------
    scene : Scene
        With pairs.

    """

    def __init__(self, scene):
        count = len(scene.particles.position)
        self._matter = Matter(_each(scene.particles.radius, count),
                              1.0 / _each(scene.particles.mass, count))
        self._scratch = self._simple = None
        contacts = min(6 * count, MOST_CONTACTS) + SPARE
        self._memory = Impulses(_nobody(count), _nobody(contacts), _nobody(contacts),
                                np.zeros((contacts, 3)))

    def __getstate__(self):
        """Give what a copy goes on from."""
        return {**vars(self), '_scratch': None}

    def adopt(self, scene, forces):
        """Take the values of a scene, and the forces in flight."""
        self._forces = forces
        friction = scene.pairs.friction_in(scene)
        laws = np.vstack([collider_table(scene), pair_row(scene)])
        calm = laws.copy()
        calm[:, RESTITUTION] = 0.0
        self._laws, self._sweeps = np.vstack([laws, calm]), SWEEPS * scene.stepping.iterations
        self._frictions = (friction.static is not None, friction.wet is not None)
        simple = not scene.colliders and forces.quadratic == 0.0
        if simple != self._simple:
            self._simple, self._scratch = simple, None

    def forget(self):
        """Forget the impulses of the last step."""
        self._memory.head[:] = NONE

    def step(self, dt, steps, world, courses):
        """
        Take the particles through some steps.

        Parameters
        ----------
        dt : float [s]
            Length of a step.
        steps : int
            How many.
        world : world.World
            Of the steps.
        courses : (S, C, COURSE) float64
            How the colliders move.

        """
        if not len(self._matter.radius):
            return
        if self._simple:
            stretches = self._stretches(steps * dt, world.x, world.v)
            dt, steps = steps * dt / stretches, stretches
        gas = refer(self._gas(dt, world, courses))
        step_gas(gas, dt, steps)

    def _stretches(self, duration, x, v):
        """
        Give into how many stretches to divide a time without colliders [s].

        In each, times are to be as exact as places.
        """
        way = duration * float(np.abs(v).max() + np.linalg.norm(self._forces.gravity) * duration)
        size = max(STRETCH * float(self._matter.radius.min()), float(np.abs(x).max()),
                   STRETCH * 1e-3 * float(self._matter.radius.max()))
        return max(1, ceil(way / size))

    def _gas(self, dt, world, courses):
        """Give all that the kernel needs."""
        if self._scratch is None:
            self._scratch = self._make_scratch(len(world.table))
        (states, links, ways, heap, struck, pressing, pile, room, everyone, work,
         met) = self._scratch
        count = len(states)
        origin, size, counts = lay_out_grid(
            world.x, 2.0 * float(self._matter.radius.max()), 8 * count)
        grid = Grid(np.empty(int(counts.prod()), dtype=np.int64), np.empty(count, dtype=np.int64),
                    counts, origin, size)
        dry, wet = self._frictions
        slow = 2.0 * float(np.linalg.norm(self._forces.gravity)) * dt / BEATS
        return Gas(
            refer_world(world), self._forces, courses, everyone, np.empty((0, ANSWERS)),
            self._matter, self._laws, world.rules.dry or dry,
            world.rules.wet or wet, dry, wet, float(self._laws[len(world.table), RESTITUTION]),
            self._simple, states, links, ways, np.zeros(CLOCK),
            np.zeros(NUMBERS, dtype=np.int64), grid, heap, struck, pressing, self._memory,
            pile, room, make_work(self._sweeps, slow), work, met)

    def _make_scratch(self, colliders):
        """Allocate what the kernel works with."""
        count = len(self._matter.radius)
        states, links, ways = make_states(count, self._simple)
        states[:, RADIUS] = self._matter.radius
        contacts = len(self._memory.whom)
        pile = make_pile(count + contacts, contacts + count, _nobody(count))
        heap = Heap(np.empty(count), _nobody(count), _nobody(count))
        return (states, links, ways, heap, np.empty(count, dtype=np.int64),
                np.empty(count, dtype=np.int64), pile, make_room(),
                np.arange(colliders), np.empty((ROWS, 6)), np.empty((FACES * colliders + 6, MET)))


def _nobody(count):
    """Give NONE for each of a number of things."""
    return np.full(count, NONE, dtype=np.int64)


def _each(value, count):
    """One number for each particle."""
    return np.broadcast_to(np.asarray(value, dtype=np.float64), count).copy()
