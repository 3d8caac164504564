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

"""Pieces of a step on threads: each is done once, failures are seen, programs may fork."""

import os
from threading import current_thread, main_thread, Thread
from time import sleep

from collision_sim.core.threads import (AT_END, AT_START, claim, CLAIMED, CREW, Crew, DONE,
                                        ENTERED, fetch_add, FIRST, LEFT, NO_PIECE, post, SECOND,
                                        share, wait_for_job, wait_until_done)
from numba import njit
import numpy as np
import pytest


@njit(nogil=True)
def count_pieces(posted, counters, done, work):
    """Add 1 to each entry of `done` that this thread claims, after some work."""
    fetch_add(posted, 0, 1)
    fetch_add(counters, ENTERED, 1)
    piece = fetch_add(counters, CLAIMED, 1)
    while piece < done.shape[0]:
        for k in range(work.shape[0]):
            work[k] += 1.0 / (1.0 + piece)
        done[piece] += 1
        piece = fetch_add(counters, CLAIMED, 1)
    fetch_add(counters, LEFT, 1)


@njit(nogil=True)
def add_pieces(job, pieces, first, second, looks, done, work):
    """Add the two numbers of a job to each entry of `done` that this thread claims."""
    if pieces != NO_PIECE:
        post(job, pieces, first, second)
    serial, side = -1, AT_END if pieces == NO_PIECE else AT_START
    while wait_for_job(job, serial, looks if pieces == NO_PIECE else 0):
        serial, piece, _ = claim(job, side)
        while piece != NO_PIECE:
            for k in range(work.shape[0]):
                work[k] += 1.0 / (1.0 + piece)
            done[piece] += job[FIRST] + job[SECOND]
            fetch_add(job, DONE, 1)
            _, piece, _ = claim(job, side)
    return wait_until_done(job, looks)


@pytest.mark.parametrize('stays', [True, False])
@pytest.mark.parametrize('threads', [1, 2, 5])
@pytest.mark.parametrize('pieces', [0, 1, 3, 1000])
def test_a_crew_does_each_piece_of_each_job_once(threads, pieces, stays):
    """Job after job, whether its helpers have stayed or have gone meanwhile."""
    done = np.zeros(pieces, dtype=np.int64)
    crew = Crew(add_pieces, done, np.zeros(100), stays=stays)
    for job in range(50):
        crew.run(threads, pieces, job, 1)
        if job % 20 == 0:
            sleep(2e-3)
    assert done.tolist() == [sum(range(1, 51))] * pieces


@njit
def claim_serial(job):
    """Give the number of the job that a claim now is for."""
    return claim(job, AT_START)[0]


@njit
def claimed(job, pieces, sides):
    """Post a job of so many pieces, and claim one after the other from these sides."""
    post(job, pieces, 0, 0)
    return [claim(job, side)[1:] for side in sides]


def test_pieces_are_claimed_from_both_ends():
    """Each once, however the two meet; a finished job gives none, nor one that begins anew."""
    job = np.zeros(CREW, dtype=np.int64)
    sides = np.array([AT_START, AT_END, AT_END, AT_START, AT_END, AT_START, AT_END, AT_START])
    for serial in range(1, 4):
        found = claimed(job, 5, sides)
        assert found[:5] == [(0, 4), (4, 3), (3, 2), (1, 1), (2, 0)]
        assert all(piece == NO_PIECE and left < 0 for piece, left in found[5:])
        assert claim_serial(job) == serial


def test_two_crews_at_once():
    """Jobs of crews that work at the same time are not mixed up."""
    done = np.zeros((4, 200), dtype=np.int64)

    def work(mine):
        crew = Crew(add_pieces, mine, np.zeros(100))
        for job in range(50):
            crew.run(3, len(mine), job, 0)

    callers = [Thread(target=work, args=(row,)) for row in done]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join(30.0)
    assert (done == sum(range(50))).all()


@pytest.mark.jit
def test_a_failing_helper_of_a_crew_is_noticed(capfd):
    """Who called it is told; the traceback is printed."""
    def fail(job, pieces, first, second, looks):
        if current_thread() is not main_thread():
            raise ZeroDivisionError
        job[DONE] = 0
        return False

    with pytest.raises(RuntimeError, match='helper'):
        Crew(fail).run(2, 5, 0, 0)
    assert 'ZeroDivisionError' in capfd.readouterr().err


def collect(threads, pieces):
    """How often each piece was done."""
    done = np.zeros(pieces, dtype=np.int64)
    share(count_pieces, threads, done, np.zeros(100))
    return done.tolist()


@pytest.mark.parametrize('threads', [1, 2, 5])
@pytest.mark.parametrize('pieces', [0, 1, 3, 1000])
def test_each_piece_once(threads, pieces):
    """Whatever the number of threads."""
    for _ in range(20):
        assert collect(threads, pieces) == [1] * pieces


def test_adding_gives_the_value_before():
    """The counter from which threads claim their work."""
    counter = np.array([5, 7])
    assert (fetch_add_once(counter, 1, 3), counter.tolist()) == (7, [5, 10])


@njit
def fetch_add_once(array, index, amount):
    """Call it from compiled code, where it belongs."""
    return fetch_add(array, index, amount)


@pytest.mark.jit
def test_a_failing_helper_is_noticed(capfd):
    """The thread that shares the work does not wait for it for ever; later work is not harmed."""
    def fail(posted, counters):
        posted[0] += 1
        counters[ENTERED] += 1
        if current_thread() is not main_thread():
            raise ZeroDivisionError
        while counters[ENTERED] < 2:
            sleep(1e-3)
        counters[LEFT] += 1

    with pytest.raises(RuntimeError, match='helper'):
        share(fail, 2)
    assert 'ZeroDivisionError' in capfd.readouterr().err
    assert collect(2, 100) == [1] * 100


def test_two_programs_share_at_once():
    """Work of several threads at the same time is not mixed up."""
    results = []
    callers = [Thread(target=lambda: results.append(collect(3, 200))) for _ in range(4)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join(30.0)
    assert results == [[1] * 200] * 4


@pytest.mark.skipif(not hasattr(os, 'fork'), reason='needs fork')
@pytest.mark.filterwarnings('ignore:.*fork.*:DeprecationWarning')
def test_child_processes_have_threads_of_their_own():
    """After a fork the helpers of the parent are not there; the child starts its own."""
    collect(3, 20)
    child = os.fork()
    if child == 0:
        os._exit(0 if collect(3, 20) == [1] * 20 else 1)
    for _ in range(200):
        pid, status = os.waitpid(child, os.WNOHANG)
        if pid:
            break
        sleep(0.05)
    assert (pid, status) == (child, 0)
