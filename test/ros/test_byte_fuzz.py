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

"""Check 2 of ten, bytes: mutated messages in the thousands do not hurt a node in its process."""

import re

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402, I100
from geometry_msgs.msg import PoseStamped, Vector3  # noqa: E402
from harness import pose_message, stop_node  # noqa: E402
from rclpy.impl.implementation_singleton import rclpy_implementation  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402
from std_msgs.msg import Float64, String  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

RCLError = rclpy_implementation.RCLError
NODE = '/collision_sim'
BURST = 10              # messages; as many as the subscription keeps
COUNT, WARM_UP = 10_000, 1000
GROWTH = 10e6           # bytes


def resident(process):
    """Memory of another process [bytes]."""
    with open('/proc/%d/status' % process.pid) as status:
        return 1024 * int(re.search(r'VmRSS:\s+(\d+) kB', status.read())[1])


def mutated(message, rng):
    """One to four mutations of a serialized message."""
    message = bytearray(message)
    for _ in range(rng.integers(1, 5)):
        kind, at = rng.integers(7), int(rng.integers(len(message)) if message else 0)
        if kind == 0:
            message[at:at + 1] = bytes([(message[at] if message else 0) ^ 1 << rng.integers(8)])
        elif kind == 1:
            del message[at:]                                            # cut off
        elif kind == 2:
            message += rng.bytes(rng.integers(1, 200))                  # too long
        elif kind == 3:
            message[at:at + 4] = b'\xff\xff\xff\x7f'                    # a length of 2 GiB
        elif kind == 4:
            message[at:at + 8] = rng.bytes(8)
        elif kind == 5:
            message[at:at + 8] = np.float64(rng.choice([np.nan, np.inf, 1e300, -0.0])).tobytes()
        else:
            message[:4] = rng.bytes(4)                                  # encapsulation
    return bytes(message)


def send(peer, publisher, messages):
    for k, message in enumerate(messages):
        try:
            publisher.publish(message)
        except RCLError:        # already the sender refuses some lengths and encapsulations
            pass
        if k % BURST == 0:
            peer.spin_for(2e-3)


def dropped(messages):
    """Count what was dropped, by the last diagnostics."""
    return sum(int(value.value) for status in messages[-1].status for value in status.values
               if value.key == 'dropped')


@pytest.mark.slow
def test_mutated_poses_leave_the_node_alive_and_no_larger(run_node, peer):
    process = run_node('demo')
    publisher = peer.node.create_publisher(PoseStamped, 'paddle/pose', BURST)
    colliders = peer.subscribe(MarkerArray, NODE + '/colliders')
    diagnostics = peer.subscribe(DiagnosticArray, '/diagnostics')
    peer.spin_until(lambda: publisher.get_subscription_count() and colliders and diagnostics
                    and 'compiling' not in diagnostics[-1].status[0].message)
    rng = np.random.default_rng(0)

    def valid():
        stamp = peer.now() if rng.random() < 0.5 else None
        return serialize_message(pose_message(stamp, (0.3, 0.5, 0.1)))

    send(peer, publisher, (mutated(valid(), rng) for _ in range(WARM_UP)))
    before = resident(process)
    send(peer, publisher, (mutated(valid(), rng) for _ in range(COUNT)))
    peer.spin_until(lambda: dropped(diagnostics) > 0.1 * COUNT)     # they do reach the node
    place = (0.123, 0.456, 0.5)

    def taken():
        publisher.publish(pose_message(None, place))
        peer.spin_for(0.03)
        return any((p.x, p.y, p.z) == place for marker in colliders[-1].markers
                   for p in [marker.pose.position] if marker.ns == 'colliders/paddle')

    peer.spin_until(taken)
    assert resident(process) - before < GROWTH
    printed = stop_node(process)
    assert process.returncode == 0 and 'Traceback' not in printed
    assert len(printed.splitlines()) < 300      # one warning for many


def test_mutated_values_leave_the_node_alive(run_node, peer):
    process = run_node('demo')
    rng = np.random.default_rng(1)
    for kind, topic in ((Float64, 'restitution'), (Vector3, 'gravity'), (String, 'frame_id'),
                        (Float64, 'stepping/iterations')):
        publisher = peer.node.create_publisher(kind, NODE + '/set/' + topic, BURST)
        peer.spin_until(lambda: publisher.get_subscription_count() > 0)
        peer.spin_for(0.5)      # the node may know the publisher later than that the node
        send(peer, publisher, (mutated(serialize_message(kind()), rng) for _ in range(300)))
    diagnostics = peer.subscribe(DiagnosticArray, '/diagnostics')
    peer.spin_until(lambda: diagnostics)
    printed = stop_node(process)
    assert process.returncode == 0 and 'Traceback' not in printed
    assert 'restitution refused' in printed
