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

"""The grid of a sweep: what the words of the command line make of a scene."""

from argparse import ArgumentTypeError

from collision_sim.checks import read_yaml, SceneError
from collision_sim.scene import load_scene, Scene, SCENES, shipped_scenes
from collision_sim.studies.grid import axis, Grid, Run, with_value
import numpy as np
import pytest

SCENE = """\
particles: {count: 4, box: {min: [0, 0, 1], max: [1, 1, 2]}, seed: 7}
friction: {dry: 0.3, wet: {coefficient: 2.0, form: capped}}
colliders:
- {name: ground, shape: plane}
- {name: ball, shape: sphere, radius: 0.5, friction: {dry: {static: 0.4, kinetic: 0.2}}}
"""
VALUES = {int: 3, float: 0.15, tuple: (0.0, 1.0, 2.0)}      # allowed wherever there is one


@pytest.fixture
def scene(tmp_path):
    """Give the path of a scene."""
    path = tmp_path / 'my.yaml'
    path.write_text(SCENE)
    return str(path)


@pytest.mark.parametrize('text, values', [
    ('0.1:0.9:9', (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)),
    ('1e-3:1e3:7:log', (1e-3, 1e-2, 0.1, 1, 10, 100, 1000)), ('-1:-4:3:log', (-1, -2, -4)),
    ('1:0:3', (1, 0.5, 0)), ('100:300:3', (100, 200, 300)), ('0,0.1,1e-3', (0, 0.1, 1e-3)),
    ('exact, multi_pass', ('exact', 'multi_pass')), ('none,{dry: 0.1}', ('none', {'dry': 0.1})),
    ('[0,0,-9.81],[0, 0, -1.62]', ([0, 0, -9.81], [0, 0, -1.62])), ('.inf', (np.inf,)),
    ('-.5,+.5,.5e1,010,0o10,yes', (-0.5, 0.5, 5.0, 10, 8, 'yes')), ('010:012:3', (10, 11, 12))])
def test_values_of_an_axis(text, values):
    """Values are those that people would write: 0.1 + 2 * 0.1 is 0.3; both ends are included."""
    found = axis(f'a.b={text}')
    assert found == ('a.b', values)
    assert all(isinstance(value, int) for value in found.values) == (
        text in ('100:300:3', '-1:-4:3:log', '010:012:3'))


@pytest.mark.parametrize('text', [
    '', 'a', 'a=', '=1', 'a..b=1', 'a=1:2', 'a=1:2:1', 'a=1:2:0.5', 'a=1:2:3:lin', 'a=0:1:3:log',
    'a=-1:1:3:log', 'a=1e999999999:0:3', 'a=1:2:9999999', 'a=nan:1:3', 'a=1,1', 'a=]', 'a=1,,2',
    'a=!!bool x', 'a=x:y:z'])
def test_axes_that_are_refused(text):
    """What is no axis is refused with a word on what was written."""
    with pytest.raises(ArgumentTypeError, match='.'):
        axis(text)


@pytest.mark.parametrize('name', shipped_scenes())
def test_values_are_set_as_parameters_are(name):
    """What is varied in the file has the effect of `Scene.with_parameter`, bit for bit."""
    scene, mapping = load_scene(name), read_yaml(SCENES / f'{name}.yaml')
    for path, parameter in scene.parameters().items():
        value = VALUES[type(parameter.value)]
        grid = Grid(name)
        found = grid.scene(Run({path: value}, 0))
        wanted = scene.with_parameter(path, value)
        assert found.parameters() == wanted.parameters(), path
        assert Scene.from_dict(mapping).parameters() == scene.parameters()  # left as it was


@pytest.mark.parametrize('path, value, place, found', [
    ('friction.dry.static', 0.9, ['friction', 'dry'], {'static': 0.9, 'kinetic': 0.3}),
    ('friction.wet', 5, ['friction', 'wet'], {'coefficient': 5, 'form': 'capped'}),
    ('friction.wet.form', 'linear', ['friction', 'wet'], {'coefficient': 2.0, 'form': 'linear'}),
    ('colliders.ground.friction.dry', 0.1, ['colliders', 0, 'friction'],
     {'dry': 0.1, 'wet': {'coefficient': 2.0, 'form': 'capped'}}),
    ('colliders.ball.friction.dry.static', 0.5, ['colliders', 1, 'friction', 'dry', 'static'],
     0.5),
    ('colliders.ball.radius', 2, ['colliders', 1, 'radius'], 2),
    ('colliders.1.radius', 2, ['colliders', 1, 'radius'], 2),
    ('particles.box.max.2', 5, ['particles', 'box', 'max'], [1, 1, 5]),
    ('particles.velocity.sphere', 5, ['particles', 'velocity'], {'sphere': 5}),
    ('stepping.dt', 0.1, ['stepping'], {'dt': 0.1}), ('drag.linear', 1, ['drag'], {'linear': 1})])
