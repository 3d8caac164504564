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

"""`collision_sim compile`: what it says and gives, and that a run after it compiles nothing."""

import os
import subprocess
import sys
from time import perf_counter

from collision_sim import cli, load_scene, Scene, Simulation
from collision_sim.core import jit
from collision_sim.core.stepping import step_blocks
from collision_sim.preparing import prepare
from collision_sim.scene import shipped_scenes
from collision_sim.studies import compile as compiling
from numba import config
from numba.core import event
import pytest

SOON = 60.0             # s, with room for a machine that is busy; on an idle one it takes three
SMALL = 'particles: {position: [[0, 0, 1]]}\ncolliders: [{name: ground, shape: plane}]\n'


@pytest.fixture
def scene(tmp_path):
    """Give the path of a small scene."""
    path = tmp_path / 'small.yaml'
    path.write_text(SMALL)
    return str(path)


@pytest.fixture
def compiled():
    """Give a list that fills with the names of what is compiled."""
    names = []

    class Names(event.Listener):
        """Keeps the names."""

        def on_start(self, event):
            names.append(event.data['dispatcher'].py_func.__qualname__)

        def on_end(self, event):
            pass
    with event.install_listener('numba:compile', Names()):
        yield names


@pytest.mark.jit
def test_the_second_time_everything_is_there(scene, capsys):
    """It says so soon, and where the cache is; exit code 0."""
    assert cli.main(['compile', scene]) == 0
    capsys.readouterr()
    began = perf_counter()
    assert cli.main(['compile', scene]) == 0
    assert perf_counter() - began < SOON
    out, err = capsys.readouterr()
    assert out.startswith('everything is there (looked for ')
    assert out.endswith(f'cache: {step_blocks.stats.cache_path}\n')
    assert 'collision_sim:' not in err


@pytest.mark.jit
def test_what_is_compiled_is_said_and_kept(tmp_path):
    """For a new folder, in an image: a process after it compiles nothing."""
    (tmp_path / 'still.yaml').write_text(SMALL + 'stepping: {dt: 0.0}\n')
    environment = {**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path / 'numba')}

    def run():
        return subprocess.run([sys.executable, '-m', 'collision_sim.cli', 'compile', 'still.yaml'],
                              env={**environment, 'PYTHONPATH': os.pathsep.join(sys.path)},
                              cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    first, second = run(), run()
    assert 'still.yaml: ' in first and ' functions compiled in ' in first
    assert f'cache: {tmp_path}/numba/' in first
    assert second.startswith('everything is there')


@pytest.mark.parametrize('scenes', [['no_such_scene'], ['demo', 'bad.yaml']], ids=' '.join)
def test_a_scene_that_does_not_load(scenes, tmp_path, monkeypatch, capsys):
    """One line on stderr, exit code 2, and nothing is begun."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(config, 'DISABLE_JIT', 0)
    monkeypatch.setattr(compiling, '_folder', lambda: '/somewhere')
    monkeypatch.setattr(compiling, '_prepare_all', None)
    (tmp_path / 'bad.yaml').write_text('restitution: 2\n')
    assert cli.main(['compile', *scenes]) == 2
    err = capsys.readouterr().err
    assert err.startswith('collision_sim: ') and len(err.splitlines()) == 1
    assert 'restitution' in err or 'no_such_scene' in err


def test_nothing_can_be_compiled_or_kept(scene, monkeypatch, capsys):
    """Exit code 1, and what to do about it."""
    monkeypatch.setattr(config, 'DISABLE_JIT', 1)
    assert cli.main(['compile', scene]) == 1
    assert 'NUMBA_DISABLE_JIT is set' in capsys.readouterr().err
    monkeypatch.setattr(config, 'DISABLE_JIT', 0)
    monkeypatch.setattr(compiling, '_folder', lambda: None)
    assert cli.main(['compile', scene]) == 1
    assert 'set NUMBA_CACHE_DIR' in capsys.readouterr().err


def test_what_goes_wrong_on_the_way(scene, monkeypatch, capsys):
    """A scene that cannot be prepared, or a full disk: exit code 1, and the reason."""
    monkeypatch.setattr(config, 'DISABLE_JIT', 0)
    monkeypatch.setattr(compiling, '_folder', lambda: '/somewhere')
    for done, said in ((compiling.Done(0, 0, 1.0, 'SceneError: no'), f'{scene}: SceneError: no'),
                       (compiling.Done(9, 3, 1.0, ''), '3 functions could not be written')):
        monkeypatch.setattr(compiling, '_prepare_all', lambda scenes, done=done: {scene: done})
        assert cli.main(['compile', scene]) == 1
        assert said in capsys.readouterr().err


def test_an_error_in_a_process_is_handed_on(monkeypatch):
    def fail(scene, ledger):
        raise RuntimeError('no machine code today')
    monkeypatch.setattr(compiling, 'prepare', fail)
    assert compiling._prepare(None, False).error == 'RuntimeError: no machine code today'


@pytest.mark.jit
def test_a_cache_that_cannot_be_written_to_is_counted(monkeypatch):
    def full(self, name, data):
        raise OSError(28, 'No space left on device')

    @jit.entry
    def doubled(x):
        return 2.0 * x
    monkeypatch.setattr(jit.KernelFiles, '_write', full)
    before = jit.KernelCache.lost
    assert doubled(1.0) == 2.0 and jit.KernelCache.lost == before + 1


@pytest.mark.jit
@pytest.mark.slow
def test_all_modules_are_all(compiled, tmp_path, capsys):
    """After it neither a shipped scene compiles anything, nor a mix of what there is."""
    assert cli.main(['compile']) == 0
    del compiled[:]
    (tmp_path / 'mesh.obj').write_text(compiling.TETRAHEDRON)
    mesh = {'name': 'mesh', 'shape': 'mesh', 'file': 'mesh.obj', 'topic': 'mesh/pose'}
    mixed = {**compiling.BASE, 'drag': {'linear': 0.1, 'quadratic': 0.1},
             'friction': {'dry': {'static': 0.4, 'kinetic': 0.3}, 'wet': 0.1},
             'colliders': [compiling.GROUND, mesh]}
    scenes = [load_scene(name) for name in shipped_scenes()]
    scenes += [Scene.from_dict({**mixed, **more}, tmp_path) for more in (
        {}, {'stepping': {'detection': 'trajectory'}}, {'stepping': {'method': 'single_pass'}},
        {'springs': compiling.SPRINGS}, {'particles': compiling.SIZES, 'pairs': {}})]
    for each in scenes:
        for ledger in (False, True):
            prepare(each, ledger)
            assert not compiled


@pytest.mark.jit
@pytest.mark.parametrize('radius', [0.1, [0.1, 0.2]], ids=str)
def test_a_first_touch_is_prepared(compiled, radius):
    """Two balls that are apart at first and meet on the ground later: nothing is compiled then."""
    scene = Scene.from_dict({
        'particles': {'position': [[0, 0, 0.2], [0, 0, 1.0]], 'radius': radius},
        'pairs': {'restitution': 0.5}, 'colliders': [compiling.GROUND]})
    prepare(scene)
    del compiled[:]
    sim = Simulation(scene)
    sim.step(300)
    assert sim.counters['pair_collisions'] > 0 and not compiled
