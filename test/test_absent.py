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
What is left out changes nothing: absent is the same as neutral, to the last bit.

Absent features have no code in the compiled kernels, so each pair here compares two kernels; and
neither the number of threads nor the grouping of the steps may be seen in a result.
"""

from collision_sim import Scene, Simulation
from collision_sim.core.stepping import step_blocks
import numpy as np
import pytest
from small_scenes import METHODS, plane, sphere, UPRIGHT

pytestmark = pytest.mark.jit

RANDOM = np.random.default_rng(5)
COUNT = 200
POSITION = RANDOM.uniform((-2.0, -2.0, 0.6), (2.0, 2.0, 2.0), (COUNT, 3))
VELOCITY = RANDOM.normal(0.0, 2.0, (COUNT, 3))
GROUND = plane((0.1, 0.0, 1.0))
BALL = sphere(0.5, (0.3, 0.0, 0.3))


def run(method='collision_then_contact', steps=200, contacts=True, particles=None, ledger=False,
        **sections):
    """State and counters of a scene after some steps."""
    scene = {'particles': {'position': POSITION, 'velocity': VELOCITY, **(particles or {})},
             'restitution': 0.5, 'colliders': [GROUND, BALL],
             'stepping': {'method': method}, **sections}
    sim = Simulation(Scene.from_dict(scene), contacts=contacts, ledger=ledger)
    sim.step(steps)
    return sim


def assert_same(one, other):
    """Compare two simulations to the last bit."""
    differ = np.flatnonzero((one.position != other.position).any(axis=1)
                            | (one.velocity != other.velocity).any(axis=1))
    assert not differ.size
    assert one.position.tobytes() == other.position.tobytes()
    assert one.velocity.tobytes() == other.velocity.tobytes()
    assert one.counters == other.counters


@pytest.mark.parametrize('method', METHODS[1:])
@pytest.mark.parametrize('friction', [
    {'dry': 0.0}, {'wet': 0.0}, {'wet': {'coefficient': 0.0, 'form': 'linear'}},
    {'dry': {'static': 0.0, 'kinetic': 0.0}, 'wet': {'coefficient': 0.0, 'form': 'capped'}},
], ids=['dry', 'wet', 'linear', 'both'])
def test_no_friction(method, friction):
    """No friction, and coefficients of 0."""
    assert_same(run(method), run(method, friction=friction))
    assert_same(run(method), run(method, friction='none'))


def test_friction_of_one_collider():
    """Friction on one collider compiles it for all: the other one does as before."""
    colliders = [GROUND, {**BALL, 'friction': {'dry': 0.0}}]
    assert_same(run(friction={'dry': 0.3}, colliders=colliders),
                run(friction={'dry': 0.3}, colliders=[GROUND, {**BALL, 'friction': 'none'}]))
    wet = [GROUND, {**BALL, 'friction': {'dry': 0.3, 'wet': 0.0}}]
    assert_same(run(friction={'dry': 0.3}, colliders=wet), run(friction={'dry': 0.3}))


@pytest.mark.parametrize('method', METHODS[1:])
@pytest.mark.parametrize('drag', [{'linear': 0.0}, {'quadratic': 0.0}, {'wind': [3.0, 2.0, 1.0]}],
                         ids=['linear', 'quadratic', 'wind'])
def test_no_drag(method, drag):
    """No drag, and coefficients of 0; wind alone does nothing."""
    assert_same(run(method), run(method, drag=drag))


def test_drag_of_one_kind():
    """Linear drag with and without a quadratic coefficient of 0, and the other way round."""
    assert_same(run(drag={'linear': 0.5}), run(drag={'linear': 0.5, 'quadratic': 0.0}))
    assert_same(run(drag={'quadratic': 0.5}), run(drag={'linear': 0.0, 'quadratic': 0.5}))


@pytest.mark.parametrize('method', METHODS[1:])
def test_fixed_colliders(method):
    """Colliders that do not move, and those that move with a velocity of 0."""
    still = {'linear_velocity': [0.0, 0.0, 0.0], 'angular_velocity': [0.0, 0.0, 0.0],
             'oscillate': {'axis': [1, 0, 0], 'amplitude': 0.0, 'frequency': 3.0}}
    fixed = run(method, friction={'dry': 0.3})
    assert_same(fixed, run(method, friction={'dry': 0.3},
                           colliders=[{**GROUND, 'motion': still}, {**BALL, 'motion': still}]))
    moved = run(method, steps=0, friction={'dry': 0.3})
    for _ in range(200):
        moved.move_collider('ball', BALL['position'], UPRIGHT)
        moved.step()
    assert_same(fixed, moved)


@pytest.mark.parametrize('shape', [
    {'shape': 'box', 'size': [1, 1, 1]}, {'shape': 'capsule', 'radius': 1, 'length': 1},
    {'shape': 'cylinder', 'radius': 1, 'length': 1}, {'shape': 'sphere', 'radius': 1},
    {'shape': 'box', 'size': [1e5, 1e5, 1e5], 'inside': True}], ids=str)
def test_shape_that_nobody_meets(shape):
    """A collider far away, or wide around, changes nothing."""
    far = {'name': 'far', 'position': [0.0, 0.0, 0.0 if 'inside' in shape else 1e4], **shape}
    assert_same(run(), run(colliders=[GROUND, BALL, far]))
    assert_same(run(), run(colliders=[far, GROUND, BALL]))


@pytest.mark.parametrize('method', METHODS[1:])
def test_recording(method):
    """Contacts are recorded or not."""
    assert_same(run(method), run(method, contacts=False))
    sim = run(method, steps=100)
    sim.record_contacts = False
    sim.step(60)
    assert len(sim.contacts.particle) == 0
    sim.record_contacts = True
    sim.step(40)
    assert len(sim.contacts.particle) > 0
    assert_same(run(method), sim)


@pytest.mark.parametrize('method', METHODS[1:])
def test_points(method):
    """No radius, a radius of 0, and one that some particle has."""
    assert_same(run(method), run(method, particles={'radius': 0.0}))
    assert_same(run(method), run(method, particles={'radius': [0.0] * COUNT}))
    big = np.zeros(COUNT)
    big[17] = 0.05
    mixed, points = run(method, particles={'radius': big}), run(method)
    assert not np.array_equal(mixed.position[17], points.position[17])
    others = np.arange(COUNT) != 17
    assert mixed.position[others].tobytes() == points.position[others].tobytes()


@pytest.mark.parametrize('method', METHODS)
def test_ledger(method):
    """The ledger looks on: with it and without it the same, to the last bit."""
    motion = {'angular_velocity': [0.0, 0.5, 1.0]}
    sections = {'friction': {'dry': 0.3}, 'colliders': [GROUND, {**BALL, 'motion': motion}]}
    assert_same(run(method, **sections), run(method, ledger=True, **sections))


def test_mass():
    """Masses matter to impulses and energies only."""
    assert_same(run(), run(particles={'mass': RANDOM.uniform(0.1, 9.0, COUNT)}))


@pytest.mark.parametrize('method', METHODS)
def test_grouping_of_steps(method):
    """step(n) is n times step(), with and without moving colliders."""
    motion = {'angular_velocity': [0.0, 0.5, 1.0],
              'oscillate': {'axis': [0, 0, 1], 'amplitude': 0.1, 'frequency': 2.0}}
    for colliders in ([GROUND, BALL], [GROUND, {**BALL, 'motion': motion}]):
        single = run(method, 0, friction={'dry': 0.3}, colliders=colliders)
        for _ in range(200):
            single.step()
        assert_same(run(method, friction={'dry': 0.3}, colliders=colliders), single)


def test_grouping_beyond_the_poses_of_one_call():
    """Moving colliders are laid out over 1024 steps at once; that cannot be seen."""
    motion = {'angular_velocity': [0.0, 0.5, 1.0]}
    colliders = [GROUND, {**BALL, 'motion': motion}]
    parts = run(steps=777, friction={'dry': 0.3}, colliders=colliders)
    parts.step(1724)
    assert_same(run(steps=2501, friction={'dry': 0.3}, colliders=colliders), parts)


def test_grouping_of_moves():
    """Poses of several steps at once are the same as one by one, where twists are given."""
    places = 0.3 + 0.2 * np.sin(np.arange(1, 101) / 20.0)[:, None] * np.array((0.0, 0.3, 1.0))
    turns = np.tile(UPRIGHT, (100, 1))
    twists = np.zeros((100, 6))
    twists[:, :3] = 240 / 20.0 * 0.2 * np.cos(np.arange(1, 101) / 20.0)[:, None] * (0.0, 0.3, 1.0)
    whole, single = (run(steps=0, friction={'dry': 0.3}) for _ in range(2))
    whole.move_collider('ball', places, turns, twists)
    whole.step(40)
    whole.step(60)
    for k in range(100):
        single.move_collider('ball', places[k], turns[k], twists[k])
        single.step()
    assert_same(whole, single)


def many(threads, steps=50, contacts=True):
    """More particles than one thread takes, with contacts."""
    random = np.random.default_rng(9)
    scene = {'particles': {'position': random.uniform((-3, -3, 0.6), (3, 3, 1.0), (40_000, 3)),
                           'velocity': random.normal(0.0, 3.0, (40_000, 3))},
             'restitution': 0.5, 'friction': {'dry': 0.3}, 'colliders': [GROUND, BALL]}
    sim = Simulation(Scene.from_dict(scene), contacts=contacts, threads=threads)
    sim.step(steps)
    return sim


@pytest.mark.parametrize('threads', [2, 3, 7, 100])
def test_threads(threads):
    """T91: results and recorded contacts do not depend on the number of threads."""
    one, other = many(1), many(threads)
    assert_same(one, other)
    for a, b in zip(one.contacts, other.contacts):
        assert a.tobytes() == b.tobytes()


def test_threads_when_few_particles_are_left():
    """Results do not depend on which particles are in the scene besides."""
    part = np.arange(3000)
    whole = run(particles={'position': np.tile(POSITION, (15, 1)),
                           'velocity': np.tile(VELOCITY, (15, 1))})
    single = run()
    for k in range(15):
        rows = part[:COUNT] + k * COUNT
        assert whole.position[rows].tobytes() == single.position.tobytes()
        assert whole.velocity[rows].tobytes() == single.velocity.tobytes()


@pytest.mark.parametrize('method', METHODS)
def test_same_input_twice(method):
    """T91: bit-identical, and again after a reset."""
    first, second = run(method, friction={'dry': 0.3}), run(method, friction={'dry': 0.3})
    assert_same(first, second)
    second.step(13)
    second.reset()
    second.step(200)
    assert_same(first, second)


PYRAMID = {'vertices': [[-1, -1, 0], [1, -1, 0], [0, 1, 0], [0, 0, 1]],
           'faces': [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]}
VALUES = {
    'shapes': {'colliders': [GROUND, BALL, {'name': 'rod', 'shape': 'capsule', 'radius': 0.1,
                                            'length': 1.0, 'position': [0.0, 1.0, 0.3]}]},
    'many': {'colliders': [GROUND, *(sphere(0.2, (0.5 * k, 1.0, 0.2), name=f'ball{k}')
                                     for k in range(9))]},
    'moving': {'colliders': [GROUND, sphere(0.5, (0.3, 0.0, 0.3), motion={
        'angular_velocity': [0.0, 0.0, 1.0]})]},
    'friction': {'friction': {'dry': 0.3}}, 'wet': {'friction': {'wet': 1.0}},
    'drag': {'drag': {'linear': 0.5, 'quadratic': 0.1}},
    'radius': {'particles': {'radius': 0.05}},
    'radii': {'particles': {'radius': [0.05, *[0.1] * (COUNT - 1)]}},
    'silent': {'contacts': False}, 'one by one': {'method': 'multi_pass'},
    'paths': {'stepping': {'detection': 'trajectory'}}, 'ledger': {'ledger': True},
    'second order': {'method': 'second_order_contact'},
    'mesh': {'colliders': [GROUND, {'name': 'pyramid', 'shape': 'mesh', **PYRAMID}]}}


@pytest.mark.parametrize('name', VALUES)
def test_a_value_compiles_nothing(name):
    """Scenes that differ by values run the same machine code."""
    run(steps=1)
    known = set(step_blocks.signatures)
    run(steps=1, **VALUES[name])
    assert set(step_blocks.signatures) == known
