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
Rigid motion of colliders: poses over the steps of a call, and velocities of material points.

A pose is 12 numbers: the rotation in row order, then the position [m]. A twist is 6 numbers:
linear velocity of the position [m/s], then angular velocity [rad/s], world frame. Twists come from
the script or the pose stream where these know them, else from the chords between poses.
"""

from math import atan2, cos, pi, sin, sqrt

from collision_sim.core.jit import formula, kernel
from collision_sim.core.vectors import add, cross, dot, origin, subtract
import numpy as np

POSE, TWIST, SCRIPT = 12, 6, 10         # row lengths of the tables
# Columns of the motion table (S, C, MOTION), one row of zeros where no collider moves:
# R(t+dt) R(t)^T - 1 in row order, shift of the position [m], twists at both ends of a step, the
# change of the twist since the step before where these are estimated from the poses (else 0), and
# the turn of the step, axis times angle [rad].
SHIFT, START, END, DOUBT, TURN, MOTION = 9, 12, 18, 24, 30, 33


@kernel
def turn_about(axis, angle, matrix, out):
    """Write rotation(axis, angle) times matrix (9,) to out[:9], by Rodrigues' formula."""
    s, c = sin(angle), 2.0 * sin(0.5 * angle) ** 2
    for j in range(3):
        column = (matrix[j], matrix[3 + j], matrix[6 + j])
        first = cross(axis, column)
        second = cross(axis, first)
        for i in range(3):
            out[3 * i + j] = column[i] + s * first[i] + c * second[i]


@formula
def scripted_pose(base, script, time, pose, twist):
    """
    Write the pose and twist of a scripted collider at a time, exactly, not by accumulation.

    Parameters
    ----------
    base : (12,) float64
        Pose at time 0.
    script : (10,) float64
        Linear velocity [m/s], angular velocity [rad/s], axis times amplitude [m], frequency [Hz].
    time : float [s]
        Since the start.
    pose, twist : (12,), (6,) float64
        Overwritten.

    """
    phase = 2.0 * pi * script[9]
    swing, speed = sin(phase * time), phase * cos(phase * time)
    for i in range(3):
        pose[9 + i] = base[9 + i] + script[i] * time + script[6 + i] * swing
        twist[i] = script[i] + script[6 + i] * speed
        twist[3 + i] = script[3 + i]
    rate = sqrt(script[3] ** 2 + script[4] ** 2 + script[5] ** 2)
    if rate > 0.0:
        axis = (script[3] / rate, script[4] / rate, script[5] / rate)
        turn_about(axis, rate * time, base, pose)
    else:
        for k in range(9):
            pose[k] = base[k]


@formula
def script_poses(scripted, bases, scripts, first, dt, poses, motion, twist):
    """
    Fill the tables of the scripted colliders over consecutive steps.

    Parameters
    ----------
    scripted : (K,) int64
        Which colliders follow a script.
    bases, scripts : (C, 12), (C, 10) float64
        As in `scripted_pose`.
    first : int
        Number of the first of these steps; it starts at time first * dt.
    dt : float [s]
        Length of a step.
    poses, motion : (S + 1, C, 12), (S, C, MOTION) float64
        Overwritten for these colliders: the poses, and the twists in motion.
    twist : (6,) float64
        Scratch.

    """
    for j in range(scripted.shape[0]):
        c = scripted[j]
        for s in range(poses.shape[0]):
            scripted_pose(bases[c], scripts[c], (first + s) * dt, poses[s, c], twist)
            if s < motion.shape[0]:
                for k in range(TWIST):
                    motion[s, c, START + k] = twist[k]
                for k in range(3):
                    motion[s, c, TURN + k] = dt * twist[3 + k]
            if s > 0:
                for k in range(TWIST):
                    motion[s - 1, c, END + k] = twist[k]


@kernel
def fill_turn(out):
    """Write the turn of a step, the shortest way, from the matrix in its row, if not given."""
    if out[TURN] != 0.0 or out[TURN + 1] != 0.0 or out[TURN + 2] != 0.0:
        return
    s = (0.5 * (out[7] - out[5]), 0.5 * (out[2] - out[6]), 0.5 * (out[3] - out[1]))
    sine, cosine = sqrt(dot(s, s)), 1.0 + 0.5 * (out[0] + out[4] + out[8])
    if sine > 0.0:
        angle = atan2(sine, cosine)
        for k in range(3):
            out[TURN + k] = s[k] * (angle / sine)


