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

"""Meshes in glTF and 3MF files: what trimesh writes is read; what is hostile is refused."""

import json
import sys
import zipfile

from collision_sim.mesh_files import MOST_BYTES
import numpy as np
import pytest
import small_meshes
from test_mesh_files import collider, refusal, volume, write


def scene_file(kind):
    """Give the bytes of a file with two boxes, one of them moved and turned."""
    trimesh = pytest.importorskip('trimesh', reason="needs pip install 'collision_sim[meshes]'")
    if kind == '3mf':
        pytest.importorskip('lxml')
        pytest.importorskip('networkx')
    vertices, faces = small_meshes.box((1.0, 2.0, 3.0))
    box = trimesh.Trimesh(vertices, small_meshes.triangles(faces), process=False)
    scene = trimesh.Scene()
    scene.add_geometry(box, geom_name='a', node_name='a')
    turn = np.array([[0.0, -1, 0, 5], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    scene.graph.update('b', geometry='a', matrix=turn)
    content = scene.export(file_type=kind, **({'merge_buffers': True} if kind == 'gltf' else {}))
    return content


@pytest.mark.parametrize('kind', ['glb', '3mf'])
def test_all_bodies_are_read_where_they_are(tmp_path, kind):
    found = collider(tmp_path, file=write(tmp_path, f'a.{kind}', scene_file(kind))).mesh
    assert found.closed and len(found.faces) == 24
    assert volume(found) == pytest.approx(12.0, rel=1e-6)
    assert found.vertices.max(axis=0) == pytest.approx([6.0, 1.0, 1.5])


@pytest.mark.parametrize('kind', ['glb', 'gltf', '3mf'])
def test_without_trimesh_it_is_said_what_to_install(tmp_path, monkeypatch, kind):
    monkeypatch.setitem(sys.modules, 'trimesh', None)
    refusal('.file', "pip install 'collision_sim[meshes]'", directory=tmp_path,
            file=write(tmp_path, f'a.{kind}', b'{}'))


def test_hostile_files_are_refused_before_memory_is_taken(tmp_path):
    pytest.importorskip('trimesh', reason="needs pip install 'collision_sim[meshes]'")
    head = {'accessors': [{'componentType': 5126, 'count': 10 ** 12, 'type': 'VEC3'}],
            'asset': {'version': '2.0'}}
    refusal('more numbers than it has', directory=tmp_path,
            file=write(tmp_path, 'a.gltf', json.dumps(head).encode()))
    head = {'buffers': [{'uri': '/dev/zero', 'byteLength': 12}], 'asset': {'version': '2.0'}}
    refusal('in other files', directory=tmp_path,
            file=write(tmp_path, 'b.gltf', json.dumps(head).encode()))
    with zipfile.ZipFile(tmp_path / 'bomb.3mf', 'w', zipfile.ZIP_DEFLATED) as archive:
        with archive.open('3D/3dmodel.model', 'w', force_zip64=True) as entry:
            for _ in range(MOST_BYTES // 2 ** 24 + 1):
                entry.write(bytes(2 ** 24))
    refusal('unpack to more', directory=tmp_path, file='bomb.3mf')
    for kind in ('glb', 'gltf', '3mf'):
        for content in (b'x', b'glTF' + bytes(40), b'PK\3\4' + bytes(40), bytes(range(256))):
            refusal('.file', directory=tmp_path, file=write(tmp_path, f'c.{kind}', content))
