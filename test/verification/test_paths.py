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

"""Impacts along the path: thin walls, blades, rooms; and where it must change nothing."""

from math import cos, pi, sin

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import (box, EPSILON, FAR, FIRST_ORDER, incline, METHODS, order, plane,
                          root_mean_square, simulate, sphere, STAGED, swinging_wall)

pytestmark = pytest.mark.plain

every_method = pytest.mark.parametrize('method', METHODS)
WEIGHTLESS = (0.0, 0.0, 0.0)
PERIOD = 2.13913760055868884        # T42: 4 sqrt(R / g) K(sin(1/2)), R = 1, released at 1 rad


def follow_paths(colliders, position, velocity=(0.0, 0.0, 0.0), *, stepping=None, **keys):
    """Make a simulation that finds impacts along the path."""
    return simulate(colliders, position, velocity,
                    stepping={'detection': 'trajectory', **(stepping or {})}, **keys)


@every_method
@pytest.mark.parametrize('ratio', [1.0, 1e3, 1e6, 1e9])
@pytest.mark.parametrize('eps', [0.0, 0.5, 1.0])
def test_thin_wall_is_never_missed(method, ratio, eps):
    """T73: v dt / h up to 1e9: everybody is reflected, with the speed eps v, on the near side."""
    count, speed, dt = 1000, 1e3, 1e-2
    thickness = speed * dt / ratio
    start = np.zeros((count, 3))
    start[:, 2] = 0.5 * thickness + speed * dt * (np.arange(count) + 0.5) / count
    for side in (1.0, -1.0):
        sim = follow_paths([box((9.0, 9.0, thickness)), *FAR], side * start,
                           (0.0, 0.0, -side * speed), gravity=WEIGHTLESS, restitution=eps, dt=dt,
                           method=method)
        sim.step()
        assert sim.counters['collisions'] == len(start) or eps == 0.0
        assert_allclose(sim.velocity[:, 2], side * eps * speed, rtol=4 * EPSILON)
        assert (side * sim.position[:, 2] >= 0.5 * thickness * (1.0 - 4 * EPSILON)).all()
        assert sim.counters['fail_safes'] == sim.counters['undecided'] == 0
        sim.step(10)
        assert (side * sim.position[:, 2] >= 0.5 * thickness * (1.0 - 4 * EPSILON)).all()


def first_cut(thickness, angle, start, move):
    """First time at which a blade, 2 m long about the z axis, cuts a path in the plane."""
    tau = np.linspace(0.0, 1.0, 2_000_001)

    def depth(tau):
        x, y = start[0] + tau * move[0], start[1] + tau * move[1]
        c, s = np.cos(angle * tau), np.sin(angle * tau)
        return np.maximum(np.abs(c * x + s * y) - 1.0, np.abs(c * y - s * x) - 0.5 * thickness)
    first = np.argmax(depth(tau) < 0.0)
    low, high = tau[first - 1], tau[first]
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if depth(middle) < 0.0 else (middle, high)
    return high


def blade_normal(thickness, turn, place):
    """Give the normal of the blade, turned by an angle, at the place that it cuts."""
    along, across = np.array((cos(turn), sin(turn))), np.array((-sin(turn), cos(turn)))
    x, y = place @ along, place @ across
    n = np.sign(y) * across if abs(y) - 0.5 * thickness > abs(x) - 1.0 else np.sign(x) * along
    return (*n, 0.0)


@every_method
@pytest.mark.parametrize(('start', 'move'), [
    ((0.5, 0.5), (0.0, 0.0)), ((-0.2, 0.5), (0.1, -0.2)), ((3.0, 0.3), (-4.0, 0.0)),
    ((3.0, -0.7), (-4.0, 0.5)), ((0.0, -9.0), (0.3, 9.0))])
