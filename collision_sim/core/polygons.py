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
Polygons in space cut into triangles, by cutting off ears, the first that there is each time.

After G. H. Meisters: Polygons have ears, American Mathematical Monthly 82, 1975; in the plane
normal to the area vector of the polygon.
"""

from math import sqrt

from collision_sim.core.jit import kernel, law
from collision_sim.core.vectors import cross, dot, largest
import numpy as np

MOST_CORNERS = 1000     # of a polygon: the time grows with the square, at worst with the cube
FLATNESS = 1e-3         # how far a corner may be off the plane, relative to the polygon
FINE, NO_AREA, NOT_FLAT, NO_EAR, TOO_MANY = range(5)
PROBLEMS = {NO_AREA: 'has no area', NOT_FLAT: f'must be flat to {FLATNESS:g} of its size',
            NO_EAR: 'crosses itself, or has corners without an angle',
            TOO_MANY: f'must have at most {MOST_CORNERS} corners'}


@law
def cut(vertices, corners, sizes):
    """
    Cut polygons into triangles.

    Parameters
    ----------
    vertices : (V, 3) float64 [m]
        In any order.
    corners : (sum of sizes,) int64
        Vertices of the polygons, one after the other.
    sizes : (P,) int64
        At least 3 each.

    Returns
    -------
    faces : (T, 3) int64
    polygons : (T,) int64
        Which polygon each is part of.
    problem : int
        FINE, or what is wrong with the last of these polygons.

    """
    faces = np.empty((len(corners) - 2 * len(sizes), 3), np.int64)
    polygons = np.empty(len(faces), np.int64)
    flat, ring = np.empty((MOST_CORNERS, 2)), np.empty(MOST_CORNERS, np.int64)
    start, count = 0, 0
    for p in range(len(sizes)):
        n, problem = sizes[p], FINE
        polygons[count:count + n - 2] = p
        if n == 3:
            faces[count] = corners[start:start + 3]
        elif n > MOST_CORNERS:
            problem = TOO_MANY
        else:
            problem = _lay_flat(vertices, corners, start, n, flat)
            if problem == FINE:
                problem = _cut_ears(flat, ring, corners, start, n, faces, count)
        if problem != FINE:
            return faces[:count], polygons[:count + 1], problem
        start, count = start + n, count + n - 2
    return faces, polygons, FINE


@kernel
def _arm(vertices, corners, start, k):
    """Corner k of a polygon from its first."""
    a, b = corners[start], corners[start + k]
    return (vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1],
            vertices[b, 2] - vertices[a, 2])


@kernel
def _lay_flat(vertices, corners, start, n, flat):
    """Write the corners of a polygon in its plane, in which it turns left, to flat."""
    area, reach = (0.0, 0.0, 0.0), 0.0
    for k in range(1, n):
        arm = _arm(vertices, corners, start, k)
        part = cross(_arm(vertices, corners, start, k - 1), arm)
        area = (area[0] + part[0], area[1] + part[1], area[2] + part[2])
        reach = max(reach, largest(arm))
    size = sqrt(dot(area, area))
    if not size > 0.0:
        return NO_AREA
    normal = (area[0] / size, area[1] / size, area[2] / size)
    least = min(abs(normal[0]), min(abs(normal[1]), abs(normal[2])))
    axis = (1.0, 0.0, 0.0) if least == abs(normal[0]) else (
        (0.0, 1.0, 0.0) if least == abs(normal[1]) else (0.0, 0.0, 1.0))
    first = cross(axis, normal)
    second = cross(normal, first)
    for k in range(n):
        arm = _arm(vertices, corners, start, k)
        if abs(dot(arm, normal)) > FLATNESS * reach:
            return NOT_FLAT
        flat[k, 0], flat[k, 1] = dot(arm, first), dot(arm, second)
    return FINE


@kernel
def _cut_ears(flat, ring, corners, start, n, faces, count):
    """Write the triangles of a polygon that lies flat to faces from `count` on."""
    for k in range(n):
        ring[k] = k
    k, tried = 1, 0
    while n > 3:
        if _is_ear(flat, ring, n, k):
            for j in range(3):
                faces[count, j] = corners[start + ring[(k - 1 + j) % n]]
            count, n, tried = count + 1, n - 1, 0
            for j in range(k, n):
                ring[j] = ring[j + 1]
            k %= n
        else:
            k, tried = (k + 1) % n, tried + 1
            if tried == n:
                return NO_EAR
    if not _left_of(flat, ring[0], ring[1], ring[2]) > 0.0:
        return NO_EAR
    for j in range(3):
        faces[count, j] = corners[start + ring[j]]
    return FINE


@kernel
def _left_of(flat, a, b, c):
    """Twice the area of a triangle, positive if it turns left."""
    return ((flat[b, 0] - flat[a, 0]) * (flat[c, 1] - flat[a, 1])
            - (flat[b, 1] - flat[a, 1]) * (flat[c, 0] - flat[a, 0]))


@kernel
def _is_ear(flat, ring, n, k):
    """Whether corner k of the ring turns left and no other corner lies in its triangle."""
    a, b, c = ring[(k - 1) % n], ring[k], ring[(k + 1) % n]
    if not _left_of(flat, a, b, c) > 0.0:
        return False
    for j in range(n - 3):
        d = ring[(k + 2 + j) % n]
        if (_left_of(flat, a, b, d) >= 0.0 and _left_of(flat, b, c, d) >= 0.0
                and _left_of(flat, c, a, d) >= 0.0):
            return False
    return True
