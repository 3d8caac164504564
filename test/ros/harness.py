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

"""How the ROS tests drive a node in this process, and talk to one in another process."""

import math
import random
import signal
import subprocess
import sys
import time

from collision_sim.ros.messages import read_pose_array
from collision_sim.ros.node import CollisionSimNode
from geometry_msgs.msg import PoseStamped
import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
import rclpy.time
from visualization_msgs.msg import MarkerArray
import yaml

DEADLINE = 120.0        # s; kernels may have to be compiled; nothing is asserted about times
TICK = 1.0 / 60.0
SECOND = 1_000_000_000
PADDLE = {
    'particles': {'position': [[0, 0, 0.5], [0.3, 0, 1.0]]},
    'restitution': 0.5,
    'colliders': [
        {'name': 'ground', 'shape': 'plane'},
        {'name': 'paddle', 'shape': 'box', 'size': [0.2, 1, 1], 'topic': 'paddle/pose',
         'position': [-3, 0, 0.5]}]}


def scene_file(folder, scene):
    path = folder / ('scene_%d.yaml' % len(list(folder.iterdir())))
    path.write_text(yaml.safe_dump(scene))
    return str(path)


def pose_message(stamp, position, orientation=(0, 0, 0, 1), frame='world'):
    """Build a PoseStamped; stamp in seconds, None for a zero stamp."""
    message = PoseStamped()
    message.header.frame_id = frame
    if stamp is not None:
        message.header.stamp = rclpy.time.Time(nanoseconds=round(stamp * SECOND)).to_msg()
    point, turn = message.pose.position, message.pose.orientation
    point.x, point.y, point.z = map(float, position)
    turn.x, turn.y, turn.z, turn.w = map(float, orientation)
    return message


def jittered_stamps(begin, end, rate=30.0, jitter=5e-3, seed=0):
    rng = random.Random(seed)
    count = int((end - begin) * rate)
    return [begin + k / rate + rng.uniform(-jitter, jitter) for k in range(count)]


def moved(messages):
    """Whether the poses of raw PoseArrays have changed, as they do when the kernels are ready."""
    return len(messages) > 1 and \
        (read_pose_array(messages[0])[3] != read_pose_array(messages[-1])[3]).any()


