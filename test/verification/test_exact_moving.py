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

"""The event-driven method with moving colliders and with balls, against closed forms."""

from math import cos, cosh, pi, sin, sinh, sqrt, tan

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import (box, EPSILON, FAR, G, incline, plane, simulate, sphere, swinging_wall,
                          UPRIGHT)
from test_exact_events import every_dt, WEIGHTLESS
from test_moving import follow, turning

pytestmark = pytest.mark.jit     # without the compiler they take minutes

DRIFTING = [{**FAR[0], 'motion': {'linear_velocity': [0.0, 0.0, 1e-3]}}, *FAR[1:]]
POINT = 1e-300                  # radius of a point that has the kernels of balls


def build(colliders, position, velocity=(0.0, 0.0, 0.0), radius=POINT, dt=0.3, **keys):
    """Make a simulation; all tests here share the kernels for moving colliders and for balls."""
    particles = {'radius': radius, 'mass': keys.pop('mass', 1.0)}
    return simulate([*colliders, *DRIFTING], position, velocity, particles=particles, dt=dt,
                    method='exact', **keys)


def run(colliders, position, velocity=(0.0, 0.0, 0.0), *, duration, **keys):
    """Simulate for a duration; nobody ends inside or undecided."""
    sim = build(colliders, position, velocity, **keys)
    sim.advance(duration)
    assert sim.counters['fail_safes'] == sim.counters['undecided'] == 0
    assert (sim.clearance() >= -1e-12).all()
    return sim


@every_dt
@pytest.mark.parametrize('eps', [0.0, 0.5, 1.0])
def test_moving_wall(dt, eps):
    """T23: v' = V - eps (v - V) from where they meet."""
    wall = plane(motion={'linear_velocity': [0.0, 0.0, 1.5]})
    sim = run([wall], (0.0, 0.0, 0.3), (0.0, 0.0, -4.0), gravity=WEIGHTLESS, duration=0.7, dt=dt,
              restitution=eps)
    hit, after = 0.3 / 5.5, 1.5 + 5.5 * eps
    assert sim.velocity[0, 2] == pytest.approx(after, abs=1e-14)
    assert sim.position[0, 2] == pytest.approx(1.5 * hit + after * (0.7 - hit), abs=1e-13)


@every_dt
def test_swinging_wall(dt):
    """T23: a hundred particles meet a wall that oscillates, each at another phase."""
    wall, start, after, place = swinging_wall(0.7)
    sim = run([wall], start, (0.0, 0.0, -2.0), gravity=WEIGHTLESS, duration=0.45, dt=dt,
              restitution=0.7)
    assert_allclose(sim.velocity[:, 2], after, rtol=0.0, atol=1e-12)
    assert_allclose(sim.position[:, 2], place(0.45), rtol=0.0, atol=1e-13)
    assert sim.counters['collisions'] == len(start)


def accelerate(colliders, along, acceleration, dt=0.01, **keys):
    """
    Make a simulation in which 'ground' accelerates from rest for 100 steps, with a particle on it.

    Before that there is a step without gravity, in which the ground is known to be at rest.
    """
    sim = build(colliders, (0.0, 0.0, 0.0), dt=dt, gravity=WEIGHTLESS, **keys)
    sim.move_collider('ground', (0.0, 0.0, 0.0), UPRIGHT, (0.0, ) * 6)
    sim.step()
    sim.set_parameter('gravity', (0.0, 0.0, -G))
    begin, a = sim.time, acceleration * np.array(along)
    follow(sim, 'ground', lambda t: 0.5 * a * (t - begin) ** 2, 100, lambda t: a * (t - begin))
    sim.step(100)
    return sim


@pytest.mark.parametrize('eps', [0.0, 0.5, 1.0])
def test_platform_that_accelerates_up(eps):
    """T25: a = 3: gap 0, N / m = g + a."""
    sim = accelerate([plane()], (0.0, 0.0, 1.0), 3.0, restitution=eps)
    assert_allclose(sim.position[0], (0.0, 0.0, 1.5), atol=1e-13)
    assert sim.clearance()[0] == pytest.approx(0.0, abs=1e-14)
    assert sim.velocity[0, 2] == pytest.approx(3.0, abs=1e-12)
    assert sim.contacts.impulse[0, 2] == pytest.approx((G + 3.0) * 0.01, rel=1e-9)


@pytest.mark.parametrize(('acceleration', 'gap'), [(G - 1e-9, 0.0), (G + 1e-9, 5e-10)])
def test_platform_that_falls_away(acceleration, gap):
    """T27: stays in contact for a < g, separates by (a - g) t^2 / 2 for a > g, 1e-9 beside it."""
    sim = accelerate([plane()], (0.0, 0.0, -1.0), acceleration, restitution=0.5)
    assert sim.clearance()[0] == pytest.approx(gap, abs=100 * 5.0 * EPSILON)


