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
Files with meshes: OBJ, OFF and STL; ply.py, rib.py and mesh_bodies.py read other formats.

A reader takes the bytes of a file, follows no reference out of it and gives vertices (V, 3), the
corners of all polygons one after the other, how many corners each has, and remarks on what it has
left out. It raises ValueError where the file is not what it should be. What a header announces is
compared with the size of the file before memory is taken.
"""

from functools import partial
from itertools import islice, product
import re
import warnings

from collision_sim.checks import SceneError, SceneWarning, Text
from collision_sim.input_files import as_text, open_file, refuse_underscores
from collision_sim.mesh_bodies import read_bodies
from collision_sim.ply import read_ply
from collision_sim.rib import read_rib
import numpy as np

MOST_BYTES = 2 ** 29        # of a file
# Words that lines of OBJ begin with and that make no surface, or only say how it looks.
NO_SURFACE = frozenset((
    'vt vn vp g s o mg usemtl mtllib usemap maplib bevel c_interp d_interp lod shadow_obj '
    'trace_obj').encode().split())
COMMENT = re.compile(rb'#[^\n]*')
OFF = re.compile(rb'\s*(?P<picture>ST)?(?P<colour>C)?(?P<normal>N)?(?P<weight>4)?(?P<any>n)?OFF')
FACET = re.compile(rb'\bend\s*facet\b|\bfacet\b|\bvertex\s+(\S+)\s+(\S+)\s+(\S+)')
# The first and the last line of a solid, with its name, which may be any words.
SOLID = re.compile(rb'^[ \t]*solid\b(?:(?!facet\s+normal\b)[^\n])*', re.MULTILINE)
END_SOLID = re.compile(rb'\bend[ \t]*solid\b([^\n]*)')


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

    Warns
    -----
    SceneWarning
        For what the file has and is left out.

    """
    kinds = '|'.join(READERS)
    name = Text(rf'(?is:.+)\.(?i:{kinds})', 'must be the name of a file that ends in '
                + ', '.join(f'.{kind}' for kind in READERS)).read(value, path)
    try:
        vertices, corners, sizes, remarks = READERS[name.rpartition('.')[2].lower()](
            _content(directory / name))
        polygons = (np.asarray(vertices, dtype=np.float64).reshape(-1, 3),
                    np.asarray(corners, dtype=np.int64), np.asarray(sizes, dtype=np.int64))
    except Exception as error:  # whatever a broken file makes its reader raise
        problem = ' '.join(str(error).split()) or type(error).__name__
        raise SceneError(path, name, f'must be a readable mesh; {problem[:200]}') from None
    for remark in remarks:
        warnings.warn(f'{path}: {name!r}: {remark}', SceneWarning, stacklevel=2)
    return polygons


def _content(path):
    """Give the bytes of an ordinary file that is not too large."""
    if not path.is_file():
        raise ValueError('there is no such file')
    with open_file(path) as file:
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
        return [kind(word) for word in refuse_underscores(words)]
    except ValueError as error:
        raise ValueError(f'line {number}: {error}') from None


def _read_obj(data):
    """Read the lines v, f and fo, an old name of f."""
    vertices, corners, sizes, others = [], [], [], []
    for number, words in _lines(as_text(data).replace(b'\\\n', b' ')):
        if words[0] == b'v':
            if len(words) < 4:
                raise ValueError(f'line {number}: a vertex must have 3 numbers')
            vertices += _read_numbers(float, words[1:4], number)
        elif words[0] in (b'f', b'fo'):
            count = len(vertices) // 3
            numbers = _read_numbers(int, [word.partition(b'/')[0] for word in words[1:]], number)
            if 0 in numbers:
                raise ValueError(f'line {number}: vertices are counted from 1')
            corners += [count + k if k < 0 else k - 1 for k in numbers]
            sizes.append(len(numbers))
        elif words[0] not in NO_SURFACE:
            others.append((number, words[0]))
    return vertices, corners, sizes, [
        f'{len(others)} lines that are no vertices or faces are left out; the first is line '
        f'{number}, {word[:20].decode("ascii", "replace")!r}' for number, word in others[:1]]


def _read_off(data):
    """Read OFF as text, colours and normals aside: a row a line, or else number by number."""
    data = COMMENT.sub(b'', as_text(data))
    head = OFF.match(data)
    if not head or data[head.end():head.end() + 20].split()[:1] == [b'BINARY']:
        raise ValueError('the file must begin with OFF and be text')
    if head['any']:
        raise ValueError('nOFF, of any number of dimensions, is not read')
    before, data = data.count(b'\n', 0, head.end()), data[head.end():]
    number, counts = next(_lines(data), (1, []))
    if len(counts) < 2:
        counts = [word for _, words in islice(_lines(data), 3) for word in words]
    if len(counts) < 2:
        raise ValueError(f'line {before + number}: the counts of vertices and faces are missing')
    count, faces = _read_numbers(int, counts[:2], before + number)
    if not (0 <= count < len(data) and 0 <= faces < len(data)):
        raise ValueError(f'{count} vertices and {faces} faces do not fit into the file')
    width = 4 if head['weight'] else 3
    try:
        vertices, corners, sizes, rest = _off_by_line(data, before, count, faces, width)
    except ValueError as error:
        more = (3 if head['normal'] else 0) + (2 if head['picture'] else 0)
        vertices, corners, sizes, rest = _off_by_number(
            data, 2 if len(counts) == 2 else 3, count, faces, width,
            [more + 4, more + 3] if head['colour'] else [more], error)
    vertices = np.reshape(vertices, (-1, width))
    if head['weight']:
        vertices = vertices[:, :3] / vertices[:, 3:]
    return vertices, corners, sizes, [f'{rest} after the last face are left out'] * bool(rest)


