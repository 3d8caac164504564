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
Compiles what the steps of a scene need, or loads it, beside whatever else goes on; no ROS.

That is done once: other values of the scene, and whether contacts are recorded, need no other
kernels.
"""

from concurrent.futures import Future
import threading

from collision_sim.preparing import prepare
from numba.core import event

NAME = 'warm_up'        # of the threads


class WarmUp:
    """
    Compiles the kernels of a scene in a thread of its own, or loads them.

    Parameters
    ----------
    scene : Scene
        A simulation of its own is stepped, nobody else's.
    ledger : bool
        Whether accounts of energy are kept.

    Attributes
    ----------
    compiles : bool
        Whether anything had to be compiled so far.

    """

    def __init__(self, scene, ledger):
        """Start the thread."""
        self.compiles, self._seconds = False, Future()
        threading.Thread(target=self._work, args=(scene, ledger), name=NAME, daemon=True).start()

    @property
    def done(self):
        """Whether nothing more will come."""
        return self._seconds.done()

    @property
    def seconds_a_step(self):
        """Duration of a step [s], waited for; raises what kept the kernels from being ready."""
        return self._seconds.result()

    @property
    def failure(self):
        """What was raised, an exception; None as a rule."""
        return self._seconds.exception() if self.done else None

    def _work(self, scene, ledger):
        """Prepare all, noting whether that compiles anything."""
        try:
            with event.install_listener('numba:compile', Notice(self._note)):
                seconds = prepare(scene, ledger)
            self._seconds.set_result(seconds)
        except BaseException as error:
            self._seconds.set_exception(error)

    def _note(self):
        self.compiles = True


class Notice(event.Listener):
    """Calls something whenever the thread that has made this begins to compile."""

    def __init__(self, call):
        self._call, self._thread = call, threading.get_ident()

    def on_start(self, event):
        """Call it."""
        if threading.get_ident() == self._thread:
            self._call()

    def on_end(self, event):
        """Do nothing."""


def at_work():
    """Whether a thread is still compiling."""
    return any(thread.name == NAME for thread in threading.enumerate())
