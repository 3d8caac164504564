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

"""
The node: one Simulation in step with the clock, between topics in and topics out.

All callbacks run in one thread, one after the other, so that nothing here needs a lock. Times are
seconds of the clock that the steps are in step with (clocks.py).
"""

from math import ceil
import sys
import time

from collision_sim.ros import fast_dds
from collision_sim.ros.advice import advice
from collision_sim.ros.clocks import FollowedClock, PublishedClock
from collision_sim.ros.diagnostics import Diagnostics
from collision_sim.ros.outputs import Outputs
from collision_sim.ros.parameters import (declare_fixed, declare_values, LiveParameters,
                                          warn_of_unknown)
from collision_sim.ros.pose_topics import PoseTopics
from collision_sim.ros.spin import spin, SturdyNode
from collision_sim.ros.start import main
from collision_sim.ros.warm_up import WarmUp
from collision_sim.scene import is_of_a_part
from collision_sim.simulation import Simulation
from diagnostic_msgs.msg import DiagnosticArray
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import ParameterException
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import SetBool, Trigger

SLOWEST_TICKS = 30.0    # Hz; slower messages go out every second, third, ... tick
LONGEST_TICK = 0.05     # s of computing in one tick; what does not fit is left out
WARN_PERIOD = 5.0       # s
WAITING = 0.02          # s between two looks whether the kernels are ready


