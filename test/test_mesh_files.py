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


"""Meshes from files and mappings: what is read, what is mended, what is refused and how."""

import os
import pickle

from collision_sim import Scene, SceneError
from collision_sim.checks import SceneWarning
from collision_sim.core import polygons
from collision_sim.mesh_files import read_polygons
from numba import config
import numpy as np
import pytest
import small_meshes
from small_meshes import FILES

TETRAHEDRON = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
SIDES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]


def collider(directory='.', **keys):
    """Read a scene with one mesh, and give the collider."""
    scene = {'colliders': [{'name': 'bunny', 'shape': 'mesh', **keys}]}
    return Scene.from_dict(scene, directory).colliders[0]


def mesh(vertices, faces, **keys):
    """Read a mesh from a mapping."""
    return collider(vertices=vertices, faces=faces, **keys).mesh


def volume(found):
    """Volume of a closed mesh [m^3], by the divergence theorem."""
    return np.linalg.det(found.vertices[found.faces]).sum() / 6.0


def area(found):
    """Area of a mesh [m^2]."""
    a, b, c = found.vertices[found.faces].transpose(1, 0, 2)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def refusal(*words, **keys):
    """Check that a mesh is refused with these words."""
    directory = keys.pop('directory', '.')
    with pytest.raises(SceneError) as caught:
        collider(directory, **keys)
    for word in words:
        assert word in str(caught.value), str(caught.value)
    assert caught.value.key.startswith('colliders.bunny')


def write(directory, name, content):
    """Write a file and give its name."""
    (directory / name).write_bytes(content)
    return name


@pytest.mark.parametrize('name', FILES)
@pytest.mark.parametrize('shape', ['box', 'torus'])
def test_each_format_gives_the_same_mesh(tmp_path, name, shape):
    vertices, faces = getattr(small_meshes, shape)()
    write(tmp_path, name, FILES[name](vertices, faces))
    found = collider(tmp_path, file=name, scale=2.0).mesh
    assert found.closed and len(found.vertices) == len(vertices)
    assert len(found.faces) == len(small_meshes.triangles(faces))
    same = mesh(2.0 * vertices, faces)
    assert volume(found) == pytest.approx(volume(same), rel=1e-6 if name == 'a.STL' else 1e-14)


def test_the_mesh_goes_through_pickle_and_cannot_be_written_to():
    found = pickle.loads(pickle.dumps(mesh(TETRAHEDRON, SIDES)))
    assert found.closed and np.array_equal(found.faces, SIDES)
    with pytest.raises(ValueError):
        mesh(TETRAHEDRON, SIDES).vertices[0] = 0.0


def test_polygons_that_are_not_convex_are_cut_inside_themselves():
    shape = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 2, 0], [1, 1, 0], [0, 1, 0]]
    for k in range(6):
        assert area(mesh(np.roll(shape, k, axis=0), [list(range(6))])) == pytest.approx(3.0)
    star = [[r * np.sin(a), r * np.cos(a), a] for k in range(10)
            for r, a in [(1.0 if k % 2 else 0.3, np.pi * k / 5.0)]]
    flat = np.array(star) * [1, 1, 0]
    assert area(mesh(flat, [list(range(10))])) == pytest.approx(1.5 * np.sin(np.pi / 5.0))


def test_a_corner_on_a_straight_edge_of_a_polygon_is_kept():
    square = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]
    found = mesh(square, [[0, 1, 2, 3, 4]])
    assert area(found) == pytest.approx(4.0) and len(found.vertices) == 5


def test_equal_vertices_are_merged_and_minus_zero_is_zero():
    corners = np.array(TETRAHEDRON)[np.ravel(SIDES)]
    corners[::2] = np.where(corners[::2] == 0.0, -0.0, corners[::2])
    found = mesh(corners, np.arange(12).reshape(4, 3))
    assert found.closed and len(found.vertices) == 4


@pytest.mark.parametrize('flips', [(0, 1, 2, 3), (2,), (0, 3)])
def test_closed_meshes_are_turned_outward(flips):
    faces = [face[::-1] if k in flips else face for k, face in enumerate(SIDES)]
    found = mesh(TETRAHEDRON, faces)
    assert found.closed and volume(found) == pytest.approx(1.0 / 6.0)


def test_parts_are_turned_one_by_one_and_cavities_are_left():
    vertices, faces = small_meshes.box()
    back = [[k + 8 for k in face[::-1]] for face in faces]
    apart = mesh(np.concatenate([vertices, vertices + 3.0]), faces + back)
    assert apart.closed and volume(apart) == pytest.approx(2.0)
    hollow = mesh(np.concatenate([vertices, 0.5 * vertices]), faces + back)
    assert hollow.closed and volume(hollow) == pytest.approx(1.0 - 0.125)


