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


"""Values of parameters as they come, and as they are declared: whole numbers are numbers, too."""

from collision_sim.checks import as_list, join, SceneError
from rclpy.node import Node
from rclpy.parameter import Parameter

KINDS = {
    Parameter.Type.BOOL: 'must be true or false',
    Parameter.Type.INTEGER: 'must be a whole number',
    Parameter.Type.DOUBLE: 'must be a number',
    Parameter.Type.STRING: 'must be a text',
    Parameter.Type.DOUBLE_ARRAY: 'must be a list of numbers',
}
LONGEST_NAME = 80       # characters of an unknown name that are shown


def as_declared(parameter, default):
    """
    Give a parameter in the type of a default, where it differs in how a number is written.

    Parameters
    ----------
    parameter : rclpy.parameter.Parameter
        Lists may be arrays.
    default : object
        What is declared.

    """
    value = as_list(parameter.value)
    kind = Parameter.Type.from_parameter_value(default)
    if kind == Parameter.Type.DOUBLE and parameter.type_ == Parameter.Type.INTEGER:
        value = float(value)
    elif kind == Parameter.Type.DOUBLE_ARRAY and parameter.type_ == Parameter.Type.INTEGER_ARRAY:
        value = [float(number) for number in value]
    elif value is parameter.value:
        return parameter
    return Parameter(parameter.name, value=value)


def as_asked(node, parameter):
    """
    Give a parameter that somebody wants to set in the type that is declared.

    Parameters
    ----------
    node : rclpy.node.Node
        All its parameters are declared.
    parameter : rclpy.parameter.Parameter
        As it was asked for.

    Raises
    ------
    SceneError
        For one that the node does not have, or that is of another type.

    """
    if not node.has_parameter(parameter.name):
        raise SceneError(join('', parameter.name)[:LONGEST_NAME], as_list(parameter.value),
                         'there is no such parameter')
    declared = Node.get_parameter(node, parameter.name)     # as it is, whatever else has come
    parameter = as_declared(parameter, declared.value)
    if parameter.type_ != declared.type_:
        raise SceneError(parameter.name, parameter.value, KINDS[declared.type_])
    return parameter
