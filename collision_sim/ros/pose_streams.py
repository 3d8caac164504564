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

from collision_sim.core.held_pose import HeldPose
from collision_sim.core.pose_stream import PoseError, PoseStream
from collision_sim.ros.messages import read_pose, SECOND
import numpy as np

AHEAD = 1.0     # s; a stamp further in the future is wrong


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
        self._streams = {name: PoseStream() for name in self.topics}
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
            Time on the clock; a zero stamp means this.

        Raises
        ------
        PoseError
            For a pose that was dropped.

        """
        seconds, nanoseconds, frame_id, position, orientation = pose
        stream = self._streams[name]
        try:
            if frame_id != self.frame_id:
                raise PoseError('frame', f'frame_id is {frame_id!r} instead of {self.frame_id!r}')
            stamp = self._stamp(seconds, nanoseconds)
            if self._held:
                self._held[name].add(stamp, position, orientation)
            else:
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
        tracks = [(name, stream.sample(times)) for name, stream in self._streams.items()
                  if stream.newest is not None]
        every = add_contacts is not None
        for first, last in pairwise(_cuts(tracks, len(times), every)):
            for name, track in tracks:
                if track.teleport[first]:
                    simulation.place_collider(name, track.position[first],
                                              track.orientation[first])
            part = slice(first, last)
            simulation.move_colliders(
                [name for name, _ in tracks],
                np.array([track.position[part] for _, track in tracks]),
                np.array([track.orientation[part] for _, track in tracks]),
                pace * np.array([track.twist[part] for _, track in tracks]))
            simulation.step(last - first)
            if every:
                add_contacts(simulation.contacts)


def _checked_time(stamp, now, stream):
    """Give the time of a pose, which is near to the clock; without a stamp it is now."""
    if stamp is None:
        return now
    if stamp > now + AHEAD:
        raise PoseError('future', f'stamped {stamp - now:.3f} s ahead of the clock')
    if stamp < now - stream.bounds.delay - stream.bounds.timeout:
        raise PoseError('stale', f'stamped {now - stamp:.3f} s behind the clock')
    return stamp


def _cuts(tracks, count, every):
    """Where the steps are taken apart: at teleports, or everywhere."""
    if every:
        return range(count + 1)
    cuts = {0, count}
    for _, track in tracks:
        cuts.update(track.teleport.nonzero()[0].tolist())
    return sorted(cuts)
