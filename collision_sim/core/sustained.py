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
Contact as a mode of motion, for the event-driven method: which surfaces hold a particle, and how.

A particle that touches a surface without approaching it is pressed on by it, with the normal force
N >= 0 (per unit mass) that keeps the gap at zero: n.f + bend - n.a_frame + N = 0, f the forces and
the rest the acceleration of the gap without N. It rests on the collider where static friction can
hold it there, else it slides with N (n - mu_k w/|w| - D w). Up to three surfaces press at once;
their forces come from one linear system. A surface that would have to pull does not hold.
"""

from typing import NamedTuple

from collision_sim.core.courses import (carried, frame_acceleration, material_velocity,
                                        spin_rate)
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.meeting import (BALANCED, facing, first_choice, gather, least_push,
                                        leave_out, NEED, next_choice, NOBODY, normal_forces,
                                        square_up, surface_of, surfaces_of, ZERO)
from collision_sim.core.rules import NONE, ROUNDING
from collision_sim.core.shapes import KINETIC, SIDE, STATIC, WET
from collision_sim.core.surfaces import bend_of, FACES, gap_to
from collision_sim.core.vectors import add_scaled, dot, largest, length, origin, subtract

BLINK = 3e-5                    # share of a step: how long friction turns a first slip
SETTLED = 1e-4                  # share of a blink: how long the last of a slide takes
FLIES, RESTS, SLIDES, GLIDES = 0, 1, 2, 3       # the last: slides without friction


class Forces(NamedTuple):
    """
    Gravity [m/s^2], wind [m/s], linear [1/s] and quadratic drag [1/m], 0 where absent.

    blink [s]: time whose acceleration makes no speed that counts; grip [-]: share of the friction
    of contact that acts, 0 where it jams.
    """

    gravity: tuple
    wind: tuple
    linear: float
    quadratic: float
    blink: float
    grip: float = 1.0


@inlined
def smooth(forces):
    """Return the forces without the friction of contact."""
    return Forces(forces.gravity, forces.wind, forces.linear, forces.quadratic, forces.blink, 0.0)


@inlined
def _linear_drag(linear, u, a):
    if linear > 0.0:
        return add_scaled(a, -linear, u)
    return a


@inlined
def _quadratic_drag(quadratic, u, a):
    if quadratic > 0.0:
        return add_scaled(a, -quadratic * length(u), u)
    return a


@inlined
def pull(forces, v):
    """Give the acceleration [m/s^2] by gravity and drag at a velocity [m/s]."""
    u = subtract(v, forces.wind)
    return _quadratic_drag(forces.quadratic, u, _linear_drag(forces.linear, u, forces.gravity))


@inlined
def normal_at(world, here, courses, s, t, x):
    """Give the normal of a surface [-]."""
    c, face = s // FACES, s % FACES
    return gap_to(world, here, courses, c, face, world.table[c, SIDE], here.radius, t, x)[2]


@kernel
def opening(world, here, courses, s, t, x, v, n):
    """
    Acceleration of the gap without forces, and the velocity relative to the collider.

    Returns
    -------
    g : float [m/s^2]
        To which n.f and the normal forces add.
    w : (3,) tuple of float [m/s]

    """
    poses = world.poses
    c, face = s // FACES, s % FACES
    w = subtract(v, material_velocity(courses, poses, here, c, t, x))
    g = bend_of(world, here, courses, c, face, t, x, n, w)
    return g - dot(n, frame_acceleration(courses, poses, here, c, t, x, w)), w


@inlined
def _friction(dry, wet, grip, table, c, w, along, n):
    """Give the force of a surface for N = 1: normal, and friction against w or a first slip."""
    d = n
    if wet:
        d = add_scaled(d, -grip * table[c, WET], w)
    if dry:
        slip = along if dot(along, along) > 0.0 else w
        speed = length(slip)
        if speed > 0.0:
            d = add_scaled(d, -grip * table[c, KINETIC] / speed, slip)
    return d


@inlined
def still_speed(courses, poses, here, c, x, v):
    """Speed [m/s] relative to a collider that is only rounding."""
    arm = largest(x) + largest(origin(poses, here.start, c))
    return 2.0 * ROUNDING * (largest(v) + spin_rate(courses, here, c) * arm)


@kernel
def _first_slip(dry, forces, world, here, courses, holds, t, x, v, f, w, n0, n1, n2, g0, g1, g2):
    """
    Give the direction in which a particle begins to slide; zero where it is that of w.

    Friction turns the velocity of a slow slide into the direction of the drive within w / (mu N),
    which is stiff just after a particle has broken away. For a blink it is taken as turned.
    """
    poses = world.poses
    if dry:
        if length(w) <= forces.blink * (length(f) + abs(g0)):
            normal = normal_forces(holds, n0, n1, n2, n0, n1, n2, g0, g1, g2)
            push = add_scaled(add_scaled(add_scaled(f, normal[0], n0), normal[1], n1), normal[2],
                              n2)
            c, grip = holds[0] // FACES, 0.0
            push = subtract(push, frame_acceleration(courses, poses, here, c, t, x, ZERO))
            for k in range(3):
                if holds[k] != NONE:
                    grip += world.table[holds[k] // FACES, KINETIC] * normal[k]
            still = length(w) <= 2.0 * still_speed(courses, poses, here, c, x, v)
            if still or (dot(w, push) > 0.0 and length(push) > grip):
                return push
    return ZERO


@inlined
def pull_slack(forces, a):
    """Give the normal force [m/s^2] that is only rounding."""
    return BALANCED * (length(a) + length(forces.gravity))


@kernel
def held(world, forces, here, courses, holds, t, x, v):
    """
    Acceleration of a particle that slides along the surfaces that hold it, and their forces.

    Parameters
    ----------
    world, forces, here, courses
        As in exact.py.
    holds : (3,) tuple of int
        Surfaces; none: free flight.
    t : float [s]
        Since the start of the step.
    x, v : (3,) tuple of float [m], [m/s]
        Where and how fast it is.

    Returns
    -------
    a : (3,) tuple of float [m/s^2]
    normal : (3,) tuple of float [m/s^2]
        Normal forces per unit mass; not restricted to be positive.

    """
    rules, table = world.rules, world.table
    f = pull(forces, v)
    if holds[0] == NONE:
        return f, ZERO
    n0 = normal_at(world, here, courses, holds[0], t, x)
    g0, w0 = opening(world, here, courses, holds[0], t, x, v, n0)
    n1, g1, w1, n2, g2, w2 = n0, 0.0, ZERO, n0, 0.0, ZERO
    if holds[1] != NONE:
        n1 = normal_at(world, here, courses, holds[1], t, x)
        g1, w1 = opening(world, here, courses, holds[1], t, x, v, n1)
    if holds[2] != NONE:
        n2 = normal_at(world, here, courses, holds[2], t, x)
        g2, w2 = opening(world, here, courses, holds[2], t, x, v, n2)
    g0, g1, g2 = g0 + dot(n0, f), g1 + dot(n1, f), g2 + dot(n2, f)
    push = _first_slip(rules.dry, forces, world, here, courses, holds, t, x, v, f, w0, n0, n1, n2,
                       g0, g1, g2)
    d0 = _friction(rules.dry, rules.wet, forces.grip, table, holds[0] // FACES, w0, push,
                   n0)
    d1, d2 = n1, n2
    if holds[1] != NONE:
        d1 = _friction(rules.dry, rules.wet, forces.grip, table, holds[1] // FACES, w1,
                       push, n1)
    if holds[2] != NONE:
        d2 = _friction(rules.dry, rules.wet, forces.grip, table, holds[2] // FACES, w2,
                       push, n2)
    normal = normal_forces(holds, n0, n1, n2, d0, d1, d2, g0, g1, g2)
    a = add_scaled(add_scaled(add_scaled(f, normal[0], d0), normal[1], d1), normal[2], d2)
    return a, normal


@kernel
def _rests_on(world, holds, n0, n1, n2, need):
    """
    Whether up to three surfaces can give a particle the acceleration `need` by resting on them.

    Their normal forces take what they can, which must not be a pull; static friction the rest.
    """
    normal = normal_forces(holds, n0, n1, n2, n0, n1, n2, -dot(n0, need), -dot(n1, need),
                           -dot(n2, need))
    grip = 0.0
    for k in range(3):
        if holds[k] != NONE:
            if not normal[k] >= -BALANCED * length(need):
                return False
            grip += world.table[holds[k] // FACES, STATIC] * normal[k]
    _, d1, d2 = square_up(n0, n1, n2, holds)
    rest = 0.0
    if holds[1] == NONE:
        rest = length(add_scaled(need, -dot(n0, need), n0))
    elif holds[2] == NONE:
        rest = abs(dot(d2, need))
    return rest <= grip + BALANCED * length(need)


@inlined
def at_rest(courses, poses, here, c, t, x, v):
    """Whether a particle does not move relative to a collider, to rounding."""
    obj = material_velocity(courses, poses, here, c, t, x)
    return largest(subtract(v, obj)) <= still_speed(courses, poses, here, c, x, v)


@kernel
def nearly_at_rest(forces, courses, poses, here, c, t, x, v):
    """
    Whether a particle is so slow on a collider that it stops at once if friction can hold it.

    Close to the limit of static friction a slide would take long to stop, on a way that does not
    count.
    """
    obj = material_velocity(courses, poses, here, c, t, x)
    slow = SETTLED * forces.blink * length(pull(forces, obj))
    return largest(subtract(v, obj)) <= slow + still_speed(courses, poses, here, c, x, v)


@kernel
def can_rest(world, forces, here, courses, holds, t, x):
    """Whether a particle that rests on the first of some surfaces goes on doing so at a time."""
    poses = world.poses
    c = holds[0] // FACES
    v = material_velocity(courses, poses, here, c, t, x)
    need = subtract(frame_acceleration(courses, poses, here, c, t, x, ZERO), pull(forces, v))
    n0 = normal_at(world, here, courses, holds[0], t, x)
    n1, n2 = n0, n0
    if holds[1] != NONE:
        n1 = normal_at(world, here, courses, holds[1], t, x)
    if holds[2] != NONE:
        n2 = normal_at(world, here, courses, holds[2], t, x)
    return _rests_on(world, holds, n0, n1, n2, need)


@kernel
def _opens(world, forces, here, courses, holds, other, t, x, v, a, slack):
    """
    Whether a touched surface that does not hold opens by more than slack at acceleration a.

    With a slack below 0 it may as well stay: without any force that slack is 0.
    """
    if other == holds[0] or other == holds[1] or other == holds[2]:
        return True
    n = normal_at(world, here, courses, other, t, x)
    g, _ = opening(world, here, courses, other, t, x, v, n)
    gap, least = g + dot(n, a), slack * BALANCED * (length(a) + length(forces.gravity))
    return gap > least or (slack < 0.0 and gap == least)


@kernel
def _slides_on(world, forces, here, courses, holds, met, count, t, x, v):
    """
    Whether sliding on `holds` needs no pull, and the other touched surfaces open.

    A surface with neither push nor pull holds: the next moment decides.
    """
    a, normal = held(world, forces, here, courses, holds, t, x, v)
    slack = 1.0 if holds[0] == NONE else -1.0
    for k in range(3):
        if holds[k] != NONE and not normal[k] >= -pull_slack(forces, a):
            return False
    for k in range(count):
        if not _opens(world, forces, here, courses, holds, surface_of(met, k), t, x, v, a, slack):
            return False
    return True


@kernel
def _all_still(forces, courses, poses, here, holds, t, x, v):
    """Whether a particle hardly moves relative to all surfaces that hold it."""
    for k in range(3):
        if holds[k] != NONE and not nearly_at_rest(forces, courses, poses, here,
                                                   holds[k] // FACES, t, x, v):
            return False
    return True


@kernel
def _keeps_still(world, forces, here, courses, holds, met, count, t, x):
    """Whether resting on `holds` is possible, and the other touched surfaces let it."""
    poses = world.poses
    c = holds[0] // FACES
    if not can_rest(world, forces, here, courses, holds, t, x):
        return False
    v = material_velocity(courses, poses, here, c, t, x)
    a = frame_acceleration(courses, poses, here, c, t, x, ZERO)
    for k in range(1, 3):
        if holds[k] != NONE and _opens(world, forces, here, courses, NOBODY, holds[k], t, x, v, a,
                                       1.0):
            return False
    for k in range(count):
        if not _opens(world, forces, here, courses, holds, surface_of(met, k), t, x, v, a, -1.0):
            return False
    return True


@kernel
def _slides(world, forces, here, courses, met, count, t, x, v):
    """Return the first choice of surfaces on which a particle can slide, or NOBODY."""
    choice = first_choice(count)
    while choice[0] != NONE:
        holds = surfaces_of(met, choice)
        if _slides_on(world, forces, here, courses, holds, met, count, t, x, v):
            return holds
        choice = next_choice(choice, count)
    return NOBODY


@kernel
def _bearing(world, forces, here, courses, met, count, t, x, v):
    """Return the surfaces that bear the forces on a particle, without friction."""
    f = pull(forces, v)
    for k in range(count):
        n = facing(met, k)
        g, _ = opening(world, here, courses, surface_of(met, k), t, x, v, n)
        met[k, NEED] = -(g + dot(n, f))
    _, choice, _ = least_push(met, count)
    return surfaces_of(met, choice if choice[0] != NONE else first_choice(count))


@kernel
def choose_mode(world, forces, here, courses, met, released, t, x, v):
    """
    How a particle that approaches nothing goes on: it flies, rests or slides, and on what.

    Parameters
    ----------
    world, forces, here, courses, met
        As in exact.py.
    released : int
        Surface that does not hold it any more, or NONE.
    t, x, v
        Time, position and velocity.

    Returns
    -------
    mode : int
        FLIES, RESTS, SLIDES or GLIDES.
    holds : (3,) tuple of int
        Surfaces; the first choice that needs no pull. There may be none between surfaces that move
        relative to each other: their friction jams, and for this path it is left out. Where even
        that leaves none, by rounding, those that bear the forces.

    """
    poses = world.poses
    count = gather(world, here, courses, met, t, x, v, 1.0, False)
    count = leave_out(met, count, released)
    if count == 0 or _slides_on(world, forces, here, courses, NOBODY, met, count, t, x, v):
        return FLIES, NOBODY
    choice = first_choice(count)
    while choice[0] != NONE:
        holds = surfaces_of(met, choice)
        if _all_still(forces, courses, poses, here, holds, t, x, v) and _keeps_still(world, forces,
                                                                                     here, courses,
                                                                                     holds, met,
                                                                                     count, t, x):
            return RESTS, holds
        choice = next_choice(choice, count)
    holds = _slides(world, forces, here, courses, met, count, t, x, v)
    if holds[0] != NONE:
        return SLIDES, holds
    holds = _slides(world, smooth(forces), here, courses, met, count, t, x, v)
    if holds[0] == NONE:
        holds = _bearing(world, forces, here, courses, met, count, t, x, v)
        if _all_still(forces, courses, poses, here, holds, t, x, v):
            return RESTS, holds
    return GLIDES, holds


@inlined
def resting_place(courses, poses, here, c, x, since, t):
    """Position and velocity at time t of a particle that has rested on a collider since."""
    x = carried(courses, poses, here, c, x, since, t)
    return x, material_velocity(courses, poses, here, c, t, x)


@kernel
def onto_surfaces(world, here, courses, holds, t, x, v):
    """Take rounding out of a particle on surfaces: gaps to zero, velocity along them."""
    table, poses = world.table, world.poses
    for _ in range(2):
        n0 = n1 = n2 = (0.0, 0.0, 1.0)
        if holds[0] != NONE:
            n0 = normal_at(world, here, courses, holds[0], t, x)
        if holds[1] != NONE:
            n1 = normal_at(world, here, courses, holds[1], t, x)
        d = square_up(n0, n1, n2, holds)
        for k in range(3):
            if holds[k] != NONE:
                c, face = holds[k] // FACES, holds[k] % FACES
                gap, slope, n = gap_to(world, here, courses, c, face, table[c, SIDE], here.radius,
                                       t, x)
                along = dot(n, d[k])
                if abs(along) > BALANCED:
                    x = add_scaled(x, -gap / (slope * along), d[k])
                    w = subtract(v, material_velocity(courses, poses, here, c, t, x))
                    v = add_scaled(v, -dot(w, n) / along, d[k])
    return x, v
