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

"""The files of `collision_sim run --out`: the state at the end, or states over time."""

from contextlib import ExitStack
import csv

from collision_sim.studies.drafts import draft_of
import numpy as np

FORMATS = ('.npz', '.csv')
COLUMNS = ('x', 'y', 'z', 'vx', 'vy', 'vz')


def write_state(path, sim):
    """Write positions and velocities now: arrays, or a row a particle."""
    with draft_of(path) as draft, open(draft, 'wb' if path.endswith('.npz') else 'w') as file:
        if path.endswith('.npz'):
            np.savez(file, position=sim.position, velocity=sim.velocity, time=sim.time)
        else:
            writer = csv.writer(file, lineterminator='\n')
            writer.writerow(COLUMNS)
            writer.writerows(np.hstack([sim.position, sim.velocity]).tolist())


class StatesCsv:
    """
    A table of the states of a simulation over time, a row a particle and time.

    Parameters
    ----------
    path : str
        Of the file; it is there when the `with` block has ended without error.
    sim : Simulation

    """

    def __init__(self, path, sim):
        self._path, self._sim = path, sim

    def __enter__(self):
        with ExitStack() as stack:
            draft = stack.enter_context(draft_of(self._path))
            file = stack.enter_context(open(draft, 'w'))
            self._writer = csv.writer(file, lineterminator='\n')
            self._writer.writerow(('time', 'particle', *COLUMNS))
            self._stack = stack.pop_all()
        return self

    def write(self):
        """Add the state now."""
        rows = np.hstack([self._sim.position, self._sim.velocity]).tolist()
        time = self._sim.time
        self._writer.writerows([time, k, *row] for k, row in enumerate(rows))

    def __exit__(self, *error):
        return self._stack.__exit__(*error)


class StatesNpz:
    """
    Arrays of the states of a simulation over time: time (T,), position and velocity (T, N, 3).

    They are kept in memory until the end of the `with` block.

    Parameters
    ----------
    path : str
        Of the file; it is there when the `with` block has ended without error.
    sim : Simulation

    """

    def __init__(self, path, sim):
        self._path, self._sim = path, sim
        self._times, self._positions, self._velocities = [], [], []

    def __enter__(self):
        return self

    def write(self):
        """Add the state now."""
        self._times.append(self._sim.time)
        self._positions.append(self._sim.position.copy())
        self._velocities.append(self._sim.velocity.copy())

    def __exit__(self, kind, *_):
        if kind is None:
            with draft_of(self._path) as draft, open(draft, 'wb') as file:
                np.savez(file, time=self._times, position=self._positions,
                         velocity=self._velocities)
