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

"""The response of a particle: laws on relative velocities, what counts as rounding, records."""

from math import cos, sin

from collision_sim.core import response
from collision_sim.core.laws import EXPONENTIAL
from collision_sim.core.rules import COLLISION, MOST_CONTACTS, REPULSION, SLIDE, STICK
from collision_sim.core.shapes import COLUMNS, KINETIC, STATIC, WET, WET_FORM
from hypothesis import given, strategies as st
from numba import njit
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import box, EPSILON, FAR, G, METHODS, plane, simulate, sphere

every_method = pytest.mark.parametrize('method', METHODS)
components = st.floats(-1e3, 1e3)
velocities = st.tuples(components, components, components)


@njit
def respond(table, v, obj, n, v_n, dv_n):
    """Call a kernel, which has no entry from Python."""
    return response.respond(table, 0, v, obj, n, v_n, dv_n)


@njit
def approach(v, obj, n):
    """Call a kernel, which has no entry from Python."""
    return response.approach(v, obj, n)


def laws(static=0.0, kinetic=None, wet=0.0, form=EXPONENTIAL):
    """Table of one collider with these coefficients."""
    table = np.zeros((1, COLUMNS))
    table[0, [STATIC, KINETIC, WET, WET_FORM]] = (
        static, static if kinetic is None else kinetic, wet, form)
    return table


def test_restitution_alone():
    """Only the normal velocity changes, the rest to the bit."""
    v, stuck = respond(laws(), (0.1, 0.3, -4.0), (9.0, 9.0, 1.0), (0.0, 0.0, 1.0), -5.0,
                       7.5)
    assert v == (0.1, 0.3, 3.5)
    assert not stuck


def test_friction_alone_is_on_the_relative_velocity():
    """V_T relative to the collider, 3 m/s along x, loses mu dv_N = 1."""
    v, stuck = respond(laws(0.2), (5.0, 1.0, -4.0), (2.0, 1.0, 0.0), (0.0, 0.0, 1.0), -4.0,
                       5.0)
    assert_allclose(v, (4.0, 1.0, 1.0), rtol=4 * EPSILON)
    assert not stuck


def test_stick_is_exactly_the_velocity_of_the_collider():
    """Else a particle would creep on what it rides on."""
    n, obj = (0.6, 0.0, 0.8), (0.1, 1 / 3, 7.7)
    v, stuck = respond(laws(9.0), (0.1 - 0.6, 1 / 3, 7.7 - 0.8), obj, n, -1.0, 1.0)
    assert v == obj
    assert stuck


def test_wet_and_dry_friction():
    """Their factors multiply: dry first, wet on the remainder."""
    v, _ = respond(laws(0.1, wet=0.1), (3.0, 0.0, -4.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0),
                   -4.0, 6.0)
    assert_allclose(v, (3.0 * 0.8 * np.exp(-0.6), 0.0, 2.0), rtol=8 * EPSILON)


@pytest.mark.jit
@given(velocities, velocities, st.floats(0.0, 3.2), st.floats(0.0, 1.0), st.floats(0.0, 5.0),
       st.floats(0.0, 5.0))
def test_no_energy_in_the_frame_of_the_collider(v, obj, angle, eps, mu, wet):
    """Nobody leaves faster than it came, and friction stays in its cone."""
    n = (sin(angle), 0.0, cos(angle))
    v_n = float(np.dot(np.subtract(v, obj), n))
    if v_n >= 0.0:
        return
    dv_n = -(1.0 + eps) * v_n
    after, _ = respond(laws(mu, wet=wet), v, obj, n, v_n, dv_n)
    before, after = np.subtract(v, obj), np.subtract(after, obj)
    slack = 64 * EPSILON * (np.abs(v).max() + np.abs(obj).max())
    assert np.linalg.norm(after) <= np.linalg.norm(before) + slack
    assert after @ n == pytest.approx(-eps * v_n, abs=slack)
    slip, kept = (u - (u @ n) * np.array(n) for u in (before, after))
    assert np.linalg.norm(kept) <= np.linalg.norm(slip) + slack
    assert kept @ slip >= -slack * np.linalg.norm(slip)
    dry, _ = respond(laws(mu), v, obj, n, v_n, dv_n)
    lost = np.subtract(dry, v) - dv_n * np.array(n)
    assert np.linalg.norm(lost) <= mu * dv_n + slack


