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
Triangles cut where others cross them, and which pieces are part of the surface of a solid.

A piece is convex. It is cut along the plane of another triangle that comes through it, and where
the other lies in its plane along the sides of that. No piece is crossed then, so one point speaks
for it: it is part of the surface if the parts wind about one side of it in total at least once,
and not about the other. The winding number is the sum of the solid angles of all triangles over
4 pi (A. van Oosterom, J. Strackee: The solid angle of a plane triangle, IEEE Transactions on
Biomedical Engineering 30, 1983).
"""

from math import atan2, pi

from collision_sim.core.jit import counted, kernel, law
from collision_sim.core.mesh import (after, apart, corner, COUNT, face_normal,
                                     height_over, NEXT, triangle_distance)
from collision_sim.core.mesh_tree import tree
from collision_sim.core.vectors import add_scaled, cross, dot, length, scaled, subtract
import numpy as np

HIDDEN, SURFACE, SHEET, UNKNOWN = range(4)      # states of a piece
CLEAR = 0.2             # how far a winding number may be off a whole one


@law
def boxes_that_meet(lows, highs, groups, corners):
    """
    Pairs of boxes that have something in common.

    Parameters
    ----------
    lows, highs : (N, 3) float64 [m]
        Corners of the boxes.
    groups, corners : (N,) int64, (N, C) int64
        Boxes of the same group that have a corner in common are no pairs.

    Returns
    -------
    pairs : (K, 2) int64
        Each once, the smaller number first.

    """
    order, nodes = tree(lows.T.copy(), highs.T.copy())
    pairs = np.empty((0, 2), np.int64)
    for filling in (False, True):
        count = 0
        for a in range(len(lows)):
            low, high, i = ((lows[a, 0], lows[a, 1], lows[a, 2]),
                            (highs[a, 0], highs[a, 1], highs[a, 2]), 0)
            while i < len(nodes):
                if apart(nodes, i, low, high):
                    i = after(nodes, i)
                    continue
                first = int(nodes[i, NEXT])
                for b in order[first:first + int(nodes[i, COUNT])]:
                    if b > a and _meet(lows, highs, a, b) and not (
                            groups[a] == groups[b] and _share(corners, a, b)):
                        if filling:
                            pairs[count, 0], pairs[count, 1] = a, b
                        count += 1
                i += 1
        if not filling:
            pairs = np.empty((count, 2), np.int64)
    return pairs


@kernel
def _meet(lows, highs, a, b):
    """Whether two boxes have something in common."""
    for k in range(3):
        if lows[b, k] > highs[a, k] or highs[b, k] < lows[a, k]:
            return False
    return True


@kernel
def _share(corners, a, b):
    """Whether two rows have a number in common."""
    for i in range(corners.shape[1]):
        for j in range(corners.shape[1]):
            if corners[a, i] == corners[b, j]:
                return True
    return False


@kernel
def _height(triangles, t, p, tolerance):
    """Height [m] of p over the plane of a triangle; 0 within the tolerance."""
    h = height_over(triangles, t, p)
    return h if abs(h) > tolerance else 0.0


@kernel
def _heights(triangles, t, s, tolerance):
    """Heights [m] of the corners of triangle s over the plane of triangle t."""
    return (_height(triangles, t, corner(triangles, s, 0), tolerance),
            _height(triangles, t, corner(triangles, s, 1), tolerance),
            _height(triangles, t, corner(triangles, s, 2), tolerance))


@kernel
def _is_flat(heights):
    return heights[0] == 0.0 and heights[1] == 0.0 and heights[2] == 0.0


@kernel
def _is_beside(heights):
    """Whether three points lie on one side of a plane, none on it."""
    a, b, c = heights
    return (a > 0.0 and b > 0.0 and c > 0.0) or (a < 0.0 and b < 0.0 and c < 0.0)


@law
def that_touch(triangles, pairs, tolerance):
    """Whether the triangles of each pair (K, 2) are not divided by the plane of one, (K,)."""
    touching = np.empty(len(pairs), np.bool_)
    for i in range(len(pairs)):
        t, s = pairs[i]
        touching[i] = not (_is_beside(_heights(triangles, t, s, tolerance))
                           or _is_beside(_heights(triangles, s, t, tolerance)))
    return touching


@kernel
def _between(a, b, ha, hb):
    """Point of the way from a to b with height 0, of heights with unlike signs."""
    return add_scaled(a, ha / (ha - hb), subtract(b, a))


@kernel
def _common_line(triangles, s, heights):
    """Find the ends of what triangle s has in common with a plane, and whether it is a line."""
    p, q, count = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0
    for k in range(3):
        a, b = corner(triangles, s, k), corner(triangles, s, (k + 1) % 3)
        ha, hb = heights[k], heights[(k + 1) % 3]
        if ha == 0.0 or ha * hb < 0.0:
            p, q, count = q, (a if ha == 0.0 else _between(a, b, ha, hb)), count + 1
    return p, q, count == 2


@counted
def _divided(pieces, o, m, p, q, tolerance):
    """Cut those pieces along the plane through o with normal m that the line p q comes into."""
    count = len(pieces)
    for i in range(count):
        piece = pieces[i]
        n, heights, least, most = len(piece), np.empty(len(piece)), 0.0, 0.0
        for k in range(n):
            h = dot(subtract((piece[k, 0], piece[k, 1], piece[k, 2]), o), m)
            heights[k] = h if abs(h) > tolerance else 0.0
            least, most = min(least, heights[k]), max(most, heights[k])
        if not least < 0.0 < most:
            continue
        front, back = np.empty((2 * n, 3)), np.empty((2 * n, 3))
        fronts, backs, cuts = 0, 0, 0
        first, last = o, o
        for k in range(n):
            a, b = piece[k], piece[(k + 1) % n]
            ha, hb = heights[k], heights[(k + 1) % n]
            if ha >= 0.0:
                front[fronts] = a
                fronts += 1
            if ha <= 0.0:
                back[backs] = a
                backs += 1
            if ha == 0.0 or ha * hb < 0.0:
                c = (a[0], a[1], a[2])
                if ha != 0.0:
                    c = _between(c, (b[0], b[1], b[2]), ha, hb)
                    front[fronts, 0], front[fronts, 1], front[fronts, 2] = c
                    back[backs, 0], back[backs, 1], back[backs, 2] = c
                    fronts, backs = fronts + 1, backs + 1
                first, last, cuts = (c if cuts == 0 else first), c, cuts + 1
        if cuts < 2 or not _overlap(first, last, p, q, tolerance):
            continue
        pieces[i] = front[:fronts].copy()
        pieces.append(back[:backs].copy())


@kernel
def _overlap(a, b, p, q, tolerance):
    """Whether two pieces of a line have more than a point in common."""
    along = subtract(b, a)
    size = length(along)
    if not size > tolerance:
        return False
    along = scaled(1.0 / size, along)
    s, t = dot(subtract(p, a), along), dot(subtract(q, a), along)
    return min(max(s, t), size) - max(min(s, t), 0.0) > tolerance


@law
def cut(triangles, which, starts, others, tolerance):
    """
    Cut triangles by others.

    Parameters
    ----------
    triangles : (T, mesh.TRIANGLE) float64
        All of them.
    which : (K,) int64
        Those to cut.
    starts : (K + 1,) int64
        Triangle which[k] is cut by others[starts[k]:starts[k + 1]].
    others : (L,) int64
        Triangles.
    tolerance : float [m]
        Within this distance all is the same.

    Returns
    -------
    points : (N, 3) float64 [m]
        Corners of the pieces, one piece after the other.
    sizes : (P,) int64
        How many corners each piece has.
    counts : (K,) int64
        How many pieces there are of each triangle.

    """
    pieces, counts = [np.empty((3, 3)) for _ in range(0)], np.empty(len(which), np.int64)
    for k in range(len(which)):
        t = which[k]
        parts = [triangles[t, :9].copy().reshape(3, 3)]
        for e in range(starts[k], starts[k + 1]):
            s = others[e]
            heights = _heights(triangles, t, s, tolerance)
            if _is_flat(heights) or _is_flat(_heights(triangles, s, t, tolerance)):
                for j in range(3):
                    p, q = corner(triangles, s, j), corner(triangles, s, (j + 1) % 3)
                    m = cross(face_normal(triangles, t), subtract(q, p))
                    _divided(parts, p, scaled(1.0 / length(m), m), p, q, tolerance)
            else:
                p, q, common = _common_line(triangles, s, heights)
                if common:
                    _divided(parts, corner(triangles, s, 0), face_normal(triangles, s), p, q,
                             tolerance)
        for piece in parts:
            pieces.append(piece)
        counts[k] = len(parts)
    total = 0
    for piece in pieces:
        total += len(piece)
    points, sizes, count = np.empty((total, 3)), np.empty(len(pieces), np.int64), 0
    for i in range(len(pieces)):
        sizes[i] = len(pieces[i])
        points[count:count + sizes[i]] = pieces[i]
        count += sizes[i]
    return points, sizes, counts


@kernel
def _solid_angle(triangles, t, p):
    """Solid angle [sr] of a triangle seen from p; positive from behind."""
    a, b, c = (subtract(corner(triangles, t, 0), p), subtract(corner(triangles, t, 1), p),
               subtract(corner(triangles, t, 2), p))
    la, lb, lc = length(a), length(b), length(c)
    return 2.0 * atan2(dot(a, cross(b, c)),
                       la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)


@kernel
def _is_off(lows, highs, k, p, distance):
    """Whether a point is further from a box than a distance, along some axis."""
    for axis in range(3):
        if p[axis] < lows[k, axis] - distance or p[axis] > highs[k, axis] + distance:
            return True
    return False


@law
def states_of(triangles, first, lows, highs, points, owners, tolerance):
    """
    Tell which pieces are part of the surface of the solid.

    Parameters
    ----------
    triangles : (T, mesh.TRIANGLE) float64
        Those of part k are from first[k] to before first[k + 1].
    first : (M + 1,) int64
        See above.
    lows, highs : (M, 3) float64 [m]
        Corners of the boxes of the parts.
    points : (P, 3) float64 [m]
        A point of each piece.
    owners : (P,) int64
        Which triangle each piece is of.
    tolerance : float [m]
        Triangles nearer than this to a point lie on each other there.

    Returns
    -------
    states : (P,) int64
        HIDDEN, SURFACE, SHEET of no thickness out of the solid, or UNKNOWN.

    """
    states = np.empty(len(points), np.int64)
    for i in range(len(points)):
        p, t = (points[i, 0], points[i, 1], points[i, 2]), owners[i]
        angle, sheets, is_first = 0.0, 1, True
        for k in range(len(first) - 1):
            if _is_off(lows, highs, k, p, tolerance):
                continue
            for s in range(first[k], first[k + 1]):
                if s == t:
                    continue
                if (abs(height_over(triangles, s, p)) <= tolerance
                        and triangle_distance(triangles, s, p)[0] <= tolerance):
                    alike = dot(face_normal(triangles, s), face_normal(triangles, t)) > 0.0
                    sheets += 1 if alike else -1
                    is_first = is_first and not (alike and s < t)
                else:
                    angle += _solid_angle(triangles, s, p)
        behind = angle / (4.0 * pi) + 0.5 * sheets
        windings = int(np.floor(behind + 0.5))
        if abs(behind - windings) > CLEAR:
            states[i] = UNKNOWN
        elif windings - sheets <= 0 < windings:
            states[i] = SURFACE if is_first else HIDDEN
        else:
            states[i] = SHEET if sheets == 0 and windings <= 0 else HIDDEN
    return states
