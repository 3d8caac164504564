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
The grid of cells: which particles may be near each other.

Each particle has a centre and an extent, and two are near if their centres are closer than the
sum of their extents. A particle lives in a level of the grid by its extent: cells of a level are
at least twice as wide as the largest extent in it, those of the next finer level half as wide. So
near particles of a level lie in neighbouring cells, and a particle is near to a larger one only if
that lies in one of the 27 cells of the coarser level around it.

A level has a table of slots. A cell with the whole coordinates (a, b, c) has the slot
a + sy b + sz c: runs of cells along x are runs of slots. Where the cells of the box around all
particles fit into four slots for each particle, the strides sy, sz are those of that box. Else the
slot is taken modulo a power of two of at least two slots for each particle, with strides of the
golden ratio's kind: far and empty space costs no memory, and particles of different cells share a
slot about as often as in a hash table. The 27 slots around a cell are distinct, so no
pair is found twice; what shares a slot by chance is told apart by its distance.

Particles are brought into the order of their slots by a counting sort; in a slot they are ordered
by their coordinates. So the order of what is found does not depend on that of the particles, nor
on threads.
"""

from math import floor, frexp, ldexp
from typing import NamedTuple, Optional

from collision_sim.core.jit import formula, inlined, kernel
import numpy as np

MANY = 32               # particles in a slot; more are sorted with gaps
GHOSTS = 2              # slots of a level that repeat its first ones behind its last
LEVELS = 64             # of the grid; each with cells half as wide as the one before
POINTS = LEVELS - 1     # level of particles without extent, which are never near each other
FEWEST = 128            # slots of a level; with fewer the golden strides come too close
WIDER = 1.0 + 2.0 ** -20        # of a cell than need be: covers the rounding of its coordinates
FARTHEST = 2.0 ** 32            # cells from the origin up to which that is enough
UNBOUNDED = 2.0 ** 61           # largest whole coordinate of a cell
GOLDEN = 0.7548776662466927, 0.5698402909980532     # generalised golden ratio of two dimensions
# Columns of the table of levels: first slot, number of slots, mask of the modulo (-1 for none),
# strides along y and z, lowest and highest slot of a particle, lowest coordinates of a cell.
FIRST, SLOTS, MASK, STRIDE_Y, STRIDE_Z, LOWEST, HIGHEST, LOW, LEVEL = 0, 1, 2, 3, 4, 5, 6, 7, 10
PADDING = 4             # rows behind the last one that may be read
EXTENT, PLACE = 3, 4    # columns of the rows of sorted particles: x, y, z, extent


class Cells(NamedTuple):
    """
    The grid of a step: scratch that is allocated once.

    inverse (LEVELS,) [1/m]: of the width of the cells; levels (LEVELS, LEVEL) int64; slot (N,)
    int32: of each particle; counts (chunks, slots) int32; start (slots + 1,) int32: first row of
    each slot; rows (2 N, PLACE) [m], particle (2 N,) int32, home (2 N,) int32: the particles in
    the order of their slots, with their slots. level (N,) int8: of each particle, None where all
    are in level 0.
    """

    inverse: np.ndarray
    levels: np.ndarray
    slot: np.ndarray
    counts: np.ndarray
    start: np.ndarray
    rows: np.ndarray
    particle: np.ndarray
    home: np.ndarray
    level: Optional[np.ndarray]


def make_cells(count, chunks, many):
    """
    Allocate the grid of a number of particles.

    Parameters
    ----------
    count : int
        Of the particles.
    chunks : int
        Parts that they are counted in, one for each thread.
    many : bool
        Whether there may be more than one level.

    Returns
    -------
    Cells

    """
    slots = 4 * count + (LEVELS if many else 1) * (FEWEST + 2)
    rows = 2 * count + PADDING
    return Cells(
        np.ones(LEVELS), np.zeros((LEVELS, LEVEL), dtype=np.int64),
        np.zeros(count, dtype=np.int32), np.zeros((chunks, slots), dtype=np.int32),
        np.zeros(slots + 1, dtype=np.int32), np.zeros((rows, PLACE)),
        np.zeros(rows, dtype=np.int32), np.zeros(rows, dtype=np.int32),
        np.zeros(count, dtype=np.int8) if many else None)


@formula
def level_of(extent, largest):
    """
    Level that a particle lives in.

    Parameters
    ----------
    extent, largest : float [m]
        Of the particle, and the largest of all, which lives in level 0.

    Returns
    -------
    level : int
        k where the extent is above 2^-(k + 1) and at most 2^-k of the largest one.

    """
    if not extent > 0.0:
        return POINTS
    if not largest <= extent * 2.0 ** (POINTS - 1):
        return POINTS - 1
    return frexp(largest / extent)[1] - 1


@formula
def cell_width(largest, far):
    """
    Width of the cells of level 0.

    Parameters
    ----------
    largest : float [m]
        Extent.
    far : float [m]
        Largest coordinate of a centre.

    Returns
    -------
    width : float [m]
        Twice the extent and a little more; the next power of two, for which coordinates of cells
        have no rounding, where particles are far from the origin.

    """
    width = 2.0 * largest * WIDER
    if not far <= FARTHEST * width:
        return ldexp(1.0, frexp(width)[1])
    return width


@inlined
def coordinate(inverse, x):
    """Whole coordinate of the cell that x lies in; that of a place too far away is cut off."""
    q = x * inverse
    q = q if q > -UNBOUNDED else -UNBOUNDED
    return int(floor(q if q < UNBOUNDED else UNBOUNDED))


@inlined
def slot_of(inverse, levels, k, x, y, z):
    """Slot of a place in level k, counted from the first one of that level."""
    mask = levels[k, MASK]
    a = (coordinate(inverse[k], x) - levels[k, LOW]) & mask
    b = (coordinate(inverse[k], y) - levels[k, LOW + 1]) & mask
    c = (coordinate(inverse[k], z) - levels[k, LOW + 2]) & mask
    slot = (a + levels[k, STRIDE_Y] * b + levels[k, STRIDE_Z] * c) & mask
    return min(max(slot, levels[k, LOWEST]), levels[k, HIGHEST])


@kernel
def _plan_level(cells, k, count, low, high):
    """Choose the strides of level k for a number of particles between two corners [m]."""
    inverse, levels, slots = cells.inverse[k], cells.levels, 1.0
    for d in range(3):
        first = coordinate(inverse, low[d])
        levels[k, LOW + d] = first - 1
        width = coordinate(inverse, high[d]) - first + 3
        if d < 2:
            levels[k, STRIDE_Y + d] = int(min(slots * width, UNBOUNDED / 4))
        slots *= float(width)
    reach = 1 + levels[k, STRIDE_Y] + levels[k, STRIDE_Z]
    levels[k, SLOTS], levels[k, MASK] = int(min(slots, UNBOUNDED)), -1
    levels[k, LOWEST], levels[k, HIGHEST] = reach, levels[k, SLOTS] - 1 - reach
    if not slots <= max(4 * count, FEWEST):
        _wrap_level(levels, k, count)


@kernel
def _wrap_level(levels, k, count):
    """Take the slots of level k modulo a power of two."""
    size = FEWEST
    while size < 2 * count:
        size *= 2
    levels[k, SLOTS], levels[k, MASK] = size, size - 1
    levels[k, LOWEST], levels[k, HIGHEST] = 0, size - 1
    for d in range(2):
        levels[k, STRIDE_Y + d] = int(GOLDEN[d] * size) | 1
    for d in range(3):
        levels[k, LOW + d] = 0


@kernel
def plan_levels(cells, counts, low, high, width):
    """
    Lay out the table of levels for a step.

    Parameters
    ----------
    cells : Cells
        Written.
    counts : (LEVELS,) int64
        Particles in each level.
    low, high : (3,) tuple of float [m]
        Corners of a box around all centres.
    width : float [m]
        Of the cells of level 0.

    """
    first = 0
    for k in range(LEVELS):
        cells.inverse[k] = min(ldexp(1.0 / width, k), 1e300)
        cells.levels[k, FIRST] = cells.levels[k, SLOTS] = 0
        if counts[k] > 0:
            _plan_level(cells, k, counts[k], low, high)
            cells.levels[k, FIRST] = first
            first += cells.levels[k, SLOTS] + GHOSTS


@formula
def slots_in(levels):
    """
    Give how many slots the levels have together.

    Parameters
    ----------
    levels : (LEVELS, LEVEL) int64
        Of Cells.

    Returns
    -------
    slots : int
        Ghosts included.

    """
    slots = 0
    for k in range(LEVELS):
        if levels[k, SLOTS] > 0:
            slots = levels[k, FIRST] + levels[k, SLOTS] + GHOSTS
    return slots


@inlined
def level_at(level, i):
    """Level of particle i; 0 where there is one only (None)."""
    if level is not None:
        return int(level[i])
    return 0


@kernel
def count_level(level, extent, largest, first, last, counts):
    """Write the levels of some particles, and add them to the counts (LEVELS,) of levels."""
    for i in range(first, last):
        k = level_of(extent[i], largest)
        level[i] = k
        counts[k] += 1


@kernel
def count_slots(cells, chunk, centre, first, last):
    """Write the slots of the particles of a chunk, and how many of them each slot has."""
    levels, counts = cells.levels, cells.counts
    for s in range(slots_in(levels)):
        counts[chunk, s] = 0
    for i in range(first, last):
        k = level_at(cells.level, i)
        s = slot_of(cells.inverse, levels, k, centre[0, i], centre[1, i], centre[2, i])
        if centre[0, i] != centre[0, i]:        # NaN: spread, as many in a slot would take long
            s = levels[k, LOWEST] + i % (levels[k, HIGHEST] + 1 - levels[k, LOWEST])
        cells.slot[i] = s
        counts[chunk, levels[k, FIRST] + s] += 1
        if s < GHOSTS:
            counts[chunk, levels[k, FIRST] + levels[k, SLOTS] + s] += 1


@kernel
def start_slots(cells):
    """Turn the counts of the slots into the rows at which each chunk goes on in them."""
    counts, row, slots = cells.counts, 0, slots_in(cells.levels)
    for s in range(slots):
        cells.start[s] = row
        for chunk in range(counts.shape[0]):
            count = counts[chunk, s]
            counts[chunk, s] = row
            row += count
    cells.start[slots] = row


@inlined
def _write_row(cells, chunk, slot, i, centre, extent):
    """Add particle i to a slot."""
    row = cells.counts[chunk, slot]
    cells.counts[chunk, slot] = row + 1
    for d in range(3):
        cells.rows[row, d] = centre[d, i]
    cells.rows[row, EXTENT] = extent[i]
    cells.particle[row], cells.home[row] = i, slot


@kernel
def fill_slots(cells, chunk, centre, extent, first, last):
    """Write the particles of a chunk to the rows of their slots, ghosts included."""
    for i in range(first, last):
        k, s = level_at(cells.level, i), cells.slot[i]
        _write_row(cells, chunk, cells.levels[k, FIRST] + s, i, centre, extent)
        if s < GHOSTS:
            _write_row(cells, chunk, cells.levels[k, FIRST] + cells.levels[k, SLOTS] + s, i,
                       centre, extent)


@inlined
def _comes_before(rows, a, b):
    """Whether row a comes before row b by its coordinates, then by its extent."""
    for d in range(PLACE):
        if rows[a, d] != rows[b, d]:
            return rows[a, d] < rows[b, d]
    return False


@inlined
def _swap(cells, a, b):
    rows, particle = cells.rows, cells.particle
    for d in range(PLACE):
        rows[a, d], rows[b, d] = rows[b, d], rows[a, d]
    particle[a], particle[b] = particle[b], particle[a]


@kernel
def _order_rows(cells, first, last):
    """Sort rows by their coordinates: insertion with gaps (Shell), stable without gaps."""
    gap = 1
    while last - first > MANY and 3 * gap < last - first:
        gap = 3 * gap + 1
    while gap > 0:
        for a in range(first + gap, last):
            b = a
            while b - gap >= first and _comes_before(cells.rows, b, b - gap):
                _swap(cells, b, b - gap)
                b -= gap
        gap //= 3


@kernel
def order_slots(cells, first, last):
    """Sort the particles of each slot that begins in the rows from `first` to `last`."""
    home, start = cells.home, cells.start
    for row in range(first, last):
        if home[row] == home[row + 1] and start[home[row]] == row:
            _order_rows(cells, row, start[home[row] + 1])
