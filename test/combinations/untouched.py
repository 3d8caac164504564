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
Checks 3: nothing that is not touched matters; the same bits.

Each plays the case in another way and compares places, velocities, counters and contacts with
those of the run, bit for bit: promise.md says the same bits for the same input on any number of
threads, design.md for colliders that nobody touches and for the order of colliders and particles.
"""

import copy
import pickle

from bounds import has_no_place
from cases import call, calls, changed, particles, play, simulate, single_steps, state
from numba import config
import numpy as np
from symmetries import compare

FAR = 1e4           # m, of colliders that nobody touches
CONTACT = 1e-9      # of the impulses; whose sums may come in another order


def differences(run, other, which=None, colliders=None, contacts=True, counters=True):
    """
    Tell the first difference of two runs, None without.

    Parameters
    ----------
    run, other : list of Step
        As of cases.play.
    which : sequence of int or None
        Particles of `run` that those of `other` are; None: all.
    colliders : sequence of int or None
        Colliders of `run` that those of `other` are, None for one that only `other` has.
    contacts, counters : bool
        Whether to compare them, too.

    """
    which = np.arange(len(run[0].x)) if which is None and run else which
    for k, (one, two) in enumerate(zip(run, other, strict=True)):
        for name in ('x', 'v'):
            a, b = getattr(one, name)[which], getattr(two, name)
            if a.tobytes() != b.tobytes() and not np.array_equal(a, b, equal_nan=True):
                i = int((a != b).any(axis=1).argmax())
                return (f'step {k}: {name} of particle {which[i]} is {b[i].tolist()}, not '
                        f'{a[i].tolist()}')
        if counters and one.counters != two.counters:
            return f'step {k}: counters {_apart(two.counters, one.counters)}'
        if contacts and one.contacts is not None and two.contacts is not None:
            a, b = _told(one.contacts, None, None), _told(two.contacts, which, colliders)
            a = [row for row in a if row[0] in which]
            if a != b:
                return f'step {k}: contacts {b}, not {a}'
    return None


def _apart(counters, others):
    return ', '.join(f'{key} {counters[key]}, not {others[key]}' for key in counters
                     if counters[key] != others[key])


def _told(contacts, which, colliders):
    """Give the contacts as sorted rows that can be compared."""
    return sorted((int(i) if which is None else int(which[i]),
                   int(c) if colliders is None else colliders[c],
                   *point.tolist(), *normal.tolist(), *impulse.tolist(), int(kind))
                  for i, c, point, normal, impulse, kind in zip(*contacts))


def far_collider(random, name):
    """Give a collider far away of any shape that stands, moves, turns or swings."""
    shape = ['sphere', 'box', 'capsule', 'cylinder', 'plane', 'mesh'][random.integers(5)]
    way = random.standard_normal(3)
    place = (FAR * way / np.linalg.norm(way)).round(1).tolist()
    size = {'sphere': {'radius': 1.0}, 'box': {'size': [1.0, 2.0, 3.0]}, 'plane': {}}.get(
        shape, {'radius': 0.5, 'length': 2.0})
    found = {'name': name, 'shape': shape, **size}
    if shape == 'plane':    # it must neither turn nor come near
        found.update(point=place, normal=[-entry / FAR for entry in place])
    else:
        found['position'] = place
    kind = random.integers(4)
    if kind == 1:
        found['motion'] = {'linear_velocity': [3.0, -1.0, 2.0]}
    elif kind == 2 and shape != 'plane':
        found['motion'] = {'angular_velocity': [30.0, 50.0, -100.0]}
    elif kind == 3:
        found['motion'] = {'oscillate': {'axis': [0.0, 0.6, 0.8], 'amplitude': 0.5,
                                         'frequency': 7.0}}
    if random.random() < 0.3:
        found['restitution'], found['friction'] = 1.0, 'none'
    return found


def with_colliders(case, more, index):
    """Give a case with more colliders at an index; and whose is which."""
    colliders = case['scene'].get('colliders', [])
    mapping = [*range(index), *[None] * len(more), *range(index, len(colliders))]
    return changed(case, colliders=colliders[:index] + more + colliders[index:]), mapping


def is_squeezed(case, run):
    """Whether balls have no place in a cavity, and so push each other as far as what is far."""
    return 'pairs' in case['scene'] and any(has_no_place(case, step) for step in run)


def far_collider_changes_nothing(case, run, random):
    """Add a collider far away: still, moving or spinning, first, last or in between."""
    count = len(case['scene'].get('colliders', []))
    index = [0, count, int(random.integers(count + 1))][random.integers(3)]
    other, mapping = with_colliders(case, [far_collider(random, 'far')], index)
    return None if is_squeezed(case, run) else differences(run, play(other), colliders=mapping)


def grid_changes_nothing(case, run, random):
    """So many still colliders far away that all are looked up in a grid."""
    count = len(case['scene'].get('colliders', []))
    if count >= 8:
        return None
    more = [{'name': f'far{k}', 'shape': 'sphere', 'radius': 1.0,
             'position': [100.0 + 10.0 * k, 50.0, (-1.0) ** k * 30.0]} for k in range(9)]
    other, mapping = with_colliders(case, more, 0 if random.random() < 0.5 else count)
    return None if is_squeezed(case, run) else differences(run, play(other), colliders=mapping)


def order_of_colliders(case, run, random):
    """Colliders in another order."""
    colliders = case['scene'].get('colliders', [])
    if len(colliders) < 2:
        return None
    order = random.permutation(len(colliders)).tolist()
    if order == sorted(order):
        order = order[::-1]
    other = changed(case, colliders=[colliders[k] for k in order])
    return differences(run, play(other), colliders=order)


def some_particles(case, which):
    """Give a case with some of its particles, in an order."""
    section = dict(case['scene']['particles'])
    count = particles(case)
    for key in ('position', 'velocity', 'mass', 'radius'):
        value = section.get(key)
        if isinstance(value, list) and len(value) == count and (
                key in ('mass', 'radius') or key == 'position' or isinstance(value[0], list)):
            section[key] = [value[k] for k in which]
    other = changed(case, particles=section)
    if 'springs' in other['scene']:
        place = {k: n for n, k in enumerate(which)}
        other['scene']['springs']['pairs'] = [
            [place[a], place[b]] for a, b in other['scene']['springs']['pairs']]
    return other


def order_of_particles(case, run, random):
    """
    Particles in another order; twins at one place excepted, who part as they are listed.

    The implicit solver of springs eliminates the velocities one after the other, or iterates with
    sums over all of them: there the answer is the same to rounding.
    """
    count = particles(case)
    if count < 2 or len(np.unique(run[0].x0, axis=0)) < count:
        return None
    order = random.permutation(count).tolist()
    if order == sorted(order):
        order = order[::-1]
    others, back = play(some_particles(case, order)), np.argsort(order)
    if case['scene'].get('springs', {}).get('solver') == 'implicit':
        return compare(case, run, others, lambda x, v, time: (x[back], v[back]), random)
    return differences(run, others, which=order)


def one_by_one(case, run, random):
    """Particles that do not act on each other, one by one."""
    if particles(case) < 2 or 'pairs' in case['scene'] or 'springs' in case['scene']:
        return None
    i = int(random.integers(particles(case)))
    return differences(run, play(some_particles(case, [i])), which=[i], counters=False)


def threads(case, run, random):
    """One thread or two, with so many copies of the particles that they come in several blocks."""
    if config.DISABLE_JIT or 'springs' in case['scene']:
        return None
    copies = 1100 // particles(case)
    other = some_particles(case, list(range(particles(case))) * copies)
    if 'pairs' in case['scene']:
        shift = np.repeat(np.arange(copies), particles(case))[:, None] * (0.0, 50.0, 0.0)
        other['scene']['particles']['position'] = (
            np.array(other['scene']['particles']['position']) + shift).tolist()
    other['calls'] = other['calls'][:2]
    return differences(play(other, threads=1), play(other, threads=2))


def checkpoint(case, run, random):
    """See that a copy or a pickle of the simulation goes on as the simulation would."""
    program = calls(single_steps(case))
    cut = int(random.integers(len(program) + 1))
    sim, deep = simulate(case), random.random() < 0.5
    for name, value in program[:cut]:
        sim.step(value) if name == 'step' else call(sim, name, value)
    again = copy.deepcopy(sim) if deep else pickle.loads(pickle.dumps(sim))
    rest = {**case, 'calls': [{name: value} for name, value in program[cut:]]}
    for one in (again, sim):        # the copy first: it must not disturb its original
        taken = len(run) - sum(value for name, value in program[cut:] if name == 'step')
        problem = differences(run[taken:], play(rest, one))
        if problem:
            return f'{"copied" if one is again else "original"} after call {cut}: {problem}'
    return None


def steps_at_once(case, run, random):
    """step(n) is n times step(): the state in the end."""
    sim = simulate(case)
    for name, value in calls(case):
        sim.step(value) if name == 'step' else call(sim, name, value)
    return _ends_alike(run, sim)


def again_after_reset(case, run, random):
    """After a reset the same calls lead to the same bits; parameters and poses were the same."""
    if any(name == 'set' for name, _ in calls(case)):
        return None
    sim = simulate(case)
    for name, value in calls(case):
        sim.step(value) if name == 'step' else call(sim, name, value)
    sim.reset()
    return differences(run, play(case, sim))


def _ends_alike(run, sim):
    x, v, counters, _ = state(sim)
    if run and not (np.array_equal(x, run[-1].x, equal_nan=True)
                    and np.array_equal(v, run[-1].v, equal_nan=True)):
        return (f'ends at {x.tolist()}, {v.tolist()}, not '
                f'{run[-1].x.tolist()}, {run[-1].v.tolist()}')
    total = {key: sum(step.counters[key] for step in run) for key in counters}
    return f'counters {_apart(counters, total)}' if run and counters != total else None


def contacts_are_only_looked_at(case, run, random):
    """Contacts are recorded or not; the ledger is kept or not."""
    other = {**case, 'contacts': not case.get('contacts', True)}
    problem = differences(run, play(other))
    if problem:
        return f'contacts: {problem}'
    other = {**case, 'ledger': not case.get('ledger', False)}
    problem = differences(run, play(other))
    return f'ledger: {problem}' if problem else None


CHECKS = (far_collider_changes_nothing, grid_changes_nothing, order_of_colliders,
          order_of_particles, one_by_one, threads, checkpoint, steps_at_once, again_after_reset,
          contacts_are_only_looked_at)
