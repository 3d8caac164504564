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
A new value is checked by the scene when it is asked for (on_set) and kept when it is accepted
(post_set). All that came since the last tick the simulation adopts at once, between two steps.
"""

from collections import Counter
from functools import partial
import warnings

from collision_sim.checks import Number, SceneWarning, Text
from collision_sim.particles import read_shard
from collision_sim.ros.rare_warnings import RareWarnings
from collision_sim.ros.start import interruptible
from collision_sim.ros.values import as_asked
from collision_sim.scene import load_scene, Parameter, SceneError
from geometry_msgs.msg import Vector3
from rcl_interfaces.msg import FloatingPointRange, IntegerRange
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.node import Node
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
FRAME = Text(r'[^\x00-\x1f\x7f]{1,255}', 'must be 1 to 255 characters on one line')
ACCEPTED = SetParametersResult(successful=True)


def descriptor(parameter, read_only=False):
    """ROS descriptor of a parameter: range, and unit and meaning in words."""
    value, unit, low, high, meaning = parameter
    result = ParameterDescriptor(read_only=read_only)
    result.description = meaning
    if type(value) in (int, float, tuple):
        result.description += ' [%s]' % (unit or '-')
    if type(value) is tuple:
        result.additional_constraints = 'three finite numbers'
    elif None not in (low, high) and type(value) is int:
        result.integer_range = [IntegerRange(from_value=low, to_value=high)]
    elif None not in (low, high) and type(value) is float:
        result.floating_point_range = [FloatingPointRange(
            from_value=float(low), to_value=float(high))]
    elif low is not None:       # a range that ends nowhere is no use to a slider
        result.additional_constraints = '%g or more' % low
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
    FRAME.read(node.get_parameter('frame_id').value, 'frame_id')
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


def _check_clock(use_sim_time):
    if use_sim_time:
        raise SceneError('use_sim_time', True, 'must be false with publish_clock: a node cannot '
                                               'be the clock and follow one')


class LiveParameters:
    """
    Keeps parameters and simulation equal, whoever sets a value: a service, a topic or the node.

    Parameters
    ----------
    node : SturdyNode
        All parameters are declared.
    scene : Scene
        With the values that they have.
    adopt : callable
        Called with a Scene that the simulation is to have.
    node_changed : callable
        Called with name and value after a parameter of the node itself has changed.

    """

    def __init__(self, node, scene, adopt, node_changed):
        """Subscribe to the parameter topics and take part in every change of a parameter."""
        self._node = node
        self._adopt, self._node_changed = adopt, node_changed
        self._warn = RareWarnings(node)
        self.refused = Counter()    # values from topics, by name
        self._publishes_clock = node.get_parameter('publish_clock').value
        self._known = scene.parameters().keys()
        self._live = NODE_PARAMETERS.keys() | self._known
        self._scene = self._shown = self._adopted = scene   # accepted; as ROS has it; in steps
        self._arrived = {}          # parameters from topics, by name, that wait for the next tick,
        self._ahead = scene         # and the scene with their values
        self._setting = False       # parameters are being set to what has been checked
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._accept)
        self.topics = [self._subscribe(name, parameter.value) for name, parameter
                       in (NODE_PARAMETERS | scene.parameters()).items()]

    # --- changes ---------------------------------------------------------------------------

    def adopt(self):
        """Let the simulation have all that has come."""
        self._take_arrived()
        self._follow()
        if self._adopted is not self._scene:
            self._adopt(self._scene)
            self._adopted = self._scene

    def set_each(self, parameters):
        """
        Set parameters in their order, those that can be, with a single adoption and event.

        Parameters
        ----------
        parameters : list of rclpy.parameter.Parameter
            As they were asked for.

        Returns
        -------
        results : list of rcl_interfaces.msg.SetParametersResult

        """
        self._take_arrived()
        results, accepted, scene = [], {}, self._scene
        for parameter in parameters:
            try:
                if parameter.name not in self._live:
                    results.append(self._node.set_parameters_atomically([parameter]))
                    continue
                parameter = as_asked(self._node, parameter)
                scene = self._checked(scene, [parameter])
                accepted[parameter.name] = parameter
                results.append(ACCEPTED)
            except Exception as error:
                results.append(SetParametersResult(successful=False, reason=str(error)))
        self._set(list(accepted.values()), scene)
        return results

    def _set(self, parameters, scene):
        """Set what has been checked, and what scene that makes."""
        if not parameters:
            return
        self._setting, self._scene = True, scene
        try:
            self._node.set_parameters_atomically(parameters)
        finally:
            self._setting = False

    def _check(self, parameters):
        """Accept the values together or refuse them with the reason; never raise."""
        if not self._setting:
            self._take_arrived()        # which came before
            try:
                self._checked(self._scene, parameters)
            except Exception as error:
                return SetParametersResult(successful=False, reason=str(error))
        return ACCEPTED

    def _checked(self, scene, parameters):
        """Give a scene with values, or raise the SceneError of one that is not allowed."""
        changes = []
        for name, value in ((parameter.name, parameter.value) for parameter in parameters):
            if name == 'frame_id':
                FRAME.read(value, name)
            elif name in NODE_PARAMETERS:
                default, unit, low, high, meaning = NODE_PARAMETERS[name]
                Number(unit, meaning, low, high, whole=type(default) is int).read(value, name)
            elif name == 'use_sim_time' and self._publishes_clock:
                _check_clock(value)
            elif name in self._known:
                changes.append((name, value))
        return scene.with_parameters(changes)

    def _accept(self, parameters):
        if not self._setting:
            self._scene = self._checked(self._scene, parameters)
        for parameter in parameters:
            if parameter.name in NODE_PARAMETERS:
                self._node_changed(parameter.name, parameter.value)

    def _follow(self):
        """Show what else has changed: the colliders that take a default of the scene."""
        if self._shown is self._scene:
            return
        self._shown = self._scene
        changed = [
            rclpy.parameter.Parameter(path, value=ros_value(parameter.value))
            for path, parameter in self._scene.parameters().items()
            if self._node.has_parameter(path)
            and not _same(Node.get_parameter(self._node, path).value, ros_value(parameter.value))]
        self._set(changed, self._scene)

    # --- topics ----------------------------------------------------------------------------

    def _subscribe(self, name, value):
        kind = type(value)
        topic = '~/set/' + name.replace('.', '/')
        subscription = self._node.create_subscription(
            TOPIC_TYPES[kind], topic, partial(self._take, name, kind), 10)
        return subscription.topic_name

    def _take(self, name, kind, message):
        """Check a value, and keep it for the next tick."""
        if kind is tuple:
            value = [message.x, message.y, message.z]
        elif kind is int and message.data.is_integer():
            value = int(message.data)
        else:
            value = message.data
        try:
            parameter = as_asked(self._node, rclpy.parameter.Parameter(name, value=value))
            self._ahead = self._checked(self._ahead if self._arrived else self._scene, [parameter])
            self._arrived[name] = parameter
        except Exception as error:
            self.refused[name] += 1
            self._warn(name, '%s refused: %s (%d so far)' % (name, error, self.refused[name]))

    def _take_arrived(self):
        """Set the parameters that came from topics, each to the last value of its own."""
        if self._arrived:
            arrived, self._arrived = list(self._arrived.values()), {}
            self._set(arrived, self._ahead)
