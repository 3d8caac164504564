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

"""Scenes: what is read, what is refused and with which words, and changes while running."""

from array import array
import copy
from dataclasses import FrozenInstanceError, replace
import datetime
import math
import os
import pickle
import re

from collision_sim import load_scene, Scene, SceneError
from collision_sim import particles as particles_module
from collision_sim.colliders import Collider, Motion, Oscillation
from collision_sim.friction import Friction
from collision_sim.scene import Drag, shipped_scenes, Stepping
from hypothesis import given, settings, strategies as st
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest

FULL = {
    'gravity': [0, 0, -9.81],
    'drag': {'linear': 0.5, 'quadratic': 0.1, 'wind': [1, 0, 0]},
    'particles': {
        'count': 5, 'box': {'min': [-1, -1, 1], 'max': [1, 1, 2]}, 'seed': 3,
        'velocity': [0, 0, -1], 'mass': 2.0, 'radius': 0.01},
    'restitution': 0.5,
    'friction': {'dry': 0.3},
    'colliders': [
        {'name': 'ground', 'shape': 'plane', 'point': [0, 0, 0.1], 'normal': [0, 0, 2]},
        {'name': 'ball', 'shape': 'sphere', 'radius': 0.5, 'position': [0, 0, 0.5],
         'friction': 'none'},
        {'name': 'paddle', 'shape': 'box', 'size': [1, 0.2, 0.5], 'position': [1, 0, 1],
         'orientation': [0, 0, 0, 1], 'topic': 'paddle/pose', 'restitution': 0.9},
        {'name': 'drum', 'shape': 'cylinder', 'radius': 2, 'length': 1, 'inside': True,
         'motion': {'angular_velocity': [0, 0, 3.6],
                    'oscillate': {'axis': [0, 3, 4], 'amplitude': 0.1, 'frequency': 2}},
         'friction': {'dry': {'static': 0.4, 'kinetic': 0.3},
                      'wet': {'coefficient': 2.0, 'form': 'linear'}}},
        {'name': 'pill', 'shape': 'capsule', 'radius': 0.1, 'length': 0.4}],
    'stepping': {
        'dt': 0.004, 'method': 'multi_pass', 'detection': 'end_of_step',
        'flight': 'symplectic_euler', 'iterations': 7, 'repulsion': 0.2, 'repulsion_speed': 3.0},
}


def nameless(value):
    """Give a value as text, without addresses, which differ between processes."""
    return re.sub(' at 0x[0-9a-f]+', '', repr(value))


def changed(path, value):
    """Give FULL with one entry replaced, or removed where the value is Ellipsis."""
    mapping = copy.deepcopy(FULL)
    place = mapping
    for key in path[:-1]:
        place = place[key]
    if value is ...:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return mapping


def brief(value):
    """Name a case; Python does not print integers of thousands of digits."""
    return value if isinstance(value, str) else str(SceneError('', value, ''))[2:50]


def full_with(*path_and_value):
    *path, value = path_and_value
    return Scene.from_dict(changed(path, value))


def refused(function, *arguments):
    """Give the SceneError that the call must raise; its parts make up its message."""
    with pytest.raises(SceneError) as caught:
        function(*arguments)
    error = caught.value
    assert str(error).startswith(f'{error.key}: ')
    assert str(error).endswith(f': {error.allowed}')
    assert len(str(error)) < 1000 and '\n' not in str(error)
    return error


# What is read


def test_full_scene():
    scene = Scene.from_dict(FULL)
    ground, ball, paddle, drum, pill = scene.colliders
    assert scene.gravity == (0.0, 0.0, -9.81)
    assert scene.drag == Drag(0.5, 0.1, (1.0, 0.0, 0.0))
    assert scene.restitution == 0.5
    assert scene.friction == Friction(static=0.3, kinetic=0.3)
    assert ground == Collider('ground', 'plane', (0.0, 0.0, 0.0), position=(0.0, 0.0, 0.1))
    assert ball == Collider('ball', 'sphere', (0.5, 0.0, 0.0), position=(0.0, 0.0, 0.5),
                            friction=Friction())
    assert paddle == Collider('paddle', 'box', (0.5, 0.1, 0.25), position=(1.0, 0.0, 1.0),
                              topic='paddle/pose', restitution=0.9)
    assert drum == Collider(
        'drum', 'cylinder', (2.0, 0.5, 0.0), inside=True,
        friction=Friction(0.4, 0.3, 2.0, 'linear', apart=True),
        motion=Motion(angular_velocity=(0.0, 0.0, 3.6),
                      oscillate=Oscillation((0.0, 0.6, 0.8), 0.1, 2.0)))
    assert pill == Collider('pill', 'capsule', (0.1, 0.2, 0.0))
    assert [c.moving for c in scene.colliders] == [False, False, True, True, False]
    assert scene.stepping == Stepping(0.004, 'multi_pass', 'end_of_step', 'symplectic_euler', 7,
                                      0.2, 3.0)


@pytest.mark.parametrize('mapping', [
    {},
    {'particles': None, 'colliders': None, 'drag': None, 'friction': None, 'stepping': None},
    {'particles': {}, 'colliders': [], 'drag': {}, 'friction': 'none', 'stepping': {}},
], ids=['absent', 'null', 'empty'])
def test_empty_sections_are_absent(mapping):
    scene = Scene.from_dict(mapping)
    assert scene.gravity == (0.0, 0.0, -9.81)
    assert scene.drag is None
    assert scene.particles.position.shape == scene.particles.velocity.shape == (0, 3)
    assert scene.restitution == 0.0
    assert scene.friction == Friction()
    assert scene.colliders == ()
    assert scene.stepping == Stepping()


def test_defaults_of_colliders():
    scene = Scene.from_dict(FULL)
    ground, ball, paddle = scene.colliders[:3]
    assert scene.restitution_of(ground) == 0.5
    assert scene.restitution_of(paddle) == 0.9
    assert scene.friction_of(ground) == scene.friction
    assert scene.friction_of(ball) == Friction()
    assert scene.collider('paddle') is paddle
    error = refused(scene.collider, 'padle')
    assert error.key == 'colliders.padle' and 'paddle' in str(error)


