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

"""The answers of the report's scenes, against the reference cases and against themselves."""

from math import acos, cos, inf, pi, sin, sqrt

from collision_sim import scene as scenes
from collision_sim.studies.cases import all_cases
from collision_sim.studies.errors import (Answer, dt_of, measure, sample_times, SAMPLES, Setting,
                                          settings)
from collision_sim.studies.orders import fitted_order
from collision_sim.studies.pendulum import elliptic, fall_time, swing
import numpy as np
from numpy.testing import assert_allclose
import pytest

CASES = all_cases(256)
every_case = pytest.mark.parametrize('case', CASES, ids=lambda case: case.name)
DEFAULT = Setting('collision_then_contact', 'end_of_step', 'ballistic')
G = 9.81


def named(name):
    """Give a case by its name."""
    return next(case for case in CASES if case.name == name)


def test_elliptic_functions():
    """sn(0.7, k = 0.6) to 20 digits by mpmath; sn^2 + cn^2 = 1 = dn^2 + k^2 sn^2."""
    sn, cn, dn = elliptic(np.array([0.7]), np.array([0.6]), np.array([0.8]))
    assert sn[0] == pytest.approx(0.62991711532348698, abs=4e-16)
    assert cn[0] == pytest.approx(0.77666236410845698, abs=4e-16)
    assert dn[0] ** 2 + 0.36 * sn[0] ** 2 == pytest.approx(1.0, abs=4e-16)


def test_elliptic_functions_at_their_limits():
    """Limits k = 0: sn = sin; k near 1: sn = tanh to O(kc^2)."""
    u = np.linspace(0.0, 3.0, 7)
    assert_allclose(elliptic(u, np.array(0.0), np.array(1.0))[0], np.sin(u), atol=1e-15)
    kc = 1e-7
    assert_allclose(elliptic(u, np.sqrt(1.0 - np.array(kc) ** 2), np.array(kc))[0], np.tanh(u),
                    atol=1e-12)


def test_period_of_the_bowl():
    """T42: released at 1 rad it is back after 4 sqrt(R / g) K(sin(1/2)), at rest."""
    angle, rate = swing(np.array([2.13913760055868884]), np.array(sin(0.5)), np.array(cos(0.5)))
    assert angle[0] == pytest.approx(1.0, abs=1e-14)
    assert rate[0] == pytest.approx(0.0, abs=2e-14)
    _, rate = swing(np.array([2.13913760055868884 / 4]), np.array(sin(0.5)), np.array(cos(0.5)))
    assert abs(rate[0]) == pytest.approx(3.0032097427364441, abs=1e-14)


def test_leaving_the_sphere_top():
    """T39: from 0.1 rad it leaves after 0.907110111046269434 s."""
    angle, leave = np.array([0.1]), acos(2.0 / 3.0 * cos(0.1))
    assert leave == pytest.approx(0.845528201856860743, abs=1e-15)
    assert fall_time(angle, np.array([leave]))[0] == pytest.approx(0.907110111046269434, abs=1e-15)


def test_sphere_top_in_the_air(monkeypatch):
    """T39: at t = 1.2 s it is at (1.243930772593345, -0.316542575433447)."""
    from collision_sim.studies import cases
    monkeypatch.setattr(cases, 'spread', lambda count, low, high, seed=0: np.full(count, 0.1))
    position, velocity = cases.sphere_top(1).reference(np.array([0.907110111046269434, 1.2]))
    assert_allclose(position[1, 0], (1.243930772593345, 0.0, -0.316542575433447), atol=2e-15)
    assert np.linalg.norm(velocity[0, 0]) == pytest.approx(2.55094634222640765, abs=1e-14)


def test_bounce_train():
    """T01, T02: hits at t1 (1 + 2 sum eps^k), apexes h eps^(2 n), rest after t_inf."""
    from collision_sim.studies.case import bounces
    first, eps = 0.451523640985730904, 0.5
    apexes = first * np.array([0.0, 1.5, 2.25, 2.625])
    heights, speeds = bounces(apexes, np.ones(1), eps)
    assert_allclose(heights[:, 0], eps ** (2.0 * np.arange(4)), atol=1e-14)
    assert_allclose(speeds[:, 0], 0.0, atol=1e-14)
    heights, _ = bounces(first * np.array([1.0, 2.0, 2.5]), np.ones(1), eps)
    assert_allclose(heights[:, 0], 0.0, atol=1e-14)


