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
Contacts and colliders as markers.

Every marker has a stable namespace and id, so that a new message replaces the one before. Nothing
that is not finite goes into a marker, because RViz drops the whole of it for that.
"""

from functools import lru_cache

from collision_sim.core.rules import COLLISION, REPULSION, SLIDE, STICK
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
import numpy as np
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

LENGTH = 0.1            # m for an impulse of 1 N s
LONGEST = 0.5           # m
POINT_SIZE, LINE_WIDTH = 0.02, 0.006    # m
MOST_TRIANGLES = 20_000     # of a mesh; of more, every second, third, ... one is shown
MOST_CONTACTS = 2000    # shown in one message; of more, every second, third, ... one
PLANE_SIZE, PLANE_THICKNESS = 20.0, 0.002   # m


def _color(red, green, blue, alpha=1.0):
    return ColorRGBA(r=red, g=green, b=blue, a=alpha)


STATE_COLORS = {
    COLLISION: _color(1.0, 0.2, 0.1),
    SLIDE: _color(1.0, 0.8, 0.0),
    STICK: _color(0.1, 0.8, 0.2),
    REPULSION: _color(0.7, 0.2, 1.0),
}
FIXED, MOVING = _color(0.55, 0.58, 0.62, 0.8), _color(0.2, 0.5, 0.9, 0.9)
FIXED_INSIDE, MOVING_INSIDE = _color(0.55, 0.58, 0.62, 0.15), _color(0.2, 0.5, 0.9, 0.15)


def _point(xyz):
    return Point(x=float(xyz[0]), y=float(xyz[1]), z=float(xyz[2]))


def _marker(namespace, number, kind, scale, pose=None):
    marker = Marker(ns=namespace, id=number, type=kind, action=Marker.ADD)
    marker.scale = Vector3(x=float(scale[0]), y=float(scale[1]), z=float(scale[2]))
    marker.pose = pose or Pose(orientation=Quaternion(w=1.0))
    return marker


def _array(markers, frame_id, stamp):
    for marker in markers:
        marker.header.frame_id = frame_id
        marker.header.stamp = stamp
    return MarkerArray(markers=markers)


def contact_markers(contacts, frame_id, stamp, lifetime):
    """
    Points of contact, and lines along the normals as long as the impulses, coloured by state.

    Parameters
    ----------
    contacts : list of Contacts
        Of the steps since the message before.
    frame_id : str
        Of the headers.
    stamp, lifetime : builtin_interfaces.msg.Time, Duration
        Of the headers, and of the markers.

    Returns
    -------
    markers : visualization_msgs.msg.MarkerArray

    """
    points = _marker('points', 0, Marker.SPHERE_LIST, 3 * [POINT_SIZE])
    lines = _marker('normals', 0, Marker.LINE_LIST, (LINE_WIDTH, 0.0, 0.0))
    for start, end, state in _shown(contacts):
        color = STATE_COLORS[state]
        points.points.append(start)
        points.colors.append(color)
        lines.points += (start, end)
        lines.colors += (color, color)
    for marker in (points, lines):
        marker.lifetime = lifetime
        if not marker.points:
            marker.action = Marker.DELETE
    return _array([points, lines], frame_id, stamp)


def _shown(contacts):
    """Start, end and state of the lines to be shown."""
    if not contacts:
        return
    point, normal, impulse, state = (
        np.concatenate([getattr(one, name) for one in contacts])
        for name in ('point', 'normal', 'impulse', 'state'))
    size = np.minimum(LENGTH * np.sqrt(np.square(impulse).sum(axis=1)), LONGEST)
    end = point + size[:, None] * normal
    finite = np.isfinite(point).all(axis=1) & np.isfinite(end).all(axis=1)
    chosen = np.flatnonzero(finite)
    for i in chosen[::1 + len(chosen) // MOST_CONTACTS]:
        yield _point(point[i]), _point(end[i]), int(state[i])


def clear_markers(frame_id, stamp):
    """Message that takes all markers of its topic away."""
    return _array([Marker(action=Marker.DELETEALL)], frame_id, stamp)


def collider_markers(scene, poses, frame_id, stamp):
    """
    Colliders as solids, those with particles inside nearly transparent.

    Parameters
    ----------
    scene : Scene
        Shapes and sizes.
    poses : list of ((3,) float64 [m], (4,) float64 [-])
        Position and orientation of each collider.
    frame_id, stamp : str, builtin_interfaces.msg.Time
        Of the headers.

    Returns
    -------
    markers : visualization_msgs.msg.MarkerArray

    """
    markers = []
    for collider, (position, orientation) in zip(scene.colliders, poses):
        for number, solid in enumerate(_solids(collider)):
            markers.append(_solid_marker(collider, number, solid, position, orientation))
    return _array(markers, frame_id, stamp)


def _solids(collider):
    """Marker type, scale [m], centre [m] and local orientation of the solids of a collider."""
    a, b, c = collider.size
    upright = (0.0, 0.0, 0.0, 1.0)
    if collider.shape == 'plane':
        scale = (PLANE_SIZE, PLANE_SIZE, PLANE_THICKNESS)
        turn = _turn_to(collider.normal)
        shift = [-0.5 * PLANE_THICKNESS * x for x in collider.normal]
        return [(Marker.CUBE, scale, shift, turn)]
    if collider.shape == 'sphere':
        return [(Marker.SPHERE, 3 * [2 * a], (0, 0, 0), upright)]
    if collider.shape == 'mesh':
        return [(Marker.TRIANGLE_LIST, (1.0, 1.0, 1.0), (0, 0, 0), upright)]
    if collider.shape == 'box':
        return [(Marker.CUBE, (2 * a, 2 * b, 2 * c), (0, 0, 0), upright)]
    solids = [(Marker.CYLINDER, (2 * a, 2 * a, 2 * b), (0, 0, 0), upright)]
    if collider.shape == 'capsule':
        solids += [(Marker.SPHERE, 3 * [2 * a], (0, 0, side * b), upright) for side in (-1, 1)]
    return solids


@lru_cache(maxsize=100)
def _triangle_points(mesh):
    """Corners of the triangles of a mesh, at most MOST_TRIANGLES, evenly left out."""
    faces = mesh.faces[::1 + len(mesh.faces) // MOST_TRIANGLES]
    return [_point(corner) for corner in mesh.vertices[faces.ravel()]]


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
    x, y, z, w = (float(part) for part in _product(orientation, turn))
    pose = Pose(position=_point([position[i] + shift[i] for i in range(3)]),
                orientation=Quaternion(x=x, y=y, z=z, w=w))
    marker = _marker('colliders/' + collider.name, number, kind, scale, pose)
    if collider.mesh:
        marker.points = _triangle_points(collider.mesh)
    if collider.inside:
        marker.color = MOVING_INSIDE if collider.moving else FIXED_INSIDE
    else:
        marker.color = MOVING if collider.moving else FIXED
    return marker
