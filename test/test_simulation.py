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

"""Simulation: time, state, moves, parameters, records, and what it refuses."""

from math import inf, nan, pi
import re

from collision_sim import SceneError
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import EPSILON, G, METHODS, plane, simulate, UPRIGHT

KEYS = ['collisions', 'contacts', 'repulsions', 'fail_safes', 'unplaced', 'undecided',
        'pair_collisions', 'pair_contacts', 'frozen', 'unsettled', 'collapsed']
QUARTER = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))


def drop(**scene):
    """Give a particle above the ground, and a lid that can be moved."""
    lid = plane((0.0, 0.0, -1.0), (0.0, 0.0, 9.0), name='lid', topic='lid/pose')
    return simulate([plane(), lid], (0.0, 0.0, 1.0), (0.5, 0.0, 0.0), **scene)


def test_time_is_counted_in_steps():
    """No rounding builds up over many steps."""
    sim = drop(dt=0.1)
    assert sim.time == 0.0
    sim.step()
    sim.step(9)
    assert sim.time == 10 * 0.1
    assert sim.dt == 0.1
    sim.step(0)
    assert sim.time == 10 * 0.1


@pytest.mark.parametrize(('duration', 'steps'), [(0.0, 0), (1.0, 10), (0.96, 10), (0.04, 0),
                                                 (1, 10), (1e3, 10_000)])
def test_advance_takes_whole_steps(duration, steps):
    sim = simulate([], (0.0, 0.0, 0.0), dt=0.1)
    assert sim.advance(duration) == steps
    assert sim.time == steps * 0.1


@pytest.mark.parametrize('kind', [np.uint8, np.int8, np.int16, np.uint32, np.uint64])
def test_steps_of_any_type(kind):
    """Time is counted in Python's numbers, which do not wrap around."""
    sim = drop(dt=0.1)
    for _ in range(3):
        sim.step(kind(100))
    assert sim.time == 300 * 0.1 and type(sim.time) is float
    sim.advance(np.float32(0.5))
    assert sim.time == 305 * 0.1 and type(sim.time) is float


@pytest.mark.parametrize(('call', 'value', 'allowed'), [
    ('step', 10 ** 30, 'from 0 to 1000000000000000'), ('advance', 1e300, 'at most 1e+14 s'),
    ('some_contacts', 0, 'whole number from 1 on'), ('some_contacts', 1.5, 'whole number')])
def test_numbers_that_are_too_large_or_too_small(call, value, allowed):
    """What would never end, or mean nothing, is refused before anything has changed."""
    sim = drop(dt=0.1)
    with pytest.raises(SceneError, match=f'{call}: .*{re.escape(allowed)}'):
        getattr(sim, call)(value)
    assert sim.time == 0.0


@pytest.mark.parametrize('threads', [0, -1, 1.5, True, 'two', 10 ** 9])
def test_threads_that_are_none(threads):
    with pytest.raises(SceneError, match='threads'):
        drop(threads=threads)
    assert drop(threads=np.uint8(2)).dt == 1 / 240


def test_a_step_too_short_for_numbers():
    """Its square would be 0, and its inverse infinite."""
    with pytest.raises(SceneError, match='stepping.dt: 5e-324: must be 0 or from 1e-100 s on'):
        drop(dt=5e-324)


def test_more_than_fits_into_memory(monkeypatch):
    """Says how much would be needed, as NumPy does."""
    def full(count):
        raise MemoryError(f'Unable to allocate {8 * count} bytes')
    monkeypatch.setattr('collision_sim.simulation.in_lines', full)
    with pytest.raises(SceneError, match='particles: 1: must fit into memory: .*24 bytes'):
        drop()


@pytest.mark.parametrize('steps', [-1, 1.0, 1.5, nan, None, 'one', True])
def test_steps_that_are_none(steps):
    sim = drop()
    with pytest.raises(SceneError, match='step'):
        sim.step(steps)
    assert sim.time == 0.0


