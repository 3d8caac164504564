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
Collisions of particles with colliders, where they belong together with those among particles.

That is where a particle collides with another one, too, or where a collider throws it back onto
somebody. All others are left to response.py: who is near and is not met changes nothing.
"""

from math import inf
from typing import NamedTuple

from collision_sim.core.around import find_around, move, Moved
from collision_sim.core.candidates import is_settled, mean_anew
from collision_sim.core.cells import Cells
from collision_sim.core.contact_solver import at, Pile, put_at
from collision_sim.core.detection import detect, end_distance, starts_inside
from collision_sim.core.impulses import respond
from collision_sim.core.jit import inlined, kernel, law
from collision_sim.core.laws import normal_impulse, repulsion
from collision_sim.core.motion import chord_velocity
from collision_sim.core.pair_memory import Memory, recall, resting_speed
from collision_sim.core.pairs import (BLUR, can_meet, column, end_normal, FIRST, HEAD, is_spent,
                                      Matter, meet, Meetings, NEAR, PairRules, put, SECOND,
                                      sort_by_place, TOUCH)
from collision_sim.core.reference import put as put_value, refer
from collision_sim.core.rules import Here, NONE, ROUNDING
from collision_sim.core.shapes import RESTITUTION, signed_distance
from collision_sim.core.stepping import BLOCK
from collision_sim.core.ties import stands_first
from collision_sim.core.vectors import add_scaled, dot, largest, length, scaled, subtract
from collision_sim.core.world import World
import numpy as np

# Marks of a particle whose colliders were looked at: it is away from them; near one; near one, and
# its collisions are listed; these are left to response.py.
AWAY, AT_WALL, LISTED, LEFT = 1, 2, 3, 4
SIDES = 3               # most colliders that push a particle one after the other: of a corner
# Columns of the walls, collisions of particles with colliders: when or how deep, normal velocity
# and normal, velocity of the collider, point.
ORDER, APPROACH, ALONG, COLLIDER_VELOCITY, WHERE, WALL = 0, 1, 2, 5, 8, 11


class Walls(NamedTuple):
    """
    Collisions with colliders that are waiting: scratch.

    values (W, WALL); ends (W, 2) int64: particle and collider; size (1,) int64: how many; one (1,)
    int64: a collider by itself.
    """

    values: np.ndarray
    ends: np.ndarray
    size: np.ndarray
    one: np.ndarray


def make_walls(most):
    """Allocate room for a number of collisions with colliders."""
    return Walls(np.empty((most, WALL)), np.empty((most, 2), dtype=np.int64),
                 np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64))


class Stage(NamedTuple):
    """
    What the stages of a step between particles work on.

    world: with rules that have a collision stage; pair_rules, matter, meetings, memory, cells,
    moved, pile: of the modules that say so; walls: scratch. everyone (C,): all colliders. Nearly
    all are written. moves: whether a collider moves; bounces: whether
    contacts with colliders are elastic, as there is no collision stage (`single_pass` and
    `multi_pass`).
    """

    world: World
    pair_rules: PairRules
    matter: Matter
    meetings: Meetings
    memory: Memory
    cells: Cells
    moved: Moved
    pile: Pile
    walls: Walls
    everyone: np.ndarray
    moves: bool
    bounces: bool


@law
def _store(words, world, pair_rules, matter, meetings, memory, cells, moved, pile, walls, everyone,
           moves, bounces):
    """Write a Stage to its words; return how many it takes."""
    return put_value(words, Stage(world, pair_rules, matter, meetings, memory, cells, moved, pile,
                                  walls, everyone, moves, bounces))


def refer_stage(stage):
    """Return a Reference to a Stage."""
    return refer(stage, _store)


@inlined
def here_of(stage, i, answers):
    """Where particle i is looked at."""
    end = min(1, stage.world.poses.shape[0] - 1)
    return Here(0, 0, end, i // BLOCK, i, stage.matter.radius[i], stage.everyone, answers,
                stage.walls.one)


@kernel
def _may_meet_still(present, table, poses, end, radius, x1, way):
    """Whether a path of some length [m] that ends at x1 may meet colliders that stand still."""
    for c in range(table.shape[0]):
        if signed_distance(present, table, poses, end, c, x1)[0] - radius <= way:
            return True
    return False


@inlined
def _comes_before(stage, k, m):
    """Whether row k comes before row m: by its normal, its order, what the collider is."""
    world = stage.world
    values, ends = stage.walls.values, stage.walls.ends
    for column_ in (ALONG, ALONG + 1, ALONG + 2, ORDER):
        if values[k, column_] != values[m, column_]:
            return values[k, column_] < values[m, column_]
    return stands_first(world.table, world.poses, 0, ends[k, 1], at(values, k, ALONG), ends[m, 1],
                        at(values, m, ALONG))


@kernel
def sort_walls(stage, first):
    """Sort the walls from `first` on by their normals: the order of colliders means nothing."""
    values, ends = stage.walls.values, stage.walls.ends
    for last in range(first + 1, stage.walls.size[0]):
        k = last
        while k > first and _comes_before(stage, k, k - 1):
            for d in range(WALL):
                values[k, d], values[k - 1, d] = values[k - 1, d], values[k, d]
            ends[k, 1], ends[k - 1, 1] = ends[k - 1, 1], ends[k, 1]
            k -= 1


@kernel
def _is_near(stage, i):
    """Whether particle i may meet a collider in the step."""
    world = stage.world
    x0, u, poses = column(world.x, i), column(world.candidates.u, i), world.poses
    x1 = add_scaled(x0, world.rules.flight.dt, u)
    return stage.moves or _may_meet_still(
        world.rules.present, world.table, poses, poses.shape[0] - 1, stage.matter.radius[i], x1,
        length(subtract(x1, x0)))


@inlined
def _rests_on(stage, i, c, v_n):
    """Whether particle i pressed on collider c, and comes no faster [m/s] than who rests on it."""
    row = recall(stage.memory, i, stage.world.x.shape[1] + c)
    return row != NONE and v_n >= -resting_speed(stage.memory, row, stage.pair_rules.slow,
                                                 stage.matter.inverse[i])


@kernel
def _list_walls(stage, i, answers):
    """List the collisions of particle i with colliders that are near its path."""
    world = stage.world
    walls, x0, v0 = stage.walls, column(world.x, i), column(world.v, i)
    u, rules, here = column(world.candidates.u, i), world.rules, here_of(stage, i, answers)
    x1 = add_scaled(x0, rules.flight.dt, u)
    first = walls.size[0]
    if is_spent(stage.meetings, i):
        return
    for c in range(world.table.shape[0]):
        walls.one[0], k = c, walls.size[0]
        touch, _ = detect(world, here, x0, x1, v0, u, first >= 0)
        least = ROUNDING * (largest(v0) + largest(u) + largest(touch.obj))
        if touch.hit and touch.v_n < -least - stage.meetings.states[i, BLUR] and (
                k < walls.ends.shape[0]) and not _rests_on(stage, i, c, touch.v_n):
            walls.ends[k, 0], walls.ends[k, 1] = i, c
            walls.values[k, APPROACH] = touch.v_n
            put_at(walls.values, k, ALONG, touch.normal)
            put_at(walls.values, k, COLLIDER_VELOCITY, touch.obj)
            put_at(walls.values, k, WHERE, touch.point)
            walls.values[k, ORDER] = _order_of(rules.sweep, touch, x0, x1)
            walls.size[0] += 1
    sort_walls(stage, first)


@inlined
def _order_of(sweep, touch, x0, x1):
    """When a particle meets a collider, or how deep it ends in it."""
    if sweep:
        way = length(subtract(x1, x0))
        return length(subtract(touch.point, x0)) / way if way > 0.0 else 0.0
    return dot(touch.normal, subtract(x1, touch.point))


@inlined
def look_at_walls(stage, i, answers):
    """List the collisions of particle i with colliders, of which none is listed."""
    stage.meetings.states[i, NEAR] = AWAY
    if _is_near(stage, i):
        stage.meetings.states[i, NEAR] = LISTED
        _list_walls(stage, i, answers)


@inlined
def meet_walls(stage, i, answers):
    """List the collisions of particle i with colliders, if they are not."""
    near = stage.meetings.states[i, NEAR]
    if near != AWAY and near != LISTED:
        look_at_walls(stage, i, answers)


@kernel
def _throw_back(stage, i, answers):
    """Whether a collider throws particle i back, and its velocity and mean velocity [m/s] then."""
    world = stage.world
    walls, v, u = stage.walls, column(world.v, i), column(world.candidates.u, i)
    first, k = walls.size[0], NONE
    _list_walls(stage, i, answers)
    for other in range(first, walls.size[0]):
        if k == NONE or walls.values[other, ORDER] < walls.values[k, ORDER]:
            k = other
    walls.size[0] = first
    if k == NONE:
        return False, v, u
    c, v_n = walls.ends[k, 1], walls.values[k, APPROACH]
    after, _ = respond(world.table, c, v, at(walls.values, k, COLLIDER_VELOCITY),
                       at(walls.values, k, ALONG), v_n,
                       normal_impulse(v_n, world.table[c, RESTITUTION]))
    return True, after, mean_anew(world.rules.flight, v, after, u)


@kernel
def _is_in_contact(stage, i):
    """Whether particle i is close enough to another one at the end to be in contact with it."""
    world = stage.world
    meetings, code, dt = stage.meetings, int(stage.meetings.states[i, HEAD]), world.rules.flight.dt
    while code != NONE:
        a, b = meetings.ends[code >> 1, FIRST], meetings.ends[code >> 1, SECOND]
        size = stage.matter.radius[a] + stage.matter.radius[b]
        gap, _ = end_normal(world.rules.sweep, dt, size, world.x,
                            subtract(column(world.v, a), column(world.v, b)), world.candidates,
                            a, b)
        if gap - TOUCH * size <= dt * stage.pair_rules.slow and can_meet(stage.matter, a, b):
            return True
        code = meetings.behind[code >> 1, code & 1]
    return False


@kernel
def lead(stage, i, v, u, base):
    """Give particle i other velocities, without an account, and another place in the grid."""
    world = stage.world
    moved, dt = stage.moved, world.rules.flight.dt
    put(world.v, i, v)
    put(world.candidates.u, i, u)
    part, extent = dt, moved.extent[i]
    if world.rules.sweep:
        part = 0.5 * dt
        extent = base + part * length(u)
    before, centre = column(moved.centre, i), add_scaled(column(world.x, i), part, u)
    move(stage.cells, moved, i, centre, extent, length(subtract(centre, before)))


@kernel
def _meets_somebody(stage, i):
    """Whether particle i meets another one in the step."""
    world = stage.world
    find_around(stage.cells, stage.moved, i)
    for k in range(stage.moved.size[1]):
        j = stage.moved.found[k]
        if can_meet(stage.matter, i, j):
            order, _ = meet(world.rules.sweep, world.rules.flight.dt,
                            stage.matter.radius[i] + stage.matter.radius[j], world.x,
                            subtract(column(world.v, i), column(world.v, j)), world.candidates,
                            i, j)
            if order < inf:
                return True
    return False


@kernel
def _find_at_walls(stage, mark, bounced, bounces):
    """Find those with a mark that may collide with a collider; how many are `fresh`."""
    world = stage.world
    meetings, size = stage.meetings, 0
    for block in range(bounces.shape[0]):
        for k in range(block * BLOCK, block * BLOCK + bounces[block, 0]):
            i = max(bounced[k], -1 - bounced[k])
            if meetings.states[i, NEAR] == mark:
                meetings.states[i, NEAR] = AT_WALL
                if bounced[k] >= 0:
                    meetings.fresh[size] = i
                    size += 1
    if world.rules.sweep:
        for p in range(meetings.size[0]):
            for end in range(2):
                i = meetings.ends[p, end]
                if meetings.states[i, NEAR] == mark:
                    meetings.states[i, NEAR] = AWAY
                    if _is_near(stage, i):
                        meetings.states[i, NEAR] = AT_WALL
                        meetings.fresh[size] = i
                        size += 1
    sort_by_place(world.x, world.v, meetings.fresh, size)
    return size


@kernel
def _pushed_by(stage, here, c, gap, n, x0, u):
    """Place [m] to which collider c pushes a particle that ends in it, by a gap [m] below 0."""
    world = stage.world
    i, dt, table = here.particle, world.rules.flight.dt, world.table
    obj = chord_velocity(world.motion, world.poses, here.step, here.start, c, x0, dt)
    lag = dot(n, subtract(obj, u))
    depth = starts_inside(world, here, c, x0)
    dv_n, left = max(lag, 0.0), 0.0
    if depth > 0.0:
        dv_n = max(lag + repulsion(depth, dt, world.rules.share, world.rules.highest), 0.0)
    else:
        if (stage.bounces or stage.meetings.states[i, NEAR] == LEFT) and not (
                is_settled(world.candidates, i)):
            dv_n *= 1.0 + table[c, RESTITUTION]
        left = max(-gap - dt * dv_n, 0.0)
    if dv_n > 0.0:
        u, _ = respond(table, c, u, obj, n, -lag, dv_n)
    return add_scaled(add_scaled(x0, dt, u), left, n)


@kernel
def _deepest_wall(stage, here, x0, x1):
    """Collider that a particle is deepest in at x1, or NONE, the gap [m] and the normal."""
    world = stage.world
    c, deepest, normal = NONE, 0.0, (0.0, 0.0, 1.0)
    for k in range(world.table.shape[0]):
        stage.walls.one[0] = k
        gap, n = end_distance(world, here, k, x0, x1)
        if gap < deepest or (c != NONE and gap == deepest and stands_first(
                world.table, world.poses, here.end, k, n, c, normal)):
            c, deepest, normal = k, gap, n
    return c, deepest, normal


@kernel
def pushed_place(stage, i, answers):
    """
    Find how deep [m] particle i ends in colliders, and where [m] these push it, deepest first.

    As response.py presses it: no farther than to the surface, or to go with the collider; if it
    has started inside, no faster than it is repelled. Of one whose collisions are still to come
    the deepest only: what others then do is for the next step, which keeps its speed.
    """
    world = stage.world
    x0, here, u = column(world.x, i), here_of(stage, i, answers), column(world.candidates.u, i)
    place, depth, dt = add_scaled(x0, world.rules.flight.dt, u), 0.0, world.rules.flight.dt
    for turn in range(SIDES if is_settled(world.candidates, i) else 1):
        c, gap, n = _deepest_wall(stage, here, x0, place)
        if turn == 0:
            depth = -gap
        if not gap < -ROUNDING * (largest(place) + here.radius):
            break
        stage.walls.one[0] = c
        place = _pushed_by(stage, here, c, gap, n, x0, u)
        u = scaled(1.0 / dt, subtract(place, x0))
    return depth, place


@kernel
def list_thrown(stage, mark, base, bounced, bounces, before, after, kept, answers):
    """
    List the collisions with colliders of those that these throw back onto somebody; how many.

    Of those with a mark: 0 to begin with, and LEFT once others have got other paths. All are led
    to where they are thrown back to, so that two that are thrown onto each other find each other,
    then to where the collider pushes them there, and back; those that are in contact with somebody
    as it is are listed as well.
    """
    world = stage.world
    struck, size, listed = stage.meetings.fresh, 0, 0
    found = _find_at_walls(stage, mark, bounced, bounces)
    for k in range(found):
        i = struck[k]
        hits, v, u = _throw_back(stage, i, answers)
        if hits:
            struck[size], kept[size] = i, _is_in_contact(stage, i)
            put_at(before, size, 0, column(world.v, i))
            put_at(before, size, 3, column(world.candidates.u, i))
            put_at(after, size, 0, v)
            put_at(after, size, 3, u)
            size += 1
    for k in range(size):
        lead(stage, struck[k], at(after, k, 0), at(after, k, 3), base[struck[k]])
    for k in range(size):
        kept[k] = kept[k] or _meets_somebody(stage, struck[k])
    for k in range(size):
        if stage.bounces:
            put(world.candidates.u, struck[k], at(before, k, 3))
        depth, place = pushed_place(stage, struck[k], answers)
        if depth > 0.0:
            put_at(after, k, 3, scaled(1.0 / world.rules.flight.dt, subtract(
                place, column(world.x, struck[k]))))
    for k in range(size):
        lead(stage, struck[k], at(after, k, 0), at(after, k, 3), base[struck[k]])
    for k in range(size):
        kept[k] = kept[k] or _meets_somebody(stage, struck[k])
    for k in range(size):
        lead(stage, struck[k], at(before, k, 0), at(before, k, 3), base[struck[k]])
    for k in range(size):
        if kept[k]:
            look_at_walls(stage, struck[k], answers)
            listed += 1
        else:
            stage.meetings.states[struck[k], NEAR] = LEFT
    return listed
