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
Which particles of a block may touch something: the same tests for all of them, branch-free.

A block of particles fits the cache nearest to the core. Each shape has a loop over the particles
of the block that LLVM turns into vector instructions; its sign agrees with the signed distance of
shapes.py or errs towards "may touch", and the few particles that may touch are then treated one
by one by response.py.
"""

from collision_sim.core.broad_phase import own_radius
from collision_sim.core.flight import affine, quadratic_factor
from collision_sim.core.jit import (inlined, kernel, lowest, not_clear, prefetch, select,
                                    widest_vectors, WORD)
from collision_sim.core.lines import LINE
from collision_sim.core.nearby import choose_for_tile, clear_in_grid
from collision_sim.core.shapes import (BOX, CAPSULE, CYLINDER, KIND, PLANE, seam_width, SIDE, SIZE,
                                       SPHERE)
import numpy as np

NONE = -1               # no collider to leave out
TILE = 256              # particles that are flown and tested at a time
MARGIN = 1e-14          # relative: squares are compared where the signed distance takes a root


@kernel
def _slowed_block(quadratic, vx, vy, vz, factor, ends):
    """Half a step of quadratic drag from a block's velocities to `ends`; as flight.slowed."""
    if quadratic[0] > 0.0:
        c, wx, wy, wz = quadratic[0], quadratic[1], quadratic[2], quadratic[3]
        for i in range(vx.shape[0]):
            ux, uy, uz = vx[i] - wx, vy[i] - wy, vz[i] - wz
            factor[i] = quadratic_factor(np.sqrt(ux * ux + uy * uy + uz * uz), c)
        for i in range(vx.shape[0]):
            ends[0, i] = wx + factor[i] * (vx[i] - wx)
            ends[1, i] = wy + factor[i] * (vy[i] - wy)
            ends[2, i] = wz + factor[i] * (vz[i] - wz)
    else:
        for i in range(vx.shape[0]):
            ends[0, i], ends[1, i], ends[2, i] = vx[i], vy[i], vz[i]


@kernel
def fly_block(flight, x, y, z, vx, vy, vz, new, factor):
    """
    Write the candidates of a block; the formula of flight.fly.

    Parameters
    ----------
    flight : Flight
        Coefficients of the step.
    x, y, z, vx, vy, vz : (B,) float64 [m], [m/s]
        State at the start of the step.
    new : (6, TILE) float64
        Overwritten with position and velocity at its end.
    factor : (TILE,) float64
        Scratch.

    """
    end, mean, gains, dt = flight.end_shift, flight.mean_shift, flight.gains, flight.dt
    ends = new[3:]
    _slowed_block(flight.quadratic, vx, vy, vz, factor, ends)
    for i in range(x.shape[0]):
        new[0, i] = x[i] + dt * affine(gains, 1, ends[0, i], mean[0])
        new[1, i] = y[i] + dt * affine(gains, 1, ends[1, i], mean[1])
        new[2, i] = z[i] + dt * affine(gains, 1, ends[2, i], mean[2])
    for i in range(x.shape[0]):
        ends[0, i] = affine(gains, 0, ends[0, i], end[0])
        ends[1, i] = affine(gains, 0, ends[1, i], end[1])
        ends[2, i] = affine(gains, 0, ends[2, i], end[2])
    if flight.quadratic[0] > 0.0:
        n = x.shape[0]
        _slowed_block(flight.quadratic, ends[0][:n], ends[1][:n], ends[2][:n], factor, ends)


@inlined
def prefetch_row(row, ahead):
    """
    Ask for what is worked on later, as much of it as now.

    Row by row between the stages of a tile: all six at once would be waited for, which at 1e6
    particles takes a sixth longer.

    Parameters
    ----------
    row : (B,) float64
        Of places or velocities of the tile.
    ahead : int
        How far behind it what comes later begins; 0 for nothing.

    """
    if ahead != 0:
        for i in range(0, row.shape[0], LINE):
            prefetch(row, ahead + i)


@inlined
def _place_component(gains, mean_shift, dt, x, v, new):
    widest_vectors()
    if gains[1] == 1.0:         # no drag: one product less
        for i in range(x.shape[0]):
            new[i] = x[i] + dt * (v[i] + mean_shift)
    else:
        for i in range(x.shape[0]):
            new[i] = x[i] + dt * affine(gains, 1, v[i], mean_shift)


@inlined
def place_block(flight, x, y, z, vx, vy, vz, new):
    """
    Write the candidate positions of a tile; `fly_block` without quadratic drag and velocities.

    Parameters
    ----------
    flight, x, y, z, vx, vy, vz, new
        As in `fly_block`; only positions are written.

    """
    mean, gains, dt = flight.mean_shift, flight.gains, flight.dt
    _place_component(gains, mean[0], dt, x, vx, new[0])
    _place_component(gains, mean[1], dt, y, vy, new[1])
    _place_component(gains, mean[2], dt, z, vz, new[2])


