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

"""Particles that collide with each other by the event-driven method, against known answers."""

from copy import deepcopy
from decimal import Decimal, localcontext
from math import pi, sqrt
import pickle

from collision_sim import Scene, Simulation
import numpy as np
import pytest
from small_scenes import G, plane

REST = {'restitution': 1.0}
FALL = (0.0, 0.0, -G)


def exact(position, velocity=(0.0, 0.0, 0.0), *, radius=0.5, mass=1.0, restitution=1.0,
          gravity=(0.0, 0.0, 0.0), dt=0.01, colliders=(), method='exact', ledger=False, **keys):
    """Simulate balls that collide by the event-driven method."""
    return Simulation(Scene.from_dict({
        'gravity': list(gravity),
        'particles': {'position': np.array(position, dtype=float), 'velocity': velocity,
                      'radius': radius, 'mass': mass},
        'restitution': restitution, 'pairs': {}, 'colliders': list(colliders),
        'stepping': {'dt': dt, 'method': method}, **keys}), ledger=ledger)


def gaps(sim):
    """Gaps between all pairs [m]."""
    x, radius = sim.position, np.broadcast_to(sim.scene.particles.radius, len(sim.position))
    i, j = np.triu_indices(len(x), 1)
    return np.linalg.norm(x[i] - x[j], axis=1) - radius[i] - radius[j]


def hits(sim):
    """Collisions of particles with each other, and of all kinds."""
    return sim.counters['pair_collisions'], (sim.counters['pair_collisions']
                                             + sim.counters['collisions'])


def blocks(ratio):
    """Hits of Galperin's blocks and their speeds at the end, the heavy one first, to 50 digits."""
    with localcontext() as context:
        context.prec = 50
        heavy, light, m, count = Decimal(-1), Decimal(0), Decimal(ratio), 0
        while heavy < light or light < 0:
            if heavy < light:
                heavy, light = (((m - 1) * heavy + 2 * light) / (m + 1),
                                ((1 - m) * light + 2 * m * heavy) / (m + 1))
            else:
                light = -light
            count += 1
    return count, float(heavy), float(light)


@pytest.mark.parametrize(('power', 'count'), [(0, 3), (1, 31), (2, 314),
                                              pytest.param(3, 3141, marks=pytest.mark.jit)])
def test_galperins_blocks(power, count):
    """G. Galperin (2003): the hits of a block against a wall spell the digits of pi."""
    ratio = 100 ** power
    sim = exact([[2, 0, 0], [1, 0, 0]], [[-1, 0, 0], [0, 0, 0]], radius=0.1, mass=[ratio, 1.0],
                colliders=[plane((1, 0, 0))], dt=0.25)
    sim.advance(20.0)
    expected, heavy, light = blocks(ratio)
    assert hits(sim)[1] == expected == count
    assert np.allclose(sim.velocity[:, 0], [heavy, light], rtol=0, atol=1e-11)
    assert not sim.velocity[:, 1:].any()


@pytest.mark.parametrize('gap', [0.0, 1e-12, 1e-3])
def test_newtons_cradle(gap):
    """T67: one in, one out."""
    sim = exact([[-3, 0, 0], *([k * (1 + gap), 0, 0] for k in range(4))],
                [[1, 0, 0]] + [[0, 0, 0]] * 4, dt=0.5)
    sim.advance(5.0)
    assert np.allclose(sim.velocity, [[0, 0, 0]] * 4 + [[1, 0, 0]], rtol=0, atol=1e-15)
    assert hits(sim) == (4, 4)


def test_two_in_two_out():
    """A cradle, with two that come in together."""
    sim = exact([[-4, 0, 0], [-3, 0, 0], [0, 0, 0], [1, 0, 0], [2, 0, 0]],
                [[1, 0, 0]] * 2 + [[0, 0, 0]] * 3, dt=0.5)
    sim.advance(5.0)
    assert np.allclose(sim.velocity[:, 0], [0, 0, 0, 1, 1], rtol=0, atol=1e-14)


