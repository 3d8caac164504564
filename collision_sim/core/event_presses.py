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
Who presses on whom: contact between particles, for the event-driven method.

Particles that touch, do not approach and have accelerations that would press them together stay in
contact, like those in a pile; so do those whose hit is so slow that the bounces that follow, of
height p BEAT^2 / 2 at most where p is that acceleration, do not count. There is no closed form for
where they go, and this is where the method has an error: from beat to beat, BEATS in a step, they
move straight on, with the velocities that joint.py finds for them together, with all they touch,
colliders included. Forces act at the beginning of a beat. So what is at rest stays at rest, and a
pile in motion is right to first order in the length of a beat. Groups of more than joint.MOST
contacts are solved by sweeps, as in contact_solver.py.

Nothing else changes: who presses still meets others on its way, event by event, and is never led
through anybody. Who touches nobody any more flies, slides or rests again as in exact.py.
"""

from math import inf

from collision_sim.core.contact_solver import (at, colour_contacts, CONTACTS, END_BOUND, ENDING,
                                               FREE as UNPUSHED, IMPULSE, INVERSE, KEPT,
                                               KEPT_IMPULSE, LAW_ROW, NORMAL, push, put_at,
                                               SIZE as BODIES, solve)
from collision_sim.core.courses import carried, frame_acceleration
from collision_sim.core.event_cells import AROUND, cell_beside
from collision_sim.core.event_meetings import can_meet, closing_noise, predict, QUIET, reach, TIE
from collision_sim.core.event_queue import reseat
from collision_sim.core.event_state import (AFTER, AGE, BEAT, BOUND, END, ENDS, FORCED, FREE,
                                            FREED, FROZEN, GLIDING, HITS, keep_path, KIND, path_of,
                                            PRESSES, PRESSING, put_three, RADIUS, ROUND, ROUNDS,
                                            ROW, SETTLES, spot_at, state_of, STOPPED, STRUCK,
                                            take_in, three, V, X)
from collision_sim.core.event_walls import begin_bound_path, bring_up
from collision_sim.core.events import _first_hit
from collision_sim.core.exact import record
from collision_sim.core.exact_ledger import _book_momentum
from collision_sim.core.groups import group_contacts
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.joint import _end_approaches, MOST, OPEN, restrain
from collision_sim.core.ledger import (book, book_impulse, DRAG, INTERNAL, is_kept, kinetic,
                                       REPULSED)
from collision_sim.core.meeting import NOBODY, ZERO
from collision_sim.core.pairs import direction, FIRST, SECOND
from collision_sim.core.paths import Path
from collision_sim.core.rules import (N_PAIR_CONTACT, N_UNDECIDED, N_UNSETTLED, NONE, ROUNDING,
                                      SLIDE, STICK)
from collision_sim.core.shapes import SIDE, SIZE
from collision_sim.core.surfaces import FACES, faces, gap_to, is_flat, touching_depth
from collision_sim.core.sustained import FLIES, held, pull, RESTS
from collision_sim.core.vectors import (add, add_scaled, dot, EPSILON, largest, length, scaled,
                                        subtract)

EVENTS = 100_000        # most rounds that a particle takes part in, in a step
STILL = 1e-9            # share of what gravity does in a beat: slower, a particle is at rest
LEAN = 1e-3             # share of the speed that a force makes in a beat: who leaves slower stays


@inlined
def brisk(gas):
    """Speed [m/s] that gravity makes in a beat."""
    return length(gas.forces.gravity) * gas.clock[BEAT]


@kernel
def _acceleration(gas, i, t):
    """Acceleration [m/s^2] of a particle on its path."""
    kind, f = gas.links[i, KIND], gas.forces
    x, v = state_of(gas, i, t)
    if kind == FREE:
        return pull(f, v)
    if kind == PRESSES or kind == FROZEN:
        return ZERO
    here, path = spot_at(gas, i), path_of(gas, i)
    if path.mode == RESTS:
        c = path.holds[0] // FACES
        return frame_acceleration(gas.courses, gas.world.poses, here, c, t, x, ZERO)
    return held(gas.world, f, here, gas.courses, path.holds, t, x, v)[0]


@kernel
def pressing(gas, i, j, n, t):
    """Acceleration [m/s^2] with which two particles that touch press on each other; or <= 0."""
    one, other = gas.links[i, KIND], gas.links[j, KIND]
    if one == FREE and other == FREE and gas.forces.quadratic == 0.0:
        return 0.0
    if one == PRESSES or other == PRESSES:
        return length(gas.forces.gravity)
    return -dot(n, subtract(_acceleration(gas, i, t), _acceleration(gas, j, t)))


@kernel
def is_slow(gas, i, j, n, t, speed, size):
    """Whether two particles that hit each other at some speed [m/s] stay in contact then."""
    p = pressing(gas, i, j, n, t)
    if not p > 0.0:
        return False
    return speed * speed <= 2.0 * p * TIE * size or (gas.eps < 1.0
                                                     and speed <= p * gas.clock[BEAT])


@kernel
def begin_pressed_path(gas, i, t):
    """Let a particle that presses go straight on, to a collider or the next beat."""
    here, states, ways = spot_at(gas, i), gas.states, gas.ways
    path = Path(FLIES, NOBODY, t, three(states, i, X), three(states, i, V), True, ZERO, 0.0, 0.0,
                False)
    keep_path(gas, i, path)
    ways[i, STOPPED] = ways[i, FREED] = NONE
    ways[i, GLIDING] = 0.0
    end = min(gas.clock[SETTLES], gas.clock[END])
    states[i, ENDS] = inf
    if end > t:
        hit = _first_hit(gas.world, gas.forces, here, gas.courses, gas.work, path, end)
        states[i, ENDS] = hit if hit < end else inf


@kernel
def _give_up(gas, i, t):
    """Fail-safe of a particle with too many events in a step: it stays where it is."""
    here, v = spot_at(gas, i), three(gas.states, i, V)
    gas.world.accounts[i, N_UNDECIDED] += gas.links[i, HITS] == EVENTS
    book(gas.world.ledger, here, REPULSED, kinetic(v, ZERO))
    put_three(gas.states, i, V, ZERO)
    keep_path(gas, i, Path(FLIES, NOBODY, t, three(gas.states, i, X), ZERO, True, ZERO, 0.0, 0.0,
                           False))
    gas.states[i, ENDS] = inf
    gas.ways[i, STOPPED] = gas.ways[i, FREED] = NONE
    gas.ways[i, GLIDING] = 0.0
    if gas.links[i, KIND] != PRESSES:
        gas.links[i, KIND] = FROZEN
        put_three(gas.ways, i, AFTER, ZERO)


@inlined
def begin_path(gas, i, t):
    """Let a particle go on."""
    gas.links[i, HITS] += 1
    if gas.links[i, HITS] >= EVENTS:
        _give_up(gas, i, t)
    elif gas.links[i, KIND] == PRESSES:
        begin_pressed_path(gas, i, t)
    else:
        begin_bound_path(gas, i, t)


@kernel
def _flag(gas, i, t):
    """Let a particle press from now on."""
    if gas.links[i, KIND] == PRESSES or gas.matter.inverse[i] == 0.0:
        return
    if gas.links[i, ROUND] != gas.numbers[ROUNDS]:
        take_in(gas, i)
        bring_up(gas, i, t)
        gas.links[i, AGE] += 1
    gas.links[i, KIND] = PRESSES
    gas.states[i, FORCED] = t
    if not gas.clock[SETTLES] < inf:
        beats = int(t / gas.clock[BEAT]) + 1
        gas.clock[SETTLES] = beats * gas.clock[BEAT]
    gas.pressing[gas.numbers[PRESSING]] = i
    gas.numbers[PRESSING] += 1
    begin_pressed_path(gas, i, t)


@inlined
def _lean(gas, i, j, t):
    """Let two particles press from now on, if they do."""
    states, links = gas.states, gas.links
    if links[i, KIND] == PRESSES and links[j, KIND] == PRESSES:
        return
    size = states[i, RADIUS] + states[j, RADIUS]
    x, v = three(states, i, X), three(states, i, V)
    y, w = state_of(gas, j, t)
    r, u = subtract(x, y), subtract(v, w)
    near = reach(gas, size, x, y, v, w)
    if dot(r, r) > near * near or not can_meet(gas, i, j):
        return
    _, n = direction(r, u)
    p, v_n, noise = pressing(gas, i, j, n, t), dot(n, u), closing_noise(v, w)
    if p > 0.0 and abs(v_n) <= noise + LEAN * p * gas.clock[BEAT]:
        _flag(gas, i, t)
        _flag(gas, j, t)


@kernel
def press_on(gas, row, t):
    """Let a particle of the round press from now on, with all that lean on each other there."""
    i = gas.struck[row]
    for k in range(AROUND):
        j = gas.grid.head[cell_beside(gas, i, k)]
        while j != NONE:
            if j != i:
                _lean(gas, i, j, t)
            j = gas.grid.after[j]


@inlined
def go_on(gas, t):
    """Let all that have taken part go on, and find what comes next for each."""
    for row in range(gas.numbers[STRUCK]):
        i = gas.struck[row]
        gas.links[i, AGE] += 1
        if not gas.simple:
            begin_path(gas, i, t)
    if not gas.simple:
        row = 0
        while row < gas.numbers[STRUCK]:
            press_on(gas, row, t)
            row += 1
    for row in range(gas.numbers[STRUCK]):
        i = gas.struck[row]
        predict(gas, i, t)
        reseat(gas, i)


@inlined
def _begin_contact(gas, c, a, b, law, source, n, gap, h):
    """Write a contact with a gap [m] that may close in a beat, and its impulse of the last one."""
    pile = gas.pile
    pile.ends[c, FIRST], pile.ends[c, SECOND], pile.ends[c, LAW_ROW] = a, b, law
    pile.source[c] = source
    put_at(pile.contacts, c, NORMAL, n)
    total = pile.bodies[a, INVERSE] + pile.bodies[b, INVERSE]
    pile.contacts[c, 3] = 1.0 / total
    pile.contacts[c, END_BOUND] = -max(gap, 0.0) / h + min(max(-gap, 0.0) / h, brisk(gas))


@kernel
def _list_near(gas, row, i, j, t, h, count):
    """List the contact of two particles that may come to touch in a beat; how many there are."""
    states = gas.states
    size = states[i, RADIUS] + states[j, RADIUS]
    x, v = three(states, i, X), three(states, i, V)
    y, w = state_of(gas, j, t)
    r, u = subtract(x, y), subtract(v, w)
    distance, n = direction(r, u)
    near = reach(gas, size, x, y, v, w)
    if distance > near + h * (2.0 * brisk(gas) + max(-dot(n, u), 0.0)) or not can_meet(gas, i, j):
        return count
    if count >= gas.pile.ends.shape[0]:
        gas.world.accounts[i, N_UNDECIDED] += 1
        return count
    if gas.links[j, ROUND] != gas.numbers[ROUNDS]:      # who cannot be moved, and moves on
        take_in(gas, j)
        bring_up(gas, j, t)
        _write_body(gas, gas.links[j, ROW], j, 0.0)
    gap = distance - size
    if abs(gap) <= ROUNDING * (largest(x) + largest(y) + size):
        gap = 0.0
    _begin_contact(gas, count, row, gas.links[j, ROW], gas.world.table.shape[0],
                   j if distance <= near else -2 - j, n, gap, h)
    return count + 1


@inlined
def _list_others(gas, row, t, h, count):
    """List the contacts of a particle that presses with other particles; how many there are."""
    links, i = gas.links, gas.struck[row]
    for k in range(AROUND):
        j = gas.grid.head[cell_beside(gas, i, k)]
        while j != NONE:
            fixed = gas.matter.inverse[j] == 0.0
            if fixed or (links[j, KIND] == PRESSES and links[j, ROW] > row):
                count = _list_near(gas, row, i, j, t, h, count)
            j = gas.grid.after[j]
    return count


@inlined
def chord_rise(gas, c, face, w, n, radius, h):
    """Speed [m/s] off a round wall around a particle at which a chord ends on the wall again."""
    table = gas.world.table
    if table[c, SIDE] > 0.0 or is_flat(table, c, face, table[c, SIDE]):
        return 0.0
    space = max(gas.world.table[c, SIZE] - radius, EPSILON * gas.world.table[c, SIZE])
    along = add_scaled(w, -dot(w, n), n)
    return 0.5 * h * dot(along, along) / space


@kernel
def _list_colliders(gas, row, t, h, count, bodies):
    """List the colliders that a particle may come to touch in a beat; contacts, bodies then."""
    i, table, here = gas.struck[row], gas.world.table, spot_at(gas, gas.struck[row])
    x, v = three(gas.states, i, X), three(gas.states, i, V)
    for c in range(table.shape[0]):
        side = table[c, SIDE]
        later = carried(gas.courses, gas.world.poses, here, c, x, t, t + h)
        obj = scaled(1.0 / h, subtract(later, x))
        for face in range(faces(table, c, side)):
            gap, slope, n = gap_to(gas.world, here, gas.courses, c, face, side, here.radius, t, x)
            w = subtract(v, obj)
            if gap > h * (2.0 * brisk(gas) + max(-dot(n, w), 0.0)) + TIE * here.radius or (
                    count >= gas.pile.ends.shape[0] or bodies >= gas.pile.bodies.shape[0]):
                continue
            if abs(gap) <= touching_depth(gas.world, here, c, x):
                gap = 0.0
            gas.pile.bodies[bodies, INVERSE] = 0.0
            put_at(gas.pile.bodies, bodies, UNPUSHED, obj)
            put_at(gas.pile.bodies, bodies, ENDING, obj)
            put_at(gas.pile.bodies, bodies, KEPT, obj)
            _begin_contact(gas, count, row, bodies, c, c, n, gap / max(slope, 0.5), h)
            gas.pile.contacts[count, END_BOUND] += chord_rise(gas, c, face, w, n, here.radius, h)
            count, bodies = count + 1, bodies + 1
    return count, bodies


@inlined
def _write_body(gas, row, i, h):
    """Write the body of a particle, with what forces do until the end of a beat of length h."""
    v, bodies = three(gas.states, i, V), gas.pile.bodies
    bodies[row, INVERSE] = gas.matter.inverse[i]
    if h > 0.0:
        v = add_scaled(v, h, pull(gas.forces, v))
    put_at(bodies, row, UNPUSHED, v)
    put_at(bodies, row, ENDING, v)
    put_at(bodies, row, KEPT, v)


@kernel
def _recall(gas, count, pairs):
    """Give the contacts of large groups the impulses that they had in the last beat."""
    memory, pile = gas.memory, gas.pile
    for c in range(count):
        put_at(pile.contacts, c, IMPULSE, ZERO)
        if pile.colour[c] != NONE:
            i = gas.struck[pile.ends[c, FIRST]]
            other = gas.struck[pile.ends[c, SECOND]] if c < pairs else -2 - pile.source[c]
            for end in range(2):
                one, two = (i, other) if end == 0 else (other, i)
                k = memory.head[one] if one >= 0 else NONE
                while k != NONE and memory.whom[k] != two:
                    k = memory.after[k]
                if k != NONE:
                    kept = scaled(1.0 - 2.0 * end, three(memory.impulse, k, 0))
                    if dot(kept, at(pile.contacts, c, NORMAL)) > 0.0:
                        put_at(pile.contacts, c, IMPULSE, kept)
                        push(pile.bodies, pile.ends[c, FIRST], pile.ends[c, SECOND], ENDING, kept)
                    break
        put_at(pile.contacts, c, KEPT_IMPULSE, at(pile.contacts, c, IMPULSE))


@kernel
def _remember(gas, count, pairs):
    """Keep the impulses of a beat for the next one."""
    memory, pile = gas.memory, gas.pile
    memory.head[:] = NONE
    for c in range(min(count, memory.whom.shape[0])):
        i = gas.struck[pile.ends[c, FIRST]]
        memory.whom[c] = gas.struck[pile.ends[c, SECOND]] if c < pairs else -2 - pile.source[c]
        put_three(memory.impulse, c, 0, at(pile.contacts, c, IMPULSE))
        memory.after[c], memory.head[i] = memory.head[i], c


@kernel
def _solve_all(gas, count, pairs, bodies):
    """Find the impulses of all contacts."""
    pile, large = gas.pile, 0
    groups = group_contacts(pile, bodies, count)
    for g in range(groups):
        first, size = 0 + pile.group[g], pile.group[g + 1] - pile.group[g]
        for k in range(size):
            pile.colour[pile.member[first + k]] = NONE if size <= MOST else 0
        large += size > MOST
    _recall(gas, count, pairs)
    for g in range(groups):
        first, size = 0 + pile.group[g], pile.group[g + 1] - pile.group[g]
        if size <= MOST:
            friction = _end_approaches(gas.dry, gas.wet, gas.laws, pile, first, size, gas.room)
            gas.world.accounts[0, N_UNSETTLED] += friction == OPEN
    if large > 0:
        sweeps = gas.sweeps
        sweeps.progress[:] = 0
        sweeps.start[:] = 0
        sweeps.numbers[BODIES], sweeps.numbers[CONTACTS] = bodies, count
        for row in range(bodies):
            put_at(pile.bodies, row, KEPT, at(pile.bodies, row, ENDING))
        colour_contacts(sweeps, pile)
        solve(False, sweeps, 0, gas.dry, gas.wet, gas.laws, pile)
        for g in range(groups):
            first, size = 0 + pile.group[g], pile.group[g + 1] - pile.group[g]
            if size > MOST:
                restrain(pile, first, size)
    _remember(gas, count, pairs)


@inlined
def _book_forces(gas, i, h, work, after):
    """Book what forces, colliders and other particles do to a particle in a beat."""
    if is_kept(gas.world.ledger):
        here, v = spot_at(gas, i), three(gas.states, i, V)
        drag = scaled(h, subtract(pull(gas.forces, v), gas.forces.gravity))
        _book_momentum(gas.world.ledger, here, scaled(h, gas.forces.gravity), drag)
        slowed = dot(drag, v)
        book(gas.world.ledger, here, DRAG, slowed)
        book(gas.world.ledger, here, INTERNAL, kinetic(v, after) - work - slowed)


@kernel
def _hand_on(gas, own, count, pairs, end):
    """Give the particles the velocities that have been found, and log and book what did it."""
    pile, states = gas.pile, gas.states
    for row in range(own):
        pile.work[row] = 0.0
        pile.order[row] = 0
    for c in range(count):
        impulse, n = at(pile.contacts, c, IMPULSE), at(pile.contacts, c, NORMAL)
        row, acts = pile.ends[c, FIRST], dot(impulse, n) > 0.0
        i, other = gas.struck[row], pile.ends[c, SECOND]
        if c < pairs:
            if acts or pile.source[c] >= 0:
                pile.order[row] = pile.order[other] = 1
            gas.world.accounts[i, N_PAIR_CONTACT] += acts
        elif acts and pile.order[row] == 1:
            here, wall = spot_at(gas, i), pile.source[c]
            dv, obj = scaled(gas.matter.inverse[i], impulse), at(pile.bodies, other, UNPUSHED)
            w = subtract(at(pile.bodies, row, ENDING), obj)
            if abs(dot(w, n)) <= QUIET * brisk(gas):    # what the solution has left open
                left = scaled(-dot(w, n), n)
                dv, w = add(dv, left), add(w, left)
                put_at(pile.bodies, row, ENDING, add(w, obj))
            slip = length(add_scaled(w, -dot(w, n), n))
            record(gas.world, here, wall, STICK if slip <= 1e-9 * brisk(gas) else SLIDE,
                   three(states, i, X), n, dv)
            book_impulse(gas.world.ledger, here, wall, dot(dv, obj), dv)
            pile.work[row] += dot(dv, obj)
    for row in range(own):
        i = gas.struck[row]
        after = at(pile.bodies, row, ENDING)
        if pile.order[row] == 1:
            if length(after) <= STILL * brisk(gas):
                after = ZERO
            _book_forces(gas, i, end - states[i, FORCED], pile.work[row], after)
            put_three(states, i, V, after)
            states[i, FORCED] = end


@kernel
def _release(gas, i, t, on_wall):
    """Let a particle that touches nobody any more go on by itself."""
    states, h = gas.states, t - gas.states[i, FORCED]
    gas.links[i, KIND] = BOUND
    if h > 0.0 and not on_wall:
        v = three(states, i, V)
        after = add_scaled(v, h, pull(gas.forces, v))
        _book_forces(gas, i, h, 0.0, after)
        put_three(states, i, V, after)


@kernel
def settle_pressed(gas, t):
    """
    Begin a beat: find the velocities of all that press, together with what they touch.

    Parameters
    ----------
    gas : event_state.Gas
        The step.
    t : float [s]
        Now.

    """
    h = min(gas.clock[BEAT], gas.clock[END] - t)
    own, count, row = gas.numbers[PRESSING], 0, 0
    gas.numbers[ROUNDS] += 1
    gas.numbers[STRUCK] = 0
    gas.clock[SETTLES] = t + h
    for k in range(own):
        take_in(gas, gas.pressing[k])
    for row in range(own):
        bring_up(gas, gas.struck[row], t)
        _write_body(gas, row, gas.struck[row], t + h - gas.states[gas.struck[row], FORCED])
    for row in range(own):
        count = _list_others(gas, row, t, h, count)
    pairs, bodies = count, gas.numbers[STRUCK]
    for row in range(own):
        count, bodies = _list_colliders(gas, row, t, h, count, bodies)
    if count > 0:
        _solve_all(gas, count, pairs, bodies)
    _hand_on(gas, own, count, pairs, t + h)
    kept = 0
    for row in range(own):
        i = gas.struck[row]
        if gas.pile.order[row] == 1:
            gas.pressing[kept] = i
            kept += 1
        else:
            _release(gas, i, t, _is_on_wall(gas, row, count, pairs))
    gas.numbers[PRESSING] = kept
    if kept == 0:
        gas.clock[SETTLES] = inf
    go_on(gas, t)


@kernel
def _is_on_wall(gas, row, count, pairs):
    """Whether a collider pushes the particle of a row."""
    for c in range(pairs, count):
        if gas.pile.ends[c, FIRST] == row and dot(at(gas.pile.contacts, c, IMPULSE),
                                                  at(gas.pile.contacts, c, NORMAL)) > 0.0:
            return True
    return False


@kernel
def find_pressed(gas):
    """Find who presses at the start of a step."""
    gas.numbers[ROUNDS] += 1
    gas.numbers[STRUCK] = 0
    for i in range(gas.states.shape[0]):
        if gas.links[i, ROUND] != gas.numbers[ROUNDS]:
            take_in(gas, i)
    row = 0
    while row < gas.numbers[STRUCK]:
        press_on(gas, row, 0.0)
        row += 1
    if gas.numbers[PRESSING] > 0:
        gas.clock[SETTLES] = 0.0
