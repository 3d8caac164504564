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

"""While its kernels are being compiled the node serves as in a pause; then it moves."""

from contextlib import suppress
from pathlib import Path
import subprocess
import sys
import threading

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from collision_sim.ros import warm_up  # noqa: E402, I100
from collision_sim.ros.messages import read_pose_array  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from geometry_msgs.msg import PoseArray  # noqa: E402
from harness import (DEADLINE, jittered_stamps, PADDLE, pose_message, stop_node,  # noqa: E402
                     TICK)
from numba import config, njit  # noqa: E402
from numba.core import event  # noqa: E402
from rcl_interfaces.srv import ListParameters, SetParameters  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from std_msgs.msg import Float64  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402

NODE = '/collision_sim'
UPRIGHT = (0, 0, 0, 1)
LYING = {'particles': {'position': [[0, 0, 0]]}, 'friction': {'dry': 0.3},
         'colliders': [{'name': 'ground', 'shape': 'plane'}]}
FAILS = """
import sys
from collision_sim.ros import warm_up
from collision_sim.ros.start import main

def fail(scene, ledger):
    raise RuntimeError('no machine code today')

warm_up.prepare = fail
sys.exit(main([]))
"""


@pytest.fixture
def slow(drive, monkeypatch):
    """Give a function that makes a node whose kernels are not ready before `release`."""
    compiled, events = warm_up.prepare, []

    def make(scene, **parameters):
        released = threading.Event()
        events.append(released)

        def wait(scene, ledger):
            assert released.wait(DEADLINE)
            return compiled(scene, ledger)

        monkeypatch.setattr(warm_up, 'prepare', wait)
        driver = drive(scene, ready=False, **parameters)
        driver.released = released
        return driver

    yield make
    for released in events:
        released.set()


def release(driver):
    driver.released.set()
    driver.node.wait_until_ready()


def set_restitution(driver, value):
    request = SetParameters.Request(
        parameters=[Parameter('restitution', value=value).to_parameter_msg()])
    return driver.call(SetParameters, NODE + '/set_parameters', request).results[0]


def test_services_and_parameters_answer(slow):
    driver = slow(PADDLE)
    names = driver.call(ListParameters, NODE + '/list_parameters',
                        ListParameters.Request()).result.names
    assert {'restitution', 'publish_rate', 'gravity'} <= set(names)
    assert set_restitution(driver, 0.25).successful
    assert not set_restitution(driver, 2.0).successful
    assert driver.call(Trigger, NODE + '/reset', Trigger.Request()).success
    for data in (True, False):
        assert driver.call(SetBool, NODE + '/pause', SetBool.Request(data=data)).success
    answer = driver.call(Trigger, NODE + '/step', Trigger.Request())
    assert not answer.success and 'compiled' in answer.message
    value = driver.peer.create_publisher(Float64, NODE + '/set/publish_rate', 1)
    driver.spin_until(value.get_subscription_count)
    value.publish(Float64(data=30.0))
    driver.spin_until(lambda: driver.node.get_parameter('publish_rate').value == 30.0)
    release(driver)
    driver.run(0.5)
    assert driver.simulation.scene.restitution == 0.25
    assert driver.simulation.time == pytest.approx(0.5, abs=driver.simulation.dt)


def test_the_start_is_shown_and_time_begins_when_it_is_over(slow):
    """Nothing moves before, and no steps are caught up with."""
    driver, messages = slow(PADDLE), []
    driver.peer.create_subscription(PoseArray, NODE + '/particles', messages.append, 5, raw=True)
    driver.spin_until(lambda: driver.outputs._particles.get_subscription_count())
    driver.run(5.0, each=lambda: driver.executor.spin_once(timeout_sec=0.0))
    driver.spin_until(lambda: messages)
    start = PADDLE['particles']['position']
    for message in messages:
        np.testing.assert_array_equal(read_pose_array(message)[3][:, :3], start)
    assert driver.simulation.time == 0.0
    release(driver)
    driver.set_clock(driver.now + TICK)
    driver.node._tick()
    assert 0.0 < driver.simulation.time <= TICK
    driver.run(0.5 - TICK)
    assert driver.simulation.time == pytest.approx(0.5, abs=driver.simulation.dt)


