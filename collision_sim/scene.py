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
What a scene is, how it is read, and what its values may be.

SI units, world frame, quaternions x, y, z, w. A scene is checked here, once: whoever gets a Scene
from `Scene.from_dict`, `load_scene` or `with_parameter` can compute with it unchecked. Scenes are
immutable; a change makes a new one.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
import math
import os
from pathlib import Path

from collision_sim.checks import as_list, Choice, Direction, Flag, is_list_of_vectors, join
from collision_sim.checks import MISSING, Number, Parameter, Quaternion, read_each, read_file
from collision_sim.checks import read_leaves, read_only, read_section, read_vectors, read_yaml
from collision_sim.checks import SceneError, Text, unknown, Vector
import numpy as np

SCENES = Path(__file__).parent / 'scenes'

# What a scene can ask for. A new method, shape, ... is named here and nowhere else in this file.
METHODS = ('single_pass', 'multi_pass', 'collision_then_contact', 'second_order_contact',
           'exact')
DETECTIONS = ('end_of_step', 'trajectory')
FLIGHTS = ('ballistic', 'symplectic_euler')
WET_FORMS = ('exponential', 'capped', 'linear')

Vector3 = tuple[float, float, float]
Vector4 = tuple[float, float, float, float]


@dataclass(frozen=True)
class Friction:
    """
    Friction of a collider with particles; nothing given is no friction.

    Attributes
    ----------
    static, kinetic : float or None [-]
        Dry friction, static >= kinetic; both None without it.
    wet : float or None [s/m]
        Wet friction; None without it.
    wet_form : str
        One of WET_FORMS.
    apart : bool
        Static and kinetic were given apart, so they are two parameters.

    """

    static: float | None = None
    kinetic: float | None = None
    wet: float | None = None
    wet_form: str = WET_FORMS[0]
    apart: bool = False


@dataclass(frozen=True)
class Drag:
    """Deceleration of particles in the wind: linear [1/s], quadratic [1/m], wind [m/s]."""

    linear: float = 0.0
    quadratic: float = 0.0
    wind: Vector3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Oscillation:
    """Displacement along a unit axis as a sine of time: amplitude [m], frequency [Hz]."""

    axis: Vector3
    amplitude: float
    frequency: float


@dataclass(frozen=True)
class Motion:
    """Scripted motion: a constant twist [m/s, rad/s, world frame] and an oscillation on top."""

    linear_velocity: Vector3 = (0.0, 0.0, 0.0)
    angular_velocity: Vector3 = (0.0, 0.0, 0.0)
    oscillate: Oscillation | None = None


@dataclass(frozen=True)
class Collider:
    """
    A kinematic body that particles collide with.

    Attributes
    ----------
    name : str
        Unique in the scene.
    shape : str
        A key of SHAPES.
    size : (3,) tuple [m]
        plane (0, 0, 0); sphere (radius, 0, 0); box half edge lengths; capsule and cylinder
        (radius, half length along the local z, 0).
    inside : bool
        Particles are kept inside instead of outside.
    position, orientation : (3,) and (4,) tuple [m], [-]
        Pose at the start; the position of a plane is any point of it.
    normal : (3,) tuple [-]
        Unit normal of a plane in its own frame.
    restitution, friction : float and Friction, or None
        None takes the default of the scene; Friction() is none at all.
    topic : str or None
        Pose topic that the collider follows.
    motion : Motion or None
        Scripted motion; never together with a topic.

    """

    name: str
    shape: str
    size: Vector3
    inside: bool = False
    position: Vector3 = (0.0, 0.0, 0.0)
    orientation: Vector4 = (0.0, 0.0, 0.0, 1.0)
    normal: Vector3 = (0.0, 0.0, 1.0)
    restitution: float | None = None
    friction: Friction | None = None
    topic: str | None = None
    motion: Motion | None = None

    @property
    def moving(self) -> bool:
        """Whether the collider follows a topic or a script."""
        return self.topic is not None or self.motion is not None


