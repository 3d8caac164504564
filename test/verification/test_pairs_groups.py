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

"""Balls pressed and struck together: energy, nobody passes, mirror images, any ratio of masses."""

import numpy as np
import pytest
import small_meshes
from small_scenes import box, G, METHODS, plane, simulate

pytestmark = pytest.mark.plain

RADIUS = 0.1
OPEN = 0.15             # share of it by which two who collide by themselves may overlap a third
DETECTIONS = ['end_of_step', 'trajectory']


def balls(position, velocity=(0.0, 0.0, 0.0), *, colliders=(), mass=1.0, restitution=0.0,
          gravity=(0.0, 0.0, 0.0), detection='end_of_step', radius=RADIUS, **keys):
    """Simulate balls that collide with each other as with colliders."""
    return simulate(colliders, position, velocity, gravity=gravity, restitution=restitution,
                    particles={'radius': radius, 'mass': mass}, pairs={},
                    stepping={'detection': detection}, **keys)


def row(count, gap=0.0, axis=0):
    """Places of equal balls in a row that begins at 0, (count, 3)."""
    position = np.zeros((count, 3))
    position[:, axis] = RADIUS + (2.0 * RADIUS + gap) * np.arange(count)
    return position


def overlap(sim):
    """Deepest overlap of two balls [m]."""
    distance = np.linalg.norm(sim.position[:, None] - sim.position, axis=2)
    return 2.0 * RADIUS - distance[np.triu_indices(len(distance), 1)].min()


@pytest.mark.parametrize('restitution', [0.0, 0.3])
@pytest.mark.parametrize('heavy, dt', [(100.0, 1 / 240), (1e3, 1 / 240), (1e3, 1 / 2000),
                                       (1e6, 1 / 60)])
def test_heavy_on_light_gains_no_energy(heavy, dt, restitution):
    """A loose column with a heavy ball on top: what falls on the ground never has more energy."""
    sim = balls(row(4, 0.1, axis=2), mass=[1.0, 1.0, 1.0, heavy], colliders=[plane()], dt=dt,
                gravity=(0.0, 0.0, -G), restitution=restitution)
    most = sim.energy()
    for _ in range(int(0.4 / dt)):
        sim.step()
        assert sim.energy() <= most * (1.0 + 1e-9)
        assert overlap(sim) < 0.01 * RADIUS


@pytest.mark.parametrize('detection', DETECTIONS)
@pytest.mark.parametrize('gap', [0.0, 1e-12, 1e-3])
@pytest.mark.parametrize('masses', [(1.0, 1e3), (10.0, 1.0), (1.0, 1.0, 1.0), (1.0, 1e6),
                                    (1e6, 1.0, 1e6)])
def test_a_wall_pushes_a_row(masses, gap, detection):
    """All of a row move with the wall, whatever their masses, and nobody into anybody."""
    wall = plane((1, 0, 0), motion={'linear_velocity': [1.0, 0.0, 0.0]})
    sim = balls(row(len(masses), gap), mass=masses, colliders=[wall], detection=detection)
    for _ in range(20):
        sim.step()
        assert overlap(sim) < 0.01 * RADIUS
        assert sim.clearance().min() > -1e-12
    assert np.allclose(sim.velocity, [1.0, 0.0, 0.0], atol=1e-9)


def fast_wall(shape, speed):
    """Give a wall in front of x = 0 that moves along x."""
    motion = {'motion': {'linear_velocity': [speed, 0.0, 0.0]}}
    if shape == 'plane':
        return plane((1, 0, 0), **motion)
    if shape == 'box':
        return box((1.0, 4.0, 4.0), (-0.5, 0.0, 0.0), **motion)
    vertices, faces = small_meshes.box((1.0, 4.0, 4.0))
    return {'name': 'box', 'shape': 'mesh', 'vertices': np.array(vertices).tolist(),
            'faces': np.array(faces).tolist(), 'position': [-0.5, 0.0, 0.0], **motion}


