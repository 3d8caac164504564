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

from functools import partial

from collision_sim.core.pose_stream import PoseError
from collision_sim.ros.pose_streams import PoseStreams
from collision_sim.ros.rare_warnings import RareWarnings
from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

# Takes reliable and best-effort publishers; a burst of poses late by some ticks still fits.
QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


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
        self._subscriptions = {}
        for name, topic in self.topics.items():
            subscription = node.create_subscription(
                PoseStamped, topic, partial(self._take, name), QOS, raw=True,
                qos_overriding_options=QoSOverridingOptions.with_default_policies())
            self.topics[name] = subscription.topic_name
            self._subscriptions[name] = subscription
        self.set_times(node.get_parameter('pose_delay').value,
                       node.get_parameter('pose_timeout').value)

    def take_arrived(self):
        """
        Take all poses that have arrived.

        An executor may serve a request before a pose that was sent, and has arrived, before it.
        """
        for name, subscription in self._subscriptions.items():
            with subscription.handle:
                while taken := subscription.handle.take_message(
                        subscription.msg_type, subscription.raw):
                    self._take(name, taken[0])

    def _take(self, name, message):
        try:
            self.add_message(name, message, self._clock.nanoseconds())
        except PoseError as error:
            key = name, error.reason
            self._warn(key, '%s: pose dropped, %s (%d so far)' % (
                self.topics[name], error, self.dropped[key]))
