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
The poses that move the colliders of a scene: what is taken, what is dropped and why; no ROS.

The node fills it from its topics (pose_topics.py), a replay from a recorded bag (recording.py).
"""

from collections import Counter
from itertools import pairwise
from math import hypot, nan

from collision_sim.core.held_pose import HeldPose
from collision_sim.core.pose_play import KEPT
from collision_sim.core.pose_stream import PoseError
from collision_sim.core.pose_table import add_poses, new_curves, play_curves, streams_of
from collision_sim.ros.arrivals import Arrivals
from collision_sim.ros.messages import read_pose, read_poses, SECOND
import numpy as np

AHEAD = 1.0     # s; a stamp further in the future is wrong
LONGEST_FRAME = 60      # characters of a frame that are shown


class PoseStreams:
    """
    A PoseStream for each collider of a scene that has a topic.

    Parameters
    ----------
    scene : Scene
    frame_id : str
        Of the poses; those of another frame are dropped.
    seconds : callable
        Gives nanoseconds on the clock as the seconds of the streams.

    Attributes
    ----------
    topics : dict of str
        Of the colliders, by their names.
    dropped : Counter
        Poses by collider and reason.

    """

    def __init__(self, scene, frame_id, seconds):
        """Start without any pose."""
        self.frame_id = frame_id
        self.topics = {collider.name: collider.topic
                       for collider in scene.colliders if collider.topic is not None}
        self.dropped = Counter()
        self._seconds = seconds
        self._curves = new_curves(len(self.topics))
        self._streams = dict(zip(self.topics, streams_of(self._curves)))
        self._arrivals = [Arrivals() for _ in self.topics]
        self._held = {}         # HeldPose by collider while time stands still

    def set_times(self, delay, timeout):
        """Change the delay and the time-out of all streams [s]."""
        for stream in self._streams.values():
            bounds = stream.bounds._replace(delay=delay, timeout=timeout)
            if stream.bounds != bounds:
                stream.bounds = bounds
                stream.restart()

    def restart(self):
        """Place the colliders at their poses at the next time that is asked for."""
        for stream in self._streams.values():
            stream.restart()
        for held in self._held.values():
            held.reset()

    def forget(self):
        """Drop all poses: their stamps are those of another time."""
        for stream in self._streams.values():
            stream.reset()
        for arrivals in self._arrivals:
            arrivals.forget()
        for held in self._held.values():
            held.forget_stamp()

    def stale(self, now):
        """Names of the colliders whose poses have stopped for longer than the time-out."""
        return [name for name, stream in self._streams.items()
                if stream.newest is not None and not self._held
                and now - stream.bounds.delay - stream.newest > stream.bounds.timeout]

    def add(self, name, pose, now):
        """
        Take a pose that has come, or drop and count it.

        Parameters
        ----------
        name : str
            Of the collider.
        pose : tuple
            As a messages.PoseStamped.
        now : int [ns]
            Time on the clock; a zero stamp means this, up to jitter (arrivals.py).

        Raises
        ------
        PoseError
            For a pose that was dropped.

        """
        seconds, nanoseconds, frame_id, position, orientation = pose
        stream = self._streams[name]
        try:
            if frame_id != self.frame_id:
                raise PoseError('frame', f'frame_id is {frame_id[:LONGEST_FRAME]!r} instead of '
                                         f'{self.frame_id!r}')
            stamp = self._stamp(seconds, nanoseconds)
            if self._held:
                self._held[name].add(stamp, position, orientation)
            else:
                if stamp is None:
                    stamp = self._arrivals[list(self.topics).index(name)].sent(self._seconds(now))
                stamp = _checked_time(stamp, self._seconds(now), stream)
                stream.add(stamp, position, orientation)
        except PoseError as error:
            self.dropped[name, error.reason] += 1
            raise

    def add_message(self, name, message, now):
        """As `add`, for a serialized geometry_msgs/PoseStamped."""
        try:
            pose = read_pose(message)
        except ValueError as error:
            self.dropped[name, 'malformed'] += 1
            raise PoseError('malformed', error) from None
        self.add(name, pose, now)

    def add_messages(self, which, messages, times):
        """
        As `add_message` one after the other, but cheaper.

        Parameters
        ----------
        which : list of int
            Places in `topics`.
        messages : list of bytes
            Serialized geometry_msgs/PoseStamped.
        times : (n,) int64 [ns]
            Times on the clock; a zero stamp means this.

        Returns
        -------
        dropped : list of (str, PoseError)
            Collider and reason of the poses that were dropped.

        """
        names, dropped = list(self.topics), []
        together = None if self._held or not messages else self._together(which, messages, times)
        n = 0
        while n < len(messages):
            if together is not None:
                n = add_poses(self._curves, self._bounds, n, *together)
            if n < len(messages):       # it is not like the others, or refused
                name = names[which[n]]
                try:
                    self.add_message(name, messages[n], int(times[n]))
                except PoseError as error:
                    dropped.append((name, error))
                n += 1
        return dropped

    def _together(self, which, messages, times):
        """Give what add_poses takes; None where messages have to be looked at one by one."""
        taken_apart = read_poses(messages, self.frame_id)
        if taken_apart is None:
            return None
        seconds, nanoseconds, poses = taken_apart
        stamps = seconds * SECOND + nanoseconds
        unstamped = np.flatnonzero(stamps == 0)
        stamps = self._seconds(np.where(stamps == 0, times, stamps))
        for k in unstamped:
            stamps[k] = self._arrivals[which[k]].sent(stamps.item(k))
        stamps[nanoseconds >= SECOND] = nan
        now, bounds = self._seconds(times), self._bounds
        periods = np.stack([now - bounds.delay - bounds.timeout, now + AHEAD], axis=1)
        lengths = np.array([hypot(*orientation) for orientation in poses[:, 3:].tolist()])
        return np.array(which), stamps, periods, poses, lengths

    @property
    def _bounds(self):
        """Bounds of all streams."""
        return next(iter(self._streams.values())).bounds

    def _stamp(self, seconds, nanoseconds):
        """Stamp in the seconds of the streams; None for a zero stamp."""
        if nanoseconds >= SECOND:
            raise PoseError('stamp', f'{nanoseconds} nanoseconds')
        if seconds == 0 and nanoseconds == 0:
            return None
        return self._seconds(seconds * SECOND + nanoseconds)

    def hold(self):
        """From now on keep the newest pose of each collider, for steps asked for one by one."""
        self._held = self._held or {
            name: HeldPose(stream) for name, stream in self._streams.items()}

    def release(self, now):
        """Go on with the clock [s], the colliders where they were held."""
        for name, held in self._held.items():
            if held.is_new:
                stream, pose = self._streams[name], held.newest
                stream.reset()
                try:
                    stamp = _checked_time(pose.stamp, now, stream)
                except PoseError:       # of another time
                    stamp = now
                stream.add(stamp, pose.position, pose.orientation)
        self._held = {}
        self.restart()

    def move_held(self, simulation):
        """
        Tell a simulation where the colliders are at the end of a step that is asked for.

        Parameters
        ----------
        simulation : Simulation
            Of the scene whose streams these are.

        Returns
        -------
        moved : list of str
            Names of the colliders for which a new pose has come.

        """
        moved = []
        for name, held in self._held.items():
            pose = held.take(*simulation.collider_pose(name))
            if pose is not None:
                move = simulation.place_collider if pose.teleport else simulation.move_collider
                move(name, pose.position, pose.orientation)
                moved.append(name)
        return moved

    def step(self, simulation, times, pace=1.0, add_contacts=None):
        """
        Take steps of a simulation, with its colliders where the streams lead them.

        Parameters
        ----------
        simulation : Simulation
            Of the scene whose streams these are.
        times : (n,) float64 [s]
            Ends of the steps, in the seconds of the streams.
        pace : float [-]
            Time on the clock a time of the simulation: above 1 where steps are left out.
        add_contacts : callable or None
            Called with the Contacts of each step; if None, steps are taken together.

        """
        names, position, orientation, twist, teleport = self._play(times)
        every = add_contacts is not None
        for first, last in pairwise(_cuts(teleport, every)):
            for k in teleport[:, first].nonzero()[0]:
                simulation.place_collider(names[k], position[k, first], orientation[k, first])
            part = slice(first, last)
            simulation.move_colliders(names, position[:, part], orientation[:, part],
                                      pace * twist[:, part])
            simulation.step(last - first)
            if every:
                add_contacts(simulation.contacts)

    def _play(self, times):
        """Names of the K colliders that have poses, and where they are at S times (K, S, ...)."""
        which = self._curves.counts[:, KEPT].nonzero()[0]
        out = np.empty((len(which), 13, len(times)))
        teleport = np.zeros((len(which), len(times)), dtype=bool)
        if len(which):
            times = times - self._bounds.delay
            play_curves(self._curves, self._bounds, which, times, out, teleport)
        names = list(self.topics)
        rows = np.ascontiguousarray(out.swapaxes(1, 2))
        return [names[k] for k in which], rows[..., :3], rows[..., 3:7], rows[..., 7:], teleport


def _checked_time(stamp, now, stream):
    """Give the time of a pose, which is near to the clock; without a stamp it is now."""
    if stamp is None:
        return now
    if stamp > now + AHEAD:
        raise PoseError('future', f'stamped {stamp - now:.3f} s ahead of the clock')
    if stamp < now - stream.bounds.delay - stream.bounds.timeout:
        raise PoseError('stale', f'stamped {now - stamp:.3f} s behind the clock')
    return stamp


def _cuts(teleport, every):
    """Where the steps are taken apart: at teleports (K, S), or everywhere."""
    count = teleport.shape[1]
    if every:
        return range(count + 1)
    return sorted({0, count, *teleport.any(axis=0).nonzero()[0].tolist()})