def test_conveyor_slips_as_long_as_it_should():
    """T29: V = 1, mu = 0.4: at rest it slips for 0.254841997961264016 s over 0.12742 m."""
    from collision_sim.studies.case import slide
    place = slide(np.zeros((1, 3)), np.array([[-1.0, 0.0, 0.0]]), 0.4 * G, (1.0, 0.0, 0.0))
    stop = 0.254841997961264016
    position, velocity = place(np.array([stop, 1.0]))
    assert stop - position[0, 0, 0] == pytest.approx(0.127420998980632008, abs=1e-15)
    assert_allclose(velocity[:, 0, 0], 1.0, atol=1e-15)
    assert 1.0 - position[1, 0, 0] == pytest.approx(0.127420998980632008, abs=1e-15)


@every_case
def test_answers_start_where_the_scene_does(case):
    """At t = 0 the answer is the start, for positions and velocities."""
    position, velocity = case.reference(np.zeros(1))
    assert_allclose(position[0], case.scene['particles']['position'], atol=1e-15)
    start = np.broadcast_to(case.scene['particles']['velocity'], velocity[0].shape)
    assert_allclose(velocity[0], start, atol=2e-15)


@every_case
def test_velocities_are_those_of_the_positions(case):
    """The answer's velocity is the derivative of its position, but for the few at an event."""
    times, h = np.linspace(0.01, case.duration, 97), 1e-6
    _, velocity = case.reference(times)
    slope = (case.reference(times + h)[0] - case.reference(times - h)[0]) / (2.0 * h)
    differ = np.linalg.norm(slope - velocity, axis=2)
    assert np.median(differ) < 1e-9
    assert np.mean(differ > 1e-4) < 1e-3


@every_case
def test_ways_to_step(case):
    """All methods, each detection and, where anything accelerates, flight; `exact` once."""
    found = settings(case)
    assert {setting.method for setting in found} == set(scenes.METHODS)
    weightless = case.name in ('moving_wall', 'small_ball')
    for method in scenes.METHODS:
        many = sum(setting.method == method for setting in found)
        assert many == (1 if method == 'exact' else 2 if weightless else 4)


def orders_of(case, setting, steps=(29, 71, 173, 421)):
    """Order over time and at the end of one way to step a case."""
    answer = Answer(case)
    rows = [measure(case, answer, setting, count, 1) for count in steps]
    dt = [row.dt for row in rows]
    assert all(row.failure == '' for row in rows[1:])
    return (fitted_order(dt, [row.error for row in rows], case.scale),
            fitted_order(dt, [row.error_end for row in rows], case.scale))


def assert_order(order, theory):
    """Compare an order with that of theory; inf is exact to rounding."""
    assert order == theory if theory == inf else order == pytest.approx(theory, abs=0.15)


@every_case
@pytest.mark.jit
@pytest.mark.parametrize('setting', [
    DEFAULT, DEFAULT._replace(method='single_pass'), DEFAULT._replace(flight='symplectic_euler')],
    ids=lambda setting: '-'.join(setting))
def test_orders_are_those_of_theory(case, setting):
    """Position error over time and at the end, over more than a decade of dt."""
    for order in orders_of(case, setting):
        assert_order(order, case.theory(setting))


@pytest.mark.parametrize('name', ['bowl', 'sphere_top'])
@pytest.mark.jit
def test_second_order_on_curved_surfaces(name):
    """The second-order contact stage on frictionless surfaces: order 2."""
    if 'second_order_contact' not in scenes.METHODS:
        pytest.skip('no such method yet')
    case = named(name)
    setting = DEFAULT._replace(method='second_order_contact')
    assert case.theory(setting) == 2.0
    for order in orders_of(case, setting):
        assert_order(order, 2.0)


def test_theory():
    """The table of physics.md: bounces 1, slides exact, Euler at most 1, curved 1 or 2."""
    euler = DEFAULT._replace(flight='symplectic_euler')
    assert named('bounce').theory(DEFAULT) == 1.0
    assert named('incline_slide').theory(DEFAULT) == inf
    assert named('incline_slide').theory(euler) == 1.0
    assert named('incline_stick').theory(DEFAULT._replace(method='single_pass')) == 1.0
    assert named('incline_stick').theory(euler) == inf
    assert named('bowl').theory(DEFAULT._replace(method='second_order_contact')) == 2.0
    for case in CASES:
        assert case.theory(DEFAULT._replace(method='exact')) == inf


def test_fitted_order_of_synthetic_errors():
    """Slopes 1 and 2 are found beside coarse errors that bend and fine ones that are rounding."""
    dt = np.geomspace(1e-5, 1e-1, 17)
    for order in (1.0, 2.0):
        errors = 0.5 * dt ** order * (1.0 + 20.0 * dt) + 1e-15
        assert fitted_order(dt, errors) == pytest.approx(order, abs=0.02)
        assert fitted_order(dt[::-1], errors[::-1]) == pytest.approx(order, abs=0.02)


