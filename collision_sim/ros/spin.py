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

"""The loop in which a node lives, and the node that nothing ends in it."""

from functools import wraps
import signal

from collision_sim.ros.events import Events
from collision_sim.ros.services import answering, error_text
from collision_sim.ros.start import STOP
from collision_sim.ros.values import as_asked, as_declared
from rcl_interfaces.msg import SetParametersResult
import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node

MOST_VALUES = 1000      # in one request, or as many as there are parameters


class SturdyNode(Node):
    """
    A node whose subscriptions and services report what their callbacks raise, and go on.

    Those of rclpy included, whose parameter services raise for a value of an unknown type. What
    arrived in one go with the cause would else wait for the next to arrive.
    """

    def __init__(self, *arguments, **options):
        """As that of rclpy."""
        self._polled = set()
        self.events = None      # there are none of what rclpy itself creates
        super().__init__(*arguments, **options)
        self.events = Events(self)
        self.add_pre_set_parameters_callback(
            lambda parameters: [as_asked(self, parameter) for parameter in parameters])

    def declare_parameter(self, name, value=None, descriptor=None, ignore_override=False):
        """As that of rclpy; also takes whole numbers where others are declared."""
        given = self._parameter_overrides.get(name)
        if given is not None:
            self._parameter_overrides[name] = as_declared(given, value)
        return super().declare_parameter(name, value, descriptor, ignore_override)

    @property
    def subscriptions(self):
        """Those that executors serve."""
        return (each for each in super().subscriptions if each not in self._polled)

    def create_polled_subscription(self, msg_type, topic, *arguments, **options):
        """
        Create a subscription whose messages wait until somebody takes them (`arrived`).

        For small messages that come often: to be woken by each costs more than it takes to read.
        """
        subscription = self.create_subscription(
            msg_type, topic, lambda message: None, *arguments, **options)
        self._polled.add(subscription)
        return subscription

    def create_publisher(self, msg_type, topic, *arguments, **options):
        """As that of rclpy."""
        if self.events:
            options.setdefault('event_callbacks',
                               self.events.of_publisher(self.resolve_topic_name(topic)))
        return super().create_publisher(msg_type, topic, *arguments, **options)

    def create_subscription(self, msg_type, topic, callback, *arguments, **options):
        """As that of rclpy."""
        if self.events:
            options.setdefault('event_callbacks',
                               self.events.of_subscription(self.resolve_topic_name(topic)))

        @wraps(callback)
        def guarded(*message):
            try:
                callback(*message)
            except Exception as error:
                self.log_error(error_text(error))
        return super().create_subscription(msg_type, topic, guarded, *arguments, **options)

    def create_service(self, srv_type, srv_name, callback, **options):
        """As that of rclpy, which also creates those of the parameters by it; always answers."""
        return super().create_service(
            srv_type, srv_name, answering(
                srv_type, callback, self.log_error, self._most_values, self.set_each),
            **options)

    def set_each(self, parameters):
        """Set parameters one by one; gives a SetParametersResult for each, and never raises."""
        return [self._set_one(parameter) for parameter in parameters]

    def _set_one(self, parameter):
        try:
            return self.set_parameters_atomically([parameter])
        except Exception as error:
            return SetParametersResult(successful=False, reason=str(error))

    def _most_values(self):
        return max(MOST_VALUES, len(self._parameters))

    def log_error(self, text):
        """Log what was raised, from time to time."""
        self.get_logger().error(text, throttle_duration_sec=1.0)


def arrived(subscription):
    """Yield the messages that wait in a subscription, and when each was received [ns]."""
    handle = subscription.handle
    with handle:
        while taken := handle.take_message(subscription.msg_type, subscription.raw):
            message, info = taken
            yield message, info['received_timestamp']


def spin(node, stopped):
    """
    Serve a SturdyNode until `stopped` is not empty; no request and no message ends it.

    By an EventsExecutor: the others look at every subscription for every message.
    """
    handlers = [signal.getsignal(number) for number in STOP]
    executor = EventsExecutor()
    _handle(handlers)       # the executor has put its own in their place
    executor.add_node(node)
    while rclpy.ok() and not stopped:
        try:
            executor.spin_once(timeout_sec=0.1)
        except Exception as error:
            node.log_error(error_text(error))
    del executor
    _handle(handlers)       # its end has put the system's defaults in their place


def _handle(handlers):
    for number, handler in zip(STOP, handlers):
        signal.signal(number, handler)
