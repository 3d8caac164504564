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

Inelastic, and over the whole step. A contact is between two particles that are closer than
gravity moves them in a step where their candidates end. Its impulse, with friction, acts on the
end velocities w: these approach each other no faster than lets the two just touch where the step
ends; those that pressed on each other when the last step ended do not approach at all, so that
gaps that rounding and the sweeps leave set nothing in motion. Who comes down and does not meet
anybody yet is for the next collision stage and keeps its speed. The mean velocity u gets the part
of that impulse that a constant force over the step would give it; then its normal impulses are
solved for once more, so that those that press just touch where the step ends. Who started the step
overlapping is pushed by laws.repulsion. These pushes are without friction and are not kept by the
end velocity: friction that acts on them would wedge a pile up, with impulses that grow from sweep
to sweep, and would shoot balls out of it.

The impulses are those of contact_solver.py; they start from those of the last step. Colliders take
part as bodies of infinite mass, so that the floor carries the pile, and what they do to it is
booked and logged here: response.py finds their particles on the surface. Without gravity nothing
has to be carried, and a gas keeps its energy.

Sources: J. J. Moreau (1999), impulses with friction that act on the velocity at the end; E. Catto
(2005), the impulses of the last step; E. Coumans (2015), the push apart by itself.
"""

from collision_sim.core.candidates import fly_anew
from collision_sim.core.contact_solver import (at, BODIES, colour_contacts, CONTACTS, ENDING, FREE,
                                               IMPULSE, INVERSE, KEPT, KEPT_IMPULSE,
                                               LAW_ROW, MEAN, NORMAL,
                                               PAIRS, PIECE, PUSH, push, put_at, SIZE, solve)
from collision_sim.core.jit import entry, inlined, kernel
from collision_sim.core.ledger import book, book_impulse, GRAVITY, INTERNAL, kinetic
from collision_sim.core.ledger import CONTACT as LOST_IN_CONTACT
from collision_sim.core.motion import point_velocity, START
from collision_sim.core.pairs import column, FIRST, put, SECOND
from collision_sim.core.pile_contacts import list_pairs, list_supports, remember
from collision_sim.core.response import record
from collision_sim.core.rules import Here, N_CONTACT, N_PAIR_CONTACT, NONE, ROUNDING, SLIDE, STICK
from collision_sim.core.shapes import STATIC
from collision_sim.core.stepping import BLOCK
from collision_sim.core.threads import ENTERED, fetch_add, finish, LEFT
from collision_sim.core.vectors import add_scaled, dot, length, scaled, subtract


@kernel
def _book(ledger, dt, i, before, after, shift):
    """Book a change of the end velocity and a shift of the place as those of inner forces."""
    if ledger is not None:
        here, pull = Here(0, 0, 0, i // BLOCK, i, 0.0, None), dot(ledger.gravity, shift)
        book(ledger, here, GRAVITY, pull)
        book(ledger, here, INTERNAL, kinetic(before, after) - pull)


@inlined
def _mean_impulse(part, pile, c):
    """Impulse [N s] of contact c on the mean velocities."""
    impulse, n = at(pile.contacts, c, IMPULSE), at(pile.contacts, c, NORMAL)
    return add_scaled(scaled(part, impulse), pile.contacts[c, PUSH] - part * dot(impulse, n), n)


@kernel
def _hand_on(ledger, part, dt, candidates, pile, bodies, pairs):
    """Add the impulses between particles to the candidates, and to what the bodies had."""
    for a in range(bodies):
        i = pile.particle[a]
        put_at(pile.bodies, a, MEAN, column(candidates.u, i))
        put_at(pile.bodies, a, ENDING, column(candidates.w, i))
    for c in range(pairs):
        a, b = pile.ends[c, FIRST], pile.ends[c, SECOND]
        push(pile.bodies, a, b, MEAN, _mean_impulse(part, pile, c))
        push(pile.bodies, a, b, ENDING, at(pile.contacts, c, IMPULSE))
    for a in range(bodies):
        i = pile.particle[a]
        u, w = at(pile.bodies, a, MEAN), at(pile.bodies, a, ENDING)
        _book(ledger, dt, i, column(candidates.w, i), w,
              scaled(dt, subtract(u, column(candidates.u, i))))
        put(candidates.u, i, u)
        put(candidates.w, i, w)
        pile.body[i] = NONE


@inlined
def _presses(pile, c):
    """Whether contact c pushes its particles apart."""
    impulse, n = at(pile.contacts, c, IMPULSE), at(pile.contacts, c, NORMAL)
    return pile.contacts[c, PUSH] > 0.0 or dot(impulse, n) > 0.0


@inlined
def _state(dry, laws, pile, c):
    """State of a support: it holds a particle whose friction is below what it could be."""
    if dry is not None:
        impulse, n = at(pile.contacts, c, IMPULSE), at(pile.contacts, c, NORMAL)
        pressing = dot(impulse, n)
        slip = add_scaled(impulse, -pressing, n)
        if length(slip) < laws[pile.ends[c, LAW_ROW], STATIC] * pressing * (1.0 - ROUNDING):
            return STICK
    return SLIDE


@inlined
def _arrive(rules, ledger, here, poses, motion, x, v, candidates, collider, n):
    """End the approach of a particle at the start of the step: no other collision is to do so."""
    i, before = here.particle, column(v, here.particle)
    obj = point_velocity(motion, poses, here.step, START, here.start, collider, column(x, i))
    v_n = dot(n, subtract(before, obj))
    if v_n < 0.0:
        after = add_scaled(before, -v_n, n)
        u, w = fly_anew(candidates, ledger, here, rules.flight, before, after,
                        column(candidates.u, i), column(candidates.w, i))
        put(v, i, after)
        put(candidates.u, i, u)
        put(candidates.w, i, w)
        if ledger is not None:
            work = -v_n * dot(n, obj)
            book_impulse(ledger, here, collider, work, scaled(-v_n, n))
            book(ledger, here, LOST_IN_CONTACT, kinetic(before, after) - work)


@kernel
def _lean(rules, dry, laws, ledger, here, part, poses, motion, x, v, candidates, pile, c, log,
          accounts):
    """Add the impulses of a support to the candidate of a particle, and book and log them."""
    i, inverse = here.particle, pile.bodies[pile.ends[c, FIRST], INVERSE]
    collider, n, dt = pile.ends[c, LAW_ROW], at(pile.contacts, c, NORMAL), rules.flight.dt
    change = scaled(inverse, at(pile.contacts, c, IMPULSE))
    u = add_scaled(column(candidates.u, i), inverse, _mean_impulse(part, pile, c))
    after = add_scaled(column(candidates.w, i), 1.0, change)
    _arrive(rules, ledger, here, poses, motion, x, v, candidates, collider, n)
    du = subtract(u, column(candidates.u, i))
    w, obj = column(candidates.w, i), at(pile.bodies, pile.ends[c, SECOND], MEAN)
    put(candidates.u, i, u)
    put(candidates.w, i, after)
    record(log, accounts, here, collider, _state(dry, laws, pile, c),
           add_scaled(column(x, i), dt, u), n, change)
    accounts[here.block, N_CONTACT] += 1
    if ledger is not None:
        dw, pull = subtract(after, w), dt * dot(ledger.gravity, du)
        work = dot(dw, obj)
        book_impulse(ledger, here, collider, work, dw)
        book(ledger, here, GRAVITY, pull)
        book(ledger, here, LOST_IN_CONTACT, kinetic(w, after) - pull - work)


@kernel
def _list(rules, pair_rules, table, poses, motion, matter, x, v, candidates, meetings, count,
          pile, memory, numbers):
    """List all contacts."""
    bodies, pairs = list_pairs(rules, pair_rules, table.shape[0], matter, meetings, count, x, v,
                               candidates, pile, memory)
    size, contacts = bodies, pairs
    if pairs > 0 and pair_rules.slow > 0.0:
        size, contacts = list_supports(rules, pair_rules, table, poses, motion, matter.radius, x,
                                       v, meetings.before, candidates, pile, memory, bodies,
                                       pairs)
    numbers[BODIES], numbers[PAIRS], numbers[SIZE], numbers[CONTACTS] = (
        bodies, pairs, size, contacts)


@kernel
def _lay_out_means(work, phase, part, pile):
    """Give the mean velocities the part of all impulses that is theirs; the next phase."""
    bodies, contacts, progress = pile.bodies, pile.contacts, work.progress
    size, count = work.numbers[SIZE], work.numbers[CONTACTS]
    piece = fetch_add(progress, 2 * phase, 1)
    while piece * PIECE < max(size, count):
        for a in range(piece * PIECE, min((piece + 1) * PIECE, size)):
            change = subtract(at(bodies, a, ENDING), at(bodies, a, FREE))
            u = add_scaled(at(bodies, a, MEAN), part, change)
            put_at(bodies, a, MEAN, u)
            put_at(bodies, a, KEPT, u)
        for c in range(piece * PIECE, min((piece + 1) * PIECE, count)):
            pushing = part * dot(at(contacts, c, IMPULSE), at(contacts, c, NORMAL))
            contacts[c, PUSH] = contacts[c, KEPT_IMPULSE] = pushing
        fetch_add(progress, 2 * phase + 1, 1)
        piece = fetch_add(progress, 2 * phase, 1)
    finish(progress, phase, -(-max(size, count) // PIECE))
    return phase + 1


@kernel
def _end(rules, dry, laws, ledger, part, slow, poses, motion, x, v, candidates, pile, memory,
         numbers, log, accounts):
    """Keep what has been found for the next step, and hand it on to the candidates."""
    bodies, pairs, contacts = numbers[BODIES], numbers[PAIRS], numbers[CONTACTS]
    for c in range(pairs):
        accounts[0, N_PAIR_CONTACT] += _presses(pile, c)
    remember(pile, memory, contacts, bodies, slow)
    _hand_on(ledger, part, rules.flight.dt, candidates, pile, bodies, pairs)
    for c in range(pairs, contacts):
        if _presses(pile, c):
            i = pile.particle[pile.ends[c, FIRST]]
            here = Here(0, 0, 0, i // BLOCK, i, 0.0, None)
            _lean(rules, dry, laws, ledger, here, part, poses, motion, x, v, candidates, pile, c,
                  log, accounts)


@entry
def settle(posted, counters, work, rules, pair_rules, dry, wet, table, poses, motion, matter,
           ledger, x, v, candidates, meetings, count, pile, memory, log, accounts):
    """
    Run the contact stage between particles.

    Parameters
    ----------
    posted, counters
        Of threads.share.
    work : contact_solver.Work
        How the contacts are solved; new for each step.
    rules, table, poses, motion
        As in response.resolve.
    pair_rules : pairs.PairRules
        What pairs do.
    dry, wet : int or None
        1 if pairs or colliders have such friction.
    matter, ledger, x, v, candidates, meetings, count
        As in pairs.collide_all, with the number of meetings; the candidates are changed.
    pile, memory : Pile, Memory
        Scratch with room for all contacts; what the last step has left, and the next one gets.
    log, accounts
        Of response.py; written.

    """
    numbers, progress, laws, part = work.numbers, work.progress, pair_rules.laws, pair_rules.part
    fetch_add(posted, 0, 1)
    fetch_add(counters, ENTERED, 1)
    if fetch_add(progress, 0, 1) == 0:
        _list(rules, pair_rules, table, poses, motion, matter, x, v, candidates, meetings, count,
              pile, memory, numbers)
        colour_contacts(work, pile)
        fetch_add(progress, 1, 1)
    finish(progress, 0, 1)
    phase = solve(None, work, 1, dry, wet, laws, pile)
    phase = _lay_out_means(work, phase, part, pile)
    phase = solve(1, work, phase, None, None, laws, pile)
    if fetch_add(progress, 2 * phase, 1) == 0:
        _end(rules, dry, laws, ledger, part, work.slow, poses, motion, x, v, candidates, pile,
             memory, numbers, log, accounts)
    fetch_add(counters, LEFT, 1)
