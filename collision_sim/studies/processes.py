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
Runs of a sweep on the cores of this machine, in processes of their own.

A process that dies (out of memory, say) takes down its own run only, which is done again.
"""

from collections import deque
from contextlib import suppress
import multiprocessing
from multiprocessing import resource_tracker
from multiprocessing.connection import wait
import os
import signal
from threading import Thread

from collision_sim.core.interrupts import held

CONTEXT = multiprocessing.get_context('spawn')
ATTEMPTS = 3            # at a run whose process dies


class Worker:
    """A process that calls functions, one at a time; it does not hear Ctrl-C."""

    def __init__(self):
        self.pipe, far = CONTEXT.Pipe()
        self._process = CONTEXT.Process(target=_serve, args=(far,), daemon=True)
        resource_tracker.ensure_running()       # `start` would do so, and let SIGINT in after it
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})   # inherited
        try:
            self._process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        far.close()

    def call(self, function, *args):
        """Begin a call; `pipe` has its result when it is done, or its end when the process is."""
        with suppress(OSError):         # where it has died, the pipe says so
            self.pipe.send((function, args))

    def end(self):
        """End the process, whatever it is doing; its exit code, negative for a signal."""
        self._process.kill()
        self._process.join()
        self.pipe.close()
        return self._process.exitcode


def _serve(pipe):
    """Call what comes through a pipe until it or the process at its other end is closed."""
    Thread(target=_end_with_parent, daemon=True).start()
    with suppress(EOFError):
        while True:
            function, args = pipe.recv()
            pipe.send(function(*args))


def _end_with_parent():
    multiprocessing.parent_process().join()
    os._exit(1)


class Pool:
    """
    A few processes; leaving the `with` block ends them at once.

    Parameters
    ----------
    count : int
        How many.

    """

    def __init__(self, count):
        with held():            # one that is interrupted as it starts says so
            self._idle = [Worker() for _ in range(count)]
        self._busy = {}                 # by pipe: worker, call, which attempt at it

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for worker in self._idle + [worker for worker, *_ in self._busy.values()]:
            worker.end()

    def each(self, function, calls):
        """
        Call a function for each of some arguments.

        Parameters
        ----------
        function : callable
            At the top of a module; raises nothing.
        calls : iterable of (key, tuple)
            Arguments, fetched when there is a process for them.

        Yields
        ------
        key : object
            As in `calls`, as the calls end.
        result : object
            What the function gave, None where the process died ATTEMPTS times.
        reason : str
            How it died then, else ''.

        """
        calls, again = ((key, args, 1) for key, args in calls), deque()
        while True:
            while self._idle and (call := again.popleft() if again else next(calls, None)):
                worker = self._idle.pop()
                worker.call(function, *call[1])
                self._busy[worker.pipe] = worker, call
            if not self._busy:
                return
            for pipe in wait(list(self._busy)):
                worker, (key, args, attempt) = self._busy.pop(pipe)
                try:
                    result, reason = pipe.recv(), ''
                    self._idle.append(worker)
                except (EOFError, OSError):
                    result, reason = None, _death(worker.end(), attempt)
                    self._idle.append(Worker())
                if reason and attempt < ATTEMPTS:
                    again.append((key, args, attempt + 1))
                else:
                    yield key, result, reason


def _death(code, attempt):
    """Say how a process died."""
    how = signal.strsignal(-code) if code < 0 else f'exit code {code}'
    return f'the process died ({how}) in each of {attempt} attempts'
