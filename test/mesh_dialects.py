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
Files of meshes as one program or another writes them: all the freedom that the formats leave.

`write(kind, random, vertices, faces)` draws one. Whoever reads it gets the mesh that it was.
"""

import re

import numpy as np
import small_meshes

ENDS = ('\n', '\r\n', '\r')
MARK = b'\xef\xbb\xbf'


def number(random, x):
    """Give a number in one of the ways that it is written; all digits are there."""
    text = repr(float(x))
    return str(random.choice([text, f'{x:.17e}', f'{x:.17E}', f'+{text}' if x >= 0.0 else text,
                              re.sub(r'^(-?)0\.', r'\1.', text)]))


def place(random, vertex):
    """Give three numbers with spaces between them."""
    return str(random.choice([' ', '  ', '\t'])).join(number(random, x) for x in vertex)


def some(random, chance=0.3):
    """Whether something is to be."""
    return random.random() < chance


def encoded(random, lines):
    """Give lines as bytes, with a mark or none and line ends of one system."""
    end = str(random.choice(ENDS))
    text = end.join('\n'.join(lines).split('\n')) + end * int(random.integers(0, 3))
    if some(random, 0.1):
        return text.encode('utf-16')
    return MARK * some(random) + text.encode()


def spread(random, lines):
    """Give lines with empty ones and comments between them."""
    for line in lines:
        if some(random, 0.1):
            yield str(random.choice(['', '   ', '# v 1 2 3', '#', '# f 1 2 3 end_header']))
        yield line + ('  # f 1 2 3' if some(random, 0.05) else ' ' * some(random, 0.1))


def obj(random, vertices, faces):
    """Give an OBJ file: corners with or without more, counted from the start or from the end."""
    form = str(random.choice(['%s', '%s/1', '%s//1', '%s/1/1', '%s/']))
    word = str(random.choice(['f', 'fo']))
    rows, written, waiting = [], 0, list(faces)
    for vertex in vertices:
        rows.append('v ' + place(random, vertex) + str(random.choice(['', ' 1.0', ' .5 .5 .5'])))
        written += 1
        while waiting and max(waiting[0]) < written and some(random, 0.5):
            rows.append(_obj_face(random, word, form, waiting.pop(0), written))
    rows += [_obj_face(random, word, form, face, written) for face in waiting]
    head = ['mtllib /dev/zero', 'o fo f', 'g vertex', 'vn 0 0 1', 'vt .5 .5', 's off', 'usemtl v']
    return encoded(random, [*spread(random, head + rows)])


def _obj_face(random, word, form, face, written):
    back = some(random, 0.5)
    corners = [form % (k - written if back else k + 1) for k in face]
    return f'{word} ' + (' \\\n ' if some(random, 0.1) else ' ').join(corners)


def off(random, vertices, faces):
    """Give an OFF file: with colours, normals or weights, a row a line or not."""
    head, more = [('OFF', 0), ('COFF', 4), ('COFF', 3), ('NOFF', 3), ('STOFF', 2),
                  ('CNOFF', 7), ('4OFF', 1)][random.integers(7)]
    counts = f'{len(vertices)} {len(faces)} {random.integers(0, 2)}'
    head = str(random.choice([f'{head}\n{counts}', f'{head}{counts}', f'{head} {counts}'])) \
        if not head.startswith('4') else f'{head}\n{counts}'
    rows = [f'{place(random, v)} {" ".join(["1"] * more)}' for v in vertices]
    if some(random):        # as it comes
        words = ' '.join(rows + [small_meshes.text([len(f), *f]) for f in faces]).split()
        cuts = np.sort(random.integers(0, len(words), len(words) // 3))
        return encoded(random, [head, *(' '.join(part) for part in np.split(words, cuts))])
    faces = [small_meshes.text([len(f), *f]) + str(random.choice(['', ' 255 0 0', ' 7']))
             for f in faces]
    return encoded(random, ['# OFF'] * some(random) + [head] + [*spread(random, rows + faces)])


def stl(random, vertices, faces):
    """Give an STL file, text or binary."""
    triangles = small_meshes.triangles(faces)
    if some(random, 0.4):
        data = bytearray(small_meshes.stl_binary(vertices, faces))
        data[:80] = str(random.choice(['solid facet', 'a mesh'])).encode().ljust(
            80, bytes([random.integers(0, 33)]))
        return bytes(data) + (b'\0' * int(random.integers(0, 60)) if some(random) else b'')
    facet, end = 'facet normal {} {} {}\n outer loop\n{}\n', '{0} loop\n{0} facet\n'
    end = end.format('end') if some(random) else end.format('end').replace('d ', 'd')
    rows, solids = [], np.array_split(triangles, random.integers(1, 3))
    for part in solids:
        name = str(random.choice(['', ' facet', ' a solid vertex 1 2 3', ' "x"']))
        rows.append('solid' + name)
        for t in part:
            corners = '\n'.join('  vertex ' + place(random, vertices[k]) for k in t)
            rows.append(facet.format(*random.choice(['0', 'nan', '-1.0'], 3), corners) + end)
        rows.append(str(random.choice(['endsolid', 'end solid'])) + name)
    text = encoded(random, rows)
    return text.upper() if some(random) and b'\0' not in text else text


def ply(random, vertices, faces):
    """Give a PLY file, text or binary, with more properties and elements than are needed."""
    kind = str(random.choice(['ascii', 'binary_little_endian', 'binary_big_endian']))
    order = '>' if 'big' in kind else '<'
    size, index = random.choice(['uchar', 'int', 'uint8']), random.choice(['int', 'uint32'])
    name = str(random.choice(['vertex_index', 'vertex_indices']))
    red, edge, strips = some(random), some(random), some(random)
    end = str(random.choice(ENDS))
    head = [
        'ply', f'format {kind} 1.0', 'comment end_header', 'obj_info ply', *[''] * some(random),
        f'element vertex {len(vertices)}', *['property uchar red'] * red,
        *(f'property double {axis}' for axis in 'xyz'),
        *['element edge 1', 'property short a', 'property list uchar float b'] * edge]
    triangles = small_meshes.triangles(faces)
    chain = [k for t in triangles for k in (*t, -1)]
    head += ['element tristrips 1', 'property list int int vertex_indices'] if strips else [
        f'element face {len(faces)}', f'property list {size} {index} {name}',
        *['property list uchar uchar flags'] * red]
    body = [([7] if red else [], v) for v in vertices]
    if kind == 'ascii':
        rows = [' '.join([*map(str, first), place(random, v)]) for first, v in body]
        rows += ['1 2 3.5 -4'] * edge
        rows += [small_meshes.text([len(chain), *chain])] if strips else [
            small_meshes.text([len(f), *f]) + ' 2 0 0' * red for f in faces]
        rows = [row for each in rows for row in ([''] if some(random, 0.1) else []) + [each]]
        if some(random):
            rows = [row.replace(' ', end, int(random.integers(0, 2))) for row in rows]
        return MARK * some(random) + end.join([*head, 'end_header', *rows, '']).encode()
    data = b''.join(bytes(first) + np.array(v, f'{order}f8').tobytes() for first, v in body)
    if edge:
        data += np.array([1], f'{order}i2').tobytes() + b'\2' + np.array(
            [3.5, -4.0], f'{order}f4').tobytes()
    if strips:
        data += np.array([len(chain), *chain], f'{order}i4').tobytes()
    else:
        lengths = f'{order}i4' if size == 'int' else 'u1'
        data += b''.join(
            np.array([len(f)], lengths).tobytes() + np.array(f, f'{order}i4').tobytes()
            + b'\2\0\0' * red for f in faces)
    return MARK * some(random) + end.join([*head, 'end_header', '']).encode() + data


def rib(random, vertices, faces):
    """Give a RIB file, with strings that hold anything."""
    text = small_meshes.text
    rows = [
        '##RenderMan RIB', 'Display "a \\"b\\" # [" "file" "rgb"', 'Attribute "x" "y" ["1\n2 ["]',
        'Option "path" "C:\\\\"', 'WorldBegin', 'Surface "Polygon \\\\\\" [" # "P" [',
        f'PointsPolygons [{text([len(f) for f in faces])}]',
        f'[{text([k for f in faces for k in f])}]',
        f'"vertex point P" [{" ".join(place(random, v) for v in vertices)}]', 'WorldEnd']
    return encoded(random, rows)


WRITERS = {'obj': obj, 'off': off, 'stl': stl, 'ply': ply, 'rib': rib}
