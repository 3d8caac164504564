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


"""Queries of a mesh by themselves: nearest point, sign, cells, ways; against plain NumPy."""

from collision_sim.core import mesh, mesh_cells, mesh_path, mesh_way
from collision_sim.core.mesh_build import joined, mesh_arrays
from collision_sim.core.vectors import EPSILON
from collision_sim.mesh_surface import make_mesh
from numba import njit
import numpy as np
import pytest
import small_meshes

pytestmark = pytest.mark.jit
SKIN = 1e-14


def build(vertices, faces):
    """Build the arrays of one mesh, as a simulation does."""
    corners = np.concatenate([np.asarray(f, dtype=np.int64) for f in faces])
    sizes = np.array([len(f) for f in faces])
    found = make_mesh(np.asarray(vertices, dtype=float), corners, sizes, 'mesh', None)
    return mesh_arrays(found.vertices, found.faces, found.closed)


@njit
def distances(meshes, m, points):
    """Give the signed distance and the normal of each point, and whether it is inside."""
    d, n, inside = np.empty(len(points)), np.empty_like(points), np.empty(len(points), np.bool_)
    for i in range(len(points)):
        p = (points[i, 0], points[i, 1], points[i, 2])
        d[i], n_i = mesh.mesh_distance(meshes, m, p)
        n[i, 0], n[i, 1], n[i, 2] = n_i
        inside[i] = mesh.is_inside(meshes, m, p)
    return d, n, inside


@njit
def cell_labels(meshes, points):
    """Labels (N,) of the cells that points (N, 3) lie in."""
    labels = np.empty(len(points), np.int64)
    for i in range(len(points)):
        labels[i] = mesh_cells.cell_at(meshes.heads, meshes.cells, 0,
                                       (points[i, 0], points[i, 1], points[i, 2]))
    return labels


@njit
def ways(meshes, side, starts, ends, radius):
    """Give time, distance and normal of the first hit on each way, and how often it crosses."""
    tau, phi, count = np.empty(len(starts)), np.empty(len(starts)), np.empty(len(starts), np.int64)
    n = np.empty_like(starts)
    for i in range(len(starts)):
        tau[i], phi[i], n_i, count[i], _ = mesh_path.meet(
            meshes, 0, side, (starts[i, 0], starts[i, 1], starts[i, 2]),
            (ends[i, 0], ends[i, 1], ends[i, 2]), radius, SKIN)
        n[i, 0], n[i, 1], n[i, 2] = n_i
    return tau, phi, n, count


@njit
def follow_all(answers, meshes, starts, ends, radius):
    """Rows of what is met on each way, and whether it starts inside."""
    rows = np.empty((len(starts), 9))
    for i in range(len(starts)):
        a, b = (starts[i, 0], starts[i, 1], starts[i, 2]), (ends[i, 0], ends[i, 1], ends[i, 2])
        way = mesh_way.follow(answers, meshes, 0, 0, 0.0, a, b, radius[i], SKIN)
        rows[i, 0], rows[i, 1] = way.tau, way.phi
        rows[i, 2], rows[i, 3], rows[i, 4] = way.n
        rows[i, 5], rows[i, 6], rows[i, 7] = way.end
        rows[i, 8] = mesh_way.is_within(answers, meshes, 0, 0, a)
    return rows


def brute_distances(corners, points):
    """Distances (N,) from points to triangles (T, 3, 3): feature by feature, in plain NumPy."""
    least = np.full(len(points), np.inf)
    for a, b, c in corners:
        n = np.cross(b - a, c - a)
        n /= np.linalg.norm(n)
        within = np.ones(len(points), dtype=bool)
        for p, q in ((a, b), (b, c), (c, a)):
            s = np.clip((points - p) @ (q - p) / ((q - p) @ (q - p)), 0.0, 1.0)
            least = np.minimum(least, np.linalg.norm(points - p - s[:, None] * (q - p), axis=1))
            within &= (points - p) @ np.cross(n, q - p) >= 0.0
        least = np.where(within, np.minimum(least, np.abs((points - a) @ n)), least)
    return least


