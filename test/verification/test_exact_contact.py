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

"""Slides, rest and corners by the event-driven method, on still surfaces, by closed forms."""

from math import atan, cos, exp, expm1, log, pi, sin, sqrt, tan

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import box, G, incline, plane, sphere
from test_corners import groove
from test_exact_events import bounces, every_dt, run, WEIGHTLESS

pytestmark = pytest.mark.jit     # without the compiler they take minutes

PERIOD = 2.13913760055868884        # T42: 4 sqrt(R / g) K(sin(1/2)), R = 1, released at 1 rad
LYING = (sqrt(0.5), 0.0, 0.0, sqrt(0.5))        # turns the axis of a shape from z to y


def pipe(shape, length=4.0, **keys):
    """Give a cylinder or a capsule of radius 1 along y."""
    return {'name': 'pipe', 'shape': shape, 'radius': 1.0, 'length': length,
            'orientation': LYING, **keys}


tops = pytest.mark.parametrize('top', [sphere(), pipe('cylinder'), pipe('capsule')],
                               ids=['ball', 'cylinder', 'capsule'])
bowls = pytest.mark.parametrize('bowl', [
    sphere(inside=True), pipe('cylinder', inside=True), pipe('capsule', inside=True)],
    ids=['bowl', 'drum', 'capsule'])
floors = pytest.mark.parametrize('floor', [
    plane(), box((50.0, 50.0, 2.0), (0.0, 0.0, -1.0)),
    box((50.0, 50.0, 9.0), (0.0, 0.0, 4.5), inside=True),
    {'name': 'c', 'shape': 'cylinder', 'radius': 25.0, 'length': 2.0, 'position': [0, 0, -1]},
    {'name': 'c', 'shape': 'cylinder', 'radius': 25.0, 'length': 9.0, 'position': [0, 0, 4.5],
     'inside': True}], ids=['plane', 'box', 'room', 'end of a cylinder', 'floor of a drum'])


@every_dt
@floors
def test_sliding_to_a_stop(dt, floor):
    """T12: v0 = 2, mu = 0.3: v = v0 - mu g t; stops after v0^2 / (2 mu g) and stays there."""
    early = run([floor], (0.0, 0.0, 0.0), (2.0, 0.0, 0.0), duration=0.5, dt=dt,
                friction={'dry': 0.3})
    assert early.velocity[0, 0] == pytest.approx(2.0 - 0.15 * G, abs=1e-14)
    assert early.position[0, 0] == pytest.approx(1.0 - 0.0375 * G, abs=1e-14)
    sim = run([floor], (0.0, 0.0, 0.0), (2.0, 0.0, 0.0), duration=1.0, dt=dt, restitution=0.5,
              friction={'dry': 0.3})
    assert_allclose(sim.position[0], (0.679578661230037377, 0.0, 0.0), atol=1e-14)
    assert_array_equal(sim.velocity[0], 0.0)
    stop = sim.position[0].copy()
    sim.advance(1000 * dt)
    assert_array_equal(sim.position[0], stop)


@every_dt
def test_incline(dt):
    """T13, T14: sticks for mu > tan(theta), 1e-9 below it slides with the right acceleration."""
    angle, down = pi / 6, np.array((-cos(pi / 6), 0.0, -0.5))
    for part, stays in ((1.0 + 1e-9, True), (1.0 - 1e-9, False)):
        sim = run([incline(angle)], (0.0, 0.0, 0.0), duration=1.0, dt=dt,
                  friction={'dry': tan(angle) * part})
        way = 0.0 if stays else 0.5 * G * 0.5 * 1e-9
        assert sim.position[0] @ down == pytest.approx(way, abs=1e-15)
    sim = run([incline(angle)], (0.0, 0.0, 0.0), duration=1.0, dt=dt, friction={'dry': 0.2})
    assert_allclose(sim.velocity[0], 3.20585815777493138 * down, rtol=0.0, atol=1e-13)
    assert_allclose(sim.position[0], 3.20585815777493138 / 2 * down, rtol=0.0, atol=1e-13)


