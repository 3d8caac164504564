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

The impulses are those of contact_solver.py; they start from those of the last step. Colliders take
part as bodies of infinite mass, so that the floor carries the pile; but of their impulses only
those that response.py could not find again are handed on: it then answers the colliders, with
their friction, contacts and ledger. As there, a particle that would end inside a collider does not
approach it at all. Without gravity nothing has to be carried, and a gas keeps its energy.

Source: E. Catto (2005), the impulses of the last step.
"""

from math import inf
from typing import NamedTuple

from collision_sim.core.contact_solver import (at, END_BOUND, END_IMPULSE, ENDING, INVERSE,
                                               LAW_ROW, MASS, MEAN, MEAN_BOUND,
                                               MEAN_IMPULSE, NORMAL, push, put_at, rounding, solve)
from collision_sim.core.detection import starts_inside
from collision_sim.core.jit import inlined, kernel, LAW
from collision_sim.core.laws import repulsion
from collision_sim.core.ledger import book, book_impulse, GRAVITY, INTERNAL, kinetic
from collision_sim.core.ledger import CONTACT as LOST_IN_CONTACT
from collision_sim.core.motion import chord_velocity, END, point_velocity, START
from collision_sim.core.pairs import apart_at_end, can_meet, column, direction, FIRST, put, SECOND
from collision_sim.core.response import record
from collision_sim.core.rules import Here, N_CONTACT, N_PAIR_CONTACT, NONE, ROUNDING, SLIDE
from collision_sim.core.shapes import signed_distance
from collision_sim.core.stepping import BLOCK
from collision_sim.core.vectors import add_scaled, dot, largest, length, scaled, subtract
from numba import njit
import numpy as np

SUPPORT_REACH = 0.25    # share of a radius within which a collider may carry a particle


class Memory(NamedTuple):
    """
    Impulses of the last step.

    size (1,) int64: how many; key (C, 2) int64: particle with the smaller index and the other one,
    or N plus a collider; impulses (C, 6) [N s]: on the first, mean and end; other (C,) int32, head
    (N,) int32: the last one of each particle, and of each the one before.
    """

    size: np.ndarray
    key: np.ndarray
    impulses: np.ndarray
    other: np.ndarray
    head: np.ndarray


@kernel
def _body_of(pile, size, candidates, inverse, i):
    """Body of particle i; a new one, behind `size` others, if it has none; and their number."""
    if pile.body[i] != NONE:
        return pile.body[i], size
    pile.body[i], pile.particle[size] = size, i
    put_at(pile.bodies, size, MEAN, column(candidates.u, i))
    put_at(pile.bodies, size, ENDING, column(candidates.w, i))
    pile.bodies[size, INVERSE] = inverse[i]
    return size, size + 1


@inlined
def _recall(memory, i, j):
    """Row of the impulses of the last step between particle i and j, or N plus a collider."""
    row = memory.head[i]
    while row != NONE:
        if memory.key[row, 1] == j:
            return row
        row = memory.other[row]
    return NONE


@inlined
def _add_contact(pile, memory, c, a, b, law, n, mean_bound, end_bound, i, j):
    """Write contact c between bodies a and b, with the impulses that i and j had on each other."""
    bodies, contacts = pile.bodies, pile.contacts
    pile.ends[c, FIRST], pile.ends[c, SECOND], pile.ends[c, LAW_ROW] = a, b, law
    put_at(contacts, c, NORMAL, n)
    contacts[c, MASS] = 1.0 / (bodies[a, INVERSE] + bodies[b, INVERSE])
    contacts[c, MEAN_BOUND], contacts[c, END_BOUND] = mean_bound, end_bound
    row = _recall(memory, min(i, j), max(i, j))
    for k in range(6):
        contacts[c, MEAN_IMPULSE + k] = 0.0
    if row != NONE:
        sign = 1.0 if i < j else -1.0
        for k in range(6):
            contacts[c, MEAN_IMPULSE + k] = sign * memory.impulses[row, k]
    push(bodies, a, b, MEAN, at(contacts, c, MEAN_IMPULSE))
    push(bodies, a, b, ENDING, at(contacts, c, END_IMPULSE))


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
        if distance - extent <= reach and can_meet(matter, i, j):
            mean, end = _pair_bounds(rules, reach, dt, extent, x, v, candidates, i, j,
                                     n, distance - extent)
            a, size = _body_of(pile, size, candidates, matter.inverse, i)
            b, size = _body_of(pile, size, candidates, matter.inverse, j)
            _add_contact(pile, memory, c, a, b, law, n, mean, end, i, j)
            c += 1
    return size, c


@inlined
def _support(rules, reach, here, table, poses, motion, x, before, candidates, c, pile, memory,
             size, count):
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
    put_at(pile.bodies, size, MEAN, obj)
    put_at(pile.bodies, size, ENDING, last)
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


@kernel
def _forget(memory):
    """Empty the lists of the last step's impulses."""
    for row in range(memory.size[0]):
        memory.head[memory.key[row, 0]] = NONE
    memory.size[0] = 0


@kernel
def _remember(pile, memory, count, bodies):
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
        memory.other[c], memory.head[min(i, j)] = memory.head[min(i, j)], c
    memory.size[0] = count


