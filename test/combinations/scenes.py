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
Cases drawn at random over everything that a scene can say.

Numbers are short, so that a case can be read. A part of the cases is drawn from special values:
zeros, multiples of a quarter, axis-aligned, touching, coincident; there the knife edges are. Each
case has only some of all features, for what hides a fault is often another feature (J. Groce et
al., Swarm testing, ISSTA 2012).
"""

from itertools import product

from distances import rotation
import numpy as np

FIXED = ('single_pass', 'multi_pass', 'collision_then_contact', 'second_order_contact')
SHAPES = ('plane', 'sphere', 'box', 'capsule', 'cylinder')
# s/m, wet friction of the linear form. It multiplies a velocity by 1 - D dv_N, which the lecture
# shows to be unstable: more of it, and what comes out is a large number, and no failure.
LINEAR = 0.01
HALF_TURN = 1e-6    # least |cos| of half the angle of a turn that has one way round
TURNS = ([0.0, 0.0, 0.0, 1.0], [0.5, 0.5, 0.5, 0.5], [1.0, 0.0, 0.0, 0.0], [0.0, 0.6, 0.0, 0.8])


class Dice:
    """
    Random choices, all from one seed; `special`: whether numbers are special ones.

    Parameters
    ----------
    seed : int or sequence of int

    """

    def __init__(self, seed):
        self.random = np.random.default_rng(seed)
        self.special = self.chance(0.4)

    def chance(self, share):
        """Say yes with a probability."""
        return bool(self.random.random() < share)

    def pick(self, *choices):
        """Give one of several, all alike."""
        return choices[self.random.integers(len(choices))]

    def whole(self, low, high):
        """Give a whole number from low to high."""
        return int(self.random.integers(low, high + 1))

    def number(self, low, high):
        """Give a short number, evenly drawn."""
        if self.special:
            steps = np.arange(np.ceil(4.0 * low), np.floor(4.0 * high) + 1.0) / 4.0
            if len(steps):
                return float(self.random.choice(steps))
        return short(self.random.uniform(low, high))

    def decades(self, low, high):
        """Give a short number, its logarithm evenly drawn."""
        return short(np.exp(self.random.uniform(np.log(low), np.log(high))), 3)

    def vector(self, most):
        """Give a vector; if special, often along an axis."""
        vector = [self.number(-most, most) for _ in range(3)]
        if self.special and self.chance(0.5):
            keep = self.whole(0, 2)
            vector = [entry if k == keep else 0.0 for k, entry in enumerate(vector)]
        return vector

    def direction(self):
        """Give a vector of length 1, about."""
        if self.special:
            vector = [0.0, 0.0, 0.0]
            vector[self.whole(0, 2)] = self.pick(-1.0, 1.0)
            return vector
        vector = self.random.standard_normal(3)
        return [short(entry, 5) for entry in vector / np.linalg.norm(vector)]

    def turn(self):
        """Give a quaternion."""
        if self.special or self.chance(0.2):
            return list(self.pick(*TURNS))
        q = self.random.standard_normal(4)
        return [short(entry, 5) for entry in q / np.linalg.norm(q)]


def short(number, digits=4):
    """Round to a number of significant digits."""
    return float(f'{number:.{digits}g}') + 0.0


def draw(seed):
    """
    Draw a case.

    Parameters
    ----------
    seed : int or sequence of int
        Of all random numbers.

    Returns
    -------
    dict
        As in cases.py.

    """
    dice = Dice(seed)
    case = {'scene': {}, 'ledger': dice.chance(0.5), 'contacts': dice.chance(0.8)}
    scene = case['scene']
    family = dice.pick(*FAMILIES)
    colliders, spots = family(dice, case)
    for k, collider in enumerate(colliders):
        scene_name = collider.pop('name', f'c{k}')
        colliders[k] = {'name': scene_name, **collider}
    _laws(dice, scene)
    _stepping(dice, scene)
    _particles(dice, scene, colliders, spots)
    for collider in colliders:
        if dice.chance(0.3):
            collider['restitution'] = dice.pick(0.0, 0.25, 1.0, 0.9)
        if dice.chance(0.2):
            collider['friction'] = _friction(dice)
    scene['colliders'] = colliders
    case['calls'] = _calls(dice, scene, colliders)
    if has_half_turn(case):     # from where a collider has been placed
        case['calls'] = [call for call in case['calls'] if 'place' not in call]
    return _plain(case)


def has_half_turn(case):
    """
    Say whether a collider is moved by half a turn in a step.

    Two ways round are as long then, and which one it takes is rounding: there is no answer to it.
    """
    turns = {collider['name']: collider.get('orientation', TURNS[0])
             for collider in case['scene'].get('colliders', ())}
    for one in case['calls']:
        for name, value in one.items():
            for collider, (_, turn) in (value.items() if name in ('move', 'place') else ()):
                if name == 'move' and abs(np.dot(turns.get(collider, turn), turn)) < HALF_TURN:
                    return True
                turns[collider] = turn
    return False


def _plain(value):
    """Give a value in the types of a YAML file, and without -0."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    return float(value) + 0.0 if isinstance(value, (float, np.floating)) else value