@every_dt
def test_conveyor(dt):
    """T29: V = 1, mu = 0.4: slips for 0.2548 s over 0.1274 m, then stays at its place."""
    sim = run([plane(motion={'linear_velocity': [1.0, 0.0, 0.0]})], (0.0, 0.0, 0.0),
              duration=0.9, dt=dt, friction={'dry': 0.4})
    assert 0.9 - sim.position[0, 0] == pytest.approx(0.127420998980632008, abs=1e-14)
    assert_array_equal(sim.velocity[0], (1.0, 0.0, 0.0))
    early = run([plane(motion={'linear_velocity': [1.0, 0.0, 0.0]})], (0.0, 0.0, 0.0),
                duration=0.25, dt=dt, friction={'dry': 0.4})
    assert early.velocity[0, 0] == pytest.approx(0.1 * G, abs=1e-14)


@every_dt
def test_turntable(dt):
    """T31: sticks for r < mu g / omega^2 = 1.22625, to 1e-9 of it, and beyond slides out."""
    omega, mu, limit = 2.0, 0.5, 1.22625
    for r, sticks in ((limit * (1.0 - 1e-9), True), (limit * (1.0 + 1e-4), False)):
        sim = run([turning(omega)], (r, 0.0, 0.0), (0.0, r * omega, 0.0), duration=3.0, dt=dt,
                  friction={'dry': mu})
        out = np.hypot(*sim.position[0, :2]) / r - 1.0
        assert abs(out) < 1e-12 if sticks else out > 1e-5
        if sticks:
            assert_allclose(sim.position[0], (r * cos(6.0), r * sin(6.0), 0.0), atol=1e-12)


@every_dt
def test_rotating_blade(dt):
    """T33: r = r0 cosh(omega t) on a frictionless radial blade, and its force 2 omega r'."""
    omega, r0 = 2.0 * pi, 0.1
    sim = run([turning(omega, normal=(0.0, 1.0, 0.0))], (r0, 0.0, 0.0), (0.0, r0 * omega, 0.0),
              gravity=WEIGHTLESS, duration=0.25, dt=dt)
    out, along = r0 * cosh(0.5 * pi), r0 * omega * sinh(0.5 * pi)
    assert out == pytest.approx(0.250917847865805678, rel=1e-15)
    assert_allclose(sim.position[0], (0.0, out, 0.0), atol=1e-13)
    assert_allclose(sim.velocity[0], (-omega * out, along, 0.0), atol=1e-12)


@pytest.mark.parametrize(('mu', 'acceleration', 'stays'), [
    (0.0, G * tan(pi / 6), True), (0.2, 3.31860647268267355 * (1 + 1e-6), True),
    (0.2, 8.62130917538537625 * (1 - 1e-6), True), (0.2, 5.0, True),
    (0.2, 3.2, False), (0.2, 8.8, False)])
def test_accelerating_wedge(mu, acceleration, stays):
    """T36: no relative motion within the cone of friction about a = g tan(30 deg)."""
    sim = accelerate([incline(pi / 6)], (-1.0, 0.0, 0.0), acceleration, dt=0.02,
                     friction={'dry': mu})
    way = np.linalg.norm(sim.position[0] - sim.collider_pose('ground')[0])
    assert way < 1e-12 if stays else way > 0.05


@every_dt
@pytest.mark.parametrize('speed', [1.0, 1e3, 1e6])
def test_galilean_copy(dt, speed):
    """T38: a velocity added to everything changes nothing relative, to ulps of the position."""
    particles = [(0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.5, 0.0, 0.3)]
    velocities = np.array([(1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 1.0, -2.0)])
    scene = {'friction': {'dry': 0.3}, 'restitution': 0.5, 'dt': dt, 'duration': 1.9}
    rest = run([plane(motion={'linear_velocity': [0.0, 0.0, 0.0]})], particles, velocities,
               **scene)
    copy = run([plane(motion={'linear_velocity': [speed, 0.0, 0.0]})], particles,
               velocities + (speed, 0.0, 0.0), **scene)
    moved = copy.position - (speed * 1.9, 0.0, 0.0)
    steps = max(10.0, 1.9 / dt)
    assert_allclose(moved, rest.position, rtol=0.0,
                    atol=1e-13 + steps * EPSILON * speed * 1.9)


@pytest.mark.parametrize('gap', [1.0, 1e-3])
def test_moving_together_is_no_hit(gap):
    """T77: particle and wall at 1e8 m/s: nothing touches."""
    speed = 1e8
    sim = build([plane(motion={'linear_velocity': [0.0, 0.0, speed]})], (0.0, 0.0, gap),
                (0.0, 0.0, speed), gravity=WEIGHTLESS, dt=1e-3)
    sim.step(100)
    assert sim.counters == dict.fromkeys(sim.counters, 0)
    assert sim.velocity[0, 2] == speed


