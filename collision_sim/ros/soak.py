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
Runs the node for a long time, watches it from another process, and says what has changed.

    python -m collision_sim.ros.soak --minutes 30

A box swings through the particles at 50 poses a second, a parameter changes every second, and the
scene starts again every minute. Meanwhile: memory, step time and every particle. Afterwards the
same poses are played twice in lockstep. The status is 1 where something does not hold.
"""

import argparse
from collections import Counter
from contextlib import contextmanager
import hashlib
import math
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import tempfile
import time

from collision_sim.ros.diagnostics import new_since
from collision_sim.ros.messages import read_pose_array
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray, PoseStamped
import numpy as np
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger
import yaml

NODE = '/collision_sim'
HALF = 2.0              # m; half the edge of the room
RATE = 50.0             # Hz of the poses
SPEED = 2.0             # m/s; the most that the box has
SKIN = 1e-6             # m; deeper in a wall is an error
FASTEST = 30.0          # m/s; more than a few hits by the box can give
SLOPE, GROWTH = 0.1, 10.0       # MB a minute from ten minutes on; MB in a shorter run
SLOWER = 1.2            # p99 of the step time, relative to the first minute
PATIENCE = 120.0        # s; kernels may have to be compiled


def scene(particles):
    """Give a room with a box that swings in it, and particles that bounce and slide."""
    return {
        'particles': {'count': particles, 'box': {'min': [-1.9, -1.9, 0.1], 'max': [1.9, 1.9, 2]}},
        'restitution': 0.5, 'friction': {'dry': 0.2},
        'colliders': [
            {'name': 'room', 'shape': 'box', 'inside': True, 'size': [2 * HALF, 2 * HALF, 20],
             'position': [0, 0, 10]},
            {'name': 'box', 'shape': 'box', 'size': [0.4, 0.4, 1], 'topic': 'box/pose',
             'position': [0, 0, 0.5]}]}


def pose(time, stamp):
    """Give the pose of the box: a circle, at SPEED, and a turn about z; stamp in ns."""
    message = PoseStamped()
    message.header.frame_id = 'world'
    message.header.stamp = rclpy.time.Time(nanoseconds=stamp).to_msg()
    angle = SPEED * time
    message.pose.position.x, message.pose.position.y = math.sin(angle), math.cos(angle)
    message.pose.position.z = 0.5
    message.pose.orientation.z, message.pose.orientation.w = math.sin(angle), math.cos(angle)
    return message


class Watch:
    """A node in this process that moves the box and sees what becomes of the particles."""

    def __init__(self):
        self.node = rclpy.create_node('soak')
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.problems = Counter()
        self._counts = Counter()        # of the node's own counters, when they were last told
        self.step_times = []            # p99 [ms] by the diagnostics, one a second
        self.messages = 0
        self.newest = b''
        self.poses = self.node.create_publisher(PoseStamped, 'box/pose', 5)
        self.node.create_subscription(PoseArray, NODE + '/particles', self._see, 5, raw=True)
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self._read, 5)
        self.clients = {kind: self.node.create_client(kind, NODE + '/' + name) for kind, name in (
            (SetParameters, 'set_parameters'), (SetBool, 'pause'))}
        self.step, self.reset = (self.node.create_client(Trigger, NODE + '/' + name)
                                 for name in ('step', 'reset'))

    def _see(self, message):
        self.messages, self.newest = self.messages + 1, message
        position = read_pose_array(message)[3][:, :3]
        self.problems['not finite'] += not np.isfinite(position).all()
        out = (np.abs(position[:, :2]).max(initial=0.0) > HALF + SKIN
               or position[:, 2].min(initial=0.0) < -SKIN)
        self.problems['outside the room'] += bool(out)
        self.problems['too high'] += position[:, 2].max(initial=0.0) > 2 + FASTEST ** 2 / 20

    def _read(self, message):
        for value in (value for status in message.status for value in status.values):
            if value.key in ('unplaced', 'frozen'):
                count = int(value.value)
                self.problems[value.key] += new_since(self._counts[value.key], count)
                self._counts[value.key] = count
            elif re.search('step.*p99', value.key):
                self.step_times.append(float(value.value))

    def until(self, condition):
        """Serve callbacks until a condition holds."""
        end = time.monotonic() + PATIENCE
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError('the node does not answer')
            self.executor.spin_once(timeout_sec=0.02)

    def call(self, client, request):
        """Give the response of a service."""
        self.until(client.service_is_ready)
        future = client.call_async(request)
        self.until(future.done)
        return future.result()

    def change(self, second):
        """Set a parameter to a value that depends on the time."""
        value = Parameter('restitution', value=0.1 * (second % 10)).to_parameter_msg()
        result, = self.call(self.clients[SetParameters],
                            SetParameters.Request(parameters=[value])).results
        self.problems['parameter refused'] += not result.successful


@contextmanager
def running(particles, *arguments):
    """Run the node in another process; gives it and a Watch of it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'soak.yaml'
        path.write_text(yaml.safe_dump(scene(particles)))
        process = subprocess.Popen(
            [sys.executable, '-m', 'collision_sim.ros.node', '--ros-args', '--log-level', 'warn',
             '-p', 'scene:=%s' % path, *arguments])
        watch = Watch()
        try:
            watch.until(lambda: watch.step_times and watch.poses.get_subscription_count())
            yield process, watch
        finally:
            process.send_signal(signal.SIGINT)
            watch.problems['exit status'] += process.wait(PATIENCE) != 0
            watch.executor.shutdown()
            watch.node.destroy_node()


