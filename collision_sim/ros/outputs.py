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
from collision_sim.ros.markers import (clear_markers, collider_markers, contact_markers,
                                       LIFETIME)
from collision_sim.ros.messages import marker_array, PointCloudWriter, PoseArrayWriter
from geometry_msgs.msg import PoseArray
import numpy as np
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
    shown : int
        How many particles there are in a PoseArray.

    """

    def __init__(self, node, simulation, frame_id):
        """Create the publishers, and publish the colliders for those who come later."""
        self._simulation = simulation
        self._page = _page(node, simulation)
        self._logger = node.get_logger()
        self._frame_id = frame_id
        overriding = {'qos_overriding_options': QoSOverridingOptions.with_default_policies()}
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._particles = node.create_publisher(PoseArray, '~/particles', DEPTH, **overriding)
        self._cloud = node.create_publisher(PointCloud2, '~/cloud', DEPTH, **overriding)
        self._contacts = node.create_publisher(MarkerArray, '~/contacts', DEPTH)
        self._colliders = node.create_publisher(MarkerArray, '~/colliders', kept)
        self._contacts_seen = []        # Contacts of the steps since the last message
        self._lifetime = 0.0            # s
        self._some_move = any(collider.moving for collider in simulation.scene.colliders)
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
        count = len(self._simulation.position)
        self.shown = min(most, count)
        self._chosen = slice(None)
        if self.shown < count:
            self._chosen = np.arange(self.shown) * count // self.shown
            self._logger.warning('%s has %d of %d particles (max_published_particles), %s all' % (
                self._particles.topic_name, self.shown, count, self._cloud.topic_name))
        self._pose_array = PoseArrayWriter(self._frame_id, self.shown)

    def use_frame(self, frame_id, stamp):
        """Change the frame of all messages; what was shown in the old one is taken away."""
        self._frame_id = frame_id
        self._pose_array = PoseArrayWriter(frame_id, self.shown)
        self._point_cloud = PointCloudWriter(frame_id, len(self._simulation.position))
        self.clear_contacts(stamp)
        self._publish_colliders(stamp)

    def use_rate(self, rate):
        """Say how many messages a second there will be [Hz]."""
        self._lifetime = LIFETIME / rate

    def add_contacts(self, contacts):
        """Take the Contacts of a step into the next message."""
        self._contacts_seen.append(contacts)

    def clear_contacts(self, stamp):
        """Take all contacts away, those that are shown and those of the next message."""
        self._contacts_seen = []
        self._publish_markers(self._contacts, clear_markers(), stamp)

    def publish(self, stamp):
        """
        Publish the state on all topics that somebody listens to.

        Parameters
        ----------
        stamp : builtin_interfaces.msg.Time
            Time on the clock that the state belongs to.

        """
        if self._particles.get_subscription_count():
            self._particles.publish(self._pose_array.message(
                stamp.sec, stamp.nanosec, self._simulation.position[self._chosen]))
        if self._cloud.get_subscription_count():
            self._cloud.publish(self._point_cloud.message(
                stamp.sec, stamp.nanosec, self._simulation.position, self._simulation.velocity))
        if self._page is not None:
            self._page.show(self._contacts_seen)
        if self._contacts.get_subscription_count():
            self._publish_markers(
                self._contacts, contact_markers(self._contacts_seen, self._lifetime), stamp)
        self._contacts_seen = []
        if self._some_move and self._colliders.get_subscription_count():
            self._publish_colliders(stamp)

    def close(self):
        """Take the page away."""
        if self._page is not None:
            self._page.close()

    def _publish_colliders(self, stamp):
        scene = self._simulation.scene
        poses = [self._simulation.collider_pose(collider.name) for collider in scene.colliders]
        self._publish_markers(self._colliders, collider_markers(scene, poses), stamp)

    def _publish_markers(self, publisher, markers, stamp):
        publisher.publish(marker_array(stamp.sec, stamp.nanosec, self._frame_id, markers))


def _page(node, simulation):
    """Give the page in the browser, None unless the parameter `viewer` asks for it."""
    if not node.get_parameter('viewer').value:
        return None
    from collision_sim.ros.page import Page
    return Page(node, simulation)
