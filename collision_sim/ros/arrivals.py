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
When poses without a stamp were sent, from when they arrived; no ROS.

They arrive some milliseconds late, by turns more and less. Speeds from those times would be wrong
by that share of the time between two poses, and particles hit with them. Poses are sent at a
regular rate as a rule: the times lie on the line fitted to the arrivals by least squares, one
after the other, with the gains of an alpha-beta filter whose memory grows.
"""

MEMORY = 50             # arrivals that the line is fitted to
OFF = 0.5               # periods; who is further from the line begins a new one
SHORTEST = 1e-6         # s between two poses
MISSED = 5              # poses missing in a row after which a new line begins


class Arrivals:
    """The line of one stream of poses."""

    def __init__(self):
        """Start without any."""
        self.forget()

    def forget(self):
        """Begin a new line with the next arrival."""
        self._count, self._arrived, self._sent, self._period = 0, None, 0.0, 0.0

    def sent(self, arrived):
        """
        Give when a pose was sent, up to what all of them take.

        Parameters
        ----------
        arrived : float [s]
            Not before the one before; the same again for the same pose.

        Returns
        -------
        sent : float [s]
            Later than that of the pose before.

        """
        if arrived == self._arrived:
            return self._sent
        if self._count == 1:
            self._period = arrived - self._arrived
        gap = arrived - self._sent
        periods = max(1, round(gap / self._period)) if self._period > 0.0 else 1
        error = gap - periods * self._period
        if self._count == 0 or not abs(error) < OFF * self._period or periods > MISSED:
            later = self._sent + SHORTEST if self._count else arrived
            self._count, self._sent = 1, max(arrived, later)
        else:
            n = self._count = min(self._count + 1, MEMORY)
            self._sent += periods * self._period + (4 * n - 2) / (n * (n + 1)) * error
            self._period += 6.0 / (n * (n + 1)) * error / periods
        self._arrived = arrived
        return self._sent
