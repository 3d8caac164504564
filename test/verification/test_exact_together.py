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

"""Several colliders at once by the event-driven method, and colliders that nobody touches."""

from itertools import permutations

from numba import config
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import box, G, plane, simulate, sphere, UPRIGHT

pytestmark = pytest.mark.plain

compiled = pytest.mark.jit      # without the compiler they take minutes
interpreted = pytest.mark.skipif(not config.DISABLE_JIT, reason='runs without the compiler')

WEIGHTLESS = (0.0, 0.0, 0.0)
AWAY = [
    {'name': 'swing', 'shape': 'capsule', 'radius': 1.0, 'length': 2.0,
     'position': [0.0, 500.0, 0.0],
     'motion': {'oscillate': {'axis': [0, 0, 1], 'amplitude': 0.3, 'frequency': 37.0}}},
    box(position=(-300.0, 0.0, 0.0), name='spin', motion={'angular_velocity': [10.0, 3.0, 2.0]}),
    sphere(50.0, (0.0, 0.0, -400.0), name='still'),
    plane(point=(0.0, 0.0, -700.0), name='rising', motion={'linear_velocity': [0.0, 0.0, 2.0]}),
    {'name': 'around', 'shape': 'cylinder', 'radius': 800.0, 'length': 2000.0, 'inside': True,
     'motion': {'angular_velocity': [0.0, 0.0, 1.0]}}]


def funnel(count, degrees, tilt=0.0, **keys):
    """Give planes of a steepness about the origin, tilted together about the x axis [rad]."""
    steep, walls = np.radians(degrees), []
    for k in range(count):
        turn = 2.0 * np.pi * k / count
        x, y, z = np.sin(steep) * np.cos(turn), np.sin(steep) * np.sin(turn), np.cos(steep)
        normal = (x, np.cos(tilt) * y - np.sin(tilt) * z, np.sin(tilt) * y + np.cos(tilt) * z)
        walls.append(plane([float(a) for a in normal], name=f'wall{k}', **keys))
    return walls


def impulse_error(sim, before):
    """Step, and tell how far the impulses are from the changes of momentum less gravity's."""
    sim.step()
    impulse = np.zeros_like(before)
    np.add.at(impulse, sim.contacts.particle, sim.contacts.impulse)
    return abs(impulse - (sim.velocity - before - np.multiply(sim.dt, sim.scene.gravity))).max()


def settle(sim, steps):
    """Step; outside, without gain of energy, with all impulses, and never undecided."""
    energy = sim.energy()
    for _ in range(steps):
        assert impulse_error(sim, sim.velocity.copy()) <= 1e-9
        assert sim.clearance().min() >= -1e-14
        assert sim.energy() <= energy + 1e-13
        energy = sim.energy()
    for name in ('fail_safes', 'unplaced', 'undecided', 'repulsions'):
        assert sim.counters[name] == 0


@compiled
@pytest.mark.parametrize(('count', 'degrees', 'friction', 'tilt'), [
    (5, 69, {}, 0.0), (5, 69, {}, 0.1), (5, 20, {}, 0.0), (7, 80, {}, 0.0), (12, 85, {}, 0.0),
    (5, 69, {'dry': 0.1}, 0.0), (5, 69, {'wet': 0.5}, 0.0), (6, 45, {'dry': 0.2, 'wet': 0.1}, 0.2),
    (12, 60, {}, 0.1)])
def test_funnel(count, degrees, friction, tilt):
    """Without bounces a particle comes to rest at the apex, where more than three planes meet."""
    sim = simulate(funnel(count, degrees, tilt), (0.003, 0.004, 0.1), (0.1, 0.0, 0.0), dt=1 / 60,
                   method='exact', friction=friction)
    settle(sim, 40)
    assert sim.counters['collisions'] < 1000
    if 'wet' not in friction and degrees > 20:
        assert_array_equal(sim.velocity, 0.0)
        assert_allclose(sim.position, 0.0, atol=1e-15)


@compiled
@pytest.mark.parametrize(('count', 'degrees'), [(4, 30), (5, 69), (8, 50)])
@pytest.mark.parametrize('eps', [0.3, 1.0])
def test_bouncing_in_a_funnel(count, degrees, eps):
    """Whatever bounces in a funnel ends in its time, and with eps = 1 energy is kept."""
    sim = simulate(funnel(count, degrees), (0.01, 0.02, 0.1), dt=1 / 60, method='exact',
                   restitution=eps)
    start = sim.energy()
    settle(sim, 12)
    assert eps < 1.0 or sim.energy() == pytest.approx(start, rel=1e-12)