@pytest.mark.parametrize('duration', [-1.0, nan, inf, None, 'one'])
def test_durations_that_are_none(duration):
    sim = drop()
    with pytest.raises(SceneError, match='advance'):
        sim.advance(duration)
    assert sim.time == 0.0


def test_steps_of_numpy():
    sim = drop()
    sim.step(np.int64(3))
    sim.advance(np.float64(sim.dt))
    assert sim.time == 4 * sim.dt


def test_position_and_velocity_are_views():
    """They may be written to, and the scene keeps its start."""
    sim = drop()
    assert sim.position.shape == sim.velocity.shape == (1, 3)
    position = sim.position
    sim.step()
    assert position is not sim.position and np.shares_memory(position, sim.position)
    assert position[0, 0] == sim.position[0, 0] != 0.0
    sim.position[0] = (7.0, 8.0, 9.0)
    sim.velocity[:] = 0.0
    sim.step()
    assert_allclose(sim.position[0], (7.0, 8.0, 9.0 - 0.5 * G * sim.dt ** 2), rtol=1e-15)
    assert sim.scene.particles.position[0, 2] == 1.0


def test_two_simulations_of_a_scene_are_apart():
    sim, other = drop(), None
    other = type(sim)(sim.scene)
    sim.step(100)
    assert other.time == 0.0
    assert_array_equal(other.position, [(0.0, 0.0, 1.0)])


def test_reset():
    """Back to the start, with the parameters as they are now, and the colliders in place."""
    sim = drop()
    sim.set_parameter('restitution', 0.75)
    sim.move_collider('lid', (0.0, 0.0, 5.0), UPRIGHT)
    sim.step(200)
    assert sum(sim.counters.values()) > 0
    sim.move_collider('lid', (0.0, 0.0, 1.0), UPRIGHT)
    sim.reset()
    assert sim.time == 0.0
    assert_array_equal(sim.position, [(0.0, 0.0, 1.0)])
    assert_array_equal(sim.velocity, [(0.5, 0.0, 0.0)])
    assert sim.counters == dict.fromkeys(KEYS, 0)
    assert len(sim.contacts.particle) == 0
    assert sim.unplaced == []
    assert_array_equal(sim.collider_pose('lid')[0], (0.0, 0.0, 9.0))
    sim.step()                                      # the pending move is forgotten
    assert_array_equal(sim.collider_pose('lid')[0], (0.0, 0.0, 9.0))
    assert sim.scene.restitution == 0.75


def test_parameters_act_from_the_next_step_on():
    """The default of all colliders, and one collider of its own."""
    def bounce(**parameters):
        sim = simulate([plane()], (0.0, 0.0, 1e-3), (3.0, 0.0, -4.0), gravity=(0.0, 0.0, 0.0))
        for path, value in parameters.items():
            sim.set_parameter(path.replace('__', '.'), value)
        sim.step()
        return sim.velocity[0]
    assert_array_equal(bounce(), (3.0, 0.0, 0.0))
    assert_array_equal(bounce(restitution=0.5), (3.0, 0.0, 2.0))
    assert_array_equal(bounce(restitution=0.5, colliders__ground__restitution=1.0), (3., 0., 4.))
    assert_allclose(bounce(friction__dry=0.25), (2.0, 0.0, 0.0))
    assert_array_equal(bounce(colliders__ground__friction__dry=9.0), (0.0, 0.0, 0.0))
    assert_allclose(bounce(friction__wet=0.5), (3.0 * np.exp(-2.0), 0.0, 0.0))
    assert bounce(gravity=(0.0, 240.0, 0.0))[1] == 1.0


