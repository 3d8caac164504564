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
Moves that are handed over: from poses at the ends of steps to the motion over these steps.

A move is a table (PAST + S, K, MOVE): a row for each of K colliders and S steps, after those of
the two steps before. A row is the pose at the end of the step; the twists at both ends and their
doubt, in the columns of the motion table (motion.py); and the chord, the constant twist that leads
from the pose before to this one. It is NaN where the twists were given, or nothing is known.
"""

from math import isnan, sqrt

from collision_sim.core.jit import entry, formula, kernel
from collision_sim.core.motion import DOUBT, END, POSE, START, TURN, TWIST
from collision_sim.core.rotation import rotated_frames, turn_between
from collision_sim.core.vectors import EPSILON
import numpy as np

PAST = 2                        # rows of steps before a move
CHORD, MOVE = TURN, TURN + TWIST
NORM_TOLERANCE = 1e-3           # how far from 1 the norm of an orientation may be
NONE = -1


@kernel
def _norm(q, s, k):
    return sqrt((q[s, k, 0] * q[s, k, 0] + q[s, k, 2] * q[s, k, 2])
                + (q[s, k, 1] * q[s, k, 1] + q[s, k, 3] * q[s, k, 3]))


@formula
def bring_to_unit_norm(q):
    """
    Divide quaternions by their norms, unless one of these is not 1 within NORM_TOLERANCE.

    Parameters
    ----------
    q : (S, K, 4) float64 [-]
        Overwritten.

    Returns
    -------
    wrong : int
        The first of the K where a norm is wrong, and no quaternion has changed; NONE.

    """
    for k in range(q.shape[1]):
        for s in range(q.shape[0]):
            if not abs(_norm(q, s, k) - 1.0) <= NORM_TOLERANCE:
                return k
    for k in range(q.shape[1]):
        for s in range(q.shape[0]):
            norm = _norm(q, s, k)
            for i in range(4):
                q[s, k, i] /= norm
    return NONE


@kernel
def keep_where_at_rest(rows, s, k):
    """
    Whether a pose differs from the one before by rounding only; then it becomes that.

    An orientation that was read and is given back has been a matrix meanwhile.
    """
    for i in range(9, POSE):
        if rows[s, k, i] != rows[s - 1, k, i]:
            return False
    for i in range(9):
        if not abs(rows[s, k, i] - rows[s - 1, k, i]) <= 4.0 * EPSILON:
            return False
    for i in range(POSE):
        rows[s, k, i] = rows[s - 1, k, i]
    return True


@kernel
def end_twists(rows, s, k):
    """
    Write the twists at both ends of a step, estimated from its chord and the two before.

    Half the change of the chord is added where two successive changes agree in sign, the smaller
    of the two (minmod): second order where the motion is smooth, and the chord itself, which gives
    the right impulse, where the collider starts or stops at once. Their doubt is the change of the
    chord since the step before, at first from rest: the estimates are off by less.
    """
    for i in range(TWIST):
        chord, before = rows[s, k, CHORD + i], rows[s - 1, k, CHORD + i]
        new, old = chord - before, before - rows[s - 2, k, CHORD + i]
        half = 0.0
        if new * old > 0.0:
            half = 0.5 * (new if abs(new) < abs(old) else old)
        rows[s, k, START + i], rows[s, k, END + i] = chord - half, chord + half
        rows[s, k, DOUBT + i] = chord if isnan(new) else new


@kernel
def given_twists(rows, s, k, twists):
    """Write the twists at both ends of a step, where they are given at the ends of all steps."""
    for i in range(TWIST):
        end, before = twists[s - PAST, k, i], rows[s - 1, k, END + i]
        was_given = isnan(rows[s - 1, k, CHORD + i]) and not isnan(before)
        rows[s, k, START + i], rows[s, k, END + i] = before if was_given else end, end
        rows[s, k, DOUBT + i], rows[s, k, CHORD + i] = 0.0, np.nan


@entry
def lay_out_move(rows, frames, start, positions, orientations, twists, dt):
    """
    Fill the rows of a move.

    Parameters
    ----------
    rows : (PAST + S, K, MOVE) float64
        Overwritten from row PAST on. Before it are the chords of the last steps, the twists that
        they ended with, and in row PAST - 1 the poses now.
    frames : (K, 3, 3) float64 [-]
        Rotation of each shape in the frame of its collider.
    start : (K, 4) float64 [-]
        Orientations now, without frames; not read if there are twists.
    positions, orientations : (S, K, 3), (S, K, 4) float64 [m], [-]
        At the ends of the steps; unit quaternions x, y, z, w.
    twists : (S, K, 6) or (0, K, 6) float64
        At the ends of the steps, linear [m/s] and angular [rad/s]; else they are estimated.
    dt : float [s]
        Length of a step; positive.

    """
    turned = rotated_frames(orientations, frames)
    for k in range(rows.shape[1]):
        for s in range(PAST, rows.shape[0]):
            n = s - PAST
            for i in range(9):
                rows[s, k, i] = turned[n, k, i]
            for i in range(3):
                rows[s, k, 9 + i] = positions[n, k, i]
            rests = keep_where_at_rest(rows, s, k)
            if twists.shape[0] > 0:
                given_twists(rows, s, k, twists)
            else:
                if n == 0:
                    turn = turn_between(start[k], orientations[n, k])
                else:
                    turn = turn_between(orientations[n - 1, k], orientations[n, k])
                for i in range(3):
                    before = positions[n - 1, k, i] if n > 0 else rows[s - 1, k, 9 + i]
                    shift = positions[n, k, i] - before
                    rows[s, k, CHORD + i] = 0.0 if rests else shift / dt
                    rows[s, k, CHORD + 3 + i] = 0.0 if rests else turn[i] / dt
                end_twists(rows, s, k)
