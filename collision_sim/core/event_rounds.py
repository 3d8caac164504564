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
What happens at once between particles is answered at once, round by round.

A round begins with the first event of the queue, and takes in all that come within TIE of it. All
contacts at which those that take part approach each other, or a collider, are answered together:
by joint.collide_group where they hang together, so that the order of the particles means nothing
and what is symmetric stays so; one alone by Newton's law with the lecture's friction. What then
approaches makes up the next round, at the same time: in a row at rest the push goes from one to
the next, and the last one leaves.

A particle that collides CHATTER times with no time in between has collapsed (of particles that
lose energy there are infinitely many collisions in a finite time): all that touch then and hang
together go on without approaching, which is what these collisions come to. It is counted.
"""

from math import inf

from collision_sim.core.cells import MANY
from collision_sim.core.contact_solver import (at, END_BOUND, ENDING, FREE as UNPUSHED, IMPULSE,
                                               INVERSE, LAW_ROW, MASS, MEAN_BOUND, NORMAL, put_at)
from collision_sim.core.courses import carried, material_velocity
from collision_sim.core.event_cells import AROUND, cell_beside
from collision_sim.core.event_meetings import (can_meet, change_cell, least_closing, predict,
                                               reach, SOON, TIE)
from collision_sim.core.event_presses import brisk, chord_rise, go_on, is_slow
from collision_sim.core.event_queue import reseat, seat_at
from collision_sim.core.event_state import (AGE, BEAT, END, ENDS, HITS, KIND, LATEST, LEAVES,
                                            MEETS, NEXT_BEST, OTHER, OTHER_AGE, PRESSES, put_three,
                                            RADIUS, RAPID, ROUND, ROUNDS, ROW, SETTLES, spot_at,
                                            state_of, STRUCK, take_in, three, V, X)
from collision_sim.core.event_walls import answer_walls, bring_up, gather_walls
from collision_sim.core.exact import _approaches, record
from collision_sim.core.groups import group_contacts
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.joint import _end_approaches, collide_group, MOST, OPEN
from collision_sim.core.laws import normal_impulse
from collision_sim.core.ledger import book, book_impulse, INTERNAL, kinetic
from collision_sim.core.meeting import facing, SPEED, surface_of, ZERO
from collision_sim.core.pair_collisions import friction_factor
from collision_sim.core.pairs import direction, FIRST, SECOND
from collision_sim.core.rules import (COLLISION, N_COLLAPSED, N_COLLISION, N_PAIR_COLLISION,
                                      N_UNDECIDED, N_UNSETTLED, NONE)
from collision_sim.core.shapes import RESTITUTION
from collision_sim.core.surfaces import FACES
from collision_sim.core.vectors import add, add_scaled, dot, length, scaled, subtract

CHATTER = 64            # collisions without time in between after which a particle collapses
ALL = 1 << 40           # contacts: no limit
UNITED = -2             # label of a body that has been counted
PATIENCE = 8            # collisions without time in between with a wall that chords lead off it
STEEP = 100.0           # times what a velocity lacks: up to there it gets faster, not turned
CLOSE = 10.0            # times TIE: who hangs together in a collapse


@inlined
def is_void(gas, i):
    """Whether who particle i was to meet has changed its path since."""
    return gas.links[gas.links[i, OTHER], AGE] != gas.links[i, OTHER_AGE]


@inlined
def take_event(gas, i):
    """Let those whom the first event of particle i is about take part in the round."""
    states = gas.states
    if states[i, MEETS] <= states[i, ENDS]:
        take_in(gas, gas.links[i, OTHER])
    take_in(gas, i)
    seat_at(gas, i, inf)


@kernel
def _delay(gas, i, t):
    """How far [m] those of the first event of particle i move until it, relative to each other."""
    states = gas.states
    _, v = state_of(gas, i, t)
    when, size = states[i, ENDS], states[i, RADIUS]
    if states[i, MEETS] <= states[i, ENDS]:
        j = gas.links[i, OTHER]
        _, other = state_of(gas, j, t)
        v, when, size = subtract(v, other), states[i, MEETS], size + states[j, RADIUS]
    return length(v) * (when - t), size


@kernel
def take_ties(gas, t):
    """Let all take part that come at the same time, up to what is only rounding."""
    states, keys, seats = gas.states, gas.heap.keys, gas.heap.seats
    soon = t + 1e-3 * TIE * gas.clock[END]
    while keys[0] < inf:
        i, when = seats[0], keys[0]
        if states[i, LEAVES] <= when:
            if when > soon:
                return
            change_cell(gas, i, when)
            reseat(gas, i)
        elif states[i, MEETS] <= states[i, ENDS] and is_void(gas, i):
            if when > soon:
                return
            predict(gas, i, t)
            reseat(gas, i)
        else:
            way, size = _delay(gas, i, t)
            if when > soon and not way <= TIE * size:
                return
            take_event(gas, i)


@inlined
def write_body(gas, row, i):
    """Write the body that stands for a particle in what happens at once."""
    bodies = gas.pile.bodies
    bodies[row, INVERSE] = gas.matter.inverse[i]
    put_at(bodies, row, UNPUSHED, three(gas.states, i, V))
    put_at(bodies, row, ENDING, three(gas.states, i, V))


@kernel
def write_contact(gas, c, a, b, law, source, n):
    """Write contact c of bodies a and b; `source` is its collider, if it has one."""
    pile = gas.pile
    pile.ends[c, FIRST], pile.ends[c, SECOND], pile.ends[c, LAW_ROW] = a, b, law
    pile.source[c] = source
    put_at(pile.contacts, c, NORMAL, n)
    total = pile.bodies[a, INVERSE] + pile.bodies[b, INVERSE]
    pile.contacts[c, MASS] = 1.0 / total if total > 0.0 else 1.0
    pile.contacts[c, END_BOUND] = 0.0


@inlined
def _looks_back(gas, i, row):
    """Whether what particle i has to do with that of a row is known already."""
    return gas.links[i, ROUND] == gas.numbers[ROUNDS] and gas.links[i, ROW] <= row


@kernel
def _list_touch(gas, row, i, j, t, count, lasting):
    """List the contact of particle i with j, if they touch; how many contacts there are then."""
    states, size = gas.states, gas.states[i, RADIUS] + gas.states[j, RADIUS]
    x, v = three(states, i, X), three(states, i, V)
    y, w = state_of(gas, j, t)
    r, u = subtract(x, y), subtract(v, w)
    near = reach(gas, size, x, y, v, w) + (CLOSE * TIE * size if lasting else 0.0)
    if dot(r, r) > near * near or not can_meet(gas, i, j):
        return count
    _, n = direction(r, u)
    if not (lasting or dot(n, u) < -least_closing(gas, i, j, v, w)):
        return count
    if count >= gas.pile.ends.shape[0]:
        gas.world.accounts[i, N_UNDECIDED] += 1
        return count
    take_in(gas, j)
    pile, law = gas.pile, gas.world.table.shape[0]
    if not gas.simple:
        if is_slow(gas, i, j, n, t, -dot(n, u), size):
            law += gas.world.table.shape[0] + 1
    pile.ends[count, FIRST], pile.ends[count, SECOND] = row, gas.links[j, ROW]
    pile.ends[count, LAW_ROW], pile.source[count] = law, NONE
    put_at(pile.contacts, count, NORMAL, n)
    return count + 1


@inlined
def list_touches(gas, row, t, count, lasting):
    """List the contacts of a particle of the round with others; how many there are then."""
    i = gas.struck[row]
    for k in range(AROUND):
        j = gas.grid.head[cell_beside(gas, i, k)]
        while j != NONE:
            if not _looks_back(gas, j, row):
                count = _list_touch(gas, row, i, j, t, count, lasting)
            j = gas.grid.after[j]
    return count


@inlined
def _note_pace(gas, i, t, speed, size):
    """Count how often a particle has collided without time in between; whether that is enough."""
    states, links = gas.states, gas.links
    rapid = t == states[i, LATEST] or speed * (t - states[i, LATEST]) <= TIE * size
    links[i, RAPID] = links[i, RAPID] + 1 if rapid else 0
    states[i, LATEST] = t
    return links[i, RAPID] > CHATTER or links[i, HITS] > MANY


@inlined
def _outrun(gas, i, c, obj, n, t, rest):
    """Speed [m/s] by which a collider that accelerates gets ahead of its velocity in a time."""
    if not rest > 0.0:
        return 0.0
    x = three(gas.states, i, X)
    ahead = carried(gas.courses, gas.world.poses, spot_at(gas, i), c, x, t, t + rest)
    return max(dot(subtract(scaled(1.0 / rest, subtract(ahead, x)), obj), n), 0.0)


@kernel
def list_walls(gas, row, t, first, count, lasting):
    """
    List the contacts of a particle with colliders that it approaches; how many there are then.

    Bodies for them follow from `first` on, one for each contact.
    """
    i = gas.struck[row]
    met = gather_walls(gas, i, t)
    for k in range(met):
        if (lasting or gas.met[k, SPEED] < 0.0) and count < gas.pile.ends.shape[0] and (
                first + k < gas.pile.bodies.shape[0]):
            c, body = surface_of(gas.met, k) // FACES, first + k
            obj = material_velocity(gas.courses, gas.world.poses, spot_at(gas, i), c, t,
                                    three(gas.states, i, X))
            gas.pile.bodies[body, INVERSE] = 0.0
            put_at(gas.pile.bodies, body, UNPUSHED, obj)
            put_at(gas.pile.bodies, body, ENDING, obj)
            law, rise, n = c, 0.0, facing(gas.met, k)
            if gas.links[i, KIND] == PRESSES and -gas.met[k, SPEED] <= brisk(gas):
                law += gas.world.table.shape[0] + 1
                rest = min(gas.clock[SETTLES], gas.clock[END]) - t
                w, face = subtract(three(gas.states, i, V), obj), surface_of(gas.met, k) % FACES
                if gas.links[i, RAPID] < PATIENCE:
                    rise = chord_rise(gas, c, face, w, n, gas.states[i, RADIUS], max(rest, 0.0))
                    rise += _outrun(gas, i, c, obj, n, t, rest)
                soon = t - gas.states[i, LATEST] <= SOON * gas.clock[BEAT]
                gas.links[i, RAPID] = gas.links[i, RAPID] + 1 if soon else 0
                gas.states[i, LATEST] = t
            write_contact(gas, count, row, body, law, c, n)
            gas.pile.contacts[count, MEAN_BOUND] = rise
            count += 1
    return count, first + met


@inlined
def change_velocity(gas, i, after, work):
    """Give a particle another velocity; `work` [J/kg] is what colliders have done to it."""
    before = three(gas.states, i, V)
    put_three(gas.states, i, V, after)
    book(gas.world.ledger, spot_at(gas, i), INTERNAL, kinetic(before, after) - work)


@inlined
def _collide_two(gas, i, j, n, law):
    """Let two particles collide by themselves."""
    states, inverse = gas.states, gas.matter.inverse
    vi, vj = three(states, i, V), three(states, j, V)
    u = subtract(vi, vj)
    v_n = dot(u, n)
    dv_n = normal_impulse(v_n, gas.laws[law, RESTITUTION])
    slip = add_scaled(u, -v_n, n)
    factor = friction_factor(gas.pairs_dry, gas.pairs_wet, gas.laws, law, slip, dv_n)
    dv = add_scaled(scaled(dv_n, n), factor - 1.0, slip)
    total = inverse[i] + inverse[j]
    change_velocity(gas, i, add_scaled(vi, inverse[i] / total, dv), 0.0)
    change_velocity(gas, j, add_scaled(vj, -inverse[j] / total, dv), 0.0)
    gas.world.accounts[i, N_PAIR_COLLISION] += 1


@kernel
def _has_collapsed(gas, count, t):
    """Note the collisions of a round with its particles; whether one of these has collapsed."""
    collapsed = False
    for c in range(count):
        i, j = gas.struck[gas.pile.ends[c, FIRST]], gas.struck[gas.pile.ends[c, SECOND]]
        speed = length(subtract(three(gas.states, i, V), three(gas.states, j, V)))
        size = gas.states[i, RADIUS] + gas.states[j, RADIUS]
        one, other = _note_pace(gas, i, t, speed, size), _note_pace(gas, j, t, speed, size)
        collapsed = collapsed or one or other
    return collapsed and gas.eps < 1.0


@kernel
def _answer_group(gas, first, count, inelastic):
    """Answer contacts that hang together: at once where they are few, else one by one."""
    if count <= MOST:
        if inelastic:
            friction = _end_approaches(gas.dry, gas.wet, gas.laws, gas.pile, first, count,
                                       gas.room)
        else:
            friction = collide_group(gas.dry, gas.wet, gas.laws, gas.pile, first, count, gas.room)
        gas.world.accounts[0, N_UNSETTLED] += friction == OPEN
        return
    gas.world.accounts[0, N_UNSETTLED] += 1
    if inelastic:
        _unite(gas, first, count)
    else:
        _answer_singly(gas, first, count)


@kernel
def _answer_singly(gas, first, count):
    """Answer contacts one after the other, each for what the ones before it have left."""
    pile = gas.pile
    bodies = pile.bodies
    for k in range(count):
        c = pile.member[first + k]
        put_at(pile.contacts, c, IMPULSE, ZERO)
        a, b, n = pile.ends[c, FIRST], pile.ends[c, SECOND], at(pile.contacts, c, NORMAL)
        u = subtract(at(bodies, a, ENDING), at(bodies, b, ENDING))
        v_n, law = dot(u, n), pile.ends[c, LAW_ROW]
        if v_n < 0.0:
            dv_n = normal_impulse(v_n, gas.laws[law, RESTITUTION])
            slip = add_scaled(u, -v_n, n)
            factor = friction_factor(gas.dry, gas.wet, gas.laws, law, slip, dv_n)
            dv = add_scaled(scaled(dv_n, n), factor - 1.0, slip)
            total = bodies[a, INVERSE] + bodies[b, INVERSE]
            put_at(pile.contacts, c, IMPULSE, scaled(1.0 / total, dv))
            put_at(bodies, a, ENDING, add_scaled(at(bodies, a, ENDING),
                                                 bodies[a, INVERSE] / total, dv))
            put_at(bodies, b, ENDING, add_scaled(at(bodies, b, ENDING),
                                                 -bodies[b, INVERSE] / total, dv))


@kernel
def _unite(gas, first, count):
    """Give all of a group one velocity: that of what nothing moves, or else the mean."""
    pile, mass, momentum, fixed = gas.pile, 0.0, ZERO, NONE
    for k in range(count):
        c = pile.member[first + k]
        put_at(pile.contacts, c, IMPULSE, ZERO)
        for end in range(2):
            body = pile.ends[c, end]
            inverse = pile.bodies[body, INVERSE]
            if inverse == 0.0:
                fixed = c
            elif pile.label[body] != UNITED:
                pile.label[body] = UNITED
                mass += 1.0 / inverse
                momentum = add_scaled(momentum, 1.0 / inverse, at(pile.bodies, body, UNPUSHED))
    u = scaled(1.0 / mass, momentum)
    if fixed != NONE:
        other = pile.ends[fixed, SECOND]
        if pile.bodies[other, INVERSE] > 0.0:
            other = pile.ends[fixed, FIRST]
        u = at(pile.bodies, other, UNPUSHED)
        put_at(pile.contacts, fixed, IMPULSE, add_scaled(scaled(mass, u), -1.0, momentum))
    for k in range(count):
        for end in range(2):
            body = pile.ends[pile.member[first + k], end]
            if pile.bodies[body, INVERSE] > 0.0:
                put_at(pile.bodies, body, ENDING, u)


@inlined
def _raised(v, obj, n, rise):
    """Turn a velocity off a wall, so that the straight way that follows does not lead into it."""
    w = subtract(v, obj)
    lacks = rise - dot(w, n)
    if not lacks > 0.0:
        return v
    turned = add_scaled(w, lacks, n)
    if length(w) <= STEEP * lacks:
        return add(obj, turned)
    return add_scaled(obj, length(w) / length(turned), turned)


@kernel
def take_over(gas, count, pairs, t):
    """Give the particles of a round what has been made of their velocities."""
    pile = gas.pile
    for row in range(gas.numbers[STRUCK]):
        pile.work[row] = 0.0
    for c in range(count):
        impulse, n = at(pile.contacts, c, IMPULSE), at(pile.contacts, c, NORMAL)
        row = pile.ends[c, FIRST]
        i = gas.struck[row]
        if c < pairs:
            gas.world.accounts[i, N_PAIR_COLLISION] += dot(impulse, n) > 0.0
            continue
        wall, here = pile.source[c], spot_at(gas, i)
        dv = scaled(gas.matter.inverse[i], impulse)
        obj = at(pile.bodies, pile.ends[c, SECOND], UNPUSHED)
        if pile.contacts[c, MEAN_BOUND] > 0.0:
            before = at(pile.bodies, row, ENDING)
            after = _raised(before, obj, n, pile.contacts[c, MEAN_BOUND])
            dv = add(dv, subtract(after, before))
            put_at(pile.bodies, row, ENDING, after)
        if not dot(dv, n) > 0.0:
            continue
        record(gas.world, here, wall, COLLISION, three(gas.states, i, X), n, dv)
        book_impulse(gas.world.ledger, here, wall, dot(dv, obj), dv)
        pile.work[pile.ends[c, FIRST]] += dot(dv, obj)
        gas.world.accounts[i, N_COLLISION] += 1
    for row in range(gas.numbers[STRUCK]):
        i = gas.struck[row]
        if gas.matter.inverse[i] > 0.0:
            change_velocity(gas, i, at(pile.bodies, row, ENDING), pile.work[row])


@kernel
def _answer_together(gas, pairs, inelastic, t):
    """Answer what happens in a round, where it is more than one contact of two particles."""
    pile, struck, count = gas.pile, gas.numbers[STRUCK], pairs
    bodies = struck
    for row in range(struck):
        write_body(gas, row, gas.struck[row])
        pile.used[row] = 0
    for c in range(pairs):
        a, b = pile.ends[c, FIRST], pile.ends[c, SECOND]
        pile.used[a] = pile.used[b] = 1
        write_contact(gas, c, a, b, pile.ends[c, LAW_ROW], NONE, at(pile.contacts, c, NORMAL))
    if not gas.simple:
        for row in range(struck):
            i = gas.struck[row]
            if gas.links[i, KIND] == PRESSES:
                pile.used[row] = 1
            if pile.used[row] == 1 and gas.matter.inverse[i] > 0.0:
                count, bodies = list_walls(gas, row, t, bodies, count, inelastic)
    alone = 0
    for row in range(struck):
        alone += pile.used[row] == 0
    if count > 0:
        for row in range(struck):
            pile.order[row] = pile.used[row]
        groups = group_contacts(pile, bodies, count)
        for g in range(groups):
            _answer_group(gas, 0 + pile.group[g], pile.group[g + 1] - pile.group[g], inelastic)
        take_over(gas, count, pairs, t)
        for row in range(struck):
            pile.used[row] = pile.order[row]
    if alone > 0 and not gas.simple:
        for row in range(struck):
            if pile.used[row] == 0:
                answer_walls(gas, gas.struck[row], t)


@kernel
def list_all(gas, t, lasting, most):
    """
    List the contacts of all that take part, and who takes part by them.

    Parameters
    ----------
    gas : event_state.Gas
        The step.
    t : float [s]
        Now.
    lasting : bool
        Whether to list all that touch, or only those that approach each other.
    most : int
        After how many contacts to stop.

    Returns
    -------
    count : int
        How many contacts there are; more than `most` where not all are listed.

    """
    count, row = 0, 0
    while row < gas.numbers[STRUCK]:
        bring_up(gas, gas.struck[row], t)
        row += 1
    row = 0
    while row < gas.numbers[STRUCK] and count <= most:
        before = gas.numbers[STRUCK]
        count = list_touches(gas, row, t, count, lasting)
        for k in range(before, gas.numbers[STRUCK]):
            bring_up(gas, gas.struck[k], t)
        row += 1
    return count


@kernel
def _list_anew(gas, t, lasting, most):
    """List contacts as `list_all`, from those on that have begun the round."""
    struck = gas.numbers[STRUCK]
    gas.numbers[ROUNDS] += 1
    gas.numbers[STRUCK] = 0
    for row in range(struck):
        take_in(gas, gas.struck[row])
    return list_all(gas, t, lasting, most)


@kernel
def _is_calm(gas, count, t):
    """Whether all that approaches in a round does so slowly, and is held by others."""
    presses = False
    for c in range(count):
        if gas.pile.ends[c, LAW_ROW] == gas.world.table.shape[0]:
            return False
    for row in range(gas.numbers[STRUCK]):
        presses = presses or gas.links[gas.struck[row], KIND] == PRESSES
    if presses:
        for row in range(gas.numbers[STRUCK]):
            met = gather_walls(gas, gas.struck[row], t)
            for k in range(met):
                if -gas.met[k, SPEED] > brisk(gas):
                    return False
    return presses


@inlined
def _is_alone(gas, i, t):
    """Whether nobody but the two of an event can take part in the round, as far as is known."""
    states, j, soon = gas.states, gas.links[i, OTHER], t + 1e-3 * TIE * gas.clock[END]
    if gas.numbers[STRUCK] == 1:
        return states[i, MEETS] > soon
    if gas.numbers[STRUCK] > 2 or not states[i, NEXT_BEST] > soon:
        return False
    return not (states[j, MEETS] <= soon and (gas.links[j, OTHER] != i
                                              or not states[j, NEXT_BEST] > soon))


@inlined
def _list_alone(gas, i, t):
    """List the contact of the two of an event, if they approach; how many there are."""
    bring_up(gas, gas.struck[0], t)
    if gas.numbers[STRUCK] == 1:
        return 0
    bring_up(gas, gas.struck[1], t)
    return _list_touch(gas, 0, gas.struck[0], gas.struck[1], t, 0, False)


@inlined
def _meets_walls(gas, t):
    """Whether any particle of the round approaches a collider that it touches."""
    if not gas.simple:
        for row in range(gas.numbers[STRUCK]):
            if _approaches(gas.met, gather_walls(gas, gas.struck[row], t)):
                return True
    return False


@inlined
def play_round(gas, i, t):
    """
    Answer the first event of the queue, with all that happens at once.

    Parameters
    ----------
    gas : event_state.Gas
        The step.
    i : int
        Whose event it is.
    t : float [s]
        When it is.

    """
    gas.numbers[ROUNDS] += 1
    gas.numbers[STRUCK] = 0
    take_event(gas, i)
    take_ties(gas, t)
    count = _list_alone(gas, i, t) if _is_alone(gas, i, t) else list_all(gas, t, False, ALL)
    collapsed = count > 0 and _has_collapsed(gas, count, t)
    calm = False
    if collapsed:
        count = _list_anew(gas, t, True, ALL)
    elif not gas.simple and _is_calm(gas, count, t):
        struck = gas.numbers[STRUCK]
        count = _list_anew(gas, t, True, MOST)
        calm = count <= MOST
        if not calm:
            gas.numbers[STRUCK] = struck
            count = _list_anew(gas, t, False, ALL)
    if count == 1 and gas.numbers[STRUCK] == 2 and not (collapsed or calm) and (
            not _meets_walls(gas, t)):
        a, b = gas.struck[gas.pile.ends[0, FIRST]], gas.struck[gas.pile.ends[0, SECOND]]
        _collide_two(gas, a, b, at(gas.pile.contacts, 0, NORMAL), gas.pile.ends[0, LAW_ROW])
    elif count > 0 or not gas.simple:
        _answer_together(gas, count, collapsed or calm, t)
    gas.world.accounts[0, N_COLLAPSED] += collapsed
    go_on(gas, t)
