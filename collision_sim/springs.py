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

"""The springs of a scene, and how they are read."""

from dataclasses import dataclass, replace
from importlib.util import find_spec
import math

from collision_sim.checks import as_list, Choice, MISSING, Number, read_each, read_leaves
from collision_sim.checks import read_only, read_section, SceneError
from collision_sim.input_files import read_table
import numpy as np

SOLVERS = ('explicit', 'implicit')
MOST_SUBSTEPS = 1000        # of the explicit solver in a step
SHARE = 0.5                 # of the longest stable substep that is taken: at most 1 rad of a mode
WORST = 1e12                # condition of the implicit solver's matrix: leaves 4 digits of 16

SPRING = {
    'stiffness': Number('N/m', 'Stiffness of the springs', low=0),
    'damping': Number('N s/m', 'Damping along the springs', low=0),
}
REST_LENGTH = Number('m', 'Length of a spring without force', low=0)
ROWS = Number('', 'Rows or columns of a grid', low=1, high=10 ** 8, whole=True)
KEYS = ['pairs', 'file', 'grid', *SPRING, 'rest_length', 'solver']


@dataclass(frozen=True, eq=False)
class Springs:
    """
    Springs between particles; the arrays are read-only.

    Attributes
    ----------
    pairs : (S, 2) int64
        Particles at the ends.
    stiffness, damping : float or (S,) float64 [N/m], [N s/m]
    rest_length : float or (S,) float64 [m]
    solver : str
        One of SOLVERS.

    """

    pairs: np.ndarray
    stiffness: float | np.ndarray
    damping: float | np.ndarray
    rest_length: float | np.ndarray
    solver: str = SOLVERS[0]

    @property
    def laws(self):
        """Stiffness, rest length and damping of each spring, (S, 3)."""
        each = np.empty((len(self.pairs), 3))
        each[:, 0], each[:, 1], each[:, 2] = self.stiffness, self.rest_length, self.damping
        return each

    def substeps(self, particles, dt):
        """Give how many substeps a step of dt [s] takes: as many as its stability asks for."""
        return _substeps(self._limit(particles), dt) if self.solver == 'explicit' else 1

    def parameters(self):
        """Give what may change while the simulation runs, by its path in the scene."""
        return {f'springs.{key}': leaf.parameter(getattr(self, key))
                for key, leaf in SPRING.items() if isinstance(getattr(self, key), float)}

    def with_parameter(self, path, value, particles, stepping):
        """Give a copy in which the parameter of `parameters` at a path has another value."""
        key = path.removeprefix('springs.')
        changed = replace(self, **{key: SPRING[key].read(value, path)})
        changed.check(path, value, particles, stepping)
        return changed

    def check(self, path, value, particles, stepping):
        """Raise SceneError, with this path and value, where the steps cannot be stable."""
        dt = stepping.dt
        if self.solver == 'implicit':
            square, rate = self._bounds(particles)
            condition = float(np.max(1.0 + dt * rate + dt * dt * square, initial=1.0))
            if not condition <= WORST:
                raise SceneError(path, value, (
                    f'makes the equations of the implicit solver too stiff to be solved: their '
                    f'condition is up to {condition:.3g}, at most {WORST:g} is allowed; take less '
                    'stiffness or damping, more mass or a shorter stepping.dt'))
            return
        limit = self._limit(particles)
        if not _substeps(limit, dt) <= MOST_SUBSTEPS:
            raise SceneError(path, value, (
                f'would take {_substeps(limit, dt):.6g} substeps in a step of {dt:g} s, at most '
                f'{MOST_SUBSTEPS} are allowed: the explicit solver is stable up to {limit:.17g} s '
                f'and takes {SHARE:g} of that; take solver: implicit, or a stepping.dt of at most '
                f'{MOST_SUBSTEPS * SHARE * limit:.3g} s'))

    def _limit(self, particles):
        from collision_sim.core.springs import longest_substep      # kernels take a while
        return longest_substep(*self._bounds(particles))

    def _bounds(self, particles):
        from collision_sim.core.springs import mode_bounds
        return mode_bounds(self.pairs, self.laws, particle_masses(particles))


def _substeps(limit, dt):
    """Whole number of substeps, or infinity."""
    need = dt / (SHARE * limit) if limit > 0.0 else math.inf
    return max(math.ceil(need), 1) if need < math.inf else math.inf


def particle_masses(particles):
    """Give the masses of the particles, (N,) [kg]."""
    return np.broadcast_to(np.asarray(particles.mass, dtype=np.float64),
                           len(particles.position))


