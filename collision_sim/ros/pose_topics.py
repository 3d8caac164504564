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

"""The pose topics of the colliders: subscriptions, and warnings of what is dropped."""

import time

from collision_sim.ros.messages import SECOND
from collision_sim.ros.pose_streams import PoseStreams
from collision_sim.ros.rare_warnings import RareWarnings
from collision_sim.ros.spin import arrived
from geometry_msgs.msg import PoseStamped
import numpy as np
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

# Takes reliable and best-effort publishers; at 1 kHz, poses of the longest tick wait for the next.
QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
OLDEST = SECOND     # ns; poses are taken more often: what seems older, a clock has jumped


class PoseTopics(PoseStreams):
    """
    Subscribes to the pose topics of a scene and keeps a PoseStream for each.

    Parameters
    ----------
    node : rclpy.node.Node
    scene : Scene
    clock : FollowedClock or PublishedClock
        Whose times those of the streams are.

    """

    def __init__(self, node, scene, clock):
        """Subscribe to the topics of all colliders that have one."""
        super().__init__(scene, node.get_parameter('frame_id').value, clock.seconds)
        self._clock = clock
        self._warn = RareWarnings(node)
        self._subscriptions = []        # in the order of the topics
        for name, topic in self.topics.items():
            subscription = node.create_polled_subscription(
                PoseStamped, topic, QOS, raw=True,
                qos_overriding_options=QoSOverridingOptions.with_default_policies())
            self.topics[name] = subscription.topic_name
            self._subscriptions.append(subscription)
        self.set_times(node.get_parameter('pose_delay').value,
                       node.get_parameter('pose_timeout').value)

    def take_arrived(self):
        """Take all poses that have arrived; without a stamp, they are of when that was."""
        now, system = self._clock.nanoseconds(), time.time_ns()
        which, messages, received = [], [], []
        for k, subscription in enumerate(self._subscriptions):
            for message, when in arrived(subscription):
                which.append(k)
                messages.append(message)
                received.append(when)
        age = system - np.array(received, dtype=np.int64)
        known = (age > 0) & (age < OLDEST) & self._clock.flows
        self.take(which, messages, now - np.where(known, age, 0))

    def take(self, which, messages, times):
        """Take poses as `add_messages`, and warn of those that are dropped."""
        for name, error in self.add_messages(which, messages, times):
            key = name, error.reason
            self._warn(key, '%s: pose dropped, %s (%d so far)' % (
                self.topics[name], error, self.dropped[key]))
