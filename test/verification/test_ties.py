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
A particle that is equally deep in several colliders: their order does not matter.

In a groove that is its own mirror image, what falls on the middle plane leaves in it.
"""

from itertools import permutations

import numpy as np
from numpy.testing import assert_array_equal
import pytest
from small_scenes import METHODS, simulate, STAGED

pytestmark = pytest.mark.plain

DETECTIONS = ('end_of_step', 'trajectory')


def planes(count, angle):
    """Give planes about z, whose normals are so many degrees off z."""
    angle = np.radians(angle)
    return [{'name': f'p{k}', 'shape': 'plane',
             'normal': [np.sin(angle) * np.cos(t), np.sin(angle) * np.sin(t), np.cos(angle)]}
            for k, t in enumerate(2.0 * np.pi * np.arange(count) / count)]


def groove(angle):
    """Give two planes that are mirror images in x, to the last bit."""
    x, z = np.sin(np.radians(angle)), np.cos(np.radians(angle))
    return [{'name': 'left', 'shape': 'plane', 'normal': [x, 0.0, z]},
            {'name': 'right', 'shape': 'plane', 'normal': [-x, 0.0, z]}]


def run(colliders, method, detection, steps=40, position=(0.0, 0.0, 0.35),
        velocity=(0.0, 0.3, -1.0), **scene):
    """States (steps, 6) of a ball after each step, and the simulation."""
    sim = simulate(colliders, position, velocity, particles={'radius': 0.1}, method=method,
                   dt=1 / 60, stepping={'detection': detection}, **scene)
    found = []
    for _ in range(steps):
        sim.step()
        found.append((*sim.position[0], *sim.velocity[0]))
    return np.array(found), sim


@pytest.mark.parametrize('angle', (20.0, 45.0, 60.0, 80.0))
@pytest.mark.parametrize('restitution', (0.0, 0.5, 1.0))
@pytest.mark.parametrize('detection', DETECTIONS)
@pytest.mark.parametrize('method', METHODS)
def test_a_ball_on_the_middle_plane_of_a_groove_stays_in_it(method, detection, restitution, angle):
    """It is hit by both planes at once, and leaves none of them sideways."""
    height = 0.2 + 0.1 / np.cos(np.radians(angle))
    states, _ = run(groove(angle), method, detection, position=(0.0, 0.0, height),
                    restitution=restitution, friction={'dry': 0.2})
    assert np.abs(states[:, (0, 3)]).max() < 1e-12


@pytest.mark.parametrize('detection', DETECTIONS)
@pytest.mark.parametrize('angle', (20.0, 45.0, 70.0))
def test_both_planes_of_a_groove_throw_a_ball_back(angle, detection):
    """Restitution acts once, along the middle plane, and nothing on the way along the groove."""
    states, sim = run(groove(angle), 'collision_then_contact', detection, restitution=0.5,
                      gravity=[0.0, 0.0, 0.0], steps=60)
    assert states[-1, 3:] == pytest.approx([0.0, 0.3, 0.5], abs=1e-12)
    assert sim.counters['collisions'] == 2 and sim.counters['fail_safes'] == 0


@pytest.mark.parametrize('method', METHODS)
def test_a_deep_start_in_a_groove_is_pushed_straight_up(method):
    """Both planes repel it alike, and the speed of the repulsion is not kept."""
    states, _ = run(groove(30.0), method, 'end_of_step', gravity=[0.0, 0.0, 0.0], steps=3,
                    position=(0.0, 0.0, 0.08), velocity=(0.0, 0.0, 0.0))
    assert np.abs(states[:, 0]).max() == 0.0
    assert (states[:, 2] > 0.08).all() and np.abs(states[:, 3:]).max() < 1e-15


@pytest.mark.parametrize('angle', (20.0, 45.0, 70.0))
@pytest.mark.parametrize(('count', 'restitution'), (
    (3, 0.0), (4, 0.0), (5, 0.0), (7, 0.0), (4, 0.5)))
@pytest.mark.parametrize('detection', DETECTIONS)
@pytest.mark.parametrize('method', METHODS)
def test_a_ball_on_the_axis_of_a_funnel_stays_on_it(method, detection, restitution, count, angle):
    """
    It is thrown back along the axis, and rests on it, on all planes at once.

    Bounces amplify what the axis is off by rounding; so they are asked for with four planes only.
    """
    height = 0.2 + 0.1 / np.cos(np.radians(angle))
    states, sim = run(planes(count, angle), method, detection, position=(0.0, 0.0, height),
                      velocity=(0.0, 0.0, -1.0), restitution=restitution, friction={'dry': 0.2},
                      ledger=True)
    assert np.abs(states[:, (0, 1, 3, 4)]).max() < 1e-12
    assert sim.counters['fail_safes'] == 0 and abs(sim.ledger.total.residual) < 1e-12
    if restitution == 0.0 and method in STAGED:
        assert_array_equal(states[-1], states[-2])


@pytest.mark.parametrize('restitution', (0.0, 1.0))
@pytest.mark.parametrize('detection', DETECTIONS)
@pytest.mark.parametrize('method', METHODS)
def test_the_order_of_the_planes_of_a_funnel_does_not_matter(method, detection, restitution):
    """Three planes are equally deep, with friction of their own; the same bits in any order."""
    funnel = planes(3, 50.0)
    for k, plane in enumerate(funnel):
        plane['friction'] = {'dry': 0.1 * k}
    first, _ = run(funnel, method, detection, restitution=restitution,
                   velocity=(0.0, 0.0, 0.0))
    for order in permutations(funnel):
        again, _ = run(list(order), method, detection, restitution=restitution,
                       velocity=(0.0, 0.0, 0.0))
        assert again.tobytes() == first.tobytes()


@pytest.mark.parametrize('detection', DETECTIONS)
@pytest.mark.parametrize('method', METHODS)
def test_the_order_of_two_tiles_does_not_matter_on_their_seam(method, detection):
    """They differ in their laws; the mirror image takes the same one."""
    tiles = [{'name': 'left', 'shape': 'box', 'size': [1.0, 1.0, 0.2], 'restitution': 1.0,
              'position': [-0.5, 0.0, -0.1]},
             {'name': 'right', 'shape': 'box', 'size': [1.0, 1.0, 0.2], 'restitution': 0.25,
              'friction': {'dry': 0.3}, 'position': [0.5, 0.0, -0.1]}]
    mirrored = [{**tile, 'position': [-tile['position'][0], 0.0, -0.1]} for tile in tiles]
    first, _ = run(tiles, method, detection)
    for other in (tiles[::-1], mirrored, mirrored[::-1]):
        again, _ = run(other, method, detection)
        assert again.tobytes() == first.tobytes()


def test_impulses_of_a_tie_are_the_change_of_momentum():
    """Contacts tell of both planes, of each what it has done."""
    _, sim = run(groove(30.0), 'collision_then_contact', 'trajectory', restitution=0.5,
                 friction={'dry': 0.2}, gravity=[0.0, 0.0, 0.0], steps=1,
                 position=(0.0, 0.0, 0.1 / np.cos(np.radians(30.0)) + 1e-3))
    one, two = sim.contacts.impulse
    assert one + two == pytest.approx(sim.velocity[0] - (0.0, 0.3, -1.0), abs=1e-15)
    assert one == pytest.approx(two * (-1.0, 1.0, 1.0), abs=1e-15)
