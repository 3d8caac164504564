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

"""Meshes in files as all kinds of programs write them give the solid that was written."""

import warnings

import mesh_dialects
import numpy as np
import pytest
import small_meshes
from test_mesh_files import collider, volume, write

SHAPES = {'box': small_meshes.box((1.0, 2.0, 3.0)), 'torus': small_meshes.torus(6)}


def house():
    """Give a closed solid whose ends are polygons that are not convex."""
    ring = [[0, 0], [2, 0], [2, 2], [1, 0.5], [0, 2]]
    vertices = np.array([[x, y, z] for z in (0.0, 1.0) for x, y in ring])
    sides = [[k, (k + 1) % 5, (k + 1) % 5 + 5, k + 5] for k in range(5)]
    return vertices, [[4, 3, 2, 1, 0], [5, 6, 7, 8, 9], *sides]


@pytest.mark.parametrize('kind', mesh_dialects.WRITERS)
@pytest.mark.parametrize('shape', [*SHAPES, 'house'])
@pytest.mark.parametrize('seed', range(12))
def test_what_was_written_is_read(tmp_path, kind, shape, seed):
    random = np.random.default_rng([seed, len(kind), len(shape)])
    vertices, faces = house() if shape == 'house' else SHAPES[shape]
    if shape == 'house' and kind in ('stl', 'ply'):     # their writers cut convex faces only
        faces = small_meshes.triangles(faces[2:]).tolist()
        faces += [[4, 3, 0], [3, 1, 0], [3, 2, 1], [9, 5, 8], [8, 5, 6], [8, 6, 7]]
    content = mesh_dialects.WRITERS[kind](random, vertices, faces)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter('always')
        found = collider(tmp_path, file=write(tmp_path, f'a.{kind}', content)).mesh
    exact = volume(collider(vertices=vertices, faces=faces).mesh)
    assert found.closed and len(found.vertices) == len(vertices)
    assert volume(found) == pytest.approx(exact, rel=1e-6 if kind == 'stl' else 1e-12)
    said = [str(each.message) for each in caught]
    assert not said or (kind == 'stl' and 'bytes after the last triangle' in said[0])
