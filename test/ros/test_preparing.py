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

import io
import subprocess
import sys
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from collision_sim.ros import kernels, warm_up  # noqa: E402, I100
from collision_sim.ros.messages import read_pose_array  # noqa: E402
from collision_sim.scene import Scene  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from geometry_msgs.msg import PoseArray  # noqa: E402
from harness import DEADLINE, jittered_stamps, PADDLE, pose_message, TICK  # noqa: E402
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

compiled, failing = warm_up._step, [name == 'contacts' for name in sys.argv[1:]]

def fail(scene, ledger, contacts):
    if contacts in failing:
        raise RuntimeError('no machine code today')
    return compiled(scene, ledger, contacts)

warm_up._step = fail
sys.exit(main([]))
"""


@pytest.fixture
def slow(drive, monkeypatch):
    """Give a function that makes a node whose kernels are not ready before `release`."""
    compiled, events = warm_up._step, []

    def make(scene, **parameters):
        released = {recording: threading.Event() for recording in (False, True)}
        events.extend(released.values())

        def wait(scene, ledger, contacts):
            assert released[contacts].wait(DEADLINE)
            return compiled(scene, ledger, contacts)

        monkeypatch.setattr(warm_up, '_step', wait)
        monkeypatch.setattr(warm_up, 'LONG', DEADLINE)      # no help
        driver = drive(scene, ready=False, **parameters)
        driver.released = released
        return driver

    yield make
    for released in events:
        released.set()


def release(driver):
    for released in driver.released.values():
        released.set()
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
    driver.released[False].set()
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


def test_contacts_begin_when_they_can_be_recorded(slow):
    """Time does not wait for the kernels that record them; a step asked for is refused."""
    driver, messages = slow(LYING), []
    driver.peer.create_subscription(MarkerArray, NODE + '/contacts', messages.append, 50)
    driver.spin_until(lambda: driver.outputs._contacts.get_subscription_count())
    driver.released[False].set()
    driver.spin_until(lambda: driver.node._ready)
    driver.run(0.5)
    assert driver.simulation.time == pytest.approx(0.5, abs=driver.simulation.dt)
    assert driver.simulation.counters['contacts'] > 100
    assert not driver.simulation.record_contacts
    driver.call(SetBool, NODE + '/pause', SetBool.Request(data=True))
    answer = driver.call(Trigger, NODE + '/step', Trigger.Request())
    assert not answer.success and 'compiled' in answer.message
    assert not any(shows_contacts(message) for message in messages)
    release(driver)
    assert driver.call(Trigger, NODE + '/step', Trigger.Request()).success
    driver.spin_until(lambda: shows_contacts(messages[-1]))


def shows_contacts(message):
    return any(marker.action == Marker.ADD and marker.points for marker in message.markers)


FALLING = {'particles': {'position': [[0, 0, 5]]}, 'drag': {'linear': 0.0},
           'colliders': [{'name': 'ground', 'shape': 'plane'}]}
# With the fixed-step methods drag is a value like others; the event-driven one has kernels for it.
BY_EVENTS = {**FALLING, 'stepping': {'method': 'exact'}}


@pytest.fixture
def held(drive, monkeypatch):
    """Give a function that makes a node whose kernels for new values wait for its `released`."""
    load, released = warm_up._load, threading.Event()

    def wait(warming, scene, ledger, contacts):
        warming.compiles = True
        assert released.wait(DEADLINE)
        return load(warming, scene, ledger, contacts)

    def make(scene, **parameters):
        driver = drive(scene, **parameters)
        driver.released = released
        return driver

    monkeypatch.setattr(warm_up, '_load', wait)
    # No value needs other kernels as it is: here drag does.
    monkeypatch.setattr(kernels, 'variant', lambda scene: scene.drag and scene.drag.linear)
    yield make
    released.set()


def set_drag(driver, value):
    request = SetParameters.Request(
        parameters=[Parameter('drag.linear', value=value).to_parameter_msg()])
    return driver.call(SetParameters, NODE + '/set_parameters', request).results[0]


def test_steps_go_on_while_the_kernels_for_a_new_value_compile(held):
    """By the value before it, and the diagnostics say so; then by the new one."""
    driver, messages, particles = held(BY_EVENTS), [], []
    driver.peer.create_subscription(DiagnosticArray, '/diagnostics', messages.append, 5)
    driver.peer.create_subscription(PoseArray, NODE + '/particles', particles.append, 5, raw=True)
    driver.spin_until(lambda: driver.outputs._particles.get_subscription_count())
    assert set_drag(driver, 100.0).successful and set_restitution(driver, 0.25).successful
    assert driver.node.get_parameter('drag.linear').value == 100.0
    driver.run(0.5, each=lambda: driver.executor.spin_once(timeout_sec=0.0))
    time_before = driver.simulation.time
    assert time_before == pytest.approx(0.5, abs=driver.simulation.dt)
    assert driver.simulation.velocity[0, 2] == pytest.approx(-9.81 * time_before)
    assert driver.simulation.scene.drag.linear == driver.simulation.scene.restitution == 0.0
    driver.spin_until(lambda: messages and 'drag.linear' in messages[-1].status[0].message)
    assert messages[-1].status[0].level == DiagnosticStatus.WARN
    assert 'compiling' in messages[-1].status[0].message and len(particles) > 10
    driver.released.set()
    driver.node.wait_until_ready()
    driver.run(0.5)
    assert driver.simulation.scene.drag.linear == 100.0
    assert driver.simulation.scene.restitution == 0.25
    assert driver.simulation.velocity[0, 2] == pytest.approx(-0.0981, rel=1e-6)
    driver.spin_until(lambda: messages[-1].status[0].level == DiagnosticStatus.OK)


def test_a_step_asked_for_waits_for_the_kernels_of_a_new_value(held):
    """It is refused rather than taken with the value before; back there it is taken at once."""
    driver = held(BY_EVENTS)
    driver.call(SetBool, NODE + '/pause', SetBool.Request(data=True))
    assert set_drag(driver, 100.0).successful
    answer = driver.call(Trigger, NODE + '/step', Trigger.Request())
    assert not answer.success and 'compiled' in answer.message and driver.simulation.time == 0.0
    assert set_drag(driver, 0.0).successful
    assert driver.call(Trigger, NODE + '/step', Trigger.Request()).success
    assert set_drag(driver, 100.0).successful
    driver.released.set()
    driver.node.wait_until_ready()
    assert driver.call(Trigger, NODE + '/step', Trigger.Request()).success
    assert driver.simulation.scene.drag.linear == 100.0


def test_only_what_is_compiled_is_said_to_be(drive, capfd):
    """What comes from the cache or needs no compiler is not."""
    drive(FALLING)
    capfd.readouterr()
    drive(FALLING)
    printed = capfd.readouterr().err
    assert 'publishes' in printed and 'compiling' not in printed


@pytest.mark.skipif(config.DISABLE_JIT, reason='needs the compiler')
@pytest.mark.parametrize('beside', [False, True])
def test_what_is_compiled_is_noticed(monkeypatch, beside):
    """Here or, beside other steps, in a process; the second time nothing has to be."""
    @njit
    def double(x):
        return 2.0 * x

    def compile_elsewhere(*what):
        double(1.0)
        return SimpleNamespace(stdout=io.BytesIO(), communicate=lambda: None)

    monkeypatch.setattr(warm_up, '_step', lambda scene, ledger, contacts: double(1.0))
    monkeypatch.setattr(warm_up, '_play_poses', lambda scene: None)
    monkeypatch.setattr(warm_up, 'start_helper', compile_elsewhere)
    for compiles in (True, False):
        warming = warm_up.WarmUp(None, False, False, beside)
        assert [future.result(DEADLINE) for future in warming.seconds.values()] == [2.0, 2.0]
        assert warming.compiles == compiles


@pytest.mark.skipif(config.DISABLE_JIT, reason='needs the compiler')
def test_a_new_value_at_a_run_compiles_nothing_in_this_thread(drive):
    """Nor does somebody who listens to the contacts after it."""
    driver, compiled = drive(FALLING), []
    with event.install_listener('numba:compile', warm_up._Notice(lambda: compiled.append(1))):
        for value in (0.5, 0.0, 0.5):
            assert set_drag(driver, value).successful
            driver.run(0.1)
            driver.node.wait_until_ready()
            driver.run(0.1)
            assert driver.simulation.scene.drag.linear == value
        driver.peer.create_subscription(MarkerArray, NODE + '/contacts', lambda message: None, 5)
        driver.spin_until(lambda: driver.outputs._contacts.get_subscription_count())
        driver.run(0.1)
        assert driver.simulation.record_contacts
    assert not compiled


@pytest.mark.parametrize('failing', [['contacts', 'none'], ['contacts']], ids=str)
def test_the_node_ends_where_they_cannot_be_compiled(failing):
    """All of them, or those that record contacts, when time has begun already."""
    done = subprocess.run([sys.executable, '-c', FAILS, *failing], capture_output=True, text=True,
                          timeout=DEADLINE)
    assert done.returncode == 1 and 'Traceback' not in done.stderr
    assert done.stderr.strip().endswith('collision_sim_node: no machine code today')


def test_help_comes_if_it_takes_long(monkeypatch):
    """A process has played poses before they are played here, and recorded contacts likewise."""
    monkeypatch.setattr(warm_up, 'LONG', 0.0)
    steps, order, wait = warm_up._step, [], warm_up._wait_for

    def step(scene, ledger, contacts):
        while not helpers:
            time.sleep(0.01)
        order.append(contacts)
        return steps(scene, ledger, contacts)

    def start(*what):
        helpers.append(start_helper(*what))
        return helpers[-1]

    def wait_for(each):
        wait(each)
        order.append('waited')

    helpers, start_helper = [], warm_up.start_helper
    for name, function in (('_step', step), ('start_helper', start), ('_wait_for', wait_for)):
        monkeypatch.setattr(warm_up, name, function)
    seconds = warm_up.WarmUp(Scene.from_dict(PADDLE), False, False).seconds
    assert all(future.result(DEADLINE) > 0.0 for future in seconds.values())
    assert order == [False, 'waited', 'waited', True]
    assert helpers[0].wait(DEADLINE) == 0


def test_a_helper_says_what_it_has_done():
    helper = warm_up.start_helper(Scene.from_dict(PADDLE), False, True)
    assert [helper.stdout.readline() for _ in range(3)] == [b'poses\n', b'steps\n', b'']
    helper.communicate()
    assert helper.returncode == 0


def test_a_helper_ends_with_who_has_started_it(monkeypatch, tmp_path):
    """Long before it has compiled all."""
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))
    helper = warm_up.start_helper(Scene.from_dict(PADDLE), False, True)
    helper.stdin.close()
    assert helper.stdout.read() == b''
    assert helper.wait(DEADLINE) == 0
