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

"""The works as collision_sim does them."""

from dataclasses import replace

from collision_sim.simulation import Simulation
from collision_sim.studies.bench_works import BLOCK, block_moves, is_near_torus, WORKS
import numpy as np

LOOKS = 24              # times in a run at which particles near the torus are counted


class Own:
    """
    All works, step by step with the contacts of each step, or `fused` in one call.

    As `moved` the box of work 1 does not follow its script: each step is told where it ends.

    Parameters
    ----------
    job : job.Job
        What to do.

    """

    precision = 'f64'

    def __init__(self, job):
        self.job, self.threads, scene = job, job.threads, job.scene
        if job.variant == 'moved':
            still = [replace(collider, motion=None) for collider in scene.colliders]
            scene = replace(scene, colliders=tuple(still))
            self._moves = block_moves(WORKS[job.work].steps)
        self.sim = Simulation(scene, contacts=True, threads=job.threads)
        self.begin = self.sim.reset

    def run(self, steps):
        """Take the steps."""
        if self.job.variant == 'fused':
            self.sim.step(steps)
        elif self.job.variant == 'moved':
            for position, orientation in self._moves[:steps]:
                self.sim.move_collider(BLOCK['name'], position, orientation)
                self.sim.step()
        else:
            for _ in range(steps):
                self.sim.step()

    def state(self):
        """Give positions and velocities."""
        return self.sim.position, self.sim.velocity

    def figures(self):
        """Give contacts (of pairs, where there are) and particles near the torus, a step."""
        steps = WORKS[self.job.work].steps
        found = {'contacts': self._contacts() / (steps * self.job.count)}
        if self.job.work == '3':
            found['near'] = self._near(steps)
        return found

    def _contacts(self):
        kinds = ('pair_collisions', 'pair_contacts') if self.job.work == '2' else \
            ('collisions', 'contacts')
        return sum(self.sim.counters[kind] for kind in kinds)

    def _near(self, steps):
        self.begin()
        shares = []
        for _ in range(LOOKS):
            self.sim.step(steps // LOOKS)
            shares.append(is_near_torus(self.sim.position).mean())
        return float(np.mean(shares))


runner = Own
