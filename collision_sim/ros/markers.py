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

from collision_sim.appearance import collider_color, contact_lines, STATE_COLORS, turn_to
from collision_sim.core.rotation import product, rotation_matrix
from collision_sim.ros.messages import (ADD, CUBE, CYLINDER, DELETE, DELETEALL, LINE_LIST,
                                        Marker, SPHERE, SPHERE_LIST, TRIANGLE_LIST, UPRIGHT)
import numpy as np

POINT_SIZE, LINE_WIDTH = 0.02, 0.006    # m
LIFETIME = 3            # of contacts, in periods of the messages
MOST_TRIANGLES = 20_000     # of a mesh; of more, every second, third, ... one is shown
MOST_CONTACTS = 10_000      # shown in one message; of more, every second, third, ... one
PLANE_SIZE, PLANE_THICKNESS = 20.0, 0.002   # m


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
    start, end, state = contact_lines(contacts, MOST_CONTACTS)
    colors = STATE_COLORS[state]
    lines = np.stack([start, end], axis=1).reshape(-1, 3)
    action = ADD if len(state) else DELETE
    return [
        Marker('points', 0, action, SPHERE_LIST, 3 * (POINT_SIZE,), lifetime=lifetime,
               points=start, colors=colors),
        Marker('normals', 0, action, LINE_LIST, (LINE_WIDTH, 0.0, 0.0), lifetime=lifetime,
               points=lines, colors=np.repeat(colors, 2, axis=0)),
    ]


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
        turn = turn_to(collider.normal)
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


def _solid_marker(collider, number, solid, position, orientation):
    kind, scale, centre, turn = solid
    shift = rotation_matrix(orientation) @ np.array(centre, dtype=float)
    marker = Marker('colliders/' + collider.name, number, ADD, kind, scale,
                    collider_color(collider),
                    [position[i] + shift[i] for i in range(3)],
                    product(np.array(orientation, dtype=float), np.array(turn, dtype=float)))
    return marker._replace(points=_triangle_points(collider.mesh)) if collider.mesh else marker
