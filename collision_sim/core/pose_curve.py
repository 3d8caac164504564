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
The arithmetic of pose streams, compiled: twists from poses, cubics between poses, their values.

A cubic (12, 4) has the position, the rotation vector relative to the orientation at its start, and
the rates of both, by powers of time. Quaternions are x, y, z, w; rotation vectors (axis times
angle) and twists are in the world frame.
"""

from collision_sim.core.jit import counted
from collision_sim.core.rotation import (cross, exponential, product, TINY, turn_between,
                                         vector_rate)
import numpy as np


@counted
def twist_at(stamps, positions, orientations, i):
    """
    Twist at pose i from the polynomial through all.

    Rotation vectors lead to its neighbours the shortest way; to earlier poses through as many
    whole turns as the spin from the neighbour before suggests.

    Parameters
    ----------
    stamps : (n,) float64 [s]
        Increasing.
    positions, orientations : (n, 3), (n, 4) float64 [m], [-]
        At the stamps.
    i : int
        Which of them.

    Returns
    -------
    twist : (6,) float64 [m/s], [rad/s]

    """
    n = len(stamps)
    vectors = np.empty((n, 3))
    for j in range(n):
        vectors[j] = turn_between(orientations[i], orientations[j])
    if i > 1:
        spin = vectors[i - 1] / (stamps[i - 1] - stamps[i])
        for j in range(i - 1):
            v = vectors[j]
            angle = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + TINY
            along = (v[0] * spin[0] + v[1] * spin[1] + v[2] * spin[2]) / angle
            expected = (stamps[j] - stamps[i]) * along
            whole = 2.0 * np.pi * np.rint((expected - angle) / (2.0 * np.pi))
            vectors[j] = v + whole * (v / angle)
    scale = np.ones(n)
    for j in range(n):
        for k in range(n):
            if k != j:
                scale[j] /= stamps[j] - stamps[k]
    twist = np.zeros(6)
    for j in range(n):
        if j != i:
            weight = scale[j] / (scale[i] * (stamps[i] - stamps[j]))
            twist[:3] += weight * (positions[j] - positions[i])
            twist[3:] += weight * vectors[j]
    return twist


@counted
def cubic(position, first, second, third):
    """Cubic from a position (3,) on, with the powers 1 to 3 of time, (6,) each."""
    table = np.zeros((12, 4))
    table[:3, 0] = position
    for k in range(6):
        table[k, 1], table[k, 2], table[k, 3] = first[k], second[k], third[k]
        table[6 + k, 0], table[6 + k, 1], table[6 + k, 2] = first[k], 2.0 * second[k], \
            3.0 * third[k]
    return table


@counted
def cubic_between(position, orientation, twist, end_position, end_orientation, end_twist, h):
    """Cubic from pose and twist to pose and twist, h seconds later."""
    chord, rate = np.empty(6), np.empty(6)
    turn = turn_between(orientation, end_orientation)
    chord[:3] = (end_position - position) / h
    chord[3:] = turn / h
    rate[:3] = end_twist[:3]
    rate[3:] = vector_rate(turn, end_twist[3:])
    return cubic(position, twist, (3.0 * chord - 2.0 * twist - rate) / h,
                 (twist + rate - 2.0 * chord) / h ** 2)


@counted
def play(table, start, orientation, times, first, last, out):
    """
    Write values of a cubic to the columns first to last of out.

    Parameters
    ----------
    table : (12, 4) float64
        The cubic.
    start, orientation : float [s], (4,) float64 [-]
        Where it begins.
    times : (n,) float64 [s]
        Increasing.
    first, last : int
        Which of the times.
    out : (13, n) float64
        Position, orientation, twist.

    """
    value = np.empty(12)
    for n in range(first, last):
        u = times[n] - start
        for k in range(12):
            value[k] = table[k, 0] + table[k, 1] * u + table[k, 2] * (u * u) \
                + table[k, 3] * (u * u * u)
        q, a, b = exponential(value[3:6])
        across = cross(value[3:6], value[9:])
        out[:3, n] = value[:3]
        out[3:7, n] = product(q, orientation)
        out[7:, n] = value[6:]
        out[10:, n] += a * across + b * cross(value[3:6], across)


@counted
def turned(orientation, vector):
    """Orientation (4,) after a turn by a rotation vector (3,)."""
    return product(exponential(vector)[0], orientation)
