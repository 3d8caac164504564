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
Compiles what the steps of a scene need, beside whatever else goes on; no ROS.

A thread compiles the first steps. As soon as that turns out to take long, a process that runs this
module compiles the rest on another core, and hands it over by Numba's cache on disk: in a process
Numba compiles one thing at a time, and whoever looks up a kernel waits for it.
"""

from concurrent.futures import Future
import os
import pickle
import sys
import threading
import time

from collision_sim.core.pose_table import prepare
from collision_sim.processes import start
from collision_sim.simulation import Simulation

NAME = 'warm_up'        # of the threads
LONG = 1.0              # s; to load takes a quarter of it, to compile many times as long


def warm_up(scene, ledger, contacts):
    """
    Compile the kernels of a scene in a thread of its own, or load them.

    Those that record contacts are others than those that do not; what is needed first comes first.

    Parameters
    ----------
    scene : Scene
        A simulation of its own is stepped, nobody else's.
    ledger : bool
        Whether accounts of energy are kept.
    contacts : bool
        Which are needed first.

    Returns
    -------
    seconds : dict of concurrent.futures.Future of float [s]
        By whether contacts are recorded: duration of a step, once its kernels are ready; or what
        was raised.

    """
    seconds = {contacts: Future(), not contacts: Future()}
    threading.Thread(target=_work, args=(scene, ledger, seconds), name=NAME, daemon=True).start()
    return seconds


def at_work():
    """Whether a thread is still compiling."""
    return any(thread.name == NAME for thread in threading.enumerate())


def _work(scene, ledger, seconds):
    """Fulfil the futures of warm_up."""
    first, second = seconds
    helpers = []
    call = threading.Timer(LONG, lambda: helpers.append(start_helper(scene, ledger, second)))
    call.start()

    def begin():
        try:
            duration = _step(scene, ledger, first)
        finally:
            call.cancel()
            call.join()
        _wait_for(helpers)
        _play_poses(scene)
        return duration

    def go_on():
        _wait_for(helpers)
        return _step(scene, ledger, second)

    for contacts, work in ((first, begin), (second, go_on)):
        try:
            seconds[contacts].set_result(work())
        except BaseException as error:
            seconds[contacts].set_exception(error)
    for helper in helpers:
        helper.communicate()


def _step(scene, ledger, contacts):
    """Take steps; give the duration of one [s]."""
    simulation = Simulation(scene, contacts, ledger=ledger)
    simulation.step()
    simulation.clearance()
    start = time.perf_counter()
    simulation.step()
    return time.perf_counter() - start


def _play_poses(scene):
    if any(collider.topic is not None for collider in scene.colliders):
        prepare()


def start_helper(scene, ledger, contacts):
    """Start a process that plays poses, then takes steps; it writes a line after each of them."""
    # Its standard input stays open as long as this process lives.
    return start('collision_sim.ros.warm_up', (scene, ledger, contacts))


def _wait_for(helpers):
    """Wait until each has done one thing more; one that has ended is not waited for."""
    for helper in helpers:
        helper.stdout.readline()


def _help():
    """Do what start_helper says, or end with who has started this."""
    scene, ledger, contacts = pickle.load(sys.stdin.buffer)
    threading.Thread(target=_end_with_starter, daemon=True).start()
    _play_poses(scene)
    print('poses', flush=True)
    _step(scene, ledger, contacts)
    print('steps', flush=True)
    os._exit(0)                         # without the thread, which reads


def _end_with_starter():
    sys.stdin.buffer.read()
    os._exit(0)


if __name__ == '__main__':
    _help()
