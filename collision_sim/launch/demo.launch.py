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

from pathlib import Path

from collision_sim.ros.launching import arguments, BOOLEANS, node, simulator
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node

RVIZ = Path(__file__).resolve().parents[1] / 'rviz' / 'collision_sim.rviz'
SHOWN = ['cloud', 'colliders', 'contacts', 'particles']     # topics in that file


def nodes(context):
    """Give the nodes, with the arguments filled in."""
    values = context.launch_configurations
    viewer = [{'viewer': values['viewer'].lower() == 'true'}] if values['viewer'] else []
    found = [simulator(values, viewer), node('swing_paddle', values)]
    if values['rviz'].lower() == 'true':
        found.append(Node(package='rviz2', executable='rviz2', output='screen',
                          arguments=['-d', str(RVIZ)], namespace=values['namespace'],
                          remappings=[(f'/collision_sim/{topic}', f'collision_sim/{topic}')
                                      for topic in SHOWN]))
    return found


def generate_launch_description():
    return LaunchDescription([
        *arguments(),
        DeclareLaunchArgument(
            'viewer', default_value='', choices=['', *BOOLEANS],
            description='Show the simulation in the browser, on a page whose address is logged; '
                        'needs viser. Empty: as in the params_file, or else not.'),
        DeclareLaunchArgument(
            'rviz', default_value='false', choices=BOOLEANS,
            description='Show the simulation in RViz, which has to be installed.'),
        OpaqueFunction(function=nodes)])
