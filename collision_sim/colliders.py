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

"""The colliders of a scene: shapes, poses and motion, and how they are read."""

from collections.abc import Mapping
from dataclasses import dataclass

from collision_sim.checks import as_list, Choice, Direction, Flag, join, Number, Quaternion
from collision_sim.checks import read_leaves, read_section, SceneError, Text, Vector
from collision_sim.friction import Friction, read_friction
from collision_sim.mesh_surface import Mesh, MESH_KEYS, read_mesh


Vector3 = tuple[float, float, float]
Vector4 = tuple[float, float, float, float]

POSITION = Vector('m', 'Position')
RESTITUTION = Number('', 'Share of the normal velocity that a collision reverses', low=0, high=1)
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
    'mesh': {'scale': Number('', 'Factor of all lengths of the mesh', low=0, above=True), **_BODY},
}
MESH_METHODS = ('single_pass', 'multi_pass', 'collision_then_contact')
_SIZE_KEYS = ('radius', 'size', 'length')


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
    mesh : Mesh or None
        Of the shape mesh, which has no size.

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
    mesh: Mesh | None = None

    @property
    def moving(self) -> bool:
        """Whether the collider follows a topic or a script."""
        return self.topic is not None or self.motion is not None


def read_colliders(value, directory, method) -> tuple[Collider, ...]:
    """
    Read the colliders of a scene.

    Parameters
    ----------
    value : list
        As it stands in the scene.
    directory : Path
        Where relative names of files start.
    method : str
        By which the scene is stepped.

    Raises
    ------
    SceneError
        For the first value that is not allowed.

    """
    entries = [] if value is None else as_list(value)
    if not isinstance(entries, list):
        raise SceneError('colliders', value, 'must be a list of colliders')
    colliders = {}
    for index, entry in enumerate(entries):
        collider = _read_collider(entry, f'colliders[{index}]', colliders, directory)
        colliders[collider.name] = collider
    check_method(colliders.values(), method)
    return tuple(colliders.values())


def check_method(colliders, method):
    """
    Check that a method of stepping can treat all colliders.

    Parameters
    ----------
    colliders : iterable of Collider
        Of the scene.
    method : str
        By which it is stepped.

    Raises
    ------
    SceneError
        For a mesh with a method that needs surfaces without edges.

    """
    meshes = [collider.name for collider in colliders if collider.mesh]
    if meshes and method not in MESH_METHODS:
        raise SceneError('stepping.method', method, f'must be one of {", ".join(MESH_METHODS)} '
                                                    f'where a collider ({meshes[0]}) is a mesh')


def _read_collider(value, path, others, directory) -> Collider:
    """Read a collider; its path goes by its name as soon as that is known to be good."""
    if not isinstance(value, Mapping):
        raise SceneError(path, value, 'must be a mapping with name, shape, ...')
    name = value.get('name')
    if COLLIDER['name'].fits(name):
        if name in others:
            raise SceneError(f'{path}.name', name, 'must be unique in the scene')
        path = f'colliders.{name}'
    leaves = {**COLLIDER, 'shape': Choice(tuple(SHAPES)), **_shape_leaves(value.get('shape'))}
    extra = MESH_KEYS if value.get('shape') == 'mesh' else ()
    section = read_section(value, path, [*leaves, *extra, 'friction', 'motion'])
    required = ['name', 'shape', *(key for key in _SIZE_KEYS if key in leaves)]
    found = read_leaves(section, path, leaves, required)
    motion = _read_motion(section.get('motion'), join(path, 'motion'))
    if 'topic' in found and motion is not None:
        raise SceneError(join(path, 'topic'), found['topic'],
                         'must be absent where the collider has a motion')
    size = _size(*(found.pop(key, None) for key in _SIZE_KEYS))
    if 'point' in found:
        found['position'] = found.pop('point')
    friction = read_friction(section.get('friction'), join(path, 'friction'))
    scale, inside = found.pop('scale', 1.0), found.get('inside', False)
    mesh = read_mesh(section, path, directory, scale, inside) if extra else None
    return Collider(**found, size=size, friction=friction, motion=motion, mesh=mesh)


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
