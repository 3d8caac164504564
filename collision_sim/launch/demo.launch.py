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

"""The simulator with a scene whose paddle another node swings."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch_ros.actions import Node

BOOLEANS = ['true', 'false', 'True', 'False']
LEVELS = ['debug', 'info', 'warn', 'error', 'fatal']


def nodes(context):
    """Both nodes, with the arguments filled in."""
    values = context.launch_configurations
    use_sim_time = {'use_sim_time': values['use_sim_time'].lower() == 'true'}
    parameters = [{'scene': values['scene']}, use_sim_time]
    if values['params_file']:
        parameters.append(values['params_file'])  # last, so that its values win
    common = {
        'package': 'collision_sim',
        'namespace': values['namespace'],
        'ros_arguments': ['--log-level', values['log_level']],
        'output': 'screen',
    }
    return [
        Node(executable='collision_sim_node', parameters=parameters, on_exit=Shutdown(), **common),
        Node(executable='swing_paddle', parameters=[use_sim_time], **common),
    ]


def generate_launch_description():
    return LaunchDescription([
        DeclareLaunchArgument(
            'scene', default_value='demo',
            description='Path of a scene file, or the name of a shipped scene.'),
        DeclareLaunchArgument(
            'params_file', default_value='',
            description='YAML file of parameters for the simulator; its values win over '
                        'the arguments here. Empty: none.'),
        DeclareLaunchArgument(
            'namespace', default_value='',
            description='Namespace of both nodes and their topics.'),
        DeclareLaunchArgument(
            'use_sim_time', default_value='false', choices=BOOLEANS,
            description='Take the time from /clock.'),
        DeclareLaunchArgument(
            'log_level', default_value='info', choices=LEVELS,
            description='Least severity that both nodes log.'),
        OpaqueFunction(function=nodes),
    ])
