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

"""The node in this process, on a simulated clock: stepping, messages, services."""

import time

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from collision_sim import Simulation  # noqa: E402, I100
from collision_sim.ros.messages import read_pose_array  # noqa: E402
from collision_sim.scene import load_scene  # noqa: E402
from geometry_msgs.msg import PoseArray, PoseStamped  # noqa: E402
from harness import jittered_stamps, PADDLE, pose_message, TICK  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from sensor_msgs.msg import PointCloud2  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402

ALL_SHAPES = {
    **PADDLE,
    'colliders': [
        *PADDLE['colliders'],
        {'name': 'pill', 'shape': 'capsule', 'radius': 0.1, 'length': 1, 'position': [5, 0, 1]},
        {'name': 'room', 'shape': 'sphere', 'radius': 50, 'inside': True},
        {'name': 'post', 'shape': 'cylinder', 'radius': 0.1, 'length': 1, 'position': [4, 0, 1]},
    ],
}


def state(driver):
    return driver.simulation.position.copy(), driver.simulation.velocity.copy()


def subscribe(driver, kind, topic, qos=10, **options):
    messages = []
    driver.peer.create_subscription(kind, topic, messages.append, qos, **options)
    return messages


def listened(driver, publisher):
    driver.spin_until(lambda: publisher.get_subscription_count() > 0)


# --- stepping --------------------------------------------------------------------------------


def test_steps_follow_the_clock(drive):
    driver = drive('rain')
    driver.run(1.0)
    assert driver.simulation.time == pytest.approx(1.0, abs=driver.simulation.dt)
    alone = Simulation(load_scene('rain'))
    alone.step(round(driver.simulation.time / alone.dt))
    np.testing.assert_array_equal(driver.simulation.position, alone.position)


def test_the_default_scene_moves_and_touches(drive):
    driver = drive()
    before, _ = state(driver)
    driver.run(1.0)
    assert np.abs(driver.simulation.position - before).max() > 0.5
    assert driver.simulation.counters['collisions'] > 0


def test_names_are_relative(drive):
    driver = drive(ALL_SHAPES, node_options={'namespace': 'left'})
    names = [name for name, _ in driver.node.get_topic_names_and_types()]
    assert {'/left/collision_sim/particles', '/left/collision_sim/set/restitution',
            '/left/paddle/pose', '/diagnostics'} <= set(names)


# --- out -------------------------------------------------------------------------------------


def test_particles(drive):
    driver = drive(ALL_SHAPES)
    messages = subscribe(driver, PoseArray, '/collision_sim/particles', raw=True)
    listened(driver, driver.outputs._particles)
    driver.run(0.3)
    stamp = driver.node._time.stamp()
    driver.spin_until(lambda: messages and read_pose_array(messages[-1])[:2] == (
        stamp.sec, stamp.nanosec))
    _, _, frame, poses = read_pose_array(messages[-1])
    assert frame == 'world'
    np.testing.assert_array_equal(poses[:, :3], driver.simulation.position)
    late = driver.now - stamp.sec - 1e-9 * stamp.nanosec
    assert -1e-6 < late < driver.simulation.dt


def test_cloud(drive):
    driver = drive(ALL_SHAPES)
    messages = subscribe(driver, PointCloud2, '/collision_sim/cloud')
    listened(driver, driver.outputs._cloud)
    driver.run(TICK)
    driver.spin_until(lambda: messages)
    cloud = messages[0]
    points = np.frombuffer(cloud.data, '<f4').reshape(-1, 6)
    np.testing.assert_allclose(points, np.hstack(state(driver)), rtol=1e-6)
    assert [field.name for field in cloud.fields] == ['x', 'y', 'z', 'vx', 'vy', 'vz']
    assert (cloud.width, cloud.height, cloud.point_step, cloud.row_step) == (2, 1, 24, 48)


