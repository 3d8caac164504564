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

"""Large messages reach another process whole and all, with the shipped profile of Fast DDS."""

import os
from pathlib import Path
import subprocess
import sys

import collision_sim
from collision_sim.ros.messages import read_pose_array
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from geometry_msgs.msg import PoseArray  # noqa: E402, I100
from harness import DEADLINE  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402

PROFILE = Path(collision_sim.__file__).parent / 'config' / 'fast_dds.xml'
COUNT, POSES = 20, 100_000
PUBLISH = """
import sys, time
from collision_sim.ros.messages import PoseArrayWriter
from geometry_msgs.msg import PoseArray
import numpy as np, rclpy
count, poses = map(int, sys.argv[1:])
rclpy.init()
node = rclpy.create_node('large')
publisher = node.create_publisher(PoseArray, 'large', 5)
while not publisher.get_subscription_count():
    time.sleep(0.05)
time.sleep(0.5)
writer = PoseArrayWriter('world', poses)
for k in range(count):
    publisher.publish(writer.message(k, 0, np.full((poses, 3), float(k))))
    time.sleep(0.1)
input()
"""


def test_no_large_message_is_lost(peer):
    """As many as were sent arrive, in order, each of them whole."""
    messages = []
    peer.node.create_subscription(PoseArray, 'large', messages.append, QoSProfile(depth=5),
                                  raw=True)
    process = subprocess.Popen(
        [sys.executable, '-c', PUBLISH, str(COUNT), str(POSES)], stdin=subprocess.PIPE, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        env={**os.environ, 'FASTRTPS_DEFAULT_PROFILES_FILE': str(PROFILE),
             'RMW_FASTRTPS_PUBLICATION_MODE': 'ASYNCHRONOUS'})
    try:
        peer.spin_until(lambda: messages and read_pose_array(messages[-1])[0] == COUNT - 1)
    finally:
        printed, _ = process.communicate('\n', timeout=DEADLINE)
    assert 'XML' not in printed and process.returncode == 0, printed
    assert [read_pose_array(message)[0] for message in messages] == list(range(COUNT))
    for k, message in enumerate(messages):
        poses = read_pose_array(message)[3]
        assert poses.shape == (POSES, 7) and (poses[:, :3] == k).all()
