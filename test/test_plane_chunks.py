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
Particles that touch one plane are answered together (core/planes.py), as they would be one by one.

Fewer than TOGETHER in a block are answered one by one, by core/response.py, and so is every
particle with a ledger: the same particles are also simulated in groups of fewer, and with a
ledger, and all must agree bit for bit, in state, counters and contacts.
"""

from collision_sim.core.stepping import TOGETHER
import numpy as np
from numpy.testing import assert_array_equal
import pytest
import small_meshes
from small_scenes import box, plane, simulate, sphere

FRICTIONS = [{'dry': 0.3}, {'dry': {'static': 0.6, 'kinetic': 0.4}}, {'wet': 2.0},
             {'dry': 0.2, 'wet': {'coefficient': 0.5, 'form': 'capped'}}]
TURNING = {'angular_velocity': [0.3, -0.2, 1.0], 'linear_velocity': [0.5, 0.0, 0.2]}
ROOM = [plane(), plane((0.6, 0.0, 0.8), (-1.0, 0.0, 0.0), 'slope'),
        plane((0.0, -1.0, 0.1), (0.0, 1.5, 0.0), 'wall', restitution=1.0)]
THINGS = [sphere(0.5, (0.0, 0.0, 0.5)), box((1.0, 0.4, 0.6), (1.2, 0.0, 0.3))]


def groups(position, velocity):
    """Cut particles into groups that are too small to be answered together."""
    return [(position[k:k + TOGETHER - 1], velocity[k:k + TOGETHER - 1])
            for k in range(0, len(position), TOGETHER - 1)]


def both_ways(colliders, moves=None, **scene):
    """Give the scene with its particles answered together; one by one with a ledger, in groups."""
    random = np.random.default_rng(5)
    position = random.uniform((-1.0, -1.0, 0.0), (2.0, 1.5, 0.5), (700, 3))
    position[:200, 2] = 0.0         # on the ground
    velocity = random.normal(0.0, 2.0, position.shape)
    velocity[:100] = 0.0
    together, *alone = [simulate(colliders, *state, restitution=0.5, **scene)
                        for state in [(position, velocity), *groups(position, velocity)]]
    watched = simulate(colliders, position, velocity, restitution=0.5, ledger=True, **scene)
    for step in range(60):
        for sim in [together, watched, *alone]:
            if moves:
                sim.move_collider('ground', *moves(step / 240))
            sim.step()
        yield together, [watched], alone


def assert_same(together, *others):
    """Assert that a simulation agrees in all it says with each way to cut it into simulations."""
    for parts in others:
        assert_array_equal(together.position, np.concatenate([sim.position for sim in parts]))
        assert_array_equal(together.velocity, np.concatenate([sim.velocity for sim in parts]))
        assert together.counters == {key: sum(sim.counters[key] for sim in parts)
                                     for key in together.counters}
        contacts = [sim.contacts for sim in parts]
        firsts = np.cumsum([0, *(len(sim.position) for sim in parts[:-1])])
        theirs = [np.concatenate(columns) for columns in zip(*contacts)]
        theirs[0] += np.repeat(firsts, [len(found.particle) for found in contacts])
        for found, expected in zip(together.contacts, theirs, strict=True):
            assert_array_equal(found, expected)


@pytest.mark.jit
@pytest.mark.parametrize('friction', FRICTIONS, ids=str)
@pytest.mark.parametrize('colliders', [ROOM[:1], ROOM, ROOM + THINGS], ids=len)
def test_together_as_one_by_one(colliders, friction):
    """Rest, slides and bounces on planes, beside other colliders."""
    for sims in both_ways(colliders, friction=friction):
        assert_same(*sims)


@pytest.mark.jit
@pytest.mark.parametrize('radius', [0.0, 0.02])
def test_together_on_moving_planes(radius):
    """A ground that turns and shifts by a script, beside slopes that do not."""
    ground = plane(motion=TURNING, name='ground')
    for sims in both_ways([ground, *ROOM[1:]], friction={'dry': 0.3},
                          particles={'radius': radius}):
        assert_same(*sims)


@pytest.mark.jit
def test_together_on_a_plane_that_is_moved():
    """A ground whose velocity is only estimated from its poses."""
    def moves(time):
        height = 0.02 * np.sin(20.0 * time)
        return (0.1 * time, 0.0, height), (0.0, 0.0, 0.0, 1.0)

    for sims in both_ways(ROOM + THINGS, moves, friction={'dry': 0.3}):
        assert_same(*sims)


@pytest.mark.jit
@pytest.mark.parametrize('radius', [0.0, 0.02])
def test_together_beside_meshes(radius, tmp_path):
    """One that stands on the ground, one that moves over it, and one seen from inside."""
    things = []
    for name, size, keys in [('crate', (1.0, 0.4, 0.6), {'position': [1.2, 0.0, 0.3]}),
                             ('sledge', (0.5, 0.5, 0.2), {
                                 'position': [-1.0, 0.0, 0.11],
                                 'motion': {'linear_velocity': [2.0, 0.5, 0.0]}}),
                             ('hall', (9.0, 9.0, 9.0), {'inside': True})]:
        (tmp_path / f'{name}.obj').write_bytes(small_meshes.obj(*small_meshes.box(size)))
        things.append({'name': name, 'shape': 'mesh', 'file': str(tmp_path / f'{name}.obj'),
                       **keys})
    for count in (2, 3):
        touched = set()
        for sims in both_ways([ROOM[0], *things[:count]], friction={'dry': 0.3},
                              particles={'radius': radius}):
            assert_same(*sims)
            touched.update(sims[0].contacts.collider.tolist())
        assert touched >= {0, 1, 2}


def test_extreme_slips_are_answered_one_by_one():
    """Slips whose squares under- or overflow: the size is that of vectors.length."""
    velocity = np.repeat([[1e-170, 0.0, 0.0], [1e170, 0.0, -1.0], [1e-300, 1e-300, -1e-9]], 10, 0)
    position = np.zeros(velocity.shape)
    together, watched, *alone = [
        simulate([plane()], *state, friction={'dry': 0.5}, ledger=ledger) for *state, ledger in [
            (position, velocity, False), (position, velocity, True),
            *((*state, False) for state in groups(position, velocity))]]
    for sim in [together, watched, *alone]:
        sim.step(3)
    assert_same(together, [watched], alone)
