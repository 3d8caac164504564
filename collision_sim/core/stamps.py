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
What a compiled function is made from, as a digest: the key of the cache on disk.

It is of the function itself and of all that it uses, as Python has read it: a comment, a docstring
or a function that it does not use changes nothing, a constant does. What it calls by address
(jit.by_address) is compiled by itself. Of the files that say how functions are compiled, every
byte counts.
"""

from hashlib import sha256
from opcode import opmap
from pathlib import Path
import re
from types import CodeType, FunctionType, ModuleType

import numpy as np

LOAD_GLOBAL, EXTENDED = opmap['LOAD_GLOBAL'], opmap['EXTENDED_ARG']
DEFAULTS, CLOSURE = '(defaults)', '(closure)'
HOW = ('jit.py', 'reference.py', 'stamps.py')
# A line that names a NamedTuple, or a field of one with its type.
FIELD = re.compile(rb'class \w+\(NamedTuple\):|    \w+: (int|float|bool|tuple|np\.ndarray|Optional'
                   rb'\[.*\]|[A-Z]\w*)( = .*)?')
_how = None             # digest of these
_nodes = {}             # by id of a function: itself, digest of its own, functions that it uses


def stamp(function, options):
    """
    Return the digest of a Python function that is compiled with some options.

    Parameters
    ----------
    function : function
        As it is without Numba.
    options : dict
        Of Numba.

    Returns
    -------
    bytes

    """
    digest = sha256(_digest_of_how() + _in_words(options).encode())
    for each in sorted(_node(used)[1] for used in uses(function)):
        digest.update(each)
    return digest.digest()


def uses(function):
    """Return all Python functions that are compiled into one, itself included."""
    found, new = {id(function): function}, [function]
    while new:
        for used in _node(new.pop())[2]:
            if id(used) not in found:
                found[id(used)] = used
                new.append(used)
    return list(found.values())


def _digest_of_how():
    """Return the digest of what says how functions are compiled, and in which order fields lie."""
    global _how
    if _how is None:
        core = Path(__file__).parent
        fields = (line for path in sorted(core.glob('*.py'))
                  for line in path.read_bytes().splitlines() if FIELD.fullmatch(line))
        files = ((core / name).read_bytes() for name in HOW)
        _how = sha256(b'\n'.join([*files, *fields])).digest()
    return _how


def _node(function):
    """Return a function, the digest of what it says, and the functions that it uses."""
    if id(function) not in _nodes:
        used, words = [], [_label(function)]
        values = _globals(function)
        for k, cell in enumerate(function.__closure__ or ()):
            values[CLOSURE + str(k)] = cell.cell_contents
        values[DEFAULTS] = function.__defaults__, function.__kwdefaults__
        words += [f'{name}={_value(values[name], used)}' for name in sorted(values)]
        digest = sha256('\n'.join(words).encode())
        for code in _codes(function.__code__):
            digest.update(_said(code))
        _nodes[id(function)] = function, digest.digest(), used
    return _nodes[id(function)]


def _codes(code):
    """Yield code and the code of the functions in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _said(code):
    """Return code as bytes, without where it is and what is written about it."""
    about, *constants = code.co_consts or (None,)       # a docstring, or None
    constants = [about if not isinstance(about, str) else None, *constants]
    said = (code.co_names, code.co_varnames, code.co_freevars, code.co_argcount,
            code.co_kwonlyargcount, code.co_flags,
            [None if isinstance(each, CodeType) else each for each in constants])
    return code.co_code + code.co_exceptiontable + repr(said).encode()


def _globals(function):
    """Return the global values that a function uses, by name."""
    known, found = function.__globals__, {}
    for code in _codes(function.__code__):
        names = code.co_names
        if 'by_address' in names:
            names = set(names) - _handed_over(code, known)
        found |= {name: known[name] for name in names if name in known}
    return found


def _handed_over(code, known):
    """Return the names of compiled functions that code hands over, and does not call."""
    handed, called, high = set(), set(), 0
    said = code.co_code
    for operation, argument in zip(said[::2], said[1::2]):
        argument |= high
        high = argument << 8 if operation == EXTENDED else 0
        if operation == LOAD_GLOBAL:
            (called if argument & 1 else handed).add(code.co_names[argument >> 1])
    return {name for name in handed - called if hasattr(known.get(name), 'py_func')}


def _value(value, used):
    """Say in words what a value is; functions to be looked into are added to those used."""
    if isinstance(value, (tuple, list)) and type(value).__name__ in ('tuple', 'list'):
        return f'({", ".join(_value(each, used) for each in value)})'
    if isinstance(value, dict):
        return _value(sorted(value.items()), used)
    if isinstance(value, np.ndarray):
        return f'{value.dtype} {value.shape} {value.tobytes()}'
    if isinstance(value, ModuleType):
        return value.__name__
    if isinstance(value, type):
        return _class_in_words(value)
    function = getattr(value, 'py_func', None) or getattr(value, '_defn', value)
    if isinstance(function, FunctionType):
        if function.__module__.split('.')[0] not in ('numba', 'numpy', 'llvmlite'):
            used.append(function)
            # By agreement an overload of a Python function has its name with an underscore.
            other = function.__globals__.get('_' + function.__name__)
            if function is value and isinstance(other, FunctionType):
                used.append(other)
        return f'{_label(function)} {_in_words(getattr(value, "targetoptions", {}))}'
    if callable(value):
        return getattr(value, '__qualname__', type(value).__qualname__)
    if type(value).__module__ in ('builtins', 'numpy') or hasattr(value, '_fields'):
        return repr(value)
    return type(value).__qualname__


def _class_in_words(kind):
    """Say what there is in a class, as far as compiled code sees it."""
    fields = getattr(kind, '_fields', ())
    return f'{kind.__module__}.{kind.__qualname__} {fields}'


def _label(function):
    return f'{function.__module__}.{function.__qualname__}'


def _in_words(options):
    """Say in words how a function is compiled."""
    return str(sorted((name, getattr(value, '__qualname__', repr(value)))
                      for name, value in options.items()))