@pytest.mark.jit
def test_blade(method, start, move):
    """T74: 50 rad in a step: the hit is where a dense search finds the first cut."""
    dt, angle, thickness = 0.1, 50.0, 1e-3
    blade = box((2.0, thickness, 1.0), motion={'angular_velocity': [0.0, 0.0, angle / dt]})
    sim = follow_paths([blade, *FAR], (*start, 0.0), (move[0] / dt, move[1] / dt, 0.0),
                       gravity=WEIGHTLESS, restitution=1.0, dt=dt, method=method)
    sim.step()
    tau = first_cut(thickness, angle, start, move)
    place = np.array(start) + tau * np.array(move)
    assert_allclose(sim.contacts.normal[0], blade_normal(thickness, angle * tau, place), atol=1e-9)
    if method in STAGED:        # the others note where the step ends
        assert_allclose(sim.contacts.point[0, :2], place, atol=1e-9)
    assert sim.counters['collisions'] >= 1
    assert sim.counters['undecided'] == 0


@every_method
def test_blade_by_angle_arithmetic(method):
    """T74: a particle at rest at the polar angle a is hit at a - h / (2 rho), not turns later."""
    dt, rate, thickness, rho = 0.1, 500.0, 1e-3, 0.5
    blade = box((2.0, thickness, 1.0), motion={'angular_velocity': [0.0, 0.0, rate]})
    for place in (0.4, 2.0, 3.5, 6.0):
        start = np.array((rho * cos(place), rho * sin(place), 0.0))
        sim = follow_paths([blade, *FAR], start, gravity=WEIGHTLESS, restitution=1.0, dt=dt,
                           method=method)
        sim.step()
        at_hit = place % pi - np.arcsin(0.5 * thickness / rho)
        normal = np.array((-sin(at_hit), cos(at_hit), 0.0)) * (1.0 if place < pi else -1.0)
        assert_allclose(sim.contacts.normal[0], normal, atol=1e-9)
        if method in STAGED:
            assert_allclose(sim.contacts.point[0], start, atol=1e-12)


@every_method
@pytest.mark.parametrize('eps', [0.0, 0.5, 1.0])
@pytest.mark.parametrize('wall', [plane, box])
def test_moving_wall(method, eps, wall):
    """T23: v' = V - eps (v - V)."""
    ground = wall(motion={'linear_velocity': [0.0, 0.0, 1.5]})
    sim = follow_paths([ground, *FAR], (0.0, 0.0, 0.8), (0.0, 0.0, -4.0), gravity=WEIGHTLESS,
                       restitution=eps, method=method)
    sim.step(60)
    assert sim.velocity[0, 2] == pytest.approx(1.5 - eps * (-4.0 - 1.5), abs=64 * EPSILON)
    assert sim.clearance()[0] >= -4 * EPSILON


@every_method
@pytest.mark.jit
def test_moving_wall_bounce_is_first_order(method):
    """T23: place and velocity after a bounce from a wall that oscillates."""
    eps = 0.5
    wall, start, _, place = swinging_wall(eps)
    steps, errors = [0.00507, 0.002511, 0.001253, 0.0006251, 0.0003127], []
    for dt in steps:
        sim = follow_paths([wall, *FAR], start, (0.0, 0.0, -2.0),
                           dt=dt, gravity=WEIGHTLESS, restitution=eps, method=method)
        sim.advance(0.4)
        exact = place(sim.time)
        errors.append(root_mean_square(sim.position[:, 2] - exact))
    assert order(steps, errors) == pytest.approx(1.0, abs=0.15)


@every_method
def test_sliding_down_an_incline(method):
    """T14: mu = 0.2 at 30 degrees: a = g (sin - mu cos), exact in all methods."""
    sim = follow_paths([incline(pi / 6), *FAR], (0.0, 0.0, 0.0), friction={'dry': 0.2},
                       method=method)
    sim.step(240)
    down = np.array([-cos(pi / 6), 0.0, -sin(pi / 6)])
    assert sim.position[0] @ down == pytest.approx(3.20585815777493138 / 2, abs=240 * EPSILON)


