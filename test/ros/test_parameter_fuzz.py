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

"""Check 3 of ten, parameters: bad values of all kinds, for all, by services and topics."""

from math import inf, nan

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from geometry_msgs.msg import Vector3  # noqa: E402, I100
from rcl_interfaces.msg import Parameter as ParameterMessage, ParameterValue  # noqa: E402
from rcl_interfaces.srv import SetParameters, SetParametersAtomically  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from std_msgs.msg import Float64, String  # noqa: E402

NODE = '/collision_sim'
SCENE = {
    'drag': {'linear': 0.1},
    'particles': {'position': [[0, 0, 1], [0, 0, 2]], 'radius': 0.1},
    'restitution': 0.5,
    'friction': {'dry': {'static': 0.4, 'kinetic': 0.3}},
    'pairs': {'restitution': 0.9, 'friction': {'dry': 0.1}},
    'springs': {'pairs': [[0, 1]], 'stiffness': 100.0, 'damping': 0.1},
    'colliders': [{'name': 'ground', 'shape': 'plane'},
                  {'name': 'wall', 'shape': 'plane', 'normal': [1, 0, 0], 'point': [-9, 0, 0],
                   'restitution': 0.9, 'friction': {'wet': 0.2}, 'topic': 'wall/pose'}],
}
OF_ALL_TYPES = [True, 1, 0.25, 'x', b'x', [True], [1], [0.25], ['x'], [b'x']]
GOOD = [('restitution', 0.25), ('gravity', [0.0, 0.0, -1.0])]


def changeable(driver):
    """Names of the parameters that are not fixed at the start."""
    return [name for name in driver.node._parameters
            if not driver.node.describe_parameter(name).read_only]


def message(name, value):
    if isinstance(value, ParameterValue):
        return ParameterMessage(name=name, value=value)
    return Parameter(name, value=[value] if isinstance(value, bytes) else value).to_parameter_msg()


def bad_values(driver, name):
    """Values of wrong types, of no type, not finite, out of range, of wrong length."""
    value, descriptor = driver.node.get_parameter(name).value, driver.node.describe_parameter(name)
    vector = not isinstance(value, (bool, int, float, str))
    yield from (ParameterValue(type=kind) for kind in (0, 10, 200, 255))
    yield from (other for other in OF_ALL_TYPES if type(other) is not type(value) and not (
        vector and isinstance(other, list) and isinstance(other[0], float)) and not (
        type(value) is float and type(other) is int))      # a whole number is a number
    if isinstance(value, float):
        yield from (nan, inf, -inf)
    if vector:
        yield from ([], [1.0], [1.0, 2.0], 4 * [1.0], [nan, 0.0, 0.0], [0.0, inf, 0.0])
    if name == 'frame_id':
        yield ''
    if descriptor.additional_constraints == '0 or more':
        yield from (-1e-3, -1e300)
    for limits in descriptor.floating_point_range:
        yield from (limits.from_value - 1e-3, -1e300)
        if limits.to_value < 1e300:
            yield from (limits.to_value * 1.001, 1e300)
    for limits in descriptor.integer_range:
        yield from (limits.from_value - 1, -2 ** 63, limits.to_value + 1, 2 ** 63 - 1)


def cases(driver):
    """All bad pairs of name and value."""
    names = list(driver.node._parameters)
    assert len(names) > 20
    for name in names:
        if name in changeable(driver):
            yield from ((name, value) for value in bad_values(driver, name))
        else:
            yield name, driver.node.get_parameter(name).value
    for name in ('', 'nothing', 'Restitution', 'restitution.', 'colliders.nobody.restitution',
                 'x' * 10_000, 'colliders', '\u2207'):
        yield name, 0.5


def snapshot(driver):
    values = {name: parameter.value for name, parameter in driver.node._parameters.items()}
    return {name: list(value) if hasattr(value, 'tolist') else value
            for name, value in values.items()}


def set_each(driver, *pairs):
    request = SetParameters.Request(parameters=[message(*pair) for pair in pairs])
    return driver.call(SetParameters, NODE + '/set_parameters', request).results


def set_together(driver, *pairs):
    request = SetParametersAtomically.Request(parameters=[message(*pair) for pair in pairs])
    return driver.call(
        SetParametersAtomically, NODE + '/set_parameters_atomically', request).result


