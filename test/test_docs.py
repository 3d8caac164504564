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
The documentation: its examples run, its commands exist, its links lead somewhere.

Python blocks of a page run one after the other in a folder of their own. A YAML block is a scene;
one that begins with a comment such as `# my.yaml` is written to that file. Of the commands, `run`
and `sweep` are run for a moment; of the others it is checked that programs, options, parameters,
extras and files exist.
"""

import argparse
import ast
from importlib.util import find_spec
import os
from pathlib import Path
import re
import runpy
import shlex
import subprocess
import sys
from types import SimpleNamespace

from changelog_page import changelog_page
from collision_sim import cli
from collision_sim.checks import read_yaml
from collision_sim.scene import load_scene, Scene, shipped_scenes
import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'collision_sim'
DOCS = PACKAGE / 'docs'
PAGES = [ROOT / 'README.md', *sorted(DOCS.rglob('*.md'))]
BLOCK = re.compile(r'^```(\w*)\n(.*?)^```$', re.MULTILINE | re.DOTALL)
LINK = re.compile(r'\]\(([^)\s]+)\)')
LANGUAGES = {'bash', 'python', 'text', 'yaml'}
MOST_WORDS = 1200       # of README.md
MOMENT = ['--duration', '0.02']
# Modules and files that a page may need, and how the message is when they are absent.
NEEDED = {'rclpy.init': 'rclpy', 'from matplotlib': 'matplotlib', '--record': 'rosbags'}
OTHERS = {      # programs of others, and the first words that they may have
    '.ci/run': None, 'cd': None, 'colcon': ['build'], 'pip': ['install'], 'python3': ['-m'],
    'ros2': ['bag', 'launch', 'param', 'run', 'service', 'topic'], 'rosdep': ['install'],
    'rviz2': ['-d'], 'source': None}
PARAMETERS = {'swing_paddle': {'amplitude', 'period', 'rate', 'centre', 'topic', 'frame_id'}}
OF_OTHER_MODULES = {'pytest', 'venv', 'flake8', 'pydocstyle', 'mkdocs'}


def name_of(path):
    """Name of a page, below the root."""
    return str(path.relative_to(ROOT))


def blocks(page, language):
    """Blocks of a language on a page."""
    return [text for kind, text in BLOCK.findall(page.read_text()) if kind == language]


def commands(page):
    """Commands of the bash blocks of a page, as lists of words."""
    for text in blocks(page, 'bash'):
        yield from split(text)


def split(text):
    """Split lines of the shell into commands, each a list of words."""
    lexer = shlex.shlex(text.replace('\\\n', ' ').replace('\n', '\n;'), posix=True,
                        punctuation_chars=';&')
    lexer.whitespace_split, lexer.commenters, words = True, '#', []
    # A line break within quotation marks is a part of a word.
    for word in lexer:
        if set(word) <= set(';&'):
            if words:
                yield [each.replace('\n;', '\n') for each in words]
            words = []
        else:
            words.append(word)
    if words:
        yield [each.replace('\n;', '\n') for each in words]


def with_language(language):
    """Pages that have such a block."""
    return [page for page in PAGES if blocks(page, language)]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Give a folder to run a page in."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('MPLBACKEND', 'Agg')
    monkeypatch.setenv('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    return tmp_path


@pytest.fixture(scope='module')
def setup():
    """Keyword arguments that setup.py hands to setuptools."""
    arguments, before = {}, sys.modules.get('setuptools')
    sys.modules['setuptools'] = SimpleNamespace(
        setup=arguments.update, find_packages=lambda include: include)
    try:
        runpy.run_path(str(ROOT / 'setup.py'))
    finally:
        del sys.modules['setuptools']
        if before is not None:
            sys.modules['setuptools'] = before
    return arguments


def write_files(page, folder):
    """Write the YAML blocks that are files; give the scenes of all of them."""
    found = []
    for text in blocks(page, 'yaml'):
        named = re.match(r'# (\w+\.yaml)\n', text)
        path = folder / (named[1] if named else f'block_{len(found)}.yaml')
        path.write_text(text)
        found.append(path)
    return found


def need(text):
    """Skip where something that an example needs is absent."""
    for sign, module in NEEDED.items():
        if sign in text:
            pytest.importorskip(module, reason=f'{module} is not installed')


# ---------------------------------------------------------------- pages

@pytest.mark.parametrize('page', PAGES, ids=name_of)
def test_blocks_say_their_language(page):
    text = page.read_text()
    assert {kind for kind, _ in BLOCK.findall(text)} <= LANGUAGES
    assert len(re.findall('^```', text, re.MULTILINE)) == 2 * len(BLOCK.findall(text))


@pytest.mark.parametrize('page', PAGES, ids=name_of)
def test_links_lead_somewhere(page):
    for target in LINK.findall(page.read_text()):
        if re.match(r'https?://', target):
            continue
        path, _, anchor = target.partition('#')
        found = (page.parent / path).resolve() if path else page
        assert found.is_file(), target
        if page.parts[-1] != 'README.md':
            assert DOCS in found.parents, f'{target}: leads out of the web site'
        if anchor:
            headings = re.findall(r'^#+ (.*)$', found.read_text(), re.MULTILINE)
            assert anchor in [re.sub(r'[^\w -]', '', each).strip().lower().replace(' ', '-')
                              for each in headings], target


def test_every_page_is_in_the_menu():
    listed = re.findall(r'[\w/]+\.md', (PACKAGE / 'mkdocs.yml').read_text())
    assert sorted(listed) == sorted(str(page.relative_to(DOCS)) for page in PAGES[1:])


def test_every_page_is_named_in_the_readme():
    text = (ROOT / 'README.md').read_text()
    for page in PAGES[1:]:
        if page.name not in ('index.md', 'changelog.md'):
            assert name_of(page) in text


def test_the_readme_is_short():
    assert len((ROOT / 'README.md').read_text().split()) <= MOST_WORDS


def test_the_page_of_the_change_log():
    """Written by `python -m test.changelog_page`."""
    assert (DOCS / 'changelog.md').read_text() == changelog_page()


def test_parameters_of_the_node_are_all_in_the_reference():
    """With their defaults, as config/parameters.yaml has them."""
    text = (DOCS / 'reference' / 'node.md').read_text()
    given = read_yaml(PACKAGE / 'config' / 'parameters.yaml')['/**']['ros__parameters']
    for name, value in given.items():
        if '.' not in name and name not in ('gravity', 'restitution'):
            row, = re.findall(rf'^\| `{name}` \|.*$', text, re.MULTILINE)
            default = {'False': 'false', '': 'all', '0.0': '0'}.get(str(value), str(value))
            assert default in row.split('|')[3], row


def test_shipped_scenes_are_all_in_the_reference():
    text = (DOCS / 'reference' / 'scene.md').read_text()
    assert all(f'`{name}`' in text for name in shipped_scenes())


def test_counters_and_keys_are_all_explained():
    from collision_sim.core.rules import COUNTERS
    words = (DOCS / 'explanation' / 'words.md').read_text()
    assert all(f'`{name}`' in words for name in COUNTERS)
    assert all(f'collision_sim {name}`' in (DOCS / 'reference' / 'command_line.md').read_text()
               for name in cli.COMMANDS)


# ---------------------------------------------------------------- scenes

@pytest.mark.parametrize('page', with_language('yaml'), ids=name_of)
def test_scenes_load(page, folder):
    for path in write_files(page, folder):
        assert isinstance(load_scene(path), Scene)


# ---------------------------------------------------------------- Python

@pytest.mark.slow
@pytest.mark.parametrize('page', with_language('python'), ids=name_of)
def test_python_runs(page, folder):
    """All blocks of a page, one after the other; those that begin with a name are files."""
    need('\n'.join(blocks(page, 'python')))
    write_files(page, folder)
    scope = {'__name__': '__main__'}
    for number, text in enumerate(blocks(page, 'python')):
        exec(compile(text, f'{name_of(page)}, Python block {number + 1}', 'exec'), scope)


# ---------------------------------------------------------------- commands

@pytest.mark.parametrize('page', with_language('bash'), ids=name_of)
def test_commands_exist(page, folder, setup):
    write_files(page, folder)
    for words in commands(page):
        check(words, setup)


def check(words, setup):
    """See that a command is one, with all that it names."""
    words = [word for word in words if not re.fullmatch(r'[A-Z_]+=\S*', word)]
    program, *rest = words
    scripts = {line.split('=')[0].strip() for line in setup['entry_points']['console_scripts']}
    base = program.removeprefix('.venv/bin/')
    if base == 'collision_sim':
        cli.parse(rest)
    elif base in scripts:
        check_node(base, rest, setup)
    elif base in ('python', 'python3'):
        check_python(rest)
    elif base == 'pip':
        check_pip(rest, setup)
    else:
        assert program in OTHERS, words
        assert OTHERS[program] is None or rest[0] in OTHERS[program], words
        if words[:3] == ['ros2', 'run', 'collision_sim']:
            check([f'.venv/bin/{rest[2]}', *rest[3:]], setup)
        elif words[:2] == ['ros2', 'launch']:
            check_launch(rest[1:])
        elif words[:2] == ['ros2', 'topic'] or words[:2] == ['ros2', 'service']:
            check_ros_types(rest)
        elif program == '.ci/run':
            assert (ROOT / program).is_file()


def check_node(program, rest, setup):
    """See that the parameters of a node exist, and a scene that it names."""
    given = read_yaml(PACKAGE / 'config' / 'parameters.yaml')['/**']['ros__parameters']
    known = PARAMETERS.get(program, set(given))
    assert not rest or rest[0] == '--ros-args'
    for flag, value in zip(rest[1::2], rest[2::2]):
        name, _, given = value.partition(':=')
        assert flag == '-p' and (name in known or name.startswith('qos_overrides.')), value
        assert name != 'scene' or load_scene(given)


def check_python(rest):
    """See that a module exists, or that a program compiles."""
    if rest[0] == '-c':
        ast.parse(rest[1])
    else:
        assert rest[0] == '-m'
        module = rest[1]
        if module in OF_OTHER_MODULES:
            return
        sys.path.insert(0, str(ROOT))
        try:
            assert find_spec(module), module
        finally:
            sys.path.remove(str(ROOT))


def check_pip(rest, setup):
    """See that what is installed is this checkout, with extras that exist."""
    assert rest[0] == 'install'
    what = rest[-1]
    assert re.fullmatch(r'\.(\[[\w,]+\])?', what), what
    assert set(re.findall(r'\w+', what)) <= set(setup['extras_require'])


def check_launch(rest):
    """See that a launch file and its arguments exist."""
    assert rest[0] == 'collision_sim'
    text = (PACKAGE / 'launch' / rest[1]).read_text() + (
        PACKAGE / 'ros' / 'launching.py').read_text()
    for word in rest[2:]:
        assert word == '-s' or f"'{word.partition(':=')[0]}'" in text, word


def check_ros_types(rest):
    """See that types of messages and services exist, where there are any to look at."""
    for word in rest:
        found = re.fullmatch(r'(\w+_(?:msgs|srvs))/(msg|srv)/(\w+)', word)
        if found and find_spec(found[1]):
            module = __import__(f'{found[1]}.{found[2]}', fromlist=[found[3]])
            assert hasattr(module, found[3]), word


def runnable(page):
    """Commands of a page that are run, for a moment, without a network or recordings."""
    for words in commands(page):
        if words[0].endswith('/collision_sim'):
            if words[1] in ('run', 'sweep') and not {'--poses', '--scheduler'} & set(words):
                yield words[1:]


@pytest.mark.slow
@pytest.mark.parametrize('page', [page for page in PAGES if [*runnable(page)]], ids=name_of)
def test_commands_run(page, folder, monkeypatch, capsys):
    """For a moment: 0.02 s of simulated time, and at most two values of each that varies."""
    write_files(page, folder)
    for words in runnable(page):
        need(' '.join(words))
        words = [re.sub(r':(\d+)(:log)?$', r':2\2', word) for word in words]
        if words[0] == 'run':
            words += MOMENT
            if '--every' in words:
                words += ['--every', '0.01']
        else:
            words = [word for k, word in enumerate(words) if not (
                {'--repeat', '--steps', '--duration'} & {word, words[k - 1]})]
            words += ['--steps', '2', '--jobs', '1']
        try:
            assert cli.main(words) == 0, words
        except SystemExit as stop:
            raise AssertionError((words, capsys.readouterr().err)) from stop


@pytest.mark.slow
@pytest.mark.parametrize('page', [page for page in PAGES if ' -c "' in page.read_text()],
                         ids=name_of)
def test_programs_of_one_command_run(page, folder):
    """Those of `python -c`, as they are."""
    for words in commands(page):
        if words[1:2] == ['-c']:
            need(words[2])
            subprocess.run([sys.executable, *words[1:]], check=True, timeout=60)


def test_the_checks_find_what_is_wrong(setup):
    """A page that names something that is not there does not pass."""
    for words in (['.venv/bin/collision_sim_node', '--ros-args', '-p', 'scheme:=rain'],
                  ['.venv/bin/pip', 'install', '.[rose]'], ['pip', 'install', 'collision_sim'],
                  ['.venv/bin/python', '-m', 'collision_sim.no_such_module'],
                  ['ros2', 'launch', 'collision_sim', 'demo.launch.py', 'speed:=2'],
                  ['rostopic', 'list']):
        with pytest.raises(AssertionError):
            check(words, setup)
    with pytest.raises((SystemExit, argparse.ArgumentError)):
        check(['.venv/bin/collision_sim', 'run', 'demo', '--speed', '2'], setup)
