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
What holds in every scene: nobody who is outside ends inside, nothing becomes infinite or NaN.

Random scenes of up to six overlapping colliders of all shapes, some of which hold the particles
inside, that jump and turn at will; every scene has the same features, so that one kernel for each
kind of method serves them all.
"""

from collision_sim.simulation import Simulation
from hypothesis import given, settings, strategies as st
import numpy as np
import pytest
from small_scenes import EPSILON, FAR, METHODS, simulate

pytestmark = pytest.mark.jit

PARTICLES = 24
SLACK = 64 * EPSILON        # of a position: rounding of a distance that is computed from it
FAR_PLACE = 1e9             # of the colliders that only bring all shapes into the scene


def vectors(limit):
    """Vectors with components up to a limit, some of them exactly 0 or a corner of it."""
    component = st.one_of(st.sampled_from([0.0, limit, -limit]), st.floats(-limit, limit))
    return st.tuples(component, component, component)


@st.composite
def orientations(draw):
    """Give a unit quaternion, often a simple one."""
    q = np.array(draw(st.one_of(
        st.sampled_from([(0.0, 0.0, 0.0, 1.0), (0.5, 0.5, 0.5, 0.5), (1.0, 0.0, 0.0, 0.0)]),
        st.tuples(*[st.floats(-1.0, 1.0)] * 4))))
    size = np.sqrt(q @ q)
    return (q / size if size > 1e-3 else np.array((0.0, 0.0, 0.0, 1.0))).tolist()


lengths = st.one_of(st.sampled_from([1.0, 0.5]), st.floats(1e-3, 3.0))
directions = vectors(1.0).filter(lambda n: 0.01 < np.dot(n, n))


@st.composite
def colliders(draw, index):
    """Give a collider of any shape, sometimes one that holds the particles inside."""
    shape = draw(st.sampled_from(['plane', 'sphere', 'box', 'capsule', 'cylinder']))
    found = {'name': f'c{index}', 'shape': shape, 'orientation': draw(orientations()),
             'restitution': draw(st.sampled_from([0.0, 0.5, 1.0]))}
    place = list(draw(vectors(1.0)))
    if shape == 'plane':
        return {**found, 'point': place, 'normal': list(draw(directions))}
    size = {'box': {'size': [draw(lengths), draw(lengths), draw(lengths)]},
            'sphere': {'radius': draw(lengths)}}.get(shape)
    size = size or {'radius': draw(lengths), 'length': draw(lengths)}
    return {**found, 'position': place, **size, 'inside': draw(st.booleans())}


@st.composite
def scenes(draw, methods=METHODS, wet='exponential'):
    """Give a simulation of particles scattered over the colliders, and how those may move."""
    count = draw(st.integers(1, 6))
    random = np.random.default_rng(draw(st.integers(0, 2 ** 32 - 1)))
    speed = 10.0 ** draw(st.floats(-3.0, 8.0))
    still = {'name': 'still', 'shape': 'plane', 'point': [0, 0, -FAR_PLACE],
             'motion': {'linear_velocity': [0, 0, 0]}}
    mu = draw(st.sampled_from([0.0, 0.3, 1e6]))
    sim = simulate(
        [*(draw(colliders(k)) for k in range(count)), *FAR, still],
        random.uniform(-2.0, 2.0, (PARTICLES, 3)),
        speed * random.uniform(-1.0, 1.0, (PARTICLES, 3)),
        gravity=draw(st.sampled_from([(0.0, 0.0, 0.0), (0.0, 0.0, -9.81), (1e3, 0.0, 0.0)])),
        dt=10.0 ** draw(st.floats(-9.0, 1.0)), method=draw(st.sampled_from(methods)),
        friction={'dry': mu, 'wet': {'coefficient': draw(st.sampled_from([0.0, 0.1, 1e9])),
                                     'form': wet}},
        particles={'radius': np.where(np.arange(PARTICLES) % 3 == 0, 0.1, 1e-300)},
        stepping={'iterations': draw(st.sampled_from([1, 2, 10]))})
    reach = draw(st.sampled_from([0.0, 1e-3, 0.3, 10.0, 1e4]))
    moves = [(f'c{k}', draw(vectors(1.0)), draw(orientations())) for k in range(count)
             if draw(st.booleans())]
    return sim, [(name, reach * np.array(place), turn) for name, place, turn in moves]


def slack(sim):
    """Give the rounding of distances, larger for particles that are far out."""
    return SLACK * (4.0 + np.abs(sim.position).max(axis=1))


def take_step(sim, moves):
    """Take a step in which some colliders jump; give what each particle's clearance was."""
    for name, place, turn in moves:
        sim.move_collider(name, place, turn)
    before = sim.clearance()
    sim.step()
    return before


