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
Meshes in glTF and 3MF files, by the library trimesh; they hold triangles only.

All bodies of the scene in a file are read, each where the scene places it. Files that a file names
are not.
"""

from io import BytesIO
import json
import zipfile

import numpy as np

MOST_TRIANGLES = 2 ** 25    # of all bodies


def read_bodies(data, kind):
    """
    Give the triangles of a file.

    Parameters
    ----------
    data : bytes
        Content of the file.
    kind : str
        glb, gltf or 3mf.

    Returns
    -------
    vertices, corners, sizes, remarks
        As in mesh_files.py.

    Raises
    ------
    ValueError
        For what is no such file, or would be larger than it says, or where trimesh is missing.

    """
    try:
        import trimesh
    except ImportError:
        advice = "trimesh must be installed: pip install 'collision_sim[meshes]'"
        raise ValueError(advice) from None
    if kind == '3mf':
        _check_archive(data)
    else:
        _check_counts(data, kind)
    scene = trimesh.load_scene(BytesIO(data), file_type=kind, process=False)
    places = [scene.graph[node] for node in scene.graph.nodes_geometry]
    bodies = [(matrix, scene.geometry[name]) for matrix, name in places
              if isinstance(scene.geometry[name], trimesh.Trimesh)]
    if sum(len(body.faces) for _, body in bodies) > MOST_TRIANGLES:
        raise ValueError(f'there are more than {MOST_TRIANGLES} triangles')
    if not bodies:
        raise ValueError('there are no triangles in it')
    counts = [len(body.vertices) for _, body in bodies]
    starts = np.cumsum([0, *counts[:-1]])
    vertices = [body.vertices @ matrix[:3, :3].T + matrix[:3, 3] for matrix, body in bodies]
    corners = np.concatenate([body.faces + start for (_, body), start in zip(bodies, starts)])
    rest = len(places) - len(bodies)
    return np.concatenate(vertices), corners.ravel(), np.full(len(corners), 3), [
        f'{rest} bodies without triangles are left out'] * bool(rest)


def _check_archive(data):
    """Refuse an archive that would grow beyond all measure."""
    from collision_sim.mesh_files import MOST_BYTES
    with zipfile.ZipFile(BytesIO(data)) as archive:
        if sum(entry.file_size for entry in archive.infolist()) > MOST_BYTES:
            raise ValueError(f'it would unpack to more than {MOST_BYTES >> 20} MiB')


def _check_counts(data, kind):
    """Refuse glTF that announces more numbers than it has bytes."""
    text = data[20:20 + int.from_bytes(data[12:16], 'little')] if kind == 'glb' else data
    head = json.loads(text)
    if any('uri' in buffer and not buffer['uri'].startswith('data:')
           for buffer in head.get('buffers', [])):
        raise ValueError('its numbers are in other files; save it as .glb')
    if any(accessor.get('count', 0) > len(data) for accessor in head.get('accessors', [])):
        raise ValueError('it announces more numbers than it has')
