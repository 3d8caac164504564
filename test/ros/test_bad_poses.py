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

"""Check 1 of ten, bad poses: dropped, counted by reason, warned of once, and of no effect."""

from math import inf, nan

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402, I100
from geometry_msgs.msg import PoseStamped  # noqa: E402
from harness import Driver, jittered_stamps, PADDLE, pose_message  # noqa: E402


def bad_poses(now):
    good = now - 0.01, (0, 0, 0.5)
    broken = pose_message(*good)
    broken.header.stamp.nanosec = 10 ** 9
    yield 'stamp', broken
    yield 'frame', pose_message(*good, frame='')
    yield 'frame', pose_message(*good, frame='map')
    yield 'not_finite', pose_message(now, (nan, 0, 0))
    yield 'not_finite', pose_message(now, (0, -inf, 0))
    yield 'not_finite', pose_message(now, (0, 0, 0), (0, 0, nan, 1))
    yield 'too_far', pose_message(now, (1e300, 0, 0))
    yield 'zero_quaternion', pose_message(now, (0, 0, 0), (0, 0, 0, 0))
    yield 'not_unit', pose_message(now, (0, 0, 0), (0, 0, 0, 2))
    yield 'future', pose_message(now + 10.0, (0, 0, 0))
    yield 'stale', pose_message(now - 10.0, (0, 0, 0))
    yield 'backwards', pose_message(now - 0.3, (0, 0, 0))


def test_bad_poses_are_dropped_and_counted(drive):
    """The state stays bit by bit that of a run without them."""
    def pose(stamp):
        return (stamp - Driver.START - 1.5, 0.0, 0.5), (0, 0, 0, 1)

    drivers = drive(PADDLE), drive(PADDLE)
    stamps = jittered_stamps(Driver.START, Driver.START + 2.0)
    reasons = []
    for driver in drivers:
        driver.run(1.0, {'paddle': pose}, stamps)
        if driver is drivers[0]:
            for reason, message in bad_poses(driver.now):
                driver.take('paddle', message)
                reasons.append(reason)
        driver.run(1.0, {'paddle': pose}, [s for s in stamps if s + driver.LATENCY > driver.now])
    for name in ('position', 'velocity'):
        one, other = (getattr(driver.simulation, name) for driver in drivers)
        np.testing.assert_array_equal(one, other)
    dropped = drivers[0].node._poses.dropped
    assert not drivers[1].node._poses.dropped
    assert dropped == {('paddle', reason): reasons.count(reason) for reason in reasons}


def test_they_are_counted_in_the_diagnostics_and_warned_of_once(drive, capfd):
    """A flood over the topic, 50 of each reason."""
    driver = drive(PADDLE)
    messages = []
    driver.peer.create_subscription(DiagnosticArray, '/diagnostics', messages.append, 10)
    publisher = driver.peer.create_publisher(PoseStamped, 'paddle/pose', 1000)
    driver.spin_until(lambda: publisher.get_subscription_count() > 0)
    driver.take('paddle', pose_message(driver.now, (-1, 0, 0.5)))
    taken = driver.node._poses._streams['paddle'].newest
    driver.spin_until(lambda: messages)
    bad = list(bad_poses(driver.now))
    expected = {}
    for reason, message in bad:
        expected[reason] = expected.get(reason, 0) + 50
        for k in range(50):
            publisher.publish(message)
            if k % 5 == 4:      # so that none is lost
                driver.spin_until(lambda: sum(driver.node._poses.dropped.values()) == sum(
                    expected.values()) - 49 + k)

    def counted():
        status = messages[-1].status[-1] if messages else None
        return status and {
            value.key.split()[-1]: int(value.value) for value in status.values
            if value.key.startswith('dropped paddle')} == expected

    driver.spin_until(counted)
    assert any(message.status[-1].level == DiagnosticStatus.WARN for message in messages)
    assert capfd.readouterr().err.count('pose dropped') < 3 * len(expected)
    assert driver.node._poses._streams['paddle'].newest == taken