def test_diagnostics_say_so(slow):
    driver, messages = slow(PADDLE), []
    driver.peer.create_subscription(DiagnosticArray, '/diagnostics', messages.append, 5)
    driver.spin_until(lambda: messages)
    pace, = messages[-1].status
    assert pace.level == DiagnosticStatus.WARN and 'compiling' in pace.message
    driver.released.set()
    driver.spin_until(lambda: messages[-1].status[0].level == DiagnosticStatus.OK)
    assert len(messages[-1].status) == 3


def test_a_collider_begins_at_the_newest_pose(slow):
    """Also where the clock has jumped meanwhile; none is dropped."""
    driver = slow(PADDLE)

    def pose(stamp):
        return (0.01 * (stamp - driver.now) - 1.0, 0.0, 0.5), UPRIGHT

    driver.take('paddle', pose_message(driver.now, (-2, 0, 0.5)))
    driver.set_clock(driver.now + 400.0)
    driver.run(2.0, {'paddle': pose}, jittered_stamps(driver.now, driver.now + 1.9))
    assert driver.simulation.collider_pose('paddle')[0][0] == -3.0
    release(driver)
    driver.run(0.2)
    assert -1.01 < driver.simulation.collider_pose('paddle')[0][0] < -0.99
    assert not driver.node._poses.dropped and not driver.simulation.velocity[:, 0].any()


def test_a_pause_asked_for_meanwhile_goes_on(slow):
    driver = slow(PADDLE)
    driver.call(SetBool, NODE + '/pause', SetBool.Request(data=True))
    driver.take('paddle', pose_message(None, (-2, 0, 0.5)))
    release(driver)
    driver.run(0.2)
    assert driver.simulation.time == 0.0
    answer = driver.call(Trigger, NODE + '/step', Trigger.Request())
    assert answer.success and answer.message.endswith('moved: paddle')
    assert driver.simulation.time == driver.simulation.dt


def test_a_start_time_holds(slow):
    """One that comes while the kernels compile is late, a later one is kept to."""
    for start, simulated in ((1.0, 0.5), (2.25, 0.25)):
        driver = slow(PADDLE, start_time=1000.0 + start)
        driver.run(2.0)
        release(driver)
        driver.run(0.5)
        assert driver.simulation.time == pytest.approx(simulated, abs=2 * driver.simulation.dt)


def test_contacts_that_somebody_has_waited_for(slow):
    """Who listens while the kernels compile sees those of the first steps; time waits for none."""
    driver, messages = slow(LYING), []
    driver.peer.create_subscription(MarkerArray, NODE + '/contacts', messages.append, 50)
    driver.spin_until(lambda: driver.outputs._contacts.get_subscription_count())
    driver.run(0.2)
    assert not any(shows_contacts(message) for message in messages)
    release(driver)
    driver.run(0.5)
    assert driver.simulation.time == pytest.approx(0.5, abs=driver.simulation.dt)
    assert driver.simulation.counters['contacts'] > 100
    assert driver.simulation.record_contacts
    driver.spin_until(lambda: any(shows_contacts(message) for message in messages))


def shows_contacts(message):
    return any(marker.action == Marker.ADD and marker.points for marker in message.markers)


FALLING = {'particles': {'position': [[0, 0, 5]]}, 'drag': {'linear': 0.0},
           'colliders': [{'name': 'ground', 'shape': 'plane'}]}
BY_EVENTS = {**FALLING, 'stepping': {'method': 'exact'}}


class Listening(event.Listener):
    """Calls a function with each event."""

    def __init__(self, call):
        self._call = call

    def on_start(self, event):
        self._call(event)

    def on_end(self, event):
        self._call(event)


