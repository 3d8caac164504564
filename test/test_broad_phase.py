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

"""Scenes of many colliders: a grid over them changes nothing but the time that a step takes."""

from collision_sim import kinematics
from collision_sim.core import broad_phase, nearby
from numba import njit
import numpy as np
from numpy.testing import assert_array_equal
import pytest
from small_scenes import plane, simulate

SIZES = {'box': {'size': [0.4, 0.5, 0.6]}, 'sphere': {'radius': 0.3},
         'capsule': {'radius': 0.2, 'length': 0.5}, 'cylinder': {'radius': 0.3, 'length': 0.4}}


def crowd(count, moving, seed=0):
    """Give a ground and colliders of all shapes at random places, some of which move."""
    random = np.random.default_rng(seed)
    colliders = [plane()]
    for k in range(count):
        shape = list(SIZES)[k % 4]
        turn = random.normal(size=4)
        colliders.append({
            'name': f'{shape}_{k}', 'shape': shape, **SIZES[shape],
            'position': random.uniform((-3.0, -3.0, 0.5), (3.0, 3.0, 3.0)).tolist(),
            'orientation': (turn / np.linalg.norm(turn)).tolist()})
        if k < moving:
            colliders[-1]['motion'] = {'angular_velocity': random.normal(size=3).tolist(),
                                       'linear_velocity': random.normal(size=3).tolist()}
    return colliders


def simulations(monkeypatch, count, moving, radius, **stepping):
    """Give the same scene with the grid and without it."""
    random = np.random.default_rng(1)
    position = random.uniform((-4.0, -4.0, 0.1), (4.0, 4.0, 4.0), (600, 3))
    scene = {'colliders': crowd(count, moving), 'position': position, 'restitution': 0.5,
             'velocity': random.normal(0.0, 3.0, position.shape), 'friction': {'dry': 0.3},
             'particles': {'radius': radius}, 'stepping': stepping}
    with_grid = simulate(**scene)
    monkeypatch.setattr(kinematics, 'in_grid', lambda table: [])
    return with_grid, simulate(**scene)


@pytest.mark.jit
@pytest.mark.parametrize(('moving', 'radius', 'detection'), [
    (0, 0.0, 'end_of_step'), (20, 0.05, 'end_of_step'), (20, 0.02, 'trajectory')])
def test_same_bits_as_without_grid(monkeypatch, moving, radius, detection):
    """Bounces among forty colliders, some of them moving, step by step and in one call."""
    grid, plain = simulations(monkeypatch, 40, moving, radius, detection=detection)
    assert grid._colliders.grid.starts.size > 0 == plain._colliders.grid.starts.size
    for steps in (1, 1, 1, 60):
        grid.step(steps)
        plain.step(steps)
        assert_array_equal(grid.position, plain.position)
        assert_array_equal(grid.velocity, plain.velocity)
        assert grid.counters == plain.counters
    assert grid.counters['collisions'] > 50


@pytest.mark.jit
@pytest.mark.parametrize('moved', [1, 12])
def test_same_bits_where_colliders_are_moved(monkeypatch, moved):
    """Those that stay within the grid leave it as it was laid out, those that leave it do not."""
    grid, plain = simulations(monkeypatch, 40, 0, 0.05)
    names = [collider.name for collider in grid.scene.colliders[1:1 + moved]]
    random, laid_out = np.random.default_rng(3), []
    places = np.array([grid.collider_pose(name)[0] for name in names])
    turns = [grid.collider_pose(name)[1] for name in names]
    for step in range(60):
        places = places + random.uniform(-0.01, 0.01, places.shape)
        places[0] += 9.0 * (step == 30)
        for sim in (grid, plain):
            sim.move_colliders(names, places, turns)
            sim.step()
        assert_array_equal(grid.position, plain.position)
        assert_array_equal(grid.velocity, plain.velocity)
        assert grid.counters == plain.counters
        laid_out.append(grid._colliders.laid_out)
    assert grid.counters['collisions'] > 50
    assert len(set(laid_out[:30])) == 1 < len(set(laid_out))


