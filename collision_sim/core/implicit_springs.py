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
The equations of an implicit step of springs: backward Euler, linearised (Baraff and Witkin 1998).

Wanted is the velocity v at the end of the step of length h with m (v - w) = h F(x + h v, v), where
w is that of the free flight. Linearised about a velocity v with the springs at the places y:

    (M + h C + h^2 K) dv = M (w - v) + h F(y, v) - h^2 K q

with the damping C and the stiffness K of the springs at y; q = v where y is the place x at the
start, as in that paper, and 0 where y = x + h v, as in Newton's method. Of K the part across a
spring, k (1 - l0 / l), is left out where it is negative, for springs under compression: the matrix
is then symmetric and positive definite whatever the springs do, at the cost of some speed of
convergence but not of what it converges to. Pins have rows of the unit matrix and dv = 0.
"""

from typing import NamedTuple

from collision_sim.core.jit import formula, kernel
from collision_sim.core.springs import DAMPING, direction, REST, STIFFNESS
from collision_sim.core.vectors import dot, subtract
import numpy as np


class Equations(NamedTuple):
    """
    Where the springs stand in the matrix: rows of 3 x 3 blocks, one row for each particle.

    members (A,): particles with springs; start (A + 1,): of the springs of each, as in
    springs.Springs; other, slot (2 S,): row of the other end, and block in this row; law (2 S, 3);
    mass (A,) [kg], infinite for pins; blocks (A + 1,): of the blocks of each row; diagonal (A,):
    block on the diagonal in its row.
    """

    members: np.ndarray
    start: np.ndarray
    other: np.ndarray
    slot: np.ndarray
    law: np.ndarray
    mass: np.ndarray
    blocks: np.ndarray
    diagonal: np.ndarray


def write_equations(springs, mass):
    """
    Lay the equations out.

    Parameters
    ----------
    springs : springs.Springs
        All of them.
    mass : (N,) float64 [kg]
        Of the particles.

    Returns
    -------
    equations : Equations
    columns : (B,) int64
        Column of each block, ascending in each row.

    """
    counts = np.diff(springs.start)
    members = np.flatnonzero(counts)
    local = np.cumsum(counts > 0) - 1
    start = np.concatenate([[0], np.cumsum(counts[members])])
    rows = np.repeat(np.arange(len(members)), counts[members])
    other, own = local[springs.other], np.arange(len(members))
    keys = np.concatenate([rows, own]) * len(members) + np.concatenate([other, own])
    blocks, inverse = np.unique(keys, return_inverse=True)
    row = blocks // max(len(members), 1)
    first = np.searchsorted(row, np.arange(len(members) + 1))
    slot = inverse - first[np.concatenate([rows, own])]
    return Equations(members, start, other, slot[:len(rows)], springs.law, mass[members], first,
                     slot[len(rows):]), blocks % max(len(members), 1)


@kernel
def _entry(equations, a, slot, i, j):
    """Place in the data of the matrix, in compressed rows of numbers, of an entry of a block."""
    width = equations.blocks[a + 1] - equations.blocks[a]
    return 9 * equations.blocks[a] + 3 * i * width + 3 * slot + j


@kernel
def _difference(table, i, j):
    """Column j of a table (3, N) minus column i."""
    return subtract((table[0, j], table[1, j], table[2, j]),
                    (table[0, i], table[1, i], table[2, i]))


@kernel
def _along_and_across(law, s, distance, dt, stiff):
    """Share of spring s in the matrix [kg] along it and, from stiffness only, across it."""
    k, rest = law[s, STIFFNESS], law[s, REST]
    across = 0.0
    if distance > rest:
        across = 1.0 - rest / distance
    elif rest == 0.0:
        across = 1.0
    return dt * law[s, DAMPING] + stiff * dt * dt * k, stiff * dt * dt * k * across


@formula
def assemble(equations, y, v, w, dt, first, data, right):
    """
    Write the matrix and the right-hand side.

    Parameters
    ----------
    equations : Equations
        Where the springs stand.
    y, v, w : (3, N) float64 [m], [m/s], [m/s]
        Places and velocity to linearise about; velocity of the free flight.
    dt : float [s]
        Length of the step.
    first : bool
        Whether y is the place at the start of the step, else y = x + dt v.
    data : (9 B,) float64 [kg]
        Overwritten: the matrix, in compressed rows.
    right : (3 A,) float64 [N s]
        Overwritten.

    """
    data[:] = 0.0
    for a in range(equations.members.shape[0]):
        i, mass, d = equations.members[a], equations.mass[a], equations.diagonal[a]
        held = mass == np.inf
        for p in range(3):
            data[_entry(equations, a, d, p, p)] = 1.0 if held else mass
            right[3 * a + p] = 0.0 if held else mass * (w[p, i] - v[p, i])
        if not held:
            for s in range(equations.start[a], equations.start[a + 1]):
                _add_spring(equations, a, s, y, v, dt, first, data, right)


@kernel
def _add_spring(equations, a, s, y, v, dt, first, data, right):
    """Add spring s to the row of the particle at one of its ends."""
    b, law, d = equations.other[s], equations.law, equations.diagonal[a]
    i, j, slot = equations.members[a], equations.members[b], equations.slot[s]
    distance, n = direction(_difference(y, i, j), i < j)
    dv = _difference(v, i, j)
    along, across = _along_and_across(law, s, distance, dt, 1.0)
    pull = dt * law[s, STIFFNESS] * (distance - law[s, REST])
    more, aside = _along_and_across(law, s, distance, dt, 1.0 if first else 0.0)
    pull += (more - aside) * dot(n, dv)
    moves = equations.mass[b] != np.inf
    for p in range(3):
        right[3 * a + p] += pull * n[p] + aside * dv[p]
        for q in range(3):
            block = (along - across) * n[p] * n[q] + (across if p == q else 0.0)
            data[_entry(equations, a, d, p, q)] += block
            if moves:
                data[_entry(equations, a, slot, p, q)] -= block
