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
Where a particle goes that is still inside a collider after its velocities have been answered.

It is pushed to the surfaces, which is a move and no impulse; the fail-safe is for what no push
gets out.
"""

from collision_sim.core.detection import blocker, deepest, is_same_surface, rounding_depth
from collision_sim.core.jit import kernel
from collision_sim.core.motion import chord_velocity, END, point_velocity
from collision_sim.core.rules import (N_FAIL_SAFE, N_FROZEN, N_UNPLACED, NONE, NOTES, PARALLEL,
                                      PUSHES)
from collision_sim.core.vectors import (add_scaled, cross, dot, EPSILON, largest, length, origin,
                                        scaled, subtract)


@kernel
def _free_part(n, a, b):
    """
    Give the part of normal n along the surfaces with normals a and b; zero: no such surface.

    As vector products, which lose no digits where surfaces are all but parallel.
    """
    along = cross(a, b)
    size = dot(along, along)
    if size > PARALLEL:
        t = scaled(dot(along, n) / size, along)
    elif dot(a, a) > 0.0:
        t = cross(cross(a, n), a)
    else:
        return n
    return t if dot(t, t) > PARALLEL else n


@kernel
def _carried(world, here, c, x0):
    """Where collider c would have carried a particle; where it started if c does not move."""
    rules = world.rules
    obj = chord_velocity(world.motion, world.poses, here.step, here.start, c, x0, rules.flight.dt)
    return add_scaled(x0, rules.flight.dt, obj)


@kernel
def push_out(world, here, x0, place):
    """
    Push a particle to the surfaces it is inside of, deepest first; a move, not an impulse.

    A push goes along the surfaces of the two colliders before it, so that a particle in a groove
    or a corner gets out in two or three pushes, however acute that is. Pushing ends where it leads
    further than the particle came, as the colliders see it, and twice the way they came together.

    Returns
    -------
    place : (3,) tuple of float [m]
    c, other : int
        The last two colliders it was inside of; c is NONE where it is now outside all.

    """
    table, poses = world.table, world.poses
    zero = (0.0, 0.0, 0.0)
    c1, c2, n1, n2, candidate = NONE, NONE, zero, zero, place
    for k in range(PUSHES):
        c, phi, n = deepest(world, here, x0, place)
        if c == NONE:
            return place, NONE, NONE
        a, b = n1, n2
        again = is_same_surface(table, c, n, c1, n1)
        if again or is_same_surface(table, c, n, c2, n2):
            a, b = (n2 if again else n1), zero
        if not again:
            c2, n2 = c1, n1
        c1, n1 = c, n
        t = _free_part(n, a, b)
        rounding = EPSILON * (largest(place) + largest(origin(poses, here.end, c)) + here.radius)
        place = add_scaled(place, (k * rounding - phi) / dot(t, t), t)
        carried = _carried(world, here, c, x0)
        reach = length(subtract(candidate, carried))
        if c2 != NONE:
            beside = _carried(world, here, c2, x0)
            reach = max(reach, length(subtract(candidate, beside)))
            reach += 2.0 * length(subtract(beside, carried))
        reach += rounding_depth(world, here, c, x0) + PUSHES * rounding
        if length(subtract(place, candidate)) > reach:
            break
    return place, c1, c2


@kernel
def fail_safe(world, here, c, other, x0):
    """
    Place a particle that cannot be pushed out, with the velocity of a collider.

    It goes where the collider that it is still inside of, or that is in its way, would have
    carried it, or else the collider beside that one: nobody else has touched it. Where both lead
    into a collider, it rides along with the first and is noted as unplaced.

    Parameters
    ----------
    world, here
        As in response.resolve.
    c, other : int
        The collider that it is inside of or that is in its way, and the one beside it or NONE.
    x0 : (3,) tuple of float [m]
        Where it started.

    Returns
    -------
    x1, w : (3,) tuple of float [m], [m/s]
    carrier : int
        The collider whose velocity that is.

    """
    poses, motion = world.poses, world.motion
    world.accounts[here.block, N_FAIL_SAFE] += 1
    for carrier in (c, other):
        if carrier != NONE:
            place = _carried(world, here, carrier, x0)
            place, inside, _ = push_out(world, here, x0, place)
            if inside == NONE and blocker(world, here, x0, place) == NONE:
                w = point_velocity(motion, poses, here.step, END, here.end, carrier, place)
                return place, w, carrier
    note_unplaced(world, here, c, other)
    place = _carried(world, here, c, x0)
    return place, point_velocity(motion, poses, here.step, END, here.end, c, place), c


@kernel
def note_unplaced(world, here, c, other):
    """Count a particle that stays inside a collider, and note which one and what hems it in."""
    accounts, notes = world.accounts, world.notes
    seat = accounts[here.block, N_UNPLACED]
    if seat < NOTES:
        notes[here.block, seat, 0], notes[here.block, seat, 1] = here.particle, c
        notes[here.block, seat, 2] = other
    accounts[here.block, N_UNPLACED] = seat + 1


@kernel
def freeze(accounts, block, x0):
    """
    Leave a particle where a step began, at rest, and count it: it would not be finite any more.

    It moves on once what drove it out of the range of numbers is gone.

    Returns
    -------
    x1, w : (3,) tuple of float [m], [m/s]

    """
    accounts[block, N_FROZEN] += 1
    return x0, (0.0, 0.0, 0.0)
