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
Who is near a particle that has got another path within the step: the grid is asked again.

The grid of cells.py holds the particles where their candidates have been when the step began. Who
has got another candidate since then is still found there while he is not farther away than SHORT
cells; who is, is found where that leads, in slots of their own that go with those of the coarsest
level, or, if he flies farther than a cell of it is wide, in a list.
"""

from math import inf
from typing import NamedTuple

from collision_sim.core.cells import (coordinate, EXTENT, FIRST, LEVELS, LOW, MASK, POINTS,
                                      slot_of, SLOTS, STRIDE_Y, STRIDE_Z)
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.rules import NONE
import numpy as np

SHORT = 0.125           # share of the width of the finest cells: so far is not moved
MOST_CELLS = 100        # looked through one by one; of more, all particles of the level


class Moved(NamedTuple):
    """
    Particles with another candidate than in the grid: scratch.

    centre (3, N), extent (N,) [m]: of all particles, and where they are now; head (slots + 1,)
    int64: the last one in each slot of level 0, and in the list of those that fly far; behind
    (N,) int64: of each the one before; slot (N,) int64: that it is in, NONE for who is found where
    the grid has it; away (N,) [m]: how far it has moved at most; who (N,) int64: those that have;
    found (N,) int64: who is near; size (5,) int64: how many have moved, how many are found, how
    often was looked, levels of the grid, how many are in slots; seen (N,) int64: in which look a
    particle was found last.
    """

    centre: np.ndarray
    extent: np.ndarray
    head: np.ndarray
    behind: np.ndarray
    slot: np.ndarray
    away: np.ndarray
    who: np.ndarray
    found: np.ndarray
    size: np.ndarray
    seen: np.ndarray


def make_moved(centre, extent, slots):
    """Allocate it for the centres and extents of all particles and a number of slots."""
    count = len(extent)
    return Moved(centre, extent, np.full(slots + 1, NONE, dtype=np.int64),
                 np.empty(count, dtype=np.int64), np.full(count, NONE, dtype=np.int64),
                 np.zeros(count), np.empty(count, dtype=np.int64),
                 np.empty(count, dtype=np.int64), np.zeros(5, dtype=np.int64),
                 np.zeros(count, dtype=np.int64))


@kernel
def begin_moves(cells, moved):
    """Take all particles to be where the grid has them."""
    for k in range(moved.size[0]):
        i = moved.who[k]
        if moved.slot[i] != NONE:
            moved.head[moved.slot[i]] = NONE
        moved.slot[i], moved.away[i] = NONE, 0.0
    moved.size[0] = moved.size[3] = moved.size[4] = 0
    for k in range(LEVELS):
        if cells.levels[k, SLOTS] > 0 and k != POINTS:
            moved.size[3] = k + 1


@inlined
def short_way(cells, moved):
    """How far [m] a particle may have moved to be found where the grid has it."""
    return SHORT / cells.inverse[max(moved.size[3] - 1, 0)]


@inlined
def _take_out(moved, i):
    """Take particle i out of its slot."""
    slot = moved.slot[i]
    if moved.head[slot] == i:
        moved.head[slot] = moved.behind[i]
        return
    other = moved.head[slot]
    while moved.behind[other] != i:
        other = moved.behind[other]
    moved.behind[other] = moved.behind[i]


@inlined
def _is_plain(levels, k):
    """Whether the cells of level k have slots of their own, none for those outside its box."""
    return levels[k, MASK] == -1


@inlined
def _slot_for(cells, moved, centre, extent):
    """Slot for a centre and an extent [m]; the last one for who flies far."""
    levels, inverse, far = cells.levels, cells.inverse[0], moved.head.shape[0] - 1
    if not 2.0 * extent * inverse <= 1.0:
        return far
    a, b = coordinate(inverse, centre[0]), coordinate(inverse, centre[1])
    c = coordinate(inverse, centre[2])
    if _is_plain(levels, 0):
        a, b, c = a - levels[0, LOW], b - levels[0, LOW + 1], c - levels[0, LOW + 2]
        wide, high = levels[0, STRIDE_Y], levels[0, STRIDE_Z]
        if not (0 <= a < wide and 0 <= b * wide < high and 0 <= c * high < levels[0, SLOTS]):
            return far
        return a + wide * b + high * c
    return slot_of(cells.inverse, levels, 0, centre[0], centre[1], centre[2])


@inlined
def move(cells, moved, i, centre, extent, shift):
    """Note that particle i has another centre and extent [m], `shift` [m] from the last one."""
    if shift == 0.0:
        return
    if moved.away[i] == 0.0:
        moved.who[moved.size[0]] = i
        moved.size[0] += 1
    moved.away[i] += shift
    if moved.slot[i] != NONE:
        _take_out(moved, i)
    moved.centre[0, i], moved.centre[1, i], moved.centre[2, i] = centre
    moved.extent[i] = extent
    if not moved.away[i] <= short_way(cells, moved):
        slot = _slot_for(cells, moved, centre, extent)
        moved.size[4] += moved.slot[i] == NONE
        moved.slot[i], moved.behind[i], moved.head[slot] = slot, moved.head[slot], i


@inlined
def _append(moved, j):
    """Append particle j to what is found, unless it is there."""
    if moved.seen[j] != moved.size[2]:
        moved.seen[j] = moved.size[2]
        moved.found[moved.size[1]] = j
        moved.size[1] += 1


@inlined
def _test(moved, i, j):
    """Append particle j, which has moved, if it is near particle i."""
    limit = moved.extent[i] + moved.extent[j]
    dx = moved.centre[0, j] - moved.centre[0, i]
    dy = moved.centre[1, j] - moved.centre[1, i]
    dz = moved.centre[2, j] - moved.centre[2, i]
    if i != j and dx * dx + dy * dy + dz * dz < limit * limit:
        _append(moved, j)


@inlined
def _test_lists(moved, i, first, last):
    """Test those that have moved to some slots."""
    for slot in range(first, last):
        other = moved.head[slot]
        while other != NONE:
            _test(moved, i, other)
            other = moved.behind[other]


@inlined
def _test_rows(cells, moved, i, way, first, last):
    """Test those that are near where the grid has them, in some rows of it."""
    rows, x, y, z = cells.rows, moved.centre[0, i], moved.centre[1, i], moved.centre[2, i]
    for row in range(first, last):
        dx, dy, dz = rows[row, 0] - x, rows[row, 1] - y, rows[row, 2] - z
        limit = rows[row, EXTENT] + moved.extent[i] + way
        if dx * dx + dy * dy + dz * dz < limit * limit:
            j = int(cells.particle[row])
            if moved.slot[j] == NONE:
                _test(moved, i, j)


@inlined
def _test_run(cells, moved, k, i, way, slot, count):
    """Test all in a run of slots of level k."""
    first = cells.levels[k, FIRST] + slot
    _test_rows(cells, moved, i, way, cells.start[first], cells.start[first + count])
    if k == 0 and moved.size[4] > 0:
        _test_lists(moved, i, slot, slot + count)


@inlined
def _test_all(cells, moved, k, i, way):
    """Test all in level k, but who flies far."""
    first = cells.levels[k, FIRST]
    _test_rows(cells, moved, i, way, cells.start[first],
               cells.start[first + cells.levels[k, SLOTS]])
    if k == 0:
        for m in range(moved.size[0]):
            if 0 <= moved.slot[moved.who[m]] < moved.head.shape[0] - 1:
                _test(moved, i, moved.who[m])


@inlined
def _look_in(cells, moved, k, i):
    """Look for those that are near particle i in level k."""
    levels, inverse = cells.levels, cells.inverse[k]
    way = short_way(cells, moved)
    reach = moved.extent[i] + 0.5 / inverse + way
    x, y, z = moved.centre[0, i], moved.centre[1, i], moved.centre[2, i]
    ax, bx = coordinate(inverse, x - reach), coordinate(inverse, x + reach)
    ay, by = coordinate(inverse, y - reach), coordinate(inverse, y + reach)
    az, bz = coordinate(inverse, z - reach), coordinate(inverse, z + reach)
    if (bx - ax + 1.0) * (by - ay + 1.0) * (bz - az + 1.0) > MOST_CELLS:
        _test_all(cells, moved, k, i, way)
    elif _is_plain(levels, k):
        wide, high = levels[k, STRIDE_Y], levels[k, STRIDE_Z]
        ax, bx = max(ax - levels[k, LOW], 0), min(bx - levels[k, LOW], wide - 1)
        ay, by = max(ay - levels[k, LOW + 1], 0), min(by - levels[k, LOW + 1], high // wide - 1)
        az = max(az - levels[k, LOW + 2], 0)
        bz = min(bz - levels[k, LOW + 2], levels[k, SLOTS] // high - 1)
        if ax <= bx:
            for c in range(az, bz + 1):
                for b in range(ay, by + 1):
                    _test_run(cells, moved, k, i, way, ax + wide * b + high * c, bx - ax + 1)
    else:
        width = 1.0 / inverse
        for c in range(az, bz + 1):
            for b in range(ay, by + 1):
                for a in range(ax, bx + 1):
                    slot = slot_of(cells.inverse, levels, k, (a + 0.5) * width, (b + 0.5) * width,
                                   (c + 0.5) * width)
                    _test_run(cells, moved, k, i, way, slot, 1)


@kernel
def find_around(cells, moved, i):
    """
    Find those that are near particle i.

    Parameters
    ----------
    cells : cells.Cells
        The grid of the step.
    moved : Moved
        Where those are that are elsewhere; what is found is written.
    i : int
        The particle, which has moved.

    """
    moved.size[1] = 0
    moved.size[2] += 1
    if not moved.extent[i] < inf:
        return
    for n in range(moved.size[3] + 1):
        k = n if n < moved.size[3] else POINTS
        if cells.levels[k, SLOTS] > 0:
            _look_in(cells, moved, k, i)
    _test_lists(moved, i, moved.head.shape[0] - 1, moved.head.shape[0])
