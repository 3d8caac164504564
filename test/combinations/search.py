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
The search: case after case is drawn and examined, and what fails is kept, shrunk, as YAML.

Case number n of a seed is the same on every machine. Each is examined with all checks of the run
itself, and with some of those that play it again in another way.
"""

from collections import Counter
from dataclasses import dataclass, field
import time

from cases import method, stepping
from checks import examine, OF_OTHER_RUNS, OF_THE_RUN, RUNS
import numpy as np
from scenes import draw
from shrink import shrink
import yaml

OTHERS = 3              # other runs of a case
SHRUNK = 2              # failures of a check that are shrunk; of the others the case is named
SHRINKING = 8.0         # s of the process for each
SHARE = 0.25            # of the time that all of them together may take


@dataclass
class Found:
    """
    A failure: number of the case, name of the check, what it says, and the case, shrunk.

    after [s]: time of the process until then.
    """

    seed: list
    check: str
    problem: str
    case: dict
    after: float


@dataclass
class Search:
    """
    What a search has done so far.

    Attributes
    ----------
    scenes, refused : int
        Cases drawn, and those that the reader of scenes did not accept.
    applied, failed : Counter
        By the name of the check.
    found : list of Found
        Failures that were shrunk.

    """

    scenes: int = 0
    refused: int = 0
    applied: Counter = field(default_factory=Counter)
    failed: Counter = field(default_factory=Counter)
    found: list = field(default_factory=list)


def search(seed, seconds, numbers, names=None, tell=None, shrinks=SHRUNK, stop=None,
           without=None):
    """
    Examine cases until the time is over.

    Parameters
    ----------
    seed : int
        Of all cases.
    seconds : float
        How long.
    numbers : iterator of int
        Of the cases of that seed.
    names : list of str or None
        The checks; None: those of the run itself, and some of the others.
    tell : callable or None
        Called with the Search after each case, and with a Found where there is one.
    shrinks : int
        Failures of a check that are shrunk, and told; 0: all are told as they are.
    stop : callable or None
        Says of a Search whether it is to end.
    without : str or None
        Scenes with that section are left out.

    Returns
    -------
    Search

    """
    done, start, busy, shrinking = Search(), time.monotonic(), time.process_time(), 0.0
    for number in numbers:
        if time.monotonic() - start > seconds or stop and stop(done):
            break
        case, key = draw([seed, number]), [seed, number]
        if without in case['scene']:
            continue
        chosen = [name for name in names or chosen_names(key) if name != RUNS]
        problems = examine(case, key, chosen)
        done.scenes += 1
        if problems is None:
            done.refused += 1
            continue
        done.applied.update(chosen)
        for name, problem in problems.items():
            done.failed[name] += 1
            small, said = case, problem
            if 0 < shrinks < done.failed[name]:
                continue
            if shrinks:
                begun = time.process_time()
                left = max(seconds - (time.monotonic() - start), 1.0)
                most = SHRINKING + SHARE * (begun - busy) - shrinking
                small, said = shrink(case, name, key, max(min(SHRINKING, left, most), 1.0))
                shrinking += time.process_time() - begun
            done.found.append(Found(key, name, said or problem, small, time.process_time() - busy))
            if tell:
                tell(done, done.found[-1])
        if tell:
            tell(done, None)
    return done


def chosen_names(key):
    """Give the names of the checks for a case: all of the run itself, and some others."""
    random = np.random.default_rng([*key, 1])
    others = random.choice(len(OF_OTHER_RUNS), OTHERS, replace=False)
    return [check.__name__ for check in OF_THE_RUN] + [
        OF_OTHER_RUNS[k].__name__ for k in others]


def text(found):
    """Give a failure as YAML that `python -m test.combinations --replay` reads."""
    head = {'check': found.check, 'seed': found.seed, 'problem': found.problem}
    return yaml.dump({**head, **found.case}, sort_keys=False, default_flow_style=None, width=99,
                     Dumper=_Dumper)


def kind(found):
    """Give what tells failures apart in a list: check, method and detection, and features."""
    scene = found.case['scene']
    shapes = '+'.join(sorted({collider['shape'] for collider in scene.get('colliders', ())}))
    features = [key for key in ('pairs', 'springs', 'drag', 'friction') if key in scene]
    return (f'{found.check}: {method(found.case)} '
            f'{stepping(found.case, "detection", "end_of_step")} {shapes} {" ".join(features)}')


class _Dumper(yaml.SafeDumper):
    """Writes no anchors."""

    def ignore_aliases(self, data):
        """Write everything out."""
        return True
