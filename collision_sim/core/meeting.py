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
The surfaces that a particle touches, and the least push by which they keep it out.

They are gathered in rows of a table, in an order that depends on what they are and not on the
order of the colliders: so the latter changes no bit. However many surfaces there are, three push
at most (Caratheodory): choices of one, two and three are gone through, which always ends.
"""

from collision_sim.core.courses import material_velocity
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.rules import NONE, ROUNDING
from collision_sim.core.shapes import KINETIC, RESTITUTION, SIDE, STATIC, WET
from collision_sim.core.surfaces import (face_beside, FACES, faces, gap_to, open_face, runs_off,
                                         touching_depth)
from collision_sim.core.ties import stands_first
from collision_sim.core.vectors import add_scaled, cross, dot, EPSILON, is_finite, length, subtract

# Columns of the rows: what they are sorted by, static, kinetic and wet friction, restitution,
# normal and normal velocity [m/s]; the surface; the push that the surface needs at least.
LAWS, FACING, SPEED, SURFACE, NEED, MET = 0, 4, 7, 8, 9, 10
NOBODY = (NONE, NONE, NONE)     # no surface
ZERO = (0.0, 0.0, 0.0)
BALANCED = 64.0 * EPSILON       # relative size of a force that is only rounding


@inlined
def facing(met, k):
    """Return the normal of a row."""
    return (met[k, FACING], met[k, FACING + 1], met[k, FACING + 2])


@inlined
def surface_of(met, k):
    """Return the surface of a row; NONE for none."""
    if k == NONE:
        return NONE
    return int(met[k, SURFACE])


@inlined
def surfaces_of(met, choice):
    """Return the surfaces of up to three rows."""
    return (surface_of(met, choice[0]), surface_of(met, choice[1]), surface_of(met, choice[2]))


@kernel
def _comes_first(table, poses, row, met, a, b):
    for k in range(SURFACE):
        if met[a, k] != met[b, k]:
            return met[a, k] < met[b, k]
    s, other = surface_of(met, a), surface_of(met, b)
    if s // FACES == other // FACES:
        return s < other
    return stands_first(table, poses, row, s // FACES, facing(met, a), other // FACES,
                        facing(met, b))


@kernel
def _sort_in(table, poses, row, met, last):
    """Sort in the last row of `met`, with a row of the poses."""
    while last > 0 and _comes_first(table, poses, row, met, last, last - 1):
        for k in range(MET):
            met[last, k], met[last - 1, k] = met[last - 1, k], met[last, k]
        last -= 1


@kernel
def gather(world, here, courses, met, t, x, v, share, leaving):
    """
    Gather the surfaces that a particle touches.

    Parameters
    ----------
    world, here, courses
        As in exact.py.
    met : (M, MET) float64
        Overwritten.
    t, x, v
        Time, position and velocity.
    share : float [-]
        Of the depth of touching, up to which a surface is touched.
    leaving : bool
        Whether those count that the particle leaves.

    Returns
    -------
    count : int
        Of rows; their normal velocities are 0 where that is only rounding.

    """
    table, poses = world.table, world.poses
    count = 0
    for c in range(table.shape[0]):
        side = table[c, SIDE]
        for face in range(faces(table, c, side)):
            gap, _, n = gap_to(world, here, courses, c, face, side, here.radius, t, x)
            touching = share * touching_depth(world, here, c, x)
            if gap > touching:
                continue
            obj = material_velocity(courses, poses, here, c, t, x)
            rounding = ROUNDING * (length(v) + length(obj))
            w, s = subtract(v, obj), FACES * c + face
            other = 0
            if not dot(w, n) > rounding:    # who goes over a seam leaves it to the next collider
                other = open_face(world, here, courses, c, here.radius, t, x, n, touching)
            if other > 0:
                s = FACES * c + other
                n = gap_to(world, here, courses, c, other, side, here.radius, t, x)[2]
            v_n = dot(w, n)
            if not leaving and (v_n > rounding or (v_n >= -rounding and runs_off(world, here,
                                                                                 courses, c, t, x,
                                                                                 w, n, touching,
                                                                                 rounding))):
                continue
            if v_n < -rounding:
                beside = face_beside(world, here, courses, c, here.radius, t, x, w, touching,
                                     rounding)
                if beside > 0:
                    s, v_n = FACES * c + beside, 0.0
                    n = gap_to(world, here, courses, c, beside, side, here.radius, t, x)[2]
            met[count, LAWS], met[count, LAWS + 1] = table[c, STATIC], table[c, KINETIC]
            met[count, LAWS + 2], met[count, LAWS + 3] = table[c, WET], table[c, RESTITUTION]
            for d in range(3):
                met[count, FACING + d] = n[d]
            met[count, SPEED] = v_n if abs(v_n) > rounding else 0.0
            met[count, SURFACE], met[count, NEED] = s, 0.0
            _sort_in(table, poses, here.start, met, count)
            count += 1
    return count


@inlined
def leave_out(met, count, s):
    """Take a surface out of the rows; how many are left."""
    left = 0
    for k in range(count):
        if surface_of(met, k) != s:
            for d in range(MET):
                met[left, d] = met[k, d]
            left += 1
    return left


@inlined
def turn_round(met, k, count):
    """Add a row that keeps a particle from leaving a surface; how many rows there are then."""
    for d in range(MET):
        met[count, d] = met[k, d]
    for d in range(FACING, SURFACE):
        met[count, d] = -met[k, d]
    return count + 1


@inlined
def first_choice(count):
    """Return the first choice of up to three of some rows; NOBODY where there is none."""
    return (0, NONE, NONE) if count > 0 else NOBODY


@inlined
def next_choice(choice, count):
    """Return the choice after one: all singles, then pairs, then threes; NOBODY at the end."""
    i, j, k = choice
    if j == NONE:
        if i + 1 < count:
            return (i + 1, NONE, NONE)
        return (0, 1, NONE) if count > 1 else NOBODY
    if k == NONE:
        if j + 1 < count:
            return (i, j + 1, NONE)
        if i + 2 < count:
            return (i + 1, i + 2, NONE)
        return (0, 1, 2) if count > 2 else NOBODY
    if k + 1 < count:
        return (i, j, k + 1)
    if j + 2 < count:
        return (i, j + 1, j + 2)
    return (i + 1, i + 2, i + 3) if i + 3 < count else NOBODY


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


@inlined
def _sum_of(p, n0, n1, n2):
    return add_scaled(add_scaled(add_scaled(ZERO, p[0], n0), p[1], n1), p[2], n2)


@kernel
def _lack(met, count, push):
    """By how much a push falls short of what a surface needs, at most."""
    worst = 0.0
    for k in range(count):
        worst = max(worst, met[k, NEED] - dot(facing(met, k), push))
    return worst


@kernel
def least_push(met, count):
    """
    Least vector y with n.y >= need for all rows, of the normals of up to three of them.

    It is unique, and what it adds to a velocity or a force that the surfaces are to bear is in the
    cone of their normals (Moreau 1988). Where no choice is right to rounding, as with normals that
    are nearly dependent, or none at all, as between closing walls, the one that is least wrong.

    Parameters
    ----------
    met : (M, MET) float64
        Rows of surfaces.
    count : int
        How many.

    Returns
    -------
    push : (3,) tuple of float
        y.
    choice : (3,) tuple of int
        Rows that push, NONE from the first free seat on.
    parts : (3,) tuple of float
        How much each pushes.

    """
    push, rows, parts, lack, need = ZERO, NOBODY, ZERO, _lack(met, count, ZERO), 0.0
    for k in range(count):
        need = max(need, met[k, NEED])
    choice = first_choice(count)
    while choice[0] != NONE and lack > 4.0 * EPSILON * need:
        i, j, k = choice
        a, b, c = facing(met, i), facing(met, max(j, 0)), facing(met, max(k, 0))
        p = normal_forces(choice, a, b, c, a, b, c, -met[i, NEED], -met[max(j, 0), NEED],
                          -met[max(k, 0), NEED])
        y = _sum_of(p, a, b, c)
        if is_finite(p, y):
            miss = max(_lack(met, count, y), max(-p[0], max(-p[1], -p[2])))
            if miss < lack:
                push, rows, parts, lack = y, choice, p, miss
        choice = next_choice(choice, count)
    return push, rows, parts
