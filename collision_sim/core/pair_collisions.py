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
The collision stage between particles, and with the colliders near them.

It is elastic, and acts on the velocities at the start of the step.

Two particles collide if they meet and approach each other, as pairs.py says; a particle that is
near another one collides with a collider as response.py says. Who pressed on each other when the
last step ended stays in contact, unless they approach faster than gravity makes it in a step: what
the sweeps of a pile have left of an approach is no collision. Each gets its part, by the masses,
of one change of their relative velocity: restitution along the normal, friction along the surface.
So the momentum of a pair is conserved to rounding, and with restitution 1 and without friction its
energy. Balls do not spin: friction at their surfaces does not conserve angular momentum about
their centres.

What happens at once is answered at once: all collisions of a round that have a particle in common,
by joint.collide_group. Without sweeps all that meet at the end of the step do so; with sweeps
those that come first for all that take part, to TIE. Then their candidates are flown anew, the
pairs and colliders of who has collided are looked at again, with whoever is near its new path, and
the next round follows until nobody collides, and no collider throws anybody onto those that have:
he is listed then, and rounds go on. So in a row at rest the push goes from ball to ball,
and the last one leaves. A particle collides MOST_HITS times in a step; what is left is for the
contact stage, in piles.py. Of more than joint.MOST collisions at once those come first that are
deepest, or earliest, for both of their particles. Nothing depends on the order of the particles.
"""

from math import inf

from collision_sim.core.around import begin_moves, find_around, move
from collision_sim.core.candidates import fly_anew
from collision_sim.core.contact_solver import (at, END_BOUND, ENDING, FREE, IMPULSE, INVERSE,
                                               LAW_ROW, MASS, NORMAL, put_at)
from collision_sim.core.groups import group_contacts
from collision_sim.core.impulses import dry_factor, wet_factor
from collision_sim.core.jit import entry, inlined, kernel
from collision_sim.core.joint import collide_group, make_room, MOST, OPEN
from collision_sim.core.laws import normal_impulse
from collision_sim.core.ledger import book, book_impulse, INTERNAL, kinetic
from collision_sim.core.mesh_way import keep_answers
from collision_sim.core.pair_memory import BLURRED, recall
from collision_sim.core.pair_walls import (ALONG, APPROACH, COLLIDER_VELOCITY, LEFT, list_thrown,
                                           look_at_walls, meet_walls, ORDER, WALL, WHERE)
from collision_sim.core.pairs import (BLUR, BUSY, can_meet, column, DRIFT, FIRST, HEAD, HITS,
                                      look_at, MOVED, NEAR, put, SECOND, SOONEST)
from collision_sim.core.response import collide as collide_with_collider
from collision_sim.core.response import record
from collision_sim.core.rules import (account_of, COLLISION, N_COLLISION, N_PAIR_COLLISION,
                                      N_UNDECIDED, N_UNSETTLED, NONE, ROUNDING, Touch)
from collision_sim.core.shapes import RESTITUTION
from collision_sim.core.stepping import BLOCK
from collision_sim.core.vectors import add_scaled, dot, length, scaled, subtract
import numpy as np

TIE = 1e-9              # share of a step: what is closer happens at once
LOOSE = 0.002           # share of its radius that a particle may leave its path by unnoticed


@inlined
def friction_factor(dry, wet, laws, c, slip, dv_n):
    """Factor of the friction in row c of the laws on a tangential velocity; 1 without friction."""
    if not (dry or wet):
        return 1.0
    return dry_factor(laws, c, length(slip), dv_n) * wet_factor(laws, c, dv_n)


@inlined
def relative_change(rules, relative, n):
    """Change of the relative velocity [m/s] of a pair in a collision along the normal n."""
    c = rules.laws.shape[0] - 1
    v_n = dot(relative, n)
    dv_n = normal_impulse(v_n, rules.laws[c, RESTITUTION])
    slip = add_scaled(relative, -v_n, n)
    factor = friction_factor(rules.dry, rules.wet, rules.laws, c, slip, dv_n)
    return add_scaled(scaled(dv_n, n), factor - 1.0, slip)


@inlined
def _fly_on(stage, i, before, after):
    """Give particle i another velocity at the start of the step, and fly it anew."""
    world = stage.world
    candidates = world.candidates
    here = account_of(i // BLOCK, i)
    old = column(candidates.u, i)
    u, w = fly_anew(world, here, world.rules.flight, before, after, old,
                    column(candidates.w, i))
    put(world.v, i, after)
    put(candidates.u, i, u)
    put(candidates.w, i, w)
    candidates.settled[i] = 1
    stage.meetings.states[i, DRIFT] += world.rules.flight.dt * length(subtract(u, old))


@inlined
def change(stage, i, after, work):
    """Change the velocity of particle i; `work` [J/kg] is what colliders have done to it."""
    world = stage.world
    before = column(world.v, i)
    _fly_on(stage, i, before, after)
    book(world.ledger, account_of(i // BLOCK, i), INTERNAL,
         kinetic(before, after) - work)


@inlined
def _collide(stage, p):
    """Let the particles of pair p collide by themselves."""
    meetings, matter, v = stage.meetings, stage.matter, stage.world.v
    i, j = meetings.ends[p, FIRST], meetings.ends[p, SECOND]
    n = (meetings.normal[p, 0], meetings.normal[p, 1], meetings.normal[p, 2])
    dv = relative_change(stage.pair_rules, subtract(column(v, i), column(v, j)), n)
    total = matter.inverse[i] + matter.inverse[j]
    change(stage, i, add_scaled(column(v, i), matter.inverse[i] / total, dv), 0.0)
    change(stage, j, add_scaled(column(v, j), -matter.inverse[j] / total, dv), 0.0)


@kernel
def _collide_with_wall(stage, k):
    """Let a particle collide with a collider by itself."""
    world = stage.world
    values, i = stage.walls.values, stage.walls.ends[k, 0]
    here = account_of(i // BLOCK, i)
    touch = Touch(stage.walls.ends[k, 1], at(values, k, ALONG), at(values, k, COLLIDER_VELOCITY),
                  at(values, k, WHERE), values[k, APPROACH], 0.0, True, False)
    before = column(world.v, i)
    after = collide_with_collider(world, here, touch, before)
    _fly_on(stage, i, before, after)


@inlined
def enlist(meetings, p):
    """Note pair p with its particles."""
    for end in range(2):
        i = meetings.ends[p, end]
        meetings.behind[p, end] = int(meetings.states[i, HEAD])
        meetings.states[i, HEAD] = 2 * p + end


@inlined
def _is_listed(meetings, i, j):
    """Whether particles i and j are a pair already."""
    code = int(meetings.states[i, HEAD])
    while code != NONE:
        if meetings.ends[code >> 1, 1 - (code & 1)] == j:
            return True
        code = meetings.behind[code >> 1, code & 1]
    return False


@inlined
def follow(stage, i, base, tolerance):
    """
    List the pairs of who is near the path of particle i now; how many there are more.

    Nothing is to be done if it ends no farther than `tolerance` [m] from where it was found.
    """
    world = stage.world
    moved, meetings, x, dt = stage.moved, stage.meetings, world.x, world.rules.flight.dt
    part = dt if not world.rules.sweep else 0.5 * dt
    u, shift = column(world.candidates.u, i), meetings.states[i, DRIFT]
    if not shift > tolerance:
        return 0
    meetings.states[i, DRIFT] = 0.0
    centre = add_scaled(column(x, i), part, u)
    extent = base
    if world.rules.sweep:
        extent = base + part * length(u)
    move(stage.cells, moved, i, centre, extent, shift)
    find_around(stage.cells, moved, i)
    before = meetings.size[0]
    for k in range(moved.size[1]):
        j, p = moved.found[k], meetings.size[0]
        if can_meet(stage.matter, i, j) and not _is_listed(meetings, i, j):
            if p == meetings.ends.shape[0]:
                world.accounts[0, N_UNDECIDED] += 1
                return p - before
            meetings.ends[p, FIRST], meetings.ends[p, SECOND] = i, j
            meetings.known[p] = recall(stage.memory, i, j)
            meetings.order[p], meetings.looked[p] = inf, NONE
            meetings.size[0] += 1
            enlist(meetings, p)
    return meetings.size[0] - before


@inlined
def _comes_now(stage, i, order):
    """Whether what has an order is first for particle i, or happens at once with what is."""
    return not stage.world.rules.sweep or order <= stage.meetings.states[i, SOONEST] + TIE


@inlined
def _choose(stage):
    """Let each particle find what comes first for it."""
    meetings, walls = stage.meetings, stage.walls
    for k in range(meetings.size[1]):
        p = meetings.active[k]
        for end in range(2):
            i = meetings.ends[p, end]
            meetings.states[i, SOONEST] = min(meetings.states[i, SOONEST], meetings.order[p])
    for k in range(walls.size[0]):
        i = walls.ends[k, 0]
        meetings.states[i, SOONEST] = min(meetings.states[i, SOONEST], walls.values[k, ORDER])


@inlined
def _is_pair_now(stage, p):
    meetings = stage.meetings
    return (_comes_now(stage, meetings.ends[p, FIRST], meetings.order[p])
            and _comes_now(stage, meetings.ends[p, SECOND], meetings.order[p]))


@inlined
def _is_wall_now(stage, k):
    return _comes_now(stage, stage.walls.ends[k, 0], stage.walls.values[k, ORDER])


@inlined
def _is_passive(stage, i):
    """Whether other particles can move particle i: its mass is finite."""
    return stage.matter.inverse[i] > 0.0


@inlined
def _count_parts(stage):
    """Count what each particle takes part in now."""
    meetings, walls = stage.meetings, stage.walls
    for k in range(meetings.size[1]):
        p = meetings.active[k]
        if _is_pair_now(stage, p):
            meetings.states[meetings.ends[p, FIRST], BUSY] += 1
            meetings.states[meetings.ends[p, SECOND], BUSY] += 1
    for k in range(walls.size[0]):
        if _is_wall_now(stage, k) and _is_passive(stage, walls.ends[k, 0]):
            meetings.states[walls.ends[k, 0], BUSY] += 1


@inlined
def _forget_parts(stage):
    """Forget what comes first, and what each particle takes part in."""
    meetings, walls = stage.meetings, stage.walls
    for k in range(meetings.size[1]):
        for end in range(2):
            i = meetings.ends[meetings.active[k], end]
            meetings.states[i, BUSY], meetings.states[i, SOONEST] = 0, inf
    for k in range(walls.size[0]):
        i = walls.ends[k, 0]
        meetings.states[i, BUSY], meetings.states[i, SOONEST] = 0, inf


@kernel
def _body_of(stage, size, i):
    """Body of particle i; a new one, behind `size` others, if it has none; and their number."""
    world = stage.world
    pile = stage.pile
    if pile.body[i] != NONE:
        return pile.body[i], size
    pile.body[i], pile.particle[size] = size, i
    pile.bodies[size, INVERSE] = stage.matter.inverse[i]
    put_at(pile.bodies, size, FREE, column(world.v, i))
    put_at(pile.bodies, size, ENDING, column(world.v, i))
    return size, size + 1


@inlined
def _write_contact(pile, c, a, b, law_row, source, n):
    """Write contact c of the bodies a and b; `source` is its pair, or the wall it is."""
    pile.ends[c, FIRST], pile.ends[c, SECOND], pile.ends[c, LAW_ROW] = a, b, law_row
    pile.source[c] = source
    put_at(pile.contacts, c, NORMAL, n)
    pile.contacts[c, MASS] = 1.0 / (pile.bodies[a, INVERSE] + pile.bodies[b, INVERSE])
    pile.contacts[c, END_BOUND] = 0.0


@kernel
def _list_together(stage):
    """List what happens at once, but pairs and walls by themselves; bodies, pairs, contacts."""
    meetings, walls, pile, size, c = stage.meetings, stage.walls, stage.pile, 0, 0
    for k in range(meetings.size[1]):
        p = meetings.active[k]
        i, j = meetings.ends[p, FIRST], meetings.ends[p, SECOND]
        if max(meetings.states[i, BUSY], meetings.states[j, BUSY]) > 1 and _is_pair_now(stage, p):
            a, size = _body_of(stage, size, i)
            b, size = _body_of(stage, size, j)
            _write_contact(pile, c, a, b, stage.world.table.shape[0], p,
                           (meetings.normal[p, 0], meetings.normal[p, 1], meetings.normal[p, 2]))
            c += 1
    pairs = c
    for k in range(walls.size[0]):
        i = walls.ends[k, 0]
        if meetings.states[i, BUSY] > 1 and _is_passive(stage, i) and _is_wall_now(stage, k):
            a, size = _body_of(stage, size, i)
            if c == pile.ends.shape[0] or size == pile.bodies.shape[0]:
                break
            put_at(pile.bodies, size, FREE, at(walls.values, k, COLLIDER_VELOCITY))
            put_at(pile.bodies, size, ENDING, at(walls.values, k, COLLIDER_VELOCITY))
            pile.bodies[size, INVERSE] = 0.0
            _write_contact(pile, c, a, size, walls.ends[k, 1], k, at(walls.values, k, ALONG))
            size, c = size + 1, c + 1
    return size, pairs, c


@inlined
def _note(meetings, i, turn):
    """Note that a particle has collided in a round."""
    if meetings.states[i, MOVED] != turn:
        if meetings.states[i, HITS] == 0:
            meetings.struck[meetings.size[2]] = i
            meetings.size[2] += 1
        meetings.states[i, MOVED] = turn
        meetings.states[i, HITS] += 1
        meetings.fresh[meetings.size[3]] = i
        meetings.size[3] += 1


@kernel
def _take_over(stage, size, pairs, contacts, turn):
    """Give the particles what the group collisions have made of their velocities."""
    world = stage.world
    pile, meetings, walls = stage.pile, stage.meetings, stage.walls
    for body in range(size):
        pile.work[body] = 0.0
    for c in range(contacts):
        impulse = at(pile.contacts, c, IMPULSE)
        if dot(impulse, at(pile.contacts, c, NORMAL)) > 0.0:
            a = pile.ends[c, FIRST]
            for end in range(2 if c < pairs else 1):
                body = pile.ends[c, end]
                meetings.states[pile.particle[body], BLUR] += (
                    BLURRED * ROUNDING * length(impulse) * pile.bodies[body, INVERSE])
            _note(meetings, pile.particle[a], turn)
            if c < pairs:
                _note(meetings, pile.particle[pile.ends[c, SECOND]], turn)
                world.accounts[0, N_PAIR_COLLISION] += 1
            else:
                i, k = pile.particle[a], pile.source[c]
                here = account_of(i // BLOCK, i)
                dv, obj = scaled(pile.bodies[a, INVERSE], impulse), at(pile.bodies,
                                                                       pile.ends[c, SECOND], FREE)
                record(world, here, walls.ends[k, 1], COLLISION, at(walls.values, k, WHERE),
                       at(pile.contacts, c, NORMAL), dv)
                book_impulse(world.ledger, here, walls.ends[k, 1], dot(dv, obj), dv)
                pile.work[a] += dot(dv, obj)
                world.accounts[here.block, N_COLLISION] += 1
    for c in range(contacts):
        for end in range(2 if c < pairs else 1):
            body = pile.ends[c, end]
            i = pile.particle[body]
            if pile.body[i] != NONE:
                pile.body[i] = NONE
                if meetings.states[i, MOVED] == turn and _is_passive(stage, i):
                    change(stage, i, at(pile.bodies, body, ENDING), pile.work[body])


@kernel
def _is_first(stage, c):
    """Whether contact c has the least order of all that its particles take part in."""
    pile, meetings, pairs = stage.pile, stage.meetings, stage.world.table.shape[0]
    if pile.ends[c, LAW_ROW] == pairs:
        p = pile.source[c]
        order = meetings.order[p]
        return order <= meetings.states[meetings.ends[p, FIRST], SOONEST] and (
            order <= meetings.states[meetings.ends[p, SECOND], SOONEST])
    k = pile.source[c]
    return stage.walls.values[k, ORDER] <= meetings.states[stage.walls.ends[k, 0], SOONEST]


@kernel
def _collide_group(stage, dry, wet, first, count, room):
    """Let a group of contacts collide at once."""
    friction = collide_group(dry, wet, stage.pair_rules.laws, stage.pile, first, count, room)
    stage.world.accounts[0, N_UNSETTLED] += friction == OPEN


@kernel
def _collide_one_by_one(stage, first, count, dry, wet, room):
    """Let those of a large group collide that come first, one after the other."""
    pile = stage.pile
    for k in range(count):
        c = pile.member[first + k]
        put_at(pile.contacts, c, IMPULSE, (0.0, 0.0, 0.0))
    for k in range(count):
        c = pile.member[first + k]
        a, b = pile.ends[c, FIRST], pile.ends[c, SECOND]
        if _is_first(stage, c) and pile.used[a] >= 0 and pile.used[b] >= 0:
            pile.used[a] = pile.used[b] = NONE
            _collide_group(stage, dry, wet, first + k, min(count, 1), room)


@kernel
def _collide_together(stage, dry, wet, room, turn):
    """Answer what happens at once."""
    pile = stage.pile
    size, pairs, contacts = _list_together(stage)
    groups = group_contacts(pile, size, contacts)
    for g in range(groups):
        first, count = 0 + pile.group[g], pile.group[g + 1] - pile.group[g]
        if count <= MOST:
            _collide_group(stage, dry, wet, first, count, room)
        else:
            _collide_one_by_one(stage, first, count, dry, wet, room)
    _take_over(stage, size, pairs, contacts, turn)


@inlined
def _respond(stage, dry, wet, room, turn):
    """Answer all that comes now; whether anybody has collided, else the next round is the same."""
    meetings, walls, together = stage.meetings, stage.walls, False
    for k in range(meetings.size[1]):
        p = meetings.active[k]
        if _is_pair_now(stage, p):
            i, j = meetings.ends[p, FIRST], meetings.ends[p, SECOND]
            if meetings.states[i, BUSY] == 1 and meetings.states[j, BUSY] == 1:
                _collide(stage, p)
                _note(meetings, i, turn)
                _note(meetings, j, turn)
                stage.world.accounts[0, N_PAIR_COLLISION] += 1
            else:
                together = True
    for k in range(walls.size[0]):
        if _is_wall_now(stage, k):
            i = walls.ends[k, 0]
            if meetings.states[i, BUSY] == 1 or not _is_passive(stage, i):
                _collide_with_wall(stage, k)
                _note(meetings, i, turn)
            else:
                together = True
    if together:
        _collide_together(stage, dry, wet, room, turn)
    return meetings.size[3] > 0


@inlined
def _look_at_pairs(stage, i, turn):
    """Look at the pairs of particle i again, unless they have been in this round."""
    world = stage.world
    meetings, code = stage.meetings, int(stage.meetings.states[i, HEAD])
    while code != NONE:
        p = code >> 1
        if meetings.looked[p] != turn and can_meet(stage.matter, meetings.ends[p, FIRST],
                                                   meetings.ends[p, SECOND]):
            meetings.looked[p] = turn
            look_at(world.rules.sweep, stage.pair_rules.slow, world.rules.flight.dt, stage.matter,
                    stage.memory, world.x, world.v, world.candidates, meetings, p)
            if meetings.order[p] < inf:
                meetings.active[meetings.size[1]] = p
                meetings.size[1] += 1
        code = meetings.behind[p, code & 1]


@inlined
def _keep_others(stage, turn):
    """Keep the collisions of those that have not collided in a round, for the next one."""
    meetings, walls, kept = stage.meetings, stage.walls, 0
    for k in range(meetings.size[1]):
        p = meetings.active[k]
        if meetings.states[meetings.ends[p, FIRST], MOVED] != turn and (
                meetings.states[meetings.ends[p, SECOND], MOVED] != turn):
            meetings.active[kept] = p
            kept += 1
    meetings.size[1], kept = kept, 0
    for k in range(walls.size[0]):
        if meetings.states[walls.ends[k, 0], MOVED] != turn:
            for d in range(WALL):
                walls.values[kept, d] = walls.values[k, d]
            walls.ends[kept, 0], walls.ends[kept, 1] = walls.ends[k, 0], walls.ends[k, 1]
            kept += 1
    walls.size[0] = kept


@inlined
def _look_again(stage, base, slack, turn, answers):
    """Look at what those meet that have collided in a round."""
    meetings = stage.meetings
    _keep_others(stage, turn)
    for k in range(meetings.size[3]):
        i = meetings.fresh[k]
        follow(stage, i, base[i], LOOSE * stage.matter.radius[i] + slack)
    for k in range(meetings.size[3]):
        i = meetings.fresh[k]
        _look_at_pairs(stage, i, turn)
        look_at_walls(stage, i, answers)
    meetings.size[3] = 0
    _meet_walls_of_active(stage, answers)


@inlined
def _meet_walls_of_active(stage, answers):
    """List the collisions with colliders of those that collide with somebody."""
    for k in range(stage.meetings.size[1]):
        for end in range(2):
            meet_walls(stage, stage.meetings.ends[stage.meetings.active[k], end], answers)


@inlined
def _begin(stage, answers):
    """List what collides to begin with, but with colliders only."""
    meetings = stage.meetings
    meetings.size[1] = meetings.size[2] = meetings.size[3] = stage.walls.size[0] = 0
    for p in range(meetings.size[0]):
        enlist(meetings, p)
        meetings.looked[p] = NONE
        if meetings.order[p] < inf:
            meetings.active[meetings.size[1]] = p
            meetings.size[1] += 1
    _meet_walls_of_active(stage, answers)


@inlined
def _run_rounds(stage, dry, wet, base, room, turn, answers):
    """Let all collide that do, round by round; the number of the next round."""
    going, slack = True, stage.world.rules.flight.dt * stage.pair_rules.slow
    while going:
        _choose(stage)
        _count_parts(stage)
        going = _respond(stage, dry, wet, room, turn)
        _forget_parts(stage)
        _look_again(stage, base, slack, turn, answers)
        turn += 1
    return turn


@entry
def collide_all(stage, dry, wet, base, bounced, bounces):
    """
    Run the collision stage between particles.

    Parameters
    ----------
    stage : Stage
        With the pairs of `list_meetings`; velocities and candidates are changed.
    dry, wet : bool
        1 if pairs or colliders have such friction.
    base : (N,) float64 [m]
        Extent of each particle without its path.
    bounced, bounces
        Of bounces.find_bounces.

    """
    world = stage.world
    room = make_room()
    answers = keep_answers(world.rules.present.meshes, world.table)
    meetings, listed, count = stage.meetings, 1, world.x.shape[1]
    before, after, kept = np.empty((count, 6)), np.empty((count, 6)), np.empty(count, np.int8)
    begin_moves(stage.cells, stage.moved)
    _begin(stage, answers)
    list_thrown(stage, 0, base, bounced, bounces, before, after, kept, answers)
    turn = 0 * meetings.size[0]
    while listed > 0:
        turn, listed = _run_rounds(stage, dry, wet, base, room, turn, answers), 0
        if meetings.size[2] > 0:
            listed = list_thrown(stage, LEFT, base, bounced, bounces, before, after, kept, answers)
    for k in range(meetings.size[2]):
        i = meetings.struck[k]
        meetings.states[i, MOVED], meetings.states[i, BLUR] = NONE, 0.0


@kernel
def part_all(meetings, bounced, bounces):
    """Forget the pairs of a step."""
    for p in range(meetings.size[0]):
        for end in range(2):
            _forget(meetings, meetings.ends[p, end])
    for block in range(bounces.shape[0]):
        for k in range(block * BLOCK, block * BLOCK + bounces[block, 0]):
            _forget(meetings, max(bounced[k], -1 - bounced[k]))


@inlined
def _forget(meetings, i):
    """Forget what has happened to particle i in a step."""
    meetings.states[i, HEAD], meetings.states[i, NEAR] = NONE, 0.0
    meetings.states[i, DRIFT], meetings.states[i, HITS] = 0.0, 0.0
