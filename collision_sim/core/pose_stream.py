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

from bisect import bisect_right
from math import hypot, inf, isfinite
from typing import NamedTuple

from collision_sim.core.pose_curve import cubic, cubic_between, play, turned, twist_at
from collision_sim.core.rotation import turn_between
import numpy as np

BEFORE, AFTER = 3, 1        # stamps around one from which its twist is estimated
BEFORE_NEWEST = 2           # the same for the newest stamp
SHORTEST = 0.002            # s; poses that follow closer replace each other
FARTHEST = 1e6              # m from the origin
ZERO, UNIT = 1e-6, 1e-3     # length of a quaternion: taken as zero below, as a unit one within
CAPACITY = 1000             # poses kept while nobody plays them
STILL = np.zeros(6)         # a twist


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


class _Knot(NamedTuple):
    """Where the curve ends so far; a twist of None is estimated when the curve goes on."""

    time: float
    position: np.ndarray
    orientation: np.ndarray
    twist: np.ndarray


class _Piece(NamedTuple):
    """A cubic of pose_curve.py, from `start` and an orientation on."""

    start: float
    table: np.ndarray
    orientation: np.ndarray


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

    """

    def __init__(self, delay=0.1, timeout=0.5, teleport_distance=0.5, teleport_angle=2.0,
                 teleport_speed=30.0):
        """Start without any pose."""
        self.delay = delay
        self.timeout = timeout
        self.teleport_distance = teleport_distance
        self.teleport_angle = teleport_angle
        self.teleport_speed = teleport_speed
        self.reset()

    def reset(self):
        """Forget all poses."""
        self._poses = []
        self.restart()

    def restart(self):
        """Begin the curve anew, with a teleport, at the next time that is asked for."""
        self._knot = None           # end of the curve so far
        self._used = 0              # index of the newest pose on the curve
        self._on_pose = True        # the curve ends at that pose
        self._pieces = []
        self._jumps = []            # times of teleports on the curve
        self._played = -inf

    @property
    def newest(self):
        """Stamp of the newest pose [s]; None without any."""
        return self._poses[-1].stamp if self._poses else None

    @property
    def newest_pose(self):
        """Newest Pose; None without any."""
        return self._poses[-1] if self._poses else None

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
        poses = self._poses
        if poses and stamp <= poses[-1].stamp:
            raise PoseError('repeated' if stamp == poses[-1].stamp else 'backwards',
                            'stamp %.9f after %.9f' % (stamp, poses[-1].stamp))
        if self._is_provisional():
            poses.pop()
        if poses and poses[-1].orientation @ orientation < 0.0:
            orientation = -orientation
        poses.append(Pose(stamp, position, orientation, False))
        if len(poses) > 1:
            poses[-1] = poses[-1]._replace(teleport=self._is_teleport())
        if len(poses) > CAPACITY:
            self._drop(1)

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
        if not self._poses:
            raise PoseError('no_pose', 'nothing to play')
        times = np.asarray(times, dtype=float) - self.delay
        if times[0] < self._played:
            self.restart()
        if self._knot is None:
            self._start(times[0])
        while self._knot.time < times[-1]:
            self._extend(times[-1])
        track = self._evaluate(times)
        self._forget(times[-1])
        return track

    def _is_provisional(self):
        """Whether the newest pose follows the one before too closely to be kept, and is unused."""
        poses = self._poses
        unused = self._knot is None or self._used < len(poses) - 1
        return len(poses) > 1 and unused and poses[-1].stamp - poses[-2].stamp < SHORTEST

    def _is_teleport(self):
        """Whether the newest pose cannot be a motion from the one before."""
        *older, before, new = self._poses[-3:]
        gap = new.stamp - before.stamp
        way, turn = way_between(before, new)
        if gap > self.timeout:
            return True
        farthest = min(self.teleport_distance, self.teleport_speed * gap)
        if hypot(*way) <= farthest and hypot(*turn) <= self.teleport_angle:
            return False
        expected_way, expected_turn = np.zeros(3), np.zeros(3)
        if older and before.stamp - older[0].stamp <= self.timeout:
            ratio = gap / (before.stamp - older[0].stamp)
            expected_way, expected_turn = (ratio * part for part in way_between(older[0], before))
        return (min(hypot(*way), hypot(*(way - expected_way))) > farthest
                or min(hypot(*turn), hypot(*(turn - expected_turn))) > self.teleport_angle)

    def _drop(self, count):
        """Forget the oldest poses."""
        del self._poses[:count]
        self._used -= count
        if self._used < 0:
            self.restart()

    def _start(self, time):
        """Begin the curve at the newest pose before a time, or stand still until the first."""
        self._used = max(bisect_right([pose.stamp for pose in self._poses], time) - 1, 0)
        pose = self._poses[self._used]
        self._knot = _Knot(pose.stamp, pose.position, pose.orientation, None)
        begin = min(time, pose.stamp)
        self._jumps.append(begin)
        self._append(begin, cubic(pose.position, STILL, STILL, STILL))

    def _extend(self, until):
        """Add the next piece of the curve; it coasts no longer than to `until`."""
        if self._knot.twist is None:
            self._knot = self._knot._replace(twist=self._twist(self._used))
        following = self._used + 1
        if following == len(self._poses):
            self._coast(until)
        elif self._poses[following].teleport:
            if self._knot.time < self._poses[following].stamp:
                self._coast(min(until, self._poses[following].stamp))
            else:
                self._jump(following)
        elif self._on_pose:
            self._curve(following, self._poses[following].stamp)
        else:
            self._catch_up(following)

    def _catch_up(self, following):
        """Lead the curve back to the poses, or to where the newest one would be by then."""
        poses, knot = self._poses, self._knot
        gap = poses[following].stamp - poses[self._used].stamp
        soonest = knot.time + 0.5 * max(gap, self.delay)
        target = following
        while (poses[target].stamp < soonest and target + 1 < len(poses)
               and not poses[target + 1].teleport):
            target += 1
        time = max(soonest, poses[target].stamp)
        way, turn = way_between(knot, poses[target])
        if (time - poses[target].stamp > self.timeout or hypot(*way) > self.teleport_distance
                or hypot(*turn) > self.teleport_angle):
            self._jump(target)
        else:
            self._curve(target, time)

    def _curve(self, target, time):
        """Add the cubic to a pose, or to where its twist leads by a later time."""
        pose, knot = self._poses[target], self._knot
        twist = self._twist(target)
        lead = time - pose.stamp
        end = _moved(pose, twist, lead) if lead > 0.0 else pose
        self._append(knot.time, cubic_between(
            knot.position, knot.orientation, knot.twist, end.position, end.orientation, twist,
            time - knot.time))
        self._knot = _Knot(time, end.position, end.orientation, twist)
        self._used, self._on_pose = target, lead <= 0.0

    def _coast(self, until):
        """Go on with the last twist, but stand still from the time-out on."""
        limit = self._poses[self._used].stamp + self.timeout
        knot = self._knot
        if knot.time >= limit:
            knot = knot._replace(twist=STILL)
        end = min(until, limit) if knot.time < limit else until
        self._append(knot.time, cubic(knot.position, knot.twist, STILL, STILL))
        self._knot = _moved(knot, knot.twist, end - knot.time)
        self._on_pose = False

    def _jump(self, target):
        """Place the collider at a pose that has arrived; late ones bring no twist."""
        pose = self._poses[target]
        time = max(self._knot.time, pose.stamp)
        self._used, self._on_pose = target, time == pose.stamp
        self._knot = _Knot(time, pose.position, pose.orientation,
                           None if self._on_pose else STILL)
        self._jumps.append(time)

    def _append(self, start, table):
        """Add a cubic that leaves the end of the curve."""
        self._pieces.append(_Piece(start, table, self._knot.orientation))

    def _twist(self, i):
        """Twist (6,) at pose i from the poses around it that no teleport parts from it."""
        poses = self._poses
        last = i
        while last < min(i + AFTER, len(poses) - 1) and not poses[last + 1].teleport:
            last += 1
        first = i
        before = BEFORE if last > i else BEFORE_NEWEST
        while first > max(i - before, 0) and not poses[first].teleport:
            first -= 1
        if first == last:
            return STILL
        around = poses[first:last + 1]
        stamps = np.array([pose.stamp for pose in around]) - poses[i].stamp
        return twist_at(stamps, np.array([pose.position for pose in around]),
                        np.array([pose.orientation for pose in around]), i - first)

    def _evaluate(self, times):
        out = np.empty((13, len(times)))
        first = 0
        for k, piece in enumerate(self._pieces):
            last = len(times)
            if k + 1 < len(self._pieces):
                last = int(times.searchsorted(self._pieces[k + 1].start))
            if last > first:
                play(piece.table, piece.start, piece.orientation, times, first, last, out)
                first = last
        teleport = np.zeros(len(times), dtype=bool)
        for jump in self._jumps:
            if jump <= times[-1]:
                teleport[times.searchsorted(jump)] = True
        return PoseTrack(out[:3].T, out[3:7].T, out[7:].T, teleport)

    def _forget(self, time):
        """Drop what lies before a time that was played, except for the poses twists still need."""
        self._played = time
        self._jumps = [jump for jump in self._jumps if jump > time]
        while len(self._pieces) > 1 and self._pieces[1].start <= time:
            del self._pieces[0]
        self._drop(max(self._used - BEFORE, 0))


def prepare():
    """Compile what streams are played with, or load it; the first pose would wait for it."""
    stream = PoseStream(delay=0.0)
    for k in range(4):
        stream.add(0.1 * k, (0.01 * k, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    stream.sample(np.array([0.0, 0.15, 0.4]))      # on the curve, and coasting


def _moved(pose, twist, duration):
    """Knot at which a constant twist arrives."""
    turn = turned(pose.orientation, duration * twist[3:])
    return _Knot(pose[0] + duration, pose.position + duration * twist[:3], turn, twist)


def way_between(before, after):
    """Shift (3,) and rotation vector (3,) from one pose or knot to another."""
    return (after.position - before.position,
            turn_between(before.orientation, after.orientation))


def checked_pose(stamp, position, orientation):
    """Arrays of a pose, the orientation normalised; PoseError if it cannot be one."""
    position = x, y, z = [float(part) for part in position]
    orientation = [float(part) for part in orientation]
    if not (isfinite(stamp) and all(map(isfinite, position)) and all(map(isfinite, orientation))):
        raise PoseError('not_finite', 'stamp %s, position %s, orientation %s'
                        % (stamp, position, orientation))
    if max(abs(x), abs(y), abs(z)) > FARTHEST:
        raise PoseError('too_far', 'position %s, at most %g m' % (position, FARTHEST))
    length = hypot(*orientation)
    if length < ZERO:
        raise PoseError('zero_quaternion', 'orientation %s' % orientation)
    if abs(length - 1.0) > UNIT:
        raise PoseError('not_unit', 'orientation of length %g' % length)
    return np.array(position), np.array(orientation) / length
