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
Compile the kernels of a refinement before it measures, on all cores.

Modules of the core take seconds to compile. Processes do that side by side, each running this
module; they hand the result over by Numba's cache on disk.
"""

import os
import pickle
import sys
from threading import Thread

from collision_sim.checks import SceneError
from collision_sim.processes import start
from collision_sim.scene import Scene
from collision_sim.simulation import Simulation
from tqdm import tqdm

OWN_MODULES = ('exact', 'second_order_contact')     # methods that have some


def kernel(case, setting):
    """Return what the modules that a run needs depend on; values of the scene are not in it."""
    colliders = case.scene.get('colliders') or []
    return (any(collider['shape'] == 'mesh' for collider in colliders),
            any('motion' in collider or 'topic' in collider for collider in colliders),
            'pairs' in case.scene, 'springs' in case.scene,
            setting.method if setting.method in OWN_MODULES else None, setting.detection)


def refusal(scene, setting):
    """
    Take a step, which compiles.

    Parameters
    ----------
    scene : dict
        As in a file.
    setting : errors.Setting
        How to step.

    Returns
    -------
    reason : str
        Why that way to step does not apply to the scene, '' if it does.

    """
    stepping = {**(scene.get('stepping') or {}), **setting._asdict()}
    try:
        found = Scene.from_dict({**scene, 'stepping': stepping})
        Simulation(found, contacts=False, threads=1).step()
    except SceneError as error:
        return str(error)
    return ''


def compile_kernels(ways):
    """
    Compile the kernels of some ways to step, with a progress bar.

    Parameters
    ----------
    ways : list of (case.Case, errors.Setting)
        What will be measured.

    """
    kernels = {kernel(case, setting): (case.scene, setting) for case, setting in ways}
    jobs = sorted(kernels.values(), key=lambda job: job[1].method != 'exact')   # takes longest
    count = min(os.cpu_count() or 1, len(jobs))
    workers = []
    try:
        for k in range(count if count > 1 else 0):
            workers.append(start('collision_sim.studies.warming', jobs[k::count]))
        with tqdm(total=len(jobs), desc='compiling', disable=None, leave=False) as bar:
            for worker in workers:
                for _ in worker.stdout:         # a line for each
                    bar.update()
    finally:
        for worker in workers:
            worker.kill()
            worker.wait()
            worker.stdin.close()
            worker.stdout.close()


def _end_with_starter():
    """End when who has started this process ends, and with it the standard input."""
    sys.stdin.buffer.read()
    os._exit(1)


def _work():
    """Compile the kernels that the standard input says; a line for each."""
    jobs = pickle.load(sys.stdin.buffer)
    Thread(target=_end_with_starter, daemon=True).start()
    for job in jobs:
        refusal(*job)
        print('done', flush=True)
    os._exit(0)                         # without the thread, which reads


if __name__ == '__main__':
    _work()
