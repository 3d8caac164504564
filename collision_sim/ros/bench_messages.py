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
Measures what messages cost on this machine: large ones going out, many poses coming in.

    python -m collision_sim.ros.bench_messages
    FASTDDS_BUILTIN_TRANSPORTS=DEFAULT python -m collision_sim.ros.bench_messages --count 100000

Publishes PoseArrays to a raw subscriber in another process, and says how long a message takes to
lay out and to publish, how many came and how late. Then it moves colliders of a node in another
process, and says which share of a core that node uses, without and with the poses.
"""

import argparse
import math
import os
from pathlib import Path
import signal
import struct
import subprocess
import sys
import tempfile
import time

from collision_sim.ros import fast_dds
from collision_sim.ros.messages import ENCAPSULATION, PoseArrayWriter, SECOND
from geometry_msgs.msg import PoseArray, PoseStamped
import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger
import yaml

TOPIC, DEPTH, RATE = 'bench_messages', 5, 60.0      # Hz
POSE_RATE, SECONDS = 100.0, 4.0                     # Hz, s
TICKS = os.sysconf('SC_CLK_TCK')                    # of processor time in a second


def receive():
    """Count messages until SIGTERM; print how many, and the delays of the middle and the 99th."""
    stopped, delays = [], []
    signal.signal(signal.SIGTERM, lambda *received: stopped.append(received))
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node, executor = rclpy.create_node('bench_receiver'), SingleThreadedExecutor()

    def take(message):
        seconds, nanoseconds = struct.unpack_from('<iI', message, len(ENCAPSULATION))
        delays.append(1e-6 * (time.time_ns() - seconds * SECOND - nanoseconds))

    node.create_subscription(PoseArray, TOPIC, take, DEPTH, raw=True)
    executor.add_node(node)
    while not stopped:
        executor.spin_once(timeout_sec=0.1)
    middle, late = np.percentile(delays or [math.nan], [50, 99])
    print(f'{len(delays)} received, {middle:.1f} ms late (p99 {late:.1f})')


def _paced(rate, seconds):
    """Yield at a rate [Hz], for a number of seconds."""
    began = time.perf_counter()
    for k in range(round(rate * seconds)):
        time.sleep(max(0.0, began + k / rate - time.perf_counter()))
        yield k / rate


def _times(times):
    return '{:.2f} ms (p99 {:.2f})'.format(*(1e3 * np.percentile(times, [50, 99])))


def send(node, count):
    """Publish messages of `count` poses, and print what they cost."""
    publisher = node.create_publisher(PoseArray, TOPIC, DEPTH)
    receiver = subprocess.Popen([sys.executable, '-m', __spec__.name, '--receive'],
                                stdout=subprocess.PIPE, text=True)
    while not publisher.get_subscription_count():
        time.sleep(0.05)
    writer, laying, publishing = PoseArrayWriter('world', count), [], []
    position = np.random.default_rng(0).normal(size=(3, count)).T
    for _ in _paced(RATE, SECONDS):
        began = time.perf_counter()
        message = writer.message(*divmod(time.time_ns(), SECOND), position)
        laid = time.perf_counter()
        publisher.publish(message)
        laying.append(laid - began)
        publishing.append(time.perf_counter() - laid)
    time.sleep(1.0)
    receiver.send_signal(signal.SIGTERM)
    print(f'{count} poses, {len(laying)} messages at {RATE:g} Hz: laid out in {_times(laying)}, '
          f'published in {_times(publishing)}, {receiver.communicate()[0].strip()}')


def _busy(process):
    """Processor time of a process [s]."""
    fields = Path(f'/proc/{process.pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def move(node, colliders):
    """Move the colliders of a node, and print which share of a core that takes it."""
    boxes = [{'name': f'box{k}', 'shape': 'box', 'size': [0.1, 0.1, 0.1], 'topic': f'box{k}/pose',
              'position': [0.3 * k, 0.0, 0.5]} for k in range(colliders)]
    scene = {'particles': {'count': 100, 'box': {'min': [-1, -1, 1], 'max': [1, 1, 2]}},
             'colliders': [{'name': 'ground', 'shape': 'plane'}, *boxes]}
    publishers = [node.create_publisher(PoseStamped, box['topic'], DEPTH) for box in boxes]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'boxes.yaml')
        path.write_text(yaml.safe_dump(scene))
        process = subprocess.Popen(
            [sys.executable, '-m', 'collision_sim.ros.node', '--ros-args', '-p', f'scene:={path}',
             '--log-level', 'error'])
        while not (all(publisher.get_subscription_count() for publisher in publishers)
                   and _is_ready(node)):
            time.sleep(0.1)
        time.sleep(3.0)
        shares = []
        for moving in (False, True):
            busy, began = _busy(process), time.perf_counter()
            for elapsed in _paced(POSE_RATE, SECONDS):
                if moving:
                    _publish_poses(node, boxes, publishers, elapsed)
            shares.append((_busy(process) - busy) / (time.perf_counter() - began))
        process.send_signal(signal.SIGINT)
        process.wait()
    print(f'{colliders} colliders at {POSE_RATE:g} Hz: the node uses {shares[1]:.0%} of a core, '
          f'{shares[0]:.0%} without poses')


def _is_ready(node):
    """Whether the kernels of the other node are: it would take steps, if it were paused."""
    client = node.create_client(Trigger, '/collision_sim/step')
    client.wait_for_service()
    answer = client.call_async(Trigger.Request())
    rclpy.spin_until_future_complete(node, answer)
    node.destroy_client(client)
    return 'paused' in answer.result().message


def _publish_poses(node, boxes, publishers, elapsed):
    message = PoseStamped()
    message.header.frame_id = 'world'
    message.header.stamp = node.get_clock().now().to_msg()
    message.pose.orientation.w = 1.0
    for box, publisher in zip(boxes, publishers):
        x, _, z = box['position']
        message.pose.position.x, message.pose.position.z = x + 0.1 * math.sin(elapsed), z
        publisher.publish(message)


def main():
    """Measure what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--count', type=int, nargs='*', default=[1000, 10_000, 100_000],
                        help='poses in a message (default 1000 10000 100000)')
    parser.add_argument('--colliders', type=int, default=32, help='that are moved (default 32)')
    parser.add_argument('--receive', action='store_true', help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.receive:
        receive()
        return
    fast_dds.prepare()
    rclpy.init()
    node = rclpy.create_node('bench_messages')
    for count in arguments.count:
        send(node, count)
    if arguments.colliders:
        move(node, arguments.colliders)
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()
