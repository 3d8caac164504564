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
The contact stage between particles: piles, solved together with the colliders that carry them.

Inelastic, and over the whole step. A contact is between two particles that are closer than the
`reach` where their candidates end. It keeps their mean velocities u from closing more than the gap
between them, and, where it has to push, their end velocities w from approaching each other more
than they did at the start of the step: that is for the next collision stage. Both have their own
impulses, with the same law, so that a pile at rest stays at rest exactly. Who started the step
overlapping is pushed apart by the mean velocity (laws.repulsion), which the end velocity does not
keep.

The impulses are found by projected Gauss-Seidel: each contact in turn is solved for by itself, with
its own impulse so far taken out, so that friction gets the slip that it acts on; sweeps go to and
fro. They start from the impulses of the last step. Colliders take part as bodies of infinite mass,
so that the floor carries the pile; but only the impulses between particles are handed on:
response.py then answers the colliders, with their friction, contacts and ledger. As there, a
particle that would end inside a collider does not approach it at all.

Sources: J. J. Moreau (1999), contact dynamics; E. Catto (2005), the impulses of the last step;
H. Mazhar and others (2015), Nesterov's acceleration.
"""

from math import inf, sqrt
from typing import NamedTuple

from collision_sim.core.detection import starts_inside
from collision_sim.core.impulses import dry_factor, wet_factor
from collision_sim.core.jit import inlined, kernel, LAW
from collision_sim.core.laws import repulsion
from collision_sim.core.ledger import INTERNAL, GRAVITY, weight_of
from collision_sim.core.motion import chord_velocity, END, point_velocity, START
from collision_sim.core.pairs import apart_at_end, column, direction, FIRST, SECOND
from collision_sim.core.rules import Here, N_PAIR_CONTACT, NONE, ROUNDING
from collision_sim.core.shapes import signed_distance
from collision_sim.core.stepping import BLOCK
from collision_sim.core.vectors import add_scaled, dot, largest, length, scaled, subtract
from numba import njit
import numpy as np

# Columns of the bodies: mean velocity, inverse mass, end velocity.
MEAN, INVERSE, ENDING, BODY = 0, 3, 4, 8
# Columns of the contacts: normal, effective mass, bounds of the normal velocities, impulses, and
# of these the change of the last sweep and the way that they were moved on after it.
(NORMAL, MASS, MEAN_BOUND, END_BOUND, MEAN_IMPULSE, END_IMPULSE, CHANGE, WAY,
 CONTACT) = 0, 3, 4, 5, 6, 9, 12, 15, 18
LAW_ROW, ENDS = 2, 3    # columns of the ends: two bodies, the row of the laws
SUPPORT_REACH = 0.25    # share of a radius within which a collider may carry a particle
STILL = 1e-12           # share of the speeds below which a sweep has changed nothing


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


class Memory(NamedTuple):
    """
    Impulses of the last step.

    size (1,) int64: how many; key (C, 2) int64: particle with the smaller index and the other one,
    or N plus a collider; impulses (C, 6) [N s]: on the first, mean and end; next (C,) int32, head
    (N,) int32: lists of those of a particle.
    """

    size: np.ndarray
    key: np.ndarray
    impulses: np.ndarray
    next: np.ndarray
    head: np.ndarray


@inlined
def _at(table, row, first):
    """Three entries of a row."""
    return (table[row, first], table[row, first + 1], table[row, first + 2])


@inlined
def _put(table, row, first, value):
    table[row, first], table[row, first + 1], table[row, first + 2] = value


@kernel
def _body_of(pile, size, candidates, inverse, i):
    """Body of particle i; a new one, behind `size` others, if it has none; and their number."""
    if pile.body[i] != NONE:
        return pile.body[i], size
    pile.body[i], pile.particle[size] = size, i
    _put(pile.bodies, size, MEAN, column(candidates.u, i))
    _put(pile.bodies, size, ENDING, column(candidates.w, i))
    pile.bodies[size, INVERSE] = inverse[i]
    return size, size + 1


@inlined
def _recall(memory, count, i, j, sign):
    """Row of the impulses of the last step between particle i and j, or N plus a collider."""
    row = memory.head[i]
    while row != NONE:
        if memory.key[row, 1] == j:
            return row
        row = memory.next[row]
    return NONE


@inlined
def _add_contact(pile, memory, c, a, b, law, n, mean_bound, end_bound, i, j):
    """Write contact c between bodies a and b, with the impulses that i and j had on each other."""
    bodies, contacts = pile.bodies, pile.contacts
    pile.ends[c, FIRST], pile.ends[c, SECOND], pile.ends[c, LAW_ROW] = a, b, law
    _put(contacts, c, NORMAL, n)
    contacts[c, MASS] = 1.0 / (bodies[a, INVERSE] + bodies[b, INVERSE])
    contacts[c, MEAN_BOUND], contacts[c, END_BOUND] = mean_bound, end_bound
    row = _recall(memory, 0, min(i, j), max(i, j), 1.0)
    for k in range(6):
        contacts[c, MEAN_IMPULSE + k] = 0.0
    if row != NONE:
        sign = 1.0 if i < j else -1.0
        for k in range(6):
            contacts[c, MEAN_IMPULSE + k] = sign * memory.impulses[row, k]
    _push(bodies, a, b, MEAN, _at(contacts, c, MEAN_IMPULSE))
    _push(bodies, a, b, ENDING, _at(contacts, c, END_IMPULSE))


@inlined
def _push(bodies, a, b, which, impulse):
    """Add an impulse [N s] to body a, and its opposite to body b."""
    p, q = bodies[a, INVERSE], bodies[b, INVERSE]
    for d in range(3):
        bodies[a, which + d] += p * impulse[d]
        bodies[b, which + d] -= q * impulse[d]


@inlined
def _end_bound(v_n, gap, slow):
    """Bound of the normal velocity at the end [m/s], for that at the start and the gap [m]."""
    return v_n if v_n < -slow and gap > 0.0 else 0.0


@inlined
def _pair_bounds(rules, reach, dt, size, x, v, candidates, i, j, n, gap):
    """Bounds of the normal velocities of a pair with a gap [m] at the end of its candidates."""
    xi, xj = column(x, i), column(x, j)
    depth = size - length(subtract(xi, xj))
    if depth > ROUNDING * (largest(xi) + largest(xj) + size):
        mean = repulsion(depth, dt, rules.share, rules.highest)
    else:
        mean = dot(n, subtract(column(candidates.u, i), column(candidates.u, j))) - gap / dt
    return mean, _end_bound(dot(n, subtract(column(v, i), column(v, j))), gap, reach / dt)


@kernel
def list_pairs(rules, law, reach, matter, meetings, count, x, v, candidates, pile, memory):
    """List the pairs that are in contact; how many bodies and contacts there are."""
    size, c, dt = 0, 0, rules.flight.dt
    for p in range(count):
        i, j = meetings.ends[p, FIRST], meetings.ends[p, SECOND]
        extent = matter.radius[i] + matter.radius[j]
        distance, n = direction(apart_at_end(dt, x, candidates, i, j),
                                subtract(column(v, i), column(v, j)))
        if distance - extent <= reach:
            mean, end = _pair_bounds(rules, reach, dt, extent, x, v, candidates, i, j,
                                     n, distance - extent)
            a, size = _body_of(pile, size, candidates, matter.inverse, i)
            b, size = _body_of(pile, size, candidates, matter.inverse, j)
            _add_contact(pile, memory, c, a, b, law, n, mean, end, i, j)
            c += 1
    return size, c


@inlined
def _support(rules, reach, here, table, poses, motion, x, before, candidates, c, pile, memory, size, count):
    """
    List collider c as a support of a particle, if it may carry it; how many there are then.

    Who comes down on it from before the step will collide with it, and is not carried.
    """
    i, dt = here.particle, rules.flight.dt
    x0, u = column(x, i), column(candidates.u, i)
    x1 = add_scaled(x0, dt, u)
    phi, n = signed_distance(rules.present, table, poses, here.end, c, x1)
    gap = phi - here.radius
    if not gap <= SUPPORT_REACH * here.radius:
        return size, count
    first = point_velocity(motion, poses, here.step, START, here.start, c, x0)
    if dot(n, subtract(column(before, i), first)) < -reach / dt:
        return size, count
    depth = starts_inside(rules, here, table, poses, c, x0)
    obj = chord_velocity(motion, poses, here.step, here.start, c, x0, dt)
    last = point_velocity(motion, poses, here.step, END, here.end, c, x1)
    mean = dot(n, subtract(u, obj)) - gap / dt
    if depth > 0.0:
        mean = repulsion(depth, dt, rules.share, rules.highest)
    _put(pile.bodies, size, MEAN, obj)
    _put(pile.bodies, size, ENDING, last)
    pile.bodies[size, INVERSE] = 0.0
    _add_contact(pile, memory, count, pile.body[i], size, c, n, mean, 0.0, i, x.shape[1] + c)
    return size + 1, count + 1


@kernel
def list_supports(rules, reach, table, poses, motion, radius, x, before, candidates, pile, memory,
                  bodies, contacts):
    """List the colliders that may carry the bodies; how many bodies and contacts there are."""
    size, end = bodies, min(1, poses.shape[0] - 1)
    for a in range(bodies):
        i = pile.particle[a]
        if pile.bodies[a, INVERSE] > 0.0:
            for c in range(table.shape[0]):
                if contacts == pile.ends.shape[0] or size == pile.bodies.shape[0]:
                    return size, contacts
                here = Here(0, 0, end, 0, i, radius[i], None)
                size, contacts = _support(rules, reach, here, table, poses, motion, x, before,
                                          candidates, c, pile, memory, size, contacts)
    return size, contacts


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
    a, b, n = pile.ends[c, FIRST], pile.ends[c, SECOND], _at(contacts, c, NORMAL)
    relative = subtract(_at(bodies, a, which), _at(bodies, b, which))
    impulse, mass = _at(contacts, c, kind), contacts[c, MASS]
    alone = dot(relative, n) - dot(impulse, n) / mass       # normal velocity without this contact
    after, target = (0.0, 0.0, 0.0), contacts[c, bound]
    if alone < target:
        if pile.ends[c, LAW_ROW] < laws.shape[0] - 1:
            target = max(target, 0.0)
        pressing = mass * (target - alone)
        after = add_scaled(_slide(dry, wet, laws, pile.ends[c, LAW_ROW], relative, n, mass,
                                  impulse, pressing), pressing, n)
    change = subtract(after, impulse)
    _put(contacts, c, kind, after)
    _put(contacts, c, CHANGE, change)
    _push(bodies, a, b, which, change)
    return dot(change, change) / mass


@kernel
def _go_further(pile, count, which, kind, part, first):
    """Move the impulses on by a part of their change since the sweep before."""
    contacts = pile.contacts
    for c in range(count):
        way = _at(contacts, c, CHANGE)
        if not first:
            way = add_scaled(way, 1.0, _at(contacts, c, WAY))
        way = scaled(part, way)
        _put(contacts, c, WAY, way)
        _put(contacts, c, kind, add_scaled(_at(contacts, c, kind), 1.0, way))
        _push(pile.bodies, pile.ends[c, FIRST], pile.ends[c, SECOND], which, way)


@kernel
def _rounding(pile, count, which):
    """Energy [J] of the changes of all contacts that are only rounding of their velocities."""
    energy = 0.0
    for c in range(count):
        speed = STILL * max(largest(_at(pile.bodies, pile.ends[c, FIRST], which)),
                            largest(_at(pile.bodies, pile.ends[c, SECOND], which)))
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


@kernel
def _forget(memory):
    """Empty the lists of the last step's impulses."""
    for row in range(memory.size[0]):
        memory.head[memory.key[row, 0]] = NONE
    memory.size[0] = 0


