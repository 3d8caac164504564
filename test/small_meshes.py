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


"""Small meshes for the tests, as (V, 3) vertices and lists of faces, and files of them."""

from itertools import product

import numpy as np


def grid(count=4, half=2.0, height=0.0):
    """Give a flat floor of quads, count x count, from -half to half."""
    ticks = np.linspace(-half, half, count + 1)
    vertices = np.array([[x, y, height] for x, y in product(ticks, ticks)])
    row = count + 1
    faces = [[a, a + row, a + row + 1, a + 1] for i, j in product(range(count), range(count))
             for a in [i * row + j]]
    return vertices, faces


def box(size=(1.0, 1.0, 1.0)):
    """Give a box of quads."""
    vertices = np.array(list(product((-0.5, 0.5), repeat=3))) * size
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return vertices, faces


def sphere(level, radius=1.0):
    """Give an icosahedron whose triangles are divided in four, level times."""
    golden = 0.5 * (1.0 + 5.0 ** 0.5)
    vertices = [[0, -1, golden], [0, 1, golden], [0, -1, -golden], [0, 1, -golden]]
    vertices = [np.roll(v, k) for k in range(3) for v in vertices]
    vertices = np.array(vertices) / np.hypot(1.0, golden)
    near = np.linalg.norm(vertices[:, None] - vertices, axis=2) < 1.2
    faces = [list(f) for f in product(range(12), repeat=3) if f[0] < min(f[1], f[2])
             and all(near[f[i], f[j]] for i, j in ((0, 1), (1, 2), (2, 0))) and len(set(f)) == 3
             and np.linalg.det(vertices[list(f)]) > 0.0]
    for _ in range(level):
        vertices, faces = _divided(vertices, np.array(faces))
    return radius * vertices, faces


