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

"""What must not matter: colliders that nobody touches, their order, moves that lead nowhere."""

from itertools import permutations

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import box, FAR, METHODS, plane, simulate, sphere, STAGED, UPRIGHT

pytestmark = pytest.mark.plain

every_method = pytest.mark.parametrize('method', METHODS)
SHAPES = {'sphere': {'radius': 1.0}, 'box': {'size': [1.2, 1.6, 2.0]},
          'capsule': {'radius': 0.5, 'length': 1.0}, 'cylinder': {'radius': 0.6, 'length': 2.0}}
TILT = (0.1, 0.2, 0.3, 0.9273618495495703)


def state(sim):
    """All numbers that a step leaves."""
    return np.concatenate([sim.position.ravel(), sim.velocity.ravel(),
                           list(sim.counters.values())])


@every_method
@pytest.mark.parametrize('radius', [0.01, 0.3, 3.0])
@pytest.mark.parametrize('tilt', [UPRIGHT, TILT])
@pytest.mark.parametrize('shape', SHAPES)
def test_a_ball_stays_outside_by_its_radius(method, shape, radius, tilt):
    """Dropped on the top of each shape from a millimetre above, however large it is (A1)."""
    ball = {'name': shape, 'shape': shape, 'position': [0, 0, 0], 'orientation': list(tilt),
            **SHAPES[shape]}
    sim = simulate([ball], (0.0, 0.0, 5.0), friction={'dry': 0.5}, method=method,
                   particles={'radius': radius})
    sim.position[0, 2] = 5.0 - sim.clearance()[0]
    while sim.clearance()[0] > 1e-3:        # the distance is convex along the way down
        sim.position[0, 2] -= sim.clearance()[0] - 5e-4
    sim.velocity[:] = (0.0, 0.0, -0.1)
    for _ in range(60):
        sim.step()
        assert sim.clearance()[0] > -1e-12
    assert sim.counters['repulsions'] == 0 and sim.counters['fail_safes'] == 0


@every_method
def test_a_ball_at_rest_on_a_sphere(method):
    """R = 1 and r = 0.05: it rests at z = 1.05 (A1)."""
    sim = simulate([sphere()], (0.0, 0.0, 1.05), friction={'dry': 0.5}, method=method,
                   particles={'radius': 0.05})
    sim.step(200)
    assert_allclose(sim.position[0], (0.0, 0.0, 1.05), atol=1e-15)
    assert sim.counters['repulsions'] == 0


@every_method
@pytest.mark.parametrize('detection', ['end_of_step', 'trajectory'])
def test_one_that_a_fast_collider_strikes_meets_what_is_far_away(method, detection):
    """What is beyond the reach of a particle before it is struck is not beyond it afterwards."""
    swing = {'oscillate': {'axis': [1, 0, 0], 'amplitude': 0.5, 'frequency': 10.0}}
    bat = box((0.2, 1.0, 1.0), (0.0, 0.0, 0.0), 'bat', motion=swing)    # 31 m/s in the middle
    wall = box((1.0, 9.0, 9.0), (1.0, 0.0, 0.0), 'wall')
    scene = {'gravity': (0.0, 0.0, 0.0), 'method': method, 'restitution': 1.0, 'dt': 1.0 / 100.0,
             'stepping': {'detection': detection}}
    sims = [simulate([bat, wall, *more], (0.11, 0.0, 0.0), **scene) for more in ([], FAR)]
    for _ in range(5):
        for sim in sims:
            sim.step()
            assert sim.clearance()[0] > -1e-12 or sim.counters['unplaced'] > 0
        assert_array_equal(state(sims[1]), state(sims[0]))


def press(others=()):
    """Give a floor, a press that comes down on it, and others."""
    floor = box((4.0, 4.0, 0.02), (0.0, 0.0, -0.01), 'floor')
    return [floor, box((4.0, 4.0, 0.02), (0.0, 0.0, 0.04), 'press',
                       motion={'linear_velocity': [0.0, 0.0, -0.5]}), *others]


@every_method
@pytest.mark.parametrize('detection', ['end_of_step', 'trajectory'])
def test_a_pressed_particle_takes_nothing_from_a_far_collider(method, detection):
    """
    It gets no more than the speed of the press, and not through the floor unsaid (A2).

    Without a collision stage some steps' fall comes on top: the change of the mean velocity is
    added to the end velocity.
    """
    highest = 0.5 if method in STAGED else 2.0
    far = box((1.0, 1.0, 1.0), (10.0, 0.0, 0.0), 'far', motion={'linear_velocity': [0, 0, -3]})
    colliders = press([far])
    sims = [simulate(some, (0.0, 0.0, 0.005), method=method, dt=1 / 60,
                     stepping={'detection': detection})
            for some in (press(), *permutations(colliders))]
    for _ in range(8):
        for sim in sims:
            sim.step()
            assert np.abs(sim.velocity[0, 2]) <= highest
            assert sim.position[0, 2] >= 0.0 or sim.counters['unplaced'] > 0
            assert_array_equal(sim.position, sims[0].position)
            assert_array_equal(sim.velocity, sims[0].velocity)