def test_several_parameters_change_together_or_not_at_all():
    """Those that hold only together may come in any order."""
    sim = simulate([plane()], (0.0, 0.0, 1.0), friction={'dry': {'static': 0.4, 'kinetic': 0.3}})
    scene = sim.scene
    with pytest.raises(SceneError, match='gravity'):
        sim.set_parameters([('restitution', 0.5), ('gravity', (nan, 0.0, 0.0))])
    assert sim.scene is scene
    lower = [('friction.dry.static', 0.2), ('friction.dry.kinetic', 0.1)]
    higher = [('friction.dry.static', 0.9), ('friction.dry.kinetic', 0.8)]
    for changes in (lower, higher, lower[::-1], higher[::-1]):
        sim.set_parameters(changes)
        assert all(sim.scene.parameters()[path].value == value for path, value in changes)
    with pytest.raises(SceneError, match='kinetic|static'):
        sim.set_parameters([('friction.dry.static', 0.1), ('restitution', 0.5)])
    assert sim.scene.restitution == 0.0


def test_parameters_that_the_start_left_out():
    """Friction and drag that were absent are compiled when they come."""
    sim = simulate([], (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), drag={'linear': 0.0})
    sim.step()
    assert sim.velocity[0, 0] == 1.0
    sim.set_parameter('drag.linear', 2.0)
    sim.step()
    assert sim.velocity[0, 0] == pytest.approx(np.exp(-2.0 * sim.dt), rel=1e-14)


@pytest.mark.parametrize(('path', 'value'), [
    ('restitution', 1.5), ('restitution', nan), ('restitutoin', 0.5), ('friction.dry', -1.0),
    ('colliders.nobody.restitution', 0.5), ('gravity', 9.81), ('stepping.dt', -1.0), (None, 1.0)])
def test_parameters_that_are_refused_change_nothing(path, value):
    sim = drop()
    scene = sim.scene
    with pytest.raises(SceneError):
        sim.set_parameter(path, value)
    assert sim.scene is scene
    sim.step()


def test_moves():
    """The pose at the end of the next step, or of the next steps, then it stands still."""
    sim = drop()
    position, orientation = sim.collider_pose('lid')
    assert_array_equal(position, (0.0, 0.0, 9.0))
    assert_allclose(np.abs(orientation), UPRIGHT, atol=1e-15)
    sim.move_collider('lid', (1.0, 2.0, 8.0), QUARTER)
    assert_array_equal(sim.collider_pose('lid')[0], (0.0, 0.0, 9.0))
    sim.step()
    position, orientation = sim.collider_pose('lid')
    assert_array_equal(position, (1.0, 2.0, 8.0))
    assert_allclose(orientation, QUARTER, atol=1e-15)
    sim.step(10)
    assert_array_equal(sim.collider_pose('lid')[0], (1.0, 2.0, 8.0))
    sim.move_collider('lid', [(0.0, 0.0, 7.0), (0.0, 0.0, 6.0), (0.0, 0.0, 5.0)], [UPRIGHT] * 3)
    for height in (7.0, 6.0, 5.0, 5.0):
        sim.step()
        assert sim.collider_pose('lid')[0][2] == height


def test_moves_of_several_steps_in_one_call():
    """However the steps are called, and a new move replaces what is left of the old one."""
    sim = drop()
    places = np.array([(0.0, 0.0, 9.0 - 0.1 * k) for k in range(1, 6)])
    sim.move_collider('lid', places, [UPRIGHT] * 5)
    sim.step(3)
    assert_array_equal(sim.collider_pose('lid')[0], places[2])
    sim.move_collider('lid', (0.0, 0.0, 4.0), UPRIGHT)
    sim.step(7)
    assert_array_equal(sim.collider_pose('lid')[0], (0.0, 0.0, 4.0))


def test_a_place_ends_a_move():
    """A teleport takes place at once, and drops the poses that were to come."""
    sim = drop()
    sim.move_collider('lid', [(0.0, 0.0, 7.0), (0.0, 0.0, 6.0)], [UPRIGHT] * 2)
    sim.place_collider('lid', (0.0, 0.0, 3.0), QUARTER)
    assert_array_equal(sim.collider_pose('lid')[0], (0.0, 0.0, 3.0))
    sim.step(2)
    assert_array_equal(sim.collider_pose('lid')[0], (0.0, 0.0, 3.0))


