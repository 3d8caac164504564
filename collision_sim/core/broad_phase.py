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
Broad phase: of many colliders, those that a particle may be near.

A grid lists for each of its cells the colliders whose bounding boxes reach into it; a particle is
tested against those of its own cell only. Planes, meshes and shapes that particles are kept inside
of are not in it, nor is anything in scenes of few colliders: these are tested without a grid.
"""

from math import ceil, inf, prod, sqrt
from typing import NamedTuple

from collision_sim.core.jit import (formula, inlined, kernel, not_clear, select,
                                    widest_vectors, WORD)
from collision_sim.core.motion import SHIFT, TURN
from collision_sim.core.shapes import (BOX, CAPSULE, CYLINDER, KIND, PLANE, SIDE,
                                       signed_distance, SIZE, SPHERE)
from collision_sim.core.vectors import dot, EPSILON, length, origin, subtract
import numpy as np

MANY = 8                        # colliders; for fewer a grid brings nothing
CELLS = 16                      # cells for each collider in the grid, about
MOST_CELLS = 1 << 16
BOUNDED = (SPHERE, BOX, CAPSULE, CYLINDER)


class Grid(NamedTuple):
    """
    Which colliders reach into which cell.

    low, high (3,) [m]: corners; per_metre (3,) [1/m]: cells per length; counts (3,): cells along
    each axis; starts (cells + 1,) int64: first entry of a cell in items; items int64: colliders;
    others int64: colliders not in the grid.
    """

    low: tuple
    high: tuple
    per_metre: tuple
    counts: tuple
    starts: np.ndarray
    items: np.ndarray
    others: np.ndarray


@inlined
def radius_at(radius, i):
    """Radius [m] of particle i; 0 where the particles are points (None)."""
    if radius is not None:
        return radius[i]
    return 0.0


@inlined
def how_many(chosen, table):
    """Count of the colliders that are chosen: entries of `chosen`, or all where that is None."""
    if chosen is not None:
        return chosen.shape[0]
    return table.shape[0]


@inlined
def nth(chosen, m):
    """Collider number m of those that are chosen."""
    if chosen is not None:
        return chosen[m]
    return m


@inlined
def others_of(grid):
    """Colliders that are not in the grid; None, for all, without one."""
    if grid is not None:
        return grid.others
    return None


def in_grid(table):
    """Say which colliders (C, COLUMNS) belong into a grid, as indices; none if they are few."""
    bounded = np.isin(table[:, KIND], BOUNDED) & (table[:, SIDE] > 0.0)
    return np.flatnonzero(bounded) if np.sum(bounded) >= MANY else np.empty(0, dtype=np.int64)


@kernel
def _extent(kind, turns, row, pose, i):
    """Half edge [m] along an axis of the box that bounds a collider, or all its turns."""
    a, b, c = row[SIZE], row[SIZE + 1], row[SIZE + 2]
    if turns:
        return 1.5 * sqrt(a * a + b * b + c * c)
    along = abs(pose[3 * i + 2])
    if kind == SPHERE:
        return a
    if kind == BOX:
        return abs(pose[3 * i]) * a + abs(pose[3 * i + 1]) * b + along * c
    if kind == CAPSULE:
        return along * b + a
    return along * b + sqrt(max(1.0 - along * along, 0.0)) * a


@formula
def _bounds(which, table, poses, motion, reach, lows, highs):
    """Write the corners (C, 3) of boxes that hold colliders during steps that are laid out."""
    for m in range(which.shape[0]):
        c = which[m]
        kind, turns = int(table[c, KIND]), False
        if motion is not None:
            for s in range(motion.shape[0]):
                for i in range(TURN, TURN + 3):
                    turns = turns or motion[s, c, i] != 0.0
        for i in range(3):
            lows[c, i], highs[c, i] = inf, -inf
            for s in range(poses.shape[0]):
                extent, place = _extent(kind, turns, table[c], poses[s, c], i), poses[s, c, 9 + i]
                extent = extent * (1.0 + 1e-12) + 16.0 * EPSILON * abs(place) + reach
                lows[c, i] = min(lows[c, i], place - extent)
                highs[c, i] = max(highs[c, i], place + extent)


@inlined
def most_move(motion, step, table):
    """Most that the surface of a collider moves in a step [m]; infinite where a plane turns."""
    most = 0.0
    if motion is not None:
        for c in range(table.shape[0]):
            k, t = SHIFT, TURN
            shift = (motion[step, c, k], motion[step, c, k + 1], motion[step, c, k + 2])
            turn = (motion[step, c, t], motion[step, c, t + 1], motion[step, c, t + 2])
            size = table[c, SIZE] + table[c, SIZE + 1] + table[c, SIZE + 2]
            size = inf if table[c, KIND] == PLANE else size
            angle = length(turn)
            most = max(most, length(shift) + (angle * size if angle > 0.0 else 0.0))
    return most


@kernel
def _cell(low, per_metre, count, x):
    """Cell along one axis in which a coordinate is; the outermost ones go on for ever."""
    k = (x - low) * per_metre
    return int(k) if 0.0 < k < count - 1.0 else (0 if k < 1.0 else count - 1)


@formula
def _fill(grid, lows, highs, which, fills):
    """Count the entries of each cell in grid.starts, or with `fills` write them to grid.items."""
    nx, ny = grid.counts[0], grid.counts[1]
    for m in range(which.shape[0]):
        c = which[m]
        first, last = (0, 0, 0), (0, 0, 0)
        first = (_cell(grid.low[0], grid.per_metre[0], nx, lows[c, 0]),
                 _cell(grid.low[1], grid.per_metre[1], ny, lows[c, 1]),
                 _cell(grid.low[2], grid.per_metre[2], grid.counts[2], lows[c, 2]))
        last = (_cell(grid.low[0], grid.per_metre[0], nx, highs[c, 0]),
                _cell(grid.low[1], grid.per_metre[1], ny, highs[c, 1]),
                _cell(grid.low[2], grid.per_metre[2], grid.counts[2], highs[c, 2]))
        for z in range(first[2], last[2] + 1):
            for y in range(first[1], last[1] + 1):
                for x in range(first[0], last[0] + 1):
                    cell = x + nx * (y + ny * z)
                    if fills:
                        grid.items[grid.starts[cell]] = c
                        grid.starts[cell] += 1
                    else:
                        grid.starts[cell + 1] += 1


def make_grid(which, table, poses, motion, reach):
    """
    Lay out a grid over the colliders of a scene.

    Parameters
    ----------
    which : (K,) int64
        Colliders that belong into it, of `in_grid`; at least one.
    table : (C, shapes.COLUMNS) float64
        The colliders.
    poses : (S + 1, C, 12) float64
        Of all steps that the grid is for.
    motion : (S, C, motion.MOTION) float64 or None
        How the colliders move.
    reach : float [m]
        Largest radius of a particle.

    Returns
    -------
    Grid

    """
    lows, highs = np.empty((len(table), 3)), np.empty((len(table), 3))
    _bounds(which, table, poses, motion, reach, lows, highs)
    low, high = lows[which].min(axis=0), highs[which].max(axis=0)
    extent = np.maximum(high - low, 1e-9 * np.max(high - low))
    edge = np.cbrt(np.prod(extent / extent.max()) / (CELLS * len(which))) * extent.max()
    most = int(np.cbrt(MOST_CELLS))
    counts = tuple(min(max(ceil(cells), 1), most) for cells in (extent / edge).tolist())
    starts, others = np.zeros(prod(counts) + 1, dtype=np.int64), np.ones(len(table), dtype=bool)
    others[which] = False
    grid = Grid(tuple(low.tolist()), tuple(high.tolist()), tuple((counts / extent).tolist()),
                counts, starts, np.empty(0, dtype=np.int64), np.flatnonzero(others))
    _fill(grid, lows, highs, which, False)
    np.cumsum(starts, out=starts)
    grid = grid._replace(items=np.empty(starts[-1], dtype=np.int64))
    _fill(grid, lows, highs, which, True)
    starts[1:] = starts[:-1]
    starts[0] = 0
    return grid


@kernel
def _range(grid, axis, x, reach):
    """First and last cell along an axis within reach [m] of a coordinate."""
    low, per_metre, count = grid.low[axis], grid.per_metre[axis], grid.counts[axis]
    return (_cell(low, per_metre, count, x - reach), _cell(low, per_metre, count, x + reach))


@kernel
def _apart(grid, x, y, z, reach):
    """Whether a point is further than reach [m] from the whole grid."""
    return (x + reach < grid.low[0] or x - reach > grid.high[0]
            or y + reach < grid.low[1] or y - reach > grid.high[1]
            or z + reach < grid.low[2] or z - reach > grid.high[2])


@kernel
def _clear_in_cell(grid, cell, present, table, poses, end, skip, near, margins, x, y, z):
    """Least distance [m] of a point to the colliders of a cell, less its own."""
    clear = 1.0
    for m in range(grid.starts[cell], grid.starts[cell + 1]):
        c = grid.items[m]
        if c != skip:
            phi = signed_distance(present, table, poses, end, c, (x, y, z))[0]
            clear = min(clear, phi - near - _margin_at(margins, c))
    return clear


@inlined
def _margin_at(margins, c):
    if margins is not None:
        return margins[c]
    return 0.0


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
    return _cell(lx, px, nx, x) + nx * (_cell(ly, py, ny, y) + ny * _cell(lz, pz, nz, z))


@kernel
def _clear_on_way(grid, present, table, poses, end, skip, reach, near, margins, x, y, z):
    """Least distance [m], as `_clear_in_cell`, over the cells within reach [m] of a point."""
    clear, nx, ny = 1.0, grid.counts[0], grid.counts[1]
    if _apart(grid, x, y, z, reach):
        return clear
    fx, lx = _range(grid, 0, x, reach)
    fy, ly = _range(grid, 1, y, reach)
    fz, lz = _range(grid, 2, z, reach)
    for cz in range(fz, lz + 1):
        for cy in range(fy, ly + 1):
            for cx in range(fx, lx + 1):
                clear = min(clear, _clear_in_cell(grid, cx + nx * (cy + ny * cz), present, table,
                                                  poses, end, skip, near, margins, x, y, z))
    return clear


@kernel
def clear_in_grid(grid, present, table, poses, end, skip, radius, margins, x, y, z, clear, marks):
    """
    Lower `clear` for the particles of a block that may touch a collider in the grid.

    Parameters
    ----------
    grid : Grid or None
        None where there is none.
    present, table, poses
        As in shapes.signed_distance.
    end : int
        Row of poses at the end of the step.
    skip : int
        Collider that is left out.
    radius, margins, x, y, z, clear
        As in blocks.clear_of_others.
    marks : (B,) float64
        Scratch, not used with margins; as long as WORD divides.

    """
    if grid is not None:
        if margins is not None:
            for i in range(x.shape[0]):
                near = radius_at(radius, i)
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
                                grid, cell, present, table, poses, end, skip, radius_at(radius, i),
                                None, x[i], y[i], z[i]))


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
def _choose_in_grid(grid, x0, reach, chosen):
    """Choose from the cells within reach [m] of a point; how many are chosen."""
    count = 0
    for m in range(grid.others.shape[0]):
        count = _insert(chosen, count, grid.others[m])
    if _apart(grid, x0[0], x0[1], x0[2], reach):
        return count
    fx, lx = _range(grid, 0, x0[0], reach)
    fy, ly = _range(grid, 1, x0[1], reach)
    fz, lz = _range(grid, 2, x0[2], reach)
    for cz in range(fz, lz + 1):
        for cy in range(fy, ly + 1):
            for cx in range(fx, lx + 1):
                cell = cx + grid.counts[0] * (cy + grid.counts[1] * cz)
                for m in range(grid.starts[cell], grid.starts[cell + 1]):
                    count = _insert(chosen, count, grid.items[m])
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
    grid, table, poses : Grid or None, (C, COLUMNS), (S, C, 12) float64
        None where there is no grid; the colliders and their poses.
    start : int
        Row of poses at the start of the step.
    x0 : (3,) tuple of float [m]
        Start of the step.
    reach : float [m]
        How far from there anything of the step may happen, twice the moves of colliders included.
    chosen : (C,) int64
        Overwritten with their indices, ascending.

    Returns
    -------
    count : int
        How many are chosen.

    """
    if grid is not None:
        if reach < grid.high[0] - grid.low[0] + grid.high[1] - grid.low[1]:
            return _choose_in_grid(grid, x0, reach, chosen)
    return _choose_one_by_one(table, poses, start, x0, reach, chosen)
