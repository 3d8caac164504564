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

"""Moves that are handed over: chords, twists at the ends of steps, and what is kept at rest."""

from math import cos, sin

from collision_sim.core import moves
from collision_sim.core.motion import DOUBT, END, POSE, START, TWIST
from collision_sim.core.rotation import quaternions, rotation_matrix, turn_between
from collision_sim.core.vectors import EPSILON
from numba import njit
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
NO_TWISTS = np.empty((0, 0, TWIST))


def fill(rows, start, positions, orientations, twists=NO_TWISTS, dt=0.5, frames=None):
    """Fill the rows of a move of K colliders, whose frames are straight if none are given."""
    frames = np.tile(np.eye(3), (rows.shape[1], 1, 1)) if frames is None else frames
    moves.lay_out_move(rows, frames, start, positions, orientations, twists, dt)
    return rows[moves.PAST:]


def begin(steps, start=(0.0, 0.0, 0.0, *UPRIGHT)):
    """Rows of a move of one collider that starts at a pose and was never moved before."""
    rows = np.full((moves.PAST + steps, 1, moves.MOVE), np.nan)
    rows[1, 0, :POSE] = *rotation_matrix(start[3:]).ravel(), *start[:3]
    return rows


def test_chords():
    """The constant twist from each pose to the next, the shortest way round."""
    places = np.array([(1.0, 0.0, 0.0), (1.0, 3.0, 0.0)])[:, None]
    turns = np.array([(0.0, 0.0, sin(a / 2), cos(a / 2)) for a in (1.0, 2.5)])[:, None]
    turns[0] *= -1.0                                            # the same orientation
    rows = fill(begin(2), np.array([UPRIGHT]), places, turns)
    assert_allclose(rows[:, 0, moves.CHORD:], [(2, 0, 0, 0, 0, 2), (0, 6, 0, 0, 0, 3)], atol=1e-15)


@njit
def estimate(rows):
    """Call a kernel, which has no entry from Python."""
    for s in range(moves.PAST, rows.shape[0]):
        moves.end_twists(rows, s, 0)


def end_twists(chords, before):
    """Twists along x at both ends of steps with these chords, after steps with those before."""
    rows = np.zeros((moves.PAST + len(chords), 1, moves.MOVE))
    rows[:, 0, moves.CHORD] = *before, *chords
    estimate(rows)
    assert_array_equal(rows[:, 0, START + 1:END], 0.0)
    return rows[moves.PAST:, 0, START], rows[moves.PAST:, 0, END]


def test_end_twists_of_a_constant_acceleration_are_exact():
    """V = a t: chords (k + 1/2) a dt, twists k a dt and (k + 1) a dt, with a history of two."""
    start, end = end_twists([2.5, 3.5, 4.5], [0.5, 1.5])
    assert_array_equal(start, (2.0, 3.0, 4.0))
    assert_array_equal(end, (3.0, 4.0, 5.0))


@pytest.mark.parametrize(('values', 'before', 'half'), [
    ([1.0], [np.nan, np.nan], [0.0]),               # nothing before: the chord
    ([1.0, 1.0], [np.nan, np.nan], [0.0, 0.0]),
    ([1.0, 2.0], [np.nan, np.nan], [0.0, 0.0]),
    ([1.0, 2.0, 4.0], [np.nan, np.nan], [0.0, 0.0, 0.5]),   # the smaller one of two changes
    ([1.0], [0.0, 0.0], [0.0]),                     # it starts at once
    ([0.0], [1.0, 1.0], [0.0]),                     # it stops at once
    ([2.0], [1.0, 3.0], [0.0]),                     # it turns round
    ([-4.0], [-1.0, -2.0], [-0.5]),
])
def test_end_twists_take_the_smaller_change(values, before, half):
    """Minmod: half of the smaller change where two agree in sign, else the chord itself."""
    start, end = end_twists(values, before)
    assert_array_equal(end - values, half)
    assert_array_equal(values - start, half)


def test_end_twists_are_of_second_order():
    """On a smooth motion, away from its turning points."""
    errors = []
    for dt in (0.02, 0.01):
        times = np.arange(-2.0, 30.0) * dt
        chords = np.diff(np.sin(times + 0.3)) / dt
        _, end = end_twists(chords[2:], chords[:2])
        errors.append(np.abs(end[:9] - np.cos(times[3:12] + 0.3)).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)