@pytest.mark.parametrize('given_friction, friction', [
    ('none', Friction()),
    ({'dry': 0}, Friction(0.0, 0.0)),
    ({'dry': 1e308}, Friction(1e308, 1e308)),
    ({'dry': {'static': 0.4, 'kinetic': 0.3}}, Friction(0.4, 0.3, apart=True)),
    ({'dry': {'static': 0.4, 'kinetic': 0.4}}, Friction(0.4, 0.4, apart=True)),
    ({'wet': 2}, Friction(wet=2.0)),
    ({'wet': {'coefficient': 2, 'form': 'capped'}}, Friction(wet=2.0, wet_form='capped')),
    ({'wet': {'coefficient': 2}}, Friction(wet=2.0)),
    ({'dry': 0.3, 'wet': 2}, Friction(0.3, 0.3, 2.0)),
], ids=str)
def test_forms_of_friction(given_friction, friction):
    assert Scene.from_dict({'friction': given_friction}).friction == friction
    assert full_with('colliders', 2, 'friction', given_friction).colliders[2].friction == friction


@pytest.mark.parametrize('normal', [
    [0, 0, 1e308], [0, 0, 5e-324], [1e200, 1e200, 1e200], [1, -2, 3], np.array([0, 0, 2])],
    ids=str)
def test_normals_become_unit(normal):
    unit = full_with('colliders', 0, 'normal', normal).colliders[0].normal
    assert math.hypot(*unit) == pytest.approx(1, abs=1e-15)
    scaled = np.array(normal) / np.max(np.abs(normal))
    assert_allclose(unit, scaled / np.linalg.norm(scaled))


def test_nearly_unit_quaternion_is_normalized():
    orientation = full_with('colliders', 2, 'orientation', [0, 0, 0.7071, 0.7071]).colliders[2]
    assert math.hypot(*orientation.orientation) == pytest.approx(1, abs=1e-15)


@pytest.mark.parametrize('vector', [
    (1, 2, 3), [1, 2.0, np.float32(3)], np.array([1, 2, 3]), array('d', [1, 2, 3])],
    ids=['tuple', 'list', 'numpy', 'ros'])
def test_kinds_of_vectors(vector):
    gravity = Scene.from_dict({'gravity': vector}).gravity
    assert gravity == (1.0, 2.0, 3.0) and all(type(g) is float for g in gravity)


@pytest.mark.parametrize('topic', ['pose', '/pose', '~/pose', 'a/b_1/_c', '/a/b'])
def test_topics(topic):
    assert full_with('colliders', 2, 'topic', topic).colliders[2].topic == topic


# Particles


def particles(**section):
    return Scene.from_dict({'particles': section}).particles


BOX = {'min': [-1, 0, 2], 'max': [1, 0, 3]}


def test_random_positions_come_first_and_repeat():
    still = particles(count=50, box=BOX, seed=7)
    moving = particles(count=50, box=BOX, seed=7, velocity={'sphere': 2.0})
    random = np.random.Generator(np.random.PCG64(7))
    assert_array_equal(still.position, random.uniform(BOX['min'], BOX['max'], (50, 3)))
    assert_array_equal(still.position, moving.position)
    assert_array_equal(still.velocity, np.zeros((50, 3)))
    assert np.any(still.position != particles(count=50, box=BOX, seed=8).position)
    assert np.all((BOX['min'] <= still.position) & (still.position <= BOX['max']))


def test_random_velocities():
    sphere = particles(count=4000, box=BOX, velocity={'sphere': 2.0}).velocity
    assert_allclose(np.linalg.norm(sphere, axis=1), 2.0)
    # The mean of N unit vectors has a standard deviation of sqrt(1 / N) in length.
    assert np.linalg.norm(sphere.mean(axis=0)) < 2.0 * 5 / math.sqrt(4000)
    box = particles(count=100, box=BOX, velocity={'box': {'min': [1, 2, 3], 'max': [2, 2, 5]}})
    assert np.all(([1, 2, 3] <= box.velocity) & (box.velocity <= [2, 2, 5]))


def test_particles_one_by_one():
    found = particles(position=[[0, 0, 1], (1, 2, 3)], velocity=[[1, 0, 0], [0, 1, 0]],
                      mass=[1, math.inf], radius=[0, 0.5])
    assert_array_equal(found.position, [[0, 0, 1], [1, 2, 3]])
    assert_array_equal(found.velocity, [[1, 0, 0], [0, 1, 0]])
    assert_array_equal(found.mass, [1, np.inf])
    assert_array_equal(found.radius, [0, 0.5])


@pytest.mark.parametrize('section', [
    {'count': 0, 'box': BOX}, {'position': []}, {'position': np.empty((0, 3))},
    {'position': [], 'velocity': [], 'mass': [], 'radius': []},
    {'count': 0, 'box': BOX, 'velocity': {'sphere': 1}}], ids=str)
def test_no_particles(section):
    found = particles(**section)
    assert found.position.shape == found.velocity.shape == (0, 3)


def test_arrays_are_copied_and_read_only():
    position = np.ones((2, 3))
    mass = np.ones(2)
    found = particles(position=position, velocity=position, mass=mass)
    position[:] = mass[:] = 5
    for values in (found.position, found.velocity, found.mass):
        assert values.dtype == np.float64 and np.all(values == 1)
        with pytest.raises(ValueError):
            values[0] = 2
    with pytest.raises(FrozenInstanceError):
        found.mass = 2


def test_particle_files(tmp_path):
    rows = np.arange(6.0).reshape(2, 3)
    np.save(tmp_path / 'points.npy', rows)
    (tmp_path / 'plain.csv').write_text('0,1,2\n3, 4, 5e0\n\n')
    (tmp_path / 'header.csv').write_text('\ufeffx, y, z\r\n0,1,2\r\n3,4,5\r\n', encoding='utf-8')
    for name in ('points.npy', 'plain.csv', 'header.csv', str(tmp_path / 'plain.csv')):
        scene = Scene.from_dict({'particles': {'file': name}}, tmp_path)
        assert_array_equal(scene.particles.position, rows)
    for head in ('x [m], y [m], z [m]', '# x y z', 'X (m),Y (m),Z (m)', '# a\n\n"x","y","z"'):
        (tmp_path / 'head.csv').write_text(f'{head}\n0,1,2 # here\n\n# 7,8,9\n3,4,5\n,,\n')
        scene = Scene.from_dict({'particles': {'file': 'head.csv'}}, tmp_path)
        assert_array_equal(scene.particles.position, rows)
    (tmp_path / 'order.csv').write_text('z [m], x, y\n2,0,1\n5,3,4\n')
    scene = Scene.from_dict({'particles': {'file': 'order.csv'}}, tmp_path)
    assert_array_equal(scene.particles.position, rows)
    (tmp_path / 'none.csv').write_text('x,y,z\n')
    scene = Scene.from_dict({'particles': {'file': 'none.csv'}}, tmp_path)
    assert scene.particles.position.shape == (0, 3)


