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

"""What pip, colcon and rosdep read: package.xml, setup.py, the change log, launch files."""

import ast
import os
from pathlib import Path
import re
import runpy
import shutil
import subprocess
import sys
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest
from stand_in_launch import nodes_of

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'collision_sim'
LAUNCH_FILES = sorted((PACKAGE / 'launch').glob('*.launch.py'))
NO_CATKIN = 'catkin_pkg is not installed'
NO_LAUNCH = 'launch comes with an installed ROS only'


@pytest.fixture
def setup(monkeypatch):
    """Keyword arguments that setup.py hands to setuptools; setuptools itself is not needed."""
    arguments = {}
    fake = SimpleNamespace(setup=arguments.update, find_packages=lambda include: include)
    monkeypatch.setitem(sys.modules, 'setuptools', fake)
    monkeypatch.chdir(ROOT)
    runpy.run_path('setup.py')
    return arguments


def console_scripts(setup):
    """Name of each console script -> its `module:function`."""
    return dict(re.split(r'\s*=\s*', line) for line in setup['entry_points']['console_scripts'])


def test_package_xml_is_valid():
    # colcon falls back to a plain Python build, without a word, when it is not.
    package = pytest.importorskip('catkin_pkg.package', reason=NO_CATKIN)
    warnings = []
    manifest = package.parse_package(str(ROOT), warnings=warnings)
    manifest.validate(warnings=warnings)
    assert warnings == []
    assert manifest.get_build_type() == 'ament_python'
    assert manifest.licenses == ['Apache-2.0']


def test_one_version(setup):
    headings = re.findall(r'^(\S+) \(\d{4}-\d\d-\d\d\)\n-+$',
                          (ROOT / 'CHANGELOG.rst').read_text(), re.MULTILINE)
    manifest = ElementTree.parse(ROOT / 'package.xml')
    assert manifest.findtext('version') == setup['version'] == headings[0]


def test_changelog_is_in_the_form_that_ros_releases_read(setup):
    changelog = pytest.importorskip('catkin_pkg.changelog', reason=NO_CATKIN)
    history = changelog.get_changelog_from_path(str(ROOT))
    assert setup['version'] in [version for version, _, _ in history.foreach_version()]


def test_maintainers_and_license_agree(setup):
    manifest = ElementTree.parse(ROOT / 'package.xml')
    maintainer = manifest.find('maintainer')
    assert maintainer.get('email') == setup['maintainer_email']
    assert maintainer.text == setup['maintainer']
    assert manifest.findtext('license') == setup['license']


def test_extras(setup):
    assert setup['extras_require']['ros'] == [
        'ros-jazzy-common-interfaces', 'ros-jazzy-rclpy', 'ros-jazzy-rmw-fastrtps-cpp']
    # colcon looks for pytest there before it runs these tests.
    assert 'pytest' in setup['extras_require']['test']


def test_every_imported_ros_package_is_declared():
    manifest = ElementTree.parse(ROOT / 'package.xml')
    declared = {element.text for tag in ('depend', 'exec_depend') for element in
                manifest.iter(tag)}
    pattern = re.compile(r'^\s*(?:from|import) (rclpy|launch\w*|\w+_(?:msgs|srvs|interfaces))\b',
                         re.MULTILINE)
    sources = [path.read_text() for name in ('ros', 'launch')
               for path in (PACKAGE / name).rglob('*.py')]
    assert {name for text in sources for name in pattern.findall(text)} <= declared


@pytest.mark.parametrize('folder', ['config', 'docs', 'launch', 'scenes', 'rviz'])
def test_shared_files_are_installed_for_pip_and_for_ros(setup, folder):
    """Those of folders below it too, each in its place."""
    present = {str(path) for path in (PACKAGE / folder).rglob('*')
               if path.is_file() and '__pycache__' not in path.parts}
    place = f'share/collision_sim/{folder}'
    shared = {name: share for share, names in setup['data_files'] for name in names
              if share == place or share.startswith(f'{place}/')}
    assert {str(ROOT / name) for name in shared} == present
    assert all(f'share/{Path(name).parent}' == share for name, share in shared.items())
    patterns = setup['package_data']['collision_sim']
    packed = {str(path) for pattern in patterns for path in PACKAGE.glob(pattern)}
    assert present <= packed


def test_the_package_is_in_the_ament_index(setup):
    files = dict(setup['data_files'])
    marker, = files['share/ament_index/resource_index/packages']
    assert Path(marker).name == 'collision_sim'
    assert (ROOT / marker).is_file()
    assert files['share/collision_sim'] == ['package.xml']


def test_console_scripts_exist(setup):
    for target in console_scripts(setup).values():
        module, function = target.split(':')
        tree = ast.parse((ROOT / module.replace('.', '/')).with_suffix('.py').read_text())
        assert function in [node.name for node in tree.body if isinstance(node, ast.FunctionDef)]


