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
Codes that do a work, each in a process of its own, measured in turn.

Interleaved turns (ours, peer, ours, peer, ...) let all codes see the same machine, whatever else
it is doing.
"""

from importlib.util import find_spec
import json
import os
from statistics import median
import subprocess
import sys
from threading import Timer
from typing import NamedTuple

from collision_sim.studies.bench_works import WORKS

FLOOR = 0.01                    # m, m/s, J/kg; difference of means that is always the same work
PATIENCE = 600.0                # s; for one answer of a code
SHARE = 60.0                    # s; of one code at one size, after which it takes no more turns
COMPARED = {'height': 'mean height', 'drift': 'mean velocity along x',
            'energy': 'mean kinetic energy'}


class Code(NamedTuple):
    """A code: its name, the package that it needs, its module of peers and the way to use it."""

    name: str
    package: str
    module: str
    variant: str = ''


OWN = Code('collision_sim', 'collision_sim', 'of_own')
FUSED = Code('collision_sim fused', 'collision_sim', 'of_own', 'fused')
MOVED = Code('collision_sim moved', 'collision_sim', 'of_own', 'moved')
OURS = (OWN, FUSED, MOVED)
PEERS = (
    Code('numpy', 'numpy', 'of_numpy'),
    Code('warp', 'warp', 'of_warp'),
    Code('warp fused', 'warp', 'of_warp', 'fused'),
    Code('taichi', 'taichi', 'of_taichi'),
    Code('taichi fused', 'taichi', 'of_taichi', 'fused'),
    Code('quadrants', 'quadrants', 'of_quadrants'),
    Code('quadrants fused', 'quadrants', 'of_quadrants', 'fused'),
    Code('newton XPBD', 'newton', 'of_newton', 'XPBD'),
    Code('newton semi-implicit', 'newton', 'of_newton', 'semi-implicit'),
    Code('mujoco', 'mujoco', 'of_mujoco'),
    Code('pybullet', 'pybullet', 'of_pybullet'),
)


class Row(NamedTuple):
    """
    A measurement; the numbers are None where there is none, and the note says why.

    best, median [ns a particle-step]; share: of the memory bandwidth; ratio: to collision_sim;
    contacts, near: a particle-step, of collision_sim only; note: what is to be said; threads,
    used: most that were allowed, and those that the code took.
    """

    work: str
    particles: int
    code: str
    precision: str
    threads: int
    used: int | None
    runs: int
    best: float | None
    median: float | None
    share: float | None
    ratio: float | None
    contacts: float | None
    near: float | None
    note: str


class Process:
    """
    A code at work on one size.

    Parameters
    ----------
    code : Code
        Which.
    work : str
        A key of WORKS.
    count : int
        Of the particles.
    threads : int
        Most that it may use.
    folder : str
        For files of the scene.

    """

    def __init__(self, code, work, count, threads, folder):
        self.code, self.threads, self.times, self._process = code, threads, [], None
        if find_spec(code.package) is None:
            self.outcome = {'refused': 'not installed'}
            return
        self._process = subprocess.Popen(
            [sys.executable, '-m', 'collision_sim.studies.peers.worker', code.module,
             code.variant, work, str(count), str(threads), str(folder)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            start_new_session=True,
            env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})
        self.outcome = self._answer()

    @property
    def goes_on(self):
        """Whether it takes more turns."""
        return 'refused' not in self.outcome and sum(self.times) < SHARE

    def _answer(self):
        """Wait for an answer, but not for ever."""
        timer = Timer(PATIENCE, self._process.kill)
        timer.start()
        try:
            line = self._process.stdout.readline()
        except KeyboardInterrupt:
            self._process.kill()
            raise
        finally:
            timer.cancel()
        return json.loads(line) if line else {'refused': 'it ended without an answer'}

    def turn(self):
        """Measure some runs."""
        self._process.stdin.write('\n')
        self._process.stdin.flush()
        answer = self._answer()
        if isinstance(answer, dict):
            self.outcome = answer
        else:
            self.times += answer

    def close(self):
        """End the process."""
        if self._process:
            self._process.kill()
            self._process.wait()
            self._process.stdin.close()
            self._process.stdout.close()


def difference(outcome, own, band):
    """Say in which means a result is not that of collision_sim within a band, '' if it is."""
    apart = [f'{words} {outcome[key]:.3g}, not {own[key]:.3g}' for key, words in COMPARED.items()
             if not abs(outcome[key] - own[key]) <= band * abs(own[key]) + FLOOR]
    return 'does other work: ' + ', '.join(apart) if apart else ''


def row(process, own, work, count, rate):
    """
    Give what was measured of a process as a Row.

    Parameters
    ----------
    process, own : Process
        The process, and that of collision_sim.
    work : str
        A key of WORKS.
    count : int
        Of the particles.
    rate : float [bytes/s]
        Memory bandwidth.

    """
    outcome, steps = process.outcome, WORKS[work].steps
    if 'refused' in outcome:
        return Row(work, count, process.code.name, '', process.threads, None, 0, *[None] * 6,
                   outcome['refused'])
    best, middle = (1e9 * pick(process.times) / (steps * count) for pick in (min, median))
    reference = min(own.times) if own.times else None
    note = difference(outcome, own.outcome, WORKS[work].band) if reference else ''
    share = WORKS[work].moved / (best * 1e-9) / rate
    return Row(work, count, process.code.name, outcome['precision'], process.threads,
               outcome['threads'], len(process.times), best, middle, share,
               min(process.times) / reference if reference else None, outcome.get('contacts'),
               outcome.get('near'), note)


def measure(work, count, codes, threads, repeats, folder, rate, bar):
    """
    Measure codes at one size, in turn.

    Parameters
    ----------
    work : str
        A key of WORKS.
    count : int
        Of the particles.
    codes : sequence of Code
        OWN first.
    threads : int
        Most to use.
    repeats : int
        Turns.
    folder : str
        For files of the scene.
    rate : float [bytes/s]
        Memory bandwidth on these threads.
    bar : tqdm.tqdm
        Moves by repeats + 1 for each code.

    Returns
    -------
    rows : list of Row
        One for each code.

    """
    processes = []
    try:
        for code in codes:
            bar.set_description(f'work {work}, {count} particles, {code.name}')
            processes.append(Process(code, work, count, threads, folder))
            bar.update()
        for _ in range(repeats):
            for process in processes:
                bar.set_description(f'work {work}, {count} particles, {process.code.name}')
                if process.goes_on:
                    process.turn()
                bar.update()
    finally:
        for process in processes:
            process.close()
    return [row(process, processes[0], work, count, rate) for process in processes]