def brute_crossings(corners, starts, ends):
    """How many triangles each way crosses, by Moeller and Trumbore; without regard to edges."""
    count = np.zeros(len(starts), dtype=int)
    for a, b, c in corners:
        d, e1, e2, s = ends - starts, b - a, c - a, starts - a
        h = np.cross(d, e2)
        with np.errstate(divide='ignore', invalid='ignore'):
            f = 1.0 / (h @ e1)
            q = np.cross(s, e1)
            u, v, t = f * (s * h).sum(axis=1), f * (d * q).sum(axis=1), f * (q @ e2)
        count += (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t >= 0.0) & (t <= 1.0)
    return count


def random_triangles(random, count=40):
    """Give triangles that have nothing to do with each other."""
    return random.uniform(-1, 1, (3 * count, 3)), np.arange(3 * count).reshape(-1, 3)


SHAPES = {'sphere': small_meshes.sphere(2), 'torus': small_meshes.torus(12),
          'box': small_meshes.box((1.0, 2.0, 0.1)), 'grid': small_meshes.grid(5),
          'loose': random_triangles(np.random.default_rng(1))}


@pytest.mark.parametrize('shape', SHAPES)
def test_distance_is_that_to_the_nearest_of_all_triangles(shape):
    meshes = build(*SHAPES[shape])
    points = np.random.default_rng(2).uniform(-2, 2, (3000, 3))
    d, n, _ = distances(meshes, 0, points)
    corners = meshes.triangles[:, :9].reshape(-1, 3, 3)
    assert np.abs(np.abs(d) - brute_distances(corners, points)).max() < 8 * EPSILON
    on_surface = points - d[:, None] * n
    assert np.abs(distances(meshes, 0, on_surface)[0]).max() < 16 * EPSILON


@pytest.mark.parametrize('shape', ['sphere', 'torus', 'box'])
def test_sign_agrees_with_the_solid_and_with_the_cells(shape):
    meshes = build(*SHAPES[shape])
    points = np.random.default_rng(3).uniform(-1.6, 1.6, (20_000, 3))
    d, _, inside = distances(meshes, 0, points)
    assert np.array_equal(d < 0.0, inside) and 0.005 < inside.mean() < 0.5
    if shape == 'box':
        assert np.array_equal(inside, (np.abs(points) < [0.5, 1.0, 0.05]).all(axis=1))
    far = points + 10.0
    crossings = brute_crossings(meshes.triangles[:, :9].reshape(-1, 3, 3), points, far)
    assert np.array_equal(inside, crossings % 2 == 1)


def test_sign_at_edges_and_corners_of_a_thin_wedge():
    """The plain normal of the face gives the wrong sign beside an acute edge."""
    wedge = [[0, -1, 0], [0, 1, 0], [2, -1, 0.05], [2, 1, 0.05], [2, -1, -0.05], [2, 1, -0.05]]
    meshes = build(wedge, [[0, 1, 3, 2], [0, 4, 5, 1], [2, 3, 5, 4], [0, 2, 4], [1, 5, 3]])
    points = np.random.default_rng(4).uniform([-0.1, -1.1, -0.1], [0.2, 1.1, 0.1], (20_000, 3))
    d, _, inside = distances(meshes, 0, points)
    x, y, z = points.T
    solid = (x > 0) & (np.abs(y) < 1.0) & (np.abs(z) < 0.025 * x)
    assert np.array_equal(d < 0.0, solid) and np.array_equal(inside, solid)


def test_normals_of_a_flat_surface_are_one_and_the_same():
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    vertices, faces = small_meshes.grid(6)
    meshes = build(vertices @ turn.T, faces)
    assert len(np.unique(meshes.triangles[:, 9:], axis=0)) == 1
    inner = np.abs(vertices @ np.eye(3))[:, :2].max(axis=1) < 1.9
    assert inner.sum() == 25 and (meshes.sharp > 0).sum() < len(meshes.sharp)


