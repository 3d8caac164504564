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

"""Check 8 of ten, throughput: 1e4 poses a message arrive whole, in order, none lost."""

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from collision_sim.ros.messages import read_pose_array  # noqa: E402, I100
from geometry_msgs.msg import PoseArray  # noqa: E402
from harness import moved, SECOND  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402

NODE = '/collision_sim'
DT, COUNT, STEPS, RATE = 0.01, 10_000, 120, 60.0
# Without gravity x of every particle tells the time.
SCENE = {'gravity': [0, 0, 0], 'stepping': {'dt': DT},
         'particles': {'count': COUNT, 'box': {'min': [0, 0, 1], 'max': [0, 9, 2]},
                       'velocity': [1, 0, 0]},
         'colliders': [{'name': 'ground', 'shape': 'plane'}]}


def test_ten_thousand_poses_a_message_in_order_and_none_lost(run_node, peer):
    """At 60 Hz, over the default transport; every step is published."""
    run_node(SCENE, '-p', 'publish_clock:=true', '-p', 'publish_rate:=1.0')
    messages = peer.subscribe(PoseArray, NODE + '/particles', raw=True)
    client = peer.node.create_client(Trigger, NODE + '/step')
    peer.spin_until(lambda: moved(messages) and client.service_is_ready())
    peer.call(SetBool, NODE + '/pause', SetBool.Request(data=True))
    peer.call(Trigger, NODE + '/reset', Trigger.Request())
    messages.clear()
    for _ in range(STEPS):
        future = client.call_async(Trigger.Request())
        peer.spin_for(1.0 / RATE)
        peer.spin_until(future.done)
    last = round(STEPS * DT * SECOND)
    times = []

    def all_came():
        for message in messages[len(times):]:
            sec, nanosec, _, poses = read_pose_array(message)
            times.append(sec * SECOND + nanosec)
            assert len(poses) == COUNT
            np.testing.assert_allclose(poses[:, 0], 1e-9 * times[-1], atol=1e-9)
        return times and times[-1] == last

    peer.spin_until(all_came)
    assert times == sorted(times)
    assert set(times) >= {round(k * DT * SECOND) for k in range(1, STEPS + 1)}
