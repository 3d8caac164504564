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


"""Pairs: how a scene gives them, what is refused, and what their results do not depend on."""

from collision_sim import Scene, SceneError
import numpy as np
import pytest
from small_scenes import box, plane, simulate

FLOOR = [plane(point=(0, 0, -1e9))]     # far below, so that all share their kernels


def scene(**sections):
    """Give a scene of two balls."""
    return {'particles': {'position': [[0, 0, 0], [3, 0, 0]], 'radius': 1.0},
            'pairs': {}, **sections}


def cloud(count, *, permuted=None, threads=None, shift=(0.0, 0.0, 0.0), boost=(0.0, 0.0, 0.0),
          gravity=(0.0, 0.0, -9.81), colliders=None, **keys):
    """Simulate balls of several radii and masses that fall into a corner, or fly freely."""
    random = np.random.default_rng(3)
    site, wide = np.arange(count), 5
    position = np.stack([site % wide, site // wide % wide, site // wide ** 2], axis=1) * 0.05
    position += 0.05 + random.uniform(-0.005, 0.005, (count, 3))
    velocity = 0.5 * random.normal(size=(count, 3))
    radius, mass = 0.02 * 2.0 ** -random.random(count), 10.0 ** random.uniform(-1.0, 0.0, count)
    order = np.arange(count) if permuted is None else permuted
    if colliders is None:
        colliders = [plane(), plane((1, 0, 0), name='side'), plane((0, 1, 0), name='front')]
    return simulate(colliders, position[order] + shift, velocity[order] + boost, gravity=gravity,
                    particles={'radius': radius[order], 'mass': mass[order]},
                    pairs={'restitution': 0.5}, friction={'dry': 0.3}, restitution=0.5,
                    threads=threads, **keys)


def test_pairs_take_the_laws_of_the_scene():
    """An empty section is there; what it does not give is the scene's."""
    given = Scene.from_dict(scene(restitution=0.7, friction={'dry': 0.2}))
    assert given.pairs.restitution_in(given) == 0.7
    assert given.pairs.friction_in(given).static == 0.2
    parameters = given.parameters()
    assert parameters['pairs.restitution'].value == 0.7
    assert parameters['pairs.friction.dry'].value == 0.2
    assert Scene.from_dict({'particles': {}}).pairs is None
    assert Scene.from_dict({**scene(), 'pairs': None}).pairs is None


def test_parameters_of_pairs_change():
    """Restitution and friction of pairs are parameters of their own."""
    given = Scene.from_dict(scene()).with_parameter('pairs.restitution', 0.25)
    given = given.with_parameter('pairs.friction.dry', 0.5)
    assert (given.pairs.restitution, given.pairs.friction.kinetic) == (0.25, 0.5)
    assert (given.restitution, given.friction.kinetic) == (0.0, None)
    for path in ('pairs', 'pairs.mass', 'pairs.friction', 'pairs.friction.dry.x'):
        with pytest.raises(SceneError):
            given.with_parameter(path, 0.5)
    with pytest.raises(SceneError, match='pairs.restitution'):
        given.with_parameter('pairs.restitution', 1.5)
    with pytest.raises(SceneError, match='pairs.restitution'):
        Scene.from_dict({'particles': {}}).with_parameter('pairs.restitution', 0.5)


@pytest.mark.parametrize('sections, key', [
    ({'pairs': {'restitution': 2}}, 'pairs.restitution'),
    ({'pairs': {'friction': {'dry': -1}}}, 'pairs.friction.dry'),
    ({'pairs': {'bounce': 1}}, 'pairs.bounce'),
    ({'pairs': 3}, 'pairs'),
    ({'particles': {'position': [[0, 0, 0]]}}, 'particles.radius')])
def test_what_is_refused(sections, key):
    """The error names the key."""
    with pytest.raises(SceneError) as caught:
        Scene.from_dict(scene(**sections))
    assert caught.value.key == key


def test_without_the_section_particles_pass_through_each_other():
    """Two balls that fly at each other go on."""
    sim = simulate(FLOOR, [[-1, 0, 0], [1, 0, 0]], [[1, 0, 0], [-1, 0, 0]], gravity=(0, 0, 0),
                   particles={'radius': 0.5})
    sim.step(480)
    assert np.allclose(sim.position[:, 0], [1.0, -1.0])


@pytest.mark.parametrize('count', [0, 1])
def test_nobody_to_meet(count):
    """No particle, or one."""
    sim = simulate([plane()], np.ones((count, 3)), particles={'radius': 0.1} if count else {},
                   pairs={})
    sim.step(3)
    assert sim.counters['pair_collisions'] == 0


@pytest.mark.filterwarnings('ignore:overflow')     # 1e300 m squared, without the compiler
def test_particles_far_from_each_other():
    """A pair in the origin and one at 1e9 m collide as they do alone."""
    position = np.array([[-0.6, 0, 0], [0.6, 0, 0]])
    far = np.concatenate([position, position + [0.0, 2.0 ** 30, -(2.0 ** 30)], [[1e300, 0, 0]]])
    velocity = np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    sim = simulate(FLOOR, far, np.concatenate([velocity, velocity, [[0, 0, 0]]]),
                   gravity=(0, 0, 0), dt=1 / 64, particles={'radius': 0.5},
                   pairs={'restitution': 0.5})
    sim.step(16)
    assert np.allclose(sim.velocity[:4, 0], [-0.5, 0.5, -0.5, 0.5], rtol=1e-12)


@pytest.mark.parametrize('other', [(0.0, 0.0, 0.25), (9.0, 0.0, 9.0)])
def test_nothing_that_a_ball_does_moves_one_of_infinite_mass(other):
    """It starts in the floor, on its way up: with a ball on it, it moves as without."""
    sim = simulate([plane()], [(0.0, 0.0, 0.07), other], [(0.5, 0.0, 0.0), (0.0, 0.0, 0.0)],
                   dt=0.02, particles={'radius': 0.1, 'mass': [np.inf, 1.0]}, pairs={},
                   friction={'dry': 0.3}, restitution=0.5)
    sim.step(3)
    alone = simulate([plane()], [(0.0, 0.0, 0.07)], [(0.5, 0.0, 0.0)], dt=0.02,
                     particles={'radius': 0.1}, friction={'dry': 0.3}, restitution=0.5)
    alone.step(3)
    assert sim.position[0].tolist() == alone.position[0].tolist()
    assert sim.velocity[0].tolist() == alone.velocity[0].tolist()


def test_a_crowd_at_one_place_ends():
    """Seventy balls at one place: counted as undecided, finite, momentum kept."""
    velocity = np.random.default_rng(1).normal(size=(70, 3))
    sim = simulate(FLOOR, np.full((70, 3), 0.5), velocity, gravity=(0, 0, 0),
                   particles={'radius': 1.0}, pairs={'restitution': 1.0})
    sim.step()
    assert sim.counters['undecided'] > 0
    assert np.isfinite(sim.position).all()
    assert np.allclose(sim.momentum(), velocity.sum(axis=0), atol=1e-12)


@pytest.mark.filterwarnings('ignore:invalid value', 'ignore:overflow')     # without the compiler
@pytest.mark.parametrize('detection', ['end_of_step', 'trajectory'])
@pytest.mark.parametrize('value', [np.nan, np.inf])
def test_who_is_not_finite_takes_no_part(value, detection):
    """Places or velocities that are not finite do nothing to the others."""
    sims = [cloud(40, stepping={'detection': detection}) for _ in range(2)]
    for sim, bad in zip(sims, (value, 1e3)):
        sim.position[7, 0] = sim.position[8] = bad
        sim.velocity[9, 1] = bad
        sim.position[9] = 2e3       # alone, for comparison
        sim.step(40)
    others = np.delete(np.arange(40), [7, 8, 9])
    assert np.isfinite(sims[0].position[others]).all()
    assert np.allclose(sims[0].position[others], sims[1].position[others], atol=1e-12)
    assert sims[0].counters['pair_collisions'] == sims[1].counters['pair_collisions'] > 5


def test_writing_to_the_state_between_steps():
    """A jump of a particle loses what the last step has left, and nothing else."""
    sim = simulate([plane()], [[0, 0, 0.1], [0, 0, 0.3]], particles={'radius': 0.1},
                   pairs={}, dt=1 / 64)
    sim.step(10)
    sim.position[1] = [5.0, 0.0, 0.1]
    sim.velocity[1] = 0.0
    sim.step(10)
    assert np.allclose(sim.position, [[0, 0, 0.1], [5, 0, 0.1]], atol=1e-15)


def test_reset_starts_from_the_same_bits():
    """A second run after a reset is the first one."""
    sim = cloud(60)
    sim.step(40)
    first = sim.position.copy(), sim.velocity.copy()
    sim.reset()
    sim.step(40)
    assert np.array_equal(sim.position, first[0]) and np.array_equal(sim.velocity, first[1])


@pytest.mark.jit
@pytest.mark.parametrize('detection', ['end_of_step', 'trajectory'])
def test_same_bits_with_any_number_of_threads_and_any_order(detection):
    """Gas, pouring and a pile, with 1, 2 and 5 threads and with permuted particles."""
    count, stepping = 1500, {'detection': detection}
    order = np.random.default_rng(1).permutation(count)
    one = cloud(count, threads=1, stepping=stepping)
    others = [cloud(count, threads=threads, stepping=stepping) for threads in (1, 2, 5)]
    permuted = cloud(count, permuted=order, threads=2, stepping=stepping)
    for _ in range(3):
        for sim in (one, *others, permuted):
            sim.step(30)
        for sim in others:
            assert np.array_equal(sim.position, one.position)
            assert np.array_equal(sim.velocity, one.velocity)
        assert np.array_equal(permuted.position, one.position[order])
        assert np.array_equal(permuted.velocity, one.velocity[order])
    assert one.counters['pair_collisions'] > 1000 and one.counters['pair_contacts'] > 100


@pytest.mark.parametrize('detection', ['end_of_step', 'trajectory'])
def test_ledger_explains_what_pairs_do(detection):
    """Energy and momentum of balls that fall into a corner: nothing is left but rounding."""
    sim = cloud(50, stepping={'detection': detection}, ledger=True)
    energy, momentum = sim.energy(), sim.momentum()
    sim.step(60)
    total = sim.ledger.total
    assert np.isclose(total.change, sim.energy() - energy, rtol=1e-12)
    assert abs(total.residual) < 1e-13 * abs(energy)
    assert np.abs(total.momentum.residual).max() < 1e-12 * np.abs(sim.momentum() - momentum).max()
    assert total.internal < 0.0


def test_galilean_invariance():
    """A gas that drifts at 16 m/s collides as one that does not."""
    still = cloud(50, gravity=(0, 0, 0), colliders=FLOOR)
    moving = cloud(50, gravity=(0, 0, 0), colliders=FLOOR, boost=(16.0, 0.0, 0.0))
    for sim in (still, moving):
        sim.step(40)
    assert still.counters['pair_collisions'] == moving.counters['pair_collisions'] > 5
    drift = [16.0 * still.time, 0.0, 0.0]
    assert np.allclose(moving.position - drift, still.position, atol=1e-12)


def test_balls_in_a_box_stay_inside():
    """Colliders come last: nobody ends a step inside one."""
    walls = box((0.4, 0.4, 0.4), (0.2, 0.2, 0.2), inside=True)
    sim = cloud(60, colliders=[walls], contacts=True)
    for _ in range(60):
        sim.step()
        assert sim.clearance().min() > -1e-15