def test_files_are_relative_to_the_scene(tmp_path):
    (tmp_path / 'points.csv').write_text('1,2,3')
    (tmp_path / 'scene.yaml').write_text('particles: {file: points.csv}')
    assert_array_equal(load_scene(tmp_path / 'scene.yaml').particles.position, [[1, 2, 3]])


@pytest.mark.parametrize('name, content', [
    ('absent.npy', None),
    ('absent.csv', None),
    ('text.npy', b'hello'),
    ('empty.npy', b''),
    ('zip.npy', b'PK\x03\x04 nothing'),
    ('huge.npy', b"\x93NUMPY\x01\x00\x46\x00{'descr': '<f8', 'fortran_order': False, "
                 b"'shape': (99999999999999, 3)}\n"),
    ('word.csv', b'1,2,a\n'),
    ('ragged.csv', b'1,2,3\n4,5\n'),
    ('wide.csv', b'1,2,3,4\n1,2,3,4\n1,2,3,4\n'),
    ('nan.csv', b'1,2,nan\n'),
    ('big.csv', b'1,2,1e999\n'),
    ('binary.csv', b'\xff\xfe\x00'),
], ids=lambda value: value if isinstance(value, str) else '')
def test_bad_particle_files(tmp_path, name, content):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    error = refused(Scene.from_dict, {'particles': {'file': name}}, tmp_path)
    assert error.key == 'particles.file' and name in str(error)


@pytest.mark.parametrize('content, words', [
    (b'1,2,a\n', "line 1: 'a' is no number"),
    (b'# 1\nx,y,z\n1,2,3\n4,5,1_0\n', "line 4: '1_0' is no number"),
    (b'1,2,3\n4,5\n', 'line 2 must have 3 entries with commas between them, not 2'),
    (b'1 2 3\n', 'line 1 must have 3 entries with commas between them, not 1'),
    (b'x [mm],y [mm],z [mm]\n1,2,3\n', 'line 1: lengths must be in m, not mm'),
    (b'a,b,c\n1,2,3\n', 'line 1 must have 3 numbers, or the titles x, y, z'),
    (b'1,2,3\nx,y,z\n', "line 2: 'x' is no number"),
    (b'1,,3\n', "line 1: '' is no number"),
])
def test_errors_in_tables_name_line_and_entry(tmp_path, content, words):
    (tmp_path / 'a.csv').write_bytes(content)
    error = refused(Scene.from_dict, {'particles': {'file': 'a.csv'}}, tmp_path)
    assert words in str(error) and 'could not convert' not in str(error)


@pytest.mark.parametrize('kind', ['csv', 'npy'])
@pytest.mark.parametrize('section', ['particles', 'springs'])
def test_pipes_devices_and_folders_are_refused_at_once(tmp_path, kind, section):
    os.mkfifo(tmp_path / f'pipe.{kind}')
    (tmp_path / f'device.{kind}').symlink_to('/dev/zero')
    (tmp_path / f'folder.{kind}').mkdir()
    for name in ('pipe', 'device', 'folder'):
        scene = {'particles': {'position': [[0, 0, 0], [1, 0, 0]]},
                 'springs': {'stiffness': 1}}
        scene[section] = {**({} if section == 'particles' else scene[section]),
                          'file': f'{name}.{kind}'}
        if section == 'particles':
            del scene['springs']
        error = refused(Scene.from_dict, scene, tmp_path)
        assert error.key == f'{section}.file' and 'is not an ordinary file' in str(error)


@pytest.mark.parametrize('rows', [
    np.ones((2, 4)), np.ones(3), np.float64(1), np.array([[1, np.nan, 0]]),
    np.ones((2, 3), dtype=bool), np.ones((2, 3), dtype=complex),
    np.array([[object(), 1, 1]])], ids=nameless)
def test_bad_arrays(tmp_path, rows):
    assert refused(particles_of, {'position': rows}).key == 'particles.position'
    np.save(tmp_path / 'rows.npy', rows, allow_pickle=True)
    error = refused(Scene.from_dict, {'particles': {'file': 'rows.npy'}}, tmp_path)
    assert error.key == 'particles.file' and 'rows.npy' in str(error)


def particles_of(section):
    return Scene.from_dict({'particles': section}).particles