@every_method
@pytest.mark.jit
def test_block_on_an_incline(method):
    """T13, T16: no creep; eps matters not beside a collision stage, else it must be 0."""
    for eps in (0.0, 0.5, 1.0) if method in STAGED else (0.0, ):
        sim = follow_paths([incline(pi / 6), *FAR], (0.0, 0.0, 0.0), friction={'dry': 1.0},
                           restitution=eps, method=method)
        sim.step(100_000)
        assert_array_equal(sim.position[0], 0.0)
        if method in STAGED:
            assert_array_equal(sim.velocity[0], 0.0)


def sphere_top(count, method):
    """T39: distance from the exact place after 1.2 s, from rest on a frictionless ball."""
    sim = follow_paths([sphere(), *FAR], (sin(0.1), 0.0, cos(0.1)), dt=1.2 / count, method=method)
    sim.step(count)
    assert sim.counters['fail_safes'] == sim.counters['undecided'] == 0
    return np.linalg.norm(sim.position[0] - (1.243930772593345, 0.0, -0.316542575433447))


def bowl(count, method):
    """T42: distance from the release after a period in a frictionless bowl."""
    start = (sin(1.0), 0.0, -cos(1.0))
    sim = follow_paths([sphere(inside=True), *FAR], start, dt=PERIOD / count, method=method)
    sim.step(count)
    assert sim.counters['fail_safes'] == sim.counters['undecided'] == 0
    return np.linalg.norm(sim.position[0] - start)


@pytest.mark.parametrize('method', FIRST_ORDER)
@pytest.mark.parametrize('error', [sphere_top, bowl])
@pytest.mark.jit
def test_curved_surfaces_are_first_order(method, error):
    """T39, T42: order 1, the mean over a few steps each: where a step ends matters by chance."""
    counts = np.array([1031, 2053, 4099, 8209, 16411])
    errors = [root_mean_square([error(int(count * (1.0 + 0.02 * k)), method) for k in range(8)])
              for count in counts]
    assert order(1.0 / counts, errors) == pytest.approx(1.0, abs=0.15)
    assert errors[0] < 0.02


BELT = box((40.0, 40.0, 2.0), (0.0, 0.0, -1.0), motion={'linear_velocity': [1.0, 0.0, 0.0]})
TURNTABLE = box((2.0, 2.0, 1.0), (0.0, 0.0, -0.5),
                motion={'angular_velocity': [0.0, 0.0, 2.0 * pi]})
LIFT = box((2.0, 2.0, 1.0), (0.0, 0.0, -0.5), motion={'linear_velocity': [0.3, 0.2, 1.0]})
SLOPE = box((40.0, 40.0, 1.0), (0.5 * sin(0.3), 0.0, -0.5 * cos(0.3)),
            orientation=(0.0, -sin(0.15), 0.0, cos(0.15)),
            motion={'linear_velocity': [0.0, 1.0, 0.5]})


