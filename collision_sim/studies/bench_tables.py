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

"""Tables of `collision_sim bench`: Markdown that reads well as text, and CSV."""

import csv

from collision_sim.studies.drafts import draft_of


def aligned(head, lines):
    """
    Give a table in Markdown whose columns line up.

    Parameters
    ----------
    head : sequence of str
        Names of the columns.
    lines : sequence of sequence of str
        Cells; those that begin with a digit are aligned to the right.

    """
    widths = [max(map(len, column)) for column in zip(head, *lines)]
    rule = ['-' * width for width in widths]
    rows = [[cell.rjust(width) if cell[:1].isdigit() else cell.ljust(width)
             for cell, width in zip(line, widths)] for line in (head, rule, *lines)]
    return '\n'.join(f'| {" | ".join(row)} |' for row in rows)


def figure(value):
    """Give three digits of a number, '' for None."""
    if value is None:
        return ''
    return f'{value:.3g}' if value < 1000.0 else f'{value:.0f}'


def size(count):
    """Give a number of particles as it is said: 1e5, 2500."""
    digits = str(count).rstrip('0')
    return f'1e{len(str(count)) - 1}' if digits == '1' and count >= 1000 else str(count)


def write_csv(path, rows):
    """Write named tuples of one kind, at least one, under the names of their entries."""
    with draft_of(path) as draft, open(draft, 'w', newline='') as file:
        writer = csv.writer(file, lineterminator='\n')
        writer.writerow(rows[0]._fields)
        writer.writerows(rows)
