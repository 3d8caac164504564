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
One particle and moving colliders, against closed forms.

Colliders move by a script, by poses alone (twists are then estimated) or by poses with twists.
"""

from math import cos, cosh, pi, sin, sinh, sqrt, tan

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import (EPSILON, FAR, FIRST_ORDER, G, incline, METHODS, order, plane,
                          root_mean_square, simulate, swinging_wall, UPRIGHT)

pytestmark = pytest.mark.plain

every_method = pytest.mark.parametrize('method', METHODS)
WEIGHTLESS = (0.0, 0.0, 0.0)


def follow(sim, name, path, steps, speed=None):
    """Move a collider along path(t) over the next steps, with the velocity speed(t) if known."""
    times = sim.time + sim.dt * np.arange(1, steps + 1)
    places = np.array([path(t) for t in times])
    twists = None if speed is None else np.array([(*speed(t), 0.0, 0.0, 0.0) for t in times])
    sim.move_collider(name, places, np.tile(UPRIGHT, (steps, 1)), twists)


def turning(rate, **keys):
    """Give a plane that turns about +z [rad/s]."""
    return plane(motion={'angular_velocity': [0.0, 0.0, rate]}, **keys)


def radius(sim):
    """Distance from the z axis."""
    return np.hypot(sim.position[:, 0], sim.position[:, 1])


@every_method
@pytest.mark.parametrize('eps', [0.0, 0.5, 1.0])
@pytest.mark.parametrize('scripted', [True, False])
def test_moving_wall(method, eps, scripted):
    """T23: v' = V - eps (v - V), whether the wall is scripted or follows poses."""
    wall = plane(motion={'linear_velocity': [0.0, 0.0, 1.5]}) if scripted else plane()
    sim = simulate([wall], (0.0, 0.0, 0.3), (0.0, 0.0, -4.0), gravity=WEIGHTLESS,
                   restitution=eps, method=method)
    if not scripted:
        follow(sim, 'ground', lambda t: (0.0, 0.0, 1.5 * t), 30)
    sim.step(30)
    assert sim.velocity[0, 2] == pytest.approx(1.5 - eps * (-4.0 - 1.5), abs=64 * EPSILON)
    assert sim.counters['collisions'] == 1 or eps == 0.0


@every_method
@pytest.mark.jit
def test_moving_wall_bounce_is_first_order(method):
    """T23: place and velocity after a bounce from a wall that oscillates."""
    eps = 0.5
    wall, start, after, place = swinging_wall(eps)
    steps, errors, speeds = [0.00507, 0.002511, 0.001253, 0.0006251, 0.0003127], [], []
    for dt in steps:
        sim = simulate([wall], start, (0.0, 0.0, -2.0), dt=dt,
                       gravity=WEIGHTLESS, restitution=eps, method=method)
        sim.advance(0.4)
        exact = place(sim.time)
        assert sim.counters['collisions'] == len(start)
        errors.append(root_mean_square(sim.position[:, 2] - exact))
        speeds.append(root_mean_square(sim.velocity[:, 2] - after))
    assert order(steps, errors) == pytest.approx(1.0, abs=0.15)
    assert order(steps, speeds) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize('eps', [0.0, 0.5, 1.0])
def test_platform_that_accelerates_up(eps):
    """T25: a = 3: the particle stays, its gap 0, and keeps the velocity of the platform."""
    sim = simulate([plane()], (0.0, 0.0, 0.0), restitution=eps)
    follow(sim, 'ground', lambda t: (0.0, 0.0, 1.5 * t * t), 480)
    for _ in range(480):
        sim.step()
        assert sim.clearance()[0] == pytest.approx(0.0, abs=4 * EPSILON * 6.0)
    assert sim.velocity[0, 2] == pytest.approx(3.0 * sim.time, abs=1e-12)
    # N / m = g + a, as an impulse over a step
    assert sim.contacts.impulse[0, 2] == pytest.approx((G + 3.0) * sim.dt, rel=1e-9)