@pytest.mark.parametrize(('v', 'obj', 'expected'), [
    ((0.0, 0.0, -2.0), (0.0, 0.0, 0.0), -2.0), ((0.0, 0.0, -2.0), (0.0, 0.0, -3.0), 0.0),
    ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0), ((1e6, 0.0, -1e-11), (0.0, 0.0, 0.0), 0.0),
    ((1.0, 0.0, -1e-11), (0.0, 0.0, 0.0), -1e-11),
    ((0.0, 0.0, -1e-300), (0.0, 0.0, 0.0), -1e-300)])
def test_approach(v, obj, expected):
    """The normal velocity, unless it leaves or is only rounding of the velocities."""
    assert approach(v, obj, (0.0, 0.0, 1.0)) == expected


@every_method
def test_state_of_rest_and_its_impulse(method):
    """A particle at rest sticks; the impulse of a step is m g dt, at the surface."""
    sim = simulate([plane()], (0.25, 0.5, 0.0), friction={'dry': 0.5}, method=method,
                   particles={'mass': 3.0})
    sim.step(10)
    contacts = sim.contacts
    assert contacts.particle.tolist() == contacts.collider.tolist() == [0]
    assert contacts.state.tolist() == [STICK]
    assert_array_equal(contacts.point, [(0.25, 0.5, 0.0)])
    assert_array_equal(contacts.normal, [(0.0, 0.0, 1.0)])
    assert_allclose(contacts.impulse, [(0.0, 0.0, 3.0 * G * sim.dt)], rtol=1e-12)


@every_method
def test_state_of_sliding_and_its_impulse(method):
    """Friction in the impulse: mu m g dt against the motion."""
    sim = simulate([plane()], (0.0, 0.0, 0.0), (2.0, 0.0, 0.0), friction={'dry': 0.25},
                   method=method, particles={'mass': 3.0})
    sim.step(10)
    assert sim.contacts.state.tolist() == [SLIDE]
    assert_allclose(sim.contacts.impulse, [np.array((-0.25, 0.0, 1.0)) * 3.0 * G * sim.dt],
                    rtol=1e-10, atol=1e-15)


@every_method
def test_state_of_a_collision_and_its_impulse(method):
    """(1 + eps) m |v_N| in the step of the hit; nothing in the steps before and after."""
    sim = simulate([plane()], (0.0, 0.0, 0.0995), (1.0, 0.0, -3.0), gravity=(0.0, 0.0, 0.0),
                   restitution=0.5, method=method, particles={'mass': 2.0}, dt=0.01)
    for k in range(8):
        sim.step()
        if k == 3:
            assert sim.contacts.state.tolist() == [COLLISION]
            assert_allclose(sim.contacts.impulse, [(0.0, 0.0, 2.0 * 4.5)], rtol=1e-14)
            # on the surface, or where the particle leaves off in this step
            assert sim.contacts.point[0, 2] == pytest.approx(0.0, abs=0.03)
        else:
            assert len(sim.contacts.particle) == 0
    assert sim.counters['collisions'] == 1


def test_state_of_repulsion():
    """Both ends inside: counted, and an impulse only where an approach has to end."""
    sim = simulate([plane()], (0.0, 0.0, -0.5), (0.0, 0.0, -2.0), gravity=(0.0, 0.0, 0.0))
    sim.step()
    assert sim.contacts.state.tolist() == [REPULSION]
    assert_allclose(sim.contacts.impulse, [(0.0, 0.0, 2.0)])
    sim.step()
    assert sim.counters['repulsions'] == 2
    assert_array_equal(sim.contacts.impulse, [(0.0, 0.0, 0.0)])


@every_method
def test_impulses_are_the_change_of_momentum(method):
    """Over a step of many particles and colliders: m dv less that of gravity."""
    random = np.random.default_rng(4)
    sim = simulate([plane(), sphere(0.5, (0.3, 0.0, 0.3)), *FAR],
                   random.uniform((-1, -1, 0.05), (1, 1, 1), (300, 3)),
                   random.normal(0, 3, (300, 3)), friction={'dry': 0.3}, restitution=0.5,
                   method=method, particles={'mass': 2.0})
    for _ in range(60):
        before = sim.velocity.copy()
        fail_safes = sim.counters['fail_safes']
        sim.step()
        if sim.counters['fail_safes'] == fail_safes:
            change = 2.0 * (sim.velocity - before - (0.0, 0.0, -G * sim.dt))
            impulse = np.zeros((300, 3))
            np.add.at(impulse, sim.contacts.particle, sim.contacts.impulse)
            # what is changed before the end of the step is the same at its end: no drag
            assert_allclose(impulse, change, rtol=0.0, atol=1e-12)


