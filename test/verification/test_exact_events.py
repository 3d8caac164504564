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

"""Collisions by the event-driven method, at any length of the step, against closed forms."""

from math import atan, ceil, cos, exp, expm1, floor, pi, sin, sqrt, tan, tanh

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import box, EPSILON, FAR, G, plane, simulate, sphere
from test_corners import sharp_places, unfolded, wedge
from test_planes import oblique_hits

pytestmark = pytest.mark.jit     # without the compiler they take minutes

WEIGHTLESS = (0.0, 0.0, 0.0)
OBLIQUE = (3.0, 0.0, -4.0)      # v_T = 3, v_N = -4; with eps = 0.5 the change of v_N is 6
FIRST_HIT, FIRST_SPEED = 0.451523640985730904, 4.42944691807002017      # T01: drop from 1 m
every_dt = pytest.mark.parametrize('dt', [0.3, 0.05, 0.003])


def run(colliders, position, velocity=(0.0, 0.0, 0.0), *, duration, dt=0.3, **keys):
    """Simulate with the event-driven method for a duration; nobody ends inside or undecided."""
    sim = simulate([*colliders, *FAR], position, velocity, dt=dt, method='exact', **keys)
    sim.advance(duration)
    assert sim.time == pytest.approx(duration, rel=4 * EPSILON)
    assert sim.counters['fail_safes'] == sim.counters['undecided'] == 0
    assert (sim.clearance() >= -1e-12).all()
    return sim


def bounces(height, eps, most=400):
    """Give the times of the hits of a particle dropped on the ground, and speeds after them."""
    speed = sqrt(2.0 * G * height)
    after = speed * eps ** np.arange(1.0, most)
    times = speed / G + np.concatenate([[0.0], np.cumsum(2.0 * after / G)])[:-1]
    return times, after


def bouncing(height, eps, time):
    """Height and velocity at a time, and how many hits there were."""
    times, after = bounces(height, eps)
    hits = int(np.searchsorted(times, time))
    if hits == 0:
        return height - 0.5 * G * time ** 2, -G * time, 0
    if hits == len(times):
        return 0.0, 0.0, hits
    since = time - times[hits - 1]
    return after[hits - 1] * since - 0.5 * G * since ** 2, after[hits - 1] - G * since, hits


def test_advance_lands_on_the_time():
    """A shorter step at the end, at which free fall is exact; whole steps else."""
    sim = simulate([plane(), *FAR], (0.0, 0.0, 9.0), dt=0.3, method='exact')
    for duration, steps in ((0.5, 2), (0.07, 1), (0.6, 2), (0.0, 0)):
        assert sim.advance(duration) == steps
    assert sim.time == pytest.approx(1.17, rel=4 * EPSILON)
    assert sim.position[0, 2] == pytest.approx(9.0 - 0.5 * G * 1.17 ** 2, rel=8 * EPSILON)
    assert sim.velocity[0, 2] == pytest.approx(-G * 1.17, rel=8 * EPSILON)


@every_dt
@pytest.mark.parametrize('eps', [0.0, 0.5, 0.9, 1.0])
def test_drop(dt, eps):
    """T01, T04: every hit at its time; place and velocity between, and how many hits."""
    for time in (0.44, 0.46, 1.0, 1.3):
        sim = run([plane()], (0.0, 0.0, 1.0), duration=time, dt=dt, restitution=eps)
        z, v, hits = bouncing(1.0, eps, time)
        if eps == 0.0:
            z, v, hits = (z, v, 0) if time < FIRST_HIT else (0.0, 0.0, 1)
        assert_allclose((sim.position[0, 2], sim.velocity[0, 2]), (z, v), rtol=0.0, atol=1e-13)
        assert sim.counters['collisions'] == hits


@every_dt
@pytest.mark.parametrize(('eps', 'last'), [(0.5, 1.35457092295719271), (0.9, 8.57894917872888718)])
def test_bounces_end(dt, eps, last):
    """T02: infinitely many bounces end at t1 (1 + eps) / (1 - eps); then it rests."""
    before = run([plane()], (0.0, 0.0, 1.0), duration=last - 1e-3, dt=dt, restitution=eps)
    assert_allclose((before.position[0, 2], before.velocity[0, 2]),
                    bouncing(1.0, eps, last - 1e-3)[:2], rtol=0.0, atol=1e-12)
    assert before.velocity[0, 2] != 0.0
    sim = run([plane()], (0.0, 0.0, 1.0), duration=last + 1e-6, dt=dt, restitution=eps)
    assert_array_equal(sim.velocity[0], 0.0)
    assert abs(sim.position[0, 2]) < 1e-15
    hits = sim.counters['collisions']
    assert np.log(1e-5) / np.log(eps) < hits < np.log(1e-12) / np.log(eps)     # until rounding
    sim.advance(3.0)
    assert sim.counters['collisions'] == hits
    assert_array_equal(sim.velocity[0], 0.0)


