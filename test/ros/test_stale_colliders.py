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

"""Check 5 of ten, poses that stop and return: standing still in time, and no fling."""

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from diagnostic_msgs.msg import DiagnosticStatus  # noqa: E402, I100
from harness import jittered_stamps, TICK  # noqa: E402

UPRIGHT = (0, 0, 0, 1)
DELAY, TIMEOUT = 0.1, 0.5       # s, the defaults
SPEED = 1.0                     # m/s
# A row of elastic particles in front of the box, wherever it gets to.
SCENE = {
    'gravity': [0, 0, 0], 'restitution': 1.0,
    'particles': {'position': [[0.05 * k, 0, 0] for k in range(3, 120)]},
    'colliders': [{'name': 'moved', 'shape': 'box', 'size': [0.2, 1, 1], 'topic': 'moved/pose',
                   'position': [-2, 0, 0]}]}


def place(driver):
    return driver.simulation.collider_pose('moved')[0][0]


def level(driver):
    """Level and message of the diagnostics of the inputs."""
    if driver.node._diagnostics.report(driver.node._time.now()) is None:
        return level(driver)
    status = driver.node._diagnostics.report(driver.node._time.now()).status[-1]
    return status.level, status.message


def test_a_collider_whose_poses_stop_goes_on_and_then_stands_still(drive):
    """With its twist until the time-out, within a tick; diagnostics say so, and of its return."""
    driver = drive(SCENE)

    def pose(stamp):
        return (SPEED * (stamp - driver.START) - 1.0, 0, 0), UPRIGHT

    stamps = jittered_stamps(driver.START, driver.START + 0.5)
    last = max(stamps)
    driver.run(0.5, {'moved': pose}, stamps)
    assert level(driver)[0] == DiagnosticStatus.OK
    driver.run(last + DELAY + TIMEOUT - 2 * TICK - driver.now)
    before = place(driver)
    driver.run(TICK)
    assert place(driver) - before == pytest.approx(SPEED * TICK, rel=0.3)
    driver.run(3 * TICK)
    still = place(driver)
    driver.run(1.0)
    assert place(driver) == still
    assert still == pytest.approx(pose(last + TIMEOUT)[0][0], abs=1e-3)
    assert level(driver)[0] == DiagnosticStatus.WARN and 'moved' in level(driver)[1]
    now = driver.now
    driver.run(0.5, {'moved': lambda stamp: ((3.0 + SPEED * (stamp - now), 0, 0), UPRIGHT)},
               jittered_stamps(now, now + 0.5))
    assert place(driver) > 3.0 and level(driver)[0] == DiagnosticStatus.OK


@pytest.mark.parametrize('gap', [0.1, 0.2, 0.4, 0.49, 0.6, 3.0])
@pytest.mark.parametrize('away', [-0.4, 0.1, 0.4, 0.6, 3.0])
def test_a_collider_that_returns_flings_nothing(drive, gap, away):
    """What is nearer than a teleport is caught up with in half the gap, or half the delay."""
    driver = drive(SCENE)
    leave = driver.START + 0.4

    def pose(stamp):
        beyond = away if stamp > leave else 0.0
        return (SPEED * (stamp - driver.START) - 0.5 + beyond, 0, 0), UPRIGHT

    stamps = [stamp for stamp in jittered_stamps(driver.START, driver.START + 5.0)
              if not leave < stamp < leave + gap]
    driver.run(gap + 1.5, {'moved': pose}, stamps)
    fastest = np.abs(driver.simulation.velocity).max()
    bound = 2.0 * (SPEED + 1.5 * (abs(away) + SPEED * gap) / (0.5 * max(gap, DELAY)))
    teleports = gap > TIMEOUT or away > 0.5
    assert fastest <= (2.0 * SPEED * 1.01 if teleports else bound)
    assert place(driver) == pytest.approx(pose(driver.now - DELAY)[0][0], abs=1e-3)
