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

"""That entries with too many signatures are found; the count itself is at the end of a session."""

import subprocess
import sys

import collision_sim.core
from collision_sim.core.jit import entry, kernel
import pytest
import signatures

TOO_MANY = """
import sys
sys.path[:0] = {path!r}
pytest_plugins = ['signatures']
"""
TEST = """
import collision_sim.core.shapes as shapes
from collision_sim.core.jit import entry

@entry
def same(x):
    return x

def test_types():
    shapes.same = same
    for value in {values}:
        same(value)
"""


@entry
def given(x, y):
    """Give the second of two things."""
    return y


@kernel
def given_inside(x):
    """Give a thing."""
    return x


def test_only_entries_count():
    assert not any(map(signatures.is_entry, (given_inside, collision_sim.core, 1)))


@pytest.mark.jit
def test_entries_count():
    assert signatures.is_entry(given)


def test_signatures_of_several_processes_count_together():
    one, other = {'a': {'(int64,)', '(float64,)'}, 'b': {'()'}}, {'a': {'(boolean,)'}}
    found = signatures.joined([one, other, {}])
    assert found == {'a': {'(int64,)', '(float64,)', '(boolean,)'}, 'b': {'()'}}
    assert signatures.crowded(one) == {} and list(signatures.crowded(found)) == ['a']


def test_it_is_said_where_they_differ():
    found = {'entry': {'(Rules(int64, float64), array(float64, 2d, C), int64)',
                       '(Rules(int64, none), array(float64, 2d, C), int64)'}}
    assert signatures.in_words(found) == [
        'entry has 2 signatures:',
        '  argument 0: Rules(int64, float64) | Rules(int64, none)']


@pytest.mark.jit
@pytest.mark.parametrize(('values', 'code'), [((1, 1.0), 0), ((1, 1.0, True), 1)])
@pytest.mark.parametrize('parallel', [[], ['-n', '1']], ids=['here', 'xdist'])
def test_a_session_fails(values, code, parallel, tmp_path):
    """Three types of arguments are one too many, whether a test process or this one has them."""
    if parallel:
        pytest.importorskip('xdist')
    (tmp_path / 'conftest.py').write_text(TOO_MANY.format(path=sys.path))
    (tmp_path / 'test_it.py').write_text(TEST.format(values=values))
    done = subprocess.run([sys.executable, '-m', 'pytest', '-q', '-c', '/dev/null', '--rootdir',
                           str(tmp_path), *parallel, str(tmp_path)], capture_output=True,
                          text=True, cwd=tmp_path)
    assert done.returncode == code, done.stdout
    assert ('shapes' in done.stdout or 'same has 3 signatures' in done.stdout) == bool(code)