@kernel
def _remember(pile, memory, count, bodies, table):
    """Keep the impulses for the next step."""
    _forget(memory)
    particles = memory.head.shape[0]
    for c in range(count):
        a, b = pile.ends[c, FIRST], pile.ends[c, SECOND]
        i = pile.particle[a]
        j = pile.particle[b] if b < bodies else particles + pile.ends[c, LAW_ROW]
        sign = 1.0 if i < j else -1.0
        memory.key[c, 0], memory.key[c, 1] = min(i, j), max(i, j)
        for k in range(6):
            memory.impulses[c, k] = sign * pile.contacts[c, MEAN_IMPULSE + k]
        memory.next[c], memory.head[min(i, j)] = memory.head[min(i, j)], c
    memory.size[0] = count


@kernel
def _book(ledger, dt, i, before, after, shift):
    """Book a change of the end velocity and a shift of the place as those of inner forces."""
    if ledger is not None:
        m, pull = weight_of(ledger.weight, i), dot(ledger.gravity, shift)
        gained = 0.5 * dot(subtract(after, before), subtract(after, scaled(-1.0, before)))
        ledger.rows[i // BLOCK, GRAVITY] += m * pull
        ledger.rows[i // BLOCK, INTERNAL] += m * (gained - pull)


@kernel
def _hand_on(ledger, dt, inverse, candidates, pile, bodies, contacts):
    """Add the impulses between particles, and no others, to the candidates."""
    for a in range(bodies):
        i = pile.particle[a]
        _put(pile.bodies, a, MEAN, column(candidates.u, i))
        _put(pile.bodies, a, ENDING, column(candidates.w, i))
    for c in range(contacts):
        a, b = pile.ends[c, FIRST], pile.ends[c, SECOND]
        _push(pile.bodies, a, b, MEAN, _at(pile.contacts, c, MEAN_IMPULSE))
        _push(pile.bodies, a, b, ENDING, _at(pile.contacts, c, END_IMPULSE))
    for a in range(bodies):
        i = pile.particle[a]
        u, w = _at(pile.bodies, a, MEAN), _at(pile.bodies, a, ENDING)
        _book(ledger, dt, i, column(candidates.w, i), w,
              scaled(dt, subtract(u, column(candidates.u, i))))
        for d in range(3):
            candidates.u[d, i], candidates.w[d, i] = u[d], w[d]
        pile.body[i] = NONE


@njit(**LAW)
def settle(rules, pair_rules, dry, wet, sweeps, table, poses, motion, matter, ledger, x, v,
           candidates, meetings, count, pile, memory, accounts):
    """
    Run the contact stage between particles.

    Parameters
    ----------
    rules, table, poses, motion
        As in response.resolve.
    pair_rules : pairs.PairRules
        What pairs do.
    dry, wet : int or None
        1 if pairs or colliders have such friction.
    sweeps : int
        Most sweeps over the contacts.
    matter, ledger, x, v, candidates, meetings, count, accounts
        As in pairs.collide_all, with the number of meetings; the candidates are changed.
    pile, memory : Pile, Memory
        Scratch with room for all contacts; what the last step has left, and the next one gets.

    """
    law = table.shape[0]
    bodies, pairs = list_pairs(rules, law, pair_rules.reach, matter, meetings, count, x, v,
                               candidates, pile, memory)
    if pairs == 0:
        _forget(memory)
        return
    size, contacts = list_supports(rules, pair_rules.reach, table, poses, motion, matter.radius,
                                   x, meetings.before, candidates, pile, memory, bodies, pairs)
    solve(dry, wet, pair_rules.laws, pile, contacts, MEAN, MEAN_BOUND, MEAN_IMPULSE, sweeps,
          _rounding(pile, contacts, MEAN))
    for c in range(contacts):
        if dot(_at(pile.contacts, c, MEAN_IMPULSE), _at(pile.contacts, c, NORMAL)) <= 0.0:
            pile.contacts[c, END_BOUND] = -inf
    solve(dry, wet, pair_rules.laws, pile, contacts, ENDING, END_BOUND, END_IMPULSE, sweeps,
          _rounding(pile, contacts, ENDING))
    for c in range(pairs):
        accounts[0, N_PAIR_CONTACT] += dot(_at(pile.contacts, c, MEAN_IMPULSE),
                                           _at(pile.contacts, c, NORMAL)) > 0.0
    _remember(pile, memory, contacts, bodies, table)
    _hand_on(ledger, rules.flight.dt, matter.inverse, candidates, pile, bodies, pairs)