def test_orientations_need_not_be_exactly_of_unit_norm():
    """Within 1e-3 they are brought to it."""
    sim = drop()
    sim.move_collider('lid', (0.0, 0.0, 9.0), (0.0, 0.0, 0.0, 1.0009))
    sim.step()
    assert_allclose(sim.collider_pose('lid')[1], UPRIGHT, atol=1e-15)


SPIN = {'motion': {'angular_velocity': [0.0, 0.0, pi / 2], 'linear_velocity': [1.0, 0.0, 0.0]}}


def test_scripted_pose_at_a_time():
    """Quarter of a turn a second about its position, which goes along."""
    sim = simulate([plane(point=(2.0, 0.0, 0.0), **SPIN)], (0.0, 0.0, 9.0), dt=0.25)
    sim.step(4)
    position, orientation = sim.collider_pose('ground')
    assert_allclose(position, (3.0, 0.0, 0.0), rtol=1e-15)
    assert_allclose(orientation, QUARTER, rtol=0.0, atol=1e-15)


@pytest.mark.parametrize(('name', 'position', 'orientation', 'key'), [
    ('nobody', (0, 0, 0), UPRIGHT, 'collider'),
    ('ground', (0, 0, 0), UPRIGHT, 'colliders.ground'),
    ('lid', (0, 0), UPRIGHT, 'colliders.lid.position'),
    ('lid', (0, 0, nan), UPRIGHT, 'colliders.lid.position'),
    ('lid', (0, inf, 0), UPRIGHT, 'colliders.lid.position'),
    ('lid', 'here', UPRIGHT, 'colliders.lid.position'),
    ('lid', None, UPRIGHT, 'colliders.lid.position'),
    ('lid', [], UPRIGHT, 'colliders.lid.position'),
    ('lid', [[[0, 0, 0]]], UPRIGHT, 'colliders.lid.position'),
    ('lid', (0, 0, 0), (0, 0, 0, 0), 'colliders.lid.orientation'),
    ('lid', (0, 0, 0), (0, 0, 0, 1.01), 'colliders.lid.orientation'),
    ('lid', (0, 0, 0), (0, 0, nan, 1), 'colliders.lid.orientation'),
    ('lid', (0, 0, 0), (0, 0, 1), 'colliders.lid.orientation'),
    ('lid', (0, 0, 0), [UPRIGHT, UPRIGHT], 'colliders.lid.orientation')], ids=str)
@pytest.mark.parametrize('call', ['move_collider', 'place_collider'])
def test_moves_that_are_refused(call, name, position, orientation, key):
    """By the key of the bad value; nothing has changed then."""
    sim = simulate([plane(**SPIN), plane((0, 0, -1.0), (0, 0, 9.0), name='lid')], (0.0, 0.0, 1.0))
    with pytest.raises(SceneError) as error:
        getattr(sim, call)(name, position, orientation)
    assert error.value.key == key
    sim.step()
    assert_array_equal(sim.collider_pose('lid')[0], (0.0, 0.0, 9.0))


@pytest.mark.parametrize('twist', [(0, ) * 5, (0, 0, 0, 0, 0, nan), [(0, ) * 6] * 2, 'fast'])
def test_twists_that_are_refused(twist):
    sim = drop()
    with pytest.raises(SceneError) as error:
        sim.move_collider('lid', (0.0, 0.0, 8.0), UPRIGHT, twist)
    assert error.value.key == 'colliders.lid.twist'


def four_lids():
    """Balls fall on four plates that can be moved."""
    lids = [plane(name=f'lid{k}', point=(0.0, 0.0, -float(k))) for k in range(4)]
    return simulate(lids, [(0.3 * k, 0.0, 0.01) for k in range(9)], restitution=0.5)