def test_pip_also_puts_the_executables_where_ros_looks(monkeypatch, tmp_path):
    """There they call those that pip has made; colcon, which makes its own there, has none."""
    found = {}
    fake = SimpleNamespace(setup=found.update, find_packages=lambda include: include)
    monkeypatch.setitem(sys.modules, 'setuptools', fake)
    monkeypatch.chdir(ROOT)
    for command, present in (('install', False), ('bdist_wheel', True)):
        monkeypatch.setattr(sys, 'argv', ['setup.py', command])
        runpy.run_path('setup.py')
        assert ('lib/collision_sim' in dict(found['data_files'])) == present
    files = dict(found['data_files'])['lib/collision_sim']
    assert {Path(name).name for name in files} == console_scripts(found).keys() - {'collision_sim'}
    for folder in ('bin', 'lib/collision_sim'):
        (tmp_path / folder).mkdir(parents=True)
    for name in files:
        assert os.access(name, os.X_OK)
        copy = shutil.copy(name, tmp_path / 'lib' / 'collision_sim')
        script = tmp_path / 'bin' / Path(name).name
        script.write_text('#!/bin/sh\necho "$0" "$@"\n')
        script.chmod(0o755)
        printed = subprocess.run([copy, '--ros-args', 'a b'], capture_output=True, text=True)
        assert Path(printed.stdout.split()[0]).resolve() == script
        assert printed.stdout.strip().endswith('--ros-args a b')


@pytest.mark.parametrize('path', LAUNCH_FILES, ids=lambda path: path.name)
def test_launch_files_start_what_is_installed(setup, path):
    nodes = nodes_of(path)
    assert {node.package for node in nodes} == {'collision_sim'}
    assert {node.executable for node in nodes} <= set(console_scripts(setup))


@pytest.mark.parametrize('path', LAUNCH_FILES, ids=lambda path: path.name)
def test_launch_file_loads(path):
    pytest.importorskip('launch_ros', reason=NO_LAUNCH)
    launch = pytest.importorskip('launch', reason=NO_LAUNCH)
    description = runpy.run_path(str(path))['generate_launch_description']()
    context = launch.LaunchContext()
    for entity in description.entities:
        entity.visit(context)
    assert {argument.name for argument in description.get_launch_arguments()} >= {
        'scene', 'params_file', 'namespace', 'use_sim_time', 'log_level'}


def test_ci_runs_the_test_line_of_the_readme():
    script = (ROOT / '.ci' / 'run').read_text()
    line, = re.findall(r'^python3 -m venv .*$', script, re.MULTILINE)
    assert (ROOT / 'README.md').read_text().splitlines().count(line) == 1
    assert os.access(ROOT / '.ci' / 'run', os.X_OK)


@pytest.fixture(scope='module')
def workspace(tmp_path_factory):
    """Give a colcon workspace in which the package is built."""
    if shutil.which('colcon') is None:
        pytest.skip('colcon is not installed')
    folder = tmp_path_factory.mktemp('workspace')
    shutil.copytree(ROOT, folder / 'src' / 'collision_sim', ignore=shutil.ignore_patterns(
        '.git', '.venv', '.*_cache', '.hypothesis', '__pycache__', '*.egg-info', 'build',
        'install', 'log'))
    assert colcon(folder, 'build') == 0
    return folder


def colcon(folder, *words):
    return subprocess.run(['colcon', *words], cwd=folder, stdin=subprocess.DEVNULL).returncode


@pytest.mark.slow
def test_colcon_builds_a_ros_package(setup, workspace):
    prefix = workspace / 'install' / 'collision_sim'
    for folder, files in setup['data_files']:
        for name in files:
            assert (prefix / folder / Path(name).name).is_file()
    assert (prefix / 'share' / 'collision_sim' / 'hook' / 'ament_prefix_path.dsv').is_file()
    for name in console_scripts(setup):
        assert os.access(prefix / 'lib' / 'collision_sim' / name, os.X_OK)


@pytest.mark.slow
def test_colcon_test_runs_pytest(workspace):
    """And notices a failure: these few tests pass, and then one that cannot."""
    few = ['test/test_package.py', 'test/test_layers.py', 'test/test_copyright.py']
    test = ['test', '--pytest-args', '-k', 'not colcon']
    assert colcon(workspace, *test, *few) == 0 == colcon(workspace, 'test-result')
    results = ElementTree.parse(workspace / 'build' / 'collision_sim' / 'pytest.xml')
    assert {case.get('classname').split('.')[-1] for case in results.iter('testcase')} == {
        Path(name).stem for name in few}
    failing = workspace / 'src' / 'collision_sim' / 'test' / 'test_failing.py'
    failing.write_text('def test_failing():\n    assert False\n')
    colcon(workspace, *test, 'test/test_failing.py')
    assert colcon(workspace, 'test-result') == 1
