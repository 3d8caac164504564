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

from collision_sim.core.candidates import Candidates
from collision_sim.core.rules import CHECKS
from collision_sim.pair_solver import PairSolver
from collision_sim.spring_solvers import ExplicitSprings, ImplicitSprings
import numpy as np


class Coupling:
    """
    Candidates of the particles of a scene with springs or pairs.

    Parameters
    ----------
    scene : Scene
        With springs, pairs or both.

    Attributes
    ----------
    parts : int
        Substeps in a step: each is a whole step, collisions included, of that part of dt.

    """

    def __init__(self, scene):
        shape = 3, len(scene.particles.position)
        self._candidates = Candidates(np.empty(shape), np.empty(shape))
        self._solver = None
        self._pairs = PairSolver(scene) if scene.pairs else None
        self.adopt(scene)

    def adopt(self, scene):
        """Take a scene whose values may differ from those of the scene before."""
        self.parts = 1
        if scene.springs:
            self.parts = scene.springs.substeps(scene.particles, scene.stepping.dt)
            solver = ImplicitSprings if scene.springs.solver == 'implicit' else ExplicitSprings
            self._solver = solver(scene)

    def step(self, parts, threads, strike=None):
        """
        Lay out the candidates of the next step.

        Parameters
        ----------
        parts : plan.Parts
            Of the step; the ledger is written, and v where somebody collides.
        threads : int
            Most threads to use.
        strike : callable or None
            The collision stage against colliders, for springs: strike(candidates) writes v and
            says whether anybody has collided. None for methods without such a stage.

        Returns
        -------
        candidates.Candidates

        """
        if self._solver:
            self._stretch(parts.rules.flight, parts.ledger, parts.x, parts.v, threads, strike)
        if self._pairs:
            self._pairs.step(parts, self._candidates, None if self._solver else 1, threads)
        return self._candidates

    def adopt_rules(self, scene, rules):
        """Take the scene of a substep, and its rules."""
        if self._pairs:
            self._pairs.adopt(scene, rules)

    def reset(self):
        """Forget what the last step has left for the next one."""
        if self._pairs:
            self._pairs.forget()

    def _stretch(self, flight, ledger, x, v, threads, strike):
        """Lay out candidates with springs, from the velocities after the collision stage."""
        going, done = CHECKS if strike else 0, False
        while going and not done:
            self._solver.step(flight, None, x, v, self._candidates, threads)
            going, done = going - 1, not strike(self._candidates)
        if ledger or not done:
            self._solver.step(flight, ledger, x, v, self._candidates, threads)