@pytest.mark.parametrize('method', METHODS[:2])
def test_platform_that_accelerates_up_without_restitution(method):
    """T25: the other methods with eps = 0: no gap; the end velocity is half a step's behind."""
    sim = simulate([plane()], (0.0, 0.0, 0.0), method=method)
    follow(sim, 'ground', lambda t: (0.0, 0.0, 1.5 * t * t), 480)
    sim.step(480)
    assert sim.clearance()[0] == pytest.approx(0.0, abs=4 * EPSILON * 6.0)
    assert sim.velocity[0, 2] == pytest.approx(3.0 * sim.time, abs=(G + 3.0) * sim.dt)


@every_method
@pytest.mark.parametrize('known', [True, False], ids=['twists', 'poses'])
@pytest.mark.parametrize(('acceleration', 'gap'), [(G - 1e-9, 0.0), (G + 1e-9, 5e-10)])
def test_platform_that_falls_away(method, known, acceleration, gap):
    """T27: stays in contact for a < g, separates by (a - g) t^2 / 2 for a > g, 1e-9 beside it."""
    sim = simulate([plane()], (0.0, 0.0, 0.0), restitution=0.5, method=method)
    follow(sim, 'ground', lambda t: (0.0, 0.0, -0.5 * acceleration * t * t), 240,
           (lambda t: (0.0, 0.0, -acceleration * t)) if known else None)
    sim.step(240)
    assert sim.clearance()[0] == pytest.approx(gap, abs=240 * 5.0 * EPSILON)


@every_method
def test_conveyor(method):
    """T29: V = 1, mu = 0.4: slips over V^2 / (2 mu g), then stays at its place on the belt."""
    dt, mu = 1 / 240, 0.4
    sim = simulate([plane(motion={'linear_velocity': [1.0, 0.0, 0.0]})], (0.0, 0.0, 0.0),
                   friction={'dry': mu}, dt=dt, method=method)
    sim.step(240)
    slip = sim.time - sim.position[0, 0]
    # in the last step it slips with less than mu g dt for less than dt
    assert slip == pytest.approx(0.127420998980632008, abs=mu * G * dt ** 2)
    # the velocity of the belt is a difference of its positions over dt
    assert sim.velocity[0, 0] == pytest.approx(1.0, abs=2.0 * EPSILON * sim.time / dt)
    sim.step(2400)
    assert sim.time - sim.position[0, 0] == pytest.approx(slip, abs=2640 * 11.0 * EPSILON)


@every_method
def test_turntable_threshold(method):
    """
    T31: sticks for r < mu g dt^2 / (4 sin^2(omega dt / 2)), the discrete mu g / omega^2.

    For the end velocity of the third method it is mu g dt / (2 omega sin(omega dt / 2)), which is
    smaller by (omega dt)^2 / 24 = 3e-6.
    """
    omega, mu, dt = 2.0, 0.5, 1 / 240
    limit = mu * G * dt ** 2 / (4.0 * sin(0.5 * omega * dt) ** 2)
    assert limit == pytest.approx(1.22625, rel=(omega * dt) ** 2 / 12 * 1.01)
    for r, sticks in ((limit * (1.0 - 1e-5), True), (limit * (1.0 + 1e-4), False)):
        sim = simulate([turning(omega)], (r, 0.0, 0.0), (0.0, r * omega, 0.0), dt=dt,
                       friction={'dry': mu}, method=method)
        sim.step(1200)
        drift = radius(sim)[0] / r - 1.0
        assert abs(drift) < 1e-12 if sticks else drift > 1e-3


@every_method
def test_turntable_of_ten_revolutions(method):
    """Fact 7: with the chord velocity of the material point the radius is kept to rounding."""
    sim = simulate([turning(2.0 * pi)], (0.1, 0.0, 0.0), (0.0, 0.2 * pi, 0.0), dt=1 / 64,
                   friction={'dry': 5.0}, method=method)
    sim.step(640)
    assert radius(sim)[0] == pytest.approx(0.1, rel=2e-14)
    assert_allclose(sim.position[0], (0.1, 0.0, 0.0), atol=1e-13)


