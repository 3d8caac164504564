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
Files with meshes: OBJ, OFF and STL; PLY is in ply.py, RIB in rib.py.

A reader takes the bytes of a file, follows no reference out of it and gives vertices (V, 3), the
corners of all polygons one after the other, and how many corners each has. It raises ValueError
where the file is not what it should be. What a header announces is compared with the size of the
file before memory is taken.
"""

import re

from collision_sim.checks import SceneError, Text
from collision_sim.ply import read_ply
from collision_sim.rib import read_rib
import numpy as np

MOST_BYTES = 2 ** 29        # of a file
VERTEX = re.compile(rb'vertex\s+(\S+)\s+(\S+)\s+(\S+)')


def read_polygons(value, path, directory):
    """
    Give the polygons in the file that `value` names.

    Parameters
    ----------
    value, path : str
        Name of the file, and the key it stands under.
    directory : Path
        Where relative names start.

    Returns
    -------
    vertices, corners, sizes : (V, 3) float64, (sum of sizes,) int64, (P,) int64

    Raises
    ------
    SceneError
        For a file that is missing, too large or broken.

    """
    kinds = '|'.join(READERS)
    name = Text(rf'(?is:.+)\.(?i:{kinds})', 'must be the name of a file that ends in '
                + ', '.join(f'.{kind}' for kind in READERS)).read(value, path)
    try:
        vertices, corners, sizes = READERS[name.rpartition('.')[2].lower()](
            _content(directory / name))
        return (np.asarray(vertices, dtype=np.float64).reshape(-1, 3),
                np.asarray(corners, dtype=np.int64), np.asarray(sizes, dtype=np.int64))
    except Exception as error:  # whatever a broken file makes its reader raise
        problem = ' '.join(str(error).split()) or type(error).__name__
        raise SceneError(path, name, f'must be a readable mesh; {problem[:200]}') from None


def _content(path):
    """Give the bytes of an ordinary file that is not too large."""
    if not path.is_file():
        raise ValueError('there is no such file')
    with open(path, 'rb') as file:
        data = file.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise ValueError(f'the file is larger than {MOST_BYTES >> 20} MiB')
    if not data.strip():
        raise ValueError('the file is empty')
    return data


def _lines(data, comment=b'#'):
    """Give number and words of each line that has any, without comments."""
    start, number = 0, 0
    while start < len(data):
        end = data.find(b'\n', start)
        end = len(data) if end < 0 else end
        number += 1
        words = data[start:end].partition(comment)[0].split()
        start = end + 1
        if words:
            yield number, words


def _read_numbers(kind, words, number):
    """Give words of a line as numbers."""
    try:
        return [kind(word) for word in words]
    except ValueError as error:
        raise ValueError(f'line {number}: {error}') from None


def _read_obj(data):
    """Read the lines v and f; all else (normals, groups, materials) is left."""
    vertices, corners, sizes = [], [], []
    for number, words in _lines(data.replace(b'\\\r\n', b' ').replace(b'\\\n', b' ')):
        if words[0] == b'v':
            if len(words) < 4:
                raise ValueError(f'line {number}: a vertex must have 3 numbers')
            vertices += _read_numbers(float, words[1:4], number)
        elif words[0] == b'f':
            count = len(vertices) // 3
            numbers = _read_numbers(int, [word.partition(b'/')[0] for word in words[1:]], number)
            if 0 in numbers:
                raise ValueError(f'line {number}: vertices are counted from 1')
            corners += [count + k if k < 0 else k - 1 for k in numbers]
            sizes.append(len(numbers))
    return vertices, corners, sizes


def _read_off(data):
    """Read OFF as text, colours and normals aside."""
    lines = _lines(data)
    number, words = next(lines, (0, [b'']))
    if not words[0].endswith(b'OFF') or b'BINARY' in words:
        raise ValueError('the file must begin with OFF and be text')
    counts = words[1:] or next(lines, (number, []))[1]
    if len(counts) < 2:
        raise ValueError(f'line {number}: the counts of vertices and faces are missing')
    count, faces = _read_numbers(int, counts[:2], number)
    if not (0 <= count < len(data) and 0 <= faces < len(data)):
        raise ValueError(f'{count} vertices and {faces} faces do not fit into the file')
    vertices, corners, sizes = [], [], []
    for number, words in lines:
        if count:
            vertices += _read_numbers(float, words[:3], number)
            count -= 1
            if len(vertices) % 3:
                raise ValueError(f'line {number}: a vertex must have 3 numbers')
        elif len(sizes) < faces:
            size, *face = _read_numbers(int, words[:1 + _size(words, number)], number)
            if len(face) != size:
                raise ValueError(f'line {number}: a face must have as many corners as it says')
            corners += face
            sizes.append(size)
    if count or len(sizes) < faces:
        raise ValueError('the file ends too early')
    return vertices, corners, sizes


def _size(words, number):
    """Give the number at the start of a line, which says how many follow."""
    size = _read_numbers(int, words[:1], number)[0]
    if not 0 <= size < len(words):
        raise ValueError(f'line {number}: there must be {size} corners')
    return size


def _read_stl(data):
    """Read STL: binary if the size of the file is the one that its header announces."""
    count = int.from_bytes(data[80:84], 'little')
    if len(data) >= 84 and len(data) == 84 + 50 * count:
        facet = np.dtype([('normal', '<f4', 3), ('corners', '<f4', (3, 3)), ('rest', '<u2')])
        vertices = np.frombuffer(data, facet, count, 84)['corners'].reshape(-1, 3)
    elif data.lstrip()[:5].lower() == b'solid':
        vertices, count = _facets(data)
    else:
        raise ValueError(f'{len(data)} bytes are no text, and not the {84 + 50 * count} of '
                         f'{count} binary triangles')
    if len(vertices) != 3 * count:
        raise ValueError('a facet must have 3 vertices')
    return vertices, np.arange(len(vertices)), np.full(count, 3)


def _facets(data):
    """Give the vertices in the text of STL, and how many facets there are."""
    if b'endsolid' not in data:
        raise ValueError('the file ends too early')
    numbers = (float(word) for found in VERTEX.finditer(data) for word in found.groups())
    return np.fromiter(numbers, dtype=np.float64).reshape(-1, 3), data.count(b'endfacet')


READERS = {'obj': _read_obj, 'off': _read_off, 'ply': read_ply, 'rib': read_rib, 'stl': _read_stl}