def test_a_grid_holds_colliders_as_long_as_they_stay_within():
    """And as long as there is room for all entries; cells list who is there now."""
    colliders = simulate(crowd(40, 0), np.zeros((1, 3)))._colliders
    cover, start, motion = colliders._cover, colliders.poses, colliders.motion
    c = 1 + np.linalg.norm(start[0, 1:, 9:] - (0.0, 0.0, 1.7), axis=1).argmin()
    beside, beyond = start.copy(), start.copy()
    beside[:, c, 9:] += 0.3
    beyond[:, c, 9:] += 9.0
    grid = cover.lay_out(start, motion, spare=True)
    starts, items = grid.starts.copy(), grid.items[:grid.starts[-1]].copy()
    assert cover.holds(beside, motion)
    assert (grid.starts != starts).any()
    assert cover.holds(start, motion)
    assert_array_equal(grid.starts, starts)
    assert_array_equal(grid.items[:starts[-1]], items)
    assert not cover.holds(beyond, motion)
    assert cover.holds(start, motion)
    cover._grid = grid._replace(items=grid.items[:starts[-1] - 1])
    assert not cover.holds(start, motion)


@pytest.mark.jit
@pytest.mark.parametrize('count', [12, 60])
def test_same_bits_for_many_that_a_belt_moves(monkeypatch, count):
    """Those on a plane are answered together, but not who may be pressed into something."""
    random = np.random.default_rng(4)
    belt = plane(motion={'linear_velocity': [6.0, 2.0, 0.0]})
    colliders = [belt] + [
        {'name': f'box_{k}', 'shape': 'box', 'size': [0.3, 0.3, 0.3],
         'position': [*random.uniform(-4.0, 4.0, 2).tolist(), 0.0]} for k in range(count)]
    places = random.uniform(-4.0, 4.0, (3000, 2))
    away = [np.abs(places - c['position'][:2]).max(axis=1) > 0.16 for c in colliders[1:]]
    position = np.column_stack([places, np.zeros(3000)])[np.all(away, axis=0)]
    scene = {'colliders': colliders, 'position': position, 'stepping': {'dt': 1 / 30},
             'friction': {'dry': 2.0}, 'restitution': 0.5}
    with_grid = simulate(**scene)
    monkeypatch.setattr(kinematics, 'in_grid', lambda table: [])
    without = simulate(**scene)
    for _ in range(20):
        with_grid.step()
        without.step()
        assert_array_equal(with_grid.position, without.position)
        assert_array_equal(with_grid.velocity, without.velocity)
    assert with_grid.counters == without.counters
    assert with_grid.counters['collisions'] > 100 and with_grid.counters['contacts'] > 30000


def test_few_colliders_have_no_grid(monkeypatch):
    """What a scene does not need is absent."""
    grid, _ = simulations(monkeypatch, broad_phase.MANY - 1, 0, 0.0)
    assert grid._colliders.grid.starts.size == 0


@njit
def cell_of(grid, x, y, z):
    """Call a kernel, which has no entry from Python."""
    return nearby._cell_of(grid, x, y, z)


def test_each_collider_is_in_the_cells_of_its_points():
    """Every point of a collider's surface is in a cell that lists the collider."""
    sim = simulate(crowd(40, 0), np.zeros((1, 3)))
    grid, random = sim._colliders.grid, np.random.default_rng(2)
    inside = np.array([grid.low, grid.high])
    for k, collider in enumerate(sim.scene.colliders):
        if collider.shape != 'sphere':
            continue
        ways = random.normal(size=(50, 3))
        points = collider.position + collider.size[0] * ways / np.linalg.norm(
            ways, axis=1, keepdims=True)
        assert (points >= inside[0]).all() and (points <= inside[1]).all()
        for cell in [cell_of(grid, *point) for point in points]:
            assert k in grid.items[grid.starts[cell]:grid.starts[cell + 1]]


def test_far_particles_and_teleports(monkeypatch):
    """Particles far outside the grid, and a collider that is placed on one of them."""
    colliders = crowd(12, 0)
    colliders.append({'name': 'late', 'shape': 'sphere', 'radius': 1.0, 'position': [50, 0, 0],
                      'topic': 'late'})
    sim = simulate(colliders, [(1e9, 0.0, 5.0), (0.0, 1e300, 5.0), (-9.0, 0.0, 5.0)],
                   gravity=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, -1.0))
    sim.step(5)
    assert sim.counters['collisions'] == 0
    sim.place_collider('late', (-9.0, 0.0, 3.5), (0.0, 0.0, 0.0, 1.0))
    sim.step(240)
    assert sim.counters['collisions'] == 1
    assert_array_equal(sim.position[0], (1e9, 0.0, sim.position[0, 2]))
