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
What a step does, what it counts and what it logs: names shared by the kernels of a step.

The accounts (blocks, ACCOUNTS) hold the counters and the number of rows in the log.
"""

from typing import NamedTuple, Optional

from collision_sim.core.flight import Flight
from collision_sim.core.jit import inlined
from collision_sim.core.shapes import Present
from collision_sim.core.vectors import EPSILON
import numpy as np

COLLISION, SLIDE, STICK, REPULSION = 1, 2, 3, 4         # states of a contact
STATES = {COLLISION: 'collision', SLIDE: 'slide', STICK: 'stick', REPULSION: 'repulsion'}

COUNTERS = ('collisions', 'contacts', 'repulsions', 'fail_safes', 'unplaced', 'undecided',
            'pair_collisions', 'pair_contacts', 'frozen', 'unsettled',
            'collapsed')
(N_COLLISION, N_CONTACT, N_REPULSION, N_FAIL_SAFE, N_UNPLACED, N_UNDECIDED, N_PAIR_COLLISION,
 N_PAIR_CONTACT, N_FROZEN, N_UNSETTLED, N_COLLAPSED) = range(11)
# Columns of the accounts (blocks, ACCOUNTS): counters; rows of the log; where particles act on
# each other, rows that each has in the log and the number of the step, else 0; and room, so that
# what threads write is not in one cache line.
N_LOGGED, N_ROWS, N_STEP, ACCOUNTS = 11, 12, 13, 24

# Columns of the log of contacts (blocks, rows, LOG), None when nobody wants it: particle,
# collider, state, point [m], normal, change of velocity [m/s]; and of the notes
# (blocks, NOTES, 3) on unplaced particles: particle, collider, other collider. Where each particle
# has rows of its own, OF_STEP times the number of the step is added to the state: rows with
# another one are empty.
POINT, NORMAL, CHANGE, LOG = 3, 6, 9, 12
NOTES = 8
OF_STEP = 8
MOST_CONTACTS = 4           # colliders logged for one particle in one step

CHECKS = 3                  # most collisions of a particle in one step, as in the lecture
PUSHES = 12                 # times a particle is pushed to a surface before the fail-safe
PARALLEL = 1e-14            # square of the sine below which two normals are parallel
ROUNDING = 16.0 * EPSILON   # relative size of a velocity or depth that is only rounding
SAME_SIDE = 0.5             # cosine above which two normals belong to the same side of a surface
STRAIGHT = 0.9              # cosine above which there is no edge between two normals
NONE = -1                   # no collider


class Rules(NamedTuple):
    """
    What a step does.

    present: the meshes; dry, wet: whether any collider has such friction; sweep: whether impacts
    are found along the path; checks: whether the method has a collision stage; passes: most passes
    of the contact stage; once: each collider at most once in turn (`single_pass`); share [-] and
    highest [m/s]: the repulsion; second: whether contacts are of second order; planes: whether
    particles that touch a single plane are answered by planes.py.
    """

    flight: Flight
    present: Present
    dry: bool
    wet: bool
    sweep: bool
    checks: bool
    passes: int
    once: bool
    share: float
    highest: float
    second: bool = False
    planes: bool = False


class Here(NamedTuple):
    """
    Step of this call, rows of poses at its start and end, block, particle and its radius.

    chosen: colliders that the particle may touch (broad_phase.py); answers: the last ones of
    meshes (mesh_way.py), without rows where nobody keeps them; only: the one collider of those
    chosen that is acted on, (1,), or (0,) for all: pairs look at one at a time.
    """

    step: int
    start: int
    end: int
    block: int
    particle: int
    radius: float
    chosen: Optional[np.ndarray]
    answers: Optional[np.ndarray]
    only: Optional[np.ndarray]


@inlined
def account_of(block, i):
    """Where what happens to particle i of a block is booked."""
    return Here(0, 0, 0, block, i, 0.0, None, None, None)


class Touch(NamedTuple):
    """
    A collider to act on; NOTHING where there is none.

    collider, normal; obj [m/s]: velocity of its material point; point [m]: where the particle
    touches; v_n, target [m/s]: normal velocity, and the one that repulsion asks for, else 0; hit:
    whether to act on the velocity at the start of the step (collision stage); stays: whether the
    normal is that where the surface is met, and the particle is to end on it (second order).
    """

    collider: int
    normal: tuple
    obj: tuple
    point: tuple
    v_n: float
    target: float
    hit: bool
    stays: bool


NOTHING = Touch(NONE, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, False, False)