@inlined
def hold(x, y, z, vx, vy, vz, first, touching, before, count, held):
    """
    Keep the state of the particles of a tile that may touch something.

    Parameters
    ----------
    x, y, z, vx, vy, vz : (B,) float64 [m], [m/s]
        State of the block.
    first : int
        First particle of the tile.
    touching : (BLOCK,) int64
        Their numbers in the tile; overwritten with those in the block.
    before, count : int
        From which entry to which.
    held : (6, BLOCK) float64
        Overwritten with their places and velocities, at the same entries.

    """
    for k in range(before, count):
        j = np.uint64(first + touching[k])
        touching[k] = j
        held[0, k], held[1, k], held[2, k] = x[j], y[j], z[j]
        held[3, k], held[4, k], held[5, k] = vx[j], vy[j], vz[j]


@inlined
def _copy(source, target):
    widest_vectors()
    for i in range(target.shape[0]):
        target[i] = source[i]


@inlined
def take(x, y, z, new):
    """Take the first three rows of `new`: positions of a tile, or velocities."""
    _copy(new[0], x)
    _copy(new[1], y)
    _copy(new[2], z)


@inlined
def _gain_component(gains, end_shift, ahead, v):
    widest_vectors()
    prefetch_row(v, ahead)
    if gains[0] == 1.0:
        for i in range(v.shape[0]):
            v[i] = v[i] + end_shift
    else:
        for i in range(v.shape[0]):
            v[i] = affine(gains, 0, v[i], end_shift)


@inlined
def gain_velocities(flight, ahead, vx, vy, vz):
    """Give a tile the velocities at the end of its flight; ahead: as in `prefetch_row`."""
    end, gains = flight.end_shift, flight.gains
    _gain_component(gains, end[0], ahead, vx)
    _gain_component(gains, end[1], ahead, vy)
    _gain_component(gains, end[2], ahead, vz)


@inlined
def _smaller(a, b):
    """Give the smaller number; NaN where the first one is."""
    return select(b < a, b, a)


@inlined
def _larger(a, b):
    return select(a > b, a, b)


@inlined
def _square_limit(size, side, r):
    limit = _larger(size + side * r, 0.0)
    return limit * limit * (1.0 + side * MARGIN)


@inlined
def _clear_planes(table, poses, chosen, skip, radius, margins, x, y, z, clear):
    widest_vectors()
    for m in range(chosen.shape[0]):
        c = chosen[m]
        margin = margins[c]
        if table[c, KIND] != PLANE or c == skip:
            continue
        pose, side = poses[c], table[c, SIDE]
        nx, ny, nz, px, py, pz = pose[2], pose[5], pose[8], pose[9], pose[10], pose[11]
        for i in range(x.shape[0]):
            q = nx * (x[i] - px) + ny * (y[i] - py) + nz * (z[i] - pz)
            clear[i] = _smaller(clear[i], side * q - (own_radius(radius, i) + margin))


@inlined
def _clear_spheres(table, poses, chosen, skip, radius, margins, x, y, z, clear):
    widest_vectors()
    for m in range(chosen.shape[0]):
        c = chosen[m]
        margin = margins[c]
        if table[c, KIND] != SPHERE or c == skip:
            continue
        pose, side = poses[c], table[c, SIDE]
        size = table[c, SIZE]
        px, py, pz = pose[9], pose[10], pose[11]
        for i in range(x.shape[0]):
            ax, ay, az = x[i] - px, y[i] - py, z[i] - pz
            limit = _square_limit(size, side, own_radius(radius, i) + margin)
            clear[i] = _smaller(clear[i], side * (ax * ax + ay * ay + az * az - limit))


@inlined
def _clear_boxes(table, poses, chosen, skip, radius, margins, x, y, z, clear):
    widest_vectors()
    for m in range(chosen.shape[0]):
        c = chosen[m]
        margin = margins[c]
        if table[c, KIND] != BOX or c == skip:
            continue
        p, side = poses[c], table[c, SIDE]
        wide = seam_width(table, c, (p[9], p[10], p[11]))
        h0, h1 = table[c, SIZE] + wide, table[c, SIZE + 1] + wide
        h2 = table[c, SIZE + 2] + wide
        r0, r1, r2, r3, r4, r5, r6, r7, r8 = p[:9]
        px, py, pz = p[9], p[10], p[11]
        for i in range(x.shape[0]):
            ax, ay, az = x[i] - px, y[i] - py, z[i] - pz
            dx = abs(r0 * ax + r3 * ay + r6 * az) - h0
            dy = abs(r1 * ax + r4 * ay + r7 * az) - h1
            dz = abs(r2 * ax + r5 * ay + r8 * az) - h2
            outside = _larger(dx, _larger(dy, dz))
            clear[i] = _smaller(clear[i], side * outside - (own_radius(radius, i) + margin))


