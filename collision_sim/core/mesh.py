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
Triangle meshes in their own frame: layout, nearest point, inside or outside, signed distance.

All meshes of a scene lie in the same arrays, `Meshes`; the rows of `heads` say where each begins.
The tree over the triangles is stored in the order of a descent, each node with the place to go on
at when its box is of no interest, so that no query needs a stack. A grid of cells tells at once
what is far from the surface (mesh_cells.py).

A closed mesh has a signed distance, negative inside, with the sign of the angle-weighted normal at
the nearest feature (J. A. Baerentzen, H. Aanaes: Signed distance computation using the angle
weighted pseudonormal, IEEE TVCG 11, 2005). An open mesh has two sides and a distance only.
"""

from math import inf
from typing import NamedTuple

from collision_sim.core.jit import inlined, kernel
from collision_sim.core.mesh_cells import (cell_index, cell_of, cells_of, CLOSED, EXTENT,
                                           FIRST_NODE, HEAD, INSIDE, is_in_grid, LAST_NODE,
                                           NEAR_INSIDE)
from collision_sim.core.mesh_rays import line_through, pierces
from collision_sim.core.vectors import add_scaled, cross, dot, length, scaled, subtract
import numpy as np

# Columns of a node: low and high corner of its box [m]; of an inner node 0 and the node to go on
# at when its box is of no interest, of a leaf how many triangles and the first.
LOW, HIGH, COUNT, NEXT, NODE = 0, 3, 6, 7, 8
CORNER, NORMAL, TRIANGLE = 0, 9, 12     # columns of a triangle: three corners [m], unit normal
FACE, EDGE, VERTEX = 0, 1, 4            # features: the face, edges AB, BC, CA, corners A, B, C
FEATURES = 18                           # columns of the normals: edges, then corners
NONE = -1               # no triangle
SURE = 1e-9     # relative to the size of a mesh: from here on a difference gives a direction


class Meshes(NamedTuple):
    """
    All meshes of a scene.

    Attributes
    ----------
    heads : (M, mesh_cells.HEAD) float64
        Of each mesh: where it begins in the other arrays, its grid of cells, its size.
    nodes : (K, NODE) float64
        The trees.
    triangles : (T, TRIANGLE) float64
        In the order of the leaves.
    normals : (T, FEATURES) float32
        Angle-weighted normals of edges and corners, of any length.
    sharp : (T,) uint8
        Bit f - 1 is set where feature f is no part of a flat surface.
    cells : (G,) uint8
        Labels of the cells of the grids.
    starts, listed : (G,) int32, (L,) int32
        The triangles that come into cell g are listed from starts[g] to before starts[g + 1].

    """

    heads: np.ndarray
    nodes: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray
    sharp: np.ndarray
    cells: np.ndarray
    starts: np.ndarray
    listed: np.ndarray


NO_MESHES = Meshes(np.empty((0, HEAD)), np.empty((0, NODE)), np.empty((0, TRIANGLE)),
                   np.empty((0, FEATURES), dtype=np.float32), np.empty(0, dtype=np.uint8),
                   np.empty(0, dtype=np.uint8), np.empty(0, dtype=np.int32),
                   np.empty(0, dtype=np.int32))


@inlined
def corner(triangles, t, k):
    """Give corner k of triangle t."""
    return triangles[t, 3 * k], triangles[t, 3 * k + 1], triangles[t, 3 * k + 2]


@inlined
def face_normal(triangles, t):
    """Give the unit normal of triangle t; its corners turn left about it."""
    return triangles[t, NORMAL], triangles[t, NORMAL + 1], triangles[t, NORMAL + 2]


@inlined
def height_over(triangles, t, p):
    """Signed distance [m] from the plane of triangle t to p."""
    return dot(face_normal(triangles, t), subtract(p, corner(triangles, t, 0)))


@kernel
def nearest_on_triangle(triangles, t, p):
    """
    Point of a triangle nearest to p, and the feature it lies on.

    Returns
    -------
    q : (3,) tuple of float [m]
    feature : int
        FACE, EDGE + k from corner k to the next, or VERTEX + k.

    """
    n, feature, q, least, outside = face_normal(triangles, t), FACE, p, inf, False
    for k in range(3):
        a, b = corner(triangles, t, k), corner(triangles, t, (k + 1) % 3)
        ab, ap = subtract(b, a), subtract(p, a)
        if dot(cross(ab, ap), n) >= 0.0:
            continue
        outside = True
        s = min(max(dot(ap, ab) / dot(ab, ab), 0.0), 1.0)
        on_edge = add_scaled(a, s, ab)
        away = subtract(p, on_edge)
        if dot(away, away) < least:
            least, q, feature = dot(away, away), on_edge, EDGE + k
            if s == 0.0:
                q, feature = a, VERTEX + k
            elif s == 1.0:
                q, feature = b, VERTEX + (k + 1) % 3
    if not outside:
        q = add_scaled(p, -height_over(triangles, t, p), n)
    return q, feature


@inlined
def triangle_distance(triangles, t, p):
    """Distance [m] from p to a triangle, the nearest point and its feature."""
    q, feature = nearest_on_triangle(triangles, t, p)
    if feature == FACE:
        return abs(height_over(triangles, t, p)), q, feature
    return length(subtract(p, q)), q, feature


@inlined
def box_distance_squared(nodes, i, p):
    """Square of the distance [m^2] from p to the box of a node."""
    x = max(max(nodes[i, LOW] - p[0], p[0] - nodes[i, HIGH]), 0.0)
    y = max(max(nodes[i, LOW + 1] - p[1], p[1] - nodes[i, HIGH + 1]), 0.0)
    z = max(max(nodes[i, LOW + 2] - p[2], p[2] - nodes[i, HIGH + 2]), 0.0)
    return x * x + y * y + z * z


@inlined
def after(nodes, i):
    """Give the node to go on at after the subtree of node i."""
    return i + 1 if nodes[i, COUNT] > 0.0 else int(nodes[i, NEXT])


@inlined
def _reach(meshes, m, p):
    """Distance [m] from p to some triangle that is not far from the nearest."""
    nodes, i, least = meshes.nodes, int(meshes.heads[m, FIRST_NODE]), inf
    while nodes[i, COUNT] == 0.0:
        left, right = i + 1, after(nodes, i + 1)
        nearer = box_distance_squared(nodes, left, p) <= box_distance_squared(nodes, right, p)
        i = left if nearer else right
    first = int(nodes[i, NEXT])
    for t in range(first, first + int(nodes[i, COUNT])):
        least = min(least, triangle_distance(meshes.triangles, t, p)[0])
    return least


@kernel
def nearest(meshes, m, p, bound, guess=NONE):
    """
    Triangle of a mesh that is nearest to a point.

    Parameters
    ----------
    meshes : Meshes
        Of the scene.
    m : int
        Which mesh.
    p : (3,) tuple of float [m]
        In the frame of the mesh.
    bound : float [m]
        Only what is nearer than this counts.
    guess : int
        A triangle that is likely to be nearest, or NONE.

    Returns
    -------
    d : float [m]
        The bound where no triangle is nearer.
    t, feature : int
        Triangle, NONE for none, and its feature as of `nearest_on_triangle`; of equally near ones
        the guess, else the first.
    q : (3,) tuple of float [m]

    """
    best = (bound, NONE, FACE, p)
    if guess != NONE:
        best = _nearer(meshes.triangles, guess, p, best)
    low, high = box_of(p, p, best[0])
    first, last, few = cells_of(meshes.heads, m, low, high)
    if few:
        return _nearest_in_cells(meshes, m, p, best, first, last)
    nodes, i, end = meshes.nodes, int(meshes.heads[m, FIRST_NODE]), meshes.heads[m, LAST_NODE]
    while i < end:
        if box_distance_squared(nodes, i, p) > best[0] * best[0]:
            i = after(nodes, i)
            continue
        start = int(nodes[i, NEXT])
        for t in range(start, start + int(nodes[i, COUNT])):
            best = _nearer(meshes.triangles, t, p, best)
        i += 1
    return best


@inlined
def _nearer(triangles, t, p, best):
    """Give distance, triangle, feature and point of triangle t if it is nearer than the best."""
    if abs(height_over(triangles, t, p)) < best[0]:
        d, q, feature = triangle_distance(triangles, t, p)
        if d < best[0]:
            return d, t, feature, q
    return best


@inlined
def _nearest_in_cells(meshes, m, p, best, first, last):
    """Nearest triangle as `nearest`, of the best so far and those in a block of cells."""
    for i in range(first[0], last[0] + 1):
        for j in range(first[1], last[1] + 1):
            for k in range(first[2], last[2] + 1):
                g = cell_index(meshes.heads, m, i, j, k)
                if meshes.cells[g] > INSIDE:
                    for e in range(meshes.starts[g], meshes.starts[g + 1]):
                        best = _nearer(meshes.triangles, np.int64(meshes.listed[e]), p, best)
    return best


@inlined
def nearest_of_all(meshes, m, p):
    """Nearest triangle as `nearest`, without a bound."""
    return nearest(meshes, m, p, _reach(meshes, m, p) * (1.0 + SURE))


@inlined
def feature_normal(meshes, t, feature):
    """Angle-weighted normal of an edge or a corner, of any length."""
    k, normals = 3 * (feature - EDGE), meshes.normals
    return float(normals[t, k]), float(normals[t, k + 1]), float(normals[t, k + 2])


@inlined
def is_in_front(meshes, t, feature, q, p):
    """Whether p lies on the side of a feature that its normal points to, or on the feature."""
    if feature == FACE:
        return height_over(meshes.triangles, t, p) >= 0.0
    return dot(subtract(p, q), feature_normal(meshes, t, feature)) >= 0.0


@kernel
def normal_towards(meshes, t, feature, q, p, d, front, sure):
    """
    Give the unit normal of the surface at its point q nearest to p, on the side of p.

    That is the normal of the face, also at edges and corners that are part of a flat surface; else
    the direction from the feature, and very near to it, where that is only rounding, the
    angle-weighted normal.

    Parameters
    ----------
    meshes, t, feature, q, d
        As `nearest` gives them for p.
    p : (3,) tuple of float [m]
        In the frame of the mesh.
    front : bool
        Whether p is on the side that the triangle's normal points to.
    sure : float [m]
        From which distance on the direction is known.

    """
    side = 1.0 if front else -1.0
    if feature == FACE or not meshes.sharp[t] >> (feature - EDGE) & 1:
        return scaled(side, face_normal(meshes.triangles, t))
    if d > sure:
        return scaled(1.0 / d, subtract(p, q))
    n = feature_normal(meshes, t, feature)
    size = length(n)
    return scaled(side / size, n) if size > 0.0 else scaled(side, face_normal(meshes.triangles, t))


@kernel
def is_inside(meshes, m, p):
    """
    Whether a point is inside a closed mesh.

    Far from the surface the cell of the grid knows. Near it the signs of the crossings on the way
    from the centre of the cell are added up; a way that touches an edge or a corner says nothing,
    and the normal at the nearest feature decides.
    """
    if not is_in_grid(meshes.heads, m, p):
        return False
    g, centre = cell_of(meshes.heads, m, p)
    label = meshes.cells[g]
    if label <= INSIDE:
        return label == INSIDE
    crossings, certain = _signed_crossings(meshes, g, centre, p)
    if certain:
        return crossings < (1 if label == NEAR_INSIDE else 0)
    d, t, feature, q = nearest_of_all(meshes, m, p)
    return d > 0.0 and not is_in_front(meshes, t, feature, q, p)


@inlined
def apart(nodes, i, low, high):
    """Whether the box of a node and another box have nothing in common."""
    return (nodes[i, LOW] > high[0] or nodes[i, HIGH] < low[0]
            or nodes[i, LOW + 1] > high[1] or nodes[i, HIGH + 1] < low[1]
            or nodes[i, LOW + 2] > high[2] or nodes[i, HIGH + 2] < low[2])


@inlined
def box_of(a, b, margin):
    """Corners of the box around two points, widened by a margin."""
    return ((min(a[0], b[0]) - margin, min(a[1], b[1]) - margin, min(a[2], b[2]) - margin),
            (max(a[0], b[0]) + margin, max(a[1], b[1]) + margin, max(a[2], b[2]) + margin))


@inlined
def _signed_crossings(meshes, g, a, b):
    """
    Count how often the way from a to b comes to the front of triangles, less how often behind.

    Parameters
    ----------
    meshes : Meshes
        Of the scene.
    g : int
        Cell that the way does not leave.
    a, b : (3,) tuple of float [m]
        In the frame of the mesh.

    Returns
    -------
    crossings : int
    certain : bool
        False where the way touches an edge, or an end lies in the plane of a triangle it meets.

    """
    triangles, crossings, certain = meshes.triangles, 0, True
    line = line_through(a, subtract(b, a))
    for k in range(meshes.starts[g], meshes.starts[g + 1]):
        t = meshes.listed[k]
        ha, hb = height_over(triangles, t, a), height_over(triangles, t, b)
        if ha * hb <= 0.0:
            met, at_edge = pierces(line, triangles, t)
            certain = certain and not (met and (at_edge or ha == 0.0 or hb == 0.0))
            crossings += (1 if hb > ha else -1) if met else 0
    return crossings, certain


@kernel
def mesh_distance(meshes, m, p):
    """
    Signed distance of a closed mesh, distance of an open one, and the normal.

    Parameters
    ----------
    meshes, m, p
        As in `nearest`.

    Returns
    -------
    distance : float [m]
    n : (3,) tuple of float [-]
        Unit gradient of the distance: out of a closed mesh, towards p from an open one.

    """
    d, t, feature, q = nearest_of_all(meshes, m, p)
    front, sure = is_in_front(meshes, t, feature, q, p), SURE * meshes.heads[m, EXTENT]
    n = normal_towards(meshes, t, feature, q, p, d, front, sure)
    if meshes.heads[m, CLOSED] > 0.0 and not front:
        return -d, scaled(-1.0, n)
    return d, n
