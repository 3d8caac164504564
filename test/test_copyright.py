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

"""Every source file says whose it is and under which license."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCES = [ROOT / 'setup.py', *sorted((ROOT / 'collision_sim').rglob('*.py')),
           *sorted((ROOT / 'test').rglob('*.py'))]


@pytest.mark.copyright
@pytest.mark.linter
def test_header():
    header = (ROOT / 'setup.py').read_text().partition('"""')[0]
    assert header.startswith('# Copyright')
    assert 'Licensed under the Apache License, Version 2.0' in header
    assert [path for path in SOURCES if not path.read_text().startswith(header)] == []


@pytest.mark.copyright
@pytest.mark.linter
def test_copyright():
    ament_copyright = pytest.importorskip(
        'ament_copyright.main', reason='ament_copyright comes with an installed ROS only')
    # Not '.': at the top of a repository ament_copyright asks for a CONTRIBUTING.md as well.
    paths = [str(ROOT / name) for name in ('collision_sim', 'test', 'LICENSE')]
    assert ament_copyright.main(argv=paths) == 0, 'Found errors'
