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

from typing import NamedTuple, Optional

from collision_sim.core.courses import (carried, frame_acceleration, material_velocity,
                                        spin_rate)
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.rules import NONE, ROUNDING
from collision_sim.core.shapes import KINETIC, SIDE, STATIC, WET
from collision_sim.core.surfaces import (bend_of, face_beside, FACES, faces, gap_to,
                                         touching_depth)
from collision_sim.core.vectors import (add_scaled, cross, dot, EPSILON, largest, length,
                                        origin, subtract)

NOBODY = (NONE, NONE, NONE)     # no surface holds
ZERO = (0.0, 0.0, 0.0)
BALANCED = 64.0 * EPSILON       # relative size of a force that is only rounding
BLINK = 3e-5                    # share of a step: how long friction turns a first slip
SETTLED = 1e-4                  # share of a blink: how long the last of a slide takes
FLIES, RESTS, SLIDES = 0, 1, 2


class Forces(NamedTuple):
    """
    Gravity [m/s^2], wind [m/s], linear [1/s] and quadratic drag [1/m], None where absent.

    blink [s]: time whose acceleration makes no speed that counts.
    """

    gravity: tuple
    wind: tuple
    linear: Optional[float]
    quadratic: Optional[float]
    blink: float


@inlined
def _linear_drag(linear, u, a):
    if linear is not None:
        return add_scaled(a, -linear, u)
    return a


@inlined
def _quadratic_drag(quadratic, u, a):
    if quadratic is not None:
        return add_scaled(a, -quadratic * length(u), u)
    return a


@inlined
def pull(forces, v):
    """Give the acceleration [m/s^2] by gravity and drag at a velocity [m/s]."""
    u = subtract(v, forces.wind)
    return _quadratic_drag(forces.quadratic, u, _linear_drag(forces.linear, u, forces.gravity))


@kernel
def touched(rules, here, table, poses, courses, t, x, v, count):
    """
    Give the surface that a particle touches without leaving it, `count` of them skipped.

    Returns
    -------
    surface : int
        NONE if there are no more.
    v_n : float [m/s]
        Normal velocity, 0 if it is only rounding.

    """
    for c in range(table.shape[0]):
        side = table[c, SIDE]
        for face in range(faces(table, c, side)):
            gap, _, n = gap_to(rules, here, table, poses, courses, c, face, side, here.radius, t,
                               x)
            if gap > touching_depth(table, poses, here, c, x):
                continue
            obj = material_velocity(courses, poses, here, c, t, x)
            rounding = ROUNDING * (largest(v) + largest(obj))
            v_n = dot(subtract(v, obj), n)
            if v_n > rounding:
                continue
            if count == 0:
                beside = 0
                if v_n < -rounding:
                    beside = face_beside(rules, here, table, poses, courses, c, here.radius, t, x,
                                         subtract(v, obj), touching_depth(table, poses, here, c,
                                                                          x), rounding)
                if beside > 0:
                    return FACES * c + beside, 0.0
                return FACES * c + face, (v_n if v_n < -rounding else 0.0)
            count -= 1
    return NONE, 0.0


@inlined
def normal_at(rules, here, table, poses, courses, s, t, x):
    """Give the normal of a surface [-]."""
    c, face = s // FACES, s % FACES
    return gap_to(rules, here, table, poses, courses, c, face, table[c, SIDE], here.radius, t,
                  x)[2]


@kernel
def opening(rules, here, table, poses, courses, s, t, x, v, n):
    """
    Acceleration of the gap without forces, and the velocity relative to the collider.

    Returns
    -------
    g : float [m/s^2]
        To which n.f and the normal forces add.
    w : (3,) tuple of float [m/s]

    """
    c, face = s // FACES, s % FACES
    w = subtract(v, material_velocity(courses, poses, here, c, t, x))
    g = bend_of(rules, here, table, poses, courses, c, face, t, x, n, w)
    return g - dot(n, frame_acceleration(courses, poses, here, c, t, x, w)), w


@inlined
def _friction(dry, wet, table, c, w, along, n):
    """Give the force of a surface for N = 1: normal, and friction against w or a first slip."""
    d = n
    if wet is not None:
        d = add_scaled(d, -table[c, WET], w)
    if dry is not None:
        slip = along if dot(along, along) > 0.0 else w
        speed = length(slip)
        if speed > 0.0:
            d = add_scaled(d, -table[c, KINETIC] / speed, slip)
    return d