@pytest.fixture
def compiled():
    """Give a list of what any thread of this process compiles, which ought to be empty."""
    names = []

    def note(compiling):
        if compiling.is_start:
            names.append(compiling.data['dispatcher'].py_func.__qualname__)
    with event.install_listener('numba:compile', Listening(note)):
        yield names


def set_drag(driver, value):
    request = SetParameters.Request(
        parameters=[Parameter('drag.linear', value=value).to_parameter_msg()])
    return driver.call(SetParameters, NODE + '/set_parameters', request).results[0]


@pytest.mark.parametrize('scene', [FALLING, BY_EVENTS], ids=['in_steps', 'by_events'])
def test_steps_go_on_with_new_values_at_once(drive, scene):
    """The tick after they are set takes them; services answer, and nothing is out of order."""
    driver, messages, particles = drive(scene), [], []
    driver.peer.create_subscription(DiagnosticArray, '/diagnostics', messages.append, 5)
    driver.peer.create_subscription(PoseArray, NODE + '/particles', particles.append, 5, raw=True)
    driver.spin_until(lambda: driver.outputs._particles.get_subscription_count())
    driver.run(0.5)
    time_before = driver.simulation.time
    assert time_before == pytest.approx(0.5, abs=driver.simulation.dt)
    assert driver.simulation.velocity[0, 2] == pytest.approx(-9.81 * time_before)
    assert set_drag(driver, 100.0).successful and set_restitution(driver, 0.25).successful
    assert driver.node.get_parameter('drag.linear').value == 100.0
    driver.run(TICK)
    assert driver.simulation.time > time_before
    assert driver.simulation.scene.drag.linear == 100.0
    assert driver.simulation.scene.restitution == 0.25
    assert driver.simulation.velocity[0, 2] > -0.5 * 9.81 * time_before
    driver.run(0.5, each=lambda: driver.executor.spin_once(timeout_sec=0.0))
    assert driver.simulation.velocity[0, 2] == pytest.approx(-0.0981, rel=1e-6)
    driver.spin_until(lambda: messages and len(particles) > 10)
    driver.spin_until(lambda: messages[-1].status[0].level == DiagnosticStatus.OK)


@pytest.mark.parametrize('scene', [FALLING, BY_EVENTS], ids=['in_steps', 'by_events'])
def test_a_step_asked_for_takes_a_new_value(drive, scene):
    """It is never refused for it; and back at the value before it is the step of before."""
    driver = drive(scene)
    driver.call(SetBool, NODE + '/pause', SetBool.Request(data=True))
    for value in (100.0, 0.0, 100.0):
        assert set_drag(driver, value).successful
        assert driver.call(Trigger, NODE + '/step', Trigger.Request()).success
        assert driver.simulation.scene.drag.linear == value
    assert driver.simulation.time == pytest.approx(3 * driver.simulation.dt)


def test_only_what_is_compiled_is_said_to_be(drive, capfd):
    """What comes from the cache or needs no compiler is not."""
    drive(FALLING)
    capfd.readouterr()
    drive(FALLING)
    printed = capfd.readouterr().err
    assert 'publishes' in printed and 'compiling' not in printed


@pytest.mark.skipif(config.DISABLE_JIT, reason='needs the compiler')
def test_what_is_compiled_is_noticed(monkeypatch):
    """The second time nothing has to be."""
    @njit
    def double(x):
        return 2.0 * x

    monkeypatch.setattr(warm_up, 'prepare', lambda scene, ledger: double(1.0))
    for compiles in (True, False):
        warming = warm_up.WarmUp(None, False)
        assert warming.seconds_a_step == 2.0 and warming.failure is None
        assert warming.compiles == compiles


