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

"""Particles on springs: closed forms, orders of convergence, what is conserved, collisions."""

from math import cos, exp, inf, pi, sin, sqrt

from collision_sim import Scene, Simulation
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import EPSILON, G, order, plane, simulate, sphere

pytestmark = pytest.mark.plain

SOLVERS = ('explicit', 'implicit')
RANDOM = np.random.default_rng(8)


def links(count):
    """Springs of a string of particles."""
    return [[i, i + 1] for i in range(count - 1)]


def oscillator(solver, damping, dt, colliders=(), **sections):
    """Two masses, 1 and 2 kg, on a spring of 10 N/m stretched by 0.2 m, after 1 s."""
    sim = simulate(list(colliders), [[0, 0, 0], [1, 0, 0]], dt=dt, gravity=(0, 0, 0),
                   particles={'mass': [1.0, 2.0]}, springs={
                       'pairs': [[0, 1]], 'stiffness': 10.0, 'damping': damping,
                       'rest_length': 0.8, 'solver': solver}, **sections)
    sim.advance(1.0)
    return sim


@pytest.mark.parametrize('damping', [0.0, 0.7])
@pytest.mark.parametrize('solver, expected', [('explicit', 2.0), ('implicit', 1.0)])
def test_oscillator(solver, damping, expected):
    """Follow 0.2 exp(-g t) (cos(w t) + g/w sin(w t)): explicit by order 2, implicit by 1."""
    g = damping / (2 * 2 / 3)
    w = sqrt(10 / (2 / 3) - g * g)
    exact = 0.8 + 0.2 * exp(-g) * (cos(w) + g / w * sin(w))
    steps = [1 / 800, 1 / 1600, 1 / 3200]
    errors = []
    for dt in steps:
        sim = oscillator(solver, damping, dt)
        errors.append(abs(sim.position[1, 0] - sim.position[0, 0] - exact))
        assert_allclose(sim.momentum(), 0.0, atol=1e-14)
    assert order(steps, errors) == pytest.approx(expected, abs=0.05)
    assert errors[-1] < (3e-6 if solver == 'explicit' else 3e-3)


@pytest.mark.parametrize('drag', [{'linear': 0.8}, {'quadratic': 0.5}], ids=str)
def test_drag_keeps_the_second_order(drag):
    """Against a step of 1/25600, with drag and gravity."""
    ends = [oscillator('explicit', 0.3, dt, drag=drag).position.copy()
            for dt in (1 / 100, 1 / 200, 1 / 400, 1 / 25600)]
    errors = [np.abs(end - ends[-1]).max() for end in ends[:-1]]
    assert order([1 / 100, 1 / 200, 1 / 400], errors) == pytest.approx(2.0, abs=0.05)


def test_free_particles_fly_as_without_springs():
    """Who has no spring, and a spring without stiffness, change nothing: the same bits."""
    position = RANDOM.uniform(-1, 1, (4, 3))
    alone = simulate([], position, (1.0, 2.0, 3.0), drag={'linear': 0.3})
    for solver in SOLVERS:
        sim = simulate([], position, (1.0, 2.0, 3.0), drag={'linear': 0.3}, springs={
            'pairs': [[0, 1]], 'stiffness': 1e3, 'rest_length': 1.0, 'solver': solver})
        slack = simulate([], position, (1.0, 2.0, 3.0), drag={'linear': 0.3}, springs={
            'pairs': [[0, 1]], 'stiffness': 0.0})
        for each in (alone, sim, slack):
            each.reset()
            each.step(5)
        if solver == 'implicit':
            assert_array_equal(sim.position[2:], alone.position[2:])
        assert_array_equal(slack.position, alone.position)