@inlined
def solve(a, b, c, right):
    """Solve the system with columns a, b, c by Cramer's rule; NaN or infinite if singular."""
    bc = cross(b, c)
    size = dot(a, bc)
    return (dot(right, bc) / size, dot(a, cross(right, c)) / size,
            dot(a, cross(b, right)) / size)


@kernel
def normal_forces(holds, n0, n1, n2, d0, d1, d2, g0, g1, g2):
    """
    Give the normal forces that keep the gaps of up to three surfaces at zero.

    Parameters
    ----------
    holds : (3,) tuple of int
        Surfaces, NONE from the first free seat on.
    n0, n1, n2 : (3,) tuple of float [-]
        Normals.
    d0, d1, d2 : (3,) tuple of float [-]
        Forces for a normal force of 1.
    g0, g1, g2 : float [m/s^2]
        Accelerations of the gaps without these.

    Returns
    -------
    forces : (3,) tuple of float [m/s^2]

    """
    if holds[1] == NONE:
        return (-g0 / dot(n0, d0), 0.0, 0.0)
    if holds[2] == NONE:
        a, b, c, d = dot(n0, d0), dot(n0, d1), dot(n1, d0), dot(n1, d1)
        size = a * d - b * c
        return ((b * g1 - d * g0) / size, (c * g0 - a * g1) / size, 0.0)
    return solve((dot(n0, d0), dot(n1, d0), dot(n2, d0)), (dot(n0, d1), dot(n1, d1), dot(n2, d1)),
                 (dot(n0, d2), dot(n1, d2), dot(n2, d2)), (-g0, -g1, -g2))


@inlined
def still_speed(courses, poses, here, c, x, v):
    """Speed [m/s] relative to a collider that is only rounding."""
    arm = largest(x) + largest(origin(poses, here.start, c))
    return 2.0 * ROUNDING * (largest(v) + spin_rate(courses, here, c) * arm)


