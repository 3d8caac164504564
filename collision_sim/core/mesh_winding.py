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
first triangle of each connected part is. The mesh is closed if then each edge is passed as often
one way as the other: by two triangles, or by four and more where parts touch. If it is not, the
triangles at such edges are tried in pairs, as they are listed. A part of a closed mesh with a
negative volume is turned outward, unless it may be the wall of a cavity: it lies in the box of a
part that is not.
"""

from collision_sim.core.jit import kernel, law
from collision_sim.core.mesh_build import edge_numbers
import numpy as np

NONE = -1               # no side that one is joined with


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
        Number of the connected part that each triangle belongs to; those of a closed mesh are
        closed.
    closed : bool
        Whether each edge is passed as often one way as the other.

    """
    edges = edge_numbers(faces)
    pairs = (np.bincount(edges.ravel()) == 2)[edges]
    listed = joined_sides(edges)
    turned, parts = connected(faces, np.where(pairs, listed, NONE))
    if pairs.all() and _is_balanced(faces, edges, turned):
        return _reversed(faces, turned), parts, True
    if not _is_balanced(faces, edges, turned):
        other = connected(faces, listed)[0]
        if not _is_balanced(faces, edges, other):
            return _reversed(faces, turned), parts, False
        turned = other
    faces = _reversed(faces, turned)
    return faces, closed_parts(faces, parts), True


def closed_parts(faces, groups):
    """
    Divide triangles that pass each edge as often one way as the other into closed parts.

    Parameters
    ----------
    faces : (T, 3) int64
        Vertices of the triangles.
    groups : (T,) int64
        Triangles of the same group are joined before others, where there is a choice.

    Returns
    -------
    parts : (T,) int64

    """
    edges, ahead = edge_numbers(faces), (faces < np.roll(faces, -1, axis=1)).ravel()
    order = np.lexsort((np.repeat(groups, 3), ahead, edges.ravel()))
    key = 2 * edges.ravel()[order] + ahead[order]
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order)) - np.searchsorted(key, key)
    return connected(faces, joined_sides(edges, ahead, rank))[1]


def joined_sides(edges, *keys):
    """
    Join the sides of triangles at each edge in pairs.

    Parameters
    ----------
    edges : (T, 3) int64
        Numbers of edges; side 3 t + k of triangle t is that from corner k to the next.
    *keys : (3 T,) array
        What the sides at an edge are sorted by, the most important one last; none: as listed.

    Returns
    -------
    joined : (T, 3) int64
        The side that each is joined with; NONE where an odd number of triangles share the edge.

    """
    flat = edges.ravel()
    order = np.lexsort((*keys, flat))
    pairs = order[(np.bincount(flat) % 2 == 0)[flat[order]]].reshape(-1, 2)
    joined = np.full(len(flat), NONE)
    joined[pairs] = pairs[:, ::-1]
    return joined.reshape(edges.shape)


def _is_balanced(faces, edges, turned):
    """Whether triangles, some of them turned, pass each edge as often one way as the other."""
    ahead = (faces < np.roll(faces, -1, axis=1)) != turned[:, None]
    return not np.bincount(edges.ravel(), np.where(ahead, 1.0, -1.0).ravel()).any()


def _reversed(faces, turned):
    return np.where(turned[:, None], faces[:, ::-1], faces)


@law
def connected(faces, joined):
    """Find which triangles to turn so that joined ones are alike, and which hang together."""
    turned, parts = np.zeros(len(faces), np.bool_), np.full(len(faces), NONE)
    todo, count = np.empty(len(faces), np.int64), 0
    for seed in range(len(faces)):
        if parts[seed] != NONE:
            continue
        parts[seed], todo[0], top = count, seed, 1
        while top > 0:
            top -= 1
            t = todo[top]
            for k in range(3):
                if joined[t, k] != NONE:
                    other, turn = _beyond(faces, joined[t, k], t, k)
                    if parts[other] == NONE:
                        parts[other], turned[other], todo[top] = count, turned[t] != turn, other
                        top += 1
        count += 1
    return turned, parts


@kernel
def _beyond(faces, side, t, k):
    """Triangle with a side that is joined with side k of t, and whether it is turned otherwise."""
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
