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
The grid of cells over a mesh: what is known of a point before any triangle is looked at.

A cell that no triangle comes into lies outside or, of a closed mesh, inside as a whole. Of the
cells near the surface the grid says where their centres lie, and it lists the triangles that come
into them, which short ways are tested against. Beyond the grid all is outside.
"""

from collision_sim.core.jit import inlined

OUTSIDE, INSIDE, NEAR_OUTSIDE, NEAR_INSIDE = range(4)   # near: and where the centre of the cell is
FEW_CELLS = 3           # along an axis; of a box with more the tree is asked, not the cells
# Columns of a head: nodes of the mesh; 1 if it is closed; greatest distance of a corner from the
# origin [m]; low and high corner of its box [m]; of the grid low corner [m], edge length of a cell
# [m], cells along each axis, first cell.
FIRST_NODE, LAST_NODE, CLOSED, EXTENT, BOX_LOW, BOX_HIGH = 0, 1, 2, 3, 4, 7
GRID_LOW, EDGE_LENGTH, CELLS, FIRST_CELL, HEAD = 10, 13, 14, 17, 18


@inlined
def _place(heads, m, p, k):
    """Give coordinate k of p in cells from the low corner of the grid."""
    return (p[k] - heads[m, GRID_LOW + k]) / heads[m, EDGE_LENGTH]


@inlined
def is_in_grid(heads, m, p):
    """Whether a point lies in the grid of a mesh."""
    x, y, z = _place(heads, m, p, 0), _place(heads, m, p, 1), _place(heads, m, p, 2)
    return (0.0 <= x < heads[m, CELLS] and 0.0 <= y < heads[m, CELLS + 1]
            and 0.0 <= z < heads[m, CELLS + 2])


@inlined
def cell_index(heads, m, i, j, k):
    """Give the index of a cell of the grid of a mesh."""
    ny, nz = int(heads[m, CELLS + 1]), int(heads[m, CELLS + 2])
    return int(heads[m, FIRST_CELL]) + (i * ny + j) * nz + k


@inlined
def centre_of(heads, m, i, j, k):
    """Centre [m] of a cell."""
    h = heads[m, EDGE_LENGTH]
    return (heads[m, GRID_LOW] + (i + 0.5) * h, heads[m, GRID_LOW + 1] + (j + 0.5) * h,
            heads[m, GRID_LOW + 2] + (k + 0.5) * h)


@inlined
def cell_of(heads, m, p):
    """Index and centre [m] of the cell that a point in the grid lies in."""
    i, j, k = (int(_place(heads, m, p, 0)), int(_place(heads, m, p, 1)),
               int(_place(heads, m, p, 2)))
    return cell_index(heads, m, i, j, k), centre_of(heads, m, i, j, k)


@inlined
def cell_at(heads, cells, m, p):
    """Label of the cell that a point in the frame of mesh m lies in."""
    return int(cells[cell_of(heads, m, p)[0]]) if is_in_grid(heads, m, p) else OUTSIDE


@inlined
def _clamped(heads, m, p, k):
    """Index along axis k of the cell of p, or of the last one on that side."""
    place = _place(heads, m, p, k)
    if not place > 0.0:
        return 0
    return int(min(place, heads[m, CELLS + k] - 1.0))


@inlined
def cells_of(heads, m, low, high):
    """First and last cell along each axis of those that a box meets, and whether these are few."""
    first = (_clamped(heads, m, low, 0), _clamped(heads, m, low, 1), _clamped(heads, m, low, 2))
    last = (_clamped(heads, m, high, 0), _clamped(heads, m, high, 1), _clamped(heads, m, high, 2))
    most = max(last[0] - first[0], max(last[1] - first[1], last[2] - first[2]))
    return first, last, most < FEW_CELLS


@inlined
def box_label(heads, cells, m, low, high):
    """
    Label that all cells have that a box meets, -1 where some are near the surface or differ.

    Parameters
    ----------
    heads, cells
        As in mesh.Meshes.
    m : int
        Which mesh.
    low, high : (3,) tuple of float [m]
        Corners of the box.

    """
    (i0, j0, k0), (i1, j1, k1), few = cells_of(heads, m, low, high)
    label = int(cells[cell_index(heads, m, i0, j0, k0)])
    if label > INSIDE or not few:
        return -1
    for i in range(i0, i1 + 1):
        for j in range(j0, j1 + 1):
            for k in range(k0, k1 + 1):
                if cells[cell_index(heads, m, i, j, k)] != label:
                    return -1
    return label
