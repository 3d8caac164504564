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
The contact stage between particles: piles, solved together with the colliders that they press on.

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

Groups of up to joint.MOST contacts are solved exactly, whatever their masses; larger ones by the
sweeps of contact_solver.py, which start from the impulses of the last step. Colliders take part as
bodies of infinite mass, so that the floor carries the pile and a wall that moves pushes it, and
what they do to it is booked and logged here: response.py finds their particles on the surface.
Whom a push moves onto somebody else, he presses on as well, and so does whom a collider throws or
pushes onto those that have moved: the stage is run again, from where it
has led, for the groups of those that are met anew, AGAIN times at most, and no more once the
pushes grow. In groups of more than MOST_AGAIN particles that waits for the next step.

Sources: J. J. Moreau (1999), impulses with friction that act on the velocity at the end; E. Catto
(2005), the impulses of the last step; E. Coumans (2015), the push apart by itself.
"""

from collision_sim.core.around import find_around
from collision_sim.core.contact_solver import (at, BODIES, colour_contacts, COLOURED, CONTACTS,
                                               ENDING, FREE, GROUPS, IMPULSE, INVERSE, KEPT,
                                               KEPT_IMPULSE, LAW_ROW, MEAN, MET, NORMAL,
                                               OPEN_GROUPS, PAIRS, PIECE, PUSH, push, put_at, SIZE,
                                               solve)
from collision_sim.core.groups import group_contacts
from collision_sim.core.jit import entry, inlined, kernel
from collision_sim.core.joint import make_room, MOST, OPEN, restrain, settle_group
from collision_sim.core.ledger import book, book_impulse, GRAVITY, INTERNAL, is_kept
from collision_sim.core.ledger import CONTACT as LOST_IN_CONTACT
from collision_sim.core.mesh_way import keep_answers
from collision_sim.core.pair_collisions import follow, LOOSE, part_all
from collision_sim.core.pair_memory import recall
from collision_sim.core.pair_walls import AWAY, here_of, lead, pushed_place
from collision_sim.core.pairs import (apart_at_end, can_meet, column, DRIFT, end_normal, FIRST,
                                      HEAD, HITS, is_spent, MOST_HITS, NEAR, put, SECOND,
                                      sort_by_place)
from collision_sim.core.pile_contacts import (body_of, CARRIES, HOT, IN_CONTACT, list_pairs,
                                              list_supports, MET_ANEW, remember, SUPPORT_REACH)
from collision_sim.core.response import record
from collision_sim.core.rules import (account_of, N_CONTACT, N_PAIR_CONTACT, N_REPULSION,
                                      N_UNSETTLED, NONE, REPULSION, ROUNDING, SLIDE, STICK)
from collision_sim.core.shapes import STATIC
from collision_sim.core.stepping import BLOCK
from collision_sim.core.threads import ENTERED, fetch_add, finish, LEFT
from collision_sim.core.vectors import add_scaled, dot, largest, length, scaled, subtract
import numpy as np

AGAIN = 32              # times that the stage is run at most
MOST_AGAIN = 4 * MOST   # particles that hang together for which it is run again
COLD, WARM, PUSHED = 0, 2, 3    # marks beside HOT: nothing, too many to run again, by a collider
GROWN = 2.0             # times the first pushes: larger ones have no end
DEEP = 1e-5             # share of a radius: who is pushed deeper into somebody else meets him anew


@inlined
def _mean_impulse(part, pile, c):
    """Impulse [N s] of contact c on the mean velocities."""
    impulse, n = at(pile.contacts, c, IMPULSE), at(pile.contacts, c, NORMAL)
    return add_scaled(scaled(part, impulse), pile.contacts[c, PUSH] - part * dot(impulse, n), n)


@kernel
def _hand_on(part, candidates, pile, bodies, pairs):
    """Add the impulses between particles to the candidates; nobody leads who nothing moves."""
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
        if pile.bodies[a, INVERSE] > 0.0:
            candidates.settled[i] = 1
            put(candidates.u, i, at(pile.bodies, a, MEAN))
            put(candidates.w, i, at(pile.bodies, a, ENDING))
        pile.body[i] = NONE


@inlined
def _half_way(pile, a):
    """Mean [m/s] of the end velocities of a body before and after all impulses."""
    return scaled(0.5, add_scaled(at(pile.bodies, a, FREE), 1.0, at(pile.bodies, a, ENDING)))


@kernel
def _book_between(stage, ledger, c):
    """Book the impulse of contact c between two particles, and that it shifts their places."""
    pile, dt = stage.pile, stage.world.rules.flight.dt
    impulse = at(pile.contacts, c, IMPULSE)
    mean = _mean_impulse(stage.pair_rules.part, pile, c)
    for end, sign in ((FIRST, 1.0), (SECOND, -1.0)):
        a = pile.ends[c, end]
        i, share = pile.particle[a], sign * pile.bodies[a, INVERSE]
        here, pull = account_of(i // BLOCK, i), dt * share * dot(ledger.gravity, mean)
        book(ledger, here, GRAVITY, pull)
        book(ledger, here, INTERNAL, share * dot(impulse, _half_way(pile, a)) - pull)


@kernel
def _book_support(stage, ledger, here, c):
    """Book the impulse of a support on a particle, and that it shifts its place."""
    pile, collider = stage.pile, stage.pile.ends[c, LAW_ROW]
    a = pile.ends[c, FIRST]
    inverse = pile.bodies[a, INVERSE]
    dw = scaled(inverse, at(pile.contacts, c, IMPULSE))
    du = scaled(inverse, _mean_impulse(stage.pair_rules.part, pile, c))
    work = dot(dw, at(pile.bodies, pile.ends[c, SECOND], MEAN))
    pull = stage.world.rules.flight.dt * dot(ledger.gravity, du)
    book_impulse(ledger, here, collider, work, dw)
    book(ledger, here, GRAVITY, pull)
    book(ledger, here, LOST_IN_CONTACT, dot(dw, _half_way(pile, a)) - pull - work)


@kernel
def _book(stage, ledger, bodies, pairs, contacts):
    """
    Book all impulses: each does the work that it does on the way from the end velocity before all.

    So the impulses between particles bring no energy, though that of one alone would.
    """
    if is_kept(ledger):
        pile = stage.pile
        for a in range(bodies):
            put_at(pile.bodies, a, ENDING, column(stage.world.candidates.w, pile.particle[a]))
        for c in range(pairs):
            _book_between(stage, ledger, c)
        for c in range(pairs, contacts):
            if _presses(pile, c):
                i = pile.particle[pile.ends[c, FIRST]]
                _book_support(stage, ledger, account_of(i // BLOCK, i), c)


@inlined
def _presses(pile, c):
    """Whether contact c pushes its particles apart."""
    impulse, n = at(pile.contacts, c, IMPULSE), at(pile.contacts, c, NORMAL)
    return pile.contacts[c, PUSH] > 0.0 or dot(impulse, n) > 0.0


@inlined
def _state(dry, laws, pile, c):
    """State of a support: it holds a particle whose friction is below what it could be."""
    if dry:
        impulse, n = at(pile.contacts, c, IMPULSE), at(pile.contacts, c, NORMAL)
        pressing = dot(impulse, n)
        slip = add_scaled(impulse, -pressing, n)
        if length(slip) < laws[pile.ends[c, LAW_ROW], STATIC] * pressing * (1.0 - ROUNDING):
            return STICK
    return SLIDE


@kernel
def _lean(stage, dry, here, pile, c):
    """Add the impulses of a support to the candidate of a particle, and log them."""
    world = stage.world
    i, part = here.particle, stage.pair_rules.part
    inverse = pile.bodies[pile.ends[c, FIRST], INVERSE]
    candidates, dt = world.candidates, world.rules.flight.dt
    dw, du = scaled(inverse, at(pile.contacts, c, IMPULSE)), scaled(
        inverse, _mean_impulse(part, pile, c))
    u = add_scaled(column(candidates.u, i), 1.0, du)
    put(candidates.u, i, u)
    put(candidates.w, i, add_scaled(column(candidates.w, i), 1.0, dw))
    state, counter = REPULSION, N_REPULSION
    if pile.source[c] == CARRIES:
        state, counter = _state(dry, stage.pair_rules.laws, pile, c), N_CONTACT
    record(world, here, pile.ends[c, LAW_ROW], state, add_scaled(column(world.x, i), dt, u),
           at(pile.contacts, c, NORMAL), dw)
    world.accounts[here.block, counter] += 1


@inlined
def _is_deep(stage, i, depth):
    """Whether a depth [m] of particle i in colliders is more than what is left of a push."""
    return depth > DEEP * stage.matter.radius[i] + ROUNDING * largest(column(stage.world.x, i))


@kernel
def _is_at_wall(stage, i, answers):
    """Whether particle i now ends inside a collider."""
    return _is_deep(stage, i, pushed_place(stage, i, answers)[0])


@inlined
def _is_pushed(stage, i):
    """Whether colliders may push particle i, and nothing else is to be done with them before."""
    return stage.meetings.states[i, NEAR] > AWAY and stage.matter.inverse[i] > 0.0 and (
        stage.pile.body[i] == NONE and stage.meetings.heat[i] != PUSHED)


@kernel
def _list_at_walls(stage, bounced, bounces):
    """List those that colliders may push, and mark them; how many are `struck`."""
    world = stage.world
    meetings, size = stage.meetings, 0
    for block in range(-1, bounces.shape[0]):
        count = 2 * meetings.size[0] if block < 0 else bounces[block, 0]
        for k in range(count):
            if block < 0:
                i = meetings.ends[k >> 1, k & 1]
            else:
                i = max(bounced[block * BLOCK + k], -1 - bounced[block * BLOCK + k])
            if _is_pushed(stage, i):
                meetings.struck[size], meetings.heat[i] = i, PUSHED
                size += 1
    sort_by_place(world.x, world.v, meetings.struck, size)
    return size


@kernel
def _find_pushed(stage, bounced, bounces, velocities, answers):
    """Find those that end inside a collider and are no bodies, and their velocities; how many."""
    world = stage.world
    meetings, size, dt = stage.meetings, 0, world.rules.flight.dt
    for k in range(_list_at_walls(stage, bounced, bounces)):
        i = meetings.struck[k]
        depth, place = pushed_place(stage, i, answers)
        if _is_deep(stage, i, depth):
            put_at(velocities, size, 0, column(world.candidates.u, i))
            put_at(velocities, size, 3, scaled(1.0 / dt, subtract(place, column(world.x, i))))
            meetings.struck[size] = i
            size += 1
        else:
            meetings.heat[i] = COLD
    return size


@kernel
def _overlaps_somebody(stage, i):
    """Whether particle i ends in another one."""
    world = stage.world
    find_around(stage.cells, stage.moved, i)
    radius = stage.matter.radius
    for k in range(stage.moved.size[1]):
        j = stage.moved.found[k]
        apart = length(apart_at_end(world.rules.flight.dt, world.x, world.candidates, i, j))
        if apart < radius[i] + radius[j] and can_meet(stage.matter, i, j):
            return True
    return False


@kernel
def _pushed_onto(stage, base, bounced, bounces, velocities, answers):
    """
    Find those that colliders push onto somebody, the first in `struck`; how many.

    All are led to where they are pushed, so that two that are pushed onto each other find each
    other, and back.
    """
    world = stage.world
    meetings, struck, onto = stage.meetings, stage.meetings.struck, 0
    size = _find_pushed(stage, bounced, bounces, velocities, answers)
    for k in range(size):
        i = struck[k]
        lead(stage, i, column(world.v, i), at(velocities, k, 3), base[i])
    for k in range(size):
        meetings.heat[struck[k]] = _overlaps_somebody(stage, struck[k])
    for k in range(size):
        i = struck[k]
        lead(stage, i, column(world.v, i), at(velocities, k, 0), base[i])
        if meetings.heat[i]:
            struck[onto] = i
            onto += 1
            way = length(subtract(at(velocities, k, 3), at(velocities, k, 0)))
            stage.pile.farthest[0] = max(stage.pile.farthest[0], world.rules.flight.dt * way)
        meetings.heat[i] = COLD
    return onto


@kernel
def _list(stage, base, bounced, bounces, velocities, again, numbers, answers):
    """List all contacts, and group them."""
    bodies, pairs = list_pairs(stage, again)
    if not again:
        stage.pile.farthest[0] = 0.0
    for k in range(_pushed_onto(stage, base, bounced, bounces, velocities, answers)):
        if 2 * bodies < stage.pile.bodies.shape[0]:
            _, bodies = body_of(stage.pile, bodies, stage.world.candidates, stage.matter.inverse,
                                stage.meetings.struck[k])
    size, contacts = bodies, pairs
    if bodies > 0:
        size, contacts = list_supports(stage, bodies, pairs, again, answers)
    groups, pile = group_contacts(stage.pile, size, contacts), stage.pile
    for g in range(groups):
        first, last = pile.group[g], pile.group[g + 1]
        for k in range(first, last):
            pile.colour[pile.member[k]] = NONE if last - first <= MOST else 0
    numbers[BODIES], numbers[PAIRS], numbers[SIZE], numbers[CONTACTS], numbers[GROUPS] = (
        bodies, pairs, size, contacts, groups)


@inlined
def _is_large(pile, g):
    return pile.group[g + 1] - pile.group[g] > MOST


@kernel
def _settle_groups(work, phase, dry, wet, laws, part, pull, pile, room):
    """Solve for the impulses of all small groups; the next phase."""
    progress, groups = work.progress, work.numbers[GROUPS]
    g = fetch_add(progress, 2 * phase, 1)
    while g < groups:
        if not _is_large(pile, g):
            friction = settle_group(dry, wet, laws, part, pull, pile, pile.group[g],
                                    pile.group[g + 1] - pile.group[g], room)
            if friction == OPEN:
                fetch_add(work.numbers, OPEN_GROUPS, 1)
        fetch_add(progress, 2 * phase + 1, 1)
        g = fetch_add(progress, 2 * phase, 1)
    finish(progress, phase, groups)
    return phase + 1


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
            if pile.colour[c] != NONE:
                pushing = part * dot(at(contacts, c, IMPULSE), at(contacts, c, NORMAL))
                contacts[c, PUSH] = contacts[c, KEPT_IMPULSE] = pushing
        fetch_add(progress, 2 * phase + 1, 1)
        piece = fetch_add(progress, 2 * phase, 1)
    finish(progress, phase, -(-max(size, count) // PIECE))
    return phase + 1


@kernel
def _settle_large(work, phase, dry, wet, laws, part, pile):
    """Solve for the impulses of all large groups, with sweeps; the next phase."""
    phase = solve(False, work, phase, dry, wet, laws, pile)
    groups = work.numbers[GROUPS]
    if fetch_add(work.progress, 2 * phase, 1) == 0:
        for g in range(groups):
            if _is_large(pile, g):
                restrain(pile, pile.group[g], pile.group[g + 1] - pile.group[g])
        fetch_add(work.progress, 2 * phase + 1, 1)
    finish(work.progress, phase, 1)
    phase = _lay_out_means(work, phase + 1, part, pile)
    return solve(True, work, phase, False, False, laws, pile)


@kernel
def _is_met_anew(stage, p):
    """Whether the particles of pair p, not in contact so far, overlap where they now end."""
    world = stage.world
    i, j = stage.meetings.ends[p, FIRST], stage.meetings.ends[p, SECOND]
    if not can_meet(stage.matter, i, j):
        return False
    radius = stage.matter.radius
    gap, _ = end_normal(world.rules.sweep, world.rules.flight.dt, radius[i] + radius[j], world.x,
                        subtract(column(world.v, i), column(world.v, j)), world.candidates, i, j)
    return gap < -DEEP * max(radius[i], radius[j])


@kernel
def _spread(stage, i):
    """
    Mark all that hang together with particle i by contacts; whether they are few enough.

    The marks of too many say that this has been looked at.
    """
    meetings, heat, stack = stage.meetings, stage.meetings.heat, stage.meetings.struck
    if heat[i] != COLD:
        return heat[i] == HOT
    size, done, heat[i], stack[0] = 1, 0, HOT, i
    while done < size and size <= MOST_AGAIN:
        code = int(meetings.states[stack[done], HEAD])
        while code != NONE:
            p = code >> 1
            j = meetings.ends[p, 1 - (code & 1)]
            if meetings.looked[p] <= IN_CONTACT and heat[j] == COLD and (
                    stage.matter.inverse[j] > 0.0):
                heat[j], stack[size] = HOT, j
                size += 1
            code = meetings.behind[p, code & 1]
        done += 1
    if size > MOST_AGAIN:
        for k in range(size):
            heat[stack[k]] = WARM
    return size <= MOST_AGAIN


@kernel
def _mark_met(stage, i):
    """Mark the pairs of particle i that are met anew, and their ends as cold."""
    meetings, code = stage.meetings, int(stage.meetings.states[i, HEAD])
    while code != NONE:
        p = code >> 1
        meetings.heat[meetings.ends[p, FIRST]] = meetings.heat[meetings.ends[p, SECOND]] = COLD
        if meetings.looked[p] > IN_CONTACT and _is_met_anew(stage, p):
            meetings.looked[p] = MET_ANEW
        code = meetings.behind[p, code & 1]


@kernel
def _count_met_by(stage, i):
    """Count who particle i meets anew, in groups that are small enough."""
    meetings, code, met = stage.meetings, int(stage.meetings.states[i, HEAD]), 0
    while code != NONE:
        p = code >> 1
        if meetings.looked[p] == MET_ANEW:
            first, second = meetings.ends[p, FIRST], meetings.ends[p, SECOND]
            met += _spread(stage, first if stage.matter.inverse[first] > 0.0 else second)
        code = meetings.behind[p, code & 1]
    return met


@inlined
def _shift(stage, a):
    """How far [m] the last run has pushed body a."""
    world = stage.world
    return world.rules.flight.dt * length(subtract(
        column(world.candidates.u, stage.pile.particle[a]), at(stage.pile.bodies, a, KEPT)))


@kernel
def _count_met(stage, bodies, base, again, answers):
    """
    Count who is met anew where the pushes have led.

    But not by whom they push farther from run to run, by more than his radius: where there is no
    place for all, pushes grow, as each leads into others, and the next step goes on.
    """
    meetings, pile, met = stage.meetings, stage.pile, 0
    slack = stage.world.rules.flight.dt * stage.pair_rules.slow
    for a in range(bodies):
        i, shift = pile.particle[a], _shift(stage, a)
        meetings.heat[i] = COLD
        meetings.states[i, DRIFT] += shift
        if not again:
            pile.farthest[0] = max(pile.farthest[0], shift)
        follow(stage, i, base[i], LOOSE * stage.matter.radius[i] + slack)
    for a in range(bodies):
        _mark_met(stage, pile.particle[a])
    for a in range(bodies):
        i, shift, radius = pile.particle[a], _shift(stage, a), stage.matter.radius
        if shift - radius[i] <= GROWN * pile.farthest[0]:
            met += _count_met_by(stage, i)
            if shift > SUPPORT_REACH * radius[i] and stage.matter.inverse[i] > 0.0:
                if _is_at_wall(stage, i, answers):
                    met += _spread(stage, i)
    return met


@kernel
def _share_rattles(stage, bodies, pairs):
    """Let those that press on who is spent be spent as well: what he hands on is inelastic."""
    pile, states = stage.pile, stage.meetings.states
    for a in range(bodies):
        pile.used[a] = is_spent(stage.meetings, pile.particle[a])
    for c in range(pairs):
        if _presses(pile, c):
            for end in range(2):
                a, b = pile.ends[c, end], pile.ends[c, 1 - end]
                if pile.used[a] and pile.bodies[a, INVERSE] > 0.0:
                    states[pile.particle[b], HITS] = MOST_HITS


@inlined
def _mark_bodies(stage, bodies, mark):
    """Mark all particles that are bodies."""
    for a in range(bodies):
        stage.meetings.heat[stage.pile.particle[a]] = mark


@kernel
def _end(stage, dry, base, bounced, bounces, velocities, again, numbers, answers):
    """Keep what has been found for the next step, and hand it on to the candidates."""
    world = stage.world
    bodies, pairs, contacts, pile = numbers[BODIES], numbers[PAIRS], numbers[CONTACTS], stage.pile
    world.accounts[0, N_UNSETTLED] += numbers[OPEN_GROUPS]
    for c in range(pairs):
        world.accounts[0, N_PAIR_CONTACT] += _presses(pile, c)
    _share_rattles(stage, bodies, pairs)
    remember(stage, contacts, bodies, again)
    for a in range(bodies):
        put_at(pile.bodies, a, KEPT, column(world.candidates.u, pile.particle[a]))
    _hand_on(stage.pair_rules.part, world.candidates, pile, bodies, pairs)
    for c in range(pairs, contacts):
        if _presses(pile, c):
            _lean(stage, dry, here_of(stage, pile.particle[pile.ends[c, FIRST]], answers), pile, c)
    _book(stage, world.ledger, bodies, pairs, contacts)
    numbers[MET] = 0
    if bodies > 0:
        numbers[MET] = _count_met(stage, bodies, base, again, answers)
        if numbers[MET] == 0:
            _mark_bodies(stage, bodies, PUSHED)
            numbers[MET] = _pushed_onto(stage, base, bounced, bounces, velocities, answers)
            _mark_bodies(stage, bodies, COLD)
    if numbers[MET] > 0:
        for p in range(stage.meetings.size[0]):
            i, j = stage.meetings.ends[p, FIRST], stage.meetings.ends[p, SECOND]
            stage.meetings.known[p] = recall(stage.memory, i, j)


@entry
def settle(posted, counters, work, stage, dry, wet, base, bounced, bounces, again):
    """
    Run the contact stage between particles.

    Parameters
    ----------
    posted, counters
        Of threads.share.
    work : contact_solver.Work
        How the contacts are solved; new for each run. Its numbers say how many have been met anew.
    stage : pair_collisions.Stage
        After `collide_all`; the candidates are changed.
    dry, wet : bool
        1 if pairs or colliders have such friction.
    base : (N,) float64 [m]
        Extent of each particle without its path.
    bounced, bounces
        Of bounces.find_bounces.
    again : bool
        Whether it has been run in this step before.

    """
    world = stage.world
    numbers, progress, pile = work.numbers, work.progress, stage.pile
    laws, part = stage.pair_rules.laws, stage.pair_rules.part
    room, velocities = make_room(), np.empty((world.x.shape[1], 6))
    answers = keep_answers(world.rules.present.meshes, world.table)
    fetch_add(posted, 0, 1)
    fetch_add(counters, ENTERED, 1)
    if fetch_add(progress, 0, 1) == 0:
        _list(stage, base, bounced, bounces, velocities, again, numbers, answers)
        colour_contacts(work, pile)
        fetch_add(progress, 1, 1)
    finish(progress, 0, 1)
    phase = _settle_groups(work, 1, dry, wet, laws, part, stage.pair_rules.pull, pile, room)
    if numbers[COLOURED] > 0:
        phase = _settle_large(work, phase, dry, wet, laws, part, pile)
    if fetch_add(progress, 2 * phase, 1) == 0:
        _end(stage, dry, base, bounced, bounces, velocities, again, numbers, answers)
    fetch_add(counters, LEFT, 1)


@entry
def part(meetings, bounced, bounces):
    """Forget the pairs of a step."""
    part_all(meetings, bounced, bounces)
