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
Contact of second order, of a particle that slides on a surface.

As RATTLE does for a constraint: half of the impulse acts at the start, along the normal there, and
is such that the particle ends on the surface; the other half acts at the end, along the normal
there, and ends the approach. (Who lands in this step has its first normal where it lands.) Each
half brings its friction, the first one on the velocity at the start and the second one on that at
the end: a trapezoid, for which of dry and wet friction the one that comes last there comes first
here. On planes both halves have the same normal, and what is exact with one impulse a step is
exact with two halves as well.

The order is two while a particle slides. Events inside a step, that is impacts, the end of a
contact and the moment when dry friction turns around, are met to first order, as everywhere.

Source: H. C. Andersen, RATTLE, J. Comput. Phys. 52 (1983).
"""

from collision_sim.core.detection import distance, rounding_depth
from collision_sim.core.faces import face_below, height_over
from collision_sim.core.impulses import (along_both, between, dry_factor, joint_impulses,
                                         joint_law, wet_factor)
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.laws import dry_friction
from collision_sim.core.motion import chord_velocity, END, point_velocity, START
from collision_sim.core.rules import NONE, ROUNDING
from collision_sim.core.shapes import KINETIC, signed_distance, SIZE, STATIC
from collision_sim.core.vectors import (add, add_scaled, dot, largest, length, origin,
                                        subtract)

NEWTON = 12             # most evaluations of the distance at the end
LEAST_SLOPE = 0.25      # cosine below which Newton's method is given up
LEAST_CHANGE = 1e-8     # relative change of velocity below which friction is not in the slope


@inlined
def tangential(v, n):
    """Part of a vector along the surface with normal n."""
    return add_scaled(v, -dot(v, n), n)


@inlined
def _kinetic_factor(table, c, speed, dv_n):
    """Factor of dry friction on a velocity of which it is known that it slips."""
    if table[c, KINETIC] * dv_n > 0.0:
        return dry_friction(speed, dv_n, table[c, KINETIC], table[c, KINETIC])
    return 1.0


@inlined
def _sticks(table, c, slip, dv_n):
    """Whether dry friction holds a slip [m/s] of the mean velocity."""
    return table[c, STATIC] * dv_n > 0.0 and length(slip) <= table[c, STATIC] * dv_n


@inlined
def _first_half(table, c, u, obj, n, v_n, slip, kick, dv_n):
    """
    Mean velocity after the half of the impulse that acts at the start, and whether it sticks.

    Parameters
    ----------
    table, c, u, obj, n
        As in `impulses.respond`, for the mean velocity.
    v_n, dv_n : float [m/s]
        Normal velocity of u before, and its change.
    slip, kick : (3,) tuple of float [m/s]
        Tangential velocity at the start, and what the flight adds to its mean. Friction acts on
        the first, except where the second is larger: a particle that starts to slip, or stops.

    Returns
    -------
    u : (3,) tuple of float [m/s]
    stuck : bool

    """
    mean = (slip[0] + kick[0], slip[1] + kick[1], slip[2] + kick[2])
    if _sticks(table, c, mean, dv_n):
        return add_scaled(obj, v_n + dv_n, n), True
    slides = dot(slip, slip) > dot(kick, kick)
    acted = slip if slides else mean
    wet = wet_factor(table, c, dv_n)
    factor = wet * _kinetic_factor(table, c, abs(wet) * length(acted), dv_n)
    after = add_scaled(u, dv_n, n)
    if factor == 1.0:
        return after, False
    return add_scaled(after, factor - 1.0, acted), False


@inlined
def _surface(world, here, c, x0, n0, x1):
    """
    Distance [m] and normal of a collider at the end of the step, and what is only rounding.

    Of a face that the particle is over at the start, with normal n0, those of its continuation.
    """
    table, poses = world.table, world.poses
    face = face_below(table, poses, here.start, c, x0, n0)
    if face != NONE:
        phi, n = height_over(table, poses, here.end, c, face, x1)
    else:
        phi, n = signed_distance(world.rules.present, table, poses, here.end, c, x1)
    scale = largest(x1) + largest(origin(poses, here.end, c)) + table[c, SIZE]
    return phi - here.radius, n, 0.25 * ROUNDING * scale


@kernel
def to_surface(world, here, x0, v0, touch, u):
    """
    Push the end of the step to the surface, along the normal at the start of the contact.

    Returns
    -------
    u, x1 : (3,) tuple of float [m/s], [m]
        Mean velocity, and the end of the step with it.
    n : (3,) tuple of float [-]
        Normal there.
    stuck : bool

    """
    poses, motion = world.poses, world.motion
    c, n0, dt = touch.collider, touch.normal, world.rules.flight.dt
    obj = chord_velocity(motion, poses, here.step, here.start, c, x0, dt)
    obj0 = point_velocity(motion, poses, here.step, START, here.start, c, x0)
    relative = subtract(u, obj)
    v_n = dot(relative, n0)
    slip = tangential(subtract(v0, obj0), n0)
    kick = subtract(tangential(relative, n0), slip)
    gap = abs(distance(world, here, here.start, c, x0))
    gap = gap if gap <= rounding_depth(world, here, c, x0) else 0.0
    dv_n, left = max(-v_n, 0.0), NEWTON
    while True:
        after, stuck = _first_half(world.table, c, u, obj, n0, v_n, slip, kick, dv_n)
        x1, left = add_scaled(x0, dt, after), left - 1
        phi, n, rounding = _surface(world, here, c, x0, n0, x1)
        slope = dot(n, n0)
        if dv_n > LEAST_CHANGE * largest(u) and not stuck:
            slope = dot(n, subtract(after, u)) / dv_n
        if abs(phi) <= max(rounding, gap) or left == 0 or not slope > LEAST_SLOPE:
            return after, x1, n, stuck
        dv_n, gap = max(dv_n - phi / (dt * slope), 0.0), 0.0


@inlined
def _joint_half(table, c1, n1, obj1, slip1, c2, n2, obj2, slip2, u):
    """
    Mean velocity after both impulses that act at the start, as `_first_half`.

    slip1, slip2 (3,) [m/s]: along both surfaces, relative to each collider, at the start.
    """
    a, b = joint_impulses(n1, obj1, n2, obj2, u)
    after = add_scaled(add_scaled(u, a, n1), b, n2)
    if a > 0.0 and b > 0.0:
        after = between(after, n1, obj1, n2, obj2, 0.0)
    slowed = (0.0, 0.0, 0.0)
    for c, obj, slip, dv_n in ((c2, obj2, slip2, b), (c1, obj1, slip1, a)):
        acted = subtract(after, obj)
        if a > 0.0 and b > 0.0:         # across, they hold the particle between them
            acted = along_both(acted, n1, n2)
            kick = subtract(acted, slip)
            acted = slip if dot(slip, slip) > dot(kick, kick) else acted
        acted = add(acted, slowed)
        wet = wet_factor(table, c, dv_n)
        factor = wet * dry_factor(table, c, abs(wet) * length(acted), dv_n)
        slowed = add_scaled(slowed, factor - 1.0, acted)
    return add(after, slowed)


@kernel
def to_both_surfaces(world, here, x0, v0, one, two, u, w):
    """
    Contact with two colliders at once: the end on both surfaces, the end velocity along both.

    Parameters
    ----------
    world, here, x0, v0
        As in `response.resolve`.
    one, two : Touch
        The colliders, with their normals at the start of the contact, which are not parallel.
    u, w : (3,) tuple of float [m/s]
        Mean and end velocity of the candidate.

    Returns
    -------
    u, w : (3,) tuple of float [m/s]

    """
    table, poses, motion = world.table, world.poses, world.motion
    c1, c2, n1, n2, dt = one.collider, two.collider, one.normal, two.normal, world.rules.flight.dt
    obj1 = chord_velocity(motion, poses, here.step, here.start, c1, x0, dt)
    obj2 = chord_velocity(motion, poses, here.step, here.start, c2, x0, dt)
    slip1 = along_both(subtract(v0, point_velocity(
        motion, poses, here.step, START, here.start, c1, x0)), n1, n2)
    slip2 = along_both(subtract(v0, point_velocity(
        motion, poses, here.step, START, here.start, c2, x0)), n1, n2)
    v1, v2, after, left = 0.0, 0.0, u, NEWTON
    while True:
        after = _joint_half(table, c1, n1, add_scaled(obj1, v1, n1), slip1, c2, n2,
                            add_scaled(obj2, v2, n2), slip2, u)
        x1, left = add_scaled(x0, dt, after), left - 1
        phi1, end1, rounding1 = _surface(world, here, c1, x0, n1, x1)
        phi2, end2, rounding2 = _surface(world, here, c2, x0, n2, x1)
        if (abs(phi1) <= rounding1 and abs(phi2) <= rounding2) or left == 0:
            break
        v1, v2 = v1 - phi1 / dt, v2 - phi2 / dt
    obj1 = point_velocity(motion, poses, here.step, END, here.end, c1, x1)
    obj2 = point_velocity(motion, poses, here.step, END, here.end, c2, x1)
    w = add(w, subtract(after, u))
    return after, joint_law(table, c1, end1, obj1, c2, end2, obj2, w)
