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


"""Piles: what rests on each other stays at rest, and what is poured comes to rest."""

import numpy as np
import pytest
from small_scenes import G, plane, simulate

pytestmark = pytest.mark.plain

RADIUS, DT = 0.02, 1 / 240


def pile(position, *, radius=RADIUS, mass=1.0, restitution=0.3, friction=0.3, colliders=None,
         velocity=(0.0, 0.0, 0.0), **keys):
    """Simulate balls that fall on a floor, or on other colliders."""
    return simulate([plane()] if colliders is None else colliders, position, velocity, dt=DT,
                    particles={'radius': radius, 'mass': mass},
                    pairs={'restitution': restitution}, friction={'dry': friction},
                    restitution=restitution, **keys)


def column(count, radius=RADIUS):
    """Balls on top of each other, (count, 3)."""
    position = np.zeros((count, 3))
    position[:, 2] = radius + 2 * radius * np.arange(count)
    return position


def pyramid(wide):
    """Layers of balls in the hollows of the layer below, on a square of `wide` balls a side."""
    places = []
    for layer in range(wide):
        side = 2 * RADIUS * (np.arange(wide - layer) + 0.5 * layer)
        x, y = np.meshgrid(side, side)
        z = np.full(x.size, RADIUS + np.sqrt(2.0) * RADIUS * layer)
        places.append(np.stack([x.ravel(), y.ravel(), z], axis=1))
    return np.concatenate(places)


def overlap(sim, radius=RADIUS):
    """Deepest overlap of a pair, as a share of the smaller radius."""
    x, r = sim.position, np.broadcast_to(radius, len(sim.position))
    distance = np.linalg.norm(x[:, None] - x, axis=2) + np.diag(np.full(len(x), np.inf))
    depth = r[:, None] + r - distance
    return float((depth / np.minimum(r[:, None], r)).max())


def fastest(sim):
    """Largest speed of a particle."""
    return float(np.linalg.norm(sim.velocity, axis=1).max())


@pytest.mark.parametrize('method', ['collision_then_contact', 'second_order_contact'])
@pytest.mark.parametrize('flight', ['ballistic', 'symplectic_euler'])
def test_two_balls_rest_on_each_other(method, flight):
    """A ball on a ball: what is left of the first step fades away."""
    start = column(2)
    sim = pile(start, restitution=0.5, method=method, flight=flight)
    sim.step(50)
    assert np.abs(sim.position - start).max() < 1e-7
    assert fastest(sim) < 1e-12


@pytest.mark.parametrize('method', ['single_pass', 'multi_pass'])
@pytest.mark.parametrize('flight', ['ballistic', 'symplectic_euler'])
def test_two_balls_on_a_floor_without_a_collision_stage(method, flight):
    """Lower balls have g dt / 2 there for each ball that they carry; nobody sinks in."""
    start = column(2)
    sim = pile(start, restitution=0.0, method=method, flight=flight)
    sim.step(200)
    assert np.abs(sim.position - start).max() < 1e-3 * RADIUS
    assert fastest(sim) < 1.01 * G * DT


def test_column_comes_to_rest_exactly():
    """Ten balls on top of each other end where they were, to rounding."""
    start = column(10)
    sim = pile(start)
    sim.step(40)
    assert overlap(sim) < 1e-3
    sim.step(160)
    assert np.abs(sim.position - start).max() < 1e-12
    assert fastest(sim) < 1e-12


def test_support_carries_the_weight_of_the_column():
    """The contact of the lowest ball with the floor has the impulse of the whole weight."""
    sim = pile(column(8), mass=2.0)
    sim.step(100)
    contacts = sim.contacts
    assert contacts.particle.tolist() == [0]
    assert np.allclose(contacts.impulse, [[0, 0, 8 * 2.0 * G * DT]], rtol=1e-9, atol=1e-12)


def test_heavy_ball_on_a_light_one():
    """A mass a hundred times that of the ball below comes to rest on it."""
    start = column(2)
    sim = pile(start, mass=[1.0, 100.0])
    sim.step(200)
    assert np.abs(sim.position - start).max() < 1e-3 * RADIUS
    assert fastest(sim) < 1e-9


@pytest.mark.parametrize('radii', [(1.0, 1.0), (100.0, 1.0)])
def test_ball_rests_on_one_of_infinite_mass_on_the_floor(radii):
    """The floor carries the lower ball before the upper one follows it down."""
    large, small = RADIUS * np.array(radii)
    start = np.array([[0.0, 0.0, large], [0.0, 0.0, 2.0 * large + small]])
    sim = pile(start, radius=[large, small], mass=[np.inf, 1.0])
    sim.step(200)
    assert np.abs(sim.position - start).max() < 1e-12
    assert fastest(sim) < 1e-12