def rack(rows, gap):
    """Triangle of balls of radius 0.5, and one before it."""
    return [[-3.0, 0.0, 0.0]] + [
        [row * sqrt(0.75) * (1 + gap), (k - row / 2) * (1 + gap), 0.0]
        for row in range(rows) for k in range(row + 1)]


@pytest.mark.parametrize('gap', [0.0, 1e-4, 1e-2])
def test_break_keeps_its_symmetry(gap):
    """15 balls in a triangle, struck along the axis."""
    x = rack(5, gap)
    sim = exact(x, [[10.0, 0, 0]] + [[0, 0, 0]] * 15, dt=0.05)
    sim.advance(2.0)
    mirrored = sim.position * (1, -1, 1)
    off = np.linalg.norm(sim.position[:, None] - mirrored, axis=2).min(axis=1)
    assert off.max() <= 1e-12
    assert sim.energy() == pytest.approx(50.0, rel=1e-14)
    assert sim.counters['pair_collisions'] > 9


def by_brute_force(x, v, radius, mass, eps, g, duration):
    """Go from hit to hit, each the first of all pairs."""
    x, v, t, count = x.copy(), v.copy(), 0.0, 0
    i, j = np.triu_indices(len(x), 1)
    size = radius[i] + radius[j]
    while True:
        r, w = x[i] - x[j], v[i] - v[j]
        b, c, ww = (r * w).sum(1), (r * r).sum(1) - size ** 2, (w * w).sum(1)
        room = b * b - ww * c
        meets = (b < 0.0) & (room > 0.0)
        when = np.full(len(i), np.inf)
        when[meets] = np.maximum(c[meets] / (np.sqrt(room[meets]) - b[meets]), 0.0)
        k = int(np.argmin(when))
        h = min(when[k], duration - t)
        x, v, t = x + h * v + 0.5 * h * h * g, v + h * g, t + h
        if t >= duration:
            return x, v, count
        one, two = i[k], j[k]
        n = x[one] - x[two]
        n /= np.linalg.norm(n)
        push = -(1 + eps) * ((v[one] - v[two]) @ n) / (1 / mass[one] + 1 / mass[two])
        v[one] += push / mass[one] * n
        v[two] -= push / mass[two] * n
        count += 1


@pytest.mark.parametrize('seed', range(40))
def test_no_hit_is_missed(seed):
    """Small gases of any radii and masses that fall together, against a search over all pairs."""
    random = np.random.default_rng(seed)
    count = int(random.integers(2, 14))
    radius = random.uniform(0.02, 0.3, count) ** random.uniform(1.0, 2.0)
    mass, places = random.uniform(0.1, 10.0, count), []
    while len(places) < count:
        place = random.uniform(-1.0, 1.0, 3)
        if all(np.linalg.norm(place - other) > radius[len(places)] + radius[k] + 1e-3
               for k, other in enumerate(places)):
            places.append(place)
    x = np.array(places)
    v = -2.0 * x + random.normal(0.0, 0.7, x.shape)
    eps, g = random.choice([1.0, 0.8, 0.5]), np.array(FALL) * random.choice([0.0, 1.0])
    sim = exact(x, v, radius=radius, mass=mass, restitution=eps, gravity=g,
                dt=float(random.choice([0.01, 0.1, 1.0])))
    sim.advance(1.0)
    places, speeds, found = by_brute_force(x, v, radius, mass, eps, g, 1.0)
    assert hits(sim) == (found, found)
    assert np.allclose(sim.position, places, rtol=0, atol=1e-10)
    assert np.allclose(sim.velocity, speeds, rtol=0, atol=1e-9)


