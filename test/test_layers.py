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

"""Who may import whom: ros, cli and studies -> simulation -> core, and ROS in one folder only."""

import ast
from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'collision_sim'
MODULES = sorted(PACKAGE.rglob('*.py'))
ROS = re.compile(r'(rclpy|launch\w*|(rosidl|ament|rosbag2)_\w+|\w+_(msgs|srvs|interfaces))\b')
UPPER = re.compile(r'collision_sim\.(ros|studies|cli|recording|viewer)\b')


def folder(path):
    """First folder below the package, or '' for a module at its top."""
    parts = path.relative_to(PACKAGE).parts
    return parts[0] if len(parts) > 1 else ''


def imports(path):
    """Dotted names that a module imports, anywhere in it; `from a import b` counts as a.b too."""
    package = path.relative_to(ROOT).parts[:-1]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[:len(package) - node.level + 1] if node.level else ()
            origin = '.'.join([*above, *([node.module] if node.module else [])])
            yield origin
            yield from (f'{origin}.{alias.name}' for alias in node.names)


def offences(paths, forbidden):
    """List `module: name` for each import of a name that `forbidden` matches."""
    return [f'{path.relative_to(ROOT)}: {name}'
            for path in paths for name in imports(path) if forbidden.match(name)]


def test_importing_the_package_loads_no_ros_and_no_plots():
    listing = subprocess.run(
        [sys.executable, '-c', 'from collision_sim import Simulation; import sys; '
         'print(*sys.modules, sep="\\n")'],
        cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    assert 'collision_sim.simulation' in listing
    unwanted = re.compile(ROS.pattern + r'|(matplotlib|viser|collision_sim\.ros)\b')
    assert [name for name in listing if unwanted.match(name)] == []


def test_only_ros_and_launch_import_ros():
    others = [path for path in MODULES if folder(path) not in ('ros', 'launch')]
    assert offences(others, ROS) == []


def test_only_ros_and_launch_import_the_ros_folder():
    """But for what of it needs no ROS, which recordings use."""
    others = [path for path in MODULES if folder(path) not in ('ros', 'launch')]
    without = r'(?!\.(messages|pose_streams|state_messages)\b)'
    assert offences(others, re.compile(rf'collision_sim\.ros{without}\b')) == []


def test_recordings_need_no_ros():
    listing = subprocess.run(
        [sys.executable, '-c', 'import collision_sim.recording, sys; print(*sys.modules)'],
        cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    assert 'collision_sim.ros.messages' in listing
    assert [name for name in listing if ROS.match(name) or name.startswith('rosbags')] == []


def test_core_imports_nothing_above_it():
    core = [path for path in MODULES if folder(path) == 'core']
    assert core
    above = re.compile(r'collision_sim($|\.(scene|simulation|Scene|Simulation|load_scene)\b)')
    assert offences(core, above) + offences(core, UPPER) == []


@pytest.mark.parametrize('name', ['__init__', 'scene', 'simulation'])
def test_the_library_imports_nothing_above_it(name):
    assert offences([PACKAGE / f'{name}.py'], UPPER) == []
