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

"""Files are old and whole or new and whole: two writers, full disks, errors."""

import errno
import resource

from collision_sim import cli
from collision_sim.studies.drafts import draft_of, write_text, write_whole
from collision_sim.studies.states import StatesCsv
import numpy as np
import pytest

SCENE = """
particles: {position: [[0, 0, 1]]}
stepping: {dt: 0.01}
"""
RUNS = {'over time.csv': ['--every', '0.01'], 'end.csv': [], 'over time.npz': ['--every', '0.01'],
        'end.npz': []}


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / 'my.yaml'
    path.write_text(SCENE)
    return str(path)


def test_two_writers(tmp_path):
    """Each writes a whole file; that of the last one stays, nothing else."""
    path = tmp_path / 'x.csv'
    with draft_of(path) as one, draft_of(path) as other:
        assert one != other
        with open(one, 'w') as first, open(other, 'w') as second:
            first.write('1' * 9)
            second.write('2')
    assert path.read_text() == '1' * 9
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_stays_one(tmp_path):
    (tmp_path / 'link').symlink_to(tmp_path / 'file')
    write_text(tmp_path / 'link', 'a')
    assert (tmp_path / 'link').is_symlink() and (tmp_path / 'file').read_text() == 'a'


@pytest.mark.parametrize('name', RUNS)
def test_a_full_disk_leaves_the_old_file(name, scene, tmp_path, monkeypatch, capsys):
    """Exit code 2, the reason, the file that was there, and no draft."""
    def full(*arguments, **options):
        raise OSError(errno.ENOSPC, 'No space left on device')
    path = tmp_path / name
    path.write_bytes(b'old')
    monkeypatch.setattr('os.fsync', full)
    assert cli.main(['run', scene, '--duration', '0.5', '--out', str(path), *RUNS[name]]) == 2
    assert 'No space left on device' in capsys.readouterr().err
    assert path.read_bytes() == b'old'
    assert sorted(each.name for each in tmp_path.iterdir()) == sorted([name, 'my.yaml'])


def test_an_error_in_a_run_leaves_the_old_file(scene, tmp_path, monkeypatch):
    """Whatever ends the writing of states over time before its time."""
    path = tmp_path / 'x.csv'
    path.write_bytes(b'old')
    write, count = StatesCsv.write, []

    def fail(self):
        count.append(1)
        if len(count) == 3:
            raise OSError(errno.ENOSPC, 'No space left on device')
        write(self)
    monkeypatch.setattr(StatesCsv, 'write', fail)
    assert cli.main(['run', scene, '--out', str(path), '--every', '0.01']) == 2
    assert path.read_bytes() == b'old'
    assert [each.name for each in tmp_path.iterdir() if each.suffix == '.draft'] == []


def test_a_log_has_whole_lines_only(tmp_path):
    """A line that does not fit is taken back; a limit of the size of a file stands for a disk."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    path = tmp_path / 'log'
    with open(path, 'ab', buffering=0) as file:
        write_whole(file, b'0123456789\n')
        resource.setrlimit(resource.RLIMIT_FSIZE, (15, limits[1]))
        try:
            with pytest.raises(OSError):
                write_whole(file, b'0123456789\n')
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        write_whole(file, b'abc\n')
    assert path.read_bytes() == b'0123456789\nabc\n'


def test_a_draft_that_is_dropped(tmp_path):
    """An error in the block: the old file stays, and no draft."""
    path = tmp_path / 'x'
    path.write_text('old')
    with pytest.raises(ZeroDivisionError), draft_of(path) as draft:
        with open(draft, 'w') as file:
            file.write('new')
        raise ZeroDivisionError
    assert path.read_text() == 'old' and list(tmp_path.iterdir()) == [path]


def test_the_last_run_wins(scene, tmp_path):
    """The second of two runs takes the place of the first."""
    path = tmp_path / 'x.npz'
    for duration in ('0.5', '0.2'):
        assert cli.main(['run', scene, '--duration', duration, '--out', str(path)]) == 0
    assert np.load(path)['time'] == pytest.approx(0.2)
