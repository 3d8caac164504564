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

"""What /diagnostics says, and that nothing is computed for it when nobody listens."""

from collections import Counter
from math import nan
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from collision_sim.balances import Balance  # noqa: E402, I100
from collision_sim.core.rules import COUNTERS  # noqa: E402
from collision_sim.ros.diagnostics import DEEPEST, Diagnostics, SLOWEST  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from geometry_msgs.msg import Vector3  # noqa: E402
from harness import pose_message  # noqa: E402
from std_msgs.msg import Float64  # noqa: E402

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
SCENE = {
    'particles': {'position': [[0, 0, 0.5], [0.3, 0, 0.01]]},
    'colliders': [{'name': 'ground', 'shape': 'plane'},
                  {'name': 'paddle', 'shape': 'box', 'size': [0.2, 1, 1], 'topic': 'paddle/pose',
                   'position': [-3, 0, 0.5]}],
}


def values(status):
    return {value.key: value.value for value in status.values}


def statuses(driver):
    return driver.node._diagnostics.report(driver.node._time.now()).status


class Quiet:
    """Diagnostics of a simulation of which everything can be said."""

    def __init__(self):
        self.simulation = SimpleNamespace(
            time=1.0, dt=1e-9, position=np.zeros((3, 3)), ledger=None,
            counters=dict.fromkeys(COUNTERS, 0),
            clearance=lambda: np.array([self.clearance, 1.0, nan, np.inf]))
        self.clearance = 0.0
        poses = SimpleNamespace(topics={}, dropped=Counter(), stale=lambda now: [])
        self.diagnostics = Diagnostics(
            'node', self.simulation, poses, SimpleNamespace(
                messages=SimpleNamespace(shown=3)), Counter())
        self.diagnostics.begin()

    def report(self):
        return self.diagnostics.report(0.0).status


@pytest.fixture
def quiet():
    return Quiet()


# --- levels ----------------------------------------------------------------------------------


def test_a_sound_simulation_is_ok(quiet):
    pace, physics = quiet.report()
    assert pace.level == physics.level == OK
    assert (pace.message, physics.message) == ('running', 'fine')


def test_pace_of_steps_left_out(quiet):
    """A little too slow is a warning, below SLOWEST an error."""
    quiet.diagnostics.slow = True
    quiet.diagnostics._since -= 1.0
    quiet.simulation.dt = 1e-3
    quiet.diagnostics.steps = int(1.2 * SLOWEST / 1e-3)
    assert quiet.report()[0].level == WARN
    quiet.diagnostics.slow = True
    quiet.diagnostics.steps = 0
    pace = quiet.report()[0]
    assert pace.level == ERROR and 'too slow' in pace.message
    assert quiet.report()[0].level == OK


@pytest.mark.parametrize('counter', ['fail_safes', 'unplaced', 'undecided'])
def test_what_a_sound_simulation_does_not_do_is_a_warning_once(quiet, counter):
    quiet.simulation.counters = {**quiet.simulation.counters, counter: 2}
    physics = quiet.report()[1]
    assert physics.level == WARN and physics.message.startswith('2 ')
    assert quiet.report()[1].level == OK
    quiet.simulation.counters = {**quiet.simulation.counters, counter: 1}   # after a reset
    assert quiet.report()[1].message.startswith('1 ')


def test_frozen_particles_stay_an_error(quiet):
    quiet.simulation.counters = {**quiet.simulation.counters, 'frozen': 1}
    for _ in range(2):
        physics = quiet.report()[1]
        assert physics.level == ERROR and 'frozen' in physics.message


def test_a_particle_driven_out_of_the_range_of_numbers(drive):
    """By a parameter topic: what the node publishes stays finite, and it says what happened."""
    driver = drive(SCENE)
    publisher = driver.peer.create_publisher(Vector3, '/collision_sim/set/gravity', 1)
    driver.spin_until(publisher.get_subscription_count)
    publisher.publish(Vector3(x=0.0, y=0.0, z=1e308))
    driver.spin_until(lambda: driver.simulation.scene.gravity[2] == 1e308)

    def check():
        assert np.isfinite(driver.simulation.position).all()
        assert np.isfinite(driver.simulation.velocity).all()

    driver.node._diagnostics.begin()
    driver.run(3.0, each=check)
    assert driver.simulation.counters['frozen'] > 0
    physics = statuses(driver)[1]
    assert physics.level == ERROR and 'frozen' in physics.message


