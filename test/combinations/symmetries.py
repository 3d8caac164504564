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
Checks 4: mirror images, other axes, other frames and other units give the same, to rounding.

Each plays a case that is turned, mirrored, carried along or measured in other units, and turns,
mirrors, ... the answer back. Rounding is amplified by each collision, at a corner beyond all
bounds; so steps are compared only as long as the run itself is steady: as a run whose start and
colliders are 1e-10 off stays close, and as long as all could be placed: who could not goes
along with one of the colliders that hold it, where a press has closed to rounding; and no ball
starts in a cavity that is too small for it, where there is no place. What the scene itself
makes a knife edge, such as a ball that falls on an edge, is left out by that; `own_mirror_image`
is for those that are symmetric.
"""

import copy

from bounds import has_no_place, is_excused
from cases import acts, calls, each, particles, play, single_steps
import numpy as np
from scenes import product_of

TOLERANCE = 1e-8        # of the lengths and speeds in the scene
PLACED = 1e-5           # of those, where a fail-safe places, in corners however acute they are
SOLVED = 3e-5           # of those, with implicit springs: the root of the share of their energy
NUDGE = 2.0 ** -33      # of those, to see whether a run is steady
AMPLIFIED = 1e5         # most that a steady run makes of a nudge
EYE = np.eye(3)


def lengths(step):
    """Length and speed [m], [m/s] by which places and velocities of a step are measured."""
    size = 1.0 + max((np.abs(pose[0]).max() for pose in step.poses), default=0.0)
    speed = 1.0 + np.abs(step.v0).max(initial=0.0) + max(
        (np.abs(one[0] - two[0]).max() for one, two in zip(step.poses0, step.poses)),
        default=0.0) / (step.scene.stepping.dt or 1.0)
    return size + np.abs(step.x0).max(initial=0.0), speed


def apart(run, others, back=lambda x, v, time: (x, v)):
    """Give for each step how far two runs are apart, relative; `back` brings others back."""
    found = []
    for k, (one, two) in enumerate(zip(run, others)):
        time = (k + 1) * one.scene.stepping.dt
        x, v = back(two.x, two.v, time)
        length, speed = lengths(one)
        with np.errstate(invalid='ignore'):
            found.append(max(np.abs(x - one.x).max(initial=0.0) / length,
                             np.abs(v - one.v).max(initial=0.0) / speed))
    return found


def nudges(case, random, count):
    """
    Give so many cases, an even number, that start a little off: particles and colliders.

    Each is off as far as one before it, to the other side: so on a knife edge, such as a collider
    that comes as far as a particle, or a ball that just fits between two, one of both falls to
    each side of it.
    """
    for _ in range(count // 2):
        state = random.bit_generator.state
        for sign in (1.0, -1.0):
            random.bit_generator.state = state
            yield _nudged(case, random, sign * NUDGE)


def _nudged(case, random, most):
    """Give a case whose places, velocities and radii are up to `most` off, and colliders'."""
    case = copy.deepcopy(case)
    scene, off = case['scene'], {}
    found, count = scene['particles'], particles(case)
    for key in ('position', 'velocity'):
        value = np.broadcast_to(np.array(found.get(key, (0.0, 0.0, 0.0)), dtype=float), (count, 3))
        found[key] = (value + most * random.uniform(-1.0, 1.0, value.shape)).tolist()
    radius = each(case, 'radius', 0.0)
    if radius.any():
        found['radius'] = (radius + most * (radius > 0.0)
                           * random.uniform(-1.0, 1.0, count)).tolist()
    for collider in scene.get('colliders', ()):
        off[collider['name']] = most * random.uniform(-1.0, 1.0, 3)
        key = 'point' if collider['shape'] == 'plane' else 'position'
        collider[key] = (np.array(collider.get(key, (0.0, 0.0, 0.0)), dtype=float)
                         + off[collider['name']]).tolist()
    for name, value in calls(case):
        if name in ('move', 'place'):
            for key, (place, turn) in value.items():
                value[key] = [(np.array(place, dtype=float) + off[key]).tolist(), turn]
    return case


