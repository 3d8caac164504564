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

"""Parameters of the node: by service, by topic, at the start; refused ones change nothing."""

from math import inf, nan

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from collision_sim.ros.parameters import NODE_PARAMETERS  # noqa: E402, I100
from geometry_msgs.msg import Vector3  # noqa: E402
from rcl_interfaces.msg import Parameter as ParameterMessage, ParameterValue  # noqa: E402
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters  # noqa: E402
from rcl_interfaces.srv import SetParameters, SetParametersAtomically  # noqa: E402
from rclpy.exceptions import ParameterException  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from std_msgs.msg import Float64, String  # noqa: E402

SCENE = {
    'drag': {'linear': 0.1},
    'particles': {'position': [[0, 0, 1]]},
    'restitution': 0.5,
    'friction': {'dry': {'static': 0.4, 'kinetic': 0.3}},
    'colliders': [{'name': 'ground', 'shape': 'plane'},
                  {'name': 'wall', 'shape': 'plane', 'normal': [1, 0, 0], 'point': [-9, 0, 0],
                   'restitution': 0.9, 'friction': {'wet': 0.2}}],
}
NODE = '/collision_sim'


def value_of(driver, path):
    return driver.simulation.scene.parameters()[path].value


def set_by_service(driver, *parameters, atomically=False):
    kind = SetParametersAtomically if atomically else SetParameters
    request = kind.Request(parameters=[p if isinstance(p, ParameterMessage)
                                       else Parameter(p[0], value=p[1]).to_parameter_msg()
                                       for p in parameters])
    name = NODE + ('/set_parameters_atomically' if atomically else '/set_parameters')
    response = driver.call(kind, name, request)
    return [response.result] if atomically else response.results


def snapshot(driver):
    names = sorted(driver.node._parameters)
    return [driver.node.get_parameter(name).value for name in names]


# --- what is there ---------------------------------------------------------------------------


def test_every_value_is_declared_with_range_and_unit(drive):
    driver = drive(SCENE)
    names = driver.call(ListParameters, NODE + '/list_parameters',
                        ListParameters.Request()).result.names
    expected = {'scene', *NODE_PARAMETERS, *driver.simulation.scene.parameters()}
    assert expected <= set(names)
    wanted = ['restitution', 'gravity', 'colliders.wall.friction.wet', 'stepping.iterations',
              'scene', 'drag.linear']
    found = driver.call(DescribeParameters, NODE + '/describe_parameters',
                        DescribeParameters.Request(names=wanted)).descriptors
    restitution, gravity, wet, iterations, scene, drag = found
    limits = restitution.floating_point_range[0]
    assert (limits.from_value, limits.to_value) == (0.0, 1.0)
    assert '[m/s^2]' in gravity.description and gravity.additional_constraints
    assert '[s/m]' in wet.description and wet.additional_constraints == '0 or more'
    assert iterations.integer_range[0].from_value == 1
    assert scene.read_only and '[1/s]' in drag.description
    assert all(descriptor.description for descriptor in found)


def test_values_at_the_start(drive):
    driver = drive(SCENE, restitution=0.8, colliders__ground__friction__dry__kinetic=0.1,
                   gravity=[0.0, 0.0, -1.0])
    assert value_of(driver, 'restitution') == 0.8
    assert value_of(driver, 'colliders.ground.restitution') == 0.8
    assert value_of(driver, 'colliders.wall.restitution') == 0.9
    assert value_of(driver, 'colliders.ground.friction.dry.kinetic') == 0.1
    assert driver.simulation.scene.gravity == (0.0, 0.0, -1.0)
    assert driver.node.get_parameter('colliders.ground.restitution').value == 0.8


@pytest.mark.parametrize('name, value, error', [
    ('restitution', 1.5, ParameterException), ('restitution', 'high', ParameterException),
    ('gravity', [1.0], ValueError), ('gravity', [nan, 0.0, 0.0], ValueError),
    ('frame_id', '', ValueError), ('scene', 'nowhere', ValueError)])
def test_bad_values_at_the_start_are_errors(drive, name, value, error):
    if name == 'scene':
        with pytest.raises(error, match=value):
            drive(value)
    else:
        with pytest.raises(error, match=name):
            drive(SCENE, **{name: value})


def test_unknown_values_at_the_start_are_warned_of(drive, capfd):
    """Nothing else would tell of a slip; what the node has, QoS included, is not mentioned."""
    qos = {'qos_overrides./collision_sim/particles.publisher.depth': 3}
    drive(SCENE, publish_rat=10.0, colliders__wal__restitution=0.5, restitution=0.25, **qos)
    printed = capfd.readouterr().err
    assert 'no such parameters: colliders.wal.restitution, publish_rat\n' in printed
    drive(SCENE, restitution=0.25, **qos)
    assert 'no such parameters' not in capfd.readouterr().err


# --- services --------------------------------------------------------------------------------