@every_dt
@pytest.mark.parametrize(('friction', 'slowed', 'law'), [
    ({'dry': 0.1}, lambda v, dv: v - 0.1 * dv, lambda t: 9.0 - 0.1 * G * t),
    ({'wet': 0.05}, lambda v, dv: v * exp(-0.05 * dv), lambda t: 9.0 * exp(-0.05 * G * t))],
    ids=['dry', 'wet'])
@pytest.mark.parametrize('eps', [0.5, 0.8])
def test_friction_of_bounces_that_end(dt, friction, slowed, law, eps):
    """T02 with friction: impulses and times of infinitely many bounces as geometric series."""
    times, after = bounces(1.0, eps)
    speed, place, last = 9.0, 0.0, 0.0
    for time, up in zip(times, after):
        place, last = place + speed * (time - last), time
        speed = slowed(speed, up * (1.0 + 1.0 / eps))
    assert speed == pytest.approx(law(last), rel=1e-13)         # as if it had pressed all the time
    end = last + 1e-3
    place += 1e-3 * 0.5 * (speed + law(end)) if 'dry' in friction else \
        (speed - law(end)) / (0.05 * G)
    sim = run([plane()], (0.0, 0.0, 1.0), (9.0, 0.0, 0.0), duration=end, dt=dt, restitution=eps,
              friction=friction)
    assert_allclose(sim.velocity[0], (law(end), 0.0, 0.0), rtol=0.0, atol=1e-12)
    assert_allclose(sim.position[0], (place, 0.0, 0.0), rtol=0.0, atol=1e-12)


def test_a_million_elastic_bounces():
    """T03: eps = 1: the energy, and so the apex, after 1e6 bounces, to 1e-10."""
    sim = simulate([plane(), *FAR], (0.0, 0.0, 1.0), dt=20.0, method='exact', restitution=1.0)
    energy = sim.energy()
    sim.step(45_153)
    assert sim.counters['collisions'] == pytest.approx(1e6, rel=1e-4)
    assert sim.energy() == pytest.approx(energy, rel=1e-10)


def one_hit(velocity, **scene):
    """Velocity of a particle after it has hit the ground once, without gravity."""
    return run([plane()], (0.0, 0.0, 1e-3), velocity, gravity=WEIGHTLESS, duration=0.1,
               **scene).velocity[0]


@oblique_hits
def test_oblique_hit(friction, expected):
    """T06, T09, T10: v_N' = 2, v_T' by the law for dv_N = 6."""
    after = one_hit(OBLIQUE, restitution=0.5, friction=friction)
    assert_allclose(after, (expected, 0.0, 2.0), rtol=16 * EPSILON, atol=3.0 * EPSILON)


@pytest.mark.parametrize('mu', [0.5, 0.5 * (1.0 + 1e-9), 1.0, 1e9, 1e308])
def test_oblique_hit_sticks(mu):
    """T07: mu dv_N >= v_T stops the tangential velocity exactly; mu = 1/2 is the boundary."""
    assert_array_equal(one_hit(OBLIQUE, restitution=0.5, friction={'dry': mu}), (0.0, 0.0, 2.0))


@pytest.mark.parametrize('mu', [0.0, 0.5, 1e9, 1e308])
def test_normal_hit_makes_no_slip(mu):
    """T08: v_T = 0 stays 0."""
    after = one_hit((0.0, 0.0, -4.0), restitution=0.5, friction={'dry': mu})
    assert_array_equal(after, (0.0, 0.0, 2.0))


@every_dt
@pytest.mark.parametrize('gap', [0.0, 1e-15, -1e-15])
def test_ceiling_graze(dt, gap):
    """T20: an apex that just touches the ceiling changes nothing beyond rounding."""
    v0 = sqrt(2.0 * G)
    sim = run([plane((0.0, 0.0, -1.0), (0.0, 0.0, 1.0 + gap))], (0.0, 0.0, 0.0), (1.0, 0.0, v0),
              duration=1.0, dt=dt, restitution=1.0)
    assert_allclose(sim.position[0], (1.0, 0.0, v0 - 0.5 * G), atol=2e-7 if gap < 0.0 else 1e-14)
    assert_allclose(sim.velocity[0], (1.0, 0.0, v0 - G), atol=2e-7 if gap < 0.0 else 1e-14)