@given(scenes())
@settings(max_examples=150)
def test_who_starts_outside_ends_outside(drawn):
    """Except for those that are counted as unplaced, of which the first eight are named."""
    sim, moves = drawn
    for _ in range(5):
        noted = sim.counters['unplaced']
        before = take_step(sim, moves)
        assert np.isfinite(sim.position).all() and np.isfinite(sim.velocity).all()
        through = np.flatnonzero((before >= 0.0) & (sim.clearance() < -slack(sim)))
        assert len(through) <= sim.counters['unplaced'] - noted
        if sim.counters['unplaced'] <= 8:
            assert set(through) <= {particle for particle, _, _ in sim.unplaced}
        moves = [(name, -place, turn) for name, place, turn in moves]


@given(scenes())
@settings(max_examples=60)
def test_contacts_fit_the_counters(drawn):
    """Contacts are finite, have unit normals and come at most four for each particle."""
    sim, moves = drawn
    for _ in range(3):
        before = sim.counters
        take_step(sim, moves)
        contacts = sim.contacts
        events = sum(sim.counters[key] - before[key]
                     for key in ('collisions', 'contacts', 'repulsions'))
        assert len(contacts.particle) <= events
        assert (events > 0) == (len(contacts.particle) > 0)
        assert np.bincount(contacts.particle, minlength=1).max() <= 4
        assert (np.diff(contacts.particle) >= 0).all()
        norms = np.sqrt(np.square(contacts.normal).sum(axis=1))
        assert np.allclose(norms, 1.0, rtol=0.0, atol=1e-14)
        for part in contacts:
            assert np.isfinite(part).all()


@given(scenes(METHODS[2:]))
@settings(max_examples=80)
def test_fixed_colliders_give_no_speed(drawn):
    """
    Among colliders that do not move the third method never speeds a particle up.

    Each answer is a shrinking of the velocity: |v| after a step is at most |v| + |g| dt. Repulsion
    moves, but gives no velocity.
    """
    sim, _ = drawn
    gravity = np.linalg.norm(sim.scene.gravity)
    for _ in range(5):
        before = np.sqrt(np.square(sim.velocity).sum(axis=1))
        sim.step()
        after = np.sqrt(np.square(sim.velocity).sum(axis=1))
        # the collision stage flies each candidate anew, from a velocity that is not larger
        assert (after <= (before + gravity * sim.dt) * (1.0 + 1e-12) + 1e-300).all()


@given(scenes(METHODS[2:]))
@settings(max_examples=80)
def test_moving_colliders_give_no_more_than_their_speed(drawn):
    """
    A particle leaves a collider with at most twice its speed more than it came, each time.

    There are at most three collisions and `iterations` contacts in a step; where twists are
    estimated from poses, they are at most 3/2 of the chord.
    """
    sim, moves = drawn
    for _ in range(3):
        before_velocity = np.sqrt(np.square(sim.velocity).sum(axis=1))
        fastest = highest_speed(sim, moves)
        take_step(sim, moves)
        after = np.sqrt(np.square(sim.velocity).sum(axis=1))
        gravity = np.linalg.norm(sim.scene.gravity) * sim.dt
        rounds = 3 + sim.scene.stepping.iterations + 1
        assert (after <= (before_velocity + gravity + 2.0 * rounds * fastest) * (1 + 1e-9)).all()
        moves = [(name, -place, turn) for name, place, turn in moves]


def highest_speed(sim: Simulation, moves):
    """Bound of the speed of material points that particles may meet in the next step [m/s]."""
    speed = 0.0
    fly = np.sqrt(np.square(sim.velocity).sum(axis=1).max()) * sim.dt
    fly += np.linalg.norm(sim.scene.gravity) * sim.dt ** 2
    for name, place, _ in moves:
        old, _ = sim.collider_pose(name)
        way = np.linalg.norm(place - old)
        arm = np.sqrt(np.square(sim.position - old).sum(axis=1).max()) + way + fly
        speed = max(speed, 1.5 * (way + np.pi * (arm + 2.0 * way)) / sim.dt)
    return speed


@given(scenes(), st.integers(1, 4))
@settings(max_examples=30)
def test_same_input_twice(drawn, steps):
    """T91: after a reset the same steps lead to the same bits."""
    sim, moves = drawn
    states = []
    for _ in range(2):
        sim.reset()
        for _ in range(steps):
            take_step(sim, moves)
        states.append(sim.position.tobytes() + sim.velocity.tobytes() + str(sim.counters).encode())
    assert states[0] == states[1]
