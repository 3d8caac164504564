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

"""Contacts of second order: measured orders on curved surfaces, against closed forms and ODEs."""

from math import cos, sin, sqrt

import numpy as np
from numpy.testing import assert_allclose
import pytest
from small_scenes import FAR, G, METHODS, order, plane, simulate, sphere

SECOND, DEFAULT = METHODS[3], METHODS[2]
PERIOD = 2.13913760055868884        # T42: 4 sqrt(R / g) K(sin(1/2)), R = 1, released at 1 rad
BOWL = [sphere(inside=True), *FAR]
DRUM = [{'name': 'drum', 'shape': 'cylinder', 'radius': 1.0, 'length': 9.0, 'inside': True,
         'orientation': [0.0, sqrt(0.5), 0.0, sqrt(0.5)]}, *FAR[:4]]        # along x
DETECTIONS = ('end_of_step', 'trajectory')
every_detection = pytest.mark.parametrize('detection', DETECTIONS)

pytestmark = pytest.mark.jit


def slide(colliders, start, velocity, duration, count, method=SECOND, detection=DETECTIONS[0],
          **keys):
    """State of a particle after `count` steps that make up `duration`."""
    sim = simulate(colliders, start, velocity, dt=duration / count, method=method,
                   stepping={'detection': detection}, **keys)
    sim.step(count)
    assert sim.counters['fail_safes'] == sim.counters['undecided'] == 0
    assert sim.clearance()[0] >= -1e-15
    return sim


def integrate(rate, state, duration, count=4000):
    """Solve state' = rate(state) by the classical method of Runge and Kutta."""
    h = duration / count
    for _ in range(count):
        k1 = rate(state)
        k2 = rate(state + 0.5 * h * k1)
        k3 = rate(state + 0.5 * h * k2)
        k4 = rate(state + h * k3)
        state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return state


def round_slide(axes, side, dry=0.0, wet=0.0, obj=lambda x: np.zeros(3)):
    """
    Rate of (x, v) of a particle that slides on a round surface of radius 1 about the origin.

    axes (3,): 1 where the surface is round, 0 along a cylinder; side: -1 inside, 1 outside; obj:
    velocity of the surface at a place.
    """
    def rate(state):
        x, v = state[:3], state[3:]
        out = axes * x / np.linalg.norm(axes * x)
        push = side * (G * out[2] - (axes * v) @ v)     # N / m along side * out
        slip = v - obj(x)
        slip -= (slip @ out) * out
        speed = np.linalg.norm(slip)
        friction = -(dry / speed + wet) * push * slip
        return np.concatenate([v, side * push * out + friction + (0.0, 0.0, -G)])
    return rate


@every_detection
def test_the_sphere_top(detection):
    """T39: place after leaving the ball, for 128, 512, 2048, 8192 steps: as the prototype."""
    errors = []
    for count in (128, 512, 2048, 8192):
        sim = simulate([sphere()], (sin(0.1), 0.0, cos(0.1)), dt=1.2 / count, method=SECOND,
                       stepping={'detection': detection})
        sim.step(count)
        errors.append(np.linalg.norm(
            sim.position[0] - (1.243930772593345, 0.0, -0.316542575433447)))
    assert (np.array(errors) < 2.0 * np.array((4.5e-5, 3.5e-6, 1.9e-7, 3.1e-8))).all()


@every_detection
@pytest.mark.parametrize('eps', [0.0, 1.0])
def test_a_period_in_the_bowl(detection, eps):
    """T42: place after a period, for 64, 256, 1024, 4096 steps; no slide is a collision."""
    errors, start = [], np.array((sin(1.0), 0.0, -cos(1.0)))
    for count in (64, 256, 1024, 4096):
        sim = slide(BOWL, start, (0.0, 0.0, 0.0), PERIOD, count, detection=detection,
                    restitution=eps)
        errors.append(np.linalg.norm(sim.position[0] - start))
        assert sim.counters['collisions'] == 0
    assert_allclose(errors, (1.9e-5, 7.5e-8, 2.9e-10, 1.2e-12), rtol=0.05)


