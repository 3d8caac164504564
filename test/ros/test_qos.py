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
Check 7 of ten, quality of service: who hears whom, and what is said to those who do not.

Poses are taken from publishers of all kinds. Parameter topics take reliable publishers only, as a
value is sent once. All that comes out is reliable; only the colliders are kept for late listeners.
"""

from itertools import product

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from geometry_msgs.msg import PoseArray, PoseStamped  # noqa: E402, I100
from harness import pose_message  # noqa: E402
from rclpy.event_handler import PublisherEventCallbacks  # noqa: E402
from rclpy.event_handler import SubscriptionEventCallbacks  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: E402
from sensor_msgs.msg import PointCloud2  # noqa: E402
from std_msgs.msg import Float64  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

NODE = '/collision_sim'
SCENE = {'particles': {'position': [[0, 0, 0]]}, 'colliders': [
    {'name': 'ground', 'shape': 'plane'},
    {'name': 'moved', 'shape': 'sphere', 'radius': 1, 'position': [9, 0, 0],
     'topic': 'moved/pose'}]}
RELIABLE, BEST_EFFORT = ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT
VOLATILE, KEPT = DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL
KINDS = list(product((RELIABLE, BEST_EFFORT), (VOLATILE, KEPT)))
OUT = {'particles': PoseArray, 'cloud': PointCloud2, 'contacts': MarkerArray,
       'colliders': MarkerArray}


def names(value):
    return value.name if hasattr(value, 'name') else None


def profile(reliability, durability):
    return QoSProfile(depth=5, reliability=reliability, durability=durability)


@pytest.mark.parametrize('reliability, durability', KINDS, ids=names)
def test_poses_from_publishers_of_all_kinds(drive, reliability, durability):
    driver = drive(SCENE)
    publisher = driver.peer.create_publisher(
        PoseStamped, 'moved/pose', profile(reliability, durability))
    driver.spin_until(lambda: publisher.get_subscription_count() > 0)
    publisher.publish(pose_message(None, (1, 2, 3)))
    driver.spin_until(lambda: driver.node._poses._streams['moved'].newest is not None)


@pytest.mark.parametrize('reliability, durability', KINDS, ids=names)
def test_values_from_reliable_publishers_only(drive, capfd, reliability, durability):
    driver = drive(SCENE)
    events = []
    publisher = driver.peer.create_publisher(
        Float64, NODE + '/set/restitution', profile(reliability, durability),
        event_callbacks=PublisherEventCallbacks(incompatible_qos=events.append))
    if reliability is RELIABLE:
        driver.spin_until(lambda: publisher.get_subscription_count() > 0)
        publisher.publish(Float64(data=0.25))
        driver.spin_until(lambda: driver.simulation.scene.restitution == 0.25)
        assert not events
        return
    printed = []

    def warned():
        printed.append(capfd.readouterr().err)
        return '/set/restitution' in ''.join(printed) and events

    driver.spin_until(warned)
    for _ in range(20):
        publisher.publish(Float64(data=0.25))
        driver.executor.spin_once(timeout_sec=0.01)
    printed.append(capfd.readouterr().err)
    text = ''.join(printed)
    assert 'RELIABILITY' in text and text.count('incompatible QoS') == 1
    assert driver.simulation.scene.restitution == 0.0


@pytest.mark.parametrize('reliability, durability', KINDS, ids=names)
@pytest.mark.parametrize('topic', OUT)
def test_what_comes_out_reaches_the_documented_listeners(drive, topic, reliability, durability):
    driver = drive(SCENE)
    messages, events = [], []
    driver.peer.create_subscription(
        OUT[topic], NODE + '/' + topic, messages.append, profile(reliability, durability),
        event_callbacks=SubscriptionEventCallbacks(incompatible_qos=events.append))

    def happened():
        driver.run(0.05)
        return messages or events

    driver.spin_until(happened)
    kept = topic == 'colliders'
    assert bool(messages) == (durability is VOLATILE or kept)
    assert len(events) == (0 if messages else 1)
