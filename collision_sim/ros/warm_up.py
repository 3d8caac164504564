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

"""Compiles what the steps of a scene need, beside whatever else goes on; no ROS."""

from concurrent.futures import Future
import threading
import time

from collision_sim.core.pose_table import prepare
from collision_sim.simulation import Simulation

NAME = 'warm_up'        # of the threads


def warm_up(scene, ledger):
    """
    Compile the kernels of a scene in a thread of its own, or load them.

    Parameters
    ----------
    scene : Scene
        A simulation of its own is stepped, nobody else's.
    ledger : bool
        Whether accounts of energy are kept.

    Returns
    -------
    seconds : concurrent.futures.Future of float [s]
        Duration of a step, once the kernels are ready; or what was raised.

    """
    seconds = Future()

    def work():
        try:
            seconds.set_result(_compile(scene, ledger))
        except BaseException as error:
            seconds.set_exception(error)

    threading.Thread(target=work, name=NAME, daemon=True).start()
    return seconds


def at_work():
    """Whether a thread is still compiling."""
    return any(thread.name == NAME for thread in threading.enumerate())


def _compile(scene, ledger):
    """Take steps with and without contacts, and play poses; give the duration of a step [s]."""
    simulation = Simulation(scene, ledger=ledger)
    for recording in (True, False):
        simulation.record_contacts = recording
        simulation.step()
    simulation.clearance()
    if any(collider.topic is not None for collider in scene.colliders):
        prepare()
    start = time.perf_counter()
    simulation.step()
    return time.perf_counter() - start
