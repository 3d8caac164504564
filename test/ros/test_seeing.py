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

"""What is seen of the node: the RViz configuration, and the page in the browser."""

from pathlib import Path
import sys

import collision_sim
import pytest
import yaml

pytest.importorskip('rclpy', reason='needs rclpy')

from rclpy.exceptions import ParameterException  # noqa: E402, I100
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy  # noqa: E402
from stand_in_launch import nodes_of  # noqa: E402

PACKAGE = Path(collision_sim.__file__).parent
RVIZ = PACKAGE / 'rviz' / 'collision_sim.rviz'
SCENE = {'particles': {'position': [[0, 0, 1], [0.5, 0, 0.01]]},
         'colliders': [{'name': 'ground', 'shape': 'plane'}]}


# --- RViz ------------------------------------------------------------------------------------


@pytest.fixture
def displays():
    """Those of the RViz configuration that have a topic."""
    manager = yaml.safe_load(RVIZ.read_text())['Visualization Manager']
    return [display for display in manager['Displays'] if 'Topic' in display]


def test_rviz_shows_the_topics_of_the_node(drive, displays):
    """Each display has a topic and type that the node publishes, with a quality that matches."""
    node = drive(SCENE).node
    shown = {display['Topic']['Value']: display for display in displays}
    assert set(shown) == set(node._outputs.topics)
    for topic, display in shown.items():
        offer, = node.get_publishers_info_by_topic(topic)
        kind = display['Class'].removeprefix('rviz_default_plugins/')
        assert offer.topic_type.rsplit('/', 1)[1] == kind
        asked = display['Topic']
        kept = offer.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        assert asked['Durability Policy'] == ('Transient Local' if kept else 'Volatile')
        assert asked['Reliability Policy'] in ('Reliable', 'Best Effort')
        assert offer.qos_profile.reliability == ReliabilityPolicy.RELIABLE


def test_rviz_draws_many_particles_from_the_cloud(drive, displays):
    manager = yaml.safe_load(RVIZ.read_text())['Visualization Manager']
    default = drive(SCENE).node.get_parameter('frame_id').value
    assert manager['Global Options']['Fixed Frame'] == default
    assert {display['Name']: display['Enabled'] for display in displays} == {
        'cloud': True, 'particles': False, 'contacts': True, 'colliders': True}


def test_launch_file_shows_on_request():
    """Nothing unless asked for; RViz with the configuration, the page by the parameter."""
    path = PACKAGE / 'launch' / 'demo.launch.py'
    assert {'viewer': True} not in nodes_of(path)[0].parameters
    assert [node.executable for node in nodes_of(path)] == ['collision_sim_node', 'swing_paddle']
    simulator, _, rviz = nodes_of(path, viewer='true', rviz='true')
    assert {'viewer': True} in simulator.parameters
    assert (rviz.package, rviz.executable) == ('rviz2', 'rviz2')
    assert rviz.arguments == ['-d', str(RVIZ)]


# --- the page --------------------------------------------------------------------------------


def test_the_page_shows_what_the_node_does(drive, monkeypatch):
    """At most 20 frames a second, with the contacts of all steps since the frame before."""
    pytest.importorskip('viser', reason='needs viser')
    driver = drive(SCENE, viewer=True, viewer_port=0)
    page = driver.outputs._page
    frames, now = [], [page._due]
    update = page._viewer.update

    def note(simulation, contacts):
        frames.append((simulation.time, contacts))
        update(simulation, contacts)
    monkeypatch.setattr(page._viewer, 'update', note)
    monkeypatch.setattr('collision_sim.ros.page.perf_counter', lambda: now[0])

    def tick():
        now[0] += 1 / 60
    driver.run(1.0, each=tick)
    assert 18 <= len(frames) <= 21
    assert frames[-1][0] == pytest.approx(1.0, abs=0.06)
    assert all(10 <= len(contacts) <= 14 for _, contacts in frames[2:])


def test_absent_costs_nothing(drive, monkeypatch):
    """By default there is no page, no step records contacts, and nothing of viser is needed."""
    monkeypatch.setitem(sys.modules, 'viser', None)
    driver = drive(SCENE)
    driver.run(0.1)
    assert driver.outputs._page is None and not driver.simulation.record_contacts


def test_without_viser_it_says_what_to_install(drive, monkeypatch):
    monkeypatch.setitem(sys.modules, 'viser', None)
    with pytest.raises((ValueError, ParameterException), match=r'collision_sim\[viewer\]'):
        drive(SCENE, viewer=True)
