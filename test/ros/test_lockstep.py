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

"""Steps asked for one by one: what they use of the poses, and another simulator in step."""

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from collision_sim import Scene, Simulation  # noqa: E402, I100
from collision_sim.ros.messages import read_pose_array  # noqa: E402
from geometry_msgs.msg import PoseArray, PoseStamped  # noqa: E402
from harness import jittered_stamps, pose_message, SECOND  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402

NODE = '/collision_sim'
DT = 1.0 / 240.0
STEPS = 400
SPEED, SPIN = 1.5, 2.0      # m/s, rad/s
# A turning box runs through a grid of particles that bounce on the ground.
SCENE = {
    'particles': {'count': 200, 'box': {'min': [-0.5, -0.5, 0.1], 'max': [0.5, 0.5, 0.5]}},
    'restitution': 0.6, 'friction': {'dry': 0.2},
    'colliders': [{'name': 'ground', 'shape': 'plane'},
                  {'name': 'moved', 'shape': 'box', 'size': [0.2, 1.0, 1.0], 'topic': 'moved/pose',
                   'position': [-0.7, 0, 0.5]}],
}


def pose(time):
    """Pose of the box at a time since the start [s]."""
    return ((-0.7 + SPEED * time, 0.0, 0.5),
            (0.0, 0.0, np.sin(SPIN * time / 2), np.cos(SPIN * time / 2)))


def by_library():
    """Positions after each step where the box is moved by calls."""
    simulation = Simulation(Scene.from_dict(SCENE))
    positions = []
    for k in range(1, STEPS + 1):
        simulation.move_collider('moved', *pose(k * DT))
        simulation.step()
        positions.append(simulation.position.copy())
    assert simulation.counters['collisions'] > 100
    return np.array(positions)


class OtherSimulator:
    """Says where the box is at the end of a step, asks for it, and takes what comes out."""

    def __init__(self, peer, stamped):
        self.peer = peer
        self.stamped = stamped
        self.publisher = peer.node.create_publisher(PoseStamped, 'moved/pose', 5)
        self.client = peer.node.create_client(Trigger, NODE + '/step')
        self.messages = peer.subscribe(PoseArray, NODE + '/particles', raw=True)
        peer.spin_until(lambda: self.client.service_is_ready() and self.messages)
        peer.call(SetBool, NODE + '/pause', SetBool.Request(data=True))
        while 'moved: moved' not in self.step(0.0):     # it is not ready, or not discovered
            peer.spin_for(0.1)

    def step(self, time):
        message = pose_message(time if self.stamped else None, *pose(time))
        self.publisher.publish(message)
        future = self.client.call_async(Trigger.Request())
        self.peer.spin_until(future.done)
        return future.result().message

    def run(self):
        """Positions by time on the clock [ns], from the start on."""
        self.peer.call(Trigger, NODE + '/reset', Trigger.Request())
        for k in range(1, STEPS + 1):
            answer = self.step(k * DT)
            assert answer == 'at %.6f s, moved: moved' % (k * DT)
        count = len(self.messages)
        self.peer.spin_until(lambda: len(self.messages) > count + 10)
        found = {}
        for message in self.messages:
            sec, nanosec, _, poses = read_pose_array(message)
            found[sec * SECOND + nanosec] = poses[:, :3]
        self.messages.clear()
        return found


def test_lockstep_with_the_published_clock(run_node, peer):
    """Every step is published, stamped with the simulated time, bit by bit that of the library."""
    run_node(SCENE, '-p', 'publish_clock:=true',
             '-p', 'qos_overrides./moved/pose.subscription.reliability:=reliable')
    other = OtherSimulator(peer, stamped=True)
    expected = by_library()
    for _ in range(2):
        found = other.run()
        times = [round(k * DT * SECOND) for k in range(1, STEPS + 1)]
        np.testing.assert_array_equal([found[time] for time in times], expected)


