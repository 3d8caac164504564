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
Cells for the event-driven collisions of particles: who can meet whom before either changes cells.

The side of a cell is more than the largest diameter, so that a particle meets only those in its
own cell and the 26 around it. It may go SLACK of a side beyond its cell before it changes to where
it is then, so that nobody goes to and fro between two cells; the side makes up for that. The grid
is wound up, so that it has no end and needs no more cells than there are particles: who is a whole
turn apart is looked at, and not met.
"""

from math import floor

from collision_sim.core.event_state import AT, BEFORE, CELL, FREE, KIND
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.paths import safe_time
from collision_sim.core.rules import NONE
import numpy as np

SLACK = 0.03            # share of a side that a particle may be outside its cell
CROWD = 0.7             # share of the mean distance that the side of a cell is at least
LOOSE = 1e-6            # share of a diameter that cells are larger than need be
FEWEST = 4              # cells of a turn along an axis: the 27 differ then
AROUND = 27             # cells
FURTHEST = 2.0 ** 40    # cells from the origin: beyond, places are rounded to more than a cell


def lay_out_grid(x, largest, most):
    """
    Lay out a grid for particles at some places.

    Parameters
    ----------
    x : (3, N) float64 [m]
        Places.
    largest : float [m]
        Largest diameter.
    most : int
        About how many cells at most.

    Returns
    -------
    origin : (3,) tuple of float [m]
    size : float [m]
        Side of a cell: at least what the largest needs, at most about the mean distance.
    counts : (3,) int64
        Cells of a turn along each axis, powers of two.

    """
    low, high = x.min(axis=1), x.max(axis=1)
    least = max(largest / (1.0 - 2.0 * SLACK) * (1.0 + LOOSE), np.finfo(float).tiny)
    extent = np.maximum(high - low, least)
    spacing = float(np.exp(np.mean(np.log(extent))) / x.shape[1] ** (1.0 / 3.0))
    size = max(least, CROWD * spacing, float(np.abs(x).max()) / FURTHEST)
    wanted = np.clip(np.ceil(np.log2(extent / size + 1.0)), 2, 40).astype(int)
    while wanted.sum() > max(6, int(np.log2(most))) and wanted.max() > 2:
        wanted[np.argmax(wanted)] -= 1
    return tuple(low.tolist()), size, 2 ** wanted.astype(np.int64)


@inlined
def cell_number(gas, a, b, c):
    """Give the number of the cell at a place in the grid."""
    counts = gas.grid.counts
    return ((a & (counts[0] - 1)) * counts[1] + (b & (counts[1] - 1))) * counts[2] + (
        c & (counts[2] - 1))


@inlined
def cell_beside(gas, i, k):
    """Return the number of cell k of the AROUND cells at and around that of a particle."""
    links = gas.links
    return cell_number(gas, links[i, AT] + k // 9 - 1, links[i, AT + 1] + k // 3 % 3 - 1,
                       links[i, AT + 2] + k % 3 - 1)


@inlined
def _along(gas, d, value):
    """Give the place in the grid along an axis."""
    return int(floor((value - gas.grid.origin[d]) / gas.grid.size))


@inlined
def enter(gas, i, x):
    """Put a particle into the cell where it is."""
    links, head = gas.links, gas.grid.head
    a, b, c = _along(gas, 0, x[0]), _along(gas, 1, x[1]), _along(gas, 2, x[2])
    links[i, AT], links[i, AT + 1], links[i, AT + 2] = a, b, c
    cell = cell_number(gas, a, b, c)
    first = head[cell]
    links[i, CELL], links[i, BEFORE], gas.grid.after[i] = cell, NONE, first
    if first != NONE:
        links[first, BEFORE] = i
    head[cell] = i


@inlined
def leave(gas, i):
    """Take a particle out of its cell."""
    links = gas.links
    after, before = gas.grid.after[i], links[i, BEFORE]
    if before == NONE:
        gas.grid.head[links[i, CELL]] = after
    else:
        gas.grid.after[before] = after
    if after != NONE:
        links[after, BEFORE] = before


@inlined
def _axis_exit(gas, i, d, x, v, low, high):
    """Give the time for which a particle is sure to stay within its cell along an axis."""
    size = gas.grid.size
    first = gas.grid.origin[d] + (gas.links[i, AT + d] - SLACK) * size
    above, below = first + (1.0 + 2.0 * SLACK) * size - x, x - first
    return min(safe_time(max(above, 0.0), -v, high), safe_time(max(below, 0.0), v, -low))


@kernel
def exit_time(gas, i, t, x, v, bend):
    """
    Give the time [s] up to which a particle is sure to stay within its cell.

    Parameters
    ----------
    gas : event_state.Gas
        The step.
    i : int
        Which particle.
    t : float [s]
        Now.
    x, v : (3,) tuple of float [m], [m/s]
        Where it is now.
    bend : float [m/s^2]
        Bound on its acceleration, if it does not fly freely.

    """
    if gas.links[i, KIND] == FREE:
        f, k, h = gas.forces, gas.forces.linear, t
        for d in range(3):
            a = f.gravity[d] - k * (v[d] - f.wind[d])
            low = a if k == 0.0 else min(a, 0.0)
            high = a if k == 0.0 else max(a, 0.0)
            step = _axis_exit(gas, i, d, x[d], v[d], low, high)
            h = t + step if d == 0 else min(h, t + step)
        return h
    h = t + _axis_exit(gas, i, 0, x[0], v[0], -bend, bend)
    h = min(h, t + _axis_exit(gas, i, 1, x[1], v[1], -bend, bend))
    return min(h, t + _axis_exit(gas, i, 2, x[2], v[2], -bend, bend))
