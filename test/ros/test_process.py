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

"""The node in a process of its own: real clock, real DDS, signals and hostile requests."""

from math import cos, nan, pi, sin
from pathlib import Path
import signal
import subprocess
import sys
import time

import collision_sim
from collision_sim.ros.messages import read_pose_array
import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from geometry_msgs.msg import PoseArray, PoseStamped  # noqa: E402, I100
from harness import DEADLINE, pose_message, stop_node  # noqa: E402
from rcl_interfaces.msg import Parameter as ParameterMessage, ParameterValue  # noqa: E402
from rcl_interfaces.srv import SetParameters, SetParametersAtomically  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from sensor_msgs.msg import PointCloud2  # noqa: E402
from std_msgs.msg import Float64  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

NODE = '/collision_sim'
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
G = 9.81
LONGEST_GAP = 0.08      # s between poses; with more the machine was too busy to tell


def points(cloud):
    return np.frombuffer(cloud.data, '<f4').reshape(-1, 6).astype(float)


def scene(collider, position, gravity, **laws):
    return {'gravity': gravity, 'particles': {'position': [position]},
            'colliders': [{'name': 'moved', 'shape': 'box', 'topic': 'moved/pose', **collider}],
            **laws}


# --- end to end ------------------------------------------------------------------------------


def test_the_bare_node_publishes_and_explains_itself(run_node, peer):
    process = run_node()
    messages = peer.subscribe(PoseArray, NODE + '/particles', raw=True)
    peer.spin_until(lambda: len(messages) > 20)
    first, last = (read_pose_array(message)[3] for message in (messages[0], messages[-1]))
    assert len(first) > 0 and (first[:, :3] != last[:, :3]).any()
    printed = stop_node(process)
    assert process.returncode == 0
    assert NODE + '/particles' in printed and 'ros2 topic pub' in printed
    assert 'paddle/pose' in printed and 'Traceback' not in printed


def test_paddle_over_dds(run_node, peer):
    speed = 1.0
    run_node(scene({'size': [0.1, 1, 1], 'position': [-0.5, 0, 0]}, [1.0, 0, 0], [0, 0, 0],
                   restitution=0.5))
    clouds = peer.subscribe(PointCloud2, NODE + '/cloud')
    peer.publish_poses('moved', 'moved/pose', lambda t: ((speed * t - 0.2, 0, 0), UPRIGHT), 1.6)
    peer.spin_until(lambda: clouds and points(clouds[-1])[0, 3] > 0)
    np.testing.assert_allclose(points(clouds[-1])[0, 3:], (1.5 * speed, 0, 0), rtol=0.01,
                               atol=1e-6)


def test_belt_over_dds(run_node, peer):
    run_node(scene({'size': [40, 1, 0.2], 'position': [0.1, 0, -0.1]}, [0, 0, 0], [0, 0, -G],
                   friction={'dry': 0.3}))
    clouds = peer.subscribe(PointCloud2, NODE + '/cloud')
    peer.publish_poses('moved', 'moved/pose', lambda t: ((0.5 * t, 0, -0.1), UPRIGHT), 2.0)
    peer.spin_until(lambda: clouds)
    np.testing.assert_allclose(points(clouds[-1])[0, 3:], (0.5, 0, 0), rtol=0.01, atol=1e-6)


def swing(peer, peak, frequency=2.0, duration=6.0):
    """Swing the plate; gaps of the particle on it in the full swing [m], None if poses lagged."""
    rate = 2 * pi * frequency
    amplitude = peak * G / rate ** 2
    heights, plates = {}, {}

    def take_particle(message):
        seconds, nanoseconds, _, poses = read_pose_array(message)
        heights[seconds, nanoseconds] = poses[0, 2]

    def take_plate(message):
        for marker in message.markers:
            plates[marker.header.stamp.sec, marker.header.stamp.nanosec] = marker.pose.position.z

    listening = [peer.node.create_subscription(PoseArray, NODE + '/particles', take_particle, 10,
                                               raw=True),
                 peer.node.create_subscription(MarkerArray, NODE + '/colliders', take_plate, 10)]

    def pose(t):
        swell = 0.5 - 0.5 * cos(pi * min(t / 3, 1))
        return (0, 0, swell * amplitude * sin(rate * t) - 0.1), UPRIGHT

    longest = peer.publish_poses('moved', 'moved/pose', pose, duration)
    end = peer.now()
    for subscription in listening:
        peer.node.destroy_subscription(subscription)
    if longest > LONGEST_GAP:
        return None
    return np.array([heights[stamp] - plates[stamp] - 0.1 for stamp in heights.keys() & plates
                     if end - 2.0 < stamp[0] + 1e-9 * stamp[1] < end])


@pytest.mark.parametrize('peak', [0.9, 1.1])
def test_lift_off_over_dds(run_node, peer, peak):
    for attempt in range(3):
        process = run_node(scene({'size': [1, 1, 0.2], 'position': [0.1, 0, -0.1]}, [0, 0, 0],
                                 [0, 0, -G]))
        gaps = swing(peer, peak)
        stop_node(process)
        if gaps is not None and len(gaps) > 20:
            break
    else:
        pytest.skip('the machine is too busy to publish poses at 30 Hz')
    assert gaps.min() > -1e-6
    assert (gaps.max() < 1e-5) if peak < 1 else (gaps.max() > 3e-4)