@compiled
def test_moving_funnel():
    """A funnel that moves carries the particle at its apex along."""
    velocity = (0.3, -0.2, 0.5)
    sim = simulate(funnel(5, 69, 0.1, motion={'linear_velocity': list(velocity)}),
                   (0.01, 0.02, 0.1), velocity, dt=1 / 60, method='exact')
    sim.step(40)
    assert_allclose(sim.velocity[0], velocity, rtol=0.0, atol=1e-15)
    assert_allclose(sim.position[0], sim.time * np.array(velocity), rtol=0.0, atol=1e-14)
    assert sim.counters['undecided'] == sim.counters['unplaced'] == 0


@compiled
@pytest.mark.parametrize('eps', [0.0, 0.5, 1.0])
@pytest.mark.parametrize(('count', 'degrees', 'tilt'), [
    (2, 45, 0.0), (3, 30, 0.0), (5, 69, 0.0), (4, 70, 0.1), (12, 80, 0.0)])
def test_straight_into_an_apex(count, degrees, tilt, eps):
    """Surfaces met at once answer at once: v' = -eps v where v is in the cone of the normals."""
    sim = simulate(funnel(count, degrees, tilt), (0.0, 0.0, 0.5), (0.0, 0.0, -2.0), dt=0.4,
                   gravity=WEIGHTLESS, method='exact', restitution=eps)
    assert impulse_error(sim, sim.velocity.copy()) <= 1e-14
    assert sim.counters['collisions'] == 1
    assert_allclose(sim.velocity[0], (0.0, 0.0, 2.0 * eps), rtol=0.0, atol=1e-13)
    assert_allclose(sim.position[0], (0.0, 0.0, 2.0 * eps * 0.15), rtol=0.0, atol=1e-13)


@compiled
def test_friction_of_two_surfaces_at_once():
    """Along the edge of a groove: mu times both impulses, each dv / (2 cos(45 deg))."""
    groove = [plane((1.0, 0.0, 1.0), name='left'), plane((-1.0, 0.0, 1.0), name='right')]
    for eps in (0.0, 0.5):
        sim = simulate(groove, (0.0, 0.0, 0.2), (0.0, 3.0, -2.0), dt=0.2, gravity=WEIGHTLESS,
                       method='exact', restitution=eps, friction={'dry': 0.3}, ledger=True)
        assert impulse_error(sim, sim.velocity.copy()) <= 1e-14
        slower = 0.3 * 2.0 * (1.0 + eps) * 2.0 / np.sqrt(2.0)
        assert_allclose(sim.velocity[0], (0.0, 3.0 - slower, 2.0 * eps), rtol=0.0, atol=1e-14)


@interpreted
@pytest.mark.parametrize('eps', [0.0, 0.5, 1.0])
def test_order_of_colliders_changes_no_bit(eps):
    """Four walls of a groove, a lid and a ball, in every order."""
    walls = [*funnel(3, 50, 0.1), sphere(0.3, (0.4, 0.1, 0.6)),
             box((0.2, 0.3, 0.4), (0.0, 0.3, 0.5))]
    states = set()
    for some in list(permutations(walls))[::7]:
        sim = simulate(some, [(0.05, 0.02, 0.3), (0.0, 0.0, 1.0)], (0.3, 0.1, -1.0), dt=0.05,
                       method='exact', restitution=eps, friction={'dry': 0.2})
        sim.step(6)
        states.add(sim.position.tobytes() + sim.velocity.tobytes())
    assert len(states) == 1


@interpreted
@pytest.mark.parametrize('drag', [None, {'linear': 0.7}, {'quadratic': 0.4}])
@pytest.mark.parametrize('floor', [plane(), plane((1.0, 0.0, 1.0), (0.0, 0.0, -1.0),
                                                  friction={'dry': 1.2}),
                                   sphere(1.0, (0.0, 0.0, -1.0)),
                                   box((4.0, 4.0, 4.0), (0.0, 0.0, 2.0), inside=True)])
def test_colliders_that_nobody_touches_change_no_bit(floor, drag):
    """Still, moving, swinging and turning ones, before and after those that matter."""
    keys = {'drag': drag} if drag else {}
    states = set()
    for some in ([floor], [floor, *AWAY], [*AWAY, floor], [AWAY[0], floor], [AWAY[3], floor]):
        sim = simulate(some, [(0.1, 0.05, 0.2), (0.0, 0.0, 0.0), (0.1, 0.0, 1.0)],
                       (0.3, 0.1, -1.0), dt=0.05, method='exact', restitution=0.5,
                       friction={'dry': 0.2}, **keys)
        sim.step(6)
        states.add(sim.position.tobytes() + sim.velocity.tobytes())
    assert len(states) == 1