EVERYTHING = {
    'particles': {'position': [[0, 0, 1], [0.3, 0, 0.5], [0, 0, 0]]}, 'restitution': 0.5,
    'drag': {'linear': 0.1, 'quadratic': 0.0, 'wind': [0, 0, 0]},
    'friction': {'dry': 0.3, 'wet': 0.0},
    'colliders': [{'name': 'ground', 'shape': 'plane'},
                  {'name': 'ball', 'shape': 'sphere', 'radius': 0.2, 'position': [0, 0, 0.2]},
                  {'name': 'paddle', 'shape': 'box', 'size': [0.2, 1, 1], 'topic': 'paddle/pose',
                   'position': [-3, 0, 0.5]}]}


@pytest.mark.skipif(config.DISABLE_JIT, reason='needs the compiler')
@pytest.mark.parametrize('method', ['collision_then_contact', 'second_order_contact', 'exact'])
@pytest.mark.parametrize('ledger', [False, True])
def test_nothing_at_a_run_compiles_anything(drive, compiled, method, ledger):
    """Neither a new value of any parameter, nor who listens to contacts, nor a pose."""
    driver = drive({**EVERYTHING, 'stepping': {'method': method}}, ledger=ledger)
    driver.run(0.1)
    del compiled[:]
    changed = 0
    for path, parameter in driver.simulation.scene.parameters().items():
        for value in others(parameter):
            request = SetParameters.Request(
                parameters=[Parameter(path, value=value).to_parameter_msg()])
            changed += driver.call(SetParameters, NODE + '/set_parameters',
                                   request).results[0].successful
            driver.run(0.02)
    assert changed > 30 and not compiled
    for _ in range(2):
        listening = driver.peer.create_subscription(
            MarkerArray, NODE + '/contacts', lambda message: None, 5)
        driver.spin_until(lambda: driver.outputs._contacts.get_subscription_count())
        driver.run(0.1)
        assert driver.simulation.record_contacts
        driver.peer.destroy_subscription(listening)
        driver.spin_until(lambda: not driver.outputs._contacts.get_subscription_count())
        driver.run(0.1)
        assert not driver.simulation.record_contacts
    driver.run(0.5, {'paddle': lambda stamp: ((-2.9, 0.0, 0.5), UPRIGHT)},
               jittered_stamps(driver.now, driver.now + 0.4))
    assert driver.simulation.collider_pose('paddle')[0][0] == pytest.approx(-2.9)
    assert driver.call(Trigger, NODE + '/reset', Trigger.Request()).success
    driver.run(0.1)
    assert not compiled


def others(parameter):
    """Values of a parameter's type that it may have, and its own again at the end."""
    value, _, low, high, _ = parameter
    if isinstance(value, tuple):
        return [0.5, -0.25, -3.0], list(value)
    if isinstance(value, float):
        between = [x for x in (0.0, 0.125, 1.0) if (low is None or x >= low)
                   and (high is None or x <= high)]
        return [*between, value]
    return [value + 1, value] if type(value) is int else [value]


def test_the_node_ends_where_they_cannot_be_compiled():
    done = subprocess.run([sys.executable, '-c', FAILS], capture_output=True, text=True,
                          timeout=DEADLINE)
    assert done.returncode == 1 and 'Traceback' not in done.stderr
    assert done.stderr.strip().endswith('collision_sim_node: no machine code today')


def parents():
    """Give the processes that others have been started by."""
    found = set()
    for stat in Path('/proc').glob('[0-9]*/stat'):
        with suppress(OSError):         # it has ended
            found.add(int(stat.read_text().rpartition(')')[2].split()[1]))
    return found


@pytest.mark.skipif(config.DISABLE_JIT, reason='needs the compiler')
@pytest.mark.skipif(not Path('/proc/self/stat').exists(), reason='needs /proc')
def test_a_cold_node_starts_no_process(run_node, peer, monkeypatch, tmp_path):
    """It compiles in a thread of its own, and answers meanwhile."""
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))
    process = run_node(PADDLE)
    for _ in range(10):
        assert not peer.call(Trigger, NODE + '/step', Trigger.Request()).success
        assert process.pid not in parents()
        peer.spin_for(0.3)
    assert 'compiling the kernels' in stop_node(process)
