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

"""Check 9 of ten, instances: namesakes, namespaces, and a second run in one process."""

import subprocess
import sys
import time

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from collision_sim.ros.messages import read_pose_array  # noqa: E402, I100
from geometry_msgs.msg import PoseArray, PoseStamped  # noqa: E402
from harness import DEADLINE, pose_message, stop_node  # noqa: E402
from std_msgs.msg import Float64  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

TWICE = """
import signal
import sys
import threading
import rclpy
from collision_sim import load_scene
from collision_sim.ros import node, warm_up

warm_up.WarmUp(load_scene('demo'), False).seconds_a_step
for k in range(2):
    stopped = []
    threading.Timer(2.0, stopped.append, [signal.SIGINT]).start()
    assert node.run([], stopped) == 0 and not rclpy.ok()
    print('run', k, flush=True)
"""


def test_namesakes_are_warned_of(run_node, peer):
    processes = run_node(), run_node()
    peer.spin_until(lambda: peer.node.count_publishers('/collision_sim/particles') == 2)
    time.sleep(5.0)     # a node looks around once, some seconds after its start
    printed = [stop_node(process) for process in processes]
    assert any('another node is called /collision_sim' in text for text in printed)


def test_namespaces_keep_two_nodes_apart(run_node, peer):
    """Poses and parameters of the one do not reach the other."""
    processes = [run_node('demo', '-r', '__ns:=' + name) for name in ('/left', '/right')]
    colliders = {side: peer.subscribe(MarkerArray, '/%s/collision_sim/colliders' % side)
                 for side in ('left', 'right')}
    particles = {side: peer.subscribe(PoseArray, '/%s/collision_sim/particles' % side, raw=True)
                 for side in ('left', 'right')}
    peer.spin_until(lambda: all(colliders.values()) and all(particles.values()))
    pose = peer.node.create_publisher(PoseStamped, '/left/paddle/pose', 5)
    value = peer.node.create_publisher(Float64, '/left/collision_sim/set/restitution', 5)
    place = (0.25, 0.5, 0.125)

    def places(side):
        points = [m.pose.position for m in colliders[side][-1].markers
                  if m.ns == 'colliders/paddle']
        return {(point.x, point.y, point.z) for point in points}

    def arrived():
        pose.publish(pose_message(None, place))
        peer.spin_for(0.03)
        return place in places('left')

    peer.spin_until(arrived)
    peer.spin_until(lambda: value.get_subscription_count() > 0)
    value.publish(Float64(data=7.0))
    peer.spin_for(0.5)
    assert place not in places('right')
    assert len(read_pose_array(particles['right'][-1])[3]) > 0
    left, right = (stop_node(process) for process in processes)
    assert 'restitution refused' in left and 'refused' not in right
    assert 'another node' not in left + right


def test_a_second_run_in_one_process():
    done = subprocess.run([sys.executable, '-c', TWICE], capture_output=True, text=True,
                          timeout=DEADLINE)
    assert done.returncode == 0 and done.stdout.split() == ['run', '0', 'run', '1'], done.stderr
    assert 'Traceback' not in done.stderr