@every_method
@pytest.mark.parametrize(('support', 'start', 'velocity', 'mu'), [
    (BELT, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.4),
    (BELT, (0.0, 0.0, 0.0), (0.0, 2.0, 0.0), 0.1),
    (BELT, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0),
    (TURNTABLE, (0.1, 0.0, 0.0), (0.0, 0.2 * pi, 0.0), 5.0),
    (TURNTABLE, (0.1, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0),
    (TURNTABLE, (0.2, 0.0, 0.0), (0.1, 0.1, 0.0), 0.3),
    (LIFT, (0.1, 0.0, 0.0), (0.3, 0.2, 1.0), 0.5),
    (SLOPE, (0.0, 0.0, 0.0), (0.0, 1.0, 0.5), 1.0),
    (SLOPE, (0.0, 0.0, 0.0), (0.0, 0.0, 0.5), 0.1),
])
def test_in_contact_as_at_the_end_of_the_step(method, support, start, velocity, mu):
    """Rest and slide on boxes that move and turn: the same as with the test at the end."""
    states = []
    for detection in ('trajectory', 'end_of_step'):
        sim = simulate([support, *FAR], start, velocity, friction={'dry': mu}, dt=1 / 256,
                       method=method, stepping={'detection': detection})
        sim.step(256)
        assert sim.counters['undecided'] == sim.counters['fail_safes'] == 0
        states.append((sim.position[0].copy(), sim.velocity[0].copy()))
    assert_allclose(states[0][0], states[1][0], rtol=0.0, atol=1e-12)
    assert_allclose(states[0][1], states[1][1], rtol=0.0, atol=1e-10)


@every_method
def test_turntable_of_ten_revolutions(method):
    """Fact 7 on a box: with the chord of the material point the radius is kept to rounding."""
    sim = follow_paths([TURNTABLE, *FAR], (0.1, 0.0, 0.0), (0.0, 0.2 * pi, 0.0), dt=1 / 64,
                       friction={'dry': 5.0}, method=method)
    sim.step(640)
    assert_allclose(sim.position[0], (0.1, 0.0, 0.0), atol=1e-13)


@every_method
@pytest.mark.parametrize('wall', [plane, box])
@pytest.mark.parametrize('gap', [1.0, 1e-3])
def test_moving_together_is_no_hit(method, wall, gap):
    """T77: particle and wall at 1e8 m/s: nothing touches."""
    speed = 1e8
    ground = wall(motion={'linear_velocity': [0.0, 0.0, speed]})
    sim = follow_paths([ground, *FAR], (0.0, 0.0, gap + 0.5 * (wall == box)), (0.0, 0.0, speed),
                       gravity=WEIGHTLESS, dt=1e-3, method=method)
    sim.step(1000)
    assert sim.counters == dict.fromkeys(sim.counters, 0)
    assert sim.velocity[0, 2] == speed
    assert sim.clearance()[0] == pytest.approx(gap, abs=1000 * EPSILON * speed)


def room(thickness, top=True, **keys):
    """Walls that close a room of 2 m edge length, a box each; without `top` a cup."""
    walls = []
    for axis in range(3):
        for side in (-1.0, 1.0)[:1 if axis == 2 and not top else 2]:
            size, position = np.full(3, 2.0 + 2.0 * thickness), np.zeros(3)
            size[axis], position[axis] = thickness, side * (1.0 + 0.5 * thickness)
            walls.append(box(size.tolist(), position.tolist(), f'wall_{len(walls)}', **keys))
    return walls


def shots(speed, count=200, seed=1):
    """Particles in the room with a speed in all directions."""
    random = np.random.default_rng(seed)
    velocity = random.normal(size=(count, 3))
    velocity *= speed / np.linalg.norm(velocity, axis=1)[:, np.newaxis]
    return random.uniform(-0.9, 0.9, (count, 3)), velocity


@every_method
@pytest.mark.parametrize('eps', [1.0, 0.5])
@pytest.mark.parametrize('thickness', [1e-3, 1e-9])
@pytest.mark.parametrize('speed', [1.0, 1e3, 1e6])
@pytest.mark.parametrize('radius', [0.0, 0.05])
@pytest.mark.jit
def test_nobody_leaves_a_room(method, eps, thickness, speed, radius):
    """Out of six thin walls nobody gets, at up to v dt / h = 4e12, in 300 steps."""
    start, velocity = shots(speed)
    sim = follow_paths([*room(thickness), *FAR], start, velocity, restitution=eps, method=method,
                       friction={'dry': 0.1}, particles={'radius': radius})
    for _ in range(100):
        sim.step(3)
        assert (np.abs(sim.position) <= 1.0 - radius + 8 * EPSILON).all()
    assert sim.counters['unplaced'] == sim.counters['undecided'] == 0
    assert (sim.clearance() >= -8 * EPSILON).all()


@every_method
@pytest.mark.parametrize('speed', [1.0, 1e4])
@pytest.mark.parametrize('carried', [1.0, 1e4])
@pytest.mark.jit
def test_nobody_leaves_a_room_that_moves(method, speed, carried):
    """The same where the room is carried along, and the particles start with any velocity."""
    start, velocity = shots(speed)
    shift = carried * np.array((1.0, 0.5, -0.3))
    walls = room(1e-4, motion={'linear_velocity': shift.tolist()})
    sim = follow_paths([*walls, *FAR], start, velocity, restitution=0.5, method=method)
    for _ in range(100):
        sim.step(3)
        inside = sim.position - shift * sim.time
        assert (np.abs(inside) <= 1.0 + 16 * EPSILON * (1.0 + carried * sim.time)).all()
    assert sim.counters['undecided'] == 0


@every_method
@pytest.mark.parametrize('speed', [1.0, 1e3])
@pytest.mark.parametrize('thickness', [1e-3, 1e-9])
@pytest.mark.jit
def test_nobody_gets_through_a_cup(method, speed, thickness):
    """In a cup without a top nobody who starts downwards gets out, and nobody from below in."""
    start, velocity = shots(speed)
    start[:, 2] -= 0.5 * (start[:, 2] + 1.0)
    velocity[:, 2] = -np.abs(velocity[:, 2])
    cup = [*room(thickness, top=False), *FAR]
    sim = follow_paths(cup, start, velocity, restitution=0.0, method=method)
    below = start - (0.0, 0.0, 1.5)
    other = follow_paths(cup, below, -velocity, gravity=WEIGHTLESS, restitution=0.5,
                         method=method)
    assert (below[:, 2] < -1.0 - thickness).all()
    for _ in range(100):
        sim.step(3)
        other.step(3)
        assert (np.abs(sim.position[:, :2]) <= 1.0 + 8 * EPSILON).all()
        assert (sim.position[:, 2] >= -1.0 - 8 * EPSILON).all()
        column = (np.abs(other.position[:, :2]) < 1.0).all(axis=1)
        assert not (column & (np.abs(other.position[:, 2]) <= 1.0)).any()


def random_collider(random, index, speed):
    """Give a shape of any size that moves and turns at random."""
    kind = ('sphere', 'box', 'capsule', 'cylinder')[random.integers(4)]
    axis = random.normal(size=4)
    sizes = {'sphere': {'radius': random.uniform(0.05, 0.5)},
             'box': {'size': (10.0 ** random.uniform(-4.0, 0.0, 3)).tolist()}}
    size = sizes.get(kind, {'radius': random.uniform(0.01, 0.3),
                            'length': random.uniform(0.01, 1.0)})
    return {'name': f'c{index}', 'shape': kind, **size,
            'position': (2.0 * random.normal(size=3)).tolist(),
            'orientation': (axis / np.linalg.norm(axis)).tolist(),
            'motion': {'linear_velocity': (speed * random.normal(size=3)).tolist(),
                       'angular_velocity': (speed * random.normal(size=3)).tolist()}}


@every_method
@pytest.mark.parametrize('seed', range(12))
@pytest.mark.jit
def test_starts_outside_ends_outside(method, seed):
    """Among shapes that move and turn, who is outside before a step is outside after it."""
    random = np.random.default_rng(seed)
    speed = 10.0 ** random.uniform(-1.0, 2.0)
    colliders = [random_collider(random, k, speed) for k in range(6)]
    sim = follow_paths([*colliders, *FAR], random.normal(size=(500, 3)) * 2.0,
                       10.0 ** random.uniform(-1.0, 3.0) * random.normal(size=(500, 3)),
                       restitution=random.choice((0.0, 0.5, 1.0)), method=method,
                       friction={'dry': 0.3}, dt=1 / 60)
    for _ in range(40):
        before, unplaced = sim.clearance() >= 0.0, sim.counters['unplaced']
        sim.step()
        inside = before & (sim.clearance() < -1e-12 * (1.0 + np.abs(sim.position).max(axis=1)))
        assert inside.sum() <= sim.counters['unplaced'] - unplaced
        assert np.isfinite(sim.position).all() and np.isfinite(sim.velocity).all()