@every_dt
def test_up_and_down_an_incline(dt):
    """T14: slides up, turns, and slides down with another acceleration."""
    angle, mu, v0 = pi / 6, 0.2, 2.0
    up = np.array((cos(angle), 0.0, sin(angle)))
    sim = run([incline(angle)], (0.0, 0.0, 0.0), v0 * up, duration=2.0, dt=dt,
              friction={'dry': mu})
    turn = v0 / (G * (sin(angle) + mu * cos(angle)))
    way = 0.5 * v0 * turn - 0.5 * G * (sin(angle) - mu * cos(angle)) * (2.0 - turn) ** 2
    assert_allclose(sim.position[0], way * up, rtol=0.0, atol=1e-13)


@every_dt
@pytest.mark.parametrize('eps', [0.0, 0.5, 1.0])
def test_block_on_an_incline(dt, eps):
    """T16: released at rest on the surface: no motion at all."""
    sim = run([incline(pi / 6)], (0.0, 0.0, 0.0), duration=3.0, dt=dt, restitution=eps,
              friction={'dry': 1.0})
    assert_array_equal(sim.position[0], 0.0)
    assert_array_equal(sim.velocity[0], 0.0)


@every_dt
@pytest.mark.parametrize('eps', [0.0, 0.5, 0.8])
def test_landing_on_an_incline(dt, eps):
    """
    Bounces down an incline that end: along it the velocity is as if it had pressed all the time.

    Frames: n out of the incline, s down it; gravity has -g cos and g sin there. Bounces are those
    on the ground for g cos; friction takes mu dv_N at each.
    """
    angle, mu, height = pi / 6, 0.2, 0.4
    down, n = np.array((-cos(angle), 0.0, -sin(angle))), np.array((-sin(angle), 0.0, cos(angle)))
    drive, press = G * sin(angle), G * cos(angle)
    times, after = bounces(height * press / G, eps) if eps else ([], [])    # sqrt(2 press height)
    times = np.array(times) * G / press
    speed, way, last = 0.0, 0.0, 0.0
    if not eps:
        times, after = [sqrt(2.0 * height / press)], [0.0]
    for time, up in zip(times, after):
        h, last = time - last, time
        way, speed = way + speed * h + 0.5 * drive * h * h, speed + drive * h
        hit = up / eps if eps else sqrt(2.0 * height * press)
        speed -= mu * (1.0 + eps) * hit
    end = last + 0.05
    way += speed * 0.05 + 0.5 * (drive - mu * press) * 0.05 ** 2
    sim = run([incline(angle)], height * n, duration=end, dt=dt, restitution=eps,
              friction={'dry': mu})
    assert sim.velocity[0] @ down == pytest.approx((drive - mu * press) * end, abs=1e-12)
    assert_allclose(sim.position[0], way * down, rtol=0.0, atol=1e-12)


@every_dt
def test_wet_sliding(dt):
    """T18: v = v0 e^(-D g t), to the end of its path v0 / (D g)."""
    sim = run([plane()], (0.0, 0.0, 0.0), (2.0, 0.0, 0.0), duration=1.0, dt=dt,
              friction={'wet': 0.5})
    assert sim.velocity[0, 0] == pytest.approx(0.0148188861658293715, rel=1e-13)
    assert sim.position[0, 0] == pytest.approx(
        0.407747196738022426 * -expm1(-0.5 * G), rel=1e-13)


@every_dt
@pytest.mark.parametrize('stiffness', [1e3, 1e6, 1e300])
def test_stiff_wet_friction(dt, stiffness):
    """T18: D g dt >> 1: it stops after v0 / (D g), neither reverses nor grows."""
    sim = run([plane()], (0.0, 0.0, 0.0), (2.0, 0.0, 0.0), duration=0.6, dt=dt,
              friction={'wet': stiffness})
    assert sim.position[0, 0] == pytest.approx(2.0 / (stiffness * G), rel=1e-12)
    assert 0.0 <= sim.velocity[0, 0] <= 1e-300