def test_fitted_order_where_there_is_none():
    """All rounding is inf; too few or only coarse errors give none; NaN is left out."""
    dt = np.geomspace(1e-4, 1e-1, 7)
    assert fitted_order(dt, np.full(7, 1e-13)) == inf
    assert fitted_order(dt, np.zeros(7)) == inf
    assert fitted_order(dt, np.full(7, 0.5)) is None
    assert fitted_order(dt[:2], 0.1 * dt[:2]) is None
    assert fitted_order([], []) is None
    errors = 0.1 * dt
    errors[-2:] = np.nan
    assert fitted_order(dt, errors) == pytest.approx(1.0, abs=1e-12)


def test_fitted_order_above_an_uncertain_reference():
    """Errors near that of the reference are left out."""
    dt = np.geomspace(1e-4, 1e-1, 13)
    errors = 0.01 * dt ** 2 + 1e-8
    assert fitted_order(dt, errors, uncertainty=1e-8) == pytest.approx(2.0, abs=0.1)
    assert fitted_order(dt, errors) < 1.5


def test_measured_row():
    """A row holds what was asked for, and errors by hand: a slide is exact, and so its energy."""
    case = named('incline_slide')
    row = measure(case, Answer(case), DEFAULT, 5, 1)
    assert row.scene == case.name and row.setting == DEFAULT and row.particles == 64
    assert row.steps == 5 * SAMPLES
    assert row.dt == dt_of(case, 5) == pytest.approx(case.duration / row.steps)
    assert row.error < 1e-13 and row.error_end < 1e-13 and abs(row.energy) < 1e-13
    assert row.penetration < 1e-13
    assert row.run_time_step * row.steps == pytest.approx(row.run_time * case.duration)
    assert row.run_time > 0.0


def test_error_of_an_answer_that_is_wrong_by_a_known_way():
    """An answer that is off by 1 cm at all times gives an error of 1 cm, and no energy."""
    case = named('incline_stick')
    shifted = case._replace(reference=lambda times: (
        case.reference(times)[0] + (0.0, 0.01, 0.0), case.reference(times)[1]))
    row = measure(shifted, Answer(shifted), DEFAULT, 1, 1)
    assert row.error == pytest.approx(0.01, rel=1e-12) == row.error_end
    assert row.energy == 0.0


def test_tunnelling_is_a_failure():
    """T73: a step longer than the ball loses particles with `end_of_step`, never along paths."""
    case = named('small_ball')
    lost = measure(case, Answer(case), DEFAULT, 1, 1)
    assert lost.failure.endswith(f'of {len(case.scene["particles"]["position"])} lost')
    found = measure(case, Answer(case), DEFAULT._replace(detection='trajectory'), 1, 1)
    assert found.failure == ''


def test_sample_times_end_with_the_scene():
    """The last time of comparison is the duration."""
    case = named('bowl')
    assert sample_times(case)[-1] == case.duration
    assert len(sample_times(case)) == SAMPLES


def test_thrown_particles_stick_and_slide():
    """T06, T07: v_T' = max(0, v_T - mu (1 + eps) v_N); both kinds are among the particles."""
    case = named('oblique')
    height = case.scene['particles']['position'][:, 2]
    speed = case.scene['particles']['velocity'][:, 0]
    after = case.reference(np.array([case.duration]))[1][0, :, 0]
    assert_allclose(after, np.maximum(speed - 0.45 * np.sqrt(2.0 * G * height), 0.0), atol=1e-14)
    assert (after == 0.0).any() and (after > 0.0).any()


def test_groove_slows_by_its_angle():
    """T55: mu g / sin(half angle); sqrt(2) mu g at 90 degrees, 2 mu g at 60."""
    case = named('groove')
    start = case.scene['particles']['velocity'][:, 1]
    later = case.reference(np.array([0.1]))[1][0, :, 1]
    assert_allclose((start - later) / 0.1, 2.0 * 0.2 * G, rtol=1e-12)
    assert sqrt(2.0) == pytest.approx(1.0 / sin(pi / 4))


def test_drag_falls_as_in_closed_form():
    """T68: before the hit z = h - (g / k) (t - (1 - e^(-k t)) / k)."""
    case = named('drag')
    t = 0.1
    height = case.scene['particles']['position'][:, 2]
    position, velocity = case.reference(np.array([t]))
    e = (1.0 - np.exp(-2.0 * t)) / 2.0
    assert_allclose(position[0, :, 2], height - G / 2.0 * (t - e), atol=1e-14)
    assert_allclose(velocity[0, :, 2], -G * e, atol=1e-14)
