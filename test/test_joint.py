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

"""The impulses of a few contacts at once, against what they are defined by."""

from collision_sim.core.contact_solver import (END_BOUND, ENDING, FREE, IMPULSE, INVERSE,
                                               make_pile, MASS, MEAN, MEAN_BOUND, NORMAL)
from collision_sim.core.groups import group_contacts
from collision_sim.core.joint import collide_group, FOUND, make_room, settle_group
from collision_sim.core.laws import CAPPED, EXPONENTIAL
from collision_sim.core.shapes import COLUMNS, RESTITUTION, STATIC, WET, WET_FORM
from collision_sim.core.sliding import LEFT_OVER
import numpy as np
import pytest

pytestmark = pytest.mark.skipif(hasattr(settle_group, 'py_func'),
                                reason='kernels are called from compiled code only')
REST = slice(ENDING, ENDING + 3)


def cluster(seed, ratio, friction, count=5):
    """
    Give bodies in a heap: all near pairs of random places touch, and the lowest one the ground.

    Returns
    -------
    pile : Pile
    contacts : int
    laws : (1, COLUMNS) float64

    """
    random = np.random.default_rng(seed)
    place, inverse = random.normal(size=(count, 3)), ratio ** -random.random(count)
    ends = [(i, j) for i in range(count) for j in range(i) if random.random() < 0.6] + [(0, count)]
    pile = make_pile(count + 1, len(ends), np.full(count, -1, dtype=np.int32))
    pile.bodies[:] = 0.0
    pile.bodies[:count, FREE:FREE + 3] = random.normal(size=(count, 3))
    pile.bodies[:count, INVERSE] = inverse
    pile.bodies[:, REST] = pile.bodies[:, FREE:FREE + 3]
    pile.bodies[:, MEAN:MEAN + 3] = pile.bodies[:, FREE:FREE + 3]
    for c, (a, b) in enumerate(ends):
        n = place[a] - place[b] if b < count else np.array([0.0, 0.0, 1.0])
        pile.ends[c] = a, b, 0
        pile.contacts[c, NORMAL:NORMAL + 3] = n / np.linalg.norm(n)
        pile.contacts[c, MASS] = 1.0 / (pile.bodies[a, INVERSE] + pile.bodies[b, INVERSE])
        pile.contacts[c, END_BOUND] = pile.contacts[c, MEAN_BOUND] = 0.0
    return pile, len(ends), laws(friction)


def laws(friction, restitution=0.5):
    """Give one row of laws."""
    table = np.zeros((1, COLUMNS))
    table[0, RESTITUTION], table[0, STATIC:STATIC + 2] = restitution, friction
    return table


def normal_speeds(pile, contacts, which):
    """Give the normal velocities of the contacts."""
    a, b = pile.ends[:contacts, 0], pile.ends[:contacts, 1]
    relative = pile.bodies[a, which:which + 3] - pile.bodies[b, which:which + 3]
    return np.sum(relative * pile.contacts[:contacts, NORMAL:NORMAL + 3], axis=1)


def energy(pile, which):
    """Give the kinetic energy of the bodies."""
    moving = pile.bodies[:, INVERSE] > 0.0
    v = pile.bodies[moving, which:which + 3]
    return 0.5 * np.sum(np.square(v).sum(axis=1) / pile.bodies[moving, INVERSE])


@pytest.mark.parametrize('friction', [0.0, 0.3, 5.0])
@pytest.mark.parametrize('ratio', [1.0, 1e3, 1e6])
@pytest.mark.parametrize('seed', range(6))
def test_contacts_end_every_approach(seed, ratio, friction):
    """No contact approaches or pulls, only those press that touch, and no energy comes in."""
    pile, contacts, table = cluster(seed, ratio, friction)
    first = 0
    for g in range(group_contacts(pile, len(pile.bodies), contacts)):
        count = pile.group[g + 1] - pile.group[g]
        settle_group(True, False, table, 0.5, (0.0, 0.0, 0.0), pile, first, count, make_room())
        first += count
    speeds = normal_speeds(pile, contacts, ENDING)
    pressing = np.sum(pile.contacts[:, IMPULSE:IMPULSE + 3] * pile.contacts[:, NORMAL:NORMAL + 3],
                      axis=1)
    assert speeds.min() > -1e-12
    assert pressing.min() >= -1e-9
    assert np.abs(speeds * pressing * pile.bodies[:, INVERSE].min()).max() < 1e-5
    assert energy(pile, ENDING) <= energy(pile, FREE) * (1.0 + 1e-9)
    assert normal_speeds(pile, contacts, MEAN).min() > -1e-12


@pytest.mark.parametrize('restitution', [0.0, 0.5, 1.0])
@pytest.mark.parametrize('ratio', [1.0, 1e3, 1e6])
@pytest.mark.parametrize('seed', range(6))
def test_collisions_give_back_what_restitution_allows(seed, ratio, restitution):
    """With e = 1 all of the energy, with less the share e^2 of what an inelastic hit takes."""
    pile, contacts, _ = cluster(seed, ratio, 0.0)
    ends = []
    for e in (0.0, restitution):
        first, before = 0, energy(pile, FREE)
        for g in range(group_contacts(pile, len(pile.bodies), contacts)):
            count = pile.group[g + 1] - pile.group[g]
            collide_group(False, False, laws(0.0, e), pile, first, count, make_room())
            first += count
        ends.append(energy(pile, ENDING))
    assert before - ends[1] == pytest.approx((1.0 - restitution ** 2) * (before - ends[0]),
                                             rel=1e-6, abs=1e-9 * before)


