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
Threads that share the work of one step; the kernels release the interpreter lock.

Plain threads instead of Numba's parallel loops: these abort the process when two threads of a
program step at once, and their kernels take twice as long to compile. The work comes in more parts
than threads, and each thread takes the next part when it is done with one: a thread that wakes
late or shares its core with another program delays a step by a part, not by half of it. Waking a
thread takes about 50 us; who waits therefore first watches a counter for a while, offering its core
to others, before it goes to sleep.
"""

import os
from queue import SimpleQueue
from threading import Thread

from numba import config, njit, types
import numpy as np

LOOKS = 500             # looks at a counter before going to sleep, about half a microsecond each

_sched_yield = types.ExternalFunction('sched_yield', types.int32())
_helping = SimpleQueue()
_helpers = []
_posted = np.zeros(1, dtype=np.int64)   # jobs so far


@njit(cache=True, nogil=True)
def _watch(counter, seen, looks):
    """Return when a counter is no longer what was seen, or after a number of looks."""
    for _ in range(looks):
        if counter[0] != seen:
            return
        _sched_yield()


if config.DISABLE_JIT:
    def _watch(counter, seen, looks):   # noqa: F811
        """Go to sleep at once: plain Python would keep the interpreter lock while it looks."""


def share(function, threads, parts, *args):
    """
    Call function(k, parts, *args) for k = 0 … parts - 1 on this thread and on helpers.

    Parameters
    ----------
    function : callable
        Releases the interpreter lock while it works.
    threads : int
        Most threads to work on it.
    parts : int
        Calls to make.
    *args
        Passed on.

    """
    threads = min(threads, parts)
    while len(_helpers) < threads - 1:
        _helpers.append(Thread(target=_help, name='collision_sim', daemon=True))
        _helpers[-1].start()
    done, finished = SimpleQueue(), np.zeros(1, dtype=np.int64)
    work = (iter(range(parts)), function, parts, args)
    for _ in range(1, threads):
        _helping.put((work, done, finished))
    _posted[0] += 1
    errors = [_work(*work)]
    for k in range(1, threads):
        _watch(finished, k - 1, LOOKS)
        errors.append(done.get())
    for error in filter(None, errors):
        raise error


def _work(left, function, parts, args):
    """Do parts until none is left; the error that ended that, if there was one."""
    try:
        for k in left:
            function(k, parts, *args)
    except BaseException as error:  # raised by the thread that waits for all
        return error
    return None


def _help():
    while True:
        seen = _posted[0]
        if _helping.empty():
            _watch(_posted, seen, LOOKS)
        work, done, finished = _helping.get()
        done.put(_work(*work))
        finished[0] += 1
        del work, done, finished        # arrays are not kept alive until the next job


def _forget_helpers():
    """After a fork the child has none of the threads of its parent."""
    global _helping
    _helping = SimpleQueue()
    _helpers.clear()


os.register_at_fork(after_in_child=_forget_helpers)