def test_the_bowl_keeps_its_energy():
    """Fact 5: dt = 1/128: over a hundred periods the energy of each turn is that of the first."""
    sim = simulate(BOWL, (sin(1.0), 0.0, -cos(1.0)), dt=1 / 128, method=SECOND)
    energy, worst = sim.energy(), 0.0
    for _ in range(100):
        sim.advance(PERIOD)
        worst = max(worst, abs(sim.energy() - energy))
    assert worst < 1e-3 * G


@every_detection
def test_a_circle_without_gravity(detection):
    """T43: the speed is kept to rounding; the other methods lose v dt / R of it per radian."""
    sim = slide(BOWL, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), 10.0, 1000, detection=detection,
                gravity=(0.0, 0.0, 0.0))
    assert np.linalg.norm(sim.velocity[0]) == pytest.approx(1.0, abs=1e-13)


INSIDE = ((sin(1.0), 0.0, -cos(1.0)), (0.0, 1.5, 0.0), 0.9)
ON_TOP = ((sin(0.1), 0.0, cos(0.1)), (0.7 * cos(0.1), 0.5, -0.7 * sin(0.1)), 0.35)
IN_DRUM = ((0.0, -sin(1.0), -cos(1.0)), (0.8, 0.0, 0.0), 0.5)
ALL, ACROSS = np.ones(3), np.array((0.0, 1.0, 1.0))


@every_detection
@pytest.mark.parametrize(('colliders', 'axes', 'side', 'case'), [
    (BOWL, ALL, -1.0, INSIDE), ([sphere(), *FAR], ALL, 1.0, ON_TOP),
    (DRUM, ACROSS, -1.0, IN_DRUM)], ids=['bowl', 'ball', 'drum'])
@pytest.mark.parametrize('friction', [
    {}, {'dry': 0.2}, {'wet': 0.5}, {'dry': 0.1, 'wet': 0.3}], ids=str)
def test_slides_are_of_second_order(detection, colliders, axes, side, case, friction):
    """A slide whose direction turns, with every friction: order 2, against its ODE."""
    start, velocity, duration = case
    exact = integrate(round_slide(axes, side, **friction), np.array(start + velocity), duration)
    counts, errors = np.array([50, 101, 199, 402]), []
    for count in counts:
        sim = slide(colliders, start, velocity, duration, count, detection=detection,
                    friction=friction)
        errors.append(np.linalg.norm(sim.position[0] - exact[:3])
                      + np.linalg.norm(sim.velocity[0] - exact[3:]))
    assert order(duration / counts, errors) == pytest.approx(2.0, abs=0.15)
    first = slide(colliders, start, velocity, duration, counts[-1], DEFAULT, friction=friction)
    assert errors[-1] < 0.05 * np.linalg.norm(first.position[0] - exact[:3])


@every_detection
def test_slide_in_a_turning_bowl(detection):
    """With friction that a bowl drags along, which turns about a skew axis: order 2."""
    spin = np.array((1.0, 2.0, 3.0))
    bowl = [sphere(inside=True, motion={'angular_velocity': spin.tolist()}), *FAR]
    start, velocity, duration = INSIDE
    rate = round_slide(ALL, -1.0, dry=0.2, obj=lambda x: np.cross(spin, x))
    exact = integrate(rate, np.array(start + velocity), duration)
    counts, errors = np.array([101, 199, 402]), []
    for count in counts:
        sim = slide(bowl, start, velocity, duration, count, detection=detection,
                    friction={'dry': 0.2})
        errors.append(np.linalg.norm(sim.position[0] - exact[:3]))
    assert order(duration / counts, errors) == pytest.approx(2.0, abs=0.15)


def ring(mu):
    """Rate of (angle, angular velocity) in the groove of a bowl and a wall at y = 0.6."""
    depth, rho = 0.6, 0.8

    def rate(state):
        angle, speed = state
        bowl = (rho * speed ** 2 + G * cos(angle)) / rho
        wall = 20.0 - depth * bowl
        assert wall > 0.0
        drag = mu * (bowl + wall) * (1.0 if speed > 0.0 else -1.0)
        return np.array((speed, (-G * sin(angle) - drag) / rho))
    return rate


