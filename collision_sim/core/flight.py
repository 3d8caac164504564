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
Candidate motion over a step as if nothing were hit.

Gravity, linear drag and wind have a closed form: with the velocity v at the start of the step
the end and the mean velocity are a gain times v plus a shift, and the position moves by dt times
the mean velocity. The coefficients are computed once, so `ballistic` and `symplectic_euler` cost
the same. Quadratic drag acts in two half steps around that (Strang splitting, second order), each
by its closed form, which never overshoots.
"""

from math import exp, expm1, sqrt
from typing import NamedTuple

from collision_sim.core.jit import formula, inlined, kernel
from collision_sim.core.vectors import dot
import numpy as np


class Flight(NamedTuple):
    """
    Coefficients of one step.

    dt [s]; end_shift, mean_shift (3,) [m/s]; gains (2,) [-] of the end and the mean velocity, 1
    without linear drag; quadratic (4,): dt c / 2 [s/m], 0 without, and the wind [m/s].
    """

    dt: float
    end_shift: tuple
    mean_shift: tuple
    gains: tuple = (1.0, 1.0)
    quadratic: tuple = (0.0, 0.0, 0.0, 0.0)


def decay(z):
    """
    Exponential decay and its first two averages, without cancellation at small z.

    Parameters
    ----------
    z : float [-]
        Drag coefficient times dt, not negative.

    Returns
    -------
    e0, e1, e2 : float [-]
        exp(-z), (1 - exp(-z)) / z and (1 - e1) / z; 1, 1 and 1/2 at z = 0.

    """
    if z == 0.0:
        return 1.0, 1.0, 0.5
    e1 = -expm1(-z) / z
    if z > 0.1:
        return exp(-z), e1, (1.0 - e1) / z
    e2, term = 0.0, 0.5
    for k in range(3, 15):          # series 1/2! - z/3! + z^2/4! …
        e2 += term
        term *= -z / k
    return exp(-z), e1, e2


def flight_coefficients(gravity, drag, dt, flight):
    """
    Coefficients of the candidate motion.

    Parameters
    ----------
    gravity : (3,) sequence of float [m/s^2]
        Acceleration.
    drag : scene.Drag or None
        Coefficients and wind.
    dt : float [s]
        Length of the step.
    flight : str
        'ballistic': exact for gravity and linear drag. 'symplectic_euler': the mean velocity is
        the end velocity, first order; drag keeps its closed form so that it is stable.

    Returns
    -------
    Flight

    Notes
    -----
    v' = g - k (v - w) has v(t) = e0 v + g t e1 + w (1 - e0) and the mean of v over t is
    e1 v + g t e2 + w (1 - e1), with e0, e1, e2 of `decay` at z = k t.

    """
    g = np.array(gravity, dtype=np.float64)
    k = drag.linear if drag else 0.0
    wind = np.array(drag.wind if drag else (0.0, 0.0, 0.0), dtype=np.float64)
    e0, e1, e2 = decay(k * dt)
    with np.errstate(over='ignore', invalid='ignore'):      # such particles are frozen
        end = g * (dt * e1) + wind * (k * dt * e1)
        mean = g * (dt * e2) + wind * (k * dt * e2)
    if flight == 'symplectic_euler':
        e1, mean = e0, end
    c = 0.5 * dt * drag.quadratic if drag else 0.0
    return Flight(float(dt), tuple(end.tolist()), tuple(mean.tolist()), (float(e0), float(e1)),
                  (float(c), *(wind.tolist() if c > 0.0 else (0.0, 0.0, 0.0))))


@formula
def quadratic_factor(speed, half_step):
    """
    Factor on the velocity relative to the wind after half a step of v' = -c |v| v.

    Parameters
    ----------
    speed : float [m/s]
        Size of the velocity relative to the wind.
    half_step : float [s/m]
        c dt / 2.

    Returns
    -------
    factor : float [-]
        1 / (1 + c |v| dt / 2), the closed form.

    """
    return 1.0 / (1.0 + half_step * speed)


@inlined
def affine(gains, which, velocity, shift):
    """Gain times velocity plus shift."""
    return gains[which] * velocity + shift


@kernel
def slowed(quadratic, v):
    """Velocity after half a step of quadratic drag, if there is any."""
    if quadratic[0] > 0.0:
        wind = (quadratic[1], quadratic[2], quadratic[3])
        u = (v[0] - wind[0], v[1] - wind[1], v[2] - wind[2])
        f = quadratic_factor(sqrt(dot(u, u)), quadratic[0])
        return (wind[0] + f * u[0], wind[1] + f * u[1], wind[2] + f * u[2])
    return v


@inlined
def fly_calmly(flight, v):
    """Mean and end velocity of a step as `fly`, without quadratic drag."""
    gains, end, mean = flight.gains, flight.end_shift, flight.mean_shift
    after = (affine(gains, 0, v[0], end[0]), affine(gains, 0, v[1], end[1]),
             affine(gains, 0, v[2], end[2]))
    between = (affine(gains, 1, v[0], mean[0]), affine(gains, 1, v[1], mean[1]),
               affine(gains, 1, v[2], mean[2]))
    return between, after


@formula
def fly(flight, velocity):
    """
    Mean and end velocity of a step without collisions.

    Parameters
    ----------
    flight : Flight
        Coefficients of the step.
    velocity : (3,) tuple of float [m/s]
        At the start of the step.

    Returns
    -------
    mean, end : (3,) tuple of float [m/s]

    """
    between, after = fly_calmly(flight, slowed(flight.quadratic, velocity))
    return between, slowed(flight.quadratic, after)
