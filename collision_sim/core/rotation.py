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
Rotations in plain NumPy: quaternions, rotation vectors, and how fast they turn.

Quaternions are x, y, z, w; either sign is the same rotation. Rotation vectors (axis times angle)
and angular velocities are in the world frame. Columns are the elements, so that (3, n) holds n
vectors, except where (n, 4) is said.
"""

from math import sqrt

from collision_sim.core.jit import law
import numpy as np

TINY = 1e-200                                # keeps 0 / 0 away


@law
def product(p, q):
    """Quaternion product p q, (4,) each: q turns first."""
    r = np.empty(4)
    r[0] = p[3] * q[0] + p[0] * q[3] + p[1] * q[2] - p[2] * q[1]
    r[1] = p[3] * q[1] - p[0] * q[2] + p[1] * q[3] + p[2] * q[0]
    r[2] = p[3] * q[2] + p[0] * q[1] - p[1] * q[0] + p[2] * q[3]
    r[3] = p[3] * q[3] - p[0] * q[0] - p[1] * q[1] - p[2] * q[2]
    return r


@law
def cross(a, b):
    """Vector product (3,)."""
    c = np.empty(3)
    c[0] = a[1] * b[2] - a[2] * b[1]
    c[1] = a[2] * b[0] - a[0] * b[2]
    c[2] = a[0] * b[1] - a[1] * b[0]
    return c


@law
def exponential(vector):
    """
    Quaternion of a rotation vector, and the factors of its angular velocity.

    Parameters
    ----------
    vector : (3,) float64 [rad]
        Of any length.

    Returns
    -------
    q : (4,) float64 [-]
    a, b : float [-]
        A rotation vector r that changes at the rate d turns at d + a r x d + b r x (r x d).

    """
    square = vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]
    half = 0.5 * np.sqrt(square) + TINY
    cosine, ratio = np.cos(half), np.sin(half) / half
    q = np.empty(4)
    for k in range(3):
        q[k] = 0.5 * ratio * vector[k]
    q[3] = cosine
    return q, 0.5 * ratio * ratio, (1.0 - ratio * cosine) / (square + TINY)


@law
def logarithm(q):
    """Rotation vector (3,) of a unit quaternion (4,), the shortest way."""
    sign = -1.0 if q[3] < 0.0 else 1.0
    sine = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]) + TINY
    return q[:3] * (sign * 2.0 * np.arctan2(sine, sign * q[3]) / sine)


@law
def turn_between(start, end):
    """Rotation vector (3,) from one orientation (4,) to another, the shortest way."""
    inverse = -start
    inverse[3] = start[3]
    return logarithm(product(end, inverse))


@law
def vector_rate(vector, angular_velocity):
    """
    Rate at which a rotation vector changes at an angular velocity.

    Parameters
    ----------
    vector : (3,) float64 [rad]
        Less than a whole turn long.
    angular_velocity : (3,) float64 [rad/s]
        World frame.

    Returns
    -------
    rate : (3,) float64 [rad/s]
        The inverse of the formula in `exponential`.

    """
    square = vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]
    half = 0.5 * np.sqrt(square)
    c = 1.0 / 12.0 if square < 1e-8 else (1.0 - half / np.tan(half)) / square
    across = cross(vector, angular_velocity)
    return angular_velocity - 0.5 * across + c * cross(vector, across)


def rotation_matrix(q):
    """
    Convert unit quaternions to rotation matrices.

    Parameters
    ----------
    q : (..., 4) float64 [-]
        x, y, z, w.

    Returns
    -------
    matrix : (..., 3, 3) float64 [-]

    """
    q = np.asarray(q, dtype=float)
    return rotated_frames(q.reshape(-1, 1, 4), np.eye(3)[None]).reshape(*q.shape[:-1], 3, 3)


@law
def rotated_frames(q, frames):
    """Rotation matrices of unit quaternions (S, C, 4), times frames (C, 3, 3); rows (S, C, 9)."""
    rows, m = np.empty((*q.shape[:2], 9)), np.empty((3, 3))
    for s in range(q.shape[0]):
        for c in range(q.shape[1]):
            x, y, z, w = q[s, c, 0], q[s, c, 1], q[s, c, 2], q[s, c, 3]
            m[0, 0], m[0, 1], m[0, 2] = \
                1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)
            m[1, 0], m[1, 1], m[1, 2] = \
                2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)
            m[2, 0], m[2, 1], m[2, 2] = \
                2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)
            for i in range(3):
                for j in range(3):
                    rows[s, c, 3 * i + j] = m[i, 0] * frames[c, 0, j] \
                        + m[i, 1] * frames[c, 1, j] + m[i, 2] * frames[c, 2, j]
    return rows


@law
def _from_largest(matrices):
    """Quaternions (K, 4) of matrices (K, 3, 3), from their largest components; of any norm."""
    q = np.empty((matrices.shape[0], 4))
    for n in range(matrices.shape[0]):
        m, largest = matrices[n], 0
        trace = m[0, 0] + m[1, 1] + m[2, 2]
        for k in range(3):
            q[n, k] = 2.0 * m[k, k] - trace + 1.0
        q[n, 3] = trace + 1.0
        for k in range(1, 4):
            if q[n, k] > q[n, largest]:
                largest = k
        i, j, k = (largest + 1) % 3, (largest + 2) % 3, largest
        if k == 3:
            q[n, 0], q[n, 1] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0]
            q[n, 2] = m[1, 0] - m[0, 1]
        else:
            q[n, 3] = m[j, i] - m[i, j]
            q[n, i], q[n, j] = m[i, k] + m[k, i], m[j, k] + m[k, j]
    return q


def quaternions(matrices):
    """
    Convert rotation matrices to unit quaternions, from their largest components.

    Parameters
    ----------
    matrices : (K, 3, 3) float64 [-]
        Orthogonal, C-contiguous.

    Returns
    -------
    q : (K, 4) float64 [-]
        x, y, z, w.

    """
    q = _from_largest(matrices)
    for row in q:
        row /= sqrt(row.dot(row))
    return q