def test_what_does_not_close_is_open():
    assert not mesh(TETRAHEDRON, SIDES[:3]).closed
    assert not mesh(TETRAHEDRON, [*SIDES[:3], SIDES[0][::-1]]).closed   # a face twice
    fin = mesh([*TETRAHEDRON, [1, 1, 1]], [*SIDES, [0, 1, 4]])          # an edge with three faces
    assert not fin.closed and len(fin.faces) == 5
    strip = [[np.cos(a) * (2 + w * np.cos(a / 2)), np.sin(a) * (2 + w * np.cos(a / 2)),
              w * np.sin(a / 2)] for a in np.linspace(0, 2 * np.pi, 9)[:-1] for w in (-0.5, 0.5)]
    moebius = [[2 * k, (2 * k + 2) % 16, 2 * k + 1] for k in range(7)] + [
        [2 * k + 2, 2 * k + 3, 2 * k + 1] for k in range(7)] + [[14, 1, 15], [1, 0, 15]]
    assert not mesh(strip, moebius).closed


def test_errors_name_key_and_element():
    refusal('file, or vertices and faces')
    refusal('.vertices', 'missing', faces=SIDES)
    refusal('.faces', 'missing', vertices=TETRAHEDRON)
    refusal('faces[1]', vertices=TETRAHEDRON, faces=[[0, 1, 2], [0, 1, 0.5]])
    refusal('face 1: corner 9 is out of range (4 vertices', vertices=TETRAHEDRON,
            faces=[[0, 1, 2], [0, 1, 9]])
    refusal('face 0: corner -1', vertices=TETRAHEDRON, faces=[[0, 1, -1]])
    refusal('at least one face with an area', vertices=[[0, 0, 0], [1, 1, 1], [3, 3, 3]],
            faces=[[0, 1, 2]])
    refusal('face 1 must have at least 3 corners', vertices=TETRAHEDRON, faces=[[0, 1, 2], [0]])
    refusal('vertices[2]', 'finite', vertices=[*TETRAHEDRON[:2], [0, np.nan, 0]],
            faces=[[0, 1, 2]])
    refusal('vertex 1 ', '1e+30', vertices=[[0, 0, 0], [1e200, 0, 0], [0, 1, 0]],
            faces=[[0, 1, 2]])
    refusal('at least one face', vertices=TETRAHEDRON, faces=[])
    refusal('crosses itself', vertices=[[0, 0, 0], [2, 2, 0], [3, 0, 0], [0, 1, 0]],
            faces=[[0, 1, 2, 3]])
    refusal('must be closed', vertices=TETRAHEDRON, faces=SIDES[:3], inside=True)
    refusal('scale', 'above 0', vertices=TETRAHEDRON, faces=SIDES, scale=0)
    refusal('radius', 'unknown key', vertices=TETRAHEDRON, faces=SIDES, radius=1)


def test_faces_without_area_are_left_out_and_counted():
    """A collinear triangle between two others gives its corner to one: the body stays closed."""
    with pytest.warns(SceneWarning, match='2 faces without area are left out; the first is 4'):
        found = mesh(TETRAHEDRON, [*SIDES, [0, 1, 1], [2, 2, 2]])
    assert found.closed and len(found.faces) == 4
    vertices, faces = small_meshes.box()
    middle = [[0.0, -0.5, -0.5], [0.25, -0.5, -0.5]]      # on the edge from 0 to 4
    split = [[0, 4, 5, 1], [0, 8, 9, 4], [0, 2, 6, 4, 9, 8], *faces[:2], faces[3], faces[5]]
    with pytest.warns(SceneWarning, match='1 faces without area are left out; the first is 1'):
        found = mesh([*vertices, *middle], split)
    assert found.closed and volume(found) == pytest.approx(1.0) and len(found.vertices) == 10


@pytest.mark.parametrize('seed', range(10))
def test_needles_along_edges_open_no_gap(seed):
    """Edges of a solid get corners that only needles know of, as CAD programs write them."""
    random = np.random.default_rng(seed)
    vertices, faces = small_meshes.torus(5)
    vertices, faces = list(vertices), small_meshes.triangles(faces).tolist()
    for t in random.permutation(len(faces))[:20]:
        a, b, _ = corners = faces[t]
        cuts = np.sort(random.choice(8, 2, replace=False) + 1) / 9.0
        new = [len(vertices), len(vertices) + 1]
        vertices += [vertices[a] + share * (vertices[b] - vertices[a]) for share in cuts]
        faces[t] = [a, *new, *corners[1:]]
        needles = [[a, b, new[0]], [new[0], b, new[1]]]
        faces += [list(np.roll(needle, random.integers(3))) for needle in needles]
    random.shuffle(faces)
    with pytest.warns(SceneWarning, match='40 faces without area'):
        found = mesh(vertices, [[int(k) for k in face] for face in faces])
    solid = mesh(*small_meshes.torus(5))
    assert found.closed and volume(found) == pytest.approx(volume(solid), rel=1e-12)


