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
What time it is, and how many steps that asks for.

Either the steps follow the clock of the node, or the node is the clock of the graph. Times are
seconds since an epoch: the start, or the last jump of the clock.
"""

import time

from builtin_interfaces.msg import Time
from collision_sim.ros.messages import SECOND
import numpy as np
import rosgraph_msgs.msg

LONGEST_GAP = 1.0       # s between two ticks; more is a jump of the clock
LONGEST_TICK = 0.05     # s; the published clock is not read further ahead of its last tick
ROUNDING = 1e-6         # of a step


def ros_time(nanoseconds):
    """Give a time in a message."""
    seconds, nanoseconds = divmod(nanoseconds, SECOND)
    return Time(sec=seconds, nanosec=nanoseconds)


class FollowedClock:
    """
    The clock of a node, wall or simulated by somebody else; steps were taken up to `stepped`.

    Parameters
    ----------
    node : rclpy.node.Node
    start : float [s]
        On that clock: no steps are asked for before.

    """

    resets = False          # goes on when the simulation goes back to its start

    @property
    def flows(self):
        """Whether it goes on between two looks at it, as a simulated one does not."""
        return not self._clock.ros_time_is_active

    def __init__(self, node, start):
        """Start now, unless the start is still to come."""
        self._clock, self._logger = node.get_clock(), node.get_logger()
        self._start = round(start * SECOND)
        self.begin_again()

    def begin(self):
        """Ask for steps from now on, and say how that fits the start."""
        self.stand_still()
        late = (self.nanoseconds() - self._start) / SECOND
        if late < 0.0:
            self._logger.info('the first step begins in %.3f s' % -late)
        elif self._start > 0:
            self._logger.warning('begins %.3f s after start_time' % late)

    def begin_again(self):
        """Make now the epoch, or the start if that is still to come; no steps come before it."""
        now = self.nanoseconds()
        self._epoch = max(now, self._start)
        self.stepped = self.seconds(now)

    def nanoseconds(self):
        """Give the time as it is in stamps [ns]."""
        return self._clock.now().nanoseconds

    def now(self):
        """Give the time [s]."""
        return self.seconds(self.nanoseconds())

    def seconds(self, nanoseconds):
        """Give the time [s] of a stamp."""
        return (nanoseconds - self._epoch) / SECOND

    def stamp(self):
        """Give the time that the state belongs to, as a message."""
        return ros_time(self._epoch + round(self.stepped * SECOND))

    def jump(self):
        """Give by how much the clock has jumped since the last steps [s]; 0 as a rule."""
        gap = self.now() - self.stepped
        return 0.0 if -ROUNDING <= gap <= LONGEST_GAP else gap

    def stand_still(self):
        """Ask for no steps up to now."""
        self.stepped = self.now()

    def due(self, dt):
        """Give how many steps of dt [s] are asked for."""
        now = self.now()
        self.stepped = max(self.stepped, min(now, 0.0))
        return int((now - self.stepped) / dt + ROUNDING)

    def spend(self, asked, count, dt):
        """
        Give the times at which `count` steps end that stand for all that are asked for.

        Returns
        -------
        times : (count,) float64 [s]
        pace : float [-]
            Time on the clock a time of the simulation: above 1 where steps are left out.

        """
        times = self.stepped + asked * dt / count * np.arange(1, count + 1)
        self.stepped += asked * dt
        return times, asked / count

    def publish(self):
        """Do nothing: others say what time it is."""


class PublishedClock:
    """
    The time of a simulation, in step with the steady clock and published on /clock.

    Parameters
    ----------
    node : rclpy.node.Node
    simulation : Simulation

    """

    resets, flows = True, True

    def __init__(self, node, simulation):
        """Start now, at the time of the simulation."""
        self._simulation = simulation
        self._publisher = node.create_publisher(rosgraph_msgs.msg.Clock, '/clock', 10)
        self.stand_still()

    def nanoseconds(self):
        """Give the time as it is in stamps [ns]."""
        return round(self.now() * SECOND)

    def now(self):
        """Give the time [s], between two ticks as well."""
        return self._simulation.time + min(self._owed(), LONGEST_TICK)

    def seconds(self, nanoseconds):
        """Give the time [s] of a stamp."""
        return nanoseconds / SECOND

    def stamp(self):
        """Give the time of the simulation, as a message."""
        return ros_time(round(self._simulation.time * SECOND))

    def jump(self):
        """Give 0: what the node itself publishes does not jump."""
        return 0.0

    def stand_still(self):
        """Ask for no steps up to now."""
        self._ticked, self._rest = time.monotonic(), 0.0

    begin = stand_still

    def due(self, dt):
        """Give how many steps of dt [s] are asked for."""
        self._rest, self._ticked = min(self._owed(), LONGEST_GAP), time.monotonic()
        return int(self._rest / dt + ROUNDING)

    def spend(self, asked, count, dt):
        """As that of FollowedClock; for steps that are left out, the clock runs slower."""
        self._rest -= asked * dt
        return self._simulation.time + dt * np.arange(1, count + 1), 1.0

    def publish(self):
        """Say what time it is."""
        self._publisher.publish(rosgraph_msgs.msg.Clock(clock=self.stamp()))

    def _owed(self):
        """Give the time since the last tick, and what was less than a step before [s]."""
        return self._rest + time.monotonic() - self._ticked
