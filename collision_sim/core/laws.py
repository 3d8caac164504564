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
Laws of collision and friction, one formula of the lecture each.

Every function takes floats or arrays, in compiled code and in plain Python. Velocities are
relative to the collider: the normal velocity is negative when approaching, `dv_n` >= 0 is the size
of the change of normal velocity, and friction is a factor on the tangential velocity. Source of
the laws: R. Bridson's lecture notes on particle collision, contact and friction.
"""

from collision_sim.core.jit import law
import numpy as np

EXPONENTIAL, CAPPED, LINEAR = 0, 1, 2       # forms of wet friction
SMALLEST = 2.0 ** -1022                     # keeps 0 / 0 away where nothing slides
WET_FORMS = {'exponential': EXPONENTIAL, 'capped': CAPPED, 'linear': LINEAR}


@law
def normal_impulse(v_n, restitution):
    """
    Change of normal velocity in a collision, per unit mass.

    Parameters
    ----------
    v_n : float or array [m/s]
        Normal velocity; only an approaching one (negative) is changed.
    restitution : float or array [-]
        From 0 (inelastic) to 1 (elastic).

    Returns
    -------
    dv_n : float or array [m/s]
        -(1 + restitution) v_n where v_n < 0, else 0.

    """
    return -(1.0 + restitution) * np.minimum(v_n, 0.0)


@law
def dry_friction(speed, dv_n, static, kinetic):
    """
    Factor of Coulomb friction on the tangential velocity.

    Parameters
    ----------
    speed : float or array [m/s]
        Size of the tangential velocity, not negative.
    dv_n : float or array [m/s]
        Change of normal velocity, not negative.
    static, kinetic : float or array [-]
        Coefficients, static >= kinetic. Below static * dv_n the particle sticks.

    Returns
    -------
    factor : float or array [-]
        0 where speed <= static dv_n, else max(0, 1 - kinetic dv_n / speed); continuous where
        static = kinetic.

    """
    slips = speed > static * dv_n
    return slips * (1.0 - np.minimum(kinetic * dv_n / np.maximum(speed, SMALLEST), 1.0))


@law
def wet_friction_linear(coefficient, dv_n):
    """
    Factor of wet friction in its explicit form; unstable: it reverses beyond D dv_n = 1.

    Parameters
    ----------
    coefficient : float or array [s/m]
        Wet coefficient D.
    dv_n : float or array [m/s]
        Change of normal velocity, not negative.

    Returns
    -------
    factor : float or array [-]
        1 - D dv_n, of any sign.

    """
    return 1.0 - coefficient * dv_n


@law
def wet_friction_capped(coefficient, dv_n):
    """
    Factor of wet friction in its explicit form, capped at a stop.

    Parameters
    ----------
    coefficient : float or array [s/m]
        Wet coefficient D.
    dv_n : float or array [m/s]
        Change of normal velocity, not negative.

    Returns
    -------
    factor : float or array [-]
        max(0, 1 - D dv_n).

    """
    return np.maximum(wet_friction_linear(coefficient, dv_n), 0.0)


@law
def wet_friction_exponential(coefficient, dv_n):
    """
    Factor of wet friction, exact for a normal force that acts while the particle slides.

    Parameters
    ----------
    coefficient : float or array [s/m]
        Wet coefficient D.
    dv_n : float or array [m/s]
        Change of normal velocity, not negative.

    Returns
    -------
    factor : float or array [-]
        exp(-D dv_n), from 0 to 1.

    """
    return np.exp(-(coefficient * dv_n))


@law
def repulsion(depth, dt, share, highest):
    """
    Separating speed given to a particle that is inside a collider at both ends of a step.

    Parameters
    ----------
    depth : float or array [m]
        Depth inside the collider, not negative.
    dt : float [s]
        Length of the step.
    share : float [-]
        Share of the depth removed in a step, above 0 and at most 1; after n steps
        depth (1 - share)^n is left.
    highest : float [m/s]
        Largest separating speed.

    Returns
    -------
    speed : float or array [m/s]
        min(share depth / dt, highest).

    Notes
    -----
    Source: Bridson, Fedkiw, Anderson (2002), section 7.4: at most a tenth of the depth a step.

    """
    return np.minimum(share * depth / dt, highest)
