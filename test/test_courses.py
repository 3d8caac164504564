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

"""Courses of colliders within a step, against scripted poses and differences."""

from math import pi

from collision_sim.core import courses
from collision_sim.core.courses import COURSE, CUBE, fill_courses, LINEAR, SPIN, SQUARE
from collision_sim.core.motion import (END, fill_turns, MOTION, script_poses, scripted_pose, START,
                                       TWIST)
from collision_sim.core.rules import Here
from numba import njit
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest

HERE = Here(0, 0, 1, 0, 0, 0.0, None, None, None)
DT = 0.1


@njit
def where(table, poses, c, t, x, w):
    """Centre, velocity and acceleration of the material point, and where x has been carried."""
    return (courses.centre(table, poses, HERE, c, t),
            courses.material_velocity(table, poses, HERE, c, t, x),
            courses.frame_acceleration(table, poses, HERE, c, t, x, w),
            courses.carried(table, poses, HERE, c, x, 0.02, t))


@njit
def bounds(table, c):
    """Give the largest jerk, the quickest rate, and whether uniform and accelerating."""
    return (courses.largest_jerk(table, HERE, c), courses.quickest(table, HERE, c),
            courses.is_uniform(table, HERE, c), courses.accelerates(table, HERE, c))


def scripted(script, steps=3, first=5):
    """Tables of one collider that follows a script, and its pose at the start of them."""
    base = np.concatenate([np.eye(3).ravel(), (0.3, -0.2, 0.5)])
    scripts = np.array([script], dtype=float)
    poses, motion = np.zeros((steps + 1, 1, 12)), np.zeros((steps, 1, MOTION))
    which = np.array([0])
    script_poses(which, base[None], scripts, first, DT, poses, motion, np.empty(TWIST))
    fill_turns(poses, motion)
    return fill_courses(poses, motion, which, scripts, first, DT), poses, base, scripts[0]


SCRIPTS = {'rest': (0, 0, 0, 0, 0, 0, 0, 0, 0, 0), 'shift': (1, -2, 3, 0, 0, 0, 0, 0, 0, 0),
           'turn': (0, 0, 0, 3, 4, 12, 0, 0, 0, 0), 'swing': (0, 0, 0, 0, 0, 0, 0.1, 0, 0.2, 1.5),
           'all': (1, -2, 3, 3, 4, 12, 0.1, 0, 0.2, 1.5)}
every_script = pytest.mark.parametrize('script', SCRIPTS.values(), ids=SCRIPTS)


@every_script
def test_scripted_motion_is_a_course(script):
    """Within a step place and velocity are those of the script, at any time."""
    table, poses, base, script = scripted(script)
    assert table.shape == (3, 1, COURSE)
    pose, twist = np.empty(12), np.empty(TWIST)
    for t in (0.0, 0.03, 0.1):
        scripted_pose(base, script, 5 * DT + t, pose, twist)
        x = pose[9:] + (0.4, 0.1, -0.2)
        middle, v, _, _ = where(table, poses, 0, t, tuple(x), (0.0, 0.0, 0.0))
        assert_allclose(middle, pose[9:], rtol=0.0, atol=1e-14)
        assert_allclose(v, twist[:3] + np.cross(twist[3:], x - pose[9:]), rtol=0.0, atol=1e-13)


@every_script
def test_material_points_move_as_they_say(script):
    """First and second derivative of a carried place are its velocity and acceleration."""
    table, poses, _, _ = scripted(script)
    x, h = (1.0, 0.5, -0.3), 1e-4
    track = [np.array(where(table, poses, 0, t, x, (0.0, 0.0, 0.0))[3])
             for t in (0.02 - h, 0.02, 0.02 + h)]
    assert_allclose(track[1], x, rtol=0.0, atol=1e-15)
    _, v, a, _ = where(table, poses, 0, 0.02, x, (0.0, 0.0, 0.0))
    size = 1.0 + np.linalg.norm(a)
    assert_allclose((track[2] - track[0]) / (2.0 * h), v, rtol=0.0, atol=1e-4 * size)
    assert_allclose((track[2] - 2.0 * track[1] + track[0]) / h ** 2, a, rtol=0.0,
                    atol=1e-4 * size)


def test_coriolis():
    """A particle that moves relative to a turning frame accelerates by 2 omega x w more."""
    table, poses, _, _ = scripted(SCRIPTS['turn'])
    x, w = (1.0, 0.5, -0.3), (0.3, 0.2, -0.7)
    still, moves = (where(table, poses, 0, 0.02, x, u)[2] for u in ((0.0, 0.0, 0.0), w))
    assert_allclose(np.subtract(moves, still), 2.0 * np.cross((3.0, 4.0, 12.0), w), atol=1e-13)


def moved(places, starts, ends):
    """Courses of one collider that follows poses with these velocities at the ends of steps."""
    steps = len(places) - 1
    poses, motion = np.zeros((steps + 1, 1, 12)), np.zeros((steps, 1, MOTION))
    poses[:, 0, :9], poses[:, 0, 9:] = np.eye(3).ravel(), places
    motion[:, 0, START:START + 3], motion[:, 0, END:END + 3] = starts, ends
    fill_turns(poses, motion)
    return fill_courses(poses, motion, np.empty(0, dtype=np.int64), np.zeros((1, 10)), 0, DT)


def test_poses_with_a_constant_acceleration():
    """The cubic between poses is the parabola; one without acceleration is exactly straight."""
    t = DT * np.arange(11.0)[:, None]
    v0, a = np.array((1.0, 0.0, -3.0)), np.array((0.0, 2.0, 5.0))
    table = moved(v0 * t + 0.5 * a * t * t, (v0 + a * t)[:-1], (v0 + a * t)[1:])[:, 0]
    assert_allclose(table[:, LINEAR:SQUARE], (v0 + a * t)[:-1], atol=1e-15)
    assert_allclose(table[:, SQUARE:CUBE], np.tile(0.5 * a, (10, 1)), atol=1e-11)
    assert_array_equal(table[:, CUBE:CUBE + 3], 0.0)
    straight = moved(v0 * t, np.tile(v0, (10, 1)), np.tile(v0, (10, 1)))
    assert_array_equal(straight[:, 0, SQUARE:CUBE + 3], 0.0)


def test_a_cubic_between_poses():
    """Any other change of velocity makes the cubic that has both velocities and both places."""
    t = DT * np.arange(4.0)[:, None]
    place, speed = t ** 3 * (1.0, 2.0, 0.0), 3.0 * t ** 2 * (1.0, 2.0, 0.0)
    table = moved(place, speed[:-1], speed[1:])[:, 0]
    assert_allclose(table[:, CUBE:CUBE + 3], np.tile((1.0, 2.0, 0.0), (3, 1)), atol=1e-12)


@every_script
def test_bounds(script):
    """Nothing turns or swings faster than told; jerks of the position are below their bound."""
    table, poses, _, script = scripted(script)
    jerk, quick, uniform, accelerates = bounds(table, 0)
    rate = 2.0 * pi * script[9]
    assert quick == pytest.approx(max(np.linalg.norm(script[3:6]), rate))
    assert uniform == (quick == 0.0)
    assert not accelerates
    assert table[0, 0, SPIN] == pytest.approx(np.linalg.norm(script[3:6]))
    assert jerk == pytest.approx(rate ** 3 * np.linalg.norm(script[6:9]))
