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

"""Flight: gravity, drag and wind, against closed forms; dt = 0; nobody and nothing."""

from math import exp, expm1, sqrt, tan, tanh

from collision_sim import Scene, Simulation
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import EPSILON, FLIGHTS, G, METHODS, order, plane, simulate

pytestmark = pytest.mark.plain

START, VELOCITY = (1.0, -2.0, 3.0), (3.0, 0.5, 4.0)


def fly(duration, dt, flight='ballistic', velocity=VELOCITY, **sections):
    """Particle without colliders after a time."""
    sim = simulate([], START, velocity, dt=dt, flight=flight, **sections)
    sim.advance(duration)
    return sim


@pytest.mark.parametrize('method', METHODS)
def test_free_flight_is_exact(method):
    """Free fall: x0 + v0 t + g t^2 / 2 and v0 + g t, to the rounding of each step."""
    sim = simulate([plane(point=(0.0, 0.0, -99.0))], START, VELOCITY, gravity=(0.1, -0.2, -G),
                   method=method)
    sim.step(480)
    g, t = np.array((0.1, -0.2, -G)), sim.time
    assert_allclose(sim.velocity[0], VELOCITY + g * t, rtol=0, atol=480 * 20 * EPSILON)
    assert_allclose(sim.position[0], START + np.array(VELOCITY) * t + 0.5 * g * t * t,
                    rtol=0, atol=480 * 30 * EPSILON)


def test_symplectic_euler_is_its_discrete_sum():
    """x_n = x0 + n dt v0 + g dt^2 n (n + 1) / 2, which is first order."""
    dt, n = 1 / 128, 200
    sim = fly(n * dt, dt, 'symplectic_euler')
    expected = START[2] + n * dt * VELOCITY[2] - G * dt * dt * n * (n + 1) / 2
    assert sim.position[0, 2] == pytest.approx(expected, abs=n * 30 * EPSILON)
    steps = [0.0101, 0.00503, 0.00251]
    errors = []
    for dt in steps:
        sim = fly(1.0, dt, 'symplectic_euler')
        t = sim.time
        errors.append(abs(sim.position[0, 2] - (START[2] + VELOCITY[2] * t - 0.5 * G * t * t)))
    assert order(steps, errors) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize('dt', [1 / 7, 1 / 240, 1 / 3])
def test_linear_drag_is_exact(dt):
    """T68: k = 2: v = -(g / k) (1 - e^(-k t)), z by its integral, at any dt."""
    k = 2.0
    sim = fly(1.0, dt, velocity=(0.0, 0.0, 0.0), drag={'linear': k})
    t = sim.time
    if t == 1.0:
        assert sim.velocity[0, 2] == pytest.approx(-4.24118043572441475, rel=1e-13)
    assert sim.velocity[0, 2] == pytest.approx(G / k * expm1(-k * t), rel=1e-13)
    fall = -G / k * (t + expm1(-k * t) / k)
    assert sim.position[0, 2] == pytest.approx(START[2] + fall, abs=1e-12)


@pytest.mark.parametrize('flight', FLIGHTS)
@pytest.mark.parametrize('dt', [1e-6, 1 / 240, 10.0])
def test_stiff_linear_drag(flight, dt):
    """T68: k = 1e9: v = -g / k at once, at any dt, then it goes on like that."""
    sim = simulate([], START, VELOCITY, dt=dt, flight=flight, drag={'linear': 1e9})
    sim.step(3)
    assert_allclose(sim.velocity[0], (0.0, 0.0, -G / 1e9), rtol=1e-12, atol=1e-250)
    # v0 / k from the start, then -g t / k; the mean velocity of Euler is already the last one
    way = np.array(VELOCITY) / 1e9 if flight == 'ballistic' else np.zeros(3)
    assert_allclose(sim.position[0] - START, way + (0.0, 0.0, -G / 1e9 * sim.time),
                    rtol=0.0, atol=1e-15 + 3e-9 * (flight != 'ballistic') + 1e-17)


@pytest.mark.parametrize('method', METHODS)
def test_stiff_linear_drag_then_a_bounce(method):
    """T68: with k = 1e9 a hit reverses the terminal velocity, which is back a step later."""
    sim = simulate([plane()], (0.0, 0.0, 1e-10), dt=1 / 240, restitution=1.0, method=method,
                   drag={'linear': 1e9})
    for _ in range(50):
        sim.step()
        assert sim.position[0, 2] >= 0.0
        assert abs(sim.velocity[0, 2]) <= G / 1e9 * (1.0 + 1e-9) + 1e-12


def test_wind_carries_along():
    """With v' = -k (v - w): v = w + (v0 - w) e^(-k t), exact at any dt."""
    wind, k, t = np.array((2.0, -1.0, 0.5)), 0.7, 3.0
    sim = fly(t, 0.5, gravity=(0.0, 0.0, 0.0), drag={'linear': k, 'wind': wind.tolist()})
    relative = np.array(VELOCITY) - wind
    assert_allclose(sim.velocity[0], wind + relative * exp(-k * t), rtol=1e-13)
    assert_allclose(sim.position[0], START + wind * t - relative * expm1(-k * t) / k, rtol=1e-13)


def test_wind_without_drag_does_nothing():
    """No coefficient, no force."""
    calm = fly(1.0, 1 / 64)
    windy = fly(1.0, 1 / 64, drag={'wind': [30.0, 20.0, 10.0]})
    assert calm.position.tobytes() == windy.position.tobytes()


