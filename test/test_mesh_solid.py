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

"""Meshes of several parts: which are closed, and what solid they are."""

from collision_sim.mesh_surface import make_mesh
import numpy as np
import pytest
import small_meshes
from small_meshes import a_turn, box, joined, placed

turned = pytest.mark.parametrize('turn', [None, a_turn(1), a_turn(2)], ids=['straight', '1', '2'])


def made(shape):
    """Make a mesh of (vertices, faces)."""
    vertices, faces = shape
    return make_mesh(np.asarray(vertices, dtype=float), np.concatenate(faces).astype(np.int64),
                     np.array([len(face) for face in faces]), 'mesh', None)


def volume_and_area(mesh):
    """Volume [m^3] and area [m^2] of a closed mesh."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    return (a * cross).sum() / 6.0, 0.5 * np.sqrt(np.square(cross).sum(axis=1)).sum()


def inverted(shape):
    """Turn all faces of a mesh the other way round."""
    return shape[0], [face[::-1] for face in shape[1]]


def half(at=(0.0, 0.0, 0.0)):
    """Give a cube of half a metre."""
    return placed(box((0.5, 0.5, 0.5)), at)


def brick(i, j, k=0):
    """Give a brick of a running bond."""
    return placed(box((2.0, 1.0, 1.0)), (2 * i + j % 2, j, k))


CUBE = box()
SOLIDS = {      # parts, volume, area
    'side by side': ([CUBE, placed(CUBE, (1, 0, 0))], 2, 10),
    'shifted by a third': ([CUBE, placed(CUBE, (1, 1 / 3, 0))], 2, 12 - 4 / 3),
    'a small one on a large one': ([CUBE, half((0.75, 0.1, 0.05))], 1.125, 7),
    'a small one in a corner of the face': ([CUBE, half((0.75, 0.25, 0.25))], 1.125, 7),
    'a common edge': ([CUBE, placed(CUBE, (1, 1, 0))], 2, 12),
    'part of a common edge': ([CUBE, placed(CUBE, (1, 1, 0.3))], 2, 12),
    'a common corner': ([CUBE, placed(CUBE, (1, 1, 1))], 2, 12),
    'overlapping': ([CUBE, placed(CUBE, (0.5, 0.5, 0.5))], 1.875, 10.5),
    'overlapping flush': ([CUBE, placed(CUBE, (0.5, 0, 0))], 1.5, 8),
    'a cross': ([box((3, 1, 1)), box((1, 3, 1))], 5, 22),
    'nested': ([CUBE, half()], 1, 6),
    'nested at the wall': ([CUBE, half((0.25, 0, 0))], 1, 6),
    'twice': ([CUBE, CUBE], 1, 6),
    'thrice': ([CUBE, CUBE, CUBE], 1, 6),
    'once outward, once inward': ([CUBE, inverted(CUBE)], 1, 6),
    'a cavity': ([CUBE, inverted(half())], 0.875, 7.5),
    'a cavity with a cube in it': ([CUBE, inverted(half()), box((0.2, 0.2, 0.2))], 0.883, 7.74),
    'a cavity that another part fills by half': (
        [CUBE, inverted(half()), placed(box((0.75, 0.25, 0.5)), (0, 0.125, 0))], 0.9375, 7.0),
    'apart': ([CUBE, placed(CUBE, (2, 0, 0)), inverted(placed(CUBE, (0, 3, 0)))], 3, 18),
    'the second inward': ([CUBE, inverted(placed(CUBE, (1, 0, 0)))], 2, 10),
    'voxels': ([placed(CUBE, (i, j, k)) for i in range(2) for j in range(3) for k in range(2)],
               12, 32),
    'voxels with a gap': ([placed(CUBE, (i, j, k)) for i in range(3) for j in range(3)
                           for k in range(3) if (i, j, k) != (1, 1, 1)], 26, 60),
    'voxels like a chessboard': ([placed(CUBE, (i, j, 0)) for i in range(4) for j in range(4)
                                  if (i + j) % 2], 8, 48),
    'bricks': ([brick(i, j, k) for i in range(2) for j in range(3) for k in range(2)], 24, 60),
    'a frame of four': ([placed(box((3, 1, 1)), (0, 1, 0)), placed(box((3, 1, 1)), (0, -1, 0)),
                         placed(CUBE, (1, 0, 0)), placed(CUBE, (-1, 0, 0))], 8, 32),
}


@turned
@pytest.mark.parametrize('name', SOLIDS)
def test_the_solid_is_the_union_of_the_parts(name, turn):
    """Volume and area by hand; the surface closes, whichever part comes first."""
    parts, volume, area = SOLIDS[name]
    parts = [placed(part, turn=turn) for part in parts]
    for shape in (joined(*parts), joined(*parts[::-1])):
        mesh = made(shape)
        assert mesh.closed
        assert volume_and_area(mesh) == pytest.approx((volume, area), rel=1e-12)
        assert_closed(mesh)


def assert_closed(mesh):
    """Each edge is passed as often one way as the other, and no vertex is there twice."""
    ends = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2)
    count = len(mesh.vertices)
    passed = np.zeros((count, count), dtype=int)
    np.add.at(passed, tuple(ends.T), 1)
    assert np.array_equal(passed, passed.T)
    assert len(np.unique(mesh.vertices, axis=0)) == count


@turned
def test_walls_between_parts_are_gone(turn):
    """Two cubes side by side are a box of twice the triangles at most, and no vertex is within."""
    mesh = made(placed(joined(CUBE, placed(CUBE, (1, 0, 0))), turn=turn))
    middles = mesh.vertices[mesh.faces].mean(axis=1) @ (np.eye(3) if turn is None else turn)
    assert len(mesh.faces) == 20 and not (np.abs(middles[:, 0] - 0.5) < 1e-9).any()


def test_a_doubled_quad_with_common_corners():
    """Eight faces about four corners that both cubes list, each edge of the wall four times."""
    vertices, faces = CUBE
    other = placed(CUBE, (1, 0, 0))[0]
    corners = np.concatenate([vertices, other[4:]])
    second = {0: 4, 1: 5, 2: 6, 3: 7, 4: 8, 5: 9, 6: 10, 7: 11}
    faces = faces + [[second[k] for k in face] for face in faces]
    for listed in (faces, faces[::-1], [face[::-1] for face in faces],
                   faces[:6] + [face[::-1] for face in faces[6:]]):
        mesh = made((corners, listed))
        assert mesh.closed and volume_and_area(mesh) == pytest.approx((2, 10))


@pytest.mark.parametrize('again', [1, -1])
def test_a_triangle_that_is_listed_twice(again):
    """Either way round, alone or all of a face: still the cube."""
    vertices, faces = CUBE
    cut = [list(face) for face in small_meshes.triangles(faces)]
    for more in (cut[:1], cut[3:7], cut):
        mesh = made((vertices, cut + [face[::again] for face in more]))
        assert mesh.closed and volume_and_area(mesh) == pytest.approx((1, 6))


@turned
def test_a_part_that_overlaps_itself(turn):
    """What is beyond a turn of a flat coil counts once, where other parts make a union anyway."""
    volumes = []
    for coil in (small_meshes.coil(1.0, 40, 0.0), small_meshes.coil(1.25, 40, 1e-3)):
        mesh = made(placed(joined(coil, box((0.3, 0.3, 0.3))), turn=turn))
        assert mesh.closed
        assert_closed(mesh)
        volumes.append(volume_and_area(mesh)[0])
    assert volumes[1] == pytest.approx(volumes[0], rel=0.01)


def test_what_is_open_stays_open():
    """A box without a face, a fin, sheets on both sides: no solid, beside a cube or alone."""
    vertices, faces = CUBE
    grid = small_meshes.grid(2, 0.4)
    both = grid[0], grid[1] + [face[::-1] for face in grid[1]]
    fin = np.concatenate([vertices, [[1.5, 0.5, 0.5], [1.5, 0.5, -0.5]]])
    fins = faces + [[7, 8, 9, 6]], faces + [[7, 8, 9, 6], [6, 9, 8, 7]]
    for shape in ((vertices, faces[1:]), grid, both, placed(both, (0, 0, 3)),
                  joined(grid, placed(grid, (0, 0.8, 0))), *((fin, listed) for listed in fins)):
        assert not made(shape).closed
        assert not made(joined(shape, placed(CUBE, (3, 0, 0)))).closed
    cut = [list(face) for face in small_meshes.triangles(grid[1])]
    both = made((grid[0], cut + [face[::-1] for face in cut]))
    assert not both.closed and len(both.faces) == len(cut)
