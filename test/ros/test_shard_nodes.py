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

"""Nodes that carry one scene together: the parameter `shard`."""

from collision_sim import load_scene
import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from geometry_msgs.msg import PoseArray  # noqa: E402, I100
from harness import Driver, stop_node  # noqa: E402

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
STAMPS = [Driver.START + 0.03 * k for k in range(60)]


def swinging(stamp):
    return (0.5 * np.sin(3.0 * (stamp - Driver.START)), 0.5, 0.1), UPRIGHT


def final_state(driver):
    driver.run(1.5, {'paddle': swinging}, STAMPS)
    assert driver.simulation.counters['collisions'] > 0
    return np.hstack([driver.simulation.position, driver.simulation.velocity])


def test_nodes_of_shards_carry_the_scene_of_one_node(drive):
    """Bit for bit, with a collider that follows a topic."""
    whole = final_state(drive('demo'))
    parts = [final_state(drive('demo', shard='%d/3' % k)) for k in (1, 2, 3)]
    assert np.concatenate(parts).tobytes() == whole.tobytes()
    assert [len(part) for part in parts] == [133, 133, 134]


@pytest.mark.parametrize('shard', ['0/2', '3/2', '1', 'a/b', '1/2/3'])
def test_shards_that_are_none(drive, shard):
    with pytest.raises(ValueError, match='shard: .*must be k/n with k from 1 to n'):
        drive('demo', shard=shard)


def test_a_scene_whose_particles_are_coupled_is_not_parted(drive):
    with pytest.raises(ValueError, match='shard: .*with springs'):
        drive('cloth', shard='1/2')
    assert load_scene('cloth').springs is not None


def test_the_node_says_which_shard_it_has(run_node, peer):
    process = run_node('demo', '-p', 'shard:=2/3')
    peer.spin_until(lambda: any(name == 'collision_sim' for name in peer.node.get_node_names()))
    printed = ''
    while 'publishes' not in printed:
        printed += process.stdout.readline()
    stop_node(process)
    assert 'scene demo, shard 2/3: 133 particles' in printed


# --- start_time ------------------------------------------------------------------------------


def test_nodes_with_a_start_time_begin_together(drive):
    """Scripted colliders are in phase, whenever a node was started and whenever it ticks."""
    states = []
    for early, part in ((0.5, 1), (0.2031, 2)):
        driver = drive('demo', start_time=Driver.START + 1.0, shard='%d/2' % part)
        driver.run(1.0 - early)
        assert driver.simulation.time == 0.0
        assert driver.node._time.stamp().sec == int(driver.now)
        driver.run(0.7)
        driver.set_clock(Driver.START + 2.001)
        driver.node._tick()
        assert driver.simulation.time == pytest.approx(1.001, abs=driver.simulation.dt)
        states.append((driver.simulation.time, *driver.simulation.collider_pose('rotor')[1]))
    assert states[0] == states[1]


def test_a_node_that_is_late_begins_at_once_and_says_so(run_node, peer):
    process = run_node('demo', '-p', 'start_time:=1.0')
    messages = peer.subscribe(PoseArray, '/collision_sim/particles', raw=True)
    peer.spin_until(lambda: len({message[200:] for message in messages}) > 2)
    assert 's after start_time' in stop_node(process)