def gas(count, packing=0.2, radius=0.05, seed=1, **keys):
    """Balls of random velocities on a lattice that is shaken, in a box around them."""
    random, rows = np.random.default_rng(seed), round(count ** (1 / 3))
    count = rows ** 3
    side = (count * 4 / 3 * pi * radius ** 3 / packing) ** (1 / 3)
    line = (np.arange(rows) + 0.5) * side / rows - side / 2
    x = np.array(np.meshgrid(line, line, line, indexing='ij')).reshape(3, -1).T
    x += random.uniform(-0.9, 0.9, x.shape) * (side / rows / 2 - radius)
    box = {'name': 'box', 'shape': 'box', 'size': [side] * 3, 'inside': True}
    return exact(x, random.normal(0.0, 1.0, x.shape), radius=radius, colliders=[box],
                 **keys), side


def test_gas_in_a_box():
    """T66: energy, no overlap, and the momentum is what the box has given."""
    sim, side = gas(27, ledger=True)
    before = sim.energy()
    sim.advance(0.5)
    assert sim.energy() == pytest.approx(before, rel=1e-13)
    assert hits(sim)[0] > 30
    assert gaps(sim).min() >= -1e-12 * 0.05
    assert np.abs(sim.position).max() <= side / 2 - 0.05 * (1 - 1e-12)
    total = sim.ledger.total
    assert abs(total.residual) <= 1e-12
    assert np.abs(total.momentum.residual).max() <= 1e-12


@pytest.mark.jit
def test_gas_of_many():
    """T66: 1e5 events change neither energy nor, without a box, momentum."""
    sim, _ = gas(10 ** 3, dt=0.1)
    x, v = sim.position.copy(), sim.velocity - sim.velocity.mean(axis=0)
    before = sim.energy()
    sim.advance(20.0)
    assert hits(sim)[0] > 1e5
    assert sim.energy() == pytest.approx(before, rel=1e-12)
    assert gaps(sim).min() >= -1e-12 * 0.05
    free = exact(x, v, radius=0.05, dt=0.1)
    free.advance(2.0)
    assert hits(free)[0] > 1000
    assert np.abs(free.momentum()).max() <= 1e-12 * len(x)


@pytest.mark.jit
def test_equation_of_state():
    """
    N. F. Carnahan, K. E. Starling (1969): p V / N k T = (1 + f + f^2 - f^3) / (1 - f)^3.

    The pressure is that on the middle of the walls, and the density that in the middle of the box:
    at walls, edges and corners there are more balls.
    """
    sim, side = gas(16 ** 3, packing=0.2, dt=0.1)
    sim.advance(2.0)
    inner, count, push, samples = side / 2 - 0.25, 0, 0.0, 100
    for _ in range(samples):
        sim.step()
        contacts = sim.contacts
        middle = np.sort(np.abs(contacts.point), axis=1)[:, 1] < inner
        push += np.abs(contacts.impulse[middle]).sum()
        count += np.all(np.abs(sim.position) < inner, axis=1).sum()
    pressure = push / (samples * sim.dt) / (6 * (2 * inner) ** 2)
    density = count / samples / (2 * inner) ** 3
    packing, temperature = density * 4 / 3 * pi * 0.05 ** 3, (sim.velocity ** 2).mean()
    expected = (1 + packing + packing ** 2 - packing ** 3) / (1 - packing) ** 3
    assert pressure / (density * temperature) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize('drag', [{'linear': 2.0, 'wind': [0.3, 0.0, 0.0]},
                                  {'linear': 0.5, 'quadratic': 0.4}])
def test_drag(drag):
    """Two balls with drag meet where their separate flights touch."""
    x, v = [[-1.0, 0.1, 0.0], [1.0, -0.1, 0.3]], [[6.0, 0.0, 1.0], [-5.0, 0.0, 0.0]]
    pair = exact(x, v, radius=0.2, gravity=FALL, drag=drag, dt=1.0)
    alone = [exact([x[k]], [v[k]], radius=0.2, gravity=FALL, drag=drag, dt=1.0) for k in (0, 1)]

    def gap(t):
        for k, sim in enumerate(alone):
            sim.reset()
            sim.advance(t)
        return np.linalg.norm(alone[0].position - alone[1].position) - 0.4

    high = next(t for t in np.linspace(0.0, 0.5, 51) if gap(t) < 0.0)
    low = high - 0.01
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if gap(middle) > 0.0 else (low, middle)
    pair.advance(low - 1e-9)
    assert hits(pair) == (0, 0)
    pair.advance(2e-9)
    assert hits(pair) == (1, 1)