# ------------------------------------------------------------------------------------- colliders

def _body(dice, shape=None, near=1.0, most=3.0):
    """Give a collider of any shape, whose lengths are at most so much."""
    shape = shape or dice.pick(*SHAPES)
    turned = {'orientation': dice.turn()} if dice.chance(0.6) else {}
    place = dice.vector(near)
    if shape == 'plane':
        return {'shape': shape, 'point': place, 'normal': dice.direction(), **turned}
    size = {'box': lambda: {'size': [_length(dice, most) for _ in range(3)]},
            'sphere': lambda: {'radius': _length(dice, most)}}.get(
        shape, lambda: {'radius': _length(dice, most), 'length': _length(dice, most)})()
    inside = {'inside': True} if dice.chance(0.25) else {}
    return {'shape': shape, **size, 'position': place, **turned, **inside}


def _length(dice, most=3.0):
    if dice.special:
        return dice.pick(*(length for length in (0.25, 0.5, 1.0, 2.0) if length <= most))
    return dice.decades(0.05, most)


def _motion(dice):
    """Give a scripted motion: a twist, an oscillation, or both."""
    motion = {}
    if dice.chance(0.6):
        motion['linear_velocity'] = dice.vector(1.0)
    if dice.chance(0.5):
        motion['angular_velocity'] = [dice.pick(1.0, 10.0) * w for w in dice.vector(1.0)]
    if not motion or dice.chance(0.2):
        motion['oscillate'] = {'axis': dice.direction(), 'amplitude': dice.decades(0.01, 0.3),
                               'frequency': dice.decades(0.3, 10.0)}
    return motion


def several(dice, case):
    """Give one to four colliders of any kind."""
    colliders = [_body(dice) for _ in range(dice.pick(1, 1, 2, 2, 2, 3, 4))]
    _moving(dice, colliders)
    return colliders, []


def many(dice, case):
    """Give eight or nine small colliders, which are found by a grid."""
    colliders = [_body(dice, dice.pick(*SHAPES[1:]), 1.5, dice.pick(0.5, 0.5, 3.0))
                 for _ in range(dice.pick(8, 8, 9))]
    for collider in colliders:
        collider.pop('inside', None)
    _moving(dice, colliders)
    return colliders, []


def tiles(dice, case):
    """Give boxes side by side, and places on their seams and their tops."""
    nx, ny, nz = dice.pick((2, 1, 1), (1, 2, 1), (2, 2, 1), (2, 2, 1), (3, 1, 1),
                           (1, 1, 2), (3, 3, 1))
    size = np.array([dice.pick(0.5, 1.0, 2.0) for _ in range(2)] + [dice.pick(0.1, 0.25, 1.0)])
    turn = [0.0, 0.0, 0.0, 1.0] if dice.chance(0.6) else dice.turn()
    where = np.array(dice.vector(0.5)) if dice.chance(0.5) else np.zeros(3)
    counts = np.array([nx, ny, nz])
    frame, colliders = rotation(turn), []
    for index in product(range(nx), range(ny), range(nz)):
        centre = (np.array(index) - 0.5 * (counts - 1)) * size
        colliders.append({'shape': 'box', 'size': size.tolist(),
                          'position': (where + frame @ centre).tolist(),
                          **({'orientation': turn} if turn[3] != 1.0 else {})})
    half = 0.5 * counts * size
    spots = []
    for _ in range(4):
        spot = dice.random.uniform(-half, half)
        spot = [short(entry, 3) for entry in spot]
        if dice.chance(0.5):    # on a seam, or close by
            axis = dice.pick(*(np.flatnonzero(counts > 1).tolist() or [0]))
            seam = dice.whole(1, max(counts[axis] - 1, 1)) - 0.5 * counts[axis]
            spot[axis] = seam * size[axis] + dice.pick(0.0, 0.0, 0.001, -0.001)
        spot[2] = half[2]
        spots.append((where + frame @ spot, frame[:, 2]))
    if dice.chance(0.2):
        motion = {'linear_velocity': dice.vector(1.0)}
        for collider in colliders:
            collider['motion'] = motion
    if dice.chance(0.2):
        colliders.append(_body(dice))
    if dice.chance(0.3):
        colliders = [colliders[k] for k in dice.random.permutation(len(colliders))]
    return colliders, spots


