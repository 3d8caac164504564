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

"""The ledger: each account against a closed form, and nothing left over."""

from math import cos, exp, pi, sin

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import (box, FLIGHTS, G, METHODS, plane, simulate, sphere, STAGED, UPRIGHT)

pytestmark = pytest.mark.jit

every_method = pytest.mark.parametrize('method', METHODS)
staged = pytest.mark.parametrize('method', STAGED)
WEIGHTLESS = (0.0, 0.0, 0.0)
MASS = 3.0
ACCOUNTS = ('drag', 'flight', 'colliders', 'restitution', 'dry', 'wet', 'contact', 'repulsion')


def book(colliders, position, velocity=(0.0, 0.0, 0.0), mass=MASS, **keys):
    """Make a simulation that keeps the ledger, of particles with a mass."""
    return simulate(colliders, position, velocity, particles={'mass': mass}, ledger=True, **keys)


def only(balance, **expected):
    """Assert that these accounts hold that and all others nothing, to rounding [J]."""
    for name in ACCOUNTS:
        assert_allclose(np.sum(getattr(balance, name)), expected.get(name, 0.0), rtol=1e-12,
                        atol=1e-12, err_msg=name)


def throughput(balance):
    """Sum of all that was booked [J]."""
    return sum(np.abs(getattr(balance, name)).sum() for name in ('gravity', *ACCOUNTS))


@every_method
@pytest.mark.parametrize('eps', [0.0, 0.5, 1.0])
def test_restitution(method, eps):
    """A head-on hit loses (1 - eps^2) m v^2 / 2; an impulse (1 + eps) m v comes from the wall."""
    sim = book([plane()], (0.0, 0.0, 0.0995), (0.0, 0.0, -3.0), gravity=WEIGHTLESS, method=method,
               restitution=eps, dt=0.01)
    sim.step(8)
    loss = -0.5 * (1.0 - eps ** 2) * MASS * 9.0
    if method in STAGED or eps > 0.0:
        only(sim.ledger.total, restitution=loss)
    else:       # a landing without restitution is a contact there
        only(sim.ledger.total, contact=loss)
    assert_allclose(sim.ledger.total.momentum.colliders, [(0.0, 0.0, MASS * 3.0 * (1.0 + eps))])
    assert_array_equal(sim.ledger.total.momentum.gravity, 0.0)


@staged
def test_friction_of_an_oblique_hit(method):
    """T06, T09: (3, -4), dv_N = 6: dry friction first, then wet friction on what is left."""
    sim = book([plane()], (0.0, 0.0, 0.0995), (3.0, 0.0, -4.0), gravity=WEIGHTLESS, method=method,
               restitution=0.5, friction={'dry': 0.1, 'wet': 0.1}, dt=0.01)
    sim.step(8)
    slip, end = 3.0 - 0.6, (3.0 - 0.6) * exp(-0.6)
    only(sim.ledger.total, restitution=-0.5 * MASS * (16.0 - 4.0),
         dry=-0.5 * MASS * (9.0 - slip ** 2), wet=-0.5 * MASS * (slip ** 2 - end ** 2))


@every_method
def test_a_moving_wall(method):
    """T23: a wall at V does the work (1 + eps) m (V - v) V; the loss is that relative to it."""
    wall = plane(motion={'linear_velocity': [0.5, 0.0, 1.5]})
    sim = book([wall], (0.0, 0.0, 1.0), (0.0, 0.0, -4.0), gravity=WEIGHTLESS, method=method,
               restitution=0.5)
    sim.step(60)
    only(sim.ledger.total, colliders=1.5 * MASS * 5.5 * 1.5,
         restitution=-0.5 * 0.75 * MASS * 5.5 ** 2)