@pytest.mark.parametrize('friction', [0.0, 0.4])
def test_squeezed_between_plates(friction):
    """T58: outside until the plates meet, then noted; never faster than the plates."""
    plates = [plane(motion={'linear_velocity': [0.0, 0.0, 1.0]}),
              plane((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), name='lid',
                    motion={'linear_velocity': [0.0, 0.0, -1.0]})]
    sim = build(plates, (0.0, 0.0, 0.4), gravity=WEIGHTLESS, dt=1 / 256,
                friction={'dry': friction})
    closed = None
    for _ in range(200):
        sim.step()
        assert np.isfinite(sim.position).all()
        assert np.linalg.norm(sim.velocity[0]) <= 1.0 + 1e-12
        closed = sim.time if closed is None and sim.counters['unplaced'] else closed
        assert sim.clearance()[0] >= -1e-12 or closed
    assert closed == pytest.approx(0.5, abs=2 * sim.dt)        # gap 1 - 2 t


@every_dt
@pytest.mark.parametrize('turns', [0.3, 8.0])
def test_blade_that_sweeps_over_a_particle(dt, turns):
    """T74: a turning blade meets a particle where the angles say, however many turns a step."""
    rate, rho, place, half = 2.0 * pi * turns, 0.5, 2.0, 0.5e-3
    blade = box((2.0, 2.0 * half, 1.0), name='blade', motion={'angular_velocity': [0, 0, rate]})
    start = np.array((rho * cos(place), rho * sin(place), 0.0))
    hit = (place - np.arcsin(half / rho)) / rate
    sim = build([blade], start, dt=dt, gravity=WEIGHTLESS, restitution=1.0)
    sim.advance(hit + 0.01 / rate)
    angle = rate * hit
    # twice the normal part of the velocity of the blade there; the rest of it does not act
    normal = np.array((-sin(angle), cos(angle), 0.0))
    after = 2.0 * (rate * np.array((-start[1], start[0], 0.0)) @ normal) * normal
    assert_allclose(sim.velocity[0], after, rtol=1e-10, atol=1e-10)
    assert_allclose(sim.position[0], start + 0.01 / rate * after, atol=1e-11)


@every_dt
def test_balls_roll_off_nothing(dt):
    """A ball bounces at the height of its radius, slides off a ball (T39) and in a bowl (T42)."""
    sim = run([plane()], (0.0, 0.0, 1.2), radius=0.2, duration=0.6, dt=dt, restitution=0.5)
    hit, up = sqrt(2.0 / G), 0.5 * sqrt(2.0 * G)
    late = 0.6 - hit
    assert sim.position[0, 2] == pytest.approx(0.2 + up * late - 0.5 * G * late ** 2, abs=1e-14)
    # T39 on a sphere of 0.75 m with balls of 0.25 m: their centres are on one of 1 m
    top = run([sphere(0.75)], (sin(0.1), 0.0, cos(0.1)), radius=0.25, duration=1.2, dt=dt)
    assert_allclose(top.position[0], (1.243930772593345, 0.0, -0.316542575433447), atol=1e-12)
    bowl = run([sphere(1.25, inside=True)], (sin(1.0), 0.0, -cos(1.0)), radius=0.25, dt=dt,
               duration=2.13913760055868884)
    assert_allclose(bowl.position[0], (sin(1.0), 0.0, -cos(1.0)), atol=1e-12)


@every_dt
def test_ball_over_the_edge_of_a_box(dt):
    """
    A ball slides off a table: its centre goes round the edge like a particle on a ball (T40).

    From cos(theta) = 1 with v0 it leaves at cos = 2/3 + v0^2 / (3 g r): energy fixes v there.
    """
    r, v0 = 0.5, 1.0
    table = box((2.0, 4.0, 1.0), (0.0, 0.0, -0.5))
    sim = run([table], (0.5, 0.0, r), (v0, 0.0, 0.0), radius=r, duration=1.1, dt=dt)
    cosine = 2.0 / 3.0 + v0 ** 2 / (3.0 * G * r)
    assert np.hypot(sim.position[0, 0] - 1.0, sim.position[0, 2]) > r * (1.0 + 1e-6)
    assert sim.velocity[0, 0] == pytest.approx(sqrt(G * r * cosine) * cosine, abs=1e-11)
    energy = 0.5 * sim.velocity[0] @ sim.velocity[0] + G * sim.position[0, 2]
    assert energy == pytest.approx(0.5 * v0 ** 2 + G * r, abs=1e-11)


def test_bouncing_balls_keep_their_energy():
    """Bouncing balls as in SimBenchmark: 49 of 10 kg fall 5 m, eps = 1, 20 s, together 24 kJ."""
    grid = np.array([(x, y, 5.5) for x in range(7) for y in range(7)], dtype=float)
    sim = build([plane()], grid, radius=0.5, mass=10.0, dt=0.01, restitution=1.0)
    start = sim.energy()
    assert start - 49 * 10 * G * 0.5 == pytest.approx(24e3, rel=2e-3)
    worst = 0.0
    for _ in range(200):
        sim.step(10)
        worst = max(worst, (sim.energy() - start) ** 2)
    assert worst < 1e-15
