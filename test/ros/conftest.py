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

"""Surroundings of the ROS tests: a domain of their own, strict messages, and nodes to test."""

import os

import pytest

# Set before anything loads rclpy; type checks of message fields are off by default in Jazzy.
os.environ['ROS_DOMAIN_ID'] = str(1 + os.getpid() % 100)
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'


def pytest_collection_modifyitems(items):
    for item in items:
        if item.path.parent == item.config.rootpath / 'test' / 'ros':
            item.add_marker(pytest.mark.ros)


@pytest.fixture
def drive(tmp_path):
    """Give a function that makes a node in this process, driven by a clock of its own."""
    from harness import Driver, scene_file
    drivers = []

    def make(scene=None, node_options=None, ready=True, **parameters):
        name = scene if isinstance(scene, (str, type(None))) else scene_file(tmp_path, scene)
        drivers.append(Driver(name, parameters, node_options, ready))
        return drivers[-1]

    yield make
    for driver in drivers:
        driver.close()


@pytest.fixture
def run_node(tmp_path):
    """Give a function that starts the node in another process."""
    from harness import scene_file, start_node, stop_node
    processes = []

    def run(scene=None, *arguments):
        name = scene if isinstance(scene, (str, type(None))) else scene_file(tmp_path, scene)
        processes.append(start_node(name, arguments))
        return processes[-1]

    yield run
    for process in processes:
        stop_node(process)


@pytest.fixture
def peer():
    """Give a node of the test itself, to talk to the one in another process."""
    from harness import Peer
    node = Peer()
    yield node
    node.close()
