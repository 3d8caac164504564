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
The impulses of a few contacts that touch each other, found at once and exactly.

Normal impulses push and do not pull, and leave each contact a normal velocity no lower than its
bound, and exactly that where there is an impulse. Of all changes of velocity that do so they make
the smallest in the metric of the masses, so they bring no energy (Moreau 1988), and there is one
such change only: it depends neither on the order of the contacts nor on how they are found. That
is a linear complementarity problem, solved by block pivoting (Judice and Pires 1994) with Cholesky
factors, so the ratio of masses costs no sweeps. Where contacts are redundant, as the four legs of
a table are, their impulses are not unique: SHIFT on the diagonal chooses among them, and is taken
out again by repeating the solution from the last one (proximal point, Rockafellar 1976). Where no
impulses do, as between two walls that close, they would grow without end: there SOFT on the
diagonal divides what is missing, and nobody gets faster than those that squeeze him. So it does
where the way out of a squeeze is SQUEEZED times as fast as what closes, between walls on two sides
that are all but opposite to each other. A light ball between a wall and a heavy one that gives way
is shot out as fast as it has to be: by the root of the ratio of their masses at most.

Friction, of sliding.py, and the normal impulses are solved anew in turns until nothing changes.
What comes out is tested: impulses that would bring energy, in the frames of those that touch, are
made smaller.
"""

from math import inf, sqrt
from typing import NamedTuple

from collision_sim.core.contact_solver import (at, END_BOUND, ENDING, FREE, IMPULSE, INVERSE,
                                               KEPT, LAW_ROW, MASS, MEAN, MEAN_BOUND, NORMAL,
                                               PUSH, push, put_at)
from collision_sim.core.jit import inlined, kernel, law
from collision_sim.core.pairs import FIRST, SECOND
from collision_sim.core.rules import NONE
from collision_sim.core.shapes import RESTITUTION, STATIC, WET
from collision_sim.core.sliding import (AGAIN, ALONE, BOUNDED, BY_LAW, FORCE, JOINTLY, MARK,
                                        mark_sliding, MAY_STICK, PRESSING, rub_all, shared_mass,
                                        slide_at_once, take_back)
from collision_sim.core.vectors import add_scaled, dot, length, scaled, subtract
import numpy as np

MOST = 64               # contacts that are solved for at once
SHIFT = 1e-11           # on a diagonal of ones
SOFT = 1e-2             # the same where no impulses are enough
PASSES = 4              # of the proximal point
MISSING = 1e-6          # share of what is wanted that shows that
WILD = 1e3              # times the speeds: friction that changes more has no end
SQUEEZED = 30.0         # times the approaches: a faster way out of a squeeze is none
PATIENCE = 3            # exchanges of many contacts that may bring nothing
TURNS = 80              # of normal impulses and friction
EAGER = 8               # turns up to which those that stick are held; then Newton's method helps
NEARER = 0.5            # most that a leap of friction may leave of what a turn changes
NEARLY = 1e-9           # such a share that does not fall any more is rounding
SETTLED = 1e-13         # change in a turn as a share of the largest speed: nothing changes
WITHOUT_END, OPEN, FOUND = 0, 1, 2  # what becomes of the search for friction
BLUR = 2.0 ** -49       # of a sum of products, relative to the sum of their sizes
# Rows of the vectors, beside FORCE and PRESSING of sliding.py: what the impulses have to bring,
# and those of the last pass.
WANTED, LATEST, VECTORS = 0, 2, 4


class Room(NamedTuple):
    """
    Scratch of a thread, for up to MOST contacts.

    matrix (MOST, MOST): what a unit impulse of each brings to the normal velocity of each, both
    scaled by the square roots of the effective masses; factor (MOST, MOST): Cholesky factor of the
    rows `pushed`; vectors (VECTORS, MOST); pushed (MOST,) int64: contacts with an impulse, in
    order; state (3, MOST) int64: whether a contact has one, now and in the factor, and whether it
    sticks or slides. along (2 MOST, 3), holding (2 MOST, 2 MOST), slips (2 MOST,): of those that
    stick, two directions along the surface of each, the factor of their matrix, and what ends
    their slips. shift (2,): on the diagonal now, and when the impulses were found. table (3 MOST,
    3 MOST + 1), kept (MOST, 3) [N s]: of sliding.py, equations, and friction before these.
    """

    matrix: np.ndarray
    factor: np.ndarray
    vectors: np.ndarray
    pushed: np.ndarray
    state: np.ndarray
    along: np.ndarray
    holding: np.ndarray
    slips: np.ndarray
    shift: np.ndarray
    table: np.ndarray
    kept: np.ndarray


@kernel
def _lay_out(pile, first, count, room):
    """Write the matrix of some contacts, and let none of them push."""
    contacts = pile.contacts
    for k in range(count):
        c = pile.member[first + k]
        n = at(contacts, c, NORMAL)
        for m in range(k):
            d = pile.member[first + m]
            shared, entry = shared_mass(pile, c, d), 0.0
            if shared != 0.0:
                entry = shared * sqrt(contacts[c, MASS] * contacts[d, MASS]) * dot(
                    n, at(contacts, d, NORMAL))
            room.matrix[k, m] = room.matrix[m, k] = entry
        room.matrix[k, k] = 1.0
        room.vectors[FORCE, k] = 0.0
        room.state[0, k] = room.state[1, k] = 0


@law
def make_room():
    """Allocate the scratch of a thread."""
    return Room(np.empty((MOST, MOST)), np.empty((MOST, MOST)), np.empty((VECTORS, MOST)),
                np.empty(MOST, dtype=np.int64), np.empty((3, MOST), dtype=np.int64),
                np.empty((2 * MOST, 3)), np.empty((2 * MOST, 2 * MOST)), np.empty(2 * MOST),
                np.full(2, SHIFT), np.empty((3 * MOST, 3 * MOST + 1)), np.empty((MOST, 3)))


@kernel
def _factorise(room, count):
    """List the contacts that push, and factorise their part of the matrix; how many there are."""
    factor, pushed, state, size, same = room.factor, room.pushed, room.state, 0, True
    for k in range(count):
        if state[0, k] == 1:
            pushed[size] = k
            size += 1
        same = same and state[0, k] == state[1, k]
        state[1, k] = state[0, k]
    if same:
        return size
    for a in range(size):
        for b in range(a + 1):
            entry = room.matrix[pushed[a], pushed[b]]
            for k in range(b):
                entry -= factor[a, k] * factor[b, k]
            if a == b:
                factor[a, a] = sqrt(max(entry + room.shift[0], 0.5 * room.shift[0]))
            else:
                factor[a, b] = entry / factor[b, b]
    return size


@kernel
def _solve(room, count):
    """Give those that push the impulses that bring just what is wanted, and the others none."""
    size, factor, pushed, vectors = _factorise(room, count), room.factor, room.pushed, room.vectors
    for k in range(count):
        vectors[FORCE, k] = 0.0
    for a in range(size):
        k = pushed[a]
        value = vectors[WANTED, k] + room.shift[0] * vectors[LATEST, k]
        for b in range(a):
            value -= factor[a, b] * vectors[FORCE, pushed[b]]
        vectors[FORCE, k] = value / factor[a, a]
    for a in range(size - 1, -1, -1):
        value = vectors[FORCE, pushed[a]]
        for b in range(a + 1, size):
            value -= factor[b, a] * vectors[FORCE, pushed[b]]
        vectors[FORCE, pushed[a]] = value / factor[a, a]


@inlined
def _is_wrong(room, count, k):
    """Whether contact k pulls, or is to push and does not, by more than rounding."""
    vectors = room.vectors
    if room.state[0, k] == 1:
        return vectors[FORCE, k] < 0.0
    missing = vectors[WANTED, k] + room.shift[0] * vectors[LATEST, k]
    size = abs(missing)
    for m in range(count):
        part = room.matrix[k, m] * vectors[FORCE, m]
        missing, size = missing - part, size + abs(part)
    return missing > BLUR * size


@kernel
def _choose(room, count):
    """Find which contacts push, and their impulses."""
    fewest, patience, state = count + 1, PATIENCE, room.state
    for _ in range(10 * count + 20):
        _solve(room, count)
        wrong, last = 0, 0
        for k in range(count):
            room.pushed[k] = 0      # free now: whether it is wrong
            if _is_wrong(room, count, k):
                room.pushed[k] = 1
                wrong, last = wrong + 1, k
        if wrong == 0:
            return
        if wrong < fewest:
            fewest, patience = wrong, PATIENCE
        else:
            patience -= 1
        for k in range(count):
            if room.pushed[k] == 1 and (patience >= 0 or k == last):
                state[0, k] = 1 - state[0, k]


@kernel
def press(room, count):
    """
    Find the impulses of some contacts that bring at least what is wanted.

    Parameters
    ----------
    room : Room
        With the matrix, and what is wanted in the vectors; the impulses are written there.
    count : int
        How many contacts there are.

    """
    vectors, largest, change = room.vectors, 0.0, 0.0
    for k in range(count):
        vectors[LATEST, k] = 0.0
        largest = max(largest, abs(vectors[WANTED, k]))
    for _ in range(PASSES):
        change = _repeat(room, count)
        if not SHIFT * change > BLUR * largest:
            return
    if SHIFT * change > MISSING * largest:
        _press_softly(room, count)


@kernel
def _press_softly(room, count):
    """Find impulses that bring only a part of what is wanted, and do not grow without end."""
    _shift(room, count, SOFT)
    for k in range(count):
        room.vectors[LATEST, k] = 0.0
    _repeat(room, count)
    _shift(room, count, SHIFT)


@inlined
def _shift(room, count, shift):
    """Put something else on the diagonal of the matrix."""
    room.shift[0] = shift
    for k in range(count):
        room.state[1, k] = NONE


@kernel
def _repeat(room, count):
    """Find the impulses from those of the last pass; the largest change of them."""
    vectors, change, room.shift[1] = room.vectors, 0.0, room.shift[0]
    _choose(room, count)
    for k in range(count):
        vectors[FORCE, k] = max(vectors[FORCE, k], 0.0)
        change = max(change, abs(vectors[FORCE, k] - vectors[LATEST, k]))
        vectors[LATEST, k] = vectors[FORCE, k]
    return change


@inlined
def approach_of(pile, c, which):
    """Relative velocity [m/s] of the bodies of contact c."""
    return subtract(at(pile.bodies, pile.ends[c, FIRST], which),
                    at(pile.bodies, pile.ends[c, SECOND], which))


@kernel
def _largest_speed(pile, first, count, which):
    """Largest relative speed [m/s] at some contacts."""
    fastest = 0.0
    for k in range(count):
        fastest = max(fastest, length(approach_of(pile, pile.member[first + k], which)))
    return fastest


@kernel
def _press_normally(pile, first, count, room, which, bound):
    """Give the contacts their normal impulses, instead of those that they have in `room`."""
    contacts, vectors, most = pile.contacts, room.vectors, 0.0
    for k in range(count):
        c = pile.member[first + k]
        missing = contacts[c, bound] - dot(approach_of(pile, c, which), at(contacts, c, NORMAL))
        wanted = sqrt(contacts[c, MASS]) * missing
        for m in range(count):
            wanted += room.matrix[k, m] * vectors[FORCE, m]
        vectors[WANTED, k] = wanted
        most = max(most, abs(wanted) / sqrt(contacts[c, MASS]))
    for k in range(count):      # taken out first: light bodies between heavy ones stay exact
        _add_normally(pile, first, k, room, which, -1.0)
    most = SQUEEZED * most + _largest_speed(pile, first, count, which)
    press(room, count)
    for k in range(count):
        _add_normally(pile, first, k, room, which, 1.0)
    if _largest_speed(pile, first, count, which) > most and _is_squeezed(pile, first, count, room):
        for k in range(count):
            _add_normally(pile, first, k, room, which, -1.0)
        _press_softly(room, count)
        for k in range(count):
            _add_normally(pile, first, k, room, which, 1.0)


@kernel
def _is_squeezed(pile, first, count, room):
    """Whether two bodies that nothing moves push a group from opposite sides."""
    for k in range(count):
        c = pile.member[first + k]
        side = _fixed_side(pile, c)
        if side != 0.0 and room.vectors[FORCE, k] > 0.0:
            for m in range(k):
                d = pile.member[first + m]
                if room.vectors[FORCE, m] > 0.0 and side * _fixed_side(pile, d) * dot(
                        at(pile.contacts, c, NORMAL), at(pile.contacts, d, NORMAL)) < 0.0:
                    return True
    return False


@inlined
def _fixed_side(pile, c):
    """1 where the second body of contact c has infinite mass, -1 where the first has, else 0."""
    return (pile.bodies[pile.ends[c, FIRST], INVERSE] > 0.0) - 1.0 * (
        pile.bodies[pile.ends[c, SECOND], INVERSE] > 0.0)


@inlined
def _add_normally(pile, first, k, room, which, factor):
    """Add the normal impulse of contact k in `room`, times a factor, to its bodies."""
    c = pile.member[first + k]
    force = factor * sqrt(pile.contacts[c, MASS]) * room.vectors[FORCE, k]
    if force != 0.0:
        push(pile.bodies, pile.ends[c, FIRST], pile.ends[c, SECOND], which,
             scaled(force, at(pile.contacts, c, NORMAL)))


@kernel
def _take_over_normal_impulses(pile, first, count, room):
    """Write the normal impulses there are now, beside the friction so far."""
    for k in range(count):
        c = pile.member[first + k]
        n, impulse = at(pile.contacts, c, NORMAL), at(pile.contacts, c, IMPULSE)
        pressing = sqrt(pile.contacts[c, MASS]) * room.vectors[FORCE, k]
        put_at(pile.contacts, c, IMPULSE, add_scaled(impulse, pressing - dot(impulse, n), n))


@kernel
def restrain(pile, first, count):
    """
    Make the impulses of some contacts smaller if they bring energy in the frames of their bodies.

    With impulses p, relative velocities r before and r + d after them that energy is the sum of
    p (r + d / 2); of a share t of the impulses t p (r + t d / 2).
    """
    linear = square = 0.0
    for k in range(count):
        c = pile.member[first + k]
        before, after = approach_of(pile, c, FREE), approach_of(pile, c, ENDING)
        impulse = at(pile.contacts, c, IMPULSE)
        linear += dot(impulse, before)
        square += 0.5 * dot(impulse, subtract(after, before))
    if not linear + square > BLUR * abs(square):
        return
    share = max(-linear / square, 0.0)
    for k in range(count):
        c = pile.member[first + k]
        impulse = at(pile.contacts, c, IMPULSE)
        put_at(pile.contacts, c, IMPULSE, scaled(share, impulse))
        push(pile.bodies, pile.ends[c, FIRST], pile.ends[c, SECOND], ENDING,
             scaled(share - 1.0, impulse))


@kernel
def _begin(pile, first, count, room):
    """Lay out some contacts without impulses."""
    _lay_out(pile, first, count, room)
    for k in range(count):
        c = pile.member[first + k]
        put_at(pile.contacts, c, IMPULSE, (0.0, 0.0, 0.0))
        for end in range(2):
            body = pile.ends[c, end]
            if pile.bodies[body, INVERSE] > 0.0:
                put_at(pile.bodies, body, ENDING, at(pile.bodies, body, FREE))


@kernel
def _sum_up(pile, first, count):
    """Give the bodies of a group what the impulses come to, without the rounding on the way."""
    for k in range(count):
        c = pile.member[first + k]
        for end in range(2):
            body = pile.ends[c, end]
            if pile.bodies[body, INVERSE] > 0.0:
                put_at(pile.bodies, body, ENDING, at(pile.bodies, body, FREE))
    for k in range(count):
        c = pile.member[first + k]
        push(pile.bodies, pile.ends[c, FIRST], pile.ends[c, SECOND], ENDING,
             at(pile.contacts, c, IMPULSE))


@inlined
def _is_done(dry, wet, change, before, speed):
    """Whether friction has found its impulses, for the changes of two turns and a speed."""
    if not (dry or wet):
        return True
    return not change > SETTLED * speed or (
        max(before, change) <= NEARLY * speed and change >= 0.5 * before)


@kernel
def _rubs(dry, wet, laws, pile, first, count):
    """Whether there is friction in a group of contacts: coefficients of zero change no bit."""
    for k in range(count):
        row = pile.ends[pile.member[first + k], LAW_ROW]
        if dry:
            if laws[row, STATIC] > 0.0:
                return True
        if wet:
            if laws[row, WET] > 0.0:
                return True
    return False


@kernel
def _turn(dry, wet, laws, pile, first, count, room, mode):
    """
    Turn by turn, find the friction of a group: WITHOUT_END, OPEN or FOUND.

    Where turns do not end soon, friction is led from one to the next by `slide_at_once`, and back
    where the next one then has no less to do; the turns between two such leaps double then.
    """
    speed, before, leapt, wait, rest = _largest_speed(pile, first, count, FREE), inf, False, 0, 1
    wildest = WILD * (speed + _fastest_bound(pile, first, count))
    for turn in range(TURNS):
        change = rub_all(dry, laws, pile, first, count, room, mode, turn < EAGER)
        if leapt and not change <= NEARER * before:
            take_back(pile, first, count, room)
            wait, rest, leapt, done = rest, 2 * rest, False, False
        elif mode < ALONE and not change <= wildest:
            return WITHOUT_END
        else:
            done = _is_done(dry, wet, change, before, speed)
            wait, leapt, before = wait - 1, turn >= EAGER and wait <= 0 and not done, change
        if leapt:
            slide_at_once(dry, wet, laws, pile, first, count, room, mode)
        if mode < ALONE:
            _press_normally(pile, first, count, room, ENDING, END_BOUND)
        if done:
            return FOUND
    return FOUND if before <= NEARLY * speed else OPEN


@kernel
def _find_friction(dry, wet, laws, pile, first, count, room, mode):
    """
    Find the friction of a group, and what presses with it: WITHOUT_END, OPEN or FOUND.

    Who could stick is taken to have the static coefficient, up to where he slides even so: from
    there on he has the kinetic one. So each law is continuous, and the order of the contacts
    means nothing.
    """
    for k in range(count):
        room.state[MARK, k] = BY_LAW if count == 1 else MAY_STICK
        room.vectors[PRESSING, k] = room.vectors[FORCE, k]
    friction = _turn(dry, wet, laws, pile, first, count, room, mode)
    while friction == FOUND and mark_sliding(dry, laws, pile, first, count, room):
        friction = _turn(dry, wet, laws, pile, first, count, room, mode)
    return friction


@kernel
def _fastest_bound(pile, first, count):
    """Largest bound [m/s] of the end velocities of a group."""
    fastest = 0.0
    for k in range(count):
        fastest = max(fastest, abs(pile.contacts[pile.member[first + k], END_BOUND]))
    return fastest


@kernel
def _end_approaches(dry, wet, laws, pile, first, count, room):
    """
    Find the impulses of a group that leave its end velocities within their bounds.

    Friction that wedges a group up makes impulses that grow from turn to turn, or has several
    answers: then its bounds are those of what presses without it, and if it is wet it leaves
    something of each slip. That has one answer, but for linear wet friction that overshoots: there
    is none then.
    Returns FOUND, or OPEN where that was so.
    """
    _begin(pile, first, count, room)
    _press_normally(pile, first, count, room, ENDING, END_BOUND)
    friction, rubs = FOUND, _rubs(dry, wet, laws, pile, first, count)
    if rubs:
        friction = _find_friction(dry, wet, laws, pile, first, count, room, JOINTLY)
        if friction != FOUND:
            _begin(pile, first, count, room)
            _press_normally(pile, first, count, room, ENDING, END_BOUND)
            bounded = _find_friction(dry, wet, laws, pile, first, count, room, BOUNDED)
            if bounded == WITHOUT_END:
                _begin(pile, first, count, room)
                _press_normally(pile, first, count, room, ENDING, END_BOUND)
            friction = OPEN
    _take_over_normal_impulses(pile, first, count, room)
    if rubs:
        _sum_up(pile, first, count)
    restrain(pile, first, count)
    return friction


@inlined
def _add_friction_to_means(pile, c, part):
    """Add a part of the friction of contact c to the mean velocities of its bodies."""
    n, impulse = at(pile.contacts, c, NORMAL), at(pile.contacts, c, IMPULSE)
    push(pile.bodies, pile.ends[c, FIRST], pile.ends[c, SECOND], MEAN,
         scaled(part, add_scaled(impulse, -dot(impulse, n), n)))


@kernel
def _push_apart(part, pile, first, count, room):
    """Find the pushes of a group that leave its mean velocities within their bounds."""
    for k in range(count):
        _add_friction_to_means(pile, pile.member[first + k], part)
        room.vectors[FORCE, k] = 0.0
    _press_normally(pile, first, count, room, MEAN, MEAN_BOUND)
    for k in range(count):
        c = pile.member[first + k]
        pile.contacts[c, PUSH] = sqrt(pile.contacts[c, MASS]) * room.vectors[FORCE, k]


@kernel
def _lifts_for_nothing(part, pull, pile, first, count):
    """
    Whether the pushes of a group lift it by more than its impulses have taken of its energy.

    That is energy in the frames of those that touch. Pushes between two particles lift nothing.
    """
    taken = lifted = 0.0
    for k in range(count):
        c = pile.member[first + k]
        impulse, n = at(pile.contacts, c, IMPULSE), at(pile.contacts, c, NORMAL)
        taken -= 0.5 * dot(impulse, approach_of(pile, c, FREE)) + 0.5 * dot(
            impulse, approach_of(pile, c, ENDING))
        sides = _fixed_side(pile, c)
        mean = add_scaled(scaled(part, impulse),
                          pile.contacts[c, PUSH] - part * dot(impulse, n), n)
        lifted -= sides * dot(mean, pull)
    return lifted - taken > BLUR * (abs(lifted) + abs(taken))


@kernel
def settle_group(dry, wet, laws, part, pull, pile, first, count, room):
    """
    Find the impulses of a group of contacts that leave the end velocities no approach.

    Then find its pushes, without friction, for the mean velocities. Bounds that let those that
    come down keep their speed are taken away where the pushes would lift them for nothing.

    Parameters
    ----------
    dry, wet, laws, part
        As in `piles.settle`.
    pull : (3,) tuple of float [m/s]
        What gravity does in the step.
    pile : contact_solver.Pile
        Of the contacts pile.member[first:first + count]; impulses and pushes are written, and the
        velocities of their bodies.
    first, count : int
        The group; at most MOST.
    room : Room
        Scratch.

    Returns
    -------
    friction : int
        FOUND; OPEN where friction and what presses with it have no end, or are not found in TURNS:
        friction has the bounds of what presses without it then.

    """
    contacts, bodies = pile.contacts, pile.bodies
    for k in range(count):
        c = pile.member[first + k]
        for end in range(2):
            body = pile.ends[c, end]
            if bodies[body, INVERSE] > 0.0:
                put_at(bodies, body, KEPT, at(bodies, body, MEAN))
    friction = _end_approaches(dry, wet, laws, pile, first, count, room)
    _push_apart(part, pile, first, count, room)
    if _lifts_for_nothing(part, pull, pile, first, count):
        for k in range(count):
            c = pile.member[first + k]
            if contacts[c, PUSH] > 0.0:
                contacts[c, END_BOUND] = 0.0
            for end in range(2):
                body = pile.ends[c, end]
                if bodies[body, INVERSE] > 0.0:
                    put_at(bodies, body, MEAN, at(bodies, body, KEPT))
        friction = _end_approaches(dry, wet, laws, pile, first, count, room)
        _push_apart(part, pile, first, count, room)
    return friction


@kernel
def _bounce(laws, pile, first, count, room):
    """
    Add to impulses that end an approach what restitution gives back.

    With one restitution e for all it is e times the impulse, and of the energy that an inelastic
    collision takes the share e^2 comes back. Where restitutions differ it could be more than all
    of it: it is then what restores all.
    """
    lost = back = 0.0
    for k in range(count):
        e = laws[pile.ends[pile.member[first + k], LAW_ROW], RESTITUTION]
        room.vectors[LATEST, k] = e * room.vectors[FORCE, k]
    for k in range(count):
        for m in range(count):
            lost += room.matrix[k, m] * room.vectors[FORCE, k] * room.vectors[FORCE, m]
            back += room.matrix[k, m] * room.vectors[LATEST, k] * room.vectors[LATEST, m]
    lost = max(lost, 0.0)       # below 0 by rounding, where impulses are opposite
    share = sqrt(lost / back) if back > lost else 1.0
    for k in range(count):
        room.vectors[FORCE, k] += share * room.vectors[LATEST, k]


@kernel
def collide_group(dry, wet, laws, pile, first, count, room):
    """
    Find the impulses of a group of contacts that collide at once.

    Parameters
    ----------
    dry, wet, laws, pile, first, count, room
        As in `settle_group`; END_BOUND is 0.

    Returns
    -------
    friction : int
        As of `settle_group`.

    Notes
    -----
    The inelastic impulses end every approach; each then gets its restitution once, and friction
    for what it is then. For a single contact that is Newton's law with the lecture's friction.

    """
    _begin(pile, first, count, room)
    _press_normally(pile, first, count, room, ENDING, END_BOUND)
    for k in range(count):
        _add_normally(pile, first, k, room, ENDING, -1.0)
    _bounce(laws, pile, first, count, room)
    for k in range(count):
        _add_normally(pile, first, k, room, ENDING, 1.0)
    friction = _find_friction(dry, wet, laws, pile, first, count, room, ALONE)
    if wet and friction == OPEN:
        for k in range(count):
            put_at(room.kept, k, 0, (0.0, 0.0, 0.0))
        take_back(pile, first, count, room)
        _find_friction(dry, wet, laws, pile, first, count, room, AGAIN)
    _take_over_normal_impulses(pile, first, count, room)
    if _rubs(dry, wet, laws, pile, first, count):
        _sum_up(pile, first, count)
    restrain(pile, first, count)
    return friction