@pytest.mark.parametrize('with_twists', [False, True])
def test_moves_together_are_as_one_by_one(with_twists):
    """To the last bit, whatever the lengths of the moves, and where moves replace others."""
    random, sims = np.random.default_rng(0), (four_lids(), four_lids())
    for lids, moved, steps in (((0, 1, 2), 1, 1), ((0, 2), 3, 2), ((1, 2, 3), 2, 1), ((3, ), 1, 3),
                               ((0, 1, 2, 3), 5, 5), ((1, ), 1, 4)):
        names = [f'lid{k}' for k in lids]
        places = random.normal(0.0, 0.02, (len(lids), moved, 3))
        turns = np.full((len(lids), moved, 4), UPRIGHT) + random.normal(0.0, 1e-5, (moved, 4))
        twists = random.normal(size=(len(lids), moved, 6)) if with_twists else None
        sims[0].move_colliders(names, places, turns, twists)
        for k, name in enumerate(names):
            twist = None if twists is None else twists[k].tolist()
            sims[1].move_collider(name, places[k].tolist(), turns[k].tolist(), twist)
        for sim in sims:
            sim.step(steps)
        assert_array_equal(sims[0].position, sims[1].position)
        assert_array_equal(sims[0].velocity, sims[1].velocity)
        for k in range(4):
            for one, other in zip(*(sim.collider_pose(f'lid{k}') for sim in sims)):
                assert_array_equal(one, other)
    assert sims[0].counters['collisions'] > 0


@pytest.mark.parametrize(('names', 'places', 'key'), [
    (('lid0', 'lid1'), np.array([[(0, 0, 1.0)], [(0, 0, nan)]]), 'colliders.lid1.position'),
    (('lid0', 'lid1'), [[(0, 0, 1.0)], [(0, 0, 1.0), (0, 0, 2.0)]], 'colliders.lid1.position'),
    (('lid0', 'lid1'), [(0, 0, 1.0)], 'colliders'),
    (('lid0', 'lid0'), [(0, 0, 1.0), (0, 0, 2.0)], 'colliders'),
    (('lid0', 'nobody'), [(0, 0, 1.0), (0, 0, 2.0)], 'collider')], ids=str)
def test_moves_together_that_are_refused(names, places, key):
    """By the key of the first bad value; none has moved then."""
    sim = four_lids()
    with pytest.raises(SceneError) as error:
        sim.move_colliders(names, places, [UPRIGHT] * len(places))
    assert error.value.key == key
    sim.step()
    assert_array_equal(sim.collider_pose('lid0')[0], (0.0, 0.0, 0.0))


def test_unknown_collider():
    """All ways to name one say which there are."""
    sim = drop()
    with pytest.raises(SceneError, match='ground, lid'):
        sim.collider_pose('floor')


def test_a_move_that_was_replaced_leaves_no_trace():
    """Only motions that took place may be used to estimate twists."""
    speeds = []
    for first in ([0.005], [-0.005, 0.005]):        # the last one before a step counts
        sim = simulate([plane()], (0.0, 0.0, 0.0))
        for height in first:
            sim.move_collider('ground', (0.0, 0.0, height), UPRIGHT)
        sim.step()
        sim.move_collider('ground', (0.0, 0.0, 0.02), UPRIGHT)
        sim.step()
        speeds.append(sim.velocity[0, 2])
    assert speeds[0] == speeds[1]


def test_poses_that_were_to_come_leave_no_trace():
    """A new move after some of several poses: only those that took place count."""
    speeds = []
    for heights in ([0.005], [0.005, 0.0125]):      # the second one is replaced
        sim = simulate([plane()], (0.0, 0.0, 0.0))
        places = [(0.0, 0.0, height) for height in heights]
        sim.move_collider('ground', places, [UPRIGHT] * len(places))
        sim.step()
        sim.move_collider('ground', (0.0, 0.0, 0.015), UPRIGHT)
        sim.step()
        speeds.append(sim.velocity[0, 2])
    assert speeds[0] == speeds[1]


