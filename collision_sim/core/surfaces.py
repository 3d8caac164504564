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
Surfaces of colliders: gaps that are smooth functions of the place, for the event-driven method.

From outside a shape has surface 0, whose gap is the signed distance less the radius of the
particle: convex. Shapes around a particle (`inside`) have one for every face, so that edges are
where two surfaces meet. A face of a box or cylinder from outside, continued beyond its ends, is
1 plus that number: a particle that slides on it does not see the edges before it gets there.
The gap to a round face is (R^2 - rho^2) / (2 R), with rho the distance from its axis or centre
and R its radius less that of the particle: that is R - rho near the surface, and has bounded
second derivatives everywhere.
A surface is named by one number, FACES times the collider plus the face.
"""

from math import inf
from typing import NamedTuple, Optional

from collision_sim.core.courses import centre, material_velocity, move, spin_axis, spin_rate
from collision_sim.core.faces import drawn_in, face_at, face_towards, FLUSH, leans
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.rules import Here
from collision_sim.core.shapes import (BOX, CAPSULE, CYLINDER, has_faces, KIND, local_distance,
                                       PLANE, SIDE, SIZE)
from collision_sim.core.trajectory import TOUCHING
from collision_sim.core.vectors import (add, add_scaled, dot, largest, length, origin, rotate,
                                        rotate_back, subtract, turned)
import numpy as np

STEEP = 0.5             # cosine below which two normals are of faces with an edge in between
FACES = 8               # room for the faces of a collider


class Spot(NamedTuple):
    """
    As rules.Here, and `way` [m]: the particle's way in a step at its velocity.

    Its place at a time within the step is known to the rounding of that way.
    """

    step: int
    start: int
    end: int
    block: int
    particle: int
    radius: float
    chosen: Optional[np.ndarray]
    answers: Optional[np.ndarray]
    only: Optional[np.ndarray]
    way: float


@inlined
def as_here(spot):
    """Return a Spot as rules.Here."""
    return Here(spot.step, spot.start, spot.end, spot.block, spot.particle, spot.radius,
                spot.chosen, spot.answers, spot.only)


@inlined
def faces(table, c, side):
    """Count the surfaces of a collider, seen from outside (+1) or inside (-1)."""
    if side > 0.0:
        return 1
    if table[c, KIND] == BOX:
        return 6
    return 3 if table[c, KIND] == CYLINDER else 1


@kernel
def _round_gap(arm, space):
    """Gap, slope and normal inside a sphere, capsule or cylinder with `space` around its axis."""
    rho = length(arm)
    n = (-arm[0] / rho, -arm[1] / rho, -arm[2] / rho) if rho > 0.0 else (0.0, 0.0, 1.0)
    if space <= 0.0:
        return space - rho, 1.0, n
    return 0.5 * (space - rho) * (1.0 + rho / space), rho / space, n


@kernel
def _inner_gap(kind, size, face, q, radius):
    """Gap, slope and normal of one face of a shape around the particle."""
    if kind == BOX or (kind == CYLINDER and face > 0):
        axis, sign = (face // 2, 1.0 - 2.0 * (face % 2)) if kind == BOX else (2, 2.0 * face - 3.0)
        half = size[1] if kind == CYLINDER else size[axis]
        n = (-sign if axis == 0 else 0.0, -sign if axis == 1 else 0.0,
             -sign if axis == 2 else 0.0)
        return half - radius - sign * q[axis], 1.0, n
    z = q[2]
    if kind == CYLINDER:
        z = 0.0
    elif kind == CAPSULE:
        z = q[2] - min(max(q[2], -size[1]), size[1])
    return _round_gap((q[0], q[1], z), size[0] - radius)


@inlined
def body_frame(courses, world, here, c, t, a):
    """Turn a world vector into the frame of a collider at time t [s]."""
    if move(courses):
        spin = spin_rate(courses, here, c)
        if spin > 0.0:
            a = turned(spin_axis(courses, here, c), -spin * t, a)
    return rotate_back(world.poses, here.start, c, a)


@inlined
def world_frame(courses, poses, here, c, t, a):
    """Turn a vector in the frame of a collider at time t [s] into the world frame."""
    a = rotate(poses, here.start, c, a)
    if move(courses):
        spin = spin_rate(courses, here, c)
        if spin > 0.0:
            a = turned(spin_axis(courses, here, c), spin * t, a)
    return a


@kernel
def gap_to(world, here, courses, c, face, side, radius, t, x):
    """
    Gap between a particle and a surface.

    Parameters
    ----------
    world, here, courses
        As in exact.py.
    c, face : int
        Collider and face.
    side : float [-]
        +1 from outside, -1 from inside.
    radius : float [m]
        Of the particle.
    t : float [s]
        Since the start of the step.
    x : (3,) tuple of float [m]
        Of the particle, world frame.

    Returns
    -------
    gap : float [m]
        Negative behind the surface.
    slope : float [-]
        The gap changes at slope times the normal velocity.
    n : (3,) tuple of float [-]
        Unit normal towards the particle's side, world frame.

    """
    table, poses = world.table, world.poses
    arm = subtract(x, centre(courses, poses, here, c, t))
    q = body_frame(courses, world, here, c, t, arm)
    size = (table[c, SIZE], table[c, SIZE + 1], table[c, SIZE + 2])
    if side > 0.0 and face > 0:
        gap, slope, n = _inner_gap(table[c, KIND], size, face - 1, q, -radius)
        n = world_frame(courses, poses, here, c, t, n)
        return -gap, slope, (-n[0], -n[1], -n[2])
    if side > 0.0:
        gap, n = local_distance(table[c, KIND], q, size)
        return gap - radius, 1.0, world_frame(courses, poses, here, c, t, n)
    gap, slope, n = _inner_gap(table[c, KIND], size, face, q, radius)
    return gap, slope, world_frame(courses, poses, here, c, t, n)


@inlined
def touching_depth(world, here, c, x):
    """Gap [m] below which a particle touches."""
    table, poses = world.table, world.poses
    return TOUCHING * (largest(x) + largest(origin(poses, here.start, c)) + table[c, SIZE]
                       + here.radius + here.way)


@inlined
def is_flat(table, c, face, side):
    """Whether the gap of a surface is linear in the place, in the frame of the collider."""
    kind, own = table[c, KIND], face if side < 0.0 else face - 1
    return kind == PLANE or (own >= 0 and (kind == BOX or (kind == CYLINDER and own > 0)))


@kernel
def face_beside(world, here, courses, c, radius, t, x, w, slack, rounding):
    """
    Face of a box or cylinder that a particle at its edge goes along or away from, as a surface.

    A convex solid is behind the plane of each of its faces: a particle that is not behind one, and
    does not approach it, does not come inside. So there is no bump at the seam of two flush boxes.
    A face that another collider covers is none (faces.py): nobody falls into that seam.

    Parameters
    ----------
    world, here, courses, c, radius, t, x
        As in `gap_to`.
    w : (3,) tuple of float [m/s]
        Velocity relative to the collider.
    slack, rounding : float [m], [m/s]
        Gap and speed that are only rounding.

    Returns
    -------
    face : int
        As in `gap_to`; 0 if there is none.

    """
    table = world.table
    kind = table[c, KIND]
    if table[c, SIDE] > 0.0 and (kind == BOX or kind == CYLINDER):
        for face in range(1, faces(table, c, -1.0) + 1):
            gap, _, n = gap_to(world, here, courses, c, face, 1.0, radius, t, x)
            if gap >= -slack and dot(w, n) >= -rounding and not _is_covered(world, here, courses,
                                                                            c, face - 1, t, x):
                return face
    return 0


@kernel
def runs_off(world, here, courses, c, t, x, w, n, slack, rounding):
    """
    Whether a point on a face of a box or cylinder, with the normal n, leaves it over its edge now.

    There is nothing beyond that a point could slide on; a ball goes on to the round of the edge.
    The other arguments are as in `face_beside`.
    """
    table = world.table
    if here.radius == 0.0 and has_faces(table, c):
        for face in range(1, faces(table, c, -1.0) + 1):
            gap, _, m = gap_to(world, here, courses, c, face, 1.0, 0.0, t, x)
            if abs(gap) <= slack and dot(w, m) > rounding and dot(m, n) < STEEP:
                return True
    return False


@kernel
def open_face(world, here, courses, c, radius, t, x, n, slack):
    """
    Face of a box or cylinder that a particle touches at an edge, where the nearest is covered.

    Parameters
    ----------
    world, here, courses, c, radius, t, x
        As in `gap_to`.
    n : (3,) tuple of float [-]
        Normal of the nearest one, world frame.
    slack : float [m]
        Gap that is only rounding.

    Returns
    -------
    face : int
        As in `gap_to`; 0 if the nearest is not covered, or no other is touched.

    """
    table = world.table
    if has_faces(table, c):
        m = body_frame(courses, world, here, c, t, n)
        nearest = face_towards(table, c, m)
        if _is_covered(world, here, courses, c, _own(table, c, nearest), t, x):
            for face in range(1, faces(table, c, -1.0) + 1):
                gap, _, _ = gap_to(world, here, courses, c, face, 1.0, radius, t, x)
                if abs(gap) <= slack and not _is_covered(world, here, courses, c, face - 1, t, x):
                    return face
    return 0


@inlined
def _own(table, c, face):
    """Turn the number of a face of a box or cylinder from that of faces.py, or to it."""
    return 3 - face if table[c, KIND] == CYLINDER and face > 0 else face


@kernel
def _is_covered(world, here, courses, c, own, t, x):
    """Whether another collider covers a face of a box or a cylinder below a particle."""
    table, poses = world.table, world.poses
    place = centre(courses, poses, here, c, t)
    q = body_frame(courses, world, here, c, t, subtract(x, place))
    face = _own(table, c, own)
    margin = FLUSH * (largest(place) + table[c, SIZE] + table[c, SIZE + 1] + table[c, SIZE + 2])
    p = drawn_in(table, c, face, q, 2.0 * margin)
    before = world_frame(courses, poses, here, c, t, add_scaled(
        p, margin, face_at(table, c, face, p)[1]))
    n = world_frame(courses, poses, here, c, t, face_at(table, c, face, p)[1])
    for k in range(table.shape[0]):
        if k != c:
            arm = add(before, subtract(place, centre(courses, poses, here, k, t)))
            depth = _depth_of(world, here, courses, k, t, arm)
            if depth >= 0.5 * margin and (depth > 2.0 * margin or not leans(
                    depth, _depth_of(world, here, courses, k, t,
                                     add_scaled(arm, margin, n)), margin)):
                return True
    return False


@inlined
def _depth_of(world, here, courses, k, t, arm):
    """Depth [m] in collider k of what is at `arm` from its position, world frame."""
    table = world.table
    size = (table[k, SIZE], table[k, SIZE + 1], table[k, SIZE + 2])
    gap, _ = local_distance(table[k, KIND], body_frame(courses, world, here, k, t, arm),
                            size)
    return -table[k, SIDE] * gap


@inlined
def is_end(table, c, face, edge):
    """Whether a face of a box or cylinder ends at another one, by their numbers from inside."""
    if table[c, KIND] == BOX:
        return edge // 2 != face // 2
    return (edge == 0) == (face > 0)


@kernel
def face_of(world, here, courses, s, t, x, v):
    """
    Give the surface of the face of a box or cylinder that a particle is on from outside.

    Parameters
    ----------
    world, here, courses
        As in exact.py.
    s : int
        Surface.
    t, x, v
        Time, position and velocity.

    Returns
    -------
    surface : int
        s itself for all other surfaces, and where it is beyond the end of a face or about to
        leave it.

    """
    table = world.table
    c, kind = s // FACES, table[s // FACES, KIND]
    if table[c, SIDE] < 0.0 or (kind != BOX and kind != CYLINDER) or s % FACES > 0:
        return s
    _, _, n = gap_to(world, here, courses, c, 0, 1.0, here.radius, t, x)
    m = body_frame(courses, world, here, c, t, n)
    axis = 0 if abs(m[0]) > 0.9 else (1 if abs(m[1]) > 0.9 else 2)
    face = 2 * axis + (0 if m[axis] > 0.0 else 1)
    if kind == CYLINDER:
        face = 0 if abs(m[2]) < 0.5 else (2 if m[2] > 0.0 else 1)
    w = subtract(v, material_velocity(courses, world.poses, here, c, t, x))
    slack = touching_depth(world, here, c, x)
    for edge in range(faces(table, c, -1.0)):
        if is_end(table, c, face, edge):
            gap, _, inward = gap_to(world, here, courses, c, edge, -1.0, 0.0, t, x)
            if gap < -slack or (gap <= slack and dot(w, inward) < 0.0):
                return s
    return FACES * c + 1 + face


@inlined
def _zone(a, half):
    """Where a coordinate is: 0 between -half and half, else 1 or 2."""
    return 0 if abs(a) <= half else (1 if a > 0.0 else 2)


@kernel
def region_of(world, here, courses, s, t, x):
    """
    Which part of a shape is nearest, where the curvature jumps from one to the next.

    Parameters
    ----------
    world, here, courses
        As in exact.py.
    s : int
        Surface.
    t : float [s]
        Since the start of the step.
    x : (3,) tuple of float [m]
        Of the particle, world frame.

    Returns
    -------
    region : int
        Of a capsule: side or cap; of a box or cylinder from outside: face, edge or corner.

    """
    table, poses = world.table, world.poses
    c, kind = s // FACES, table[s // FACES, KIND]
    q = body_frame(courses, world, here, c, t, subtract(x, centre(courses, poses, here, c, t)))
    if kind == CAPSULE:
        return _zone(q[2], table[c, SIZE + 1])
    if table[c, SIDE] < 0.0 or s % FACES > 0:
        return 0
    if kind == CYLINDER:
        return (_zone(length((q[0], q[1], 0.0)), table[c, SIZE])
                + 3 * _zone(q[2], table[c, SIZE + 1]))
    if kind == BOX:
        return (_zone(q[0], table[c, SIZE]) + 3 * _zone(q[1], table[c, SIZE + 1])
                + 9 * _zone(q[2], table[c, SIZE + 2]))
    return 0


@inlined
def _bend(across, rho):
    """Give the curvature term w_t^2 / rho; infinite at a sharp edge."""
    square = dot(across, across)
    if rho > 0.0:
        return square / rho
    return inf if square > 0.0 else 0.0


@kernel
def _tangential(w, n):
    s = dot(w, n)
    return (w[0] - s * n[0], w[1] - s * n[1], w[2] - s * n[2])


@inlined
def _beyond(overhang, speed, slack):
    """Whether a particle is past the end of a face, or at it and leaving."""
    return overhang > slack or (overhang >= -slack and speed > 0.0)


@kernel
def _box_bend(q, w, size, slack):
    """Curvature term outside a box: round about the edges and corners it is past."""
    gap, part, count = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0
    for k in range(3):
        sign = 1.0 if q[k] >= 0.0 else -1.0
        over = sign * q[k] - size[k]
        if _beyond(over, sign * w[k], slack):
            own = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
            over, count = max(over, 0.0), count + 1
            gap = (gap[0] + sign * over * own[0], gap[1] + sign * over * own[1],
                   gap[2] + sign * over * own[2])
            part = (part[0] + w[k] * own[0], part[1] + w[k] * own[1], part[2] + w[k] * own[2])
    rho = length(gap)
    if count < 2:
        return 0.0      # on a face
    if rho == 0.0:
        return _bend(part, rho)
    return _bend(_tangential(part, (gap[0] / rho, gap[1] / rho, gap[2] / rho)), rho)


@kernel
def _cylinder_bend(q, w, size, slack):
    """Curvature term outside a cylinder: on its side, flat on its ends, round about the rims."""
    rho = length((q[0], q[1], 0.0))
    e = (q[0] / rho, q[1] / rho, 0.0) if rho > 0.0 else (1.0, 0.0, 0.0)
    sign = 1.0 if q[2] >= 0.0 else -1.0
    outward, along = dot(w, e), sign * w[2]
    side, cap = rho - size[0], sign * q[2] - size[1]
    past_side, past_cap = _beyond(side, outward, slack), _beyond(cap, along, slack)
    turning = w[1] * e[0] - w[0] * e[1]
    if past_side and past_cap:
        side, cap = max(side, 0.0), max(cap, 0.0)
        d = length((side, cap, 0.0))
        if d == 0.0:
            return _bend((outward, along, 0.0), d)
        return (_bend(_tangential((outward, along, 0.0), (side / d, cap / d, 0.0)), d)
                + turning * turning * (side / d) / rho)
    if past_side or (side > cap and not past_cap):
        return turning * turning / rho if rho > 0.0 else 0.0
    return 0.0


@kernel
def bend_of(world, here, courses, c, face, t, x, n, w):
    """
    Second derivative of the gap that motion along the surface causes.

    Parameters
    ----------
    world, here, courses, c, face, t, x
        As in `gap_to`.
    n, w : (3,) tuple of float [-], [m/s]
        Normal, and velocity relative to the collider; world frame.

    Returns
    -------
    bend : float [m/s^2]
        w H w with the second derivatives H of the distance; w_t^2 / R outside a ball.

    """
    table = world.table
    kind, side = table[c, KIND], table[c, SIDE]
    if is_flat(table, c, face, side):
        return 0.0
    arm = subtract(x, centre(courses, world.poses, here, c, t))
    q = body_frame(courses, world, here, c, t, arm)
    v = body_frame(courses, world, here, c, t, w)
    size = (table[c, SIZE], table[c, SIZE + 1], table[c, SIZE + 2])
    slack = touching_depth(world, here, c, x)
    if kind == BOX:
        return _box_bend(q, v, size, slack)
    if kind == CYLINDER and side > 0.0 and face == 0:
        return _cylinder_bend(q, v, size, slack)
    if kind == CYLINDER:
        q, v = (q[0], q[1], 0.0), (v[0], v[1], 0.0)
    elif kind == CAPSULE and abs(q[2]) <= size[1]:
        q, v = (q[0], q[1], 0.0), (v[0], v[1], 0.0)
    elif kind == CAPSULE:
        q = (q[0], q[1], q[2] - min(max(q[2], -size[1]), size[1]))
    rho = length(q)
    m = (q[0] / rho, q[1] / rho, q[2] / rho) if rho > 0.0 else (0.0, 0.0, 1.0)
    return side * _bend(_tangential(v, m), rho)
