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
Signed distance and normal of the shapes, each in its own frame.

The distance is exact everywhere, negative inside the solid; the normal is the unit gradient of the
distance, out of the solid. Where that is not unique the choice is stated at the function. Capsules
and cylinders lie along z; the solid of a plane is z < 0.
"""

from math import inf
from typing import NamedTuple

from collision_sim.core.jit import by_address, formula, inlined, kernel
from collision_sim.core.mesh import mesh_distance, Meshes, NO_MESHES
from collision_sim.core.modules import MESH_DISTANCE, no_modules
from collision_sim.core.vectors import (EPSILON, largest, length, origin, rotate, rotate_back,
                                        subtract)
import numpy as np

PLANE, SPHERE, BOX, CAPSULE, CYLINDER, MESH = range(6)
# Columns of the table of colliders: one of the above; +1, or -1 for `inside`; sizes as in scene.py
# [m]; restitution; static, kinetic friction; wet friction [s/m]; one of laws.WET_FORMS.
KIND, SIDE, SIZE, RESTITUTION, STATIC, KINETIC, WET, WET_FORM, COLUMNS = 0, 1, 2, 5, 6, 7, 8, 9, 10
SHAPES = {'plane': PLANE, 'sphere': SPHERE, 'box': BOX, 'capsule': CAPSULE, 'cylinder': CYLINDER,
          'mesh': MESH}
DISTANCE = inf, (0.0, 0.0, 1.0)     # of the kind that a distance, or a time, and a normal are


@formula
def plane(point):
    """
    Signed distance to the half space z < 0.

    Parameters
    ----------
    point : (3,) tuple of float [m]
        In the frame of the plane.

    Returns
    -------
    distance : float [m]
    normal : (3,) tuple of float [-]

    """
    return point[2], (0.0, 0.0, 1.0)


@formula
def sphere(point, radius):
    """
    Signed distance to a ball; the normal at its centre is +z.

    Parameters
    ----------
    point : (3,) tuple of float [m]
        In the frame of the sphere.
    radius : float [m]
        Positive.

    Returns
    -------
    distance : float [m]
    normal : (3,) tuple of float [-]

    """
    rho = length(point)
    if rho == 0.0:
        return -radius, (0.0, 0.0, 1.0)
    return rho - radius, (point[0] / rho, point[1] / rho, point[2] / rho)


@formula
def box(point, half):
    """
    Signed distance to a box; of equally near faces the first of x, y, z, and its + side.

    Parameters
    ----------
    point : (3,) tuple of float [m]
        In the frame of the box.
    half : (3,) tuple of float [m]
        Half the edge lengths.

    Returns
    -------
    distance : float [m]
    normal : (3,) tuple of float [-]
        Outside an edge or a corner it points from there.

    """
    sx = 1.0 if point[0] >= 0.0 else -1.0
    sy = 1.0 if point[1] >= 0.0 else -1.0
    sz = 1.0 if point[2] >= 0.0 else -1.0
    dx, dy, dz = sx * point[0] - half[0], sy * point[1] - half[1], sz * point[2] - half[2]
    if dx <= 0.0 and dy <= 0.0 and dz <= 0.0:
        if dx >= dy and dx >= dz:
            return dx, (sx, 0.0, 0.0)
        if dy >= dz:
            return dy, (0.0, sy, 0.0)
        return dz, (0.0, 0.0, sz)
    gap = (max(dx, 0.0), max(dy, 0.0), max(dz, 0.0))
    distance = length(gap)
    return distance, (sx * (gap[0] / distance), sy * (gap[1] / distance), sz * (gap[2] / distance))


@formula
def capsule(point, radius, half):
    """
    Signed distance to a capsule; the normal on its axis is +x.

    Parameters
    ----------
    point : (3,) tuple of float [m]
        In the frame of the capsule.
    radius, half : float [m]
        Radius, and half the distance between the centres of its caps.

    Returns
    -------
    distance : float [m]
    normal : (3,) tuple of float [-]

    """
    arm = (point[0], point[1], point[2] - min(max(point[2], -half), half))
    rho = length(arm)
    if rho == 0.0:
        return -radius, (1.0, 0.0, 0.0)
    return rho - radius, (arm[0] / rho, arm[1] / rho, arm[2] / rho)


@formula
def cylinder(point, radius, half):
    """
    Signed distance to a cylinder; equally near faces: the side; on the axis: +x; at z = 0: +z.

    Parameters
    ----------
    point : (3,) tuple of float [m]
        In the frame of the cylinder.
    radius, half : float [m]
        Radius, and half the height.

    Returns
    -------
    distance : float [m]
    normal : (3,) tuple of float [-]
        Outside a rim it points from the rim.

    """
    rho = length((point[0], point[1], 0.0))
    sz = 1.0 if point[2] >= 0.0 else -1.0
    ex, ey = (1.0, 0.0) if rho == 0.0 else (point[0] / rho, point[1] / rho)
    side, cap = rho - radius, sz * point[2] - half
    if side <= 0.0 and cap <= 0.0:
        if side >= cap:
            return side, (ex, ey, 0.0)
        return cap, (0.0, 0.0, sz)
    gap = (max(side, 0.0), max(cap, 0.0), 0.0)
    distance = length(gap)
    return distance, (ex * (gap[0] / distance), ey * (gap[0] / distance), sz * (gap[1] / distance))


@inlined
def has_faces(table, c):
    """Whether a collider is a box or a cylinder that particles are outside of."""
    kind = table[c, KIND]
    return table[c, SIDE] > 0.0 and (kind == BOX or kind == CYLINDER)


@inlined
def seam_width(table, c, place):
    """
    How far apart [m] two boxes or cylinders may be by rounding only, where they are flush.

    Nearer than this a particle is looked at, since it may be on the seam; 0 for other shapes.
    """
    if has_faces(table, c):
        extent = table[c, SIZE] + table[c, SIZE + 1] + table[c, SIZE + 2]
        return 64.0 * EPSILON * (largest(place) + extent)
    return 0.0


class Present(NamedTuple):
    """The meshes of a scene, in simulations by reference; addresses of modules (modules.py)."""

    meshes: Meshes = NO_MESHES
    modules: np.ndarray = no_modules()


@inlined
def local_distance(kind, point, size):
    """Signed distance and normal of a shape in its own frame; a mesh is infinitely far."""
    if kind == PLANE:
        return plane(point)
    if kind == SPHERE:
        return sphere(point, size[0])
    if kind == BOX:
        return box(point, size)
    if kind == CAPSULE:
        return capsule(point, size[0], size[1])
    if kind == CYLINDER:
        return cylinder(point, size[0], size[1])
    return inf, (0.0, 0.0, 1.0)


@kernel
def _distance_to_mesh(present, m, point):
    return by_address(present.modules, MESH_DISTANCE, mesh_distance, DISTANCE,
                      (present.meshes, m, point))


@inlined
def _distance_in_frame(present, table, c, point):
    """Distance and normal in the frame of collider c, before its side is looked at."""
    if table[c, KIND] == MESH:
        return _distance_to_mesh(present, int(table[c, SIZE + 1]), point)
    size = (table[c, SIZE], table[c, SIZE + 1], table[c, SIZE + 2])
    return local_distance(table[c, KIND], point, size)


@inlined
def arm_distance(present, table, poses, s, c, arm):
    """Signed distance and normal of `signed_distance`, of a point less the collider's position."""
    distance, normal = _distance_in_frame(present, table, c,
                                          rotate_back(poses, s, c, arm))
    side = table[c, SIDE]
    world = rotate(poses, s, c, normal)
    return side * distance, (side * world[0], side * world[1], side * world[2])


