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
All that step_blocks works on, in one value.

Handing a dozen arrays and tuples to a compiled function takes longer than a step of a small scene;
a Plan is handed over as a pointer.
"""

from typing import NamedTuple

from collision_sim.core.broad_phase import Grid
from collision_sim.core.candidates import Candidates
from collision_sim.core.jit import law
from collision_sim.core.ledger import Ledger
from collision_sim.core.rules import Rules
from numba import config, types
from numba.experimental import structref
import numpy as np


class Parts(NamedTuple):
    """
    What a Plan is made of.

    rules: what a step does; table (C, shapes.COLUMNS): the colliders; poses (S + 1, C, 12), one
    row where nothing moves; motion (S, C, motion.MOTION), then one row too; radius (N,) [m],
    or (1,) of all; log, accounts, notes: of response.py, a segment for each block, log without
    room if nobody wants it; x, v (3, N) [m], [m/s]; ledger;
    candidates: of no particle where springs and pairs change nothing; grid: without cells in
    scenes of few colliders. All from log to ledger are written. block: particles of a block.
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


if config.DISABLE_JIT:
    def make_plan(parts):
        """Give the parts themselves, which plain Python hands over just as well."""
        return parts
else:
    @structref.register
    class PlanType(types.StructRef):
        """Numba's type of a Plan; its fields have those of the parts."""

        def preprocess_fields(self, fields):
            """Let a field hold any value of a type, not just one."""
            return tuple((name, types.unliteral(kind)) for name, kind in fields)

    class Plan(structref.StructRefProxy):
        """The parts, kept where compiled code finds them."""

    structref.define_proxy(Plan, PlanType, list(Parts._fields))

    def make_plan(parts):
        """
        Keep the parts where compiled code finds them, for as long as anybody has the plan.

        Parameters
        ----------
        parts : Parts
            Of the plan; what is handed over by reference lives no longer than these.

        Returns
        -------
        Plan

        """
        plan = _plan_of(parts)
        plan.parts = parts
        return plan

    @law
    def _plan_of(parts):
        return Plan(parts.rules, parts.table, parts.poses, parts.motion, parts.radius, parts.log,
                    parts.accounts, parts.notes, parts.x, parts.v, parts.ledger, parts.candidates,
                    parts.grid, parts.block)