@every_dt
def test_dry_and_wet_sliding(dt):
    """Both: v' = -mu g - D g v, so v = (v0 + c) e^(-k t) - c, c = mu / D, k = D g; it stops."""
    mu, wet, v0 = 0.2, 0.5, 2.0
    k, c = wet * G, mu / wet
    stop = log(1.0 + v0 / c) / k
    for time in (0.7 * stop, stop + 0.2):
        sim = run([plane()], (0.0, 0.0, 0.0), (v0, 0.0, 0.0), duration=time, dt=dt,
                  friction={'dry': mu, 'wet': wet})
        t = min(time, stop)
        assert sim.velocity[0, 0] == pytest.approx((v0 + c) * exp(-k * t) - c, abs=1e-14)
        assert sim.position[0, 0] == pytest.approx(-(v0 + c) * expm1(-k * t) / k - c * t,
                                                   abs=1e-13)


@every_dt
def test_sliding_with_linear_drag(dt):
    """Dry friction and drag: v' = -mu g - k v; wet friction and drag: v' = -(k + D g) v."""
    mu, k, v0, t = 0.1, 2.0, 3.0, 0.4
    c = mu * G / k
    sim = run([plane()], (0.0, 0.0, 0.0), (v0, 0.0, 0.0), duration=t, dt=dt, drag={'linear': k},
              friction={'dry': mu})
    assert sim.velocity[0, 0] == pytest.approx((v0 + c) * exp(-k * t) - c, abs=1e-13)
    assert sim.position[0, 0] == pytest.approx(-(v0 + c) * expm1(-k * t) / k - c * t, abs=1e-13)
    wet = run([plane()], (0.0, 0.0, 0.0), (v0, 0.0, 0.0), duration=t, dt=dt, drag={'linear': k},
              friction={'wet': mu})
    rate = k + mu * G
    assert wet.velocity[0, 0] == pytest.approx(v0 * exp(-rate * t), abs=1e-13)
    assert wet.position[0, 0] == pytest.approx(-v0 * expm1(-rate * t) / rate, abs=1e-13)


@every_dt
def test_sliding_with_quadratic_drag(dt):
    """Dry friction and drag: v' = -mu g - c v^2: v = V tan(atan(v0 / V) - c V t); it stops."""
    mu, c, v0 = 0.1, 0.5, 3.0
    scale = sqrt(mu * G / c)
    phase = atan(v0 / scale)
    stop = phase / (c * scale)
    for time in (0.4, stop + 0.2):
        sim = run([plane()], (0.0, 0.0, 0.0), (v0, 0.0, 0.0), duration=time, dt=dt,
                  drag={'quadratic': c}, friction={'dry': mu})
        late = phase - c * scale * min(time, stop)
        assert sim.velocity[0, 0] == pytest.approx(scale * tan(late), abs=1e-12)
        assert sim.position[0, 0] == pytest.approx(log(cos(late) / cos(phase)) / c, abs=1e-12)


@every_dt
@tops
def test_sliding_off_a_top(dt, top):
    """T39: leaves at cos = 2/3 cos(theta0); angle, time and speed by the place at t = 1.2."""
    start = (sin(0.1), 0.0, cos(0.1))
    sim = run([top], start, duration=1.2, dt=dt)
    assert_allclose(sim.position[0], (1.243930772593345, 0.0, -0.316542575433447), atol=1e-13)
    angle, time, speed = 0.845528201856860743, 0.907110111046269434, 2.55094634222640765
    sim = run([top], start, duration=time, dt=dt)
    assert_allclose(sim.position[0], (sin(angle), 0.0, cos(angle)), atol=1e-12)
    assert_allclose(sim.velocity[0], (speed * cos(angle), 0.0, -speed * sin(angle)), atol=1e-12)
    later = run([top], start, duration=time + 1e-3, dt=dt, contacts=True)
    height = cos(angle) - speed * sin(angle) * 1e-3 - 0.5e-6 * G
    assert later.position[0, 2] == pytest.approx(height, abs=1e-12)