def _divided(vertices, faces):
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, numbers = np.unique(edges, axis=0, return_inverse=True)
    middles = vertices[edges].sum(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    (a, b, c), (ab, bc, ca) = faces.T, numbers.reshape(-1, 3).T + len(vertices)
    faces = np.concatenate([np.stack(f, axis=1) for f in (
        (a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return np.concatenate([vertices, middles]), faces.tolist()


def torus(count=20, major=1.0, minor=0.4):
    """Give a torus about z of count x count quads."""
    u, v = np.meshgrid(*2 * [2.0 * np.pi * np.arange(count) / count], indexing='ij')
    rho = major + minor * np.cos(v)
    vertices = np.stack([rho * np.cos(u), rho * np.sin(u), minor * np.sin(v)], axis=2)
    number = np.arange(count * count).reshape(count, count)
    on, up = np.roll(number, -1, axis=0), np.roll(number, -1, axis=1)
    faces = np.stack([number, on, np.roll(on, -1, axis=1), up], axis=2).reshape(-1, 4)
    return vertices.reshape(-1, 3), faces.tolist()


def tetrahedron(size=1.0):
    """Give a tetrahedron in a cube of this size."""
    vertices = 0.5 * size * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    return vertices, [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]


def coil(turns, count=24, rise=0.07):
    """Give a rod of 0.2 m square, bent to a circle of 1 m; beyond one turn it overlaps itself."""
    around, up = np.array([-0.1, 0.1, 0.1, -0.1]), np.array([-0.1, -0.1, 0.1, 0.1])
    way = np.linspace(0.0, 1.0, count + 1)[:, None]
    angle = 2.0 * np.pi * turns * way
    vertices = np.stack([(1.0 + around) * np.cos(angle), (1.0 + around) * np.sin(angle),
                         up + rise * way], axis=2).reshape(-1, 3)
    faces = [[3, 2, 1, 0], [4 * count + k for k in range(4)]]
    for i, k in product(range(count), range(4)):
        a, b = 4 * i + k, 4 * i + (k + 1) % 4
        faces += [[b, b + 4, a + 4], [a, b, a + 4]]
    return vertices, faces


def placed(shape, at=(0.0, 0.0, 0.0), turn=None):
    """Move a mesh and then turn it about the origin."""
    vertices = shape[0] + np.asarray(at)
    return (vertices if turn is None else vertices @ turn.T), shape[1]


def joined(*shapes):
    """Give one mesh of several, their corners listed one after the other."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in shapes)]).tolist()
    return (np.concatenate([vertices for vertices, _ in shapes]),
            [[k + start for k in face] for (_, faces), start in zip(shapes, starts)
             for face in faces])


def a_turn(seed):
    """Give a random rotation matrix."""
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return turn * np.linalg.det(turn)


def triangles(faces):
    """Cut convex faces into triangles, (T, 3)."""
    return np.array([[f[0], f[k], f[k + 1]] for f in faces for k in range(1, len(f) - 1)])


def _planes(shape):
    """Find normals (F, 3) and distances (F,) of the planes of a convex mesh."""
    a, b, c = np.moveaxis(shape[0][triangles(shape[1])], 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals, (normals * a).sum(axis=1)


def random_union(seed):
    """Give 2 to 8 boxes, round and pointed parts: tilted each by itself, or on a tilted grid."""
    random = np.random.default_rng(seed)
    on_grid, turn, parts = seed % 2 == 0, a_turn(seed), []
    for _ in range(random.integers(2, 9)):
        kind = random.integers(1 if on_grid and seed % 3 else 3)
        part = (box(random.choice([0.5, 1.0, 1.5], 3) if on_grid else random.uniform(0.3, 1.5, 3)),
                sphere(random.integers(3), random.uniform(0.3, 0.8)),
                tetrahedron())[kind]
        at = random.uniform(-0.8, 0.8, 3)
        parts.append(placed(part, np.round(4.0 * at) / 4.0, turn) if on_grid else placed(
            placed(part, turn=a_turn(random.integers(1000))), at))
    return parts


def height_in_union(parts, points):
    """Height (N,) [m] over the nearest plane of that part that a point is deepest in."""
    heights = [((points @ normals.T) - offsets).max(axis=1)
               for normals, offsets in (_planes(part) for part in parts)]
    return np.min(heights, axis=0)


def text(numbers):
    """Give numbers as words that hold all their digits."""
    return ' '.join(repr(x) for x in np.asarray(numbers).ravel().tolist())


def obj(vertices, faces):
    """Give the bytes of an OBJ file."""
    lines = [f'v {text(v)}' for v in vertices]
    lines += ['f ' + ' '.join(f'{k + 1}/{k + 1}' for k in f) for f in faces]
    return ('# a mesh\nmtllib none.mtl\no mesh\n' + '\n'.join(lines) + '\n').encode()


def off(vertices, faces):
    """Give the bytes of an OFF file."""
    lines = [text(v) for v in vertices] + [f'{len(f)} {text(f)}' for f in faces]
    return (f'OFF # a mesh\n{len(vertices)} {len(faces)} 0\n' + '\n'.join(lines)).encode()


def stl_text(vertices, faces):
    """Give the bytes of a text STL file."""
    facets = ''.join('facet normal 0 0 0\nouter loop\n' + ''.join(
        f'vertex {text(vertices[k])}\n' for k in f) + 'endloop\nendfacet\n'
        for f in triangles(faces))
    return f'solid mesh\n{facets}endsolid mesh\n'.encode()


def stl_binary(vertices, faces):
    """Give the bytes of a binary STL file; it holds single precision."""
    corners = np.asarray(vertices)[triangles(faces)]
    facets = np.zeros(len(corners), [('normal', '<f4', 3), ('corners', '<f4', (3, 3)),
                                     ('rest', '<u2')])
    facets['corners'] = corners
    return b'mesh'.ljust(80) + len(facets).to_bytes(4, 'little') + facets.tobytes()


def _ply_header(kind, vertices, faces):
    return (f'ply\nformat {kind} 1.0\ncomment a mesh\nelement vertex {len(vertices)}\n'
            'property double x\nproperty double y\nproperty double z\nproperty uchar red\n'
            f'element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n'
            ).encode()


def ply_text(vertices, faces):
    """Give the bytes of a text PLY file."""
    lines = [f'{text(v)} 7' for v in vertices] + [f'{len(f)} {text(f)}' for f in faces]
    return _ply_header('ascii', vertices, faces) + '\n'.join(lines).encode()


def ply_binary(vertices, faces, order='<'):
    """Give the bytes of a binary PLY file."""
    kind = {'<': 'binary_little_endian', '>': 'binary_big_endian'}[order]
    rows = np.zeros(len(vertices), [('xyz', order + 'f8', 3), ('red', 'u1')])
    rows['xyz'] = vertices
    body = [bytes([len(f)]) + np.array(f, order + 'i4').tobytes() for f in faces]
    return _ply_header(kind, vertices, faces) + rows.tobytes() + b''.join(body)


def rib(vertices, faces):
    """Give the bytes of a RIB file."""
    return (f'##RenderMan RIB\nDisplay "a.tif" "file" "rgb" # [\nWorldBegin\nColor [1 0 0]\n'
            f'PointsPolygons [{text([len(f) for f in faces])}]\n'
            f'[{text([k for f in faces for k in f])}]\n"P" [{text(vertices)}]\n'
            'WorldEnd\n').encode()


FILES = {'a.obj': obj, 'a.off': off, 'text.stl': stl_text, 'a.STL': stl_binary,
         'text.ply': ply_text, 'a.ply': ply_binary,
         'big.ply': lambda *mesh: ply_binary(*mesh, order='>'), 'a.rib': rib}
