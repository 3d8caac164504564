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
What a run of a sweep gives: one row of numbers about its end and its course.

Nothing here depends on where the run takes place, but for the columns VOLATILE.
"""

from importlib import metadata
import os
import socket
from time import perf_counter
from typing import NamedTuple

from collision_sim.simulation import Simulation
import numpy as np

VOLATILE = ('host', 'worker', 'run_time', 'ns_per_particle_step')
AXES = 'xyz'
STATISTICS = {'mean': np.mean, 'std': np.std, 'min': np.min, 'max': np.max}


class Plan(NamedTuple):
    """
    How to run a scene.

    Attributes
    ----------
    duration : float or None [s]
        Simulated time.
    steps : int or None
        Steps of dt; one of the two is given.
    threads : int
        Of one run.
    ledger : bool
        Whether to keep the accounts of energy and momentum.

    """

    duration: float | None = None
    steps: int | None = None
    threads: int = 1
    ledger: bool = False


def version():
    """Give the version of this package, 'unknown' where it is not installed."""
    try:
        return metadata.version('collision_sim')
    except metadata.PackageNotFoundError:
        return 'unknown'


def outcome(scene, plan):
    """
    Run a scene.

    Parameters
    ----------
    scene : scene.Scene
        What to run.
    plan : Plan
        How to run it.

    Returns
    -------
    row : dict
        By column; `error` is None, or says why there are no figures.

    """
    row = {'error': None, 'version': version(), 'host': socket.gethostname(),
           'worker': os.getpid()}
    try:
        with np.errstate(all='ignore'):     # sums of what is near the largest float
            return row | _figures(scene, plan)
    except Exception as error:      # whatever it is, the other runs go on
        return row | {'error': failure(error)}


def failure(error):
    """Say what went wrong, in one line."""
    return f'{type(error).__name__}: {" ".join(str(error).split())}'


def compile_kernels(scene, plan):
    """Do what compiles: a step of the run, and one with contacts."""
    outcome(scene, plan._replace(duration=None, steps=1))


def _simulation(scene, plan):
    return Simulation(scene, contacts=False, threads=plan.threads, ledger=plan.ledger)


def _figures(scene, plan):
    """Run a scene and measure it, without the time to compile."""
    _simulation(scene, plan).step(1)
    sim = _simulation(scene, plan)
    before, began = _balance(sim, 'start'), perf_counter()
    steps = sim.advance(plan.duration) if plan.steps is None else _step(sim, plan.steps)
    spent = perf_counter() - began
    if sim.counters['frozen']:
        raise FloatingPointError('particles left the range of numbers and were frozen, '
                                 f'{sim.counters["frozen"]} times')
    count = len(sim.position)
    counters = {f'counters.{name}': number for name, number in sim.counters.items()}
    return {'run_time': spent, 'ns_per_particle_step': 1e9 * spent / max(steps * count, 1),
            'time': sim.time, 'steps': steps, 'particles': count,
            **before, **_balance(sim, 'end'), **counters, **_ledger(sim), **_state(sim)}


def _step(sim, steps):
    sim.step(steps)
    return steps


def _balance(sim, when):
    """Give energy [J] and momentum [N s]."""
    momentum = zip(AXES, sim.momentum().tolist())
    return {f'energy.{when}': sim.energy(),
            **{f'momentum.{when}.{axis}': value for axis, value in momentum}}


def _ledger(sim):
    """Give the accounts [J] since the start, and what they leave unexplained [J], [N s]."""
    if sim.ledger is None:
        return {}
    total = sim.ledger.total
    accounts = {name: float(np.sum(value)) for name, value in total._asdict().items()
                if name != 'momentum'}
    accounts |= {'residual': float(total.residual),
                 'momentum_residual': float(np.linalg.norm(total.momentum.residual))}
    return {f'ledger.{name}': value for name, value in accounts.items()}


def _state(sim):
    """Give statistics of the particles; contacts are those of a further step."""
    if not len(sim.position):
        return {}
    speed = np.linalg.norm(sim.velocity, axis=1)
    found = {f'{name}.{axis}.{word}': float(statistic(values[:, k]))
             for name, values in (('position', sim.position), ('velocity', sim.velocity))
             for k, axis in enumerate(AXES) for word, statistic in STATISTICS.items()}
    found |= {'speed.mean': float(speed.mean()), 'speed.max': float(speed.max()),
              'depth.max': max(0.0, -float(sim.clearance().min()))}
    sim.record_contacts = True
    sim.step(1)
    touching = len(np.unique(sim.contacts.particle))
    return found | {'in_contact': touching / len(speed)}
