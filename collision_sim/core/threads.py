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
Threads that share the pieces of a step; the kernels release the interpreter lock.

Plain threads instead of Numba's parallel loops: these abort the process when two threads of a
program step at once, and their kernels take twice as long to compile. Threads claim work from an
atomic counter inside the kernel, so that one that starts late or shares its core with another
program holds nobody up. Waking a thread takes about 50 us; who waits therefore first watches a
counter for a while, offering its core to others, before it goes to sleep. `share` is for a job of
its own; a Crew is for one that comes again and again: its helpers stay in compiled code between
jobs, where they need not wait for the interpreter lock.
"""

from functools import partial
import os
from queue import SimpleQueue
from threading import Thread
import time
import traceback

from collision_sim.core.interrupts import held
from collision_sim.core.jit import bound, entry, inlined
from numba import config, types
from numba.core import cgutils
from numba.core.imputils import impl_ret_untracked
from numba.extending import intrinsic
from numba.np.arrayobj import make_array
import numpy as np

LOOKS = 400             # looks at a counter before going to sleep, about half a microsecond each
NAP = 5e-5              # s
CLAIMED, ENTERED, LEFT, FAILED, SHARED = range(5)   # columns of the counters of a shared job
# Entries of the jobs of a crew: the next ticket and the pieces done, in cache lines of their own;
# number of pieces, and two numbers that say what is to be done.
TICKET, DONE, PIECES, FIRST, SECOND, CREW = 0, 8, 16, 17, 18, 24
NO_PIECE = -1
# Bits of a ticket: below END how many pieces are claimed at the start of a job, from there on how
# many at its end, and from SERIAL on which job it is.
END, SERIAL, JOBS = 24, 48, (1 << 15) - 1
AT_START, AT_END, COUNT = 1, 1 << END, (1 << END) - 1
CLOSED = 1 << (END - 1)     # more than there are pieces: none to claim

_sched_yield = types.ExternalFunction('sched_yield', types.int32())
_posted = np.zeros(1, dtype=np.int64)               # changes when there is work
_jobs = SimpleQueue()
_helpers = []
_generation = 0         # of processes: a child has no helpers yet


if config.DISABLE_JIT:
    def fetch_add(array, index, amount):
        """Add to an entry of an array and give its value before; there is one thread then."""
        array[index] += amount
        return array[index] - amount

    def exchange(array, index, value):
        """Set an entry of an array and give its value before; there is one thread then."""
        before, array[index] = array[index], value
        return before
else:
    def _atomic(operation):
        """Give the code generator of an atomic operation on an entry of an array."""
        def generate(context, builder, signature, arguments):
            entries = make_array(signature.args[0])(context, builder, arguments[0])
            place = cgutils.get_item_pointer(context, builder, signature.args[0], entries,
                                             [arguments[1]], wraparound=False)
            before = builder.atomic_rmw(operation, place, arguments[2], 'seq_cst')
            return impl_ret_untracked(context, builder, signature.return_type, before)
        return generate

    @intrinsic
    def fetch_add(typing_context, array, index, amount):
        """Add to an entry of an int64 array and give its value before, atomically."""
        return types.int64(array, types.intp, types.int64), _atomic('add')

    @intrinsic
    def exchange(typing_context, array, index, value):
        """Set an entry of an int64 array and give its value before, atomically."""
        return types.int64(array, types.intp, types.int64), _atomic('xchg')


@entry
def _watch_for_work(posted, seen, looks):
    """Return when there may be work, or after a number of looks."""
    for _ in range(looks):
        if fetch_add(posted, 0, 0) != seen:
            return
        _sched_yield()


@entry
def _watch_the_last(counters, looks):
    """Whether all that have entered a job have left it, after at most a number of looks."""
    for _ in range(looks):
        if fetch_add(counters, LEFT, 0) == fetch_add(counters, ENTERED, 0):
            return True
        _sched_yield()
    return False


@entry
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
    _call_helpers(threads - 1)
    for _ in range(1, threads):
        _jobs.put((partial(_help_with, function), counters, args))
    try:
        function(_posted, counters, *args)
    except BaseException:           # it has not begun: an interrupt while it was compiled
        counters[FAILED] = 1
        raise
    while threads > 1 and not _watch_the_last(counters, LOOKS):
        if counters[FAILED]:
            raise RuntimeError('a helper thread failed; its traceback is above')
        time.sleep(NAP)


def _help_with(function, posted, counters, *args):
    """Take a share of a job once its caller has begun, if ever."""
    while not counters[ENTERED]:
        if counters[FAILED]:
            return
        time.sleep(NAP)
    function(posted, counters, *args)


def prepare(function, *args):
    """Compile what `share` will call with arguments of these types, if need be."""
    bound(function, _posted, np.zeros(SHARED, dtype=np.int64), *args)


def prepare_waiting():
    """Compile what threads wait for each other with, if need be."""
    bound(_watch_for_work, _posted, _posted[0], LOOKS)
    bound(_watch_the_last, np.zeros(SHARED, dtype=np.int64), LOOKS)


@inlined
def post(job, pieces, first, second):
    """Offer a job to a crew, whose last one is done: so many pieces, and what to do."""
    serial = ((job[TICKET] >> SERIAL) + 1) & JOBS
    exchange(job, TICKET, (job[TICKET] >> SERIAL << SERIAL) + CLOSED)
    job[PIECES], job[FIRST], job[SECOND], job[DONE] = pieces, first, second, 0
    exchange(job, TICKET, serial << SERIAL)


@inlined
def claim(job, side):
    """
    Take a piece of a job, which stays as it is until the piece is done.

    Parameters
    ----------
    job : (CREW,) int64
        Of a crew.
    side : int
        AT_START for who has posted it, AT_END for helpers: each finds the pieces of the job
        before again, which its cache may still hold.

    Returns
    -------
    serial, piece, left : int
        Number of the job; the piece, or NO_PIECE; how many are still to be claimed.

    """
    ticket = fetch_add(job, TICKET, side)
    before = ticket & COUNT
    left = job[PIECES] - before - ((ticket >> END) & COUNT) - 1
    piece = before if side == AT_START else before + left
    return ticket >> SERIAL, piece if left >= 0 else NO_PIECE, left


@inlined
def wait_for_job(job, serial, looks):
    """Whether there is a job with another serial number, after at most a number of looks."""
    for _ in range(looks):
        if fetch_add(job, TICKET, 0) >> SERIAL != serial:
            return True
        _sched_yield()
    return fetch_add(job, TICKET, 0) >> SERIAL != serial


@inlined
def wait_until_done(job, looks):
    """Whether all pieces of a job are done, after at most a number of looks."""
    for _ in range(looks):
        if fetch_add(job, DONE, 0) == job[PIECES]:
            return True
        _sched_yield()
    return fetch_add(job, DONE, 0) == job[PIECES]


class Crew:
    """
    Threads that do one job after the other of the same kind.

    Parameters
    ----------
    function : callable
        Takes (job, pieces, first, second, looks, *args) and releases the interpreter lock. With
        pieces it does post(job, pieces, first, second); then it does the pieces that it can
        claim, counts each in DONE, and goes on with the next job, if it does wait_for_job. Gives
        whether wait_until_done.
    *args
        Passed on.
    stays : bool
        Whether its helpers wait for the next job, which is worth while if that comes soon.

    """

    def __init__(self, function, *args, stays=True):
        """Nobody is recruited before there is a job."""
        self._patience = LOOKS if stays else 0
        self._job, self._args = np.zeros(CREW, dtype=np.int64), args
        self._function = bound(function, self._job, 0, 0, 0, 0, *args) if stays else function
        self._counters = np.zeros(SHARED, dtype=np.int64)
        self._recruited, self._generation = 0, _generation

    def prepare(self):
        """Compile the function, if need be."""
        bound(self._function, self._job, 0, 0, 0, 0, *self._args)

    def run(self, threads, pieces, first, second):
        """
        Do a job.

        Parameters
        ----------
        threads : int
            Most threads to work on it.
        pieces, first, second : int
            How many, and what to do.

        """
        helpers = (threads if threads < pieces else pieces) - 1
        if self._recruited < helpers or self._generation != _generation:
            self._recruit(helpers)
        if not self._function(self._job, pieces, first, second, LOOKS, *self._args):
            with held():                    # what helpers have begun is finished first
                self._wait(pieces)

    def _recruit(self, count):
        """See to it that so many helpers attend, none without the compiler or from a parent."""
        if self._generation != _generation:
            self._recruited, self._generation = 0, _generation
        while self._recruited < count and not config.DISABLE_JIT:
            self._recruited += 1
            _call_helpers(count)
            _jobs.put((self._attend, self._counters, ()))
            _posted[0] += 1

    def _wait(self, pieces):
        """Wait until the helpers are done, too."""
        while self._job[DONE] < pieces:
            if self._counters[FAILED]:
                raise RuntimeError('a helper thread failed; its traceback is above')
            time.sleep(NAP)

    def _attend(self, posted, counters):
        """Work on jobs until none has come for a while."""
        self._function(self._job, NO_PIECE, 0, 0, self._patience, *self._args)
        self._recruited -= 1


def _call_helpers(count):
    """See to it that there are so many helpers."""
    while len(_helpers) < count:
        _helpers.append(Thread(target=_help, name='collision_sim', daemon=True))
        _helpers[-1].start()


def _help():
    while True:
        if _jobs.empty():
            _watch_for_work(_posted, _posted[0], LOOKS)
        function, counters, args = _jobs.get()
        try:
            function(_posted, counters, *args)
        except BaseException:
            traceback.print_exc()
            counters[FAILED] = 1
        del function, counters, args    # arrays are not kept alive until the next job


def _forget_helpers():
    """After a fork the child has none of the threads of its parent."""
    global _jobs, _generation
    _jobs, _generation = SimpleQueue(), _generation + 1
    _helpers.clear()


os.register_at_fork(after_in_child=_forget_helpers)
