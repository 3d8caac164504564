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

"""Colliders side by side: a floor of them is a floor, and its seams are not there (A8)."""

from itertools import product

from collision_sim.core.rotation import rotation_matrix
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import box, G, METHODS, plane, simulate, STAGED

pytestmark = pytest.mark.plain

METHODS_AND_DETECTIONS = [*product(METHODS, ('end_of_step', 'trajectory')),
                          ('exact', 'end_of_step')]
every_way = pytest.mark.parametrize(('method', 'detection'), METHODS_AND_DETECTIONS)
every_fixed_way = pytest.mark.parametrize(('method', 'detection'), METHODS_AND_DETECTIONS[:-1])
LYING = (0.0, 0.7071067811865476, 0.0, 0.7071067811865476)     # z of a rod along x


def run(colliders, position, method, detection, **scene):
    """Make a simulation with one of the ways to detect what is hit."""
    return simulate(colliders, position, method=method, stepping={'detection': detection}, **scene)


def two_boxes():
    """Give two flush boxes whose seam is y = 0; their top is z = 0."""
    return [box((4.0, 1.0, 0.2), (0.0, y, -0.1), name) for name, y in (('a', -0.5), ('b', 0.5))]


def floor_of(kind, depth=0.25):
    """Give shapes, places and the way of a floor of tiles or a row of rods, with its top at 0."""
    ticks = 0.25 * np.arange(-2, 3)
    if kind == 'tiles':
        return [({'shape': 'box', 'size': [0.25, 0.25, depth]}, (x, y, -0.5 * depth),
                 (0.0, 0.0, 0.0, 1.0)) for x in ticks for y in ticks], (0.9, 0.8, 0.0)
    shape = 'cylinder' if kind == 'rods' else 'capsule'
    return [({'shape': shape, 'radius': 0.2, 'length': 0.25}, (x, 0.0, -0.2), LYING)
            for x in ticks], (0.9, 0.0, 0.0)


