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

"""Parts of a step on threads: each is done once, errors are raised, programs may fork."""

import os
from threading import current_thread, Lock, Thread
from time import sleep

from collision_sim.core.threads import share
import pytest


def collect(threads, parts):
    """Numbers of the parts that were done, and the threads that did them."""
    done, names, lock = [], set(), Lock()

    def work(k, count, *args):
        assert (count, args) == (parts, ('a', 2))
        sleep(1e-3)
        with lock:
            done.append(k)
            names.add(current_thread().name)

    share(work, threads, parts, 'a', 2)
    return done, names


@pytest.mark.parametrize('threads', [1, 2, 5])
@pytest.mark.parametrize('parts', [0, 1, 3, 64])
def test_each_part_once(threads, parts):
    """Whatever the number of threads, and in no stated order."""
    done, _ = collect(threads, parts)
    assert sorted(done) == list(range(parts))


def test_one_thread_is_this_one():
    """Nothing is handed on where one thread is asked for."""
    _, names = collect(1, 8)
    assert names == {current_thread().name}


@pytest.mark.parametrize('threads', [1, 2, 4])
def test_errors_are_raised(threads):
    """By the thread that shares the work; the next work is not harmed."""
    def fail(k, parts):
        sleep(1e-3)
        if k == 3:
            raise ZeroDivisionError(k)

    with pytest.raises(ZeroDivisionError, match='3'):
        share(fail, threads, 8)
    assert sorted(collect(threads, 9)[0]) == list(range(9))


def test_two_programs_share_at_once():
    """Work of several threads at the same time is not mixed up."""
    results = []
    callers = [Thread(target=lambda: results.append(sorted(collect(3, 20)[0]))) for _ in range(4)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join(30.0)
    assert results == [list(range(20))] * 4


@pytest.mark.skipif(not hasattr(os, 'fork'), reason='needs fork')
@pytest.mark.filterwarnings('ignore:.*fork.*:DeprecationWarning')
def test_child_processes_have_threads_of_their_own():
    """After a fork the helpers of the parent are not there; the child starts its own."""
    collect(3, 20)
    child = os.fork()
    if child == 0:
        done, _ = collect(3, 20)
        os._exit(0 if sorted(done) == list(range(20)) else 1)
    for _ in range(200):
        pid, status = os.waitpid(child, os.WNOHANG)
        if pid:
            break
        sleep(0.05)
    assert (pid, status) == (child, 0)