@pytest.mark.parametrize('shape', SHAPES)
def test_points_meet_what_they_cross(shape):
    meshes = build(*SHAPES[shape])
    random = np.random.default_rng(6)
    starts = random.uniform(-1.6, 1.6, (20_000, 3))
    ends = starts + random.normal(size=starts.shape) * random.choice([0.02, 0.3, 3], (20_000, 1))
    tau, phi, n, count = ways(meshes, 0.0, starts, ends, 0.0)
    corners = meshes.triangles[:, :9].reshape(-1, 3, 3)
    crossings = brute_crossings(corners, starts, ends)
    assert np.array_equal(count, np.minimum(crossings, 2))
    hit = tau <= 1.0
    assert np.array_equal(hit, count > 0) and hit.sum() > 300
    places = starts + tau[:, None] * (ends - starts)
    assert np.abs(distances(meshes, 0, places[hit])[0]).max() < 1e-12
    assert ((ends - starts) * n)[hit].sum(axis=1).max() < 0.0 and phi[hit].max() < 0.0
    before = starts + (tau * (1.0 - 1e-9))[:, None] * (ends - starts)
    assert not ways(meshes, 0.0, starts[hit], before[hit], 0.0)[3].any()


def directions_through(shape, targets, random):
    """Directions that lead through the surface at points of it, edges and corners included."""
    if shape == 'grid':
        return [0.0, 0.0, 1.0] + 0.3 * random.normal(size=targets.shape)
    inner = 0.3 * random.uniform(-1, 1, targets.shape) * [1, 1, 0.1]
    if shape == 'torus':
        ring = targets * [1, 1, 0]
        inner = 0.1 * inner + ring / np.linalg.norm(ring, axis=1, keepdims=True)
    return targets - inner


@pytest.mark.parametrize('shape', ['sphere', 'torus', 'box', 'grid'])
@pytest.mark.parametrize('turned', [False, True])
def test_nothing_leaks_through_edges_and_corners(shape, turned):
    """Ways exactly through corners and points of edges, of many lengths."""
    (vertices, faces), random = SHAPES[shape], np.random.default_rng(9)
    corners = vertices[small_meshes.triangles(faces)]
    which = random.integers(0, len(corners), 20_000)
    weight = random.choice([0.0, 0.5, 0.25], len(which))[:, None]
    target = corners[which, 0] * weight + corners[which, 1] * (1.0 - weight)
    if shape == 'grid':
        target = target[np.abs(target).max(axis=1) < 2.0]
    across = directions_through(shape, target, random)
    if turned:
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
        vertices, target, across = vertices @ turn, target @ turn, across @ turn
    lengths = 10.0 ** random.uniform(-4, 1, (2, len(target), 1))
    starts, ends = target + lengths[0] * across, target - np.minimum(lengths[1], 0.1) * across
    tau, _, _, count = ways(build(vertices, faces), 0.0, starts, ends, 0.0)
    assert (tau <= 1.0).all() and count.min() > 0


@pytest.mark.parametrize('shape', SHAPES)
@pytest.mark.parametrize('radius', [0.03, 0.3])
def test_balls_meet_what_comes_within_their_radius(shape, radius):
    """The first time is exact: the distance there is the radius, and larger before."""
    meshes = build(*SHAPES[shape])
    random = np.random.default_rng(10)
    starts = random.uniform(-2, 2, (6000, 3))
    starts = starts[np.abs(distances(meshes, 0, starts)[0]) > 1.001 * radius]
    ends = starts + random.normal(size=starts.shape)
    tau = ways(meshes, 0.0, starts, ends, radius)[0]
    times = np.linspace(0.0, 1.0, 200)
    least = np.full(len(starts), np.inf)
    for time in times:
        now = starts + np.minimum(time, tau)[:, None] * (ends - starts)
        least = np.minimum(least, np.abs(distances(meshes, 0, now)[0]))
    assert least.min() > radius * (1.0 - 1e-12)
    hit = tau <= 1.0
    assert hit.sum() > 150
    there = starts + tau[:, None] * (ends - starts)
    gap = np.abs(distances(meshes, 0, there[hit])[0]) - radius
    assert np.abs(gap).max() < 1e-12