def read_springs(value, particles, stepping, directory) -> Springs | None:
    """
    Read the springs of a scene.

    Parameters
    ----------
    value : dict or None
        The section.
    particles, stepping : Particles, Stepping
        Of the scene.
    directory : Path
        Where relative names of files start.

    Returns
    -------
    Springs or None
        None where there are no springs.

    Raises
    ------
    SceneError
        For the first value that is not allowed, and where the steps cannot be stable.

    """
    section = read_section(value, 'springs', KEYS)
    if not section:
        return None
    if stepping.method == 'exact':
        raise SceneError('stepping.method', 'exact', 'does not go with springs; take '
                         'collision_then_contact, second_order_contact, multi_pass or single_pass')
    pairs = read_only(_read_pairs(section, len(particles.position), directory))
    found = {key: read_each(section.get(key, MISSING if key == 'stiffness' else 0.0),
                            f'springs.{key}', leaf, len(pairs), 'springs')
             for key, leaf in SPRING.items()}
    found |= read_leaves(section, 'springs', {'solver': Choice(SOLVERS)})
    springs = Springs(pairs, rest_length=_read_rest(section, particles, pairs), **found)
    if springs.solver == 'implicit' and not find_spec('scipy'):
        raise SceneError('springs.solver', 'implicit',
                         "needs SciPy: pip install 'collision_sim[springs]'")
    springs.check('springs.stiffness', section['stiffness'], particles, stepping)
    return springs if len(pairs) else None


def _read_pairs(section, count, directory):
    """Give the pairs (S, 2) int64, by whichever way the section has."""
    ways = [key for key in ('pairs', 'file', 'grid') if key in section]
    if len(ways) != 1:
        raise SceneError('springs', ways or MISSING, 'must have exactly one of pairs, file, grid')
    if 'grid' in section:
        return _grid_pairs(section['grid'], count)
    path, rows = f'springs.{ways[0]}', section[ways[0]]
    if 'file' in section:
        rows = read_table(rows, path, directory, 2, int, 'pairs of indices (S, 2)')
    pairs = _indices(rows, path)
    bad = np.flatnonzero(((pairs < 0) | (pairs >= count)).any(axis=1))
    if len(bad):
        raise SceneError(f'{path}[{bad[0]}]', pairs[bad[0]].tolist(),
                         f'must be two of the {count} particles, from 0 to {count - 1}')
    bad = np.flatnonzero(pairs[:, 0] == pairs[:, 1])
    if len(bad):
        raise SceneError(f'{path}[{bad[0]}]', pairs[bad[0]].tolist(),
                         'must be two different particles')
    return pairs


def _indices(rows, path):
    """Give rows of two whole numbers as an array (S, 2) int64."""
    allowed = 'must be a list of pairs of whole numbers, the indices of two particles'
    rows = as_list(rows)
    if not isinstance(rows, list):
        raise SceneError(path, rows, allowed)
    for k, row in enumerate(rows):
        row = as_list(row)
        if not (isinstance(row, list) and len(row) == 2 and all(
                isinstance(i, (int, np.integer)) and not isinstance(i, bool)
                and abs(i) < 2 ** 62 for i in row)):
            raise SceneError(f'{path}[{k}]', row, 'must be two whole numbers, the indices of two '
                                                  'particles')
    return np.array([as_list(row) for row in rows], dtype=np.int64).reshape(-1, 2)


def _grid_pairs(value, count):
    """Springs along the rows, the columns and the diagonals of a grid of particles, row by row."""
    path, shape = 'springs.grid', as_list(value)
    allowed = f'must be the rows and columns of a grid of all {count} particles'
    if not isinstance(shape, list) or len(shape) != 2:
        raise SceneError(path, value, allowed)
    rows, columns = (ROWS.read(entry, path) for entry in shape)
    if rows * columns != count:
        raise SceneError(path, value, allowed)
    grid = np.arange(count).reshape(rows, columns)
    ends = [(grid[:, :-1], grid[:, 1:]), (grid[:-1], grid[1:]), (grid[:-1, :-1], grid[1:, 1:]),
            (grid[:-1, 1:], grid[1:, :-1])]
    return np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in ends])


def _read_rest(section, particles, pairs):
    """Give the lengths without force: those at the start where they are not given."""
    value = section.get('rest_length', 'auto')
    if isinstance(value, str) and value == 'auto':
        from collision_sim.core.springs import lengths
        with np.errstate(over='ignore'):
            rest = lengths(pairs, particles.position)
        if not np.isfinite(rest).all():
            raise SceneError('springs.rest_length', 'auto', 'must be given as numbers where '
                                                            'particles start that far apart')
        return read_only(rest)
    if isinstance(value, str):
        raise SceneError('springs.rest_length', value, 'must be auto, a number or a list of them')
    return read_each(value, 'springs.rest_length', REST_LENGTH, len(pairs), 'springs')
