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
What the laws make of a velocity: the response to one collider, and to two at once.

Velocities are relative to the material point of the collider; absent kinds of friction are None
and have no code.
"""

from collision_sim.core.jit import inlined
from collision_sim.core.laws import (CAPPED, dry_friction, EXPONENTIAL, wet_friction_capped,
                                     wet_friction_exponential, wet_friction_linear)
from collision_sim.core.rules import PARALLEL
from collision_sim.core.shapes import KINETIC, STATIC, WET, WET_FORM
from collision_sim.core.vectors import add, add_scaled, cross, dot, length, scaled, subtract


@inlined
def dry_factor(table, c, speed, dv_n):
    """Factor of dry friction on a tangential velocity; 1 where there is none."""
    if table[c, STATIC] * dv_n > 0.0:
        return dry_friction(speed, dv_n, table[c, STATIC], table[c, KINETIC])
    return 1.0


@inlined
def wet_factor(table, c, dv_n):
    """Factor of wet friction on a tangential velocity; 1 where there is none."""
    if table[c, WET] == 0.0:
        return 1.0
    if table[c, WET_FORM] == EXPONENTIAL:
        return wet_friction_exponential(table[c, WET], dv_n)
    if table[c, WET_FORM] == CAPPED:
        return wet_friction_capped(table[c, WET], dv_n)
    return wet_friction_linear(table[c, WET], dv_n)


@inlined
def respond(table, c, v, obj, n, v_n, dv_n):
    """
    Velocity after a change dv_n along the normal and the friction that it causes.

    Parameters
    ----------
    table, c
        As in `resolve`; which collider.
    v, obj, n : (3,) tuple of float [m/s], [-]
        Velocities of the particle and of the material point, and the normal.
    v_n, dv_n : float [m/s]
        Normal velocity before, and its change, not negative.

    Returns
    -------
    v : (3,) tuple of float [m/s]
        Where the particle sticks, exactly the velocity of the material point plus (v_n + dv_n) n.
    stuck : bool

    """
    tangential = slip_of(v, obj, n)
    return respond_to_slip(1, table, c, v, obj, n, v_n, dv_n, tangential, length(tangential))


@inlined
def slip_of(v, obj, n):
    """Tangential velocity [m/s] relative to the material point."""
    relative = subtract(v, obj)
    return add_scaled(relative, -dot(relative, n), n)


@inlined
def respond_to_slip(rare, table, c, v, obj, n, v_n, dv_n, tangential, speed):
    """
    Velocity after a change dv_n, as `respond`, for a tangential velocity of known size.

    With `rare` None it is known that there is no wet friction: vector loops need no exponential.
    """
    factor = dry_factor(table, c, speed, dv_n)
    if rare is not None:
        factor *= wet_factor(table, c, dv_n)
    if factor == 0.0:
        return add_scaled(obj, v_n + dv_n, n), True
    after = add_scaled(v, dv_n, n)
    if factor == 1.0:
        return after, False
    return add_scaled(after, factor - 1.0, tangential), False


@inlined
def doubtful_change(w_n, most, off):
    """
    Change of normal velocity [m/s] that ends an approach to a velocity that is estimated.

    Parameters
    ----------
    w_n : float [m/s]
        Normal velocity before, negative.
    most : float [m/s]
        What there is reason for.
    off : float [m/s]
        How far off the estimate may be: the most that is left of the approach.

    Returns
    -------
    dv_n : float [m/s]

    """
    return -w_n - min(off, max(-w_n - most, 0.0))


@inlined
def _wanted_impulses(n1, obj1, n2, obj2, v):
    """
    Find the changes of velocity along two normals that end the approach of v to both colliders.

    None of them pulls. Both are 0 where nothing approaches, and where the normals are parallel.

    Returns
    -------
    a, b : float [m/s]
        Along n1 and n2.
    share : float [-]
        At most 1: with more of both two closing colliders would squeeze the particle out faster
        than twice the speed at which they close, as seen from between them.

    """
    v1, v2, k = dot(subtract(v, obj1), n1), dot(subtract(v, obj2), n2), dot(n1, n2)
    across = 1.0 - k * k
    if (v1 >= 0.0 and v2 >= 0.0) or across < PARALLEL:
        return 0.0, 0.0, 1.0
    a, b = (k * v2 - v1) / across, (k * v1 - v2) / across
    if b <= 0.0:
        a, b = max(-v1, 0.0), 0.0
    elif a <= 0.0:
        a, b = 0.0, max(-v2, 0.0)
    middle = scaled(0.5, add(obj1, obj2))
    before, after = subtract(v, middle), add_scaled(add_scaled(v, a, n1), b, n2)
    speed = length(subtract(after, middle))
    most = length(before) + 2.0 * length(subtract(obj1, obj2))
    return a, b, (most / speed if speed > most else 1.0)


@inlined
def joint_impulses(n1, obj1, n2, obj2, v):
    """Find the changes as `_wanted_impulses`; both are 0 where only a share may act."""
    a, b, share = _wanted_impulses(n1, obj1, n2, obj2, v)
    return (a, b) if share == 1.0 else (0.0, 0.0)


@inlined
def joint_law(table, c1, n1, obj1, c2, n2, obj2, v):
    """Velocity that approaches neither of two colliders, with the friction of both."""
    a, b = joint_impulses(n1, obj1, n2, obj2, v)
    if a == 0.0 and b == 0.0:
        return v
    after = add_scaled(add_scaled(v, a, n1), b, n2)
    for c, obj, dv_n in ((c1, obj1, a), (c2, obj2, b)):
        relative = subtract(after, obj)
        factor = (dry_factor(table, c, length(relative), dv_n)
                  * wet_factor(table, c, dv_n))
        after = add_scaled(after, factor - 1.0, relative)
    return after


@inlined
def along_both(v, n1, n2):
    """Part of a vector along the edge of two surfaces."""
    edge = cross(n1, n2)
    return scaled(dot(v, edge) / dot(edge, edge), edge)


@inlined
def between(v, n1, obj1, n2, obj2, target):
    """
    Velocity that has been answered by two colliders, to the last bit where that is known.

    Where both move alike, and nothing is thrown back, only the part along both is its own: what
    rests between them rests, however acute their angle is.
    """
    if target == 0.0 and obj1[0] == obj2[0] and obj1[1] == obj2[1] and obj1[2] == obj2[2]:
        return add(obj1, along_both(subtract(v, obj1), n1, n2))
    return v


@inlined
def law_at_once(table, c1, n1, obj1, c2, n2, obj2, target, v):
    """
    Velocity after two colliders have acted at once, and what they change it by.

    Parameters
    ----------
    table, c1, c2
        As in `resolve`; the colliders.
    n1, obj1, n2, obj2 : (3,) tuple of float [-], [m/s]
        Normals, which are not parallel, and velocities of the material points.
    target : float [m/s]
        Normal velocity to reach, as both see it.
    v : (3,) tuple of float [m/s]
        Velocity before.

    Returns
    -------
    v : (3,) tuple of float [m/s]
        The friction of both is along both surfaces: across, they hold the particle between them.
    a, b : float [m/s]
        Along n1 and n2; 0 unless both push.

    """
    a, b, share = _wanted_impulses(n1, add_scaled(obj1, target, n1),
                                   n2, add_scaled(obj2, target, n2), v)
    if not (a > 0.0 and b > 0.0):
        return v, 0.0, 0.0
    if share < 1.0:
        a, b = share * a, share * b
    after = add_scaled(add_scaled(v, a, n1), b, n2)
    if share == 1.0:
        after = between(after, n1, obj1, n2, obj2, target)
    for c, obj, dv_n in ((c1, obj1, a), (c2, obj2, b)):
        slip = along_both(subtract(after, obj), n1, n2)
        factor = (dry_factor(table, c, length(slip), dv_n)
                  * wet_factor(table, c, dv_n))
        after = add_scaled(after, factor - 1.0, slip)
    return after, a, b


@inlined
def shares(n1, n2, dv):
    """
    Divide a change of velocity between two normals.

    Returns
    -------
    a, b : float [m/s]
        Such that dv less a n1 + b n2 is along both surfaces; the normals are not parallel.

    """
    d1, d2, k = dot(dv, n1), dot(dv, n2), dot(n1, n2)
    across = 1.0 - k * k
    return (d1 - k * d2) / across, (d2 - k * d1) / across


@inlined
def two_parts(n1, n2, dv):
    """Divide a change of velocity between two colliders; friction in the ratio of the normals."""
    k = dot(n1, n2)
    a, b = shares(n1, n2, dv) if 1.0 - k * k >= PARALLEL else (dot(dv, n1), 0.0)
    rest = add_scaled(add_scaled(dv, -a, n1), -b, n2)
    total = abs(a) + abs(b)
    part = abs(a) / total if total > 0.0 else 0.5
    return add_scaled(scaled(a, n1), part, rest), a, b
