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
Signed distances to the shapes of a scene, written down once more, without the core.

What checks the core must not share its mistakes. Points come (N, 3), colliders as in a scene.
"""

import numpy as np


def rotation(quaternion):
    """Give the matrix of a quaternion x, y, z, w."""
    x, y, z, w = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def distance(collider, pose, points):
    """
    Signed distance of points to a collider, negative where particles must not be.

    Parameters
    ----------
    collider : collision_sim.colliders.Collider
        Of any shape.
    pose : ((3,), (4,)) [m], [-]
        Where it is.
    points : (N, 3) float64 [m]
        Anywhere.

    Returns
    -------
    (N,) float64 [m]
        Of an open mesh never negative.

    """
    local = (points - pose[0]) @ rotation(pose[1])
    return SHAPES[collider.shape](collider, local) * (-1.0 if collider.inside else 1.0)


def _plane(collider, p):
    return p @ np.asarray(collider.normal)


def _sphere(collider, p):
    return np.linalg.norm(p, axis=1) - collider.size[0]


def _beyond(excess):
    """Distance to a product of intervals, by how far each coordinate is beyond its own."""
    return (np.linalg.norm(np.maximum(excess, 0.0), axis=1)
            + np.minimum(excess.max(axis=1), 0.0))


def _box(collider, p):
    return _beyond(np.abs(p) - collider.size)


def _capsule(collider, p):
    p = p.copy()
    p[:, 2] -= np.clip(p[:, 2], -collider.size[1], collider.size[1])
    return np.linalg.norm(p, axis=1) - collider.size[0]


def _cylinder(collider, p):
    return _beyond(np.stack([np.linalg.norm(p[:, :2], axis=1) - collider.size[0],
                             np.abs(p[:, 2]) - collider.size[1]], axis=1))


def _mesh(collider, p):
    corners = collider.mesh.vertices[collider.mesh.faces]
    near = _to_triangles(corners, p[:, None])
    return np.where(_winding(corners, p) > 0.5, -near, near) if collider.mesh.closed else near


def _to_triangles(corners, p):
    """Least distance of points (N, 1, 3) to triangles (T, 3, 3): to a plane, else to an edge."""
    edges = np.roll(corners, -1, axis=1) - corners
    n = np.cross(edges[:, 0], edges[:, 1])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    best, inside = np.full((len(p), len(corners)), np.inf), True
    for k in range(3):
        start, edge = corners[:, k], edges[:, k]
        inside = inside & (((p - start) * np.cross(n, edge)).sum(axis=2) >= 0.0)
        along = ((p - start) * edge).sum(axis=2) / np.square(edge).sum(axis=1)
        foot = start + np.clip(along, 0.0, 1.0)[..., None] * edge
        best = np.minimum(best, np.linalg.norm(p - foot, axis=2))
    height = np.abs(((p - corners[:, 0]) * n).sum(axis=2))
    return np.where(inside, height, best).min(axis=1)


def _winding(corners, points):
    """Winding numbers of closed triangles about points, by their solid angles."""
    a, b, c = np.moveaxis(corners[None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(side, axis=2) for side in (a, b, c))
    det = (a * np.cross(b, c)).sum(axis=2)
    rest = (la * lb * lc + (a * b).sum(axis=2) * lc + (b * c).sum(axis=2) * la
            + (c * a).sum(axis=2) * lb)
    return np.arctan2(det, rest).sum(axis=1) / (2.0 * np.pi)


def crossings(collider, pose0, pose1, x0, x1):
    """
    Count how often the chord of a point goes through the triangles of a mesh.

    The chord is taken in the frame of the collider; whatever is within rounding of an edge or of
    an end of the chord is left out.
    """
    p0 = (x0 - pose0[0]) @ rotation(pose0[1])
    p1 = (x1 - pose1[0]) @ rotation(pose1[1])
    a, b, c = (collider.mesh.vertices[collider.mesh.faces][:, k] for k in range(3))
    d, e1, e2 = p1 - p0, b - a, c - a
    h = np.cross(d, e2)
    det = (e1 * h).sum(axis=1)
    with np.errstate(divide='ignore', invalid='ignore'):
        u = ((p0 - a) * h).sum(axis=1) / det
        q = np.cross(p0 - a, e1)
        v, t = (q * d).sum(axis=1) / det, (q * e2).sum(axis=1) / det
    slack = 1e-9
    return int(np.sum((u > slack) & (v > slack) & (u + v < 1.0 - slack) & (t > slack)
                      & (t < 1.0 - slack) & (np.abs(t * np.linalg.norm(d)) > 1e-12)))


SHAPES = {'plane': _plane, 'sphere': _sphere, 'box': _box, 'capsule': _capsule,
          'cylinder': _cylinder, 'mesh': _mesh}
