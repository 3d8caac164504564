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
All checks by name, and how a case is examined.

A check is a function of a case, its run and random numbers; its docstring says what is promised.
It gives None where that holds or does not apply, else what is wrong.
"""

from contextlib import contextmanager
import signal

import accounts
import bounds
from cases import method, play
from collision_sim import SceneError
import limits
import neutral
import numpy as np
import symmetries
import untouched

OF_THE_RUN = bounds.CHECKS + accounts.CHECKS + (symmetries.own_mirror_image,)
OF_OTHER_RUNS = untouched.CHECKS + symmetries.CHECKS + neutral.CHECKS + limits.CHECKS
CHECKS = {check.__name__: check for check in OF_THE_RUN + OF_OTHER_RUNS}
RUNS = 'runs'       # the check that a scene which is accepted runs
LONGEST = 60.0      # s of the process for a case, or one check of it; 0.05 s as a rule
LONGEST_EXACT = 3.0     # s; see `_longest`


class TooLong(Exception):
    """A case takes hundreds of times as long as others."""


@contextmanager
def limit(seconds):
    """Raise TooLong after so many seconds of this process, whatever else the machine does."""
    def stop(*_):
        raise TooLong(f'more than {seconds:g} s')

    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def examine(case, seed, names):
    """
    Examine a case.

    Parameters
    ----------
    case : dict
        As in cases.py.
    seed : int or sequence of int
        Of what the checks draw.
    names : iterable of str
        Keys of CHECKS.

    Returns
    -------
    dict of str
        What is wrong, by the name of the check; None where the scene is not accepted, or takes
        too long to say.

    """
    found = {}
    try:
        with np.errstate(all='ignore'):
            with limit(_longest(case, RUNS)):
                run = play(case)
            for name in names:
                problem = _problem(case, run, seed, name)
                if problem:
                    found[name] = problem
    except SceneError:
        return None
    except TooLong as error:
        if _longest(case, RUNS) < LONGEST:
            return None
        found[RUNS] = said(error)
    except Exception as error:
        found[RUNS] = said(error)
    return found


def _longest(case, name):
    """
    Give the time [s] for a case or for one of its checks.

    Plates that close with restitution 1 are hit ever faster: `exact` gives up after 100 000
    events, for which plain Python takes minutes. So where it plays, to take too long is no fault.
    """
    return LONGEST_EXACT if method(case) == 'exact' or name == 'meets_exact' else LONGEST


def _problem(case, run, seed, name):
    """Ask a check, whose exceptions are problems; a changed scene need not be accepted."""
    try:
        with limit(_longest(case, name)):
            return CHECKS[name](case, run, np.random.default_rng(seed))
    except SceneError:
        return None
    except TooLong:
        if _longest(case, name) < LONGEST:
            return None
        raise
    except Exception as error:
        return said(error)


def said(error):
    """Give an exception in a line, with the place where it was raised."""
    trace = error.__traceback__
    while trace.tb_next:
        trace = trace.tb_next
    code = trace.tb_frame.f_code
    file = code.co_filename.rpartition('/')[2]
    return f'{type(error).__name__}: {error} ({file}, {code.co_name}, line {trace.tb_lineno})'
