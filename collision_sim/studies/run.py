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

"""`collision_sim run`: run a scene and say what happened."""

import argparse
import csv
import math
import os
from time import perf_counter

from collision_sim.particles import read_shard
from collision_sim.scene import load_scene, shipped_scenes
from collision_sim.simulation import Simulation
import numpy as np
from tqdm import tqdm

PARTS = 200             # of a run: how often the progress bar moves, and Ctrl-C is heard
COLUMNS = ('x', 'y', 'z', 'vx', 'vy', 'vz')
FORMATS = ('.npz', '.csv')
INTERRUPTED = 130


def seconds(text):
    """Read a duration of the command line [s]."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f'{text!r} is not a positive number of seconds')
    return value


def state_file(text):
    """Read the name of the file for the final state."""
    if os.path.splitext(text)[1] not in FORMATS:
        raise argparse.ArgumentTypeError(f'{text!r} does not end in {" or ".join(FORMATS)}')
    if not os.path.isdir(os.path.dirname(text) or '.'):
        raise argparse.ArgumentTypeError(f'the folder of {text!r} does not exist')
    return text


def add_arguments(parser):
    """Declare the options."""
    parser.epilog = ('examples:\n  collision_sim run demo --duration 10\n'
                     '  collision_sim run my.yaml --out state.npz\n\n'
                     'shipped scenes: ' + ', '.join(shipped_scenes()))
    parser.add_argument('scene', help='a YAML file, or the name of a shipped scene')
    parser.add_argument('--duration', type=seconds, default=5.0, metavar='S',
                        help='simulated time in s (default 5)')
    parser.add_argument('--shard', default='1/1', metavar='K/N',
                        help='only the K-th of N slices of the particles (default 1/1, all)')
    parser.add_argument('--out', type=state_file, metavar='FILE',
                        help='.npz or .csv for positions and velocities at the end')


def go(sim, duration):
    """Step with a progress bar; whether that was not interrupted, and the run time [s]."""
    total = round(duration / sim.dt) if sim.dt > 0.0 else 0
    part, began = max(total // PARTS, 1), perf_counter()
    try:
        with tqdm(total=total, unit='step', leave=False, disable=None) as bar:
            for done in range(0, total, part):
                steps = min(part, total - done)
                sim.step(steps)
                bar.update(steps)
        complete = True
    except KeyboardInterrupt:
        complete = False
    return complete, perf_counter() - began


def save(path, sim):
    """Write positions and velocities."""
    if path.endswith('.npz'):
        np.savez(path, position=sim.position, velocity=sim.velocity, time=sim.time)
        return
    with open(path, 'w', newline='') as file:
        writer = csv.writer(file, lineterminator='\n')
        writer.writerow(COLUMNS)
        writer.writerows(np.hstack([sim.position, sim.velocity]).tolist())


def outcome(sim, before, spent):
    """Give lines about a run: time, speed, energy and counters."""
    steps = round(sim.time / sim.dt) if sim.dt > 0.0 else 0
    each = spent / max(steps * len(sim.position), 1)
    yield f'particles         {len(sim.position)}'
    yield f'simulated time    {sim.time:.6g} s in {steps} steps of {sim.dt:g} s'
    yield f'run time          {spent:.3g} s, {1e9 * each:.3g} ns per particle and step'
    yield f'real-time factor  {sim.time / spent if spent else 0.0:.4g}'
    yield f'energy            {sim.energy():.9g} J, {sim.energy() - before:+.3g} J since the start'
    for name, count in sim.counters.items():
        yield f'{name:17s} {count}'


def run(arguments):
    """Run a scene; the exit code."""
    scene = load_scene(arguments.scene).shard(*read_shard(arguments.shard))
    Simulation(scene, contacts=False).step(1)       # compiles
    sim = Simulation(scene, contacts=False)
    before = sim.energy()
    complete, spent = go(sim, arguments.duration)
    print('\n'.join(outcome(sim, before, spent)))
    if arguments.out:
        save(arguments.out, sim)
    return 0 if complete else INTERRUPTED
