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

"""The page in the browser as one more output of the node."""

from time import perf_counter

from collision_sim.viewer import EVERY_CONTACT, RATE, Viewer


class Page:
    """
    A Viewer that is updated RATE times a second at most.

    Parameters
    ----------
    node : rclpy.node.Node
        Its parameter `viewer_port` is declared.
    simulation : Simulation

    """

    def __init__(self, node, simulation):
        """Open the page and log where it is."""
        self._simulation = simulation
        self._viewer = Viewer(simulation, node.get_parameter('viewer_port').value)
        self._contacts = []             # of the steps since the last frame
        self._due = 0.0
        self.contacts_wanted = len(simulation.position) <= EVERY_CONTACT
        node.get_logger().info('%s shows the simulation' % self._viewer.url)

    def show(self, contacts):
        """Take Contacts, and show the simulation if it is time to."""
        self._contacts += contacts
        now = perf_counter()
        if now >= self._due:
            self._due = max(self._due + 1.0 / RATE, now)
            self._viewer.update(self._simulation, self._contacts)
            self._contacts = []

    def close(self):
        """Take the page away."""
        self._viewer.close()