def compare(case, run, others, back, random):
    """Tell the first step of a steady run in which the answers differ by more than rounding."""
    gaps = apart(run, others, back)
    least = SOLVED if case['scene'].get('springs', {}).get('solver') == 'implicit' else TOLERANCE
    bad = [k for k, gap in enumerate(gaps) if not gap <= (
        PLACED if run[k].counters['fail_safes'] else least)]
    if not bad or not np.isfinite(gaps[bad[0]]) and not np.isfinite(run[bad[0]].x).all():
        return None
    if any(is_excused(step) or has_no_place(case, step)
           for step in [*run[:bad[0] + 1], *others[:bad[0] + 1]]):
        return None
    for other in nudges(case, random, 4):
        unsteady = apart(run, play(other))
        if not max(unsteady[:bad[0] + 1]) <= AMPLIFIED * NUDGE or unsteady[bad[0]] >= gaps[bad[0]]:
            return None
    k = bad[0]
    time = (k + 1) * run[k].scene.stepping.dt
    x, v = back(others[k].x, others[k].v, time)
    with np.errstate(invalid='ignore'):
        i = int((np.abs(x - run[k].x) + np.abs(v - run[k].v)).max(axis=1).argmax())
    return (f'step {k}: particle {i} at {x[i].tolist()}, {v[i].tolist()}, not '
            f'{run[k].x[i].tolist()}, {run[k].v[i].tolist()}')


# ----------------------------------------------------------------------------- turns and mirrors

def rotated(case, frame):
    """Give a case whose vectors are all multiplied by a signed permutation matrix (3, 3)."""
    case, sign = copy.deepcopy(case), round(np.linalg.det(frame))
    scene = case['scene']
    scene['gravity'] = vectors(frame, scene.get('gravity', [0.0, 0.0, -9.81]))
    if 'wind' in scene.get('drag', {}):
        scene['drag']['wind'] = vectors(frame, scene['drag']['wind'])
    for key in ('position', 'velocity'):
        if key in scene['particles']:
            scene['particles'][key] = vectors(frame, scene['particles'][key])
    files = case.get('files', {})
    for name, text in files.items():
        files[name] = ''.join(_rotated_line(line, sign) for line in text.splitlines(True))
    for collider in scene.get('colliders', ()):
        for key in ('position', 'point'):
            if key in collider:
                collider[key] = vectors(frame, collider[key])
        collider['orientation'] = _turned(frame, sign, collider.get('orientation', [0, 0, 0, 1]))
        if collider['shape'] == 'plane':
            collider['normal'] = _flipped(sign, collider.get('normal', [0.0, 0.0, 1.0]))
        if 'vertices' in collider:
            collider['vertices'] = [_flipped(sign, vertex) for vertex in collider['vertices']]
        motion = collider.get('motion', {})
        if 'linear_velocity' in motion:
            motion['linear_velocity'] = vectors(frame, motion['linear_velocity'])
        if 'angular_velocity' in motion:
            motion['angular_velocity'] = vectors(sign * frame, motion['angular_velocity'])
        if 'oscillate' in motion:
            motion['oscillate']['axis'] = vectors(frame, motion['oscillate']['axis'])
    for name, value in calls(case):
        if name in ('move', 'place'):
            for key, (place, turn) in value.items():
                value[key] = [vectors(frame, place), _turned(frame, sign, turn)]
        elif name == 'set':
            for key in ('gravity', 'drag.wind'):
                if key in value:
                    value[key] = vectors(frame, value[key])
    return case


def vectors(frame, value):
    """Multiply a vector, or a list of them."""
    return (np.array(value, dtype=float) @ frame.T + 0.0).tolist()


def _flipped(sign, vector):
    """Mirror in z, in the frame of a collider, whose shape is the same then."""
    return [vector[0], vector[1], sign * vector[2] + 0.0]