def steps_of(sim, speed, count):
    """Step a row that a wall pushes, see what always holds, and give the mean velocities."""
    for _ in range(count):
        before, energy = sim.position.copy(), in_frame(sim, speed)
        sim.step()
        assert overlap(sim) < 0.01 * RADIUS
        assert sim.clearance().min() > -1e-12
        assert in_frame(sim, speed) <= energy * (1.0 + 1e-9) + 1e-12
        yield (sim.position - before)[:, 0] / sim.scene.stepping.dt


def in_frame(sim, speed):
    """Kinetic energy in the frame of a wall [J]."""
    relative = sim.velocity - [speed, 0.0, 0.0]
    return 0.5 * float(np.square(relative).sum(axis=1) @ np.array(sim.scene.particles.mass))


@pytest.mark.parametrize('detection', DETECTIONS)
@pytest.mark.parametrize('shape', ['plane', 'box', 'mesh'])
@pytest.mark.parametrize('masses', [(1.0, 1e2, 1e4, 1e6), (1.0, 1e4, 1.0, 1e4), (1.0, 1e6),
                                    (1e6, 1e4, 1e2, 1.0), (1.0, 1.0, 1.0, 1e6)])
def test_a_fast_wall_hits_a_row(masses, shape, detection):
    """What is left of ten collisions is inelastic: places and velocities agree, but for gaps."""
    gap, dt = 1e-3, 0.01
    sim = balls(row(len(masses), gap), mass=list(masses), colliders=[fast_wall(shape, 5.0)],
                restitution=1.0, dt=dt, detection=detection)
    for mean in steps_of(sim, 5.0, 12):
        assert np.allclose(mean, sim.velocity[:, 0], rtol=0.0, atol=len(masses) * gap / dt)
    assert np.allclose(mean, sim.velocity[:, 0], rtol=0.0, atol=1e-9)
    assert sim.velocity[:, 0].min() >= 5.0 - 1e-9


@pytest.mark.parametrize('shape', ['plane', 'box', 'mesh'])
def test_a_wall_and_five_balls_with_gaps(shape):
    """A wall throws the first onto the second once that has lost its speed to the third."""
    sim = balls(row(5, 0.01), mass=[1.0] * 5, colliders=[fast_wall(shape, 1.0)],
                restitution=0.5, dt=0.01, detection='trajectory')
    for mean in steps_of(sim, 1.0, 20):
        assert np.allclose(mean, sim.velocity[:, 0], rtol=0.0, atol=1e-3)


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize('detection', DETECTIONS)
def test_a_ball_and_a_wall_within_one_step(detection, method):
    """A ball pushes another one to the wall and gets it back: v = (-2, 0), in their order."""
    sim = balls([[0.78, 0, 0], [0.99, 0, 0]], [[2, 0, 0], [0, 0, 0]], restitution=1.0, dt=0.11,
                colliders=[plane((-1, 0, 0), (1.1, 0, 0))], detection=detection, method=method)
    sim.step()
    assert np.allclose(sim.velocity[:, 0], [-2.0, 0.0], atol=1e-15)
    assert sim.position[1, 0] - sim.position[0, 0] >= 2.0 * RADIUS


def test_a_ball_thrown_back_meets_who_comes_behind():
    """The ground throws a ball back onto one that was not near its path: both are answered."""
    sim = balls(row(2, 1e-3, axis=2), [[0, 0, -3], [0, 0, -1]], restitution=1.0, dt=1 / 240,
                colliders=[plane()])
    sim.step()
    assert np.allclose(sim.velocity[:, 2], [1.0, 3.0], atol=1e-12)     # equal masses exchange
    assert overlap(sim) <= 0.0


@pytest.mark.parametrize('method', METHODS)
def test_repulsion_leaves_no_speed(method):
    """A ball between the ground and one of infinite mass that it overlaps is moved, no more."""
    sim = balls([[0.06, 0, RADIUS], [0, 0, 0.22]], mass=[1.0, np.inf], colliders=[plane()],
                method=method)
    before = overlap(sim)
    for _ in range(60):
        sim.step()
        assert sim.energy() == 0.0
    assert 0.0 < overlap(sim) < 0.1 * before
    assert sim.clearance().min() > -1e-12


