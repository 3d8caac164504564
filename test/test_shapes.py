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

"""Signed distances and normals of all shapes, against formulae of another kind."""

from collision_sim.core import shapes
from collision_sim.core.rotation import rotation_matrix
from collision_sim.core.shapes import box, capsule, cylinder, plane, sphere
from numba import njit
import numpy as np
from numpy.testing import assert_allclose
import pytest
from small_scenes import EPSILON, simulate

LONG = np.longdouble
HALF = (0.5, 1.25, 2.0)
# functions of a point in the frame of the shape, and the same by closest points, below
SHAPES = {
    'plane': plane,
    'sphere': lambda p, s=1.0: sphere(p, 1.5 * s),
    'box': lambda p, s=1.0: box(p, (HALF[0] * s, HALF[1] * s, HALF[2] * s)),
    'capsule': lambda p, s=1.0: capsule(p, 0.75 * s, 1.5 * s),
    'cylinder': lambda p, s=1.0: cylinder(p, 0.75 * s, 1.5 * s),
}
every_shape = pytest.mark.parametrize('shape', SHAPES)


def to_segment(p, a, b):
    """Distance from a point to a segment, in any number of dimensions, extended precision."""
    along = b - a
    t = np.clip(((p - a) @ along) / (along @ along), LONG(0), LONG(1))
    return np.sqrt(np.sum((p - a - t * along) ** 2))


def plane_by_points(p):
    return p[2]


def sphere_by_points(p):
    return np.sqrt(np.sum(p ** 2)) - LONG(1.5)


def box_by_points(p):
    """Least distance to the points of the six faces that are nearest; negative within."""
    half, best = np.array(HALF, dtype=LONG), LONG(np.inf)
    for axis in range(3):
        for side in (-1, 1):
            nearest = np.clip(p, -half, half)
            nearest[axis] = side * half[axis]
            best = min(best, np.sqrt(np.sum((p - nearest) ** 2)))
    return -best if (np.abs(p) <= half).all() else best


def capsule_by_points(p):
    end = np.array((0.0, 0.0, 1.5), dtype=LONG)
    return to_segment(p, -end, end) - LONG(0.75)


def cylinder_by_points(p):
    """Least distance to the outline in the half plane through the axis; negative within."""
    q = np.array((np.sqrt(p[0] ** 2 + p[1] ** 2), p[2]))
    corners = [np.array(c, dtype=LONG) for c in ((0, -1.5), (0.75, -1.5), (0.75, 1.5), (0, 1.5))]
    best = min(to_segment(q, a, b) for a, b in zip(corners, corners[1:]))
    return -best if q[0] <= 0.75 and abs(q[1]) <= 1.5 else best


BY_POINTS = {'plane': plane_by_points, 'sphere': sphere_by_points, 'box': box_by_points,
             'capsule': capsule_by_points, 'cylinder': cylinder_by_points}


def points(count=400, reach=3.0, seed=1):
    """Random points about the shapes; some on planes and axes of symmetry."""
    found = np.random.default_rng(seed).uniform(-reach, reach, (count, 3))
    found[::5, 0] = 0.0
    found[::7, 1] = 0.0
    found[::11, 2] = 0.0
    return [tuple(p) for p in found.tolist()]


@every_shape
def test_distance(shape):
    """Against the distance to the closest point, to rounding."""
    for p in points():
        distance, _ = SHAPES[shape](p)
        exact = BY_POINTS[shape](np.array(p, dtype=LONG))
        assert distance == pytest.approx(float(exact), abs=8 * EPSILON * 3.0)


@every_shape
@pytest.mark.parametrize('scale', [2.0 ** -660, 2.0 ** -30, 2.0 ** 30, 2.0 ** 660],
                         ids=['1e-199', '1e-9', '1e9', '1e199'])
def test_distance_at_any_scale(shape, scale):
    """A scene of another size by a power of two: the same distances, to rounding."""
    for p in points(100):
        scaled = tuple(scale * x for x in p)
        distance, normal = SHAPES[shape](scaled) if shape == 'plane' else \
            SHAPES[shape](scaled, scale)
        near, same = SHAPES[shape](p)
        assert distance / scale == pytest.approx(near, abs=8 * EPSILON * 3.0)
        assert_allclose(normal, same, rtol=0.0, atol=8 * EPSILON)


@every_shape
@pytest.mark.parametrize('reach', [1e-200, 1e-100, 1e-17, 1e-8, 1e8, 1e100, 1e200, 1e300])
def test_points_at_any_distance(shape, reach):
    """Far out and next to the center: right to rounding, unit normal."""
    for p in points(100, reach):
        distance, normal = SHAPES[shape](p)
        exact = float(BY_POINTS[shape](np.array(p, dtype=LONG)))
        assert distance == pytest.approx(exact, abs=8 * EPSILON * (3.0 + reach))
        assert sum(x * x for x in normal) == pytest.approx(1.0, abs=8 * EPSILON)


