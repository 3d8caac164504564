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
The modules are opened: compiled where need be, and their addresses written down.

Values are handed over for their types alone.
"""

from collision_sim.core.detection import (first_on_way, meeting_on_path, normal_between,
                                          survey_path)
from collision_sim.core.jit import entry, open_kernel
from collision_sim.core.ledger import book_pass, book_two
from collision_sim.core.mesh import mesh_distance
from collision_sim.core.mesh_blocks import mark_near_box, mark_on_way
from collision_sim.core.mesh_contact import depth_at, hit_on_way, mesh_end, mesh_gap, mesh_hit
from collision_sim.core.modules import (BLOCKER, BOOK_PASS, BOOK_TWO, MEETING_ON_PATH,
                                        MESH_BOXES, MESH_DEPTH, MESH_DISTANCE, MESH_END, MESH_GAP,
                                        MESH_HIT, MESH_WAY, MESHES_ON_WAY, NORMAL_BETWEEN,
                                        SURVEY_PATH, TO_BOTH_SURFACES, TO_SURFACE)
from collision_sim.core.rules import Here, NOTHING
from collision_sim.core.second_order import to_both_surfaces, to_surface
from collision_sim.core.shapes import DISTANCE
import numpy as np


@entry
def open_meshes(present, table, poses, motion):
    """
    Open what is about meshes, for the scene with these tables.

    Parameters
    ----------
    present : shapes.Present
        Its addresses are written.
    table, poses, motion
        As in plan.Parts.

    """
    meshes, modules, at, i, r = present.meshes, present.modules, DISTANCE[1], 0, 0.0
    row = table[0]
    open_kernel(modules, MESH_DISTANCE, mesh_distance, DISTANCE, (meshes, i, at))
    open_kernel(modules, MESH_DEPTH, depth_at, r, (meshes, table, table, poses, i, i, r, at))
    open_kernel(modules, MESH_END, mesh_end, DISTANCE, (
        meshes, table, table, poses, i, i, i, r, at, at))
    open_kernel(modules, MESH_GAP, mesh_gap, DISTANCE, (
        meshes, table, poses, i, i, i, r, r, at))
    open_kernel(modules, MESH_WAY, hit_on_way, DISTANCE, (
        meshes, table, table, poses, i, i, i, r, at, at))
    open_kernel(modules, MESH_HIT, mesh_hit, DISTANCE, (
        meshes, table, poses, i, i, r, at, at, at, r))
    open_kernel(modules, MESHES_ON_WAY, mark_on_way, i, (
        meshes, False, table, poses, motion, i, i, i, row, row, row, row, table, row, row))
    open_kernel(modules, MESH_BOXES, mark_near_box, i, (
        meshes, table, poses, i, i, row, row, row, row, row, row, row, row, row))


@entry
def open_paths(rules, table, poses, motion, accounts):
    """
    Open what looks along the paths of particles, for the scene with these tables.

    Parameters
    ----------
    rules : rules.Rules
        The addresses in it are written.
    table, poses, motion, accounts
        As in plan.Parts.

    """
    modules, at, i, r, flag = rules.present.modules, DISTANCE[1], 0, 0.0, False
    chosen = np.empty(0, dtype=np.int64)
    here = Here(i, i, i, i, i, r, chosen, table, chosen)
    open_kernel(modules, SURVEY_PATH, survey_path, (NOTHING, i), (
        rules, here, table, poses, motion, accounts, at, at, at, at, flag))
    open_kernel(modules, MEETING_ON_PATH, meeting_on_path, (NOTHING, r, r), (
        rules, here, table, poses, motion, accounts, i, r, at, at, at, at, flag))
    open_kernel(modules, BLOCKER, first_on_way, i, (rules, here, table, poses, motion, at, at))


@entry
def open_second_order(rules, table, poses, motion):
    """Open what contacts of second order need; the arguments are as in `open_paths`."""
    modules, at, i, r, flag = rules.present.modules, DISTANCE[1], 0, 0.0, False
    chosen = np.empty(0, dtype=np.int64)
    here = Here(i, i, i, i, i, r, chosen, table, chosen)
    open_kernel(modules, NORMAL_BETWEEN, normal_between, (at, flag, flag), (
        rules, here, table, poses, i, at, at, r, at))
    open_kernel(modules, TO_SURFACE, to_surface, (at, at, at, flag), (
        rules, here, table, poses, motion, at, at, NOTHING, at))
    open_kernel(modules, TO_BOTH_SURFACES, to_both_surfaces, (at, at), (
        rules, here, table, poses, motion, at, at, NOTHING, NOTHING, at, at))


@entry
def open_ledger(rules, table, poses, motion, ledger):
    """Open what books; the arguments are as in `open_paths`."""
    modules, at, i, r, flag = rules.present.modules, DISTANCE[1], 0, 0.0, False
    chosen = np.empty(0, dtype=np.int64)
    here = Here(i, i, i, i, i, r, chosen, table, chosen)
    open_kernel(modules, BOOK_PASS, book_pass, flag, (
        ledger, rules, here, table, poses, motion, NOTHING, at, at, at, at, at, at, r, flag))
    open_kernel(modules, BOOK_TWO, book_two, flag, (
        ledger, rules, here, table, NOTHING, NOTHING, at, at, at, at, at, at, r, i, flag))


def open_modules(parts):
    """
    Open the modules that the steps of a scene need.

    Parameters
    ----------
    parts : plan.Parts
        Of a step in this scene.

    """
    rules, table, poses, motion = parts.rules, parts.table, parts.poses, parts.motion
    if rules.present.meshes.heads.size:
        open_meshes(rules.present, table, poses, motion)
    if rules.sweep:
        open_paths(rules, table, poses, motion, parts.accounts)
    if rules.second:
        open_second_order(rules, table, poses, motion)
    if len(parts.ledger.rows):
        open_ledger(rules, table, poses, motion, parts.ledger)