@dataclass(frozen=True, eq=False)
class Particles:
    """
    The particles at the start; the arrays are read-only.

    Attributes
    ----------
    position, velocity : (N, 3) float64 [m], [m/s]
    mass, radius : float or (N,) float64 [kg], [m]

    """

    position: np.ndarray
    velocity: np.ndarray
    mass: float | np.ndarray = 1.0
    radius: float | np.ndarray = 0.0


@dataclass(frozen=True)
class Stepping:
    """
    How time advances.

    Attributes
    ----------
    dt : float [s]
    method, detection, flight : str
        One of METHODS, DETECTIONS, FLIGHTS.
    iterations : int
        Most passes over the colliders in one step.
    repulsion : float [-]
        Share of the depth that repulsion removes in one step.
    repulsion_speed : float [m/s]
        Most that repulsion adds to the normal velocity.

    """

    dt: float = 1 / 240
    method: str = 'collision_then_contact'
    detection: str = 'end_of_step'
    flight: str = 'ballistic'
    iterations: int = 10
    repulsion: float = 0.1
    repulsion_speed: float = 10.0


# The leaves of a scene: unit, meaning and range of every value, for reading and for parameters().

GRAVITY = Vector('m/s^2', 'Acceleration of free fall')
RESTITUTION = Number('', 'Share of the normal velocity that a collision reverses', low=0, high=1)
COUNT = Number('', 'Count of particles', low=0, high=10 ** 8, whole=True)
SEED = Number('', 'Seed of the random numbers', low=0, whole=True)
POSITION = Vector('m', 'Position')
VELOCITY = Vector('m/s', 'Velocity')
SPEED = Number('m/s', 'Speed', low=0)
MASS = Number('kg', 'Mass of a particle', low=0, above=True, infinite=True)
RADIUS = Number('m', 'Radius of a particle', low=0)

FRICTION = {
    'dry': Number('', 'Dry friction', low=0),
    'dry.static': Number('', 'Dry friction at rest', low=0),
    'dry.kinetic': Number('', 'Dry friction while sliding', low=0),
    'wet': Number('s/m', 'Wet friction', low=0),
}
DRAG = {
    'linear': Number('1/s', 'Drag proportional to the velocity relative to the wind', low=0),
    'quadratic': Number('1/m', 'Drag proportional to the square of that velocity', low=0),
    'wind': Vector('m/s', 'Velocity of the air'),
}
STEPPING = {
    'dt': Number('s', 'Duration of a step', low=0),
    'method': Choice(METHODS),
    'detection': Choice(DETECTIONS),
    'flight': Choice(FLIGHTS),
    'iterations': Number('', 'Most passes over the colliders in one step', low=1, high=10_000,
                         whole=True),
    'repulsion': Number('', 'Share of the depth removed in one step', low=0, high=1, above=True),
    'repulsion_speed': Number('m/s', 'Most that repulsion adds to the normal velocity', low=0,
                              above=True),
}
TWIST = {
    'linear_velocity': Vector('m/s', 'Velocity of the position'),
    'angular_velocity': Vector('rad/s', 'Angular velocity about the position'),
}
OSCILLATION = {
    'axis': Direction('', 'Direction of the oscillation'),
    'amplitude': Number('m', 'Amplitude of the oscillation', low=0),
    'frequency': Number('Hz', 'Frequency of the oscillation', low=0),
}
COLLIDER = {
    'name': Text('[A-Za-z][A-Za-z0-9_]{0,99}',
                 'must be a name of at most 100 letters, digits and underscores that starts '
                 'with a letter'),
    'orientation': Quaternion('', 'Orientation x, y, z, w'),
    'restitution': RESTITUTION,
    'topic': Text('(?!.{200})(~?/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*',
                  'must be a valid topic name such as paddle/pose'),
}
_LENGTH = Number('m', 'Length', low=0, above=True)
_BODY = {'position': POSITION, 'inside': Flag()}
SHAPES = {  # the keys that a shape adds to those of every collider
    'plane': {'point': POSITION, 'normal': Direction('', 'Normal')},
    'sphere': {'radius': _LENGTH, **_BODY},
    'box': {'size': Vector('m', 'Edge lengths', low=0, above=True), **_BODY},
    'capsule': {'radius': _LENGTH, 'length': _LENGTH, **_BODY},
    'cylinder': {'radius': _LENGTH, 'length': _LENGTH, **_BODY},
}
_SIZE_KEYS = ('radius', 'size', 'length')