@pytest.mark.parametrize('section, key, words', [
    ({'seed': 1}, 'particles', 'exactly one of count (with box), position, file'),
    ({'count': 2, 'box': BOX, 'position': [[0, 0, 0]]}, 'particles', 'exactly one'),
    ({'position': [], 'file': 'a.npy'}, 'particles', 'exactly one'),
    ({'position': [[0, 0, 0]], 'box': BOX}, 'particles.box', 'count only'),
    ({'count': 2}, 'particles.box', 'missing: must be a mapping with the keys min, max'),
    ({'count': 2, 'box': {'min': [0, 0, 0]}}, 'particles.box.max', 'missing: must be 3 finite'),
    ({'count': 2, 'box': {'min': [0, 0, 1], 'max': [1, 1, 0]}}, 'particles.box', 'min <= max'),
    ({'count': 2, 'box': {'min': [0, 0, -1e308], 'max': [1, 1, 1e308]}}, 'particles.box',
     'finite extent'),
    ({'count': 10 ** 8 + 1, 'box': BOX}, 'particles.count', 'whole number from 0 to 100000000'),
    ({'count': 2.0, 'box': BOX}, 'particles.count', 'whole number'),
    ({'count': -1, 'box': BOX}, 'particles.count', 'whole number'),
    ({'count': True, 'box': BOX}, 'particles.count', 'whole number'),
    ({'count': 2, 'box': BOX, 'seed': -1}, 'particles.seed', 'whole number from 0 upwards'),
    ({'position': 5}, 'particles.position', 'list of vectors'),
    ({'position': None}, 'particles.position', 'list of vectors'),
    ({'position': 'abc'}, 'particles.position', 'list of vectors'),
    ({'position': [1, 2, 3]}, 'particles.position[0]', '3 finite numbers'),
    ({'position': [[0, 0, 0], [1, 2]]}, 'particles.position[1]', '3 finite numbers'),
    ({'position': [[0, 0, 0], [1, 2, [3]]]}, 'particles.position[1]', '3 finite numbers'),
    ({'position': [[0, 0, True]]}, 'particles.position[0]', '3 finite numbers'),
    ({'position': [[0, 0, 10 ** 5000]]}, 'particles.position[0]', '3 finite numbers'),
    ({'file': 'points.txt'}, 'particles.file', '.npy or .csv'),
    ({'file': 5}, 'particles.file', '.npy or .csv'),
    ({'file': 'a\0b.npy'}, 'particles.file', ''),
    ({'position': [[0, 0, 0]], 'velocity': [[0, 0, 0]] * 2}, 'particles.velocity',
     'one for each of the 1 particles, not 2'),
    ({'position': [[0, 0, 0]], 'velocity': []}, 'particles.velocity', 'not 0'),
    ({'position': [[0, 0, 0]], 'velocity': [1, 2]}, 'particles.velocity', '3 finite numbers'),
    ({'position': [[0, 0, 0]], 'velocity': [[0, math.nan, 0]]}, 'particles.velocity[0]',
     '3 finite numbers'),
    ({'position': [[0, 0, 0]], 'velocity': {'sphere': -1}}, 'particles.velocity.sphere',
     'from 0 upwards'),
    ({'position': [[0, 0, 0]], 'velocity': {'sphere': 1, 'box': BOX}}, 'particles.velocity',
     'exactly one'),
    ({'position': [[0, 0, 0]], 'velocity': {}}, 'particles.velocity', 'exactly one'),
    ({'position': [[0, 0, 0]], 'velocity': {'cube': 1}}, 'particles.velocity.cube', 'box'),
    ({'position': [[0, 0, 0]], 'mass': 0}, 'particles.mass', 'above 0, infinity included'),
    ({'position': [[0, 0, 0]], 'mass': math.nan}, 'particles.mass', 'above 0'),
    ({'position': [[0, 0, 0]], 'mass': [1, 2]}, 'particles.mass', 'each of the 1 particles'),
    ({'position': [[0, 0, 0]], 'mass': [0]}, 'particles.mass[0]', 'above 0'),
    ({'position': [[0, 0, 0]], 'radius': -1}, 'particles.radius', 'from 0 upwards'),
    ({'position': [[0, 0, 0]], 'radius': math.inf}, 'particles.radius', 'finite'),
    ({'position': [[0, 0, 0]], 'radius': np.ones((1, 1))}, 'particles.radius[0]', 'finite'),
], ids=brief)
def test_bad_particles(section, key, words):
    error = refused(particles_of, section)
    assert error.key == key
    assert words in str(error)


# What is refused


@pytest.mark.parametrize('path, key', [
    (['gravity'], 'gravity'),
    (['drag', 'linear'], 'drag.linear'),
    (['drag', 'quadratic'], 'drag.quadratic'),
    (['drag', 'wind'], 'drag.wind'),
    (['particles', 'count'], 'particles.count'),
    (['particles', 'box', 'min'], 'particles.box.min'),
    (['particles', 'seed'], 'particles.seed'),
    (['particles', 'velocity'], 'particles.velocity'),
    (['particles', 'mass'], 'particles.mass'),
    (['particles', 'radius'], 'particles.radius'),
    (['restitution'], 'restitution'),
    (['friction', 'dry'], 'friction.dry'),
    (['colliders', 0, 'name'], 'colliders[0].name'),
    (['colliders', 0, 'shape'], 'colliders.ground.shape'),
    (['colliders', 0, 'point'], 'colliders.ground.point'),
    (['colliders', 0, 'normal'], 'colliders.ground.normal'),
    (['colliders', 1, 'radius'], 'colliders.ball.radius'),
    (['colliders', 1, 'position'], 'colliders.ball.position'),
    (['colliders', 2, 'size'], 'colliders.paddle.size'),
    (['colliders', 2, 'orientation'], 'colliders.paddle.orientation'),
    (['colliders', 2, 'topic'], 'colliders.paddle.topic'),
    (['colliders', 2, 'restitution'], 'colliders.paddle.restitution'),
    (['colliders', 3, 'length'], 'colliders.drum.length'),
    (['colliders', 3, 'motion', 'angular_velocity'], 'colliders.drum.motion.angular_velocity'),
    (['colliders', 3, 'motion', 'oscillate', 'axis'], 'colliders.drum.motion.oscillate.axis'),
    (['colliders', 3, 'motion', 'oscillate', 'amplitude'],
     'colliders.drum.motion.oscillate.amplitude'),
    (['colliders', 3, 'motion', 'oscillate', 'frequency'],
     'colliders.drum.motion.oscillate.frequency'),
    (['colliders', 3, 'friction', 'dry', 'static'], 'colliders.drum.friction.dry.static'),
    (['colliders', 3, 'friction', 'wet', 'coefficient'],
     'colliders.drum.friction.wet.coefficient'),
    (['colliders', 3, 'friction', 'wet', 'form'], 'colliders.drum.friction.wet.form'),
    (['stepping', 'dt'], 'stepping.dt'),
    (['stepping', 'method'], 'stepping.method'),
    (['stepping', 'detection'], 'stepping.detection'),
    (['stepping', 'flight'], 'stepping.flight'),
    (['stepping', 'iterations'], 'stepping.iterations'),
    (['stepping', 'repulsion'], 'stepping.repulsion'),
    (['stepping', 'repulsion_speed'], 'stepping.repulsion_speed'),
], ids=lambda value: value if isinstance(value, str) else '')
@pytest.mark.parametrize('value', [
    '0.5 m', '1e-3', True, math.nan, -math.inf, -1, -10 ** 400, None, [], [1, 2],
    [[1, 2, 3], [4]], [0, 0, math.nan], [0, 0, '1'], {1, 2}, b'1', 1j, object(),
    datetime.date(2026, 1, 1)], ids=nameless)
def test_wrong_values_everywhere(path, key, value):
    error = refused(full_with, *path, value)
    # Lists name the entry, and a velocity of vectors the first bad vector.
    assert error.key == key or error.key.startswith(f'{key}[')


