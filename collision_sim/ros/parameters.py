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
ROS parameters <-> scene values, and the topics that set parameters.

Every value of the scene that may change while it runs is a parameter under its path in the scene.
A new value is checked by the scene when it is asked for (on_set) and applied when it is accepted
(post_set). One executor thread runs both and the ticks, so that applying falls between two steps.
"""

from collections import Counter
from functools import partial
import sys
import warnings

from collision_sim.checks import SceneWarning
from collision_sim.particles import read_shard
from collision_sim.ros.rare_warnings import RareWarnings
from collision_sim.ros.start import interruptible
from collision_sim.scene import load_scene, Parameter, SceneError
from geometry_msgs.msg import Vector3
from rcl_interfaces.msg import FloatingPointRange, IntegerRange
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
import rclpy.parameter
from std_msgs.msg import Bool, Float64, String

FIXED_PARAMETERS = {        # read-only
    'scene': Parameter('demo', '', None, None, 'Path of a YAML file, or name of a shipped scene'),
    'shard': Parameter('', '', None, None, 'k/n: only the k-th of n slices of the particles, k '
                                           'from 1 to n; empty: all of them'),
    'publish_clock': Parameter(False, '', None, None, 'Whether the simulated time is published on '
                                                      '/clock, for nodes with use_sim_time'),
    'start_time': Parameter(0.0, 's', 0.0, 1e10, 'When the first step begins, on the clock of the '
                                                 'node, where several begin together; at once if '
                                                 'that is past'),
    'ledger': Parameter(False, '', None, None, 'Whether accounts of energy are kept, and their '
                                               'residual is in the diagnostics'),
    'viewer': Parameter(False, '', None, None, 'Whether a page in the browser shows the scene'),
    'viewer_port': Parameter(8080, '', 0, 65535, 'Port of that page on 127.0.0.1; 0: a free one'),
}
NODE_PARAMETERS = {
    'frame_id': Parameter('world', '', None, None, 'Frame of all poses, in and out'),
    'publish_rate': Parameter(60.0, 'Hz', 0.1, 1000.0, 'Rate of the messages'),
    'max_published_particles': Parameter(100_000, '', 1, 10 ** 9, 'Most particles in ~/particles; '
                                         'of more, evenly as many'),
    'pose_delay': Parameter(0.1, 's', 0.0, 10.0, 'How late poses are played back: two periods of '
                                                 'the poses and their jitter'),
    'pose_timeout': Parameter(0.5, 's', 0.0, 60.0, 'How long a collider without new poses keeps '
                                                   'its last twist before it stands still'),
}
TOPIC_TYPES = {bool: Bool, int: Float64, float: Float64, str: String, tuple: Vector3}
LARGEST = {int: 2 ** 63 - 1, float: sys.float_info.max}


def descriptor(parameter, read_only=False):
    """ROS descriptor of a parameter: range, and unit and meaning in words."""
    value, unit, low, high, meaning = parameter
    result = ParameterDescriptor(read_only=read_only)
    result.description = meaning
    if type(value) in (int, float, tuple):
        result.description += ' [%s]' % (unit or '-')
    if type(value) is tuple:
        result.additional_constraints = 'three finite numbers'
    elif type(value) in LARGEST and (low, high) != (None, None):
        kind = type(value)
        bounds = {'from_value': -LARGEST[kind] if low is None else kind(low),
                  'to_value': LARGEST[kind] if high is None else kind(high)}
        if kind is int:
            result.integer_range = [IntegerRange(**bounds)]
        else:
            result.floating_point_range = [FloatingPointRange(**bounds)]
    return result


def ros_value(value):
    """Give a value as ROS holds it: vectors are lists of floats."""
    return [float(x) for x in value] if type(value) is tuple else value


def declare_fixed(node):
    """
    Declare the parameters that are fixed at the start.

    Returns
    -------
    scene : Scene
        Or its shard.
    name : str
        What it is called.
    publish_clock : bool
        Whether the node is the clock of the graph.
    start : float [s]
        On the clock of the node.

    Raises
    ------
    SceneError
        Where one cannot be, or for a node that is to follow a clock as well; rclpy raises its own
        errors for wrong types.

    """
    name, shard, publish_clock, start, *_ = (
        node.declare_parameter(key, parameter.value, descriptor(parameter, True)).value
        for key, parameter in FIXED_PARAMETERS.items())
    if publish_clock:
        _check_clock(node.get_parameter('use_sim_time').value)
        if start:
            raise SceneError('start_time', start, 'must be 0 with publish_clock')
    scene = _loaded(node, name)
    if shard:
        scene, name = scene.shard(*read_shard(shard)), '%s, shard %s' % (name, shard)
    return scene, name, publish_clock, start


def _loaded(node, name):
    """Load a scene; log what is warned of, and let a signal end it."""
    with warnings.catch_warnings(record=True) as found, interruptible():
        warnings.simplefilter('always', SceneWarning)
        scene = load_scene(name)
    for warning in found:
        node.get_logger().warning(str(warning.message))
    return scene


def declare_values(node, scene):
    """
    Declare the parameters of the node and the scene.

    Returns
    -------
    scene : Scene
        With the values that were given at the start.

    Raises
    ------
    SceneError
        For a value that the scene refuses; rclpy raises its own errors for wrong types and ranges.

    """
    for name, parameter in NODE_PARAMETERS.items():
        node.declare_parameter(name, parameter.value, descriptor(parameter))
    _check_frame(node.get_parameter('frame_id').value)
    together = []       # what holds only with values that are still to come
    for path in scene.parameters():
        parameter = scene.parameters()[path]
        default = ros_value(parameter.value)
        value = node.declare_parameter(path, default, descriptor(parameter)).value
        if not _same(value, default):
            try:
                scene = scene.with_parameter(path, value)
            except SceneError:
                together.append((path, value))
    return scene.with_parameters(together)


def warn_of_unknown(node):
    """Log which parameters were given at the start that the node, all declared, does not have."""
    unknown = [name for name in node._parameter_overrides if not node.has_parameter(name)]
    if unknown:
        node.get_logger().warning('no such parameters: %s' % ', '.join(sorted(unknown)))


def _same(value, other):
    return list(value) == list(other) if isinstance(other, list) else value == other


def _check_frame(frame_id):
    if not frame_id:
        raise SceneError('frame_id', frame_id, 'must not be empty')


def _check_clock(use_sim_time):
    if use_sim_time:
        raise SceneError('use_sim_time', True, 'must be false with publish_clock: a node cannot '
                                               'be the clock and follow one')


class LiveParameters:
    """
    Keeps parameters and simulation equal, whoever sets a value: a service, a topic or the node.

    Parameters
    ----------
    node : rclpy.node.Node
        All parameters are declared.
    simulation : Simulation
    node_changed : callable
        Called with name and value after a parameter of the node itself has changed.

    """

    def __init__(self, node, simulation, node_changed):
        """Subscribe to the parameter topics and take part in every change of a parameter."""
        self._node = node
        self._simulation = simulation
        self._node_changed = node_changed
        self._warn = RareWarnings(node)
        self.refused = Counter()    # values from topics, by name
        self._publishes_clock = node.get_parameter('publish_clock').value
        self._following = False     # parameters are being set to what the simulation has already
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)
        self.topics = [self._subscribe(name, parameter.value) for name, parameter
                       in (NODE_PARAMETERS | simulation.scene.parameters()).items()]

    def _subscribe(self, name, value):
        kind = type(value)
        topic = '~/set/' + name.replace('.', '/')
        subscription = self._node.create_subscription(
            TOPIC_TYPES[kind], topic, partial(self._take, name, kind), 10)
        return subscription.topic_name

    def _take(self, name, kind, message):
        """Set a parameter from a topic, by the same way as the services."""
        if kind is tuple:
            value = [message.x, message.y, message.z]
        elif kind is int and message.data.is_integer():
            value = int(message.data)
        else:
            value = message.data
        try:
            result = self._node.set_parameters([rclpy.parameter.Parameter(name, value=value)])[0]
            refusal = '' if result.successful else result.reason
        except Exception as error:
            refusal = str(error)
        if refusal:
            self.refused[name] += 1
            self._warn(name, '%s refused: %s (%d so far)' % (name, refusal, self.refused[name]))

    def _check(self, parameters):
        """Accept the values together or refuse them with the reason; never raise."""
        try:
            for parameter in parameters:
                if not self._node.has_parameter(parameter.name):
                    raise SceneError(parameter.name, parameter.value, 'no such parameter')
                if parameter.name == 'frame_id':
                    _check_frame(parameter.value)
                elif parameter.name == 'use_sim_time' and self._publishes_clock:
                    _check_clock(parameter.value)
            self._simulation.scene.with_parameters(self._changes(parameters))
        except Exception as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _changes(self, parameters):
        """Paths and values of those parameters that are values of the scene."""
        known = self._simulation.scene.parameters()
        return [(parameter.name, parameter.value) for parameter in parameters
                if parameter.name in known]

    def _apply(self, parameters):
        if self._following:
            return
        changes = self._changes(parameters)
        if changes:
            self._simulation.set_parameters(changes)
        for parameter in parameters:
            if parameter.name in NODE_PARAMETERS:
                self._node_changed(parameter.name, parameter.value)
        self._follow()

    def _follow(self):
        """Show what else has changed: the colliders that take a default of the scene."""
        changed = [
            rclpy.parameter.Parameter(path, value=ros_value(parameter.value))
            for path, parameter in self._simulation.scene.parameters().items()
            if self._node.has_parameter(path)
            and not _same(self._node.get_parameter(path).value, ros_value(parameter.value))]
        self._following = True
        try:
            self._node.set_parameters(changed)
        finally:
            self._following = False
