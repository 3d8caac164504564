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
Files of numbers and texts that a scene names: how they are opened, and tables of numbers.

What is no ordinary file, such as a pipe, is refused without waiting for it.
"""

import csv
import os
import re
import stat

from collision_sim.checks import SceneError, Text
import numpy as np

MARKS = {b'\xef\xbb\xbf': 'utf-8-sig', b'\xff\xfe': 'utf-16', b'\xfe\xff': 'utf-16'}
TABLE = Text(r'(?s:.+)\.(?i:npy|csv)', 'must be the name of a .npy or .csv file')
TITLE = re.compile(r'([A-Za-z_]\w*)\s*(?:[\[(](.*)[\])])?')     # of a column, with its unit


def open_file(path, mode='rb', **options):
    """Open an ordinary file as `open` does; OSError for a folder, a pipe or a device."""
    return open(path, mode, opener=_open_ordinary, **options)


def _open_ordinary(path, flags):
    check_ordinary(path)
    return os.open(path, flags | os.O_NONBLOCK)     # should it have become a pipe by now


def check_ordinary(path):
    """Raise OSError for what is there and is no ordinary file."""
    if not stat.S_ISREG(os.stat(path).st_mode):
        raise OSError(f'{str(path)!r} is not an ordinary file')


def as_text(data):
    """Give the bytes of a text in UTF-8, without a mark or padding, its lines ended by a feed."""
    for mark, encoding in MARKS.items():
        if data.startswith(mark):
            data = data.decode(encoding, 'replace').encode()
    return data.rstrip(b'\0\x1a').replace(b'\r\n', b'\n').replace(b'\r', b'\n')


def refuse_underscores(words):
    """Give words, bytes, that are to be numbers; Python would take 1_000 for one."""
    if b'_' in b''.join(words):
        raise ValueError('there must be no underscores in numbers')
    return words


def read_table(value, path, directory, count, kind, what, titles=()):
    """
    Read the rows of numbers in a .npy or .csv file.

    A table in CSV may have comments, from # to the end of a line, and a first row with the titles
    of its columns and their units.

    Parameters
    ----------
    value, path : str
        Name of the file, and the key it stands under.
    directory : Path
        Where relative names start.
    count : int
        Columns of a table in CSV.
    kind : type
        Of its numbers, float or int.
    what : str
        Says in errors what the file must hold.
    titles : sequence of str
        Of its columns, lengths in m, which may come in any order; any titles if empty.

    Returns
    -------
    rows : array or list of list
        Not yet checked if from .npy.

    Raises
    ------
    SceneError
        For a file that is missing or broken.

    """
    name = TABLE.read(value, path)
    try:
        if name.lower().endswith('.csv'):
            return _read_csv(directory / name, count, kind, titles)
        with open_file(directory / name) as file:
            return np.lib.format.read_array(file, allow_pickle=False)
    except Exception as error:  # whatever a broken file makes its reader raise
        problem = ' '.join(str(error).split()) or type(error).__name__
        raise SceneError(path, name, f'must hold {what}; {problem}') from None


def _read_csv(path, count, kind, titles):
    with open_file(path, 'r', newline='', encoding='utf-8-sig', errors='replace') as file:
        reader = csv.reader(line.partition('#')[0] for line in file)
        rows = [(reader.line_num, row) for row in reader if any(entry.strip() for entry in row)]
    for line, row in rows:
        if len(row) != count:
            raise ValueError(f'line {line} must have {count} entries with commas between them, '
                             f'not {len(row)}')
    order = range(count)
    if rows and not any(_is_number(entry) for entry in rows[0][1]):
        order = _order(*rows.pop(0), titles)
    return [[_number(row[k], kind, line) for k in order] for line, row in rows]


def _order(line, row, titles):
    """Give the columns in the order of the titles that they have in the first row."""
    found = [TITLE.fullmatch(entry.strip()) for entry in row]
    names = [title and title[1].lower() for title in found]
    if None in names or (titles and sorted(names) != sorted(titles)):
        raise ValueError(f'line {line} must have {len(row)} numbers, or the titles '
                         f'{", ".join(titles) or "of its columns"}; not {",".join(row)[:60]!r}')
    if not titles:
        return range(len(row))
    units = {title[2].strip() for title in found if title[2]}
    if units - {'', 'm'}:
        raise ValueError(f'line {line}: lengths must be in m, not {", ".join(sorted(units))}')
    return [names.index(title) for title in titles]


def _is_number(entry):
    try:
        float(entry)
    except ValueError:
        return False
    return True


def _number(entry, kind, line):
    try:
        return kind(entry.replace('_', '?'))        # Python would read 1_000
    except ValueError:
        whole = ' whole' if kind is int else ''
        raise ValueError(f'line {line}: {entry.strip()[:40]!r} is no{whole} number') from None