@pytest.mark.parametrize('path, key', [
    ([], 'scene'), (['drag'], 'drag'), (['particles'], 'particles'),
    (['particles', 'box'], 'particles.box'), (['friction'], 'friction'),
    (['colliders', 1], 'colliders[1]'), (['colliders', 3, 'motion'], 'colliders.drum.motion'),
    (['colliders', 3, 'motion', 'oscillate'], 'colliders.drum.motion.oscillate'),
    (['colliders', 3, 'friction'], 'colliders.drum.friction'), (['stepping'], 'stepping'),
], ids=str)
@pytest.mark.parametrize('value', [5, 'text', [1], np.ones(3)], ids=str)
def test_wrong_sections(path, key, value):
    mapping = changed(path, value) if path else value
    error = refused(Scene.from_dict, mapping)
    assert error.key == key
    assert 'mapping' in error.allowed


@pytest.mark.parametrize('path, value, message', [
    (['restitution'], 1.5, 'restitution: 1.5: must be a number from 0 to 1'),
    (['restitution'], -0.1, 'restitution: -0.1: must be a number from 0 to 1'),
    (['restitution'], '0.5',
     "restitution: '0.5': must be a number from 0 to 1, written without quotes"),
    (['gravity'], [0, 0], 'gravity: [0, 0]: must be 3 finite numbers'),
    (['gravity'], [0, 0, '1e3'],
     "gravity: [0, 0, '1e3']: must be 3 finite numbers, written without quotes"),
    (['friction'], {}, 'friction: {}: must be none or a mapping with dry, wet or both'),
    (['friction'], {'dry': -0.1},
     'friction.dry: -0.1: must be a finite number from 0 upwards'),
    (['friction'], {'dry': {'static': 0.4}},
     'friction.dry.kinetic: missing: must be a finite number from 0 upwards'),
    (['friction'], {'dry': {'static': 0.2, 'kinetic': 0.3}},
     "friction.dry: {'kinetic': 0.3, 'static': 0.2}: static friction must be at least the kinetic "
     'one (0.2 < 0.3)'),
    (['friction'], {'wet': {'form': 'capped'}},
     'friction.wet.coefficient: missing: must be a finite number from 0 upwards'),
    (['friction'], {'wet': {'coefficient': 1, 'form': 'cubic'}},
     "friction.wet.form: 'cubic': must be one of exponential, capped, linear"),
    (['friction'], {'damp': 1}, 'friction.damp: 1: unknown key; '
                                'the nearest known one is dry (known: dry, wet)'),
    (['colliders'], {'ground': {}}, "colliders: {'ground': {}}: must be a list of colliders"),
    (['colliders', 0, 'shape'], 'torus', "colliders.ground.shape: 'torus': "
     'must be one of plane, sphere, box, capsule, cylinder, mesh'),
    (['colliders', 0, 'normal'], [0, 0, 0],
     'colliders.ground.normal: [0, 0, 0]: must be 3 finite numbers, not all of them 0'),
    (['colliders', 1, 'radius'], 0, 'colliders.ball.radius: 0: must be a finite number above 0'),
    (['colliders', 1, 'radius'], ...,
     'colliders.ball.radius: missing: must be a finite number above 0'),
    (['colliders', 1, 'name'], 'ground',
     "colliders[1].name: 'ground': must be unique in the scene"),
    (['colliders', 1, 'inside'], 'yes', "colliders.ball.inside: 'yes': must be true or false"),
    (['colliders', 2, 'size'], [1, 0, 1],
     'colliders.paddle.size: [1, 0, 1]: must be 3 finite numbers above 0'),
    (['colliders', 2, 'orientation'], [0, 0, 0, 1.01], 'colliders.paddle.orientation: '
     '[0, 0, 0, 1.01]: must be a unit quaternion x, y, z, w (norm within 0.001 of 1)'),
    (['colliders', 2, 'motion'], {'linear_velocity': [1, 0, 0]}, 'colliders.paddle.topic: '
     "'paddle/pose': must be absent where the collider has a motion"),
    (['colliders', 2, 'topic'], 'paddle pose',
     "colliders.paddle.topic: 'paddle pose': must be a valid topic name such as paddle/pose"),
    (['stepping', 'method'], 'event', "stepping.method: 'event': "
     'must be one of single_pass, multi_pass, collision_then_contact, second_order_contact, '
     'exact'),
    (['stepping', 'detection'], 'path',
     "stepping.detection: 'path': must be one of end_of_step, trajectory"),
    (['stepping', 'dt'], -1e-3, 'stepping.dt: -0.001: must be a finite number from 0 upwards'),
    (['stepping', 'iterations'], 0,
     'stepping.iterations: 0: must be a whole number from 1 to 10000'),
    (['stepping', 'repulsion'], 0,
     'stepping.repulsion: 0: must be a number above 0 and at most 1'),
], ids=brief)
def test_messages(path, value, message):
    assert str(refused(full_with, *path, value)) == message


@pytest.mark.parametrize('path, key, nearest', [
    (['restituton'], 'restituton', 'restitution'),
    (['spring'], 'spring', 'springs'),
    (['pair'], 'pair', 'pairs'),
    ([5], '5', None),
    ([None], 'None', None),
    ([(1, 2)], '(1, 2)', None),
    (['a\nb'], "'a\\nb'", None),
    (['x' * 10_000], 'x' * 80, None),
    (['drag', 'cubic'], 'drag.cubic', 'quadratic'),
    (['particles', 'positions'], 'particles.positions', 'position'),
    (['particles', 'box', 'mn'], 'particles.box.mn', 'min'),
    (['colliders', 0, 'position'], 'colliders.ground.position', None),
    (['colliders', 0, 'inside'], 'colliders.ground.inside', None),
    (['colliders', 1, 'raduis'], 'colliders.ball.raduis', 'radius'),
    (['colliders', 1, 'size'], 'colliders.ball.size', None),
    (['colliders', 3, 'motion', 'velocity'], 'colliders.drum.motion.velocity', 'linear_velocity'),
    (['colliders', 3, 'friction', 'dry', 'sticky'], 'colliders.drum.friction.dry.sticky',
     'static'),
    (['stepping', 'Dt'], 'stepping.Dt', 'dt'),
], ids=brief)
def test_unknown_keys_name_the_nearest(path, key, nearest):
    error = refused(full_with, *path, 1)
    assert error.key == key
    assert 'unknown key; the nearest known one is' in error.allowed and 'known: ' in error.allowed
    if nearest is not None:
        assert f'the nearest known one is {nearest} ' in error.allowed


