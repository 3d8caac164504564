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

"""Check 10 of ten, soak: the short form of `python -m collision_sim.ros.soak`."""

import subprocess
import sys

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from collision_sim.ros import diagnostics, soak  # noqa: E402, I100
import numpy as np  # noqa: E402


def test_soak(request):
    long = request.config.getoption('--long')
    arguments = [] if long else ['--minutes', '0.2', '--particles', '2000', '--steps', '100']
    done = subprocess.run([sys.executable, '-m', 'collision_sim.ros.soak', *arguments],
                          capture_output=True, text=True)
    print(done.stdout, done.stderr)
    assert done.returncode == 0 and 'FAIL' not in done.stdout
    assert 'ok    the same poses' in done.stdout and 'Traceback' not in done.stderr


def test_a_problem_is_counted_once():
    """Counters tell their sums each second, and start again at a reset."""
    told = [0, 1, 1, 3, 0, 0, 2, 1]
    assert sum(map(diagnostics.new_since, told, told[1:])) == 1 + 2 + 2 + 1


def test_what_grows_or_goes_wrong_is_told():
    class Seen:
        problems = {'not finite': 1, 'unplaced': 0}
        step_times = [1.0] * 700 + [2.0] * 700

    growing = 100.0 + 0.01 * np.arange(1400)
    found = dict(soak.verdicts(Seen, growing, ['a', 'b']))
    assert [fine for _, fine in sorted(found.items())].count(True) == 1
    Seen.problems, Seen.step_times = {'not finite': 0}, [1.0] * 1400
    found = soak.verdicts(Seen, growing - 0.01 * np.arange(1400), ['a', 'a'])
    assert all(fine for _, fine in found) and len(found) == 4