@pytest.mark.parametrize('known', [True, False], ids=['twists', 'poses'])
def test_turntable_that_follows_poses(known):
    """Fact 7: the same where a program sends the poses, in large steps of 1/8 revolution."""
    sim = simulate([plane()], (0.1, 0.0, 0.0), (0.0, 0.2 * pi, 0.0), dt=1 / 8,
                   friction={'dry': 50.0})
    angles = 0.5 * np.pi * 0.5 * np.arange(1, 81)
    turns = np.zeros((80, 4))
    turns[:, 2], turns[:, 3] = np.sin(0.5 * angles), np.cos(0.5 * angles)
    twists = np.tile((0.0, 0.0, 0.0, 0.0, 0.0, 2.0 * pi), (80, 1)) if known else None
    sim.move_collider('ground', np.zeros((80, 3)), turns, twists)
    sim.step(80)
    assert_allclose(sim.position[0], (0.1, 0.0, 0.0), atol=80 * 4 * EPSILON)


@every_method
@pytest.mark.jit
def test_rotating_blade(method):
    """T33: a frictionless radial blade: r = r0 cosh(omega t), to the order of the method."""
    omega, r0 = 2.0 * pi, 0.1
    steps, errors, speeds = [], [], []
    for count in (257, 1021, 4099, 16411):
        dt = 0.25 / count
        sim = simulate([turning(omega, normal=(0.0, 1.0, 0.0))], (r0, 0.0, 0.0),
                       (0.0, r0 * omega, 0.0), gravity=WEIGHTLESS, dt=dt, method=method)
        sim.step(count)
        steps.append(dt)
        errors.append(abs(radius(sim)[0] - 0.250917847865805678))
        out = sim.velocity[0] @ sim.position[0] / radius(sim)[0]
        speeds.append(abs(out - 1.44594874504057057))
    assert r0 * cosh(0.5 * pi) == pytest.approx(0.250917847865805678, rel=1e-15)
    assert r0 * omega * sinh(0.5 * pi) == pytest.approx(1.44594874504057057, rel=1e-15)
    expected = 1.0 if method in FIRST_ORDER else 2.0
    assert order(steps, errors) == pytest.approx(expected, abs=0.15)
    assert order(steps, speeds) == pytest.approx(expected, abs=0.15)


def test_force_of_a_rotating_blade():
    """T33: N = 2 m omega r_dot, as the impulse of a step."""
    omega, r0, count = 2.0 * pi, 0.1, 4096
    sim = simulate([turning(omega, normal=(0.0, 1.0, 0.0))], (r0, 0.0, 0.0),
                   (0.0, r0 * omega, 0.0), gravity=WEIGHTLESS, dt=0.25 / count,
                   particles={'mass': 3.0})
    sim.step(count)
    force = np.linalg.norm(sim.contacts.impulse[0]) / sim.dt
    assert force == pytest.approx(3.0 * 2.0 * omega * 1.44594874504057057, rel=2 * omega * sim.dt)


@pytest.mark.parametrize(('mu', 'acceleration', 'stays'), [
    (0.0, G * tan(pi / 6), True), (0.2, 3.31860647268267355 * (1 + 1e-6), True),
    (0.2, 8.62130917538537625 * (1 - 1e-6), True), (0.2, 5.0, True),
    (0.2, 3.2, False), (0.2, 8.8, False)])
