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

"""Messages about a simulation as it is: what the node publishes and a recording keeps; no ROS."""

from collision_sim.ros.markers import (clear_markers, collider_markers, contact_markers,
                                       LIFETIME)
from collision_sim.ros.messages import marker_array, PointCloudWriter, PoseArrayWriter
import numpy as np


class StateMessages:
    """
    Lays out the messages about a simulation, each as bytes for a stamp (seconds, nanoseconds).

    Parameters
    ----------
    simulation : Simulation
    frame_id : str
        Of all messages.
    rate : float [Hz]
        Of the messages, which says how long contacts are shown.

    Attributes
    ----------
    shown : int
        How many particles there are in a PoseArray.
    contacts_seen : list of Contacts
        Of the steps since `forget_contacts`.
    colliders_move : bool
        Whether some do; else their message is always the same.

    """

    def __init__(self, simulation, frame_id, rate):
        """Show all particles."""
        self._simulation = simulation
        self._most = len(simulation.position)
        self.colliders_move = any(collider.moving for collider in simulation.scene.colliders)
        self.use_rate(rate)
        self.use_frame(frame_id)
        self.forget_contacts()

    def use_frame(self, frame_id):
        """Change the frame of all messages."""
        self._frame_id = frame_id
        self._point_cloud = PointCloudWriter(frame_id, len(self._simulation.position))
        self.use_most(self._most)

    def use_most(self, most):
        """Say how many particles there are in a PoseArray at most; of more, evenly as many."""
        count, self._most = len(self._simulation.position), most
        self.shown = min(most, count)
        self._chosen = slice(None)
        if self.shown < count:
            self._chosen = np.arange(self.shown) * count // self.shown
        self._pose_array = PoseArrayWriter(self._frame_id, self.shown)

    def use_rate(self, rate):
        """Change the rate of the messages [Hz]."""
        self._lifetime = LIFETIME / rate

    def add_contacts(self, contacts):
        """Take the Contacts of a step into the next message."""
        self.contacts_seen.append(contacts)

    def forget_contacts(self):
        """Begin the next message about contacts."""
        self.contacts_seen = []

    def particles(self, *stamp):
        """Give the geometry_msgs/PoseArray of the particles."""
        return self._pose_array.message(*stamp, self._simulation.position[self._chosen])

    def cloud(self, *stamp):
        """Give the sensor_msgs/PointCloud2 of all particles."""
        return self._point_cloud.message(*stamp, self._simulation.position,
                                         self._simulation.velocity)

    def contacts(self, *stamp):
        """Give the visualization_msgs/MarkerArray of the contacts seen."""
        return self._markers(stamp, contact_markers(self.contacts_seen, self._lifetime))

    def no_contacts(self, *stamp):
        """Give the visualization_msgs/MarkerArray that takes all contacts away."""
        return self._markers(stamp, clear_markers())

    def colliders(self, *stamp):
        """Give the visualization_msgs/MarkerArray of the colliders."""
        scene = self._simulation.scene
        poses = [self._simulation.collider_pose(collider.name) for collider in scene.colliders]
        return self._markers(stamp, collider_markers(scene, poses))

    def _markers(self, stamp, markers):
        return marker_array(*stamp, self._frame_id, markers)