def press(dice, case):
    """Give a floor and a wall that comes down on it, or closing walls."""
    thick = dice.pick(0.02, 0.2, 1.0)
    gap = dice.pick(0.03, 0.1, 0.3)
    speed = dice.pick(0.5, 1.0, 3.0)
    axis = np.eye(3)[2] if dice.special else np.array(dice.direction())
    turn = _turn_to(axis)
    size = [4.0, 4.0, thick]
    colliders = [
        {'shape': 'box', 'size': size, 'position': (-0.5 * thick * axis).tolist(),
         'orientation': turn},
        {'shape': 'box', 'size': size, 'position': ((gap + 0.5 * thick) * axis).tolist(),
         'orientation': turn, 'motion': {'linear_velocity': (-speed * axis).tolist()}}]
    if dice.chance(0.5):
        colliders[0] = {'shape': 'plane', 'normal': axis.tolist()}
    if dice.chance(0.4):
        colliders.append(_body(dice))
    if dice.chance(0.4):
        colliders.reverse()
    side = np.cross(axis, [0.3, 0.5, 0.7])
    return colliders, [(short(dice.random.random(), 2) * side + share * gap * axis, axis)
                       for share in (0.15, 0.5)]


def _turn_to(axis):
    """Give a quaternion that turns z to a unit vector."""
    x, y, z = axis
    if z < -0.9999:
        return [1.0, 0.0, 0.0, 0.0]
    q = np.array([-y, x, 0.0, 1.0 + z])
    return (q / np.linalg.norm(q)).tolist()


def groove(dice, case):
    """Give two to five planes about an axis, as a groove or a funnel."""
    count, angle = dice.whole(2, 5), np.radians(dice.pick(20.0, 45.0, 60.0, 69.0, 80.0))
    normals = [[np.sin(angle) * np.cos(t), np.sin(angle) * np.sin(t), np.cos(angle)]
               for t in 2.0 * np.pi * np.arange(count) / count]
    colliders = [{'shape': 'plane', 'normal': [round(entry, 6) + 0.0 for entry in n]}
                 for n in normals]       # so that mirror images are exact
    _moving(dice, colliders, 0.15)
    return colliders, [(np.zeros(3), np.array((0.0, 0.0, 1.0)))]


def column(dice, case):
    """Give balls on top of each other, or in a row, of very different masses, and a floor."""
    radius = dice.pick(0.1, 0.25)
    count = dice.whole(2, 6)
    axis = np.array(dice.pick((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), dice.direction()))
    gap = dice.pick(0.0, 0.0, 0.01, -0.02)
    places = [((2 * k + 1) * radius + (k + 1) * gap) * axis for k in range(count)]
    if dice.chance(0.3):
        places = [place + 0.3 * radius * np.array(dice.direction()) for place in places]
    case['scene']['particles'] = {
        'position': [place.tolist() for place in places], 'radius': radius,
        'mass': [dice.pick(1.0, 1.0, 1.0, 10.0, 1000.0, 1e6, 0.01, np.inf) for _ in places],
        'velocity': [[0.0, 0.0, 0.0]] * count}
    case['scene']['pairs'] = {}
    if dice.chance(0.3):
        case['scene']['particles']['velocity'] = [
            (dice.pick(-1.0, 0.0, 0.0) * axis).tolist() for _ in places]
    floor = {'shape': 'plane', 'normal': axis.tolist()}
    if dice.chance(0.3):
        floor['motion'] = {'linear_velocity': (dice.pick(0.5, 1.0, 5.0) * axis).tolist()}
    colliders = [floor] if dice.chance(0.8) else []
    if dice.chance(0.3):
        colliders.append(_body(dice))
    return colliders, []


