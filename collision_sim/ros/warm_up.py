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

At the start a thread compiles the first steps, and as soon as that turns out to take long, a
process that runs this module compiles the rest on another core. While the steps of another variant
go on, all is left to the process. It hands over by Numba's cache on disk: in a process Numba
compiles one thing at a time, and whoever looks up a kernel waits for it.
"""

from concurrent.futures import Future
import os
import pickle
import sys
import threading
import time

from collision_sim.core.pose_table import prepare
from collision_sim.kinematics import Kinematics
from collision_sim.processes import start
from collision_sim.simulation import Simulation
from numba.core import event

NAME = 'warm_up'        # of the threads
LONG = 1.0              # s; to load takes a quarter of it, to compile many times as long


def variant(scene):
    """Return what of a scene decides which kernels take its steps; compares and hashes."""
    method = scene.stepping.method
    return method == 'exact', method == 'second_order_contact', scene.stepping.detection


class WarmUp:
    """
    Compiles the kernels of a scene in a thread of its own, or loads them.

    Those that record contacts are others than those that do not; what is needed first comes first.

    Parameters
    ----------
    scene : Scene
        A simulation of its own is stepped, nobody else's.
    ledger : bool
        Whether accounts of energy are kept.
    contacts : bool
        Which are needed first.
    beside : bool
        Whether steps go on meanwhile, which compiling in this process would slow down.

    Attributes
    ----------
    first : bool
        Which are needed first.
    seconds : dict of concurrent.futures.Future of float [s]
        By whether contacts are recorded: duration of a step, once its kernels are ready; or what
        was raised.
    compiles : bool
        Whether anything had to be compiled so far, here or in the process.

    """

    def __init__(self, scene, ledger, contacts, beside=False):
        """Start the thread."""
        self.first, self.compiles = contacts, False
        self.seconds = {contacts: Future(), not contacts: Future()}
        work = _work_beside if beside else _work
        threading.Thread(target=work, args=(self, scene, ledger), name=NAME, daemon=True).start()

    @property
    def ready(self):
        """Whether those that are needed first are there, or cannot be."""
        return self.seconds[self.first].done()

    @property
    def seconds_a_step(self):
        """Duration of a step with those that are needed first [s]; raises what was raised."""
        return self.seconds[self.first].result()

    @property
    def done(self):
        """Whether nothing more will come."""
        return all(future.done() for future in self.seconds.values())

    @property
    def failure(self):
        """What was raised, an exception; None as a rule."""
        failures = [each.exception() for each in self.seconds.values() if each.done()]
        return next(filter(None, failures), None)

    def fulfil(self, contacts, work):
        """Do some work for those kernels, noting whether it compiles anything."""
        try:
            with event.install_listener('numba:compile', _Notice(self._note)):
                self.seconds[contacts].set_result(work())
        except BaseException as error:
            self.seconds[contacts].set_exception(error)

    def _note(self):
        self.compiles = True


class _Notice(event.Listener):
    """Calls something whenever this thread begins to compile."""

    def __init__(self, call):
        self._call, self._thread = call, threading.get_ident()

    def on_start(self, event):
        """Call it."""
        if threading.get_ident() == self._thread:
            self._call()

    def on_end(self, event):
        """Do nothing."""


class _HasToCompileError(Exception):
    """What is asked for is not in Numba's cache."""


def at_work():
    """Whether a thread is still compiling."""
    return any(thread.name == NAME for thread in threading.enumerate())


def _work(warm_up, scene, ledger):
    """Fulfil the futures of a WarmUp, helped by a process for the second."""
    first, second = warm_up.seconds
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

    warm_up.fulfil(first, begin)
    warm_up.fulfil(second, go_on)
    for helper in helpers:
        helper.communicate()


def _work_beside(warm_up, scene, ledger):
    """Fulfil the futures of a WarmUp by what a process compiles, unless all is there already."""
    for contacts in warm_up.seconds:
        warm_up.fulfil(contacts, lambda contacts=contacts: _load(warm_up, scene, ledger, contacts))


def _load(warm_up, scene, ledger, contacts):
    """Take steps with kernels from the cache, where another process has put them if need be."""
    def refuse():
        raise _HasToCompileError

    try:
        with event.install_listener('numba:compile', _Notice(refuse)):
            return _step(scene, ledger, contacts)
    except _HasToCompileError:
        warm_up.compiles = True
    helper = start_helper(scene, ledger, contacts)
    for _ in ('poses', 'steps'):
        _wait_for([helper])
    helper.communicate()
    return _step(scene, ledger, contacts)


def _step(scene, ledger, contacts):
    """Take steps; give the duration of one [s]."""
    simulation = Simulation(scene, contacts, ledger=ledger)
    simulation.step()
    simulation.clearance()
    start = time.perf_counter()
    simulation.step()
    return time.perf_counter() - start


def _play_poses(scene):
    """Do what poses need that come from topics: play a stream, and move a collider."""
    names = [collider.name for collider in scene.colliders if collider.topic is not None]
    if names:
        prepare()
        colliders = Kinematics(scene)
        position, orientation = colliders.pose(names[0])
        colliders.move(names[:1], [position], [orientation], None, 1.0)


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
