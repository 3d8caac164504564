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
Courses of colliders: the pose at any time within a step, for the event-driven method.

A course is a row of numbers: the position moves by a cubic of time plus an oscillation, and the
collider turns at a constant rate about it. Scripted motion is a course exactly. Poses from outside
become cubics with the twists at both ends of the step (Hermite), which is exact for a constant
acceleration; their turning is at the mean rate of the step.
"""

from math import cos, sin

from collision_sim.core.jit import formula, inlined, kernel
from collision_sim.core.motion import END, SHIFT, START, TURN
from collision_sim.core.vectors import add, cross, EPSILON, length, origin, subtract, turned
import numpy as np

# Columns: velocity [m/s], half the acceleration [m/s^2], a sixth of the jerk [m/s^3]; amplitude
# [m], phase [rad] at the start and rate [rad/s] of the oscillation; axis and rate of the turn.
LINEAR, SQUARE, CUBE, AMPLITUDE, PHASE, RATE, AXIS, SPIN, COURSE = 0, 3, 6, 9, 12, 13, 14, 17, 18
NOISE = 16.0 * EPSILON      # relative size of a shift that is only rounding of the positions


def fill_courses(poses, motion, scripted, scripts, first, dt):
    """
    Courses of all colliders over consecutive steps.

    Parameters
    ----------
    poses, motion : (S + 1, C, 12), (S, C, MOTION) float64
        As filled by motion.fill_turns.
    scripted : (K,) int64
        Which colliders follow a script.
    scripts : (C, 10) float64
        As in motion.scripted_pose.
    first : float
        Number of the first of these steps; it starts at time first * dt.
    dt : float [s]
        Length of a step.

    Returns
    -------
    courses : (S, C, COURSE) float64

    """
    courses = np.zeros((*motion.shape[:2], COURSE))
    shift = motion[..., SHIFT:SHIFT + 3]
    v0, v1 = motion[..., START:START + 3], motion[..., END:END + 3]
    square, cube = 3.0 * shift - dt * (2.0 * v0 + v1), dt * (v0 + v1) - 2.0 * shift
    noise = NOISE * (np.abs(poses[1:, :, 9:]) + np.abs(poses[:-1, :, 9:]))
    straight = (np.abs(square) <= noise) & (np.abs(cube) <= noise)
    courses[..., LINEAR:SQUARE] = v0
    courses[..., SQUARE:CUBE] = np.where(straight, 0.0, square / dt ** 2)
    courses[..., CUBE:AMPLITUDE] = np.where(np.abs(cube) <= noise, 0.0, cube / dt ** 3)
    turn = motion[..., TURN:TURN + 3]
    angle = np.linalg.norm(turn, axis=-1)
    courses[..., AXIS:SPIN] = turn / np.where(angle > 0.0, angle, 1.0)[..., None]
    courses[..., SPIN] = angle / dt
    for c in scripted:
        courses[:, c, LINEAR:SQUARE], courses[:, c, SQUARE:AMPLITUDE] = scripts[c, :3], 0.0
        courses[:, c, AMPLITUDE:PHASE] = scripts[c, 6:9]
        courses[:, c, RATE] = 2.0 * np.pi * scripts[c, 9]
        courses[:, c, PHASE] = courses[:, c, RATE] * (first + np.arange(len(courses))) * dt
    return courses


@inlined
def move(courses):
    """Whether any collider moves: else there are no courses."""
    return courses.shape[0] > 0


@inlined
def _three(courses, s, c, k):
    return (courses[s, c, k], courses[s, c, k + 1], courses[s, c, k + 2])


@formula
def _cubic(a, b, c, d):
    return (a[0] + b[0] + c[0] + d[0], a[1] + b[1] + c[1] + d[1], a[2] + b[2] + c[2] + d[2])


@formula
def _scaled(s, a):
    return (s * a[0], s * a[1], s * a[2])


@inlined
def centre(courses, poses, here, c, t):
    """Position [m] of a collider at a time [s] since the start of the step."""
    start = origin(poses, here.start, c)
    if move(courses):
        s, phase = here.step, courses[here.step, c, PHASE]
        moved = _cubic(_scaled(t, _three(courses, s, c, LINEAR)),
                       _scaled(t * t, _three(courses, s, c, SQUARE)),
                       _scaled(t * t * t, _three(courses, s, c, CUBE)),
                       _scaled(sin(phase + courses[s, c, RATE] * t) - sin(phase),
                               _three(courses, s, c, AMPLITUDE)))
        return add(start, moved)
    return start


@kernel
def _centre_velocity(courses, here, c, t):
    s, rate = here.step, courses[here.step, c, RATE]
    return _cubic(_three(courses, s, c, LINEAR), _scaled(2.0 * t, _three(courses, s, c, SQUARE)),
                  _scaled(3.0 * t * t, _three(courses, s, c, CUBE)),
                  _scaled(rate * cos(courses[s, c, PHASE] + rate * t),
                          _three(courses, s, c, AMPLITUDE)))


@inlined
def material_velocity(courses, poses, here, c, t, x):
    """Velocity [m/s] of the material point of a collider that is at x [m] at time t [s]."""
    if move(courses):
        spin = _scaled(courses[here.step, c, SPIN], _three(courses, here.step, c, AXIS))
        arm = subtract(x, centre(courses, poses, here, c, t))
        return add(_centre_velocity(courses, here, c, t), cross(spin, arm))
    return (0.0, 0.0, 0.0)


@kernel
def frame_acceleration(courses, poses, here, c, t, x, w):
    """
    Acceleration [m/s^2] of a particle that moves at constant velocity w in a collider's frame.

    Parameters
    ----------
    courses, poses, here
        As in exact.py.
    c : int
        Which collider.
    t : float [s]
        Since the start of the step.
    x, w : (3,) tuple of float [m], [m/s]
        Position, and velocity relative to the material point there; world frame.

    Returns
    -------
    acceleration : (3,) tuple of float [m/s^2]
        That of the position, the centripetal and the Coriolis one.

    """
    if move(courses):
        s, rate = here.step, courses[here.step, c, RATE]
        spin = _scaled(courses[s, c, SPIN], _three(courses, s, c, AXIS))
        arm = subtract(x, centre(courses, poses, here, c, t))
        own = _cubic(_scaled(2.0, _three(courses, s, c, SQUARE)),
                     _scaled(6.0 * t, _three(courses, s, c, CUBE)),
                     _scaled(-rate * rate * sin(courses[s, c, PHASE] + rate * t),
                             _three(courses, s, c, AMPLITUDE)), (0.0, 0.0, 0.0))
        return add(own, cross(spin, add(add(w, w), cross(spin, arm))))
    return (0.0, 0.0, 0.0)


@kernel
def carried(courses, poses, here, c, x, since, t):
    """Where the material point that was at x [m] at time `since` is at time t [s]."""
    if move(courses):
        start = centre(courses, poses, here, c, since)
        arm, angle = subtract(x, start), courses[here.step, c, SPIN] * (t - since)
        turn = subtract(turned(_three(courses, here.step, c, AXIS), angle, arm), arm)
        shift = subtract(centre(courses, poses, here, c, t), start)
        return add(add(x, shift), turn)     # to the last bit x where it does not move
    return x


@inlined
def spin_rate(courses, here, c):
    """Rate of turn [rad/s]."""
    if move(courses):
        return courses[here.step, c, SPIN]
    return 0.0


@inlined
def spin_axis(courses, here, c):
    """Axis of turn, zero where there is none."""
    if move(courses):
        return _three(courses, here.step, c, AXIS)
    return (0.0, 0.0, 0.0)


@inlined
def is_uniform(courses, here, c):
    """Whether the position moves with a constant acceleration and the collider does not turn."""
    if move(courses):
        s = here.step
        wobble = length(_three(courses, s, c, CUBE)) + (
            length(_three(courses, s, c, AMPLITUDE)) * courses[s, c, RATE])
        return wobble == 0.0 and courses[s, c, SPIN] == 0.0
    return True


@inlined
def accelerates(courses, here, c):
    """Whether the position has a constant acceleration besides its velocity."""
    if move(courses):
        return length(_three(courses, here.step, c, SQUARE)) > 0.0
    return False


@kernel
def largest_jerk(courses, here, c):
    """Bound [m/s^3] on how fast the acceleration of the position changes."""
    if move(courses):
        s, rate = here.step, courses[here.step, c, RATE]
        return (6.0 * length(_three(courses, s, c, CUBE))
                + rate ** 3 * length(_three(courses, s, c, AMPLITUDE)))
    return 0.0


@kernel
def quickest(courses, here, c):
    """Highest rate [rad/s] of turn and oscillation: what limits a step of an integrator."""
    if move(courses):
        swings = length(_three(courses, here.step, c, AMPLITUDE)) > 0.0
        return max(courses[here.step, c, SPIN], courses[here.step, c, RATE] if swings else 0.0)
    return 0.0
