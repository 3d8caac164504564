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

"""What pressed on each other in the last step, and with which impulses: who rests on whom."""

from typing import NamedTuple

from collision_sim.core.jit import inlined, kernel
from collision_sim.core.rules import NONE, ROUNDING
from collision_sim.core.vectors import length
import numpy as np

BLURRED = 64.0          # times the rounding of an impulse that the velocity it leaves may be off


class Memory(NamedTuple):
    """
    Contacts that pressed in the last step.

    size (1,) int64: how many; key (C, 2) int64: particle with the smaller index and the other one,
    or N plus a collider; impulses (C, 3) [N s]: on the first; other (C,) int64, head
    (N,) int64: the last one of each particle, and of each the one before.
    """

    size: np.ndarray
    key: np.ndarray
    impulses: np.ndarray
    other: np.ndarray
    head: np.ndarray


@inlined
def recall(memory, i, j):
    """Row of the contact of particle i with j, or with N plus a collider; NONE if none pressed."""
    first, second = min(i, j), max(i, j)
    row = memory.head[first]
    while row != NONE:
        if memory.key[row, 1] == second:
            return row
        row = memory.other[row]
    return NONE


@inlined
def resting_speed(memory, row, slow, inverse):
    """
    Speed [m/s] up to which those of a contact that pressed do not collide.

    `slow` [m/s] is what gravity does in a step; to that comes the rounding of the impulse, for the
    sum of the inverse masses [1/kg].
    """
    impulse = (memory.impulses[row, 0], memory.impulses[row, 1], memory.impulses[row, 2])
    return slow + BLURRED * ROUNDING * length(impulse) * inverse


@kernel
def forget(memory):
    """Forget all contacts."""
    for row in range(memory.size[0]):
        memory.head[memory.key[row, 0]] = NONE
    memory.size[0] = 0


@kernel
def keep(memory, i, j, impulse):
    """Keep a contact, with the impulse [N s] on particle i, for the next step."""
    row, first, sign = memory.size[0], min(i, j), 1.0 if i < j else -1.0
    memory.key[row, 0], memory.key[row, 1] = first, max(i, j)
    for d in range(3):
        memory.impulses[row, d] = sign * impulse[d]
    memory.other[row], memory.head[first] = memory.head[first], row
    memory.size[0] = row + 1
