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


"""Collisions of pairs against closed forms: T59, T61, T62, T66, T67 and Haff's law."""

import numpy as np
import pytest
from small_scenes import EPSILON, order, plane, root_mean_square, simulate

DETECTIONS = ['end_of_step', 'trajectory']
FLOOR = [plane(point=(0, 0, -1e9))]


def balls(position, velocity, mass=1.0, *, radius=0.5, restitution=1.0, dt=1 / 64,
          detection='end_of_step', friction=None, colliders=FLOOR):
    """Simulate balls without gravity, far above a floor: piles then share their kernels."""
    return simulate(colliders, position, velocity, gravity=(0, 0, 0), dt=dt, friction=friction,
                    particles={'radius': radius, 'mass': mass}, restitution=restitution, pairs={},
                    stepping={'detection': detection})


def head_on(masses, speeds, eps):
    """T59: speeds after a central collision."""
    (m1, m2), (v1, v2) = masses, speeds
    if np.isinf(m1) or np.isinf(m2):
        share = (0.0, 1.0) if np.isinf(m1) else (1.0, 0.0)
    else:
        share = m2 / (m1 + m2), m1 / (m1 + m2)
    change = (1.0 + eps) * (v2 - v1)
    return v1 + share[0] * change, v2 - share[1] * change


@pytest.mark.parametrize('detection', DETECTIONS)
@pytest.mark.parametrize('eps', [0.0, 0.5, 1.0])
@pytest.mark.parametrize('masses', [(1, 1), (1, 2), (1, 1e12), (1e-12, 1), (1, np.inf),
                                    (np.inf, 3)])
def test_head_on(masses, eps, detection):
    """T59: two balls of any masses meet head-on."""
    sim = balls([[-1, 0, 0], [1, 0, 0]], [[2, 0, 0], [-1, 0, 0]], masses, restitution=eps,
                detection=detection)
    sim.step(64)
    expected = head_on(masses, (2.0, -1.0), eps)
    assert np.allclose(sim.velocity[:, 0], expected, rtol=1e-14, atol=1e-14)
    assert np.array_equal(sim.velocity[:, 1:], np.zeros((2, 2)))


def test_two_infinite_masses_pass():
    """They keep their velocities."""
    sim = balls([[-1, 0, 0], [1, 0, 0]], [[1, 0, 0], [-1, 0, 0]], np.inf)
    sim.step(128)
    assert np.array_equal(sim.velocity, [[1, 0, 0], [-1, 0, 0]])


def test_glancing_discs():
    """T61: with sweeps the target leaves at 30 degrees and the striker at 60, to rounding."""
    sim = balls([[-3, 0.5, 0], [0, 0, 0]], [[2, 0, 0], [0, 0, 0]], dt=0.3, detection='trajectory')
    sim.step(12)
    target, striker = np.sqrt(0.75), 0.5
    assert np.allclose(sim.velocity[1] / 2, [target * target, -target * striker, 0], atol=1e-14)
    assert np.allclose(sim.velocity[0] / 2, [striker * striker, striker * target, 0], atol=1e-14)


@pytest.mark.jit
def test_glancing_discs_converge():
    """T61 where paths end: the normal is wrong by O(dt)."""
    steps, errors = 0.1 / 2.0 ** np.arange(6), []
    for dt in steps:
        each = []
        for start in np.linspace(0.0, 0.2, 21):
            sim = balls([[-3 - start, 0.5, 0], [0, 0, 0]], [[2, 0, 0], [0, 0, 0]], dt=dt)
            sim.step(int(2.2 / dt))
            each.append(sim.velocity[1, :2] - [1.5, -np.sqrt(0.75)])
        errors.append(root_mean_square(each))
    assert 0.8 < order(steps, errors) < 1.2


