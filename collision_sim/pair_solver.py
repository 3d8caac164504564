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


"""Pairs of a simulation: the scratch of their kernels, and the order in which these are called."""

from dataclasses import replace

from collision_sim.core.around import make_moved
from collision_sim.core.bounces import find_bounces
from collision_sim.core.cells import LEVELS, make_cells, slots_in
from collision_sim.core.contact_solver import make_pile, make_work, MET
from collision_sim.core.flight import flight_coefficients
from collision_sim.core.jit import bound
from collision_sim.core.neighbours import (BOUNDS, find_near, LARGEST, lay_out_cells, Near, PHASES,
                                           PIECE, QUEUE)
from collision_sim.core.pair_collisions import collide_all
from collision_sim.core.pair_memory import Memory
from collision_sim.core.pair_walls import make_walls, refer_stage, Stage
from collision_sim.core.pairs import list_meetings, make_meetings, Matter, PairRules
from collision_sim.core.piles import AGAIN, part, settle
from collision_sim.core.rules import N_UNDECIDED, NONE
from collision_sim.core.stepping import BLOCK
from collision_sim.core.threads import prepare, share
from collision_sim.core.world import refer_world
from collision_sim.tables import collider_table, pair_row
import numpy as np

FEW = 4                 # blocks; for fewer a second thread costs more than it brings
SWEEPS = 4              # over the contacts for each of the scene's iterations
MOST_SUPPORTS = 4       # colliders that may carry a particle, on average of many
SPARE = 256             # more of them, for few
ROOMY = 2               # times the pairs that there is room for at least: a step finds more
MARGIN = 2.0 ** -20     # share of a radius that particles may be apart and count as near


