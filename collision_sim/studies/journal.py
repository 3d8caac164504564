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
The journal of a sweep: a line of JSON a finished run, in a file beside the table to be.

It outlives whatever ends the sweep, so that the same sweep can go on from there.
"""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
import fcntl
from hashlib import blake2b
import json
from pathlib import Path
import sys

from collision_sim.checks import SceneError
from collision_sim.core.interrupts import held
from collision_sim.input_files import check_ordinary
from collision_sim.studies.drafts import write_whole
import numpy as np

RESTART = '--restart begins anew, another --out leaves it'


def fingerprint(*parts):
    """Give a word that tells apart what is run: scenes, numbers, text, iterables of them."""
    digest = blake2b(digest_size=16)
    for part in parts:
        for piece in _content(part):
            digest.update(piece)
    return digest.hexdigest()


def _content(value):
    """Give the bytes of a value, each piece with its length."""
    if is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Mapping):
        value = [*value.keys(), *value.values()]
    if isinstance(value, (str, int, float, type(None))):
        piece = repr(value).encode()
    elif isinstance(value, np.ndarray):
        piece = f'{value.dtype}{value.shape}'.encode() + value.tobytes()
    else:
        yield b'['
        for entry in value:
            yield from _content(entry)
        piece = b''
    yield b'%d:' % len(piece)
    yield piece


class Journal:
    """
    The finished runs of one sweep.

    Parameters
    ----------
    path : str or Path
        Of the file; made where there is none.
    word : str
        Fingerprint of the sweep.
    restart : bool
        Whether to forget what is there.

    Attributes
    ----------
    rows : dict of int to dict
        Outcomes by the index of their run.

    Raises
    ------
    SceneError
        For the journal of another sweep, or one that is being written by another process.

    """

    def __init__(self, path, word, restart=False):
        self.path, self.rows = Path(path), {}
        if self.path.exists():
            check_ordinary(self.path)
        self._file = open(self.path, 'a+b', buffering=0)
        try:
            self._lock()
            self._file.seek(0)
            if restart:
                self._file.truncate(0)
            self._read(word)
        except BaseException:
            self._file.close()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._file.close()

    def add(self, index, row):
        """Keep the outcome of a run, on disk before this returns."""
        line = json.dumps([index, row])
        with held():
            write_whole(self._file, line.encode() + b'\n')
        self.rows[index] = json.loads(line)[1]      # the same whether it is read later or not

    def leave(self, runs):
        """Say how to go on with a sweep of so many runs that has stopped."""
        if self.rows:
            print(f'{len(self.rows)} of {runs} runs are kept in {self.path}; the same command '
                  'goes on from there', file=sys.stderr)
        else:
            self.remove()

    def remove(self):
        """Remove the file, which nobody needs any more."""
        self.path.unlink()

    def _lock(self):
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise SceneError('--out', str(self.path),
                             'must not be in use; another sweep is writing it') from None

    def _read(self, word):
        """Read what is there; a line that was torn, and all after it, is done again."""
        head = json.dumps({'sweep': word}).encode() + b'\n'
        first, *lines = self._file.read().splitlines(keepends=True) or [b'']
        if not head.startswith(first):
            raise SceneError('--out', str(self.path),
                             f'must be the journal of this sweep, not of another; {RESTART}')
        good = len(head)
        for line in lines:
            try:
                index, row = json.loads(line)
            except ValueError:
                break
            if not line.endswith(b'\n'):
                break
            self.rows[index] = row
            good += len(line)
        if first == head:
            self._file.truncate(good)
        else:
            self._file.truncate(0)
            write_whole(self._file, head)