@dataclass(frozen=True)
class Scene:
    """
    Particles, colliders, laws and stepping.

    Attributes
    ----------
    gravity : (3,) tuple [m/s^2]
    drag : Drag or None
    particles : Particles
    restitution : float [-]
    friction : Friction
        Both are defaults of every collider.
    colliders : tuple of Collider
    stepping : Stepping

    """

    gravity: Vector3
    drag: Drag | None
    particles: Particles
    restitution: float
    friction: Friction
    colliders: tuple[Collider, ...]
    stepping: Stepping

    @classmethod
    def from_dict(cls, mapping, directory='.') -> 'Scene':
        """
        Read a scene from a mapping as in a YAML file.

        Parameters
        ----------
        mapping : dict
            Left as it is; nothing of it is kept.
        directory : str or path
            Where relative names of particle files start.

        Raises
        ------
        SceneError
            For the first key or value that is not allowed.

        """
        if mapping is None:  # an empty section is an absent one, but an empty file is a mistake
            raise SceneError('scene', mapping, 'must be a mapping')
        section = read_section(mapping, '', [field.name for field in fields(cls)])
        leaves = read_leaves(section, '', {'gravity': GRAVITY, 'restitution': RESTITUTION})
        return cls(
            gravity=leaves.get('gravity', (0.0, 0.0, -9.81)),
            drag=_read_drag(section.get('drag')),
            particles=_read_particles(section.get('particles'), Path(directory)),
            restitution=leaves.get('restitution', 0.0),
            friction=_read_friction(section.get('friction'), 'friction') or Friction(),
            colliders=_read_colliders(section.get('colliders')),
            stepping=_read_stepping(section.get('stepping')))

    def collider(self, name) -> Collider:
        """Give the collider of that name."""
        for collider in self.colliders:
            if collider.name == name:
                return collider
        names = [collider.name for collider in self.colliders]
        raise unknown(join('colliders', name), name, name, names)

    def restitution_of(self, collider) -> float:
        """Give the restitution of a collider, its own or the scene's."""
        return self.restitution if collider.restitution is None else collider.restitution

    def friction_of(self, collider) -> Friction:
        """Give the friction of a collider, its own or the scene's."""
        return self.friction if collider.friction is None else collider.friction

    def parameters(self) -> dict[str, Parameter]:
        """Give what may change while the simulation runs, by its path in the scene."""
        found = {'gravity': GRAVITY.parameter(self.gravity)}
        if self.drag is not None:
            for key, leaf in DRAG.items():
                found[f'drag.{key}'] = leaf.parameter(getattr(self.drag, key))
        found['restitution'] = RESTITUTION.parameter(self.restitution)
        found |= _friction_parameters(self.friction, 'friction')
        for collider in self.colliders:
            path = f'colliders.{collider.name}'
            restitution = self.restitution_of(collider)
            found[f'{path}.restitution'] = RESTITUTION.parameter(restitution)
            found |= _friction_parameters(self.friction_of(collider), f'{path}.friction')
        found['stepping.iterations'] = STEPPING['iterations'].parameter(self.stepping.iterations)
        return found

    def with_parameter(self, path, value) -> 'Scene':
        """
        Give a copy of the scene in which one parameter has another value.

        Parameters
        ----------
        path : str
            A key of `parameters()`, or the path of a friction that is absent so far.
        value : float, int or three floats
            SI units; checked as in a file.

        Raises
        ------
        SceneError
            For an unknown path or a value that is not allowed.

        """
        match path.split('.') if isinstance(path, str) else []:
            case ['gravity']:
                return replace(self, gravity=GRAVITY.read(value, path))
            case ['drag', key] if self.drag is not None and key in DRAG:
                drag = replace(self.drag, **{key: DRAG[key].read(value, path)})
                return replace(self, drag=drag)
            case ['restitution']:
                return replace(self, restitution=RESTITUTION.read(value, path))
            case ['friction', *keys] if '.'.join(keys) in FRICTION:
                return replace(self, friction=_with_friction(self.friction, keys, value, path))
            case ['colliders', name, 'restitution'] if self._has(name):
                return self._with_collider(name, restitution=RESTITUTION.read(value, path))
            case ['colliders', name, 'friction', *keys] if (
                    self._has(name) and '.'.join(keys) in FRICTION):
                friction = self.friction_of(self.collider(name))
                friction = _with_friction(friction, keys, value, path)
                return self._with_collider(name, friction=friction)
            case ['stepping', 'iterations']:
                iterations = STEPPING['iterations'].read(value, path)
                return replace(self, stepping=replace(self.stepping, iterations=iterations))
        raise unknown(join('', path), value, path, list(self.parameters()))

    def _has(self, name) -> bool:
        return any(collider.name == name for collider in self.colliders)

    def _with_collider(self, name, **changes):
        """Give a copy of the scene in which the collider of that name is changed."""
        return replace(self, colliders=tuple(
            replace(collider, **changes) if collider.name == name else collider
            for collider in self.colliders))


