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
One particle and fixed planes, against closed forms.

Numbers such as T13 are those of the project's list of reference cases. v_N and v_T are the normal
and tangential velocity, eps the restitution, mu and D the coefficients of dry and wet friction.
"""

from math import cos, exp, pi, sin, sqrt, tan

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import (EPSILON, G, incline, METHODS, order, plane, root_mean_square, simulate,
                          STAGED)

pytestmark = pytest.mark.filterwarnings('ignore:overflow')     # without the compiler

every_method = pytest.mark.parametrize('method', METHODS)
OBLIQUE = (3.0, 0.0, -4.0)      # v_T = 3, v_N = -4; with eps = 0.5 the change of v_N is 6


def one_hit(velocity, **scene):
    """Velocity of a particle after it has hit the ground once, without gravity."""
    sim = simulate([plane()], (0.0, 0.0, 1e-3), velocity, gravity=(0.0, 0.0, 0.0), **scene)
    sim.step()
    return sim.velocity[0]


def bounced(height, time, eps):
    """Height after the first bounce of a drop: eps v1 tau - g tau^2 / 2, v1 = sqrt(2 g h)."""
    v1 = np.sqrt(2.0 * G * height)
    tau = time - v1 / G
    return eps * v1 * tau - 0.5 * G * tau ** 2


@every_method
@pytest.mark.parametrize('flight', ['ballistic', 'symplectic_euler'])
@pytest.mark.jit
def test_single_bounce_is_first_order(method, flight):
    """T01: the time of the hit is wrong by O(dt), at random phases of the step."""
    heights = 1.0 + 0.1 * np.arange(200) / 200
    start = np.zeros((200, 3))
    start[:, 2] = heights
    steps, errors = [0.01007, 0.005011, 0.002503, 0.0012517, 0.00062533], []
    for dt in steps:
        sim = simulate([plane()], start, dt=dt, method=method, flight=flight, restitution=0.5)
        sim.advance(0.65)
        errors.append(root_mean_square(sim.position[:, 2] - bounced(heights, sim.time, 0.5)))
    assert order(steps, errors) == pytest.approx(1.0, abs=0.15)


def test_apex_after_the_first_bounce():
    """T01: with eps = 1/2 the apex is h eps^2, to O(v dt)."""
    dt = 1e-4
    sim = simulate([plane()], (0.0, 0.0, 1.0), dt=dt, restitution=0.5)
    sim.advance(0.451523640985730904 * 1.5)         # t1 (1 + eps): the first apex
    assert sim.position[0, 2] == pytest.approx(0.25, abs=2 * 4.43 * dt)
    assert sim.velocity[0, 2] == pytest.approx(0.0, abs=2 * G * dt)


@every_method
@pytest.mark.parametrize(('eps', 'last'), [(0.5, 1.35457092295719271), (0.9, 8.57894917872888718)])
@pytest.mark.jit
def test_bounces_die_out(method, eps, last):
    """
    T02: infinitely many bounces end at t1 (1 + eps) / (1 - eps), then the particle rests.

    With a collision stage it rests exactly, at a gap that a step from rest would cross. Without
    it hops remain, where the gain g v dt of a bounce makes up for its loss (1 - eps^2) v^2 / 2.
    """
    dt = 1e-3
    sim = simulate([plane()], (0.0, 0.0, 1.0), dt=dt, method=method, restitution=eps)
    sim.advance(1.1 * last)
    heights = []
    for _ in range(50):
        sim.step()
        heights.append(sim.position[0, 2])
    if method in STAGED:
        assert 0.0 <= max(heights) == min(heights) <= 0.5 * G * dt ** 2
        assert_array_equal(sim.velocity[0], 0.0)
    else:
        assert 0.0 <= min(heights) <= max(heights) <= 4.0 * G * dt ** 2 / (1.0 - eps ** 2) ** 2


@pytest.mark.jit
def test_elastic_bounces_keep_the_energy():
    """T03: eps = 1 with `collision_then_contact`: E is constant, to rounding, for 1e5 bounces."""
    steps = 9_100_000
    sim = simulate([plane()], (0.0, 0.0, 1.0), dt=1e-2, restitution=1.0, contacts=False)
    energy = sim.energy()
    sim.step(steps)
    assert sim.counters['collisions'] > 100_000
    assert sim.energy() == pytest.approx(energy, rel=steps * EPSILON)


@pytest.mark.parametrize(('method', 'flight', 'sign'), [
    ('single_pass', 'ballistic', 1.0), ('single_pass', 'symplectic_euler', 1.0),
    ('multi_pass', 'ballistic', 1.0), ('multi_pass', 'symplectic_euler', 1.0),
    ('collision_then_contact', 'symplectic_euler', -1.0)])
@pytest.mark.parametrize('dt', [1e-2, 1e-3])
@pytest.mark.jit
def test_elastic_bounces_gain_or_lose_energy(method, flight, sign, dt):
    """
    A bounce changes the energy by g v dt, so after n of them E / E0 = (1 +- n g dt / v1)^2.

    `single_pass` and `multi_pass` gain: the reflected mean velocity leads v dt above the place
    where the particle was. Symplectic Euler loses as much with `collision_then_contact`.
    """
    bounces, v1 = 300, sqrt(2.0 * G)
    if sign < 0.0 and dt == 1e-2:
        bounces = 20            # later all of it is lost
    sim = simulate([plane()], (0.0, 0.0, 1.0), dt=dt, method=method, flight=flight,
                   restitution=1.0)
    energy = sim.energy()
    while sim.counters['collisions'] < bounces:
        sim.step(int(0.05 / dt))
    # the phases of the hits make v vary by up to g dt
    assert sqrt(sim.energy() / energy) == pytest.approx(1.0 + sign * bounces * G * dt / v1,
                                                        abs=G * dt / v1)


@every_method
@pytest.mark.parametrize(('flight', 'expected'), [('ballistic', 1.25), ('symplectic_euler', 1.0)])
@pytest.mark.jit
def test_inelastic_landing(method, flight, expected):
    """
    T04: eps = 0: v_N stops at a gap of O(dt), which is then fallen through in O(sqrt(dt)).

    So z has order 1 + 1/4 in L2 over time; symplectic Euler falls with an error of O(dt) besides.
    """
    count, duration = 100, 0.6
    heights = 1.0 + 0.1 * np.arange(count) / count
    start = np.zeros((count, 3))
    start[:, 2] = heights
    steps, errors = [0.01007, 0.005011, 0.002503, 0.0012517], []
    for dt in steps:
        sim = simulate([plane()], start, dt=dt, method=method, flight=flight)
        total = 0.0
        for _ in range(int(duration / dt)):
            sim.step()
            exact = np.maximum(heights - 0.5 * G * sim.time ** 2, 0.0)
            total += dt * np.mean((sim.position[:, 2] - exact) ** 2)
        errors.append(sqrt(total))
    assert order(steps, errors) == pytest.approx(expected, abs=0.15)


def test_nothing_happens_after_an_inelastic_landing():
    """T04: after the landing there are no collisions any more, and v_N stays 0."""
    sim = simulate([plane()], (0.0, 0.0, 1.0))
    sim.advance(0.6)
    collisions, place = sim.counters['collisions'], sim.position[0].copy()
    sim.step(1000)
    assert sim.counters['collisions'] == collisions
    assert_array_equal(sim.velocity[0], 0.0)
    assert_array_equal(sim.position[0], place)


oblique_hits = pytest.mark.parametrize(('friction', 'expected'), [
    ({'dry': 0.1}, 3.0 - 0.1 * 6.0),                                                  # T06
    ({'wet': {'coefficient': 0.1, 'form': 'linear'}}, 3.0 * (1.0 - 0.6)),             # T09
    ({'wet': {'coefficient': 0.1, 'form': 'capped'}}, 3.0 * (1.0 - 0.6)),
    ({'wet': {'coefficient': 0.1, 'form': 'exponential'}}, 1.6464349082820793),
    ({'wet': {'coefficient': 10.0, 'form': 'linear'}}, -177.0),                       # T10
    ({'wet': {'coefficient': 10.0, 'form': 'capped'}}, 0.0),
    ({'wet': {'coefficient': 10.0, 'form': 'exponential'}}, 3.0 * 8.75651076269652e-27),
    ({'dry': 0.1, 'wet': 0.1}, 2.4 * exp(-0.6)),
], ids=str)


@every_method
@oblique_hits
def test_oblique_hit(method, friction, expected):
    """T06, T09, T10: v = (3, -4), eps = 1/2: v_N' = 2, v_T' by the law for dv_N = 6."""
    after = one_hit(OBLIQUE, restitution=0.5, friction=friction, method=method)
    assert_allclose(after, (expected, 0.0, 2.0), rtol=16 * EPSILON, atol=3.0 * EPSILON)


@every_method
@pytest.mark.parametrize('mu', [0.5, 0.5 * (1.0 + 1e-9), 1.0, 1e9, 1e308])
def test_oblique_hit_sticks(method, mu):
    """T07: mu dv_N >= v_T stops the tangential velocity exactly; mu = 1/2 is the boundary."""
    after = one_hit(OBLIQUE, restitution=0.5, friction={'dry': mu}, method=method)
    assert_array_equal(after, (0.0, 0.0, 2.0))


@every_method
@pytest.mark.parametrize('angle', [0.0, 0.3, 2.0, -1.0])
def test_oblique_hit_in_any_direction(method, angle):
    """T06: friction acts against v_T, whatever its direction in the surface."""
    c, s = cos(angle), sin(angle)
    after = one_hit((3.0 * c, 3.0 * s, -4.0), restitution=0.5, friction={'dry': 0.1},
                    method=method)
    assert_allclose(after, (2.4 * c, 2.4 * s, 2.0), atol=1e-14)


@every_method
@pytest.mark.parametrize('mu', [0.0, 0.5, 1e9, 1e308])
def test_normal_hit_makes_no_slip(method, mu):
    """T08: v_T = 0 stays 0: no 0 / 0 in the direction of friction."""
    after = one_hit((0.0, 0.0, -4.0), restitution=0.5, friction={'dry': mu}, method=method)
    assert_array_equal(after, (0.0, 0.0, 2.0))


@every_method
@pytest.mark.jit
def test_sliding_to_a_stop(method):
    """T12: v0 = 2, mu = 0.3: stops after v0^2 / (2 mu g), without reversal, and stays there."""
    dt, mu, v0 = 1 / 256, 0.3, 2.0
    sim = simulate([plane()], (0.0, 0.0, 0.0), (v0, 0.0, 0.0), friction={'dry': mu}, dt=dt,
                   method=method)
    for _ in range(int(v0 / (mu * G) / dt) + 2):
        sim.step()
        assert sim.velocity[0, 0] >= 0.0
    stop = sim.position[0].copy()
    # in the last step the particle slides with less than mu g dt for less than dt
    assert stop[0] == pytest.approx(0.679578661230037377, abs=mu * G * dt ** 2)
    sim.step(1_000_000)
    assert_array_equal(sim.position[0], stop)


@every_method
@pytest.mark.parametrize('mu', [0.1, 0.3, 1.0])
def test_sliding_on_a_plane_is_exact(method, mu):
    """
    T12: v = v0 - mu g t, also with eps > 0 where there is a collision stage.

    In the first step of the others friction is that of the mean velocity, half a step's.
    """
    eps = 0.5 if method in STAGED else 0.0
    sim = simulate([plane()], (0.0, 0.0, 0.0), (2.0, 0.0, 0.0), friction={'dry': mu}, dt=1 / 256,
                   restitution=eps, method=method)
    sim.step(40)
    late = 0.0 if method in STAGED else 0.5 * mu * G / 256
    assert sim.velocity[0, 0] == pytest.approx(2.0 + late - mu * G * sim.time, abs=2e-14)
    assert sim.position[0, 0] == pytest.approx(
        2.0 * sim.time - 0.5 * mu * G * sim.time ** 2, abs=2e-14)


@every_method
@pytest.mark.jit
def test_incline_knife_edge(method):
    """T13: sticks for mu > tan(theta), slides below: 1e-9 beside it the acceleration is right."""
    angle, duration = pi / 6, 10.0
    sticks = simulate([incline(angle)], (0.0, 0.0, 0.0), method=method,
                      friction={'dry': tan(angle) * (1.0 + 1e-9)})
    slides = simulate([incline(angle)], (0.0, 0.0, 0.0), method=method,
                      friction={'dry': tan(angle) * (1.0 - 1e-9)})
    sticks.advance(duration)
    slides.advance(duration)
    assert_array_equal(sticks.position[0], 0.0)
    # a = g cos(theta) (tan(theta) - mu), to the relative rounding 1e-16 / 1e-9 of the difference
    path = 0.5 * G * cos(angle) * tan(angle) * 1e-9 * duration ** 2
    assert -slides.position[0, 0] / cos(angle) == pytest.approx(path, rel=1e-4)
    assert slides.position[0, 0] * tan(angle) == pytest.approx(slides.position[0, 2], rel=1e-4)


@every_method
@pytest.mark.jit
def test_rest_on_an_incline_for_a_million_steps(method):
    """T13, T16: no creep; eps matters not beside a collision stage, else it must be 0."""
    for eps in (0.0, 0.5, 1.0) if method in STAGED else (0.0, ):
        sim = simulate([incline(pi / 6)], (0.0, 0.0, 0.0), friction={'dry': 1.0},
                       restitution=eps, method=method)
        sim.step(1_000_000)
        assert_array_equal(sim.position[0], 0.0)
        if method in STAGED:
            assert_array_equal(sim.velocity[0], 0.0)


@pytest.mark.parametrize('angle', [0.0, 0.1, 0.7, 1.2])
@pytest.mark.parametrize('place', [(0.0, 0.0, 0.0), (0.1, -0.7, 3.3), (1e3, 1e4, -1e3)])
def test_rest_anywhere(angle, place):
    """T16: the same away from the origin, where the distance to the plane rounds."""
    sim = simulate([incline(angle, point=place)], place, friction={'dry': 3.0}, restitution=0.5)
    sim.step(500)
    assert_array_equal(sim.position[0], place)
    assert_array_equal(sim.velocity[0], 0.0)


@pytest.mark.parametrize('method', METHODS[:2])
@pytest.mark.parametrize('eps', [0.5, 1.0])
@pytest.mark.jit
def test_block_on_an_incline_creeps_by_the_first_methods(method, eps):
    """T16: the lecture's warning: with eps > 0 they hop down the incline; less at smaller dt."""
    ways = []
    for dt in (1 / 128, 1 / 2048):
        sim = simulate([incline(pi / 6)], (0.0, 0.0, 0.0), friction={'dry': 1.0}, dt=dt,
                       restitution=eps, method=method)
        sim.advance(1.0)
        ways.append(np.linalg.norm(sim.position[0]))
    assert 0.0 < ways[1] < 0.5 * ways[0]


