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
Vectors of three floats as tuples: what the kernels compute with, one particle at a time.

A tuple costs no allocation in compiled code, and reading single numbers from a table, unlike a
view of its row, no reference count: kernels take tables whole and index them. A pose is 12
numbers, the rotation matrix in row order and then the position.
"""

from math import inf, sin, sqrt

from collision_sim.core.jit import formula, inlined

EPSILON = 2.0 ** -52            # distance from 1.0 to the next float64
LARGE_SQUARE = 1e290            # beyond these a sum of squares is scaled first
SMALL_SQUARE = 1e-290


@formula
def dot(a, b):
    """Scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@formula
def cross(a, b):
    """Vector product a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@formula
def add(a, b):
    """Sum of two vectors."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@formula
def subtract(a, b):
    """Difference a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@formula
def scaled(s, a):
    """Vector s a."""
    return (s * a[0], s * a[1], s * a[2])


@formula
def add_scaled(a, s, b):
    """Vector a + s b."""
    return (a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2])


@formula
def largest(a):
    """Largest absolute component."""
    return max(abs(a[0]), max(abs(a[1]), abs(a[2])))


@formula
def is_finite(a, b):
    """Whether two vectors are finite."""
    return 0.0 * (a[0] + a[1] + a[2]) + 0.0 * (b[0] + b[1] + b[2]) == 0.0


@formula
def length(a):
    """Euclidean length, without overflow or underflow of the squares."""
    square = dot(a, a)
    if SMALL_SQUARE < square < LARGE_SQUARE:
        return sqrt(square)
    scale = largest(a)
    if scale == 0.0 or not scale < inf:
        return scale
    b = (a[0] / scale, a[1] / scale, a[2] / scale)
    return scale * sqrt(dot(b, b))


@inlined
def turned(axis, angle, a):
    """Turn vector a about a unit axis, by Rodrigues' formula."""
    first = cross(axis, a)
    return add_scaled(add_scaled(a, sin(angle), first), 2.0 * sin(0.5 * angle) ** 2,
                      cross(axis, first))


@formula
def rotate(poses, s, c, a):
    """Turn a vector of collider c into the world frame, with row s of poses (S, C, 12)."""
    return (poses[s, c, 0] * a[0] + poses[s, c, 1] * a[1] + poses[s, c, 2] * a[2],
            poses[s, c, 3] * a[0] + poses[s, c, 4] * a[1] + poses[s, c, 5] * a[2],
            poses[s, c, 6] * a[0] + poses[s, c, 7] * a[1] + poses[s, c, 8] * a[2])


@formula
def rotate_back(poses, s, c, a):
    """Turn a world vector into the frame of collider c, with row s of poses (S, C, 12)."""
    return (poses[s, c, 0] * a[0] + poses[s, c, 3] * a[1] + poses[s, c, 6] * a[2],
            poses[s, c, 1] * a[0] + poses[s, c, 4] * a[1] + poses[s, c, 7] * a[2],
            poses[s, c, 2] * a[0] + poses[s, c, 5] * a[1] + poses[s, c, 8] * a[2])


@formula
def origin(poses, s, c):
    """Position [m] of collider c in row s of poses (S, C, 12)."""
    return (poses[s, c, 9], poses[s, c, 10], poses[s, c, 11])
