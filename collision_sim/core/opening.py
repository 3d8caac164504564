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
from collision_sim.core.mesh_way import ANSWERS
from collision_sim.core.modules import (BLOCKER, BOOK_PASS, BOOK_TWO, MEETING_ON_PATH,
                                        MESH_BOXES, MESH_DEPTH, MESH_DISTANCE, MESH_END, MESH_GAP,
                                        MESH_HIT, MESH_WAY, MESHES_ON_WAY, NORMAL_BETWEEN,
                                        SURVEY_PATH, TO_BOTH_SURFACES, TO_SURFACE)
from collision_sim.core.rules import Here, NOTHING
from collision_sim.core.second_order import to_both_surfaces, to_surface
from collision_sim.core.shapes import DISTANCE
from collision_sim.core.world import refer_world
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
        As in world.World.

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
def open_paths(world):
    """
    Open what looks along the paths of particles.

    Parameters
    ----------
    world : world.World
        The addresses in it are written.

    """
    modules, at, i, r, flag = world.rules.present.modules, DISTANCE[1], 0, 0.0, False
    chosen, answers = np.empty(0, dtype=np.int64), np.empty((0, ANSWERS))
    here = Here(i, i, i, i, i, r, chosen, answers, chosen)
    open_kernel(modules, SURVEY_PATH, survey_path, (NOTHING, i), (
        world, here, at, at, at, at, flag))
    open_kernel(modules, MEETING_ON_PATH, meeting_on_path, (NOTHING, r, r), (
        world, here, i, r, at, at, at, at, flag))
    open_kernel(modules, BLOCKER, first_on_way, i, (world, here, at, at))


@entry
def open_second_order(world):
    """Open what contacts of second order need; `world` is as in `open_paths`."""
    modules, at, i, r, flag = world.rules.present.modules, DISTANCE[1], 0, 0.0, False
    chosen, answers = np.empty(0, dtype=np.int64), np.empty((0, ANSWERS))
    here = Here(i, i, i, i, i, r, chosen, answers, chosen)
    open_kernel(modules, NORMAL_BETWEEN, normal_between, (at, flag, flag), (
        world, here, i, at, at, r, at))
    open_kernel(modules, TO_SURFACE, to_surface, (at, at, at, flag), (
        world, here, at, at, NOTHING, at))
    open_kernel(modules, TO_BOTH_SURFACES, to_both_surfaces, (at, at), (
        world, here, at, at, NOTHING, NOTHING, at, at))


@entry
def open_ledger(world):
    """Open what books; `world` is as in `open_paths`."""
    modules, at, i, r, flag = world.rules.present.modules, DISTANCE[1], 0, 0.0, False
    chosen, answers = np.empty(0, dtype=np.int64), np.empty((0, ANSWERS))
    here = Here(i, i, i, i, i, r, chosen, answers, chosen)
    open_kernel(modules, BOOK_PASS, book_pass, flag, (
        world, here, NOTHING, at, at, at, at, at, at, r, flag))
    open_kernel(modules, BOOK_TWO, book_two, flag, (
        world, here, NOTHING, NOTHING, at, at, at, at, at, at, r, i, flag))


def open_modules(world):
    """
    Open the modules that the steps of a scene need.

    Parameters
    ----------
    world : world.World
        Of a step in this scene.

    """
    rules, world = world.rules, refer_world(world)
    if rules.present.meshes.heads.size:
        open_meshes(rules.present, world.table, world.poses, world.motion)
    if rules.sweep:
        open_paths(world)
    if rules.second:
        open_second_order(world)
    if len(world.ledger.rows):
        open_ledger(world)
