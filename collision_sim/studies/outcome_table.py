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

"""The table of a sweep as a CSV or Parquet file; it appears whole or not at all."""

import csv
from importlib.util import find_spec
import json

from collision_sim.checks import SceneError
from collision_sim.studies.drafts import draft_of

FORMATS = ('.csv', '.parquet')


def require(path):
    """Refuse a file whose format needs a library that is not installed."""
    if path.endswith('.parquet') and find_spec('pyarrow') is None:
        raise SceneError('--out', path, "needs pyarrow: pip install 'collision_sim[sweep]', or a "
                                        'name that ends in .csv')


def write(path, rows):
    """
    Write a table.

    Parameters
    ----------
    path : str
        Ends in one of FORMATS.
    rows : list of dict
        By column; columns come in the order of their first appearance, cells that a row lacks are
        empty, lists and mappings are written as JSON.

    """
    names = list(dict.fromkeys(name for row in rows for name in row))
    with draft_of(path) as draft:
        (_write_parquet if path.endswith('.parquet') else _write_csv)(draft, names, rows)


def _write_csv(path, names, rows):
    with open(path, 'w', newline='') as file:
        writer = csv.writer(file, lineterminator='\n')
        writer.writerow(names)
        for row in rows:
            cells = (row.get(name) for name in names)
            writer.writerow([_text(cell) if isinstance(cell, (list, dict)) else cell
                             for cell in cells])


def _write_parquet(path, names, rows):
    from pyarrow import parquet, table
    columns = ([row.get(name) for row in rows] for name in names)
    parquet.write_table(table([_column(cells) for cells in columns], names=names), path)


def _column(cells):
    """Give a column of numbers, truth values or text; what is of several kinds becomes text."""
    from pyarrow import array
    kinds = {type(cell) for cell in cells} - {type(None)}
    if kinds <= {int, float} or kinds in ({bool}, {str}):
        try:
            return array(cells)
        except OverflowError:       # an integer beyond 64 bits
            pass
    return array([None if cell is None else _text(cell) for cell in cells])


def _text(cell):
    return cell if isinstance(cell, str) else json.dumps(cell)