def load_scene(name) -> Scene:
    """
    Read a scene from a YAML file.

    Parameters
    ----------
    name : str or path
        A YAML file, or the name of a shipped scene, with or without `.yaml`.

    Raises
    ------
    SceneError
        For a file that cannot be read, or the first value that is not allowed.

    """
    path = _scene_path(name)
    return Scene.from_dict(read_yaml(path), path.parent)


def shipped_scenes() -> list[str]:
    """Give the names of the scenes that come with the package."""
    return sorted(path.stem for path in SCENES.glob('*.yaml'))


def _scene_path(name) -> Path:
    if not isinstance(name, (str, os.PathLike)):
        raise SceneError('scene', name, 'must be the path of a YAML file')
    if os.path.isfile(name):
        return Path(name)
    shipped = os.fspath(name).removesuffix('.yaml')
    if shipped in shipped_scenes():
        return SCENES / f'{shipped}.yaml'
    raise SceneError('scene', os.fspath(name), 'must be a YAML file or one of the shipped scenes '
                                               f'{", ".join(shipped_scenes())}')


def _read_drag(value) -> Drag | None:
    section = read_section(value, 'drag', DRAG)
    return Drag(**read_leaves(section, 'drag', DRAG)) if section else None


def _read_stepping(value) -> Stepping:
    section = read_section(value, 'stepping', STEPPING)
    return Stepping(**read_leaves(section, 'stepping', STEPPING))


def _read_friction(value, path) -> Friction | None:
    """Read friction; None where there is nothing, Friction() where there is none on purpose."""
    if value is None:
        return None
    if isinstance(value, str) and value == 'none':
        return Friction()
    if not isinstance(value, Mapping) or not value:
        raise SceneError(path, value, 'must be none or a mapping with dry, wet or both')
    section = read_section(value, path, ('dry', 'wet'))
    friction = Friction()
    if 'dry' in section:
        friction = _with_dry(friction, section['dry'], join(path, 'dry'))
    if 'wet' in section:
        friction = _with_wet(friction, section['wet'], join(path, 'wet'))
    return friction


