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
Contacts and colliders as markers; needs no ROS.

Every marker has a stable namespace and number, so that a new message replaces the one before.
Nothing that is not finite goes into a marker, because RViz drops the whole of it for that.
"""

from functools import lru_cache

from collision_sim.core.rules import COLLISION, REPULSION, SLIDE, STICK
from collision_sim.ros.messages import (ADD, CUBE, CYLINDER, DELETE, DELETEALL, LINE_LIST,
                                        Marker, SPHERE, SPHERE_LIST, TRIANGLE_LIST, UPRIGHT)
import numpy as np

LENGTH = 0.1            # m for an impulse of 1 N s
LONGEST = 0.5           # m
POINT_SIZE, LINE_WIDTH = 0.02, 0.006    # m
LIFETIME = 3            # of contacts, in periods of the messages
MOST_TRIANGLES = 20_000     # of a mesh; of more, every second, third, ... one is shown
MOST_CONTACTS = 10_000      # shown in one message; of more, every second, third, ... one
PLANE_SIZE, PLANE_THICKNESS = 20.0, 0.002   # m

# Colours: red, green, blue, alpha.
STATE_COLORS = np.zeros((5, 4), '<f4')      # a row a state
STATE_COLORS[COLLISION] = 1.0, 0.2, 0.1, 1.0
STATE_COLORS[SLIDE] = 1.0, 0.8, 0.0, 1.0
STATE_COLORS[STICK] = 0.1, 0.8, 0.2, 1.0
STATE_COLORS[REPULSION] = 0.7, 0.2, 1.0, 1.0
FIXED, MOVING = (0.55, 0.58, 0.62, 0.8), (0.2, 0.5, 0.9, 0.9)
FIXED_INSIDE, MOVING_INSIDE = (0.55, 0.58, 0.62, 0.15), (0.2, 0.5, 0.9, 0.15)


def contact_markers(contacts, lifetime):
    """
    Points of contact, and lines along the normals as long as the impulses, coloured by state.

    Parameters
    ----------
    contacts : list of Contacts
        Of the steps since the message before.
    lifetime : float [s]
        Of the markers.

    Returns
    -------
    markers : list of Marker

    """
    start, end, state = _shown(contacts)
    colors = STATE_COLORS[state]
    lines = np.stack([start, end], axis=1).reshape(-1, 3)
    action = ADD if len(state) else DELETE
    return [
        Marker('points', 0, action, SPHERE_LIST, 3 * (POINT_SIZE,), lifetime=lifetime,
               points=start, colors=colors),
        Marker('normals', 0, action, LINE_LIST, (LINE_WIDTH, 0.0, 0.0), lifetime=lifetime,
               points=lines, colors=np.repeat(colors, 2, axis=0)),
    ]


def _shown(contacts):
    """Give starts and ends (n, 3) [m] and states (n,) of the lines to be shown."""
    if not contacts:
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0, dtype=np.int64)
    point, normal, impulse, state = (
        np.concatenate([getattr(one, name) for one in contacts])
        for name in ('point', 'normal', 'impulse', 'state'))
    size = np.minimum(LENGTH * np.sqrt(np.square(impulse).sum(axis=1)), LONGEST)
    end = point + size[:, None] * normal
    finite = np.isfinite(point).all(axis=1) & np.isfinite(end).all(axis=1)
    chosen = np.flatnonzero(finite)
    chosen = chosen[::1 + len(chosen) // MOST_CONTACTS]
    return point[chosen], end[chosen], state[chosen]


def clear_markers():
    """Give the markers of a message that takes all of its topic away."""
    return [Marker(action=DELETEALL)]


def collider_markers(scene, poses):
    """
    Colliders as solids, those with particles inside nearly transparent.

    Parameters
    ----------
    scene : Scene
        Shapes and sizes.
    poses : list of ((3,) float64 [m], (4,) float64 [-])
        Position and orientation of each collider.

    Returns
    -------
    markers : list of Marker

    """
    return [_solid_marker(collider, number, solid, position, orientation)
            for collider, (position, orientation) in zip(scene.colliders, poses)
            for number, solid in enumerate(_solids(collider))]


def _solids(collider):
    """Marker type, scale [m], centre [m] and local orientation of the solids of a collider."""
    a, b, c = collider.size
    if collider.shape == 'plane':
        scale = (PLANE_SIZE, PLANE_SIZE, PLANE_THICKNESS)
        turn = _turn_to(collider.normal)
        shift = [-0.5 * PLANE_THICKNESS * x for x in collider.normal]
        return [(CUBE, scale, shift, turn)]
    if collider.shape == 'sphere':
        return [(SPHERE, 3 * [2 * a], (0, 0, 0), UPRIGHT)]
    if collider.shape == 'mesh':
        return [(TRIANGLE_LIST, (1.0, 1.0, 1.0), (0, 0, 0), UPRIGHT)]
    if collider.shape == 'box':
        return [(CUBE, (2 * a, 2 * b, 2 * c), (0, 0, 0), UPRIGHT)]
    solids = [(CYLINDER, (2 * a, 2 * a, 2 * b), (0, 0, 0), UPRIGHT)]
    if collider.shape == 'capsule':
        solids += [(SPHERE, 3 * [2 * a], (0, 0, side * b), UPRIGHT) for side in (-1, 1)]
    return solids


@lru_cache(maxsize=100)
def _triangle_points(mesh):
    """Corners of the triangles of a mesh, at most MOST_TRIANGLES, evenly left out."""
    faces = mesh.faces[::1 + len(mesh.faces) // MOST_TRIANGLES]
    return mesh.vertices[faces.ravel()]


def _turn_to(normal):
    """Quaternion that turns z to a unit normal."""
    x, y, z = normal
    if z < -1.0 + 1e-12:
        return (1.0, 0.0, 0.0, 0.0)
    w = ((1.0 + z) / 2.0) ** 0.5
    return (-y / (2.0 * w), x / (2.0 * w), 0.0, w)


def _product(p, q):
    """Quaternion product p q."""
    (px, py, pz, pw), (qx, qy, qz, qw) = p, q
    return (pw * qx + px * qw + py * qz - pz * qy, pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw, pw * qw - px * qx - py * qy - pz * qz)


def _solid_marker(collider, number, solid, position, orientation):
    kind, scale, centre, turn = solid
    inverse = [-orientation[0], -orientation[1], -orientation[2], orientation[3]]
    shift = _product(_product(orientation, (*centre, 0.0)), inverse)
    if collider.inside:
        color = MOVING_INSIDE if collider.moving else FIXED_INSIDE
    else:
        color = MOVING if collider.moving else FIXED
    marker = Marker('colliders/' + collider.name, number, ADD, kind, scale, color,
                    [position[i] + shift[i] for i in range(3)], _product(orientation, turn))
    return marker._replace(points=_triangle_points(collider.mesh)) if collider.mesh else marker
