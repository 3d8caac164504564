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
Which particles of a block may touch a mesh on their way: those that meet one of its triangles.

First the box of the way against that of the mesh, the same for all particles and branch-free, then
the cells of the grid, then the tree.
"""

from math import inf

from collision_sim.core.jit import (by_address, inlined, kernel, lowest, not_clear, select,
                                    widest_vectors, WORD)
from collision_sim.core.mesh import after, apart, box_of, COUNT, is_inside
from collision_sim.core.mesh_cells import (BOX_HIGH, box_label, BOX_LOW, FIRST_NODE, INSIDE,
                                           LAST_NODE, OUTSIDE)
from collision_sim.core.mesh_contact import mesh_of, side_of, skin_of, to_frame
from collision_sim.core.mesh_path import meet
from collision_sim.core.modules import MESH_BOXES, MESHES_ON_WAY
from collision_sim.core.shapes import KIND, MESH
from collision_sim.core.trajectory import relative_motion
from collision_sim.core.vectors import length, origin, subtract
import numpy as np


@inlined
def _near_along(k, heads, m, poses, start, end, c, radius, margin, x, y, z, x1, y1, z1, near):
    """Make near (B,) positive for ways that are apart from the box of a mesh along its axis k."""
    widest_vectors()
    low, high = heads[m, BOX_LOW + k] - margin, heads[m, BOX_HIGH + k] + margin
    a0, a1, a2 = poses[start, c, k], poses[start, c, 3 + k], poses[start, c, 6 + k]
    b0, b1, b2 = poses[end, c, k], poses[end, c, 3 + k], poses[end, c, 6 + k]
    a3 = a0 * poses[start, c, 9] + a1 * poses[start, c, 10] + a2 * poses[start, c, 11]
    b3 = b0 * poses[end, c, 9] + b1 * poses[end, c, 10] + b2 * poses[end, c, 11]
    for i in range(x.shape[0]):
        a = a0 * x[i] + a1 * y[i] + a2 * z[i] - a3
        b = b0 * x1[i] + b1 * y1[i] + b2 * z1[i] - b3
        r = radius[i]
        least, most = select(a < b, a, b) - r, select(a > b, a, b) + r
        gap = select(least - high > low - most, least - high, low - most)
        near[i] = select(gap > 0.0, gap, near[i])


@inlined
def _near_box(heads, m, poses, start, end, c, radius, margin, x, y, z, x1, y1, z1, near):
    """Write to near (B,) how far a way is from the box of a mesh; negative: it may meet it."""
    for i in range(x.shape[0]):
        near[i] = -1.0
    for k in range(3):
        _near_along(k, heads, m, poses, start, end, c, radius, margin, x, y, z, x1, y1, z1, near)


@inlined
def _sagitta(sweep, motion, step, c, arm, dx):
    """Most that the path of a particle leaves its chord by, as a turning mesh sees it [m]."""
    if sweep:
        move, _, angle = relative_motion(motion, step, c, dx)
        return 0.125 * angle * (2.0 * length(move) + angle * (length(arm) + length(move)))
    return 0.0


@kernel
def _meets_leaf(meshes, m, low, high):
    """Whether a box meets the box of a leaf."""
    nodes, i, last = meshes.nodes, int(meshes.heads[m, FIRST_NODE]), meshes.heads[m, LAST_NODE]
    while i < last:
        if apart(nodes, i, low, high):
            i = after(nodes, i)
        elif nodes[i, COUNT] > 0.0:
            return True
        else:
            i += 1
    return False


@inlined
def _touches(meshes, m, side, a, b, radius, skin, sagitta):
    """Whether a particle meets a mesh on its way from a to b, or ends inside it."""
    low, high = box_of(a, b, radius + skin + sagitta)
    label = box_label(meshes.heads, meshes.cells, m, low, high)
    if label == OUTSIDE or label == INSIDE:
        return side != 0.0 and (label == INSIDE) == (side > 0.0)
    if sagitta > 0.0:
        if _meets_leaf(meshes, m, low, high):
            return True
    elif meet(meshes, m, side, a, b, radius, skin)[0] <= 1.0:
        return True
    return side != 0.0 and is_inside(meshes, m, b) == (side > 0.0)


@inlined
def _touch_mesh(meshes, sweep, table, poses, motion, step, start, end, c, radius, x, y, z, new,
                clear, near):
    """Lower `clear` below 0 for the particles of a block that may touch mesh c."""
    m, side = mesh_of(table, c), side_of(meshes, table, c)
    skin = skin_of(meshes, table, poses, start, end, c)
    turns = _sagitta(sweep, motion, step, c, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)) > 0.0
    margin = inf if turns or side < 0.0 else skin
    _near_box(meshes.heads, m, poses, start, end, c, radius, margin, x, y, z, new[0], new[1],
              new[2], near)
    for first in range(0, x.shape[0], WORD):
        bits = not_clear(near, first)
        while bits != 0:
            i = first + lowest(bits)
            bits &= bits - np.uint64(1)
            if i < x.shape[0] and clear[i] >= 0.0:
                x0, x1 = (x[i], y[i], z[i]), (new[0, i], new[1, i], new[2, i])
                sagitta = 0.0
                if turns:
                    arm = subtract(x0, origin(poses, start, c))
                    sagitta = _sagitta(sweep, motion, step, c, arm, subtract(x1, x0))
                if _touches(meshes, m, side, to_frame(poses, start, c, x0),
                            to_frame(poses, end, c, x1), radius[i], skin, sagitta):
                    clear[i] = -1.0


@kernel
def mark_on_way(meshes, sweep, table, poses, motion, step, start, end, radius, x, y, z, new, clear,
                near):
    """Lower `clear` as `clear_of_meshes`, which calls this by address."""
    widest_vectors()
    for c in range(table.shape[0]):
        if table[c, KIND] == MESH:
            _touch_mesh(meshes, sweep, table, poses, motion, step, start, end, c, radius, x, y, z,
                        new, clear, near)
    return 0


@inlined
def clear_of_meshes(present, sweep, table, poses, motion, step, start, end, radius, x, y, z, new,
                    clear, near):
    """
    Lower `clear` below 0 for the particles of a block that may touch a mesh.

    Parameters
    ----------
    present : shapes.Present
        The meshes; nothing is done where there are none.
    sweep, table, poses, motion
        As in step_block.
    step, start, end : int
        Row of motion, rows of poses at the start and at the end of the step.
    radius, x, y, z, new, clear
        Of the block, as in step_block.
    near : (B,) float64, as long as WORD divides
        Scratch.

    """
    if present.meshes.heads.shape[0] > 0:
        by_address(present.modules, MESHES_ON_WAY, mark_on_way, 0,
                   (present.meshes, sweep, table, poses, motion, step, start, end, radius, x, y, z,
                    new, clear, near))


@kernel
def mark_near_box(meshes, table, poses, start, end, reach, x, y, z, x1, y1, z1, clear, near):
    """Lower `clear` as `clear_of_mesh_boxes`, which calls this by address."""
    widest_vectors()
    for c in range(table.shape[0]):
        if table[c, KIND] == MESH:
            side = side_of(meshes, table, c)
            margin = inf if side < 0.0 else skin_of(meshes, table, poses, start, end, c)
            _near_box(meshes.heads, mesh_of(table, c), poses, start, end, c, reach, margin, x, y,
                      z, x1, y1, z1, near)
            for i in range(x.shape[0]):
                clear[i] = select(near[i] > 0.0, clear[i], -1.0)
    return 0


@inlined
def clear_of_mesh_boxes(present, table, poses, start, end, reach, x, y, z, x1, y1, z1, clear,
                        near):
    """
    Lower `clear` below 0 for ways that come near the box around a mesh; none turns visibly.

    Parameters
    ----------
    present, table, poses, start, end, clear, near
        As in `clear_of_meshes`.
    reach : (B,) float64 [m]
        How near.
    x, y, z, x1, y1, z1 : (B,) float64 [m]
        Start and end of the ways.

    """
    if present.meshes.heads.shape[0] > 0:
        by_address(present.modules, MESH_BOXES, mark_near_box, 0,
                   (present.meshes, table, poses, start, end, reach, x, y, z, x1, y1, z1, clear,
                    near))
