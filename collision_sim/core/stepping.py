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
next block is touched, which comes from memory meanwhile. Blocks do not depend on the number of
threads, and neither do results.
"""

from collision_sim.core.blocks import (clear_if_finite, clear_of_others, collect, gain_velocities,
                                       hold, NONE, path_lengths, place_block, prefetch_row,
                                       take, TILE)
from collision_sim.core.broad_phase import most_move, radius_at
from collision_sim.core.candidates import candidate_of, fly_or_take, is_lean
from collision_sim.core.jit import entry, inlined, prefetch, widest_vectors
from collision_sim.core.ledger import is_kept
from collision_sim.core.lines import in_lines, LINE
from collision_sim.core.mesh_blocks import clear_of_meshes
from collision_sim.core.mesh_way import keep_answers
from collision_sim.core.nearby import Around, chosen_within, reach_of
from collision_sim.core.placing import freeze
from collision_sim.core.planes import answer_planes, CHUNK, ROWS
from collision_sim.core.response import resolve
from collision_sim.core.rules import Here, LOG, N_LOGGED
from collision_sim.core.threads import (AT_END, AT_START, claim, DONE, fetch_add, FIRST, NO_PIECE,
                                        post, SECOND, wait_for_job, wait_until_done)
from collision_sim.core.trajectory import sweep_margin
from collision_sim.core.vectors import add_scaled, is_finite, length
import numpy as np

BLOCK = 1024            # most particles of a block; it fits the second-level cache
SMALL_BLOCK = 512       # particles; less costs more than it brings
EVENT_BLOCK = 64        # particles, with the exact method, which spends far more time on each
APART = 40              # numbers more in a row of scratch, so that rows begin in other cache sets
TOGETHER = 16           # particles of a block that touch something; fewer are faster one by one
NO_JOB = -1             # serial number of none
SHARES = 4              # blocks that few particles are divided into
UNCLAIMED = 4           # last blocks of a job, which a thread claims when it is free, not earlier


def block_size(count):
    """Particles of a block, of so many in all: few are divided, too, for threads to share them."""
    return min(max(count // SHARES, SMALL_BLOCK), BLOCK) // CHUNK * CHUNK


@inlined
def _fly(lean, candidates, ledger, flight, block, first, x, y, z, vx, vy, vz, new, scratch, clear):
    """Write the candidates of a tile; `clear` is NaN where they are not finite, else 1."""
    if lean:
        place_block(flight, x, y, z, vx, vy, vz, new)
    else:
        fly_or_take(candidates, ledger, flight, block, first, x, y, z, vx, vy, vz, new, scratch)
    clear_if_finite(new[0], new[1], new[2], clear)


@inlined
def _sweep_margins(sweep, motion, step, table, margins):
    """Write how far each collider comes in a step; without sweeps it is 0 from the start."""
    if sweep:
        for c in range(table.shape[0]):
            margins[c] = sweep_margin(sweep, motion, step, table, c)


@inlined
def _clear(sweep, grid, present, table, poses, end, uniform, radius, x, y, z, new, lengths,
           margins, clear, scratch, chosen):
    """
    Lower `clear` where colliders but meshes are on paths, with `sweep`, or at their ends.

    Where all radii are the same, a number in place of an array reads less (with the products that
    a flight without drag is spared, work 1 takes 5 % less).
    """
    n = clear.shape[0]
    x1, y1, z1 = new[0][:n], new[1][:n], new[2][:n]
    if sweep:
        paths = lengths[:n]
        path_lengths(x, y, z, new, radius, paths)
        clear_of_others(grid, present, table, poses, end, NONE, paths, 1, margins, x1, y1, z1,
                        clear, scratch, chosen)
    elif uniform:
        clear_of_others(grid, present, table, poses, end, NONE, radius[0], None, margins, x1, y1,
                        z1, clear, scratch, chosen)
    else:
        clear_of_others(grid, present, table, poses, end, NONE, radius, None, margins, x1, y1,
                        z1, clear, scratch, chosen)


@inlined
def _take(lean, flight, ahead, x, y, z, vx, vy, vz, new):
    """Take the candidates of a tile."""
    take(x, y, z, new)
    if lean:
        gain_velocities(flight, ahead, vx, vy, vz)
    else:
        take(vx, vy, vz, new[3:])


@inlined
def _answer_together(world, margins, here, radius, first, x, y, z, vx, vy, vz, chunk, clear, cells,
                     chosen, touching, held, unanswered, count):
    """Answer those that touch a single plane together, unless they are few; how many are left."""
    ledger, candidates, rules = world.ledger, world.candidates, world.rules
    for k in range(count):
        unanswered[k] = k
    if (count >= TOGETHER and rules.planes and not is_kept(ledger)
            and candidates.settled.shape[0] == 0):
        return answer_planes(world, margins, here, radius, first, x, y, z, vx, vy, vz, chunk,
                             clear, cells, chosen, touching, held, unanswered, count)
    return count


@inlined
def _answer(world, step, start, end, block, i, radius, move, x0, v0, chosen, answers):
    """One step of particle i, which may touch something or not be finite; place and velocity."""
    grid, rules, accounts, candidates = world.grid, world.rules, world.accounts, world.candidates
    u, v1 = candidate_of(candidates, rules.flight, i, v0)
    x1 = add_scaled(x0, rules.flight.dt, u)
    if not is_finite(x1, v1):
        return freeze(accounts, block, x0)
    reach = reach_of(radius, move, x0, x1) + 2.0 * rules.flight.dt * (length(v0) + length(v1))
    around = Around(grid, move, chosen)
    here = Here(step, start, end, block, i, radius, chosen, answers, chosen[:0])
    here = chosen_within(around, world, here, x0, reach)
    place, velocity = resolve(world, here, x0, v0, around, reach)
    if not is_finite(place, velocity):
        return freeze(accounts, block, x0)
    return place, velocity


@inlined
def _empty_log(candidates, log, accounts, block):
    """Begin the log of a step, unless candidates have come with entries of the collision stage."""
    if candidates.settled.shape[0] == 0:
        if log.shape[1] > 0:        # what was written in the last step is likely to be again
            entries, first = LOG * accounts[block, N_LOGGED], block * log.shape[1] * LOG
            for k in range(0, entries, LINE):
                prefetch(log, first + k)
        accounts[block, N_LOGGED] = 0


@inlined
def step_block(world, steps, row, block, upcoming, new, scratch, clear, lengths, margins, same,
               held, touching, unanswered, chunk, chosen, answers):
    """
    Take one block of particles through the steps of a call, in place.

    A candidate that stays clear of all colliders is what the step leaves. The few that touch one
    are held, and answered by themselves from their state before the step. Who would end with
    something that is not finite is frozen.
    """
    grid, rules, table, poses = world.grid, world.rules, world.table, world.poses
    motion, log, accounts = world.motion, world.log, world.accounts
    ledger, candidates, x, v = world.ledger, world.candidates, world.x, world.v
    radius, size = world.radius, world.block
    widest_vectors()
    lean = is_lean(candidates, ledger, rules.flight.quadratic)
    first, rows = block * size, poses.shape[0] - 1
    last = min(first + size, x.shape[1])
    px, py, pz = x[0][first:last], x[1][first:last], x[2][first:last]
    vx, vy, vz = v[0][first:last], v[1][first:last], v[2][first:last]
    near = radius
    if radius.shape[0] > 1:
        near = radius[first:last]
    same[:], uniform = radius[0], radius.shape[0] == 1
    later = size * (upcoming - block) if upcoming != NO_PIECE else 0
    for step in range(row, row + steps):
        start, end, count = min(step, rows), min(step + 1, rows), 0
        turn = min(step, motion.shape[0] - 1)
        ahead = later if step == row + steps - 1 else 0
        _empty_log(candidates, log, accounts, block)
        _sweep_margins(rules.sweep, motion, turn, table, margins)
        for a in range(0, last - first, TILE):
            b = min(a + TILE, last - first)
            xt, yt, zt, ut, vt, wt = px[a:b], py[a:b], pz[a:b], vx[a:b], vy[a:b], vz[a:b]
            rt, ct = same[:b - a], clear[:b - a]
            if radius.shape[0] > 1:
                rt = near[a:b]
            _fly(lean, candidates, ledger, rules.flight, block, first + a, xt, yt, zt, ut, vt, wt,
                 new, scratch, ct)
            prefetch_row(xt, ahead)
            _clear(rules.sweep, grid, rules.present, table, poses, end, uniform, rt, xt, yt, zt,
                   new, lengths, margins, ct, scratch, chosen)
            clear_of_meshes(rules.present, rules.sweep, table, poses, motion, turn, start, end,
                            rt, xt, yt, zt, new, ct, lengths)
            prefetch_row(yt, ahead)
            before, count = count, collect(clear, b - a, touching, count)
            hold(px, py, pz, vx, vy, vz, a, touching, before, count, held)
            prefetch_row(zt, ahead)
            _take(lean, rules.flight, ahead, xt, yt, zt, ut, vt, wt, new)
        here = Here(turn, start, end, block, first, 0.0, chosen, answers, chosen[:0])
        left = _answer_together(world, margins, here, near, first, px, py, pz, vx, vy, vz, chunk,
                                clear, lengths, chosen, touching, held, unanswered, count)
        move = most_move(motion, turn, table) if left > 0 else 0.0
        for n in range(left):
            k = unanswered[n]
            j = touching[k]
            place, velocity = _answer(world, turn, start, end, block, first + j,
                                      radius_at(near, j), move,
                                      (held[0, k], held[1, k], held[2, k]),
                                      (held[3, k], held[4, k], held[5, k]), chosen, answers)
            px[j], py[j], pz[j] = place
            vx[j], vy[j], vz[j] = velocity


@entry
def step_blocks(job, pieces, steps, row, looks, world):
    """
    Take blocks of particles through the steps of a call, in place, until none is left.

    Parameters
    ----------
    job, pieces, looks
        As of threads.Crew; a piece is a block.
    steps : int
        Not negative.
    row : int
        Row of the poses at the start of the first of them, and of their motion.
    world : world.World
        What to do, and with what.

    Returns
    -------
    done : bool
        Whether all blocks are done.

    """
    widest_vectors()
    if pieces != NO_PIECE:
        post(job, pieces, steps, row)
    table = world.table
    tile = in_lines(9 * (TILE + APART)).reshape(9, TILE + APART)
    new, scratch, clear, lengths = tile[:6], tile[6], tile[7], tile[8]
    held = in_lines(6 * (BLOCK + APART)).reshape(6, BLOCK + APART)
    more = in_lines(TILE + ROWS * CHUNK + table.shape[0])
    same, chunk = more[:TILE], more[TILE:TILE + ROWS * CHUNK]
    margins = more[TILE + ROWS * CHUNK:]
    margins[:] = 0.0
    numbers = np.empty(2 * BLOCK + table.shape[0], dtype=np.int64)
    touching, unanswered = numbers[:BLOCK], numbers[BLOCK:2 * BLOCK]
    chosen = numbers[2 * BLOCK:]
    answers = keep_answers(world.rules.present.meshes, table)
    serial, patience, side = NO_JOB, 0, AT_START
    if pieces == NO_PIECE:
        patience, side = looks, AT_END
    while wait_for_job(job, serial, patience):
        serial, block, left = claim(job, side)
        while block != NO_PIECE:
            early, upcoming = left > UNCLAIMED, block
            if early:
                _, upcoming, left = claim(job, side)
            step_block(world, job[FIRST], job[SECOND], block, upcoming, new, scratch, clear,
                       lengths, margins, same, held, touching, unanswered, chunk, chosen, answers)
            fetch_add(job, DONE, 1)
            if not early:
                _, upcoming, left = claim(job, side)
            block = upcoming
    return wait_until_done(job, looks - patience)
