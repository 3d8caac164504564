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

"""Recordings and replays against the node: the same scene, the same steps, the same messages."""

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')
pytest.importorskip('rosbags', reason="needs pip install 'collision_sim[record]'")

from collision_sim import cli  # noqa: E402, I100
from collision_sim.ros.messages import SECOND  # noqa: E402
from geometry_msgs.msg import PoseArray, PoseStamped  # noqa: E402
from harness import TICK  # noqa: E402
from rclpy.serialization import deserialize_message  # noqa: E402
from sensor_msgs.msg import PointCloud2  # noqa: E402
from small_bags import read_messages, START, swing, write_swing  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

KINDS = {'/collision_sim/particles': PoseArray, '/collision_sim/contacts': MarkerArray,
         '/collision_sim/colliders': MarkerArray, '/collision_sim/cloud': PointCloud2}
ALL = 'particles,contacts,colliders,cloud'


def taken_apart(messages, kind, start):
    """Messages without their stamps, by these [ns] less a start."""
    found = {}
    for message in messages:
        message = deserialize_message(message, kind)
        headers = [part.header for part in getattr(message, 'markers', [message])]
        stamps = {header.stamp.sec * SECOND + header.stamp.nanosec for header in headers}
        for header in headers:
            header.stamp.sec = header.stamp.nanosec = 0
        stamp, = stamps
        found[stamp - start] = message
    return found


def test_a_recording_holds_what_the_node_publishes(drive, tmp_path):
    """On all topics, from the first tick of the node on; stamps differ by when it started."""
    driver, published = drive(), {topic: [] for topic in KINDS}
    for topic, kind in KINDS.items():
        driver.peer.create_subscription(kind, topic, published[topic].append, 50, raw=True)
    publishers = {publisher.topic_name: publisher for publisher in driver.node.publishers}
    for topic in KINDS:
        driver.spin_until(lambda: publishers[topic].get_subscription_count())

    def hear():
        before = len(published['/collision_sim/particles'])
        driver.spin_until(lambda: all(len(heard) > before for topic, heard in published.items()
                                      if topic != '/collision_sim/contacts'))
    driver.run(0.5, each=hear)
    driver.spin_until(lambda: len(published['/collision_sim/contacts']) >= 30)
    bag = str(tmp_path / 'out.mcap')
    assert cli.main(['run', 'demo', '--duration', '0.5', '--record', bag, '--topics', ALL]) == 0
    recorded, start = read_messages(bag), round(driver.START * SECOND)
    for topic, kind in KINDS.items():
        ours = taken_apart([message for _, message in recorded[topic]], kind, 0)
        theirs = taken_apart(published[topic], kind, start)
        assert sorted(ours) == [round(k * TICK * SECOND) for k in range(31)]
        for k in range(1, 31):      # the first one of the node came before anybody listened
            stamp = round(k * TICK * SECOND)
            assert ours[stamp] == theirs[stamp], f'{topic} at {stamp} ns'


def test_a_replay_is_what_the_node_does(drive, tmp_path):
    """The same poses by callback and by bag: the same positions, but for rounding."""
    driver, poses = drive(), swing()
    start = driver.now
    for _ in range(60):
        driver.set_clock(driver.now + TICK)
        while poses and (poses[0][0] - START) / SECOND <= driver.now - start:
            _, stamp, position = poses.pop(0)
            message = PoseStamped()
            message.header.frame_id = 'world'
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(
                stamp - START + round(start * SECOND), SECOND)
            point = message.pose.position
            point.x, point.y, point.z = position
            driver.take('paddle', message)
        driver.node._tick()
    path = tmp_path / 'final.npz'
    assert cli.main(['run', 'demo', '--poses', str(write_swing(tmp_path / 'swing')),
                     '--duration', '1.0', '--out', str(path)]) == 0
    state = np.load(path)
    assert state['time'] == pytest.approx(driver.simulation.time)
    np.testing.assert_allclose(state['position'], driver.simulation.position, atol=1e-6)
