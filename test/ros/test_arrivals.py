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


"""Poses without a stamp: when they were sent, from when they arrived with jitter."""

from collision_sim.core.pose_stream import PoseStream
from collision_sim.ros.arrivals import Arrivals
import numpy as np
import pytest

LATENCY = 1e-3      # s


def arrivals(rate, jitter, seconds=6.0, lost=0.0):
    """Give the times at which poses are sent and arrive; some are lost."""
    random = np.random.default_rng(4)
    sent = np.arange(0.0, seconds, 1.0 / rate)
    sent = sent[random.uniform(size=len(sent)) >= lost]
    arrived = sent + LATENCY + random.exponential(jitter, len(sent))
    return sent, np.maximum.accumulate(arrived + 1e-9 * np.arange(len(sent)))


def speeds(sent, stamps):
    """Speeds at which a plate is played that moves at 1 m/s, after the first second and a half."""
    stream, found = PoseStream(delay=0.1), []
    for place, stamp in zip(sent, stamps):
        stream.add(stamp, (0.25 * place, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        times = stamp + np.arange(1, 5) / 960.0
        found.append(stream.sample(times).twist[:, 0] / 0.25)
    return np.concatenate(found[int(1.5 * len(sent) / 6.0):])


@pytest.mark.parametrize('rate, jitter, lost', [
    (30, 1e-3, 0.0), (30, 3e-3, 0.0), (50, 1e-3, 0.0), (50, 1e-3, 0.1), (100, 0.3e-3, 0.0)])
def test_a_plate_moves_with_the_speed_that_it_has(rate, jitter, lost):
    """Within 3 %; by the arrivals themselves it would be wrong by some times as much."""
    sent, arrived = arrivals(rate, jitter, lost=lost)
    line = Arrivals()
    found, plain = speeds(sent, map(line.sent, arrived)), speeds(sent, arrived)
    assert np.abs(found - 1.0).max() < 0.06 and np.std(found) < 0.02
    assert abs(found.mean() - 1.0) < 2e-3
    assert np.std(plain) > 4.0 * np.std(found)


def test_regular_arrivals_are_left_as_they_are():
    line, times = Arrivals(), np.arange(100) / 30.0
    np.testing.assert_allclose([line.sent(t) for t in times], times, atol=1e-12)
    assert line.sent(times[-1]) == pytest.approx(times[-1])     # the same pose again


def test_irregular_arrivals_are_near_where_they_are():
    """In order, and never off by more than half the time to a neighbour."""
    times = np.cumsum(np.random.default_rng(1).exponential(0.05, 1000) + 1e-6)
    line = Arrivals()
    sent = np.array([line.sent(t) for t in times])
    assert (np.diff(sent) > 0.0).all()
    assert np.abs(sent - times).max() < 0.2


def test_a_stream_that_stops_or_changes_its_rate_begins_a_new_line():
    line = Arrivals()
    for t in np.arange(100) / 30.0:
        line.sent(t)
    assert line.sent(10.0) == 10.0
    later = 10.0 + np.arange(1, 100) / 50.0
    np.testing.assert_allclose([line.sent(t) for t in later], later, atol=1e-9)
