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

"""Failures that were kept, as YAML, and how they are examined again."""

from checks import examine
import yaml


def load(path):
    """Give the case of a file, the name of its check and the seed of what that draws."""
    case = yaml.safe_load(path.read_text())
    return case, case.pop('check'), case.pop('seed')


def replay(case, check, seed):
    """Examine a case with a check; what is wrong, None where all holds."""
    case.pop('problem', None)
    found = examine(case, seed, [] if check == 'runs' else [check])
    if found is None:
        return 'the scene is not accepted'
    return next(iter(found.values()), None)