def _rotated_line(line, sign):
    if not line.startswith('v '):
        return line
    return 'v {!r} {!r} {!r}\n'.format(*_flipped(sign, [float(x) for x in line.split()[1:]]))


def _turned(frame, sign, q):
    """Orientation F R M of a collider: M mirrors in z where F mirrors, so that all is a turn."""
    q = np.array(q, dtype=float)
    if sign < 0:
        frame, q = frame @ np.diag((1.0, 1.0, -1.0)), q * (-1.0, -1.0, 1.0, 1.0)
    return product_of(quaternion(frame), q).tolist()


def quaternion(matrix):
    """Quaternion of a turn by its largest entry (S. W. Shepperd, J. Guid. Control 1, 1978)."""
    trace = np.trace(matrix)
    entries = np.append(np.diag(matrix), trace)
    k = int(entries.argmax())
    if k == 3:
        q = np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0],
                      matrix[1, 0] - matrix[0, 1], 1.0 + trace])
    else:
        i, j = (k + 1) % 3, (k + 2) % 3
        q = np.empty(4)
        q[k] = 1.0 + matrix[k, k] - matrix[i, i] - matrix[j, j]
        q[i], q[j] = matrix[i, k] + matrix[k, i], matrix[j, k] + matrix[k, j]
        q[3] = matrix[j, i] - matrix[i, j]
    return q / np.linalg.norm(q)


def _compare_rotated(case, run, frame, random):
    """
    Compare with the rotated case.

    Springs without a length, and balls with the same centre, are along x (core/springs.py).
    """
    at, scene = np.array(case['scene']['particles']['position'], dtype=float), case['scene']
    if 'pairs' in scene and len(np.unique(at, axis=0)) < len(at) or any(
            np.array_equal(at[i], at[j]) for i, j in scene.get('springs', {}).get('pairs', ())):
        return None
    others = play(rotated(case, frame))
    return compare(case, run, others, lambda x, v, time: (x @ frame, v @ frame), random)


def mirror_image(case, run, random):
    """See that the mirror image of a scene has the mirror image of its answer."""
    frame = np.diag([1.0, 1.0, 1.0])
    frame[(axis := int(random.integers(3))), axis] = -1.0
    return _compare_rotated(case, run, frame, random)


def other_axes(case, run, random):
    """Axes in another order, and turned by 90 degrees."""
    frame = EYE[random.permutation(3)] * random.choice((-1.0, 1.0), 3)[:, None]
    return _compare_rotated(case, run, frame, random)


def own_mirror_image(case, run, random):
    """
    See that what is its own mirror image stays so: particles in pairs, or on the plane.

    The colliders, too, are in pairs, or across. No nudge is asked for here:
    whatever happens, happens to both sides alike. Who starts inside, as far from two faces, has to
    take one of them, and those on the plane that balance on an edge. Balls with the same centre
    and velocity part along x (core/pairs.py): twins change places in the mirror, others cannot.
    """
    scene = case['scene']
    if acts(case, 'move') or acts(case, 'place') or acts(case, 'set') or 'drag' in scene \
            or 'springs' in scene:
        return None
    for axis in range(3):
        flip = np.ones(3)
        flip[axis] = -1.0
        partner = _mirrored_particles(case, flip)
        if partner is None or _starts_between_faces(run, partner) \
                or not _mirrors_colliders(scene.get('colliders', ()), flip) \
                or axis == 0 and 'pairs' in scene and _has_unlike_twins(case) \
                or scene.get('gravity', [0.0, 0.0, -9.81])[axis] != 0.0:
            continue
        for k, step in enumerate(run):
            length, speed = lengths(step)
            if not all(any(np.abs(step.x[j] * flip - step.x[i]).max() <= TOLERANCE * length
                           and np.abs(step.v[j] * flip - step.v[i]).max() <= TOLERANCE * speed
                           for j in partner[i]) for i in range(len(partner))):
                return (f'step {k}: {step.x.tolist()}, {step.v.tolist()} is no mirror image of '
                        f'itself across axis {axis}')
    return None


