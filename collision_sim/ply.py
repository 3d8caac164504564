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
Meshes in PLY files, text or binary: positions of the vertices, corners of the faces.

What else an element has (colours, normals) is read over, and so are other elements, but for strips
of triangles.
"""

from itertools import chain
import re

from collision_sim.input_files import as_text, refuse_underscores
import numpy as np

MOST_HEADER = 2 ** 16       # bytes
TYPES = {
    'char': 'i1', 'uchar': 'u1', 'short': 'i2', 'ushort': 'u2', 'int': 'i4', 'uint': 'u4',
    'float': 'f4', 'double': 'f8', 'int8': 'i1', 'uint8': 'u1', 'int16': 'i2', 'uint16': 'u2',
    'int32': 'i4', 'uint32': 'u4', 'int64': 'i8', 'uint64': 'u8', 'float32': 'f4',
    'float64': 'f8'}
CORNERS = re.compile('vertex_?ind(ex|ices|exes)')      # names of the property
ORDERS = {'ascii': None, 'binary_little_endian': '<', 'binary_big_endian': '>'}


def read_ply(data):
    """
    Give the polygons of a PLY file.

    Parameters
    ----------
    data : bytes
        Content of the file.

    Returns
    -------
    vertices, corners, sizes, remarks
        As in mesh_files.py.

    Raises
    ------
    ValueError
        For what is no such file.

    """
    order, elements, body = _read_header(data)
    found, rest = _read_text(body, elements) if order is None else _read_binary(
        body, elements, order)
    vertices, faces = None, []
    for (name, *_), columns in zip(elements, found):
        if name == 'vertex':
            vertices = np.stack([_column(columns, axis, name) for axis in 'xyz'], axis=1)
        elif name in ('face', 'tristrips'):
            lists = _column(columns, next(filter(CORNERS.fullmatch, columns), 'vertex_indices'),
                            name)
            faces.append(lists if name == 'face' else _triangles(*lists))
    if vertices is None or not faces:
        raise ValueError('there must be vertices and faces')
    sizes, corners = map(np.concatenate, zip(*faces))
    return vertices, corners, sizes, [f'{rest} after the last element are left out'] * bool(rest)


def _column(columns, key, name):
    if key not in columns or isinstance(columns[key], tuple) != key.startswith('vertex'):
        raise ValueError(f'element {name} must have the property {key}')
    return columns[key]


def _triangles(sizes, corners):
    """Give sizes and corners of the triangles of strips, which -1 ends too."""
    triangles, start = [], 0
    for size in sizes:
        strip = []
        for corner in map(int, corners[start:start + size]):
            strip.append(corner)
            if corner < 0:
                strip = []
            elif len(strip) > 2 and len(set(strip[-3:])) == 3:
                turned = 1 if len(strip) % 2 else -1        # every other one the other way round
                triangles += strip[-3:][::turned]
        start += size
    return [3] * (len(triangles) // 3), triangles


def _read_header(data):
    """Give the byte order (None: text), the elements and the body."""
    data = data.removeprefix(b'\xef\xbb\xbf')
    if data.startswith((b'\xff\xfe', b'\xfe\xff')):
        data = as_text(data)
    begin = re.match(rb'ply[ \t]*(\r?\n|\r)', data)
    # In a binary file the body begins right behind the line, so its end has to be the right one.
    end = begin and re.compile(rb'[\r\n][ \t]*end_header[ \t]*(?:%b|$)' % (
        rb'\r' if begin[1] == b'\r' else rb'\r?\n')).search(data, 0, MOST_HEADER)
    if not end:
        raise ValueError('the file must begin with ply and have an end_header')
    order, elements = 'none', []
    for line in as_text(data[:end.start()]).decode('ascii', 'replace').split('\n')[1:]:
        match line.split():
            case [] | ['comment' | 'obj_info', *_]:
                pass
            case ['format', kind, _] if kind in ORDERS:
                order = ORDERS[kind]
            case ['element', name, count] if count.isdecimal() and int(count) <= len(data):
                elements.append((name, int(count), []))
            case ['property', 'list', size, kind, name] if (
                    elements and size in TYPES and kind in TYPES):
                elements[-1][2].append((name, TYPES[kind], TYPES[size]))
            case ['property', kind, name] if elements and kind in TYPES:
                elements[-1][2].append((name, TYPES[kind], None))
            case _:
                raise ValueError(f'the line {line[:80]!r} of the header cannot be')
    if order == 'none' or not all(properties or not count for _, count, properties in elements):
        raise ValueError('the header must have a format, and properties for each element')
    return order, elements, data[end.end():]


def _read_text(body, elements):
    """Give the columns of each element, and what comes after; a row a line, or else in a row."""
    refuse_underscores([body])
    lines = [words for words in map(bytes.split, as_text(body).split(b'\n')) if words]
    try:
        return _text_columns(lines, elements, by_line=True)
    except ValueError as error:
        try:
            return _text_columns([[*chain.from_iterable(lines)]], elements, by_line=False)
        except ValueError:
            raise error from None


def _text_columns(lines, elements, by_line):
    found, lines = [], iter(lines)
    words, k = ([] if by_line else next(lines, [])), 0
    for name, count, properties in elements:
        columns, sizes = [[] for _ in properties], [[] for _ in properties]
        for row in range(count):
            words, k = (next(lines, []), 0) if by_line else (words, k)
            for j, (_, kind, size) in enumerate(properties):
                many = 1
                if size is not None:
                    many, k = int(words[k]) if k < len(words) else 0, k + 1
                    sizes[j].append(many)
                if not 0 <= many <= len(words) - k:
                    raise ValueError(f'{name} {row}: the line ends too early')
                columns[j] += map(float if kind[0] == 'f' else int, words[k:k + many])
                k += many
        found.append({key: (sizes[j], columns[j]) if size is not None else np.array(columns[j])
                      for j, (key, _, size) in enumerate(properties)})
    rest = len(list(lines)) if by_line else len(words) - k
    return found, f'{rest} {"lines" if by_line else "numbers"}' if rest else ''


def _read_binary(body, elements, order):
    """Give the columns of each element, and what comes after."""
    found, place = [], 0
    for name, count, properties in elements:
        try:
            columns, place = _rows(body, place, order, count, properties)
        except (ValueError, IndexError):
            raise ValueError(f'element {name}: the file ends too early') from None
        found.append(columns)
    rest = len(body) - place
    return found, f'{rest} bytes' if rest else ''


def _rows(data, place, order, count, properties):
    """Read the rows of an element: all at once where all lists are as long as in the first."""
    first = _sizes_of_row(data, place, order, properties) if count else [0] * len(properties)
    fields = []
    for j, (_, kind, size) in enumerate(properties):
        fields += [] if size is None else [(f'size{j}', order + size)]
        fields.append((f'value{j}', order + kind, () if size is None else (first[j],)))
    dtype = np.dtype(fields)
    if dtype.itemsize * count > len(data) - place:
        return _row_by_row(data, place, order, count, properties)
    rows = np.frombuffer(data, dtype, count, place)
    if any(size is not None and (rows[f'size{j}'] != first[j]).any()
           for j, (_, _, size) in enumerate(properties)):
        return _row_by_row(data, place, order, count, properties)
    return {key: rows[f'value{j}'] if size is None else (
                np.full(count, first[j]), rows[f'value{j}'].ravel())
            for j, (key, _, size) in enumerate(properties)}, place + dtype.itemsize * count


def _sizes_of_row(data, place, order, properties):
    """Give the lengths of the lists of one row; 0 for a single number."""
    sizes = []
    for _, kind, size in properties:
        many = 1
        if size is not None:
            many = int(np.frombuffer(data, order + size, 1, place)[0])
            place += int(size[1])
            if not 0 <= many <= len(data):
                raise ValueError
        sizes.append(0 if size is None else many)
        place += many * int(kind[1])
    return sizes


def _row_by_row(data, place, order, count, properties):
    """Read the rows of an element with lists of different lengths."""
    columns, sizes = [[] for _ in properties], [[] for _ in properties]
    for _ in range(count):
        for j, many in enumerate(_sizes_of_row(data, place, order, properties)):
            _, kind, size = properties[j]
            if size is not None:
                sizes[j].append(many)
                place += int(size[1])
            many = 1 if size is None else many
            columns[j] += np.frombuffer(data, order + kind, many, place).tolist()
            place += many * int(kind[1])
    return {key: (sizes[j], columns[j]) if size is not None else np.array(columns[j])
            for j, (key, _, size) in enumerate(properties)}, place
