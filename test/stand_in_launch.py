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
Stand-ins for `launch`, which comes with an installed ROS only.

They tell what a launch file would start; test_package.py loads the files with the real one where
it is there.
"""

import runpy
import sys
from types import SimpleNamespace
from unittest.mock import patch

STAND_INS = {
    'launch': SimpleNamespace(LaunchDescription=list),
    'launch.actions': SimpleNamespace(
        DeclareLaunchArgument=lambda name, **words: SimpleNamespace(name=name, **words),
        OpaqueFunction=SimpleNamespace, Shutdown=lambda: 'shutdown'),
    'launch_ros': SimpleNamespace(),
    'launch_ros.actions': SimpleNamespace(Node=SimpleNamespace)}


def nodes_of(path, **given):
    """
    Give the nodes that a launch file starts, as SimpleNamespaces of the words of their Node.

    Parameters
    ----------
    path : Path
        The launch file.
    **given
        Launch arguments.

    """
    with patch.dict(sys.modules, STAND_INS):
        sys.modules.pop('collision_sim.ros.launching', None)
        *arguments, nodes = runpy.run_path(str(path))['generate_launch_description']()
    values = {argument.name: argument.default_value for argument in arguments} | given
    assert len(values) == len(arguments), 'unknown arguments'
    for argument in arguments:
        value = values[argument.name]
        assert argument.description and value in getattr(argument, 'choices', [value])
    return nodes.function(SimpleNamespace(launch_configurations=values))