@every_dt
@pytest.mark.parametrize('height', [0.0, 1e-300])
@pytest.mark.parametrize(('speed', 'after'), [(1.0, 1.0), (0.0, 0.0), (-1.0, 0.5)])
def test_start_on_the_surface(dt, height, speed, after):
    """T21: at the surface it leaves, rests, or bounces once at t = 0 and then leaves."""
    sim = run([plane()], (0.0, 0.0, height), (0.0, 0.0, speed), duration=0.1, dt=dt,
              restitution=0.5)
    expected = (after * 0.1 - 0.05 * G * 0.1, after - G * 0.1) if after else (height, 0.0)
    assert_allclose((sim.position[0, 2], sim.velocity[0, 2]), expected, rtol=0.0, atol=1e-15)
    assert sim.counters['collisions'] == (speed < 0.0)


def test_no_friction_keeps_the_tangential_velocity():
    """T22: mu = 0: v_x is bit-identical after 1e5 bounces, between two walls and on the ground."""
    walls = [plane(), plane((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), name='ceiling')]
    for gravity, speed in ((0.0, 51.7), (G, 0.0)):
        sim = run(walls, (0.0, 0.0, 0.3), (0.1, 1 / 3, speed), gravity=(0.0, 0.0, -gravity),
                  restitution=1.0, dt=50.0, duration=2000.0 if speed else 50_000.0)
        assert sim.counters['collisions'] > 100_000
        assert_array_equal(sim.velocity[0, :2], (0.1, 1 / 3))
        if speed:
            assert abs(sim.velocity[0, 2]) == 51.7


@every_dt
def test_right_corner_reverses(dt):
    """T51: eps = 1: the velocity is reversed exactly after two hits, in a cube corner three."""
    walls = [plane((1.0, 0.0, 0.0), name='a'), plane((0.0, 1.0, 0.0), name='b'),
             plane((0.0, 0.0, 1.0), name='c')]
    for count, z in ((2, 0.0), (3, -0.3)):
        velocity = np.array((-1.0, -0.7, z))
        sim = run(walls, (0.9, 0.4, 0.1), velocity, gravity=WEIGHTLESS, restitution=1.0, dt=dt,
                  duration=1.5)
        assert_array_equal(sim.velocity[0], -velocity)
        assert sim.counters['collisions'] == count


@every_dt
@pytest.mark.parametrize('degrees', [30, 7, 1])
def test_wedge_by_images(dt, degrees):
    """T52: eps = 1: hits, exit direction and place of a ray that is straight when unfolded."""
    angle = np.radians(degrees)
    start, aside, far = 0.41 * angle, 1.0, 60.0
    incoming = start + pi - np.arcsin(aside / far)
    velocity = np.array((cos(incoming), sin(incoming), 0.0))
    place = far * np.array((cos(start), sin(start), 0.0))
    sim = run(wedge(angle), place, velocity, gravity=WEIGHTLESS, restitution=1.0, dt=dt,
              duration=2.0 * far)
    end = place + 2.0 * far * velocity
    sector = floor(np.arctan2(end[1], end[0]) % (2.0 * pi) / angle)
    out = unfolded(angle, incoming, sector)
    polar = unfolded(angle, np.arctan2(end[1], end[0]) % (2.0 * pi), sector)
    distance = np.linalg.norm(end)
    assert sim.counters['collisions'] == sector <= ceil(pi / angle)
    assert_allclose(sim.velocity[0], (cos(out), sin(out), 0.0), atol=1e-12)
    assert_allclose(sim.position[0], (distance * cos(polar), distance * sin(polar), 0.0),
                    atol=1e-10)


@sharp_places
@pytest.mark.parametrize('eps', [0.0, 1.0])
def test_exactly_into_a_corner(colliders, eps):
    """T53: a ray into an apex, a face or an edge: outside, no faster, the same each time."""
    states = []
    for _ in range(2):
        sim = run(colliders, (0.0, 0.0, 0.25), (0.0, 0.0, -2.0), gravity=WEIGHTLESS,
                  restitution=eps, duration=1.0)
        assert np.linalg.norm(sim.velocity[0]) <= 2.0 * (1.0 + 1e-14)
        states.append(sim.position.tobytes() + sim.velocity.tobytes())
    assert states[0] == states[1]


