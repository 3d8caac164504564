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
Springs between particles: their forces, how long an explicit step may be, and that step.

The force on the end at x_i of a spring to x_j is (k (l - l0) + c n.(v_j - v_i)) n with the unit
vector n from i to j: the other end gets its exact opposite. Each particle sums over its own
springs in a fixed order, so nothing depends on the number of threads.

An explicit step of length h is velocity Verlet around the flight of flight.py: half a step of the
springs' acceleration at the start, the flight, half a step of it at the end. It is of second
order, without springs it is the flight itself, and what hangs still in gravity stays still. The
damping at the end is taken at the velocity foreseen from the start.

Its stability. A mode of frequency w and damping rate g (x'' = -w^2 x - g x') is stable for
(w h)^2 / 4 + g h / 2 <= 1: the characteristic polynomial z^2 - t z + d has
t = 2 - W - G + G^2/2 + W G/4 and d = 1 - G + G^2/2 - W G/4, with W = (w h)^2 and G = g h, and its
roots are in the unit circle for W < 4 - 2 G + G^2, G < 2 (Jury's conditions). The sum of k/m over
the springs of both ends of a spring bounds w^2: the matrix between springs that share an end has
the eigenvalues of M^-1 K and these row sums (Anderson and Morley 1985). k bounds the stiffness of
a spring in every direction, since that across it is k (1 - l0 / l): the bound holds at any
elongation. Where stiffness and damping have different modes the condition is no proof; it is
checked on random networks.
"""

from math import inf
from typing import NamedTuple

from collision_sim.core.flight import fly
from collision_sim.core.jit import entry, formula, kernel
from collision_sim.core.ledger import book, book_flight, INTERNAL, kinetic
from collision_sim.core.rules import account_of
from collision_sim.core.stepping import BLOCK
from collision_sim.core.threads import CLAIMED, ENTERED, fetch_add, LEFT
from collision_sim.core.vectors import add_scaled, dot, length, scaled, subtract
import numpy as np

STIFFNESS, REST, DAMPING = range(3)     # columns of the law of a spring


class Springs(NamedTuple):
    """
    The springs, listed at both of their ends.

    start (N + 1,) int64: springs of particle i are rows start[i] to start[i + 1]; other (2 S,)
    int64: particle at the other end; law (2 S, 3): stiffness [N/m], rest length [m], damping
    [N s/m]; inverse (N,) [1/kg]: of the masses, 0 for infinite ones.
    """

    start: np.ndarray
    other: np.ndarray
    law: np.ndarray
    inverse: np.ndarray


def lay_out(pairs, laws, mass):
    """
    List springs at both of their ends, those of a particle in the order in which they are given.

    Parameters
    ----------
    pairs : (S, 2) int64
        Particles at the ends.
    laws : (S, 3) float64
        Stiffness [N/m], rest length [m], damping [N s/m].
    mass : (N,) float64 [kg]
        May be infinite.

    Returns
    -------
    Springs

    """
    ends = pairs.ravel()
    order = np.argsort(ends, kind='stable')
    start = np.concatenate([[0], np.cumsum(np.bincount(ends, minlength=len(mass)))])
    return Springs(start.astype(np.int64), pairs[:, ::-1].ravel()[order],
                   np.repeat(laws, 2, axis=0)[order], 1.0 / mass)


def mode_bounds(pairs, laws, mass):
    """
    Bounds of the modes that each spring takes part in.

    Parameters
    ----------
    pairs, laws, mass
        As in `lay_out`.

    Returns
    -------
    square, rate : (S,) float64 [1/s^2], [1/s]
        Their largest entries bound the squares of the frequencies, and the rates of damping.

    """
    ends, inverse = pairs.T.ravel(), 1.0 / mass
    with np.errstate(over='ignore', invalid='ignore'):
        sums = [inverse * np.bincount(ends, np.tile(laws[:, column], 2), len(mass))
                for column in (STIFFNESS, DAMPING)]
        return [each[pairs].sum(axis=1) for each in sums]


def longest_substep(square, rate):
    """
    Longest stable step of the explicit solver.

    Parameters
    ----------
    square, rate : (S,) float64 [1/s^2], [1/s]
        Of `mode_bounds`.

    Returns
    -------
    limit : float [s]
        2 / w without damping; infinite where no spring does anything.

    """
    with np.errstate(over='ignore', divide='ignore'):
        limits = 2.0 / (0.5 * rate + np.sqrt(0.25 * np.square(rate) + square))
    return float(np.min(limits, initial=inf))


@formula
def direction(r, first):
    """
    Length and unit vector of r [m]; along x from the first to the second end where that is 0.

    Parameters
    ----------
    r : (3,) tuple of float [m]
        From one end of a spring to the other.
    first : bool
        Whether that is from the end with the smaller index.

    Returns
    -------
    length : float [m]
    n : (3,) tuple of float [-]

    """
    distance = length(r)
    if distance == 0.0:
        return distance, (1.0 if first else -1.0, 0.0, 0.0)
    return distance, (r[0] / distance, r[1] / distance, r[2] / distance)


@formula
def tension(stiffness, rest, damping, distance, rate):
    """
    Force with which a spring pulls its ends together [N].

    Parameters
    ----------
    stiffness, rest, damping : float [N/m], [m], [N s/m]
        Law of the spring.
    distance, rate : float [m], [m/s]
        Distance of its ends, and how fast that grows.

    Returns
    -------
    force : float [N]

    """
    return stiffness * (distance - rest) + damping * rate


@kernel
def _at(table, i):
    """Column i of a table (3, N)."""
    return (table[0, i], table[1, i], table[2, i])


@kernel
def acceleration(springs, x, v, i):
    """Acceleration [m/s^2] of particle i by its springs, at places x and velocities v (3, N)."""
    place, velocity, force = _at(x, i), _at(v, i), (0.0, 0.0, 0.0)
    for s in range(springs.start[i], springs.start[i + 1]):
        j = springs.other[s]
        distance, n = direction(subtract(_at(x, j), place), i < j)
        rate = dot(n, subtract(_at(v, j), velocity))
        pull = tension(springs.law[s, STIFFNESS], springs.law[s, REST], springs.law[s, DAMPING],
                       distance, rate)
        force = add_scaled(force, pull, n)
    return scaled(springs.inverse[i], force)


@kernel
def is_held(springs, i):
    """Whether particle i is a pin: springs hold it, and its mass is infinite."""
    return springs.inverse[i] == 0.0 and springs.start[i] < springs.start[i + 1]


@kernel
def _write(table, i, value):
    table[0, i], table[1, i], table[2, i] = value


@kernel
def _begin_block(springs, flight, ledger, block, x, v, candidates, reached, foreseen):
    """Half a step of the springs, and the flight, of a block of particles."""
    for i in range(block * BLOCK, min((block + 1) * BLOCK, v.shape[1])):
        velocity, half = _at(v, i), 0.5 * flight.dt
        if is_held(springs, i):
            u, w, a = velocity, velocity, (0.0, 0.0, 0.0)
        else:
            a = acceleration(springs, x, v, i)
            kicked = add_scaled(velocity, half, a)
            u, w = fly(flight, kicked)
            here = account_of(block, i)
            book(ledger, here, INTERNAL, kinetic(velocity, kicked))
            book_flight(ledger, here, flight.dt, kicked, u, w, 1.0)
        _write(candidates.u, i, u)
        _write(candidates.w, i, w)
        _write(reached, i, add_scaled(_at(x, i), flight.dt, u))
        _write(foreseen, i, add_scaled(w, half, a))


@kernel
def _end_block(springs, dt, ledger, block, candidates, reached, foreseen):
    """Half a step of the springs at the end, of a block of particles."""
    for i in range(block * BLOCK, min((block + 1) * BLOCK, reached.shape[1])):
        flown = _at(candidates.w, i)
        w = add_scaled(flown, 0.5 * dt, acceleration(springs, reached, foreseen, i))
        book(ledger, account_of(block, i), INTERNAL, kinetic(flown, w))
        _write(candidates.w, i, w)


@entry
def begin_steps(posted, counters, springs, flight, ledger, x, v, candidates, reached, foreseen):
    """
    First half of an explicit step of all particles, block by block.

    Parameters
    ----------
    posted, counters
        Of threads.share.
    springs : Springs
        All of them.
    flight : flight.Flight
        Coefficients of the step.
    ledger : ledger.Ledger
        Written.
    x, v : (3, N) float64 [m], [m/s]
        State at the start of the step.
    candidates : candidates.Candidates
        Overwritten; complete after `end_steps`.
    reached, foreseen : (3, N) float64 [m], [m/s]
        Overwritten with the place at the end, and the velocity there to first order.

    """
    fetch_add(posted, 0, 1)
    fetch_add(counters, ENTERED, 1)
    block = fetch_add(counters, CLAIMED, 1)
    while block * BLOCK < x.shape[1]:
        _begin_block(springs, flight, ledger, block, x, v, candidates, reached, foreseen)
        block = fetch_add(counters, CLAIMED, 1)
    fetch_add(counters, LEFT, 1)


@entry
def end_steps(posted, counters, springs, dt, ledger, candidates, reached, foreseen):
    """
    Second half of an explicit step of all particles, block by block.

    Parameters
    ----------
    posted, counters, springs, ledger, candidates, reached, foreseen
        As in `begin_steps`.
    dt : float [s]
        Length of the step.

    """
    fetch_add(posted, 0, 1)
    fetch_add(counters, ENTERED, 1)
    block = fetch_add(counters, CLAIMED, 1)
    while block * BLOCK < reached.shape[1]:
        _end_block(springs, dt, ledger, block, candidates, reached, foreseen)
        block = fetch_add(counters, CLAIMED, 1)
    fetch_add(counters, LEFT, 1)


def elastic_energy(pairs, laws, position):
    """
    Energy that is stored in the springs.

    Parameters
    ----------
    pairs, laws
        As in `lay_out`.
    position : (N, 3) float64 [m]
        Of the particles.

    Returns
    -------
    energy : float [J]
        Sum of k (l - l0)^2 / 2.

    """
    stretch = lengths(pairs, position) - laws[:, REST]
    return float(0.5 * np.dot(laws[:, STIFFNESS], np.square(stretch)))


def lengths(pairs, position):
    """Lengths (S,) [m] of springs between particles at `position` (N, 3) [m]."""
    return np.linalg.norm(position[pairs[:, 1]] - position[pairs[:, 0]], axis=1)