def between_closing_bodies(speed):
    """Give two balls of mass 1 between two bodies of infinite mass, of which one comes."""
    pile = make_pile(4, 3, np.full(1, -1, dtype=np.int32))
    pile.bodies[:] = 0.0
    pile.bodies[1:3, INVERSE] = 1.0
    pile.bodies[:, FREE + 2] = pile.bodies[:, ENDING + 2] = -speed * np.array([0, 0.25, 0.75, 1])
    for c in range(3):
        pile.ends[c] = c, c + 1, 0
        pile.contacts[c, NORMAL:NORMAL + 3] = 0.0, 0.0, -1.0
        pile.contacts[c, MASS] = 1.0 / pile.bodies[c:c + 2, INVERSE].sum()
        pile.contacts[c, END_BOUND], pile.member[c] = 0.0, c
    return pile


def test_impulses_are_finite_where_rounding_takes_energy_below_nothing():
    """Opposite impulses without restitution leave no energy but rounding, of either sign."""
    for speed in np.random.default_rng(5).uniform(0.1, 3.0, 50):
        pile = between_closing_bodies(speed)
        with np.errstate(all='raise'):
            collide_group(False, False, laws(0.0, 0.0), pile, 0, 3, make_room())
        assert np.isfinite(pile.contacts[:3, IMPULSE:IMPULSE + 3]).all()
        assert np.abs(pile.bodies[:, ENDING:ENDING + 3]).max() <= 1.01 * speed


def test_friction_of_a_light_ball_between_heavy_ones_is_found():
    """A column of masses 1000 : 1 : 1000 on a floor, each of which slides another way."""
    pile = make_pile(4, 3, np.full(3, -1, dtype=np.int32))
    pile.bodies[:] = 0.0
    pile.bodies[:3, INVERSE] = 1e-3, 1.0, 1e-3
    pile.bodies[:3, FREE:FREE + 3] = [(3.0, 0.0, -1.0), (0.0, 2.0, -1.0), (1.0, 1.0, -1.0)]
    pile.bodies[:3, MEAN:MEAN + 3] = pile.bodies[:3, FREE:FREE + 3]
    for c, (a, b) in enumerate(((2, 1), (1, 0), (0, 3))):
        pile.ends[c] = a, b, 0
        pile.contacts[c, NORMAL:NORMAL + 3] = 0.0, 0.0, 1.0
        pile.contacts[c, MASS] = 1.0 / (pile.bodies[a, INVERSE] + pile.bodies[b, INVERSE])
        pile.contacts[c, END_BOUND] = pile.contacts[c, MEAN_BOUND] = 0.0
    pile.member[:3] = 0, 1, 2
    friction = settle_group(True, False, laws(0.3), 0.5, (0.0, 0.0, 0.0), pile, 0, 3, make_room())
    assert friction == FOUND
    for c, (a, b) in enumerate(((2, 1), (1, 0), (0, 3))):
        slip = pile.bodies[a, ENDING:ENDING + 2] - pile.bodies[b, ENDING:ENDING + 2]
        along = pile.contacts[c, IMPULSE:IMPULSE + 2]
        bound = 0.3 * pile.contacts[c, IMPULSE + 2]
        assert np.linalg.norm(along) <= bound * (1.0 + 1e-9)
        if np.linalg.norm(slip) > 1e-9:         # who slides has all of it, against the slip
            assert abs(along @ slip + bound * np.linalg.norm(slip)) < 1e-6 * bound


@pytest.mark.parametrize('form', [CAPPED, EXPONENTIAL])
@pytest.mark.parametrize('collides', [True, False])
def test_wet_friction_between_plates_that_slide_past_each_other(form, collides):
    """
    Each plate would end all slip of the ball, which cannot be: each leaves a share of it.

    With a share s of the slip v - w left, friction is (1 / s - 1) (w - v), of each plate.
    """
    pile, table = make_pile(3, 2, np.full(1, -1, dtype=np.int32)), laws(0.0, 0.0)
    table[0, WET], table[0, WET_FORM] = 100.0, form
    pile.bodies[:] = 0.0
    pile.bodies[0, INVERSE] = 1.0
    pile.bodies[1:, FREE:FREE + 3] = [(3.0, 0.0, 1.0), (1.0, 0.0, -1.0)]
    pile.bodies[:, REST] = pile.bodies[:, MEAN:MEAN + 3] = pile.bodies[:, FREE:FREE + 3]
    for c, side in enumerate((1.0, -1.0)):
        pile.ends[c], pile.member[c] = (0, 1 + c, 0), c
        pile.contacts[c, NORMAL:NORMAL + 3], pile.contacts[c, MASS] = (0.0, 0.0, side), 1.0
        pile.contacts[c, END_BOUND] = pile.contacts[c, MEAN_BOUND] = 0.0
    if collides:
        collide_group(False, True, table, pile, 0, 2, make_room())
    else:
        settle_group(False, True, table, 0.5, (0.0, 0.0, 0.0), pile, 0, 2, make_room())
    pull = 1.0 / LEFT_OVER - 1.0
    speed = pull * (3.0 + 1.0) / (1.0 + 2.0 * pull)
    assert pile.bodies[0, ENDING:ENDING + 3] == pytest.approx((speed, 0.0, 0.0), abs=1e-6)
    assert np.abs(pile.contacts[:2, IMPULSE]).max() < 20.0