@pytest.mark.parametrize('name', ['', '1a', 'a b', 'a.b', 'é', 'a\n', 'a' * 101, '_a', 5, None])
def test_bad_names(name):
    error = refused(full_with, 'colliders', 2, 'name', name)
    assert error.key == 'colliders[2].name'


def test_misspelt_name_is_found():
    entry = {'nmae': 'ground', 'shape': 'plane'}
    error = refused(Scene.from_dict, {'colliders': [entry]})
    assert error.key == 'colliders[0].nmae' and 'name' in error.allowed


@pytest.mark.parametrize('topic', [
    '', '/', 'a/', 'a//b', '1a', 'a/1', '~a', '~', 'a b', 'a-b', 'a\n', 'é', 'a' * 200])
def test_bad_topics(topic):
    assert refused(full_with, 'colliders', 2, 'topic', topic).key == 'colliders.paddle.topic'


def test_recursive_and_huge_values_have_short_messages():
    loop = []
    loop.append(loop)
    for value in (loop, [loop] * 3, {'a': loop}, list(range(10 ** 5)), 'x' * 10 ** 6,
                  10 ** 6000, [10 ** 6000] * 4, np.ones((1000, 1000))):
        assert refused(Scene.from_dict, {'gravity': value}).key == 'gravity'
        assert refused(Scene.from_dict, {'particles': {'position': [value]}})


def test_nothing_is_applied_on_error():
    mapping = changed(['stepping', 'dt'], -1)
    before = copy.deepcopy(mapping)
    refused(Scene.from_dict, mapping)
    assert mapping == before
    scene = Scene.from_dict(FULL)
    parameters = scene.parameters()
    refused(scene.with_parameter, 'restitution', 2)
    refused(scene.with_parameter, 'colliders.drum.friction.dry.kinetic', 0.5)
    assert scene.parameters() == parameters


def test_error_can_be_pickled():
    error = refused(full_with, 'restitution', 2)
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


# YAML files


def load_text(path, text):
    path.write_text(text, encoding='utf-8')
    return load_scene(path)


@pytest.mark.parametrize('text, number', [
    ('1e-3', 1e-3), ('1E3', 1e3), ('+1e3', 1e3), ('1.5e3', 1.5e3), ('1.e3', 1e3), ('5', 5.0),
    ('-0.5', -0.5), ('-.5', -0.5), ('+.5', 0.5), ('.5e1', 5.0), ('-.5E-1', -0.05), ('5.', 5.0),
    ('010', 10.0), ('-010', -10.0), ('0o10', 8.0), ('0x1F', 31.0), ('00.5', 0.5), ('08', 8.0),
    ('010e1', 100.0)])
def test_yaml_numbers(tmp_path, text, number):
    """As the core schema of YAML 1.2 reads them."""
    scene = load_text(tmp_path / 'scene.yaml', f'gravity: [0, 0, {text}]')
    assert scene.gravity == (0.0, 0.0, number)
    scene = load_text(tmp_path / 'scene.yaml', f'drag: {{wind: [0, 0, {text}]}}')
    assert scene.drag.wind == (0.0, 0.0, number)


@pytest.mark.parametrize('text', [
    '1:30', '1:30.5', '1_000', '1_0.5', '0b11', '0o9', '+0x1', '.', '.e3', '1e', '+.inf', '.nan',
    '2020-01-01', 'yes', 'off', 'true', '~'])
def test_what_yaml_does_not_read_as_a_number_is_refused(tmp_path, text):
    error = refused(load_text, tmp_path / 'scene.yaml', f'gravity: [0, 0, {text}]')
    assert error.key == 'gravity' and 'quotes' not in str(error)


@pytest.mark.parametrize('text', ['yes', 'no', 'on', 'off', 'Yes', 'OFF', 'y'])
def test_words_that_were_flags_in_old_yaml_are_words(tmp_path, text):
    content = f'colliders: [{{name: {text}, shape: sphere, radius: 1, inside: %s}}]'
    assert load_text(tmp_path / 'scene.yaml', content % 'true').colliders[0].name == text
    error = refused(load_text, tmp_path / 'scene.yaml', content % text)
    assert error.key.endswith('inside') and error.value == text


def test_yaml_infinite_mass(tmp_path):
    scene = load_text(tmp_path / 'scene.yaml', 'particles: {position: [[0, 0, 0]], mass: .inf}')
    assert scene.particles.mass == math.inf


@pytest.mark.parametrize('text, words', [
    ('', 'must be a mapping'),
    ('[1, 2]', 'must be a mapping'),
    ('gravity: [0, 0, 1]\nfriction: none\ngravity: [0, 0, 2]', 'line 3: the key gravity is given'),
    ('colliders:\n- {name: a, name: b}', 'line 2: the key name is given twice'),
    ('gravity: [0, 0', 'line 1'),
    ('a: !!python/object:os.system x', 'line 1'),
    ('a: !!bool x', 'KeyError'),
    ('a: !!float ""', 'IndexError'),
    ('a: !!map [1]', 'line 1'),
    ('a: !!timestamp 2026-99-99', 'ValueError'),
    ('a: ' + '9' * 5000, 'ValueError'),
    ('? [a]\n: b', 'line 1'),
    ('a: 1\n---\nb: 2', 'line 2'),
    ('[' * 5000, 'RecursionError'),
    ('a: \x01', 'special characters'),
], ids=lambda value: value[:40])
def test_bad_yaml(tmp_path, text, words):
    error = refused(load_text, tmp_path / 'scene.yaml', text)
    assert error.key == 'scene' and words in str(error)


def test_yaml_in_another_encoding(tmp_path):
    (tmp_path / 'scene.yaml').write_bytes('friction: none # \xe9'.encode('latin-1'))
    assert refused(load_scene, tmp_path / 'scene.yaml').key == 'scene'


def test_merged_keys(tmp_path):
    scene = load_text(tmp_path / 'scene.yaml', """
colliders:
- &ball {name: first, shape: sphere, radius: 1, restitution: 0.5}
- {<<: *ball, name: second, restitution: 0.7}
- {<<: [{name: third}, *ball]}
""")
    assert [c.name for c in scene.colliders] == ['first', 'second', 'third']
    assert [c.restitution for c in scene.colliders] == [0.5, 0.7, 0.5]
    levels = ''.join(f'k{i}: &k{i} {{<<: [*k{i - 1}, *k{i - 1}]}}\n' for i in range(1, 60))
    refused(load_text, tmp_path / 'bomb.yaml', 'k0: &k0 {a: 1}\n' + levels)