def _off_by_line(data, before, count, faces, width):
    """Read what has a line for each vertex and each face; more on the line is left."""
    vertices, corners, sizes, rest = [], [], [], 0
    lines = _lines(data)
    next(lines, None)
    for number, words in lines:
        if len(vertices) < width * count:
            vertices += _read_numbers(float, words[:width], number + before)
            if len(vertices) % width:
                raise ValueError(f'line {number + before}: a vertex must have {width} numbers')
        elif len(sizes) < faces:
            size, *face = _read_numbers(int, words[:1 + _size(words, number + before)],
                                        number + before)
            corners += face
            sizes.append(size)
        else:
            rest += 1
    if len(vertices) < width * count or len(sizes) < faces:
        raise ValueError('the file ends too early')
    return vertices, corners, sizes, f'{rest} lines' if rest else ''


def _size(words, number):
    """Give the number at the start of a line, which says how many follow."""
    size = _read_numbers(int, words[:1], number)[0]
    if not 0 <= size < len(words):
        raise ValueError(f'line {number}: there must be {size} corners')
    return size


def _off_by_number(data, skipped, count, faces, width, others, error):
    """Read what ends its lines anywhere; raises the error if nothing fits."""
    words, ends = [], []
    for _, line in _lines(data):
        words += refuse_underscores(line)
        ends += [len(words)] * len(line)
    for more, colours in product(others, (False, True)):
        start = skipped + (width + more) * count
        try:
            vertices = [[float(word) for word in words[k:k + width]]
                        for k in range(skipped, start, width + more)]
            k, corners, sizes = start, [], []
            for _ in range(faces):
                size = int(words[k])
                face = [int(word) for word in words[k + 1:k + 1 + size]]
                if not 0 <= size == len(face) or (size and max(face) >= count):
                    raise ValueError
                k = ends[k + size] if colours else k + 1 + size     # to the end of the line
                corners += face
                sizes.append(size)
        except (ValueError, IndexError):
            continue
        if k == len(words):
            return vertices, corners, sizes, ''
    raise error


def _read_stl(data):
    """Read STL: binary if its header announces what is there, or it is no text."""
    count = int.from_bytes(data[80:84], 'little')
    size = 84 + 50 * count
    text = b'' if len(data) == size else as_text(data)
    if text.lstrip()[:5].lower() == b'solid' and b'\0' not in text:
        return _facets(text.lower())
    if not (84 <= size <= len(data) and (count or len(data) == 84)):
        raise ValueError(f'{len(data)} bytes are no text, and not the {size} of {count} binary '
                         'triangles')
    facet = np.dtype([('normal', '<f4', 3), ('corners', '<f4', (3, 3)), ('rest', '<u2')])
    vertices = np.frombuffer(data, facet, count, 84)['corners'].reshape(-1, 3)
    rest = len(data) - size
    return vertices, np.arange(len(vertices)), np.full(count, 3), [
        f'{rest} bytes after the last triangle are left out'] * bool(rest)


def _facets(text):
    """Read the text of STL, in small letters; a facet may have any number of vertices."""
    if any(b'facet' in found[1] and b'vertex' in found[1] for found in END_SOLID.finditer(text)):
        raise ValueError('after the end of a solid there must be a new line')
    text, ends = END_SOLID.subn(b'', text)
    text, begins = SOLID.subn(b'', text)
    if ends < begins:
        raise ValueError('the file ends too early')
    vertices, sizes, size = [], [], None
    for found in FACET.finditer(text):
        if found[1] is not None:
            if size is None:
                raise ValueError(f'a vertex must be in a facet, after facet {len(sizes)}')
            try:
                vertices += map(float, refuse_underscores(found.groups()))
            except ValueError as error:
                raise ValueError(f'facet {len(sizes)}: {error}') from None
            size += 1
        elif found[0].startswith(b'facet') != (size is None):
            raise ValueError(f'facet {len(sizes)} must have a beginning and an end')
        elif size is None:
            size = 0
        else:
            sizes.append(size)
            size = None
    if size is not None:
        raise ValueError('the file ends too early')
    return vertices, np.arange(sum(sizes)), sizes, []


READERS = {'obj': _read_obj, 'off': _read_off, 'ply': read_ply, 'rib': read_rib, 'stl': _read_stl,
           **{kind: partial(read_bodies, kind=kind) for kind in ('glb', 'gltf', '3mf')}}
