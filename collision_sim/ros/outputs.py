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

"""What the node publishes about particles, contacts and colliders, as long as somebody listens."""

from builtin_interfaces.msg import Time
from collision_sim.ros.state_messages import StateMessages
from geometry_msgs.msg import PoseArray
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import MarkerArray

DEPTH = 5               # messages kept for slow listeners; reliable publishers serve all kinds


class Outputs:
    """
    The publishers of a node for one simulation.

    Parameters
    ----------
    node : rclpy.node.Node
    simulation : Simulation
    frame_id : str
        Of all messages.

    Attributes
    ----------
    messages : StateMessages
        What is published.
    largest : int
        Bytes of the largest message so far.

    """

    def __init__(self, node, simulation, frame_id):
        """Create the publishers, and publish the colliders for those who come later."""
        self._count = len(simulation.position)
        self.largest = 0        # bytes of a message so far
        self._page = _page(node, simulation)
        self._logger = node.get_logger()
        overriding = {'qos_overriding_options': QoSOverridingOptions.with_default_policies()}
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._particles = node.create_publisher(PoseArray, '~/particles', DEPTH, **overriding)
        self._cloud = node.create_publisher(PointCloud2, '~/cloud', DEPTH, **overriding)
        self._contacts = node.create_publisher(MarkerArray, '~/contacts', DEPTH)
        self._colliders = node.create_publisher(MarkerArray, '~/colliders', kept)
        self.messages = StateMessages(simulation, frame_id,
                                      node.get_parameter('publish_rate').value)
        self.use_most(node.get_parameter('max_published_particles').value)
        self.use_frame(frame_id, Time())

    @property
    def topics(self):
        """Names of the topics, as they are after remapping."""
        return [publisher.topic_name for publisher in (
            self._particles, self._cloud, self._contacts, self._colliders)]

    @property
    def contacts_wanted(self):
        """Whether anybody listens to the contacts."""
        return self._contacts.get_subscription_count() > 0 or (
            self._page is not None and self._page.contacts_wanted)

    def use_most(self, most):
        """Say how many particles there are in a PoseArray at most; of more, evenly as many."""
        self.messages.use_most(most)
        shown = self.messages.shown
        if shown < self._count:
            self._logger.warning('%s has %d of %d particles (max_published_particles), %s all' % (
                self._particles.topic_name, shown, self._count, self._cloud.topic_name))

    def use_frame(self, frame_id, stamp):
        """Change the frame of all messages; what was shown in the old one is taken away."""
        self.messages.use_frame(frame_id)
        self.clear_contacts(stamp)
        self._colliders.publish(self.messages.colliders(*_parts(stamp)))

    def clear_contacts(self, stamp):
        """Take all contacts away, those that are shown and those of the next message."""
        self.messages.forget_contacts()
        self._contacts.publish(self.messages.no_contacts(*_parts(stamp)))

    def publish(self, stamp):
        """
        Publish the state on all topics that somebody listens to.

        Parameters
        ----------
        stamp : builtin_interfaces.msg.Time
            Time on the clock that the state belongs to.

        """
        messages, stamp = self.messages, _parts(stamp)
        if self._page is not None:
            self._page.show(messages.contacts_seen)
        for publisher, layout in ((self._particles, messages.particles),
                                  (self._cloud, messages.cloud),
                                  (self._contacts, messages.contacts)):
            if publisher.get_subscription_count():
                message = layout(*stamp)
                publisher.publish(message)
                content = message if isinstance(message, bytes) else getattr(message, 'data', b'')
                self.largest = max(self.largest, len(content))
        if messages.colliders_move and self._colliders.get_subscription_count():
            self._colliders.publish(messages.colliders(*stamp))
        messages.forget_contacts()

    def close(self):
        """Take the page away."""
        if self._page is not None:
            self._page.close()


def _parts(stamp):
    return stamp.sec, stamp.nanosec


def _page(node, simulation):
    """Give the page in the browser, None unless the parameter `viewer` asks for it."""
    if not node.get_parameter('viewer').value:
        return None
    from collision_sim.ros.page import Page
    return Page(node, simulation)
