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
The pendulum in closed form, by Jacobi's elliptic functions.

A particle in a bowl without friction is one, and so is one that slides off a ball, as long as it
touches it.
"""

from math import sqrt

import numpy as np

G = 9.81


def elliptic(u, k, kc):
    """
    Jacobi's elliptic functions.

    Parameters
    ----------
    u : array [-]
        Argument.
    k, kc : array [-]
        Modulus and complementary modulus, k^2 + kc^2 = 1; both, so that none is rounded.

    Returns
    -------
    sn, cn, dn : array [-]

    Notes
    -----
    Abramowitz and Stegun 16.4: the arithmetic-geometric mean down, the amplitude back up.

    """
    a, b, ratios = np.ones_like(k), kc, []
    for _ in range(7):
        ratios.append((a - b) / (a + b))
        a, b = 0.5 * (a + b), np.sqrt(a * b)
    amplitude = 2.0 ** len(ratios) * a * u
    for ratio in reversed(ratios):
        amplitude = 0.5 * (amplitude + np.arcsin(ratio * np.sin(amplitude)))
    sn, cn = np.sin(amplitude), np.cos(amplitude)
    return sn, cn, np.sqrt(kc ** 2 + (k * cn) ** 2)


def swing(time, k, kc):
    """
    Angle of a pendulum of 1 m that is released from rest.

    Parameters
    ----------
    time : array [s]
        Since the release.
    k, kc : array [-]
        Sine and cosine of half the angle at the release, from the lowest place.

    Returns
    -------
    angle, rate : array [rad], [rad/s]
        From the lowest place.

    Notes
    -----
    sin(angle / 2) = k cd(w t), w = sqrt(g / R); so cos(angle / 2) = kc / dn.

    """
    sn, cn, dn = elliptic(sqrt(G) * time, k, kc)
    return 2.0 * np.arctan2(k * cn, kc), -2.0 * sqrt(G) * k * kc * sn / dn


def fall_time(angle, along):
    """
    Time from rest at one angle from the top of a ball of 1 m to another one.

    Parameters
    ----------
    angle, along : array [rad]
        From the top; along > angle.

    Returns
    -------
    time : array [s]

    """
    time = np.arccosh(along / angle) / sqrt(G)      # that of a small angle
    for _ in range(30):
        below, rate = swing(time, np.cos(0.5 * angle), np.sin(0.5 * angle))
        time = time + (np.pi - below - along) / rate
    return time
