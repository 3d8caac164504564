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

"""The style that ROS packages share; without an installed ROS, run plain flake8."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.flake8
@pytest.mark.linter
def test_flake8():
    ament_flake8 = pytest.importorskip(
        'ament_flake8.main', reason='ament_flake8 comes with an installed ROS only')
    paths = [str(ROOT / name) for name in ('collision_sim', 'test', 'setup.py')]
    status, errors = ament_flake8.main_with_errors(argv=paths)
    assert status == 0, '\n'.join([f'Found {len(errors)} errors', *errors])
