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

"""A node that swings the paddle of the demo: a sinusoid along x, as stamped poses."""

import math
import signal
import sys

from collision_sim.ros.messages import SECOND
from collision_sim.ros.own_arguments import read_own_arguments
from collision_sim.ros.spin import spin, SturdyNode
from collision_sim.ros.start import STOP
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
import rclpy
from rclpy.exceptions import ParameterException


HELP = """\
Publishes stamped poses that swing along x, such as the paddle of the demo needs.

Parameters: amplitude [m], period [s], rate [Hz], centre [x, y, z] [m], topic, frame_id:
  swing_paddle --ros-args -p topic:=paddle/pose -p amplitude:=0.3"""


def _descriptor(description, low=None, high=None):
    """Parameters are read once, at the start."""
    limits = [] if low is None else [FloatingPointRange(from_value=low, to_value=high)]
    return ParameterDescriptor(
        description=description, floating_point_range=limits, read_only=True)


class SwingPaddle(SturdyNode):
    """Publishes centre + amplitude sin(2 pi t / period) along x, t from the first pose on."""

    def __init__(self):
        super().__init__('swing_paddle')
        self._amplitude = self.declare_parameter(
            'amplitude', 0.5, _descriptor('Largest distance from the centre [m].', 0.0, 1e3)).value
        self._period = self.declare_parameter(
            'period', 2.0, _descriptor('Time of one swing there and back [s].', 1e-2, 1e4)).value
        rate = self.declare_parameter(
            'rate', 50.0, _descriptor('Poses a second [Hz].', 0.1, 1e3)).value
        self._centre = list(self.declare_parameter(
            'centre', [0.0, 0.5, 0.1], _descriptor('Middle of the swing, x y z [m].')).value)
        if len(self._centre) != 3 or not all(map(math.isfinite, self._centre)):
            raise ValueError(f'centre: {self._centre}: three finite numbers [m]')
        topic = self.declare_parameter(
            'topic', 'paddle/pose', _descriptor('Topic of the poses.')).value
        self._pose = PoseStamped()
        self._pose.header.frame_id = self.declare_parameter(
            'frame_id', 'world', _descriptor('Frame of the poses.')).value
        self._start = None
        self._publisher = self.create_publisher(PoseStamped, topic, 5)
        self.create_timer(1.0 / rate, self._publish)

    def _publish(self):
        now = self.get_clock().now()
        if self._start is None:
            self._start = now
        phase = 2.0 * math.pi * (now - self._start).nanoseconds / SECOND / self._period
        x, y, z = self._centre
        self._pose.header.stamp = now.to_msg()
        self._pose.pose.position.x = float(x + self._amplitude * math.sin(phase))
        self._pose.pose.position.y = float(y)
        self._pose.pose.position.z = float(z)
        self._publisher.publish(self._pose)


def main(args=None):
    """Run until SIGINT or SIGTERM; the exit status is 1 when a parameter is refused."""
    read_own_arguments('swing_paddle', HELP, args)
    # rclpy's own handler shuts the context down and then calls this one instead of Python's, whose
    # KeyboardInterrupt would break into the shutdown when Ctrl-C is pressed twice.
    signals = []
    for number in STOP:
        signal.signal(number, lambda received, frame: signals.append(received))
    status = 0
    try:
        rclpy.init(args=args)
        spin(SwingPaddle(), signals)
    except (ParameterException, ValueError) as error:
        print(f'swing_paddle: {error}', file=sys.stderr)
        status = 1
    finally:
        for number in STOP:
            signal.signal(number, signal.SIG_IGN)  # Python's exit would restore the default
        rclpy.try_shutdown()
    return status


if __name__ == '__main__':
    sys.exit(main())
