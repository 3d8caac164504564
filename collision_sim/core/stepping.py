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
The fixed-step methods over all particles: blocks of them, over the steps of a call, on threads.

A block stays in the cache for all steps of a call: it is flown, tested and answered before the
next block is touched. Blocks do not depend on the number of threads, and neither do results.
"""

from collision_sim.core.blocks import find_touching, path_lengths
from collision_sim.core.broad_phase import choose, most_move, radius_at
from collision_sim.core.candidates import book_free_flights, move_block
from collision_sim.core.jit import kernel, widest_vectors
from collision_sim.core.mesh_blocks import touch_meshes
from collision_sim.core.planes import answer_planes, CHUNK, ROWS
from collision_sim.core.response import resolve
from collision_sim.core.rules import Here, N_LOGGED
from collision_sim.core.threads import CLAIMED, ENTERED, fetch_add, LEFT
from collision_sim.core.trajectory import sweep_margin
from collision_sim.core.vectors import length, subtract
from numba import njit
import numpy as np

BLOCK = 256             # particles; their scratch fits the first-level cache
PIECE = 4               # blocks that a thread claims at once
TOGETHER = 16           # particles of a block that touch something; fewer are faster one by one
FEW = 12                # blocks; for fewer a second thread costs more than it brings


@kernel
def block_radius(radius, first, last):
    """Radii of a block, None where there are none."""
    if radius is not None:
        return radius[first:last]
    return None


@kernel
def _touching(sweep, grid, present, table, poses, motion, step, end, radius, old, x, y, z, clear,
              lengths, margins, touching):
    """Find the particles that may touch something: on their paths with `sweep`, or at the end."""
    if sweep is not None:
        for c in range(table.shape[0]):
            margins[c] = sweep_margin(sweep, motion, step, table, c)
        paths = lengths[:x.shape[0]]
        path_lengths(x, y, z, old, radius, paths)
        return find_touching(grid, present, table, poses, end, paths, margins, x, y, z, clear,
                             lengths, touching)
    return find_touching(grid, present, table, poses, end, radius, None, x, y, z, clear, lengths,
                         touching)


@kernel
def _few_left(planes, ledger, candidates, grid, rules, here, table, poses, motion, radius, log,
              accounts, first, old, x, y, z, vx, vy, vz, chunk, clear, cells, touching, count):
    """Answer those that touch a single plane together, unless they are few."""
    if planes is not None:
        if ledger is None:
            if candidates is None and count >= TOGETHER:
                return answer_planes(grid, rules, here, table, poses, motion, radius, log,
                                     accounts, first, old, x, y, z, vx, vy, vz, chunk, clear,
                                     cells, touching, count)
    return count


@kernel
def _reach(dt, x0, v0, x1, v1):
    """How far from its start anything may happen to a particle in a step [m], and more."""
    return 2.0 * length(subtract(x1, x0)) + 2.0 * dt * (length(v0) + length(v1))


@kernel
def _empty_log(candidates, accounts, block):
    """Begin the log of a step, unless candidates have come with entries of the collision stage."""
    if candidates is None:
        accounts[block, N_LOGGED] = 0


@kernel
def step_block(grid, rules, steps, row, block, table, poses, motion, radius, log, accounts, notes,
               ledger, candidates, x, v, old, scratch, lengths, margins, touching, chunk,
               chosen):
    """
    Take one block of particles through the steps of a call, in place.

    A candidate that stays clear of all colliders is what the step leaves; the few that touch one
    are answered by themselves from their state before the step, kept in `old`.
    """
    widest_vectors()
    first, rows = block * BLOCK, poses.shape[0] - 1
    last = min(first + BLOCK, x.shape[1])
    px, py, pz = x[0][first:last], x[1][first:last], x[2][first:last]
    vx, vy, vz = v[0][first:last], v[1][first:last], v[2][first:last]
    near, clear = block_radius(radius, first, last), scratch[:last - first]
    for step in range(row, row + steps):
        start, end = min(step, rows), min(step + 1, rows)
        _empty_log(candidates, accounts, block)
        move_block(candidates, rules.flight, first, px, py, pz, vx, vy, vz, old, clear)
        book_free_flights(candidates, ledger, rules.flight.dt, block, first, old, px, py, pz, vx,
                          vy, vz)
        count = _touching(rules.sweep, grid, rules.present, table, poses, motion, step, end, near,
                          old, px, py, pz, clear, lengths, margins, touching)
        count = touch_meshes(rules.present.meshes, rules.sweep, table, poses, motion, step, start,
                             end, near, old, px, py, pz, clear, lengths, touching, count)
        here = Here(step, start, end, block, first, 0.0, None)
        count = _few_left(rules.planes, ledger, candidates, grid, rules, here, table, poses,
                          motion, near, log, accounts, first, old, px, py, pz, vx, vy, vz, chunk,
                          clear, lengths, touching, count)
        move = most_move(motion, step, table) if count > 0 else 0.0
        for k in range(count):
            j = touching[k]
            x0, v0 = (old[0, j], old[1, j], old[2, j]), (old[3, j], old[4, j], old[5, j])
            reach = 2.0 * move + _reach(rules.flight.dt, x0, v0, (px[j], py[j], pz[j]),
                                        (vx[j], vy[j], vz[j]))
            here = Here(step, start, end, block, first + j, radius_at(near, j),
                        chosen[:choose(grid, table, poses, start, x0, reach, chosen)])
            x1, v1 = resolve(rules, here, table, poses, motion, log, accounts, notes,
                             x0, v0, ledger, candidates)
            px[j], py[j], pz[j] = x1
            vx[j], vy[j], vz[j] = v1


@njit(cache=True, error_model='numpy', nogil=True)
def step_blocks(posted, counters, plan, steps, row):
    """
    Take blocks of particles through the steps of a call, in place, until none is left.

    Parameters
    ----------
    posted, counters : (1,), (SHARED,) int64
        Of threads.share; by them threads divide the blocks.
    plan : plan.Plan
        What to do, and with what.
    steps : int
        Not negative.
    row : int
        Row of the poses at the start of the first of them, and of their motion.

    """
    widest_vectors()
    rules, table, poses, motion = plan.rules, plan.table, plan.poses, plan.motion
    radius, log, accounts, notes = plan.radius, plan.log, plan.accounts, plan.notes
    grid, x, v, ledger, candidates = plan.grid, plan.x, plan.v, plan.ledger, plan.candidates
    old, scratch, lengths = np.empty((6, BLOCK)), np.empty(BLOCK), np.empty(BLOCK)
    margins, chunk = np.empty(table.shape[0]), np.empty(ROWS * CHUNK)
    touching = np.empty(BLOCK + 1, dtype=np.int64)
    chosen = np.empty(table.shape[0], dtype=np.int64)
    fetch_add(posted, 0, 1)
    fetch_add(counters, ENTERED, 1)
    first = PIECE * fetch_add(counters, CLAIMED, 1)
    while first < accounts.shape[0]:
        for block in range(first, min(first + PIECE, accounts.shape[0])):
            step_block(grid, rules, steps, row, block, table, poses, motion, radius, log, accounts,
                       notes, ledger, candidates, x, v, old, scratch, lengths, margins, touching,
                       chunk, chosen)
        first = PIECE * fetch_add(counters, CLAIMED, 1)
    fetch_add(counters, LEFT, 1)
