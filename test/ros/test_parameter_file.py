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

"""The shipped file of all parameters, and what `ros2 param describe` tells of each of them."""

from pathlib import Path
import re
import subprocess
import sys

import collision_sim
import pytest
import yaml

pytest.importorskip('rclpy', reason='needs rclpy')

from collision_sim.ros.parameter_file import parameter_file  # noqa: E402, I100
from collision_sim.ros.parameters import descriptor, FIXED_PARAMETERS  # noqa: E402
from collision_sim.ros.parameters import NODE_PARAMETERS  # noqa: E402
from rcl_interfaces.srv import DescribeParameters, ListParameters  # noqa: E402
from rcl_interfaces.srv import SetParameters  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402

SHIPPED = Path(collision_sim.__file__).parent / 'config' / 'parameters.yaml'
OF_RCLPY = re.compile(r'use_sim_time|start_type_description_service|qos_overrides\.')
UNITS = {'-', 'Hz', 's', 'm/s', 'm/s^2', '1/s', '1/m', 's/m', 'N/m', 'N s/m', 'm'}
EVERYTHING = {
    'drag': {'linear': 0.1, 'quadratic': 0.1, 'wind': [1, 0, 0]},
    'particles': {'position': [[0, 0, 1], [0, 0, 2]], 'radius': 0.1},
    'friction': {'dry': {'static': 0.4, 'kinetic': 0.3}, 'wet': 0.2},
    'pairs': {'restitution': 0.5, 'friction': {'dry': 0.1}},
    'springs': {'pairs': [[0, 1]], 'stiffness': 1.0, 'damping': 0.1},
    'colliders': [{'name': 'ground', 'shape': 'plane', 'restitution': 0.9,
                   'friction': {'wet': {'coefficient': 0.2, 'form': 'linear'}}}],
}


def described(driver):
    """Descriptors of all parameters that are not those of every node of rclpy, by name."""
    names = driver.call(ListParameters, '/collision_sim/list_parameters',
                        ListParameters.Request()).result.names
    names = [name for name in names if not OF_RCLPY.match(name)]
    found = driver.call(DescribeParameters, '/collision_sim/describe_parameters',
                        DescribeParameters.Request(names=names)).descriptors
    return dict(zip(names, found))


def values(text):
    return yaml.safe_load(text)['/**']['ros__parameters']


def comments(text):
    """Give the comment above each value, by its name."""
    return {name: ' '.join(re.sub(r'^ *# ', '', line) for line in comment.splitlines())
            for comment, name in re.findall(r'((?:    # .*\n)+)    (?:# )?([\w.]+): .*\n', text)}


def test_the_shipped_file_is_up_to_date():
    assert SHIPPED.read_text() == parameter_file('demo'), (
        'write it anew by: python3 -m collision_sim.ros.parameter_file '
        '> collision_sim/config/parameters.yaml')


def test_the_shipped_file_has_every_parameter_and_what_it_means(drive):
    """Values are those that are declared, and the comments say what the descriptors say."""
    driver, text = drive(), SHIPPED.read_text()
    told, meaning = described(driver), comments(text)
    given = values(re.sub('# (?=[a-z.]+: )', '', text))
    followers = given.keys() - values(text).keys()
    assert followers == {name for name in told if driver.simulation.scene.follows(name)}
    assert {'colliders.ground.restitution', 'colliders.paddle.friction.dry'} <= followers
    assert given.keys() == meaning.keys() == told.keys()
    for name, saying in told.items():
        declared = driver.node.get_parameter(name).value
        assert given[name] == (declared.tolist() if hasattr(declared, 'tolist') else declared)
        assert saying.description in meaning[name]
        assert ('read-only' in meaning[name]) == saying.read_only
        for limits in (*saying.floating_point_range, *saying.integer_range):
            bounds = re.findall(r'; ([^; ]+) to ([^; ]+)', meaning[name])[0]
            assert [float(bound) for bound in bounds] == [limits.from_value, limits.to_value]
        assert saying.additional_constraints in meaning[name]


