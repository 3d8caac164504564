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
The arrays of mesh.Meshes from corners and faces: normals of the features, tree, cells.

Done once when a simulation starts, with faces that mesh_files.py has checked.
"""

from collision_sim.core.jit import kernel, law
from collision_sim.core.mesh import (CORNER, COUNT, EDGE, FEATURES, Meshes, NEXT, NORMAL,
                                     TRIANGLE, VERTEX)
from collision_sim.core.mesh_cells import (BOX_HIGH, BOX_LOW, CELLS, CLOSED, EDGE_LENGTH, EXTENT,
                                           FIRST_CELL, FIRST_NODE, GRID_LOW, HEAD, LAST_NODE)
from collision_sim.core.mesh_grid import fit_grid, label_cells, list_triangles
from collision_sim.core.mesh_tree import tree
import numpy as np

FLAT = 1e-9             # rad between the normals of neighbours in one flat surface


def mesh_arrays(vertices, faces, closed):
    """
    Build the arrays of one mesh.

    Parameters
    ----------
    vertices : (V, 3) float64 [m]
        All different.
    faces : (T, 3) int64
        Triangles that have an area; of a closed mesh with their corners turning left as seen from
        outside.
    closed : bool
        Whether the triangles pass each edge as often one way as the other.

    Returns
    -------
    meshes : mesh.Meshes
        With one head.

    """
    corners = vertices[faces]
    order, nodes = tree(corners.min(axis=1).T.copy(), corners.max(axis=1).T.copy())
    faces, corners = faces[order], corners[order]
    normals, areas = face_normals(corners)
    edges, whole = matched_edges(faces, closed)
    patches = flat_patches(edges, whole, normals)
    normals = patch_normals(patches, normals, areas)
    triangles = np.empty((len(faces), TRIANGLE))
    triangles[:, CORNER:NORMAL] = corners.reshape(-1, 9)
    triangles[:, NORMAL:] = normals
    features = np.empty((len(faces), FEATURES), dtype=np.float32)
    features[:, :9] = edge_normals(edges, whole, normals).reshape(-1, 9)
    features[:, 9:] = vertex_normals(faces, corners, whole, normals).reshape(-1, 9)
    heads = _head(corners, closed, len(nodes))[None]
    starts, listed = list_triangles(heads, triangles)
    meshes = Meshes(heads, nodes, triangles, features,
                    sharp_features(edges, faces, whole, patches),
                    np.empty(len(starts), dtype=np.uint8), starts, listed)
    label_cells(meshes, closed)
    return meshes


def joined(parts):
    """Give meshes, each by itself, as one mesh.Meshes."""
    heads = np.concatenate([part.heads for part in parts])
    nodes = np.concatenate([part.nodes for part in parts])
    sizes = np.array([[len(part.nodes), len(part.triangles), len(part.cells), len(part.listed)]
                      for part in parts])
    starts = np.cumsum(sizes, axis=0) - sizes
    heads[:, FIRST_NODE] += starts[:, 0]
    heads[:, LAST_NODE] += starts[:, 0]
    heads[:, FIRST_CELL] += starts[:, 2]
    leaf = nodes[:, COUNT] > 0.0
    nodes[:, NEXT] += np.where(leaf, *np.repeat(starts[:, [1, 0]], sizes[:, 0], axis=0).T)
    together = Meshes(heads, nodes, *(np.concatenate(arrays) for arrays in list(zip(*parts))[2:]))
    together.starts[:] += np.repeat(starts[:, 3], sizes[:, 2]).astype(np.int32)
    together.listed[:] += np.repeat(starts[:, 1], sizes[:, 3]).astype(np.int32)
    return together


def face_normals(corners):
    """Give the unit normals (T, 3) and areas (T,) [m^2] of triangles (T, 3, 3)."""
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.sqrt(np.square(cross).sum(axis=1))
    return cross / size[:, None], 0.5 * size


def matched_edges(faces, closed):
    """
    Edges of faces (T, 3): the number of each, and whether it has a normal.

    It has one if two faces share it, once in each sense. So has each edge of a closed mesh, those
    with more faces included, where parts touch: the sign of the normal holds for any solid.

    Returns
    -------
    edges : (T, 3) int64
    whole : (T, 3) bool

    """
    edges, ahead = edge_numbers(faces), faces < np.roll(faces, -1, axis=1)
    if closed:
        return edges, np.ones(faces.shape, dtype=bool)
    count = np.bincount(edges.ravel())
    balance = np.bincount(edges.ravel(), weights=np.where(ahead, 1, -1).ravel())
    return edges, ((count == 2) & (balance == 0))[edges]


def edge_numbers(faces):
    """Give the edges of faces (T, 3), each from a corner to the next, the same numbers, (T, 3)."""
    ends = np.stack([faces, np.roll(faces, -1, axis=1)])
    keys = ends.min(axis=0) * (faces.max() + 1) + ends.max(axis=0)
    return np.unique(keys, return_inverse=True)[1].reshape(faces.shape)


@law
def flat_patches(edges, whole, normals):
    """Give triangles of the same flat surface, across whole edges, the same number, (T,)."""
    last = np.full(edges.max() + 1, -1)
    patches = np.arange(len(edges))
    for t in range(len(edges)):
        for k in range(3):
            edge, other = edges[t, k], last[edges[t, k]]
            last[edge] = t
            if other < 0 or not whole[t, k]:
                continue
            a, b = normals[t], normals[other]
            turn = np.sqrt((a[1] * b[2] - a[2] * b[1]) ** 2 + (a[2] * b[0] - a[0] * b[2]) ** 2
                           + (a[0] * b[1] - a[1] * b[0]) ** 2)
            if turn < FLAT and a[0] * b[0] + a[1] * b[1] + a[2] * b[2] > 0.0:
                one, two = _root(patches, t), _root(patches, other)
                patches[max(one, two)] = min(one, two)
    for t in range(len(edges)):
        patches[t] = _root(patches, t)
    return patches


@kernel
def _root(patches, t):
    while patches[t] != t:
        patches[t] = patches[patches[t]]
        t = patches[t]
    return t


def _sums(groups, count, values):
    """Sum values (..., 3) over equal numbers in groups (...), (count, 3)."""
    flat = values.reshape(-1, 3)
    return np.stack([np.bincount(groups.ravel(), flat[:, k], count) for k in range(3)], axis=1)


def patch_normals(patches, normals, areas):
    """Give all triangles of a flat surface the same unit normal, to the last bit."""
    alone = np.bincount(patches, minlength=len(patches))[patches] == 1
    sums = _sums(patches, len(patches), areas[:, None] * normals)[patches]
    same = np.all(normals == normals[patches], axis=1)
    kept = alone | (np.bincount(patches, ~same, len(patches))[patches] == 0)
    sizes = np.sqrt(np.square(sums).sum(axis=1, keepdims=True))
    return np.where(kept[:, None], normals, sums / sizes)


def edge_normals(edges, whole, normals):
    """Add the normals of the faces at each edge, (T, 3, 3); 0 where it has none."""
    sums = _sums(edges, edges.max() + 1, np.repeat(normals[:, None], 3, axis=1))
    return np.where(whole[..., None], sums[edges], 0.0)


def vertex_normals(faces, corners, whole, normals):
    """Add the normals at each corner, weighted by angle, (T, 3, 3); 0 on a rim."""
    on, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    angle = np.arctan2(np.sqrt(np.square(np.cross(on, back)).sum(axis=2)), (on * back).sum(axis=2))
    sums = _sums(faces, faces.max() + 1, angle[..., None] * normals[:, None])
    return np.where(on_rim(faces, whole)[faces][..., None], 0.0, sums[faces])


def on_rim(faces, whole):
    """Whether each vertex (V,) is the end of an edge that is not whole."""
    rim = np.zeros(faces.max() + 1, dtype=bool)
    rim[faces[~whole]] = True
    rim[np.roll(faces, -1, axis=1)[~whole]] = True
    return rim


def sharp_features(edges, faces, whole, patches):
    """Bit f - 1 of (T,) uint8 for each feature f that is no part of a flat surface."""
    bits = np.zeros(len(faces), dtype=np.uint8)
    for groups, torn, feature in ((edges, ~whole, EDGE),
                                  (faces, on_rim(faces, whole)[faces], VERTEX)):
        least, most = np.full(groups.max() + 1, len(faces)), np.full(groups.max() + 1, -1)
        np.minimum.at(least, groups, patches[:, None])
        np.maximum.at(most, groups, patches[:, None])
        sharp = torn | (least < most)[groups]
        for k in range(3):
            bits |= sharp[:, k].astype(np.uint8) << np.uint8(feature - EDGE + k)
    return bits


def _head(corners, closed, nodes):
    """Row of the heads of a mesh by itself."""
    head, points = np.zeros(HEAD), corners.reshape(-1, 3)
    head[LAST_NODE], head[CLOSED] = nodes, closed
    head[EXTENT] = np.sqrt(np.square(points).sum(axis=1).max())
    head[BOX_LOW:BOX_HIGH], head[BOX_HIGH:GRID_LOW] = points.min(axis=0), points.max(axis=0)
    (head[EDGE_LENGTH], head[GRID_LOW:EDGE_LENGTH],
     head[CELLS:FIRST_CELL]) = fit_grid(corners)
    return head
