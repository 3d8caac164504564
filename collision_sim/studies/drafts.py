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
Files that appear whole or not at all, in place of what was there.

Whoever writes one has a draft of its own beside it, so of two that write the same file each writes
a whole one, and the last wins.
"""

from contextlib import contextmanager, suppress
import os
from secrets import token_hex


@contextmanager
def draft_of(path):
    """Give the name of a draft, which gets the name `path` when the block ends without error."""
    path = os.path.realpath(path)           # what a link points to, not the link
    draft = f'{path}.{token_hex(4)}.draft'
    try:
        yield draft
        with open(draft, 'rb') as file:
            os.fsync(file.fileno())
        os.replace(draft, path)
    finally:
        with suppress(FileNotFoundError):
            os.unlink(draft)


def write_text(path, text):
    """Write a text to a file."""
    with draft_of(path) as draft, open(draft, 'w') as file:
        file.write(text)


def write_whole(file, line):
    """
    Add a line to a log, or, on a full disk, nothing.

    Parameters
    ----------
    file : io.FileIO
        Without a buffer, at its end.
    line : bytes
        With its end.

    """
    before = os.fstat(file.fileno()).st_size
    try:
        while line:
            line = line[file.write(line):]
    except OSError:
        file.truncate(before)
        raise
