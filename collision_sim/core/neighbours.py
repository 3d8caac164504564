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
Pairs of particles that are near each other in a step, found with the grid of cells.py.

`lay_out_cells` sorts the particles into the grid, in phases that threads share; `find_near` then
looks at each particle's own slot and at the half of the slots around it that come after, and at
all 27 slots around it in each coarser level. Candidates are listed first, without a branch for the
usual few of them, and their distances are tested afterwards: that is twice as fast as testing each
where it is found.
"""

from math import inf, sqrt
from typing import NamedTuple

from collision_sim.core.cells import (cell_width, count_level, count_slots, EXTENT, fill_slots,
                                      FIRST, level_at, LEVELS, MASK, order_slots, plan_levels,
                                      POINTS, slot_of, SLOTS, slots_in, start_slots, STRIDE_Y,
                                      STRIDE_Z)
from collision_sim.core.flight import fly
from collision_sim.core.jit import entry, inlined, kernel
from collision_sim.core.ledger import book_flight
from collision_sim.core.rules import account_of
from collision_sim.core.stepping import BLOCK
from collision_sim.core.threads import CLAIMED, ENTERED, fetch_add, finish, LEFT
from collision_sim.core.vectors import dot
import numpy as np

LARGEST, BOUNDS = 6, 7  # columns of the bounds of a block: lowest x, y, z, highest, extent
PIECE = 512             # rows of sorted particles that a thread claims at once
QUEUE = 2048            # candidates that are listed before their distances are tested
SHORT = 4               # particles of a run that are listed without a branch
MOST_NEAR = 64          # partners that a particle gets from one run of cells
PHASES = 8
FLY, MEASURE, PLAN, COUNT, START, FILL, ORDER = range(7)
LOW_BITS = 0xffffffff   # of a pair: its second row; the first row is above them


class Near(NamedTuple):
    """
    What has been found: scratch that is allocated once, and again where it is too short.

    found (pieces, most) int64: pairs of rows of each piece of PIECE rows; count (pieces,) int64:
    how many, more than `most` where there was no room; cut (pieces,) int64: how many runs had
    more than MOST_NEAR partners for a particle.
    """

    found: np.ndarray
    count: np.ndarray
    cut: np.ndarray


@inlined
def _candidate(flies, flight, ledger, block, v, candidates, i):
    """Mean velocity of particle i; its free flight is laid out here, or None: it is laid out."""
    if flies:
        start = (v[0, i], v[1, i], v[2, i])
        u, w = fly(flight, start)
        book_flight(ledger, account_of(block, i), flight.dt, start, u, w, 1.0)
        for d in range(3):
            candidates.u[d, i], candidates.w[d, i] = u[d], w[d]
        return u
    return (candidates.u[0, i], candidates.u[1, i], candidates.u[2, i])


@inlined
def _stretch(sweep, base, extent, i, half):
    """
    Write the extent of particle i with half of its path [m], if there are sweeps.

    Around the middle of its path, a collider may throw it back to three times as far.
    """
    if sweep:
        extent[i] = base[i] + 3.0 * half if half < inf else 0.0


@inlined
def _finite_place(x, y, z):
    """Give a place, or NaN, which is near nothing, where a coordinate is not finite."""
    blank = (x - x) + (y - y) + (z - z)
    return x + blank, y + blank, z + blank


@inlined
def _bound_extent(sweep, extent, first, last, block, bounds):
    """Write the largest extent of a block; without sweeps it is there from the start."""
    if sweep:
        largest = 0.0
        for i in range(first, last):
            largest = max(largest, extent[i])
        bounds[block, LARGEST] = largest


@kernel
def _lay_out_block(flies, sweep, flight, ledger, block, base, x, v, candidates, first, last,
                   centre, extent, bounds):
    """Write the candidates, centres and extents of a block, and the box around its centres."""
    part = flight.dt if not sweep else 0.5 * flight.dt
    ax, ay, az, bx, by, bz = inf, inf, inf, -inf, -inf, -inf
    for i in range(first, last):
        u = _candidate(flies, flight, ledger, block, v, candidates, i)
        px, py, pz = _finite_place(x[0, i] + part * u[0], x[1, i] + part * u[1],
                                   x[2, i] + part * u[2])
        centre[0, i], centre[1, i], centre[2, i] = px, py, pz
        _stretch(sweep, base, extent, i, part * sqrt(dot(u, u)))
        ax, bx = (px if px < ax else ax), (px if px > bx else bx)
        ay, by = (py if py < ay else ay), (py if py > by else by)
        az, bz = (pz if pz < az else az), (pz if pz > bz else bz)
    bounds[block, 0], bounds[block, 1], bounds[block, 2] = ax, ay, az
    bounds[block, 3], bounds[block, 4], bounds[block, 5] = bx, by, bz
    _bound_extent(sweep, extent, first, last, block, bounds)


@inlined
def _most(bounds, d):
    """Largest entry of a column."""
    most = -inf
    for block in range(bounds.shape[0]):
        most = max(most, bounds[block, d])
    return most


@inlined
def _least(bounds, d):
    """Smallest entry of a column."""
    least = inf
    for block in range(bounds.shape[0]):
        least = min(least, bounds[block, d])
    return least


@kernel
def _plan(cells, chunk_counts, bounds):
    """Lay out the levels for the particles in the bounds of all blocks."""
    low = (_least(bounds, 0), _least(bounds, 1), _least(bounds, 2))
    high = (_most(bounds, 3), _most(bounds, 4), _most(bounds, 5))
    far = max(max(-low[0], high[0]), max(max(-low[1], high[1]), max(-low[2], high[2])))
    for chunk in range(1, chunk_counts.shape[0]):
        for k in range(LEVELS):
            chunk_counts[0, k] += chunk_counts[chunk, k]
    plan_levels(cells, chunk_counts[0], low, high, cell_width(_most(bounds, LARGEST), far))


@kernel
def _measure(level, chunk_counts, chunk, extent, bounds, first, last):
    """Count the particles of a chunk by their levels."""
    for k in range(LEVELS):
        chunk_counts[chunk, k] = 0
    if level is not None:
        count_level(level, extent, _most(bounds, LARGEST), first, last, chunk_counts[chunk])
    else:
        chunk_counts[chunk, 0] = last - first


@entry
def lay_out_cells(posted, counters, progress, cells, chunk_counts, bounds, flies, sweep, flight,
                  ledger, base, x, v, candidates, centre, extent):
    """
    Sort the particles into the grid of a step.

    Parameters
    ----------
    posted, counters
        Of threads.share.
    progress : (2 * PHASES + 1,) int64
        Zeros, new for each step; of threads.finish, and the number of rows.
    cells : cells.Cells
        Written.
    chunk_counts : (chunks, LEVELS) int64
        Scratch.
    bounds : (blocks, BOUNDS) float64 [m]
        Scratch; without `sweep` its last column has the largest extent.
    flies : bool
        Whether candidates are free flights, which are laid out here first; else they are.
    sweep : int or None
        1: particles are near where their paths are; None: where their paths end.
    flight, ledger, x, v, candidates
        As in candidates.py.
    base : (N,) float64 [m]
        Extent of each particle without its path.
    centre, extent : (3, N), (N,) float64 [m]
        Written; without `sweep` the extent is that of the base and is left as it is.

    """
    count, blocks, chunks = x.shape[1], bounds.shape[0], chunk_counts.shape[0]
    fetch_add(posted, 0, 1)
    fetch_add(counters, ENTERED, 1)
    block = fetch_add(progress, 2 * FLY, 1)
    while block < blocks:
        first, last = block * BLOCK, min((block + 1) * BLOCK, count)
        _lay_out_block(flies, sweep, flight, ledger, block, base, x, v, candidates, first, last,
                       centre, extent, bounds)
        fetch_add(progress, 2 * FLY + 1, 1)
        block = fetch_add(progress, 2 * FLY, 1)
    finish(progress, FLY, blocks)
    chunk = fetch_add(progress, 2 * MEASURE, 1)
    while chunk < chunks:
        _measure(cells.level, chunk_counts, chunk, extent, bounds, chunk * count // chunks,
                 (chunk + 1) * count // chunks)
        fetch_add(progress, 2 * MEASURE + 1, 1)
        chunk = fetch_add(progress, 2 * MEASURE, 1)
    finish(progress, MEASURE, chunks)
    if fetch_add(progress, 2 * PLAN, 1) == 0:
        _plan(cells, chunk_counts, bounds)
        fetch_add(progress, 2 * PLAN + 1, 1)
    finish(progress, PLAN, 1)
    chunk = fetch_add(progress, 2 * COUNT, 1)
    while chunk < chunks:
        count_slots(cells, chunk, centre, chunk * count // chunks, (chunk + 1) * count // chunks)
        fetch_add(progress, 2 * COUNT + 1, 1)
        chunk = fetch_add(progress, 2 * COUNT, 1)
    finish(progress, COUNT, chunks)
    if fetch_add(progress, 2 * START, 1) == 0:
        start_slots(cells)
        progress[2 * PHASES] = cells.start[slots_in(cells.levels)]
        fetch_add(progress, 2 * START + 1, 1)
    finish(progress, START, 1)
    chunk = fetch_add(progress, 2 * FILL, 1)
    while chunk < chunks:
        fill_slots(cells, chunk, centre, extent, chunk * count // chunks,
                   (chunk + 1) * count // chunks)
        fetch_add(progress, 2 * FILL + 1, 1)
        chunk = fetch_add(progress, 2 * FILL, 1)
    finish(progress, FILL, chunks)
    rows = progress[2 * PHASES]     # not those of the next step, for a thread that comes too late
    row = PIECE * fetch_add(progress, 2 * ORDER, 1)
    while row < rows:
        order_slots(cells, row, min(row + PIECE, rows))
        fetch_add(progress, 2 * ORDER + 1, 1)
        row = PIECE * fetch_add(progress, 2 * ORDER, 1)
    fetch_add(counters, LEFT, 1)


@inlined
def _test(cells, queue, waiting, near, piece, count):
    """Append those of the candidates that are near to what is found in a piece."""
    rows, found = cells.rows, near.found
    room = min(waiting, found.shape[1] - count)
    for c in range(room):
        a, b = queue[c] >> 32, queue[c] & LOW_BITS
        dx, dy, dz = rows[b, 0] - rows[a, 0], rows[b, 1] - rows[a, 1], rows[b, 2] - rows[a, 2]
        limit = rows[a, EXTENT] + rows[b, EXTENT]
        found[piece, count] = queue[c]
        count += dx * dx + dy * dy + dz * dz < limit * limit
    return count if room == waiting else found.shape[1] + 1


@inlined
def _are_near(rows, a, b):
    dx, dy, dz = rows[b, 0] - rows[a, 0], rows[b, 1] - rows[a, 1], rows[b, 2] - rows[a, 2]
    limit = rows[a, EXTENT] + rows[b, EXTENT]
    return dx * dx + dy * dy + dz * dz < limit * limit


@inlined
def _list_long(cells, near, piece, queue, waiting, row, first, last):
    """List a run of more than SHORT candidates: all, or of a crowd the first that are near."""
    if last - first <= MOST_NEAR:
        for other in range(first, last):
            queue[waiting + other - first] = (row << 32) + other
        return waiting + last - first
    added, other = 0, first
    while other < last and added < MOST_NEAR:
        if _are_near(cells.rows, row, other):
            queue[waiting + added] = (row << 32) + other
            added += 1
        other += 1
    near.cut[piece] += other < last
    return waiting + added


@inlined
def _list_run(cells, near, piece, queue, waiting, row, first, last):
    """List the rows from `first` to `last` as candidates of a row; how many wait then."""
    for k in range(SHORT):
        queue[waiting + k] = (row << 32) + first + k
    if last - first > SHORT:
        return _list_long(cells, near, piece, queue, waiting, row, first, last)
    return waiting + max(last - first, 0)


@inlined
def _list_beside(cells, near, piece, queue, waiting, row, level, slot, offset):
    """List the three cells whose middle one has the slot at an offset from that of a level."""
    at = level[0] + ((slot + offset - 1) & level[1])
    return _list_run(cells, near, piece, queue, waiting, row, int(cells.start[at]),
                     int(cells.start[at + 3]))


@inlined
def _read_level(levels, k):
    """First slot, mask, strides and number of slots of level k."""
    return (levels[k, FIRST], levels[k, MASK], levels[k, STRIDE_Y], levels[k, STRIDE_Z],
            levels[k, SLOTS])


@inlined
def _list_same(cells, near, piece, queue, waiting, row, level, slot):
    """List the half of the neighbours in the level of the row itself."""
    sy, sz, end = level[2], level[3], int(cells.start[level[0] + slot + 2])
    waiting = _list_run(cells, near, piece, queue, waiting, row, row + 1, end)
    for offset in (sy, sz - sy, sz, sz + sy):
        waiting = _list_beside(cells, near, piece, queue, waiting, row, level, slot, offset)
    return waiting


@inlined
def _list_coarser(cells, near, piece, queue, waiting, row, k):
    """List all neighbours in a coarser level k."""
    level, rows = _read_level(cells.levels, k), cells.rows
    slot = slot_of(cells.inverse, cells.levels, k, rows[row, 0], rows[row, 1], rows[row, 2])
    for b in range(-1, 2):
        for c in range(-1, 2):
            waiting = _list_beside(cells, near, piece, queue, waiting, row, level, slot,
                                   b * level[2] + c * level[3])
    return waiting


@kernel
def find_in_piece(cells, near, piece, queue):
    """Find the pairs whose first row is in a piece."""
    levels, count, waiting, own = cells.levels, 0, 0, 0
    level = _read_level(levels, own)
    near.cut[piece] = 0
    for row in range(piece * PIECE, min((piece + 1) * PIECE, cells.start[slots_in(levels)])):
        k = level_at(cells.level, cells.particle[row])
        if k != own:
            own, level = k, _read_level(levels, k)
        slot = cells.home[row] - level[0]
        if slot >= level[4]:        # a ghost
            continue
        if own != POINTS:
            waiting = _list_same(cells, near, piece, queue, waiting, row, level, slot)
        for k in range(own):
            if waiting > QUEUE:
                count, waiting = _test(cells, queue, waiting, near, piece, count), 0
            if levels[k, SLOTS] > 0:
                waiting = _list_coarser(cells, near, piece, queue, waiting, row, k)
        if waiting > QUEUE:
            count, waiting = _test(cells, queue, waiting, near, piece, count), 0
    near.count[piece] = _test(cells, queue, waiting, near, piece, count)


@entry
def find_near(posted, counters, pieces, cells, near):
    """
    Find all pairs that are near each other, piece by piece of the sorted particles.

    Parameters
    ----------
    posted, counters
        Of threads.share.
    pieces : int
        How many there are.
    cells : cells.Cells
        Of `lay_out_cells`.
    near : Near
        Overwritten.

    """
    queue = np.empty(QUEUE + 10 * MOST_NEAR + SHORT, dtype=np.int64)
    fetch_add(posted, 0, 1)
    fetch_add(counters, ENTERED, 1)
    piece = fetch_add(counters, CLAIMED, 1)
    while piece < pieces:
        find_in_piece(cells, near, piece, queue)
        piece = fetch_add(counters, CLAIMED, 1)
    fetch_add(counters, LEFT, 1)
