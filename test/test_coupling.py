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

"""Springs and pairs with what else a scene has: every kind of kernel is compiled and stepped."""

import numpy as np
import pytest
from small_scenes import plane, simulate

BASE = {'name': 'base', 'shape': 'mesh', 'vertices': [[-9, -9, -1], [9, -9, -1], [9, 9, -1],
                                                      [-9, 9, -1], [-9, -9, 0], [9, -9, 0],
                                                      [9, 9, 0], [-9, 9, 0]],
        'faces': [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6],
                  [3, 0, 4, 7]]}
LIFT = {'linear_velocity': [0, 0, 0.25]}
PAIRS = {'restitution': 0.0}
SPRING = {'pairs': [[0, 1]], 'stiffness': 100.0, 'rest_length': 0.2}


@pytest.mark.jit
@pytest.mark.parametrize('sections, collider, keys', [
    ({'pairs': PAIRS}, BASE, {}),
    ({'pairs': PAIRS}, {**BASE, 'motion': LIFT}, {'stepping': {'detection': 'trajectory'},
                                                  'ledger': True}),
    ({'springs': SPRING}, BASE, {'stepping': {'detection': 'trajectory'}}),
    ({'springs': {**SPRING, 'solver': 'implicit'}}, {**BASE, 'motion': LIFT}, {'ledger': True}),
    ({'springs': SPRING, 'pairs': PAIRS}, BASE, {'contacts': False, 'threads': 2}),
    ({'springs': {**SPRING, 'solver': 'implicit'}, 'pairs': PAIRS}, plane(motion=LIFT),
     {'stepping': {'detection': 'trajectory'}, 'method': 'multi_pass'})],
    ids=['pairs', 'pairs, sweeps, moving', 'springs, sweeps', 'implicit, moving', 'both',
         'both on a moving plane'])
def test_balls_come_to_rest_on_any_collider(sections, collider, keys):
    """Two balls fall, meet the surface and each other, and end on it, beside each other."""
    sim = simulate([collider], [[0, 0, 0.11], [0.2, 0, 0.13]], dt=1 / 120,
                   particles={'radius': 0.1}, **sections, **keys)
    sim.step(60)
    floor = sim.time * 0.25 if 'motion' in collider else 0.0
    assert np.allclose(sim.position[:, 2], floor + 0.1, atol=1e-3)
    least = 0.2 - 1e-6 if 'pairs' in sections else 0.1
    assert abs(sim.position[1, 0] - sim.position[0, 0]) > least
