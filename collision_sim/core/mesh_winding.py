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
Which way round the triangles of a mesh are turned, and whether they close a body.

Neighbours across an edge that exactly two triangles share are turned the same way round, as the
first triangle of each connected part is. A part of a closed mesh with a negative volume is turned
outward, unless it may be the wall of a cavity: it lies in the box of a part that is not.
"""

from collision_sim.core.jit import kernel, law
from collision_sim.core.mesh_build import edge_numbers
import numpy as np


def turn_alike(faces):
    """
    Turn neighbours the same way round.

    Parameters
    ----------
    faces : (T, 3) int64
        Vertices of the triangles.

    Returns
    -------
    faces : (T, 3) int64
    parts : (T,) int64
        Number of the connected part that each triangle belongs to.
    closed : bool
        Whether all edges have two triangles that are turned alike.

    """
    edges = edge_numbers(faces)
    pairs = np.bincount(edges.ravel()) == 2
    turned, parts, alike = _spread(faces, edges, pairs)
    return np.where(turned[:, None], faces[:, ::-1], faces), parts, bool(pairs.all() and alike)


@law
def _spread(faces, edges, pairs):
    """Give which triangles to turn, their parts, and whether all neighbours are then alike."""
    sides = np.full((len(pairs), 2), -1)
    for t in range(len(faces)):
        for k in range(3):
            edge = edges[t, k]
            if pairs[edge]:
                sides[edge, 0 if sides[edge, 0] < 0 else 1] = 3 * t + k
    turned, parts, alike = np.zeros(len(faces), np.bool_), np.full(len(faces), -1), True
    todo, count = np.empty(len(faces), np.int64), 0
    for seed in range(len(faces)):
        if parts[seed] >= 0:
            continue
        parts[seed], todo[0], top = count, seed, 1
        while top > 0:
            top -= 1
            t = todo[top]
            for k in range(3):
                if not pairs[edges[t, k]]:
                    continue
                other, turn = _neighbour(faces, sides[edges[t, k]], t, k)
                if parts[other] < 0:
                    parts[other], turned[other], todo[top] = count, turned[t] != turn, other
                    top += 1
                elif turned[other] != (turned[t] != turn):
                    alike = False
        count += 1
    return turned, parts, alike


@kernel
def _neighbour(faces, sides, t, k):
    """Triangle beyond edge k of triangle t, and whether it is turned the other way round."""
    side = sides[1] if sides[0] == 3 * t + k else sides[0]
    return side // 3, faces[side // 3, side % 3] == faces[t, k]


def turn_outward(vertices, faces, parts):
    """
    Turn the parts of a closed mesh outward.

    Parameters
    ----------
    vertices : (V, 3) float64 [m]
        Of the mesh.
    faces, parts
        As from `turn_alike`.

    Returns
    -------
    faces : (T, 3) int64

    """
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    volumes = np.bincount(parts, (a * np.cross(b, c)).sum(axis=1))
    lows, highs = np.full((len(volumes), 3), np.inf), np.full((len(volumes), 3), -np.inf)
    for corner in (a, b, c):
        np.minimum.at(lows, parts, corner)
        np.maximum.at(highs, parts, corner)
    turned = (volumes < 0.0) & ~_lies_in_other(volumes, lows, highs)
    return np.where(turned[parts][:, None], faces[:, ::-1], faces)


@law
def _lies_in_other(volumes, lows, highs):
    """Whether each part of negative volume lies in the box of one with a positive volume."""
    found, outer = np.zeros(len(volumes), np.bool_), np.flatnonzero(volumes > 0.0)
    for i in np.flatnonzero(volumes < 0.0):
        for j in outer:
            if np.all(lows[j] < lows[i]) and np.all(highs[i] < highs[j]):
                found[i] = True
                break
    return found