def test_set_by_service(drive):
    driver = drive(SCENE)
    results = set_by_service(driver, ('restitution', 0.25), ('gravity', [0.0, 1.0, 2.0]),
                             ('colliders.wall.friction.wet', 0.7), ('stepping.iterations', 3))
    assert all(result.successful for result in results)
    assert value_of(driver, 'restitution') == 0.25
    assert value_of(driver, 'gravity') == (0.0, 1.0, 2.0)
    assert value_of(driver, 'colliders.wall.friction.wet') == 0.7
    assert driver.simulation.scene.stepping.iterations == 3


def test_colliders_that_take_the_default_follow_it(drive):
    driver = drive(SCENE)
    set_by_service(driver, ('restitution', 0.25))
    assert driver.node.get_parameter('colliders.ground.restitution').value == 0.25
    assert driver.node.get_parameter('colliders.wall.restitution').value == 0.9
    set_by_service(driver, ('colliders.ground.restitution', 0.3))
    set_by_service(driver, ('restitution', 0.75))
    assert value_of(driver, 'colliders.ground.restitution') == 0.3
    assert driver.node.get_parameter('colliders.ground.restitution').value == 0.3


def test_atomically_all_or_nothing(drive):
    driver = drive(SCENE)
    before = snapshot(driver)
    refused = set_by_service(driver, ('restitution', 0.25), ('gravity', [nan, 0.0, 0.0]),
                             atomically=True)[0]
    assert not refused.successful and 'gravity' in refused.reason
    assert snapshot(driver) == before and value_of(driver, 'restitution') == 0.5
    accepted = set_by_service(driver, ('restitution', 0.25), ('drag.linear', 0.0),
                              atomically=True)[0]
    driver.node.wait_until_ready()
    assert accepted.successful and value_of(driver, 'drag.linear') == 0.0


BAD = [
    ('restitution', 1.5), ('restitution', -0.1), ('restitution', nan), ('restitution', inf),
    ('restitution', 2), ('restitution', 'x'), ('restitution', True), ('restitution', [0.5]),
    ('drag.linear', -1.0), ('drag.linear', nan), ('drag.wind', [1.0, 2.0]),
    ('gravity', [0.0]), ('gravity', [0.0, 0.0, inf]), ('gravity', [1, 2]), ('gravity', 9.81),
    ('gravity', [1.0, 2.0, 3.0, 4.0]), ('friction.dry.static', 0.1), ('friction.dry.kinetic', 0.5),
    ('colliders.wall.friction.wet', -1.0), ('colliders.nobody.restitution', 0.5),
    ('stepping.iterations', 0), ('stepping.iterations', 1.0), ('stepping.iterations', 10 ** 9),
    ('scene', 'rain'), ('frame_id', ''), ('frame_id', 3), ('publish_rate', 0.0),
    ('publish_rate', nan), ('pose_delay', -1.0), ('pose_timeout', inf), ('', 1.0),
    ('nothing', 1.0),
]


@pytest.mark.parametrize('atomically', [False, True])
def test_refused_by_service(drive, atomically):
    driver = drive(SCENE)
    before, scene = snapshot(driver), driver.simulation.scene
    for name, value in BAD:
        result = set_by_service(driver, (name, value), atomically=atomically)[0]
        assert not result.successful and result.reason, (name, value)
    unset = ParameterMessage(name='restitution', value=ParameterValue(type=0))
    assert not set_by_service(driver, unset, atomically=atomically)[0].successful
    assert snapshot(driver) == before and driver.simulation.scene is scene
    assert set_by_service(driver, ('restitution', 0.1), ('restitution', 0.2))[1].successful
    assert value_of(driver, 'restitution') == 0.2


@pytest.mark.parametrize('atomically', [False, True])
def test_whole_numbers_are_numbers(drive, atomically):
    """At the start, and by both services; what is kept and told is a float."""
    driver = drive(SCENE, restitution=1, publish_rate=30, gravity=[0, 0, -1],
                   colliders__wall__friction__wet=2)
    assert value_of(driver, 'restitution') == 1.0
    assert value_of(driver, 'gravity') == (0.0, 0.0, -1.0)
    values = ('restitution', 0), ('gravity', [0, 1, -2]), ('colliders.wall.restitution', 1)
    assert all(result.successful for result in set_by_service(
        driver, *values, atomically=atomically))
    assert value_of(driver, 'colliders.wall.restitution') == 1.0
    assert value_of(driver, 'gravity') == (0.0, 1.0, -2.0)
    for name in ('restitution', 'publish_rate', 'colliders.wall.friction.wet'):
        assert type(driver.node.get_parameter(name).value) is float
    assert driver.node.get_parameter('gravity').value == [0.0, 1.0, -2.0]


@pytest.mark.parametrize('atomically', [False, True])
@pytest.mark.parametrize('name, value, words', [
    ('restitutoin', 0.5, 'restitutoin: 0.5: there is no such parameter'),
    ('x' * 100_000, 0.5, 'there is no such parameter'),
    ('gravity', [1.0, 2.0], 'gravity: [1.0, 2.0]: must be 3 finite numbers'),
    ('gravity', [nan, 0.0, 0.0], 'gravity: [nan, 0.0, 0.0]: must be 3 finite numbers'),
    ('restitution', 'high', "restitution: 'high': must be a number"),
    ('gravity', 9.81, 'gravity: 9.81: must be a list of numbers'),
    ('frame_id', 10_000_000 * 'f', 'must be 1 to 255 characters'),
    ('frame_id', 'a\nb', 'must be 1 to 255 characters')], ids=str)