def break_shot(dice, case):
    """Give a ball that flies at balls that touch, symmetrically."""
    radius, speed = 0.25, dice.pick(1.0, 2.0)
    height = radius * np.sqrt(3.0)
    colliders = [] if dice.chance(0.6) else [{'shape': 'plane'}]
    base = radius if colliders else 0.0
    start = dice.pick(0.0, 0.01, 0.1)
    case['scene']['particles'] = {
        'position': [[-height - start, 0.0, base], [0.0, radius, base], [0.0, -radius, base]],
        'velocity': [[speed, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], 'radius': radius}
    case['scene']['pairs'] = {}
    return colliders, []


def squeeze(dice, case):
    """Give two balls beside each other at a wall, and one that presses or hits them; symmetric."""
    radius, large, wall = 0.1, dice.pick(0.1, 0.3), dice.pick('plane', 'box', 'sphere')
    axis = np.roll(np.eye(3), dice.whole(0, 2), axis=0)
    apart, thick, speed = radius + dice.pick(0.0, 0.0, 0.02), 0.1, dice.pick(0.2, 1.0)
    away = np.sqrt((large + radius) ** 2 - apart ** 2) + dice.pick(0.0, 0.0, 0.001, -0.01)
    case['scene']['particles'] = {
        'position': [(-apart * axis[0]).tolist(), (apart * axis[0]).tolist(),
                     (-away * axis[1]).tolist()],
        'velocity': [[0.0] * 3, [0.0] * 3, (speed * axis[1]).tolist()],
        'radius': [radius, radius, large],
        'mass': [1.0, 1.0, dice.pick(0.01, 1.0, 1e3, 1e6, np.inf)]}
    case['scene']['pairs'] = {}
    case['scene']['gravity'] = (dice.pick(0.0, 9.81, -9.81) * axis[1]).tolist()
    if wall == 'plane':
        found = {'shape': wall, 'point': (radius * axis[1]).tolist(),
                 'normal': (-axis[1]).tolist()}
    elif wall == 'box':
        found = {'shape': wall, 'size': (2.0 * axis[0] + 2.0 * thick * axis[1]
                                         + 2.0 * axis[2]).tolist(),
                 'position': ((radius + thick) * axis[1]).tolist()}
    else:
        found = {'shape': wall, 'radius': 1.0, 'position': (
            np.sqrt((1.0 + radius) ** 2 - apart ** 2) * axis[1]).tolist()}
    return [found], []


def drum(dice, case):
    """Give a collider that holds the particles inside, often turning, and perhaps more."""
    collider = _body(dice, dice.pick('sphere', 'cylinder', 'capsule', 'box'), 0.2)
    collider['inside'] = True
    for key in ('radius', 'length'):
        if key in collider:
            collider[key] = dice.pick(1.0, 1.7, 2.0)
    if 'size' in collider:
        collider['size'] = [dice.pick(1.0, 2.0, 3.0) for _ in range(3)]
    colliders = [collider, *(_body(dice) for _ in range(dice.pick(0, 0, 1)))]
    _moving(dice, colliders, 0.5)
    return colliders, []


def meshes(dice, case):
    """Give a mesh, of several parts or open, often from a file, and perhaps more."""
    vertices, faces = dice.pick(_box_mesh, _two_boxes, _sheet, _tent, _gem)(dice)
    collider = {'shape': 'mesh', 'position': dice.vector(0.5)}
    if dice.chance(0.5):
        collider['orientation'] = dice.turn()
    if dice.chance(0.4):
        case['files'] = {'mesh.obj': ''.join(
            [f'v {x!r} {y!r} {z!r}\n' for x, y, z in vertices]
            + ['f ' + ' '.join(str(k + 1) for k in face) + '\n' for face in faces])}
        collider['file'] = 'mesh.obj'
    else:
        collider.update(vertices=vertices, faces=faces)
    if dice.chance(0.1):
        collider['inside'] = True
    colliders = [collider, *(_body(dice) for _ in range(dice.pick(0, 0, 1, 2)))]
    _moving(dice, colliders)
    return colliders, []


def _cuboid(low, high):
    vertices = [list(map(float, corner)) for corner in product(*zip(low, high))]
    return vertices, [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4],
                      [1, 5, 7, 3]]