def test_polygons_that_are_not_flat_are_cut_and_said_so():
    bent = [[0, 0, 0], [1, 0, 0.5], [1, 1, 0], [0, 1, 0.5]]
    with pytest.warns(SceneWarning, match='1 faces that are not flat to 0.001 .* first is 0'):
        found = mesh(bent, [[0, 1, 2, 3]])
    assert found.faces.tolist() == [[0, 1, 2], [0, 2, 3]]       # the diagonal others take, too


KEYHOLE = [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0], [1, 1], [1, 3], [3, 3], [3, 1], [1, 1]]
TOUCHING = {
    'a hole, joined by an edge there and back': (KEYHOLE, 12.0),
    'two parts that share a corner': ([[0, 0], [1, 1], [2, 0], [2, 2], [1, 1], [0, 2]], 2.0),
    'a corner on another edge': ([[0, 0], [4, 0], [4, 4], [2, 0], [0, 4]], 8.0),
    'there and back along an edge': ([[0, 0], [4, 0], [6, 0], [4, 0], [4, 4], [0, 4]], 16.0),
    'the same corner twice': ([[0, 0], [4, 0], [4, 0], [4, 4], [0, 4]], 16.0),
    'a slit': ([[0, 0], [2, 0], [2, 2], [2, 0], [4, 0], [4, 4], [0, 4]], 16.0),
}


@pytest.mark.parametrize('name', TOUCHING)
@pytest.mark.parametrize('back', [False, True])
def test_polygons_that_touch_themselves_are_cut(name, back):
    ring, exact = TOUCHING[name]
    ring = np.array(ring[::-1] if back else ring, dtype=float)
    turn = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    for k in range(len(ring)):
        corners = np.roll(np.insert(ring, 2, 1.0, axis=1) @ turn, k, axis=0)
        assert area(mesh(corners, [list(range(len(ring)))])) == pytest.approx(exact), (name, k)