def test_most_published_particles(drive):
    """Evenly many of them are left out of the PoseArray, none of the cloud."""
    scene = {'particles': {'position': [[k, 0, 1] for k in range(10)]}, 'colliders': []}
    driver = drive(scene, max_published_particles=4)
    poses = subscribe(driver, PoseArray, '/collision_sim/particles')
    clouds = subscribe(driver, PointCloud2, '/collision_sim/cloud')
    listened(driver, driver.outputs._particles)
    listened(driver, driver.outputs._cloud)
    driver.run(TICK)
    driver.spin_until(lambda: poses and clouds)
    assert [pose.position.x for pose in poses[0].poses] == [0, 2, 5, 7]
    assert clouds[0].width == 10
    for most, shown in ((5, [0, 2, 4, 6, 8]), (10, list(range(10))), (11, list(range(10)))):
        change = Parameter('max_published_particles', value=most)
        assert driver.node.set_parameters([change])[0].successful
        poses.clear()
        driver.run(TICK)
        driver.spin_until(lambda: poses)
        assert [pose.position.x for pose in poses[0].poses] == shown
    refused = Parameter('max_published_particles', value=0)
    assert not driver.node.set_parameters([refused])[0].successful


def test_contacts_are_recorded_for_listeners_only(drive):
    scene = {'particles': {'position': [[0, 0, 0], [1, 0, 0.1]]}, 'friction': {'dry': 0.3},
             'colliders': [{'name': 'ground', 'shape': 'plane'}]}
    driver = drive(scene)
    driver.run(0.1)
    assert not driver.simulation.record_contacts
    messages = subscribe(driver, MarkerArray, '/collision_sim/contacts')
    listened(driver, driver.outputs._contacts)
    driver.run(0.2)
    driver.spin_until(lambda: any(len(message.markers) == 2 for message in messages))
    assert driver.simulation.record_contacts
    points, lines = next(m for m in messages if len(m.markers) == 2).markers
    assert (points.type, lines.type) == (Marker.SPHERE_LIST, Marker.LINE_LIST)
    assert 2 * len(points.points) == len(lines.points) == len(lines.colors) > 0
    assert points.pose.orientation.w == 1.0 and points.lifetime.nanosec > 0


def test_colliders_are_there_for_late_listeners(drive):
    driver = drive(ALL_SHAPES)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    messages = subscribe(driver, MarkerArray, '/collision_sim/colliders', latched)
    driver.spin_until(lambda: messages)
    markers = messages[0].markers
    names = [marker.ns.split('/')[1] for marker in markers]
    assert names == ['ground', 'paddle', 'pill', 'pill', 'pill', 'room', 'post']
    kinds = [Marker.CUBE, Marker.CUBE, Marker.CYLINDER, Marker.SPHERE, Marker.SPHERE,
             Marker.SPHERE, Marker.CYLINDER]
    assert [marker.type for marker in markers] == kinds
    assert all(m.color.a > 0 and min(m.scale.x, m.scale.y, m.scale.z) > 0 for m in markers)
    assert markers[3].pose.position.z == pytest.approx(0.5)
    driver.run(0.1, {'paddle': lambda stamp: ((1, 2, 3), (0, 0, 0, 1))}, [driver.now])
    driver.spin_until(lambda: messages[-1].markers[1].pose.position.y == 2.0)


def test_frame_and_rate_may_change(drive):
    driver = drive(ALL_SHAPES)
    messages = subscribe(driver, PoseArray, '/collision_sim/particles')
    listened(driver, driver.outputs._particles)
    changes = [Parameter('frame_id', value='odom'),
               Parameter('publish_rate', value=7.0)]
    assert all(result.successful for result in driver.node.set_parameters(changes))
    assert driver.node._ticks_a_message == 5
    assert driver.node._timer.timer_period_ns == pytest.approx(1e9 / 35.0, abs=1)
    driver.run(0.5)
    driver.spin_until(lambda: messages)
    assert messages[0].header.frame_id == 'odom'