def product_of(a, b):
    """Multiply two quaternions x, y, z, w."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return [aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz]


@every_way
@pytest.mark.parametrize('y', [0.0, 1e-17, 0.001, -0.001, 0.3])
def test_rest_beside_and_on_a_seam(method, detection, y):
    """A particle on two flush boxes stays where it is, however near to the seam."""
    sim = run(two_boxes(), (0.05, y, 0.0), method, detection, dt=1 / 60)
    sim.step(60)
    assert_array_equal(sim.position[0], (0.05, y, 0.0))


@every_way
@pytest.mark.parametrize('y', [0.0, 1e-17, 0.001])
@pytest.mark.parametrize('height', [1e-3, 0.01, 0.3])
def test_a_fall_on_a_seam(method, detection, height, y):
    """A particle that falls exactly into the seam of two flush boxes lands on them."""
    sim = run(two_boxes(), (0.05, y, height), method, detection, dt=1 / 60)
    sim.step(60)
    above = 0.0 if method == 'exact' else 2.0 * G * sim.dt ** 2
    assert_array_equal(sim.position[0, :2], (0.05, y))
    assert -1e-15 <= sim.position[0, 2] <= above + 1e-15


@every_fixed_way
@pytest.mark.parametrize('kind', ['tiles', 'rods', 'capsules'])
@pytest.mark.parametrize('radius', [0.0, 0.01, 0.1])
def test_sliders_do_not_see_the_seams(method, detection, kind, radius):
    """Points and balls go on at their velocity, in any direction in space, to rounding."""
    random = np.random.default_rng(METHODS.index(method))
    for dt in (1 / 60, 1 / 240):
        turn = random.normal(size=4)
        turn /= np.linalg.norm(turn)
        matrix, place = rotation_matrix(turn), random.normal(size=3)
        parts, way = floor_of(kind, random.choice([0.25, 0.02]))
        colliders = [{'name': f'part_{k}', **parts[k][0],
                      'position': (matrix @ parts[k][1] + place).tolist(),
                      'orientation': product_of(turn, parts[k][2])}
                     for k in random.permutation(len(parts))]
        start = np.array([-0.45, -0.41 if kind == 'tiles' else 0.0, radius])
        sim = run(colliders, matrix @ start + place, method, detection, dt=dt,
                  velocity=(matrix @ way).tolist(), gravity=(matrix @ (0.0, 0.0, -G)).tolist(),
                  particles={'radius': radius})
        steps = int(0.8 / dt)
        sim.step(steps)
        assert_allclose(sim.position[0], matrix @ (start + np.multiply(way, steps * dt)) + place,
                        atol=1e-11)
        along = matrix.T @ sim.velocity[0]
        assert_allclose(along[:2], way[:2], atol=1e-11)
        assert method not in STAGED or abs(along[2]) < 1e-11


@every_fixed_way
@pytest.mark.parametrize('dt', [1 / 60, 1 / 240])
def test_rain_does_not_get_through_a_floor_of_tiles(method, detection, dt):
    """Fast and slow, points and balls, on seams and corners of tiles exactly, too."""
    random = np.random.default_rng(3)
    tiles = [box((0.25, 0.25, 0.25), (*np.add(place, 0.125), -0.125), f'tile_{k}')
             for k, place in enumerate(product(0.25 * np.arange(-3, 3), repeat=2))]
    start = random.uniform((-0.6, -0.6, 0.1), (0.6, 0.6, 0.4), (24, 3))
    start[:12, 0] = np.round(start[:12, 0] * 4.0) / 4.0
    start[6:18, 1] = np.round(start[6:18, 1] * 4.0) / 4.0
    speed = random.choice([-1.0, -6.0], 24)
    sim = run(tiles, start, method, detection, dt=dt, particles={
        'radius': random.choice([0.0, 0.02], 24).tolist()},
        velocity=np.column_stack([np.zeros((24, 2)), speed]).tolist())
    for _ in range(int(0.5 / dt)):
        sim.step()
        assert sim.position[:, 2].min() > -1e-14
    assert_array_equal(sim.position[:, :2], start[:, :2])
    assert sim.counters['fail_safes'] == 0


@every_fixed_way
def test_a_wall_on_the_floor_is_met(method, detection):
    """
    A slider comes back from a box that stands on the next tile, and from a tile that is higher.

    Without a collision stage it hops, as the lecture warns, and may come onto the higher tile.
    """
    tall = box((4.0, 1.0, 1.0), (0.0, 0.5, 0.4), 'b')
    floors = ([two_boxes()[0], tall], [plane(), tall], [two_boxes()[0], box(
        (4.0, 1.0, 0.2), (0.0, 0.5, -0.0995), 'b')])
    for floor in floors:
        for radius in (0.0, 0.0001):
            sim = run(floor, (0.05, -0.3, radius), method, detection, dt=1 / 60, restitution=0.5,
                      velocity=(0.0, 1.0, 0.0), particles={'radius': radius})
            sim.step(60)
            assert sim.clearance()[0] > -1e-12
            assert sim.position[0, 1] < 0.0 or (floor is floors[2] and method not in STAGED)
            if method in STAGED:
                assert_allclose(sim.velocity[0, :2], (0.0, -0.5), atol=2e-3)


@every_fixed_way
@pytest.mark.parametrize('start', [(0.5, 0.5, 0.5), (0.5, 0.5, 0.3), (0.45, 0.52, 0.4),
                                   (0.1, 0.2, 0.5), (0.5, 1.2, 0.9)])
def test_a_start_in_a_stack_of_boxes_comes_out(method, detection, start):
    """
    Eight cubes side by side, in the middle, on seams and anywhere: not to a covered face.

    `single_pass` answers each cube by itself: those that push to opposite sides slow each other.
    """
    cubes = [box((1.0, 1.0, 1.0), place, f'cube_{k}')
             for k, place in enumerate(product((0.0, 1.0), repeat=3))]
    sim, before = run(cubes, start, method, detection, dt=1 / 60, gravity=(0.0, 0.0, 0.0)), 1.0
    for _ in range(400):
        sim.step()
        depth = 1.0 - np.abs(sim.position[0] - 0.5).max()
        assert depth <= before + 1e-12 or method == 'single_pass'
        before = depth
    assert depth < (0.9 if method == 'single_pass' else 1e-6)


@pytest.mark.parametrize('short', [0.0, 1e-16, 1e-15, 3e-15])
@pytest.mark.parametrize('kind', ['box', 'cylinder'])
def test_exact_slides_over_an_edge_that_it_is_at(kind, short):
    """A point that a step has brought to an edge, or just not, flies on as fast as it slides."""
    size = {'size': [2.0, 1.0, 1.0]} if kind == 'box' else {'radius': 0.5, 'length': 1.0}
    sim = simulate([{'name': 'c', 'shape': kind, **size}], (0.0, 0.5 - short, 0.5),
                   (0.0, 1.0, 0.0), method='exact', dt=0.1)
    sim.step()
    assert_allclose(sim.velocity, [[0.0, 1.0, -0.1 * G]], atol=1e-13)
    assert_allclose(sim.position, [[0.0, 0.6, 0.5 - 0.005 * G]], atol=1e-13)


def test_exact_comes_to_rest_on_a_seam():
    """Bounces that die out right above the seam of two boxes do not end in it."""
    boxes = [box((2.0, 1.0, 1.0), (x, 0.0, 0.0), name) for name, x in (('a', 0.0), ('b', 2.0))]
    sim = simulate(boxes, (1.0, 0.0, 0.55), (0.0, 1.0, 0.0), method='exact', dt=0.1,
                   restitution=0.3)
    sim.step(4)
    assert_allclose(sim.position, [[1.0, 0.4, 0.5]], atol=1e-14)
    assert_array_equal(sim.velocity, [[0.0, 1.0, 0.0]])