@every_shape
def test_normal_is_the_gradient(shape):
    """Against central differences, where these are of length 1: not at edges within."""
    h, compared = 1e-6, 0
    for p in points(seed=2):
        _, normal = SHAPES[shape](p)
        gradient = np.array([
            (SHAPES[shape](tuple(q + h * e))[0] - SHAPES[shape](tuple(q - h * e))[0]) / (2 * h)
            for q, e in ((np.array(p), e) for e in np.eye(3))])
        if abs(np.linalg.norm(gradient) - 1.0) < 1e-8:
            assert_allclose(normal, gradient, rtol=0.0, atol=1e-5)
            compared += 1
    assert compared > 200


@every_shape
def test_normal_leads_to_the_surface(shape):
    """Point minus distance times normal is on the surface, from outside and inside."""
    for p in points(seed=3):
        distance, normal = SHAPES[shape](p)
        foot = tuple(x - distance * n for x, n in zip(p, normal))
        assert SHAPES[shape](foot)[0] == pytest.approx(0.0, abs=16 * EPSILON * 3.0)


@pytest.mark.parametrize(('shape', 'point', 'distance', 'normal'), [
    ('plane', (1.0, 2.0, -3.0), -3.0, (0, 0, 1)),
    ('plane', (0.0, 0.0, 0.0), 0.0, (0, 0, 1)),
    ('sphere', (0.0, 0.0, 0.0), -1.5, (0, 0, 1)),
    ('sphere', (0.0, -5e-324, 0.0), -1.5, (0, -1, 0)),
    ('sphere', (0.0, 0.9, 1.2), 0.0, (0, 0.6, 0.8)),
    ('box', (0.0, 0.0, 0.0), -0.5, (1, 0, 0)),
    ('box', (0.0, 0.75, 0.0), -0.5, (1, 0, 0)),             # as near to +y: the first axis
    ('box', (-0.1, 0.0, 0.0), -0.4, (-1, 0, 0)),
    ('box', (0.5, 0.0, 0.0), 0.0, (1, 0, 0)),
    ('box', (0.5, 1.25, 2.0), 0.0, (1, 0, 0)),              # a vertex belongs to the inside
    ('box', (0.5, 1.25, 3.0), 1.0, (0, 0, 1)),
    ('box', (3.5, 5.25, 2.0), 5.0, (0.6, 0.8, 0)),
    ('box', (-3.5, -5.25, 0.0), 5.0, (-0.6, -0.8, 0)),
    ('capsule', (0.0, 0.0, 0.3), -0.75, (1, 0, 0)),
    ('capsule', (0.0, 0.0, 1.5), -0.75, (1, 0, 0)),
    ('capsule', (0.0, 0.0, 1.6), -0.65, (0, 0, 1)),
    ('capsule', (0.0, 0.0, -3.25), 1.0, (0, 0, -1)),
    ('capsule', (0.0, 1.75, 1.5), 1.0, (0, 1, 0)),
    ('cylinder', (0.0, 0.0, 0.0), -0.75, (1, 0, 0)),
    ('cylinder', (0.0, 0.0, 0.75), -0.75, (1, 0, 0)),       # as near to the cap: the side
    ('cylinder', (0.0, 0.0, 1.25), -0.25, (0, 0, 1)),
    ('cylinder', (0.0, 0.0, -1.25), -0.25, (0, 0, -1)),
    ('cylinder', (0.0, 0.0, 2.5), 1.0, (0, 0, 1)),
    ('cylinder', (0.75, 0.0, 1.5), 0.0, (1, 0, 0)),         # the rim belongs to the inside
    ('cylinder', (3.75, 0.0, 5.5), 5.0, (0.6, 0, 0.8)),
])
def test_places_of_symmetry(shape, point, distance, normal):
    """Centers, faces, edges and axes: the side that is documented."""
    found, direction = SHAPES[shape](point)
    assert found == pytest.approx(distance, abs=4 * EPSILON)
    assert_allclose(direction, normal, rtol=0.0, atol=4 * EPSILON)


@every_shape
def test_symmetry(shape):
    """Mirrored points have the same distance, bit for bit, and mirrored normals."""
    for p in points(60):
        distance, normal = SHAPES[shape](p)
        for axis in range(2 if shape == 'plane' else 3):
            if p[axis] != 0.0:
                mirrored = tuple(-x if k == axis else x for k, x in enumerate(p))
                other, direction = SHAPES[shape](mirrored)
                assert other == distance
                assert direction[axis] == -normal[axis]


