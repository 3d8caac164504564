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
The curve through stamped poses as it grows and is played, compiled; PoseStream says what it is.

What is known of a stream is a Curve: its poses, and the cubic on which it is now. A knot is where
the curve ends so far; the next cubic begins there. Those before are not needed any more.
"""

from math import inf, nan, sqrt
from typing import NamedTuple

from collision_sim.core.jit import counted, law
from collision_sim.core.pose_curve import cubic, cubic_between, play, turned, twist_at
from collision_sim.core.rotation import turn_between
import numpy as np

BEFORE, AFTER = 3, 1        # stamps around one from which its twist is estimated
BEFORE_NEWEST = 2           # the same for the newest stamp
SHORTEST = 0.002            # s; poses that follow closer replace each other
CAPACITY = 1000             # poses kept while nobody plays them

# Columns of the poses, each a row; those up to PLACED are also the columns of the knot, whose
# twist follows.
STAMP, POSITION, ORIENTATION, TELEPORT, PLACED = 0, 1, 4, 8, 8
# Counts: poses; index of the newest pose on the curve; whether the curve ends at that pose; where
# the knot stands.
KEPT, USED, ON_POSE, STATE = 0, 1, 2, 3
NO_KNOT, NO_TWIST, COMPLETE = 0, 1, 2       # of a knot without a twist it is to be estimated
# Times: start of the cubic, teleport that is still to be played (NaN: none), last time played.
START, JUMP, PLAYED = 0, 1, 2


class Curve(NamedTuple):
    """Tables with the columns above; the cubic (12, 4) turns from the orientation base (4,)."""

    poses: np.ndarray
    counts: np.ndarray
    knot: np.ndarray
    times: np.ndarray
    cubic: np.ndarray
    base: np.ndarray


class Bounds(NamedTuple):
    """Delay and time-out [s]; what is a teleport: distance [m], angle [rad] and speed [m/s]."""

    delay: float
    timeout: float
    teleport_distance: float
    teleport_angle: float
    teleport_speed: float


def new_curve():
    """Give a Curve without poses."""
    return Curve(np.zeros((CAPACITY + 1, TELEPORT + 1)), np.zeros(4, dtype=np.int64),
                 np.zeros(PLACED + 6), np.zeros(3), np.zeros((12, 4)), np.zeros(4))


@law
def restart(curve):
    """Begin anew, with a teleport, at the next time that is asked for."""
    curve.counts[USED], curve.counts[ON_POSE], curve.counts[STATE] = 0, 1, NO_KNOT
    curve.times[JUMP], curve.times[PLAYED] = nan, -inf


@law
def add_pose(curve, bounds, stamp, position, orientation):
    """Take a pose that is later than all before; orientation of unit norm, either sign."""
    poses, counts = curve.poses, curve.counts
    n = counts[KEPT]
    if n == 0:
        restart(curve)
    unused = counts[STATE] == NO_KNOT or counts[USED] < n - 1
    if n > 1 and unused and poses[n - 1, STAMP] - poses[n - 2, STAMP] < SHORTEST:
        n -= 1
    sign = 1.0
    if n > 0:
        before = poses[n - 1]
        same = (before[4] * orientation[0] + before[5] * orientation[1]
                + before[6] * orientation[2] + before[7] * orientation[3])
        sign = -1.0 if same < 0.0 else 1.0
    poses[n, STAMP], poses[n, TELEPORT] = stamp, 0.0
    for k in range(3):
        poses[n, POSITION + k] = position[k]
    for k in range(4):
        poses[n, ORIENTATION + k] = sign * orientation[k]
    counts[KEPT] = n + 1
    if n > 0 and _is_teleport(poses, n, bounds):
        poses[n, TELEPORT] = 1.0
    if n + 1 > CAPACITY:
        _drop(curve, 1)


@law
def play_curve(curve, bounds, times, out, teleport):
    """
    Play the curve at some times.

    Parameters
    ----------
    curve : Curve
        Of at least one pose.
    bounds : Bounds
        Of the stream.
    times : (n,) float64 [s]
        On the curve, increasing.
    out : (13, n) float64
        Position, orientation and twist; overwritten.
    teleport : (n,) bool
        Set where a teleport lies between the time before and this.

    """
    last = times[-1]
    if times[0] < curve.times[PLAYED]:
        restart(curve)
    if curve.counts[STATE] == NO_KNOT:
        _start(curve, times[0])
    _note_teleport(curve.times, times, teleport)
    for n in range(len(times)):
        while curve.knot[STAMP] < last and curve.knot[STAMP] <= times[n]:
            _extend(curve, bounds, last)
            _note_teleport(curve.times, times, teleport)
        play(curve.cubic, curve.times[START], curve.base, times, n, n + 1, out)
    curve.times[PLAYED] = last
    _drop(curve, max(curve.counts[USED] - BEFORE, 0))


@counted
def _note_teleport(marks, times, teleport):
    """Flag the first time at or after a teleport, if it is one of these."""
    if marks[JUMP] <= times[-1]:
        teleport[np.searchsorted(times, marks[JUMP])] = True
        marks[JUMP] = nan


@counted
def _drop(curve, count):
    """Forget the oldest poses."""
    poses, counts = curve.poses, curve.counts
    if count == 0:
        return
    for n in range(count, counts[KEPT]):
        poses[n - count] = poses[n]
    counts[KEPT] -= count
    counts[USED] -= count
    if counts[USED] < 0:
        restart(curve)


@counted
def _length(vector):
    return sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])


@counted
def _way(before, after):
    """Shift (3,) from one pose or knot to another."""
    return after[POSITION:ORIENTATION] - before[POSITION:ORIENTATION]


@counted
def _turn(before, after):
    """Rotation vector (3,) from one pose or knot to another."""
    return turn_between(before[ORIENTATION:PLACED], after[ORIENTATION:PLACED])


@counted
def _is_teleport(poses, n, bounds):
    """Whether pose n cannot be a motion from the one before."""
    gap = poses[n, STAMP] - poses[n - 1, STAMP]
    if gap > bounds.timeout:
        return True
    way, turn = _way(poses[n - 1], poses[n]), _turn(poses[n - 1], poses[n])
    farthest = min(bounds.teleport_distance, bounds.teleport_speed * gap)
    far, wide = _length(way), _length(turn)
    if far <= farthest and wide <= bounds.teleport_angle:
        return False
    if n > 1 and poses[n - 1, STAMP] - poses[n - 2, STAMP] <= bounds.timeout:   # where it headed
        ratio = gap / (poses[n - 1, STAMP] - poses[n - 2, STAMP])
        far = min(far, _length(way - ratio * _way(poses[n - 2], poses[n - 1])))
        wide = min(wide, _length(turn - ratio * _turn(poses[n - 2], poses[n - 1])))
    return far > farthest or wide > bounds.teleport_angle


@counted
def _start(curve, time):
    """Begin the curve at the newest pose before a time, or stand still until the first."""
    used = curve.counts[KEPT] - 1
    while used > 0 and curve.poses[used, STAMP] > time:
        used -= 1
    curve.counts[USED], curve.counts[STATE] = used, NO_TWIST
    curve.knot[:PLACED] = curve.poses[used, :PLACED]
    curve.knot[PLACED:] = 0.0
    curve.times[JUMP] = min(time, curve.knot[STAMP])
    _append(curve, curve.times[JUMP], cubic(
        curve.knot[POSITION:ORIENTATION], np.zeros(6), np.zeros(6), np.zeros(6)))


@counted
def _append(curve, start, table):
    """Go on with a cubic that leaves the end of the curve at a time."""
    curve.times[START] = start
    curve.base[:] = curve.knot[ORIENTATION:PLACED]
    curve.cubic[:] = table


@counted
def _extend(curve, bounds, until):
    """Add the next piece of the curve; it coasts no longer than to `until`."""
    poses, counts, knot = curve.poses, curve.counts, curve.knot
    if counts[STATE] == NO_TWIST:
        knot[PLACED:] = _twist(curve, counts[USED])
        counts[STATE] = COMPLETE
    following = counts[USED] + 1
    if following == counts[KEPT]:
        _coast(curve, bounds, until)
    elif poses[following, TELEPORT] != 0.0:
        if knot[STAMP] < poses[following, STAMP]:
            _coast(curve, bounds, min(until, poses[following, STAMP]))
        else:
            _jump(curve, following)
    elif counts[ON_POSE] != 0:
        _lead(curve, following, poses[following, STAMP])
    else:
        _catch_up(curve, bounds, following)


@counted
def _catch_up(curve, bounds, following):
    """Lead the curve back to the poses, or to where the newest one would be by then."""
    poses, counts, knot = curve.poses, curve.counts, curve.knot
    gap = poses[following, STAMP] - poses[counts[USED], STAMP]
    soonest = knot[STAMP] + 0.5 * max(gap, bounds.delay)
    target = following
    while (poses[target, STAMP] < soonest and target + 1 < counts[KEPT]
           and poses[target + 1, TELEPORT] == 0.0):
        target += 1
    time = max(soonest, poses[target, STAMP])
    if (time - poses[target, STAMP] > bounds.timeout
            or _length(_way(knot, poses[target])) > bounds.teleport_distance
            or _length(_turn(knot, poses[target])) > bounds.teleport_angle):
        _jump(curve, target)
    else:
        _lead(curve, target, time)


@counted
def _lead(curve, target, time):
    """Add the cubic to a pose, or to where its twist leads by a later time."""
    pose, twist, end = curve.poses[target], _twist(curve, target), np.empty(PLACED + 6)
    end[:PLACED], end[PLACED:] = pose[:PLACED], twist
    if time > pose[STAMP]:
        _move(end, time - pose[STAMP])
    knot = curve.knot
    _append(curve, knot[STAMP], cubic_between(
        knot[POSITION:ORIENTATION], knot[ORIENTATION:PLACED], knot[PLACED:],
        end[POSITION:ORIENTATION], end[ORIENTATION:PLACED], twist, time - knot[STAMP]))
    knot[:] = end
    knot[STAMP] = time
    curve.counts[USED], curve.counts[ON_POSE] = target, time <= pose[STAMP]


@counted
def _coast(curve, bounds, until):
    """Go on with the last twist, but stand still from the time-out on."""
    limit, knot = curve.poses[curve.counts[USED], STAMP] + bounds.timeout, curve.knot
    if knot[STAMP] >= limit:
        knot[PLACED:] = 0.0
        end = until
    else:
        end = min(until, limit)
    _append(curve, knot[STAMP], cubic(
        knot[POSITION:ORIENTATION], knot[PLACED:], np.zeros(6), np.zeros(6)))
    _move(knot, end - knot[STAMP])
    curve.counts[ON_POSE] = 0


@counted
def _jump(curve, target):
    """Place the collider at a pose that has arrived; late ones bring no twist."""
    pose, knot, counts = curve.poses[target], curve.knot, curve.counts
    time = max(knot[STAMP], pose[STAMP])
    on_pose = time == pose[STAMP]
    counts[USED], counts[ON_POSE] = target, on_pose
    counts[STATE] = NO_TWIST if on_pose else COMPLETE
    knot[:PLACED], knot[PLACED:] = pose[:PLACED], 0.0
    knot[STAMP] = curve.times[JUMP] = time


@counted
def _twist(curve, i):
    """Twist (6,) at pose i from the poses around it that no teleport parts from it."""
    poses, last = curve.poses, i
    while last < min(i + AFTER, curve.counts[KEPT] - 1) and poses[last + 1, TELEPORT] == 0.0:
        last += 1
    first = i
    before = BEFORE if last > i else BEFORE_NEWEST
    while first > max(i - before, 0) and poses[first, TELEPORT] == 0.0:
        first -= 1
    if first == last:
        return np.zeros(6)
    around = poses[first:last + 1]
    return twist_at(around[:, STAMP] - poses[i, STAMP], around[:, POSITION:ORIENTATION],
                    around[:, ORIENTATION:PLACED], i - first)


@counted
def _move(knot, duration):
    """Move a knot on at its twist."""
    knot[STAMP] += duration
    for k in range(3):
        knot[POSITION + k] += duration * knot[PLACED + k]
    knot[ORIENTATION:PLACED] = turned(knot[ORIENTATION:PLACED], duration * knot[PLACED + 3:])
