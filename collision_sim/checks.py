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
Checks of the values of a scene one by one, and the reading of its files.

Each leaf class (Number, Vector, ...) says once what a value may be; `read(value, path)` gives the
value in its final type or raises SceneError with that path. Units are SI, '' is dimensionless.
"""

from array import array
from collections.abc import Mapping
from dataclasses import dataclass
import difflib
import math
from numbers import Integral, Real
import re
import reprlib
from typing import NamedTuple
import warnings

import numpy as np
import yaml

QUATERNION_TOLERANCE = 1e-3  # how far from 1 the norm of a quaternion typed by hand may be
SEQUENCES = (list, tuple, np.ndarray, array)  # array: what ROS parameters hold
LONGEST_KEY = 80  # characters of an unknown key that are compared and shown


class SceneError(ValueError):
    """
    A value of a scene that is not allowed.

    Attributes
    ----------
    key : str
        Full path of the key, such as ``colliders.ground.restitution``.
    value : object
        What was given there; MISSING where there was nothing.
    allowed : str
        What may stand there.

    """

    def __init__(self, key, value, allowed):
        super().__init__(f'{key}: {_SHORT.repr(value)}: {allowed}')
        self.key = key
        self.value = value
        self.allowed = allowed

    def __reduce__(self):  # so that it passes from a worker process to the one that waits
        return SceneError, (self.key, self.value, self.allowed)


class SceneWarning(UserWarning):
    """What was left out or changed of a file so that it can be used."""


def warn(path, value, numbers, what, things='faces'):
    """
    Warn of some of the things in a value, if there are any, by a SceneWarning.

    Parameters
    ----------
    path : str
        Of the key that the value stands under.
    value : object
        What was given there.
    numbers : (K,) int
        Numbers of the things, in their order.
    what : str
        What is said of them.
    things : str
        What they are.

    """
    if len(numbers):
        warnings.warn(f'{path}: {_SHORT.repr(value)}: {len(numbers)} {things} {what}; the first '
                      f'is {numbers[0]}', SceneWarning, stacklevel=2)


class Parameter(NamedTuple):
    """
    A value that may change while the simulation runs, and what is allowed for it.

    `low` and `high` are None where there is no bound; `unit` is '' for pure numbers.
    """

    value: float | bool | str | tuple[float, float, float]
    unit: str
    low: float | None
    high: float | None
    description: str


class _Missing:
    """The value of a key that is absent: every leaf refuses it with its own words."""

    def __repr__(self):
        return 'missing'


MISSING = _Missing()


class _ShortRepr(reprlib.Repr):
    """Values as they stand in messages: one line, whatever their size."""

    def __init__(self):
        super().__init__()
        self.maxstring = self.maxother = 60

    def repr_int(self, number, level):
        if number.bit_length() > 200:  # Python refuses to print integers of thousands of digits
            return f'an integer of {number.bit_length()} bits'
        return repr(number)

    def repr_instance(self, instance, level):
        return ' '.join(super().repr_instance(instance, level).split())  # arrays take many lines


_SHORT = _ShortRepr()


@dataclass(frozen=True)
class Number:
    """One number from `low` to `high`; `above` excludes `low`, `infinite` lets infinity in."""

    unit: str
    description: str
    low: int | None = None
    high: int | None = None
    above: bool = False
    infinite: bool = False
    whole: bool = False

    @property
    def allowed(self) -> str:
        """Say what may stand here."""
        return f'must be a{self._kind()} number{self._range()}'

    def read(self, value, path):
        """Give the number as float (int if whole), or raise SceneError."""
        number = self._number(value)
        if number is None:
            raise SceneError(path, value, self.allowed + _quotes_hint(value))
        return number

    def parameter(self, value) -> Parameter:
        """Give the value together with what is allowed for it."""
        low, high = (bound if bound is None or self.whole else float(bound)
                     for bound in (self.low, self.high))
        return Parameter(value, self.unit, low, high, self.description)

    def _number(self, value):
        """Give the number in its final type, None where it is not allowed."""
        wanted = Integral if self.whole else Real
        if not isinstance(value, wanted) or isinstance(value, bool):
            return None
        try:
            number = int(value) if self.whole else float(value)
        except OverflowError:  # an integer beyond the largest float
            return None
        return number if self._fits(number) else None

    def _fits(self, number) -> bool:
        if not (self.whole or self.infinite or math.isfinite(number)):
            return False
        if number != number or (self.high is not None and number > self.high):
            return False
        if self.low is None:
            return True
        return number > self.low if self.above else number >= self.low

    def _kind(self) -> str:
        if self.whole:
            return ' whole'
        bounded = self.low is not None and self.high is not None
        return '' if bounded or self.infinite else ' finite'

    def _range(self) -> str:
        infinite = ', infinity included' if self.infinite else ''
        if self.low is None:
            return infinite
        if self.above:
            low = f' above {self.low}'
            high = '' if self.high is None else f' and at most {self.high}'
        else:
            low = f' from {self.low}'
            high = ' upwards' if self.high is None else f' to {self.high}'
        return low + high + infinite


@dataclass(frozen=True)
class Vector(Number):
    """A fixed count of numbers, all of the same range."""

    length: int = 3

    @property
    def allowed(self) -> str:
        return f'must be {self.length}{self._kind()} numbers{self._range()}'

    def read(self, value, path) -> tuple[float, ...]:
        """Give the vector as a tuple of floats, or raise SceneError."""
        entries = as_list(value)
        if not isinstance(entries, list) or len(entries) != self.length:
            raise SceneError(path, value, self.allowed)
        vector = tuple(self._number(entry) for entry in entries)
        if None in vector:
            hint = _quotes_hint(entries[vector.index(None)])
            raise SceneError(path, value, self.allowed + hint)
        return vector


@dataclass(frozen=True)
class Direction(Vector):
    """A vector whose length does not matter; it is read as a unit vector."""

    def read(self, value, path):
        vector = super().read(value, path)
        largest = max(abs(x) for x in vector)
        if largest == 0:
            raise SceneError(path, value, f'{self.allowed}, not all of them 0')
        vector = tuple(x / largest for x in vector)  # so that no square over- or underflows
        norm = math.hypot(*vector)
        return tuple(x / norm for x in vector)


@dataclass(frozen=True)
class Quaternion(Vector):
    """A rotation x, y, z, w; small errors of its norm are taken out."""

    length: int = 4

    def read(self, value, path):
        quaternion = super().read(value, path)
        norm = math.hypot(*quaternion)
        if not abs(norm - 1) <= QUATERNION_TOLERANCE:
            raise SceneError(path, value, 'must be a unit quaternion x, y, z, w '
                                          f'(norm within {QUATERNION_TOLERANCE:g} of 1)')
        return tuple(x / norm for x in quaternion)


@dataclass(frozen=True)
class Choice:
    """One of a few words."""

    options: tuple[str, ...]

    def read(self, value, path) -> str:
        if not isinstance(value, str) or value not in self.options:
            raise SceneError(path, value, f'must be one of {", ".join(self.options)}')
        return value


@dataclass(frozen=True)
class Text:
    """A string that matches a pattern as a whole; `allowed` says the same in words."""

    pattern: str
    allowed: str

    def fits(self, value) -> bool:
        return isinstance(value, str) and re.fullmatch(self.pattern, value) is not None

    def read(self, value, path) -> str:
        if not self.fits(value):
            raise SceneError(path, value, self.allowed)
        return value


class Flag:
    """True or false."""

    def read(self, value, path) -> bool:
        if not isinstance(value, (bool, np.bool_)):
            raise SceneError(path, value, 'must be true or false')
        return bool(value)


def as_list(value):
    """Give sequences of numbers (tuple, NumPy and ROS arrays) as lists, the rest untouched."""
    if isinstance(value, (np.ndarray, array)):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value


def join(path, key) -> str:
    """Give the path of a key below a path; the scene itself has the path ''."""
    printable = isinstance(key, str) and key and key.isprintable()
    key = (key if printable else _SHORT.repr(key))[:LONGEST_KEY]
    return f'{path}.{key}' if path else key


def read_section(value, path, known) -> dict:
    """Give a mapping that has known keys only; an empty section reads as an absent one."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise SceneError(path or 'scene', value,
                         f'must be a mapping with the keys {", ".join(known)}')
    for key in value:
        if not isinstance(key, str) or key not in known:
            raise unknown(join(path, key), value[key], key, known)
    return dict(value)


