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

"""The demo's paddle, as a process of its own: its poses, its end, refused parameters."""

import math
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import yaml

rclpy = pytest.importorskip('rclpy', reason='rclpy is not installed')
from geometry_msgs.msg import PoseStamped  # noqa: E402, I100
from rclpy.executors import SingleThreadedExecutor  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
DOMAIN = 1 + os.getpid() % 100  # one of its own, so that other runs are not heard
PATIENCE = 20.0  # s, for a slow machine
pytestmark = pytest.mark.ros


@pytest.fixture
def start():
    """Start the node with ROS arguments; whatever still runs at the end is killed."""
    running = []

    def run(*arguments):
        process = subprocess.Popen(
            [sys.executable, '-m', 'collision_sim.ros.swing_paddle', '--ros-args', *arguments],
            cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            env={**os.environ, 'ROS_DOMAIN_ID': str(DOMAIN),
                 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'})
        running.append(process)
        return process

    yield run
    for process in running:
        process.kill()
        process.communicate()


@pytest.fixture
def poses(monkeypatch):
    """Wait for a number of poses of one topic."""
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    context = rclpy.context.Context()
    rclpy.init(context=context, domain_id=DOMAIN)
    node = rclpy.create_node('listener', context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def wait(count, topic='paddle/pose'):
        got = []
        node.create_subscription(PoseStamped, topic, got.append, 10)
        end = time.monotonic() + PATIENCE
        while len(got) < count and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)
        assert len(got) >= count
        return got

    yield wait
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown(context=context)


def test_poses_are_a_sinusoid_of_their_stamps(start, poses):
    start('-p', 'amplitude:=0.3', '-p', 'period:=0.8', '-p', 'centre:=[1.0, 2.0, 3.0]',
          '-p', 'frame_id:=lab', '-p', 'topic:=elsewhere')
    got = poses(30, 'elsewhere')
    times = np.array([pose.header.stamp.sec % 1000 + pose.header.stamp.nanosec * 1e-9
                      for pose in got])
    x = np.array([pose.pose.position.x for pose in got])
    phases = 2 * np.pi * times / 0.8
    # x - centre = a sin(phase) + b cos(phase) with a^2 + b^2 = amplitude^2
    waves = np.column_stack([np.sin(phases), np.cos(phases)])
    parts = np.linalg.lstsq(waves, x - 1.0, rcond=None)[0]
    np.testing.assert_allclose(waves @ parts, x - 1.0, atol=1e-6)
    assert math.hypot(*parts) == pytest.approx(0.3, abs=1e-6)
    assert {(pose.pose.position.y, pose.pose.position.z) for pose in got} == {(2.0, 3.0)}
    assert {pose.header.frame_id for pose in got} == {'lab'}
    assert {pose.pose.orientation.w for pose in got} == {1.0}


def test_defaults_fit_the_demo_scene(start, poses):
    scene = yaml.safe_load((ROOT / 'collision_sim' / 'scenes' / 'demo.yaml').read_text())
    paddle, = [entry for entry in scene['colliders'] if entry['name'] == 'paddle']
    start('-p', 'amplitude:=0.0')
    pose, *_ = poses(1, paddle['topic'])
    place = pose.pose.position
    assert [place.x, place.y, place.z] == paddle['position']
    assert pose.header.frame_id == 'world'


def test_whole_numbers_are_numbers(start, poses):
    start('-p', 'amplitude:=0', '-p', 'centre:=[1, 2, 3]', '-p', 'rate:=50', '-p', 'topic:=here')
    place = poses(1, 'here')[0].pose.position
    assert [place.x, place.y, place.z] == [1.0, 2.0, 3.0]


@pytest.mark.parametrize('signals', [
    [signal.SIGINT], [signal.SIGTERM], [signal.SIGINT, signal.SIGINT],
], ids=['SIGINT', 'SIGTERM', 'SIGINT twice'])
def test_a_signal_ends_it_cleanly(start, poses, signals):
    process = start()
    poses(1)
    for number in signals:
        process.send_signal(number)
        time.sleep(0.003)
    output, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, output
    assert 'Traceback' not in output


@pytest.mark.parametrize('argument', [
    'rate:=0.0', 'period:=[2]', 'amplitude:=-1.0', 'centre:=[1.0]', 'centre:=[0.0, .nan, 0.0]'])
def test_a_refused_parameter_is_named(start, argument):
    process = start('-p', argument)
    output, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert argument.partition(':=')[0] in output
    assert 'Traceback' not in output
