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
Recordings: what the node would publish goes into a bag, recorded poses move the colliders.

Needs no ROS; bags.py needs rosbags.
"""

from collections import Counter
from importlib.util import find_spec

from collision_sim.checks import SceneError
from collision_sim.core.pose_stream import PoseError
from collision_sim.ros.messages import SECOND
from collision_sim.ros.pose_streams import PoseStreams
from collision_sim.ros.state_messages import StateMessages
import numpy as np

NODE = 'collision_sim'      # name of the node, which its private topics begin with
COLLIDERS = f'/{NODE}/colliders'
MESSAGES = {
    'particles': 'geometry_msgs/msg/PoseArray',
    'contacts': 'visualization_msgs/msg/MarkerArray',
    'colliders': 'visualization_msgs/msg/MarkerArray',
    'cloud': 'sensor_msgs/msg/PointCloud2',
}


def absolute(topic):
    """Name of a topic as a bag has it: that of a node that is not in a namespace."""
    if topic.startswith('~'):
        return f'/{NODE}{topic[1:]}'
    return topic if topic.startswith('/') else f'/{topic}'


def require_rosbags(option):
    """Refuse an option of the command line that needs rosbags where that is not installed."""
    if find_spec('rosbags') is None:
        raise SceneError(option, 'rosbags',
                         "must be installed: pip install 'collision_sim[record]'")


class Recording:
    """
    A bag of what the node would publish about a simulation; stamps are simulated time.

    Parameters
    ----------
    path : str
        Of the MCAP file; it is there when the `with` block has ended without error.
    simulation : Simulation
    topics : collection of str
        Of MESSAGES.
    rate : float [Hz]
        How often `write` will be called, which says how long contacts are shown.
    frame_id : str
        Of the messages.

    Attributes
    ----------
    messages : StateMessages
        What is written; takes the Contacts of the steps.

    """

    def __init__(self, path, simulation, topics, rate, frame_id):
        from collision_sim.bags import BagWriter
        self._simulation = simulation
        self.messages = StateMessages(simulation, frame_id, rate)
        self._layouts = {absolute(f'~/{topic}'): getattr(self.messages, topic)
                         for topic in topics}
        self._bag = BagWriter(path, {absolute(f'~/{topic}'): MESSAGES[topic] for topic in topics},
                              latched=[COLLIDERS])

    def write(self):
        """Write a message on each topic about the state now; colliders that stand still once."""
        time = round(self._simulation.time * SECOND)
        for topic, layout in self._layouts.items():
            self._bag.write(topic, time, layout(*divmod(time, SECOND)))
        self.messages.forget_contacts()
        if not self.messages.colliders_move:
            self._layouts.pop(COLLIDERS, None)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._bag.__exit__(*error)


class Replay:
    """
    Recorded poses that move the colliders of a simulation as they would move those of the node.

    Simulated time starts with the bag. A step knows the poses that were received before its end.

    Parameters
    ----------
    path : str
        Of a bag, as bags.read_bag takes it.
    scene : Scene
        Says which topics move which colliders.
    frame_id : str
        Of the poses; those of another frame are dropped.
    delay, timeout : float [s]
        As of a PoseStream.

    Attributes
    ----------
    duration : float [s]
        Until the last pose has been played.
    taken, dropped : Counter
        Poses by collider, and by collider and reason.

    Raises
    ------
    SceneError, OSError
        For a scene without topics, and as bags.read_bag.

    """

    def __init__(self, path, scene, frame_id, delay, timeout):
        from collision_sim.bags import read_bag
        self._streams = PoseStreams(scene, frame_id, self._seconds)
        self._streams.set_times(delay, timeout)
        topics = {}
        for name, topic in self._streams.topics.items():
            topics.setdefault(absolute(topic), []).append(name)
        if not topics:
            raise SceneError('--poses', path, 'must be absent: no collider of the scene has a '
                                              'topic')
        self._start, messages = read_bag(path, topics, 'geometry_msgs/msg/PoseStamped')
        self._messages = [(time, name, message) for time, topic, message in messages
                          for name in topics[topic]]
        self._next = 0
        self.taken = Counter(dict.fromkeys(self._streams.topics, 0))
        self.dropped = self._streams.dropped
        self.duration = self._seconds(self._messages[-1][0]) + delay if self._messages else delay

    def step(self, simulation, count, add_contacts=None):
        """
        Take steps of a simulation.

        Parameters
        ----------
        simulation : Simulation
            Of the scene of this replay.
        count : int
            How many.
        add_contacts : callable or None
            Called with the Contacts of each step.

        """
        for _ in range(count):
            time = simulation.time + simulation.dt
            self._add_until(self._start + round(time * SECOND))
            self._streams.step(simulation, np.array([time]), add_contacts=add_contacts)

    def _seconds(self, nanoseconds):
        return (nanoseconds - self._start) / SECOND

    def _add_until(self, limit):
        """Take the poses that had been received by a time [ns]."""
        while self._next < len(self._messages) and self._messages[self._next][0] <= limit:
            time, name, message = self._messages[self._next]
            self._next += 1
            try:
                self._streams.add_message(name, message, time)
                self.taken[name] += 1
            except PoseError:
                pass            # it is counted as dropped
