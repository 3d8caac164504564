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
Building of the grid of cells over a mesh: labels, and which triangles come into each cell.

The finer the grid, the fewer points are near the surface; it is as fine as its size and that of
the lists allow.
"""

from collision_sim.core.jit import kernel, law
from collision_sim.core.mesh import is_in_front, nearest_of_all, NORMAL
from collision_sim.core.mesh_cells import (cell_index, CELLS, centre_of, EDGE_LENGTH, GRID_LOW,
                                           INSIDE, NEAR_INSIDE, NEAR_OUTSIDE, OUTSIDE)
import numpy as np

CELLS_PER_TRIANGLE, FEWEST_CELLS, MOST_CELLS = 64, 2 ** 12, 2 ** 20
ENTRIES_PER_TRIANGLE, FEWEST_ENTRIES = 16, 2 ** 20      # most in all lists together
UNKNOWN = 255           # label of a cell that is not done yet
SLACK = 1e-9            # relative to a cell: so much further a triangle is taken to reach
SHIFT = 0.6180339887498949      # of the grid, in cells, so that faces miss the centres of cells


def fit_grid(corners):
    """
    Give the edge length of the cells [m], and how many there are along each axis.

    Parameters
    ----------
    corners : (T, 3, 3) float64 [m]
        Of the triangles.

    Returns
    -------
    h : float [m]
    low : (3,) float64 [m]
        Corner of the grid: more than a cell beyond the mesh, as on the other side.
    counts : (3,) float64

    """
    low = corners.min(axis=(0, 1))
    extent, spans = corners.max(axis=(0, 1)) - low, corners.max(axis=1) - corners.min(axis=1)
    most = min(max(CELLS_PER_TRIANGLE * len(corners), FEWEST_CELLS), MOST_CELLS)
    h = _finest(extent, most)
    while np.prod(np.floor(spans / h) + 2.0, axis=1).sum() > max(
            ENTRIES_PER_TRIANGLE * len(corners), FEWEST_ENTRIES) and h < extent.max():
        h *= 1.25
    return h, low - (1.0 + SHIFT) * h, np.ceil(extent / h) + 3.0


def _finest(extent, most):
    """Edge length [m] of the cells of a grid of at most so many."""
    fine, coarse = extent.max() / most, extent.max()
    for _ in range(64):
        h = np.sqrt(fine * coarse)
        fits = np.prod(np.ceil(extent / h) + 3.0) <= most
        fine, coarse = (fine, h) if fits else (h, coarse)
    return coarse


@law
def list_triangles(head, triangles):
    """
    Give the triangles that come into each cell.

    Parameters
    ----------
    head : (1, mesh_cells.HEAD) float64
        Of the mesh by itself.
    triangles : (T, mesh.TRIANGLE) float64
        Of the mesh.

    Returns
    -------
    starts : (G,) int32
        Where the list of each cell begins; it ends where the next one begins.
    listed : (L,) int32
        Triangles.

    """
    counts = (int(head[0, CELLS]), int(head[0, CELLS + 1]), int(head[0, CELLS + 2]))
    starts = np.zeros(counts[0] * counts[1] * counts[2], np.int32)
    span, none = np.empty((2, 3), dtype=np.int64), np.empty(0, np.int32)
    for t in range(len(triangles)):
        _enter(head, triangles, t, span, starts, none)
    total = 0
    for g in range(len(starts)):
        starts[g], total = total, total + starts[g]
    listed = np.empty(total, np.int32)
    for t in range(len(triangles)):
        _enter(head, triangles, t, span, starts, listed)
    for g in range(len(starts) - 1, 0, -1):
        starts[g] = starts[g - 1]
    starts[0] = 0
    return starts, listed


@kernel
def _enter(head, triangles, t, span, starts, listed):
    """Count triangle t in `starts` for the cells it may come into, or enter it in their lists."""
    h = head[0, EDGE_LENGTH]
    for k in range(3):
        a, b, c = triangles[t, k], triangles[t, 3 + k], triangles[t, 6 + k]
        span[0, k] = int((min(a, min(b, c)) - head[0, GRID_LOW + k]) / h - SLACK)
        span[1, k] = int((max(a, max(b, c)) - head[0, GRID_LOW + k]) / h + SLACK)
    n = (triangles[t, NORMAL], triangles[t, NORMAL + 1], triangles[t, NORMAL + 2])
    reach = (0.5 + SLACK) * h * (abs(n[0]) + abs(n[1]) + abs(n[2]))
    for i in range(span[0, 0], span[1, 0] + 1):
        for j in range(span[0, 1], span[1, 1] + 1):
            for k in range(span[0, 2], span[1, 2] + 1):
                p = centre_of(head, 0, i, j, k)
                away = (n[0] * (p[0] - triangles[t, 0]) + n[1] * (p[1] - triangles[t, 1])
                        + n[2] * (p[2] - triangles[t, 2]))
                if abs(away) <= reach:
                    g = cell_index(head, 0, i, j, k)
                    if len(listed) > 0:
                        listed[starts[g]] = t
                    starts[g] += 1


@law
def label_cells(meshes, closed):
    """Write the labels of the cells of a mesh by itself, whose lists are there."""
    heads, cells, starts = meshes.heads, meshes.cells, meshes.starts
    counts = (int(heads[0, CELLS]), int(heads[0, CELLS + 1]), int(heads[0, CELLS + 2]))
    for g in range(len(cells)):
        near = g + 1 < len(cells) and starts[g + 1] > starts[g]
        cells[g] = NEAR_OUTSIDE if near else UNKNOWN
    todo = np.empty(len(cells), dtype=np.int64)
    _fill(cells, counts, todo, 0, OUTSIDE)
    for g in range(len(cells)):
        if cells[g] == UNKNOWN:
            _fill(cells, counts, todo, g, INSIDE if closed and _is_within(meshes, counts, g)
                  else OUTSIDE)
        elif cells[g] == NEAR_OUTSIDE and closed and _is_within(meshes, counts, g):
            cells[g] = NEAR_INSIDE


@kernel
def _fill(cells, counts, todo, seed, label):
    """Label all UNKNOWN cells that hang together with a seed."""
    todo[0], top, cells[seed] = seed, 1, label
    while top > 0:
        top -= 1
        g = todo[top]
        place = (g // (counts[1] * counts[2]), g // counts[2] % counts[1], g % counts[2])
        stride = (counts[1] * counts[2], counts[2], 1)
        for axis in range(3):
            for way in (-1, 1):
                other = g + way * stride[axis]
                if 0 <= place[axis] + way < counts[axis] and cells[other] == UNKNOWN:
                    cells[other] = label
                    todo[top] = other
                    top += 1


@kernel
def _is_within(meshes, counts, g):
    """Whether the centre of cell g is inside a closed mesh."""
    p = centre_of(meshes.heads, 0, g // (counts[1] * counts[2]), g // counts[2] % counts[1],
                  g % counts[2])
    d, t, feature, q = nearest_of_all(meshes, 0, p)
    return not is_in_front(meshes, t, feature, q, p)
