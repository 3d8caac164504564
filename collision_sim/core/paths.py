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
Paths between events, for the event-driven method: where a particle is, and what it hits.

Free flight with linear drag and straight slides have a closed form, resting particles move with
their collider. The rest (quadratic drag, slides on curved or turning surfaces) is integrated, with
a local error below TOLERANCE. A later time is always reached in one step of the integrator from
the start of the path, so that an event is found on the solution itself and not on an
interpolation.
"""

from math import inf, sqrt
from typing import NamedTuple

from collision_sim.core.courses import (centre, frame_acceleration, largest_jerk,
                                        material_velocity, spin_axis, spin_rate)
from collision_sim.core.extrapolation import integrate
from collision_sim.core.flight import decay
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.meeting import ZERO
from collision_sim.core.rules import N_UNDECIDED, ROUNDING
from collision_sim.core.shapes import BOX, KIND, PLANE, SIDE, SIZE, SPHERE
from collision_sim.core.surfaces import (face_beside, FACES, gap_to, is_flat, open_face,
                                         touching_depth)
from collision_sim.core.sustained import onto_surfaces, resting_place, RESTS
from collision_sim.core.vectors import (add, add_scaled, cross, dot, EPSILON, largest, length,
                                        subtract)

TOLERANCE = 1e-13       # largest local error of a step, relative to its changes
STIFF_TOLERANCE = 2e-12     # that of a stiff step, whose rounding is larger
DEEPER = 4.0            # times the depth of touching that a step may end below a face in a seam
QUERIES = 20_000        # most evaluations of a gap before a search is given up as undecided

decay = kernel(decay)


class Path(NamedTuple):
    """
    How a particle moves from an event on.

    mode, holds: as from sustained.choose_mode; since [s], x, v: where it starts; closed: whether
    v' = a - k v with a [m/s^2] and k [1/s] (`decay`); bend [m/s^2]: bound on its acceleration
    where it is not closed; stiff: which rule integrates it.
    """

    mode: int
    holds: tuple
    since: float
    x: tuple
    v: tuple
    closed: bool
    a: tuple
    k: float
    bend: float
    stiff: bool = False


@kernel
def state_at(world, forces, here, courses, work, path, t):
    """
    Position and velocity on a path at a time.

    Parameters
    ----------
    world, forces, here, courses, work
        As in exact.py.
    path : Path
        The way of the particle.
    t : float [s]
        Since the start of the step, not before that of the path.

    Returns
    -------
    x, v : (3,) tuple of float [m], [m/s]

    """
    poses = world.poses
    h = t - path.since
    if path.mode == RESTS:
        return resting_place(courses, poses, here, path.holds[0] // FACES, path.x, path.since, t)
    if path.closed:
        e0, e1, e2 = 1.0, 1.0, 0.5
        if path.k > 0.0:
            e0, e1, e2 = decay(path.k * h)
        p, q = e1 * h, e2 * h * h
        return ((path.x[0] + (p * path.v[0] + q * path.a[0]),
                 path.x[1] + (p * path.v[1] + q * path.a[1]),
                 path.x[2] + (p * path.v[2] + q * path.a[2])),
                (e0 * path.v[0] + p * path.a[0], e0 * path.v[1] + p * path.a[1],
                 e0 * path.v[2] + p * path.a[2]))
    x, v, _ = integrate(world, forces, here, courses, work, path.stiff, path.holds, path.since,
                        path.x, path.v, h)
    return onto_surfaces(world, here, courses, path.holds, t, x, v)


@inlined
def _acceleration(here, poses, courses, path, t, x, v):
    """
    Acceleration of a particle on its path, and a bound on how fast it changes from then on.

    Returns
    -------
    a : (3,) tuple of float [m/s^2]
        Zero on an integrated path.
    bound : float [m/s^2]
        On the acceleration of an integrated path, else 0.
    jerk : float [m/s^3]
        Bound, 0 on an integrated path.

    """
    if path.mode == RESTS:
        c = path.holds[0] // FACES
        spin, arm = spin_rate(courses, here, c), subtract(x, centre(courses, poses, here, c, t))
        return (frame_acceleration(courses, poses, here, c, t, x, ZERO), 0.0,
                largest_jerk(courses, here, c) + spin ** 3 * length(arm))
    if path.closed:
        a = add_scaled(path.a, -path.k, v)
        return a, 0.0, path.k * length(a)
    return ZERO, path.bend, 0.0


@inlined
def safe_time(gap, rate, bend):
    """Time until gap + rate t - bend t^2 / 2 is 0, infinite if never; gap >= 0."""
    if bend == 0.0:
        return gap / -rate if rate < 0.0 else inf
    square = rate * rate + 2.0 * bend * gap
    if square < 0.0:
        return inf
    if rate < 0.0:
        return 2.0 * gap / (sqrt(square) - rate)
    return (rate + sqrt(square)) / bend if bend > 0.0 else inf


@inlined
def _turns_in_itself(world, here, c, axis):
    """Whether a shape of revolution, or a plane, turns about its own axis."""
    table, poses = world.table, world.poses
    if table[c, KIND] == BOX:
        return False
    z = (poses[here.start, c, 2], poses[here.start, c, 5], poses[here.start, c, 8])
    return table[c, KIND] == SPHERE or largest(cross(axis, z)) <= EPSILON


@inlined
def _turning_bend(alpha, spin, drift, arm, h):
    """Bound [m/s^2] on how fast the gap to a turning solid bends down over a time h."""
    fast = drift + alpha * h
    return alpha + spin * (2.0 * fast + spin * (arm + fast * h))


@inlined
def _extent(table, c):
    """Radius [m] of a ball about the position of a collider that holds its solid."""
    if table[c, KIND] == PLANE or table[c, SIDE] < 0.0:
        return inf
    if table[c, KIND] == SPHERE:
        return table[c, SIZE]
    if table[c, KIND] == BOX:
        return length((table[c, SIZE], table[c, SIZE + 1], table[c, SIZE + 2]))
    return table[c, SIZE] + table[c, SIZE + 1]


@kernel
def _bend(table, c, face, side, radius, gap, n, w, a, bound):
    """
    How fast the gap to a solid that does not turn bends down now [m/s^2].

    No faster than that to the plane that touches a convex solid; inside a round wall (R^2 - q^2) /
    (2 R) bends by (w^2 + q.a) / R, with the arm q = -rho n from the axis.
    """
    if side > 0.0 or is_flat(table, c, face, side):
        return bound - dot(n, a)
    space = max(table[c, SIZE] - radius, EPSILON * table[c, SIZE])
    rho = sqrt(max(space * (space - 2.0 * gap), 0.0))
    return bound + (dot(w, w) - rho * dot(n, a)) / space


@inlined
def _bend_growth(table, c, face, side, radius, w, alpha, jerk, h):
    """Bound [m/s^3] on how fast the result of `_bend` grows over a time h."""
    if side > 0.0 or is_flat(table, c, face, side):
        return jerk
    space = max(table[c, SIZE] - radius, EPSILON * table[c, SIZE])
    return jerk + 3.0 * (length(w) + alpha * h) * alpha / space


@kernel
def _step_to(world, here, courses, path, c, face, side, radius, t, end, x, v, gap, rate, n, w,
             touching):
    """Time from t for which a gap stays positive, as far as is known there: see `first_time`."""
    table, poses = world.table, world.poses
    middle = centre(courses, poses, here, c, t)
    own, bound, jerk = _acceleration(here, poses, courses, path, t, x, v)
    a = subtract(own, frame_acceleration(courses, poses, here, c, t, middle, ZERO))
    jerk += largest_jerk(courses, here, c)
    arm, spin, axis = subtract(x, middle), spin_rate(courses, here, c), spin_axis(courses, here, c)
    drift = add(w, cross(axis, add_scaled(ZERO, spin, arm)))
    if _turns_in_itself(world, here, c, axis):
        spin, w = 0.0, drift
    now = _bend(table, c, face, side, radius, gap, n, w, a, bound)
    h, step, most = end - t, 0.0, length(a) + bound + jerk * (end - t)
    above = max(gap, 0.0) + touching
    if spin == 0.0 and _bend_growth(table, c, face, side, radius, w, most, jerk, h) == 0.0:
        if safe_time(above, rate, now) == inf:
            return inf              # it never comes deeper than rounding
    above = above if gap <= touching else gap
    for _ in range(16):             # what holds for a shorter time is closer
        alpha = length(a) + bound + jerk * h
        bend = now + h * _bend_growth(table, c, face, side, radius, w, alpha, jerk, h)
        if spin > 0.0:
            bend = _turning_bend(alpha, spin, length(drift), length(arm), h)
            if side < 0.0 and not is_flat(table, c, face, side):
                bend += (length(w) + bend * h) ** 2 / max(table[c, SIZE] - radius,
                                                          EPSILON * table[c, SIZE])
        hops = rate > 0.0 and rate * rate > 2.0 * bend * touching     # higher than rounding
        step = min(safe_time(max(gap, 0.0) if hops else above, rate, bend), h)
        if step >= 0.25 * h:
            break
        h = max(4.0 * step, 0.125 * h)
    if spin > 0.0 and side > 0.0:
        off = length(arm) - _extent(table, c) - radius
        if off > 0.0:
            step = max(step, safe_time(off, dot(arm, drift) / length(arm), most))
    return step


@kernel
def first_time(world, forces, here, courses, work, path, c, face, side, radius, t, end, latest):
    """
    First time at which a particle on its path comes to a surface.

    Each step goes as far as the gap is known to stay positive, from its value, its rate and a
    bound on how fast it bends down: what it is now, and how fast that can grow by the jerks of
    particle and collider; for a solid that turns, a bound over the time ahead. Against flat
    surfaces under a constant acceleration the first step is the closed form. None can be missed.

    Parameters
    ----------
    world, forces, here, courses, work
        As in exact.py.
    path : Path
        The way of the particle.
    c, face, side, radius
        As in surfaces.gap_to.
    t, end : float [s]
        From when to when the path goes.
    latest : float [s]
        Until when the search goes, at most `end`. It changes no bit of what is found before.

    Returns
    -------
    time : float [s]
        Infinite if not before `latest`.

    """
    for _ in range(QUERIES):
        x, v = state_at(world, forces, here, courses, work, path, t)
        gap, slope, n = gap_to(world, here, courses, c, face, side, radius, t, x)
        obj = material_velocity(courses, world.poses, here, c, t, x)
        touching, rate = touching_depth(world, here, c, x), dot(subtract(v, obj), n)
        rounding = ROUNDING * (largest(v) + largest(obj))
        if gap <= touching:
            beside = 0
            if abs(rate) <= rounding and face == 0 and side > 0.0:  # it may fall along a seam
                beside = open_face(world, here, courses, c, radius, t, x, n, DEEPER * touching)
                if beside > 0:
                    gap, slope, n = gap_to(world, here, courses, c, beside, side, radius, t, x)
                    rate, beside = dot(subtract(v, obj), n), 0
            if rate < -rounding and face == 0 and side > 0.0:
                beside = face_beside(world, here, courses, c, radius, t, x, subtract(v, obj),
                                     touching, rounding)
            if beside > 0:
                gap, slope, n = gap_to(world, here, courses, c, beside, side, radius, t, x)
                rate = dot(subtract(v, obj), n)
            if rate < -rounding:
                return t
            rate = max(rate, 0.0)
        step = _step_to(world, here, courses, path, c, face, side, radius, t, end, x, v, gap,
                        slope * rate, n, subtract(v, obj), touching)
        if t + step >= latest:
            return inf
        t += max(step, EPSILON * end)
    world.accounts[here.block, N_UNDECIDED] += 1
    return t