@pytest.mark.parametrize('method', ['collision_then_contact'])
def test_fixed_steps_meet_it(method):
    """As dt goes to 0 fixed steps come to where the events lead, at first order."""
    x = [[0, 0, 1.0], [0.1, 0.05, 1.5], [-0.05, 0.1, 2.0]]
    end = exact(x, radius=0.2, restitution=0.7, gravity=FALL, colliders=[plane()], dt=0.1)
    end.advance(0.6)
    errors = []
    for dt in (0.6 / 512, 0.6 / 2048, 0.6 / 8192):
        sim = exact(x, radius=0.2, restitution=0.7, gravity=FALL, colliders=[plane()], dt=dt,
                    method=method, friction={'dry': 0.0, 'wet': 0.0})
        sim.advance(0.6)
        errors.append(np.abs(sim.position - end.position).max())
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 0.02


def test_steps_and_copies():
    """One call, single steps, another length of a step, and copies: the same, to rounding."""
    keys = {'gravity': FALL, 'restitution': 0.9}
    whole, _ = gas(8, **keys)
    single, _ = gas(8, **keys)
    whole.step(10)
    for k in range(10):
        single.step()
        if k == 4:
            copies = [deepcopy(single), pickle.loads(pickle.dumps(single))]
    other, _ = gas(8, **{**keys, 'dt': 0.037})
    other.advance(0.1)
    for copy in copies:
        copy.step(5)
        assert copy.position.tobytes() == single.position.tobytes()
        assert copy.counters == single.counters
    assert other.time == pytest.approx(0.1, rel=1e-14)
    for sim in (single, other):
        assert np.allclose(sim.position, whole.position, rtol=0, atol=1e-10)
        assert hits(sim)[0] == hits(whole)[0]
    whole.reset()
    whole.step(10)
    assert np.array_equal(whole.position, copies[0].position) or np.allclose(
        whole.position, copies[0].position, rtol=0, atol=1e-10)


def test_changes_from_outside():
    """Places and velocities written between two steps, and restitution set, count from then on."""
    sim = exact([[-1, 0, 0], [1, 0, 0]], radius=0.5, dt=0.1)
    sim.step(3)
    assert hits(sim) == (0, 0)
    sim.velocity[0] = [1.0, 0, 0]
    sim.position[1] = [0.5, 0, 0]
    sim.set_parameter('pairs.restitution', 0.5)
    sim.advance(1.0)
    assert np.allclose(sim.velocity[:, 0], [0.25, 0.75], rtol=0, atol=1e-15)
    assert np.allclose(sim.position[:, 0], [-0.5 + 0.25 * 0.5, 0.5 + 0.75 * 0.5], atol=1e-14)


def test_friction_of_pairs():
    """T06: a hit at v_N = 4 with eps 0.5 and mu 0.1 changes the slip by 0.6."""
    sim = exact([[0, 1.2, 0], [0, 0, 0]], [[3, -4, 0], [0, 0, 0]], mass=[1.0, np.inf],
                restitution=0.5, dt=1.0, friction={'dry': 0.1})
    sim.position[0] = [-0.15, 1.2, 0]
    sim.advance(0.1)
    assert np.allclose(sim.velocity, [[2.4, 2.0, 0], [0, 0, 0]], rtol=0, atol=1e-14)


def test_moving_collider_drives_a_row():
    """A wall that moves at V hits the first of a row again and again, until all leave at 2 V."""
    wall = {**plane((1, 0, 0), (-1.0, 0, 0), name='wall'), 'motion': {
        'linear_velocity': [1.0, 0, 0]}}
    sim = exact([[0, 0, 0], [0.5, 0, 0], [1.0, 0, 0]], radius=0.25, colliders=[wall], dt=0.1)
    sim.advance(1.0)
    assert np.allclose(sim.velocity[:, 0], 2.0, rtol=0, atol=1e-14)
    assert np.allclose(sim.position[:, 0], [0.5, 1.0, 1.5], rtol=0, atol=1e-13)
    assert hits(sim) == (3, 6)