def test_accelerating_wedge(mu, acceleration, stays):
    """T36: no relative motion at a = g tan(30 deg), or within the cone of friction about it."""
    a = acceleration
    sim = simulate([incline(pi / 6)], (0.0, 0.0, 0.0), friction={'dry': mu})
    sim.set_parameter('gravity', WEIGHTLESS)        # a step in which it is known to be at rest
    sim.move_collider('ground', (0.0, 0.0, 0.0), UPRIGHT, (0.0, ) * 6)
    sim.step()
    sim.set_parameter('gravity', (0.0, 0.0, -G))
    begin = sim.time
    follow(sim, 'ground', lambda t: (-0.5 * a * (t - begin) ** 2, 0.0, 0.0), 480,
           lambda t: (-a * (t - begin), 0.0, 0.0))
    sim.step(480)
    way = np.linalg.norm(sim.position[0] - sim.collider_pose('ground')[0])
    assert way < 1e-12 if stays else way > 0.05


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize('acceleration', [3.6, 5.0, 8.2])
def test_accelerating_wedge_by_poses_alone(method, acceleration):
    """T36: where twists are only estimated, well within the cone: less than v_T of a step."""
    sim = simulate([incline(pi / 6)], (0.0, 0.0, 0.0), friction={'dry': 0.2}, method=method)
    follow(sim, 'ground', lambda t: (-0.5 * acceleration * t * t, 0.0, 0.0), 480)
    sim.step(480)
    way = np.linalg.norm(sim.position[0] - sim.collider_pose('ground')[0])
    assert way < acceleration * sim.dt ** 2 * 10


@every_method
@pytest.mark.parametrize('speed', [1.0, 1e3, 1e6])
def test_galilean_copy(method, speed):
    """T38: a velocity added to everything changes nothing relative, to ulp(position) a step."""
    steps = 480
    particles = [(0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.5, 0.0, 0.3)]
    velocities = np.array([(1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 1.0, -2.0)])
    scene = {'friction': {'dry': 0.3}, 'restitution': 0.5, 'method': method}
    rest = simulate([plane(motion={'linear_velocity': [0.0, 0.0, 0.0]})], particles, velocities,
                    **scene)
    copy = simulate([plane(motion={'linear_velocity': [speed, 0.0, 0.0]})], particles,
                    velocities + (speed, 0.0, 0.0), **scene)
    rest.step(steps)
    copy.step(steps)
    moved = copy.position - (speed * copy.time, 0.0, 0.0)
    ulp = EPSILON * speed * copy.time
    assert_allclose(moved, rest.position, rtol=0.0, atol=1e-14 + 2.0 * steps * ulp)
    assert_allclose(copy.velocity - (speed, 0.0, 0.0), rest.velocity, rtol=0.0,
                    atol=1e-13 + steps * EPSILON * speed)


@every_method
def test_galilean_copy_across_the_surface(method):
    """T38: the same with the velocity along the normal, where the gap itself rounds."""
    steps, speed = 480, 64.0        # a power of two: the positions round less
    particles = [(0.0, 0.0, 1.0), (0.0, 0.0, 0.5)]
    scene = {'friction': {'dry': 0.3}, 'restitution': 0.0, 'method': method, 'dt': 1 / 256}
    rest = simulate([plane(motion={'linear_velocity': [0.0, 0.0, 0.0]})], particles,
                    (1.0, 0.0, 0.0), **scene)
    copy = simulate([plane(motion={'linear_velocity': [0.0, 0.0, speed]})], particles,
                    (1.0, 0.0, speed), **scene)
    rest.step(steps)
    copy.step(steps)
    moved = copy.position - (0.0, 0.0, speed * copy.time)
    assert_allclose(moved, rest.position, rtol=0.0, atol=steps * EPSILON * speed * copy.time)


@every_method
@pytest.mark.parametrize('gap', [1.0, 1e-3])
def test_moving_together_is_no_hit(method, gap):
    """T77: particle and wall at 1e8 m/s: nothing touches."""
    speed = 1e8
    sim = simulate([plane(motion={'linear_velocity': [0.0, 0.0, speed]})], (0.0, 0.0, gap),
                   (0.0, 0.0, speed), gravity=WEIGHTLESS, dt=1e-3, method=method)
    sim.step(1000)
    assert sim.counters == dict.fromkeys(sim.counters, 0)
    assert sim.velocity[0, 2] == speed
    assert sim.clearance()[0] == pytest.approx(gap, abs=1000 * EPSILON * speed)