def test_lockstep_on_the_wall_clock_without_stamps(run_node, peer):
    run_node(SCENE)
    other = OtherSimulator(peer, stamped=False)
    for _ in range(2):
        found = other.run()
        np.testing.assert_array_equal(found[max(found)], by_library()[-1])


# --- which pose counts -----------------------------------------------------------------------


def pause(driver, data=True):
    driver.node._pause(SetBool.Request(data=data), SetBool.Response())


def step(driver):
    return driver.node._step(Trigger.Request(), Trigger.Response())


def place(driver):
    return tuple(driver.simulation.collider_pose('moved')[0])


@pytest.fixture
def paused(drive):
    driver = drive({**SCENE, 'gravity': [0, 0, 0]})
    pause(driver)
    return driver


def test_the_newest_pose_counts_whatever_the_delay(paused):
    for x in (-0.69, -0.68, -0.67):
        paused.take('moved', pose_message(None, (x, 0, 0.5)))
    assert step(paused).message.endswith('moved: moved')
    assert place(paused) == (-0.67, 0, 0.5)
    assert step(paused).message.endswith('moved: nothing')
    assert place(paused) == (-0.67, 0, 0.5)


def test_stamps_need_only_increase(paused):
    for stamp, x in ((5.0, -0.69), (5.1, -0.68), (5.1, -0.1), (4.9, -0.2), (None, -0.67)):
        paused.take('moved', pose_message(stamp, (x, 0, 0.5)))
    step(paused)
    assert place(paused) == (-0.67, 0, 0.5)
    assert paused.node._poses.dropped == {('moved', 'repeated'): 1, ('moved', 'backwards'): 1}
    paused.node._reset(Trigger.Request(), Trigger.Response())
    paused.take('moved', pose_message(1.0, (-0.66, 0, 0.5)))
    step(paused)
    assert place(paused) == (-0.66, 0, 0.5)


@pytest.mark.parametrize('stamps, way, moves', [
    ((None, None), 0.08, True), ((1.0, 1.4), 0.08, True), ((1.0, 1.6), 0.08, False),
    ((None, None), 1.4, False)],
    ids=['no stamps', 'soon', 'after a gap longer than the time-out', 'far away'])
def test_where_the_box_moves_to_it_hits(drive, stamps, way, moves):
    driver = drive({**SCENE, 'gravity': [0, 0, 0], 'particles': {'position': [[-0.59, 0, 0.5]]}})
    pause(driver)
    for stamp, x in zip(stamps, (-0.7, -0.7 + way)):
        driver.take('moved', pose_message(stamp, (x, 0, 0.5)))
        step(driver)
    assert place(driver) == (-0.7 + way, 0, 0.5)
    fast = driver.simulation.velocity[0, 0] > 1.0
    assert fast == moves


def test_poses_that_were_played_late_are_caught_up_with_by_a_jump(drive):
    """Playing back is pose_delay behind; the first step of a pause places the box."""
    driver = drive({**SCENE, 'gravity': [0, 0, 0], 'particles': {'position': [[-0.54, 0, 0.5]]}})
    driver.run(0.3, {'moved': lambda stamp: ((0.5 * (stamp - driver.START) - 0.75, 0, 0.5),
                                             (0, 0, 0, 1))},
               jittered_stamps(driver.START, driver.START + 0.29))
    pause(driver)
    before = place(driver)
    assert step(driver).message.endswith('moved: moved')
    assert place(driver)[0] - before[0] > 0.012 and not driver.simulation.velocity.any()


def test_afterwards_the_box_goes_on_from_the_held_pose(paused):
    paused.take('moved', pose_message(7.0, (-0.6, 0, 0.5)))     # a stamp of another time
    pause(paused, False)
    paused.run(0.3)
    assert place(paused) == (-0.6, 0, 0.5)
    now = paused.now
    paused.run(0.5, {'moved': lambda stamp: ((-0.6 + 0.1 * (stamp - now), 0, 0.5), (0, 0, 0, 1))},
               jittered_stamps(now, now + 0.5))
    assert -0.57 < place(paused)[0] < -0.55 and not paused.node._poses.dropped
