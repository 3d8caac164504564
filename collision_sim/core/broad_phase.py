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

A grid lists for each of its cells the colliders whose bounding boxes reach into it, for nearby.py
to find those of a particle or of a tile of them. Planes, meshes and shapes that particles are kept
inside of are not in it, nor is anything in scenes of few colliders: these are tested without one.
"""

from math import ceil, inf, prod, sqrt
from typing import NamedTuple

from collision_sim.core.jit import formula, inlined, kernel
from collision_sim.core.motion import SHIFT, TURN
from collision_sim.core.shapes import BOX, CAPSULE, CYLINDER, KIND, PLANE, SIDE, SIZE, SPHERE
from collision_sim.core.vectors import EPSILON, length
from numba import config, types
from numba.extending import overload
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
    Without a grid there are no cells, and all colliders are others (`no_grid`).
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
    """Radius [m] of particle i; a single one is that of all."""
    return radius[i] if radius.shape[0] > 1 else radius[0]


@inlined
def how_many(here):
    """How many colliders are acted on: the one of `here.only` if there is one, else all chosen."""
    return here.only.shape[0] if here.only.shape[0] > 0 else here.chosen.shape[0]


@inlined
def nth(here, m):
    """Collider number m of those that are acted on."""
    return here.only[m] if here.only.shape[0] > 0 else here.chosen[m]


@inlined
def has_cells(grid):
    """Whether there is a grid: without one all colliders are `others`."""
    return grid.starts.shape[0] > 0


def no_grid(count):
    """Return the Grid of a scene of few colliders, which has no cells."""
    nowhere, none = (0.0, 0.0, 0.0), np.empty(0, dtype=np.int64)
    return Grid(nowhere, nowhere, nowhere, (0, 0, 0), none, none, np.arange(count))


def own_radius(radius, i):
    """Radius [m] of particle i of a tile: an array of them, or the one of all."""
    return radius[i] if np.ndim(radius) else radius


if not config.DISABLE_JIT:
    @overload(own_radius)       # chooses by the type
    def _own_radius(radius, i):
        if isinstance(radius, types.Array):
            return lambda radius, i: radius[i]
        return lambda radius, i: radius


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
        for s in range(motion.shape[0]):
            for i in range(TURN, TURN + 3):
                turns = turns or motion[s, c, i] != 0.0
        for i in range(3):
            lows[c, i], highs[c, i] = inf, -inf
            for s in range(poses.shape[0]):
                extent, place = _extent(kind, turns, table[c], poses[s, c], i), poses[s, c, 9 + i]
                extent = extent * (1.0 + 1e-12) + 256.0 * EPSILON * abs(place) + reach
                lows[c, i] = min(lows[c, i], place - extent)
                highs[c, i] = max(highs[c, i], place + extent)


@inlined
def most_move(motion, step, table):
    """Most that the surface of a collider moves in a step [m]; infinite where a plane turns."""
    most = 0.0
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
def cell_along(low, per_metre, count, x):
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
        first = (cell_along(grid.low[0], grid.per_metre[0], nx, lows[c, 0]),
                 cell_along(grid.low[1], grid.per_metre[1], ny, lows[c, 1]),
                 cell_along(grid.low[2], grid.per_metre[2], grid.counts[2], lows[c, 2]))
        last = (cell_along(grid.low[0], grid.per_metre[0], nx, highs[c, 0]),
                cell_along(grid.low[1], grid.per_metre[1], ny, highs[c, 1]),
                cell_along(grid.low[2], grid.per_metre[2], grid.counts[2], highs[c, 2]))
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
    motion : (S, C, motion.MOTION) float64
        How the colliders move; without rows where none does.
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