def test_paths(path, value, place, found, scene):
    """Any value of the file has a path; what is beside it stays; what is absent is made."""
    grid = Grid(scene)
    node = grid.mapping(Run({path: value}, 0))
    for key in place:
        node = node[key]
    assert node == found
    grid.scene(Run({path: value}, 0))
    assert grid.mapping(Run({}, 0)) == Grid(scene).mapping(Run({}, 0))


@pytest.mark.parametrize('values, key', [
    ({'restitutio': 0.5}, 'restitutio'), ({'restitution': 2}, 'restitution'),
    ({'colliders.bal.radius': 1}, 'colliders.bal'), ({'gravity': 1}, 'gravity'),
    ({'colliders.2.radius': 1}, 'colliders.2'), ({'restitution.x': 1}, 'restitution'),
    ({'particles.box.min.3': 1}, 'particles.box.min.3'),
    ({'friction.dry.static': 0.1}, 'friction.dry'), ({'stepping.method': 'best'},
                                                     'stepping.method')])
def test_values_that_are_refused(values, key, scene):
    """An unknown path or a value that is not allowed: the error names the key."""
    grid = Grid(scene)
    with pytest.raises(SceneError) as error:
        grid.scene(Run(values, 0))
    assert error.value.key == key


def test_static_and_kinetic_are_set_together(scene):
    """Both below what the file has: no order of setting them one by one would do."""
    found = Grid(scene).scene(Run({'colliders.ball.friction.dry.static': 0.1,
                                   'colliders.ball.friction.dry.kinetic': 0.05}, 0))
    assert (found.colliders[1].friction.static, found.colliders[1].friction.kinetic) == (0.1, 0.05)


def test_order_and_seeds(scene):
    """The last axis varies fastest, then the repeat; repeat r has the seed + r."""
    grid = Grid(scene, [axis('restitution=0,1'), axis('particles.seed=3,5')], 2)
    assert [(*run.values.values(), run.repeat) for run in grid.runs] == [
        (0, 3, 0), (0, 3, 1), (0, 5, 0), (0, 5, 1), (1, 3, 0), (1, 3, 1), (1, 5, 0), (1, 5, 1)]
    assert [grid.seed(run) for run in grid.runs[:4]] == [3, 4, 5, 6]
    np.testing.assert_array_equal(
        grid.scene(Run({}, 3)).particles.position,
        grid.scene(Run({'particles.seed': 10}, 0)).particles.position)


@pytest.mark.parametrize('text, draws', [
    (SCENE, True), ('particles: {position: [[0, 0, 1]], seed: 3}', False), ('gravity: [0, 0, 1]',
                                                                            False),
    ('particles: {position: [[0, 0, 1]], velocity: {sphere: 1}}', True)])
def test_whether_repeats_differ(text, draws, tmp_path):
    """Places and velocities may be drawn at random, or neither."""
    (tmp_path / 'my.yaml').write_text(text)
    assert Grid(str(tmp_path / 'my.yaml')).draws() is draws


@pytest.mark.parametrize('paths', [('friction', 'friction.dry'), ('restitution', 'restitution')])
def test_nothing_is_varied_twice(paths, scene):
    """Two axes of one value, or one within the other."""
    with pytest.raises(SceneError, match='twice'):
        Grid(scene, [axis(f'{path}=1') for path in paths])


def test_grids_that_are_too_large_and_files_that_are_no_scenes(scene, tmp_path):
    """Refused before anything is laid out."""
    with pytest.raises(SceneError, match='at most'):
        Grid(scene, [axis(f'{path}=0:1:1000') for path in 'abc'], 10 ** 400)
    for text in ('', '3', '[1]'):
        (tmp_path / 'bad.yaml').write_text(text)
        with pytest.raises(SceneError, match='mapping'):
            Grid(str(tmp_path / 'bad.yaml'))


def test_particle_files_are_beside_the_scene(tmp_path, monkeypatch):
    """Names of files are relative to the scene, wherever the sweep is started."""
    np.save(tmp_path / 'points.npy', [[0.0, 0.0, 1.0]])
    (tmp_path / 'my.yaml').write_text('particles: {file: points.npy}')
    grid = Grid(str(tmp_path / 'my.yaml'))
    monkeypatch.chdir('/')
    assert grid.scene(grid.runs[0]).particles.position.tolist() == [[0.0, 0.0, 1.0]]


def test_a_copy_shares_what_is_beside_the_path():
    """Long lists are not copied for each run."""
    mapping = {'particles': {'position': [[0, 0, 0]] * 3}, 'stepping': {'dt': 1}}
    changed = with_value(mapping, ['stepping', 'dt'], 2)
    assert changed['particles'] is mapping['particles'] and mapping['stepping'] == {'dt': 1}
