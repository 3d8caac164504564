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
The error of a method on a scene with a known answer, and the time that it takes.

A scene is compared at SAMPLES even times, so dt is the time between two of them over a whole
number. Events of many different particles fall on all phases of such a step.
"""

from dataclasses import dataclass
from functools import cached_property
from math import inf
from time import perf_counter
from typing import NamedTuple

from collision_sim import scene as scenes
from collision_sim.simulation import Simulation
import numpy as np

SAMPLES = 24                # times of comparison, the end included
LONG = 0.1                  # s; for less the calls of a run in parts would count
FEWEST, ENOUGH = 3, 0.5     # repeats in any case; s after which they are enough
DEEP = 1e-6                 # share of the scene's size from which a penetration is a failure


class Setting(NamedTuple):
    """A way to step: one of METHODS, DETECTIONS and FLIGHTS of the scene each."""

    method: str
    detection: str
    flight: str

    @property
    def label(self):
        """Words for people; the detection and flight of `exact` do not matter."""
        return self.method if self.method == 'exact' else ', '.join(self)


class Row(NamedTuple):
    """
    One measurement; a line of the report's table.

    Attributes
    ----------
    scene : str
        Name of the case.
    method, detection, flight : str
        As in a scene.
    particles : int
        How many there were.
    dt : float [s]
        Length of a step.
    steps : int
        How many were taken.
    error : float [m]
        Of the position, RMS over particles and times.
    error_end : float [m]
        RMS over particles at the end.
    energy : float [-]
        Mechanical energy at the end that is too much, or too little, over the largest kinetic one.
    penetration : float [m]
        Deepest at the times of comparison.
    run_time : float [s]
        Median of several runs, per particle and simulated second.
    run_time_step : float [s]
        The same per particle and step.
    repeats : int
        Number of those runs.
    failure : str
        What went wrong, '' if nothing did.

    """

    scene: str
    method: str
    detection: str
    flight: str
    particles: int
    dt: float
    steps: int
    error: float
    error_end: float
    energy: float
    penetration: float
    run_time: float
    run_time_step: float
    repeats: int
    failure: str

    @property
    def setting(self):
        """Give the way that the steps were taken."""
        return Setting(self.method, self.detection, self.flight)


def settings(case):
    """Give all ways to step a case; symplectic Euler only where some force changes velocities."""
    flights = scenes.FLIGHTS
    if not np.any(case.scene.get('gravity', 1.0)) and not case.scene.get('drag'):
        flights = flights[:1]
    found = []
    for method in scenes.METHODS:
        if method == 'exact':
            found.append(Setting(method, scenes.DETECTIONS[0], scenes.FLIGHTS[0]))
        else:
            found += [Setting(method, detection, flight)
                      for flight in flights for detection in scenes.DETECTIONS]
    return found


def simulation(case, setting, dt):
    """Make a simulation of a case, on one thread."""
    stepping = {**(case.scene.get('stepping') or {}), **setting._asdict(), 'dt': dt}
    scene = scenes.Scene.from_dict({**case.scene, 'stepping': stepping})
    return Simulation(scene, contacts=False, threads=1)


def sample_times(case):
    """Give the times of comparison, (SAMPLES,) [s]."""
    return case.duration * np.arange(1, SAMPLES + 1) / SAMPLES


def dt_of(case, steps):
    """Length of a step [s] where there are that many between two times of comparison."""
    return case.duration / (SAMPLES * steps)


@dataclass
class Answer:
    """What a case should do at the times of comparison, computed once."""

    case: object

    @cached_property
    def states(self):
        """Positions and velocities, (SAMPLES, N, 3) [m], [m/s]."""
        return self.case.reference(sample_times(self.case))

    @cached_property
    def gravity(self):
        """Acceleration (3,) [m/s^2]."""
        return np.array(self.case.scene.get('gravity', (0.0, 0.0, -9.81)))

    @cached_property
    def energy_scale(self):
        """Largest mean kinetic energy over mass [J/kg], or that of a fall through the scene."""
        kinetic = 0.5 * np.square(self.states[1]).sum(axis=2).mean(axis=1).max()
        fall = np.linalg.norm(self.gravity) * self.case.scale
        return kinetic or fall or 1.0

    def energy(self, position, velocity):
        """Mean mechanical energy over mass [J/kg]."""
        kinetic = 0.5 * np.square(velocity).sum(axis=-1)
        return float(np.mean(kinetic - position @ self.gravity))


def penetration(sim):
    """Deepest penetration of a particle now [m]."""
    return max(-float(np.min(sim.clearance(), initial=inf)), 0.0)


def timed(sim, steps):
    """Run time of steps in one call [s]."""
    start = perf_counter()
    sim.step(steps)
    return perf_counter() - start


def trace(sim, steps):
    """
    Follow the particles.

    Returns
    -------
    positions : (SAMPLES, N, 3) float64 [m]
        At the times of comparison.
    deepest : float [m]
        Penetration at these times.
    seconds : float [s]
        Run time of the steps.

    """
    positions, deepest, seconds = [], 0.0, 0.0
    for _ in range(SAMPLES):
        seconds += timed(sim, steps)
        positions.append(sim.position.copy())
        deepest = max(deepest, penetration(sim))
    return np.array(positions), deepest, seconds


def run_times(sim, steps, repeats, first):
    """Run times [s] of the whole scene, in one call; `first` counts where that is long."""
    found = [first] if first > LONG else []
    while len(found) < FEWEST or len(found) < repeats and sum(found) < ENOUGH:
        sim.reset()
        found.append(timed(sim, steps))
    return found


def failure(case, distances, deeper, counters):
    """Say what went wrong, in a few words; `deeper` [m] inside than at the start."""
    if not np.isfinite(distances).all():
        return 'not finite'
    lost = int((distances[-1] > case.lost).sum())
    if lost:
        return f'{lost} of {len(distances[-1])} lost'
    if deeper > DEEP * case.scale:
        return f'{deeper:.1e} m inside'
    return f'{counters["unplaced"]} unplaced' if counters.get('unplaced') else ''


def measure(case, answer, setting, steps, repeats):
    """
    Measure the error and the run time of one way to step.

    Parameters
    ----------
    case : case.Case
        What to run.
    answer : Answer
        To that case.
    setting : Setting
        How to step.
    steps : int
        Between two times of comparison.
    repeats : int
        Most runs of which the run time is the median.

    Returns
    -------
    Row

    """
    dt = dt_of(case, steps)
    sim = simulation(case, setting, dt)
    total, count = steps * SAMPLES, len(sim.position)
    at_start = penetration(sim)
    with np.errstate(invalid='ignore', over='ignore'):
        positions, deepest, first = trace(sim, steps)
        distances = np.linalg.norm(positions - answer.states[0], axis=2)
        energy = answer.energy(sim.position, sim.velocity) - answer.energy(
            answer.states[0][-1], answer.states[1][-1])
        errors = np.sqrt(np.mean(np.square(distances))), np.sqrt(np.mean(distances[-1] ** 2))
    reason = failure(case, distances, deepest - at_start, sim.counters)
    runs = run_times(sim, total, repeats, first)
    seconds = float(np.median(runs)) / max(count, 1)
    return Row(case.name, *setting, count, dt, total, *map(float, errors),
               energy / answer.energy_scale, deepest, seconds / case.duration, seconds / total,
               len(runs), reason)