def _with_dry(friction, value, path):
    """Add dry friction: one coefficient, or static and kinetic apart."""
    if not isinstance(value, Mapping):
        coefficient = FRICTION['dry'].read(value, path)
        return replace(friction, static=coefficient, kinetic=coefficient)
    leaves = {key: FRICTION[f'dry.{key}'] for key in ('static', 'kinetic')}
    section = read_section(value, path, leaves)
    friction = replace(friction, **read_leaves(section, path, leaves, required=leaves), apart=True)
    return _checked_dry(friction, value, path)


def _with_wet(friction, value, path):
    """Add wet friction: one coefficient, or coefficient and form."""
    if not isinstance(value, Mapping):
        return replace(friction, wet=FRICTION['wet'].read(value, path))
    leaves = {'coefficient': FRICTION['wet'], 'form': Choice(WET_FORMS)}
    section = read_section(value, path, leaves)
    found = read_leaves(section, path, leaves, required=('coefficient',))
    return replace(friction, wet=found['coefficient'],
                   wet_form=found.get('form', friction.wet_form))


def _with_friction(friction, keys, value, path):
    """Change one coefficient; a static or kinetic one that stands alone sets both."""
    coefficient = FRICTION['.'.join(keys)].read(value, path)
    if keys == ['wet']:
        return replace(friction, wet=coefficient)
    if keys == ['dry'] or friction.static is None:
        friction = replace(friction, static=coefficient, kinetic=coefficient)
    if keys != ['dry']:
        friction = replace(friction, apart=True, **{keys[1]: coefficient})
    return _checked_dry(friction, value, path)


def _checked_dry(friction, value, path):
    if friction.static < friction.kinetic:
        raise SceneError(path, value, 'static friction must be at least the kinetic one '
                                      f'({friction.static:g} < {friction.kinetic:g})')
    return friction


def _friction_parameters(friction, path):
    """Give the coefficients that are there, by their paths."""
    values = {'wet': friction.wet}
    if friction.apart:
        values |= {'dry.static': friction.static, 'dry.kinetic': friction.kinetic}
    else:
        values['dry'] = friction.static
    return {f'{path}.{key}': leaf.parameter(values[key])
            for key, leaf in FRICTION.items() if values.get(key) is not None}


def _read_colliders(value) -> tuple[Collider, ...]:
    entries = [] if value is None else as_list(value)
    if not isinstance(entries, list):
        raise SceneError('colliders', value, 'must be a list of colliders')
    colliders = {}
    for index, entry in enumerate(entries):
        collider = _read_collider(entry, f'colliders[{index}]', colliders)
        colliders[collider.name] = collider
    return tuple(colliders.values())


def _read_collider(value, path, others) -> Collider:
    """Read a collider; its path goes by its name as soon as that is known to be good."""
    if not isinstance(value, Mapping):
        raise SceneError(path, value, 'must be a mapping with name, shape, ...')
    name = value.get('name')
    if COLLIDER['name'].fits(name):
        if name in others:
            raise SceneError(f'{path}.name', name, 'must be unique in the scene')
        path = f'colliders.{name}'
    leaves = {**COLLIDER, 'shape': Choice(tuple(SHAPES)), **_shape_leaves(value.get('shape'))}
    section = read_section(value, path, [*leaves, 'friction', 'motion'])
    required = ['name', 'shape', *(key for key in _SIZE_KEYS if key in leaves)]
    found = read_leaves(section, path, leaves, required)
    motion = _read_motion(section.get('motion'), join(path, 'motion'))
    if 'topic' in found and motion is not None:
        raise SceneError(join(path, 'topic'), found['topic'],
                         'must be absent where the collider has a motion')
    size = _size(*(found.pop(key, None) for key in _SIZE_KEYS))
    if 'point' in found:
        found['position'] = found.pop('point')
    friction = _read_friction(section.get('friction'), join(path, 'friction'))
    return Collider(**found, size=size, friction=friction, motion=motion)


def _shape_leaves(shape):
    """Give the keys that belong to a shape, all there are as long as it is not known."""
    if isinstance(shape, str) and shape in SHAPES:
        return SHAPES[shape]
    return {key: leaf for leaves in SHAPES.values() for key, leaf in leaves.items()}


