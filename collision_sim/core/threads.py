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
Threads that share the blocks of a step; the kernels release the interpreter lock.

Plain threads instead of Numba's parallel loops: these abort the process when two threads of a
program step at once, and their kernels take twice as long to compile. Threads claim work from an
atomic counter inside the kernel, so that one that starts late or shares its core with another
program holds nobody up. Waking a thread takes about 50 us; who waits therefore first watches a
counter for a while, offering its core to others, before it goes to sleep.
"""

import os
from queue import SimpleQueue
from threading import Thread
import time
import traceback

from numba import config, njit, types
from numba.core import cgutils
from numba.core.imputils import impl_ret_untracked
from numba.extending import intrinsic
from numba.np.arrayobj import make_array
import numpy as np

LOOKS = 400             # looks at a counter before going to sleep, about half a microsecond each
NAP = 5e-5              # s
CLAIMED, ENTERED, LEFT, FAILED, SHARED = range(5)   # columns of the counters of a shared job

_sched_yield = types.ExternalFunction('sched_yield', types.int32())
_posted = np.zeros(1, dtype=np.int64)               # changes when there is work
_jobs = SimpleQueue()
_helpers = []


if config.DISABLE_JIT:
    def fetch_add(array, index, amount):
        """Add to an entry of an array and give its value before; there is one thread then."""
        array[index] += amount
        return array[index] - amount
else:
    @intrinsic
    def fetch_add(typing_context, array, index, amount):
        """Add to an entry of an int64 array and give its value before, atomically."""
        def generate(context, builder, signature, arguments):
            entries = make_array(signature.args[0])(context, builder, arguments[0])
            place = cgutils.get_item_pointer(context, builder, signature.args[0], entries,
                                             [arguments[1]], wraparound=False)
            before = builder.atomic_rmw('add', place, arguments[2], 'seq_cst')
            return impl_ret_untracked(context, builder, signature.return_type, before)
        return types.int64(array, types.intp, types.int64), generate


@njit(cache=True, nogil=True, error_model='numpy')
def _watch_for_work(posted, seen, looks):
    """Return when there may be work, or after a number of looks."""
    for _ in range(looks):
        if fetch_add(posted, 0, 0) != seen:
            return
        _sched_yield()


@njit(cache=True, nogil=True, error_model='numpy')
def _watch_the_last(counters, looks):
    """Whether all that have entered a job have left it, after at most a number of looks."""
    for _ in range(looks):
        if fetch_add(counters, LEFT, 0) == fetch_add(counters, ENTERED, 0):
            return True
        _sched_yield()
    return False


@njit(cache=True, nogil=True, error_model='numpy')
def finish(progress, phase, pieces):
    """
    Return when all pieces of a phase of a shared job are done.

    Whoever has claimed a piece is at work on it, so this ends with any number of threads.

    Parameters
    ----------
    progress : (2 * phases,) int64
        Of the job, at first 0: of each phase the pieces claimed, and those done.
    phase, pieces : int
        Which one, and how many pieces it has; the caller finds none to claim.

    """
    while fetch_add(progress, 2 * phase + 1, 0) < pieces:
        _sched_yield()


def share(function, threads, *args):
    """
    Call function(posted, counters, *args) on this thread and, at the same time, on helpers.

    Parameters
    ----------
    function : callable
        Releases the interpreter lock and then does: fetch_add(posted, 0, 1), which calls the
        helpers; fetch_add(counters, ENTERED, 1); its share of the work, which it claims with
        fetch_add(counters, CLAIMED, 1) piece by piece; fetch_add(counters, LEFT, 1).
    threads : int
        Most threads to work on it.
    *args
        Passed on.

    """
    counters = np.zeros(SHARED, dtype=np.int64)
    if config.DISABLE_JIT:
        threads = 1
    while len(_helpers) < threads - 1:
        _helpers.append(Thread(target=_help, name='collision_sim', daemon=True))
        _helpers[-1].start()
    for _ in range(1, threads):
        _jobs.put((function, counters, args))
    function(_posted, counters, *args)
    while threads > 1 and not _watch_the_last(counters, LOOKS):
        if counters[FAILED]:
            raise RuntimeError('a helper thread failed; its traceback is above')
        time.sleep(NAP)


def _help():
    while True:
        if _jobs.empty():
            _watch_for_work(_posted, _posted[0], LOOKS)
        function, counters, args = _jobs.get()
        try:
            function(_posted, counters, *args)
        except BaseException:
            counters[FAILED] = 1
            traceback.print_exc()
        del function, counters, args    # arrays are not kept alive until the next job


def _forget_helpers():
    """After a fork the child has none of the threads of its parent."""
    global _jobs
    _jobs = SimpleQueue()
    _helpers.clear()


os.register_at_fork(after_in_child=_forget_helpers)
