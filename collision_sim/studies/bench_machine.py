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

"""What the machine gives, and what a start and a particle cost: for `collision_sim bench`."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
import os
from pathlib import Path
from statistics import median
import subprocess
import sys
from time import perf_counter
from typing import NamedTuple

from numba import njit
import numpy as np

LEAST, CACHES = 2 ** 28, 2          # bytes and times the largest cache: the array of `bandwidth`
TURNS = 5                           # of which the best counts
STARTS = 5                          # processes, of which the median counts
UNITS = {'K': 2 ** 10, 'M': 2 ** 20, 'G': 2 ** 30}

START = """
print('begun', flush=True)
from collision_sim import load_scene, Simulation
print('imported', flush=True)
sim = Simulation(load_scene('demo'))
print('loaded', flush=True)
sim.step()
print('stepped', flush=True)
"""
MEMORY = """
import resource, sys
from collision_sim import Scene, Simulation
from collision_sim.studies.bench_works import BALL, BLOCK, GROUND
box = {'min': [-2, -2, 0.01], 'max': [2, 2, 5]}
sim = Simulation(Scene.from_dict({'particles': {'count': int(sys.argv[1]), 'box': box},
                                  'restitution': 0.5, 'friction': {'dry': 0.3},
                                  'colliders': [GROUND, BALL, BLOCK]}), contacts=True)
sim.step()
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


class Start(NamedTuple):
    """Times from the start of a process until ... [s]; the first step of the scene `demo`."""

    imported: float
    loaded: float
    stepped: float


@njit(cache=True, nogil=True)
def update(part):
    """Read and write every entry."""
    np.multiply(part, 0.5, part)


def largest_cache():
    """Give the size of the largest cache [bytes], 0 where the system does not say."""
    files = Path('/sys/devices/system/cpu/cpu0/cache').glob('index*/size')
    sizes = [file.read_text().strip() for file in files]
    return max((int(size[:-1]) * UNITS[size[-1]] for size in sizes if size[-1:] in UNITS),
               default=0)


def bandwidth(threads, size=None):
    """
    Measure the memory bandwidth: all entries of an array read and written in place.

    Parameters
    ----------
    threads : int
        That share the array.
    size : int, optional
        Of the array [bytes]; else much larger than the caches.

    Returns
    -------
    rate : float [bytes/s]
        Best of several turns.

    """
    array = np.ones((size or max(LEAST, CACHES * largest_cache())) // 8)
    parts = np.array_split(array, threads)
    update(parts[0][:1])
    times = []
    with ThreadPoolExecutor(threads) as pool:
        for _ in range(TURNS):
            began = perf_counter()
            list(pool.map(update, parts))
            times.append(perf_counter() - began)
    return 2 * array.nbytes / min(times)


@contextmanager
def _python(code, *words):
    """Run some code in a process of its own, which an interrupt ends without a word."""
    with subprocess.Popen([sys.executable, '-c', code, *words], stdout=subprocess.PIPE,
                          text=True, start_new_session=True,
                          env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)}) as process:
        try:
            yield process
        except BaseException:
            process.kill()
            raise


def _start():
    """Start a process and see how long its parts take."""
    began = perf_counter()
    with _python(START) as process:
        times = {line.strip(): perf_counter() - began for line in process.stdout}
    return Start(*(times[name] for name in Start._fields))


def warm_start(starts=STARTS):
    """Give the median Start of several processes, after one that compiles what is missing."""
    _start()
    measured = [_start() for _ in range(starts)]
    return Start(*map(median, zip(*measured)))


def peak(count):
    """Give the most memory that a process with so many particles takes [bytes]."""
    with _python(MEMORY, str(count)) as process:
        return 1024 * int(process.stdout.read())


def bytes_a_particle(few, many):
    """Give the memory that each particle more takes, at most, with contacts [bytes]."""
    return (peak(many) - peak(few)) / (many - few)
