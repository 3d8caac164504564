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
Springs and pairs of a simulation: what particles do to each other, once a step.

Only simulations that have some of them have a Coupling. The arithmetic is in core/springs.py and
core/pairs.py.
"""

from collision_sim.core.candidates import Candidates, fly_freely
from collision_sim.core.stepping import BLOCK
import numpy as np


class Coupling:
    """
    Candidates of the particles of a scene with springs or pairs.

    Parameters
    ----------
    scene : Scene
        With springs, pairs or both.

    """

    def __init__(self, scene):
        shape = 3, len(scene.particles.position)
        self._candidates = Candidates(np.empty(shape), np.empty(shape))

    def step(self, rules, ledger, x, v):
        """
        Lay out the candidates of the next step.

        Parameters
        ----------
        rules : rules.Rules
            What the step does.
        ledger : ledger.Ledger or None
            Written.
        x, v : (3, N) float64 [m], [m/s]
            State at the start of the step; v is written where pairs collide.

        Returns
        -------
        candidates.Candidates

        """
        fly_freely(rules.flight, v, ledger, BLOCK, self._candidates)
        return self._candidates
