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
Checks 5: as dt goes to 0, fixed steps meet `exact`, and both detections meet each other.

Only where the answer is steady: a nudge of the start is not amplified much. What is left is the
error of first order of each hit, which is the way of a step, amplified.
"""

from cases import acts, changed, method, play
import numpy as np
from symmetries import lengths, NUDGE, nudges

FINE, COARSE = 64, 16       # steps
STEADY = 30.0               # most that a nudge is amplified
MARGIN = 4.0                # errors of a hit are of the size of a step's way, some are larger


def _in_steps(case, count, duration, **how):
    """Give a case of so many steps over a duration, with other stepping."""
    section = {**case['scene'].get('stepping', {}), 'dt': duration / count, **how}
    other = changed(case, stepping={key: value for key, value in section.items() if value})
    return {**other, 'calls': [{'step': count}], 'contacts': False, 'ledger': False}


def _is_plain(case):
    """Whether a case is a scene that runs by itself, with nobody inside."""
    return not (acts(case, 'move') or acts(case, 'place') or acts(case, 'set')
                or 'springs' in case['scene'])


def _amplified(case, run, random):
    """How much a nudge is amplified, at most, in two trials."""
    worst = 1.0
    for other in nudges(case, random, 2):
        worst = max(worst, *(np.abs(two.x - one.x).max(initial=0.0) / NUDGE
                             for one, two in zip(run, play(other))))
    return worst


def _far(one, other):
    return float(np.abs(one[-1].x - other[-1].x).max(initial=0.0))


def _step_way(run, count, duration):
    """Way of a fine step, times one more than the hits, at most 20 [m]."""
    speed = max(lengths(step)[1] + np.abs(step.v).max(initial=0.0) for step in run)
    hits = sum(step.counters['collisions'] + step.counters['pair_collisions'] for step in run)
    return (1 + min(hits, 20)) * speed * duration / count


def _duration(run):
    return min(0.2, len(run) * run[0].scene.stepping.dt)


def _starts_inside(run):
    return bool((run[0].gaps[:, 0] < -1e-12).any())


def meets_exact(case, run, random):
    """See that fixed steps meet the event-driven method, at first order at least."""
    scene = case['scene']
    if not run or not _is_plain(case) or 'pairs' in scene or method(case) == 'exact' or any(
            collider['shape'] == 'mesh' for collider in scene.get('colliders', ())) \
            or _starts_inside(run):
        return None
    duration = _duration(run)
    truth = _in_steps(case, 8, duration, method='exact', detection=None, flight=None)
    exact = play(truth)
    factor = _amplified(truth, exact, random)
    if factor > STEADY or any(any(step.counters[key] for key in (
            'unplaced', 'undecided', 'frozen', 'fail_safes')) for step in exact):
        return None
    fine = play(_in_steps(case, FINE, duration))
    bound = MARGIN * factor * _step_way(exact, FINE, duration)
    error = _far(fine, exact)
    if error <= bound or any(step.counters['unplaced'] for step in fine):
        return None
    coarse = _far(play(_in_steps(case, COARSE, duration)), exact)
    finer = _far(play(_in_steps(case, 4 * FINE, duration)), exact)
    if finer <= 0.5 * error and finer <= 0.5 * coarse:
        return None
    return (f'{error:.3g} m apart with {FINE} steps over {duration:.3g} s, {coarse:.3g} m with '
            f'{COARSE}, {finer:.3g} m with {4 * FINE}: at most {bound:.3g} m')


def detections_meet(case, run, random):
    """Impacts on the path, and who is inside when a step ends: the same for short steps."""
    if not run or not _is_plain(case) or method(case) == 'exact' or _starts_inside(run):
        return None
    duration = _duration(run)
    cases = [_in_steps(case, FINE, duration, detection=name)
             for name in ('end_of_step', 'trajectory')]
    one, two = (play(other) for other in cases)
    bound = MARGIN * _step_way(two, FINE, duration)
    thin = min((entry for collider in one[0].scene.colliders for entry in collider.size if entry),
               default=np.inf)
    error = _far(one, two)
    if error <= bound or bound > thin or any(any(step.counters[key] for key in (
            'unplaced', 'undecided', 'frozen', 'fail_safes')) for step in one + two):
        return None
    factor = max(_amplified(other, track, random) for other, track in zip(cases, (one, two)))
    if factor > STEADY or error <= factor * bound:
        return None
    return f'{error:.3g} m apart with {FINE} steps over {duration:.3g} s: at most {bound:.3g} m'


CHECKS = (meets_exact, detections_meet)