@pytest.mark.parametrize('name', shipped_scenes())
def test_shipped_scenes(name):
    scene = load_scene(name)
    assert scene.colliders and len(scene.particles.position)
    assert load_scene(f'{name}.yaml').parameters() == scene.parameters()


def test_demo_scene():
    scene = load_scene('demo')
    assert scene.collider('paddle').topic == 'paddle/pose'
    assert any(collider.motion for collider in scene.colliders)
    assert {'belt', 'cloth', 'demo', 'incline', 'rain'} <= set(shipped_scenes())


def test_file_comes_before_shipped_scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'demo.yaml').write_text('restitution: 0.25')
    assert load_scene('demo.yaml').restitution == 0.25
    assert load_scene('demo').restitution == 0.5


@pytest.mark.parametrize('name', ['nothing', '', '../scenes/demo', 'a\0b', 'x' * 5000, '.', None,
                                  5, b'demo'], ids=lambda value: repr(value)[:20])
def test_absent_scene(name):
    error = refused(load_scene, name)
    assert error.key == 'scene'
    if isinstance(name, str):
        assert 'shipped scenes belt, cloth, demo, incline, rain' in error.allowed


# Parameters


def test_parameters():
    parameters = Scene.from_dict(FULL).parameters()
    assert list(parameters) == [
        'gravity', 'drag.linear', 'drag.quadratic', 'drag.wind', 'restitution', 'friction.dry',
        'colliders.ground.restitution', 'colliders.ground.friction.dry',
        'colliders.ball.restitution',
        'colliders.paddle.restitution', 'colliders.paddle.friction.dry',
        'colliders.drum.restitution', 'colliders.drum.friction.dry.static',
        'colliders.drum.friction.dry.kinetic', 'colliders.drum.friction.wet',
        'colliders.pill.restitution', 'colliders.pill.friction.dry', 'stepping.iterations']
    assert parameters['restitution'][:4] == (0.5, '', 0.0, 1.0)
    assert parameters['gravity'][:4] == ((0.0, 0.0, -9.81), 'm/s^2', None, None)
    assert parameters['colliders.drum.friction.wet'][:4] == (2.0, 's/m', 0.0, None)
    assert parameters['stepping.iterations'][:4] == (7, '', 1, 10_000)
    assert all(parameter.description for parameter in parameters.values())
    assert list(Scene.from_dict({}).parameters()) == ['gravity', 'restitution',
                                                      'stepping.iterations']


def test_every_parameter_can_be_set_to_its_own_value():
    scene = Scene.from_dict(FULL)
    for path, parameter in scene.parameters().items():
        assert scene.with_parameter(path, parameter.value).parameters() == scene.parameters()


@pytest.mark.parametrize('path, value', [
    ('gravity', (0.0, 0.0, 1.0)), ('drag.linear', 0.0), ('drag.quadratic', 2.0),
    ('drag.wind', (1.0, 2.0, 3.0)), ('restitution', 0.25), ('friction.dry', 0.75),
    ('friction.wet', 1.0), ('colliders.ground.restitution', 1.0),
    ('colliders.ground.friction.dry', 0.0), ('colliders.ball.friction.dry', 0.1),
    ('colliders.ball.friction.wet', 0.1), ('colliders.drum.friction.dry.static', 0.9),
    ('colliders.drum.friction.dry.kinetic', 0.2), ('stepping.iterations', 3)])
def test_with_parameter(path, value):
    scene = Scene.from_dict(FULL)
    before = scene.parameters()
    after = scene.with_parameter(path, value).parameters()
    assert after[path].value == value
    assert scene.parameters() == before
    inherited = {'restitution', 'friction.dry', 'friction.wet'}
    if path not in inherited:
        assert {p: v for p, v in after.items() if p != path} == {
            p: v for p, v in before.items() if p != path}


def test_defaults_reach_the_colliders_without_their_own():
    scene = Scene.from_dict(FULL).with_parameter('restitution', 0.1)
    scene = scene.with_parameter('friction.dry', 0.2)
    found = {path: parameter.value for path, parameter in scene.parameters().items()}
    assert found['colliders.ground.restitution'] == 0.1
    assert found['colliders.paddle.restitution'] == 0.9
    assert found['colliders.ground.friction.dry'] == 0.2
    assert found['colliders.drum.friction.dry.static'] == 0.4


def own(scene):
    """Name what of restitution and friction is not the scene's, by part."""
    parts = {collider.name: collider for collider in scene.colliders} | {'pairs': scene.pairs}
    return {(name, law) for name, part in parts.items() for law in ('restitution', 'friction')
            if getattr(part, law) is not None}


WITH_PAIRS = {'restitution': 0.5, 'friction': {'dry': {'static': 0.4, 'kinetic': 0.3}},
              'particles': {'position': [[0, 0, 1]], 'radius': 0.1}, 'pairs': {},
              'colliders': [
                  {'name': 'ground', 'shape': 'plane'},
                  {'name': 'wall', 'shape': 'plane', 'restitution': 0.5, 'friction': {'wet': 1}}]}


@pytest.mark.parametrize('order', [1, -1])
def test_all_values_as_they_are_change_nothing(order):
    """Loading what was dumped keeps who follows the scene, and who has a value of its own."""
    scene = Scene.from_dict(WITH_PAIRS)
    values = [(path, parameter.value) for path, parameter in scene.parameters().items()]
    after = scene.with_parameters(values[::order])
    assert own(after) == own(scene) == {('wall', 'restitution'), ('wall', 'friction')}
    higher = after.with_parameter('restitution', 0.75)
    assert higher.restitution_of(higher.collider('ground')) == 0.75
    assert higher.pairs.restitution_in(higher) == 0.75
    assert higher.restitution_of(higher.collider('wall')) == 0.5


@pytest.mark.parametrize('order', [1, -1])
def test_all_values_of_another_scene_bring_who_follows(order):
    """Whatever the values are now, and in which order they come."""
    scene = Scene.from_dict(WITH_PAIRS)
    values = [(path, parameter.value) for path, parameter in scene.parameters().items()]
    other = scene.with_parameters([
        ('restitution', 0.1), ('colliders.ground.restitution', 0.2), ('pairs.restitution', 0.3),
        ('colliders.ground.friction.dry.kinetic', 0.1), ('friction.dry.static', 0.9)])
    assert own(other) >= {('ground', 'restitution'), ('ground', 'friction'),
                          ('pairs', 'restitution')}
    assert own(other.with_parameters(values[::order])) == own(scene)


