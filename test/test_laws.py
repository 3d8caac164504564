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

"""Laws of collision and friction, one term at a time, with floats and with arrays."""

from math import exp, inf

from collision_sim.core import laws
from hypothesis import given, strategies as st
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest

pytestmark = pytest.mark.filterwarnings('ignore:overflow')     # without the compiler

speeds = st.floats(0.0, 1e300)
coefficients = st.floats(0.0, 1e300)


@pytest.mark.parametrize(('v_n', 'restitution', 'expected'), [
    (-4.0, 0.0, 4.0), (-4.0, 0.5, 6.0), (-4.0, 1.0, 8.0), (0.0, 1.0, 0.0), (3.0, 1.0, 0.0),
    (-5e-324, 1.0, 1e-323), (-1e300, 0.0, 1e300)])
def test_normal_impulse(v_n, restitution, expected):
    """-(1 + eps) v_N of who approaches, nothing of who does not."""
    assert laws.normal_impulse(v_n, restitution) == expected


@pytest.mark.parametrize(('speed', 'dv_n', 'mu', 'expected'), [
    (3.0, 6.0, 0.1, 0.8), (3.0, 6.0, 0.5, 0.0), (3.0, 6.0, 9.0, 0.0), (3.0, 0.0, 0.5, 1.0),
    (3.0, 6.0, 0.0, 1.0), (0.0, 6.0, 0.5, 0.0), (0.0, 0.0, 0.5, 0.0), (5e-324, 1.0, 0.5, 0.0),
    (1e-300, 1.0, 1e300, 0.0), (3.0, 1.0, 1e308, 0.0)])
def test_dry_friction(speed, dv_n, mu, expected):
    """max(0, 1 - mu dv_N / v_T); where nothing slides the factor matters not."""
    assert laws.dry_friction(speed, dv_n, mu, mu) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(('speed', 'expected'), [(2.9, 0.0), (3.0, 0.0), (3.3, 1.0 - 1.2 / 3.3)])
def test_static_above_kinetic_friction(speed, expected):
    """Sticks below static dv_N = 3, slips with the kinetic coefficient above: a jump."""
    assert laws.dry_friction(speed, 6.0, 0.5, 0.2) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(('coefficient', 'linear', 'capped'), [
    (0.0, 1.0, 1.0), (0.1, 0.4, 0.4), (10.0, -59.0, 0.0)])
def test_wet_friction(coefficient, linear, capped):
    """1 - D dv_N, which reverses; the same capped at 0; exp(-D dv_N)."""
    assert laws.wet_friction_linear(coefficient, 6.0) == pytest.approx(linear, rel=1e-15)
    assert laws.wet_friction_capped(coefficient, 6.0) == pytest.approx(capped, rel=1e-15)
    expected = exp(-6.0 * coefficient)
    assert laws.wet_friction_exponential(coefficient, 6.0) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(('depth', 'expected'), [
    (0.0, 0.0), (1e-3, 0.1), (0.1, 10.0), (5.0, 10.0), (inf, 10.0)])
def test_repulsion(depth, expected):
    """A tenth of the depth in a step of 1 ms, at most 10 m/s."""
    assert laws.repulsion(depth, 1e-3, 0.1, 10.0) == pytest.approx(expected, rel=1e-15)


def test_repulsion_never_overshoots():
    """With a share of 1 the depth is gone after a step, with less never quite."""
    for share, left in ((1.0, 0.0), (0.1, 0.9), (0.5, 0.5)):
        assert 0.3 - 0.01 * laws.repulsion(0.3, 0.01, share, 1e9) == pytest.approx(left * 0.3)


@given(speeds, speeds, coefficients)
def test_friction_factors_are_shares(speed, dv_n, coefficient):
    """No friction reverses or speeds up, except for the linear form; it stays in its cone."""
    dry = laws.dry_friction(speed, dv_n, coefficient, coefficient)
    assert 0.0 <= dry <= 1.0
    assert (1.0 - dry) * speed <= coefficient * dv_n * (1.0 + 1e-12) + speed * 1e-15
    assert 0.0 <= laws.wet_friction_exponential(coefficient, dv_n) <= 1.0
    assert 0.0 <= laws.wet_friction_capped(coefficient, dv_n) <= 1.0


@given(st.floats(0.0, 1.0), speeds)
def test_no_energy_from_a_bounce(restitution, speed):
    """The speed after is eps times that before."""
    after = -speed + laws.normal_impulse(-speed, restitution)
    assert -1e-15 * speed <= after <= speed


@pytest.mark.parametrize(('law', 'arguments'), [
    (laws.normal_impulse, ([-4.0, 0.0, 3.0], 0.5)),
    (laws.normal_impulse, ([-4.0, -1.0, 3.0], [0.0, 0.5, 1.0])),
    (laws.dry_friction, ([3.0, 0.0, 9.0], 6.0, 0.5, 0.3)),
    (laws.dry_friction, (3.0, [0.0, 1.0, 6.0], 0.5, [0.1, 0.2, 0.5])),
    (laws.wet_friction_linear, ([0.0, 0.1, 10.0], 6.0)),
    (laws.wet_friction_capped, (0.1, [0.0, 6.0, 60.0])),
    (laws.wet_friction_exponential, ([0.0, 0.1, 10.0], [1.0, 2.0, 3.0])),
    (laws.repulsion, ([0.0, 1e-3, 9.0], 1e-3, 0.1, 10.0)),
])
def test_laws_take_arrays(law, arguments):
    """An array gives what its numbers give one by one."""
    arrays = [np.array(a) if isinstance(a, list) else a for a in arguments]
    rows = zip(*np.broadcast_arrays(*arrays))
    assert_array_equal(law(*arrays), [law(*(float(value) for value in row)) for row in rows])


def test_wet_frictions_agree_when_weak():
    """All forms have the same first order in D dv_N."""
    z = 1e-5
    forms = (laws.wet_friction_linear, laws.wet_friction_capped, laws.wet_friction_exponential)
    assert_allclose([form(z, 1.0) for form in forms], 1.0 - z, rtol=0.0, atol=z ** 2)
    assert sorted(laws.WET_FORMS) == ['capped', 'exponential', 'linear']