@pytest.mark.parametrize('masses', [(1.0, 1000.0), (1000.0, 1.0), (1.0, 1000.0, 1.0)])
def test_masses_of_ratio_a_thousand(masses):
    """Heavy balls on light ones and light on heavy ones come to rest where they are."""
    start = column(len(masses))
    sim = pile(start, mass=masses)
    sim.step(200)
    assert np.abs(sim.position - start).max() < 1e-3 * RADIUS
    assert fastest(sim) < 1e-9


def test_wedge_between_two_walls():
    """Two balls on each other in a groove: each wall carries its share of both weights."""
    normals = np.array([[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0]]) / np.sqrt(2.0)
    walls = [plane(normal, name=f'wall{k}') for k, normal in enumerate(normals)]
    start = column(2) + [0.0, 0.0, (np.sqrt(2.0) - 1.0) * RADIUS]
    sim = pile(start, mass=[1.0, 3.0], friction=0.0, colliders=walls)
    sim.step(100)
    contacts = sim.contacts
    assert contacts.collider.tolist() == [0, 1]
    assert np.allclose(contacts.impulse, 4.0 * G * DT / np.sqrt(2.0) * normals, rtol=1e-9)
    assert np.abs(sim.position - start).max() < 1e-12
    assert fastest(sim) < 1e-12


def test_a_ball_with_room_between_a_floor_and_a_roof_of_balls_comes_to_rest():
    """Whom the floor carries does not collide with it as well: no bounce feeds itself."""
    held = np.array([[-1.0, 0.0, 2.6], [1.0, 0.0, 2.6]]) * RADIUS
    sim = pile(np.concatenate([[[0.0, 0.0, 1.005 * RADIUS]], held]), mass=[1.0, np.inf, np.inf],
               restitution=0.5, gravity=(0.3, 0.0, -G))
    sim.velocity[0] = [0.0, 0.0, 0.1]
    sim.velocity[1:] = 0.0
    speeds = []
    for _ in range(120):
        sim.step()
        sim.position[1:], sim.velocity[1:] = held, 0.0
        speeds.append(np.linalg.norm(sim.velocity[0]))
    assert max(speeds) < 0.2
    assert max(speeds[-20:]) < 1e-6


def test_free_cluster_falls_as_one():
    """Touching balls in free fall do nothing to each other."""
    sim = pile(column(3) + [0, 0, 5], colliders=[plane(point=(0, 0, -1e9))])
    sim.step(60)
    assert np.allclose(sim.velocity, [0, 0, -60 * G * DT], rtol=1e-13)
    assert sim.counters['pair_collisions'] == sim.counters['pair_contacts'] == 0


def test_light_ball_bounces_off_a_resting_one():
    """Contacts do not eat restitution: 0.8 of the speed of the fall, at many phases of a step."""
    for height in np.linspace(0.1, 0.12, 7):
        sim = pile([[0, 0, RADIUS], [0, 0, 3 * RADIUS + height]], mass=[np.inf, 1.0],
                   restitution=0.8)
        speed = 0.0
        for _ in range(60):
            sim.step()
            speed = max(speed, sim.velocity[1, 2])
        assert abs(speed - 0.8 * np.sqrt(2 * G * height)) < 2 * G * DT


@pytest.mark.parametrize('share', [0.1, 0.5, 0.9])
def test_slow_balls_keep_their_restitution(share):
    """Two that approach slower than gravity makes it in a step collide: there is no threshold."""
    speed = 0.5 * share * G * DT
    sim = pile([[-1.001 * RADIUS, 0, 5], [1.001 * RADIUS, 0, 5]], restitution=0.8,
               velocity=[[speed, 0, 0], [-speed, 0, 0]])
    sim.step(60)
    assert np.allclose(sim.velocity[:, 0], [-0.8 * speed, 0.8 * speed], rtol=1e-12)
    assert sim.counters['pair_collisions'] == 1


