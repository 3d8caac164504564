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
Particles that collide with each other, event by event: what is kept of each, and where it is.

Each particle has a time of its own: where its path began. Paths do not wait for each other, only
who meets somebody is brought up to date. Free flights of all have the same acceleration, so that
relative to each other they are straight; other paths are those of paths.py. Times count from the
start of the step.
"""

from math import inf
from typing import NamedTuple

from collision_sim.core.contact_solver import Pile, Work
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.joint import Room
from collision_sim.core.pairs import Matter
from collision_sim.core.paths import decay, Path, state_at
from collision_sim.core.rules import NONE
from collision_sim.core.surfaces import Spot
from collision_sim.core.sustained import Forces, smooth
from collision_sim.core.vectors import add_scaled, length
from collision_sim.core.world import World
import numpy as np

# Columns of the states: place [m], velocity [m/s], when its path began [s], radius [m]; when it
# meets another particle, when its path ends, when it leaves its cell, when it collided last [s];
# guess for a step of the integrator [s]; until when forces have acted on it where it presses [s];
# when it would meet somebody else, that was seen when it looked [s].
(X, V, SINCE, RADIUS, MEETS, ENDS, LEAVES, LATEST, PACE, FORCED, NEXT_BEST, STATE) = (
    0, 3, 6, 7, 8, 9, 10, 11, 12, 13, 14, 16)
# Columns of the links: previous particle in the cell, number of the cell, its place in the grid;
# who is met, and the age that it had then; own age: how often its path has changed; how it moves;
# collisions without time in between, and rounds in all; round in which it was struck last, and its
# row there; whether a contact was counted; surface that has released it.
(BEFORE, CELL, AT, OTHER, OTHER_AGE, AGE, KIND, RAPID, HITS, ROUND, ROW, COUNTED, RELEASED,
 LINK) = (0, 1, 2, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 16)
# Kinds: free flight, other paths, straight on from beat to beat, and held by a fail-safe.
FREE, BOUND, PRESSES, FROZEN = 0, 1, 2, 3
# Columns of the ways: a path, and how it ends: surface it stops on, one that it is released
# by; whether it slides without friction; velocity at the end of the step of who is pushed out.
(MODE, HOLDS, FIRST_X, FIRST_V, CLOSED, ACCELERATION, DECAY, BEND, STIFF, STOPPED, FREED, GLIDING,
 AFTER, WAY) = (0, 1, 4, 7, 10, 11, 14, 15, 16, 17, 18, 19, 20, 24)
# Entries of the clock [s]: end of the step, when the next beat of those that press begins, how
# long one is, and when none begins any more.
END, SETTLES, BEAT, LAST, CLOCK = 0, 1, 2, 3, 8
# Entries of the numbers: rounds so far, particles in this one, those that press, row of the poses.
ROUNDS, STRUCK, PRESSING, STEP, NUMBERS = 0, 1, 2, 3, 8


class Grid(NamedTuple):
    """
    Cells of a grid that is wound up: cells a whole turn apart share a number.

    head (M,) int64: first particle of each cell; after (N,) int64: next one in the cell; counts
    (3,) int64: cells of a turn, powers of two; origin (3,), size [m]: where the grid begins, and
    the side of a cell.
    """

    head: np.ndarray
    after: np.ndarray
    counts: np.ndarray
    origin: tuple
    size: float


class Heap(NamedTuple):
    """Times [s] in the order of a heap with four branches, whose they are, and where, (N,)."""

    keys: np.ndarray
    seats: np.ndarray
    seat_of: np.ndarray


class Impulses(NamedTuple):
    """
    Impulses of the contacts of the last beat.

    head (N,) int64: last contact of each particle; after, whom (C,) int64: next one of the same
    particle, and with which particle, or -2 less the collider; impulse (C, 3) [N s].
    """

    head: np.ndarray
    after: np.ndarray
    whom: np.ndarray
    impulse: np.ndarray


class Gas(NamedTuple):
    """
    A step with everything in it.

    world, forces, courses: as in exact.py, each particle a block of its own; everyone, answers:
    of Spot; matter; laws
    (2 C + 2, shapes.COLUMNS): those of the colliders and of pairs, and all again with restitution
    0; dry, wet: whether any has such friction, and pairs; eps: restitution of pairs; simple:
    whether all fly and meet no collider; states (N, STATE), links (N, LINK), ways (N, WAY); clock,
    numbers; grid, heap; struck (N,) int64: particles of a round; pressing (N,) int64: those that
    press; memory; pile, room, sweeps: scratch of what happens at once; work, met: scratch of
    exact.py.
    """

    world: World
    forces: Forces
    courses: np.ndarray
    everyone: np.ndarray
    answers: np.ndarray
    matter: Matter
    laws: np.ndarray
    dry: bool
    wet: bool
    pairs_dry: bool
    pairs_wet: bool
    eps: float
    simple: bool
    states: np.ndarray
    links: np.ndarray
    ways: np.ndarray
    clock: np.ndarray
    numbers: np.ndarray
    grid: Grid
    heap: Heap
    struck: np.ndarray
    pressing: np.ndarray
    memory: Impulses
    pile: Pile
    room: Room
    sweeps: Work
    work: np.ndarray
    met: np.ndarray


@inlined
def three(table, i, first):
    """Three entries of a row."""
    return (table[i, first], table[i, first + 1], table[i, first + 2])


@inlined
def put_three(table, i, first, value):
    """Write three entries of a row."""
    table[i, first], table[i, first + 1], table[i, first + 2] = value


@inlined
def path_of(gas, i):
    """Return the path of a particle that does not fly freely."""
    ways = gas.ways
    holds = (int(ways[i, HOLDS]), int(ways[i, HOLDS + 1]), int(ways[i, HOLDS + 2]))
    return Path(int(ways[i, MODE]), holds, gas.states[i, SINCE], three(gas.states, i, X),
                three(gas.states, i, V), ways[i, CLOSED] > 0.0, three(ways, i, ACCELERATION),
                ways[i, DECAY], ways[i, BEND], ways[i, STIFF] > 0.0)


@inlined
def keep_path(gas, i, path):
    """Write the path of a particle; place, velocity and time are there already."""
    ways = gas.ways
    ways[i, MODE], ways[i, CLOSED], ways[i, DECAY] = path.mode, path.closed, path.k
    ways[i, BEND], ways[i, STIFF] = path.bend, path.stiff
    for k in range(3):
        ways[i, HOLDS + k] = path.holds[k]
    put_three(ways, i, ACCELERATION, path.a)


@inlined
def spot_at(gas, i):
    """Return where a particle is, as surfaces.Spot, with its way in the step."""
    step, v = gas.numbers[STEP], three(gas.states, i, V)
    rows, turns, end = gas.world.poses.shape[0] - 1, gas.world.motion.shape[0] - 1, gas.clock[END]
    way = end * (length(v) + end * length(gas.forces.gravity))
    return Spot(min(step, turns), min(step, rows), min(step + 1, rows), i, i,
                gas.states[i, RADIUS], gas.everyone, gas.answers, gas.everyone[:0], way)


@inlined
def fallen(gas, i, t):
    """Place and velocity of a particle in free flight at a time."""
    states, k, g = gas.states, gas.forces.linear, gas.forces.gravity
    h = t - states[i, SINCE]
    if k == 0.0:
        half = 0.5 * h * h
        return ((states[i, X] + (h * states[i, V] + half * g[0]),
                 states[i, X + 1] + (h * states[i, V + 1] + half * g[1]),
                 states[i, X + 2] + (h * states[i, V + 2] + half * g[2])),
                (states[i, V] + h * g[0], states[i, V + 1] + h * g[1],
                 states[i, V + 2] + h * g[2]))
    return _dragged(gas, i, h)


@kernel
def _dragged(gas, i, h):
    """Place and velocity of a particle after a time in free flight with linear drag."""
    states, k = gas.states, gas.forces.linear
    a = add_scaled(gas.forces.gravity, k, gas.forces.wind)
    e0, e1, e2 = decay(k * h)
    p, q = e1 * h, e2 * h * h
    return ((states[i, X] + (p * states[i, V] + q * a[0]),
             states[i, X + 1] + (p * states[i, V + 1] + q * a[1]),
             states[i, X + 2] + (p * states[i, V + 2] + q * a[2])),
            (e0 * states[i, V] + p * a[0], e0 * states[i, V + 1] + p * a[1],
             e0 * states[i, V + 2] + p * a[2]))


@kernel
def _led(gas, i, t):
    """Place and velocity of a particle that does not fly freely at a time."""
    path, forces = path_of(gas, i), gas.forces
    if gas.ways[i, GLIDING] > 0.0:
        forces = smooth(forces)
    return state_at(gas.world, forces, spot_at(gas, i), gas.courses, gas.work, path, t)


@inlined
def state_of(gas, i, t):
    """Place [m] and velocity [m/s] of a particle at a time [s] not before that of its path."""
    if gas.simple or gas.links[i, KIND] == FREE:
        return fallen(gas, i, t)
    return _led(gas, i, t)


@inlined
def take_in(gas, i):
    """Let a particle take part in the round."""
    if gas.links[i, ROUND] != gas.numbers[ROUNDS]:
        row = gas.numbers[STRUCK]
        gas.links[i, ROUND], gas.links[i, ROW] = gas.numbers[ROUNDS], row
        gas.struck[row] = i
        gas.numbers[STRUCK] = row + 1


def make_states(count, simple):
    """Allocate states, links and ways; nothing has happened yet."""
    states, links = np.zeros((count, STATE)), np.zeros((count, LINK), dtype=np.int64)
    states[:, MEETS:LATEST], states[:, LATEST] = inf, -1.0
    links[:, BEFORE] = links[:, OTHER] = links[:, ROUND] = links[:, RELEASED] = NONE
    return states, links, np.zeros((1 if simple else count, WAY))