def test_counters():
    """One bounce, then rest: each step of it is a contact."""
    sim = simulate([plane()], (0.0, 0.0, 0.01), (0.0, 0.0, -1.0), gravity=(0.0, 0.0, 0.0),
                   restitution=0.5)
    assert list(sim.counters) == KEYS
    sim.step(10)
    assert sim.counters == {**dict.fromkeys(KEYS, 0), 'collisions': 1}
    sim.set_parameter('gravity', (0.0, 0.0, -G))
    sim.step(2000)
    before = sim.counters['contacts']
    sim.step(7)
    assert sim.counters['contacts'] == before + 7
    assert all(isinstance(count, int) for count in sim.counters.values())


@pytest.mark.parametrize('method', METHODS)
def test_unplaced_particles_are_noted(method):
    """Hemmed in by two walls that leave no place: who, in what, by what; the first eight."""
    sim = simulate([plane((1.0, 0.0, 0.0), name='left'), plane((-1.0, 0.0, 0.0), name='right')],
                   [(0.0, 0.1 * k, 0.0) for k in range(10)], method=method)
    sim.move_collider('left', (0.01, 0.0, 0.0), UPRIGHT)
    sim.move_collider('right', (-0.01, 0.0, 0.0), UPRIGHT)
    sim.step()
    assert sim.counters['unplaced'] == sim.counters['fail_safes'] == 10
    assert [particle for particle, _, _ in sim.unplaced] == list(range(8))
    for _, name, reason in sim.unplaced:
        assert (name, reason) in (('left', 'hemmed in by right'), ('right', 'hemmed in by left'))
    assert np.isfinite(sim.position).all()
    assert np.abs(sim.velocity[:, 0]).max() <= 0.01 / sim.dt * (1.0 + 1e-12)
    sim.reset()
    assert sim.unplaced == []


@pytest.mark.jit
def test_the_size_of_blocks_changes_nothing(monkeypatch):
    """Not a bit of the state, the counters or the contacts: some rest, others bounce or fly."""
    rng = np.random.default_rng(1)
    places, velocities = rng.uniform(0.0, 0.5, (1500, 3)), rng.normal(0.0, 1.0, (1500, 3))
    places[::3, 2], velocities[::3] = 0.0, 0.0
    found = []
    for size in (64, 512, 1024):
        monkeypatch.setattr('collision_sim.simulation.block_size', lambda count, size=size: size)
        sim = simulate([plane()], places, velocities, restitution=0.5, friction={'dry': 0.3})
        sim.step(40)
        found.append((sim.position.copy(), sim.velocity.copy(), sim.counters, sim.contacts))
    position, velocity, counters, contacts = found[0]
    assert counters['contacts'] > 0 < counters['collisions'] and len(contacts.particle) > 500
    for other in found[1:]:
        assert_array_equal(other[0], position)
        assert_array_equal(other[1], velocity)
        assert other[2] == counters
        for one, same in zip(other[3], contacts):
            assert_array_equal(one, same)


def test_contacts_are_of_the_last_step_only():
    """Also where several steps were taken at once."""
    sim = simulate([plane()], (0.0, 0.0, 0.01), (0.0, 0.0, -1.0), gravity=(0.0, 0.0, 0.0),
                   restitution=1.0)
    sim.step(3)
    assert len(sim.contacts.particle) == 1
    sim.step(3)
    assert len(sim.contacts.particle) == 0
    assert sim.counters['collisions'] == 1


def test_contacts_have_their_shapes_when_there_are_none():
    sim = simulate([plane()], (0.0, 0.0, 1.0), contacts=False)
    sim.step()
    contacts = sim.contacts
    assert contacts.point.shape == contacts.normal.shape == contacts.impulse.shape == (0, 3)
    assert contacts.particle.shape == contacts.collider.shape == contacts.state.shape == (0, )
    assert contacts.particle.dtype == contacts.state.dtype == np.int64