@pytest.mark.parametrize('ratio', [1.0, 1e3, 1e6, 1e9])
@pytest.mark.parametrize('eps', [0.0, 0.5, 1.0])
def test_thin_wall_is_never_missed(ratio, eps):
    """T73: v dt / h up to 1e9: everybody is reflected at the near side, at its own time."""
    count, speed, dt = 20, 1e3, 1e-2
    thickness = speed * dt / ratio
    start = np.zeros((count, 3))
    start[:, 2] = 0.5 * thickness + speed * dt * (np.arange(count) + 0.5) / count
    sim = run([box((9.0, 9.0, thickness))], start, (0.0, 0.0, -speed), gravity=WEIGHTLESS,
              restitution=eps, dt=dt, duration=dt)
    assert sim.counters['collisions'] == count
    assert_allclose(sim.velocity[:, 2], eps * speed, rtol=4 * EPSILON)
    left = dt - (start[:, 2] - 0.5 * thickness) / speed
    assert_allclose(sim.position[:, 2], 0.5 * thickness + eps * speed * left, atol=1e-13)


MIRRORS = [
    ('ball', sphere(), 1.0),
    ('lying cylinder', {'name': 'c', 'shape': 'cylinder', 'radius': 1.0, 'length': 4.0,
                        'orientation': (sqrt(0.5), 0.0, 0.0, sqrt(0.5))}, 1.0),
    ('lying capsule', {'name': 'c', 'shape': 'capsule', 'radius': 1.0, 'length': 3.0,
                       'orientation': (sqrt(0.5), 0.0, 0.0, sqrt(0.5))}, 1.0),
    ('cap of a capsule', {'name': 'c', 'shape': 'capsule', 'radius': 1.0, 'length': 3.0,
                          'position': (0.0, 0.0, -1.5)}, 1.0),
    ('edge of a box', box((20.0, 20.0, 2.0), (0.0, 0.0, -1.0)), None)]


@every_dt
@pytest.mark.parametrize(('shape', 'round_side'), [
    (shape, side) for _, shape, side in MIRRORS], ids=[name for name, _, _ in MIRRORS])
def test_mirrored_off_shapes(dt, shape, round_side):
    """An off-centre ray with eps = 1 is mirrored at the normal of the place that it meets."""
    for offset in (0.0, 0.3, 0.7, -0.9):
        sim = run([shape], (offset, 0.0, 1.5), (0.0, 0.0, -1.0), gravity=WEIGHTLESS, dt=dt,
                  duration=2.0, restitution=1.0)
        normal = np.array((0.0, 0.0, 1.0))
        if round_side:
            normal = np.array((offset, 0.0, sqrt(1.0 - offset ** 2)))
        top = normal[2] if round_side else 0.0
        after = np.array((0.0, 0.0, -1.0)) + 2.0 * normal[2] * normal
        assert_allclose(sim.velocity[0], after, atol=1e-14)
        assert_allclose(sim.position[0], (offset, 0.0, top) + (0.5 + top) * after, atol=1e-13)


@every_dt
def test_linear_drag(dt):
    """T68: k = 2: v(1), and after a bounce at the root of its closed form."""
    k, fall = 2.0, lambda t: G / k * (t + expm1(-k * t) / k)
    free = run([plane()], (0.0, 0.0, 9.0), duration=1.0, dt=dt, drag={'linear': k})
    assert free.velocity[0, 2] == pytest.approx(-4.24118043572441475, rel=1e-14)
    assert free.position[0, 2] == pytest.approx(9.0 - fall(1.0), rel=1e-14)
    hit = 0.5
    up = -0.5 * G / k * expm1(-k * hit)
    sim = run([plane()], (0.0, 0.0, fall(hit)), duration=0.7, dt=dt, drag={'linear': k},
              restitution=0.5)
    # v = -g/k + (u + g/k) e^(-k t) after it
    assert sim.velocity[0, 2] == pytest.approx(-G / k + (up + G / k) * exp(-k * 0.2), abs=1e-13)
    assert sim.position[0, 2] == pytest.approx(
        -G / k * 0.2 - (up + G / k) * expm1(-k * 0.2) / k, abs=1e-13)