@every_dt
@tops
def test_leaving_a_top_with_a_start_speed(dt, top):
    """T40: leaves at cos = 2/3 + v0^2 / (3 g R); at once if v0^2 >= g R, on a parabola."""
    v0 = sqrt(G) * (1.0 + 1e-12)
    sim = run([top], (0.0, 0.0, 1.0), (v0, 0.0, 0.0), duration=0.4, dt=dt)
    assert_allclose(sim.position[0], (0.4 * v0, 0.0, 1.0 - 0.08 * G), atol=1e-13)
    sim = run([top], (0.0, 0.0, 1.0), (1.5, 0.0, 0.0), duration=0.9, dt=dt)
    away = np.linalg.norm(sim.position[0]) > 1.0 + 1e-9
    cosine = 2.0 / 3.0 + 1.5 ** 2 / (3.0 * G)
    energy = 0.5 * sim.velocity[0] @ sim.velocity[0] + G * sim.position[0, 2]
    assert away
    assert energy == pytest.approx(0.5 * 1.5 ** 2 + G, rel=1e-13)
    # v_x of the parabola is that of the place where it left
    assert sim.velocity[0, 0] == pytest.approx(sqrt(G * cosine) * cosine, rel=1e-12)


@every_dt
@bowls
def test_a_period_in_a_bowl(dt, bowl):
    """T42: back after a period, at the bottom after a quarter, with sqrt(2 g (1 - cos(1)))."""
    start = np.array((sin(1.0), 0.0, -cos(1.0)))
    sim = run([bowl], start, duration=PERIOD, dt=dt)
    assert_allclose(sim.position[0], start, atol=1e-12)
    bottom = run([bowl], start, duration=0.25 * PERIOD, dt=dt)
    assert_allclose(bottom.position[0], (0.0, 0.0, -1.0), atol=1e-12)
    assert_allclose(bottom.velocity[0], (-3.0032097427364441, 0.0, 0.0), atol=1e-11)
    assert sim.counters['collisions'] == bottom.counters['collisions'] == 0


@every_dt
@bowls
@pytest.mark.parametrize('mu', [0.0, 0.2])
def test_round_a_circle(dt, bowl, mu):
    """T43: no gravity: v = 1 / (1 + mu v0 t / R), and the angle log(1 + mu t) / mu."""
    sim = run([bowl], (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), gravity=WEIGHTLESS, duration=3.0, dt=dt,
              friction={'dry': mu})
    speed = 1.0 / (1.0 + 3.0 * mu)
    angle = log(1.0 + 3.0 * mu) / mu if mu else 3.0
    assert_allclose(sim.position[0], (cos(angle), 0.0, sin(angle)), atol=1e-12)
    assert_allclose(sim.velocity[0], (-speed * sin(angle), 0.0, speed * cos(angle)), atol=1e-12)


@every_dt
def test_round_the_floor_of_a_drum(dt):
    """Floor and wall press: v' = -mu (g + v^2 / R): v = V tan(atan(v0 / V) - mu V t / R)."""
    drum = {'name': 'drum', 'shape': 'cylinder', 'radius': 1.0, 'length': 2.0, 'inside': True,
            'position': [0.0, 0.0, 1.0]}
    mu, v0, scale = 0.1, 3.0, sqrt(G)
    phase = atan(v0 / scale)
    stop = phase / (mu * scale)
    for time in (1.0, stop + 0.1):
        sim = run([drum], (1.0, 0.0, 0.0), (0.0, v0, 0.0), duration=time, dt=dt,
                  friction={'dry': mu})
        late = phase - mu * scale * min(time, stop)
        angle, speed = log(cos(late) / cos(phase)) / mu, scale * tan(late)
        assert_allclose(sim.position[0], (cos(angle), sin(angle), 0.0), atol=1e-11)
        assert_allclose(sim.velocity[0], (-speed * sin(angle), speed * cos(angle), 0.0),
                        atol=1e-11)


@every_dt
@pytest.mark.parametrize('mu', [0.0, 0.3])
@pytest.mark.parametrize('table', [
    box((2.0, 4.0, 1.0), (0.0, 0.0, -0.5)),
    {'name': 'c', 'shape': 'cylinder', 'radius': 1.0, 'length': 1.0, 'position': [0, 0, -0.5]}],
    ids=['box', 'cylinder'])
