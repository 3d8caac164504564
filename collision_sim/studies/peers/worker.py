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
A process that does one work with one toolkit and says how long it took.

`python -m collision_sim.studies.peers.worker MODULE VARIANT WORK COUNT THREADS FOLDER` answers in
lines of JSON: first how the state is after a run, or why there is none; then, to each line that it
reads, the run times [s] of some runs.
"""

from importlib import import_module
import json
import os
import sys
from time import perf_counter

from collision_sim.studies.bench_works import WORKS
from collision_sim.studies.peers.job import Job, Unable
import numpy as np

LEAST = 0.02            # s; of all runs of one answer together


def timed(runner, steps):
    """Give the run time of one run [s]."""
    runner.begin()
    began = perf_counter()
    runner.run(steps)
    return perf_counter() - began


def measure(runner, steps):
    """Give the run times of as many runs as it takes to measure them [s]."""
    times = [timed(runner, steps)]
    while sum(times) < LEAST:
        times.append(timed(runner, steps))
    return times


def outcome(runner):
    """Give means over the particles by which results of toolkits are compared."""
    position, velocity = (np.asarray(rows, dtype=np.float64) for rows in runner.state())
    return {'precision': runner.precision, 'threads': runner.threads,
            'height': float(position[:, 2].mean()), 'drift': float(velocity[:, 0].mean()),
            'energy': float(0.5 * np.square(velocity).sum(axis=1).mean()),
            **getattr(runner, 'figures', dict)()}


def serve(job, module, replies):
    """Answer requests until there are no more."""
    steps = WORKS[job.work].steps
    runner = import_module(f'collision_sim.studies.peers.{module}').runner(job)
    timed(runner, steps)
    print(json.dumps(outcome(runner)), file=replies, flush=True)
    for _ in sys.stdin:
        print(json.dumps(measure(runner, steps)), file=replies, flush=True)


def main(module, variant, work, count, threads, folder):
    """Do a work; what toolkits print goes to stderr."""
    replies = os.fdopen(os.dup(sys.stdout.fileno()), 'w')
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    try:
        scene = WORKS[work].scene(int(count), folder)
        serve(Job(work, scene, int(threads), variant), module, replies)
    except Unable as reason:
        print(json.dumps({'refused': str(reason)}), file=replies, flush=True)
    except Exception as error:      # whatever a toolkit of any version may raise
        reason = f'{type(error).__name__}: {error}'
        print(json.dumps({'refused': reason.splitlines()[0]}), file=replies, flush=True)
        raise


if __name__ == '__main__':
    main(*sys.argv[1:])