def _size(radius, edges, length) -> Vector3:
    """Bring the sizes as written into the form of Collider.size."""
    if edges is not None:
        return tuple(edge / 2 for edge in edges)
    return (radius or 0.0, length / 2 if length else 0.0, 0.0)


def _read_motion(value, path) -> Motion | None:
    section = read_section(value, path, [*TWIST, 'oscillate'])
    if not section:
        return None
    oscillate = read_section(section.get('oscillate'), join(path, 'oscillate'), OSCILLATION)
    if oscillate:
        oscillate = Oscillation(**read_leaves(oscillate, join(path, 'oscillate'), OSCILLATION,
                                              required=OSCILLATION))
    return Motion(**read_leaves(section, path, TWIST), oscillate=oscillate or None)


def _read_particles(value, directory) -> Particles:
    """Read or draw the particles: positions first, velocities second, from one seed."""
    keys = ['count', 'box', 'position', 'file', 'seed', 'velocity', 'mass', 'radius']
    section = read_section(value, 'particles', keys)
    if not section:
        section = {'position': []}
    leaves = read_leaves(section, 'particles', {'count': COUNT, 'seed': SEED})
    random = np.random.Generator(np.random.PCG64(leaves.get('seed', 0)))
    try:
        position = _read_positions(section, directory, random)
        velocity = _read_velocities(section.get('velocity', (0, 0, 0)), len(position), random)
    except MemoryError:
        raise SceneError('particles', section, 'must fit into memory') from None
    sizes = {key: read_each(section[key], f'particles.{key}', leaf, len(position))
             for key, leaf in (('mass', MASS), ('radius', RADIUS)) if key in section}
    return Particles(read_only(position), read_only(velocity), **sizes)


def _read_positions(section, directory, random):
    ways = [key for key in ('count', 'position', 'file') if key in section]
    if len(ways) != 1:
        raise SceneError('particles', ways or MISSING,
                         'must have exactly one of count (with box), position, file')
    if 'box' in section and ways != ['count']:
        raise SceneError('particles.box', section['box'], 'goes with count only')
    if 'position' in section:
        return read_vectors(section['position'], 'particles.position', POSITION)
    if 'file' in section:
        return read_file(section['file'], 'particles.file', directory)
    low, high = _read_box(section.get('box', MISSING), 'particles.box', POSITION)
    return random.uniform(low, high, (section['count'], 3))


def _read_velocities(value, count, random):
    path = 'particles.velocity'
    if isinstance(value, Mapping):
        section = read_section(value, path, ('sphere', 'box'))
        if len(section) != 1:
            raise SceneError(path, value, 'must have exactly one of sphere, box')
        if 'box' in section:
            low, high = _read_box(section['box'], f'{path}.box', VELOCITY)
            return random.uniform(low, high, (count, 3))
        return SPEED.read(section['sphere'], f'{path}.sphere') * _directions(count, random)
    if is_list_of_vectors(value):
        velocity = read_vectors(value, path, VELOCITY)
        if len(velocity) != count:
            raise SceneError(path, value, f'must be one vector or one for each of the {count} '
                                          f'particles, not {len(velocity)}')
        return velocity
    return np.tile(VELOCITY.read(value, path), (count, 1))


def _directions(count, random):
    """Draw unit vectors, all directions alike."""
    vectors = random.standard_normal((count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _read_box(value, path, leaf):
    """Give the corners of a box that random vectors are drawn from."""
    leaves = {'min': leaf, 'max': leaf}
    corners = read_leaves(read_section(value, path, leaves), path, leaves, required=leaves)
    low, high = corners['min'], corners['max']
    if any(not 0 <= b - a < math.inf for a, b in zip(low, high)):
        raise SceneError(path, value, 'must have min <= max in each entry, with a finite extent')
    return low, high