@interpreted
def test_moving_a_collider_to_where_it_is_changes_no_bit():
    """A collider that is moved to the pose it has is one that stands still."""
    states = set()
    for moves in (False, True):
        sim = simulate([plane()], [(0.0, 0.0, 0.0), (0.1, 0.0, 0.2)],
                       [(0.2, 0.0, 0.3), (1.0, 0.0, -1.0)], dt=0.1, method='exact',
                       friction={'dry': 0.2})
        for _ in range(5):
            if moves:
                sim.move_collider('ground', (0.0, 0.0, 0.0), UPRIGHT)
            sim.step()
        states.add(sim.position.tobytes() + sim.velocity.tobytes())
    assert len(states) == 1


@compiled
@pytest.mark.parametrize('rates', [(9.4, -14.7, -6.9), (5.0, -14.7, -6.9), (9.4, -10.0, 3.0)])
@pytest.mark.parametrize('mu', [0.0, 0.5, 2.413])
def test_a_turning_plane_sweeps_along_a_drum(mu, rates):
    """Between a wall and a plane that turns towards it a particle stays outside of both."""
    drum = {'name': 'drum', 'shape': 'cylinder', 'radius': 1.7, 'length': 3.0, 'inside': True,
            'position': [0.1, 0.2, 0.2]}
    turning = plane(point=(0.1, 0.2, -0.7), motion={'angular_velocity': list(rates)})
    sim = simulate([drum, turning], (0.9, -1.3, 0.9), dt=0.02366, gravity=WEIGHTLESS,
                   method='exact', friction={'dry': mu})
    for _ in range(5):
        before, unplaced = sim.velocity.copy(), sim.counters['unplaced']
        error = impulse_error(sim, before)
        if sim.counters['unplaced'] > unplaced:
            break
        assert error <= 1e-9
        assert sim.clearance()[0] >= -1e-13
    assert sim.counters['undecided'] == 0
    assert sim.counters['collisions'] < 1000


@compiled
def test_rest_of_a_ball_in_a_corner_of_a_room():
    """A ball in the corner of a room rests on three faces of one collider; their sum is logged."""
    room = box((2.0, 2.0, 2.0), (0.0, 0.0, 1.0), inside=True)
    sim = simulate([room], (0.9, 0.9, 0.1), gravity=(1.0, 2.0, -G), dt=0.1, method='exact',
                   particles={'radius': 0.1})
    assert impulse_error(sim, sim.velocity.copy()) <= 1e-14
    assert_array_equal(sim.velocity, 0.0)
    assert_allclose(sim.contacts.impulse.sum(axis=0), (-0.1, -0.2, 0.1 * G), atol=1e-14)


@pytest.mark.parametrize('angle', [0.0, 1e-13, 1e-9, 1e-5, 1e-4])
def test_plates_that_close_are_not_a_wedge(angle):
    """Who is held between plates that are parallel but to rounding is stuck, and nobody throws."""
    sim = simulate([plane(), plane((np.sin(angle), 0.0, -np.cos(angle)), (0.0, 0.0, 1.0), 'lid',
                                   motion={'linear_velocity': [0.0, 0.0, -3.0]})],
                   (0.0, 0.0, 0.4), (0.1, 0.0, 0.0), gravity=WEIGHTLESS, dt=0.05, method='exact')
    sim.advance(0.35)
    assert sim.counters['unplaced'] == 1
    assert np.abs(sim.velocity).max() <= 3.0 and np.abs(sim.position).max() < 1.0


def test_a_wedge_that_closes_throws():
    """Its apex comes on at V / tan(angle), and drives a point along the floor at that speed."""
    angle = np.radians(5.0)
    sim = simulate([plane(), plane((-np.sin(angle), 0.0, -np.cos(angle)), (0.0, 0.0, 0.0), 'lid',
                                   motion={'linear_velocity': [0.0, 0.0, -1.0]})],
                   (-2.0, 0.0, 0.0), gravity=WEIGHTLESS, dt=0.05, method='exact')
    sim.advance(0.3)
    assert_allclose(sim.velocity[0], (-1.0 / np.tan(angle), 0.0, 0.0), atol=1e-12)
    assert sim.counters['unplaced'] == 0
