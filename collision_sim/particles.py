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

"""The particles of a scene at the start, and how they are read or drawn."""

from collections.abc import Mapping
from dataclasses import dataclass
import math

from collision_sim.checks import finite_vectors, is_list_of_vectors, MISSING, Number, read_each
from collision_sim.checks import read_leaves, read_only, read_section, read_vectors, SceneError
from collision_sim.checks import Text, Vector
from collision_sim.input_files import read_table
import numpy as np


COUNT = Number('', 'Count of particles', low=0, high=10 ** 8, whole=True)
SEED = Number('', 'Seed of the random numbers', low=0, whole=True)
POSITION = Vector('m', 'Position')
VELOCITY = Vector('m/s', 'Velocity')
SPEED = Number('m/s', 'Speed', low=0)
MASS = Number('kg', 'Mass of a particle', low=0, above=True, infinite=True)
RADIUS = Number('m', 'Radius of a particle', low=0)
SHARD = Text('[0-9]{1,9}/[0-9]{1,9}', 'must be k/n with k from 1 to n')


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

    def shard(self, k, n) -> 'Particles':
        """Give the k-th of n even slices, k from 1 on; copies, so that the rest can be freed."""
        count = len(self.position)
        part = slice((k - 1) * count // n, k * count // n)
        return Particles(*(read_only(value[part].copy()) if np.ndim(value) else value
                           for value in (self.position, self.velocity, self.mass, self.radius)))


def read_shard(text) -> tuple[int, int]:
    """Read `k/n`, the k-th of n shards."""
    k, n = map(int, SHARD.read(text, 'shard').split('/'))
    if not 1 <= k <= n:
        raise SceneError('shard', text, SHARD.allowed)
    return k, n


def read_particles(value, directory) -> Particles:
    """Read or draw the particles: positions first, velocities second, from one seed."""
    keys = ['count', 'box', 'position', 'file', 'grid', 'seed', 'velocity', 'mass', 'radius']
    section = read_section(value, 'particles', keys)
    if not section:
        section = {'position': []}
    leaves = read_leaves(section, 'particles', {'count': COUNT, 'seed': SEED})
    random = np.random.Generator(np.random.PCG64(leaves.get('seed', 0)))
    try:
        position = _read_positions(section, directory, random)
        velocity = _read_velocities(section.get('velocity', (0, 0, 0)), len(position), random)
    except MemoryError as error:
        raise SceneError('particles', section, f'must fit into memory: {error}') from None
    sizes = {key: read_each(section[key], f'particles.{key}', leaf, len(position))
             for key, leaf in (('mass', MASS), ('radius', RADIUS)) if key in section}
    return Particles(read_only(position), read_only(velocity), **sizes)


def _read_positions(section, directory, random):
    ways = [key for key in ('count', 'position', 'file', 'grid') if key in section]
    if len(ways) != 1:
        raise SceneError('particles', ways or MISSING,
                         'must have exactly one of count (with box), position, file, grid')
    if 'box' in section and ways != ['count']:
        raise SceneError('particles.box', section['box'], 'goes with count only')
    if 'position' in section:
        return read_vectors(section['position'], 'particles.position', POSITION)
    if 'file' in section:
        return _read_file(section['file'], 'particles.file', directory)
    if 'grid' in section:
        return _read_grid(section['grid'], 'particles.grid')
    low, high = _read_box(section.get('box', MISSING), 'particles.box', POSITION)
    return random.uniform(low, high, (section['count'], 3))


def _read_file(value, path, directory):
    """Give the positions in a .npy or .csv file."""
    what = 'the positions (N, 3)'
    rows = read_table(value, path, directory, 3, float, what, titles='xyz')
    try:
        return finite_vectors(np.reshape(rows, (-1, 3)) if isinstance(rows, list) else rows)
    except ValueError as error:
        raise SceneError(path, value, f'must hold {what}; {error}') from None


def _read_grid(value, path):
    """Give the places of a grid, row by row; rows follow the first edge, columns the second."""
    keys = {'count': Vector('', 'Rows and columns', low=1, high=10 ** 8, whole=True, length=2),
            'corner': POSITION}
    section = read_section(value, path, (*keys, 'edges'))
    leaves = read_leaves(section, path, keys, required=keys)
    edges = read_vectors(section.get('edges', MISSING), f'{path}.edges', POSITION)
    if len(edges) != 2:
        raise SceneError(f'{path}.edges', section['edges'], 'must be two vectors, those from the '
                         'corner along a column and along a row')
    rows, columns = leaves['count']
    if rows * columns > COUNT.high:
        raise SceneError(f'{path}.count', leaves['count'], f'must be {COUNT.high} in all at most')
    down, along = np.mgrid[:rows, :columns].reshape(2, -1, 1)
    return (np.array(leaves['corner']) + down / max(rows - 1, 1) * edges[0]
            + along / max(columns - 1, 1) * edges[1])


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