def test_nothing_is_published_without_listeners(drive, monkeypatch):
    driver = drive(ALL_SHAPES)

    def fail(*args):
        raise AssertionError('published')

    for publisher in (driver.outputs._particles, driver.outputs._cloud, driver.outputs._contacts,
                      driver.outputs._colliders):
        monkeypatch.setattr(publisher, 'publish', fail)
    driver.run(0.2)


# --- services --------------------------------------------------------------------------------


def test_pause_step_and_reset(drive):
    driver = drive(ALL_SHAPES)
    driver.run(0.2)
    refused = driver.call(Trigger, '/collision_sim/step', Trigger.Request())
    assert not refused.success and 'paused' in refused.message
    for _ in range(2):
        assert driver.call(SetBool, '/collision_sim/pause', SetBool.Request(data=True)).success
    before, _ = state(driver)
    time = driver.simulation.time
    driver.run(0.2)
    np.testing.assert_array_equal(driver.simulation.position, before)
    assert driver.call(Trigger, '/collision_sim/step', Trigger.Request()).success
    assert driver.simulation.time == pytest.approx(time + driver.simulation.dt)
    assert driver.call(SetBool, '/collision_sim/pause', SetBool.Request(data=False)).success
    driver.run(0.2)
    assert driver.simulation.time == pytest.approx(time + 0.2, abs=3 * driver.simulation.dt)
    for _ in range(2):
        assert driver.call(Trigger, '/collision_sim/reset', Trigger.Request()).success
    assert driver.simulation.time == 0.0
    np.testing.assert_array_equal(driver.simulation.position[:, 2], [0.5, 1.0])


def test_a_collider_that_moved_during_a_pause_hits_nothing(drive):
    scene = {'gravity': [0, 0, 0], 'particles': {'position': [[0, 0, 0.5]]}, 'restitution': 1.0,
             'colliders': ALL_SHAPES['colliders']}
    driver = drive(scene)

    def pose(stamp):
        return (4.0 * (stamp - driver.START) - 1.5, 0.0, 0.5), (0, 0, 0, 1)

    stamps = jittered_stamps(driver.now, driver.now + 3.0)
    driver.run(0.2, {'paddle': pose}, stamps)
    driver.node._pause(SetBool.Request(data=True), SetBool.Response())
    driver.run(1.0, {'paddle': pose}, [stamp for stamp in stamps if stamp > driver.now])
    driver.node._pause(SetBool.Request(data=False), SetBool.Response())
    driver.run(1.0, {'paddle': pose}, [stamp for stamp in stamps if stamp > driver.now])
    assert not driver.simulation.velocity.any()
    assert driver.simulation.collider_pose('paddle')[0][0] > 5.0


def test_zero_stamp_means_when_it_was_received(drive, monkeypatch):
    """Poses that wait for a tick of a node on the wall clock are not all of that tick."""
    driver, seen = drive(ALL_SHAPES), []
    poses = driver.node._poses
    publisher = driver.peer.create_publisher(PoseStamped, 'paddle/pose', 5)
    driver.spin_until(publisher.get_subscription_count)
    monkeypatch.setattr(poses, 'take', lambda which, messages, times: seen.extend(times))
    monkeypatch.setattr(type(poses._clock), 'flows', True)
    began = time.time_ns()
    for _ in range(2):
        publisher.publish(pose_message(None, (0, 0, 0)))
        time.sleep(0.1)
    # The node's clock is read first: an interruption before the other is read moves the time
    # of arrival away from the lower bound, which is the tight one.
    nodes = driver.node._time.nanoseconds()
    offset = time.time_ns() - nodes
    poses.take_arrived()
    first, second = seen
    assert 0.09e9 < second - first < 0.9e9
    assert began - 1e6 < first + offset < began + 0.9e9


def test_zero_stamp_means_now(drive):
    driver = drive(ALL_SHAPES)
    driver.run(0.1)
    driver.take('paddle', pose_message(None, (1, 2, 3)))
    driver.run(0.1)
    np.testing.assert_array_equal(driver.simulation.collider_pose('paddle')[0], [1, 2, 3])
