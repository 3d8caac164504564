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
Which triangles a line meets, without gaps at shared edges and corners.

The corners are projected along the line, each by itself, so that two triangles that share an edge
see the same edge. The sign of a difference of two rounded products is that of the exact ones or 0,
and 0 counts as met: a line through an edge meets at least one of its triangles (S. Woop, C.
Benthin, I. Wald: Watertight ray/triangle intersection, JCGT 2(1), 2013).
"""

from collision_sim.core.jit import inlined


@inlined
def line_through(a, direction):
    """
    Line through a in the form that `pierces` takes.

    Returns
    -------
    a : (3,) tuple of float [m]
    axis : int
        Of the largest component of the direction.
    sx, sy : float [-]
        Slopes along the two axes that follow it; 0 without a direction.

    """
    x, y, z = direction
    if abs(z) >= abs(x) and abs(z) >= abs(y):
        return (a, 2, x / z, y / z) if z != 0.0 else (a, 2, 0.0, 0.0)
    return (a, 1, z / y, x / y) if abs(y) >= abs(x) else (a, 0, y / x, z / x)


@inlined
def _projected(line, triangles, t, k):
    """Corner k of triangle t from the line, along it, in two dimensions."""
    a, axis, sx, sy = line
    x, y, z = (triangles[t, 3 * k] - a[0], triangles[t, 3 * k + 1] - a[1],
               triangles[t, 3 * k + 2] - a[2])
    if axis == 2:
        return x - sx * z, y - sy * z
    if axis == 1:
        return z - sx * y, x - sy * y
    return y - sx * x, z - sy * x


@inlined
def pierces(line, triangles, t):
    """Whether a line meets a triangle, and whether it does so at an edge or a corner."""
    a, b, c = (_projected(line, triangles, t, 0), _projected(line, triangles, t, 1),
               _projected(line, triangles, t, 2))
    u, v, w = c[0] * b[1] - c[1] * b[0], a[0] * c[1] - a[1] * c[0], b[0] * a[1] - b[1] * a[0]
    at_edge = u == 0.0 or v == 0.0 or w == 0.0
    left, right = u >= 0.0 and v >= 0.0 and w >= 0.0, u <= 0.0 and v <= 0.0 and w <= 0.0
    return left or right, at_edge
