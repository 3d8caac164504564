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
The solid that a closed mesh is: the union of its parts.

Parts may touch, overlap, lie in each other or be there twice. What is inside does not depend on
how: a point is inside if the parts wind about it in total at least once, so that a part of the
opposite orientation is a cavity. The mesh becomes the surface of that, once, before anything else
is made of it: walls between parts are gone, and all that asks about a surface knows one solid.
"""

from collision_sim.core.mesh_build import edge_numbers
from collision_sim.core.mesh_union import has_flat_part, surface_of_parts
from collision_sim.core.mesh_winding import closed_parts, turn_alike, turn_outward
import numpy as np


def as_solid(vertices, faces):
    """
    Make triangles the surface of a solid.

    Parameters
    ----------
    vertices : (V, 3) float64 [m]
        All different.
    faces : (T, 3) int64
        Triangles that have an area; some may be there several times.

    Returns
    -------
    (vertices, faces) or None
        Of the surface, seen from outside with the corners turning left; None if the triangles
        are open, or if there are sheets without thickness among them.

    """
    faces, parts, closed = turn_alike(faces)
    if not closed:
        return None
    faces = turn_outward(vertices, faces, parts)
    doubled = _doubled(faces)
    if doubled.any():
        sheets, faces, parts = faces[doubled], faces[~doubled], parts[~doubled]
        if not len(faces) or not _are_walls(vertices, sheets, faces):
            return None
        parts = closed_parts(faces, parts)
    if parts.any() or has_flat_part(vertices[faces], parts):
        return surface_of_parts(vertices, faces, parts)
    return vertices, faces


def _doubled(faces):
    """Whether each triangle (T,) is one of two with the same corners that face each other."""
    order = np.argsort(faces, axis=1)
    low, middle, high = np.take_along_axis(faces, order, axis=1).T
    front = (order[:, 1] - order[:, 0]) % 3 == 1
    rows = np.lexsort((front, high, middle, low))
    corners = np.stack([low, middle, high], axis=1)[rows]
    group = np.concatenate([[0], np.cumsum((np.diff(corners, axis=0) != 0).any(axis=1))])
    fronts = np.bincount(group, front[rows]).astype(int)
    pairs = np.minimum(fronts, np.bincount(group) - fronts)
    key = 2 * group + front[rows]
    doubled = np.empty(len(faces), dtype=bool)
    doubled[rows] = np.arange(len(faces)) - np.searchsorted(key, key) < pairs[group]
    return doubled


def _are_walls(vertices, sheets, faces):
    """
    Whether doubled triangles lie within the solid that the others close, by the angles at edges.

    Where there is solid beside a sheet, the next triangle about the edge shows its back. Sheets
    whose edges say nothing hang together with others, or else they are no walls.
    """
    count = len(sheets)
    edges = edge_numbers(np.concatenate([sheets, faces]))
    here, there = edges[:count].ravel(), edges[count:].ravel()
    order = np.argsort(there, kind='stable')
    first, end = (np.searchsorted(there[order], here, side) for side in ('left', 'right'))
    lone = np.bincount(here)[here] == 2
    if (lone & (first == end)).any():
        return False
    many = end - first
    one = np.repeat(np.arange(len(here)), many)
    other = order[np.arange(many.sum()) - np.repeat(np.cumsum(many) - many - first, many)]
    turn, ahead = _turn_about_edge(vertices, sheets, faces, one, other)
    best = np.lexsort((turn, one))
    best = best[np.concatenate([[True], np.diff(one[best]) != 0])] if len(best) else best
    return bool(ahead[best].all()) and bool(_reached(edges[:count], many > 0).all())


def _turn_about_edge(vertices, sheets, faces, one, other):
    """Angle [rad] from sheets' sides to sides of faces, about the edge; is the face's ahead."""
    low, high, tip = _ends(sheets, one)
    axis = vertices[high] - vertices[low]
    axis /= np.sqrt(np.square(axis).sum(axis=1, keepdims=True))
    arm = vertices[tip] - vertices[low]
    u = arm - (arm * axis).sum(axis=1, keepdims=True) * axis
    _, _, tip = _ends(faces, other)
    arm = vertices[tip] - vertices[low]
    angle = np.arctan2((arm * np.cross(axis, u)).sum(axis=1), (arm * u).sum(axis=1))
    start = faces.ravel()[other]
    return angle % (2.0 * np.pi), start == low


def _ends(faces, sides):
    """Lower and higher vertex of sides 3 t + k, and the third vertex of the triangle."""
    t, k = np.divmod(sides, 3)
    a, b = faces[t, k], faces[t, (k + 1) % 3]
    return np.minimum(a, b), np.maximum(a, b), faces[t, (k + 2) % 3]


def _reached(edges, known):
    """Which triangles (T,) hang together with one that has a known side, across edges."""
    reached = known.reshape(edges.shape).any(axis=1)
    while True:
        at = np.zeros(edges.max() + 1, dtype=bool)
        at[edges[reached]] = True
        grown = at[edges].any(axis=1)
        if (grown == reached).all():
            return reached
        reached = grown