def test_a_file_of_parameters_is_taken(drive, tmp_path):
    """Unchanged it changes nothing; lines that are changed are taken, others may be left out."""
    driver = drive(node_options={'cli_args': ['--ros-args', '--params-file', str(SHIPPED)]})
    assert driver.simulation.scene.colliders == collision_sim.load_scene('demo').colliders
    assert driver.simulation.scene.parameters() == \
        collision_sim.load_scene('demo').parameters()
    path = tmp_path / 'my.yaml'
    path.write_text(SHIPPED.read_text().replace('restitution: 0.5', 'restitution: 0.75')
                    .replace('# colliders.walls.restitution: 0.75',
                             'colliders.walls.restitution: 0.5'))
    driver = drive(node_options={'cli_args': ['--ros-args', '--params-file', str(path)]})
    found = driver.simulation.scene.parameters()
    assert found['restitution'].value == 0.75
    assert found['colliders.walls.restitution'].value == 0.5
    assert found['colliders.ground.restitution'].value == 0.75
    assert found['colliders.ball.restitution'].value == 0.8


def dump(driver):
    """Give what `ros2 param dump` writes: all values, by the names in order."""
    return {name: driver.node.get_parameter(name) for name in sorted(driver.node._parameters)}


def load(driver, parameters):
    """Do as `ros2 param load`: one request with all values; those that are fixed are refused."""
    request = SetParameters.Request(parameters=[
        parameter.to_parameter_msg() for parameter in parameters.values()])
    results = driver.call(SetParameters, '/collision_sim/set_parameters', request).results
    return {name for name, result in zip(parameters, results) if not result.successful}


def test_what_was_dumped_keeps_who_follows_the_scene(drive, tmp_path):
    """Loaded into the same node, after changes, and given at the start of another."""
    driver = drive()
    dumped, scene = dump(driver), driver.simulation.scene
    assert load(driver, dumped) == {name for name in dumped if driver.node.describe_parameter(
        name).read_only}
    assert driver.simulation.scene.colliders == scene.colliders
    for changes in ({'restitution': 0.25}, {'colliders.ground.restitution': 0.1},
                    {'colliders.ground.restitution': 0.1, 'restitution': 0.25}):
        load(driver, {name: Parameter(name, value=value) for name, value in changes.items()})
        load(driver, dumped)
        assert driver.simulation.scene.colliders == scene.colliders, changes
    path = tmp_path / 'dumped.yaml'
    path.write_text(yaml.safe_dump({'/**': {'ros__parameters': {
        name: parameter.value for name, parameter in dumped.items()
        if not OF_RCLPY.match(name)}}}))
    driver = drive(node_options={'cli_args': ['--ros-args', '--params-file', str(path)]})
    assert driver.simulation.scene.colliders == scene.colliders
    load(driver, {'restitution': Parameter('restitution', value=0.75)})
    assert driver.node.get_parameter('colliders.ground.restitution').value == 0.75
    assert driver.node.get_parameter('colliders.ball.restitution').value == 0.8


def test_the_file_of_another_scene():
    """By the documented command; a scene that is not there is one line."""
    command = [sys.executable, '-m', 'collision_sim.ros.parameter_file']
    printed = subprocess.run([*command, 'rain'], capture_output=True, text=True, check=True).stdout
    assert values(printed)['scene'] == 'rain' and 'stepping.iterations' in values(printed)
    failed = subprocess.run([*command, 'nowhere'], capture_output=True, text=True)
    assert failed.returncode == 1 and 'Traceback' not in failed.stderr


def test_descriptions_are_useful():
    """Each says what it means; numbers have a unit and a range, vectors a constraint."""
    scene = collision_sim.Scene.from_dict(EVERYTHING).parameters()
    assert {'drag.wind', 'pairs.restitution', 'springs.stiffness',
            'colliders.ground.friction.wet'} <= scene.keys()
    for name, parameter in (FIXED_PARAMETERS | NODE_PARAMETERS | scene).items():
        told = descriptor(parameter)
        assert len(told.description.split()) >= 2, name
        unit = re.search(r' \[([^]]*)\]$', told.description)
        if type(parameter.value) in (int, float):
            assert (told.floating_point_range or told.integer_range
                    or told.additional_constraints == '0 or more'), name
            assert all(limits.to_value <= 1e10 for limits in told.floating_point_range), name
        elif type(parameter.value) is tuple:
            assert told.additional_constraints == 'three finite numbers', name
        else:
            assert unit is None, name
            continue
        assert unit and unit[1] in UNITS, name
