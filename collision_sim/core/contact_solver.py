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
The contacts of a large pile, and the impulses that solve them: projected Gauss-Seidel, in colours.

Groups of few contacts are solved exactly, by joint.py.

Each contact in turn is solved for by itself, with its own impulse so far taken out, so that
friction gets the slip that it acts on; that is exact, as balls do not spin. Nesterov's
acceleration moves impulses and velocities on after each sweep, and starts anew where the changes
grow: a column of n balls takes about n sweeps, without it n^2, and a mass of m on one of 1 about
sqrt(m). The sweeps of a step end where one changes no velocity by more than ENOUGH of what the
first has, or by no more than rounding. As the next step starts from the impulses of this one, what
is left fades from step to step.

No two contacts of a colour have a body in common, so threads divide them, in pieces, and the
result does not depend on who does which. Contacts are coloured in the order of the list, which
does not depend on that of the particles. Bodies of infinite mass take part in any number of them.

Sources: J. J. Moreau (1999), contact dynamics; H. Mazhar and others (2015), Nesterov's
acceleration; M. Macklin and others (2014), colours.
"""

from math import sqrt
from typing import NamedTuple

from collision_sim.core.impulses import dry_factor, wet_factor
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.pairs import FIRST, SECOND
from collision_sim.core.rules import NONE
from collision_sim.core.threads import fetch_add, finish
from collision_sim.core.vectors import add_scaled, dot, length, scaled, subtract
import numpy as np

# Columns of the bodies: mean velocity, inverse mass, end velocity, that of the candidate, and the
# velocity that the last sweep has left.
MEAN, INVERSE, ENDING, FREE, KEPT, BODY = 0, 3, 4, 7, 10, 13
# Columns of the contacts: normal, effective mass, bounds of the mean and the end normal velocity,
# push along the normal, impulse, and what the last sweep has left of these.
(NORMAL, MASS, MEAN_BOUND, END_BOUND, PUSH, IMPULSE, KEPT_IMPULSE,
 CONTACT) = 0, 3, 4, 5, 6, 7, 10, 13
LAW_ROW, ENDS = 2, 3    # columns of the ends: two bodies, the row of the laws
ENOUGH = 1e-6           # share of the change of the first sweep
LEAST = 1e-12           # share of what gravity does in a step; below is rounding
COLOURS = 64            # the last one is for what has no other, and is not divided
PIECE = 128             # contacts or bodies that a thread claims at once
# Of the numbers.
BODIES, PAIRS, SIZE, CONTACTS, COLOURED, GROUPS, MET, OPEN_GROUPS, NUMBERS = range(9)


class Pile(NamedTuple):
    """
    The contacts of a step: scratch.

    bodies (B, BODY); particle (B,) int64; ends (C, ENDS) int64; contacts (C, CONTACT); body (N,)
    int64: of each particle, NONE without contacts; used (B,) int64: colours of a body, as bits, or
    what groups.py makes of it; colour (C,) int8: NONE for contacts of small groups; order (C,)
    int64: contacts by colour; changes (pieces, 2): of the pieces of a sweep, as `totals` of the
    sweeps; label (B,), group (C + 1,), member (C,) int64: of groups.py; source (C,) int64, work
    (B,) [J/kg]: of pair_collisions.py; farthest (1,) [m]: how far the first run of the contact
    stage in a step has pushed a body, or a collider pushes one.
    """

    bodies: np.ndarray
    particle: np.ndarray
    ends: np.ndarray
    contacts: np.ndarray
    body: np.ndarray
    used: np.ndarray
    colour: np.ndarray
    order: np.ndarray
    changes: np.ndarray
    label: np.ndarray
    group: np.ndarray
    member: np.ndarray
    source: np.ndarray
    work: np.ndarray
    farthest: np.ndarray


class Work(NamedTuple):
    """
    How the sweeps of a step are done and shared; new for each step, as a thread may come too late.

    sweeps: most of each kind; slow [m/s]: what gravity does in a step; progress (2 * phases,)
    int64: of threads.finish; totals (2 * sweeps, 2): energy [J] and largest speed [m/s] of the
    changes of each sweep; numbers (NUMBERS,) int64: bodies that are particles, contacts between
    these, all bodies, all contacts, colours, groups, how many have been met anew, groups whose
    friction is open; start (COLOURS + 1,) int64: of each in their order.
    """

    sweeps: int
    slow: float
    progress: np.ndarray
    totals: np.ndarray
    numbers: np.ndarray
    start: np.ndarray


def make_pile(bodies, contacts, body):
    """
    Allocate the contacts of a step.

    Parameters
    ----------
    bodies, contacts : int
        At most.
    body : (N,) int64
        NONE for each particle.

    Returns
    -------
    Pile

    """
    return Pile(np.empty((bodies, BODY)), np.empty(bodies, dtype=np.int64),
                np.empty((contacts, ENDS), dtype=np.int64), np.empty((contacts, CONTACT)), body,
                np.empty(bodies, dtype=np.int64), np.empty(contacts, dtype=np.int8),
                np.empty(contacts, dtype=np.int64), np.empty((contacts // PIECE + COLOURS, 2)),
                np.empty(bodies, dtype=np.int64), np.empty(contacts + 1, dtype=np.int64),
                np.empty(contacts, dtype=np.int64), np.empty(contacts, dtype=np.int64),
                np.empty(bodies), np.zeros(1))


def make_work(sweeps, slow):
    """Allocate what a step needs, with its most sweeps and what gravity does in it [m/s]."""
    return Work(sweeps, slow, np.zeros(4 * sweeps * (COLOURS + 2) + 10, dtype=np.int64),
                np.empty((2 * sweeps, 2)), np.zeros(NUMBERS, dtype=np.int64),
                np.zeros(COLOURS + 1, dtype=np.int64))


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
    """Add an impulse [N s] to body a, and its opposite to body b; nothing to infinite masses."""
    p, q = bodies[a, INVERSE], bodies[b, INVERSE]
    if p > 0.0:
        for d in range(3):
            bodies[a, which + d] += p * impulse[d]
    if q > 0.0:
        for d in range(3):
            bodies[b, which + d] -= q * impulse[d]


@kernel
def _choose_colour(pile, c):
    """Give contact c the first colour that neither of its bodies has."""
    taken, k = 0, 0
    for end in range(2):
        body = pile.ends[c, end]
        if pile.bodies[body, INVERSE] > 0.0:
            taken |= pile.used[body]
    while k < COLOURS - 1 and (taken >> k) & 1:
        k += 1
    pile.colour[c] = k
    if k < COLOURS - 1:
        for end in range(2):
            pile.used[pile.ends[c, end]] |= 1 << k
    return k


@kernel
def colour_contacts(work, pile):
    """Colour the contacts that have a colour at all, and order them by colour."""
    start, count, colours = work.start, work.numbers[CONTACTS], 0
    for a in range(work.numbers[SIZE]):
        pile.used[a] = 0
    for c in range(count):
        if pile.colour[c] != NONE:
            k = _choose_colour(pile, c)
            start[k] += 1
            colours = max(colours, k + 1)
    row = 0
    for k in range(COLOURS + 1):
        start[k], row = row, row + start[k]
    for c in range(count):
        k = pile.colour[c]
        if k != NONE:
            pile.order[start[k]] = c
            start[k] += 1
    for k in range(COLOURS, 0, -1):
        start[k] = start[k - 1]
    start[0] = 0
    work.numbers[COLOURED] = colours


@inlined
def slide(dry, wet, laws, law, relative, n, mass, impulse, pressing):
    """Impulse of friction that a normal impulse causes, for a slip that holds its own so far."""
    if not (dry or wet):
        return (0.0, 0.0, 0.0)
    along = add_scaled(impulse, -dot(impulse, n), n)
    slip = add_scaled(relative, -dot(relative, n), n)
    slip = add_scaled(slip, -1.0 / mass, along)
    factor = (dry_factor(laws, law, length(slip), pressing / mass)
              * wet_factor(laws, law, pressing / mass))
    return scaled(mass * (factor - 1.0), slip)


@inlined
def _press(dry, wet, laws, pile, c, beyond):
    """Solve contact c for its impulse; the change of it [N s]."""
    bodies, contacts = pile.bodies, pile.contacts
    a, b, n = pile.ends[c, FIRST], pile.ends[c, SECOND], at(contacts, c, NORMAL)
    relative = subtract(at(bodies, a, ENDING), at(bodies, b, ENDING))
    kept, mass = at(contacts, c, IMPULSE), contacts[c, MASS]
    impulse = add_scaled(kept, beyond, subtract(kept, at(contacts, c, KEPT_IMPULSE)))
    alone = dot(relative, n) - dot(impulse, n) / mass       # normal velocity without this contact
    after = (0.0, 0.0, 0.0)
    if alone < contacts[c, END_BOUND]:
        pressing = mass * (contacts[c, END_BOUND] - alone)
        after = add_scaled(slide(dry, wet, laws, pile.ends[c, LAW_ROW], relative, n, mass,
                                 impulse, pressing), pressing, n)
    put_at(contacts, c, KEPT_IMPULSE, kept)
    put_at(contacts, c, IMPULSE, after)
    change = subtract(after, impulse)
    push(bodies, a, b, ENDING, change)
    return length(change)


@inlined
def _push_apart(pile, c, beyond):
    """Solve contact c for its push; the change of it [N s]."""
    bodies, contacts = pile.bodies, pile.contacts
    a, b, n = pile.ends[c, FIRST], pile.ends[c, SECOND], at(contacts, c, NORMAL)
    closing = dot(subtract(at(bodies, a, MEAN), at(bodies, b, MEAN)), n)
    kept, mass = contacts[c, PUSH], contacts[c, MASS]
    before = kept + beyond * (kept - contacts[c, KEPT_IMPULSE])
    after = max(before + mass * (contacts[c, MEAN_BOUND] - closing), 0.0)
    contacts[c, KEPT_IMPULSE], contacts[c, PUSH] = kept, after
    push(bodies, a, b, MEAN, scaled(after - before, n))
    return abs(after - before)


@kernel
def _visit(pushes, dry, wet, laws, pile, first, last, beyond):
    """Solve some contacts of a colour; energy [J] and largest speed [m/s] of the changes."""
    energy, fastest = 0.0, 0.0
    for k in range(first, last):
        c = pile.order[k]
        if pushes:
            change = _push_apart(pile, c, beyond)
        else:
            change = _press(dry, wet, laws, pile, c, beyond)
        speed = change / pile.contacts[c, MASS]
        energy += change * speed
        fastest = max(fastest, speed)
    return energy, fastest


@kernel
def _sweep(pushes, work, phase, row, dry, wet, laws, pile, beyond):
    """Solve all contacts once, colour by colour; the next phase."""
    count, progress = 0, work.progress
    for k in range(work.numbers[COLOURED]):
        first, last = work.start[k], work.start[k + 1]
        size = PIECE if k < COLOURS - 1 else last - first
        pieces = -(-(last - first) // size)
        piece = fetch_add(progress, 2 * phase, 1)
        while piece < pieces:
            change = _visit(pushes, dry, wet, laws, pile, first + piece * size,
                            min(first + (piece + 1) * size, last), beyond)
            pile.changes[count + piece, 0], pile.changes[count + piece, 1] = change
            fetch_add(progress, 2 * phase + 1, 1)
            piece = fetch_add(progress, 2 * phase, 1)
        finish(progress, phase, pieces)
        count, phase = count + pieces, phase + 1
    if fetch_add(progress, 2 * phase, 1) == 0:
        work.totals[row, 0] = work.totals[row, 1] = 0.0
        for piece in range(count):
            work.totals[row, 0] += pile.changes[piece, 0]
            work.totals[row, 1] = max(work.totals[row, 1], pile.changes[piece, 1])
        fetch_add(progress, 2 * phase + 1, 1)
    finish(progress, phase, 1)
    return phase + 1


@kernel
def _move_on(work, phase, pile, which, beyond):
    """Move the velocities on by a part of their change since the sweep before; the next phase."""
    bodies, size, progress = pile.bodies, work.numbers[SIZE], work.progress
    piece = fetch_add(progress, 2 * phase, 1)
    while piece * PIECE < size:
        for a in range(piece * PIECE, min((piece + 1) * PIECE, size)):
            kept = at(bodies, a, which)
            change = subtract(kept, at(bodies, a, KEPT))
            put_at(bodies, a, KEPT, kept)
            put_at(bodies, a, which, add_scaled(kept, beyond, change))
        fetch_add(progress, 2 * phase + 1, 1)
        piece = fetch_add(progress, 2 * phase, 1)
    finish(progress, phase, -(-size // PIECE))
    return phase + 1


@kernel
def solve(pushes, work, phase, dry, wet, laws, pile):
    """
    Find the impulses of all contacts, or their pushes; threads call it together.

    Parameters
    ----------
    pushes : bool
        Whether they are pushes on the mean velocities, else impulses, with friction, on those at
        the end.
    work : Work
        How; its progress and totals are written.
    phase : int
        First phase of the progress that is still free.
    dry, wet, laws
        As in `settle`.
    pile : Pile
        Its bodies have the velocities that belong to the impulses; both are changed.

    Returns
    -------
    phase : int
        First one that is free then.

    """
    which, row = (ENDING, 0) if not pushes else (MEAN, work.sweeps)
    before, pace, beyond, enough = 0.0, 1.0, 0.0, 0.0
    for k in range(work.sweeps):
        phase = _sweep(pushes, work, phase, row + k, dry, wet, laws, pile, beyond)
        change, fastest = work.totals[row + k, 0], work.totals[row + k, 1]
        if k == 0:
            enough = max(ENOUGH * fastest, LEAST * work.slow)
        if fastest <= enough:
            break
        if change > before:
            pace = 1.0
        faster = 0.5 * (1.0 + sqrt(1.0 + 4.0 * pace * pace))
        beyond, before, pace = (pace - 1.0) / faster, change, faster
        if k < work.sweeps - 1:
            phase = _move_on(work, phase, pile, which, beyond)
    return phase