class Driver:
    """
    A node in this process on a simulated clock, so that nothing depends on the machine's speed.

    Its kernels are ready, unless it is not to wait for them. Poses reach their callback LATENCY
    after their stamp; everything else goes by real topics.
    """

    LATENCY = 3e-3
    START = 1000.0      # s on the clock

    def __init__(self, scene, parameters, node_options=None, ready=True):
        self.context = Context()
        rclpy.init(context=self.context)
        overrides = [Parameter(name.replace('__', '.'), value=value)
                     for name, value in parameters.items()]
        overrides.append(Parameter('use_sim_time', value=True))
        if scene is not None:
            overrides.append(Parameter('scene', value=scene))
        self.node = CollisionSimNode(
            context=self.context, parameter_overrides=overrides, **(node_options or {}))
        if ready:
            self.node.wait_until_ready()
        self.node._timer.cancel()
        self.peer = rclpy.create_node('peer', context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.executor.add_node(self.peer)
        self.now = self.START
        self.set_clock(self.now)
        self.node._tick()

    @property
    def simulation(self):
        return self.node._simulation

    @property
    def outputs(self):
        return self.node._outputs

    def set_clock(self, seconds):
        self.now = seconds
        clock = rclpy.time.Time(nanoseconds=round(seconds * SECOND),
                                clock_type=self.node.get_clock().clock_type)
        self.node.get_clock().set_ros_time_override(clock)

    def take(self, name, message):
        poses = self.node._poses
        poses.take([list(poses.topics).index(name)], [serialize_message(message)],
                   np.array([self.node._time.nanoseconds()]))

    def run(self, duration, poses=None, stamps=(), each=None):
        """Tick for a duration [s]; poses: collider name to function of the stamp."""
        pending = sorted(stamps)
        end = self.now + duration
        while self.now < end - 1e-9:
            self.set_clock(self.now + TICK)
            while pending and pending[0] + self.LATENCY <= self.now:
                stamp = pending.pop(0)
                for name, pose in (poses or {}).items():
                    self.take(name, pose_message(stamp, *pose(stamp)))
            self.node._tick()
            if each is not None:
                each()

    def spin_until(self, condition, deadline=DEADLINE):
        """Serve callbacks and take poses as a tick does, until a condition holds."""
        end = time.monotonic() + deadline
        while not condition():
            assert time.monotonic() < end, 'nothing came'
            self.executor.spin_once(timeout_sec=0.05)
            self.node._poses.take_arrived()

    def call(self, kind, name, request):
        client = self.peer.create_client(kind, name)
        future = client.call_async(request)
        self.spin_until(future.done)
        self.peer.destroy_client(client)
        return future.result()

    def close(self):
        self.executor.shutdown()
        self.peer.destroy_node()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


class Peer:
    """A node of the test that talks to the node in another process over DDS."""

    def __init__(self):
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node('peer', context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)

    def now(self):
        return self.node.get_clock().now().nanoseconds / SECOND

    def spin_until(self, condition, deadline=DEADLINE):
        end = time.monotonic() + deadline
        while not condition():
            assert time.monotonic() < end, 'nothing came'
            self.executor.spin_once(timeout_sec=0.02)

    def spin_for(self, duration):
        end = time.monotonic() + duration
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=max(0.0, end - time.monotonic()))

    def publish_poses(self, name, topic, pose, duration, rate=30.0, jitter=5e-3, seed=0):
        """
        Publish poses with jitter, pose(t) t seconds after the start; give the longest gap [s].

        Starts when the node shows the collider at pose(0), which must not be its pose before:
        discovery takes up to some seconds each way. Other callbacks are served meanwhile.
        """
        publisher = self.node.create_publisher(PoseStamped, topic, 5)
        rng = random.Random(seed)
        place, _ = pose(0.0)
        seen = self.subscribe(MarkerArray, '/collision_sim/colliders')

        def publish(begin):
            stamp = self.now()
            publisher.publish(pose_message(stamp, *pose(max(stamp - begin, 0.0))))
            return stamp

        def arrived():
            publish(math.inf)
            self.spin_for(1.0 / rate)
            points = [marker.pose.position for message in seen[-1:] for marker in message.markers
                      if marker.ns == 'colliders/' + name]
            return any(math.dist((p.x, p.y, p.z), place) < 1e-9 for p in points)

        self.spin_until(arrived)
        begin = last = self.now()
        longest = 0.0
        for k in range(math.ceil(duration * rate)):
            self.spin_for(begin + (k + 0.5) / rate + rng.uniform(-jitter, jitter) - self.now())
            stamp = publish(begin)
            longest, last = max(longest, stamp - last), stamp
        self.node.destroy_publisher(publisher)
        return longest

    def subscribe(self, kind, topic, **options):
        """Give the list that fills with messages of a topic."""
        messages = []
        self.node.create_subscription(kind, topic, messages.append, 10, **options)
        return messages

    def call(self, kind, name, request, deadline=DEADLINE):
        client = self.node.create_client(kind, name)
        self.spin_until(client.service_is_ready)
        future = client.call_async(request)
        self.spin_until(future.done, deadline)
        self.node.destroy_client(client)
        return future.result()

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


def start_node(scene, arguments=()):
    command = [sys.executable, '-m', 'collision_sim.ros.node', '--ros-args', *arguments]
    if scene is not None:
        command += ['-p', 'scene:=%s' % scene]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def stop_node(process, number=signal.SIGINT):
    """Stop the node and give what it has printed."""
    if process.poll() is None:
        process.send_signal(number)
    try:
        return process.communicate(timeout=DEADLINE)[0]
    except subprocess.TimeoutExpired:
        process.kill()
        raise
