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
The surface of the union of closed parts that touch, overlap or lie in each other.

Triangles that others come through are cut, and what lies within the solid or is there twice goes
(mesh_cuts.py). What is the same to rounding becomes the same: a corner that lies on an edge
becomes one of the triangles on both sides of it, so that the surface closes to the last bit.
"""

from collision_sim.core.mesh_build import edge_numbers, face_normals
from collision_sim.core.mesh_cuts import (boxes_that_meet, cut, SHEET, states_of, SURFACE,
                                          that_touch)
from collision_sim.core.mesh_loops import closed_triangles, together
from collision_sim.core.mesh_winding import connected, joined_sides, NONE
import numpy as np

ROUNDINGS = 1e-12, 1e-10, 1e-8, 1e-6        # relative: what is the same; tried in turn
GOLDEN = 0.6180339887498949
NEAR = 4.0              # times that: how far apart two roundings of a corner may be


def surface_of_parts(vertices, faces, parts):
    """
    Find the surface of the union of the parts of a mesh.

    Parameters
    ----------
    vertices : (V, 3) float64 [m]
        All different.
    faces : (T, 3) int64
        Triangles that pass each edge as often one way as the other; seen from outside their
        corners turn left.
    parts : (T,) int64
        Closed part that each triangle belongs to.

    Returns
    -------
    (vertices, faces) or None
        Of the surface; None if there are sheets without thickness. Where no surface is found that
        closes, the parts are left as they are.

    """
    order = np.argsort(parts, kind='stable')
    faces, parts = faces[order], parts[order]
    size = np.abs(vertices).max()
    if not (has_flat_part(vertices[faces], parts)
            or _some_meet(vertices[faces], parts, ROUNDINGS[0] * size)):
        return vertices, faces
    for rounding in ROUNDINGS:
        surface = _surface(vertices, faces, parts, rounding * size)
        if surface is None or len(surface[1]):
            return surface
    return vertices, faces


def has_flat_part(corners, parts):
    """Whether a part of triangles (T, 3, 3) has no volume, to rounding."""
    a, b, c = np.moveaxis(corners, 1, 0)
    volume = np.bincount(parts, (a * np.cross(b, c)).sum(axis=1) / 3.0)
    area = np.bincount(parts, np.sqrt(np.square(np.cross(b - a, c - a)).sum(axis=1)))
    return bool((np.abs(volume) <= ROUNDINGS[0] * np.abs(corners).max() * area).any())


def _some_meet(corners, parts, distance):
    """Whether the boxes of some parts come as near to each other as a distance [m]."""
    low, high, _ = _boxes(corners, parts)
    number = np.arange(len(low))
    return len(boxes_that_meet(low, high + distance, number, number[:, None])) > 0


def _boxes(corners, parts):
    """Low and high corners (M, 3) of the boxes of parts, in order, and their first triangles."""
    first = np.flatnonzero(np.diff(parts, prepend=-1))
    return (np.minimum.reduceat(corners.min(axis=1), first),
            np.maximum.reduceat(corners.max(axis=1), first), np.append(first, len(parts)))


def _surface(vertices, faces, parts, tolerance):
    """Surface as `surface_of_parts`, without faces where it does not close."""
    faces = together(vertices, NEAR * tolerance)[faces]
    kept = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    faces, parts = faces[kept], parts[kept]
    corners = vertices[faces]
    triangles = np.concatenate([corners.reshape(-1, 9), face_normals(corners)[0]], axis=1)
    touched, starts, others = _touching(triangles, corners, faces, parts, tolerance)
    points, sizes, counts = cut(triangles, touched, starts, others, tolerance)
    owners = np.repeat(touched, counts)
    groups, seeds = _untouched(faces, touched)
    places = np.concatenate([_places_in(points, sizes), _places_in(
        corners[seeds].reshape(-1, 3), np.full(len(seeds), 3))])
    lows, highs, first = _boxes(corners, parts)
    states = states_of(triangles, first, lows, highs, places, np.concatenate([owners, seeds]),
                       NEAR * tolerance)
    if (states == SHEET).any():
        return None
    open_pieces, open_groups = np.split(states == SURFACE, [len(sizes)])
    hidden = np.bincount(owners[~open_pieces], minlength=len(faces)) > 0
    whole, free = ~hidden, groups != NONE
    whole[free] = open_groups[groups[free]]
    pieces = open_pieces & hidden[owners]
    return closed_triangles(vertices, faces[whole], points[np.repeat(pieces, sizes)],
                            sizes[pieces], NEAR * tolerance)


def _places_in(points, sizes):
    """Find a point (P, 3) in each piece, somewhere off its diagonals."""
    if not len(sizes):
        return np.empty((0, 3))
    starts = np.cumsum(sizes) - sizes
    weights = 1.0 + (GOLDEN * (np.arange(len(points)) - np.repeat(starts, sizes))) % 1.0
    sums = np.add.reduceat(np.column_stack([weights[:, None] * points, weights]), starts)
    return sums[:, :3] / sums[:, 3:]


def _touching(triangles, corners, faces, parts, tolerance):
    """
    Triangles that touch some that are not their neighbours, and these.

    Returns
    -------
    touched : (K,) int64
    starts : (K + 1,) int64
    others : (L,) int64
        Triangle touched[k] touches others[starts[k]:starts[k + 1]].

    """
    pairs = boxes_that_meet(corners.min(axis=1) - tolerance, corners.max(axis=1) + tolerance,
                            parts, faces)
    pairs = pairs[that_touch(triangles, pairs, tolerance)]
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    touched, starts = np.unique(pairs[:, 0], return_index=True)
    return touched, np.append(starts, len(pairs)), pairs[:, 1].copy()


def _untouched(faces, touched):
    """Find groups (T,) of triangles that hang together untouched, NONE: others; one of each."""
    free = np.ones(len(faces), dtype=bool)
    free[touched] = False
    edges = edge_numbers(faces)
    two = np.bincount(edges.ravel()) == 2
    joined = np.where(two[edges] & free[:, None], joined_sides(edges), NONE)
    joined[~free[joined // 3]] = NONE
    groups = np.where(free, connected(faces, joined)[1], NONE)
    _, first, numbers = np.unique(groups[free], return_index=True, return_inverse=True)
    groups[free] = numbers
    return groups, np.flatnonzero(free)[first]
