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
How the commands hear SIGINT (Ctrl-C) and SIGTERM: at any time, and to the end.

A KeyboardInterrupt that is raised where nobody passes it on, as in a callback of a library or
while an object is deleted, is lost. Here it is raised again until it has got through.
"""

from itertools import count
import os
import signal
import sys
from threading import current_thread, get_ident, main_thread, Thread
import time

from collision_sim.core.interrupts import is_held, STOP

KILLED = 128            # exit code of what a signal has ended, less the number of the signal
AGAIN = 0.2             # s; until it is looked whether an interrupt has got through
PATIENCE = 4            # times AGAIN until a process is ended that is in a library all the time
_listeners = []         # the one that listens, of the command that is being done


def heard():
    """
    Say that a command has heard, and ends in order: signals do nothing from now on.

    Returns
    -------
    code : int
        Its exit code.

    """
    return _listeners[-1].hush() if _listeners else KILLED + signal.SIGINT


class Listener:
    """
    Raises KeyboardInterrupt in the `with` block for a signal that ends a command.

    Outside the main thread, where no signals are handled, it does nothing.

    Parameters
    ----------
    last : bool
        Whether the process ends after the block: signals do nothing then.

    Attributes
    ----------
    number : int or None
        The first signal that came.
    heard : bool
        Whether the command has heard it, or signals do nothing any more.

    """

    def __init__(self, last):
        self.number, self.heard, self._last = None, False, last

    def __enter__(self):
        self._works = current_thread() is main_thread()
        if self._works:
            self._begin()
        return self

    def __exit__(self, *_):
        self.hush()
        if self._works:
            self._end()

    def _begin(self):
        self._main = get_ident()
        self._before = {one: signal.signal(one, self._hear) for one in STOP}
        self._unraisable, sys.unraisablehook = sys.unraisablehook, self._pass_over
        self._out, self._in = os.pipe()
        os.set_blocking(self._in, False)
        self._wakeup = signal.set_wakeup_fd(self._in, warn_on_full_buffer=False)
        Thread(target=self._insist, name='collision_sim signals', daemon=True).start()
        _listeners.append(self)

    def _end(self):
        _listeners.remove(self)
        signal.set_wakeup_fd(self._wakeup)
        os.close(self._in)
        sys.unraisablehook = self._unraisable
        for one, handler in self._before.items():
            signal.signal(one, signal.SIG_IGN if self._last else handler)

    def hush(self):
        """Raise nothing any more; the exit code."""
        self.heard = True
        return KILLED + (self.number or signal.SIGINT)

    def _hear(self, number, frame):
        """Raise KeyboardInterrupt, unless one is on its way already."""
        self.number = self.number or number
        if not (self.heard or _is_on_its_way(sys.exception())):
            raise KeyboardInterrupt

    def _pass_over(self, unraisable):
        """Say nothing of an interrupt that was raised where it gets lost: it comes again."""
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            self._unraisable(unraisable)

    def _insist(self):
        """Wait for a signal, and send it again until the command has heard."""
        with open(self._out, 'rb', buffering=0) as arrived:
            while number := arrived.read(1):
                if number[0] in STOP:
                    self._send_again(number[0])

    def _send_again(self, number):
        for attempt in count(1):
            time.sleep(AGAIN)
            if self.heard:
                return
            if attempt >= PATIENCE and self.number is None and self._last and not is_held():
                print('collision_sim: interrupted', file=sys.stderr, flush=True)
                os._exit(KILLED + number)
            signal.pthread_kill(self._main, number)


def _is_on_its_way(error):
    """Whether an error that is being handled, None for none, came of an interrupt."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__context__
    return error is not None
