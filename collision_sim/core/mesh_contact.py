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
A particle and a mesh over one step, in the world frame.

The end of a step says nothing about a mesh by itself: a particle may have passed through it. So
"where it ends" is judged by the way there, as the mesh sees it: from where the particle is in the
frame of the mesh at the start of the step to where it is at the end.
"""

from math import ceil, inf

from collision_sim.core.jit import inlined, kernel
from collision_sim.core.mesh import mesh_distance, nearest
from collision_sim.core.mesh_cells import cell_at, CLOSED, EXTENT, INSIDE, OUTSIDE
from collision_sim.core.mesh_path import meet, SKIN, UNMET
from collision_sim.core.mesh_way import follow, is_within
from collision_sim.core.shapes import SIDE, SIZE
from collision_sim.core.vectors import (add_scaled, largest, origin, rotate, rotate_back, scaled,
                                        subtract, turned)

ARC = 1.0 / 64.0            # rad that a mesh turns by in one piece of a way
PIECES = 64                 # into which the piece with the hit is divided again


@inlined
def mesh_of(table, c):
    """Give the row of the mesh of collider c in mesh.Meshes.heads."""
    return int(table[c, SIZE + 1])


@inlined
def side_of(meshes, table, c):
    """Give the side that particles come from: 1 or -1 with a closed mesh, 0 with an open one."""
    return table[c, SIDE] * meshes.heads[mesh_of(table, c), CLOSED]


@inlined
def skin_of(meshes, table, poses, start, end, c):
    """Distance [m] that particles keep from a mesh, of the order of rounding."""
    reach = max(largest(origin(poses, start, c)), largest(origin(poses, end, c)))
    return SKIN * (reach + meshes.heads[mesh_of(table, c), EXTENT])


@inlined
def to_frame(poses, row, c, x):
    """Give a point in the frame of collider c."""
    return rotate_back(poses, row, c, subtract(x, origin(poses, row, c)))


@kernel
def signed_mesh_distance(meshes, table, c, p):
    """Distance and normal of shapes.signed_distance, in the frame of the mesh."""
    distance, n = mesh_distance(meshes, mesh_of(table, c), p)
    if side_of(meshes, table, c) < 0.0:
        return -distance, scaled(-1.0, n)
    return distance, n


@kernel
def depth_at(meshes, answers, table, poses, row, c, radius, x):
    """
    Depth [m] of a particle inside a mesh: of an open mesh, how far its surface reaches through.

    Negative where it is outside; how far is not looked for.
    """
    m, p, side = mesh_of(table, c), to_frame(poses, row, c, x), side_of(meshes, table, c)
    if side != 0.0:
        label = cell_at(meshes.heads, meshes.cells, m, p)
        known = label == (OUTSIDE if side > 0.0 else INSIDE)
        if not known and is_within(answers, meshes, c, m, p) == (side > 0.0):
            return radius - signed_mesh_distance(meshes, table, c, p)[0]
        if known and radius == 0.0:
            return -inf
    return radius - nearest(meshes, m, p, radius)[0] if radius > 0.0 else -inf


@kernel
def mesh_end(meshes, answers, table, poses, start, end, c, radius, x0, x1):
    """
    Signed distance less radius of a particle at the end of a step, and normal, for a mesh.

    Parameters
    ----------
    meshes, answers, table, poses
        Meshes and their last answers (mesh_way.py), colliders and poses.
    start, end, c : int
        Rows of poses at the start and the end of the step, and which collider.
    radius : float [m]
        Of the particle.
    x0, x1 : (3,) tuple of float [m]
        World frame, at the start and at the end.

    Returns
    -------
    phi : float [m]
        Infinity where the particle stays clear of the mesh.
    n : (3,) tuple of float [-]
        World frame.

    """
    m, side = mesh_of(table, c), side_of(meshes, table, c)
    skin = skin_of(meshes, table, poses, start, end, c)
    a, b = to_frame(poses, start, c, x0), to_frame(poses, end, c, x1)
    phi, n = inf, (0.0, 0.0, 1.0)
    starts_in = side != 0.0 and is_within(answers, meshes, c, m, a) == (side > 0.0)
    if not starts_in or depth_at(meshes, answers, table, poses, start, c, 0.0, x0) <= skin:
        _, _, phi, n = follow(answers, meshes, c, m, side, a, b, radius, skin)
    if starts_in and phi == inf:
        phi, n = signed_mesh_distance(meshes, table, c, b)
        phi -= radius + skin
    return (phi if phi < 0.0 else inf), rotate(poses, end, c, n)


@kernel
def mesh_gap(meshes, table, poses, start, end, c, radius, reach, x1):
    """
    Gap [m] between a mesh and a particle that ends clear of it, and the normal.

    Parameters
    ----------
    meshes, table, poses, start, end, c, radius, x1
        As in `mesh_end`, which says that the particle stays clear.
    reach : float [m]
        A larger gap is not looked for, and infinite.

    Returns
    -------
    phi : float [m]
    n : (3,) tuple of float [-]
        World frame.

    """
    p = to_frame(poses, end, c, x1)
    if not nearest(meshes, mesh_of(table, c), p, radius + reach)[0] < radius + reach:
        return inf, (0.0, 0.0, 1.0)
    distance, n = signed_mesh_distance(meshes, table, c, p)
    return distance - radius - skin_of(meshes, table, poses, start, end, c), rotate(poses, end, c,
                                                                                    n)


@kernel
def hit_on_way(meshes, answers, table, poses, start, end, c, radius, x0, x1):
    """First hit of a mesh that does not turn as `mesh_hit`, on the way that `mesh_end` follows."""
    skin = skin_of(meshes, table, poses, start, end, c)
    way = follow(answers, meshes, c, mesh_of(table, c), side_of(meshes, table, c),
                 to_frame(poses, start, c, x0), to_frame(poses, end, c, x1), radius, skin)
    return way.tau, rotate(poses, start, c, way.n)


@inlined
def _place_at(poses, row, c, arm, move, axis, angle, tau):
    """Where a particle is on its path, in the frame of a collider that moves by a twist."""
    now = add_scaled(arm, tau, move)
    return rotate_back(poses, row, c, turned(axis, -angle * tau, now) if angle > 0.0 else now)


@kernel
def _meet_on_arc(meshes, m, side, poses, row, c, radius, skin, arm, move, axis, angle, start, end,
                 pieces):
    """First hit on the path from time start to end, as that many straight ways; UNMET if none."""
    a = _place_at(poses, row, c, arm, move, axis, angle, start)
    for k in range(pieces):
        later = start + (end - start) * (k + 1) / pieces
        b = _place_at(poses, row, c, arm, move, axis, angle, later)
        tau, _, n, _, _ = meet(meshes, m, side, a, b, radius, skin)
        if tau <= 1.0:
            before = start + (end - start) * k / pieces
            return before + tau * (later - before), before, later, n
        a = b
    return UNMET, start, end, (0.0, 0.0, 1.0)


@kernel
def mesh_hit(meshes, table, poses, row, c, radius, arm, move, axis, angle):
    """
    First time at which a particle on its path meets a mesh.

    Exact where the mesh does not turn. Where it does, the path is taken in pieces of ARC, and the
    one with the hit in smaller ones: what is off is the sagitta of those arcs.

    Parameters
    ----------
    meshes, table, poses, row, c, radius
        As in `mesh_end`; row: of the poses at the start.
    arm, move, axis, angle
        As in trajectory.path_distance.

    Returns
    -------
    tau : float [-]
        From 0 to 1, or UNMET.
    n : (3,) tuple of float [-]
        Normal at the hit, world frame.

    """
    m, side = mesh_of(table, c), side_of(meshes, table, c)
    skin = skin_of(meshes, table, poses, row, row, c)
    pieces = int(ceil(angle / ARC)) if angle > 0.0 else 1
    tau, start, end, n = _meet_on_arc(meshes, m, side, poses, row, c, radius, skin, arm, move,
                                      axis, angle, 0.0, 1.0, pieces)
    if tau <= 1.0 and angle > 0.0:
        finer, _, _, n_finer = _meet_on_arc(meshes, m, side, poses, row, c, radius, skin, arm,
                                            move, axis, angle, start, end, PIECES)
        if finer <= 1.0:
            tau, n = finer, n_finer
    n = rotate(poses, row, c, n)
    return tau, turned(axis, angle * tau, n) if angle > 0.0 else n