# --- signals ---------------------------------------------------------------------------------


@pytest.mark.parametrize('signals', [
    (signal.SIGINT,), (signal.SIGTERM,), (signal.SIGINT, signal.SIGINT),
    (signal.SIGINT, signal.SIGTERM)], ids=lambda signals: '+'.join(s.name for s in signals))
@pytest.mark.parametrize('pause', [0.0, 0.003, 0.05])
def test_signals_end_the_node(run_node, peer, signals, pause):
    process = run_node()
    messages = peer.subscribe(PoseArray, NODE + '/particles', raw=True)
    peer.spin_until(lambda: messages)
    for number in signals:
        process.send_signal(number)
        time.sleep(pause)
    printed, _ = process.communicate(timeout=DEADLINE)
    assert process.returncode == 0 and 'Traceback' not in printed


START = """
import sys, types
package = types.ModuleType('collision_sim')
package.__path__ = sys.argv[1:2]
sys.modules['collision_sim'] = package      # without what the package itself imports
from collision_sim.ros.start import main
print('ready', flush=True)
sys.exit(main([]))
"""


@pytest.mark.parametrize('pause', [0.0, 0.1, 0.3, 0.6, 0.9])
@pytest.mark.parametrize('signals', [
    (signal.SIGINT,), (signal.SIGTERM,), (signal.SIGINT, signal.SIGINT)],
    ids=lambda signals: '+'.join(s.name for s in signals))
def test_signals_while_starting(signals, pause):
    folder = Path(collision_sim.__file__).parent
    process = subprocess.Popen([sys.executable, '-c', START, str(folder)], text=True,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    process.stdout.readline()
    time.sleep(0.01 + pause)
    for number in signals:
        process.send_signal(number)
    printed, _ = process.communicate(timeout=DEADLINE)
    assert process.returncode == 0 and 'Traceback' not in printed


def test_namesakes_are_warned_of(run_node):
    processes = run_node(), run_node()
    time.sleep(6.0)
    printed = [stop_node(process) for process in processes]
    assert any('another node is called /collision_sim' in text for text in printed)


@pytest.mark.parametrize('arguments, words', [
    (['-p', 'scene:=nowhere'], ['scene', 'nowhere']),
    (['-p', 'restitution:=1.5'], ['restitution', '1.5']),
    (['-p', 'restitution:=high'], ['restitution']),
    (['-p', 'gravity:=[1.0]'], ['gravity']),
    (['-p', 'publish_clock:=true', '-p', 'start_time:=5.0'], ['start_time', '5.0'])])
def test_a_bad_start_is_one_line_and_status_1(run_node, arguments, words):
    process = run_node(None, *arguments)
    printed, _ = process.communicate(timeout=DEADLINE)
    assert process.returncode == 1 and 'Traceback' not in printed
    last = printed.strip().splitlines()[-1]
    assert all(word in last for word in words), printed


# --- hostile peers ---------------------------------------------------------------------------


def test_requests_of_unknown_types_do_not_end_the_node(run_node, peer):
    """A stock rclpy node dies of a value of type 200, and the caller waits for ever."""
    run_node()
    hostile = ParameterMessage(name='restitution', value=ParameterValue(type=200))
    for kind, name in ((SetParameters, '/set_parameters'),
                       (SetParametersAtomically, '/set_parameters_atomically')):
        client = peer.node.create_client(kind, NODE + name)
        peer.spin_until(client.service_is_ready)
        client.call_async(kind.Request(parameters=[hostile]))
    good = Parameter('restitution', value=0.25).to_parameter_msg()
    response = peer.call(SetParameters, NODE + '/set_parameters',
                         SetParameters.Request(parameters=[good]))
    assert response.results[0].successful
    assert peer.call(Trigger, NODE + '/reset', Trigger.Request()).success


def test_malformed_messages_do_not_end_the_node(run_node, peer):
    process = run_node()
    random = np.random.default_rng(0)
    publishers = [peer.node.create_publisher(kind, topic, 100) for kind, topic in (
        (PoseStamped, 'paddle/pose'), (Float64, NODE + '/set/restitution'))]
    for publisher in publishers:
        peer.spin_until(lambda: publisher.get_subscription_count() > 0)
    for _ in range(500):
        for publisher in publishers:
            size = random.integers(0, 60 if publisher is publishers[0] else 9)
            publisher.publish(b'\0\1\0\0' + random.bytes(size))
        publishers[0].publish(pose_message(None, (nan, 0, 0)))
    for _ in range(10):     # the node may know the publisher later than that the node
        publishers[0].publish(pose_message(None, (nan, 0, 0)))
        peer.spin_for(0.1)
    publishers[1].publish(Float64(data=0.125))
    assert peer.call(Trigger, NODE + '/reset', Trigger.Request()).success
    printed = stop_node(process)
    assert process.returncode == 0 and 'Traceback' not in printed
    assert 'not_finite' in printed
