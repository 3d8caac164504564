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
Which colliders a particle may touch in a step, and which of the grid all particles of a tile may.

Where a tile is near a few colliders of the grid, its particles are tested against those together
(blocks.py); else each particle is tested here, against those of its own cell.
"""

from math import inf
from typing import NamedTuple

from collision_sim.core.broad_phase import cell_along, Grid, has_cells, MOST_CELLS, own_radius
from collision_sim.core.jit import (inlined, kernel, not_clear, number_of, ordered, select,
                                    widest_vectors, WORD)
from collision_sim.core.rules import Here
from collision_sim.core.shapes import (BOX, CAPSULE, CYLINDER, KIND, seam_width, SIDE,
                                       signed_distance, SIZE, SPHERE)
from collision_sim.core.vectors import dot, length, origin, subtract
import numpy as np

FEW = 8             # colliders in the grid that a tile is tested against as a whole
FEW_CELLS = 32      # that are looked through for them
NONE = -1           # they were not counted


class Around(NamedTuple):
    """
    What the colliders around one particle are chosen from.

    grid: over all colliders; move [m]: the most that the surface of a collider moves in
    this step; chosen (C,) int64: where the indices of the chosen ones are written.
    """

    grid: Grid
    move: float
    chosen: np.ndarray


@kernel
def _range(grid, axis, least, most):
    """First and last cell along an axis between two coordinates."""
    low, per_metre, count = grid.low[axis], grid.per_metre[axis], grid.counts[axis]
    return cell_along(low, per_metre, count, least), cell_along(low, per_metre, count, most)


@kernel
def _apart(grid, low, high):
    """Whether a box and the whole grid have nothing in common."""
    return (high[0] < grid.low[0] or low[0] > grid.high[0]
            or high[1] < grid.low[1] or low[1] > grid.high[1]
            or high[2] < grid.low[2] or low[2] > grid.high[2])


@inlined
def _around(x, reach):
    """Give the corners of the box that holds what is within reach [m] of a point."""
    return ((x[0] - reach, x[1] - reach, x[2] - reach),
            (x[0] + reach, x[1] + reach, x[2] + reach))


@kernel
def _clear_in_cell(grid, cell, present, table, poses, end, skip, near, margins, x, y, z):
    """Least distance [m] of a point to the colliders of a cell, less its own."""
    clear = 1.0
    for m in range(grid.starts[cell], grid.starts[cell + 1]):
        c = grid.items[m]
        if c != skip:
            phi = signed_distance(present, table, poses, end, c, (x, y, z))[0]
            wide = seam_width(table, c, origin(poses, end, c))
            clear = min(clear, phi - wide - near - margins[c])
    return clear


@kernel
def _mark_inside(grid, x, y, z, marks):
    """Write -1 to marks (B,) for the particles of a tile inside the grid, 1 for the others."""
    widest_vectors()
    (lx, ly, lz), (hx, hy, hz) = grid.low, grid.high
    for i in range(x.shape[0]):
        inside = ((x[i] >= lx) & (x[i] <= hx) & (y[i] >= ly) & (y[i] <= hy) & (z[i] >= lz)
                  & (z[i] <= hz))
        marks[i] = select(inside, -1.0, 1.0)


@inlined
def _cell_of(grid, x, y, z):
    """Give the number of the cell that a point inside the grid is in."""
    (lx, ly, lz), (px, py, pz), (nx, ny, nz) = grid.low, grid.per_metre, grid.counts
    return cell_along(lx, px, nx, x) + nx * (
        cell_along(ly, py, ny, y) + ny * cell_along(lz, pz, nz, z))


@kernel
def _clear_on_way(grid, present, table, poses, end, skip, reach, near, margins, x, y, z):
    """Least distance [m], as `_clear_in_cell`, over the cells within reach [m] of a point."""
    clear, nx, ny = 1.0, grid.counts[0], grid.counts[1]
    low, high = _around((x, y, z), reach)
    if _apart(grid, low, high):
        return clear
    fx, lx = _range(grid, 0, low[0], high[0])
    fy, ly = _range(grid, 1, low[1], high[1])
    fz, lz = _range(grid, 2, low[2], high[2])
    for cz in range(fz, lz + 1):
        for cy in range(fy, ly + 1):
            for cx in range(fx, lx + 1):
                clear = min(clear, _clear_in_cell(grid, cx + nx * (cy + ny * cz), present, table,
                                                  poses, end, skip, near, margins, x, y, z))
    return clear


@kernel
def clear_in_grid(grid, present, table, poses, end, skip, radius, wide, margins, x, y, z, clear,
                  marks):
    """
    Lower `clear` for the particles of a block that may touch a collider in the grid.

    Parameters
    ----------
    grid : Grid
        Without cells where there is none.
    present, table, poses
        As in shapes.signed_distance.
    end : int
        Row of poses at the end of the step.
    skip : int
        Collider that is left out.
    radius, wide, margins, x, y, z, clear
        As in blocks.clear_of_others.
    marks : (B,) float64
        Scratch, as long as WORD divides.

    """
    if has_cells(grid):
        if wide is not None:
            for i in range(x.shape[0]):
                near = own_radius(radius, i)
                if clear[i] >= 0.0:
                    clear[i] = min(clear[i], _clear_on_way(
                        grid, present, table, poses, end, skip, near, near, margins, x[i], y[i],
                        z[i]))
        else:
            _mark_inside(grid, x, y, z, marks)
            for first in range(0, x.shape[0], WORD):
                if not_clear(marks, first) != 0:
                    for i in range(first, min(first + WORD, x.shape[0])):
                        if marks[i] < 0.0 and clear[i] >= 0.0:
                            cell = _cell_of(grid, x[i], y[i], z[i])
                            clear[i] = min(clear[i], _clear_in_cell(
                                grid, cell, present, table, poses, end, skip,
                                own_radius(radius, i), margins, x[i], y[i], z[i]))


@kernel
def _insert(chosen, count, c):
    """Insert a collider into the first `count` entries, ascending, once; the new count."""
    m = count
    while m > 0 and chosen[m - 1] > c:
        m -= 1
    if m > 0 and chosen[m - 1] == c:
        return count
    for k in range(count, m, -1):
        chosen[k] = chosen[k - 1]
    chosen[m] = c
    return count + 1


@kernel
def _choose_in_grid(grid, low, high, most_cells, most, chosen):
    """Choose what reaches into the cells of a box; how many, NONE for more of either than most."""
    count = 0
    for m in range(grid.others.shape[0]):
        count = _insert(chosen, count, grid.others[m])
    if _apart(grid, low, high):
        return count
    fx, lx = _range(grid, 0, low[0], high[0])
    fy, ly = _range(grid, 1, low[1], high[1])
    fz, lz = _range(grid, 2, low[2], high[2])
    if (lx + 1 - fx) * (ly + 1 - fy) * (lz + 1 - fz) > most_cells:
        return NONE
    for cz in range(fz, lz + 1):
        for cy in range(fy, ly + 1):
            for cx in range(fx, lx + 1):
                cell = cx + grid.counts[0] * (cy + grid.counts[1] * cz)
                for m in range(grid.starts[cell], grid.starts[cell + 1]):
                    count = _insert(chosen, count, grid.items[m])
                if count > most:
                    return NONE
    return count


@kernel
def _is_bounded(table, c):
    """Whether particles outside a sphere around a collider are clear of it."""
    kind = table[c, KIND]
    return table[c, SIDE] > 0.0 and (
        kind == SPHERE or kind == BOX or kind == CAPSULE or kind == CYLINDER)


@kernel
def _choose_one_by_one(table, poses, start, x0, reach, chosen):
    """Choose by spheres around the colliders; how many are chosen."""
    count = 0
    for c in range(table.shape[0]):
        limit = reach + table[c, SIZE] + table[c, SIZE + 1] + table[c, SIZE + 2]
        arm = subtract(x0, origin(poses, start, c))
        if not _is_bounded(table, c) or not dot(arm, arm) > limit * limit:
            chosen[count] = c
            count += 1
    return count


@kernel
def choose(grid, table, poses, start, x0, reach, chosen):
    """
    Choose the colliders that a particle may touch in a step.

    Parameters
    ----------
    grid, table, poses : Grid, (C, COLUMNS), (S, C, 12) float64
        The grid, without cells where there is none; the colliders and their poses.
    start : int
        Row of poses at the start of the step.
    x0 : (3,) tuple of float [m]
        Start of the step.
    reach : float [m]
        How far from there anything of the step may happen, as `reach_of` gives it.
    chosen : (C,) int64
        Overwritten with their indices, ascending.

    Returns
    -------
    count : int
        How many are chosen.

    """
    if has_cells(grid):
        if reach < grid.high[0] - grid.low[0] + grid.high[1] - grid.low[1]:
            low, high = _around(x0, reach)
            return _choose_in_grid(grid, low, high, MOST_CELLS, table.shape[0], chosen)
    return _choose_one_by_one(table, poses, start, x0, reach, chosen)


@inlined
def reach_of(radius, move, x0, x1):
    """
    How far from x0 [m] a collider has to be, for a particle not to touch it on the way to x1.

    The particle reaches |x1 - x0| and its radius away. It may be pushed once more as far as it has
    come, as colliders see it that move themselves, and twice the way that two of them come
    together (placing.push_out); the collider that is touched comes towards it by its own move.
    """
    return radius + 6.0 * move + 2.0 * length(subtract(x1, x0))


@inlined
def chosen_within(around, world, here, x0, reach):
    """Give `here` with the colliders chosen that a particle may touch within reach [m] of x0."""
    count = choose(around.grid, world.table, world.poses, here.start, x0, reach, around.chosen)
    return Here(here.step, here.start, here.end, here.block, here.particle, here.radius,
                around.chosen[:count], here.answers, here.only)


@kernel
def _range_of(a):
    """Give the smallest and the largest number of a row, one of them NaN where one is."""
    widest_vectors()
    low = high = ordered(a[0])
    for i in range(1, a.shape[0]):
        key = ordered(a[i])
        low, high = min(low, key), max(high, key)
    return number_of(low), number_of(high)


@inlined
def choose_for_tile(grid, wide, near, x, y, z, chosen):
    """
    Choose the colliders that the particles of a tile may touch, if they are few.

    Parameters
    ----------
    grid : Grid
        Without cells where there is none.
    wide : int or None
        1 if the distances `near` may be larger than the radii of the particles.
    near : (B,) float64 or float [m]
        At which distance from a collider a particle may touch it.
    x, y, z : (B,) float64 [m]
        Where the particles end.
    chosen : (C,) int64
        Overwritten.

    Returns
    -------
    chosen : (K,) int64
        Colliders, ascending.
    all_chosen : bool
        Whether they are all that may be touched; else they are those that are not in the grid.

    """
    if has_cells(grid):
        reach = 0.0
        if wide is not None:
            reach = _range_of(near)[1]
        (x0, x1), (y0, y1), (z0, z1) = _range_of(x), _range_of(y), _range_of(z)
        if x0 <= x1 and y0 <= y1 and z0 <= z1 and reach < inf:      # nobody is NaN
            count = _choose_in_grid(grid, (x0 - reach, y0 - reach, z0 - reach),
                                    (x1 + reach, y1 + reach, z1 + reach), FEW_CELLS,
                                    grid.others.shape[0] + FEW, chosen)
            if count != NONE:
                return chosen[:count], True
        return grid.others, False
    return grid.others, True
