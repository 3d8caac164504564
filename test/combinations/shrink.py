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
A failing case is made small: greedily, whatever can be left out or made simpler is.

Written for cases, as Hypothesis' shrinker knows nothing of a collider that goes with its moves;
one pass over a case costs some fifty examinations, of some ten milliseconds each.
"""

import copy
import time

from cases import calls, particles
from checks import examine, RUNS
import numpy as np
from scenes import has_half_turn
from untouched import some_particles

DROPPED = ('drag', 'restitution', 'friction', 'springs', 'pairs', 'gravity')
OF_A_COLLIDER = ('motion', 'inside', 'restitution', 'friction', 'orientation', 'file')


def shrink(case, name, seed, seconds):
    """
    Give a smaller case for which the same check still fails.

    Parameters
    ----------
    case : dict
        As in cases.py.
    name : str
        Of the check.
    seed : int or sequence of int
        Of what the check draws.
    seconds : float
        Of this process, after which no further attempt is made.

    Returns
    -------
    case : dict
    problem : str or None
        What the check says of it; None: it did not fail.

    """
    end = time.process_time() + seconds
    problem = _said(case, name, seed)
    going, before = problem is not None, _error(problem)
    while going:
        going = False
        for simpler in (_shorter, _fewer, _plainer, _rounder):
            tries, k = list(simpler(case)), 0
            while k < len(tries):
                if time.process_time() > end:
                    return case, problem
                said = _said(tries[k], name, seed)
                if said and _error(said) == before:
                    case, problem, going = tries[k], said, True
                    tries = list(simpler(case))
                else:
                    k += 1
    return case, problem


def _said(case, name, seed):
    """Ask a check of a case; None where it holds, or the scene is not accepted or not drawn."""
    if has_half_turn(case):
        return None
    return (examine(case, seed, [] if name == RUNS else [name]) or {}).get(name)


def _error(problem):
    """Give the kind of exception that a problem is, '' for none."""
    head = (problem or '').partition(':')[0]
    return head if head.endswith('Error') else ''


def _shorter(case):
    program = case['calls']
    for k in range(1, len(program)):
        if len(program) > 2 * k or k == 1:
            yield {**case, 'calls': program[:-k]}
    for k in range(len(program)):
        if len(program) > 1:
            yield {**case, 'calls': program[:k] + program[k + 1:]}
        (name, value), = program[k].items()
        if name == 'step' and value > 1:
            for less in (1, value // 2, value - 1):
                yield {**case, 'calls': program[:k] + [{'step': less}] + program[k + 1:]}


def _fewer(case):
    for k, collider in enumerate(case['scene'].get('colliders', ())):
        smaller = copy.deepcopy(case)
        del smaller['scene']['colliders'][k]
        smaller['calls'] = [entry for entry in (
            _without(entry, collider['name']) for entry in smaller['calls']) if entry]
        yield smaller
    count = particles(case)
    for k in range(count):
        if count > 1:
            rest = [i for i in range(count) if i != k]
            springs = case['scene'].get('springs')
            if springs:
                if all(k in pair for pair in springs['pairs']):
                    continue
                case = copy.deepcopy(case)
                case['scene']['springs']['pairs'] = [
                    pair for pair in springs['pairs'] if k not in pair]
            yield some_particles(case, rest)


def _without(entry, collider):
    """Give a call without a collider; an empty one where nothing is left."""
    (name, value), = entry.items()
    if name in ('move', 'place'):
        value = {key: pose for key, pose in value.items() if key != collider}
    elif name == 'set':
        value = {key: number for key, number in value.items()
                 if not key.startswith(f'colliders.{collider}.')}
    return {name: value} if value else {}


def _plainer(case):
    for key in ('ledger', 'contacts'):
        if case.get(key):
            yield {**case, key: False}
    for key in DROPPED:
        if key in case['scene']:
            yield _at(case, (key,), None)
    if 'gravity' not in case['scene']:
        yield _at(case, ('gravity',), [0.0, 0.0, 0.0])
    for section in ('stepping', 'particles', 'pairs', 'springs', 'drag'):
        for key in case['scene'].get(section, ()):
            if key not in ('dt', 'position'):
                yield _at(case, (section, key), None)
    for k, collider in enumerate(case['scene'].get('colliders', ())):
        for key in OF_A_COLLIDER:
            if key in collider:
                yield _at(case, ('colliders', k, key), None)
        for key in collider.get('motion', ()):
            if len(collider['motion']) > 1:
                yield _at(case, ('colliders', k, 'motion', key), None)


def _rounder(case):
    """Give cases with one number 0, 1 or shorter."""
    for path, value in list(_numbers(case['scene'], ())):
        if isinstance(value, bool):
            continue
        for digits in (None, 1, 2, 3):
            simple = 0.0 if digits is None else float(f'{value:.{digits}g}')
            if simple != value and len(repr(simple)) < len(repr(value)):
                yield _at(case, path, simple)
    for k, (name, value) in enumerate(calls(case)):
        if name in ('move', 'place'):
            for collider, (place, turn) in value.items():
                for simple in ([float(f'{x:.2g}') for x in place], [0.0] * 3):
                    if simple != place:
                        smaller = copy.deepcopy(case)
                        smaller['calls'][k][name][collider] = [simple, turn]
                        yield smaller
                if turn != [0.0, 0.0, 0.0, 1.0]:
                    smaller = copy.deepcopy(case)
                    smaller['calls'][k][name][collider] = [place, [0.0, 0.0, 0.0, 1.0]]
                    yield smaller


def _numbers(section, path):
    """Give paths and values of all numbers of a section."""
    entries = section.items() if isinstance(section, dict) else enumerate(section)
    for key, value in entries:
        if isinstance(value, (dict, list)):
            yield from _numbers(value, (*path, key))
        elif isinstance(value, float) and value != 0.0 and np.isfinite(value):
            yield (*path, key), value


def _at(case, path, value):
    """Give a copy of a case with another value in its scene; None: without that key."""
    case = copy.deepcopy(case)
    section = case['scene']
    for key in path[:-1]:
        section = section[key]
    if value is None:
        del section[path[-1]]
    else:
        section[path[-1]] = value
    return case