def _box_mesh(dice):
    half = [_length(dice) / 2 for _ in range(3)]
    return _cuboid([-h for h in half], half)


def _two_boxes(dice):
    """Two cubes: apart, face to face, or one in the other."""
    first, faces = _cuboid((-0.5, -0.5, -0.5), (0.0, 0.5, 0.5))
    start = dice.pick(0.0, 0.25, -0.25)
    second, more = _cuboid((start, -0.5, -0.5), (0.5, 0.5, 0.5))
    return first + second, faces + [[k + 8 for k in face] for face in more]


def _sheet(dice):
    """Give a flat or wavy open surface."""
    ticks, wave = (-1.0, 0.0, 1.0), dice.pick(0.0, 0.0, 0.2)
    vertices = [[x, y, wave * (x * y)] for x, y in product(ticks, ticks)]
    faces = [[a, a + 3, a + 4, a + 1] for i in range(2) for j in range(2) for a in [3 * i + j]]
    if wave:
        faces = [[f[0], f[k], f[k + 1]] for f in faces for k in (1, 2)]
    return vertices, faces


def _tent(dice):
    height = dice.pick(0.5, -0.5, 2.0)
    return ([[-1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, -1.0, height], [0.0, 1.0, height],
             [1.0, -1.0, 0.0], [1.0, 1.0, 0.0]], [[0, 2, 3, 1], [2, 4, 5, 3]])


def _gem(dice):
    size = _length(dice)
    return ([[size, 0.0, 0.0], [-size, 0.0, 0.0], [0.0, size, 0.0], [0.0, -size, 0.0],
             [0.0, 0.0, size], [0.0, 0.0, -size]],
            [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5],
             [0, 3, 5]])


def _moving(dice, colliders, share=0.3):
    for collider in colliders:
        if dice.chance(share):
            collider['motion'] = _motion(dice)


# Meshes cost ten times as much as others without the compiler.
FAMILIES = (several, several, several, several, several, several, many, many, tiles, tiles, tiles,
            press, press, press, groove, groove, column, column, break_shot, squeeze,
            drum, drum, meshes)


# ------------------------------------------------------------------------------------- the rest

def _friction(dice):
    return dice.pick(
        'none', {'dry': dice.pick(0.0, 0.3, 1.0, 2.5)}, {'dry': dice.decades(0.01, 3.0)},
        {'dry': {'static': 0.5, 'kinetic': dice.pick(0.0, 0.3, 0.5)}},
        {'wet': {'coefficient': dice.pick(0.0, 0.1, 1.0),
                 'form': dice.pick('exponential', 'capped')}},
        {'wet': {'coefficient': dice.pick(0.0, LINEAR), 'form': 'linear'}},
        {'dry': 0.2, 'wet': 0.3})


def _laws(dice, scene):
    gravity = dice.pick(None, None, None, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], 'any')
    if gravity is not None:
        scene['gravity'] = dice.vector(10.0) if gravity == 'any' else gravity
    if dice.chance(0.2):
        scene['drag'] = {'linear': dice.pick(0.0, 0.5, 5.0), 'quadratic': dice.pick(0.0, 0.1)}
        if dice.chance(0.5):
            scene['drag']['wind'] = dice.vector(3.0)
    if dice.chance(0.7):
        scene['restitution'] = dice.pick(0.0, 0.3, 0.5, 1.0, 1.0)
    if dice.chance(0.5):
        scene['friction'] = _friction(dice)


def _stepping(dice, scene):
    stepping = {'dt': dice.pick(1 / 240, 1 / 60, 0.1, 0.05, dice.decades(1e-4, 0.1))}
    meshes = any(collider['shape'] == 'mesh' for collider in scene.get('colliders', ()))
    if dice.chance(0.6):
        stepping['method'] = dice.pick(*FIXED, 'exact')
    if dice.chance(0.45):
        stepping['detection'] = 'trajectory'
    if dice.chance(0.15):
        stepping['flight'] = 'symplectic_euler'
    if dice.chance(0.15):
        stepping['iterations'] = dice.pick(1, 2, 5, 30)
    if dice.chance(0.1):
        stepping['repulsion'] = dice.pick(0.5, 1.0)
    if dice.chance(0.1):
        stepping['repulsion_speed'] = dice.pick(0.5, 1.0)
    scene['stepping'] = stepping
    return meshes


