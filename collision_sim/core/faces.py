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
Which face of a box or a cylinder answers a particle that ends inside it.

The nearest face need not be the one that the particle came through, and of colliders side by side
(tiles, bricks, rods end to end) it may be one that nobody can come through. The rule:

- A face is no face where another collider covers it, which begins where that leans on it.
- A particle that starts outside is answered by the face that it crossed last, since it is inside
  from there on; of those that it crossed, since the others it has not come through.
- Where all that it crossed are covered, by the one crossed last: it came past a concave corner.
- A particle that starts inside is answered by the nearest face.

A ball whose centre stays outside is answered by the nearest point of the solid, as all balls are
by the other shapes; where several colliders touch it, detection.py tells which of them count.
"""

from math import sqrt

from collision_sim.core.jit import inlined, kernel
from collision_sim.core.motion import chord_velocity
from collision_sim.core.rules import NONE, ROUNDING
from collision_sim.core.shapes import (arm_distance, BOX, CAPSULE, CYLINDER, KIND, seam_width,
                                       SIDE, signed_distance, SIZE)
from collision_sim.core.trajectory import relative_motion
from collision_sim.core.vectors import (add, add_scaled, dot, largest, length, origin, rotate,
                                        rotate_back, subtract, turned)

FLUSH = 1e-9            # relative: how far before a face it is looked whether another covers it
FLAT = 0.999            # cosine of the angle between faces from which they lie flat on each other
PAST = 2.0              # time of crossing of a face that is not crossed


@inlined
def _how_many_faces(table, c):
    """Count the faces: +x, -x, +y, -y, +z, -z of a box; the side, +z, -z of a cylinder."""
    return 6 if table[c, KIND] == BOX else 3


@kernel
def _unit(axis, sign):
    """Give a unit vector along an axis."""
    return (sign if axis == 0 else 0.0, sign if axis == 1 else 0.0, sign if axis == 2 else 0.0)


@kernel
def face_at(table, c, face, q):
    """Height [m] of a point over a face, and the normal of the face below it, in its frame."""
    if table[c, KIND] == BOX:
        axis, sign = face // 2, 1.0 - 2.0 * (face % 2)
        return sign * q[axis] - table[c, SIZE + axis], _unit(axis, sign)
    if face > 0:
        sign = 3.0 - 2.0 * face
        return sign * q[2] - table[c, SIZE + 1], (0.0, 0.0, sign)
    rho = length((q[0], q[1], 0.0))
    return rho - table[c, SIZE], ((q[0] / rho, q[1] / rho, 0.0) if rho > 0.0 else (1.0, 0.0, 0.0))


@inlined
def face_towards(table, c, n):
    """Give the face whose normal is nearest to a direction, in the frame of the collider."""
    a, b, d = abs(n[0]), abs(n[1]), abs(n[2])
    if table[c, KIND] == BOX:
        axis = 0 if a >= b and a >= d else (1 if b >= d else 2)
        return 2 * axis + (0 if n[axis] > 0.0 else 1)
    return 0 if d < 0.5 * sqrt(2.0) else (1 if n[2] > 0.0 else 2)


@kernel
def face_below(table, poses, row, c, x, n):
    """
    Face of a box, cylinder or capsule (its side) that a point is over, NONE at an edge or a cap.

    Parameters
    ----------
    table, poses, row, c
        As in shapes.signed_distance.
    x, n : (3,) tuple of float [m], [-]
        The point and the normal of the nearest point of the collider, world frame.

    """
    if table[c, SIDE] > 0.0:
        kind, m = table[c, KIND], rotate_back(poses, row, c, n)
        if kind == BOX and largest(m) > 1.0 - FLUSH:
            return face_towards(table, c, m)
        if kind == CYLINDER and (abs(m[2]) > 1.0 - FLUSH or abs(m[2]) < FLUSH):
            return face_towards(table, c, m)
        if kind == CAPSULE and abs(rotate_back(poses, row, c, subtract(
                x, origin(poses, row, c)))[2]) <= table[c, SIZE + 1]:
            return 0
    return NONE


@kernel
def height_over(table, poses, row, c, face, x):
    """
    Height [m] of a point over a face that is taken to go on beyond its edges, and the normal.

    A particle that slides on a face does not see the edges before it gets there.
    """
    q = rotate_back(poses, row, c, subtract(x, origin(poses, row, c)))
    height, m = face_at(table, c, face, q)
    return height, rotate(poses, row, c, m)


@kernel
def _crossing(table, c, face, q0, q1, radius):
    """Time from 0 to 1 at which a way comes to a face from outside; 0 if it starts behind it."""
    h0, h1 = face_at(table, c, face, q0)[0] - radius, face_at(table, c, face, q1)[0] - radius
    if h0 <= 0.0:
        return 0.0
    if table[c, KIND] == BOX or face > 0:
        return h0 / (h0 - h1)
    dx, dy, r = q1[0] - q0[0], q1[1] - q0[1], table[c, SIZE] + radius
    b, rest = -(dx * q0[0] + dy * q0[1]), h0 * (h0 + 2.0 * r)
    return rest / (b + sqrt(max(b * b - (dx * dx + dy * dy) * rest, 0.0)))


@kernel
def drawn_in(table, c, face, q, margin):
    """Point of a face below q, at least `margin` [m] from its edges, in its frame."""
    h, n = face_at(table, c, face, q)
    x, y, z = add_scaled(q, -h, n)
    if table[c, KIND] == BOX:
        a, b, d = (max(table[c, SIZE] - margin, 0.0), max(table[c, SIZE + 1] - margin, 0.0),
                   max(table[c, SIZE + 2] - margin, 0.0))
        axis = face // 2
        return (x if axis == 0 else min(max(x, -a), a), y if axis == 1 else min(max(y, -b), b),
                z if axis == 2 else min(max(z, -d), d))
    if face == 0:
        half = max(table[c, SIZE + 1] - margin, 0.0)
        return x, y, min(max(z, -half), half)
    rho, most = length((x, y, 0.0)), max(table[c, SIZE] - margin, 0.0)
    scale = most / rho if rho > most else 1.0
    return scale * x, scale * y, z


@inlined
def _close_in(world, here, c, k, n, tau, x0, margin):
    """
    Whether two colliders come together at the start of a step, along normal n of the first.

    What they meet at is then not a seam: a particle in between is pressed.
    """
    poses, motion = world.poses, world.motion
    if tau > 0.0:
        return False
    dt = world.rules.flight.dt
    one = chord_velocity(motion, poses, here.step, here.start, c, x0, dt)
    other = chord_velocity(motion, poses, here.step, here.start, k, x0, dt)
    return dt * dot(subtract(one, other), rotate(poses, here.start, c, n)) > margin


@inlined
def _place_at(world, here, c, tau, q):
    """Where a point in the frame of a collider is in the world, at a time of the step."""
    poses = world.poses
    back, axis, angle = relative_motion(world.motion, here.step, c, (0.0, 0.0, 0.0))
    arm = rotate(poses, here.start, c, q)
    if angle > 0.0:
        arm = turned(axis, angle * tau, arm)
    return add(add_scaled(origin(poses, here.start, c), -tau, back), arm)


@inlined
def _distance_at(world, here, c, tau, point):
    """Signed distance [m] of a point of the world to a collider, at a time of the step."""
    poses = world.poses
    move, axis, angle = relative_motion(world.motion, here.step, c, (0.0, 0.0, 0.0))
    arm = add_scaled(subtract(point, origin(poses, here.start, c)), tau, move)
    if angle > 0.0:
        arm = turned(axis, -angle * tau, arm)
    return arm_distance(world.rules.present, world.table, poses, here.start, c, arm)[0]


@inlined
def leans(depth, deeper, margin):
    """
    Whether a collider that is as near to a face as a seam meets it at an acute angle.

    It does not cover the face then, however acute that is: the face begins there. In what lies
    flat on a face a point is as much deeper [m] as it is further from the face.
    """
    return deeper - depth < FLAT * margin


@kernel
def is_covered(world, here, c, face, q, tau, x0, starts_inside, far):
    """
    Whether another collider covers a face at the point below q, or comes as near as a seam.

    Parameters
    ----------
    world, here
        As in response.resolve.
    c, face : int
        Collider and face.
    q : (3,) tuple of float [m]
        In the frame of the collider.
    tau : float [-]
        When, from 0 to 1 over the step.
    x0 : (3,) tuple of float [m]
        Where the particle starts the step.
    starts_inside : bool
        Whether that is inside the collider; if not, one that it starts inside of covers nothing,
        and neither does one that comes towards it from there.
    far : bool
        Whether the face may be beyond what the particle may touch in the step, so that all
        colliders are looked at.

    """
    table, poses = world.table, world.poses
    place = origin(poses, here.start, c)
    margin = FLUSH * (largest(place) + table[c, SIZE] + table[c, SIZE + 1] + table[c, SIZE + 2])
    p = drawn_in(table, c, face, q, 2.0 * margin)
    n = face_at(table, c, face, p)[1]
    probe = _place_at(world, here, c, tau, add_scaled(p, margin, n))
    for m in range(table.shape[0] if far else here.chosen.shape[0]):
        k, depth = (m if far else here.chosen[m]), 0.0
        if k != c:
            depth = -_distance_at(world, here, k, tau, probe)
        if depth >= 0.5 * margin:
            if depth <= 2.0 * margin:
                further = _place_at(world, here, c, tau, add_scaled(p, 2.0 * margin, n))
                if leans(depth, -_distance_at(world, here, k, tau, further),
                         margin):
                    continue
            gap = signed_distance(world.rules.present, table, poses, here.start, k, x0)[0]
            rounding = ROUNDING * (largest(x0) + largest(place) + table[k, SIZE])
            if starts_inside or (gap >= -rounding and not _close_in(world, here, c, k, n, tau, x0,
                                                                    margin)):
                return True
    return False


@kernel
def nearest_face(world, here, row, c, x):
    """
    Height over the nearest face that nobody covers, and its normal, for a point in a collider.

    Parameters
    ----------
    world, here, c
        As in `is_covered`.
    row : int
        Row of poses at the start or at the end of the step.
    x : (3,) tuple of float [m]
        World frame; inside the collider or on it.

    Returns
    -------
    height : float [m]
        Less the radius of the particle.
    n : (3,) tuple of float [-]
        World frame.

    """
    table, poses = world.table, world.poses
    q = rotate_back(poses, row, c, subtract(x, origin(poses, row, c)))
    taken, first, tau = 0, NONE, 0.0 if row == here.start else 1.0
    inside = False
    while True:
        face, height = NONE, 0.0
        for f in range(_how_many_faces(table, c)):
            h = face_at(table, c, f, q)[0]
            if not taken >> f & 1 and (face == NONE or h > height):
                face, height = f, h
        if first == NONE:
            inside = height < -seam_width(table, c, origin(poses, row, c))
        if face == NONE or not is_covered(world, here, c, face, q, tau, x, inside,
                                          inside or taken != 0):
            break
        taken, first = taken | 1 << face, (face if first == NONE else first)
    height, n = face_at(table, c, first if face == NONE else face, q)
    return height - here.radius, rotate(poses, row, c, n)


@kernel
def goes_through(world, here, c, face, x0, x1):
    """
    Whether a way from x0 to x1 that comes in by a face ends beyond the opposite one, or the side.

    Then it does not just pass over another face, that of a tile which is flush.
    """
    table, poses = world.table, world.poses
    q0 = rotate_back(poses, here.start, c, subtract(x0, origin(poses, here.start, c)))
    q1 = rotate_back(poses, here.end, c, subtract(x1, origin(poses, here.end, c)))
    slack, outside = seam_width(table, c, origin(poses, here.end, c)), False
    for f in range(_how_many_faces(table, c)):
        h1 = face_at(table, c, f, q1)[0] - here.radius
        outside = outside or h1 >= slack
        if f != face and h1 >= -slack and face_at(table, c, f, q0)[0] - here.radius >= -slack:
            return False
    return outside


@kernel
def crossed_face(world, here, c, x0, x1):
    """
    Answering face of a particle that starts outside a collider and ends in it or on it.

    Parameters
    ----------
    world, here, c
        As in `is_covered`.
    x0, x1 : (3,) tuple of float [m]
        Start and end of the step, world frame.

    Returns
    -------
    height : float [m]
        At the end, less the radius of the particle; not negative: it has not come in.
    n : (3,) tuple of float [-]
        World frame, at the end.
    time : float [-]
        When it comes to that face, from 0 to 1, or PAST.

    """
    table, poses = world.table, world.poses
    q0 = rotate_back(poses, here.start, c, subtract(x0, origin(poses, here.start, c)))
    q1 = rotate_back(poses, here.end, c, subtract(x1, origin(poses, here.end, c)))
    slack = seam_width(table, c, origin(poses, here.end, c))
    taken, first, first_time = 0, NONE, PAST
    while True:
        face, time, height = NONE, 0.0, 0.0
        for f in range(_how_many_faces(table, c)):
            h = face_at(table, c, f, q1)[0] - here.radius
            if taken >> f & 1 or face_at(table, c, f, q0)[0] - here.radius < -slack:
                continue
            t = PAST if h >= 0.0 else _crossing(table, c, f, q0, q1, here.radius)
            if face == NONE or t > time or (t == time and h > height):
                face, time, height = f, t, h
        if face == NONE and first == NONE:
            return *nearest_face(world, here, here.end, c, x1), 0.0
        if face == NONE:
            face, time = first, first_time
            break
        at, when = q1, 1.0
        if taken == 0:
            when = min(time, 1.0)
            at = add_scaled(q0, when, subtract(q1, q0))
        if not is_covered(world, here, c, face, at, when, x0, False, taken != 0):
            break
        if first == NONE or first_time == PAST > time:      # it is just not beyond a seam
            first, first_time = face, time
        taken |= 1 << face
    height, n = face_at(table, c, face, q1)
    return height - here.radius, rotate(poses, here.end, c, n), time