def _mirrored_particles(case, flip):
    """Give for each particle those that start as its mirror image; None where one has none."""
    position = np.array(case['scene']['particles']['position'], dtype=float).reshape(-1, 3)
    velocity = np.broadcast_to(case['scene']['particles'].get('velocity', 0.0), position.shape)
    mass, radius, partner = each(case, 'mass', 1.0), each(case, 'radius', 0.0), []
    for i in range(len(position)):
        same = [j for j in range(len(position)) if np.array_equal(position[j], flip * position[i])
                and np.array_equal(velocity[j], flip * velocity[i])
                and mass[i] == mass[j] and radius[i] == radius[j]]
        if not same:
            return None
        partner.append(same)
    return partner


def _starts_between_faces(run, partner):
    """Whether a particle on the plane of the mirror starts inside a collider."""
    alone = [i for i, others in enumerate(partner) if i in others]
    return bool(run and (run[0].gaps[:, 0, alone] < -1e-9).any())


def _has_unlike_twins(case):
    """Whether particles of other masses or radii start at one place with one velocity."""
    position = np.array(case['scene']['particles']['position'], dtype=float).reshape(-1, 3)
    velocity = np.broadcast_to(case['scene']['particles'].get('velocity', 0.0), position.shape)
    start = np.hstack([position, velocity])
    matter = np.column_stack([start, each(case, 'mass', 1.0), each(case, 'radius', 0.0)])
    return len(np.unique(matter, axis=0)) > len(np.unique(start, axis=0))


def _mirrors_colliders(colliders, flip):
    """Say whether planes, boxes and spheres that stand are in pairs, or mirror images already."""
    found = []
    for collider in colliders:
        if collider['shape'] not in ('plane', 'box', 'sphere') or 'motion' in collider \
                or 'orientation' in collider:
            return False
        others = {key: value for key, value in collider.items()
                  if key not in ('name', 'normal', 'point', 'position')}
        place = 'point' if collider['shape'] == 'plane' else 'position'
        found.append((np.array(collider.get('normal', (0.0, 0.0, 1.0)), dtype=float)
                      if place == 'point' else np.zeros(3),
                      np.array(collider.get(place, (0.0, 0.0, 0.0)), dtype=float), others))
    return all(any(np.array_equal(flip * normal, other) and np.array_equal(flip * point, there)
                   and others == those for other, there, those in found)
               for normal, point, others in found)


# ------------------------------------------------------------------------------- frames and units

def galilean(case, run, random):
    """
    In a frame that moves with a constant velocity the same happens.

    Everything is carried along: particles, wind, scripted colliders and those that are moved in
    every step from the first on, whose twists are estimated from the poses.
    """
    moved = acts(case, 'move')
    steps = single_steps(case)
    program, took = calls(steps), []
    for name, value in program:
        took.append(set(value) if name == 'move' else set()) if name != 'step' else None
    whole = [program[k - 1] if k else ('step', 1) for k, (name, _) in enumerate(program)
             if name == 'step']
    if moved and any(name != 'move' or set(value) != moved for name, value in whole) \
            or acts(case, 'place') or acts(case, 'set'):
        return None
    boost = np.array([(0.5, -0.25, 1.0), (2.0, 0.0, 0.0), (0.0, 0.0, -1.0)][random.integers(3)])
    other, dt = copy.deepcopy(steps), run[0].scene.stepping.dt if run else 0.0
    scene = other['scene']
    velocity = np.broadcast_to(np.array(scene['particles'].get('velocity', 0.0), dtype=float),
                               (particles(case), 3))
    scene['particles']['velocity'] = (velocity + boost).tolist()
    if 'drag' in scene:
        scene['drag']['wind'] = (np.array(scene['drag'].get('wind', [0.0] * 3)) + boost).tolist()
    for collider in scene.get('colliders', ()):
        if collider['name'] not in moved:
            motion = collider.setdefault('motion', {})
            motion['linear_velocity'] = (
                np.array(motion.get('linear_velocity', [0.0] * 3)) + boost).tolist()
    taken = 0
    for name, value in calls(other):
        if name == 'move':
            for key, (place, turn) in value.items():
                value[key] = [(np.array(place) + (taken + 1) * dt * boost).tolist(), turn]
        taken += name == 'step'
    return compare(case, run, play(other),
                   lambda x, v, time: (x - time * boost, v - boost), random)