def read_leaves(section, path, leaves, required=()) -> dict:
    """Read the keys of a section that are in `leaves`; those `required` must be there."""
    return {key: leaf.read(section.get(key, MISSING), join(path, key))
            for key, leaf in leaves.items() if key in section or key in required}


def unknown(path, value, key, known) -> SceneError:
    """Give the error for a key that is not known; it names the nearest known one."""
    nearest = difflib.get_close_matches(join('', key), known, n=1, cutoff=0.0)
    hint = f'; the nearest known one is {nearest[0]}' if nearest else ''
    return SceneError(path, value, f'unknown key{hint} (known: {", ".join(known) or "none"})')


def is_list_of_vectors(value) -> bool:
    """Tell a list of vectors from a single vector; an empty list is the former."""
    if isinstance(value, np.ndarray):
        return value.ndim == 2
    return isinstance(value, (list, tuple)) and (
        not value or any(isinstance(row, SEQUENCES) for row in value))


def read_vectors(value, path, leaf):
    """Give a list of vectors as an (N, 3) array."""
    if isinstance(value, np.ndarray):
        try:
            return finite_vectors(value)
        except ValueError as error:
            raise SceneError(path, value, f'each row {leaf.allowed}; {error}') from None
    if not isinstance(value, (list, tuple)):
        raise SceneError(path, value, 'must be a list of vectors')
    vectors = [leaf.read(row, f'{path}[{i}]') for i, row in enumerate(value)]
    return np.array(vectors, dtype=np.float64).reshape(-1, 3)


