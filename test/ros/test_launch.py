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

"""Launch files and names: what is started, under which names, and that it works together."""

from pathlib import Path
import re
import subprocess
import sys
import time

import collision_sim
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from collision_sim.ros.messages import read_pose_array  # noqa: E402, I100
from geometry_msgs.msg import PoseArray, PoseStamped  # noqa: E402
from harness import pose_message, stop_node  # noqa: E402
from rcl_interfaces.srv import GetParameters  # noqa: E402
from stand_in_launch import nodes_of  # noqa: E402
from std_msgs.msg import Float64  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

LAUNCH = Path(collision_sim.__file__).parent / 'launch'
MODULES = {'collision_sim_node': 'collision_sim.ros.node',
           'swing_paddle': 'collision_sim.ros.swing_paddle'}


@pytest.fixture
def start():
    """Give a function that starts such a node."""
    running = []

    def run(node):
        words = [*node.ros_arguments, '-r', f'__ns:=/{node.namespace}']
        if hasattr(node, 'name'):
            words += ['-r', f'__node:={node.name}']
        for given in node.parameters:
            words += ['--params-file', given] if isinstance(given, str) else [
                word for key, value in given.items() for word in ('-p', f'{key}:={value}')]
        running.append(subprocess.Popen(
            [sys.executable, '-m', MODULES[node.executable], '--ros-args', *words],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True))

    yield run
    for process in running:
        stop_node(process)


# --- launch files ----------------------------------------------------------------------------


def test_demo_swings_the_paddle_in_its_namespace(start, peer):
    for node in nodes_of(LAUNCH / 'demo.launch.py', namespace='left', log_level='warn'):
        assert node.package == 'collision_sim'
        start(node)
    scenes = peer.subscribe(MarkerArray, '/left/collision_sim/colliders')

    def places():
        return {marker.pose.position.x for message in scenes for marker in message.markers
                if marker.ns == 'colliders/paddle'}

    peer.spin_until(lambda: len(places()) > 20)
    assert max(places()) - min(places()) > 0.05


def test_shards_share_the_particles_of_a_scene(start, peer):
    """Each has a name of its own; the pose topic is the same for all, and poses reach all."""
    nodes = nodes_of(LAUNCH / 'shards.launch.py', shards='3', start_time='0')
    counts, moved = {}, set()
    for node in nodes:
        assert node.on_exit == 'shutdown'
        start(node)
        peer.node.create_subscription(
            PoseArray, f'/{node.name}/particles', raw=True, qos_profile=5, callback=lambda message,
            name=node.name: counts.update({name: len(read_pose_array(message)[3])}))
        peer.node.create_subscription(
            MarkerArray, f'/{node.name}/colliders', qos_profile=5, callback=lambda message,
            name=node.name: moved.update(
                {name} & {name for marker in message.markers if marker.pose.position.x == 0.25}))
    publisher = peer.node.create_publisher(PoseStamped, 'paddle/pose', 5)

    def all_have_moved():
        publisher.publish(pose_message(None, (0.25, 0.5, 0.1)))
        peer.spin_for(0.03)
        return len(moved) == len(counts) == 3

    peer.spin_until(all_have_moved)
    assert counts == {'collision_sim_1': 133, 'collision_sim_2': 133, 'collision_sim_3': 134}


def test_some_shards_of_many():
    """As on one of several hosts."""
    nodes = nodes_of(LAUNCH / 'shards.launch.py', shards='8', only='3,4', scene='rain',
                     start_time='123.5')
    assert [(node.name, node.parameters) for node in nodes] == [
        ('collision_sim_3', [{'scene': 'rain'}, {'shard': '3/8', 'start_time': 123.5}]),
        ('collision_sim_4', [{'scene': 'rain'}, {'shard': '4/8', 'start_time': 123.5}])]


def test_shards_begin_together():
    """In some seconds from now, unless another time is given."""
    first, second = nodes_of(LAUNCH / 'shards.launch.py')
    assert first.parameters[-1]['start_time'] == second.parameters[-1]['start_time'] > time.time()


def test_arguments_win_over_the_parameter_file():
    """Those that are given, for all nodes: the last value of a parameter counts."""
    for file in ('demo.launch.py', 'shards.launch.py'):
        path = LAUNCH / file
        for node in nodes_of(path, params_file='my.yaml'):
            assert node.parameters[0] == 'my.yaml'
            assert not any({'scene', 'use_sim_time'} & set(given) for given in node.parameters[1:])
        simulator, other = nodes_of(path, params_file='my.yaml', scene='rain',
                                    use_sim_time='True')
        assert simulator.parameters[:3] == ['my.yaml', {'use_sim_time': True}, {'scene': 'rain'}]
        assert other.parameters[:2] == ['my.yaml', {'use_sim_time': True}]


def test_rviz_follows_the_namespace():
    """Its configuration is there, and each topic in it goes by a name that is relative."""
    assert len(nodes_of(LAUNCH / 'demo.launch.py')) == 2
    *_, rviz = nodes_of(LAUNCH / 'demo.launch.py', rviz='true', namespace='left')
    assert (rviz.package, rviz.namespace, rviz.arguments[0]) == ('rviz2', 'left', '-d')
    config = Path(rviz.arguments[1]).read_text()
    topics = re.findall(r'Topic:\n +Value: (/\S+)', config)
    assert len(topics) == 4
    assert dict(rviz.remappings) == {topic: topic[1:] for topic in topics}


# --- names -----------------------------------------------------------------------------------


def test_namespaces_and_remaps(run_node, peer):
    """Every name follows the node's namespace and name, and each topic can be remapped."""
    run_node(None, '-r', '__ns:=/left', '-r', '__node:=sim', '-r', '~/particles:=/points',
             '-r', 'paddle/pose:=/arm/pose', '-r', '~/set/restitution:=bounce')
    points = peer.subscribe(PoseArray, '/points', raw=True)
    colliders = peer.subscribe(MarkerArray, '/left/sim/colliders')
    moved = peer.node.create_publisher(PoseStamped, '/arm/pose', 5)
    bounce = peer.node.create_publisher(Float64, '/left/bounce', 5)

    def paddle_is_there():
        moved.publish(pose_message(None, (0.25, 0.5, 0.1)))
        peer.spin_for(0.03)
        return any(marker.pose.position.x == 0.25 for message in colliders[-1:]
                   for marker in message.markers)

    peer.spin_until(paddle_is_there)
    peer.spin_until(lambda: points and bounce.get_subscription_count())
    bounce.publish(Float64(data=0.125))
    asked = GetParameters.Request(names=['restitution'])
    peer.spin_until(lambda: peer.call(GetParameters, '/left/sim/get_parameters',
                                      asked).values[0].double_value == 0.125)
    names = {name for name, _ in peer.node.get_topic_names_and_types()}
    assert {'/left/sim/cloud', '/left/sim/contacts', '/left/sim/set/gravity'} <= names
    assert not any(name.startswith(('/collision_sim', '/left/collision_sim')) for name in names)
