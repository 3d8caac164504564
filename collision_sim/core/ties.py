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
the one that takes most from a particle, by less restitution and more friction: both are the same
in a mirror image. Where even that is alike, two colliders are answered at once (response.py);
where they cannot be, or are more than two, their normals are compared, and last their places.
"""

from collision_sim.core.jit import inlined, kernel
from collision_sim.core.rules import NONE, ROUNDING
from collision_sim.core.shapes import COLUMNS, KINETIC, RESTITUTION, STATIC, WET
from collision_sim.core.vectors import largest

SAME_TIME = 1e-12       # share of a step that two impacts on a path may be apart by rounding


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
def lack(touch):
    """Return the normal velocity [m/s] that a touch lacks of what is asked for, negative."""
    return touch.v_n - touch.target


@inlined
def lacks_alike(one, other, v):
    """Whether a particle of velocity v lacks as much of two touches, to rounding."""
    blur = ROUNDING * (largest(v) + largest(one.obj) + largest(other.obj))
    return abs(lack(one) - lack(other)) <= blur


@kernel
def is_before(table, poses, row, one, other, v):
    """Whether a Touch comes before another one that is equally deep; v: velocity they act on."""
    if not lacks_alike(one, other, v):
        return lack(one) < lack(other)
    return stands_first(table, poses, row, one.collider, one.normal, other.collider, other.normal)


@inlined
def comes_first(table, poses, row, one, phi, blur, other, phi_other, blur_other, v):
    """
    Compare a Touch with the first one so far, or NOTHING: deeper, or as deep and before.

    Parameters
    ----------
    table, poses, row
        As in shapes.signed_distance.
    one, other : Touch
        The touch, and the first one so far.
    phi, phi_other, blur, blur_other : float [m]
        Signed distances to their colliders, and how much of these is only rounding.
    v : (3,) tuple of float [m/s]
        Velocity that they act on.

    Returns
    -------
    first, tied : bool
        Whether it comes before the other one, and whether it is as deep.

    """
    if other.collider != NONE and abs(phi - phi_other) <= blur + blur_other:
        return is_before(table, poses, row, one, other, v), True
    return phi < phi_other, False


@inlined
def hits_first(table, poses, row, one, tau, phi, blur, other, tau_other, phi_other, blur_other, v):
    """Compare as `comes_first`, on a path: earlier, else deeper."""
    if abs(tau - tau_other) <= SAME_TIME and abs(phi - phi_other) <= blur + blur_other:
        if other.collider != NONE:
            return is_before(table, poses, row, one, other, v), True
    return tau < tau_other or (tau == tau_other and phi < phi_other), False


@inlined
def ties(first, tied, count):
    """Count the colliders that are tied with the first one, after one more."""
    return count + 1 if tied else (0 if first else count)