class PairSolver:
    """
    Pairs of a scene, stepped as core/pairs.py and core/piles.py say.

    Parameters
    ----------
    scene : Scene
        With pairs.
    dt : float [s]
        Of a step, or of a substep.

    """

    def __init__(self, scene):
        count = len(scene.particles.position)
        self._matter = Matter(_each(scene.particles.radius, count),
                              1.0 / _each(scene.particles.mass, count))
        self._centre, self._extent = np.empty((3, count)), np.empty(count)
        self._bounds = np.empty((-(-count // BLOCK), BOUNDS))
        self._bounced = np.empty(count, dtype=np.int64)
        self._bounces = np.zeros((len(self._bounds), 2), dtype=np.int64)
        self._near = _room(-(-2 * count // PIECE), 2 * QUEUE)
        self._cells = self._singly = None
        self._meetings, self._walls = make_meetings(0, count), make_walls(0)
        self._pile = make_pile(0, 0, _nobody(count))
        self._memory = Memory(np.zeros(1, dtype=np.int64), np.empty((0, 2), dtype=np.int64),
                              np.empty((0, 3)), _nobody(0), _nobody(count))

    def adopt(self, scene, rules):
        """Take the values of a scene, and the rules of its steps."""
        radius, flight, self._compiled = self._matter.radius, rules.flight, False
        calm = replace(scene.drag, wind=(0.0, 0.0, 0.0)) if scene.drag else None
        pull, unit = (flight_coefficients(g, calm, flight.dt, scene.stepping.flight)
                      for g in (scene.gravity, (1.0, 0.0, 0.0)))
        slow = 2.0 * float(np.linalg.norm(pull.mean_shift))
        friction = scene.pairs.friction_in(scene)
        self._rules = PairRules(np.vstack([collider_table(scene), pair_row(scene)]),
                                friction.static is not None, friction.wet is not None, slow,
                                unit.mean_shift[0] / unit.end_shift[0] if flight.dt > 0.0 else 0.5,
                                pull.end_shift)
        self._dry, self._wet = rules.dry or self._rules.dry, rules.wet or self._rules.wet
        self._sweeps = SWEEPS * scene.stepping.iterations
        self._base = np.where(radius > 0.0, radius * (1.0 + MARGIN) + flight.dt * slow, 0.0)
        self._extent[:] = self._base
        self._bounds[:, LARGEST] = self._base.max(initial=0.0)
        self._many = rules.sweep or bool(np.any(self._base != self._base[:1]))

    def step(self, world, candidates, flies, threads):
        """
        Let pairs change the candidates of a step, and the velocities at its start.

        Parameters
        ----------
        world : world.World
            Of the step.
        candidates : candidates.Candidates
            Those that it refers to; changed.
        flies : bool
            Whether they are still to be laid out, as free flights.
        threads : int
            Most threads to use.

        """
        rules, count = world.rules, len(self._base)
        candidates.settled[:] = 0
        if count == 0:
            return
        threads = threads if count > FEW * BLOCK else 1
        base = self._base
        self._sort(world, candidates, flies, base, threads)
        pieces = -(-int(self._cells.start[slots_in(self._cells.levels)]) // PIECE)
        self._find(pieces, threads)
        world.accounts[0, N_UNDECIDED] += self._near.cut[:pieces].sum()
        ends = np.cumsum(self._near.count[:pieces])
        pairs = int(ends[-1])
        singly = refer_world(world._replace(rules=self._answered_singly(rules)))
        bounces = self._find_bounces(singly, threads)
        if pairs == 0 and bounces == 0:
            self.forget()
            return
        needed = ROOMY * (pairs + bounces) + SPARE
        if needed > len(self._meetings.ends):
            self._make_room(2 * needed)
        self._meetings.size[0] = pairs
        stage = refer_stage(Stage(
            singly, self._rules, self._matter, self._meetings, self._memory, self._cells,
            self._moved, self._pile, self._walls, np.arange(len(world.table)),
            len(world.poses) > 1, not rules.checks))
        self._prepare(stage, base)
        share(list_meetings, threads, rules.sweep, self._rules.slow, rules.flight.dt,
              self._matter, self._memory, self._cells, self._near,
              ends - self._near.count[:pieces], world.x, world.v, candidates, self._meetings)
        collide_all(stage, self._dry, self._wet, base, self._bounced, self._bounces)
        for again in range(AGAIN):
            work = make_work(self._sweeps, self._rules.slow)
            share(settle, threads, work, stage, self._dry, self._wet, base, self._bounced,
                  self._bounces, again > 0)
            if work.numbers[MET] == 0:
                break
        part(self._meetings, self._bounced, self._bounces)

    def _prepare(self, stage, base):
        """Compile first what is called after velocities have changed: a signal parts them not."""
        if not self._compiled:
            prepare(settle, make_work(self._sweeps, self._rules.slow), stage, self._dry, self._wet,
                    base, self._bounced, self._bounces, False)
            bound(part, self._meetings, self._bounced, self._bounces)
            self._compiled = True

    def _answered_singly(self, rules):
        """Rules of a step with a collision stage, whose particles are answered one by one."""
        if self._singly is None or self._singly[0] is not rules:
            self._singly = rules, rules._replace(checks=True, planes=False)
        return self._singly[1]

    def _find_bounces(self, world, threads):
        """Find the particles that end inside a collider; how many there are."""
        if len(world.table) == 0:
            return 0
        share(find_bounces, threads, world, self._matter.radius, self._bounced, self._bounces)
        return int(self._bounces[:, 0].sum())

    def forget(self):
        """Forget the impulses of the last step."""
        self._memory.size[0] = 0
        self._memory.head[:] = NONE

    def _make_room(self, pairs):
        """Make room for a number of pairs."""
        count = len(self._base)
        bodies = min(4 * pairs, count)
        supports = MOST_SUPPORTS * bodies + SPARE
        contacts = pairs + supports
        self._meetings = make_meetings(pairs, count, self._meetings)
        self._walls = make_walls(supports)
        self._pile = make_pile(bodies + supports, contacts, self._pile.body)
        old, known = self._memory, self._memory.size[0]
        self._memory = Memory(
            old.size, np.empty((contacts, 2), dtype=np.int64), np.empty((contacts, 3)),
            np.empty(contacts, dtype=np.int64), old.head)
        for before, now in zip(old[1:4], self._memory[1:4]):
            now[:known] = before[:known]

    def _sort(self, world, candidates, flies, base, threads):
        """Sort the particles into the grid."""
        if self._cells is None or len(self._cells.counts) != threads or (
                (self._cells.level is not None) != self._many):
            self._cells = make_cells(len(self._base), threads, self._many)
            self._chunk_counts = np.zeros((threads, LEVELS), dtype=np.int64)
            self._moved = make_moved(self._centre, self._extent, len(self._cells.start))
        share(lay_out_cells, threads, np.zeros(2 * PHASES + 1, dtype=np.int64), self._cells,
              self._chunk_counts, self._bounds, flies, world.rules.sweep, world.rules.flight,
              world.ledger, base, world.x, world.v, candidates, self._centre, self._extent)

    def _find(self, pieces, threads):
        """Find the pairs that are near each other, with as much room as they need."""
        share(find_near, threads, pieces, self._cells, self._near)
        while (self._near.count[:pieces] > self._near.found.shape[1]).any():
            self._near = _room(len(self._near.found), 2 * self._near.found.shape[1])
            share(find_near, threads, pieces, self._cells, self._near)


def _nobody(count):
    """Give NONE for each of a number of particles."""
    return np.full(count, NONE, dtype=np.int64)


def _each(value, count):
    """One number for each particle."""
    return np.broadcast_to(np.asarray(value, dtype=np.float64), count).copy()


def _room(pieces, most):
    """Scratch for what is found: `most` pairs in each piece."""
    return Near(np.empty((pieces, most), dtype=np.int64), np.zeros(pieces, dtype=np.int64),
                np.zeros(pieces, dtype=np.int64))