def test_contacts_of_a_corner():
    """A particle in a corner of a room touches three walls at once."""
    walls = [plane((1.0, 0.0, 0.0), name='a'), plane((0.0, 1.0, 0.0), name='b'),
             plane((0.0, 0.0, 1.0), name='c')]
    sim = simulate(walls, (0.0, 0.0, 0.0), gravity=(-1.0, -2.0, -3.0), particles={'mass': 2.0})
    sim.step(5)
    contacts = sim.contacts
    assert sorted(contacts.collider.tolist()) == [0, 1, 2]
    order = np.argsort(contacts.collider)
    assert_allclose(contacts.impulse[order], 2.0 * sim.dt * np.diag((1.0, 2.0, 3.0)), rtol=1e-12)
    assert_array_equal(contacts.normal[order], np.eye(3))


def test_at_most_four_contacts_of_a_particle():
    """More of them in a step are counted, but not recorded."""
    funnel = [plane((np.cos(a), np.sin(a), 0.2), name=f'p{k}')
              for k, a in enumerate(np.linspace(0.0, 2.0 * np.pi, 7, endpoint=False))]
    sim = simulate(funnel, (0.001, 0.0005, 0.0), stepping={'iterations': 100})
    for _ in range(20):
        sim.step()
        assert len(sim.contacts.particle) <= MOST_CONTACTS
    assert len(sim.contacts.particle) == MOST_CONTACTS
    assert sim.counters['contacts'] > 20 * MOST_CONTACTS


@every_method
def test_deepest_collider_first(method):
    """Of two walls the one in which the candidate is deeper acts first, whatever their order."""
    shallow = plane((0.0, 0.0, 1.0), name='shallow')
    deep = plane((1.0, 0.0, 0.0), name='deep')
    for walls in ([shallow, deep], [deep, shallow]):
        sim = simulate(walls, (0.01, 0.0, 0.01), (-10.0, 0.0, -4.0), gravity=(0.0, 0.0, 0.0),
                       dt=0.01, restitution=1.0, method=method)
        sim.step()
        first = sim.contacts.collider[0]
        assert walls[first]['name'] == 'deep'


def test_equal_depths_do_not_take_the_first():
    """Two walls as deep act at once, in any order in the scene."""
    walls, found = [plane((1.0, 0.0, 0.0), name='a'), plane((0.0, 1.0, 0.0), name='b')], []
    for order in (walls, walls[::-1]):
        sim = simulate(order, (0.01, 0.01, 0.0), (-3.0, -3.0, 0.0), gravity=(0.0, 0.0, 0.0),
                       dt=0.01, restitution=1.0)
        sim.step()
        found.append([order[c]['name'] for c in sim.contacts.collider])
        assert_array_equal(sim.velocity[0], (3.0, 3.0, 0.0))
    assert found[0] == found[1] and sorted(found[0]) == ['a', 'b']


def test_ball_radius():
    """A ball of radius r rests with its center r above the ground, and in a bowl r inside."""
    sim = simulate([plane(), *FAR], [(0.0, 0.0, 1.0), (5.0, 0.0, 1.0)],
                   particles={'radius': [0.25, 0.0]})
    sim.step(480)
    assert_allclose(sim.position[:, 2], (0.25, 0.0), rtol=0.0, atol=G * sim.dt ** 2)
    assert (sim.clearance() >= 0.0).all()
    sim = simulate([sphere(1.0, inside=True), *FAR], (0.0, 0.0, 0.0), particles={'radius': 0.25})
    sim.step(480)
    assert sim.position[0, 2] == pytest.approx(-0.75, abs=G * sim.dt ** 2)


def test_balls_wider_than_their_room():
    """A ball that does not fit is kept finite, inside by repulsion from all sides."""
    sim = simulate([box((1.0, 1.0, 1.0), inside=True), *FAR], (0.1, 0.0, 0.0),
                   particles={'radius': 0.7})
    sim.step(240)
    assert np.isfinite(sim.position).all()
    assert np.abs(sim.position).max() < 0.7