def in_units(case, length, time, mass):
    """Give a case in which all lengths, times and masses are multiplied by factors."""
    case = copy.deepcopy(case)
    scene, speed = case['scene'], length / time
    scene['gravity'] = _times(scene.get('gravity', [0.0, 0.0, -9.81]), speed / time)
    stepping = scene.setdefault('stepping', {})
    stepping['dt'] = time * stepping.get('dt', 1 / 240)
    stepping['repulsion_speed'] = speed * stepping.get('repulsion_speed', 10.0)
    _scale(scene.get('drag', {}), {'linear': 1 / time, 'quadratic': 1 / length, 'wind': speed})
    found = scene['particles']
    _scale(found, {'position': length, 'velocity': speed, 'radius': length})
    found['mass'] = _times(found.get('mass', 1.0), mass)
    _scale(scene.get('springs', {}), {'stiffness': mass / time ** 2, 'damping': mass / time,
                                      'rest_length': length})
    for section in (scene, scene.get('pairs', {}), *scene.get('colliders', ())):
        _scale_friction(section, 1.0 / speed)
    for collider in scene.get('colliders', ()):
        _scale(collider, dict.fromkeys(('position', 'point', 'radius', 'length', 'size',
                                        'vertices'), length))
        if collider['shape'] == 'mesh' and 'file' in collider:
            collider['scale'] = length * collider.get('scale', 1.0)
        motion = collider.get('motion', {})
        _scale(motion, {'linear_velocity': speed, 'angular_velocity': 1 / time})
        _scale(motion.get('oscillate', {}), {'amplitude': length, 'frequency': 1 / time})
    for name, value in calls(case):
        if name in ('move', 'place'):
            for key, (place, turn) in value.items():
                value[key] = [_times(place, length), turn]
        elif name == 'set':
            _scale(value, {'gravity': speed / time, 'drag.linear': 1 / time,
                           'drag.quadratic': 1 / length, 'drag.wind': speed,
                           'friction.wet': 1.0 / speed})
    return case


def _times(value, factor):
    return (np.array(value, dtype=float) * factor).tolist()


def _scale(section, factors):
    for key, factor in factors.items():
        if key in section and not isinstance(section[key], str):
            section[key] = _times(section[key], factor)


def _scale_friction(section, factor):
    friction = section.get('friction')
    if isinstance(friction, dict) and 'wet' in friction:
        wet = friction['wet']
        if isinstance(wet, dict):
            wet['coefficient'] *= factor
        else:
            friction['wet'] = wet * factor


def other_units(case, run, random):
    """
    In other units of length, time and mass the same happens, to the last bit.

    The factors are powers of two, which rounds nothing: what differs is a length, a time or a
    speed that the code has of its own. Roots are taken of masses, whose factors are powers of
    four. Masses and sizes stay far from the ends of the range.
    """
    length, time, mass = 2.0 ** (random.integers(-12, 13, 3) * [1, 1, 2])
    others = play(in_units(case, length, time, mass))
    for k, (one, two) in enumerate(zip(run, others)):
        if not (np.isfinite(one.x).all() and np.abs(one.v).max(initial=0.0) < 1e100):
            return None
        for name, factor in (('x', length), ('v', length / time)):
            a, b = getattr(one, name), getattr(two, name) / factor
            if not np.array_equal(a, b):
                i = int((a != b).any(axis=1).argmax())
                return (f'length {length}, time {time}: step {k}: {name} of particle {i} is '
                        f'{b[i].tolist()}, not {a[i].tolist()}')
    return None


CHECKS = (mirror_image, other_axes, galilean, other_units)