@kernel
def _book(ledger, dt, i, before, after, shift):
    """Book a change of the end velocity and a shift of the place as those of inner forces."""
    if ledger is not None:
        here, pull = Here(0, 0, 0, i // BLOCK, i, 0.0, None), dot(ledger.gravity, shift)
        book(ledger, here, GRAVITY, pull)
        book(ledger, here, INTERNAL, kinetic(before, after) - pull)


@kernel
def _hand_on(ledger, dt, candidates, pile, bodies, pairs):
    """Add the impulses between particles to the candidates, and to what the bodies had."""
    for a in range(bodies):
        i = pile.particle[a]
        put_at(pile.bodies, a, MEAN, column(candidates.u, i))
        put_at(pile.bodies, a, ENDING, column(candidates.w, i))
    for c in range(pairs):
        a, b = pile.ends[c, FIRST], pile.ends[c, SECOND]
        push(pile.bodies, a, b, MEAN, at(pile.contacts, c, MEAN_IMPULSE))
        push(pile.bodies, a, b, ENDING, at(pile.contacts, c, END_IMPULSE))
    for a in range(bodies):
        i = pile.particle[a]
        u, w = at(pile.bodies, a, MEAN), at(pile.bodies, a, ENDING)
        _book(ledger, dt, i, column(candidates.w, i), w,
              scaled(dt, subtract(u, column(candidates.u, i))))
        put(candidates.u, i, u)
        put(candidates.w, i, w)
        pile.body[i] = NONE


@inlined
def _pressing(pile, c):
    """Give the normal impulse [N s] of contact c over the step."""
    return dot(at(pile.contacts, c, MEAN_IMPULSE), at(pile.contacts, c, NORMAL))


@inlined
def _lean(ledger, here, dt, x, candidates, pile, c, log, accounts):
    """Add the impulses of a support to the candidate of a particle, and book and log them."""
    i, inverse = here.particle, pile.bodies[pile.ends[c, FIRST], INVERSE]
    collider, obj = pile.ends[c, LAW_ROW], at(pile.bodies, pile.ends[c, SECOND], MEAN)
    u, w = column(candidates.u, i), column(candidates.w, i)
    du = scaled(inverse, at(pile.contacts, c, MEAN_IMPULSE))
    dw = scaled(inverse, at(pile.contacts, c, END_IMPULSE))
    u, after = add_scaled(u, 1.0, du), add_scaled(w, 1.0, dw)
    put(candidates.u, i, u)
    put(candidates.w, i, after)
    record(log, accounts, here, collider, SLIDE, add_scaled(column(x, i), dt, u),
           at(pile.contacts, c, NORMAL), dw)
    accounts[here.block, N_CONTACT] += 1
    if ledger is not None:
        pull, work = dt * dot(ledger.gravity, du), dot(dw, obj)
        book_impulse(ledger, here, collider, work, dw)
        book(ledger, here, GRAVITY, pull)
        book(ledger, here, LOST_IN_CONTACT, kinetic(w, after) - pull - work)


@kernel
def _lean_on(ledger, dt, x, candidates, pile, pairs, contacts, log, accounts):
    """
    Add the impulses of all supports but the strongest of each particle.

    response.py answers colliders one after the other, and divides the friction of a particle
    between a floor and a wall otherwise than here. With only one of them left, both are the same.
    """
    c = pairs
    while c < contacts:
        a, last, strongest = pile.ends[c, FIRST], c, c
        while last < contacts and pile.ends[last, FIRST] == a:
            if _pressing(pile, last) > _pressing(pile, strongest):
                strongest = last
            last += 1
        i = pile.particle[a]
        for k in range(c, last):
            if k != strongest and _pressing(pile, k) > 0.0:
                here = Here(0, 0, 0, i // BLOCK, i, 0.0, None)
                _lean(ledger, here, dt, x, candidates, pile, k, log, accounts)
        c = last


@njit(**LAW)
def settle(rules, pair_rules, dry, wet, sweeps, table, poses, motion, matter, ledger, x, v,
           candidates, meetings, count, pile, memory, log, accounts):
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
    matter, ledger, x, v, candidates, meetings, count
        As in pairs.collide_all, with the number of meetings; the candidates are changed.
    pile, memory : Pile, Memory
        Scratch with room for all contacts; what the last step has left, and the next one gets.
    log, accounts
        Of response.py; written.

    """
    law = table.shape[0]
    bodies, pairs = list_pairs(rules, law, pair_rules.reach, matter, meetings, count, x, v,
                               candidates, pile, memory)
    if pairs == 0:
        _forget(memory)
        return
    size, contacts = bodies, pairs
    if pair_rules.reach > 0.0:
        size, contacts = list_supports(rules, pair_rules.reach, table, poses, motion,
                                       matter.radius, x, meetings.before, candidates, pile, memory,
                                       bodies, pairs)
    solve(dry, wet, pair_rules.laws, pile, contacts, MEAN, MEAN_BOUND, MEAN_IMPULSE, sweeps,
          rounding(pile, contacts, MEAN))
    for c in range(contacts):
        if _pressing(pile, c) <= 0.0:
            pile.contacts[c, END_BOUND] = -inf
    solve(dry, wet, pair_rules.laws, pile, contacts, ENDING, END_BOUND, END_IMPULSE, sweeps,
          rounding(pile, contacts, ENDING))
    for c in range(pairs):
        accounts[0, N_PAIR_CONTACT] += _pressing(pile, c) > 0.0
    _remember(pile, memory, contacts, bodies)
    _hand_on(ledger, rules.flight.dt, candidates, pile, bodies, pairs)
    _lean_on(ledger, rules.flight.dt, x, candidates, pile, pairs, contacts, log, accounts)