def test_deep_particles_are_a_warning(quiet):
    quiet.clearance = -0.9 * DEEPEST
    assert quiet.report()[1].level == OK
    quiet.clearance = -2.0 * DEEPEST
    physics = quiet.report()[1]
    assert physics.level == WARN
    assert float(values(physics)['deepest penetration [m]']) == 2.0 * DEEPEST


@pytest.mark.parametrize('change, level', [(-1.0, OK), (-1.1, ERROR), (nan, ERROR)])
def test_a_ledger_that_does_not_add_up_is_an_error(quiet, change, level):
    total = Balance(1.0, -1.0, 0.0, np.zeros(1), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, change, None)
    quiet.simulation.ledger = SimpleNamespace(total=total)
    assert quiet.report()[1].level == level


def test_rates_and_times(quiet):
    quiet.simulation.counters = {**quiet.simulation.counters, 'collisions': 10, 'contacts': 40}
    quiet.diagnostics._since -= 2.0
    quiet.diagnostics.step_times = [1e-3] * 99 + [2e-3]
    pace, physics = quiet.report()
    assert float(values(physics)['collisions per second']) == pytest.approx(5.0, rel=0.2)
    assert float(values(physics)['contacts per second']) == pytest.approx(20.0, rel=0.2)
    assert float(values(pace)['step time, mean [ms]']) == pytest.approx(1.01)
    assert 1.0 < float(values(pace)['step time, p99 [ms]']) <= 2.0
    assert 'publish time, mean [ms]' not in values(pace)


# --- the node --------------------------------------------------------------------------------


def test_inputs(drive):
    driver = drive(SCENE)
    driver.node._diagnostics.begin()
    driver.run(0.2, {'paddle': lambda stamp: ((-1, 0, 0.5), (0, 0, 0, 1))}, [driver.now])
    pace, physics, inputs = statuses(driver)
    assert pace.level == physics.level == inputs.level == OK
    assert int(values(physics)['collisions']) > 0
    assert {'real-time factor', 'step time, p99 [ms]', 'publish time, p99 [ms]'} <= set(
        values(pace))
    driver.take('paddle', pose_message(None, (nan, 0, 0)))
    driver.node._live._take('restitution', float, Float64(data=2.0))
    inputs = statuses(driver)[2]
    assert inputs.level == WARN
    assert values(inputs)['dropped paddle: not_finite'] == '1'
    assert values(inputs)['refused restitution'] == '1'
    assert statuses(driver)[2].level == OK
    driver.run(1.0)
    inputs = statuses(driver)[2]
    assert inputs.level == WARN and 'paddle stands still' in inputs.message


def test_the_ledger_is_in_the_diagnostics_if_asked_for(drive):
    driver = drive(SCENE, ledger=True)
    driver.node._diagnostics.begin()
    driver.run(0.5)
    physics = statuses(driver)[1]
    assert physics.level == OK
    assert abs(float(values(physics)['ledger residual [share]'])) < 1e-12
    assert abs(float(values(physics)['ledger residual [J]'])) < 1e-12


def test_nothing_is_computed_without_listeners(drive, monkeypatch):
    driver = drive(SCENE)

    def fail():
        raise AssertionError('computed')

    monkeypatch.setattr(driver.simulation, 'clearance', fail)
    driver.run(0.1)
    driver.node._report()
    diagnostics = driver.node._diagnostics
    assert not (diagnostics.step_times or diagnostics.publish_times or diagnostics.steps)
    messages = []
    driver.peer.create_subscription(DiagnosticArray, '/diagnostics', messages.append, 5)
    driver.spin_until(lambda: driver.node._diagnostic.get_subscription_count() > 0)
    monkeypatch.undo()
    driver.spin_until(lambda: messages)
    names = [status.name for status in messages[0].status]
    assert names == ['/collision_sim: pace', '/collision_sim: physics', '/collision_sim: inputs']
