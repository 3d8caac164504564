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
The contacts of a pile: which there are, within which bounds, and what they had in the last step.

Between particles, and with the colliders that these may press on. The bounds of the normal
velocities are said in piles.py.
"""

from collision_sim.core.contact_solver import (at, END_BOUND, ENDING, ENOUGH, FREE, IMPULSE,
                                               INVERSE, KEPT, KEPT_IMPULSE, LAW_ROW, MASS, MEAN,
                                               MEAN_BOUND, NORMAL, PUSH, push, put_at)
from collision_sim.core.detection import end_gap, path_hit, starts_inside
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.laws import repulsion
from collision_sim.core.motion import chord_velocity, END, point_velocity, START
from collision_sim.core.pair_memory import forget, keep, recall
from collision_sim.core.pair_walls import (ALONG, APPROACH, COLLIDER_VELOCITY, here_of, ORDER,
                                           sort_walls)
from collision_sim.core.pairs import can_meet, column, end_normal, FIRST, is_spent, SECOND, TOUCH
from collision_sim.core.rules import N_UNDECIDED, NONE, ROUNDING
from collision_sim.core.vectors import (add_scaled, dot, largest, length, origin, scaled,
                                        subtract)

SUPPORT_REACH = 0.25    # share of a radius within which a particle may press on a collider
# Marks of a pair instead of a round: in contact, met anew, and in contact since then.
IN_CONTACT, MET_ANEW, MET = -2, -3, -4
CARRIES, PUSHES_OUT = 0, 1      # what a collider does to a particle: on it, or inside it
# Columns of the walls of a body that they carry: least velocities [m/s] along the normal, scratch.
FORCE, LEAST_MEAN, LEAST_END = APPROACH, COLLIDER_VELOCITY, COLLIDER_VELOCITY + 1
CARRIES_OVER = 200      # most rounds of these walls
HOT = 1                 # mark of a particle whose contacts are solved again


@kernel
def body_of(pile, size, candidates, inverse, i):
    """Body of particle i; a new one, behind `size` others, if it has none; and their number."""
    if pile.body[i] != NONE:
        return pile.body[i], size
    pile.body[i], pile.particle[size] = size, i
    put_at(pile.bodies, size, MEAN, column(candidates.u, i))
    w = column(candidates.w, i)
    put_at(pile.bodies, size, ENDING, w)
    put_at(pile.bodies, size, FREE, w)
    put_at(pile.bodies, size, KEPT, w)
    pile.bodies[size, INVERSE] = inverse[i]
    return size, size + 1


@inlined
def _add_contact(pile, memory, c, a, b, law, n, mean_bound, end_bound, known, sign):
    """Write contact c between bodies a and b, with the impulse of a row of the memory on a."""
    bodies, contacts = pile.bodies, pile.contacts
    pile.ends[c, FIRST], pile.ends[c, SECOND], pile.ends[c, LAW_ROW] = a, b, law
    put_at(contacts, c, NORMAL, n)
    contacts[c, MASS] = 1.0 / (bodies[a, INVERSE] + bodies[b, INVERSE])
    contacts[c, MEAN_BOUND], contacts[c, END_BOUND] = mean_bound, end_bound
    impulse = (0.0, 0.0, 0.0)
    if known != NONE:
        impulse = scaled(sign, at(memory.impulses, known, 0))
    put_at(contacts, c, IMPULSE, impulse)
    put_at(contacts, c, KEPT_IMPULSE, impulse)
    push(bodies, a, b, ENDING, impulse)


@inlined
def _end_bound(part, rests, spent, v_n, gap, mean, fast):
    """
    Bound of the normal velocity at the end [m/s]: as low as lets the pair just touch there.

    An approach v_n that no collision has answered is for the next step: where there is a gap, or
    `fast`, where pushes have brought those together that approach faster than gravity makes it.
    Who is `spent` has had his collisions: the pair comes to touch with one velocity.
    """
    if rests and (spent or not fast):
        return 0.0
    if spent:
        return min(mean, 0.0)
    touching = min((mean - (1.0 - part) * v_n) / part, 0.0)
    return min(touching, v_n) if gap > 0.0 or fast else touching


@inlined
def _pair_bounds(world, pair_rules, dt, size, x, v, i, j, rests, spent, n, gap, anew):
    """Bounds of the normal velocities of a pair with a gap [m] at the end of its candidates."""
    rules, candidates = world.rules, world.candidates
    xi, xj = column(x, i), column(x, j)
    depth = size - length(subtract(xi, xj))
    if depth > ROUNDING * (largest(xi) + largest(xj) + size):
        mean = repulsion(depth, dt, rules.share, rules.highest)
    else:
        mean = dot(n, subtract(column(candidates.u, i), column(candidates.u, j))) - gap / dt
    v_n = dot(n, subtract(column(v, i), column(v, j)))
    fast = anew and v_n < -pair_rules.slow
    return mean, _end_bound(pair_rules.part, rests, spent, v_n, gap, mean, fast)


@inlined
def _is_in_contact(stage, again, p, i, j, closeness):
    """Whether pair p is in contact, or again to be solved for."""
    if again:
        heat = stage.meetings.heat
        return stage.meetings.looked[p] <= IN_CONTACT and (heat[i] == HOT or heat[j] == HOT)
    return closeness <= stage.world.rules.flight.dt * stage.pair_rules.slow


@kernel
def list_pairs(stage, again):
    """List the pairs that are in contact; how many bodies and contacts there are."""
    world = stage.world
    rules, pair_rules, meetings = world.rules, stage.pair_rules, stage.meetings
    x, v, candidates, matter, pile = world.x, world.v, world.candidates, stage.matter, stage.pile
    size, c, dt, law = 0, 0, rules.flight.dt, world.table.shape[0]
    for p in range(meetings.size[0]):
        i, j = meetings.ends[p, FIRST], meetings.ends[p, SECOND]
        extent = matter.radius[i] + matter.radius[j]
        gap, n = end_normal(rules.sweep, dt, extent, x, subtract(column(v, i), column(v, j)),
                            candidates, i, j)
        if not again:
            meetings.looked[p] = NONE
        in_contact = can_meet(matter, i, j) and _is_in_contact(stage, again, p, i, j,
                                                               gap - TOUCH * extent)
        if in_contact and (c == pile.ends.shape[0] or size + 2 > pile.bodies.shape[0]):
            world.accounts[0, N_UNDECIDED] += 1
        elif in_contact:
            anew, known = meetings.looked[p] <= MET_ANEW, meetings.known[p]
            meetings.looked[p] = MET if anew else IN_CONTACT
            spent = is_spent(meetings, i) or is_spent(meetings, j)
            mean, end = _pair_bounds(world, pair_rules, dt, extent, x, v, i, j,
                                     known != NONE, spent, n, gap, anew)
            a, size = body_of(pile, size, candidates, matter.inverse, i)
            b, size = body_of(pile, size, candidates, matter.inverse, j)
            _add_contact(pile, stage.memory, c, a, b, law, n, mean, end, known,
                         1.0 if i < j else -1.0)
            c += 1
    return size, c


@kernel
def _carry(pile, body, which, walls, bound, force):
    """
    Give a body that no impulse moves the least change that brings a velocity to its bounds.

    Columns `bound` and `force` of the walls: the least normal velocities [m/s], and scratch. Each
    wall in turn adds what is missing, and takes back what is too much of that (C. Hildreth, 1957):
    their order means nothing then.
    """
    values, velocity = walls.values, at(pile.bodies, body, which)
    for k in range(walls.size[0]):
        values[k, force] = 0.0
    for _ in range(CARRIES_OVER):
        change = 0.0
        for k in range(walls.size[0]):
            n = at(values, k, ALONG)
            more = max(values[k, bound] - dot(n, velocity), -values[k, force])
            values[k, force] += more
            velocity, change = add_scaled(velocity, more, n), max(change, abs(more))
        if not change > ROUNDING * length(velocity):
            break
    put_at(pile.bodies, body, which, velocity)


@kernel
def _carry_along(pile, body, walls):
    """Let a body that no impulse moves go along with its supports."""
    _carry(pile, body, MEAN, walls, LEAST_MEAN, FORCE)
    _carry(pile, body, ENDING, walls, LEAST_END, FORCE)
    put_at(pile.bodies, body, FREE, at(pile.bodies, body, ENDING))
    put_at(pile.bodies, body, KEPT, at(pile.bodies, body, ENDING))


@kernel
def _gap_on_way(stage, here, c, x0, x1, gap, n):
    """
    Gap [m] at the end, along the normal, to a collider that a particle hits on its way.

    As response.py acts on it with sweeps: who meets a surface ends on the plane that touches it
    there. The end normal is for those who touch it from the start, or do not hit it.
    """
    world = stage.world
    poses, motion, dt = world.poses, world.motion, world.rules.flight.dt
    if starts_inside(world, here, c, x0) > 0.0:
        return gap, n
    tau, n_hit, _, _ = path_hit(world, here, c, x0, x1)
    if 0.0 < tau <= 1.0:
        obj = chord_velocity(motion, poses, here.step, here.start, c, x0, dt)
        way = subtract(subtract(x1, x0), scaled(dt, obj))
        return (1.0 - tau) * dot(n_hit, way), n_hit
    return gap, n


@kernel
def _find_supports(stage, here, x0):
    """List the colliders that a particle may press on among the walls, sorted."""
    world = stage.world
    rules, walls, dt = world.rules, stage.walls, world.rules.flight.dt
    u = column(world.candidates.u, here.particle)
    x1, path = add_scaled(x0, dt, u), scaled(dt, u)
    way = length(path)
    walls.size[0] = 0
    for c in range(world.table.shape[0]):
        walls.one[0], k = c, walls.size[0]
        if stage.moves:     # as it is seen from the collider; who turns far away comes no nearer
            way = length(subtract(path, subtract(origin(world.poses, here.end, c),
                                                 origin(world.poses, here.start, c))))
        reach = SUPPORT_REACH * here.radius + way
        gap, n = end_gap(world, here, c, reach, x0, x1)
        if gap <= reach and k < walls.ends.shape[0]:
            if rules.sweep:
                gap, n = _gap_on_way(stage, here, c, x0, x1, gap, n)
            walls.ends[k, 1], walls.values[k, ORDER] = c, gap
            put_at(walls.values, k, ALONG, n)
            walls.size[0] += 1
    sort_walls(stage, 0)


@inlined
def _support(stage, here, x0, k, size, count, again):
    """
    List the collider of wall k as a support of a particle; how many bodies and contacts there are.

    One of infinite mass is carried, by all at once: no impulse of the pile would change that.
    """
    world = stage.world
    i, rules, pile, values = here.particle, world.rules, stage.pile, stage.walls.values
    c, gap, n = stage.walls.ends[k, 1], values[k, ORDER], at(values, k, ALONG)
    poses, motion = world.poses, world.motion
    dt, u = rules.flight.dt, column(world.candidates.u, i)
    x1 = add_scaled(x0, dt, u)
    first = point_velocity(motion, poses, here.step, START, here.start, c, x0)
    rests = recall(stage.memory, i, world.x.shape[1] + c)
    if gap - TOUCH * here.radius > dt * stage.pair_rules.slow:      # what pressed is away now
        rests = NONE
    depth = starts_inside(world, here, c, x0)
    obj = chord_velocity(motion, poses, here.step, here.start, c, x0, dt)
    last = point_velocity(motion, poses, here.step, END, here.end, c, x1)
    mean = dot(n, subtract(u, obj)) - gap / dt
    if depth > 0.0:
        mean = repulsion(depth, dt, rules.share, rules.highest)
    v_n, spent = dot(n, subtract(column(world.v, i), first)), is_spent(stage.meetings, i)
    end = _end_bound(stage.pair_rules.part, rests != NONE, spent, v_n, gap, mean,
                     again and v_n < -stage.pair_rules.slow)
    if pile.bodies[pile.body[i], INVERSE] == 0.0:
        values[k, LEAST_MEAN], values[k, LEAST_END] = mean + dot(n, obj), end + dot(n, last)
        return size, count
    put_at(pile.bodies, size, MEAN, obj)
    put_at(pile.bodies, size, ENDING, last)
    put_at(pile.bodies, size, FREE, last)
    put_at(pile.bodies, size, KEPT, last)
    pile.bodies[size, INVERSE] = 0.0
    _add_contact(pile, stage.memory, count, pile.body[i], size, c, n, mean, end, rests, 1.0)
    pile.source[count] = PUSHES_OUT if depth > 0.0 else CARRIES
    return size + 1, count + 1


@kernel
def list_supports(stage, bodies, contacts, again, answers):
    """List the colliders that the bodies may press on; how many bodies and contacts there are."""
    world = stage.world
    pile, walls, size = stage.pile, stage.walls, bodies
    for a in range(bodies):
        i = pile.particle[a]
        x0, here = column(world.x, i), here_of(stage, i, answers)
        _find_supports(stage, here, x0)
        for k in range(walls.size[0]):
            if contacts == pile.ends.shape[0] or size == pile.bodies.shape[0]:
                world.accounts[0, N_UNDECIDED] += 1
                return size, contacts
            walls.one[0] = walls.ends[k, 1]
            size, contacts = _support(stage, here, x0, k, size, contacts, again)
        if pile.bodies[a, INVERSE] == 0.0:
            _carry_along(pile, a, walls)
    return size, contacts


@kernel
def remember(stage, count, bodies, again):
    """
    Keep the contacts that press at the end for the next step; by more than rounding does.

    `again` says whether that is added to what has been kept in this step already.
    """
    pile, memory = stage.pile, stage.memory
    if not again:
        forget(memory)
    particles = memory.head.shape[0]
    for c in range(count):
        if pile.contacts[c, PUSH] > ENOUGH * stage.pair_rules.slow * pile.contacts[c, MASS]:
            i, b = pile.particle[pile.ends[c, FIRST]], pile.ends[c, SECOND]
            other = pile.particle[b] if b < bodies else particles + pile.ends[c, LAW_ROW]
            if recall(memory, i, other) == NONE and memory.size[0] < memory.key.shape[0]:
                keep(memory, i, other, at(pile.contacts, c, IMPULSE))