def test_quadratic_drag_without_gravity_is_exact():
    """With v' = -c |v| v: v = v0 / (1 + c v0 t), in the velocity, at any dt."""
    c, speed = 0.3, np.linalg.norm(VELOCITY)
    for dt in (1 / 64, 0.5, 2.0):
        sim = fly(2.0, dt, gravity=(0.0, 0.0, 0.0), drag={'quadratic': c})
        assert_allclose(sim.velocity[0], np.array(VELOCITY) / (1.0 + c * speed * sim.time),
                        rtol=1e-13)


@pytest.mark.parametrize('flight', FLIGHTS)
def test_quadratic_drag_is_of_second_order(flight):
    """Falling: v = -V tanh(g t / V), V = sqrt(g / c); in the velocity even with Euler."""
    c = 0.4
    terminal = sqrt(G / c)
    steps, errors, places = np.array([0.0401, 0.0203, 0.0101, 0.00503]), [], []
    for dt in steps:
        sim = fly(1.0, dt, flight, (0.0, 0.0, 0.0), drag={'quadratic': c})
        t = sim.time
        errors.append(abs(sim.velocity[0, 2] + terminal * tanh(G * t / terminal)))
        fall = terminal ** 2 / G * np.log(np.cosh(G * t / terminal))
        places.append(abs(sim.position[0, 2] - START[2] + fall))
    assert order(steps, errors) == pytest.approx(2.0, abs=0.15)
    expected = 2.0 if flight == 'ballistic' else 1.0
    assert order(steps, places) == pytest.approx(expected, abs=0.15)


def test_rising_against_quadratic_drag():
    """Rising: v = V tan(atan(v0 / V) - g t / V), also of second order."""
    c, v0, duration = 0.4, 6.0, 0.3
    terminal = sqrt(G / c)
    steps, errors = np.array([0.0301, 0.0149, 0.00751, 0.00377]), []
    for dt in steps:
        sim = fly(duration, dt, velocity=(0.0, 0.0, v0), drag={'quadratic': c})
        exact = terminal * tan(np.arctan(v0 / terminal) - G * sim.time / terminal)
        errors.append(abs(sim.velocity[0, 2] - exact))
    assert order(steps, errors) == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize('flight', FLIGHTS)
@pytest.mark.parametrize('coefficient', [1e-9, 1.0, 1e9, 1e300])
@pytest.mark.parametrize('dt', [1e-9, 1 / 240, 10.0])
def test_quadratic_drag_never_overshoots(flight, coefficient, dt):
    """The speed never grows without gravity, nor does any component change its sign."""
    sim = simulate([], START, VELOCITY, gravity=(0.0, 0.0, 0.0), dt=dt, flight=flight,
                   drag={'quadratic': coefficient})
    for _ in range(5):
        before = sim.velocity[0].copy()
        sim.step()
        assert (np.abs(sim.velocity[0]) <= np.abs(before)).all()
        assert (sim.velocity[0] * VELOCITY >= 0.0).all()
        assert np.isfinite(sim.position).all()


@pytest.mark.parametrize('drag', [None, {'linear': 0.5, 'quadratic': 0.1, 'wind': [1, 2, 3]}])
@pytest.mark.parametrize('method', METHODS)
def test_no_time_changes_nothing(method, drag):
    """T84: dt = 0: bit-identical, whatever is asked for, and the clock stands."""
    sim = simulate([plane(point=(0.0, 0.0, 0.5))], [START, (0.0, 0.0, -1.0)], VELOCITY, dt=0.0,
                   method=method, **({'drag': drag} if drag else {}))
    before = sim.position.tobytes() + sim.velocity.tobytes()
    sim.step(1000)
    sim.advance(5.0)
    sim.move_collider('ground', (0.0, 0.0, 9.0), (0.0, 0.0, 0.0, 1.0))
    sim.step()
    assert sim.position.tobytes() + sim.velocity.tobytes() == before
    assert sim.time == 0.0
    assert sim.counters == dict.fromkeys(sim.counters, 0)


def test_nobody_and_nothing():
    """T85: no particles, no colliders, or neither: works, and steps take next to no time."""
    empty = Simulation(Scene.from_dict({'particles': {'position': []}}))
    empty.step(1_000_000)
    assert empty.position.shape == empty.velocity.shape == (0, 3)
    assert empty.energy() == 0.0
    assert_array_equal(empty.momentum(), 0.0)
    assert len(empty.contacts.particle) == 0
    assert empty.clearance().shape == (0, )
    nobody = Simulation(Scene.from_dict({'colliders': [plane()]}))
    nobody.step(1_000_000)
    assert nobody.counters == dict.fromkeys(nobody.counters, 0)
    nothing = simulate([], START)
    nothing.step(240)
    assert nothing.position[0, 2] == pytest.approx(START[2] - 0.5 * G, rel=1e-13)
    assert nothing.clearance()[0] == np.inf


def test_energy_and_momentum():
    """E = sum of m (v^2 / 2 - g x), p = sum of m v, by masses each."""
    masses = [1.0, 2.0, 0.5]
    sim = simulate([], [(0.0, 0.0, 1.0), (1.0, 2.0, 3.0), (0.0, 0.0, 0.0)],
                   [(1.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, -4.0)],
                   gravity=(0.0, 1.0, -10.0), particles={'mass': masses})
    expected = (0.5 + 10.0) + 2.0 * (2.0 - 2.0 + 30.0) + 0.5 * 8.0
    assert sim.energy() == pytest.approx(expected, rel=4 * EPSILON)
    assert_allclose(sim.momentum(), (1.0, 4.0, -2.0), rtol=4 * EPSILON)
    sim.step(100)
    assert sim.energy() == pytest.approx(expected, rel=100 * 16 * EPSILON)
