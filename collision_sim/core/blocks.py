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

from collision_sim.core.broad_phase import (clear_in_grid, how_many, nth, others_of,
                                            radius_at)
from collision_sim.core.flight import affine, quadratic_factor
from collision_sim.core.jit import kernel, widest_vectors
from collision_sim.core.shapes import BOX, CAPSULE, CYLINDER, KIND, PLANE, SIDE, SIZE, SPHERE
import numpy as np

NONE = -1               # no collider to leave out
MARGIN = 1e-14          # relative: squares are compared where the signed distance takes a root


@kernel
def margin_at(margins, c):
    """Margin [m] around collider c; None without margins."""
    if margins is not None:
        return margins[c]
    return None


@kernel
def near_at(radius, i, margin):
    """Distance [m] from collider to centre at which particle i may touch it."""
    if margin is not None:
        return radius_at(radius, i) + margin
    return radius_at(radius, i)


@kernel
def _slow_block(quadratic, vx, vy, vz, factor):
    """Half a step of quadratic drag on a block, if there is any; the formula of flight.slowed."""
    if quadratic is not None:
        c, wx, wy, wz = quadratic[0], quadratic[1], quadratic[2], quadratic[3]
        for i in range(vx.shape[0]):
            ux, uy, uz = vx[i] - wx, vy[i] - wy, vz[i] - wz
            factor[i] = quadratic_factor(np.sqrt(ux * ux + uy * uy + uz * uz), c)
        for i in range(vx.shape[0]):
            vx[i] = wx + factor[i] * (vx[i] - wx)
        for i in range(vy.shape[0]):
            vy[i] = wy + factor[i] * (vy[i] - wy)
        for i in range(vz.shape[0]):
            vz[i] = wz + factor[i] * (vz[i] - wz)


@kernel
def _fly_component(gains, end_shift, mean_shift, dt, x, v, old_x):
    widest_vectors()
    for i in range(x.shape[0]):
        before = v[i]
        old_x[i] = x[i]
        x[i] = x[i] + dt * affine(gains, 1, before, mean_shift)
        v[i] = affine(gains, 0, before, end_shift)


@kernel
def _copy(source, target):
    for i in range(source.shape[0]):
        target[i] = source[i]


@kernel
def fly_block(flight, x, y, z, vx, vy, vz, old, factor):
    """
    Move a block of particles by the candidate motion, in place; the formula of flight.fly.

    Parameters
    ----------
    flight : Flight
        Coefficients of the step.
    x, y, z, vx, vy, vz : (B,) float64 [m], [m/s]
        Overwritten with the candidate.
    old : (6, BLOCK) float64
        Overwritten with position and velocity at the start of the step.
    factor : (B,) float64
        Scratch.

    """
    _copy(vx, old[3])
    _copy(vy, old[4])
    _copy(vz, old[5])
    end, mean, gains, dt = flight.end_shift, flight.mean_shift, flight.gains, flight.dt
    _slow_block(flight.quadratic, vx, vy, vz, factor)
    _fly_component(gains, end[0], mean[0], dt, x, vx, old[0])
    _fly_component(gains, end[1], mean[1], dt, y, vy, old[1])
    _fly_component(gains, end[2], mean[2], dt, z, vz, old[2])
    _slow_block(flight.quadratic, vx, vy, vz, factor)


@kernel
def _smaller(a, b):
    return a if a < b else b


@kernel
def _larger(a, b):
    return a if a > b else b


@kernel
def _square_limit(size, side, r):
    limit = _larger(size + side * r, 0.0)
    return limit * limit * (1.0 + side * MARGIN)


@kernel
def _clear_planes(present, table, poses, chosen, skip, radius, margins, x, y, z, clear):
    widest_vectors()
    if present is not None:
        for m in range(how_many(chosen, table)):
            c = nth(chosen, m)
            margin = margin_at(margins, c)
            if table[c, KIND] != PLANE or c == skip:
                continue
            pose, side = poses[c], table[c, SIDE]
            nx, ny, nz, px, py, pz = pose[2], pose[5], pose[8], pose[9], pose[10], pose[11]
            for i in range(x.shape[0]):
                q = nx * (x[i] - px) + ny * (y[i] - py) + nz * (z[i] - pz)
                clear[i] = _smaller(clear[i], side * q - near_at(radius, i, margin))


@kernel
def _clear_spheres(present, table, poses, chosen, skip, radius, margins, x, y, z, clear):
    widest_vectors()
    if present is not None:
        for m in range(how_many(chosen, table)):
            c = nth(chosen, m)
            margin = margin_at(margins, c)
            if table[c, KIND] != SPHERE or c == skip:
                continue
            pose, side = poses[c], table[c, SIDE]
            size = table[c, SIZE]
            px, py, pz = pose[9], pose[10], pose[11]
            for i in range(x.shape[0]):
                ax, ay, az = x[i] - px, y[i] - py, z[i] - pz
                limit = _square_limit(size, side, near_at(radius, i, margin))
                clear[i] = _smaller(clear[i], side * (ax * ax + ay * ay + az * az - limit))


