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

"""Events a second of the method `exact` with pairs: for `collision_sim bench`."""

from math import pi
from time import perf_counter
from typing import NamedTuple

from collision_sim.scene import Scene
from collision_sim.simulation import Simulation
from collision_sim.studies.bench_tables import aligned, figure, size
import numpy as np

SIZES, QUICK_SIZES = (10 ** 3, 10 ** 4, 10 ** 5), (10 ** 3,)
RADIUS, PACKING = 0.05, 0.2
DT, FIXED_DT = 0.1, 1 / 240     # s; a ball is hit some ten times in the first
LEAST = 0.5                     # s of a turn, at least


class Row(NamedTuple):
    """
    Figures of one number of balls.

    events: how many a turn had; rate [1/s]: of the best turn; fixed [1/s]: particle-steps a second
    of `collision_then_contact` on the same balls in the same run; drift [-]: relative change of
    the energy over all turns.
    """

    particles: int
    events: int
    rate: float
    fixed: float
    drift: float


def gas(count, method, dt):
    """
    Give a gas of hard balls in a box that they fill to PACKING, with restitution 1.

    Parameters
    ----------
    count : int
        About how many balls: a cube number.
    method : str
        Of stepping.
    dt : float [s]
        Length of a step.

    Returns
    -------
    Scene

    """
    random, rows = np.random.default_rng(1), max(round(count ** (1 / 3)), 1)
    side = rows * RADIUS * (4 / 3 * pi / PACKING) ** (1 / 3)
    line = (np.arange(rows) + 0.5) * side / rows - side / 2
    position = np.stack(np.meshgrid(line, line, line, indexing='ij'), axis=-1).reshape(-1, 3)
    position += random.uniform(-0.9, 0.9, position.shape) * (side / rows / 2 - RADIUS)
    box = {'name': 'box', 'shape': 'box', 'size': [side] * 3, 'inside': True}
    return Scene.from_dict({
        'gravity': [0, 0, 0], 'restitution': 1.0, 'pairs': {}, 'colliders': [box],
        'particles': {'position': position, 'radius': RADIUS,
                      'velocity': random.normal(0.0, 1.0, position.shape)},
        'stepping': {'dt': dt, 'method': method}})


def _events(sim):
    """Count the collisions so far."""
    return sim.counters['pair_collisions'] + sim.counters['collisions']


def _turn(sim):
    """Take steps for a while; how many, the events in them, and the time [s]."""
    before, steps, began = _events(sim), 0, perf_counter()
    while steps == 0 or perf_counter() - began < LEAST:
        sim.step()
        steps += 1
    return steps, _events(sim) - before, perf_counter() - began


def measure(counts, repeats):
    """
    Measure events a second.

    Parameters
    ----------
    counts : iterable of int
        Numbers of balls.
    repeats : int
        Turns, of which the best counts.

    Returns
    -------
    list of Row

    """
    rows = []
    for count in counts:
        exact = Simulation(gas(count, 'exact', DT), contacts=False)
        fixed = Simulation(gas(count, 'collision_then_contact', FIXED_DT), contacts=False)
        exact.step()
        fixed.step()
        energy, best, rate, per_step = exact.energy(), 0, 0.0, 0.0
        for _ in range(repeats):
            _, events, took = _turn(exact)
            if events / took > rate:
                best, rate = events, events / took
            steps, _, took = _turn(fixed)
            per_step = max(per_step, steps * len(fixed.position) / took)
        drift = exact.energy() / energy - 1.0
        rows.append(Row(len(exact.position), best, rate, per_step, drift))
    return rows


def table(rows):
    """Give the figures as a table in Markdown."""
    head = ['balls', 'events', 'events a second', 'particle-steps a second, fixed steps',
            'events to these', 'change of energy']
    return aligned(head, [[size(row.particles), size(row.events), figure(row.rate),
                           figure(row.fixed), figure(row.rate / row.fixed), f'{row.drift:.1e}']
                          for row in rows])
