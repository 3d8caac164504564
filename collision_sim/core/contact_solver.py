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
The contacts of a pile, and the impulses that solve them: projected Gauss-Seidel.

Each contact in turn is solved for by itself, with its own impulse so far taken out, so that
friction gets the slip that it acts on. A contact has impulses of two kinds, for the mean and for
the end velocities, which are found one after the other.

Sources: J. J. Moreau (1999), contact dynamics; H. Mazhar and others (2015), Nesterov's
acceleration.
"""

from math import sqrt
from typing import NamedTuple

from collision_sim.core.impulses import dry_factor, wet_factor
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.pairs import FIRST, SECOND
from collision_sim.core.vectors import add_scaled, dot, largest, length, scaled, subtract
import numpy as np

# Columns of the bodies: mean velocity, inverse mass, end velocity.
MEAN, INVERSE, ENDING, BODY = 0, 3, 4, 8
# Columns of the contacts: normal, effective mass, bounds of the normal velocities, impulses, and
# of these the change of the last sweep and the way that they were moved on after it.
(NORMAL, MASS, MEAN_BOUND, END_BOUND, MEAN_IMPULSE, END_IMPULSE, CHANGE, WAY,
 CONTACT) = 0, 3, 4, 5, 6, 9, 12, 15, 18
LAW_ROW, ENDS = 2, 3    # columns of the ends: two bodies, the row of the laws
STILL = 1e-6            # share of the speeds below which a sweep has changed nothing


class Pile(NamedTuple):
    """
    The contacts of a step: scratch, and the impulses that the next step starts from.

    bodies (B, BODY); particle (B,) int32; ends (C, ENDS) int32; contacts (C, CONTACT); body (N,)
    int32: of each particle, NONE without contacts.
    """

    bodies: np.ndarray
    particle: np.ndarray
    ends: np.ndarray
    contacts: np.ndarray
    body: np.ndarray


@inlined
def at(table, row, first):
    """Three entries of a row."""
    return (table[row, first], table[row, first + 1], table[row, first + 2])


@inlined
def put_at(table, row, first, value):
    """Write three entries of a row."""
    table[row, first], table[row, first + 1], table[row, first + 2] = value


@inlined
def push(bodies, a, b, which, impulse):
    """Add an impulse [N s] to body a, and its opposite to body b."""
    p, q = bodies[a, INVERSE], bodies[b, INVERSE]
    for d in range(3):
        bodies[a, which + d] += p * impulse[d]
        bodies[b, which + d] -= q * impulse[d]


@inlined
def _slide(dry, wet, laws, law, relative, n, mass, impulse, pressing):
    """Impulse of friction that a normal impulse causes, for a slip that holds its own so far."""
    if dry is None and wet is None:
        return (0.0, 0.0, 0.0)
    along = add_scaled(impulse, -dot(impulse, n), n)
    slip = add_scaled(relative, -dot(relative, n), n)
    slip = add_scaled(slip, -1.0 / mass, along)
    factor = (dry_factor(dry, laws, law, length(slip), pressing / mass)
              * wet_factor(wet, laws, law, pressing / mass))
    return scaled(mass * (factor - 1.0), slip)


@inlined
def _solve(dry, wet, laws, pile, c, which, bound, kind):
    """Solve contact c by itself; the change of its impulse, squared and over its mass [J]."""
    bodies, contacts = pile.bodies, pile.contacts
    a, b, n = pile.ends[c, FIRST], pile.ends[c, SECOND], at(contacts, c, NORMAL)
    relative = subtract(at(bodies, a, which), at(bodies, b, which))
    impulse, mass = at(contacts, c, kind), contacts[c, MASS]
    alone = dot(relative, n) - dot(impulse, n) / mass       # normal velocity without this contact
    after, target = (0.0, 0.0, 0.0), contacts[c, bound]
    if alone < target:
        if pile.ends[c, LAW_ROW] < laws.shape[0] - 1:
            target = max(target, 0.0)
        pressing = mass * (target - alone)
        after = add_scaled(_slide(dry, wet, laws, pile.ends[c, LAW_ROW], relative, n, mass,
                                  impulse, pressing), pressing, n)
    change = subtract(after, impulse)
    put_at(contacts, c, kind, after)
    put_at(contacts, c, CHANGE, change)
    push(bodies, a, b, which, change)
    return dot(change, change) / mass


@kernel
def _go_further(pile, count, which, kind, part, first):
    """Move the impulses on by a part of their change since the sweep before."""
    contacts = pile.contacts
    for c in range(count):
        way = at(contacts, c, CHANGE)
        if not first:
            way = add_scaled(way, 1.0, at(contacts, c, WAY))
        way = scaled(part, way)
        put_at(contacts, c, WAY, way)
        put_at(contacts, c, kind, add_scaled(at(contacts, c, kind), 1.0, way))
        push(pile.bodies, pile.ends[c, FIRST], pile.ends[c, SECOND], which, way)


@kernel
def rounding(pile, count, which):
    """Energy [J] of the changes of all contacts that are only rounding of their velocities."""
    energy = 0.0
    for c in range(count):
        speed = STILL * max(largest(at(pile.bodies, pile.ends[c, FIRST], which)),
                            largest(at(pile.bodies, pile.ends[c, SECOND], which)))
        energy += pile.contacts[c, MASS] * speed * speed
    return energy


@kernel
def solve(dry, wet, laws, pile, count, which, bound, kind, sweeps, enough):
    """
    Find the impulses of all contacts for one kind of velocity.

    Sweeps of projected Gauss-Seidel, with Nesterov's acceleration, which starts anew where the
    changes grow: a column of n balls takes about n sweeps, without it n^2.

    Parameters
    ----------
    dry, wet, laws
        As in `settle`.
    pile : Pile
        Its bodies have the velocities that belong to the impulses; both are changed.
    count : int
        Of the contacts.
    which, bound, kind : int
        Columns of the velocity, its bound and the impulses: MEAN, MEAN_BOUND, MEAN_IMPULSE or
        ENDING, END_BOUND, END_IMPULSE.
    sweeps : int
        Most sweeps.
    enough : float [J]
        Sum of the squared changes of the impulses over the masses that is only rounding.

    """
    before, pace = 0.0, 1.0
    for k in range(sweeps):
        change = 0.0
        for c in range(count):
            change += _solve(dry, wet, laws, pile, c, which, bound, kind)
        if change <= enough or k == sweeps - 1:
            break
        if change > before:
            pace = 1.0
        faster = 0.5 * (1.0 + sqrt(1.0 + 4.0 * pace * pace))
        _go_further(pile, count, which, kind, (pace - 1.0) / faster, k == 0)
        before, pace = change, faster