@kernel
def _first_slip(dry, forces, here, table, poses, courses, holds, t, x, v, f, w, n0, n1, n2, g0,
                g1, g2):
    """
    Give the direction in which a particle begins to slide; zero where it is that of w.

    Friction turns the velocity of a slow slide into the direction of the drive within w / (mu N),
    which is stiff just after a particle has broken away. For a blink it is taken as turned.
    """
    if dry is not None:
        if length(w) <= forces.blink * (length(f) + abs(g0)):
            normal = normal_forces(holds, n0, n1, n2, n0, n1, n2, g0, g1, g2)
            push = add_scaled(add_scaled(add_scaled(f, normal[0], n0), normal[1], n1), normal[2],
                              n2)
            c, grip = holds[0] // FACES, 0.0
            push = subtract(push, frame_acceleration(courses, poses, here, c, t, x, ZERO))
            for k in range(3):
                if holds[k] != NONE:
                    grip += table[holds[k] // FACES, KINETIC] * normal[k]
            still = length(w) <= 2.0 * still_speed(courses, poses, here, c, x, v)
            if still or (dot(w, push) > 0.0 and length(push) > grip):
                return push
    return ZERO


@kernel
def held(rules, forces, here, table, poses, courses, holds, t, x, v):
    """
    Acceleration of a particle that slides along the surfaces that hold it, and their forces.

    Parameters
    ----------
    rules, forces, here, table, poses, courses
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
    f = pull(forces, v)
    if holds[0] == NONE:
        return f, ZERO
    n0 = normal_at(rules, here, table, poses, courses, holds[0], t, x)
    g0, w0 = opening(rules, here, table, poses, courses, holds[0], t, x, v, n0)
    n1, g1, w1, n2, g2, w2 = n0, 0.0, ZERO, n0, 0.0, ZERO
    if holds[1] != NONE:
        n1 = normal_at(rules, here, table, poses, courses, holds[1], t, x)
        g1, w1 = opening(rules, here, table, poses, courses, holds[1], t, x, v, n1)
    if holds[2] != NONE:
        n2 = normal_at(rules, here, table, poses, courses, holds[2], t, x)
        g2, w2 = opening(rules, here, table, poses, courses, holds[2], t, x, v, n2)
    g0, g1, g2 = g0 + dot(n0, f), g1 + dot(n1, f), g2 + dot(n2, f)
    push = _first_slip(rules.dry, forces, here, table, poses, courses, holds, t, x, v, f, w0, n0,
                       n1, n2, g0, g1, g2)
    d0 = _friction(rules.dry, rules.wet, table, holds[0] // FACES, w0, push, n0)
    d1, d2 = n1, n2
    if holds[1] != NONE:
        d1 = _friction(rules.dry, rules.wet, table, holds[1] // FACES, w1, push, n1)
    if holds[2] != NONE:
        d2 = _friction(rules.dry, rules.wet, table, holds[2] // FACES, w2, push, n2)
    normal = normal_forces(holds, n0, n1, n2, d0, d1, d2, g0, g1, g2)
    a = add_scaled(add_scaled(add_scaled(f, normal[0], d0), normal[1], d1), normal[2], d2)
    return a, normal


@kernel
def square_up(n0, n1, n2, holds):
    """
    Give directions at right angles, each along the surfaces before it (Gram and Schmidt).

    However acute the corner, a move along the second one does not change the gap to the first. Of
    two surfaces the third direction is that of their edge; zero where normals are parallel.
    """
    d1 = add_scaled(n1, -dot(n0, n1), n0)
    d1 = add_scaled(d1, -dot(n0, d1), n0)
    size = length(d1)
    if holds[1] == NONE or size <= BALANCED:
        return n0, ZERO, ZERO
    d1 = (d1[0] / size, d1[1] / size, d1[2] / size)
    return n0, d1, cross(n0, d1)


@kernel
def _rests_on(rules, table, holds, n0, n1, n2, need):
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
            grip += table[holds[k] // FACES, STATIC] * normal[k]
    _, d1, d2 = square_up(n0, n1, n2, holds)
    rest = 0.0
    if holds[1] == NONE:
        rest = length(add_scaled(need, -dot(n0, need), n0))
    elif holds[2] == NONE:
        rest = abs(dot(d2, need))
    return rest <= grip + BALANCED * length(need)


@inlined
def _seats(a, b, c):
    return (a, b, c)


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
def can_rest(rules, forces, here, table, poses, courses, holds, t, x):
    """Whether a particle that rests on the first of some surfaces goes on doing so at a time."""
    c = holds[0] // FACES
    v = material_velocity(courses, poses, here, c, t, x)
    need = subtract(frame_acceleration(courses, poses, here, c, t, x, ZERO), pull(forces, v))
    n0 = normal_at(rules, here, table, poses, courses, holds[0], t, x)
    n1, n2 = n0, n0
    if holds[1] != NONE:
        n1 = normal_at(rules, here, table, poses, courses, holds[1], t, x)
    if holds[2] != NONE:
        n2 = normal_at(rules, here, table, poses, courses, holds[2], t, x)
    return _rests_on(rules, table, holds, n0, n1, n2, need)


@inlined
def pull_slack(forces, a):
    """Give the normal force [m/s^2] that is only rounding."""
    return BALANCED * (length(a) + length(forces.gravity))


@kernel
def _opens(rules, forces, here, table, poses, courses, holds, other, t, x, v, a, slack):
    """Whether a touched surface that does not hold opens by more than slack at acceleration a."""
    if other == NONE or other == holds[0] or other == holds[1] or other == holds[2]:
        return True
    n = normal_at(rules, here, table, poses, courses, other, t, x)
    g, _ = opening(rules, here, table, poses, courses, other, t, x, v, n)
    return g + dot(n, a) > slack * BALANCED * (length(a) + length(forces.gravity))


@kernel
def _slides_on(rules, forces, here, table, poses, courses, holds, touch, t, x, v):
    """
    Whether sliding on `holds` needs no pull, and the other touched surfaces open.

    A surface with neither push nor pull holds: the next moment decides.
    """
    a, normal = held(rules, forces, here, table, poses, courses, holds, t, x, v)
    slack = 1.0 if holds[0] == NONE else -1.0
    for k in range(3):
        if holds[k] != NONE and not normal[k] >= -pull_slack(forces, a):
            return False
    for k in range(3):
        if not _opens(rules, forces, here, table, poses, courses, holds, touch[k], t, x, v, a,
                      slack):
            return False
    return True


@kernel
def _keeps_still(rules, forces, here, table, poses, courses, holds, touch, t, x, v):
    """Whether resting on `holds` is possible, and the other touched surfaces let it."""
    c = holds[0] // FACES
    for k in range(1, 3):
        if holds[k] != NONE and not nearly_at_rest(forces, courses, poses, here,
                                                   holds[k] // FACES, t, x, v):
            return False
    if not can_rest(rules, forces, here, table, poses, courses, holds, t, x):
        return False
    a = frame_acceleration(courses, poses, here, c, t, x, ZERO)
    for k in range(3):
        if not _opens(rules, forces, here, table, poses, courses, holds, touch[k], t, x, v, a,
                      -1.0):
            return False
    return True


@inlined
def _choice(touch, k):
    """Give the k-th choice of the touched surfaces that may hold: singles, pairs, all three."""
    if k < 3:
        return _seats(touch[k], NONE, NONE)
    if k < 6:
        return _seats(touch[0 if k < 5 else 1], touch[1 if k == 3 else 2], NONE)
    return touch


@kernel
def choose_mode(rules, forces, here, table, poses, courses, released, t, x, v):
    """
    How a particle that approaches nothing goes on: it flies, rests or slides, and on what.

    Parameters
    ----------
    rules, forces, here, table, poses, courses
        As in exact.py.
    released : int
        Surface that does not hold it any more, or NONE.
    t, x, v
        Time, position and velocity.

    Returns
    -------
    mode : int
        FLIES, RESTS or SLIDES.
    holds : (3,) tuple of int
        Surfaces; the first choice, in the order of colliders, that needs no pull.

    """
    touch, seat = NOBODY, 0
    for count in range(4):
        s, _ = touched(rules, here, table, poses, courses, t, x, v, count)
        if s == NONE or seat == 3:
            break
        if s != released:
            touch = (s if seat == 0 else touch[0], s if seat == 1 else touch[1],
                     s if seat == 2 else touch[2])
            seat += 1
    if seat == 0 or _slides_on(rules, forces, here, table, poses, courses, NOBODY, touch, t, x, v):
        return FLIES, NOBODY
    for k in range(7):
        holds = _choice(touch, k)
        if holds[0] == NONE or (k > 2 and holds[1] == NONE) or (k == 6 and holds[2] == NONE):
            continue
        if nearly_at_rest(forces, courses, poses, here, holds[0] // FACES, t, x, v) \
                and _keeps_still(rules, forces, here, table, poses, courses, holds, touch, t, x,
                                 v):
            return RESTS, holds
    for k in range(7):
        holds = _choice(touch, k)
        if holds[0] == NONE or (k > 2 and holds[1] == NONE) or (k == 6 and holds[2] == NONE):
            continue
        if _slides_on(rules, forces, here, table, poses, courses, holds, touch, t, x, v):
            return SLIDES, holds
    return RESTS, touch


@inlined
def resting_place(courses, poses, here, c, x, since, t):
    """Position and velocity at time t of a particle that has rested on a collider since."""
    x = carried(courses, poses, here, c, x, since, t)
    return x, material_velocity(courses, poses, here, c, t, x)


@kernel
def onto_surfaces(rules, here, table, poses, courses, holds, t, x, v):
    """Take rounding out of a particle on surfaces: gaps to zero, velocity along them."""
    for _ in range(2):
        n0 = n1 = n2 = (0.0, 0.0, 1.0)
        if holds[0] != NONE:
            n0 = normal_at(rules, here, table, poses, courses, holds[0], t, x)
        if holds[1] != NONE:
            n1 = normal_at(rules, here, table, poses, courses, holds[1], t, x)
        d = square_up(n0, n1, n2, holds)
        for k in range(3):
            if holds[k] != NONE:
                c, face = holds[k] // FACES, holds[k] % FACES
                gap, slope, n = gap_to(rules, here, table, poses, courses, c, face,
                                       table[c, SIDE], here.radius, t, x)
                along = dot(n, d[k])
                if abs(along) > BALANCED:
                    x = add_scaled(x, -gap / (slope * along), d[k])
                    w = subtract(v, material_velocity(courses, poses, here, c, t, x))
                    v = add_scaled(v, -dot(w, n) / along, d[k])
    return x, v
