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

"""The node brings its profile of Fast DDS unless the user has decided; losses are told of."""

import os

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from collision_sim.ros import fast_dds  # noqa: E402, I100
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from geometry_msgs.msg import PoseArray, PoseStamped  # noqa: E402
from harness import PADDLE, pose_message  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: E402

DECIDED = [
    {'FASTRTPS_DEFAULT_PROFILES_FILE': 'mine.xml'}, {'FASTDDS_DEFAULT_PROFILES_FILE': 'mine.xml'},
    {'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}, {'RMW_IMPLEMENTATION': 'rmw_cyclonedds_cpp'}]


@pytest.fixture
def surroundings(monkeypatch, tmp_path):
    """Give a function that sets an environment in which nothing is decided but what is given."""
    def be(**given):
        for name in (*fast_dds.USERS, 'RMW_IMPLEMENTATION', fast_dds.ASYNCHRONOUS[0]):
            monkeypatch.delenv(name, raising=False)
        for name, value in given.items():
            monkeypatch.setenv(name, value)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(fast_dds, 'SHARED_MEMORY', str(tmp_path))
    before = dict(os.environ)
    yield be
    for name in (*fast_dds.USERS, fast_dds.ASYNCHRONOUS[0]):
        os.environ.pop(name, None)
    os.environ.update(before)


@pytest.mark.parametrize('given', [{}, {'RMW_IMPLEMENTATION': 'rmw_fastrtps_cpp'},
                                   {'RMW_IMPLEMENTATION': '', 'FASTDDS_BUILTIN_TRANSPORTS': ''}])
def test_the_profile_is_brought(surroundings, given):
    surroundings(**given)
    fast_dds.prepare()
    assert os.environ[fast_dds.OURS] == str(fast_dds.PROFILE) and fast_dds.PROFILE.is_file()
    assert os.environ['RMW_FASTRTPS_PUBLICATION_MODE'] == 'ASYNCHRONOUS'
    assert fast_dds.trouble() == ''


@pytest.mark.parametrize('given', DECIDED, ids=str)
def test_what_the_user_has_chosen_stays(surroundings, given):
    surroundings(RMW_FASTRTPS_PUBLICATION_MODE='SYNCHRONOUS', **given)
    before = dict(os.environ)
    fast_dds.prepare()
    assert dict(os.environ) == before and fast_dds.trouble() == ''


@pytest.mark.parametrize('name', fast_dds.FILES)
def test_a_file_that_fast_dds_takes_by_itself_stays(surroundings, tmp_path, name):
    surroundings()
    (tmp_path / name).write_text('<dds/>')
    fast_dds.prepare()
    assert fast_dds.OURS not in os.environ


def test_without_room_in_shared_memory_there_is_none(surroundings, monkeypatch, tmp_path):
    surroundings()
    monkeypatch.setattr(fast_dds, 'SHARED_MEMORY', str(tmp_path / 'nowhere'))
    fast_dds.prepare()
    assert fast_dds.OURS not in os.environ and 'nowhere' in fast_dds.trouble()


def test_large_messages_without_it_are_warned_of(surroundings, drive):
    surroundings()
    driver = drive({'particles': {'count': 20_000, 'box': {'min': [0, 0, 1], 'max': [1, 1, 2]}}})
    messages = []
    driver.peer.create_subscription(DiagnosticArray, '/diagnostics', messages.append, 5)
    driver.peer.create_subscription(PoseArray, '/collision_sim/particles', lambda m: None, 5,
                                    raw=True)
    driver.spin_until(lambda: driver.outputs._particles.get_subscription_count())
    driver.node._tick()
    driver.spin_until(lambda: messages and 'may get lost' in messages[-1].status[0].message)
    assert messages[-1].status[0].level == DiagnosticStatus.WARN
    assert '1.1 MB' in messages[-1].status[0].message


def test_what_the_middleware_tells_is_in_the_diagnostics(drive, capfd, monkeypatch):
    """Poses that came too fast, and a subscriber that asks for what is not offered."""
    monkeypatch.setenv(*fast_dds.ASYNCHRONOUS)      # a best-effort publisher then skips some
    driver, messages = drive(PADDLE), []
    driver.peer.create_subscription(DiagnosticArray, '/diagnostics', messages.append, 5)
    driver.spin_until(lambda: messages)
    fast = driver.peer.create_publisher(PoseStamped, 'paddle/pose', QoSProfile(
        depth=1, reliability=ReliabilityPolicy.BEST_EFFORT))
    driver.peer.create_subscription(
        PoseArray, '/collision_sim/particles', lambda message: None,
        QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    driver.spin_until(fast.get_subscription_count)
    for _ in range(3000):
        fast.publish(pose_message(driver.now, (-3, 0, 0.5)))
    counts = driver.node.events.counts
    driver.spin_until(lambda: counts['/paddle/pose', 'messages lost'] > 0
                      and counts['/collision_sim/particles', 'incompatible QoS'] > 0)
    driver.spin_until(lambda: len(messages[-1].status) == 3 and any(
        '/paddle/pose: messages lost' == value.key for value in messages[-1].status[2].values))
    assert 'messages were lost' in capfd.readouterr().err
