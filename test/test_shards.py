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
Shards of a scene: simulated apart, their particles move to the last bit as in the whole.

The scenes share their compiled kernels with those of test_properties, test_exact_moving and
test_paths.
"""

from collision_sim import load_scene, Scene, SceneError, Simulation
import numpy as np
import pytest
from small_scenes import FAR, METHODS

COUNT = 1000        # nearly four blocks; shards of it begin and end within blocks
MOVING = [
    {'name': 'ground', 'shape': 'plane', 'restitution': 0.5,
     'motion': {'oscillate': {'axis': [0, 0, 1], 'amplitude': 0.02, 'frequency': 3.0}}},
    {'name': 'rotor', 'shape': 'box', 'size': [1.0, 0.1, 0.4], 'position': [0, 0, 0.2],
     'motion': {'angular_velocity': [0, 0, 5.0]}},
    {'name': 'bowl', 'shape': 'sphere', 'radius': 1.5, 'position': [0, 0, 0.3], 'inside': True}]


def scene_of(count=COUNT, radius=0.01, method='collision_then_contact', **sections):
    """Particles with random places and velocities, and sizes of their own, in a stirred bowl."""
    return Scene.from_dict({
        'particles': {'count': count, 'seed': 7, 'mass': np.linspace(0.1, 1.0, count),
                      'box': {'min': [-0.7, -0.7, 0.1], 'max': [0.7, 0.7, 0.8]},
                      'velocity': {'sphere': 2.0}, 'radius': np.arange(count) % 3 * radius},
        'friction': {'dry': 0.3, 'wet': 0.1}, 'colliders': MOVING + FAR,
        'stepping': {'dt': 0.01, 'method': method}, **sections})


def after(scene, steps=40):
    """Position and velocity after some steps, the colliders hit in the last, and the counters."""
    sim = Simulation(scene)
    sim.step(steps)
    contacts = sim.contacts
    return (np.hstack([sim.position, sim.velocity]), sim.counters,
            [len(contacts.particle), *contacts.impulse.sum(axis=0)])


@pytest.mark.jit
@pytest.mark.parametrize('method', [*METHODS, 'exact'])
@pytest.mark.parametrize('n', [3, 7])
def test_shards_are_slices_of_the_whole(method, n):
    """Bit for bit, whichever blocks and neighbours in them the particles have."""
    scene = scene_of(method=method)
    state, counters, contacts = after(scene)
    assert counters['collisions'] > COUNT and contacts[0] > 0
    states, counts, parts = zip(*(after(scene.shard(k, n)) for k in range(1, n + 1)))
    assert np.concatenate(states).tobytes() == state.tobytes()
    assert {key: sum(count[key] for count in counts) for key in counters} == counters
    np.testing.assert_allclose(np.sum(parts, axis=0), contacts, rtol=1e-9)


@pytest.mark.jit
def test_shards_with_sweeps_in_many_steps():
    """Also where impacts are found along the paths, called step by step."""
    scene = scene_of(radius=0.0, stepping={'dt': 0.01, 'detection': 'trajectory'})
    whole, shards = Simulation(scene), [Simulation(scene.shard(k, 3)) for k in (1, 2, 3)]
    for _ in range(20):
        for sim in (whole, *shards):
            sim.step()
    assert whole.counters['collisions'] > 0
    position = np.concatenate([sim.position for sim in shards])
    assert position.tobytes() == whole.position.tobytes()


@pytest.mark.parametrize(('count', 'n'), [(1000, 3), (1000, 1), (10, 4), (2, 5), (0, 2)])
def test_slices_are_even_and_leave_nobody_out(count, n):
    """Of every value of the particles; there may be more shards than particles."""
    scene = scene_of(count)
    shards = [scene.shard(k, n).particles for k in range(1, n + 1)]
    for name in ('position', 'velocity', 'mass', 'radius'):
        parts = [getattr(shard, name) for shard in shards]
        np.testing.assert_array_equal(np.concatenate(parts), getattr(scene.particles, name))
        assert not any(part.flags.writeable for part in parts)
        assert max(map(len, parts)) - min(map(len, parts)) <= 1


def test_one_value_for_all_stays_one():
    """A mass or radius that all particles share is kept as it is."""
    scene = Scene.from_dict({'particles': {'position': [[0, 0, 1]] * 4, 'mass': 2.0}})
    particles = scene.shard(2, 2).particles
    assert (particles.mass, particles.radius, len(particles.position)) == (2.0, 0.0, 2)


def test_more_shards_than_particles_run():
    """An empty shard is a simulation without particles."""
    sim = Simulation(load_scene('demo').shard(1, 401))
    sim.step(3)
    assert sim.position.shape == (0, 3) and not any(sim.counters.values())


@pytest.mark.parametrize(('k', 'n'), [(0, 3), (4, 3), (-1, 3), (1, 0), (1.0, 3), (True, 2),
                                      (None, 2), (1, '2/3'), (1, 10 ** 9)])
def test_shards_that_are_none(k, n):
    """The message says what was given and what is allowed."""
    with pytest.raises(SceneError, match='must be k/n with k from 1 to n') as error:
        scene_of(10).shard(k, n)
    assert error.value.key == 'shard' and error.value.value == f'{k}/{n}'


@pytest.mark.parametrize('section', [{'pairs': {}}, {'springs': {'pairs': [[0, 9]],
                                                                 'stiffness': 1.0}}])
def test_particles_that_act_on_each_other_are_not_parted(section):
    """Pairs and springs would act across shards; the whole as its only shard may have them."""
    scene = scene_of(10, particles={'position': np.arange(30.0).reshape(10, 3), 'radius': 0.1},
                     **section)
    with pytest.raises(SceneError, match=f'shard: .*with {next(iter(section))}'):
        scene.shard(1, 2)
    assert len(scene.shard(1, 1).particles.position) == 10
