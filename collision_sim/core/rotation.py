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

import numpy as np

TINY = 1e-200                                # keeps 0 / 0 away
INVERSE = np.array([-1.0, -1.0, -1.0, 1.0])  # times a unit quaternion: the inverse


def turn_matrix(q):
    """Matrix (4, 4) with p @ matrix = quaternion product p q."""
    x, y, z, w = q
    return np.array([[w, -z, y, -x], [z, w, -x, -y], [-y, x, w, -z], [x, y, z, w]])


def cross(a, b):
    """Vector products (3, n) of a (3, n) and b (3, n)."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                     a[0] * b[1] - a[1] * b[0]])


def exponential(vector):
    """
    Quaternions of rotation vectors, and the factors of their angular velocities.

    Parameters
    ----------
    vector : (3, n) float64 [rad]
        Of any length.

    Returns
    -------
    q : (4, n) float64 [-]
    a, b : (n,) float64 [-]
        A rotation vector r that changes at the rate d turns at d + a r x d + b r x (r x d).

    """
    square = vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]
    half = 0.5 * np.sqrt(square) + TINY
    cosine, ratio = np.cos(half), np.sin(half) / half
    q = np.empty((4, len(square)))
    q[:3] = 0.5 * ratio * vector
    q[3] = cosine
    return q, 0.5 * ratio * ratio, (1.0 - ratio * cosine) / (square + TINY)


def logarithm(q):
    """Rotation vectors (n, 3) of unit quaternions (n, 4), the shortest way."""
    q = np.where(q[:, 3:] < 0.0, -q, q)
    sine = np.sqrt(np.square(q[:, :3]).sum(axis=1)) + TINY
    return q[:, :3] * (2.0 * np.arctan2(sine, q[:, 3]) / sine)[:, None]


def turn_between(start, end):
    """Rotation vector (3,) from one orientation (4,) to another, the shortest way."""
    return logarithm((end @ turn_matrix(start * INVERSE))[None])[0]


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
    square = float(vector @ vector)
    half = 0.5 * square ** 0.5
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
    x, y, z, w = np.moveaxis(np.asarray(q), -1, 0)
    rows = [[1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def quaternion(matrix):
    """
    Convert a rotation matrix to a unit quaternion, from its largest component.

    Parameters
    ----------
    matrix : (3, 3) float64 [-]
        Orthogonal.

    Returns
    -------
    q : (4,) float64 [-]
        x, y, z, w.

    """
    m = np.asarray(matrix)
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    squares = [2.0 * m[i, i] - trace + 1.0 for i in range(3)] + [trace + 1.0]
    k = int(np.argmax(squares))
    if k == 3:
        q = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], squares[3]])
    else:
        i, j = (k + 1) % 3, (k + 2) % 3
        q = np.empty(4)
        q[k], q[3] = squares[k], m[j, i] - m[i, j]
        q[i], q[j] = m[i, k] + m[k, i], m[j, k] + m[k, j]
    return q / np.linalg.norm(q)