@every_method
def test_sliding_down_an_incline(method):
    """T14: mu = 0.2 at 30 degrees: a = g (sin - mu cos), exact in all methods."""
    sim = simulate([incline(pi / 6)], (0.0, 0.0, 0.0), friction={'dry': 0.2}, method=method)
    sim.step(240)
    down = np.array([-cos(pi / 6), 0.0, -sin(pi / 6)])
    assert sim.position[0] @ down == pytest.approx(3.20585815777493138 / 2, abs=240 * EPSILON)
    if method in STAGED:
        assert_allclose(sim.velocity[0], 3.20585815777493138 * down, atol=240 * 4 * EPSILON)


@every_method
def test_wet_sliding(method):
    """T18: v = v0 e^(-D g t); exact with a collision stage, else the first step presses half."""
    v0, wet, dt = 2.0, 0.5, 1 / 240
    sim = simulate([plane()], (0.0, 0.0, 0.0), (v0, 0.0, 0.0), friction={'wet': wet}, dt=dt,
                   method=method)
    sim.step(240)
    late = 0.0 if method in STAGED else wet * G * dt / 2
    assert sim.velocity[0, 0] == pytest.approx(0.0148188861658293715 * exp(late), rel=1e-12)
    # the velocity of the mean in each step is v0 e^(-D g (t + dt / 2)): a midpoint rule
    path = v0 / (wet * G) * (1.0 - exp(-wet * G))
    assert sim.position[0, 0] == pytest.approx(path, rel=(wet * G * dt) ** 2 / 12)