@pytest.mark.parametrize('solver', SOLVERS)
def test_momentum_is_kept(solver):
    """Of a thrown network: N ulp of the sizes that are added, per step."""
    count, steps = 40, 100
    pairs = RANDOM.integers(count, size=(150, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    mass = RANDOM.uniform(0.5, 2.0, count)
    sim = simulate([], RANDOM.uniform(-1, 1, (count, 3)), RANDOM.normal(size=(count, 3)).tolist(),
                   gravity=(0, 0, 0), dt=1 / 100, particles={'mass': mass}, springs={
                       'pairs': pairs, 'stiffness': 1e3, 'damping': 0.1, 'solver': solver})
    before = sim.momentum()
    sim.step(steps)
    size = np.sum(mass[:, None] * np.abs(sim.velocity))
    assert_allclose(sim.momentum(), before, rtol=0, atol=steps * 40 * EPSILON * size)


def test_galilean_copy():
    """T38: with 1e6 m/s added to everything the same motion, to the ulp of the position."""
    position, pairs = RANDOM.uniform(-1, 1, (5, 3)), links(5)
    for solver in SOLVERS:
        spring = {'pairs': pairs, 'stiffness': 200.0, 'rest_length': 0.5, 'solver': solver}
        still, moving = (simulate([], position, (speed, 0.0, 0.0), dt=1 / 128, springs=spring)
                         for speed in (0.0, 1e6))
        for sim in (still, moving):
            sim.step(64)
        assert_allclose(moving.position - (5e5, 0, 0), still.position, atol=1e-7)


@pytest.mark.parametrize('solver', SOLVERS)
def test_hanging_string_stays(solver):
    """Spring i from the top carries n - i masses: it is longer by m g (n - i) / k, for ever."""
    n, k, m = 6, 500.0, 0.2
    stretch = m * G * np.arange(n, 0, -1) / k
    z = np.concatenate([[0.0], -np.cumsum(0.1 + stretch)])
    position = np.stack([0 * z, 0 * z, z], axis=1)
    sim = simulate([], position, particles={'mass': [inf] + [m] * n}, springs={
        'pairs': links(n + 1), 'stiffness': k, 'rest_length': 0.1, 'solver': solver})
    sim.step(500)
    assert_allclose(sim.position, position, atol=2e-13)
    assert_allclose(sim.velocity, 0.0, atol=2e-12)


def test_catenary():
    """
    A string between two pins, damped to rest: the discrete catenary.

    Each joint is in balance: the horizontal force is the same in all springs, the vertical one
    grows by the weight m g from spring to spring.
    """
    n, k, m = 9, 400.0, 0.05
    position = np.stack([np.linspace(0, 1, n), np.zeros(n), np.zeros(n)], axis=1)
    mass = [inf] + [m] * (n - 2) + [inf]
    sim = simulate([], position, dt=1 / 60, particles={'mass': mass}, springs={
        'pairs': links(n), 'stiffness': k, 'damping': 1.0, 'rest_length': 0.15,
        'solver': 'implicit'})
    sim.step(3000)
    r = np.diff(sim.position, axis=0)
    length = np.linalg.norm(r, axis=1)
    force = (k * (length - 0.15) / length)[:, None] * r
    assert_allclose(force[:, 0], force[0, 0], rtol=1e-8)
    assert_allclose(np.diff(force[:, 2]), m * G, rtol=1e-8)


def test_standing_wave():
    """Transverse mode p of a tight string of n springs: w = 2 sqrt(T/(m l)) sin(p pi / (2 n))."""
    n, k, m, rest, p = 16, 1000.0, 0.01, 0.05, 2
    gap = 1.0 / n
    tension = k * (gap - rest)
    w = 2 * sqrt(tension / (m * gap)) * sin(p * pi / (2 * n))
    shape = np.sin(p * pi * np.arange(n + 1) / n)
    position = np.stack([gap * np.arange(n + 1), 0 * shape, 1e-6 * shape], axis=1)
    period = 2 * pi / w
    sim = simulate([], position, gravity=(0, 0, 0), dt=period / 400,
                   particles={'mass': [inf] + [m] * (n - 1) + [inf]},
                   springs={'pairs': links(n + 1), 'stiffness': k, 'rest_length': rest})
    sim.step(400)
    assert_allclose(sim.position[:, 2], position[:, 2], atol=2e-10)
    sim.step(200)
    assert_allclose(sim.position[:, 2], -position[:, 2], atol=2e-10)


def test_coincident_ends():
    """Direction undefined: deterministic, momentum exact, no NaN."""
    for solver in SOLVERS:
        sim = simulate([], [[0, 0, 0], [0, 0, 0]], gravity=(0, 0, 0), springs={
            'pairs': [[1, 0]], 'stiffness': 10.0, 'rest_length': 0.1, 'solver': solver})
        sim.step(20)
        assert np.isfinite(sim.position).all()
        assert_array_equal(sim.momentum(), 0.0)
        assert sim.position[0, 0] < 0.0 < sim.position[1, 0]


def thrown_string(solver, stiffness, restitution, pinned=False, dt=1 / 60, count=12, **keys):
    """Throw a string with random velocities above the ground, not damped."""
    random = np.random.default_rng(1)
    position = np.zeros((count, 3))
    position[:, 0], position[:, 2] = 0.1 * np.arange(count), 0.6
    velocity = random.normal((1.0, 0.0, 0.0), 0.5, (count, 3))
    mass = np.ones(count)
    if pinned:
        mass[0], velocity[0] = inf, 0.0
    return simulate([plane()], position, velocity, dt=dt, restitution=restitution,
                    particles={'mass': mass}, springs={
                        'pairs': links(count), 'stiffness': stiffness, 'solver': solver}, **keys)


def mechanical(sim):
    """Kinetic energy and that in the gravity field."""
    mass = np.broadcast_to(sim.scene.particles.mass, len(sim.position))
    free = np.isfinite(mass)
    return np.sum(mass[free] * (0.5 * np.square(sim.velocity[free]).sum(axis=1)
                                + G * sim.position[free, 2]))


@pytest.mark.jit
@pytest.mark.parametrize('restitution', [0.0, 0.5, 1.0])
@pytest.mark.parametrize('pinned', [False, True])
@pytest.mark.parametrize('stiffness', [1e2, 1e5, 1e9])
def test_implicit_brings_no_energy(stiffness, pinned, restitution):
    """Stiffness up to 1e9 at dt = 1/60, 1500 steps with collisions: never more than at first."""
    sim = thrown_string('implicit', stiffness, restitution, pinned)
    most = sim.energy()
    for _ in range(1500):
        sim.step()
        assert mechanical(sim) <= most * (1 + 1e-12)
    assert sim.clearance().min() >= -1e-15


@pytest.mark.parametrize('stiffness', [1e3, 1e9])
def test_implicit_flight_brings_no_energy(stiffness):
    """In flight not even in the springs: the sum falls from step to step."""
    sim = thrown_string('implicit', stiffness, 0.0, pinned=True)
    scene = Scene.from_dict({
        'particles': {'position': sim.position, 'velocity': sim.velocity,
                      'mass': sim.scene.particles.mass},
        'springs': {'pairs': links(12), 'stiffness': stiffness, 'solver': 'implicit'},
        'stepping': {'dt': 1 / 60}})
    sim = Simulation(scene)
    energy = sim.energy()
    for _ in range(300):
        sim.step()
        assert sim.energy() <= energy + 1e-7 * abs(mechanical(sim))
        energy = sim.energy()


def test_explicit_flight_keeps_the_energy():
    """Of a swinging and jumping string, over 2000 steps: within 2 % and without drift."""
    sim = thrown_string('explicit', 1e4, 0.0, pinned=True, count=6)
    sim.place_collider('ground', (0.0, 0.0, -50.0), (0.0, 0.0, 0.0, 1.0))
    before, found = sim.energy(), []
    for _ in range(400):
        sim.step()
        found.append(sim.energy())
    assert np.max(np.abs(np.array(found) / before - 1)) < 0.02
    assert np.mean(found[200:]) == pytest.approx(np.mean(found[:200]), rel=5e-3)


@pytest.mark.jit
@pytest.mark.parametrize('restitution', [0.0, 0.5, 1.0])
def test_explicit_bounces_bring_no_energy(restitution):
    """Collisions come before the springs: what an elastic one keeps stays, within 6 %."""
    sim = thrown_string('explicit', 1e4, restitution)
    before = sim.energy()
    for _ in range(600):
        sim.step()
        assert sim.energy() <= 1.06 * before
    assert sim.clearance().min() >= -1e-15


@pytest.mark.parametrize('restitution', [0.0, 1.0])
def test_stiff_spring_against_a_plane(restitution):
    """T70: w = 31622.8 1/s, w dt = 132: elastic bounces keep the energy, inelastic ones lose."""
    stretch, hit = 1e-3, -5e-4
    sim = simulate([plane(point=(0, 0, hit))], [[0, 0, 1], [0, 0, stretch]], dt=1 / 240,
                   gravity=(0, 0, 0), restitution=restitution, particles={'mass': [inf, 1.0]},
                   springs={'pairs': [[0, 1]], 'stiffness': 1e9, 'rest_length': 1.0})
    before = sim.energy()
    assert before == pytest.approx(0.5e9 * stretch ** 2)
    sim.step(5)
    if restitution == 1.0:
        assert sim.energy() == pytest.approx(before, rel=0.3)
        assert sim.counters['collisions'] > 100
    else:
        assert 0.5e9 * hit ** 2 * 0.8 < sim.energy() < 0.5e9 * hit ** 2 * 1.05
    assert sim.position[1, 2] >= hit


def cloth(size, threads=None, ledger=False, solver='explicit'):
    """Hang a square cloth of 0.6 m above a ball."""
    places = np.linspace(-0.3, 0.3, size)
    position = np.stack([*np.meshgrid(places, places), np.full((size, size), 0.55)], axis=-1)
    return simulate([plane(), sphere(0.4, (0, 0, 0.1))], position.reshape(-1, 3), dt=1 / 120,
                    friction={'dry': 0.5}, particles={'mass': 0.002}, threads=threads,
                    ledger=ledger, springs={'grid': [size, size], 'stiffness': 50.0,
                                            'damping': 0.05, 'solver': solver})


@pytest.mark.jit
@pytest.mark.parametrize('solver', SOLVERS)
def test_cloth_on_a_ball(solver):
    """Nothing ends inside, and the cloth comes to rest on the ball."""
    sim = cloth(12, solver=solver)
    for _ in range(360):
        sim.step()
        assert sim.clearance().min() >= -1e-15
    assert sim.position[:, 2].max() > 0.48
    assert np.abs(sim.velocity).max() < 0.3


@pytest.mark.jit
@pytest.mark.parametrize('solver', SOLVERS)
def test_ledger(solver):
    """What springs bring is internal; nothing is left over but rounding, with hits."""
    sim = thrown_string(solver, 1e3, 0.5, dt=1 / 120, ledger=True)
    before = sim.energy(), mechanical(sim)
    sim.step(200)
    total = sim.ledger.total
    assert total.residual == pytest.approx(0.0, abs=1e-10)
    assert total.change == pytest.approx(mechanical(sim) - before[1], abs=1e-9)
    assert total.internal != 0.0


@pytest.mark.jit
def test_threads_do_not_matter():
    """The same bits on one thread and on two, with a ledger and without."""
    ends = []
    for threads, ledger in ((1, False), (2, False), (2, True)):
        sim = cloth(60, threads=threads, ledger=ledger)
        sim.step(40)
        ends.append((sim.position.tobytes(), sim.velocity.tobytes()))
    assert ends[0] == ends[1] == ends[2]


@pytest.mark.jit
def test_substeps_of_a_moving_collider():
    """A lift carries a net: with substeps the colliders' poses are divided, nothing jumps."""
    lift = plane(motion={'oscillate': {'axis': [0, 0, 1], 'amplitude': 0.1, 'frequency': 0.5}})
    sim = simulate([lift], [[0, 0, 0], [0.1, 0, 0]], dt=1 / 60, springs={
        'pairs': [[0, 1]], 'stiffness': 1e4})
    for _ in range(120):
        sim.step()
        assert_allclose(sim.clearance(), 0.0, atol=1e-12)


def test_no_time_and_no_particles():
    """A dt of 0 changes nothing, for any stiffness; an empty list of springs is allowed."""
    sim = simulate([], [[0, 0, 0], [1, 0, 0]], dt=0.0, springs={
        'pairs': [[0, 1]], 'stiffness': 1e12, 'rest_length': 0.5})
    sim.step(3)
    assert_array_equal(sim.position, [[0, 0, 0], [1, 0, 0]])
    for solver in SOLVERS:
        sim = simulate([], [[0, 0, 0]], springs={'pairs': [], 'stiffness': 1.0, 'solver': solver})
        sim.step(3)
        assert sim.position[0, 2] < 0.0


def test_parameters_while_it_runs():
    """From the next step on, as if the scene had been so: the same bits."""
    one, other = oscillator('explicit', 0.0, 1 / 64), oscillator('explicit', 0.0, 1 / 64)
    one.set_parameter('springs.stiffness', 20.0)
    other.set_parameter('springs.stiffness', 1e4)
    other.set_parameter('springs.stiffness', 20.0)
    one.step(30)
    other.step(30)
    assert_array_equal(one.position, other.position)