def test_contacts_of_particles_with_masses():
    """The impulse is that on the particle."""
    sim = simulate([plane()], [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], particles={'mass': [1.0, 4.0]})
    sim.step(3)
    assert_allclose(sim.contacts.impulse[:, 2], np.array((1.0, 4.0)) * G * sim.dt, rtol=1e-12)


def test_contacts_of_later_blocks():
    """Particles are numbered through, in order, beyond the first block of 512."""
    sim = simulate([plane()], [(float(k), 0.0, 0.0) for k in range(1100)])
    sim.step()
    assert_array_equal(sim.contacts.particle, np.arange(1100))
    assert_allclose(sim.contacts.point[:, 0], np.arange(1100.0))


@pytest.mark.parametrize(('most', 'stride'), [(2000, 1), (1100, 1), (1099, 2), (550, 2), (400, 3),
                                              (7, 158), (1, 1100)])
def test_some_contacts(most, stride):
    """At most so many, evenly chosen across the blocks; their parts belong together."""
    sim = simulate([plane()], [(float(k), 0.0, 0.0) for k in range(1100)])
    assert len(sim.some_contacts(most).particle) == 0
    sim.step()
    some = sim.some_contacts(most)
    assert len(some.particle) <= most
    assert_array_equal(some.particle, np.arange(0, 1100, stride))
    for part, all_of_them in zip(some, sim.contacts):
        assert_array_equal(part, all_of_them[::stride])


def test_energy_is_kept_by_elastic_bounces():
    sim = simulate([plane()], (0.0, 0.0, 1.0), dt=1e-2, restitution=1.0,
                   particles={'mass': 3.0})
    assert sim.energy() == pytest.approx(3.0 * G, rel=EPSILON)
    sim.step(1000)
    assert sim.energy() == pytest.approx(3.0 * G, rel=1000 * 4 * EPSILON)
    assert_allclose(sim.momentum(), 3.0 * sim.velocity[0], rtol=EPSILON)


def test_radius_of_some():
    """The clearance is that of the balls."""
    sim = simulate([plane()], [(0.0, 0.0, 1.0), (0.0, 0.0, 1.0)], particles={'radius': [0.0, 0.3]})
    assert_array_equal(sim.clearance(), (1.0, 0.7))


@pytest.mark.parametrize('ledger', [False, True], ids=['', 'ledger'])
@pytest.mark.parametrize('drag', [{}, {'quadratic': 0.1}], ids=['free', 'drag'])
@pytest.mark.parametrize('method', METHODS)
def test_nothing_ceases_to_be_finite(method, drag, ledger):
    """Who would overflow stays where it was, at rest, is counted, and later moves on."""
    position = np.random.default_rng(2).uniform(0.0, 1.0, (40, 3))
    sim = simulate([plane()], position, gravity=(0.0, 0.0, -1e300), dt=1e10, method=method,
                   ledger=ledger, drag=drag)
    sim.step(3)
    assert_array_equal(sim.position, position)
    assert_array_equal(sim.velocity, 0.0)
    assert sim.counters['frozen'] == 3 * len(position)
    sim.set_parameter('gravity', [0.0, 0.0, -1e-25])
    sim.step()
    assert (sim.position[:, 2] < position[:, 2]).all() and np.isfinite(sim.position).all()
    assert sim.counters['frozen'] == 3 * len(position)


@pytest.mark.parametrize('method', METHODS)
def test_one_that_is_not_finite_harms_no_other(method):
    """The others do what they do without it; it keeps the place that was written."""
    position = np.random.default_rng(3).uniform(0.0, 0.1, (40, 3))
    alone, together = (simulate([plane()], position, restitution=0.5, method=method)
                       for _ in range(2))
    together.position[7, 1] = nan
    for sim in (alone, together):
        sim.step(60)
    others = np.arange(40) != 7
    assert_array_equal(together.position[others], alone.position[others])
    assert together.counters['frozen'] == 60 and alone.counters['frozen'] == 0
    assert np.isnan(together.position[7, 1]) and (together.velocity[7] == 0.0).all()
