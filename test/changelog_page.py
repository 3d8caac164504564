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
The page of the change log, made from CHANGELOG.rst, which has the form that ROS releases read.

Run as `python -m test.changelog_page`; it writes collision_sim/docs/changelog.md.
"""

from pathlib import Path
import re

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / 'collision_sim' / 'docs' / 'changelog.md'


def changelog_page():
    """Return the change log as Markdown."""
    text = (ROOT / 'CHANGELOG.rst').read_text().split('\n', 3)[3]
    text = re.sub(r'^(\S.*)\n-+$', r'## \1\n', text, flags=re.MULTILINE)
    return '# Changelog\n' + text.replace('``', '`')


if __name__ == '__main__':
    PAGE.write_text(changelog_page())