def _particles(dice, scene, colliders, spots):
    """Add particles where the family has not, and what they do to each other."""
    coupled = 'pairs' in scene
    if 'particles' not in scene:
        count = dice.pick(1, 1, 2, 2, 3, 4)
        radius = _radius(dice)
        places = [_place(dice, colliders, spots, radius, scene) for _ in range(count)]
        if count > 1 and dice.special and dice.chance(0.1):
            places[1] = places[0]
        found = {'position': [place for place, _ in places],
                 'velocity': [velocity for _, velocity in places]}
        if radius:
            found['radius'] = radius
            if count > 1 and dice.chance(0.3):
                found['radius'] = [dice.pick(radius, 0.0, 0.1) for _ in range(count)]
        if dice.chance(0.3):
            found['mass'] = [dice.pick(1.0, 2.0, dice.decades(1.0, 1e6)) for _ in range(count)]
        scene['particles'] = found
        coupled = coupled or bool(radius) and count > 1 and dice.chance(0.3)
    count = len(scene['particles']['position'])
    if coupled:
        scene['pairs'] = {'restitution': dice.pick(0.0, 0.5, 1.0)} if dice.chance(0.6) else {}
        if dice.chance(0.3):
            scene['pairs']['friction'] = _friction(dice)
    if count > 1 and dice.chance(0.1):
        scene['springs'] = {'pairs': [[k, k + 1] for k in range(count - 1)],
                            'stiffness': dice.pick(0.0, 10.0, 100.0),
                            'damping': dice.pick(0.0, 0.5)}
        if dice.chance(0.3):
            scene['springs']['solver'] = 'implicit'
    if ('pairs' in scene or 'springs' in scene
            or any(collider['shape'] == 'mesh' for collider in colliders)):
        if scene['stepping'].get('method') == 'exact' and dice.chance(0.95):
            del scene['stepping']['method']
    if any(collider['shape'] == 'mesh' for collider in colliders):
        if scene['stepping'].get('method') == 'second_order_contact' and dice.chance(0.95):
            del scene['stepping']['method']


def _radius(dice):
    return dice.pick(0.0, 0.0, 0.05, 0.1, 0.25, 0.5, 1e-6, dice.decades(1e-3, 1.0))


def _place(dice, colliders, spots, radius, scene):
    """Give a place and a velocity: on a spot, on a body or near it, or anywhere."""
    speed = dice.pick(0.0, 0.1, 1.0, 1.0, 3.0, 10.0)
    velocity = [short(speed * entry) + 0.0 for entry in dice.direction()]
    if spots and dice.chance(0.85):
        spot, normal = spots[dice.whole(0, len(spots) - 1)]
        height = radius + dice.pick(0.0, 0.0, 0.01, 0.05)
        return (np.asarray(spot) + height * np.asarray(normal)).tolist(), velocity
    body = colliders[dice.whole(0, len(colliders) - 1)] if colliders else None
    if body is None or body['shape'] == 'mesh' or dice.chance(0.2):
        return dice.vector(1.5), velocity
    outwards = np.array(dice.direction())
    centre = np.array(body.get('position', body.get('point', (0.0, 0.0, 0.0))))
    place, normal = _on_surface(body, centre, outwards)
    way = scene['stepping']['dt'] * (speed + 0.1)
    gap = dice.pick(0.0, 0.0, 1e-3, way * dice.random.random(), 0.1, -0.01)
    side = -1.0 if body.get('inside') else 1.0
    place = place + side * (radius + gap) * normal
    if not dice.special:
        place = [short(entry, 6) for entry in place]
    if dice.chance(0.5):        # towards it
        velocity = [short(entry) + 0.0 for entry in speed * (
            -side * normal + 0.5 * dice.chance(0.6) * np.array(dice.direction()))]
    return [float(entry) + 0.0 for entry in place], velocity