@every_method
def test_sliding_to_a_stop(method):
    """T12: dry friction takes m v0^2 / 2, whatever the step."""
    sim = book([plane()], (0.0, 0.0, 0.0), (2.0, 0.0, 0.0), friction={'dry': 0.3}, method=method)
    sim.step(240)
    balance, late = sim.ledger.total, 0.0 if method in STAGED else MASS * (G * sim.dt) ** 2
    assert balance.dry == pytest.approx(-0.5 * MASS * 4.0, rel=1e-12)
    assert balance.wet == balance.restitution == 0.0
    # the end velocity of the first two methods keeps half a step's fall
    assert balance.contact == pytest.approx(0.0, abs=late + 1e-12)
    assert_allclose(balance.momentum.colliders[0, 0], -MASS * 2.0, rtol=1e-12)


@staged
@pytest.mark.parametrize('mu', [0.2, 0.5773])
def test_sliding_down_an_incline(method, mu):
    """T14: dry friction takes mu m g cos(theta) times the way, the height gives the rest."""
    angle = pi / 6
    incline = plane((-sin(angle), 0.0, cos(angle)))
    sim = book([incline], (0.0, 0.0, 0.0), friction={'dry': mu}, method=method)
    sim.step(240)
    way = np.linalg.norm(sim.position[0])
    only(sim.ledger.total, dry=-mu * MASS * G * cos(angle) * way)
    assert sim.ledger.total.gravity == pytest.approx(MASS * G * sin(angle) * way, rel=1e-12)


@staged
def test_wet_sliding(method):
    """T18: v0 e^(-D g t): wet friction takes the difference of the kinetic energies."""
    sim = book([plane()], (0.0, 0.0, 0.0), (2.0, 0.0, 0.0), friction={'wet': 0.5}, method=method)
    sim.step(240)
    only(sim.ledger.total, wet=-0.5 * MASS * 4.0 * (1.0 - exp(-G)))


@staged
def test_conveyor(method):
    """T29: a belt does the work m V^2 on a particle put on it at rest; friction takes half."""
    belt = plane(motion={'linear_velocity': [1.0, 0.0, 0.0]})
    sim = book([belt], (0.0, 0.0, 0.0), friction={'dry': 0.4}, method=method)
    sim.step(240)
    only(sim.ledger.total, colliders=MASS, dry=-0.5 * MASS)
    assert_allclose(sim.ledger.total.momentum.colliders,
                    [(MASS, 0.0, MASS * G * sim.time)], rtol=1e-12)


@staged
@pytest.mark.parametrize('known', [True, False], ids=['twists', 'poses'])
def test_platform_that_accelerates_up(method, known):
    """T25: it does the work m (g + a) h, all of which the particle keeps."""
    sim, a, steps = book([plane()], (0.0, 0.0, 0.0), method=method), 3.0, 241
    times = sim.dt * np.arange(steps)       # it stands still for a step, to start with no velocity
    places, twists = np.zeros((steps, 3)), np.zeros((steps, 6))
    places[:, 2], twists[:, 2] = 0.5 * a * times ** 2, a * times
    sim.move_collider('ground', places, np.tile(UPRIGHT, (steps, 1)), twists if known else None)
    sim.step(steps)
    balance, height = sim.ledger.total, 0.5 * a
    # a platform that is given by poses starts to move with its first chord
    assert_allclose(np.sum(balance.colliders), MASS * (G + a) * height, rtol=1e-12 if known
                    else 1e-4)
    assert balance.residual == pytest.approx(0.0, abs=1e-11)
    if known:
        assert balance.contact == pytest.approx(0.0, abs=1e-11)


@staged
def test_turntable(method):
    """T31: what sticks to a turntable is turned by friction, which does no work."""
    table = plane(motion={'angular_velocity': [0.0, 0.0, 2.0]})
    sim = book([table], (0.5, 0.0, 0.0), (0.0, 1.0, 0.0), friction={'dry': 0.5}, method=method)
    sim.step(240)
    balance = sim.ledger.total
    assert np.linalg.norm(sim.position[0]) == pytest.approx(0.5, abs=1e-12)
    assert_allclose(balance.colliders, 0.0, atol=1e-12)
    assert_allclose((balance.change, balance.residual), 0.0, atol=1e-12)


