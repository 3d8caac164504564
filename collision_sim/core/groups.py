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
Groups of contacts: those that hang together by bodies of finite mass.

What moves nobody passes nothing on: colliders and particles of infinite mass divide groups. So
what one group does is not changed by what another one does, to the last bit.
"""

from collision_sim.core.contact_solver import INVERSE
from collision_sim.core.jit import kernel
from collision_sim.core.pairs import FIRST, SECOND
from collision_sim.core.rules import NONE


@kernel
def _root(pile, body):
    """Find the body that stands for the group of a body."""
    used = pile.used
    while used[body] != body:
        used[body] = used[used[body]]
        body = used[body]
    return body


@kernel
def _body_of(pile, c):
    """Find the body of finite mass that contact c acts on; the first, if there are two."""
    a, b = pile.ends[c, FIRST], pile.ends[c, SECOND]
    return a if pile.bodies[a, INVERSE] > 0.0 else b


@kernel
def group_contacts(pile, size, count):
    """
    Order contacts by their groups, and within these as they are listed.

    Parameters
    ----------
    pile : contact_solver.Pile
        Its members and groups are written: those of group g are pile.member[pile.group[g]:
        pile.group[g + 1]].
    size, count : int
        Bodies and contacts.

    Returns
    -------
    groups : int
        How many there are, in the order of their first contacts.

    """
    for body in range(size):
        pile.used[body], pile.label[body] = body, NONE
    for c in range(count):
        a, b = pile.ends[c, FIRST], pile.ends[c, SECOND]
        if pile.bodies[a, INVERSE] > 0.0 and pile.bodies[b, INVERSE] > 0.0:
            pile.used[_root(pile, b)] = _root(pile, a)
    groups = 0
    for c in range(count):
        root = _root(pile, _body_of(pile, c))
        if pile.label[root] == NONE:
            pile.label[root] = groups
            groups += 1
            pile.group[groups] = 0
        pile.group[pile.label[root] + 1] += 1
    pile.group[0] = 0
    for g in range(groups):
        pile.group[g + 1] += pile.group[g]
    for c in range(count):
        g = pile.label[_root(pile, _body_of(pile, c))]
        pile.member[pile.group[g]] = c
        pile.group[g] += 1
    for g in range(groups, 0, -1):
        pile.group[g] = pile.group[g - 1]
    pile.group[0] = 0
    return groups