@every_detection
@pytest.mark.parametrize('mu', [0.0, 0.1])
def test_a_curved_groove(detection, mu):
    """Where a wall cuts a bowl, both pressed on: solved jointly, order 2."""
    colliders = [*BOWL, plane((0.0, -1.0, 0.0), (0.0, 0.6, 0.0), name='wall')]
    duration = 0.35
    angle, speed = integrate(ring(mu), np.array((1.0, 0.0)), duration)
    exact = (0.8 * sin(angle), 0.6, -0.8 * cos(angle))
    counts, errors = np.array([20, 41, 79, 162]), []
    for count in counts:
        sim = slide(colliders, (0.8 * sin(1.0), 0.6, -0.8 * cos(1.0)), (0.0, 0.0, 0.0), duration,
                    count, detection=detection, gravity=(0.0, 20.0, -G), friction={'dry': mu})
        errors.append(np.linalg.norm(sim.position[0] - exact))
        assert sim.counters['collisions'] == 0
    assert speed < 0.0
    assert order(duration / counts, errors) == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize('wet', [0.0, 1.0])
def test_an_acute_groove_takes_two_passes(wet):
    """T55: at 0.1 degrees passes in turn would take 1e5; jointly it is exact on planes."""
    half = np.radians(0.1)
    colliders = [plane((cos(half), 0.0, sin(half)), name='left'),
                 plane((-cos(half), 0.0, sin(half)), name='right')]
    mu, speed = 1e-4, 3.0
    sim = simulate(colliders, (0.0, 0.0, 0.0), (0.0, speed, 0.0), dt=1 / 240, method=SECOND,
                   friction={'dry': mu, 'wet': 1e-4 * wet})
    sim.step(48)
    assert sim.counters['contacts'] == 2 * 48
    push = G / sin(half)
    if wet:
        k, c = 1e-4 * wet * push, mu * push         # v' = -c - k v
        expected = (speed + c / k) * np.exp(-k * sim.time) - c / k
        assert sim.velocity[0, 1] == pytest.approx(expected, rel=1e-4)
    else:
        assert sim.velocity[0, 1] == pytest.approx(speed - mu * push * sim.time, rel=1e-9)


@every_detection
@pytest.mark.parametrize('eps', [0.0, 0.5])
def test_hops_end(detection, eps):
    """After a landing in a bowl hops die out, and what is left slides without loss."""
    sim = simulate(BOWL, (0.3, 0.0, -0.5), (1.0, 2.0, 0.0), dt=1e-3, method=SECOND,
                   restitution=eps, stepping={'detection': detection})
    sim.step(4000)
    collisions, energy = sim.counters['collisions'], sim.energy()
    assert collisions < 20
    sim.step(4000)
    assert sim.counters['collisions'] == collisions
    assert sim.energy() == pytest.approx(energy, abs=1e-5)


@pytest.mark.parametrize('place', [(0.0, 0.0, 0.0), (1e3, -2e4, 5e2)])
def test_far_from_the_origin(place):
    """Where the normal of a bowl is rounded a slide is no collision: eps has no say."""
    sim = simulate([sphere(position=place, inside=True), *FAR], np.add(place, (0.0, 0.0, -1.0)),
                   (2.0, 1.0, 0.0), dt=1e-3, method=SECOND, restitution=0.5)
    sim.step(1000)
    assert sim.counters['collisions'] == 0
    kinetic = 0.5 * np.sum(sim.velocity[0] ** 2)
    height = sim.position[0, 2] - place[2] + 1.0
    assert kinetic + G * height == pytest.approx(2.5, abs=1e-5)


def test_drop_into_a_spinning_drum_keeps_to_its_wall():
    """Coarse steps, up to 0.4 radian each, in a drum that takes the particle along."""
    drum = [{**DRUM[0], 'orientation': [0.0, 0.0, 0.0, 1.0],
             'motion': {'angular_velocity': [0.0, 0.0, 6.0]}}, *FAR[:4]]
    sim = simulate(drum, (0.9, 0.0, 0.0), dt=1 / 16, method=SECOND, gravity=(0.0, 0.0, 0.0),
                   friction={'dry': 2.0}, restitution=0.3)
    sim.velocity[0] = (1.0, 0.0, 0.0)
    for _ in range(300):
        sim.step()
        assert sim.clearance()[0] >= 0.0
        assert np.linalg.norm(sim.velocity[0]) <= 6.0 * (1.0 + 1e-12)
    assert np.linalg.norm(sim.velocity[0]) == pytest.approx(6.0, rel=1e-9)
    assert sim.counters['fail_safes'] == 0