def test_one_by_one_only_good_values_change_anything(drive):
    driver = drive(SCENE)
    before, scene = snapshot(driver), driver.simulation.scene
    bad = list(cases(driver))
    assert len(bad) > 400
    results = set_each(driver, *bad)
    assert [(pair, result) for pair, result in zip(bad, results, strict=True)
            if result.successful or not result.reason] == []
    assert snapshot(driver) == before and driver.simulation.scene is scene
    mixed = [GOOD[0], bad[0], ('restitution', ParameterValue(type=200)), bad[-1], GOOD[1]]
    results = set_each(driver, *mixed)
    assert [result.successful for result in results] == [True, False, False, False, True]
    assert driver.simulation.scene.restitution == 0.25
    assert driver.simulation.scene.gravity == (0.0, 0.0, -1.0)


def test_together_it_is_all_or_nothing(drive):
    driver = drive(SCENE)
    before, scene = snapshot(driver), driver.simulation.scene
    for pair in cases(driver):
        for pairs in ([pair], [*GOOD, pair], [pair, *GOOD]):
            result = set_together(driver, *pairs)
            assert not result.successful and result.reason, pair
    assert snapshot(driver) == before and driver.simulation.scene is scene
    assert set_together(driver, *GOOD).successful
    assert driver.simulation.scene.restitution == 0.25
    assert driver.node.get_parameter('colliders.ground.restitution').value == 0.25


@pytest.mark.parametrize('order', [1, -1])
def test_values_that_hold_only_together_may_come_in_any_order(drive, order):
    driver = drive(SCENE)
    pairs = [('friction.dry.static', 0.1), ('friction.dry.kinetic', 0.05)]
    assert not set_each(driver, pairs[0])[0].successful
    assert set_together(driver, *pairs[::order]).successful
    assert driver.simulation.scene.friction_of(driver.simulation.scene.colliders[0]) == (
        driver.simulation.scene.friction)
    assert driver.node.get_parameter('colliders.ground.friction.dry.kinetic').value == 0.05
    higher = [('friction.dry.static', 0.9), ('friction.dry.kinetic', 0.8)]
    assert set_together(driver, *higher[::order]).successful
    assert not set_together(driver, *pairs, ('friction.dry.static', 0.01)).successful
    assert driver.node.get_parameter('friction.dry.static').value == 0.9


def test_of_a_name_that_comes_twice_the_last_value_counts(drive):
    driver = drive(SCENE)
    assert set_together(driver, ('restitution', 0.1), ('restitution', 0.2)).successful
    assert driver.simulation.scene.restitution == 0.2
    assert not set_together(driver, ('restitution', nan), ('restitution', 0.3)).successful
    assert not set_together(driver, ('gravity', [nan, 0.0, 0.0]), GOOD[1]).successful
    assert driver.node.get_parameter('restitution').value == 0.2


def bad_messages(driver, name):
    """Messages of the right type, as no others arrive."""
    value, descriptor = driver.node.get_parameter(name).value, driver.node.describe_parameter(name)
    if isinstance(value, str):
        return [String(data='')]
    if not isinstance(value, (int, float)):
        return [Vector3(x=nan), Vector3(y=inf), Vector3(z=-inf)]
    numbers = [nan, inf, -inf] + (
        [-1e-3] if descriptor.additional_constraints == '0 or more' else [])
    for limits in descriptor.floating_point_range:
        numbers += [limits.from_value - 1e-3] + (
            [limits.to_value * 1.001] if limits.to_value < 1e300 else [])
    for limits in descriptor.integer_range:
        numbers += [limits.from_value - 1.0, limits.from_value + 0.5, limits.to_value + 1.0, 1e300]
    return [Float64(data=number) for number in numbers]


def test_by_topic_bad_values_are_refused_and_counted(drive):
    driver = drive(SCENE)
    before, scene = snapshot(driver), driver.simulation.scene
    names = [name for name in changeable(driver) if name != 'use_sim_time']
    refused = driver.node._live.refused
    expected = {}
    for name in names:
        messages = bad_messages(driver, name)
        publisher = driver.peer.create_publisher(
            type(messages[0]), NODE + '/set/' + name.replace('.', '/'), 10)
        driver.spin_until(lambda: publisher.get_subscription_count() > 0)
        for bad in messages:
            publisher.publish(bad)
        expected[name] = len(messages)
        driver.spin_until(lambda: refused[name] == expected[name])
        driver.peer.destroy_publisher(publisher)
    assert refused == expected and len(expected) > 15
    assert snapshot(driver) == before and driver.simulation.scene is scene


def test_values_at_the_start_that_hold_only_together(drive):
    driver = drive(SCENE, friction__dry__static=0.1, friction__dry__kinetic=0.05)
    assert driver.node.get_parameter('friction.dry.static').value == 0.1
    assert driver.simulation.scene.parameters()['friction.dry.kinetic'].value == 0.05
