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
Triangles from pieces of triangles that fit together but for rounding, and for corners on edges.

Each piece is a loop of corners, convex but for rounding.
"""

import numpy as np

SKEW = np.array([0.5413, 0.3079, 0.7824])     # a direction in which few corners are level


def together(points, distance):
    """
    Find which points are the same.

    Parameters
    ----------
    points : (N, 3) float64 [m]
        In any order.
    distance : float [m]
        Points that are no further apart are the same, and the same as what these are.

    Returns
    -------
    same : (N,) int64
        The first point that each is the same as.

    """
    height = points @ SKEW
    order = np.argsort(height, kind='stable')
    pairs, shift = [], 1
    while shift < len(points):
        one, other = order[:-shift], order[shift:]
        level = height[other] - height[one] <= distance
        if not level.any():
            break
        one, other = one[level], other[level]
        near = np.square(points[one] - points[other]).sum(axis=1) <= distance ** 2
        pairs.append(np.stack([one[near], other[near]]))
        shift += 1
    same = np.arange(len(points))
    while pairs:
        one, other = np.concatenate(pairs, axis=1)
        least = np.minimum(same[one], same[other])
        if (same[one] == least).all() and (same[other] == least).all():
            break
        np.minimum.at(same, one, least)
        np.minimum.at(same, other, least)
        same = same[same]
    return same


def closed_triangles(vertices, faces, points, sizes, distance):
    """
    Make triangles that close a solid.

    Parameters
    ----------
    vertices, faces : (V, 3) float64 [m], (T, 3) int64
        Triangles that are part of it.
    points, sizes : (N, 3) float64 [m], (P,) int64
        Corners of the pieces that are part of it, one piece after the other; how many each has.
    distance : float [m]
        How far apart corners are that are the same.

    Returns
    -------
    vertices, faces : (V', 3) float64 [m], (T', 3) int64
        Without faces if they do not close.

    """
    first = len(vertices)
    vertices = np.concatenate([vertices, points])
    used = np.concatenate([np.unique(faces), np.arange(first, len(vertices))])
    same = np.arange(len(vertices))
    same[used] = used[together(vertices[used], distance)]
    faces, corners = same[faces], np.split(same[first:], np.cumsum(sizes)[:-1])
    loops = [_without_repeats(loop.tolist()) for loop in corners]
    loops = [loop for loop in loops if _is_wide(vertices, loop, distance)]
    edges = _edges(faces, loops)
    torn = edges[_are_open(edges)]
    loose = _are_open(edges)[:3 * len(faces)].reshape(-1, 3).any(axis=1)
    loops = faces[loose].tolist() + loops
    loops = _with_corners(loops, _corners_on_edges(vertices, torn, distance))
    cut = [face for loop in loops for face in _triangles(vertices, loop, distance)]
    faces = np.concatenate([faces[~loose], np.reshape(cut, (-1, 3)).astype(np.int64)])
    return vertices, faces[:0] if _are_open(_edges(faces, [])).any() else faces


def _edges(faces, loops):
    """Give the ends (E, 2) of all edges, in the sense in which they are passed."""
    on = [np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)]
    on += [np.stack([loop, np.roll(loop, -1)], axis=1) for loop in loops]
    return np.concatenate(on)


def _are_open(edges):
    """Whether each edge (E, 2) is passed more often one way than the other."""
    ahead = edges[:, 0] < edges[:, 1]
    keys = edges.min(axis=1) * (edges.max(initial=0) + 1) + edges.max(axis=1)
    _, numbers = np.unique(keys, return_inverse=True)
    return np.bincount(numbers, np.where(ahead, 1.0, -1.0))[numbers] != 0.0


def _corners_on_edges(vertices, edges, distance):
    """Find the ends of edges (E, 2) that lie on others: a dict from (a, b) to these in order."""
    corners = np.unique(edges)
    axis = int(np.argmax(np.ptp(vertices[corners], axis=0))) if len(corners) else 0
    corners = corners[np.argsort(vertices[corners, axis])]
    levels = vertices[corners, axis]
    found = {}
    for a, b in np.unique(np.sort(edges, axis=1), axis=0).tolist():
        low, high = sorted((vertices[a, axis], vertices[b, axis]))
        near = corners[np.searchsorted(levels, low - distance):
                       np.searchsorted(levels, high + distance, side='right')]
        near = near[(near != a) & (near != b)]
        along, arms = vertices[b] - vertices[a], vertices[near] - vertices[a]
        size = np.sqrt(along @ along)
        way = arms @ along / size
        off = np.square(arms - way[:, None] / size * along).sum(axis=1) <= distance ** 2
        on = near[off & (way > 0.0) & (way < size)]
        on = on[np.argsort(way[off & (way > 0.0) & (way < size)])].tolist()
        found[a, b], found[b, a] = on, on[::-1]
    return found


def _with_corners(loops, found):
    """Enter the corners that lie on the edges of loops."""
    return [[corner for a, b in zip(loop, loop[1:] + loop[:1])
             for corner in (a, *found.get((a, b), ()))] for loop in loops]


def _without_repeats(loop):
    """Leave out corners that are the same as the one before."""
    return [loop[k] for k in range(len(loop)) if loop[k] != loop[k - 1]]


def _is_wide(vertices, loop, distance):
    """Whether a loop is wider than a distance."""
    return len(loop) > 2 and _width(vertices[loop]) > distance


def _area(corners):
    """Twice the area vector [m^2] of a loop (N, 3)."""
    arms = corners[1:] - corners[0]
    return np.cross(arms[:-1], arms[1:]).sum(axis=0)


def _width(corners):
    """Twice the area of a loop (N, 3) over the greatest distance from its first corner [m]."""
    reach = np.square(corners - corners[0]).sum(axis=1).max()
    return float(np.sqrt(np.square(_area(corners)).sum() / reach))


def _triangles(vertices, loop, distance):
    """
    Cut a convex loop into triangles, the best shaped corner first.

    A corner is not cut off where the others would be left on a line.
    """
    triangles, loop = [], list(loop)
    while len(loop) > 3:
        corners = vertices[loop]
        before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
        area = np.sqrt(np.square(np.cross(corners - before, after - corners)).sum(axis=1))
        longest = np.max([np.square(side).sum(axis=1) for side in (
            corners - before, after - corners, before - after)], axis=0)
        for k in np.argsort(-area / longest, kind='stable'):
            rest = loop[:k] + loop[k + 1:]
            if _is_wide(vertices, rest, distance):
                break
        triangles.append([loop[k - 1], loop[k], loop[(k + 1) % len(loop)]])
        loop = rest
    return [*triangles, loop]