def test_no_tunnelling_with_sweeps():
    """A ball that flies a thousand radii a step hits one that is in its way."""
    sim = balls([[-777.7, 0, 0], [0, 0, 0]], [[64e3, 0, 0], [0, 0, 0]], detection='trajectory')
    sim.step(2)
    assert np.allclose(sim.velocity[:, 0], [0.0, 64e3], atol=1e-9)


@pytest.mark.parametrize('mass', [10.0, 1e6, np.inf])
def test_superball(mass):
    """T62: a small ball on a large one that falls leaves with (3 M - m) / (M + m) of its speed."""
    large, small, height, dt = 0.5, 0.05, 0.1, 1 / 4000
    sim = simulate([plane()], [[0, 0, large + height], [0, 0, 2 * large + small + height]], dt=dt,
                   particles={'radius': [large, small], 'mass': [mass, 1.0]},
                   pairs={'restitution': 1.0}, restitution=1.0, stepping={'iterations': 10})
    speed, fastest = np.sqrt(2 * 9.81 * height), 0.0
    for _ in range(640):
        sim.step()
        fastest = max(fastest, sim.velocity[1, 2])
    ratio = 3.0 if np.isinf(mass) else (3 * mass - 1) / (mass + 1)
    assert abs(fastest - ratio * speed) < 4 * 9.81 * dt


@pytest.mark.parametrize('detection', DETECTIONS)
@pytest.mark.parametrize('gap', [0.0, 1e-12, 1e-3])
def test_cradle(gap, detection):
    """T67: the last ball leaves with the speed of the first; pairs collide one after the other."""
    position = np.zeros((5, 3))
    position[:, 0] = np.arange(5) * (1.0 + gap)
    position[0, 0] -= 0.3
    sim = balls(position, [[1, 0, 0]] + [[0, 0, 0]] * 4, detection=detection)
    sim.step(40)
    assert np.allclose(sim.velocity[:, 0], [0, 0, 0, 0, 1], atol=1e-15)


@pytest.mark.parametrize('detection', DETECTIONS)
def test_coincident_centres(detection):
    """T67: finite, the momentum exact; at rest they are pushed apart along x."""
    sim = balls(np.zeros((2, 3)), [[1, 0, 0], [0, 0.5, 0]], [1.0, 2.0], detection=detection)
    sim.step(3)
    assert np.allclose(sim.momentum(), [1, 1, 0], rtol=0, atol=4 * EPSILON)
    assert np.isfinite(sim.position).all()
    sim = balls(np.zeros((2, 3)), np.zeros((2, 3)), detection=detection)
    sim.step(3)
    assert np.allclose(sim.position, [[0.5 * (1 - 0.9 ** 3), 0, 0], [-0.5 * (1 - 0.9 ** 3), 0, 0]])
    assert np.array_equal(sim.velocity, np.zeros((2, 3)))


def test_overlap_decays_and_is_not_shot_out():
    """Who overlaps at rest is repelled by a tenth of the depth a step, with no velocity left."""
    sim = balls([[0, 0, 0], [0.6, 0, 0]], np.zeros((2, 3)))
    for step in range(1, 20):
        sim.step()
        depth = 1.0 - (sim.position[1, 0] - sim.position[0, 0])
        assert np.isclose(depth, 0.4 * 0.9 ** step, rtol=1e-9)
    assert np.array_equal(sim.velocity, np.zeros((2, 3)))


def test_overlapping_and_separating_is_left_alone():
    """Bannerman's rule: it collides only while approaching."""
    sim = balls([[0, 0, 0], [0.9, 0, 0]], [[-1, 0, 0], [1, 0, 0]], dt=1 / 8)
    sim.step()
    assert sim.counters['pair_collisions'] == 0
    assert np.array_equal(sim.velocity[:, 0], [-1, 1])


@pytest.mark.parametrize('law, factor', [
    ({'dry': 0.1}, lambda slip, dv: max(1 - 0.1 * dv / slip, 0)),
    ({'dry': 5.0}, lambda slip, dv: 0.0),
    ({'wet': 0.2}, lambda slip, dv: np.exp(-0.2 * dv))])
