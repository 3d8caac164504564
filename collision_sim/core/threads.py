# Copyright 2026 collision_sim developers
#
# Licensed under the Apache License, Version 2.0
# SPDX-License-Identifier: Apache-2.0
"""
Threads that share the blocks of one step; the kernels release the interpreter lock.

Plain threads instead of Numba's parallel loops: these abort the process when two threads of a
program step at once, and their kernels take twice as long to compile.
"""

import os
from queue import SimpleQueue
from threading import Thread

_jobs = SimpleQueue()
_workers = []


def share(function, count, *args):
    """
    Call function(k, count, *args) for k = 0 … count - 1, each on a thread of its own.

    Parameters
    ----------
    function : callable
        Releases the interpreter lock while it works.
    count : int
        Number of threads; this thread is the first.

    """
    while len(_workers) < count - 1:
        _workers.append(Thread(target=_work, name='collision_sim', daemon=True))
        _workers[-1].start()
    results = SimpleQueue()
    for k in range(1, count):
        _jobs.put((results, function, (k, count, *args)))
    try:
        function(0, count, *args)
    finally:
        errors = [error for error in (results.get() for _ in range(1, count)) if error]
    if errors:
        raise errors[0]


def _work():
    while True:
        results, function, args = _jobs.get()
        try:
            function(*args)
            results.put(None)
        except BaseException as error:  # handed to the thread that waits for this share
            results.put(error)
        del results, function, args     # arrays are not kept alive until the next job


def _forget_workers():
    """After a fork the child has none of the threads of its parent."""
    global _jobs
    _jobs = SimpleQueue()
    _workers.clear()


os.register_at_fork(after_in_child=_forget_workers)
