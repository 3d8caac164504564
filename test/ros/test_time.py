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

"""Check 6 of ten, time: jumps of a clock that is followed, and the node as the clock."""

import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from builtin_interfaces.msg import Time  # noqa: E402, I100
from collision_sim.ros import clocks  # noqa: E402
from geometry_msgs.msg import PoseArray  # noqa: E402
from harness import DEADLINE, jittered_stamps, PADDLE, SECOND, stop_node  # noqa: E402
from rcl_interfaces.srv import SetParameters  # noqa: E402
import rclpy  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

NODE = '/collision_sim'
# x of the particle is the simulated time.
HAND = {'gravity': [0, 0, 0], 'particles': {'position': [[0, 0, 0]], 'velocity': [1, 0, 0]},
        'colliders': [{'name': 'paddle', 'shape': 'sphere', 'radius': 1, 'topic': 'paddle/pose',
                       'position': [0, 100, 0]}]}


def seconds(stamp):
    return stamp.sec + 1e-9 * stamp.nanosec


# --- a clock that is followed ----------------------------------------------------------------


@pytest.mark.parametrize('jump', [-51.0, -0.01, 400.0])
def test_jumps_of_the_clock_cause_no_steps(drive, jump):
    driver = drive(PADDLE)
    driver.run(0.5)
    time = driver.simulation.time
    driver.set_clock(driver.now + jump)
    driver.node._tick()
    assert driver.simulation.time == time
    driver.run(0.5)
    assert driver.simulation.time == pytest.approx(time + 0.5, abs=2 * driver.simulation.dt)


def test_poses_are_taken_after_the_clock_went_back(drive):
    driver = drive(PADDLE)
    driver.run(0.5, {'paddle': lambda stamp: ((-1.0, 0, 0.5), (0, 0, 0, 1))},
               jittered_stamps(driver.now, driver.now + 0.4))
    driver.set_clock(driver.now - 20.0)
    driver.node._tick()
    driver.run(0.5, {'paddle': lambda stamp: ((-2.0, 0, 0.5), (0, 0, 0, 1))},
               jittered_stamps(driver.now + 0.01, driver.now + 0.4))
    assert not driver.node._poses.dropped
    assert driver.simulation.collider_pose('paddle')[0][0] == -2.0


def test_a_frozen_clock_is_a_frozen_simulation(drive):
    driver = drive(PADDLE)
    driver.run(0.1)
    time = driver.simulation.time
    for _ in range(10):
        driver.node._tick()
    assert driver.simulation.time == time


def test_too_slow_for_the_clock(drive):
    """Steps are left out, the colliders still follow the clock."""
    driver = drive({**PADDLE, 'gravity': [0, 0, 0]})

    def pose(stamp):
        return (stamp - driver.START - 3.0, 0.0, 0.5), (0, 0, 0, 1)

    def slow():
        driver.node._seconds_a_step = 0.024         # two steps a tick, four are asked for

    driver.run(2.0, {'paddle': pose}, jittered_stamps(driver.now, driver.now + 2.0), slow)
    assert driver.simulation.time == pytest.approx(1.0, rel=0.05)
    x = driver.simulation.collider_pose('paddle')[0][0]
    assert x == pytest.approx(driver.now - 0.1 - driver.START - 3.0, abs=0.01)


def test_a_clock_far_from_the_start_is_as_precise(drive):
    """Simulated time that starts at zero and goes on at the time of a recording."""
    driver = drive(PADDLE)
    driver.set_clock(1.7e9)
    driver.node._tick()
    begin = driver.now
    driver.run(0.5, {'paddle': lambda stamp: ((stamp - begin - 3.0, 0, 0.5), (0, 0, 0, 1))},
               [begin + 0.05 * k for k in range(10)])
    assert not driver.node._poses.dropped
    assert driver.simulation.time == pytest.approx(0.5, abs=0.03)


class Hand:
    """A clock for the node in another process, and what the node says at it."""

    def __init__(self, peer):
        self.peer = peer
        self.publisher = peer.node.create_publisher(Clock, '/clock', 10)
        self.messages = peer.subscribe(PoseArray, NODE + '/particles')
        self.time = 1000.0

    def show(self, **stamp):
        self.publisher.publish(Clock(clock=Time(**stamp)))
        self.peer.spin_for(0.02)

    def run(self, duration, rate=50.0):
        """Go on in steps for a while on the clock [s]."""
        for _ in range(round(duration * rate)):
            self.time += 1.0 / rate
            whole, rest = divmod(round(self.time * SECOND), SECOND)
            self.show(sec=whole, nanosec=rest)

    def simulated(self):
        return self.messages[-1].poses[0].position.x


@pytest.fixture
def hand(run_node, peer):
    process = run_node(HAND, '-p', 'use_sim_time:=true')
    hand = Hand(peer)
    peer.spin_until(lambda: hand.run(0.1) or hand.messages and hand.simulated() > 0.0)
    yield hand
    printed = stop_node(process)
    assert process.returncode == 0 and 'Traceback' not in printed


@pytest.mark.parametrize('jump', [-51.0, 400.0])
def test_no_burst_of_steps_when_a_clock_elsewhere_jumps(hand, jump):
    hand.run(0.2)
    before, count = hand.simulated(), len(hand.messages)
    hand.time += jump
    hand.run(0.4)
    assert before < hand.simulated() < before + 0.6
    late = hand.messages[count + 3:]    # without those from before a jump back
    assert late and all(seconds(message.header.stamp) < hand.time + 1e-6 for message in late)