def test_friction(law, factor):
    """The relative tangential velocity gets the factor of the law; momentum is conserved."""
    masses, eps = np.array([1.0, 3.0]), 0.5
    sim = balls([[-0.51, 0, 0], [0.51, 0, 0]], [[2, 1, 0], [0, -1, 0.5]], masses, dt=1e-2,
                restitution=eps, friction=law, detection='trajectory')
    before = sim.velocity.copy()
    sim.step(2)
    time = 0.01
    for _ in range(50):     # Newton: |r| = 1
        r = np.array([-1.02, 0, 0]) + time * (before[0] - before[1])
        time -= (r @ r - 1.0) / (2.0 * r @ (before[0] - before[1]))
    n, relative = r / np.linalg.norm(r), before[0] - before[1]
    v_n = n @ relative
    slip = relative - v_n * n
    expected = -eps * v_n * n + factor(np.linalg.norm(slip), -(1 + eps) * v_n) * slip
    assert np.allclose(sim.velocity[0] - sim.velocity[1], expected, atol=1e-12)
    assert np.allclose(masses @ sim.velocity, masses @ before, atol=1e-15)


def gas(wide, restitution):
    """Balls between six walls at packing 0.2, with 1.25 m/s; elastic walls."""
    random = np.random.default_rng(2)
    pitch = 0.1378
    sites = pitch * (np.indices((wide, wide, wide)).reshape(3, -1).T + 0.5)
    position = sites + random.uniform(-0.018, 0.018, (wide ** 3, 3))
    velocity = random.standard_normal((wide ** 3, 3))
    velocity *= 1.25 / np.linalg.norm(velocity, axis=1, keepdims=True)
    far, normals = wide * pitch, np.concatenate([np.eye(3), -np.eye(3)])
    sides = [plane(normal, (far, far, far) if normal.sum() < 0 else (0, 0, 0), name=f'wall{k}',
                   restitution=1.0) for k, normal in enumerate(normals)]
    return simulate(sides, position, velocity, gravity=(0, 0, 0), contacts=False,
                    particles={'radius': 0.05}, pairs={'restitution': restitution})


@pytest.mark.jit
def test_gas_keeps_energy_and_momentum():
    """T66: restitution 1; energy to rounding, momentum to N ulp of what the walls do not take."""
    sim = gas(8, 1.0)
    energy = sim.energy()
    sim.step(100)
    assert sim.counters['pair_collisions'] > 500
    assert abs(sim.energy() / energy - 1.0) < 1e-14
    free = balls(sim.position, sim.velocity, radius=0.05, dt=1 / 240)
    momentum = free.momentum()
    free.step(100)
    assert free.counters['pair_collisions'] > 200
    assert np.abs(free.momentum() - momentum).max() < 512 * 1.25 * EPSILON


@pytest.mark.jit
@pytest.mark.slow
def test_gas_keeps_energy_over_a_million_hits():
    """T66: 1e-12 of the energy after 1e6 hits."""
    sim = gas(10, 1.0)
    energy = sim.energy()
    while sim.counters['pair_collisions'] < 1_000_000:
        sim.step(1000)
    assert abs(sim.energy() / energy - 1.0) < 1e-12


@pytest.mark.jit
def test_gas_cools_by_haffs_law():
    """T66: with restitution below 1 the temperature falls as 1 / (1 + t / tau)^2."""
    sim = gas(14, 0.9)
    cooled = []
    for _ in range(8):
        sim.step(25)
        cooled.append((sim.time, sim.energy()))
    time, energy = np.array(cooled).T
    inverse = np.sqrt(energy[0] / energy)
    straight = np.polyval(np.polyfit(time, inverse, 1), time)
    assert inverse[-1] > 1.2
    assert np.abs(straight - inverse).max() < 0.05 * (inverse[-1] - 1.0)
