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

"""Poses of a collider while time stands still, for steps that are asked for one by one."""

from math import hypot

from collision_sim.core.pose_stream import checked_pose, Pose, PoseError, way_between


class HeldPose:
    """
    The newest pose of one collider, and whether a step may move the collider there.

    Stamps are not compared with a clock: they only need to increase, or to be absent.

    Parameters
    ----------
    stream : PoseStream
        For the newest pose so far and the bounds of a teleport.

    """

    def __init__(self, stream):
        """Begin with the newest pose of a stream, if it has any; it is placed, as it is late."""
        self._stream = stream
        self._used = None           # the pose of the last step
        self._placed = self.newest = stream.newest_pose
        self._stamp = None if self.newest is None else self.newest.stamp

    def reset(self):
        """Forget all poses."""
        self._used = self._placed = self.newest = self._stamp = None

    def forget_stamp(self):
        """Compare none with the stamps so far: they are of another time."""
        self._stamp = None

    @property
    def is_new(self):
        """Whether a pose has come since time stands still."""
        return self.newest is not self._placed

    def add(self, stamp, position, orientation):
        """
        Take a pose.

        Parameters
        ----------
        stamp : float [s] or None
            Later than the one before, if there are two.
        position, orientation : (3,), (4,) sequence of float [m], [-]
            As in PoseStream.add.

        Raises
        ------
        PoseError

        """
        known = self._stamp if stamp is None else stamp
        position, orientation = checked_pose(known or 0.0, position, orientation)
        if stamp is not None and self._stamp is not None and stamp <= self._stamp:
            raise PoseError('repeated' if stamp == self._stamp else 'backwards',
                            'stamp %.9f after %.9f' % (stamp, self._stamp))
        self._stamp = known
        self.newest = Pose(stamp, position, orientation, False)

    def take(self, position, orientation):
        """
        Give the pose at the end of the next step.

        Parameters
        ----------
        position, orientation : (3,), (4,) float64 [m], [-]
            Where the collider is.

        Returns
        -------
        pose : Pose or None
            None where no new one has come: the collider stands still. Its `teleport` says that
            the collider is to be placed there: late, after a gap longer than the time-out, or
            farther away than a teleport.

        """
        new, used = self.newest, self._used
        if new is used:
            return None
        bounds, self._used = self._stream.bounds, new
        shift, turn = way_between(Pose(0.0, position, orientation, False), new)
        gap = 0.0 if used is None or None in (used.stamp, new.stamp) else new.stamp - used.stamp
        return new._replace(teleport=bool(
            new is self._placed or gap > bounds.timeout
            or hypot(*shift) > bounds.teleport_distance or hypot(*turn) > bounds.teleport_angle))
