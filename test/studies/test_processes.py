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

"""Processes that do the runs of a sweep: one that dies takes nothing else with it."""

import os
from pathlib import Path
import signal
import time

from collision_sim.studies.processes import ATTEMPTS, Pool


def square(number):
    """Square a number; runs in a process of the pool."""
    return number * number, os.getpid()


def die(mark, deaths):
    """Die so many times, then say how often that was."""
    deaths_before = len(mark.read_text())
    if deaths_before < deaths:
        mark.write_text('x' * (deaths_before + 1))
        os.kill(os.getpid(), signal.SIGKILL)
    return deaths_before


def tell_and_sleep(path):
    """Write the number of the process to a file and stay for long."""
    Path(path).write_text(str(os.getpid()))
    time.sleep(600)


def test_calls_are_shared():
    """Each call ends once, in one of the processes; the pool can be used again."""
    with Pool(2) as pool:
        for _ in range(2):
            found = {key: result for key, result, reason in
                     pool.each(square, ((k, (k,)) for k in range(20)))}
            assert {key: number for key, (number, _) in found.items()} == {
                k: k * k for k in range(20)}
    assert 1 <= len({process for _, process in found.values()}) <= 2
    assert list(Pool(0).each(square, [])) == []


def test_a_process_that_dies(tmp_path):
    """Its call is done again, at most ATTEMPTS times; the other calls do not notice."""
    marks = [tmp_path / name for name in ('once', 'always')]
    for mark in marks:
        mark.write_text('')
    with Pool(2) as pool:
        found = {key: (result, reason) for key, result, reason in pool.each(
            die, [('once', (marks[0], 1)), ('always', (marks[1], 99)),
                  *((k, (marks[0], 0)) for k in range(6))])}
    assert found.pop('once') == (1, '')
    result, reason = found.pop('always')
    assert result is None
    assert reason == f'the process died (Killed) in each of {ATTEMPTS} attempts'
    assert len(marks[1].read_text()) == ATTEMPTS
    assert len(found) == 6 and all(reason == '' for _, reason in found.values())


def test_leaving_ends_what_runs(tmp_path):
    """An error or Ctrl-C while processes work: they are gone at once."""
    path = tmp_path / 'process'
    try:
        with Pool(1) as pool:
            worker = pool._idle[0]
            worker.call(tell_and_sleep, path)
            while not path.exists() or not path.read_text():
                time.sleep(0.01)
            raise KeyboardInterrupt
    except KeyboardInterrupt:
        pass
    assert not Path('/proc', path.read_text()).exists()