def test_refusals_say_what_and_why(drive, name, value, words, atomically):
    """In a few words, however long the value is."""
    reason = set_by_service(drive(SCENE), (name, value), atomically=atomically)[0].reason
    assert words in reason and len(reason) < 300


@pytest.mark.parametrize('count', [1001, 10_000])
def test_a_request_has_a_bound(drive, count):
    """For each value there is an answer that says so, and nothing has changed."""
    driver = drive(SCENE)
    scene = driver.simulation.scene
    many = [('restitution', k / count) for k in range(count)]
    for results, expected in ((set_by_service(driver, *many), count),
                              (set_by_service(driver, *many, atomically=True), 1)):
        assert len(results) == expected
        assert all(not result.successful and str(count) in result.reason
                   and 'at most 1000' in result.reason for result in results)
    names = ListParameters.Request(prefixes=count * ['restitution'])
    assert driver.call(ListParameters, NODE + '/list_parameters', names).result.names == []
    assert driver.simulation.scene is scene
    assert all(result.successful for result in set_by_service(driver, *many[:1000]))
    assert value_of(driver, 'restitution') == many[999][1]


def test_what_comes_between_two_ticks_is_adopted_once(drive, monkeypatch):
    """By any way, in the order in which it came, before the next step."""
    driver, adopted = drive(SCENE), []
    adopt = type(driver.simulation)._adopt
    monkeypatch.setattr(type(driver.simulation), '_adopt',
                        lambda self, scene: (adopted.append(scene), adopt(self, scene)))
    for k in range(500):
        driver.node._live._take('restitution', float, Float64(data=k / 1000))
        driver.node._live._take('gravity', tuple, Vector3(x=float(k)))
    assert set_by_service(driver, *[('restitution', k / 1000) for k in range(900)])[0].successful
    driver.node._live._take('colliders.wall.restitution', float, Float64(data=0.25))
    driver.run(0.1)
    scene = adopted[-1]
    assert len(adopted) < 10        # beside the ticks, only the diagnostics have looked
    assert scene.restitution == 0.899 and scene.gravity == (499.0, 0.0, 0.0)
    assert scene.restitution_of(scene.collider('wall')) == 0.25
    assert driver.node.get_parameter('colliders.ground.restitution').value == 0.899


# --- topics ----------------------------------------------------------------------------------


def publish(driver, topic, message):
    publisher = driver.peer.create_publisher(type(message), NODE + '/set/' + topic, 10)
    driver.spin_until(lambda: publisher.get_subscription_count() > 0)
    publisher.publish(message)
    return publisher


@pytest.mark.parametrize('topic, message, path, value', [
    ('restitution', Float64(data=0.25), 'restitution', 0.25),
    ('colliders/wall/friction/wet', Float64(data=2.0), 'colliders.wall.friction.wet', 2.0),
    ('gravity', Vector3(x=0.0, y=0.0, z=-1.6), 'gravity', (0.0, 0.0, -1.6)),
    ('stepping/iterations', Float64(data=4.0), 'stepping.iterations', 4)],
    ids=['number', 'collider', 'vector', 'whole'])
def test_set_by_topic(drive, topic, message, path, value):
    driver = drive(SCENE)
    publish(driver, topic, message)
    driver.spin_until(lambda: value_of(driver, path) == value)
    asked = GetParameters.Request(names=[path])
    got = driver.call(GetParameters, NODE + '/get_parameters', asked).values[0]
    assert value in (got.double_value, got.integer_value, tuple(got.double_array_value))


def test_parameters_of_the_node_by_topic(drive):
    driver = drive(SCENE)
    publish(driver, 'frame_id', String(data='odom'))
    driver.spin_until(lambda: driver.node._poses.frame_id == 'odom')
    publish(driver, 'publish_rate', Float64(data=20.0))
    driver.spin_until(lambda: driver.node._ticks_a_message == 2)


@pytest.mark.parametrize('topic, message', [
    ('restitution', Float64(data=1.5)), ('restitution', Float64(data=nan)),
    ('gravity', Vector3(x=nan, y=0.0, z=0.0)), ('drag/linear', Float64(data=inf)),
    ('stepping/iterations', Float64(data=2.5)), ('stepping/iterations', Float64(data=1e300)),
    ('friction/dry/kinetic', Float64(data=0.5)), ('frame_id', String(data=''))])
def test_refused_by_topic(drive, topic, message, capfd):
    driver = drive(SCENE)
    before, scene = snapshot(driver), driver.simulation.scene
    publish(driver, topic, message)
    printed = []

    def refused():
        printed.append(capfd.readouterr().err)
        return topic.replace('/', '.') + ' refused' in ''.join(printed)

    driver.spin_until(refused)
    assert snapshot(driver) == before and driver.simulation.scene is scene