def test_kept_answers_are_those_to_the_same_question():
    """Each way is followed twice, then another radius, another end and another start."""
    meshes = build(*SHAPES['torus'])
    random = np.random.default_rng(14)
    a = random.uniform(-1.4, 1.4, (2, 2000, 3)) * [1.0, 1.0, 0.4]
    b = a[0] + 0.3 * random.normal(size=a.shape)
    starts = np.stack([a[0], a[0], a[0], a[0], a[1]], axis=1).reshape(-1, 3)
    ends = np.stack([b[0], b[0], b[0], b[1], b[1]], axis=1).reshape(-1, 3)
    radius = np.tile([0.02, 0.02, 0.1, 0.1, 0.1], len(a[0]))
    asked = follow_all(np.empty((0, mesh_way.ANSWERS)), meshes, starts, ends, radius)
    answers = mesh_way.keep_answers(meshes, np.zeros((1, 1)))
    assert np.array_equal(follow_all(answers, meshes, starts, ends, radius), asked)
    rows = asked.reshape(-1, 5, 9)
    differs = (rows[:, 1:] != rows[:, :-1]).any(axis=2).mean(axis=0)
    assert differs[0] == 0.0 and (differs[1:] > 0.2).all() and 0.1 < asked[:, 8].mean() < 0.9


def test_closed_meshes_are_met_from_their_side_only():
    meshes = build(*SHAPES['box'])
    starts, ends = np.array([[0.1, 0.3, 0.0]]), np.array([[0.1, 0.3, 3.0]])
    assert ways(meshes, 1.0, starts, ends, 0.0)[0][0] > 1.0
    assert ways(meshes, -1.0, starts, ends, 0.0)[0][0] == pytest.approx(0.05 / 3.0)
    assert ways(meshes, 0.0, starts, ends, 0.0)[3][0] == 1


def test_a_start_on_the_surface_is_in_front():
    meshes = build(*SHAPES['grid'])
    on = np.array([[0.3, 0.2, 0.0], [0.3, 0.2, 1e-17], [0.3, 0.2, -1e-17]])
    down, up = ways(meshes, 0.0, on, on - [0, 0, 1e-3], 0.0), ways(
        meshes, 0.0, on, on + [0, 0, 1e-3], 0.0)
    assert (down[0] == 0.0).all() and (down[2] == [0, 0, 1]).all() and (up[0] > 1.0).all()


def test_meshes_side_by_side_in_the_same_arrays():
    parts = [build(*SHAPES[shape]) for shape in ('torus', 'grid', 'sphere')]
    points = np.random.default_rng(11).uniform(-2, 2, (2000, 3))
    together = joined(parts)
    for m, part in enumerate(parts):
        for one, other in zip(distances(together, m, points), distances(part, 0, points)):
            assert np.array_equal(one, other)


@pytest.mark.parametrize('seed', range(12))
def test_the_distance_of_a_union_is_that_to_its_surface(seed):
    """Inside and outside as by planes of the parts; no nearest point is on a covered face."""
    parts = small_meshes.random_union(seed)
    meshes = build(*small_meshes.joined(*parts))
    points = np.random.default_rng(seed).uniform(-1.5, 1.5, (3000, 3))
    d, n, inside = distances(meshes, 0, points)
    height = small_meshes.height_in_union(parts, points)
    clear = np.abs(height) > 1e-12
    assert meshes.heads[0, mesh_cells.CLOSED] and 0.005 < inside.mean() < 0.7
    assert np.array_equal(inside[clear], height[clear] < 0.0)
    assert np.array_equal(d[clear] < 0.0, height[clear] < 0.0)
    on_surface = points - d[:, None] * n
    assert np.abs(small_meshes.height_in_union(parts, on_surface)).max() < 1e-12


def test_cells_know_what_lies_in_them():
    meshes = build(*SHAPES['torus'])
    points = np.random.default_rng(12).uniform(-1.6, 1.6, (20_000, 3)) * [1, 1, 0.4]
    d, _, _ = distances(meshes, 0, points)
    labels = cell_labels(meshes, points)
    assert (d[labels == mesh_cells.OUTSIDE] > 0.0).all()
    assert (d[labels == mesh_cells.INSIDE] < 0.0).all()
    assert 0.0 < (labels > mesh_cells.INSIDE).mean() < 0.5