COLLIDERS = [
    {'name': 'plane', 'shape': 'plane', 'point': [1.0, 2.0, 3.0], 'normal': [0.6, 0.0, 0.8]},
    {'name': 'sphere', 'shape': 'sphere', 'radius': 1.5, 'position': [1.0, 2.0, 3.0]},
    {'name': 'box', 'shape': 'box', 'size': [1.0, 2.5, 4.0], 'position': [1.0, 2.0, 3.0],
     'orientation': [0.1, 0.5, -0.5, 0.7]},
    {'name': 'capsule', 'shape': 'capsule', 'radius': 0.75, 'length': 3.0,
     'orientation': [0.5, 0.5, 0.5, 0.5]},
    {'name': 'cylinder', 'shape': 'cylinder', 'radius': 0.75, 'length': 3.0,
     'position': [-1.0, 0.0, 0.0], 'orientation': [0.5, -0.5, 0.5, 0.5]},
]


@njit
def world_distance(present, table, poses, c, point):
    """Call a kernel, which has no entry from Python."""
    return shapes.signed_distance(present, table, poses, 0, c, point)


@pytest.mark.parametrize('inside', [False, True], ids=['outside', 'inside'])
def test_distance_in_the_world(inside):
    """Poses turn and shift the shapes; `inside` turns sign and normal."""
    side, place = -1.0 if inside else 1.0, (1.0, 2.0, 3.0)
    turn = rotation_matrix((0.1, 0.5, -0.5, 0.7))
    sizes = {'plane': (0, 0), 'sphere': (1.5, 0), 'capsule': (0.75, 1.5), 'cylinder': (0.75, 1.5)}
    for shape in sizes.keys() | {'box'}:
        kind = shapes.SHAPES[shape]
        table, poses = np.zeros((2, shapes.COLUMNS)), np.zeros((1, 2, 12))
        table[1, :5] = (kind, side, *(HALF if shape == 'box' else (*sizes[shape], 0)))
        poses[0, 1] = (*turn.ravel(), *place)
        for p in points(40, seed=4):
            present = shapes.Present()
            distance, normal = world_distance(present, table, poses, 1, p)
            near, direction = SHAPES[shape](tuple((turn.T @ (np.array(p) - place)).tolist()))
            assert distance == pytest.approx(side * near, abs=16 * EPSILON * 3.0)
            assert_allclose(normal, side * turn @ direction, rtol=0.0, atol=16 * EPSILON)


COLLIDERS = [
    {'name': 'plane', 'shape': 'plane', 'point': [1.0, 2.0, 3.0], 'normal': [0.6, 0.0, 0.8]},
    {'name': 'sphere', 'shape': 'sphere', 'radius': 1.5, 'position': [1.0, 2.0, 3.0]}]


def test_clearance_is_the_distance_to_the_nearest():
    """Of several colliders the nearest, less the radius."""
    places = np.array(points(50, 9.0, 5))
    sim = simulate(COLLIDERS, places, particles={'radius': 0.25})
    near = np.minimum((places - (1.0, 2.0, 3.0)) @ (0.6, 0.0, 0.8),
                      np.linalg.norm(places - (1.0, 2.0, 3.0), axis=1) - 1.5) - 0.25
    assert_allclose(sim.clearance(), near, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize('inside', [False, True], ids=['outside', 'inside'])
@pytest.mark.parametrize(('keys', 'shape'), [
    ({'radius': 1.5}, 'sphere'), ({'size': [1.0, 2.5, 4.0]}, 'box'),
    ({'radius': 0.75, 'length': 3.0}, 'capsule'), ({'radius': 0.75, 'length': 3.0}, 'cylinder')])
def test_sizes_of_a_scene(keys, shape, inside):
    """Edge lengths, lengths and radii as they are written mean the solids above."""
    sim = simulate([{'name': 'one', 'shape': shape, 'inside': inside, **keys}], points(50))
    near = [SHAPES[shape](p)[0] for p in points(50)]
    assert_allclose(sim.clearance(), np.negative(near) if inside else near, atol=1e-15)


@pytest.mark.parametrize('normal', [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0.6, -0.48, 0.64),
                                    (1e-9, 0, 1), (1, 1, 1)], ids=str)
def test_plane_in_a_scene(normal):
    """The distance to a plane along its normal, from any of its points."""
    unit = np.array(normal) / np.linalg.norm(normal)
    sim = simulate([{'name': 'one', 'shape': 'plane', 'point': [3.0, 4.0, 5.0],
                     'normal': list(normal)}], points(50))
    assert_allclose(sim.clearance(), (np.array(points(50)) - (3.0, 4.0, 5.0)) @ unit, atol=4e-15)
    position, orientation = sim.collider_pose('one')
    assert_allclose(np.abs(orientation), (0, 0, 0, 1), atol=4 * EPSILON)
    assert_allclose(position, (3.0, 4.0, 5.0))
