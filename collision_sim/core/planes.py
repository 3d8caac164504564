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
Particles of a block that touch one plane and nothing else, answered many at a time.

Most contacts are of that kind. This is response.resolve for them without its loops: the same
formulae in the same order, so both agree to the last bit, over a chunk of particles at a time, of
which LLVM makes vector instructions. Who is not settled after one collision and one contact is
left to `resolve`.
"""

from math import sqrt

from collision_sim.core.blocks import clear_of_others
from collision_sim.core.broad_phase import radius_at
from collision_sim.core.detection import approach
from collision_sim.core.flight import fly, fly_calmly
from collision_sim.core.impulses import doubtful_change, respond_to_slip, slip_of
from collision_sim.core.jit import inlined, kernel, widest_vectors
from collision_sim.core.laws import normal_impulse
from collision_sim.core.mesh_blocks import clear_of_mesh_boxes
from collision_sim.core.motion import chord_velocity, DOUBT, END, point_velocity, START
from collision_sim.core.rules import (CHANGE, COLLISION, N_COLLISION, N_CONTACT, N_LOGGED, NORMAL,
                                      POINT, PUSHES, ROUNDING, SLIDE, STICK)
from collision_sim.core.shapes import KIND, PLANE, RESTITUTION, WET
from collision_sim.core.vectors import (add, add_scaled, dot, EPSILON, LARGE_SQUARE, largest,
                                        origin, SMALL_SQUARE, subtract)
import numpy as np

CHUNK = 64                  # particles answered at a time
LANES = 8                   # a multiple of the numbers in a vector register
REACH = 2.0                 # paths to the candidate: the most by which the contact stage moves one
# Rows of the scratch, CHUNK numbers each; one flat array, so that LLVM knows what may overlap:
# place and velocity, which particle, its radius, radius and reach, candidate; where it touched,
# change of velocity, normal velocity of the collision; what happened.
PLACE, VELOCITY, WHICH, RADIUS, NEAR, BETWEEN, TOUCHED, CHANGED = 0, 3, 6, 7, 8, 9, 12, 15
SPEED, DONE, ROWS = 18, 19, 20
LEFT, HIT, PRESSED, STUCK = -1.0, 1.0, 2.0, 4.0     # left to `resolve`, or a sum of the others


@inlined
def _height(poses, s, c, x):
    """Signed distance [m] of a point to a plane, as shapes.signed_distance gives it."""
    a = subtract(x, origin(poses, s, c))
    return poses[s, c, 2] * a[0] + poses[s, c, 5] * a[1] + poses[s, c, 8] * a[2]


@inlined
def _respond(rare, table, c, v, obj, n, v_n, dv_n):
    """Respond as impulses.respond, and say whether the size of the slip needs no scaling."""
    slip = slip_of(v, obj, n)
    square = dot(slip, slip)
    plain = square == 0.0 or SMALL_SQUARE < square < LARGE_SQUARE
    after, stuck = respond_to_slip(rare, table, c, v, obj, n, v_n, dv_n, slip, sqrt(square))
    return after, stuck, plain


@inlined
def _fly(rare, flight, v):
    """Fly as flight.fly; with `rare` None it is known that there is no quadratic drag."""
    if rare is not None:
        return fly(flight, v)
    return fly_calmly(flight, v)


@inlined
def _end_change(motion, poses, step, end, c, x1, n, w_n, most, touched):
    """Change of the normal velocity at the end, as response.py limits it."""
    if motion is not None:
        off = abs(dot(point_velocity(motion, poses, step, DOUBT, end, c, x1), n))
        if off > 0.0 and touched:
            return doubtful_change(w_n, most, off)
    return -w_n


@inlined
def _pushed(poses, end, c, radius, n, x, k):
    """Place after push number k of placing.push_out, and whether that was a short one."""
    phi = _height(poses, end, c, x) - radius
    rounding = EPSILON * (largest(x) + largest(origin(poses, end, c)) + radius)
    if phi < 0.0:
        return add_scaled(x, (k * rounding - phi) / dot(n, n), n), -phi < (PUSHES - 2) * rounding
    return x, True


@inlined
def _span(a):
    """Sum of the components of a vector, which is at least its length and has no square."""
    return abs(a[0]) + abs(a[1]) + abs(a[2])


@inlined
def _at(row, i):
    """Where particle i of a chunk is in a row of the scratch; not signed: none is from the end."""
    return np.uint64(row * CHUNK + i)


@inlined
def _read(s, row, i):
    """Vector of particle i of a chunk, from three rows of the scratch."""
    return s[_at(row, i)], s[_at(row + 1, i)], s[_at(row + 2, i)]


@inlined
def _write(s, row, i, a):
    """Write a vector of particle i of a chunk to three rows of the scratch."""
    s[_at(row, i)], s[_at(row + 1, i)], s[_at(row + 2, i)] = a


@inlined
def _is_still(motion, step, c):
    """Whether a plane does not move in this step: the velocities of its points are 0 exactly."""
    for k in range(motion.shape[2]):
        if motion[step, c, k] != 0.0:
            return False
    return True


@inlined
def _approach(poses, motion, step, start, end, c, x0, v0):
    """Give the normal velocity [m/s] of a collision on v0, or 0; and that of the plane."""
    n = (poses[end, c, 2], poses[end, c, 5], poses[end, c, 8])
    obj = point_velocity(motion, poses, step, START, start, c, x0)
    return approach(v0, obj, n), obj, n


@inlined
def _find_hits(poses, motion, step, start, end, c, s, count):
    """Write the normal velocity of the collisions of a chunk; how many there are."""
    widest_vectors()
    hits = 0
    for i in range(count):
        v_n, _, _ = _approach(poses, motion, step, start, end, c, _read(s, PLACE, i),
                              _read(s, VELOCITY, i))
        s[_at(SPEED, i)], s[_at(DONE, i)] = v_n, PRESSED
        hits += v_n < 0.0
    return hits


@inlined
def _collide(rare, rules, table, poses, motion, step, start, end, c, s, count):
    """Collision stage of a chunk; the new candidates, and where the old ones touched."""
    widest_vectors()
    for i in range(count):
        x0, v0, r = _read(s, PLACE, i), _read(s, VELOCITY, i), s[_at(RADIUS, i)]
        v_n, obj, n = _approach(poses, motion, step, start, end, c, x0, v0)
        after, _, plain = _respond(rare, table, c, v0, obj, n, v_n,
                                   normal_impulse(v_n, table[c, RESTITUTION]))
        hit, x1 = v_n < 0.0, _read(s, BETWEEN, i)
        touched = add_scaled(x1, -(_height(poses, end, c, x1) - r), n)
        between = add_scaled(x0, rules.flight.dt, _fly(rare, rules.flight, after)[0])
        settled = not hit or approach(after, obj, n) == 0.0
        inside = not hit or _height(poses, end, c, between) - r < 0.0
        done = (HIT if hit else 0.0) + (PRESSED if inside else 0.0)
        s[_at(DONE, i)] = done if plain and (settled or not inside) else LEFT
        _write(s, CHANGED, i, subtract(after, v0))
        _write(s, TOUCHED, i, touched)
        _write(s, BETWEEN, i, between if hit else x1)
        _write(s, VELOCITY, i, after if hit else v0)


@inlined
def _press(rare, rules, table, poses, motion, step, start, end, c, s, count):
    """Contact stage of a chunk, for those inside; places and velocities at the end."""
    widest_vectors()
    n, dt = (poses[end, c, 2], poses[end, c, 5], poses[end, c, 8]), rules.flight.dt
    for i in range(count):
        x0, v, r = _read(s, PLACE, i), _read(s, VELOCITY, i), s[_at(RADIUS, i)]
        hit, done = s[_at(SPEED, i)] < 0.0, s[_at(DONE, i)]
        gap = _height(poses, start, c, x0) - r
        rounding = ROUNDING * (largest(x0) + largest(origin(poses, start, c)))
        u, w = _fly(rare, rules.flight, v)
        chord = chord_velocity(motion, poses, step, start, c, x0, dt)
        u_n = approach(u, chord, n)
        u2, stuck, plain = _respond(rare, table, c, u, chord, n, u_n, 0.0 - u_n)
        x2, du = add_scaled(x0, dt, u2), subtract(u2, u)
        obj = point_velocity(motion, poses, step, END, end, c, x2)
        w_n = approach(w, obj, n)
        dw_n = _end_change(motion, poses, step, end, c, x2, n, w_n, 2.0 * dot(du, n),
                           not hit and gap <= rounding)
        slowed, _, plainer = _respond(rare, table, c, w, obj, n, w_n, dw_n)
        w2 = slowed if w_n < 0.0 else w
        place, near = _pushed(poses, end, c, r, n, x2, 0)
        place, nearer = _pushed(poses, end, c, r, n, place, 1)
        calm = approach(u2, chord, n) == 0.0 and u_n < 0.0 and near and nearer
        calm = calm and _height(poses, end, c, place) - r >= 0.0 and plain and plainer
        calm = calm and _span(subtract(place, _read(s, BETWEEN, i))) <= s[_at(NEAR, i)] - r
        inside, change = done >= PRESSED, subtract(w2, w)
        fits = gap >= -rounding and (calm or not inside)
        pressed = done + (STUCK if inside and stuck else 0.0)
        s[_at(DONE, i)] = pressed if fits and done != LEFT else LEFT
        before = _read(s, CHANGED, i)
        summed = add(before, change) if hit else change
        _write(s, CHANGED, i, summed if inside else before)
        _write(s, TOUCHED, i, _read(s, TOUCHED, i) if hit else x2)
        _write(s, PLACE, i, place if inside else _read(s, BETWEEN, i))
        _write(s, VELOCITY, i, w2 if inside else w)


@inlined
def _rows(s, row, count):
    """Three rows of a chunk, the components of a vector."""
    k = row * CHUNK
    return (s[k:k + count], s[k + CHUNK:k + CHUNK + count],
            s[k + 2 * CHUNK:k + 2 * CHUNK + count])


@kernel
def _leave_if_near(grid, present, margins, table, poses, start, end, c, s, count, clear, cells,
                   chosen):
    """
    Leave those particles to `resolve` that may touch a collider other than plane c.

    Tested are their candidates, with a margin for how far the contact stage may move them; with
    meshes the ways there.
    """
    if table.shape[0] > 1:
        for i in range(count):
            clear[i] = 1.0
        x, y, z = _rows(s, PLACE, count)
        x1, y1, z1 = _rows(s, BETWEEN, count)
        near, marks = s[NEAR * CHUNK:NEAR * CHUNK + count], clear[:count]
        clear_of_others(grid, present, table, poses, end, c, near, 1, margins, x1, y1, z1,
                        marks, cells, chosen)
        clear_of_mesh_boxes(present, table, poses, start, end, near, x, y, z, x1, y1, z1, marks,
                            cells)
        for i in range(count):
            s[_at(DONE, i)] = s[_at(DONE, i)] if clear[i] >= 0.0 else LEFT


@inlined
def _log(log, accounts, block, first, c, poses, end, s, touching, count):
    """Log the contacts of a chunk, if anybody wants them."""
    if log.shape[1] > 0:
        row, n = accounts[block, N_LOGGED], (poses[end, c, 2], poses[end, c, 5], poses[end, c, 8])
        for i in range(count):
            k = np.uint64(row + i)
            hit, stuck = s[_at(SPEED, i)] < 0.0, s[_at(DONE, i)] >= STUCK
            log[block, k, 0], log[block, k, 1] = first + touching[int(s[_at(WHICH, i)])], c
            log[block, k, 2] = COLLISION if hit else STICK if stuck else SLIDE
            for d in range(3):
                log[block, k, POINT + d] = s[_at(TOUCHED + d, i)]
                log[block, k, NORMAL + d] = n[d]
                log[block, k, CHANGE + d] = s[_at(CHANGED + d, i)]
        accounts[block, N_LOGGED] = row + count


@inlined
def _copy_rows(s, rows, i, k):
    """Copy the first rows of particle i of a chunk to place k."""
    for row in range(rows):
        s[_at(row, k)] = s[_at(row, i)]


@inlined
def _padded(s, count):
    """Repeat the last particle of a chunk until vectors are full; the count then."""
    full = (count + LANES - 1) // LANES * LANES
    for i in range(count, full):
        _copy_rows(s, TOUCHED, count - 1, i)
    return full


@kernel
def _keep(s, rows, count, unanswered, left):
    """
    Close the gaps of those of a chunk that are left, in its first rows.

    Returns
    -------
    kept, left : int
        How many of the chunk are kept, and how many are left in all.

    """
    kept = 0
    for i in range(count):
        if s[_at(DONE, i)] == LEFT:
            unanswered[left] = int(s[_at(WHICH, i)])
            left += 1
        else:
            if kept < i:
                _copy_rows(s, rows, i, kept)
            kept += 1
    return kept, left


@inlined
def _answer_chunk(rare, grid, rules, margins, here, table, poses, motion, c, s, count, clear,
                  cells, chosen):
    """
    Answer the particles of a chunk, in loops without branches.

    rare: 1, or None where there is neither wet friction nor quadratic drag; motion: None for a
    plane that stands still. What is known not to be there makes these loops up to a third faster.
    """
    step, start, end, full = here.step, here.start, here.end, _padded(s, count)
    if _find_hits(poses, motion, step, start, end, c, s, full) > 0:
        _collide(rare, rules, table, poses, motion, step, start, end, c, s, full)
        _leave_if_near(grid, rules.present, margins, table, poses, start, end, c, s, count, clear,
                       cells, chosen)
    _press(rare, rules, table, poses, motion, step, start, end, c, s, full)


@kernel
def _settle_chunk(grid, rules, margins, here, table, poses, motion, first, c, log, accounts, x, y,
                  z, vx, vy, vz, s, count, clear, cells, chosen, touching, unanswered, left):
    """Answer a chunk and write what is settled; how many particles are left, with the others."""
    if count == 0:
        return left
    for i in range(count):
        s[_at(DONE, i)] = 0.0
    _leave_if_near(grid, rules.present, margins, table, poses, here.start, here.end, c, s, count,
                   clear, cells, chosen)
    count, left = _keep(s, TOUCHED, count, unanswered, left)
    if count == 0:
        return left
    if table[c, WET] != 0.0 or rules.flight.quadratic[0] > 0.0:
        _answer_chunk(1, grid, rules, margins, here, table, poses, motion, c, s, count, clear,
                      cells, chosen)
    elif _is_still(motion, here.step, c):
        _answer_chunk(None, grid, rules, margins, here, table, poses, None, c, s, count, clear,
                      cells, chosen)
    else:
        _answer_chunk(None, grid, rules, margins, here, table, poses, motion, c, s, count, clear,
                      cells, chosen)
    count, left = _keep(s, ROWS, count, unanswered, left)
    hits, contacts = 0, 0
    for i in range(count):
        j = np.uint64(touching[int(s[_at(WHICH, i)])])
        x[j], y[j], z[j] = _read(s, PLACE, i)
        vx[j], vy[j], vz[j] = _read(s, VELOCITY, i)
        hits += s[_at(SPEED, i)] < 0.0
        contacts += s[_at(DONE, i)] >= PRESSED
    accounts[here.block, N_COLLISION] += hits
    accounts[here.block, N_CONTACT] += contacts
    _log(log, accounts, here.block, first, c, poses, here.end, s, touching, count)
    return left


@inlined
def answer_planes(world, margins, here, radius, first, x, y, z, vx, vy, vz, s, clear, cells,
                  chosen, touching, held, unanswered, count):
    """
    Answer the particles of a block that touch one plane and nothing else, in place.

    Parameters
    ----------
    world : world.World
        Its parts are handed on as values: reached through it, the loops below take 9 % longer.
    margins : (C,) float64
        Zeros: nobody sweeps.
    here : rules.Here
        Step, rows of poses and block; no particle.
    radius : (B,) or (1,) float64 [m]
        Of the particles of the block, or of all.
    first : int
        Index of the first particle of the block.
    x, y, z, vx, vy, vz : (B,) float64 [m], [m/s]
        Candidates; overwritten where one is answered.
    s : (ROWS * CHUNK,) float64
        Scratch.
    clear, cells, chosen : (TILE,) float64, twice, and (C,) int64
        Scratch.
    touching : (BLOCK,) int64
        Particles that may touch something.
    held : (6, BLOCK) float64 [m], [m/s]
        Their state at the start of the step.
    unanswered : (BLOCK,) int64
        Which of them are still to be answered; overwritten with those that are left.
    count : int
        How many.

    Returns
    -------
    left : int
        How many are left for response.resolve.

    """
    grid, rules, table, poses = world.grid, world.rules, world.table, world.poses
    motion, log, accounts = world.motion, world.log, world.accounts
    for m in range(grid.others.shape[0]):
        c = grid.others[m]
        if table[c, KIND] != PLANE:
            continue
        left, taken = 0, 0
        for n in range(count):
            k = np.uint64(unanswered[n])
            j = np.uint64(touching[k])
            r, x1 = radius_at(radius, j), (x[j], y[j], z[j])
            if not _height(poses, here.end, c, x1) - r < 0.0:
                unanswered[left] = k
                left += 1
                continue
            x0 = (held[0, k], held[1, k], held[2, k])
            _write(s, PLACE, taken, x0)
            _write(s, VELOCITY, taken, (held[3, k], held[4, k], held[5, k]))
            s[_at(WHICH, taken)], s[_at(RADIUS, taken)] = k, r
            s[_at(NEAR, taken)] = r + REACH * _span(subtract(x1, x0))
            _write(s, BETWEEN, taken, x1)
            taken += 1
            if taken == CHUNK:
                left = _settle_chunk(grid, rules, margins, here, table, poses, motion, first, c,
                                     log, accounts, x, y, z, vx, vy, vz, s, taken, clear, cells,
                                     chosen, touching, unanswered, left)
                taken = 0
        count = _settle_chunk(grid, rules, margins, here, table, poses, motion, first, c, log,
                              accounts, x, y, z, vx, vy, vz, s, taken, clear, cells, chosen,
                              touching, unanswered, left)
    return count
