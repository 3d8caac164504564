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

"""Meshes of parts that touch or overlap: rain, slides over seams, and starts inside; A8."""

import numpy as np
import pytest
import small_meshes
from small_meshes import a_turn, box, joined, placed
from small_scenes import simulate

pytestmark = pytest.mark.jit
DETECTIONS = ('end_of_step', 'trajectory')
both_detections = pytest.mark.parametrize('detection', DETECTIONS)
TOP = 0.125             # m, height of the bricks' top over their middle


def run(shape, position, velocity=(0.0, 0.0, 0.0), *, detection='end_of_step', radius=0.0, **keys):
    """Make a simulation with one mesh."""
    vertices, faces = shape
    mesh = {'name': 'mesh', 'shape': 'mesh', 'vertices': vertices, 'faces': faces}
    return simulate([mesh], position, velocity, particles={'radius': radius},
                    stepping={'detection': detection}, **keys)


def bricks(count, length=0.5):
    """Give a floor of count x count bricks, side by side or in a bond, its top at 0."""
    step = 0.5 * length if length > 0.25 else 0.0
    return joined(*[placed(box((length, 0.25, 2.0 * TOP)), (
        length * (i - 0.5 * count) + step * (j % 2), 0.25 * (j - 0.5 * count), -TOP))
        for i in range(count) for j in range(count)])


def stack(count):
    """Give a floor of overlapping slabs, their tops level, each thicker than the one before."""
    return joined(*[placed(box((1.0, 2.0, 0.2 + 0.1 * i)), (0.7 * (i - 0.5 * count), 0.0,
                                                            -0.1 - 0.05 * i))
                    for i in range(count)])


FLOORS = {'tiles': bricks(12, 0.25), 'bricks': bricks(8), 'slabs': stack(4)}
floors = pytest.mark.parametrize('floor', FLOORS)


@floors
@both_detections
@pytest.mark.parametrize('rate', [60, 240])
@pytest.mark.parametrize('turn', [np.eye(3), a_turn(3)], ids=['level', 'tilted'])
def test_rain_on_a_floor_of_parts(floor, detection, rate, turn):
    """Nobody gets through, also not exactly on seams or from rest on them."""
    random = np.random.default_rng(1)
    place = random.uniform([-0.8, -0.8, 0.0], [0.8, 0.8, 0.5], (600, 3))
    place[::2, 0] = np.round(8.0 * place[::2, 0]) / 8.0
    place[::3, 1] = np.round(8.0 * place[::3, 1]) / 8.0
    place[::5, 2] = 0.0
    sim = run(placed(FLOORS[floor], turn=turn), place @ turn.T, detection=detection,
              gravity=-9.81 * turn[:, 2], dt=1 / rate)
    sim.step(rate)
    height = sim.position @ turn[:, 2]
    assert height.min() > -1e-15 and height.max() <= 9.81 / rate ** 2
    assert np.abs(sim.position @ turn[:, :2] - place[:, :2]).max() < 1e-12
    assert sim.counters['repulsions'] == 0 and sim.counters['fail_safes'] == 0


@floors
@both_detections
@pytest.mark.parametrize('radius', [0.0, 0.05])
@pytest.mark.parametrize('turn', [np.eye(3), a_turn(3)], ids=['level', 'tilted'])
def test_slides_over_the_seams_of_parts(floor, detection, radius, turn):
    """Without friction the velocity stays, to rounding: across seams, along them and aslant."""
    place = np.array([[-0.8, 0.0, radius], [-0.8, 0.125, radius], [0.0, -0.8, radius],
                      [-0.7, -0.7, radius], [-0.81, 0.03, radius]])
    velocity = np.array([[1.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.7, 0.7, 0], [1, 0.3, 0]])
    sim = run(placed(FLOORS[floor], turn=turn), (place + [0, 0, 1e-15]) @ turn.T,
              velocity @ turn.T, detection=detection, radius=radius, gravity=-9.81 * turn[:, 2])
    for _ in range(36):
        sim.step(10)
        assert np.abs(sim.velocity @ turn - velocity).max() < 1e-13
        assert np.abs(sim.position @ turn[:, 2] - radius).max() < 1e-13


@both_detections
@pytest.mark.parametrize('seed', range(4))
def test_who_starts_inside_parts_comes_out_of_all(detection, seed):
    """The depth falls by the share of repulsion or at its speed in each step, from any start."""
    parts = small_meshes.random_union(seed)
    place = np.random.default_rng(seed).uniform(-1.2, 1.2, (2000, 3))
    depth = -small_meshes.height_in_union(parts, place)
    place, depth = place[depth > 1e-3][:200], depth[depth > 1e-3][:200]
    sim = run(joined(*parts), place, detection=detection, gravity=(0, 0, 0))
    before = -sim.clearance()
    assert before.min() > 0.9e-3
    for _ in range(20):
        sim.step()
        after = np.maximum(0.9 * before, before - 10.0 / 240.0)
        assert -sim.clearance() == pytest.approx(after, rel=1e-9, abs=1e-12)
        before = -sim.clearance()
    assert sim.counters['unplaced'] == 0 and sim.counters['fail_safes'] == 0


@both_detections
def test_nobody_comes_into_a_union(detection):
    """Fast points and balls from all around, on random unions; none is inside when it ends."""
    for seed, radius in ((0, 0.0), (1, 0.0), (2, 0.03), (3, 0.03)):
        parts, random = small_meshes.random_union(seed), np.random.default_rng(seed)
        place = random.normal(size=(400, 3))
        place *= 3.0 / np.linalg.norm(place, axis=1, keepdims=True)
        target = random.uniform(-0.8, 0.8, (400, 3))
        sim = run(joined(*parts), place, 10.0 * (target - place), detection=detection,
                  radius=radius, gravity=(0, 0, 0), restitution=0.5, dt=1 / 60)
        for _ in range(60):
            sim.step()
            assert small_meshes.height_in_union(parts, sim.position).min() > -1e-12
        assert sim.counters['collisions'] > 50 and sim.counters['unplaced'] == 0
