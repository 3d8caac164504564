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
Checks 6: features that are neutral change no bit.

Promised to the last bit (test_absent.py): friction and drag of 0, the restitution that a collider
has anyway, motion of velocity 0, a move to where a collider is, a parameter set to its value.
Pairs of balls that never meet and a mesh far away run through other kernels, which compute the
same. A box that is cut in two is the same box, to rounding.
"""

import copy

from cases import acts, calls, changed, each, play, simulate, single_steps, UPRIGHT
from distances import rotation
import numpy as np
from symmetries import compare
from untouched import differences, is_squeezed, with_colliders

STILL = {'linear_velocity': [0.0, 0.0, 0.0], 'angular_velocity': [0.0, 0.0, 0.0]}


def friction_of_zero(case, run, random):
    """Friction of 0 where there is none, and the other kind of 0 where there is one."""
    sections = [case['scene'], case['scene'].get('pairs'), *case['scene'].get('colliders', ())]
    which = random.integers(3)
    other = copy.deepcopy(case)
    scene = other['scene']
    for section, before in zip([scene, scene.get('pairs'), *scene.get('colliders', ())], sections):
        if section is None:
            continue
        friction = section.get('friction')
        if friction == 'none' or friction is None and section is scene:
            section['friction'] = [{'dry': 0.0}, {'wet': 0.0}, {'dry': 0.0, 'wet': 0.0}][which]
        elif isinstance(friction, dict):
            section['friction'] = {'dry': 0.0, 'wet': 0.0, **friction}
    return differences(run, play(other))


def drag_of_zero(case, run, random):
    """Drag of 0 where there is none; wind alone does nothing."""
    if 'drag' in case['scene'] and any(case['scene']['drag'].get(key)
                                       for key in ('linear', 'quadratic')):
        return None
    if any('drag' in key for name, value in calls(case) if name == 'set' for key in value):
        return None
    drag = [{'linear': 0.0}, {'quadratic': 0.0}, {'wind': [3.0, 2.0, 1.0]}][random.integers(3)]
    return differences(run, play(changed(case, drag=drag)))


def restitution_as_it_is(case, run, random):
    """Write the restitution of the scene at each collider and at the pairs."""
    if any(name == 'set' for name, _ in calls(case)):
        return None
    eps, other = case['scene'].get('restitution', 0.0), copy.deepcopy(case)
    for collider in other['scene'].get('colliders', ()):
        collider.setdefault('restitution', eps)
    if 'pairs' in other['scene']:
        other['scene']['pairs'].setdefault('restitution', eps)
    return differences(run, play(other))


def motion_of_zero(case, run, random):
    """Add scripts that do not move a collider."""
    other, used = copy.deepcopy(case), acts(case, 'move') | acts(case, 'place')
    for collider in other['scene'].get('colliders', ()):
        if collider['name'] not in used:
            collider.setdefault('motion', STILL)
    return differences(run, play(other))


def moves_to_where_it_is(case, run, random):
    """`move_collider` to the pose that a collider has; those whose quaternion is exactly unit."""
    used = acts(case, 'move') | acts(case, 'place')
    poses = {collider['name']: [collider.get('position', collider.get('point', [0.0] * 3)),
                                collider.get('orientation', UPRIGHT)]
             for collider in case['scene'].get('colliders', ())
             if 'motion' not in collider and collider['name'] not in used
             and collider.get('orientation', UPRIGHT) in (UPRIGHT, [0.5, 0.5, 0.5, 0.5])}
    if not poses:
        return None
    other = {**case, 'calls': []}
    for name, value in calls(single_steps(case)):
        if name == 'step':
            other['calls'].append({'move': poses})
        if name == 'move':
            value = {**value, **poses}
        other['calls'].append({name: value})
    if used:
        other['calls'] = [entry for k, entry in enumerate(other['calls']) if not (
            entry.get('move') is poses and k and 'move' in other['calls'][k - 1])]
    return differences(run, play(other))


def parameters_set_to_what_they_are(case, run, random):
    """
    `set_parameters` to the values that the scene has, in between.

    Where the program changes parameters, those of colliders and pairs are left alone: what follows
    the scene would no longer.
    """
    alters = any(name == 'set' for name, _ in calls(case))
    other, changes = {**case, 'calls': []}, set()
    values = {path: parameter.value
              for path, parameter in simulate(case).scene.parameters().items()
              if not (alters and path.startswith(('colliders.', 'pairs.')))}
    for name, value in calls(single_steps(case)):
        if name == 'set':
            changes |= {path.split('.')[0] for path in value}
        same = {path: value for path, value in values.items() if path.split('.')[0] not in changes}
        if name == 'step' and same:
            other['calls'].append({'set': same})
        other['calls'].append({name: value})
    return differences(run, play(other))


def pairs_that_never_meet(case, run, random):
    """Balls may collide, but never come near each other."""
    radius = each(case, 'radius', 0.0)
    if 'pairs' in case['scene'] or 'springs' in case['scene'] or not radius.any() \
            or case['scene'].get('stepping', {}).get('method') == 'exact':
        return None
    for step in run:
        g = np.linalg.norm(step.scene.gravity) * step.scene.stepping.dt
        way = (np.linalg.norm(step.v0, axis=1) + g) * step.scene.stepping.dt \
            + 2.0 * np.linalg.norm(step.x - step.x0, axis=1)
        for i in range(len(radius)):
            for j in range(i):
                apart = np.linalg.norm(step.x0[i] - step.x0[j])
                if apart < 2.0 * (radius[i] + radius[j] + way[i] + way[j]):
                    return None
    return differences(run, play(changed(case, pairs={'restitution': 0.5})))


def far_mesh(case, run, random):
    """Add a mesh far away, open or closed."""
    if case['scene'].get('stepping', {}).get('method') in ('exact', 'second_order_contact'):
        return None
    mesh = {'name': 'far', 'shape': 'mesh', 'position': [1e3, -2e3, 500.0],
            'vertices': [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            'faces': [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]][random.integers(2):]}
    count = len(case['scene'].get('colliders', []))
    other, mapping = with_colliders(case, [mesh], count if random.random() < 0.5 else 0)
    return None if is_squeezed(case, run) else differences(run, play(other), colliders=mapping)


def cut_boxes(case, run, random):
    """
    Cut a box in two: it is the same box, to rounding, for who starts outside.

    Of boxes that do not turn: then both parts have the motion of the whole.
    """
    used, whole = acts(case, 'move') | acts(case, 'place') | acts(case, 'set'), None
    for k, collider in enumerate(case['scene'].get('colliders', ())):
        motion = collider.get('motion', {})
        if collider['shape'] == 'box' and not collider.get('inside') \
                and collider['name'] not in used and not any(motion.get('angular_velocity', ())):
            whole = k
    if whole is None or len(case['scene']['colliders']) > 6:
        return None
    if (run[0].gaps[whole, 0] < -1e-12).any():
        return None
    box = case['scene']['colliders'][whole]
    axis, share = int(random.integers(3)), (0.5, 0.25)[random.integers(2)]
    parts = [copy.deepcopy(box), copy.deepcopy(box)]
    size, frame = box['size'][axis], rotation(box.get('orientation', UPRIGHT))
    middle = np.array(box.get('position', [0.0] * 3))
    for part, low, high in zip(parts, (0.0, share), (share, 1.0)):
        part['size'][axis] = (high - low) * size
        part['position'] = (middle + (0.5 * (low + high) - 0.5) * size * frame[:, axis]).tolist()
    parts[1]['name'] = box['name'] + 'b'
    other = changed(case, colliders=[*case['scene']['colliders'][:whole], *parts,
                                     *case['scene']['colliders'][whole + 1:]])
    return compare(case, run, play(other), lambda x, v, time: (x, v), random)


CHECKS = (friction_of_zero, drag_of_zero, restitution_as_it_is, motion_of_zero,
          moves_to_where_it_is, parameters_set_to_what_they_are, pairs_that_never_meet, far_mesh,
          cut_boxes)