@pytest.mark.parametrize('dt', [1e-6, 1 / 240, 10.0])
def test_stiff_linear_drag_then_a_bounce(dt):
    """T68: k = 1e9: it falls with g / k, bounces, and has that velocity again at once."""
    sim = run([plane()], (0.0, 0.0, 1e-9), duration=dt, dt=dt, drag={'linear': 1e9},
              restitution=1.0)
    assert -G / 1e9 * (1.0 + 1e-9) <= sim.velocity[0, 2] <= G / 1e9
    assert 0.0 <= sim.position[0, 2] <= 1e-9


@every_dt
def test_quadratic_drag(dt):
    """Falling: v = -V tanh(g t / V); rising after a bounce: v = V tan(atan(u / V) - g t / V)."""
    terminal = sqrt(G / 0.4)

    def fall(t):
        return terminal ** 2 / G * np.log(np.cosh(G * t / terminal))
    free = run([plane()], (0.0, 0.0, 9.0), duration=1.0, dt=dt, drag={'quadratic': 0.4})
    assert free.velocity[0, 2] == pytest.approx(-terminal * tanh(G / terminal), rel=1e-13)
    assert free.position[0, 2] == pytest.approx(9.0 - fall(1.0), rel=1e-13)
    up = 0.8 * terminal * tanh(G * 0.5 / terminal)
    sim = run([plane()], (0.0, 0.0, fall(0.5)), duration=0.7, dt=dt, drag={'quadratic': 0.4},
              restitution=0.8)
    phase = atan(up / terminal)
    late = phase - G * 0.2 / terminal
    assert sim.velocity[0, 2] == pytest.approx(terminal * tan(late), abs=1e-12)
    assert sim.position[0, 2] == pytest.approx(
        terminal ** 2 / G * np.log(cos(late) / cos(phase)), abs=1e-12)


def obstacles():
    """All shapes in a room."""
    return [box((6.0, 6.0, 6.0), (0.0, 0.0, 3.0), 'room', inside=True),
            sphere(0.5, (1.0, 0.0, 1.0)),
            box((1.0, 0.6, 0.4), (-1.0, 0.0, 0.8), orientation=(0.1, 0.2, 0.3, sqrt(0.86))),
            {'name': 'capsule', 'shape': 'capsule', 'radius': 0.3, 'length': 1.0,
             'position': [0.0, 1.5, 1.0], 'orientation': [0.5, 0.5, 0.5, 0.5]},
            {'name': 'cylinder', 'shape': 'cylinder', 'radius': 0.4, 'length': 1.0,
             'position': [0.0, -1.5, 1.0], 'orientation': [0.6, 0.0, 0.0, 0.8]}]


def crowd(count):
    """Random particles above the obstacles."""
    rng = np.random.default_rng(3)
    place = rng.uniform((-2.9, -2.9, 2.2), (2.9, 2.9, 5.9), (count, 3))
    return place, rng.normal(0.0, 3.0, (count, 3))


@pytest.mark.parametrize(('eps', 'mu'), [(1.0, 0.0), (0.5, 0.3), (0.0, 0.0), (0.9, 0.0)])
def test_energy_among_obstacles(eps, mu):
    """Energy is constant with eps = 1 and mu = 0, and else never grows; nobody comes inside."""
    place, velocity = crowd(300)
    sim = simulate(obstacles() + FAR, place, velocity, restitution=eps, friction={'dry': mu},
                   method='exact', dt=0.05)
    before = start = sim.energy()
    for _ in range(40):
        sim.step()
        assert (sim.clearance() >= -1e-12).all()
        energy = sim.energy()
        assert energy <= before + 1e-12 * start
        before = energy
    assert (energy == pytest.approx(start, rel=1e-12)) == (eps == 1.0)
    assert sim.counters['fail_safes'] == sim.counters['undecided'] == 0


@pytest.mark.parametrize(('eps', 'mu'), [(0.7, 0.3), (0.0, 0.2), (1.0, 0.0)])
def test_time_step_is_of_no_importance(eps, mu):
    """The same state at the same time for dt = 0.3, 0.05 and 0.003, before chaos sets in."""
    place, velocity = crowd(300)
    ends = [run(obstacles(), place, velocity, duration=0.8, dt=dt, restitution=eps,
                friction={'dry': mu}) for dt in (0.3, 0.05, 0.003)]
    assert ends[0].counters['collisions'] > 250
    for sim in ends[1:]:
        assert_allclose(sim.position, ends[0].position, rtol=0.0, atol=1e-11)
        assert_allclose(sim.velocity, ends[0].velocity, rtol=0.0, atol=1e-10)