def test_one_wrong_norm_changes_nothing():
    """It is named by its collider, the first of several; else all have norm 1."""
    q = np.random.default_rng(0).normal(size=(3, 5, 4))
    q *= (1.0 + 9e-4) / np.linalg.norm(q, axis=2, keepdims=True)
    bad = q.copy()
    bad[2, 1], bad[0, 3] = 1.01 * q[2, 1], np.nan
    before = bad.copy()
    assert moves.bring_to_unit_norm(bad) == 1
    assert_array_equal(bad, before)
    assert moves.bring_to_unit_norm(q) == moves.NONE
    assert_allclose(np.linalg.norm(q, axis=2), 1.0, rtol=4 * EPSILON)


def reference(rows, frames, start, positions, orientations, dt):
    """Rows of a move with NumPy, all colliders and twists at once."""
    poses = np.empty((len(positions), len(frames), POSE))
    poses[..., :9] = (rotation_matrix(orientations) @ frames).reshape(*poses.shape[:2], 9)
    poses[..., 9:] = positions
    rests, now = np.empty(poses.shape[:2], dtype=bool), rows[1, :, :POSE]
    for s, later in enumerate(poses):
        rests[s] = (later[:, 9:] == now[:, 9:]).all(axis=1) & (
            np.abs(later[:, :9] - now[:, :9]).max(axis=1) <= 4.0 * EPSILON)
        later[rests[s]] = now[rests[s]]
        now = later
    shifts = np.diff(np.concatenate([rows[1:2, :, 9:POSE], positions]), axis=0)
    all_turns = np.concatenate([start[None], orientations])
    turns = [[turn_between(all_turns[s, k], all_turns[s + 1, k]) for k in range(len(frames))]
             for s in range(len(poses))]
    chords = np.where(rests[..., None], 0.0, np.concatenate([shifts, turns], axis=2) / dt)
    changes = np.diff(np.concatenate([rows[:2, :, moves.CHORD:], chords]), axis=0)
    new, old = changes[1:], changes[:-1]
    smaller = np.where(np.abs(new) < np.abs(old), new, old)
    half = np.where(new * old > 0.0, 0.5 * smaller, 0.0)
    doubt = np.where(np.isnan(new), chords, new)
    return np.concatenate([poses, chords - half, chords + half, doubt, chords], axis=2)


@pytest.mark.parametrize('seed', range(20))
def test_rows_are_as_numpy_has_them(seed):
    """Of random moves that go on, stop, come back or stay, to the last bit but the rotations."""
    random = np.random.default_rng(seed)
    steps, count, dt = random.integers(1, 6), random.integers(1, 5), 1.0 / 240.0
    rows = np.full((moves.PAST + steps, count, moves.MOVE), np.nan)
    rows[:2, :, moves.CHORD:] = random.choice([0.0, np.nan, 0.1], (2, count, 1))
    turns = random.normal(size=(1 + steps, count, 4))
    places = random.normal(size=(1 + steps, count, 3))
    for s in range(1, 1 + steps):
        stays = random.random(count) < 0.4
        turns[s, stays], places[s, stays] = turns[s - 1, stays], places[s - 1, stays]
    assert moves.bring_to_unit_norm(2.0 * turns / np.linalg.norm(turns, axis=2)[..., None]) == 0
    turns /= np.linalg.norm(turns, axis=2)[..., None]
    frames = rotation_matrix(turns[-1])
    rows[1, :, 9:POSE] = places[0]
    rows[1, :, :9] = (rotation_matrix(turns[0]) @ frames).reshape(count, 9)
    start = quaternions(rotation_matrix(turns[0]))
    expected = reference(rows, frames, start, places[1:], turns[1:], dt)
    found = fill(rows.copy(), start, places[1:], turns[1:], NO_TWISTS, dt, frames)
    assert_allclose(found[..., :9], expected[..., :9], rtol=0.0, atol=4 * EPSILON)
    assert_array_equal(found[..., 9:], expected[..., 9:])


def test_given_twists():
    """At the start of a move that of the step before, if that was given, else the same."""
    twists = np.arange(12.0).reshape(2, 1, TWIST)
    places, turns = np.ones((2, 1, 3)), np.full((2, 1, 4), UPRIGHT)
    rows = begin(2)
    first = fill(rows, np.empty((0, 4)), places, turns, twists)
    assert_array_equal(first[:, 0, END:DOUBT], twists[:, 0])
    assert_array_equal(first[:, 0, START:END], twists[[0, 0], 0])
    assert_array_equal(first[:, 0, DOUBT:moves.CHORD], 0.0)
    assert np.isnan(first[:, 0, moves.CHORD:]).all()
    rows[:2] = rows[2:]
    later = fill(rows, np.empty((0, 4)), places, turns, 2.0 * twists)
    assert_array_equal(later[0, 0, START:END], twists[1, 0])