def _on_surface(body, centre, outwards):
    """Give a point of the surface of a body in a direction, and the normal there."""
    frame = rotation(body.get('orientation', (0.0, 0.0, 0.0, 1.0)))
    if body['shape'] == 'plane':
        normal = frame @ np.asarray(body.get('normal', (0.0, 0.0, 1.0)))
        normal = normal / np.linalg.norm(normal)
        return centre + outwards - (outwards @ normal) * normal, normal
    local = frame.T @ outwards
    if body['shape'] == 'box':
        half = 0.5 * np.array(body['size'])
        axis = int(np.argmax(np.abs(local) / half))
        point, normal = local / np.abs(local[axis]) * half[axis], np.eye(3)[axis]
        normal = normal * np.sign(local[axis])
    elif body['shape'] == 'sphere':
        point, normal = body['radius'] * local, local
    else:
        half, flat = 0.5 * body['length'], np.hypot(local[0], local[1])
        along = np.clip(local[2], -1.0, 1.0) * half
        normal = np.array((local[0], local[1], 0.0)) / flat if flat else np.eye(3)[2]
        point = body['radius'] * normal + np.array((0.0, 0.0, along if flat else half))
    return centre + frame @ point, frame @ normal


def _calls(dice, scene, colliders):
    """Give the calls: steps, and between them moves, teleports and changes of parameters."""
    steps = dice.pick(1, 2, 2, 3, 3, 4, 5, 10)
    movable = [collider for collider in colliders if 'motion' not in collider]
    moves = dice.chance(0.25)
    moved = [collider for collider in movable if dice.chance(0.6)] if moves else []
    paths, calls = {collider['name']: _walk(dice, collider) for collider in moved}, []
    every = dice.chance(0.7)
    alters, places = dice.chance(0.15), dice.chance(0.08)
    dt = scene['stepping']['dt']
    taken = 0
    while taken < steps:
        if moved and (every or dice.chance(0.5)):
            calls.append({'move': {name: walk((taken + 1) * dt) for name, walk in paths.items()}})
        if places and movable and dice.chance(0.3):
            collider = movable[dice.whole(0, len(movable) - 1)]
            calls.append({'place': {collider['name']: [dice.vector(1.0), dice.turn()]}})
        if alters and dice.chance(0.4):
            calls.append({'set': _change(dice, scene)})
        count = 1 if moved else dice.pick(1, 1, 2, 5)
        calls.append({'step': count})
        taken += count
    return calls


def _walk(dice, collider):
    """Give a pose as a function of time that begins at that of a collider."""
    place = np.array(collider.get('position', collider.get('point', (0.0, 0.0, 0.0))))
    turn = list(collider.get('orientation', (0.0, 0.0, 0.0, 1.0)))
    velocity = np.array(dice.vector(2.0))
    spin = np.array(dice.vector(1.0)) * dice.pick(0.0, 0.0, 1.0, 10.0)

    def pose(time):
        angle = np.linalg.norm(spin) * time
        if not angle:
            return [(place + time * velocity).tolist(), turn]
        axis = spin / np.linalg.norm(spin)
        q = product_of(np.append(np.sin(angle / 2) * axis, np.cos(angle / 2)), turn)
        return [(place + time * velocity).tolist(), (q / np.linalg.norm(q)).tolist()]
    return pose


def product_of(p, q):
    """Product of two quaternions x, y, z, w: first the turn q, then p."""
    p, q = np.asarray(p, dtype=float), np.asarray(q, dtype=float)
    return np.append(p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3]),
                     p[3] * q[3] - p[:3] @ q[:3])


def _change(dice, scene):
    """Give a change of some parameters."""
    choices = [{'restitution': dice.pick(0.0, 0.5, 1.0)}, {'gravity': dice.vector(10.0)},
               {'friction.dry': dice.pick(0.0, 0.5)},
               {'friction.wet': dice.pick(0.0, LINEAR if _is_linear(scene) else 0.5)},
               {'stepping.iterations': dice.pick(1, 10)}]
    if 'drag' in scene:
        choices.append({'drag.linear': dice.pick(0.0, 1.0)})
        choices.append({'drag.quadratic': dice.pick(0.0, 1.0)})
    if 'pairs' in scene:
        choices.append({'pairs.restitution': dice.pick(0.0, 1.0)})
    return dice.pick(*choices)


def _is_linear(section):
    """Say whether a section has wet friction of the linear form."""
    friction = section.get('friction', 'none')
    wet = friction.get('wet', 0.0) if isinstance(friction, dict) else 0.0
    return isinstance(wet, dict) and wet['form'] == 'linear'
