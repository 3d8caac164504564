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

"""Simulators that carry one scene together, each with a shard of its particles."""

import time

from collision_sim.ros.launching import arguments, simulator
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction


WAIT = 10.0     # s; for all nodes to be ready


def nodes(context):
    """Give the simulators collision_sim_1, collision_sim_2, ... of this host."""
    values = context.launch_configurations
    shards = values['shards']
    here = values['only'].split(',') if values['only'] else range(1, int(shards) + 1)
    start = float(values['start_time']) if values['start_time'] else time.time() + WAIT
    return [simulator(values, name=f'collision_sim_{k}', parameters=[
        {'shard': f'{k}/{shards}', 'start_time': start}]) for k in here]


def generate_launch_description():
    return LaunchDescription([
        *arguments(),
        DeclareLaunchArgument(
            'shards', default_value='2',
            description='Into how many shards the particles are divided, on all hosts together.'),
        DeclareLaunchArgument(
            'only', default_value='',
            description='Which of the shards to start here, such as 1,2. Empty: all.'),
        DeclareLaunchArgument(
            'start_time', default_value='',
            description='When the first step begins [s on the clock], the same on all hosts; 0: '
                        'each when it is ready. Empty: in 10 s, for which the clock has to be the '
                        'wall clock.'),
        OpaqueFunction(function=nodes),
    ])
