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
Stamped poses of a collider -> its pose at any time.

Poses are played back `delay` late, on a curve that goes through every one of them: piecewise cubic
Hermite in the position and in the rotation vector, with a twist at each stamp from the polynomial
through the stamps around it. Position and twist are continuous, and a constant twist is reproduced
to rounding, so that particles at rest on the collider stay there. What was played never changes.
Quaternions are x, y, z, w; twists and rotation vectors (axis times angle) are in the world frame.
"""

from math import hypot, isfinite
from typing import NamedTuple

from collision_sim.core.pose_play import (add_pose, Bounds, KEPT, new_curve, ORIENTATION, PLACED,
                                          play_curve, POSITION, restart, STAMP, TELEPORT)
from collision_sim.core.rotation import turn_between
import numpy as np

FARTHEST = 1e6              # m from the origin
ZERO, UNIT = 1e-6, 1e-3     # length of a quaternion: taken as zero below, as a unit one within


class PoseError(ValueError):
    """
    A pose that was refused; nothing has changed.

    Attributes
    ----------
    reason : str
        'not_finite', 'too_far', 'zero_quaternion', 'not_unit', 'backwards' or 'repeated'; a stream
        without any pose raises 'no_pose' when it is played.

    """

    def __init__(self, reason, detail):
        """Keep the reason apart from the text."""
        super().__init__('%s: %s' % (reason, detail))
        self.reason = reason


class PoseTrack(NamedTuple):
    """Poses at n times: position (n, 3), orientation (n, 4), twist (n, 6), teleport (n,) bool."""

    position: np.ndarray
    orientation: np.ndarray
    twist: np.ndarray
    teleport: np.ndarray


class Pose(NamedTuple):
    """A pose as it came; teleport: the collider did not move here from the pose before."""

    stamp: float
    position: np.ndarray
    orientation: np.ndarray
    teleport: bool


class PoseStream:
    """
    The motion of one collider from stamped poses that come at 10 to 100 Hz with jitter.

    Beyond the newest pose the collider goes on with its last twist until `timeout` has passed
    since that stamp, then it stands still. When poses come again it catches up within half the
    gap or half the delay, the longer of the two, or is placed where that would be a jump. Before
    the first stamp it stands at the first pose. A pose is a teleport, which has no velocity, after
    a gap longer than `timeout`, and where both the way from the pose before and the way from where
    that one was heading exceed a bound. The curve is of fourth order in the time between stamps as
    long as the stamp after next is known: `delay` should be two periods and the jitter.

    Parameters
    ----------
    delay : float [s]
        Clock time minus time on the curve.
    timeout : float [s]
    teleport_distance : float [m]
    teleport_speed : float [m/s]
        The bound on the distance is this speed times the gap, if that is less.
    teleport_angle : float [rad]
    curve : pose_play.Curve, optional
        Where the poses are kept.

    Attributes
    ----------
    bounds : Bounds
        These parameters; may be replaced before a `restart`.

    """

    def __init__(self, delay=0.1, timeout=0.5, teleport_distance=0.5, teleport_angle=2.0,
                 teleport_speed=30.0, curve=None):
        """Start without any pose."""
        self.bounds = Bounds(delay, timeout, teleport_distance, teleport_angle, teleport_speed)
        self._curve = new_curve() if curve is None else curve

    def reset(self):
        """Forget all poses."""
        self._curve.counts[KEPT] = 0

    def restart(self):
        """Begin the curve anew, with a teleport, at the next time that is asked for."""
        if self.newest is not None:
            restart(self._curve)

    @property
    def newest(self):
        """Stamp of the newest pose [s]; None without any."""
        kept = self._curve.counts[KEPT]
        return self._curve.poses.item(kept - 1, STAMP) if kept else None

    @property
    def newest_pose(self):
        """Newest Pose; None without any."""
        if self.newest is None:
            return None
        row = self._curve.poses[self._curve.counts[KEPT] - 1]
        return Pose(row.item(STAMP), row[POSITION:ORIENTATION].copy(),
                    row[ORIENTATION:PLACED].copy(), bool(row[TELEPORT]))

    def add(self, stamp, position, orientation):
        """
        Take a pose.

        Parameters
        ----------
        stamp : float [s]
            Later than the one before.
        position : (3,) sequence of float [m]
            At most 1e6 m from the origin along each axis.
        orientation : (4,) sequence of float [-]
            x, y, z, w; normalised if its length is within 1e-3 of 1.

        Raises
        ------
        PoseError

        """
        position, orientation = checked_pose(stamp, position, orientation)
        newest = self.newest
        if newest is not None and stamp <= newest:
            raise PoseError('repeated' if stamp == newest else 'backwards',
                            'stamp %.9f after %.9f' % (stamp, newest))
        add_pose(self._curve, self.bounds, float(stamp), position, orientation)

    def sample(self, times):
        """
        Play the curve.

        Parameters
        ----------
        times : (n,) array of float [s]
            Clock times, increasing; `delay` is subtracted here. If they start before the end of
            the last call the curve begins anew there, which is a teleport.

        Returns
        -------
        track : PoseTrack
            teleport[i] says that one lies between the time before (that of the last call for the
            first) and this.

        Raises
        ------
        PoseError
            Without any pose.

        """
        if self.newest is None:
            raise PoseError('no_pose', 'nothing to play')
        times = np.asarray(times, dtype=float) - self.bounds.delay
        out, teleport = np.empty((13, len(times))), np.zeros(len(times), dtype=bool)
        play_curve(self._curve, self.bounds, times, out, teleport)
        return PoseTrack(out[:3].T, out[3:7].T, out[7:].T, teleport)


def way_between(before, after):
    """Shift (3,) and rotation vector (3,) from one pose or knot to another."""
    return (after.position - before.position,
            turn_between(before.orientation, after.orientation))


def checked_pose(stamp, position, orientation):
    """Arrays of a pose, the orientation normalised; PoseError if it cannot be one."""
    x, y, z = position
    length = hypot(*orientation)
    if not (isfinite(stamp) and abs(x) <= FARTHEST and abs(y) <= FARTHEST and abs(z) <= FARTHEST
            and abs(length - 1.0) <= UNIT):
        raise _refusal(stamp, position, orientation, length)
    return np.array(position, dtype=float), np.array(orientation, dtype=float) / length


def _refusal(stamp, position, orientation, length):
    """Give the PoseError of what cannot be a pose."""
    position, orientation = [[float(part) for part in parts] for parts in (position, orientation)]
    if not (isfinite(stamp) and all(map(isfinite, position)) and all(map(isfinite, orientation))):
        return PoseError('not_finite', 'stamp %s, position %s, orientation %s'
                         % (stamp, position, orientation))
    if max(map(abs, position)) > FARTHEST:
        return PoseError('too_far', 'position %s, at most %g m' % (position, FARTHEST))
    if length < ZERO:
        return PoseError('zero_quaternion', 'orientation %s' % orientation)
    return PoseError('not_unit', 'orientation of length %g' % length)