@inlined
def signed_distance(present, table, poses, s, c, point):
    """
    Signed distance and normal of a collider in the world frame.

    Parameters
    ----------
    present : Present
        The meshes.
    table : (C, COLUMNS) float64
        The colliders, columns as named below.
    poses : (S, C, 12) float64
        Rotations in row order, then positions [m].
    s, c : int
        Row of poses, and which collider.
    point : (3,) tuple of float [m]
        World frame.

    Returns
    -------
    distance : float [m]
        Negative inside the solid; for `inside` colliders that is everything outside the shape. Of
        an open mesh, which has no inside, the distance.
    normal : (3,) tuple of float [-]
        Unit, out of the solid.

    """
    return arm_distance(present, table, poses, s, c, subtract(point, origin(poses, s, c)))


@formula
def distances(present, table, poses, x, clear):
    """
    Lower `clear` (N,) to the signed distance [m] of the nearest collider, in place.

    Parameters
    ----------
    present, table
        As in `signed_distance`.
    poses : (1, C, 12) float64
        Where the colliders are.
    x : (3, N) float64 [m]
        Positions.
    clear : (N,) float64 [m]
        Overwritten.

    """
    for i in range(x.shape[1]):
        for c in range(table.shape[0]):
            point = (x[0, i], x[1, i], x[2, i])
            clear[i] = min(clear[i], signed_distance(present, table, poses, 0, c, point)[0])