def test_collapse_ends():
    """Three that lose nearly all energy collapse: the hits end, nobody is led through others."""
    sim = exact([[0, 0, 0], [1.1, 0, 0], [2.3, 0, 0]], [[1, 0, 0], [0, 0, 0], [-1, 0, 0]],
                restitution=0.05, dt=1.0)
    sim.advance(5.0)
    assert sim.counters['collapsed'] >= 1
    assert hits(sim)[0] < 1000
    assert gaps(sim).min() >= -1e-12
    assert np.abs(sim.momentum()).max() <= 1e-14


def test_column_comes_to_rest():
    """Balls that fall on each other rest exactly, and stay so."""
    sim = exact([[0, 0, 0.05 + 0.11 * k] for k in range(4)], radius=0.05, restitution=0.5,
                gravity=FALL, colliders=[plane()], dt=1 / 60, ledger=True)
    sim.advance(1.0)
    assert np.allclose(sim.position[:, 2], 0.05 + 0.1 * np.arange(4), rtol=0, atol=1e-11)
    assert not sim.velocity.any()
    before = sim.position.copy()
    sim.step(10)
    assert np.allclose(sim.position, before, rtol=0, atol=1e-14)
    assert gaps(sim).min() >= -1e-11
    assert sim.counters['pair_contacts'] > 0
    assert abs(sim.ledger.total.residual) <= 1e-10


def test_superball():
    """T62: a light ball on a heavy one is thrown up, at the speed of two central hits."""
    m, heavy, drop = 1.0, 1e3, 1.0
    sim = exact([[0, 0, 0.5 + drop], [0, 0, 1.1 + drop]], radius=[0.5, 0.1], mass=[heavy, m],
                gravity=FALL, colliders=[plane()], dt=1 / 60)
    t, v = sqrt(2 * drop / G), sqrt(2 * G * drop)
    sim.advance(t + 1e-9)
    expected = (3 * heavy - m) / (heavy + m) * v
    assert sim.velocity[1, 2] == pytest.approx(expected, rel=1e-7)


def test_balls_roll_apart_on_a_plane():
    """A ball that slides on a smooth plane hits one at rest; the plane holds both."""
    sim = exact([[0, 0, 0.5], [2.0, 0, 0.5]], [[1, 0, 0], [0, 0, 0]], gravity=FALL,
                colliders=[plane()], restitution=0.5, dt=0.1)
    sim.advance(2.0)
    assert np.allclose(sim.velocity, [[0.25, 0, 0], [0.75, 0, 0]], rtol=0, atol=1e-12)
    assert np.allclose(sim.position[:, 2], 0.5, rtol=0, atol=1e-14)
    assert np.allclose(sim.position[:, 0], [1.25, 2.75], rtol=0, atol=1e-11)


def test_nothing_there():
    """No particle, or one; points among balls."""
    for count in (0, 1):
        sim = exact(np.ones((count, 3)), radius=0.1 if count else 0.0)
        sim.step(3)
        assert hits(sim) == (0, 0)
    sim = exact([[-1, 0, 0], [0, 0, 0], [1, 0, 0]], [[1, 0, 0], [0, 0, 0], [-1, 0, 0]],
                radius=[0.0, 0.5, 0.0], dt=1.0)
    sim.advance(0.75)
    assert np.allclose(sim.velocity[:, 0], [-1, 0, 1], atol=1e-15)


def test_same_input_twice():
    """T91: bit-identical."""
    one, two = (gas(8, gravity=FALL, restitution=0.8)[0] for _ in range(2))
    one.step(20)
    two.step(20)
    assert one.position.tobytes() == two.position.tobytes()
    assert one.counters == two.counters
