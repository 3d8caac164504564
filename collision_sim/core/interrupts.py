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
Interrupts: signals wait where nothing may come in between, and only there.

Python calls the handlers of signals in its main thread, between any two steps of the interpreter:
one that raises KeyboardInterrupt ends a step of the simulation in its middle. So who changes a
state says `hold`, and `release` when the state is whole again. What takes long meanwhile and
changes nothing, to compile, is done `aside`, by a thread of its own: there no handler is called
and nothing swallows what it raises, and the main thread, which waits, hears at once.
"""

from _signal import getsignal      # that of `signal` makes enumerations of them, for 10 us
import atexit
from contextlib import contextmanager
import os
import signal
import sys
import threading
from threading import get_ident

STOP = int(signal.SIGINT), int(signal.SIGTERM)
_main = threading.main_thread().ident
_before = {}            # handlers by signal, which `_receive` stands in for
_came = []              # signals that wait
_depth = 0              # of the holds of the main thread
_open = False           # whether it waits for something that is done aside
_aside = []             # threads


def _receive(number, frame):
    """Handle a signal, or let it wait."""
    if _depth and not _open:
        _came.append(number)
    else:
        _came.clear()
        _before[number](number, frame)


def hold():
    """Let signals wait until as many calls of `release` as of this; in the main thread only."""
    global _depth
    if get_ident() == _main:
        for number in STOP:
            handler = getsignal(number)
            if handler is not _receive and callable(handler):
                _before[number] = handler
                signal.signal(number, _receive)
        _depth += 1         # the last thing: until here something may be raised


def release():
    """Handle the first of the signals that have come since `hold`, if there is one."""
    global _depth
    if get_ident() == _main:
        _depth -= 1
        if _came and not _depth:
            _receive(_came[0], sys._getframe())


@contextmanager
def held():
    """Let signals wait for the end of the block."""
    hold()
    try:
        yield
    finally:
        release()


def is_held():
    """Whether signals wait at present."""
    return _depth > 0


def let_in():
    """Handle a signal that waits for nothing but the next `release`: the state is whole."""
    global _open
    if _came and _depth == 1 and get_ident() == _main:
        try:
            _open = True
            _receive(_came[0], sys._getframe())
        finally:
            _open = False


def aside(function, *args):
    """
    Call a function that changes nothing beside the main thread, which hears signals meanwhile.

    Parameters
    ----------
    function, *args
        What to call. Where a handler raises something, the call goes on to its end nevertheless.

    Returns
    -------
    object
        What the function gives.

    """
    global _open
    if get_ident() != _main:
        return function(*args)
    outcome, done = [], threading.Lock()
    done.acquire()

    def work():
        try:
            outcome.append((function(*args), None))
        except BaseException as error:
            outcome.append((None, error))
        finally:
            done.release()

    _aside[:] = [thread for thread in _aside if thread.is_alive()]
    _aside.append(threading.Thread(target=work, name='collision_sim aside', daemon=True))
    _aside[-1].start()
    try:
        _open = True
        if _came:
            _receive(_came[0], sys._getframe())
        done.acquire()
    finally:
        _open = False
    result, error = outcome.pop()
    if error is not None:
        raise error
    return result


def leave_what_is_aside(code):
    """End the process here, with an exit code, if something is still done aside."""
    if any(thread.is_alive() for thread in _aside):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


@atexit.register
def _end():
    """See to it that the interpreter does not end under what is done aside: it would crash."""
    for thread in _aside:
        if thread.is_alive() and getattr(sys, 'last_type', None) is KeyboardInterrupt:
            sys.stdout.flush()
            signal.signal(signal.SIGINT, signal.SIG_DFL)    # as Python ends after Ctrl-C
            os.kill(os.getpid(), signal.SIGINT)
        thread.join()


def _begin_in_child():
    """After a fork there is one thread, which holds nothing."""
    global _main, _depth, _open
    _main, _depth, _open = get_ident(), 0, False
    _came.clear()
    _aside.clear()


os.register_at_fork(after_in_child=_begin_in_child)
