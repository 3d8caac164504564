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

"""Which particles end a step inside a collider: it may throw or push them onto somebody."""

from collision_sim.core.blocks import clear_if_finite, clear_of_others, collect, TILE
from collision_sim.core.detection import end_distance
from collision_sim.core.jit import entry, kernel
from collision_sim.core.lines import in_lines
from collision_sim.core.mesh_blocks import clear_of_meshes
from collision_sim.core.mesh_way import keep_answers
from collision_sim.core.motion import point_velocity, START
from collision_sim.core.pairs import column
from collision_sim.core.rules import Here, NONE, ROUNDING
from collision_sim.core.stepping import BLOCK
from collision_sim.core.threads import CLAIMED, ENTERED, fetch_add, LEFT
from collision_sim.core.vectors import add_scaled, dot, largest, subtract
import numpy as np


@kernel
def _bounces(world, radius, i, everyone, answers):
    """
    Whether particle i ends inside a collider that it approaches at the start of the step.

    With sweeps it has met a face on the way, perhaps another one than that it leaves at the end.
    """
    rules, poses = world.rules, world.poses
    here = Here(0, 0, min(1, poses.shape[0] - 1), i // BLOCK, i, radius[i], everyone, answers,
                everyone[:0])
    x0, velocity, u = column(world.x, i), column(world.v, i), column(
        world.candidates.u, i)
    x1 = add_scaled(x0, rules.flight.dt, u)
    for c in range(world.table.shape[0]):
        gap, n = end_distance(world, here, c, x0, x1)
        if gap < 0.0:
            obj = point_velocity(world.motion, poses, 0, START, 0, c, x0)
            least = ROUNDING * (largest(velocity) + largest(obj) + largest(u))
            v_n = dot(n, subtract(velocity, obj))
            if v_n < -least or (rules.sweep and v_n > least):
                return True
    return False


@kernel
def _find_in_block(world, radius, block, bounced, ends, clear, cells, chosen, touching, everyone,
                   answers, margins):
    """List those of a block that touch a collider; how many there are, and how many bounce."""
    rules, table, poses, x = world.rules, world.table, world.poses, world.x
    first, last = block * BLOCK, min((block + 1) * BLOCK, x.shape[1])
    found, bouncing, dt, u = 0, 0, rules.flight.dt, world.candidates.u
    for a in range(first, last, TILE):
        b = min(a + TILE, last)
        xt, yt, zt, tile = ends[0, :b - a], ends[1, :b - a], ends[2, :b - a], clear[:b - a]
        for k in range(b - a):
            xt[k] = x[0, a + k] + dt * u[0, a + k]
            yt[k] = x[1, a + k] + dt * u[1, a + k]
            zt[k] = x[2, a + k] + dt * u[2, a + k]
        clear_if_finite(xt, yt, zt, tile)
        clear_of_others(world.grid, rules.present, table, poses, min(1, poses.shape[0] - 1), NONE,
                        radius[a:b], None, margins, xt, yt, zt, tile, cells, chosen)
        clear_of_meshes(rules.present, rules.sweep, table, poses, world.motion, 0, 0,
                        min(1, poses.shape[0] - 1), radius[a:b], x[0, a:b], x[1, a:b], x[2, a:b],
                        ends, tile, cells)
        for k in range(collect(clear, b - a, touching, 0)):
            i = a + touching[k]
            bounces = _bounces(world, radius, i, everyone, answers)
            bounced[first + found] = i if bounces else -1 - i
            found, bouncing = found + 1, bouncing + bounces
    return found, bouncing


@entry
def find_bounces(posted, counters, world, radius, bounced, counts):
    """
    Find the particles whose candidates end inside a collider.

    Parameters
    ----------
    posted, counters
        Of threads.share.
    world
        As in stepping.step_blocks.
    radius : (N,) float64 [m]
        Of the particles.
    x, v
        As in candidates.py.
    bounced, counts : (N,) int64, (blocks, 2) int64
        Written: of each block of particles those that touch a collider, from its first on, and
        how many. Those that do not approach it are written as -1 - i; how many do comes second.

    """
    table = world.table
    clear, cells, ends = in_lines(TILE), in_lines(TILE), np.empty((3, TILE))
    answers, everyone = keep_answers(world.rules.present.meshes, table), np.arange(table.shape[0])
    margins = np.zeros(table.shape[0])
    chosen, touching = np.empty(table.shape[0], dtype=np.int64), np.empty(BLOCK, dtype=np.int64)
    fetch_add(posted, 0, 1)
    fetch_add(counters, ENTERED, 1)
    block = fetch_add(counters, CLAIMED, 1)
    while block < counts.shape[0]:
        counts[block, 0], counts[block, 1] = _find_in_block(
            world, radius, block, bounced, ends, clear, cells, chosen, touching, everyone, answers,
            margins)
        block = fetch_add(counters, CLAIMED, 1)
    fetch_add(counters, LEFT, 1)