@kernel
def _clear_boxes(present, table, poses, chosen, skip, radius, margins, x, y, z, clear):
    widest_vectors()
    if present is not None:
        for m in range(how_many(chosen, table)):
            c = nth(chosen, m)
            margin = margin_at(margins, c)
            if table[c, KIND] != BOX or c == skip:
                continue
            p, side = poses[c], table[c, SIDE]
            h0, h1, h2 = table[c, SIZE:SIZE + 3]
            r0, r1, r2, r3, r4, r5, r6, r7, r8 = p[:9]
            px, py, pz = p[9], p[10], p[11]
            for i in range(x.shape[0]):
                ax, ay, az = x[i] - px, y[i] - py, z[i] - pz
                dx = abs(r0 * ax + r3 * ay + r6 * az) - h0
                dy = abs(r1 * ax + r4 * ay + r7 * az) - h1
                dz = abs(r2 * ax + r5 * ay + r8 * az) - h2
                outside = _larger(dx, _larger(dy, dz))
                clear[i] = _smaller(clear[i], side * outside - near_at(radius, i, margin))


@kernel
def _clear_capsules(present, table, poses, chosen, skip, radius, margins, x, y, z, clear):
    widest_vectors()
    if present is not None:
        for m in range(how_many(chosen, table)):
            c = nth(chosen, m)
            margin = margin_at(margins, c)
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
                limit = _square_limit(size, side, near_at(radius, i, margin))
                clear[i] = _smaller(clear[i], side * (lx * lx + ly * ly + lz * lz - limit))


@kernel
def _clear_cylinders(present, table, poses, chosen, skip, radius, margins, x, y, z, clear):
    widest_vectors()
    if present is not None:
        for m in range(how_many(chosen, table)):
            c = nth(chosen, m)
            margin = margin_at(margins, c)
            if table[c, KIND] != CYLINDER or c == skip:
                continue
            pose, side = poses[c], table[c, SIDE]
            size, half = table[c, SIZE], table[c, SIZE + 1]
            r0, r1, r2, r3, r4, r5, r6, r7, r8 = pose[:9]
            px, py, pz = pose[9], pose[10], pose[11]
            for i in range(x.shape[0]):
                ax, ay, az = x[i] - px, y[i] - py, z[i] - pz
                lx, ly = r0 * ax + r3 * ay + r6 * az, r1 * ax + r4 * ay + r7 * az
                lz = r2 * ax + r5 * ay + r8 * az
                r = near_at(radius, i, margin)
                barrel = lx * lx + ly * ly - _square_limit(size, side, r)
                outside = _larger(barrel, abs(lz) - (half + side * r) * (1.0 + side * MARGIN))
                clear[i] = _smaller(clear[i], side * outside)


@kernel
def path_lengths(x, y, z, old, radius, lengths):
    """Write the length of each path of a block, plus the radius, to `lengths` (B,) [m]."""
    for i in range(x.shape[0]):
        dx, dy, dz = x[i] - old[0, i], y[i] - old[1, i], z[i] - old[2, i]
        lengths[i] = np.sqrt(dx * dx + dy * dy + dz * dz) + radius_at(radius, i)


@kernel
def _clear_all(grid, present, table, poses, end, skip, radius, margins, x, y, z, clear, cells):
    """Write how clear particles are of all colliders but one; negative: may touch."""
    chosen = others_of(grid)
    for i in range(clear.shape[0]):
        clear[i] = 1.0
    _clear_planes(present.planes, table, poses[end], chosen, skip, radius, margins, x, y, z,
                  clear)
    _clear_spheres(present.spheres, table, poses[end], chosen, skip, radius, margins, x, y, z,
                   clear)
    _clear_boxes(present.boxes, table, poses[end], chosen, skip, radius, margins, x, y, z,
                 clear)
    _clear_capsules(present.capsules, table, poses[end], chosen, skip, radius, margins, x, y, z,
                    clear)
    _clear_cylinders(present.cylinders, table, poses[end], chosen, skip, radius, margins, x, y, z,
                     clear)
    clear_in_grid(grid, present, table, poses, end, skip, radius, margins, x, y, z, clear, cells)


@kernel
def clear_of_others(grid, present, table, poses, end, c, radius, x, y, z, clear, cells):
    """Write how clear particles are of all colliders but c, as in `find_touching`."""
    _clear_all(grid, present, table, poses, end, c, radius, None, x, y, z, clear, cells)


@kernel
def find_touching(grid, present, table, poses, end, radius, margins, x, y, z, clear, cells,
                  touching):
    """
    Particles of a block that may be inside a collider.

    Parameters
    ----------
    grid : broad_phase.Grid or None
        None in scenes of few colliders.
    present, table, poses
        As in shapes.signed_distance.
    end : int
        Row of poses at the end of the step.
    radius : (B,) float64 [m] or None
        Of the particles of the block; with sweeps also the length of their paths.
    margins : (C,) float64 [m] or None
        With sweeps, how far each collider came.
    x, y, z : (B,) float64 [m]
        Candidate positions.
    clear, cells, touching : (B,) float64, (B,) float64, (B,) int64
        Scratch, and the result: which particles of the block, ascending.

    Returns
    -------
    count : int
        How many entries of `touching` are set.

    """
    _clear_all(grid, present, table, poses, end, NONE, radius, margins, x, y, z, clear,
               cells)
    count = 0
    for i in range(clear.shape[0]):
        touching[count] = i
        count += clear[i] < 0.0
    return count
