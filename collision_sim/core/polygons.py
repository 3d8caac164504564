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
Polygons in space cut into triangles, by cutting off ears.

After G. H. Meisters: Polygons have ears, American Mathematical Monthly 82, 1975; in the plane
normal to the area vector of the polygon. Corners on straight edges are kept. A polygon may touch
itself: corners may coincide, lie on its edges, or run back along them.

A corner is an ear if it turns left and nothing of the polygon lies in its triangle. To cut one off
changes that of its two neighbours only, so each corner is looked at some three times.
"""

from math import sqrt

from collision_sim.core.jit import kernel, law
from collision_sim.core.vectors import cross, dot, EPSILON, largest
import numpy as np

FLATNESS = 1e-3         # how far a corner may be off the plane, relative to the polygon
NOT_FLAT, CROSSING = 1, 2       # bits of what is said of a polygon
BUDGET = 20_000_000     # corners that are looked at in one call, a tenth of a second
ROUNDING = 8.0 * EPSILON        # of a place in the plane, relative to the size of the polygon
# What is known of a corner that is left: nothing, that it is no ear.
OPEN, NO_EAR = range(2)
SPIKES, SEARCH, SEARCH_AGAIN, STRAIGHT, CROSSED = range(5)      # what is cut off in this round
# Words of the state between two calls.
POLYGON, FIRST_CORNER, FACES, LEFT, CORNER, TRIED, ROUND, STATE = range(8)


def cut(vertices, corners, sizes):
    """
    Cut polygons into triangles.

    Python hears signals all the while.

    Parameters
    ----------
    vertices : (V, 3) float64 [m]
        All different.
    corners : (sum of sizes,) int64
        Vertices of the polygons, one after the other.
    sizes : (P,) int64
        At least 3 each.

    Returns
    -------
    faces : (sum of sizes - 2 P, 3) int64
        Some may have no area.
    polygons : (as many,) int64
        Which polygon each is part of.
    remarks : (P,) uint8
        Bits of each: NOT_FLAT, by more than FLATNESS; CROSSING itself, cut somehow.

    """
    most = int(sizes.max(initial=3))
    faces = np.empty((len(corners) - 2 * len(sizes), 3), np.int64)
    remarks, state = np.zeros(len(sizes), np.uint8), np.zeros(STATE, np.int64)
    flat, ring = np.empty((most, 3)), np.empty((most, 4), np.int64)
    while state[POLYGON] < len(sizes):
        _cut_some(vertices, corners, sizes, flat, ring, state, faces, remarks)
    return faces, np.repeat(np.arange(len(sizes)), sizes - 2), remarks


# Columns of `ring`, a row for each corner of the polygon: the corners before and after it of those
# that are left, what is known of it, and its vertex. Columns of `flat`: its place in the plane of
# the polygon; in the first row also by how much places may be off.
BEFORE, AFTER, KNOWN, AT = range(4)
SLACK = 2


@law
def _cut_some(vertices, corners, sizes, flat, ring, state, faces, remarks):
    """Go on from the state until all is cut or the budget is used up."""
    work = 0
    while state[POLYGON] < len(sizes) and work < BUDGET:
        p, start = state[POLYGON], state[FIRST_CORNER]
        n = sizes[p]
        if n > 3:
            if state[LEFT] == 0:
                remarks[p] |= _lay_flat(vertices, corners, start, n, flat, ring)
                state[LEFT], state[CORNER], state[TRIED], state[ROUND] = n, 1, 0, SPIKES
            work += _cut_ears(flat, ring, state, faces, remarks, BUDGET - work)
            if state[LEFT] > 3:
                break
            b = state[CORNER]
            a, c = ring[b, BEFORE], ring[b, AFTER]
            if _left_of(flat, a, b, c) < 0.0:
                remarks[p] |= CROSSING
            _write(faces[state[FACES]], ring, a, b, c)
        else:
            faces[state[FACES]] = corners[start:start + 3]
        work += n
        state[POLYGON], state[FIRST_CORNER] = p + 1, start + n
        state[FACES], state[LEFT] = state[FACES] + 1, 0


@kernel
def _arm(vertices, corners, start, k):
    """Corner k of a polygon from its first."""
    a, b = corners[start], corners[start + k]
    return (vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1],
            vertices[b, 2] - vertices[a, 2])


@kernel
def _lay_flat(vertices, corners, start, n, flat, ring):
    """Write the corners of a polygon in its plane, in which it turns left; give remarks."""
    area, reach = (0.0, 0.0, 0.0), 0.0
    for k in range(1, n):
        arm = _arm(vertices, corners, start, k)
        part = cross(_arm(vertices, corners, start, k - 1), arm)
        area = (area[0] + part[0], area[1] + part[1], area[2] + part[2])
        reach = max(reach, largest(arm))
    size = sqrt(dot(area, area))
    normal = (area[0] / size, area[1] / size, area[2] / size) if size > 0.0 else (0.0, 0.0, 1.0)
    least = min(abs(normal[0]), min(abs(normal[1]), abs(normal[2])))
    axis = (1.0, 0.0, 0.0) if least == abs(normal[0]) else (
        (0.0, 1.0, 0.0) if least == abs(normal[1]) else (0.0, 0.0, 1.0))
    first = cross(axis, normal)
    second = cross(normal, first)
    off = 0.0
    for k in range(n):
        arm = _arm(vertices, corners, start, k)
        off = max(off, abs(dot(arm, normal)))
        flat[k, 0], flat[k, 1] = dot(arm, first), dot(arm, second)
        ring[k, BEFORE], ring[k, AFTER] = (k - 1) % n, (k + 1) % n
        ring[k, KNOWN], ring[k, AT] = OPEN, corners[start + k]
    flat[0, SLACK] = ROUNDING * reach
    return NOT_FLAT if off > FLATNESS * reach else 0


@kernel
def _cut_ears(flat, ring, state, faces, remarks, budget):
    """
    Cut off corners until three are left or the budget is used up; give what was used.

    First go those that run back along the edge that leads to them, later as soon as one comes up;
    then ears. Where there is none a corner on a straight line goes. Where there is none either the
    polygon crosses itself, and the rest is cut as it comes.
    """
    work, k = 0, state[CORNER]
    while state[LEFT] > 3 and work < budget:
        a, c = ring[k, BEFORE], ring[k, AFTER]
        work += 1
        if state[ROUND] == SPIKES:
            cut_off = _is_spike(flat, a, k, c)
        elif state[ROUND] <= SEARCH_AGAIN:
            cut_off = ring[k, KNOWN] == OPEN and (
                _is_spike(flat, a, k, c) or _is_ear(flat, ring, k))
            work += state[LEFT] if ring[k, KNOWN] == OPEN else 0
            ring[k, KNOWN] = NO_EAR
        else:
            cut_off = state[ROUND] == CROSSED or _left_of(flat, a, k, c) == 0.0
        if cut_off:
            _write(faces[state[FACES]], ring, a, k, c)
            ring[a, AFTER], ring[c, BEFORE] = c, a
            ring[a, KNOWN] = ring[c, KNOWN] = OPEN
            state[FACES], state[LEFT], state[TRIED] = state[FACES] + 1, state[LEFT] - 1, 0
            if state[ROUND] > SEARCH and state[ROUND] != CROSSED:
                state[ROUND] = SEARCH
            k = a if _is_spike(flat, ring[a, BEFORE], a, c) else c
        else:
            k = c
            state[TRIED] += 1
            if state[TRIED] == state[LEFT]:
                state[TRIED], state[ROUND] = 0, state[ROUND] + 1
                _forget(ring, k, state[LEFT])
    if state[ROUND] == CROSSED:
        remarks[state[POLYGON]] |= CROSSING
    state[CORNER] = k
    return work


@kernel
def _write(face, ring, a, b, c):
    """Make a face of three corners."""
    face[0], face[1], face[2] = ring[a, AT], ring[b, AT], ring[c, AT]


@kernel
def _forget(ring, k, count):
    """Know nothing any more of the corners that are left."""
    for _ in range(count):
        ring[k, KNOWN] = OPEN
        k = ring[k, AFTER]


@kernel
def _left_of(flat, a, b, c):
    """Twice the area of a triangle, positive if it turns left; 0 if rounding may have made it."""
    bx, by = flat[b, 0] - flat[a, 0], flat[b, 1] - flat[a, 1]
    cx, cy = flat[c, 0] - flat[a, 0], flat[c, 1] - flat[a, 1]
    area = bx * cy - by * cx
    return area if abs(area) > flat[0, SLACK] * (abs(bx) + abs(by) + abs(cx) + abs(cy)) else 0.0


@kernel
def _is_spike(flat, a, b, c):
    """Whether the edge from corner b runs back along that to it, or has no length."""
    back = ((flat[a, 0] - flat[b, 0]) * (flat[c, 0] - flat[b, 0])
            + (flat[a, 1] - flat[b, 1]) * (flat[c, 1] - flat[b, 1]))
    return back >= 0.0 and _left_of(flat, a, b, c) == 0.0


@kernel
def _is_ear(flat, ring, b):
    """Whether corner b turns left and nothing of the polygon lies in its triangle."""
    a, c = ring[b, BEFORE], ring[b, AFTER]
    if not _left_of(flat, a, b, c) > 0.0:
        return False
    low_x = min(flat[a, 0], min(flat[b, 0], flat[c, 0]))
    high_x = max(flat[a, 0], max(flat[b, 0], flat[c, 0]))
    low_y = min(flat[a, 1], min(flat[b, 1], flat[c, 1]))
    high_y = max(flat[a, 1], max(flat[b, 1], flat[c, 1]))
    d = ring[c, AFTER]
    while d != a:
        if (low_x <= flat[d, 0] and flat[d, 0] <= high_x and low_y <= flat[d, 1]
                and flat[d, 1] <= high_y and _is_in_the_way(flat, ring, a, b, c, d)):
            return False
        d = ring[d, AFTER]
    return True


@kernel
def _is_in_the_way(flat, ring, a, b, c, d):
    """Whether a corner d lies in the triangle a, b, c, or an edge leads into it from there."""
    if ring[d, AT] == ring[a, AT] or ring[d, AT] == ring[c, AT]:
        return False        # what an edge leads to from there is in the way itself
    one, two = _left_of(flat, a, b, d), _left_of(flat, b, c, d)
    if ring[d, AT] == ring[b, AT] or (one == 0.0 and two == 0.0):
        return (_leads_into(flat, ring[d, BEFORE], a, b, b, c)
                or _leads_into(flat, ring[d, AFTER], a, b, b, c))
    if one < 0.0 or two < 0.0 or _left_of(flat, c, a, d) < 0.0:
        return False
    if one == 0.0:
        return (_leads_into(flat, ring[d, BEFORE], a, b, a, b)
                or _leads_into(flat, ring[d, AFTER], a, b, a, b))
    if two == 0.0:
        return (_leads_into(flat, ring[d, BEFORE], b, c, b, c)
                or _leads_into(flat, ring[d, AFTER], b, c, b, c))
    return True


@kernel
def _leads_into(flat, f, a, b, c, d):
    """Whether corner f lies to the left of the edges a b and c d."""
    return _left_of(flat, a, b, f) > 0.0 and _left_of(flat, c, d, f) > 0.0