@pytest.mark.parametrize('speed', [0.01, 1.0])
def test_cradle_on_a_floor(speed):
    """Of five balls that lie in a row only the last one leaves, also if they are slow."""
    position = np.zeros((5, 3))
    position[:, 0], position[:, 2] = 2 * RADIUS * np.arange(5), RADIUS
    position[0, 0] -= 20.5 * DT * speed
    sim = pile(position, restitution=1.0, friction=0.0,
               velocity=[[speed, 0, 0]] + [[0, 0, 0]] * 4)
    sim.step(40)
    assert np.allclose(sim.velocity / speed, [[0, 0, 0]] * 4 + [[1, 0, 0]], rtol=0, atol=1e-12)


def test_friction_holds_a_ball_on_an_inclined_pair():
    """Two balls side by side on a slope stick with enough friction, and slide without."""
    slope = 0.2
    normal = np.array([-np.sin(slope), 0.0, np.cos(slope)])
    along = np.array([np.cos(slope), 0.0, np.sin(slope)])
    start = np.array([RADIUS * normal, RADIUS * normal + 2 * RADIUS * along])
    held = pile(start, friction=0.5, colliders=[plane(normal)])
    slid = pile(start, friction=0.0, colliders=[plane(normal)])
    for sim in (held, slid):
        sim.step(120)
    assert np.abs(held.position - start).max() < 1e-3 * RADIUS
    distance = 0.5 * G * np.sin(slope) * held.time ** 2
    assert np.allclose(slid.position - start, -distance * along, rtol=1e-6, atol=1e-6)


@pytest.mark.jit
def test_cannonballs():
    """A pyramid of 55 balls with friction stays."""
    start = pyramid(5)
    sim = pile(start, friction=0.5)
    sim.step(240)
    assert np.abs(sim.position - start).max() < 0.01 * RADIUS
    assert overlap(sim) < 1e-3
    assert fastest(sim) < 1e-6


def poured(count, spread=1.0, density=False):
    """Balls above a floor between four walls: places, radii, masses and colliders."""
    random = np.random.default_rng(0)
    radius = RADIUS * spread ** -random.random(count)
    wide = round(0.9 * count ** (1 / 3))
    site, pitch = np.arange(count), 2.6 * RADIUS
    position = np.stack([site % wide, site // wide % wide, site // wide ** 2], axis=1) * pitch
    position += 0.5 * pitch + random.uniform(-0.25, 0.25, (count, 3)) * RADIUS
    side = wide * pitch
    walls = [plane(), plane((1, 0, 0), name='west'), plane((0, 1, 0), name='south'),
             plane((-1, 0, 0), (side, 0, 0), name='east'),
             plane((0, -1, 0), (0, side, 0), name='north')]
    mass = (radius / RADIUS) ** 3 if density else np.ones(count)
    return position, radius, mass, walls


@pytest.mark.jit
def test_heap_with_friction_rests_and_stays():
    """Nobody in a heap of 300 is faster than 1e-4 m/s after 4 s, nor moves after that."""
    position, _, _, walls = poured(300)
    sim = pile(position, restitution=0.5, colliders=walls, contacts=False)
    sim.step(960)
    before, speeds = sim.position.copy(), []
    for _ in range(24):
        sim.step(10)
        speeds.append(fastest(sim))
    assert max(speeds) < 1e-4
    assert np.abs(sim.position - before).max() < 1e-3 * RADIUS
    assert overlap(sim) < 1e-3


@pytest.mark.jit
def test_heap_without_friction_rests():
    """The median speed in a heap of 200 without friction is below 1e-4 m/s after 4 s."""
    position, _, _, walls = poured(200)
    sim = pile(position, friction=0.0, colliders=walls, contacts=False)
    sim.step(960)
    assert np.median(np.linalg.norm(sim.velocity, axis=1)) < 1e-4
    assert overlap(sim) < 0.01


@pytest.mark.jit
@pytest.mark.parametrize('detection', ['end_of_step', 'trajectory'])
@pytest.mark.parametrize('spread', [1.0, 4.0])
def test_heap_comes_to_rest(spread, detection):
    """Poured balls, also of different sizes, come to rest with overlaps below 1 %."""
    position, radius, mass, walls = poured(200, spread, density=True)
    sim = pile(position, radius=radius, mass=mass, colliders=walls, contacts=False,
               stepping={'detection': detection})
    sim.step(480)
    before = sim.position.copy()
    sim.step(120)
    assert overlap(sim, radius) < 0.01
    assert np.median(np.linalg.norm(sim.velocity, axis=1)) < 1e-3
    assert np.median(np.abs(sim.position - before)) < 0.01 * RADIUS
    assert sim.clearance().min() > -1e-12
    assert sim.counters['unplaced'] == sim.counters['undecided'] == 0