class CollisionSimNode(SturdyNode):
    """Steps a scene as the clock asks for, between poses and parameters in and messages out."""

    _live = None            # LiveParameters, once all are declared

    def __init__(self, **options):
        """
        Load the scene and serve; it moves as soon as its kernels are ready.

        Parameters
        ----------
        **options
            Those of rclpy's Node.

        """
        super().__init__('collision_sim', **options)
        self._paused = self._ready = False
        self._load_simulation()
        self._poses = PoseTopics(self, self._simulation.scene, self._time)
        self._poses.hold()
        self._outputs = Outputs(self, self._simulation, self._poses.frame_id)
        self._diagnostic = self.create_publisher(DiagnosticArray, '/diagnostics', 5)
        self._create_services()
        warn_of_unknown(self)
        self._prepare()
        self._live = LiveParameters(self, self._stepped.scene, self._adopt, self._change)
        self._diagnostics = Diagnostics(self.get_fully_qualified_name(), self._simulation,
                                        self._poses, self._outputs, self._live.refused,
                                        self.events.counts)
        self._start_ticking()

    # --- start -----------------------------------------------------------------------------

    def _load_simulation(self):
        scene, name, publish_clock, start = declare_fixed(self)
        scene = declare_values(self, scene)
        self._stepped = Simulation(scene, ledger=self.get_parameter('ledger').value)
        self._time = PublishedClock(self, self._stepped) if publish_clock \
            else FollowedClock(self, start)
        self.get_logger().info('scene %s: %d particles, %d colliders' % (
            name, len(self._stepped.position), len(scene.colliders)))

    @property
    def _simulation(self):
        """The simulation, with all values that have come."""
        self._take_values()
        return self._stepped

    def set_each(self, parameters):
        """As that of SturdyNode, what is of the whole scene before what may follow it."""
        order = sorted(range(len(parameters)), key=lambda k: is_of_a_part(parameters[k].name))
        results = dict(zip(order, self._live.set_each([parameters[k] for k in order])))
        return [results[k] for k in range(len(parameters))]

    def get_parameter(self, name):
        """As that of rclpy, with all values that have come."""
        self._take_values()
        return super().get_parameter(name)

    def destroy_node(self):
        """Close what the node has opened."""
        self._outputs.close()
        super().destroy_node()

    def _create_services(self):
        self.create_service(Trigger, '~/reset', self._reset)
        self.create_service(SetBool, '~/pause', self._pause)
        self.create_service(Trigger, '~/step', self._step)

    def _start_ticking(self):
        self._time.stand_still()
        self._ticks = 0
        self._timer = None
        self._use_rate(self.get_parameter('publish_rate').value)
        steady = Clock(clock_type=ClockType.STEADY_TIME)    # also while a simulated clock stands
        self.create_timer(1.0, self._report, clock=steady)
        self._namesakes = self.create_timer(3.0, self._warn_of_namesakes, clock=steady)

    def _prepare(self):
        """Begin to prepare the kernels; until they are ready the node is as in a pause."""
        self._told = False          # that they are compiled
        self._kernels = WarmUp(self._stepped.scene, self._stepped.ledger is not None)
        self._waiting = self.create_timer(WAITING, self._look_at_kernels, clock=Clock(
            clock_type=ClockType.STEADY_TIME))      # also while a simulated clock stands

    @property
    def failure(self):
        """What kept kernels from being ready, an exception; None as a rule."""
        return self._kernels.failure

    def wait_until_ready(self):
        """Do not serve but wait until the kernels are ready; raises what kept them from it."""
        self._kernels.seconds_a_step
        self._look_at_kernels()

    def _look_at_kernels(self):
        """Say that they are compiled, where they are; begin when they are ready."""
        if self._kernels.compiles and not self._told:
            self._told = True
            self.get_logger().info('compiling the kernels of the scene, which takes a while; they '
                                   'are kept for the next time')
        if self._kernels.done and self._waiting is not None:
            self.destroy_timer(self._waiting)
            self._waiting = None
            if self.failure is not None:
                self.context.try_shutdown()     # which ends spinning
            else:
                self._begin()

    # --- changes of the scene --------------------------------------------------------------

    def _take_values(self):
        """Let the simulation have what has come."""
        if self._live is not None:
            self._live.adopt()

    def _adopt(self, scene):
        """Take steps of a scene with other values."""
        self._stepped._adopt(scene)

    def _begin(self):
        """Let time go on from here."""
        self._seconds_a_step, self._ready = self._kernels.seconds_a_step, True
        self._time.begin()
        if not self._paused:
            self._poses.release(self._time.now())
        self._say_how_to_use()

    def _say_how_to_use(self):
        log = self.get_logger()
        log.info('%s publishes %s' % (
            self.get_fully_qualified_name(), ', '.join(self._outputs.topics)))
        for line in advice(self.get_fully_qualified_name(), self._poses.frame_id, {
                name: (topic, self._simulation.scene.collider(name).position)
                for name, topic in self._poses.topics.items()}):
            log.info(line)

    # --- time ------------------------------------------------------------------------------

    def _tick(self):
        """Take the steps that the clock asks for, and publish when it is time to."""
        self._poses.take_arrived()
        jump = self._time.jump()
        if jump:
            self._begin_again(jump)
        elif self._paused or not self._ready or not self._simulation.dt:
            self._time.stand_still()
        else:
            self._take_due_steps()
        self._time.publish()
        self._ticks += 1
        if self._ticks % self._ticks_a_message == 0:
            start = time.perf_counter()
            self._outputs.publish(self._time.stamp())
            self._diagnostics.note_message(start, time.perf_counter())
            self._diagnostics.largest = self._outputs.largest

    def _begin_again(self, jump):
        """Take no steps for a jump of the clock; poses from before it mean nothing any more."""
        if self._ticks and self._ready:
            self.get_logger().warning('the clock jumped by %.3f s' % jump)
        self._poses.forget()
        self._time.begin_again()

    def _take_due_steps(self):
        """Take the steps that are due, or as many as there is time for."""
        dt = self._simulation.dt
        asked = self._time.due(dt)
        if asked == 0:
            return
        count = min(asked, max(1, int(LONGEST_TICK / self._seconds_a_step)))
        if count < asked:
            self._diagnostics.slow = True
            self.get_logger().warning('%d of %d steps taken: too slow for the clock' % (
                count, asked), throttle_duration_sec=WARN_PERIOD)
        start = time.perf_counter()
        self._advance(*self._time.spend(asked, count, dt))
        duration = (time.perf_counter() - start) / count
        self._diagnostics.step_times.append(duration)
        self._seconds_a_step += 0.1 * (duration - self._seconds_a_step)

    def _advance(self, times, pace):
        """
        Take steps that end at times on the clock.

        Parameters
        ----------
        times : (n,) float64 [s]
            On the clock.
        pace : float [-]
            Time on the clock a time of the simulation: above 1 where steps are left out.

        """
        outputs = self._outputs
        wanted = outputs.contacts_wanted
        self._stepped.record_contacts = wanted
        self._poses.step(self._simulation, times, pace,
                         outputs.messages.add_contacts if wanted else None)
        self._diagnostics.steps += len(times)

    # --- out -------------------------------------------------------------------------------

    def _report(self):
        self._poses.take_arrived()      # there are no ticks while a simulated clock stands
        self._take_values()
        if not self._diagnostic.get_subscription_count():
            self._diagnostics.rest()
            return
        message = self._diagnostics.report(self._time.now()) if self._ready \
            else self._diagnostics.preparing(self._being_compiled())
        if message is not None:
            message.header.stamp = self.get_clock().now().to_msg()
            self._diagnostic.publish(message)

    def _being_compiled(self):
        """Say that there are no kernels yet."""
        verb = 'compiling' if self._kernels.compiles else 'loading or compiling'
        return verb + ' the kernels, nothing moves yet'

    def _warn_of_namesakes(self):
        """Say once that another node has the same name: both would answer."""
        self.destroy_timer(self._namesakes)
        me = self.get_name(), self.get_namespace()
        if self.get_node_names_and_namespaces().count(me) > 1:
            self.get_logger().warning(
                'another node is called %s' % self.get_fully_qualified_name())

    # --- in --------------------------------------------------------------------------------

    def _change(self, name, value):
        """Apply a parameter of the node itself."""
        if name == 'frame_id':
            self._poses.frame_id = value
            self._outputs.use_frame(value, self._time.stamp())
        elif name == 'publish_rate':
            self._use_rate(value)
        elif name == 'max_published_particles':
            self._outputs.use_most(value)
        else:
            self._poses.set_times(self.get_parameter('pose_delay').value,
                                  self.get_parameter('pose_timeout').value)

    def _use_rate(self, rate):
        self._ticks_a_message = ceil(SLOWEST_TICKS / rate)
        self._outputs.messages.use_rate(rate)
        if self._timer is not None:
            self.destroy_timer(self._timer)
        self._timer = self.create_timer(1.0 / (rate * self._ticks_a_message), self._tick)

    def _reset(self, request, response):
        self._poses.take_arrived()
        self._simulation.reset()
        if self._time.resets:
            self._poses.forget()
        self._poses.restart()
        self._time.stand_still()
        self._time.publish()
        self._outputs.clear_contacts(self._time.stamp())
        return _answer(response, True, 'at the start')

    def _pause(self, request, response):
        self._poses.take_arrived()
        if request.data:
            self._poses.hold()
        elif self._paused and self._ready:
            self._poses.release(self._time.now())
        self._paused = self._diagnostics.paused = request.data
        return _answer(response, True, 'paused' if self._paused else 'running')

    def _step(self, request, response):
        """Take one step, in which the colliders move to the newest poses; publish it at once."""
        if not self._ready:
            return _answer(response, False, 'the kernels are still being compiled')
        if not self._paused:
            return _answer(response, False, 'only while paused')
        self._poses.take_arrived()
        moved = self._poses.move_held(self._simulation)
        wanted = self._stepped.record_contacts = self._outputs.contacts_wanted
        self._simulation.step()
        self._diagnostics.steps += 1
        if wanted:
            self._outputs.messages.add_contacts(self._simulation.contacts)
        self._time.stand_still()
        self._time.publish()
        self._outputs.publish(self._time.stamp())
        return _answer(response, True, 'at %.6f s, moved: %s' % (
            self._simulation.time, ' '.join(moved) or 'nothing'))


def _answer(response, success, message):
    response.success = success
    response.message = message
    return response


def run(args, stopped):
    """
    Run the node until `stopped` is not empty.

    Parameters
    ----------
    args : list of str or None
        As of the command line.
    stopped : list
        Filled by somebody else, such as a signal handler. While the scene is being loaded signals
        end that instead.

    Returns
    -------
    status : int
        1 where the scene or a parameter is refused, with one line that says why.

    """
    status, node = 0, None
    try:
        fast_dds.prepare()
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = CollisionSimNode()
        spin(node, stopped)
        if node.failure is not None:
            raise node.failure
    except (ParameterException, RuntimeError, ValueError) as error:
        print('collision_sim_node: %s' % error, file=sys.stderr)
        status = 1
    except KeyboardInterrupt:       # while the scene was being loaded
        pass
    if node is not None:
        node.destroy_node()
    rclpy.try_shutdown()
    return status


if __name__ == '__main__':
    sys.exit(main())
