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
Which collider comes first where a particle is equally deep in several.

That is not left to their order in the scene. The one that is approached fastest comes first; then
one that a particle rests on before one that only pushes it out, which changes no velocity; then
the one that takes most from a particle, by less restitution and more friction: both are the same
in a mirror image. Where even that is alike, the colliders are answered at once (response.py); for
what that cannot do, their normals are compared, and last their places.
"""

from collision_sim.core.jit import inlined, kernel
from collision_sim.core.rules import ROUNDING
from collision_sim.core.shapes import COLUMNS, KINETIC, RESTITUTION, STATIC, WET
from collision_sim.core.vectors import largest

SAME_TIME = 1e-12       # share of a step that two impacts on a path may be apart by rounding
ALIKE = 1e-9            # relative: how far pushes that are alike may be apart
UNIT = 2.0 ** -49       # of normals in a sum: that of eight is exact, whatever their order is


@kernel
def stands_first(table, poses, row, k, n, other, n_other):
    """
    Whether collider k comes before another one, of which a particle is equally deep in both.

    Parameters
    ----------
    table, poses, row
        As in shapes.signed_distance.
    k, other : int
        The colliders.
    n, n_other : (3,) tuple of float [-]
        Their normals.

    """
    if table[k, RESTITUTION] != table[other, RESTITUTION]:
        return table[k, RESTITUTION] < table[other, RESTITUTION]
    for column in (STATIC, KINETIC, WET):
        if table[k, column] != table[other, column]:
            return table[k, column] > table[other, column]
    for d in range(3):
        if n[d] != n_other[d]:
            return n[d] < n_other[d]
    for d in range(12):
        if poses[row, k, d] != poses[row, other, d]:
            return poses[row, k, d] < poses[row, other, d]
    for column in range(COLUMNS):
        if table[k, column] != table[other, column]:
            return table[k, column] < table[other, column]
    return False


@inlined
def to_units(n):
    """Round a normal so that sums of some have no rounding, and no order."""
    return (UNIT * round(n[0] / UNIT), UNIT * round(n[1] / UNIT), UNIT * round(n[2] / UNIT))


@inlined
def lack(touch):
    """Return the normal velocity [m/s] that a touch lacks of what is asked for, negative."""
    return touch.v_n - touch.target


@inlined
def lacks_alike(one, other, v):
    """Whether a particle of velocity v lacks as much of two touches, but for rounding."""
    blur = ROUNDING * (largest(v) + largest(one.obj) + largest(other.obj))
    return abs(lack(one) - lack(other)) <= max(blur, ALIKE * abs(lack(one)))


@kernel
def is_before(table, poses, row, one, other, v):
    """Whether a Touch comes before another one that is equally deep; v: velocity they act on."""
    if not lacks_alike(one, other, v):
        return lack(one) < lack(other)
    blur = ROUNDING * (largest(v) + largest(one.obj) + largest(other.obj))
    if abs(one.target - other.target) > blur:
        return one.target < other.target
    return stands_first(table, poses, row, one.collider, one.normal, other.collider, other.normal)
