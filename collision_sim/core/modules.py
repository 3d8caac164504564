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
Parts of the core that only some scenes need, each compiled by itself, once on a machine.

What every scene runs calls them by address (jit.by_address), so it is compiled without them: a
scene with a mesh compiles what is about meshes, and nothing again. A module is opened by
opening.py before the first step that needs it, which writes the addresses of its kernels to the
array of `no_modules`. Whether a module is called is decided by a value: the shape of a collider,
a flag of rules.Rules.
"""

import numpy as np

# Rows of the modules.
(MESH_DISTANCE, MESH_DEPTH, MESH_END, MESH_GAP, MESH_WAY, MESH_HIT, MESHES_ON_WAY,
 MESH_BOXES, SURVEY_PATH, MEETING_ON_PATH, BLOCKER, NORMAL_BETWEEN, TO_SURFACE,
 TO_BOTH_SURFACES, BOOK_PASS, BOOK_TWO) = range(16)
MODULES = 16


def no_modules():
    """Return room for the addresses of all modules, with none of them opened."""
    return np.zeros((MODULES, 2), dtype=np.int64)