def test_a_clock_elsewhere_that_stands_or_talks_nonsense(hand, peer):
    before = hand.simulated()
    peer.spin_for(0.5)
    assert hand.simulated() - before < 0.1
    assert peer.call(SetBool, NODE + '/pause', SetBool.Request(data=False)).success
    for stamp in ({'sec': 1400, 'nanosec': 2 ** 32 - 1}, {'sec': -5, 'nanosec': 0},
                  {'sec': 2 ** 31 - 1, 'nanosec': 10 ** 9}, {'sec': 0, 'nanosec': 0}):
        hand.show(**stamp)
    assert hand.simulated() - before < 0.2
    count = len(hand.messages)
    hand.run(0.4)
    assert before + 0.2 < hand.simulated() < before + 0.8 and len(hand.messages) > count


# --- the node is the clock -------------------------------------------------------------------


def published_clock(monkeypatch):
    """Give a PublishedClock, what it publishes, its simulation, and a function to wait."""
    sent, steady = [], [50.0]
    simulation = SimpleNamespace(time=2.0)
    node = SimpleNamespace(create_publisher=lambda *args: SimpleNamespace(publish=sent.append))
    monkeypatch.setattr(clocks.time, 'monotonic', lambda: steady[0])

    def wait(duration):
        steady[0] += duration

    return clocks.PublishedClock(node, simulation), sent, simulation, wait


def test_the_published_clock_is_in_step_with_the_steady_one(monkeypatch):
    clock, sent, simulation, wait = published_clock(monkeypatch)
    for _ in range(10):
        wait(0.025)
        asked = clock.due(0.01)
        times, pace = clock.spend(asked, asked, 0.01)
        np.testing.assert_allclose(times, simulation.time + 0.01 * np.arange(1, asked + 1))
        assert pace == 1.0
        simulation.time = times[-1]
    assert simulation.time == pytest.approx(2.25)
    clock.publish()
    assert seconds(sent[-1].clock) == pytest.approx(simulation.time)
    wait(0.007)
    assert clock.now() == pytest.approx(simulation.time + 0.007)


def test_the_published_clock_runs_slower_than_the_steady_one_where_it_must(monkeypatch):
    """What there was no time for is not asked for again, nor what a stopped process missed."""
    clock, _, simulation, wait = published_clock(monkeypatch)
    wait(0.5)
    assert clock.due(0.01) == 50
    times, _ = clock.spend(50, 3, 0.01)
    np.testing.assert_allclose(times, [2.01, 2.02, 2.03])
    assert clock.due(0.01) == 0
    wait(3600.0)
    assert clock.now() < simulation.time + 0.1
    assert clock.due(0.01) <= 101
    clock.stand_still()
    assert clock.due(0.01) == 0


def test_the_node_is_the_clock_of_others(run_node, peer):
    process = run_node('demo', '-p', 'publish_clock:=true')
    clock = peer.subscribe(Clock, '/clock')
    follower = rclpy.create_node('follower', context=peer.context, parameter_overrides=[
        Parameter('use_sim_time', value=True)])
    peer.executor.add_node(follower)
    messages = peer.subscribe(PoseArray, NODE + '/particles')
    swing = subprocess.Popen([sys.executable, '-m', 'collision_sim.ros.swing_paddle', '--ros-args',
                              '-p', 'use_sim_time:=true', '-p', 'rate:=30.0'])
    colliders = peer.subscribe(MarkerArray, NODE + '/colliders')

    def paddle():
        return {round(marker.pose.position.x, 6) for message in colliders
                for marker in message.markers if marker.ns == 'colliders/paddle'}

    peer.spin_until(lambda: len(paddle()) > 60)
    swing.terminate()
    assert swing.wait() == 0
    times = [seconds(message.clock) for message in clock]
    assert times == sorted(times) and 0.5 < times[-1] < 3600.0
    stamps = [seconds(message.header.stamp) for message in messages]
    assert stamps == sorted(stamps) and stamps[-1] <= times[-1]
    assert times[0] < seconds(follower.get_clock().now().to_msg()) < times[-1] + 1.0
    peer.call(SetBool, NODE + '/pause', SetBool.Request(data=True))
    peer.spin_until(lambda: clock[-1] == clock[-9])     # it stands, and goes on being published
    peer.call(Trigger, NODE + '/reset', Trigger.Request())
    peer.spin_until(lambda: seconds(clock[-1].clock) == 0.0)
    refused = peer.call(SetParameters, NODE + '/set_parameters', SetParameters.Request(
        parameters=[Parameter('use_sim_time', value=True).to_parameter_msg()])).results[0]
    assert not refused.successful and 'publish_clock' in refused.reason
    follower.destroy_node()
    assert 'dropped' not in stop_node(process)


def test_the_clock_cannot_be_published_and_followed(run_node):
    process = run_node(None, '-p', 'publish_clock:=true', '-p', 'use_sim_time:=true')
    printed, _ = process.communicate(timeout=DEADLINE)
    assert process.returncode == 1 and 'Traceback' not in printed
    assert 'use_sim_time' in printed and 'publish_clock' in printed
