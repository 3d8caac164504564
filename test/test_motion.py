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

"""Motion of colliders: scripts, chords of material points, twists estimated from poses."""

from math import cos, pi, sin

from collision_sim.core import motion as core
from collision_sim.core.rotation import exponential, rotation_matrix
from numba import njit
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest

BASE = np.array((*rotation_matrix((0.5, 0.5, 0.5, 0.5)).ravel(), 1.0, 2.0, 3.0))


def script(linear=(0, 0, 0), angular=(0, 0, 0), swing=(0, 0, 0), frequency=0.0):
    """Row of the table of scripts."""
    return np.array((*linear, *angular, *swing, frequency), dtype=float)


def pose_and_twist(row, time):
    """Pose and twist of a scripted collider."""
    pose, twist = np.empty(12), np.empty(6)
    core.scripted_pose(BASE, row, time, pose, twist)
    return pose, twist


def test_script_without_motion_is_the_start():
    """Bit for bit, also after a long time."""
    for time in (0.0, 1.0, 1e9):
        pose, twist = pose_and_twist(script(), time)
        assert_array_equal(pose, BASE)
        assert_array_equal(twist, 0.0)


def test_script_of_a_constant_twist():
    """Position by v t; the orientation turned about the axis by w t, in the world frame."""
    angular = np.array((0.3, -0.4, 1.2))
    for time in (0.0, 0.1, 7.0, 1e4):
        pose, twist = pose_and_twist(script((1.0, 0.0, -2.0), angular), time)
        assert_allclose(pose[9:], (1.0 + time, 2.0, 3.0 - 2.0 * time), rtol=1e-15)
        q, _, _ = exponential(angular * time)
        expected = rotation_matrix(q) @ BASE[:9].reshape(3, 3)
        assert_allclose(pose[:9].reshape(3, 3), expected, rtol=0.0, atol=1e-15 * (1.0 + time) * 9)
        assert_allclose(twist, (1.0, 0.0, -2.0, *angular), rtol=1e-15)


def test_script_of_an_oscillation():
    """A sin(2 pi f t) and its derivative."""
    row = script(swing=(0.0, 0.3, 0.4), frequency=1.5)
    for time in (0.0, 0.11, 2.0):
        pose, twist = pose_and_twist(row, time)
        phase = 2.0 * pi * 1.5
        assert_allclose(pose[9:] - BASE[9:], np.array((0.0, 0.3, 0.4)) * sin(phase * time),
                        atol=1e-14)
        assert_allclose(twist[:3], np.array((0.0, 0.3, 0.4)) * phase * cos(phase * time),
                        atol=1e-13)


def test_turn_does_not_accumulate_errors():
    """After 1e6 revolutions the rotation is still orthogonal, and where it should be."""
    pose, _ = pose_and_twist(script(angular=(0.0, 0.0, 2.0 * pi)), 1e6)
    matrix = pose[:9].reshape(3, 3)
    assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-15)
    assert_allclose(matrix, BASE[:9].reshape(3, 3), atol=1e-9)


def test_tables_of_scripts():
    """Poses of consecutive steps, twists at both of their ends; other colliders are left alone."""
    scripts = np.array((script(), script((1.0, 0.0, 0.0), (0.0, 0.0, 2.0), (0, 0, 1), 0.5)))
    bases, dt = np.stack([BASE, BASE]), 0.25
    poses, motion = np.full((4, 2, 12), 9.0), np.full((3, 2, core.MOTION), 9.0)
    core.script_poses(np.array([1]), bases, scripts, 6, dt, poses, motion, np.empty(6))
    assert_array_equal(poses[:, 0], 9.0)
    assert_array_equal(motion[:, 0], 9.0)
    for s in range(4):
        pose, twist = pose_and_twist(scripts[1], (6 + s) * dt)
        assert_array_equal(poses[s, 1], pose)
        if s < 3:
            assert_array_equal(motion[s, 1, core.START:core.END], twist)
        if s > 0:
            assert_array_equal(motion[s - 1, 1, core.END:core.DOUBT], twist)


@njit
def chord(motion, poses, point, dt):
    """Call a kernel, which has no entry from Python."""
    return core.chord_velocity(motion, poses, 0, 0, 0, point, dt)


@njit
def velocity(motion, poses, which, point):
    """Call a kernel, which has no entry from Python."""
    return core.point_velocity(motion, poses, 0, which, 0, 0, point)


@pytest.mark.parametrize('turn', [(0.0, 0.0, 0.0), (0.0, 0.0, 1e-9), (0.1, 0.2, -0.3),
                                  (0.0, 3.0, 0.0)])
def test_chord_keeps_a_rider_in_place(turn):
    """A particle that moves with the chord velocity keeps its place on the collider."""
    random, dt = np.random.default_rng(2), 0.01
    q, _, _ = exponential(np.array(turn, dtype=float))
    after = rotation_matrix(q) @ BASE[:9].reshape(3, 3)
    poses = np.stack([BASE, (*after.ravel(), 1.5, 1.0, 7.0)])[:, None]
    motion = np.zeros((1, 1, core.MOTION))
    core.fill_turns(poses, motion)
    for point in random.normal(size=(20, 3)) * 3.0:
        place = BASE[:9].reshape(3, 3).T @ (point - BASE[9:])
        moved = point + dt * np.array(chord(motion, poses, tuple(point), dt))
        assert_allclose(moved, after @ place + poses[1, 0, 9:], rtol=0.0, atol=1e-14)


def test_turns_of_what_does_not_turn_are_exactly_zero():
    """Else a particle would creep on an inclined collider that only shifts."""
    matrix = rotation_matrix(np.array((0.1, 0.2, 0.3, np.sqrt(1.0 - 0.14))))
    poses = np.array([(*matrix.ravel(), 0.0, 0.0, 0.0), (*matrix.ravel(), 1.0, 2.0, 3.0)])[:, None]
    motion = np.ones((1, 1, core.MOTION))
    core.fill_turns(poses, motion)
    assert_array_equal(motion[0, 0, :9], 0.0)
    assert_array_equal(motion[0, 0, 9:12], (1.0, 2.0, 3.0))


def test_velocity_of_a_material_point():
    """V + w x r, at either end of a step; nothing moves where there is no table."""
    motion = np.zeros((1, 1, core.MOTION))
    motion[0, 0, core.START:core.END] = (1.0, 2.0, 3.0, 0.0, 0.0, 2.0)
    motion[0, 0, core.END:core.DOUBT] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    poses = BASE[None, None]
    point = (2.0, 2.0, 4.0)                                    # (1, 0, 1) from the origin
    assert velocity(motion, poses, core.START, point) == (1.0, 4.0, 3.0)
    assert velocity(motion, poses, core.END, point) == (0.0, -1.0, 0.0)
    assert velocity(None, poses, core.START, point) == (0.0, 0.0, 0.0)
    assert chord(None, poses, point, 0.1) == (0.0, 0.0, 0.0)
