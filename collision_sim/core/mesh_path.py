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
Where a particle on its way from a to b, straight in the frame of a mesh, meets the mesh.

A particle keeps a distance of its radius and a skin, some roundings wide, so that the side it is
on is known at every start: the mesh itself has no thickness. It meets a triangle when its surface
does so (at a face, at the round of an edge or of a corner), when its centre crosses the triangle,
which no rounding can hide (mesh_rays.py), or when it ends nearer than the skin. At the start a
particle that is on the surface, to rounding, is on the outer side of a closed mesh, and in front
of an open one.
"""

from math import sqrt
from typing import NamedTuple

from collision_sim.core.jit import inlined, kernel
from collision_sim.core.mesh import (after, apart, box_of, corner, COUNT, EDGE, FACE, face_normal,
                                     height_over, HIGH, LOW, nearest_on_triangle, NEXT, NONE,
                                     triangle_distance, VERTEX)
from collision_sim.core.mesh_cells import cell_index, cells_of, FIRST_NODE, INSIDE, LAST_NODE
from collision_sim.core.mesh_rays import line_through, pierces
from collision_sim.core.vectors import add_scaled, dot, EPSILON, length, scaled, subtract
import numpy as np

SKIN = 24.0 * EPSILON       # relative to how far from the origin of the world a mesh reaches
ON = 0.25                   # share of the skin within which a particle is on the surface
UNMET = 2.0                 # a time after the end of the way


@inlined
def _time_to_round(m, w, rho):
    """First time from 0 on at which |m + t w| falls to rho; UNMET if it does not approach it."""
    a, b, c = dot(w, w), dot(m, w), dot(m, m) - rho * rho
    root = b * b - a * c
    if b >= 0.0 or root < 0.0:
        return UNMET
    return max(c / (sqrt(root) - b), 0.0)


@inlined
def _meets_edge(a, dx, c, d, rho):
    """Time at which a ball meets the edge from c to d between its ends, and the point of it."""
    along, arm = subtract(d, c), subtract(a, c)
    square = dot(along, along)
    s, ds = dot(arm, along) / square, dot(dx, along) / square
    t = _time_to_round(add_scaled(arm, -s, along), add_scaled(dx, -ds, along), rho)
    s += t * ds
    return (t if 0.0 <= s <= 1.0 else UNMET), add_scaled(c, s, along)


@inlined
def _passed_round(a, b, dx, time, q, rho):
    """Find the normal where a ball meets an edge or corner at q, and signed distance at b."""
    there = add_scaled(a, time, dx)
    away = subtract(there, q)
    away = scaled(1.0 / length(away), away)
    if time > 0.0:
        return away, dot(away, subtract(b, there))
    return away, dot(away, subtract(b, q)) - rho


@inlined
def _first_round(a, b, dx, rho, met, time, q):
    """Return what a ball meets first of `met`, that is time, distance and normal, and a point."""
    if time <= 1.0 and time <= met[0]:
        away, phi = _passed_round(a, b, dx, time, q, rho)
        if time < met[0] or phi < met[1]:
            return time, phi, away
    return met


@kernel
def _meets_rounds(triangles, sharp, t, a, b, dx, rho):
    """
    First time at which a ball meets a sharp edge or corner of a triangle, UNMET if it does not.

    And its signed distance at b, and the normal; of those met at once, of that it passes deepest.
    """
    met = UNMET, 0.0, (0.0, 0.0, 1.0)
    for k in range(3):
        c, d = corner(triangles, t, k), corner(triangles, t, (k + 1) % 3)
        if sharp[t] >> k & 1:
            time, q = _meets_edge(a, dx, c, d, rho)
            met = _first_round(a, b, dx, rho, met, time, q)
        if sharp[t] >> (VERTEX - EDGE + k) & 1:
            time = _time_to_round(subtract(a, c), dx, rho)
            met = _first_round(a, b, dx, rho, met, time, c)
    return met


@inlined
def _stays_beside(triangles, t, a, b, rho):
    """Whether the way from a to b stays on one side of the plane of a triangle, beyond rho."""
    ha, hb = height_over(triangles, t, a), height_over(triangles, t, b)
    return (ha > rho and hb > rho) or (ha < -rho and hb < -rho)


@inlined
def _meets_face(triangles, t, a, dx, time):
    """Whether the foot of the perpendicular from the ball at a time lies in the triangle."""
    return nearest_on_triangle(triangles, t, add_scaled(a, time, dx))[1] == FACE


@kernel
def meet_triangle(meshes, t, line, a, b, dx, side, radius, skin):
    """
    Where a particle on the way from a to b meets a triangle.

    Parameters
    ----------
    meshes, t
        Meshes, and which triangle.
    line
        Through a along dx, of mesh_rays.line_through.
    a, b, dx : (3,) tuple of float [m]
        Way in the frame of the mesh, dx from a to b.
    side : float
        1 if the particle can only come from in front of the triangle, -1 from behind, 0 from both.
    radius, skin : float [m]
        Of the particle, and how far it stays off.

    Returns
    -------
    tau : float [-]
        From 0 to 1, or UNMET.
    phi : float [m]
        Signed distance at b from the plane at which the particle was met; negative.
    n : (3,) tuple of float [-]
        Normal of that plane.
    crosses : bool
        Whether the centre crosses the triangle.

    """
    triangles, rho = meshes.triangles, radius + skin
    ha, hb, n = height_over(triangles, t, a), height_over(triangles, t, b), (0.0, 0.0, 1.0)
    if abs(ha) <= ON * skin and triangle_distance(triangles, t, a)[0] <= ON * skin:
        ha = skin if side >= 0.0 else -skin
    s = 1.0 if ha >= 0.0 else -1.0
    if s * side < 0.0:
        return UNMET, 0.0, n, False
    n, ha, hb = scaled(s, face_normal(triangles, t)), s * ha, s * hb
    tau = max((ha - rho) / (ha - hb), 0.0) if hb < ha else UNMET
    crosses = hb < 0.0 and pierces(line, triangles, t)[0]
    if radius > 0.0:
        if hb < rho and tau <= 1.0 and _meets_face(triangles, t, a, dx, tau):
            return tau, hb - rho, n, crosses
        first, phi, away = _meets_rounds(triangles, meshes.sharp, t, a, b, dx, rho)
        if first <= 1.0:
            return first, phi, away, crosses
        tau = ha / (ha - hb) if crosses else tau
    if crosses:
        return min(tau, 1.0), hb - rho, n, True
    if not abs(hb) < rho:
        return UNMET, 0.0, n, False
    d, q, feature = triangle_distance(triangles, t, b)
    if d < rho:
        if feature != FACE and radius > 0.0:
            n = scaled(1.0 / d, subtract(b, q))
        return 1.0, d - rho, n, False
    return UNMET, 0.0, n, False


@inlined
def _is_beside(r, w, h, k, j, margin):
    """Whether a segment and a box are apart along the axis w x e, e across k and j."""
    one, other = r[k] * w[j], r[j] * w[k]
    rounding = 8.0 * EPSILON * (abs(one) + abs(other))
    return abs(one - other) > (
        (h[k] + margin) * abs(w[j]) + (h[j] + margin) * abs(w[k]) + rounding)


@inlined
def _passes_by(nodes, i, middle, half, margin):
    """Whether a segment, middle +- half, passes by the box of a node widened by a margin."""
    low, high = ((nodes[i, LOW], nodes[i, LOW + 1], nodes[i, LOW + 2]),
                 (nodes[i, HIGH], nodes[i, HIGH + 1], nodes[i, HIGH + 2]))
    h = scaled(0.5, subtract(high, low))
    r = subtract(middle, add_scaled(low, 1.0, h))
    return (_is_beside(r, half, h, 0, 1, margin) or _is_beside(r, half, h, 1, 2, margin)
            or _is_beside(r, half, h, 2, 0, margin))


class Found(NamedTuple):
    """What has been met first so far, and which triangle; crossings, and the last one crossed."""

    tau: float
    phi: float
    n: tuple
    t: int
    crossings: int
    crossed: int


NOTHING = Found(UNMET, 0.0, (0.0, 0.0, 1.0), NONE, 0, NONE)


@inlined
def _earlier(found, t, met):
    """Give what was met first, triangle t or what was found before; it may come twice."""
    tau, phi, n, crosses = met
    crossings, crossed = found.crossings, found.crossed
    if crosses and crossed != t:
        crossings, crossed = min(crossings + 1, 2), t
    if tau < found.tau or (tau == found.tau and phi < found.phi):
        return Found(tau, phi, n, t, crossings, crossed)
    return Found(found.tau, found.phi, found.n, found.t, crossings, crossed)


@inlined
def _meet_in_cells(meshes, m, line, a, b, dx, side, radius, skin, first, last, found):
    """Meet the triangles that come into a block of cells."""
    for i in range(first[0], last[0] + 1):
        for j in range(first[1], last[1] + 1):
            for k in range(first[2], last[2] + 1):
                g = cell_index(meshes.heads, m, i, j, k)
                if meshes.cells[g] <= INSIDE:
                    continue
                for e in range(meshes.starts[g], meshes.starts[g + 1]):
                    t = np.int64(meshes.listed[e])
                    if not _stays_beside(meshes.triangles, t, a, b, radius + skin):
                        found = _earlier(found, t, meet_triangle(
                            meshes, t, line, a, b, dx, side, radius, skin))
    return found


@kernel
def meet(meshes, m, side, a, b, radius, skin):
    """
    First triangle of a mesh that a particle on the way from a to b meets.

    Parameters
    ----------
    meshes : mesh.Meshes
        Of the scene.
    m : int
        Which mesh.
    side, a, b, radius, skin
        As in `meet_triangle`.

    Returns
    -------
    tau, phi, n
        As from `meet_triangle`; of triangles met at the same time the one that is passed deepest.
    crossings : int
        How many triangles the centre crosses: 0, 1, or 2 for more.
    t : int
        The triangle, or mesh.NONE.

    """
    found, dx, rho = NOTHING, subtract(b, a), radius + skin
    line, (low, high) = line_through(a, dx), box_of(a, b, rho)
    first, last, few = cells_of(meshes.heads, m, low, high)
    if few:
        found = _meet_in_cells(meshes, m, line, a, b, dx, side, radius, skin, first, last, found)
        return found.tau, found.phi, found.n, found.crossings, found.t
    nodes, i, end = meshes.nodes, int(meshes.heads[m, FIRST_NODE]), meshes.heads[m, LAST_NODE]
    middle, half = add_scaled(a, 0.5, dx), scaled(0.5, dx)
    while i < end:
        if apart(nodes, i, low, high) or _passes_by(nodes, i, middle, half, rho):
            i = after(nodes, i)
            continue
        start = int(nodes[i, NEXT])
        for t in range(start, start + int(nodes[i, COUNT])):
            if not _stays_beside(meshes.triangles, t, a, b, rho):
                found = _earlier(found, t, meet_triangle(meshes, t, line, a, b, dx, side, radius,
                                                         skin))
        i += 1
    return found.tau, found.phi, found.n, found.crossings, found.t