@formula
def fill_turns(poses, motion):
    """Write turn and shift of every step, from poses (S + 1, C, 12), to motion (S, C, MOTION)."""
    for s in range(motion.shape[0]):
        for c in range(motion.shape[1]):
            a, b, out = poses[s, c], poses[s + 1, c], motion[s, c]
            same = True
            for k in range(9):
                same = same and a[k] == b[k]
            for i in range(3):
                for j in range(3):
                    out[3 * i + j] = 0.0 if same else (
                        b[3 * i] * a[3 * j] + b[3 * i + 1] * a[3 * j + 1]
                        + b[3 * i + 2] * a[3 * j + 2] - (1.0 if i == j else 0.0))
                out[SHIFT + i] = b[9 + i] - a[9 + i]
            fill_turn(out)


@formula
def _fill_parts(poses, motion, finer, changes):
    """Write the poses and twists of the parts of a step, for `subdivide`."""
    parts = changes.shape[0]
    for c in range(poses.shape[1]):
        whole, turn = motion[0, c], motion[0, c, TURN:]
        angle = sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
        for k in range(1, parts):
            if angle > 0.0:
                turn_about((turn[0] / angle, turn[1] / angle, turn[2] / angle),
                           angle * k / parts, poses[0, c], finer[k, c])
            for i in range(3):
                finer[k, c, 9 + i] = poses[0, c, 9 + i] + whole[SHIFT + i] * k / parts
        for k in range(parts):
            for i in range(TWIST):
                first, change = whole[START + i], whole[END + i] - whole[START + i]
                changes[k, c, START + i] = first + change * k / parts
                changes[k, c, END + i] = first + change * (k + 1) / parts
            for i in range(3):
                changes[k, c, TURN + i] = turn[i] / parts
            for i in range(TWIST):
                changes[k, c, DOUBT + i] = whole[DOUBT + i]


def subdivide(poses, motion, parts):
    """
    Divide a step of moving colliders into equal parts.

    Parameters
    ----------
    poses, motion : (2, C, 12), (1, C, MOTION) float64
        At the ends of the step, and within it.
    parts : int
        How many; 1 gives the step itself.

    Returns
    -------
    poses, motion : (parts + 1, C, 12), (parts, C, MOTION) float64
        On the screw between the two poses; the twists change evenly.

    """
    if parts == 1:
        return poses, motion
    finer = np.repeat(poses[:1], parts + 1, axis=0)
    finer[-1] = poses[1]
    changes = np.zeros((parts, *motion.shape[1:]))
    _fill_parts(poses, motion, finer, changes)
    fill_turns(finer, changes)
    return finer, changes


@kernel
def chord_velocity(motion, poses, step, start, c, point, dt):
    """
    Mean velocity over a step of the material point of a collider that starts at `point`.

    Parameters
    ----------
    motion : (S, C, MOTION) float64 or None
        None where it is known that the collider does not move (planes.py).
    poses : (S + 1, C, 12) float64
        Poses of all colliders.
    step, start, c : int
        Row of motion, row of poses at the start of the step, collider.
    point : (3,) tuple of float [m]
        World frame, at the start of the step.
    dt : float [s]
        Length of the step.

    Returns
    -------
    velocity : (3,) tuple of float [m/s]
        (X(t+dt) X(t)^-1 x - x) / dt, which keeps a particle that rides along in place.

    """
    if motion is not None:
        a = subtract(point, origin(poses, start, c))
        return (
            (motion[step, c, 9] + (motion[step, c, 0] * a[0] + motion[step, c, 1] * a[1]
                                   + motion[step, c, 2] * a[2])) / dt,
            (motion[step, c, 10] + (motion[step, c, 3] * a[0] + motion[step, c, 4] * a[1]
                                    + motion[step, c, 5] * a[2])) / dt,
            (motion[step, c, 11] + (motion[step, c, 6] * a[0] + motion[step, c, 7] * a[1]
                                    + motion[step, c, 8] * a[2])) / dt)
    return (0.0, 0.0, 0.0)


@kernel
def point_velocity(motion, poses, step, which, row, c, point):
    """
    Velocity of the material point of a collider at one end of a step, or its change.

    Parameters
    ----------
    motion, poses, step, c, point
        As in `chord_velocity`.
    which : int
        START or END, or DOUBT: by how much the velocity at the ends may be off.
    row : int
        Row of poses at that end.

    Returns
    -------
    velocity : (3,) tuple of float [m/s]

    """
    if motion is not None:
        k = which
        linear = (motion[step, c, k], motion[step, c, k + 1], motion[step, c, k + 2])
        angular = (motion[step, c, k + 3], motion[step, c, k + 4], motion[step, c, k + 5])
        return add(linear, cross(angular, subtract(point, origin(poses, row, c))))
    return (0.0, 0.0, 0.0)