@every_method
@pytest.mark.parametrize('form', ['exponential', 'capped'])
@pytest.mark.parametrize('stiffness', [1e3, 1e6, 1e300])
def test_stiff_wet_friction_stops(method, form, stiffness):
    """T18: D g dt >> 1: stops at once, neither reverses nor grows."""
    sim = simulate([plane()], (0.0, 0.0, 0.0), (2.0, 0.0, 0.0), method=method,
                   friction={'wet': {'coefficient': stiffness, 'form': form}})
    for _ in range(20):
        before = sim.velocity[0, 0]
        sim.step()
        assert 0.0 <= sim.velocity[0, 0] <= before
    assert sim.velocity[0, 0] < 1e-6
    assert 0.0 <= sim.position[0, 0] < 2.0 * sim.dt


@every_method
def test_stiff_wet_friction_explodes_in_its_linear_form(method):
    """T10: the explicit form reverses and grows where D dv_N > 2, as the lecture warns."""
    halves = 2.0 if method == 'second_order_contact' else 1.0      # of dv_N, in a step
    sim = simulate([plane()], (0.0, 0.0, 0.0), (2.0, 0.0, 0.0), method=method,
                   friction={'wet': {'coefficient': 3.0 * halves * 240 / G, 'form': 'linear'}})
    sim.step(20)
    assert abs(sim.velocity[0, 0]) > 1e3


