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
Counts for how many types of arguments each entry of the core is compiled, over all tests.

What a scene has is said by values, not by types (core/modules.py): an entry has one signature, or
two. More of them means that somebody pays for compiling it again; the session fails then.
"""

import sys

import pytest

MOST = 2
_of_workers = []


def signatures():
    """Give the signatures of the entries of this process, sets of str by name."""
    modules = [module for name, module in list(sys.modules.items())
               if name.startswith('collision_sim.core.')]
    entries = {f'{value.py_func.__module__}.{value.py_func.__name__}': value
               for module in modules for value in vars(module).values() if is_entry(value)}
    return {name: set(map(str, value.signatures)) for name, value in sorted(entries.items())}


def is_entry(value):
    """Whether a value is a compiled function of which only entries have the options."""
    return hasattr(value, 'signatures') and bool(value.targetoptions.get('nogil'))


def joined(parts):
    """Give the signatures of several processes together."""
    found = {}
    for part in parts:
        for name, kinds in part.items():
            found.setdefault(name, set()).update(kinds)
    return found


def crowded(found, most=MOST):
    """Give the entries with more signatures than there may be."""
    return {name: kinds for name, kinds in found.items() if len(kinds) > most}


def in_words(found):
    """Say which entries have how many signatures, and in which arguments these differ."""
    lines = []
    for name, kinds in found.items():
        columns = zip(*(_parts(kind) for kind in sorted(kinds)))
        lines.append(f'{name} has {len(kinds)} signatures:')
        lines += [f'  argument {k}: {" | ".join(sorted(set(column)))}'
                  for k, column in enumerate(columns) if len(set(column)) > 1]
    return lines


def _parts(kind):
    """Divide a signature into its arguments."""
    depth, parts = 0, ['']
    for letter in kind.strip()[1:-1]:
        depth += (letter in '([{<') - (letter in ')]}>')
        if letter == ',' and not depth:
            parts.append('')
        else:
            parts[-1] += letter
    return [part.strip() for part in parts]


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node):
    """Keep what a process of pytest-xdist has found."""
    found = getattr(node, 'workeroutput', {}).get('signatures', {})
    _of_workers.append({name: set(kinds) for name, kinds in found.items()})


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session):
    """Hand the signatures to the process that has started this one, or judge them."""
    config = session.config
    if hasattr(config, 'workeroutput'):
        config.workeroutput['signatures'] = {
            name: sorted(kinds) for name, kinds in signatures().items()}
        return
    config.crowded = crowded(joined([signatures(), *_of_workers]))
    if config.crowded and not session.exitstatus:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter, config):
    """Say which entries there are too many of."""
    lines = in_words(getattr(config, 'crowded', {}))
    if lines:
        terminalreporter.section('entries that are compiled too often')
        terminalreporter.write('\n'.join(lines) + '\n')
