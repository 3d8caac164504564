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

from collision_sim.core.candidates import make_candidates
from collision_sim.core.ledger import NO_LEDGER
from collision_sim.core.motion import subdivide
from collision_sim.core.reference import refer
from collision_sim.core.rules import CHECKS, N_COLLISION, N_LOGGED, N_ROWS, N_STEP
from collision_sim.core.springs import elastic_energy
from collision_sim.core.stepping import step_blocks
from collision_sim.core.strikes import strike_blocks
from collision_sim.core.threads import Crew, share
from collision_sim.core.world import refer_world
from collision_sim.pair_solver import PairSolver
from collision_sim.spring_solvers import ExplicitSprings, ImplicitSprings

FEW = 3                 # blocks; for fewer a second thread costs more than it brings


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
        self._candidates = make_candidates(len(scene.particles.position))
        self._referred = refer(self._candidates)
        self._solver = self._world = None
        self._pairs = PairSolver(scene) if scene.pairs else None
        self._substeps_done = 0
        self.adopt(scene)

    def __getstate__(self):
        """Give what a copy goes on from; threads are not taken along."""
        return {**vars(self), '_crew': None, '_world': None}

    def adopt(self, scene):
        """Take a scene whose values may differ from those of the scene before."""
        self.parts, self._springs, self._prepared = 1, scene.springs, False
        if scene.springs:
            self.parts = scene.springs.substeps(scene.particles, scene.stepping.dt)
            solver = ImplicitSprings if scene.springs.solver == 'implicit' else ExplicitSprings
            self._solver = solver(scene)

    def step(self, world, row, threads):
        """
        Take the particles through a step that is laid out, or, where that is interrupted, not.

        Parameters
        ----------
        world : world.World
            With the poses of all steps.
        row : int
            Row of the poses at its start.
        threads : int
            Most threads to use.

        """
        before = self._what_changes(world)
        kept = [table.copy() for table in before]
        try:
            for poses, motion in self._substeps(world.poses, world.motion, row):
                self._substep(world._replace(poses=poses, motion=motion,
                                             candidates=self._referred), threads)
        except BaseException:
            for table, old in zip(before, kept):
                table[:] = old
            raise

    def _what_changes(self, world):
        """
        Give what an interrupted step may have changed.

        Interrupts come while something is compiled, and before the first substep changes places
        and velocities all that it needs has been.
        """
        changing = [world.accounts, world.notes]
        if len(world.ledger.rows):
            changing.append(world.ledger.rows)
        if self.parts > 1:
            changing += [world.x, world.v]
        return changing

    def _substeps(self, poses, motion, row):
        """Poses (2, C, 12) and motion (1, C, MOTION) of each substep."""
        if len(poses) == 1:
            yield from [(poses, motion)] * self.parts
            return
        cut, turns = subdivide(poses[row:row + 2], motion[row:row + 1], self.parts)
        yield from ((cut[k:k + 2], turns[k:k + 1]) for k in range(self.parts))

    def _substep(self, world, threads):
        """Take one substep: candidates by springs and pairs, and then the colliders."""
        crew = self._crew_for(world)
        self._substeps_done += 1
        rows = world.log.shape[1] // world.block
        world.accounts[:, [N_LOGGED, N_ROWS, N_STEP]] = 0, rows, self._substeps_done
        if self._solver:
            self._stretch(world, threads)
        if self._pairs:
            self._pairs.step(world, self._candidates, not self._solver, threads)
        crew.run(threads if len(world.accounts) > FEW else 1, len(world.accounts), 1, 0)

    def _crew_for(self, world):
        """Give the crew of a substep; that of the last one, where it works on the same world."""
        if self._world is None or any(a is not b for a, b in zip(world, self._world)):
            crew = Crew(step_blocks, refer_world(world), stays=False)
            if not self._prepared:      # before anything changes
                crew.prepare()
                self._prepared = True
            self._crew, self._world = crew, world
        return self._crew

    def _strike(self, world, threads):
        """Take the collision stage against colliders; whether anybody has collided."""
        before = world.accounts[:, N_COLLISION].sum()
        share(strike_blocks, threads if len(world.accounts) > FEW else 1, refer_world(world))
        return world.accounts[:, N_COLLISION].sum() > before

    def elastic_energy(self, x):
        """Energy in the springs [J], for places (3, N) [m]."""
        return elastic_energy(self._springs.pairs, self._springs.laws, x.T)

    def adopt_rules(self, scene, rules):
        """Take the scene of a substep, and its rules."""
        if self._pairs:
            self._pairs.adopt(scene, rules)

    def reset(self):
        """Forget what the last step has left for the next one."""
        if self._pairs:
            self._pairs.forget()

    def _stretch(self, world, threads):
        """Lay out candidates with springs, from the velocities after the collision stage."""
        flight, x, v = world.rules.flight, world.x, world.v
        going, done = CHECKS if world.rules.checks and len(world.table) else 0, False
        booked = len(world.ledger.rows) > 0
        silent = world.ledger._replace(rows=NO_LEDGER.rows) if booked else world.ledger
        while going and not done:
            self._solver.step(flight, silent, x, v, self._candidates, threads)
            going, done = going - 1, not self._strike(world, threads)
        if booked or not done:
            self._solver.step(flight, world.ledger, x, v, self._candidates, threads)