@inlined
def _clear_capsules(table, poses, chosen, skip, radius, margins, x, y, z, clear):
    widest_vectors()
    for m in range(chosen.shape[0]):
        c = chosen[m]
        margin = margins[c]
        if table[c, KIND] != CAPSULE or c == skip:
            continue
        pose, side = poses[c], table[c, SIDE]
        size, half = table[c, SIZE], table[c, SIZE + 1]
        r0, r1, r2, r3, r4, r5, r6, r7, r8 = pose[:9]
        px, py, pz = pose[9], pose[10], pose[11]
        for i in range(x.shape[0]):
            ax, ay, az = x[i] - px, y[i] - py, z[i] - pz
            lx, ly = r0 * ax + r3 * ay + r6 * az, r1 * ax + r4 * ay + r7 * az
            lz = r2 * ax + r5 * ay + r8 * az
            lz = lz - _smaller(_larger(lz, -half), half)
            limit = _square_limit(size, side, own_radius(radius, i) + margin)
            clear[i] = _smaller(clear[i], side * (lx * lx + ly * ly + lz * lz - limit))


@inlined
def _clear_cylinders(table, poses, chosen, skip, radius, margins, x, y, z, clear):
    widest_vectors()
    for m in range(chosen.shape[0]):
        c = chosen[m]
        margin = margins[c]
        if table[c, KIND] != CYLINDER or c == skip:
            continue
        pose, side = poses[c], table[c, SIDE]
        wide = seam_width(table, c, (pose[9], pose[10], pose[11]))
        size, half = table[c, SIZE] + wide, table[c, SIZE + 1] + wide
        r0, r1, r2, r3, r4, r5, r6, r7, r8 = pose[:9]
        px, py, pz = pose[9], pose[10], pose[11]
        for i in range(x.shape[0]):
            ax, ay, az = x[i] - px, y[i] - py, z[i] - pz
            lx, ly = r0 * ax + r3 * ay + r6 * az, r1 * ax + r4 * ay + r7 * az
            lz = r2 * ax + r5 * ay + r8 * az
            r = own_radius(radius, i) + margin
            barrel = lx * lx + ly * ly - _square_limit(size, side, r)
            outside = _larger(barrel, abs(lz) - (half + side * r) * (1.0 + side * MARGIN))
            clear[i] = _smaller(clear[i], side * outside)


@inlined
def path_lengths(x, y, z, new, radius, lengths):
    """Write the length of each path of a block, plus the radius, to `lengths` (B,) [m]."""
    widest_vectors()
    for i in range(x.shape[0]):
        dx, dy, dz = new[0, i] - x[i], new[1, i] - y[i], new[2, i] - z[i]
        lengths[i] = np.sqrt(dx * dx + dy * dy + dz * dz) + own_radius(radius, i)


@inlined
def clear_of_others(grid, present, table, poses, end, skip, radius, wide, margins, x, y, z, clear,
                    cells, chosen):
    """
    Lower `clear` to how clear the particles of a block are of all colliders but meshes and one.

    Parameters
    ----------
    grid : broad_phase.Grid
        Without cells in scenes of few colliders.
    present, table, poses
        As in shapes.signed_distance.
    end : int
        Row of poses at the end of the step.
    skip : int
        Collider that is left out, or NONE.
    radius : (B,) float64 or float [m]
        Of the particles of the block, or of all; more where they may touch colliders further away.
    wide : int or None
        1 if it may be more.
    margins : (C,) float64 [m]
        How far each collider came, with sweeps; else 0.
    x, y, z : (B,) float64 [m]
        Candidate positions.
    clear : (B,) float64
        Negative afterwards where a particle may touch a collider; NaN stays.
    cells : (B,) float64, as long as WORD divides
        Scratch.
    chosen : (C,) int64
        Scratch.

    """
    which, all_chosen = choose_for_tile(grid, wide, radius, x, y, z, chosen)
    _clear_planes(table, poses[end], which, skip, radius, margins, x, y, z, clear)
    _clear_spheres(table, poses[end], which, skip, radius, margins, x, y, z, clear)
    _clear_boxes(table, poses[end], which, skip, radius, margins, x, y, z, clear)
    _clear_capsules(table, poses[end], which, skip, radius, margins, x, y, z, clear)
    _clear_cylinders(table, poses[end], which, skip, radius, margins, x, y, z, clear)
    if not all_chosen:
        clear_in_grid(grid, present, table, poses, end, skip, radius, wide, margins, x, y, z,
                      clear, cells)


@inlined
def clear_if_finite(x, y, z, clear):
    """Write 1 to `clear` (B,), but NaN for places that are not finite; velocities show there."""
    widest_vectors()
    for i in range(clear.shape[0]):
        clear[i] = 1.0 + 0.0 * (x[i] + y[i] + z[i])


@inlined
def collect(clear, size, touching, count):
    """
    Find the particles of a tile that are not clear.

    Parameters
    ----------
    clear : (TILE,) float64
        Negative or NaN: not clear.
    size : int
        Particles of the tile; what comes after theirs is overwritten.
    touching : (BLOCK,) int64
        Overwritten with their numbers, ascending, from entry `count` on.
    count : int
        Entries before.

    Returns
    -------
    count : int
        Entries now.

    """
    for i in range(size, (size + WORD - 1) // WORD * WORD):
        clear[i] = 1.0
    for first in range(0, size, WORD):
        bits = not_clear(clear, first)
        while bits != 0:
            touching[count] = first + lowest(bits)
            count += 1
            bits &= bits - np.uint64(1)
    return count
