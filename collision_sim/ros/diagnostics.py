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

"""What the node says about itself on /diagnostics, once a second."""

import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue


class Diagnostics:
    """Rates between two reports; `slow` while steps were left out for lack of time."""

    def __init__(self):
        """Start the first interval."""
        self.paused = False
        self._dropped = 0
        self.restart()

    def restart(self):
        """Start the next interval."""
        self.steps = 0
        self.slow = False
        self._since = time.monotonic()

    def report(self, name, simulation, poses, now):
        """
        Give the message about the interval since the last report.

        Parameters
        ----------
        name : str
            Of the node.
        simulation : Simulation
            For its time and counters.
        poses : PoseTopics
            For what was dropped and what is stale.
        now : float [s]
            Time of the streams.

        Returns
        -------
        statuses : diagnostic_msgs.msg.DiagnosticArray
            Without a stamp.

        """
        elapsed = max(time.monotonic() - self._since, 1e-9)
        rate = self.steps / elapsed
        values = {
            'time [s]': simulation.time,
            'step [s]': simulation.dt,
            'steps per second': rate,
            'real-time factor': rate * simulation.dt,
            'particles': len(simulation.position),
            **simulation.counters,
        }
        pace = 'too slow for the clock' if self.slow else 'paused' if self.paused else 'running'
        statuses = [_status(name + ': simulation', self.slow, pace, values)]
        if poses.topics:
            statuses.append(self._pose_status(name, poses, now))
        self.restart()
        return DiagnosticArray(status=statuses)

    def _pose_status(self, name, poses, now):
        values = {'dropped %s: %s' % key: count for key, count in sorted(poses.dropped.items())}
        total = sum(poses.dropped.values())
        stale = poses.stale(now)
        problems = ['%s stands still without poses' % collider for collider in stale]
        if total > self._dropped:
            problems.append('%d poses dropped' % (total - self._dropped))
        self._dropped = total
        values = {'dropped': total, 'stale': ' '.join(stale), **values}
        return _status(name + ': poses', bool(problems), ', '.join(problems) or 'fine', values)


def _status(name, warn, message, values):
    level = DiagnosticStatus.WARN if warn else DiagnosticStatus.OK
    return DiagnosticStatus(
        level=level, name=name, message=message, hardware_id='none',
        values=[KeyValue(key=key, value=_text(value)) for key, value in values.items()])


def _text(value):
    return '%.6g' % value if isinstance(value, float) else str(value)
