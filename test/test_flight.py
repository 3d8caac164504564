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

"""Candidate motion: coefficients, averages of exponentials, scalar against block."""

from decimal import Decimal, localcontext
from math import exp

from collision_sim.core.flight import decay, flight_coefficients, fly, quadratic_factor
from collision_sim.scene import Drag
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import FLIGHTS, simulate

GRAVITY = (0.5, 0.0, -9.81)
DRAGS = {'none': None, 'linear': Drag(linear=0.7, wind=(1.0, -2.0, 0.5)),
         'quadratic': Drag(quadratic=0.3, wind=(1.0, -2.0, 0.5)),
         'both': Drag(linear=0.7, quadratic=0.3, wind=(1.0, -2.0, 0.5))}


@pytest.mark.parametrize('z', [0.0, 1e-300, 1e-16, 1e-8, 1e-3, 0.05, 0.0999999, 0.1, 0.1000001,
                               0.5, 1.0, 5.0, 40.0, 700.0, 1e9])
def test_decay(z):
    """exp(-z) and its averages against 80 decimal digits: full precision at every z."""
    with localcontext() as context:
        context.prec = 80
        x = Decimal(z)
        e0 = (-x).exp()
        e1 = (1 - e0) / x if z > 1e-20 else 1 - x / 2
        e2 = (1 - e1) / x if z > 1e-20 else Decimal('0.5') - x / 6
    for found, exact in zip(decay(z), (e0, e1, e2)):
        assert found == pytest.approx(float(exact), rel=1e-14, abs=1e-300)


def test_coefficients_of_gravity():
    """At the end v + g dt, on average v + g dt / 2; with Euler both are the first."""
    ballistic = flight_coefficients(GRAVITY, None, 0.5, 'ballistic')
    assert_array_equal(ballistic.end_shift, np.array(GRAVITY) * 0.5)
    assert_array_equal(ballistic.mean_shift, np.array(GRAVITY) * 0.25)
    assert ballistic.gains == (1.0, 1.0) and ballistic.quadratic == (0.0, 0.0, 0.0, 0.0)
    euler = flight_coefficients(GRAVITY, None, 0.5, 'symplectic_euler')
    assert euler.end_shift == euler.mean_shift == ballistic.end_shift


def test_coefficients_of_drag():
    """Gains (e0, e1) of `decay`; half a step of the quadratic coefficient, and the wind."""
    flight = flight_coefficients((0.0, 0.0, 0.0), DRAGS['both'], 2.0, 'ballistic')
    e0, e1, _ = decay(1.4)
    assert flight.gains == (e0, e1)
    assert flight.quadratic == (0.3, 1.0, -2.0, 0.5)
    assert_allclose(flight.end_shift, np.array((1.0, -2.0, 0.5)) * (1.0 - e0), rtol=1e-15)
    assert_allclose(flight.mean_shift, np.array((1.0, -2.0, 0.5)) * (1.0 - e1), rtol=1e-14)
    euler = flight_coefficients((0.0, 0.0, 0.0), DRAGS['both'], 2.0, 'symplectic_euler')
    assert euler.gains == (e0, e0)


def test_neutral_drag_is_that_of_no_drag():
    """Coefficients of 0 leave nothing to compute."""
    neutral = flight_coefficients(GRAVITY, Drag(wind=(9.0, 9.0, 9.0)), 0.1, 'ballistic')
    assert neutral == flight_coefficients(GRAVITY, None, 0.1, 'ballistic')


@pytest.mark.parametrize('z', [0.0, 1e-300, 1.0, 1e300])
def test_quadratic_factor(z):
    """1 / (1 + c |v| dt / 2)."""
    assert quadratic_factor(2.0, z) == pytest.approx(1.0 / (1.0 + 2.0 * z), rel=1e-15)


def test_air_at_rest_with_the_particle():
    """A particle that moves with the wind feels neither drag nor a change."""
    for kind in ('linear', 'quadratic', 'both'):
        flight = flight_coefficients((0.0, 0.0, 0.0), DRAGS[kind], 0.1, 'ballistic')
        mean, end = fly(flight, (1.0, -2.0, 0.5))
        assert_allclose((mean, end), [(1.0, -2.0, 0.5)] * 2, rtol=1e-15)


def test_linear_drag_of_a_step():
    """V = w + (v0 - w) e^(-k dt)."""
    flight = flight_coefficients((0.0, 0.0, 0.0), DRAGS['linear'], 0.4, 'ballistic')
    _, end = fly(flight, (3.0, 0.0, 0.0))
    expected = np.array((1.0, -2.0, 0.5)) + np.array((2.0, 2.0, -0.5)) * exp(-0.28)
    assert_allclose(end, expected, rtol=1e-14)


@pytest.mark.parametrize('flight', FLIGHTS)
@pytest.mark.parametrize('drag', DRAGS)
def test_one_particle_flies_like_a_block(flight, drag):
    """`fly`, for the few that touch something, and the block loop agree bit for bit."""
    random, dt, drag = np.random.default_rng(3), 0.01, DRAGS[drag]
    scales = 10.0 ** random.uniform(-8.0, 8.0, (40, 1))
    position, velocity = random.normal(size=(40, 3)), scales * random.normal(size=(40, 3))
    section = {} if drag is None else {'drag': {
        'linear': drag.linear, 'quadratic': drag.quadratic, 'wind': list(drag.wind)}}
    sim = simulate([], position, velocity, gravity=GRAVITY, dt=dt, flight=flight, **section)
    sim.step()
    coefficients = flight_coefficients(GRAVITY, drag, dt, flight)
    for k in range(40):
        mean, end = fly(coefficients, tuple(velocity[k].tolist()))
        assert np.array(end).tobytes() == sim.velocity[k].tobytes()
        moved = position[k] + dt * np.array(mean)
        assert moved.tobytes() == sim.position[k].tobytes()
