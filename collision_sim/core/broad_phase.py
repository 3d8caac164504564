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
NO_GRID = -1
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


@kernel
def _cells_along(lattice, lows, highs, c, i):
    """First and last cell along an axis that the box of a collider reaches into."""
    low, per_metre, count = lattice[0, i], lattice[2, i], int(lattice[3, i])
    return cell_along(low, per_metre, count, lows[c, i]), cell_along(low, per_metre, count,
                                                                     highs[c, i])


@formula
def _fill(lattice, which, lows, highs, starts, items):
    """
    List in each cell of a grid the colliders whose boxes reach into it.

    Parameters
    ----------
    lattice : (4, 3) float64
        Corners [m], cells per length [1/m] and numbers of cells.
    which, lows, highs
        As of `_bounds`.
    starts, items
        As of Grid, overwritten; items only where there is room for all entries.

    Returns
    -------
    entries : int
        How many there are; NO_GRID, and nothing is listed, where a box is not within the corners.

    """
    starts[:] = 0
    nx, ny = int(lattice[3, 0]), int(lattice[3, 1])
    for fills in range(2):
        for m in range(which.shape[0]):
            c = which[m]
            for i in range(3):
                if not (lattice[0, i] <= lows[c, i] and highs[c, i] <= lattice[1, i]):
                    return NO_GRID
            fx, lx = _cells_along(lattice, lows, highs, c, 0)
            fy, ly = _cells_along(lattice, lows, highs, c, 1)
            fz, lz = _cells_along(lattice, lows, highs, c, 2)
            for z in range(fz, lz + 1):
                for y in range(fy, ly + 1):
                    for x in range(fx, lx + 1):
                        cell = x + nx * (y + ny * z)
                        if fills:
                            items[starts[cell]] = c
                            starts[cell] += 1
                        else:
                            starts[cell + 1] += 1
        if fills:
            for cell in range(starts.shape[0] - 1, 0, -1):
                starts[cell] = starts[cell - 1]
            starts[0] = 0
        else:
            for cell in range(1, starts.shape[0]):
                starts[cell] += starts[cell - 1]
            if starts[-1] > items.shape[0]:
                return starts[-1]
    return starts[-1]


class Cover:
    """
    The grid over the colliders of a scene, which is kept as long as they stay within it.

    Parameters
    ----------
    which : (K,) int64
        Colliders that belong into it, of `in_grid`; at least one.
    table : (C, shapes.COLUMNS) float64
        The colliders.
    reach : float [m]
        Largest radius of a particle.

    """

    def __init__(self, which, table, reach):
        self._which, self._table, self._reach = which, table, reach
        self._lows, self._highs = np.empty((len(table), 3)), np.empty((len(table), 3))

    def lay_out(self, poses, motion, spare):
        """
        Return a new Grid over the colliders.

        Parameters
        ----------
        poses : (S + 1, C, 12) float64
            Of all steps that the grid is for.
        motion : (S, C, motion.MOTION) float64
            How the colliders move.
        spare : bool
            Whether to leave room for them to move: a cell at each side, and twice the entries.

        """
        which, lows, highs = self._which, self._lows, self._highs
        _bounds(which, self._table, poses, motion, self._reach, lows, highs)
        low, high = lows[which].min(axis=0), highs[which].max(axis=0)
        extent = np.maximum(high - low, 1e-9 * np.max(high - low))
        edge = np.cbrt(np.prod(extent / extent.max()) / (CELLS * len(which))) * extent.max()
        if spare:
            low, high, extent = low - edge, high + edge, extent + 2.0 * edge
        most = int(np.cbrt(MOST_CELLS))
        counts = tuple(min(max(ceil(cells), 1), most) for cells in (extent / edge).tolist())
        starts, others = np.zeros(prod(counts) + 1, dtype=np.int64), np.ones(len(lows), dtype=bool)
        others[which] = False
        self._lattice = np.array([low, high, counts / extent, counts])
        entries = _fill(self._lattice, which, lows, highs, starts, np.empty(0, dtype=np.int64))
        items = np.empty(2 * entries if spare else entries, dtype=np.int64)
        _fill(self._lattice, which, lows, highs, starts, items)
        self._grid = Grid(tuple(low.tolist()), tuple(high.tolist()),
                          tuple(self._lattice[2].tolist()), counts, starts, items,
                          np.flatnonzero(others))
        return self._grid

    def holds(self, poses, motion):
        """Whether the last grid could be filled again, with the colliders where they are now."""
        starts, items = self._grid.starts, self._grid.items
        _bounds(self._which, self._table, poses, motion, self._reach, self._lows, self._highs)
        entries = _fill(self._lattice, self._which, self._lows, self._highs, starts, items)
        return 0 <= entries <= len(items)
