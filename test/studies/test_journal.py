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

"""What outlives a sweep: the journal of its runs, and the table."""

import csv
import math

from collision_sim.checks import SceneError
from collision_sim.scene import load_scene, Scene, shipped_scenes
from collision_sim.studies import outcome_table
from collision_sim.studies.journal import fingerprint, Journal
import pytest

ROWS = [{'restitution': 0.1, 'seed': 3, 'error': None, 'x': 1 / 3},
        {'restitution': 1, 'seed': 4, 'error': 'ValueError: no', 'y': [1, 'a']}]


def lines(path):
    """Lines of a file."""
    return path.read_bytes().splitlines(keepends=True)


def test_a_journal_goes_on(tmp_path):
    """What was added is there again, to the last bit; a journal that is removed is gone."""
    path = tmp_path / 'a.partial'
    with Journal(path, 'word') as journal:
        journal.add(5, ROWS[1])
        journal.add(2, {'x': 1 / 3, 'y': math.inf})
    with Journal(path, 'word') as journal:
        assert journal.rows == {5: ROWS[1], 2: {'x': 1 / 3, 'y': math.inf}}
        journal.add(3, {})
        journal.remove()
    assert not path.exists()


@pytest.mark.parametrize('kept', range(1, 30))
def test_a_torn_last_line(kept, tmp_path):
    """Cut anywhere, as by kill -9 or a full disk: whole lines count, the rest is done again."""
    path = tmp_path / 'a.partial'
    with Journal(path, 'word') as journal:
        journal.add(0, {'x': 0.5})
        journal.add(1, {'x': 0.25})
    whole = path.read_bytes()
    path.write_bytes(whole[:kept * len(whole) // 30])
    with Journal(path, 'word') as journal:
        assert len(journal.rows) == max(whole[:kept * len(whole) // 30].count(b'\n') - 1, 0)
        journal.add(0, {'x': 0.5})
        journal.add(1, {'x': 0.25})
    with Journal(path, 'word') as journal:
        assert journal.rows == {0: {'x': 0.5}, 1: {'x': 0.25}}


def test_lines_that_cannot_be_read(tmp_path):
    """What follows them is done again."""
    path = tmp_path / 'a.partial'
    with Journal(path, 'word') as journal:
        for k in range(4):
            journal.add(k, {})
    head, *rest = lines(path)
    path.write_bytes(head + rest[0] + b'\0\0\0\n' + rest[2])
    with Journal(path, 'word') as journal:
        assert list(journal.rows) == [0]
    assert lines(path) == [head, rest[0]]


@pytest.mark.parametrize('content', [b'{"sweep": "other"}\n', b'x,y\n1,2\n', b'word'])
def test_the_journal_of_another_sweep(content, tmp_path):
    """It is refused and left as it is, unless one asks to begin anew."""
    path = tmp_path / 'a.partial'
    path.write_bytes(content)
    with pytest.raises(SceneError, match='--restart'):
        Journal(path, 'word')
    assert path.read_bytes() == content
    with Journal(path, 'word', restart=True) as journal:
        assert journal.rows == {}


def test_two_sweeps_at_once(tmp_path):
    """A journal that is being written is refused."""
    with Journal(tmp_path / 'a.partial', 'word'):
        with pytest.raises(SceneError, match='in use'):
            Journal(tmp_path / 'a.partial', 'word')


def test_fingerprints_tell_scenes_apart(tmp_path):
    """Any value counts, and what is in particle files, but not where the scene is."""
    demo = load_scene('demo')
    words = {fingerprint([scene], 3, None) for scene in (
        demo.with_parameter('restitution', 0.25), *map(load_scene, shipped_scenes()),
        *(Scene.from_dict({'particles': {'position': [[0, 0, x]]}}) for x in (0.0, 0.1)))}
    assert len(words | {fingerprint([demo], 4, None), fingerprint(['3', '4']),
                        fingerprint(['34']), fingerprint([['3'], '4'])}) \
        == len(shipped_scenes()) + 7
    assert fingerprint([demo]) == fingerprint([load_scene('demo')])


def test_csv(tmp_path):
    """Columns in the order of their first appearance; floats to the last bit."""
    path = tmp_path / 'a.csv'
    outcome_table.write(str(path), ROWS)
    with open(path, newline='') as file:
        head, *rows = csv.reader(file)
    assert head == ['restitution', 'seed', 'error', 'x', 'y']
    assert rows == [['0.1', '3', '', repr(1 / 3), ''],
                    ['1', '4', 'ValueError: no', '', '[1, "a"]']]
    assert [entry.name for entry in tmp_path.iterdir()] == ['a.csv']


def test_parquet(tmp_path):
    """Numbers are numbers; what is of several kinds is text."""
    parquet = pytest.importorskip('pyarrow.parquet')
    path = tmp_path / 'a.parquet'
    rows = [*ROWS, {'restitution': None, 'seed': 2 ** 70, 'y': 'none', 'x': math.inf}]
    outcome_table.write(str(path), rows)
    assert parquet.read_table(path).to_pydict() == {
        'restitution': [0.1, 1.0, None], 'seed': ['3', '4', str(2 ** 70)],
        'error': [None, 'ValueError: no', None], 'x': [1 / 3, None, math.inf],
        'y': [None, '[1, "a"]', 'none']}


@pytest.mark.parametrize('suffix', outcome_table.FORMATS)
def test_a_table_appears_whole_or_not_at_all(suffix, tmp_path, monkeypatch):
    """When writing fails, the table of before is still there, and nothing else."""
    if suffix == '.parquet':
        pytest.importorskip('pyarrow')
    path = tmp_path / f'a{suffix}'
    path.write_text('before')
    monkeypatch.setattr(outcome_table, '_text', lambda cell: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        outcome_table.write(str(path), ROWS)
    assert path.read_text() == 'before'
    assert len(list(tmp_path.iterdir())) == 1


def test_parquet_without_pyarrow(monkeypatch):
    """The message says what to install."""
    monkeypatch.setattr(outcome_table, 'find_spec', lambda name: None)
    with pytest.raises(SceneError, match=r"pip install 'collision_sim\[sweep\]'"):
        outcome_table.require('a.parquet')
    outcome_table.require('a.csv')