@pytest.mark.parametrize('flight', FLIGHTS)
def test_free_fall(flight):
    """Gravity works m g h; symplectic Euler takes m (g dt)^2 / 2 in each step."""
    sim = book([plane()], (0.0, 0.0, 100.0), flight=flight)
    sim.step(240)
    balance = sim.ledger.total
    error = 0.0 if flight == 'ballistic' else -0.5 * MASS * (G * sim.dt) ** 2 * 240
    only(balance, flight=error)
    assert balance.gravity == pytest.approx(MASS * G * (100.0 - sim.position[0, 2]), rel=1e-12)
    assert_allclose(balance.momentum.gravity, (0.0, 0.0, -MASS * G), rtol=1e-12)


@pytest.mark.parametrize('flight', FLIGHTS)
def test_drag(flight):
    """T68: k = 2 /s: after 1 s drag has taken m (g h - v^2 / 2) and the impulse m (g t - v)."""
    sim = book([plane()], (0.0, 0.0, 100.0), flight=flight, drag={'linear': 2.0}, dt=1 / 1000)
    sim.step(1000)
    balance, v = sim.ledger.total, 4.24118043572441475
    fall = (G - v) / 2.0        # v' = g - k v
    accuracy = 1e-12 if flight == 'ballistic' else 2e-3
    assert balance.drag == pytest.approx(-MASS * (G * fall - 0.5 * v * v), rel=accuracy)
    assert_allclose(balance.momentum.drag, (0.0, 0.0, MASS * (G - v)), rtol=1e-12)
    only(balance, drag=balance.drag, flight=balance.flight)
    assert abs(balance.flight) < (1e-12 if flight == 'ballistic' else MASS * G * G * sim.dt)


def test_what_the_contact_stage_takes_in_a_bowl():
    """Fact 4: the default method loses energy where a surface bends, the second order none."""
    lost = {}
    for method in STAGED:
        sim = book([sphere(inside=True)], (sin(1.0), 0.0, -cos(1.0)), method=method, dt=1 / 128)
        sim.step(300)
        balance = sim.ledger.total
        assert balance.dry == balance.wet == 0.0
        assert balance.residual == pytest.approx(0.0, abs=1e-11)
        lost[method] = balance.restitution + balance.contact + balance.repulsion
        assert lost[method] == pytest.approx(balance.change, abs=1e-11)
    assert lost[STAGED[0]] < -0.15 * MASS * G * (1.0 - cos(1.0))
    assert abs(lost[STAGED[1]]) < 0.01 * MASS * G * (1.0 - cos(1.0))


@every_method
def test_repulsion(method):
    """T80: who starts inside is lifted to the surface: m g depth."""
    sim = book([plane()], (0.0, 0.0, -0.2), method=method)
    sim.step(480)
    assert sim.counters['repulsions'] > 100
    only(sim.ledger.total, repulsion=MASS * G * (sim.position[0, 2] + 0.2)
         + 0.5 * MASS * np.sum(sim.velocity[0] ** 2) - sim.ledger.total.contact,
         contact=sim.ledger.total.contact)
    assert abs(sim.ledger.total.contact) <= 2.0 * MASS * (G * sim.dt) ** 2


@staged
def test_groove(method):
    """T55: both walls share the load, and friction takes all that is lost."""
    groove = [plane((cos(pi / 6), 0.0, 0.5), name='left'),
              plane((-cos(pi / 6), 0.0, 0.5), name='right')]
    sim = book(groove, (0.0, 0.0, 0.0), (0.0, 3.0, 0.0), friction={'dry': 0.05}, method=method,
               dt=1e-3)
    sim.step(300)
    balance = sim.ledger.total
    lost = 0.5 * MASS * (sim.velocity[0, 1] ** 2 - 9.0)
    assert balance.dry == pytest.approx(lost, rel=5e-3)
    assert balance.residual == pytest.approx(0.0, abs=1e-11)
    assert_allclose(balance.momentum.colliders.sum(axis=0)[2], MASS * G * sim.time, rtol=1e-3)
    assert_allclose(*np.abs(balance.momentum.colliders[:, 0]), rtol=0.02)