def test_a_value_other_than_the_scene_s_is_one_s_own():
    scene = Scene.from_dict(WITH_PAIRS).with_parameters([
        ('colliders.ground.restitution', 0.5), ('restitution', 0.75), ('pairs.restitution', 0.75)])
    assert ('ground', 'restitution') in own(scene) and ('pairs', 'restitution') not in own(scene)
    scene = scene.with_parameter('restitution', 0.5).with_parameter('restitution', 0.25)
    assert scene.restitution_of(scene.collider('ground')) == 0.5    # only met on the way


@pytest.mark.parametrize('start, path, value, end', [
    ('none', 'dry', 0.3, Friction(0.3, 0.3)),
    ('none', 'dry.static', 0.3, Friction(0.3, 0.3, apart=True)),
    ('none', 'dry.kinetic', 0.3, Friction(0.3, 0.3, apart=True)),
    ('none', 'wet', 0.3, Friction(wet=0.3)),
    ({'dry': 0.3}, 'dry.static', 0.4, Friction(0.4, 0.3, apart=True)),
    ({'dry': {'static': 0.4, 'kinetic': 0.3}}, 'dry', 0.2, Friction(0.2, 0.2, apart=True)),
    ({'wet': {'coefficient': 1, 'form': 'capped'}}, 'wet', 2,
     Friction(wet=2.0, wet_form='capped')),
], ids=str)
def test_changes_of_friction(start, path, value, end):
    scene = Scene.from_dict({'friction': start})
    assert scene.with_parameter(f'friction.{path}', value).friction == end


@pytest.mark.parametrize('path, value', [
    ('restitution', 1.5), ('restitution', '0.5'), ('restitution', True), ('restitution', None),
    ('gravity', 9.81), ('gravity', (0, 0, math.nan)), ('drag.linear', -1), ('drag.wind', [1]),
    ('friction.dry', math.inf), ('friction.wet', -1), ('friction.dry.kinetic', 0.5),
    ('colliders.ball.restitution', -1), ('colliders.drum.friction.dry.static', 0.1),
    ('stepping.iterations', 2.0), ('stepping.iterations', 0)])
def test_bad_parameter_values(path, value):
    error = refused(Scene.from_dict(FULL).with_parameter, path, value)
    assert error.key == path and error.value is value


@pytest.mark.parametrize('path, nearest', [
    ('restituton', 'restitution'), ('drag', 'drag.wind'), ('friction', None),
    ('friction.dry.mean', None), ('colliders.bal.restitution', 'colliders.ball.restitution'),
    ('colliders.ball.radius', None), ('stepping.dt', None), ('', None), ('.', None),
    (None, None), (5, None), (['gravity'], None), (np.ones(3), None)], ids=str)
def test_unknown_parameters(path, nearest):
    error = refused(Scene.from_dict(FULL).with_parameter, path, 0.5)
    assert 'the nearest known one is' in error.allowed
    if nearest is not None:
        assert f'is {nearest} ' in error.allowed


def test_drag_that_is_absent_is_no_parameter():
    refused(Scene.from_dict({}).with_parameter, 'drag.linear', 0.5)


# Fuzz: a scene is read, or a SceneError is raised; nothing else happens.

KEYS = ['gravity', 'drag', 'linear', 'wind', 'particles', 'count', 'box', 'min', 'max', 'seed',
        'velocity', 'sphere', 'position', 'file', 'mass', 'radius', 'restitution', 'friction',
        'dry', 'static', 'kinetic', 'wet', 'coefficient', 'form', 'colliders', 'name', 'shape',
        'point', 'normal', 'size', 'length', 'inside', 'orientation', 'topic', 'motion',
        'angular_velocity', 'oscillate', 'axis', 'amplitude', 'stepping', 'dt', 'method']
WORDS = ['none', 'plane', 'box', 'sphere', 'linear', 'capped', 'a', 'points.npy', 'multi_pass']
LEAVES = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.sampled_from(WORDS), st.text(),
    st.binary(max_size=5), st.dates(), st.just(10 ** 400),
    st.lists(st.floats(0, 2), min_size=3, max_size=4))
DATA = st.recursive(LEAVES, lambda inner: st.one_of(
    st.lists(inner, max_size=4), st.tuples(inner, inner, inner),
    st.dictionaries(st.one_of(st.sampled_from(KEYS), st.text(max_size=3), st.integers()), inner,
                    max_size=5)))


def reads_or_refuses(mapping):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(particles_module, 'COUNT', replace(particles_module.COUNT, high=1000))
        try:
            scene = Scene.from_dict(mapping, '/nonexistent')
        except SceneError as error:
            assert error.key and str(error)
            return
    for path, parameter in scene.parameters().items():
        assert scene.with_parameter(path, parameter.value).parameters() == scene.parameters()
    assert np.all(np.isfinite(scene.particles.position))
    assert np.all(np.isfinite(scene.particles.velocity))


@settings(deadline=None, max_examples=300)
@given(DATA)
def test_fuzz_any_data(data):
    reads_or_refuses(data)


@settings(deadline=None, max_examples=300)
@given(st.dictionaries(st.sampled_from(['gravity', 'drag', 'particles', 'restitution', 'friction',
                                        'colliders', 'stepping']), DATA))
def test_fuzz_sections(data):
    reads_or_refuses(data)


def places(value, path=()):
    """List the paths of all entries of nested mappings and lists."""
    found = [path] if path else []
    if isinstance(value, (dict, list)):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            found += places(inner, (*path, key))
    return found


@settings(deadline=None, max_examples=500)
@given(st.sampled_from(places(FULL)), st.one_of(LEAVES, DATA))
def test_fuzz_one_place(path, value):
    reads_or_refuses(changed(path, value))


@settings(deadline=None, max_examples=300)
@given(st.one_of(st.text(), st.text(alphabet='ab:-[]{},&*!|>\'"#?<%@ \n\t.0189e')))
def test_fuzz_text(tmp_path_factory, text):
    path = tmp_path_factory.getbasetemp() / 'fuzz.yaml'
    path.write_text(text, encoding='utf-8', errors='surrogatepass')
    try:
        load_scene(path)
    except SceneError as error:
        assert error.key
