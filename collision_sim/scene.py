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

from dataclasses import dataclass, fields, replace
import os
from pathlib import Path

from collision_sim.checks import Choice, join, Number, Parameter, read_leaves, read_section
from collision_sim.checks import read_yaml, SceneError, unknown, Vector
from collision_sim.colliders import Collider, read_colliders, RESTITUTION, Vector3
from collision_sim.friction import (FRICTION, Friction, friction_parameters, read_friction,
                                    with_friction)
from collision_sim.pairs import Pairs, read_pairs
from collision_sim.particles import Particles, read_particles, read_shard
from collision_sim.springs import read_springs, Springs

SHORTEST = 1e-100       # s; of a step, so that its square and its inverse are numbers
SCENES = Path(__file__).parent / 'scenes'

# What a scene can ask for. A new method is named here and nowhere else.
METHODS = ('single_pass', 'multi_pass', 'collision_then_contact', 'second_order_contact',
           'exact')
DETECTIONS = ('end_of_step', 'trajectory')
FLIGHTS = ('ballistic', 'symplectic_euler')


@dataclass(frozen=True)
class Drag:
    """Deceleration of particles in the wind: linear [1/s], quadratic [1/m], wind [m/s]."""

    linear: float = 0.0
    quadratic: float = 0.0
    wind: Vector3 = (0.0, 0.0, 0.0)


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
    pairs : Pairs or None
    springs : Springs or None

    """

    gravity: Vector3
    drag: Drag | None
    particles: Particles
    restitution: float
    friction: Friction
    colliders: tuple[Collider, ...]
    stepping: Stepping
    pairs: Pairs | None = None
    springs: Springs | None = None

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
        directory, stepping = Path(directory), _read_stepping(section.get('stepping'))
        particles = read_particles(section.get('particles'), directory)
        return cls(
            gravity=leaves.get('gravity', (0.0, 0.0, -9.81)),
            drag=_read_drag(section.get('drag')),
            particles=particles,
            restitution=leaves.get('restitution', 0.0),
            friction=read_friction(section.get('friction'), 'friction') or Friction(),
            colliders=read_colliders(section.get('colliders'), directory, stepping.method),
            stepping=stepping,
            pairs=read_pairs(section.get('pairs'), particles, stepping),
            springs=read_springs(section.get('springs'), particles, stepping, directory))

    def collider(self, name) -> Collider:
        """Give the collider of that name."""
        for collider in self.colliders:
            if collider.name == name:
                return collider
        names = [collider.name for collider in self.colliders]
        raise unknown(join('colliders', name), name, name, names)

    def shard(self, k, n) -> 'Scene':
        """
        Give the scene with a share of its particles, for one of n simulations that carry it.

        Particles are drawn as for the whole scene, and each moves to the last bit as there.

        Parameters
        ----------
        k, n : int
            Which of how many even, contiguous slices; k from 1 to n.

        Raises
        ------
        SceneError
            For other k, and where particles act on each other: with pairs or springs.

        """
        k, n = read_shard(f'{k}/{n}')
        for name in ('pairs', 'springs'):
            if n > 1 and getattr(self, name) is not None:
                raise SceneError('shard', f'{k}/{n}', f'must be 1/1 with {name}, which act across '
                                                      'shards')
        return replace(self, particles=self.particles.shard(k, n))

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
        found |= friction_parameters(self.friction, 'friction')
        for collider in self.colliders:
            path = f'colliders.{collider.name}'
            restitution = self.restitution_of(collider)
            found[f'{path}.restitution'] = RESTITUTION.parameter(restitution)
            found |= friction_parameters(self.friction_of(collider), f'{path}.friction')
        if self.pairs is not None:
            found |= self.pairs.parameters(self)
        if self.springs is not None:
            found |= self.springs.parameters()
        found['stepping.iterations'] = STEPPING['iterations'].parameter(self.stepping.iterations)
        return found

    def follows(self, path) -> bool:
        """Whether a parameter of a collider or the pairs has the value of the whole scene."""
        match path.split('.'):
            case ['colliders', name, law, *_] if self._has(name):
                return getattr(self.collider(name), law, self) is None
            case ['pairs', law, *_] if self.pairs is not None:
                return getattr(self.pairs, law, self) is None
        return False

    def with_parameters(self, changes) -> 'Scene':
        """
        Give a copy of the scene in which several parameters have other values, or none.

        A collider, or the pairs, whose restitution or friction is set to what the scene's is
        follows the scene's from then on; another value is its own; what it has already changes
        nothing.

        Parameters
        ----------
        changes : list of (str, object)
            Paths and values; those that hold only together may come in any order.

        Raises
        ------
        SceneError
            As `with_parameter`.

        """
        of_parts = [each for each in changes if is_of_a_part(each[0])]
        before = self._with_all([each for each in changes if not is_of_a_part(each[0])])
        if not of_parts:
            return before
        after = before._with_all(of_parts)
        laws = {'restitution': after.restitution, 'friction': after.friction}
        if after.pairs is not before.pairs:
            after = replace(after, pairs=_followed(before.pairs, after.pairs, laws))
        return replace(after, colliders=tuple(
            _followed(*part, laws) for part in zip(before.colliders, after.colliders)))

    def _with_all(self, changes) -> 'Scene':
        """Change one parameter after the other, those that are refused again after the rest."""
        scene = self
        while changes:
            refused = []
            for path, value in changes:
                try:
                    scene = scene._with_one(path, value)
                except SceneError as error:
                    refused.append((path, value, error))
            if len(refused) == len(changes):
                raise refused[0][2]
            changes = [(path, value) for path, value, _ in refused]
        return scene

    def with_parameter(self, path, value) -> 'Scene':
        """
        Give a copy of the scene in which one parameter has another value, as `with_parameters`.

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
        return self.with_parameters([(path, value)])

    def _with_one(self, path, value) -> 'Scene':
        """Give a copy in which one parameter has another value; that of a part is its own."""
        match path.split('.') if isinstance(path, str) else []:
            case ['gravity']:
                return replace(self, gravity=GRAVITY.read(value, path))
            case ['drag', key] if self.drag is not None and key in DRAG:
                drag = replace(self.drag, **{key: DRAG[key].read(value, path)})
                return replace(self, drag=drag)
            case ['restitution']:
                return replace(self, restitution=RESTITUTION.read(value, path))
            case ['friction', *keys] if '.'.join(keys) in FRICTION:
                return replace(self, friction=with_friction(self.friction, keys, value, path))
            case ['colliders', name, 'restitution'] if self._has(name):
                return self._with_collider(name, restitution=RESTITUTION.read(value, path))
            case ['colliders', name, 'friction', *keys] if (
                    self._has(name) and '.'.join(keys) in FRICTION):
                friction = self.friction_of(self.collider(name))
                friction = with_friction(friction, keys, value, path)
                return self._with_collider(name, friction=friction)
            case ['pairs', *keys] if self.pairs is not None and self.pairs.has(keys):
                return replace(self, pairs=self.pairs.with_parameter(self, keys, value, path))
            case ['springs', _] if self.springs is not None and (
                    path in self.springs.parameters()):
                return replace(self, springs=self.springs.with_parameter(
                    path, value, self.particles, self.stepping))
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


def is_of_a_part(path) -> bool:
    """Whether a parameter is of a collider or the pairs, which may follow the scene."""
    return isinstance(path, str) and path.startswith(('colliders.', 'pairs.'))


def _followed(before, after, laws):
    """Give a collider or the pairs after a change, without what is as in the scene or before."""
    changes = {}
    for name, default in laws.items():
        was, value = getattr(before, name), getattr(after, name)
        if value is not was and value == (default if was is None else was):
            changes[name] = was
        elif value is not was and value == default:
            changes[name] = None
    return replace(after, **changes) if changes else after


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
    path = scene_path(name)
    return Scene.from_dict(read_yaml(path), path.parent)


def shipped_scenes() -> list[str]:
    """Give the names of the scenes that come with the package."""
    return sorted(path.stem for path in SCENES.glob('*.yaml'))


def scene_path(name) -> Path:
    """Give the file of a scene: `name` is its path, or that of a shipped scene."""
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
    stepping = Stepping(**read_leaves(section, 'stepping', STEPPING))
    if 0.0 < stepping.dt < SHORTEST:
        raise SceneError('stepping.dt', stepping.dt, f'must be 0 or from {SHORTEST:g} s on')
    return stepping