def finite_vectors(array):
    """Give a copy of an (N, 3) array as float64; ValueError says what is wrong with it."""
    if array.dtype.kind not in 'iuf' or array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f'this is {array.dtype} of shape {array.shape} instead of (N, 3) numbers')
    with np.errstate(over='ignore'):  # a long double may be more than a float64 can hold
        vectors = np.array(array, dtype=np.float64, order='C')
    bad = np.flatnonzero(~np.isfinite(vectors).all(axis=1))
    if len(bad):
        raise ValueError(f'row {bad[0]} is not finite')
    return vectors


def read_each(value, path, leaf, count, things='particles'):
    """Give one number for all of the things, or an array with one for each."""
    rows = as_list(value)
    if not isinstance(rows, list):
        return leaf.read(value, path)
    if len(rows) != count:
        raise SceneError(path, value, f'must be one number or one for each of the {count} '
                                      f'{things}, not {len(rows)}')
    numbers = [leaf.read(row, f'{path}[{i}]') for i, row in enumerate(rows)]
    return read_only(np.array(numbers, dtype=np.float64))


def read_only(array):
    """Make an array read-only in place and give it back."""
    array.flags.writeable = False
    return array


def read_yaml(path):
    """Give the content of a YAML file; SceneError says what is wrong with it and in which line."""
    try:
        return yaml.load(path.read_bytes(), Loader=Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        problem = f'line {mark.line + 1}: {error.problem}' if mark else error.problem
    except Exception as error:  # PyYAML lets many types escape: `!!bool x` gives a KeyError
        problem = f'{type(error).__name__}: {error}'
    problem = ' '.join(problem.split())
    raise SceneError('scene', str(path), f'must be a readable YAML file; {problem}')


MERGE = 'tag:yaml.org,2002:merge'


class Loader(yaml.SafeLoader):
    """
    YAML with the numbers of its version 1.2, in which a key given twice is an error.

    Source: YAML 1.2.2, section 10.3.2, core schema. PyYAML is of version 1.1, in which 010 is 8,
    1:30 is 90, 1_000 a number, 1e3 none, and `no` is false.
    """

    yaml_implicit_resolvers = {}

    def construct_whole_number(self, node):
        """Give a whole number, written in tens, as 0o in eights or as 0x in sixteens."""
        text = self.construct_scalar(node)
        return int(text.replace('_', '?'), {'0o': 8, '0x': 16}.get(text[:2], 10))

    def compose_mapping_node(self, anchor):
        node = super().compose_mapping_node(anchor)
        seen = set()
        for key, _ in node.value:
            if _name(key) in seen:
                raise yaml.MarkedYAMLError(problem=f'the key {_name(key)} is given twice',
                                           problem_mark=key.start_mark)
            seen.add(_name(key))
        return node

    def flatten_mapping(self, node):
        """
        Take in what is merged by <<; own keys win over it, and what is merged first over the rest.

        PyYAML 6.0.4 takes the last, and others before it double what is merged at each level.
        """
        own = [pair for pair in node.value if pair[0].tag != MERGE]
        merged = {}
        for _, value in (pair for pair in node.value if pair[0].tag == MERGE):
            for source in value.value if isinstance(value, yaml.SequenceNode) else [value]:
                if not isinstance(source, yaml.MappingNode):
                    raise yaml.MarkedYAMLError(problem='<< takes mappings only',
                                               problem_mark=source.start_mark)
                self.flatten_mapping(source)
                for pair in source.value:
                    merged.setdefault(_name(pair[0]), pair)
        node.value = own
        super().flatten_mapping(node)
        node.value = [*merged.values(), *node.value]


def _name(key):
    """Give what tells a key of a mapping from others."""
    return key.value if isinstance(key, yaml.ScalarNode) else id(key)


for _tag, _pattern, _first in (
        ('null', r'~|null|Null|NULL|', '~nN'),
        ('bool', r'true|True|TRUE|false|False|FALSE', 'tTfF'),
        ('int', r'[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+', '-+0123456789'),
        ('float', r'[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?'
                  r'|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)', '-+.0123456789'),
        ('merge', r'<<', '<')):
    Loader.add_implicit_resolver(f'tag:yaml.org,2002:{_tag}', re.compile(rf'(?:{_pattern})\Z'),
                                 [*_first, *[''] * (_tag == 'null')])
Loader.add_constructor('tag:yaml.org,2002:int', Loader.construct_whole_number)


def _quotes_hint(value) -> str:
    """Give advice where a number was written as text."""
    if not isinstance(value, str):
        return ''
    try:
        float(value.replace('_', '?'))      # Python reads 1_000, YAML does not
    except ValueError:
        return ''
    return ', written without quotes'
