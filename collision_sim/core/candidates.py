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
Candidates of particles that act on each other: springs and pairs change them before colliders do.

Without such forces a candidate is the free flight (flight.py), and none is laid out (NOBODY). With
them the mean velocity u and the end velocity w of every particle are laid out here, first those of
the free flight, then with what springs and pairs add; response.py starts from them.
"""

from typing import NamedTuple

from collision_sim.core.blocks import fly_block
from collision_sim.core.flight import fly
from collision_sim.core.jit import formula, inlined
from collision_sim.core.ledger import (book, book_flight, book_flights, GRAVITY, INTERNAL,
                                       is_kept, weight_of)
from collision_sim.core.rules import account_of
from collision_sim.core.vectors import add, dot, subtract
import numpy as np


class Candidates(NamedTuple):
    """
    Mean and end velocity of every particle over a step, both (3, N) float64 [m/s].

    settled (N,) int8: 1 for particles whose collisions of the step pairs have answered, with those
    of their colliders; what is left for these is to end no step inside, and no approach twice.
    """

    u: np.ndarray
    w: np.ndarray
    settled: np.ndarray


def make_candidates(count):
    """Allocate the candidates of a number of particles."""
    return Candidates(np.empty((3, count)), np.empty((3, count)), np.zeros(count, dtype=np.int8))


NOBODY = make_candidates(0)     # where springs and pairs change nothing


@inlined
def is_settled(candidates, i):
    """Whether pairs have answered the collisions of particle i, with those of its colliders."""
    if candidates.settled.shape[0] > 0:
        return candidates.settled[i] != 0
    return False


@formula
def fly_freely(flight, v, ledger, block_size, candidates):
    """
    Write the free flights of particles with velocities v (3, N) [m/s] to their candidates.

    Parameters
    ----------
    flight : flight.Flight
        Coefficients of the step.
    v : (3, N) float64 [m/s]
        At the start of the step.
    ledger : ledger.Ledger
        Where the flights are booked.
    block_size : int
        Particles to a row of the ledger.
    candidates : Candidates
        Overwritten.

    """
    for i in range(v.shape[1]):
        start = (v[0, i], v[1, i], v[2, i])
        u, w = fly(flight, start)
        here = account_of(i // block_size, i)
        book_flight(ledger, here, flight.dt, start, u, w, 1.0)
        for d in range(3):
            candidates.u[d, i], candidates.w[d, i] = u[d], w[d]


@inlined
def is_lean(candidates, ledger, quadratic):
    """Whether candidates need no velocities: free flights, no quadratic drag, not booked."""
    if is_kept(ledger):
        return False
    return candidates.settled.shape[0] == 0 and quadratic[0] == 0.0


@inlined
def fly_or_take(candidates, ledger, flight, block, first, x, y, z, vx, vy, vz, new, factor):
    """
    Write the candidates of a block: its free flights, which are booked, or what is laid out.

    Parameters
    ----------
    candidates : Candidates
        Of no particle for free flights.
    ledger : ledger.Ledger
        Where free flights are booked; candidates have been before.
    flight, x, y, z, vx, vy, vz, new, factor
        As in blocks.fly_block.
    block, first : int
        Which one, and the index of its first particle.

    """
    if candidates.settled.shape[0] > 0:
        u, w = candidates.u, candidates.w
        for i in range(x.shape[0]):
            k = first + i
            new[0, i] = x[i] + flight.dt * u[0, k]
            new[1, i] = y[i] + flight.dt * u[1, k]
            new[2, i] = z[i] + flight.dt * u[2, k]
            new[3, i], new[4, i], new[5, i] = w[0, k], w[1, k], w[2, k]
    else:
        fly_block(flight, x, y, z, vx, vy, vz, new, factor)
        book_flights(ledger, flight.dt, block, first, x, y, z, vx, vy, vz, new)


@inlined
def candidate_of(candidates, flight, i, v):
    """Mean and end velocity of particle i with velocity v at the start of the step."""
    if candidates.settled.shape[0] > 0:
        return ((candidates.u[0, i], candidates.u[1, i], candidates.u[2, i]),
                (candidates.w[0, i], candidates.w[1, i], candidates.w[2, i]))
    return fly(flight, v)


@inlined
def mean_anew(flight, v, after, u):
    """Mean velocity [m/s] of `fly_anew`, of a particle that springs or pairs act on."""
    return add(fly(flight, after)[0], subtract(u, fly(flight, v)[0]))


@inlined
def fly_anew(world, here, flight, v, after, u, w):
    """
    Mean and end velocity once a collision has changed the velocity at the start of the step.

    What springs and pairs gave to the candidate stays as it is.

    Parameters
    ----------
    world, here, flight
        As in response.resolve.
    v, after : (3,) tuple of float [m/s]
        Velocity at the start of the step, before and after the collision.
    u, w : (3,) tuple of float [m/s]
        Mean and end velocity of the candidate so far.

    Returns
    -------
    u, w : (3,) tuple of float [m/s]

    """
    ledger = world.ledger
    u_new, w_new = fly(flight, after)
    if world.candidates.settled.shape[0] > 0:
        u_old, w_old = fly(flight, v)
        du, dw = subtract(u, u_old), subtract(w, w_old)
        book_flight(ledger, here, flight.dt, v, u_old, w_old, -1.0)
        book_flight(ledger, here, flight.dt, after, u_new, w_new, 1.0)
        book(ledger, here, INTERNAL, dot(dw, subtract(w_new, w_old)))
        return add(u_new, du), add(w_new, dw)
    book_flight(ledger, here, flight.dt, v, u, w, -1.0)
    book_flight(ledger, here, flight.dt, after, u_new, w_new, 1.0)
    return u_new, w_new


@formula
def book_candidates(ledger, block_size, dt, before, after):
    """
    Book what springs or pairs have changed in the candidates as energy of internal forces.

    Parameters
    ----------
    ledger : ledger.Ledger
        Written.
    block_size : int
        Particles to a row of the ledger.
    dt : float [s]
        Length of the step.
    before, after : Candidates
        As they were, and as they are.

    """
    g = ledger.gravity
    for i in range(after.u.shape[1]):
        shift, change = 0.0, 0.0
        for d in range(3):
            shift += dt * g[d] * (after.u[d, i] - before.u[d, i])
            old, new = before.w[d, i], after.w[d, i]
            change += 0.5 * (new - old) * (new + old)
        m, row = weight_of(ledger.weight, i), i // block_size
        ledger.rows[row, GRAVITY] += m * shift
        ledger.rows[row, INTERNAL] += m * (change - shift)