@every_method
@pytest.mark.parametrize('gap', [0.0, 1e-15, -1e-15])
def test_ceiling_graze(method, gap):
    """T20: an apex that just touches the ceiling changes the velocity by no more than its own."""
    dt, apex = 2.0 ** -8, 64                             # v0 = g t, so that the apex is a step
    v0 = G * dt * apex
    height = v0 ** 2 / (2.0 * G)
    sim = simulate([plane((0.0, 0.0, -1.0), (0.0, 0.0, height + gap))], (0.0, 0.0, 0.0),
                   (1.0, 0.0, v0), dt=dt, method=method, restitution=1.0)
    sim.step(2 * apex)
    # a hit can turn only v_N of the step before the apex, at most g dt
    assert sim.velocity[0, 2] == pytest.approx(-v0, abs=2.0 * G * dt)
    assert sim.position[0, 2] == pytest.approx(0.0, abs=2.0 * G * dt * (apex + 1) * dt)
    assert sim.velocity[0, 0] == 1.0


@every_method
@pytest.mark.parametrize('height', [0.0, 1e-300])
@pytest.mark.parametrize('speed', [1.0, 0.0, -1.0])
def test_start_on_the_surface(method, height, speed):
    """T21: at the surface it leaves, rests, or bounces once at t = 0 and then leaves."""
    dt = 1e-3
    sim = simulate([plane()], (0.0, 0.0, height), (0.0, 0.0, speed), dt=dt, method=method,
                   restitution=0.5)
    sim.step(20)
    expected = {1.0: 1.0, 0.0: 0.0, -1.0: 0.5}[speed]
    exact = expected * sim.time - 0.5 * G * sim.time ** 2 if expected else 0.0
    slack = 0.0 if expected == 1.0 else 2.0 * G * dt * sim.time
    assert sim.position[0, 2] == pytest.approx(exact, abs=slack + 1e-15)
    if speed != 0.0:
        assert sim.counters['collisions'] == (speed < 0.0)
        assert sim.velocity[0, 2] == pytest.approx(expected - G * sim.time, abs=2.0 * G * dt)


@every_method
@pytest.mark.jit
def test_no_friction_keeps_the_tangential_velocity(method):
    """T22: mu = 0: v_x is bit-identical after 1e5 bounces, between two walls."""
    walls = [plane(), plane((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), name='ceiling')]
    sim = simulate(walls, (0.0, 0.0, 0.3), (0.1, 1 / 3, 51.7), gravity=(0.0, 0.0, 0.0),
                   restitution=1.0, method=method)
    sim.step(480_000)
    assert sim.counters['collisions'] > 100_000
    assert_array_equal(sim.velocity[0, :2], (0.1, 1 / 3))
    assert abs(sim.velocity[0, 2]) == 51.7


@pytest.mark.jit
def test_no_friction_keeps_the_tangential_velocity_under_gravity():
    """T22: the same with 1e5 bounces on the ground."""
    sim = simulate([plane()], (0.0, 0.0, 1.0), (0.1, 1 / 3, 0.0), dt=1e-2, restitution=1.0)
    sim.step(9_100_000)
    assert sim.counters['collisions'] > 100_000
    assert_array_equal(sim.velocity[0, :2], (0.1, 1 / 3))
