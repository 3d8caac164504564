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

import accounts
import bounds
from cases import play
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


def examine(case, seed, names):
    """
    Examine a case.

    Parameters
    ----------
    case : dict
    seed : int or sequence of int
        Of what the checks draw.
    names : iterable of str
        Keys of CHECKS.

    Returns
    -------
    dict of str
        What is wrong, by the name of the check; None where the scene is not accepted.

    """
    found = {}
    with np.errstate(all='ignore'):
        try:
            run = play(case)
        except SceneError:
            return None
        except Exception as error:
            return {RUNS: said(error)}
        for name in names:
            try:
                problem = CHECKS[name](case, run, np.random.default_rng(seed))
            except SceneError:
                continue
            except Exception as error:
                problem = said(error)
            if problem:
                found[name] = problem
    return found


def said(error):
    """Give an exception in a line, with the place where it was raised."""
    trace = error.__traceback__
    while trace.tb_next:
        trace = trace.tb_next
    code = trace.tb_frame.f_code
    file = code.co_filename.rpartition('/')[2]
    return f'{type(error).__name__}: {error} ({file}, {code.co_name}, line {trace.tb_lineno})'