def resident(process):
    """Give the memory of a process [MB]."""
    pages = int(Path('/proc/%d/statm' % process.pid).read_text().split()[1])
    return 1e-6 * pages * os.sysconf('SC_PAGE_SIZE')


def endure(minutes, particles):
    """Watch the node for some minutes; gives the Watch and its memory second by second [MB]."""
    with running(particles) as (process, watch):
        begin, memory = time.monotonic(), []
        while (now := time.monotonic() - begin) < 60.0 * minutes:
            watch.poses.publish(pose(now, watch.node.get_clock().now().nanoseconds))
            if now >= len(memory) + 1:
                memory.append(resident(process))
                watch.change(len(memory))
                if len(memory) % 60 == 0:
                    watch.call(watch.reset, Trigger.Request())
                    print('%3d min  %.1f MB' % (len(memory) // 60, memory[-1]), flush=True)
            following = time.monotonic() + 1.0 / RATE
            while time.monotonic() < following:
                watch.executor.spin_once(timeout_sec=max(0.0, following - time.monotonic()))
    return watch, np.array(memory)


def repeat(steps, particles):
    """Play the same poses twice, a step each; gives the digests of where all particles end."""
    digests = []
    with running(particles, '-p', 'publish_clock:=true') as (_, watch):
        watch.call(watch.clients[SetBool], SetBool.Request(data=True))
        for _ in range(2):
            watch.call(watch.reset, Trigger.Request())
            for k in range(1, steps + 1):
                watch.poses.publish(pose(k / 240, k * 1_000_000_000 // 240))
                watch.call(watch.step, Trigger.Request())
            seen = watch.messages
            watch.until(lambda: watch.messages > seen + 5)
            digests.append(hashlib.sha256(watch.newest).hexdigest())
    return digests


def verdicts(watch, memory, digests):
    """Give what was found, as (text, whether it is as it should be) pairs."""
    found = [('%s: %d' % item, not item[1]) for item in sorted(watch.problems.items())]
    settled = memory[min(60, len(memory) // 4):]
    growth = settled[-1] - settled[0]
    if len(memory) < 600:
        found.append(('memory: %+.1f MB' % growth, growth < GROWTH))
    else:
        slope = 60.0 * np.polyfit(np.arange(len(settled)), settled, 1)[0]
        found.append(('memory: %+.3f MB a minute' % slope, slope < SLOPE))
    first, last = np.array_split(watch.step_times, 2) if len(memory) < 120 else (
        watch.step_times[:60], watch.step_times[-60:])
    if len(last):
        ratio = np.median(last) / np.median(first)
        found.append(('step time, p99: %.2f of that of the start' % ratio,
                      ratio < SLOWER or len(memory) < 600))
    found.append(('the same poses: %s' % ' '.join(digest[:12] for digest in digests),
                  len(set(digests)) == 1))
    return found


def main(args=None):
    """Run, print what was found, and give the status."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--minutes', type=float, default=30.0)
    parser.add_argument('--particles', type=int, default=10_000)
    parser.add_argument('--steps', type=int, default=1000, help='in lockstep, twice')
    options = parser.parse_args(args)
    rclpy.init(args=[])
    try:
        watch, memory = endure(options.minutes, options.particles)
        found = verdicts(watch, memory, repeat(options.steps, options.particles))
    finally:
        rclpy.try_shutdown()
    print('%d messages of %d particles' % (watch.messages, options.particles))
    for text, fine in found:
        print('%s  %s' % ('ok  ' if fine else 'FAIL', text))
    return int(not all(fine for _, fine in found))


if __name__ == '__main__':
    sys.exit(main())
