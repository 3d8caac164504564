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

"""What the kernels of a step work on, in one value, which they are handed by reference."""

from typing import NamedTuple

from collision_sim.core.broad_phase import Grid
from collision_sim.core.candidates import Candidates
from collision_sim.core.jit import law
from collision_sim.core.ledger import Ledger
from collision_sim.core.reference import put, refer
from collision_sim.core.rules import Rules
import numpy as np


class World(NamedTuple):
    """
    A scene and what comes out of its steps.

    rules, ledger, candidates and grid are References (reference.py), as the World itself is where
    a kernel gets it.

    rules: what a step does; table (C, shapes.COLUMNS): the colliders; poses (S + 1, C, 12), one
    row where nothing moves; motion (S, C, motion.MOTION), then one row too; radius (N,) [m],
    or (1,) of all; log, accounts, notes: of response.py, a segment for each block, log without
    room if nobody wants it; x, v (3, N) [m], [m/s]; ledger;
    candidates: of no particle where springs and pairs change nothing; grid: without cells in
    scenes of few colliders. All from log to candidates are written. block: particles of a block.
    """

    rules: Rules
    table: np.ndarray
    poses: np.ndarray
    motion: np.ndarray
    radius: np.ndarray
    log: np.ndarray
    accounts: np.ndarray
    notes: np.ndarray
    x: np.ndarray
    v: np.ndarray
    ledger: Ledger
    candidates: Candidates
    grid: Grid
    block: int


@law
def _store(words, rules, table, poses, motion, radius, log, accounts, notes, x, v, ledger,
           candidates, grid, block):
    """Write a World to its words; return how many it takes."""
    return put(words, World(rules, table, poses, motion, radius, log, accounts, notes, x, v,
                            ledger, candidates, grid, block))


def refer_world(world):
    """Return a Reference to a World."""
    return refer(world, _store)