def test_sliding_off_an_edge(dt, mu, table):
    """To the end of the face with v' = -mu g, then a parabola from there."""
    v0, way = 3.0, 1.5
    leave = (v0 - sqrt(v0 ** 2 - 2.0 * mu * G * way)) / (mu * G) if mu else way / v0
    speed, left = v0 - mu * G * leave, 0.9 - leave
    sim = run([table], (-0.5, 0.0, 0.0), (v0, 0.0, 0.0), duration=0.9, dt=dt, restitution=0.5,
              friction={'dry': mu})
    assert_allclose(sim.position[0], (1.0 + speed * left, 0.0, -0.5 * G * left ** 2), atol=1e-13)
    assert_allclose(sim.velocity[0], (speed, 0.0, -G * left), atol=1e-13)
    assert sim.counters['collisions'] == 0


@every_dt
def test_along_a_wall_of_a_room(dt):
    """It slides on the floor, bounces off the wall with eps = 1/2, and slides back."""
    room = box((2.0, 2.0, 2.0), (0.0, 0.0, 1.0), inside=True)
    sim = run([room], (0.0, 0.3, 0.0), (2.0, 0.0, 0.0), duration=1.2, dt=dt, restitution=0.5)
    assert_allclose(sim.position[0], (1.0 - 0.7, 0.3, 0.0), atol=1e-14)
    assert_allclose(sim.velocity[0], (-1.0, 0.0, 0.0), atol=1e-14)
    assert sim.counters['collisions'] == 1


@every_dt
def test_seam_between_two_boxes(dt):
    """T50: over the seam of two flush boxes: no bump, no collision."""
    boxes = [box((2.0, 4.0, 1.0), (-1.0, 0.0, -0.5), 'left'),
             box((2.0, 4.0, 1.0), (1.0, 0.0, -0.5), 'right')]
    sim = run(boxes, (-0.5, 0.0, 0.0), (2.0, 0.1, 0.0), duration=0.5, dt=dt)
    assert_allclose(sim.position[0], (0.5, 0.05, 0.0), atol=1e-15)
    assert_array_equal(sim.velocity[0], (2.0, 0.1, 0.0))
    assert sim.counters['collisions'] == 0


@every_dt
@pytest.mark.parametrize(('half_angle', 'mu'), [(pi / 4, 0.3), (pi / 6, 0.05), (1e-3, 1e-4)])
def test_sliding_in_a_groove(dt, half_angle, mu):
    """T55: slows at mu g / sin(half angle), however acute the groove."""
    slower, v0 = mu * G / sin(half_angle), 2.0
    assert slower == pytest.approx(4.16203051406401873) or mu != 0.3
    for time in (0.2, v0 / slower + 0.1):
        sim = run(groove(half_angle), (0.0, 0.0, 0.0), (0.0, v0, 0.0), duration=time, dt=dt,
                  friction={'dry': mu})
        t = min(time, v0 / slower)
        assert_allclose(sim.velocity[0], (0.0, v0 - slower * t, 0.0), atol=1e-11)
        assert_allclose(sim.position[0], (0.0, v0 * t - 0.5 * slower * t * t, 0.0), atol=1e-11)


@pytest.mark.parametrize('degrees', [5.0, 0.5])
@pytest.mark.parametrize('eps', [0.0, 0.5, 0.9])
def test_falling_into_an_acute_wedge(degrees, eps):
    """T54: gravity into a wedge: it ends, nobody gets through, nor faster than in free fall."""
    half = np.radians(degrees)
    for place in ((0.0, 0.0, 1.0), (0.9 * half, 0.1, 1.0)):
        sim = run(groove(half), place, duration=0.05, dt=0.05, restitution=eps,
                  friction={'dry': 0.1})
        energy = sim.energy()
        for _ in range(60):
            sim.advance(0.05)
            assert (sim.clearance() >= -1e-12).all()
            assert sim.energy() <= energy + 1e-12
            energy = sim.energy()
        assert 0.0 <= sim.position[0, 2] <= 1.0
        assert sim.counters['undecided'] == sim.counters['unplaced'] == 0
