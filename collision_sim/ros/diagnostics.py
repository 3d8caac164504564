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

"""What the node says about itself on /diagnostics, once a second, as long as somebody listens."""

from collections import Counter
import time

from collision_sim.ros import fast_dds
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import numpy as np

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
SLOWEST = 0.5           # real-time factor below which steps left out are an error
DEEPEST = 1e-3          # m that a particle may be inside a collider
LARGEST_RESIDUAL = 1e-9     # of the ledger, as a share of all that is booked in it
UNUSUAL = {             # counters that stand still in a sound simulation, and what one more means
    'fail_safes': 'fail-safes',
    'unplaced': 'particles left inside a collider',
    'undecided': 'impacts that were not found',
}


def new_since(before, now):
    """Give how many events a counter has counted since; a reset of the node sets it to 0."""
    return now - before if now >= before else now


class Diagnostics:
    """
    Accounts of the time since the last report, and the reports.

    Parameters
    ----------
    name : str
        Of the node.
    simulation : Simulation
    poses : PoseTopics
    outputs : Outputs
    refused : Counter
        Values from topics that were refused, by parameter.
    events : Counter
        What the middleware has told, by topic and what has happened.

    Attributes
    ----------
    steps : int
        Taken.
    step_times, publish_times : list of float [s]
        Per step, and per message of all topics together.
    slow, paused : bool
        Whether steps were left out for lack of time; whether none are asked for.
    largest : int
        Bytes of the largest message so far.

    """

    def __init__(self, name, simulation, poses, outputs, refused, events=Counter()):
        """Begin the first interval when somebody listens."""
        self.paused, self.largest = False, 0
        self._name = name
        self._simulation, self._poses, self._outputs = simulation, poses, outputs
        self._refused, self._events = refused, events
        self._trouble = fast_dds.trouble()
        self.rest()

    def rest(self):
        """Nobody listens."""
        self._counters = None
        self._clear()

    def begin(self):
        """Begin an interval that a report is about."""
        self._counters, self._drops = self._simulation.counters, self._poses.dropped.total()
        self._refusals, self._told = self._refused.total(), self._events.copy()
        self._clear()

    def _clear(self):
        self.steps, self.step_times, self.publish_times = 0, [], []
        self._sent, self._gaps = None, []
        self.slow = False
        self._since = time.monotonic()

    def report(self, now):
        """
        Give the message about the interval, and begin the next.

        Parameters
        ----------
        now : float [s]
            Time of the streams.

        Returns
        -------
        message : diagnostic_msgs.msg.DiagnosticArray or None
            Without a stamp; None where the interval begins only now.

        """
        statuses = None
        if self._counters is not None:
            statuses = [self._pace(), self._physics()]
            if self._poses.topics or self._refused or self._events:
                statuses.append(self._inputs(now))
        self.begin()
        return statuses and DiagnosticArray(status=statuses)

    def note_message(self, start, end):
        """Note when the messages of a tick began and ended to go out [s]."""
        if self._sent is not None:
            self._gaps.append(start - self._sent)
        self._sent = start
        self.publish_times.append(end - start)

    def preparing(self, why):
        """Give the message before the kernels are ready, and why; there is nothing to measure."""
        return DiagnosticArray(status=[_status(
            self._name + ': pace', [(WARN, why)],
            {'particles': len(self._simulation.position)})])

    def _pace(self):
        """Tell how fast it goes, and what it takes."""
        simulation, elapsed = self._simulation, self._elapsed()
        factor = self.steps * simulation.dt / elapsed
        values = {
            'time [s]': simulation.time,
            'step [s]': simulation.dt,
            'steps per second': self.steps / elapsed,
            'real-time factor': factor,
            **_spread('step time', self.step_times),
            **_spread('publish time', self.publish_times),
            **({'longest gap between messages [ms]': 1e3 * max(self._gaps)} if self._gaps else {}),
            'particles': len(simulation.position),
            'particles in a PoseArray': self._outputs.messages.shown,
        }
        findings = []
        if self._trouble and self.largest > fast_dds.LARGE:
            findings.append((WARN, 'messages of %.1f MB may get lost: %s' % (
                1e-6 * self.largest, self._trouble)))
        if self.slow:
            findings.append((ERROR if factor < SLOWEST else WARN, 'too slow for the clock'))
        return _status(self._name + ': pace', findings, values,
                       'paused' if self.paused else 'running')

    def _physics(self):
        """Tell what happens, and whether it can be trusted."""
        counters, elapsed = self._simulation.counters, self._elapsed()
        new = {key: new_since(self._counters[key], count) for key, count in counters.items()}
        clearance = self._simulation.clearance()
        depth = float(np.max(-clearance, initial=0.0, where=np.isfinite(clearance)))
        frozen = counters['frozen']
        values = {
            'collisions per second': new['collisions'] / elapsed,
            'contacts per second': new['contacts'] / elapsed,
            'deepest penetration [m]': depth,
            **counters,
        }
        findings = [(WARN, '%d %s' % (new[key], text)) for key, text in UNUSUAL.items()
                    if new[key]]
        if frozen:
            findings.append((ERROR, '%d particles are not finite and frozen' % frozen))
        if depth > DEEPEST:
            findings.append((WARN, 'a particle is %.3g m inside a collider' % depth))
        if self._simulation.ledger is not None:
            residual, share = _residual(self._simulation.ledger.total)
            values.update({'ledger residual [J]': residual, 'ledger residual [share]': share})
            if not share <= LARGEST_RESIDUAL:
                findings.append((ERROR, 'the ledger misses %.3g of its bookings' % share))
        return _status(self._name + ': physics', findings, values)

    def _inputs(self, now):
        """Tell what came from others and was not taken, or no longer comes."""
        dropped, stale = self._poses.dropped, self._poses.stale(now)
        findings = [(WARN, '%s stands still without poses' % collider) for collider in stale]
        if dropped.total() > self._drops:
            findings.append((WARN, '%d poses dropped' % (dropped.total() - self._drops)))
        if self._refused.total() > self._refusals:
            findings.append((WARN, '%d values refused' % (
                self._refused.total() - self._refusals)))
        for (topic, what), count in (self._events - self._told).items():
            findings.append((WARN, '%s: %d %s' % (topic, count, what)))
        values = {
            'dropped': dropped.total(),
            'stale': ' '.join(stale),
            **{'dropped %s: %s' % key: count for key, count in sorted(dropped.items())},
            **{'refused %s' % key: count for key, count in sorted(self._refused.items())},
            **{'%s: %s' % key: count for key, count in sorted(self._events.items())},
        }
        return _status(self._name + ': inputs', findings, values)

    def _elapsed(self):
        return max(time.monotonic() - self._since, 1e-9)


def _spread(name, seconds):
    """Mean and 99th percentile of durations, in ms."""
    if not seconds:
        return {}
    return {name + ', mean [ms]': 1e3 * float(np.mean(seconds)),
            name + ', p99 [ms]': 1e3 * float(np.percentile(seconds, 99))}


def _residual(balance):
    """Residual of a Balance [J], and as a share of all that is booked."""
    booked = sum(abs(value) for value in (
        balance.gravity, balance.drag, balance.restitution, balance.dry, balance.wet,
        balance.contact, balance.repulsion, balance.internal, *balance.colliders))
    return balance.residual, abs(balance.residual) / max(booked, 1e-300)


def _status(name, findings, values, fine='fine'):
    """Status of the worst level of (level, text) findings."""
    return DiagnosticStatus(
        level=max((level for level, _ in findings), default=OK), name=name, hardware_id='none',
        message=', '.join(text for _, text in findings) or fine,
        values=[KeyValue(key=key, value=_text(value)) for key, value in values.items()])


def _text(value):
    return '%.6g' % value if isinstance(value, float) else str(value)
