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
Triangle meshes of a scene: what they are, and how corners and polygons become one.

Equal vertices are merged, polygons are cut into triangles, faces without area and repeated ones
are left out, and neighbours are turned the same way round; a SceneWarning says what is left out. A
mesh is closed if its triangles pass each edge as often one way as the other; it then becomes the
surface of the solid that its parts are together, its normals pointing outward
(core/mesh_solid.py). All else is open, an edge with three triangles included: it stops particles
on both sides.
"""

from dataclasses import dataclass
from numbers import Integral

from collision_sim.checks import as_list, join, MISSING, read_only, read_vectors, SceneError
from collision_sim.checks import Vector, warn
import numpy as np

MESH_KEYS = ('file', 'vertices', 'faces')
VERTEX = Vector('m', 'Vertex')
LARGEST = 1e30              # m
MOST_VERTICES = 2 ** 31
THIN = 2.0 ** -48           # height of a triangle without area, relative to its coordinates


@dataclass(frozen=True, eq=False)
class Mesh:
    """
    A triangle mesh in the frame of its collider; the arrays are read-only.

    Attributes
    ----------
    vertices : (V, 3) float64 [m]
        All different.
    faces : (T, 3) int64
        Triangles; of a closed mesh their corners turn left as seen from outside.
    closed : bool

    """

    vertices: np.ndarray
    faces: np.ndarray
    closed: bool

    @property
    def extent(self) -> float:
        """Greatest distance of a vertex from the origin [m]."""
        return float(np.sqrt(np.square(self.vertices).sum(axis=1).max()))


def read_mesh(section, path, directory, scale, inside) -> Mesh:
    """
    Read the mesh of a collider.

    Parameters
    ----------
    section : dict
        Of the collider: with `file`, or with `vertices` and `faces`.
    path : str
        Of the collider.
    directory : Path
        Where relative names of files start.
    scale : float [-]
        Factor of all lengths.
    inside : bool
        Whether the particles are to be kept inside.

    Raises
    ------
    SceneError
        For the first vertex or face that is not allowed, an unreadable file, or an open mesh that
        is to keep particles inside.

    """
    if ('file' in section) == ('vertices' in section or 'faces' in section):
        raise SceneError(path, [key for key in MESH_KEYS if key in section],
                         'must have either file, or vertices and faces')
    if 'file' in section:
        path, value = join(path, 'file'), section['file']
        from collision_sim.mesh_files import read_polygons
        polygons = read_polygons(value, path, directory)
    else:
        value, path = section.get('faces', MISSING), join(path, 'faces')
        vertices = read_vectors(section.get('vertices', MISSING),
                                path.removesuffix('faces') + 'vertices', VERTEX)
        polygons = vertices, *_read_faces(value, path)
    vertices, corners, sizes = polygons
    mesh = make_mesh(scale * vertices, corners, sizes, path, value)
    if inside and not mesh.closed:
        raise SceneError(path, value, 'must be closed to keep particles inside: each edge must '
                                      'have two faces')
    return mesh


def _read_faces(value, path):
    """Give the corners of polygons one after the other, and how many each has."""
    faces = as_list(value)
    if not isinstance(faces, list):
        raise SceneError(path, value, 'must be a list of faces, lists of numbers of vertices')
    for i, face in enumerate(faces):
        corners = faces[i] = as_list(face)
        if not isinstance(corners, list) or not all(
                isinstance(k, Integral) and not isinstance(k, bool) and abs(k) < MOST_VERTICES
                for k in corners):
            raise SceneError(f'{path}[{i}]', face, 'must be a list of numbers of vertices')
        if len(corners) < 3:
            raise SceneError(path, value, f'face {i} must have at least 3 corners, not '
                                          f'{len(corners)}')
    return (np.array([k for face in faces for k in face], dtype=np.int64),
            np.array([len(face) for face in faces], dtype=np.int64))


def make_mesh(vertices, corners, sizes, path, value) -> Mesh:
    """
    Make a mesh of polygons.

    Parameters
    ----------
    vertices : (V, 3) float64 [m]
        In any order.
    corners : (sum of sizes,) int64
        Vertices of the polygons, one after the other.
    sizes : (P,) int64
        How many corners each polygon has.
    path, value : str, object
        Of the key that the mesh stands under, for errors.

    Raises
    ------
    SceneError
        For the first vertex or face that is not allowed.

    """
    from collision_sim.core.mesh_solid import as_solid          # takes a while
    from collision_sim.core.mesh_winding import turn_alike
    _check(vertices, corners, sizes, path, value)
    used = np.zeros(len(vertices), dtype=bool)
    used[corners] = True
    numbers = np.cumsum(used) - 1
    vertices, same = merged(vertices[used])
    faces = _triangles(vertices, same[numbers[corners]], sizes, path, value)
    different, repeats = _without_repeats(faces)
    warn(path, value, repeats, 'with the corners of another one are left out', 'triangles')
    solid = as_solid(vertices, faces)
    if solid is None:
        faces, solid = different, as_solid(vertices, different)
    closed = solid is not None
    vertices, faces = solid if closed else (vertices, turn_alike(faces)[0])
    used, numbers = np.unique(faces, return_inverse=True)
    return Mesh(read_only(vertices[used]), read_only(numbers.reshape(-1, 3)), closed)


def _triangles(vertices, corners, sizes, path, value):
    """Cut polygons into triangles (T, 3) with an area; warn of what is not as it should be."""
    from collision_sim.core.needles import triangle_heights, without_needles
    from collision_sim.core.polygons import CROSSING, cut, FLATNESS, NOT_FLAT   # takes a while
    enough = sizes >= 3
    corners = corners[np.repeat(enough, sizes)]
    numbers = np.flatnonzero(enough)
    faces, polygons, remarks = cut(vertices, corners, sizes[enough])
    thin = THIN * np.abs(vertices).max()
    has_area = np.zeros(len(sizes), dtype=bool)
    has_area[numbers[polygons[triangle_heights(vertices[faces]) > thin]]] = True
    crossing = np.flatnonzero(remarks == CROSSING)
    if len(crossing):
        raise SceneError(path, value, f'face {numbers[crossing[0]]} crosses itself')
    if not has_area.any():
        raise SceneError(path, value, 'must have at least one face with an area')
    bent = has_area[numbers] & (remarks & NOT_FLAT > 0)
    warn(path, value, np.flatnonzero(~has_area), 'without area are left out')
    warn(path, value, numbers[bent],
         f'that are not flat to {FLATNESS:g} of their size are cut into triangles as if they were')
    warn(path, value, numbers[bent & (remarks & CROSSING > 0)],
         'that are not flat cross themselves in the plane that they are cut in')
    return without_needles(vertices, faces, thin)


def _check(vertices, corners, sizes, path, value):
    """Raise SceneError for the first vertex or face that cannot be."""
    if not len(sizes):
        raise SceneError(path, value, 'must have at least one face')
    out = np.flatnonzero((corners < 0) | (corners >= len(vertices)))
    if len(out):
        face = np.searchsorted(np.cumsum(sizes), out[0], side='right')
        raise SceneError(path, value, f'face {face}: corner {corners[out[0]]} is out of range '
                                      f'({len(vertices)} vertices, counted from 0)')
    bad = np.zeros(len(vertices), dtype=bool)
    bad[corners] = True
    bad &= ~(np.abs(vertices) <= LARGEST).all(axis=1)
    if bad.any():
        raise SceneError(path, value, f'vertex {np.flatnonzero(bad)[0]} must be 3 finite numbers, '
                                      f'none beyond {LARGEST:g} m')


def merged(vertices):
    """Give the different vertices (U, 3) in the order of their first use, and numbers (V,)."""
    vertices = vertices + 0.0           # so that -0 is 0
    order = np.lexsort(vertices.T)
    step = np.any(np.diff(vertices[order], axis=0) != 0.0, axis=1)
    group = np.empty(len(vertices), dtype=np.int64)
    group[order] = np.concatenate([[0], np.cumsum(step)])
    _, first, numbers = np.unique(group, return_index=True, return_inverse=True)
    place = np.argsort(first, kind='stable')
    rank = np.empty_like(place)
    rank[place] = np.arange(len(place))
    return vertices[first[place]], rank[numbers]


def _without_repeats(faces):
    """
    Leave out triangles with the same three corners as one before, whichever way round.

    Returns
    -------
    faces : (T', 3) int64
    repeats : (T - T',) int64
        Numbers of those left out.

    """
    low, middle, high = np.sort(faces, axis=1).T
    order = np.lexsort((high, middle, low))
    same = ((np.diff(low[order]) == 0) & (np.diff(middle[order]) == 0)
            & (np.diff(high[order]) == 0))
    keep = np.ones(len(faces), dtype=bool)
    keep[order[1:][same]] = False
    return faces[keep], np.flatnonzero(~keep)