def spirals(count, size):
    """Give an OBJ file of polygons wound in spirals, and the area of each."""
    along = np.linspace(0.0, 12.0 * np.pi, size // 2)
    arms = [np.stack([r * np.cos(along), r * np.sin(along)], axis=1)
            for r in (1.0 + along, 3.0 + along)]
    ring = np.concatenate([arms[0], arms[1][::-1]])
    x, y = ring.T
    exact = 0.5 * abs((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
    rows = [f'v {x!r} {y!r} {k}' for k in range(count) for x, y in ring.tolist()]
    rows += ['f ' + ' '.join(map(str, range(k * len(ring) + 1, (k + 1) * len(ring) + 1)))
             for k in range(count)]
    return '\n'.join(rows).encode(), exact


@pytest.mark.skipif(not config.DISABLE_JIT, reason='counts calls of what is else compiled')
def test_each_corner_of_a_long_polygon_is_looked_at_some_three_times(tmp_path, monkeypatch):
    content, exact = spirals(1, 98)
    write(tmp_path, 'a.obj', content)
    looks, look = [], polygons._is_ear
    monkeypatch.setattr(polygons, '_is_ear', lambda *args: looks.append(1) or look(*args))
    assert area(collider(tmp_path, file='a.obj').mesh) == pytest.approx(exact)
    assert len(looks) < 3 * 98


@pytest.mark.jit
def test_long_polygons_are_cut_in_slices_between_which_signals_are_heard(tmp_path, monkeypatch):
    """200 spirals of 998 corners, 800 kB, took minutes in one call."""
    content, exact = spirals(200, 998)
    write(tmp_path, 'a.obj', content)
    calls, some = [], polygons._cut_some
    monkeypatch.setattr(polygons, '_cut_some', lambda *args: calls.append(1) or some(*args))
    assert area(collider(tmp_path, file='a.obj').mesh) == pytest.approx(200.0 * exact)
    assert len(calls) > 10


@pytest.mark.skipif(not config.DISABLE_JIT, reason='compiled code keeps its budget')
def test_a_polygon_may_take_several_slices(tmp_path, monkeypatch):
    content, exact = spirals(3, 60)
    write(tmp_path, 'a.obj', content)
    calls, some = [], polygons._cut_some
    monkeypatch.setattr(polygons, '_cut_some', lambda *args: calls.append(1) or some(*args))
    monkeypatch.setattr(polygons, 'BUDGET', 500)
    assert area(collider(tmp_path, file='a.obj').mesh) == pytest.approx(3.0 * exact)
    assert len(calls) > 10


@pytest.mark.parametrize('method', ['second_order_contact', 'exact'])
def test_methods_that_need_smooth_surfaces_are_refused(method):
    scene = {'colliders': [{'name': 'bunny', 'shape': 'mesh', 'vertices': TETRAHEDRON,
                            'faces': SIDES}], 'stepping': {'method': method}}
    with pytest.raises(SceneError, match='stepping.method.*collision_then_contact.*bunny'):
        Scene.from_dict(scene)


@pytest.mark.parametrize('name, content, words', [
    ('none', None, 'no such file'),
    ('a.xyz', b'', '.obj, .off, .ply, .rib, .stl'),
    ('a.obj', b' \n', 'empty'),
    ('a.obj', b'v 0 0 0\nv 1 0 0\n', 'at least one face'),
    ('a.obj', b'v 0 0 0\nv 1 0 x\n', "line 2: could not convert string to float: b'x'"),
    ('a.obj', b'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n', 'face 0: corner 8 is out of range'),
    ('a.obj', b'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n', 'line 4: vertices are counted from 1'),
    ('a.obj', b'v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n', 'vertex 2 must be 3 finite numbers'),
    ('a.off', b'OFF\n1000000000000 1 0\n0 0 0\n', 'do not fit into the file'),
    ('a.off', b'OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n', 'ends too early'),
    ('a.off', b'OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n', 'line 6'),
    ('a.stl', b'solid\nfacet\nvertex 0 0 0\n', 'ends too early'),
    ('a.stl', b'\0' * 83 + b'\xff' * 60, 'no text'),
    ('a.ply', b'ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float x\nend_header\n',
     'of the header cannot be'),
    ('a.ply', b'ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\n'
     b'end_header\n3 0 1 2\n', 'vertices and faces'),
    ('a.rib', b'WorldBegin\nSphere 1 -1 1 360\nWorldEnd\n', 'line 2: Sphere'),
    ('a.rib', b'ReadArchive "/etc/passwd"', 'ReadArchive'),
    ('a.rib', b'Polygon "P" [0 0 0 1 0 0 0 1 0', 'within brackets'),
    ('a.rib', b'Polygon "P" [[[[[0 0 0]]]]]', 'nested'),
    ('a.rib', b'TransformBegin ' * 2000, 'blocks within blocks'),
    ('a.rib', b'Translate 1 2\nPolygon "P" [0 0 0 1 0 0 0 1 0]', 'Translate must have 3'),
    ('a.rib', b'PointsGeneralPolygons [2] [3 3] [0 1 2 0 1 2] "P" [0 0 0 1 0 0 0 1 0]', 'holes'),
])
def test_broken_files_are_refused_with_the_place(tmp_path, name, content, words):
    name = name if content is not None else 'none.obj'
    if content is not None:
        write(tmp_path, name, content)
    refusal('.file', words, directory=tmp_path, file=name)


@pytest.mark.parametrize('name', FILES)
def test_a_file_cut_short_anywhere_is_refused(tmp_path, name):
    content = FILES[name](*small_meshes.box())
    for size in range(0, len(content) - 12, 37):
        write(tmp_path, name, content[:size])
        try:
            found = collider(tmp_path, file=name).mesh
        except SceneError as error:
            assert error.key == 'colliders.bunny.file'
        else:   # lines of a text may end where they end
            assert name in ('a.obj', 'text.stl') and len(found.faces) < 12


@pytest.mark.parametrize('name', FILES)
def test_mutated_bytes_are_read_or_refused(tmp_path, name):
    content = FILES[name](*small_meshes.box())
    random = np.random.default_rng(7)
    for _ in range(300):
        data = np.frombuffer(content, dtype=np.uint8).copy()
        for place in random.integers(0, len(data), random.integers(1, 8)):
            data[place] = random.choice([random.integers(256), *b'0 -9e.\n[]"', 255])
        cut = random.integers(0, len(data), 2)
        data = np.delete(data, slice(*cut)) if random.random() < 0.2 else data
        write(tmp_path, name, data.tobytes())
        try:
            found = collider(tmp_path, file=name).mesh
        except SceneError as error:
            assert error.key == 'colliders.bunny.file'
        else:
            assert np.isfinite(found.vertices).all()
            assert found.faces.max() < len(found.vertices) and found.faces.min() >= 0


def test_garbage_is_refused(tmp_path):
    random = np.random.default_rng(8)
    for name in ('a.obj', 'a.off', 'a.ply', 'a.rib', 'a.stl'):
        for size in (1, 100, 100_000):
            write(tmp_path, name, random.bytes(size))
            refusal('.file', directory=tmp_path, file=name)


@pytest.mark.parametrize('name, content, said', [
    ('a.obj', b'l 1 2\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nsurf 1\n',
     "2 lines that are no vertices or faces are left out; the first is line 1, 'l'"),
    ('a.obj', b'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 3 2 1\n', '1 triangles with the corners'),
    ('a.obj', b'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2\n', '1 faces without area'),
    ('a.off', b'OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 1 2\n', '1 lines after the last'),
    ('a.ply', b'ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n'
     b'property float z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n'
     b'0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 1 2\n', '1 lines after the last element'),
    ('a.stl', small_meshes.stl_binary(*small_meshes.box()) + b'more', '4 bytes after the last'),
])
def test_what_is_left_out_is_said(tmp_path, name, content, said):
    write(tmp_path, name, content)
    with pytest.warns(SceneWarning) as caught:
        collider(tmp_path, file=name)
    message, = (str(each.message) for each in caught)
    assert message.startswith(f'colliders.bunny.file: {name!r}: {said}')


@pytest.mark.parametrize('kind', ['obj', 'off', 'ply', 'rib', 'stl'])
def test_pipes_devices_and_folders_are_refused_at_once(tmp_path, kind):
    os.mkfifo(tmp_path / f'pipe.{kind}')
    (tmp_path / f'device.{kind}').symlink_to('/dev/zero')
    (tmp_path / f'folder.{kind}').mkdir()
    for name in ('pipe', 'device', 'folder'):
        refusal('no such file', directory=tmp_path, file=f'{name}.{kind}')


def test_rib_transformations_and_unknown_requests(tmp_path):
    write(tmp_path, 'a.rib', b"""
        version 3.03 Option "limits" "bucketsize" [32 32]
        Translate 0 0 5                     # of the camera
        WorldBegin
          LightSource "distantlight" 1 "from" [0 0 1]
          AttributeBegin
            Translate 1 2 3
            TransformBegin
              Rotate 90 0 0 1 Scale 2 2 2
              ConcatTransform [1 0 0 0  0 1 0 0  0 0 1 0  0 0 1 1]
              Polygon "vertex point P" [0 0 0  1 0 0  0 1 0] "Cs" [1 1 1 1 1 1 1 1 1]
            TransformEnd
            PointsGeneralPolygons [1] [3] [0 1 2] "P" [0 0 0  1 0 0  0 1 0]
          AttributeEnd
        WorldEnd""")
    found = collider(tmp_path, file='a.rib').mesh
    places = {tuple(np.round(v, 12) + 0.0) for v in found.vertices}
    assert places == {(1, 2, 5), (1, 4, 5), (-1, 2, 5), (1, 2, 3), (2, 2, 3), (1, 3, 3)}


def test_references_out_of_a_file_are_not_followed(tmp_path):
    content = small_meshes.obj(TETRAHEDRON, SIDES)
    write(tmp_path, 'a.obj', b'mtllib /dev/zero\nusemtl x\n' + content)
    assert collider(tmp_path, file='a.obj').mesh.closed
    refusal('no such file', directory=tmp_path, file='../' + tmp_path.name + '/none.obj')
    (tmp_path / 'folder.obj').mkdir()
    refusal('no such file', directory=tmp_path, file='folder.obj')


def test_polygons_of_a_file_keep_their_numbers(tmp_path):
    vertices, faces = small_meshes.box()
    write(tmp_path, 'a.obj', small_meshes.obj(vertices, faces))
    found, corners, sizes = read_polygons('a.obj', 'file', tmp_path)
    assert np.array_equal(found, vertices) and sizes.tolist() == 6 * [4]
    assert corners.reshape(-1, 4).tolist() == faces


@pytest.mark.jit
def test_a_million_triangles_load(tmp_path):
    count = 708
    vertices, faces = small_meshes.grid(count, 1.0)
    vertices[:, 2] = 0.1 * np.sin(5.0 * vertices[:, 0])
    corners = small_meshes.triangles(faces)
    found = mesh(vertices, corners)
    assert len(found.faces) == 2 * count ** 2 > 1_000_000 and not found.closed
