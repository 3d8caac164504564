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
The grid of a sweep: every combination of the varied values, each with some seeds.

A value is varied under its path in the scene, `friction.dry` or `colliders.ball.radius`, with what
`Scene.with_parameter` would make of it; an entry of a list goes by its name or its index.
"""

from argparse import ArgumentTypeError
from collections.abc import Mapping
from decimal import Decimal
from itertools import combinations, product
from math import prod
import re
from typing import NamedTuple

from collision_sim.checks import join, Loader, read_yaml, SceneError, unknown
from collision_sim.scene import Scene, scene_path
import numpy as np
import yaml

MOST = 10 ** 6          # runs of a grid
WHOLE = 2 ** 53         # up to here a float tells whole numbers apart
NUMBER = r'[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?'
SPACED = re.compile(rf'({NUMBER}):({NUMBER}):(\d{{1,7}})(:log)?')
FORMS = 'must be PATH=first:last:count, PATH=first:last:count:log or PATH=value,value,...'


class Axis(NamedTuple):
    """The values (a tuple, as in a scene file) of what stands under a path of the scene."""

    path: str
    values: tuple


class Run(NamedTuple):
    """One run: the values by their paths, and which repeat of them it is."""

    values: dict
    repeat: int


def axis(text):
    """
    Read an axis from the command line.

    Parameters
    ----------
    text : str
        `restitution=0.1:0.9:9`, `stepping.dt=1e-4:1e-2:5:log` or `friction.dry=0,0.1,0.5`; the
        last form takes any values as YAML writes them in a list.

    Returns
    -------
    Axis

    Raises
    ------
    ArgumentTypeError
        For anything else, and for a value that is given twice.

    """
    path, _, values = text.partition('=')
    if not all(path.split('.')) or not values.strip():
        raise ArgumentTypeError(f'{text!r} {FORMS}')
    values = _spaced(values) if ':' in values and not set('[{') & set(values) else _listed(values)
    if len(set(map(repr, values))) < len(values):
        raise ArgumentTypeError(f'{text!r} gives a value twice')
    return Axis(path, tuple(values))


def _spaced(text):
    """Give values in equal differences or, with `log`, in equal ratios; both ends included."""
    found = SPACED.fullmatch(text.strip())
    if not found or not 2 <= int(found[3]) <= MOST:
        raise ArgumentTypeError(f'{text!r} {FORMS}, with a count from 2 to {MOST}')
    first, last, log = Decimal(found[1]), Decimal(found[2]), found[4]
    shares = [Decimal(k) / (int(found[3]) - 1) for k in range(int(found[3]))]
    try:
        values = [float(first * (last / first) ** share if log else first + (last - first) * share)
                  for share in shares]      # decimal, so that 0.3 comes out as people write it
    except ArithmeticError:
        raise ArgumentTypeError(f'{text!r} must be between finite numbers, with log of one sign '
                                'and without 0') from None
    whole = all(value == value.to_integral() for value in (first, last))
    return [int(value) if whole and value.is_integer() and abs(value) < WHOLE else value
            for value in values]


def _listed(text):
    """Give values that are written as in a list in YAML."""
    try:
        return yaml.load(f'[{text}]', Loader=Loader)
    except Exception as error:      # PyYAML lets many types escape
        reason = getattr(error, 'problem', None) or error
        raise ArgumentTypeError(f'{text!r} {FORMS}; {reason}') from None


def with_value(node, keys, value, path=''):
    """
    Give a copy of a part of a scene file in which one value is another one.

    Parameters
    ----------
    node : dict or list
        The part; what is beside the path is shared with the copy.
    keys : list of str
        Path in it; an entry of a list goes by its name or its index.
    value : object
        As in a file.
    path : str
        Of the part in the scene.

    Raises
    ------
    SceneError
        For an entry that is not in a list.

    """
    key, *rest = keys
    if isinstance(node, list):
        index = _index(node, key, value, path)
        entry = with_value(node[index], rest, value, join(path, key)) if rest else value
        return [*node[:index], entry, *node[index + 1:]]
    node = _opened(node, path)
    entry = node.get(key)
    if rest:
        entry = entry if isinstance(entry, list) else _opened(entry, key)
        return {**node, key: with_value(entry, rest, value, join(path, key))}
    if key == 'wet' and isinstance(entry, Mapping) and not isinstance(value, (Mapping, str)):
        value = {**entry, 'coefficient': value}     # the form stays
    return {**node, key: value}


def _opened(value, key):
    """Give what stands under a key as a mapping; what has none gives way to it."""
    if isinstance(value, Mapping):
        return value
    number = isinstance(value, (int, float))
    if number and key == 'dry':
        return {'static': value, 'kinetic': value}
    return {'coefficient': value} if number and key == 'wet' else {}


def _index(entries, key, value, path):
    """Find an entry of a list by its name or its index."""
    names = [str(entry['name']) if isinstance(entry, Mapping) and 'name' in entry else str(k)
             for k, entry in enumerate(entries)]
    if key in names:
        return names.index(key)
    if key.isdecimal() and int(key) < len(entries):
        return int(key)
    raise unknown(join(path, key), value, key, names)


class Grid:
    """
    The runs of a sweep, in the order of its table: the last axis varies fastest, then the seed.

    Parameters
    ----------
    name : str
        A YAML file or a shipped scene.
    axes : sequence of Axis
        What is varied; none for the scene as it is.
    repeats : int
        Runs of each combination, with the seeds `particles.seed`, `particles.seed` + 1, ...

    Attributes
    ----------
    runs : list of Run

    Raises
    ------
    SceneError
        For a file that cannot be read, a path that is varied twice, too many runs.

    """

    def __init__(self, name, axes=(), repeats=1):
        path = scene_path(name)
        self._mapping, self._directory = read_yaml(path), path.parent
        if not isinstance(self._mapping, Mapping):
            Scene.from_dict(self._mapping)      # says what is wrong with it
        for one, other in combinations(sorted(axis.path for axis in axes), 2):
            if f'{other}.'.startswith(f'{one}.'):
                raise SceneError('--vary', other, f'must not be varied twice, here and as {one}')
        count = prod([repeats, *(len(axis.values) for axis in axes)])
        if count > MOST:
            raise SceneError('--vary', count, f'must make at most {MOST} runs')
        paths = [axis.path for axis in axes]
        self.runs = [Run(dict(zip(paths, values)), repeat)
                     for values in product(*(axis.values for axis in axes))
                     for repeat in range(repeats)]

    def mapping(self, run):
        """Give the scene of a run, as in a file."""
        mapping = self._mapping
        for path, value in run.values.items():
            keys = path.split('.')
            mapping = with_value(_with_own_friction(mapping, keys, value), keys, value)
        if run.repeat and mapping.get('particles'):
            mapping = with_value(mapping, ['particles', 'seed'], _seed(mapping) + run.repeat)
        return mapping

    def seed(self, run):
        """Give the seed of the random numbers of a run."""
        return _seed(self.mapping(run))

    def scene(self, run):
        """Give the scene of a run; SceneError for the first value that is not allowed."""
        return Scene.from_dict(self.mapping(run), self._directory)

    def draws(self):
        """Whether any scene draws something at random, so that its repeats differ."""
        return any(
            self._differ(run, run._replace(repeat=1)) for run in self.runs if run.repeat == 0)

    def _differ(self, *runs):
        one, other = (self.scene(run).particles for run in runs)
        return not (np.array_equal(one.position, other.position)
                    and np.array_equal(one.velocity, other.velocity))


def _with_own_friction(mapping, keys, value):
    """Give a collider the friction of the scene, if it has none, before a value of it is set."""
    entries = mapping.get('colliders')
    if keys[0] == 'colliders' and keys[2:3] == ['friction'] != keys[2:] \
            and isinstance(entries, list):
        entry = entries[_index(entries, keys[1], value, 'colliders')]
        if isinstance(entry, Mapping) and entry.get('friction') is None:
            return with_value(mapping, keys[:3], mapping.get('friction'))
    return mapping


def _seed(mapping):
    return (mapping.get('particles') or {}).get('seed', 0)