def test_nobody_is_blamed_for_a_blocked_path():
    """Thin walls that close in on a particle, with a rotor half a kilometre away (A2)."""
    walls = [box((0.001, 4.0, 4.0), (side * 0.02, 0.0, 0.0), 'wall' + 'ab'[side > 0],
                 motion={'linear_velocity': [-side * 2.0, 0.0, 0.0],
                         'angular_velocity': [0.0, side * 20.0, 0.0]}) for side in (-1, 1)]
    rotor = box((0.1, 0.1, 0.1), (500.0, 0.0, 0.0), 'rotor',
                motion={'angular_velocity': [0.0, 0.0, 100.0]})
    sims = [simulate(some, [(0.0, 0.1, 0.3), (0.001, -0.2, -0.4)], gravity=(0, 0, 0), dt=1 / 60,
                     velocity=(1.0, 0.5, -2.0), stepping={'detection': 'trajectory'}, ledger=True)
            for some in (walls, [rotor, *walls], [*walls, rotor], [walls[1], rotor, walls[0]])]
    for _ in range(10):
        for sim in sims:
            sim.step()
            assert_array_equal(state(sim), state(sims[0]))
            assert np.abs(sim.velocity).max() < 500.0
    assert sims[0].counters['fail_safes'] > 0


@every_method
@pytest.mark.parametrize('tilt', [0.0, 0.4])
def test_impulses_of_contacts_are_the_change_of_momentum(method, tilt):
    """In a V-groove that leans, with and without friction of its sides (A6)."""
    sides = [plane((np.sin(a), 0.2 * tilt, np.cos(a)), name=name, friction={'dry': mu})
             for name, a, mu in (('right', 0.9 + tilt, 0.3), ('left', -0.9, 0.0))]
    random = np.random.default_rng(0)
    sim = simulate(sides, random.uniform((-0.1, -1.0, 0.3), (0.1, 1.0, 1.0), (20, 3)),
                   restitution=0.4, method=method, dt=1 / 60)
    for _ in range(90):
        before = sim.velocity.copy()
        sim.step()
        total = np.zeros_like(before)
        np.add.at(total, sim.contacts.particle, sim.contacts.impulse)
        gained = sim.velocity - before - np.array(sim.scene.gravity) * sim.dt
        assert_allclose(total, gained, atol=1e-9)


@every_method
@pytest.mark.parametrize('given', ['as read', 'as in the scene'])
@pytest.mark.parametrize('shape', [
    {'shape': 'plane', 'normal': [0, 0, 1]},
    {'shape': 'box', 'size': [4, 4, 1], 'position': [0, 0, -0.5]},
    {'shape': 'box', 'size': [4, 4, 1], 'position': [0.3, 0, -0.6], 'orientation': list(TILT)}])
def test_moved_to_where_it_is(method, shape, given):
    """A collider that is moved to its own pose is one that stands still, to the last bit (F1)."""
    collider = {'name': 'ground', **shape, 'topic': 'pose'}
    start = [(0.0, 0.0, 0.0), (0.1, 0.2, 0.4)]
    scene = {'velocity': [(0.0, 0.0, 0.3), (1.0, 0.0, -2.0)], 'dt': 0.1, 'method': method,
             'friction': {'dry': 0.2}, 'restitution': 0.5}
    still, moved = (simulate([collider], start, **scene) for _ in range(2))
    for _ in range(12):
        pose = moved.collider_pose('ground') if given == 'as read' else (
            shape.get('position', (0, 0, 0)), shape.get('orientation', UPRIGHT))
        moved.move_collider('ground', *pose)
        for sim in (still, moved):
            sim.step()
        assert_array_equal(state(moved), state(still))


@every_method
def test_moved_evenly_is_scripted_to_move_evenly(method):
    """A support of constant velocity, given pose by pose, answers as the law says (F1, F4)."""
    motion = {'linear_velocity': [0.3, -0.2, 0.5]}
    scene = {'velocity': (0.3, 0.0, 0.8), 'dt': 0.1, 'method': method, 'friction': {'dry': 0.2}}
    scripted = simulate([plane(motion=motion)], (0.0, 0.0, 0.0), **scene)
    moved = simulate([plane(topic='pose')], (0.0, 0.0, 0.0), **scene)
    moved.position[0, 2] = scripted.position[0, 2] = 1.0
    for k in range(1, 30):
        moved.move_collider('ground', np.multiply(motion['linear_velocity'], 0.1 * k), UPRIGHT)
        for sim in (scripted, moved):
            sim.step()
        assert_allclose(moved.position, scripted.position, atol=1e-13)
        assert_allclose(moved.velocity, scripted.velocity, atol=1e-13)
