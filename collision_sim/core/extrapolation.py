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
The integrator of the event-driven method: extrapolation of two simple rules.

A particle that slides on curved or turning surfaces, or flies with quadratic drag, is integrated
by Gragg's modified midpoint rule, extrapolated in the square of the substep. Where friction is
stiff, the linearly implicit Euler rule, extrapolated in the substep, takes its place: dry friction
turns a slow slide into the direction of the drive at the rate mu N / |w|, wet friction and drag
slow it at D N and k. These rates, at the start of the step, are all that is implicit.

Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.9, and II, IV.9.
"""

from collision_sim.core.courses import frame_acceleration, material_velocity
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.meeting import ZERO
from collision_sim.core.rules import NONE
from collision_sim.core.shapes import KINETIC, WET
from collision_sim.core.surfaces import FACES
from collision_sim.core.sustained import held, normal_at
from collision_sim.core.vectors import (add, add_scaled, cross, dot, EPSILON, largest, length,
                                        subtract)

ROWS = 6                # extrapolations of a step: order 12, or 6 where it is stiff
NOISE = 16.0 * EPSILON  # relative size of a change of place that is only rounding


@kernel
def _midpoints(world, forces, here, courses, holds, t, x, v, a, h, count):
    """Gragg's modified midpoint rule with `count` substeps, an even number."""
    s = h / count
    x0, v0 = x, v
    x1, v1 = add_scaled(x, s, v), add_scaled(v, s, a)
    for m in range(1, count):
        a, _ = held(world, forces, here, courses, holds, t + m * s, x1, v1)
        x0, x1 = x1, add_scaled(x0, 2.0 * s, v1)
        v0, v1 = v1, add_scaled(v0, 2.0 * s, a)
    return x1, v1


@kernel
def _implicit_steps(world, forces, here, courses, holds, t, x, v, along, across, rates, h, count):
    """
    Linearly implicit Euler rule with `count` substeps; `rates` as from `stiffness`.

    Friction depends on the velocity relative to the first collider, whose material point, where
    the particle is, accelerates by itself: that part is explicit.
    """
    poses = world.poses
    s, c = h / count, holds[0] // FACES
    for m in range(count):
        a, _ = held(world, forces, here, courses, holds, t + m * s, x, v)
        if holds[0] != NONE:
            w = subtract(v, material_velocity(courses, poses, here, c, t + m * s, x))
            own = frame_acceleration(courses, poses, here, c, t + m * s, x,
                                     (0.5 * w[0], 0.5 * w[1], 0.5 * w[2]))
            a, v = subtract(a, own), add_scaled(v, s, own)
        rest = add_scaled(add_scaled(a, -dot(a, along), along), -dot(a, across), across)
        dv = add_scaled(ZERO, s / (1.0 + s * rates[0]), rest)
        dv = add_scaled(dv, s * dot(a, along) / (1.0 + s * rates[1]), along)
        v = add(v, add_scaled(dv, s * dot(a, across) / (1.0 + s * rates[2]), across))
        x = add_scaled(x, s, v)
    return x, v


@inlined
def _grip(dry, wet, table, c, normal):
    """Give the forces of dry and of wet friction for a normal force: [m/s^2], [1/s]."""
    hold, rate = 0.0, 0.0
    if dry:
        hold = table[c, KINETIC] * normal
    if wet:
        rate = table[c, WET] * normal
    return hold, rate


@kernel
def stiffness(world, forces, here, courses, holds, t, x, v, normal):
    """
    Rates at which drag and friction slow a particle and turn its velocity.

    Parameters
    ----------
    world, forces, here, courses, holds, t, x, v
        As in `integrate`.
    normal : (3,) tuple of float [m/s^2]
        Normal forces per unit mass.

    Returns
    -------
    along, across : (3,) tuple of float [-]
        Directions of the velocity relative to the first surface, and along that surface across
        it; zero without a surface.
    rates : (3,) tuple of float [1/s]
        In all other directions, along, and across.

    """
    rules = world.rules
    k = forces.linear
    if holds[0] == NONE:
        return ZERO, ZERO, (k, k, k)
    w = subtract(v, material_velocity(courses, world.poses, here, holds[0] // FACES, t, x))
    speed, grip, wet = length(w), 0.0, 0.0
    if speed == 0.0:
        return ZERO, ZERO, (k, k, k)
    for j in range(3):
        if holds[j] != NONE:
            hold, rate = _grip(rules.dry, rules.wet, world.table, holds[j] // FACES, normal[j])
            grip, wet = grip + max(hold, 0.0), wet + max(rate, 0.0)
    along = (w[0] / speed, w[1] / speed, w[2] / speed)
    across = cross(normal_at(world, here, courses, holds[0], t, x), along)
    if holds[1] != NONE:        # on an edge there is one direction only
        across, grip = ZERO, 0.0
    return along, across, (k, k + wet, k + wet + grip / speed)


@kernel
def integrate(world, forces, here, courses, work, stiff, holds, t, x, v, h):
    """
    One extrapolated step along the surfaces that hold a particle.

    Parameters
    ----------
    world, forces, here, courses, work
        As in exact.py.
    stiff : bool
        Which of the two rules.
    holds : (3,) tuple of int
        Surfaces; none: free flight.
    t, h : float [s]
        Start, since that of the step of the simulation, and length.
    x, v : (3,) tuple of float [m], [m/s]
        Where and how fast it starts.

    Returns
    -------
    x, v : (3,) tuple of float [m], [m/s]
    error : float [-]
        Of the changes, relative; NaN or infinite if the step failed.

    """
    a, normal = held(world, forces, here, courses, holds, t, x, v)
    along, across, rates = stiffness(world, forces, here, courses, holds, t, x, v, normal)
    power = 1 if stiff else 2
    for row in range(ROWS):
        if stiff:
            x1, v1 = _implicit_steps(world, forces, here, courses, holds, t, x, v, along, across,
                                     rates, h, row + 1)
        else:
            x1, v1 = _midpoints(world, forces, here, courses, holds, t, x, v, a, h, 2 * row + 2)
        for d in range(3):      # changes, so that extrapolation does not amplify rounding of x
            new, fast = x1[d] - x[d], v1[d] - v[d]
            for k in range(row):
                ratio = ((row + 1.0) / (row - k)) ** power - 1.0
                old, work[k, d] = work[k, d], new
                new += (new - old) / ratio
                old, work[k, 3 + d] = work[k, 3 + d], fast
                fast += (fast - old) / ratio
            work[row, d], work[row, 3 + d] = new, fast
    dx = (work[ROWS - 1, 0], work[ROWS - 1, 1], work[ROWS - 1, 2])
    dv = (work[ROWS - 1, 3], work[ROWS - 1, 4], work[ROWS - 1, 5])
    less_x = (work[ROWS - 2, 0], work[ROWS - 2, 1], work[ROWS - 2, 2])
    less_v = (work[ROWS - 2, 3], work[ROWS - 2, 4], work[ROWS - 2, 5])
    speed, error = length(v) + length(dv), 0.0
    if h * speed > 0.0:
        noise = NOISE * (h * (length(a) + length(normal) + length(forces.gravity)) + largest(v))
        miss = max(length(subtract(dx, less_x)) - NOISE * largest(x), 0.0)
        miss_v = max(length(subtract(dv, less_v)) - noise, 0.0)
        error = miss / (h * speed) + miss_v / speed
    return add(x, dx), add(v, dv), error
