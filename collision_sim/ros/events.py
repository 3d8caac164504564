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


"""What the middleware tells of messages that were lost, or that will never come."""

from collections import Counter

from collision_sim.ros.rare_warnings import RareWarnings
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.qos import qos_policy_name_from_kind


class Events:
    """
    Counts events of publishers and subscriptions, and warns of them from time to time.

    Parameters
    ----------
    node : rclpy.node.Node

    Attributes
    ----------
    counts : Counter
        By topic and what has happened.

    """

    def __init__(self, node):
        """Start with none."""
        self._warn = RareWarnings(node)
        self.counts = Counter()

    def of_publisher(self, topic):
        """Give the callbacks of a publisher."""
        return PublisherEventCallbacks(incompatible_qos=lambda event: self._incompatible(
            topic, event, 'a subscriber gets no messages'))

    def of_subscription(self, topic):
        """Give the callbacks of a subscription."""
        return SubscriptionEventCallbacks(
            incompatible_qos=lambda event: self._incompatible(
                topic, event, 'no messages come from a publisher'),
            message_lost=lambda event: self._note(
                topic, 'messages lost', event.total_count_change, 'messages were lost'))

    def _incompatible(self, topic, event, effect):
        policy = qos_policy_name_from_kind(event.last_policy_kind)
        self._note(topic, 'incompatible QoS', 1, '%s, incompatible QoS: %s' % (effect, policy))

    def _note(self, topic, what, count, text):
        self.counts[topic, what] += count
        self._warn((topic, what), '%s: %s (%d so far)' % (topic, text, self.counts[topic, what]))
