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

"""What the launch files share: their arguments, and how those reach the nodes."""

from launch.actions import DeclareLaunchArgument, Shutdown
from launch_ros.actions import Node

BOOLEANS = ['true', 'false', 'True', 'False']
LEVELS = ['debug', 'info', 'warn', 'error', 'fatal']


def arguments():
    """Give the arguments that every launch file has."""
    return [
        DeclareLaunchArgument(
            'scene', default_value='',
            description='Path of a scene file, or the name of a shipped scene. Empty: that of '
                        'the params_file, or else demo.'),
        DeclareLaunchArgument(
            'params_file', default_value='',
            description='YAML file of parameters for all nodes; other arguments that are given '
                        'win over it. Empty: none.'),
        DeclareLaunchArgument(
            'namespace', default_value='',
            description='Namespace of all nodes and their topics.'),
        DeclareLaunchArgument(
            'use_sim_time', default_value='', choices=['', *BOOLEANS],
            description='Take the time from /clock. Empty: as in the params_file, or else not.'),
        DeclareLaunchArgument(
            'log_level', default_value='info', choices=LEVELS,
            description='Least severity that the nodes log.'),
    ]


def node(executable, values, **options):
    """
    Give a node of this package with the arguments of the launch.

    Parameters
    ----------
    executable : str
        Of this package.
    values : dict of str
        The launch configurations.
    **options
        Those of launch_ros.actions.Node; `parameters` win over the params_file.

    """
    parameters = [values['params_file']] if values['params_file'] else []
    if values['use_sim_time']:
        parameters.append({'use_sim_time': values['use_sim_time'].lower() == 'true'})
    parameters += options.pop('parameters', [])
    return Node(package='collision_sim', executable=executable, parameters=parameters,
                namespace=values['namespace'], output='screen',
                ros_arguments=['--log-level', values['log_level']], **options)


def simulator(values, parameters=(), **options):
    """Give the simulator of the scene that is asked for; the launch ends when it ends."""
    scene = [{'scene': values['scene']}] if values['scene'] else []
    return node('collision_sim_node', values, parameters=[*scene, *parameters],
                on_exit=Shutdown(), **options)