@every_method
@pytest.mark.parametrize('shape', ['plane', 'ball'])
def test_teleport_over_a_particle(method, shape):
    """T81: no impulse from a jump; the particle is pushed out at no more than the cap."""
    ball = {'name': 'ground', 'shape': 'sphere', 'radius': 0.5, 'position': [9.0, 0.0, 0.0]}
    start = plane(point=(0.0, 0.0, -9.0)) if shape == 'plane' else ball
    sim = simulate([start, *FAR], (0.0, 0.0, 0.0), gravity=WEIGHTLESS, restitution=1.0,
                   method=method)
    sim.step(3)
    sim.place_collider('ground', (0.0, 0.0, 0.3) if shape == 'plane' else (0.0, 0.0, -0.2),
                       UPRIGHT)
    depth = -sim.clearance()[0]
    assert depth == pytest.approx(0.3, abs=1e-15)
    for _ in range(200):
        before = sim.position[0].copy()
        sim.step()
        assert_array_equal(sim.velocity[0], 0.0)
        assert np.linalg.norm(sim.position[0] - before) <= 10.0 * sim.dt * (1.0 + 1e-12)
    assert -1e-6 * depth <= sim.clearance()[0] <= 1e-15


def test_one_step_jump_of_a_pose_is_a_fast_wall():
    """T81: the other side: move_collider sweeps, so that the jump is a velocity."""
    sim = simulate([plane(point=(0.0, 0.0, -0.5))], (0.0, 0.0, 0.0), gravity=WEIGHTLESS)
    sim.move_collider('ground', (0.0, 0.0, 0.5), UPRIGHT)
    sim.step()
    assert sim.velocity[0, 2] == pytest.approx(240.0, rel=1e-12)
    assert sim.clearance()[0] >= 0.0


@pytest.mark.parametrize('method', METHODS)
def test_oscillating_platform(method):
    """A particle rides along while the platform accelerates by less than g, not beyond."""
    for frequency, stays in ((2.0, True), (3.0, False)):       # A w^2 = 7.9, 17.8 m/s^2 at 0.05 m
        swing = {'axis': [0, 0, 1], 'amplitude': 0.05, 'frequency': frequency}
        start = (0.0, 0.0, 2.0 * pi * frequency * 0.05)
        sim = simulate([plane(motion={'oscillate': swing})], (0.0, 0.0, 0.0), start, dt=1 / 1000,
                       method=method)
        gap = 0.0
        for _ in range(1000):
            sim.step()
            gap = max(gap, sim.clearance()[0])
        assert gap < 1e-5 if stays else gap > 1e-3


def test_friction_with_a_rotated_moving_collider():
    """A box that moves by poses drags a particle along like any other conveyor."""
    angle = 0.3
    turn = (0.0, 0.0, sin(angle / 2), cos(angle / 2))
    sim = simulate([{'name': 'belt', 'shape': 'box', 'size': [40.0, 40.0, 2.0],
                     'position': [0.0, 0.0, -1.0], 'orientation': list(turn)}, *FAR],
                   (0.0, 0.0, 0.0), friction={'dry': 0.4})
    places = np.array([(k / 240, 0.0, -1.0) for k in range(1, 481)])
    sim.move_collider('belt', places, np.tile(turn, (480, 1)))
    sim.step(480)
    assert sim.time - sim.position[0, 0] == pytest.approx(0.127420998980632008, abs=3e-3)
    assert sim.velocity[0, 0] == pytest.approx(1.0, abs=1e-12)
    assert sqrt(sim.velocity[0] @ sim.velocity[0]) == pytest.approx(1.0, abs=1e-12)