def struck(method, detection, restitution, axes=(0, 1, 2), order=(0, 1, 2)):
    """Let a ball hit two that touch each other head on; velocities in the frame of the ball."""
    axes, order = list(axes), list(order)
    position = np.array([[-0.5, 0, 0], [0, RADIUS, 0], [0, -RADIUS, 0]])[order]
    velocity = np.array([[1.0, 0, 0], [0, 0, 0], [0, 0, 0]])[order]
    sim = balls(position[:, axes], velocity[:, axes], restitution=restitution, method=method,
                detection=detection)
    sim.step(120)
    return sim.velocity[np.argsort(order)][:, np.argsort(axes)]


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize('detection', DETECTIONS)
@pytest.mark.parametrize('restitution', [0.0, 0.5, 1.0])
def test_two_hit_at_once_leave_a_mirror_image(method, detection, restitution):
    """Along the line of centres 0.4 + 0.6 e of the speed are gone, and each of two takes half."""
    v = struck(method, detection, restitution)
    assert np.allclose(v[1], v[2] * [1, -1, 1], atol=1e-15)
    assert abs(v[0, 1]) < 1e-15
    assert v[0, 0] == pytest.approx(0.4 - 0.6 * restitution, abs=0.01)
    assert np.allclose(v.sum(axis=0), [1.0, 0.0, 0.0], atol=1e-15)
    assert np.allclose(struck(method, detection, restitution, (2, 0, 1)), v, atol=1e-15)
    assert np.array_equal(struck(method, detection, restitution, order=(2, 0, 1)), v)


def test_collisions_of_different_restitution_gain_no_energy():
    """A ball between an elastic wall and an inelastic heavy one, hit by both at once."""
    for angle in np.linspace(0.05, 1.5, 12):
        normal = (-np.cos(angle), np.sin(angle), 0.0)
        sim = balls([[-2.0 * RADIUS, 0, 0], [0, 0, 0]], [[1, 0, 0], [0.5, -0.1, 0]],
                    mass=[1e3, 1.0], restitution=0.0, dt=0.05,
                    colliders=[plane(normal, tuple(-RADIUS * np.array(normal)), restitution=1.0)])
        before = sim.energy()
        sim.step()
        assert sim.energy() <= before * (1.0 + 1e-12)
        assert overlap(sim) < 0.01 * RADIUS


@pytest.mark.parametrize('friction', [None, {'dry': 0.3}, {'wet': 0.5}])
@pytest.mark.parametrize('method', ['collision_then_contact', 'second_order_contact'])
@pytest.mark.parametrize('seed', range(3))
def test_balls_in_a_corner(seed, method, friction):
    """Energy, overlaps, order of the particles, and the mirror image, for balls of any mass."""
    random = np.random.default_rng(seed)
    position = np.indices((2, 2, 2)).reshape(3, -1).T[:7] * 0.21 + RADIUS
    velocity, mass = random.normal(size=(7, 3)), 10.0 ** random.uniform(0.0, 6.0, 7)
    mirror, order, sims = np.array([-1.0, 1.0, 1.0]), random.permutation(7), []
    for turned, which in ((1.0, slice(None)), (mirror, slice(None)), (1.0, order)):
        walls = [plane(), plane((1, 0, 0) * np.array(turned), name='side'),
                 plane((0, 1, 0), name='front')]
        for wall in walls:
            wall['normal'] = [float(x) for x in wall['normal']]
        sims.append(balls((position * turned)[which], (velocity * turned)[which],
                          mass=mass[which], colliders=walls, gravity=(0, 0, -G), restitution=0.5,
                          dt=1 / 120, friction=friction, method=method))
    most = sims[0].energy()
    for k in range(25):
        for sim in sims:
            sim.step()
        assert sims[0].energy() <= most * (1.0 + 1e-9)
        assert overlap(sims[0]) < OPEN * RADIUS
        assert np.array_equal(sims[2].position, sims[0].position[order])
        if k == 0:
            assert np.allclose(sims[1].velocity, sims[0].velocity * mirror, rtol=0, atol=1e-8)
