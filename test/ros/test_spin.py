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

"""The loop of a node: what its callbacks raise, and signals, end neither it nor what waits."""

import os
import signal
import threading

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from collision_sim.ros.spin import spin, SturdyNode  # noqa: E402, I100
from harness import DEADLINE, Peer  # noqa: E402
import rclpy  # noqa: E402
from rclpy.clock import Clock, ClockType  # noqa: E402
from rclpy.signals import SignalHandlerOptions  # noqa: E402
from std_msgs.msg import Float64  # noqa: E402
from std_srvs.srv import SetBool  # noqa: E402


class Fragile(SturdyNode):
    """A node whose callbacks raise when they are told to."""

    def __init__(self):
        super().__init__('fragile')
        self.ticks, self.values = 0, []
        self.create_timer(0.05, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.create_subscription(Float64, 'value', self._take, 10)
        self.create_service(SetBool, 'ask', self._answer)

    def _tick(self):
        self.ticks += 1
        raise RuntimeError('tick')

    def _take(self, message):
        self.values.append(message.data)
        if message.data < 0.0:
            raise ValueError('negative')

    def _answer(self, request, response):
        if not request.data:
            raise KeyError('asked')
        response.success = True
        return response


@pytest.fixture
def fragile():
    """Give the node, in the default context, which spin asks whether to go on."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = Fragile()
    yield node
    node.destroy_node()
    rclpy.try_shutdown()


def serve(node, work):
    """Spin until `work(peer)` is done in a thread of its own."""
    stopped, failures = [], []

    def run():
        peer = Peer()
        try:
            work(peer)
        except BaseException as error:
            failures.append(error)
        finally:
            peer.close()
            stopped.append(True)

    thread = threading.Thread(target=run)
    thread.start()
    spin(node, stopped)
    thread.join(DEADLINE)
    if failures:
        raise failures[0]


def test_raising_callbacks_end_nothing(fragile):
    def work(peer):
        publisher = peer.node.create_publisher(Float64, 'value', 10)
        peer.spin_until(lambda: publisher.get_subscription_count() > 0)
        for value in (-1.0, -2.0, 3.0):
            publisher.publish(Float64(data=value))
        peer.spin_until(lambda: len(fragile.values) == 3)
        ticks = fragile.ticks
        peer.spin_until(lambda: fragile.ticks > ticks + 2)

    serve(fragile, work)
    assert fragile.values == [-1.0, -2.0, 3.0]


def test_requests_behind_one_that_raises_are_answered(fragile):
    """All three wait when the node begins to be served, as one event."""
    def ask(peer):
        client = peer.node.create_client(SetBool, 'ask')
        peer.spin_until(client.service_is_ready)
        return [client.call_async(SetBool.Request(data=data)) for data in (False, True, True)]

    peer = Peer()
    futures = ask(peer)
    peer.spin_for(0.5)      # the requests are under way
    serve(fragile, lambda other: peer.spin_until(lambda: all(f.done() for f in futures)))
    peer.close()
    assert futures[1].result().success and futures[2].result().success
    assert futures[0].done() and not futures[0].result().success


def test_signals_go_to_those_who_asked_for_them(fragile):
    """The executor handles SIGINT and SIGTERM itself; spin gives them back, during and after."""
    seen, before = [], {}
    for number in (signal.SIGINT, signal.SIGTERM):
        before[number] = signal.signal(number, lambda received, frame: seen.append(received))
    try:
        def work(peer):
            peer.spin_until(lambda: fragile.ticks > 0)
            os.kill(os.getpid(), signal.SIGTERM)
            peer.spin_until(lambda: seen)

        serve(fragile, work)
        os.kill(os.getpid(), signal.SIGINT)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert seen == [signal.SIGTERM, signal.SIGINT]