RANDOM = np.random.default_rng(3)
COUNT = 300
PLACES = RANDOM.uniform((-1.2, -1.2, -0.2), (1.2, 1.2, 1.5), (COUNT, 3))
SPEEDS = RANDOM.normal(0.0, 3.0, (COUNT, 3))
MASSES = RANDOM.uniform(0.5, 2.0, COUNT)
TURNING = {'angular_velocity': [1.0, 2.0, 3.0],
           'oscillate': {'axis': [1, 0, 1], 'amplitude': 0.1, 'frequency': 2.0}}
CROWD = [plane((0.1, 0.0, 1.0)), plane((-1.0, 0.05, 0.1), (1.2, 0.0, 0.0), 'wall'),
         sphere(0.5, (0.3, 0.0, 0.3), motion=TURNING),
         box((0.6, 0.4, 0.5), (-0.6, 0.0, 0.2),
             motion={'linear_velocity': [0.1, 0.0, 0.0], 'angular_velocity': [0.0, 0.0, 3.0]})]


@every_method
@pytest.mark.parametrize('keys', [
    {}, {'flight': 'symplectic_euler', 'drag': {'linear': 0.3, 'quadratic': 0.2,
                                                'wind': [1.0, 2.0, 0.0]}},
    {'stepping': {'detection': 'trajectory'}}], ids=['plain', 'drag', 'trajectory'])
def test_nothing_is_left_over(method, keys):
    """A crowd between things that move, some of it inside of them: the residual is rounding."""
    sim = book(CROWD, PLACES, SPEEDS, MASSES, method=method, restitution=0.6,
               friction={'dry': 0.3, 'wet': 0.1}, **keys)
    sim.step(200)
    balance = sim.ledger.total
    assert sim.counters['repulsions'] > 0
    assert abs(balance.residual) < 1e-13 * throughput(balance)
    assert_allclose(balance.momentum.residual, 0.0, atol=1e-9)
    assert balance.dry < 0.0 and balance.wet < 0.0 and balance.restitution < 0.0


def test_last_and_total():
    """`last` is the last call of step alone; `total` since the reset; both begin with nothing."""
    sim = book([plane()], (0.0, 0.0, 1.0), restitution=0.5)
    assert sim.ledger.total.gravity == sim.ledger.last.gravity == 0.0
    works = []
    for _ in range(3):
        sim.step(40)
        works.append(sim.ledger.last.gravity)
    assert sim.ledger.total.gravity == pytest.approx(sum(works), rel=1e-12)
    sim.position[0] += 7.0      # a change from outside is nobody's work
    sim.step(0)
    assert sim.ledger.last.change == 0.0
    sim.step(40)
    assert sim.ledger.total.residual == pytest.approx(0.0, abs=1e-11)
    sim.reset()
    assert sim.ledger.total.gravity == 0.0


def test_off():
    """There is no ledger that nobody asked for."""
    assert simulate([plane()], (0.0, 0.0, 1.0)).ledger is None


def test_infinite_masses():
    """Particles of infinite mass are left out, and the others are not."""
    one = book([plane()], (0.0, 0.0, 0.5), mass=2.0)
    two = book([plane()], [(0.0, 0.0, 0.5), (1.0, 0.0, 0.5)], mass=[2.0, np.inf])
    none = book([plane()], (0.0, 0.0, 0.5), mass=np.inf)
    for sim in (one, two, none):
        sim.step(100)
    assert one.ledger.total.restitution == pytest.approx(two.ledger.total.restitution)
    assert none.ledger.total.restitution == none.ledger.total.residual == 0.0


def test_threads():
    """Blocks are added up in their order: the ledger does not depend on the threads."""
    random, totals = np.random.default_rng(9), []
    places, speeds = random.uniform(0.0, 2.0, (20_000, 3)), random.normal(0.0, 3.0, (20_000, 3))
    for threads in (1, 3):
        sim = book([plane()], places, speeds, threads=threads, restitution=0.5)
        sim.step(20)
        totals.append(sim.ledger.total)
    assert totals[0].restitution == totals[1].restitution
    assert totals[0].gravity == totals[1].gravity
