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
Pairs of particles that are near each other in a step: which they are, and where they meet.

Two particles meet if they overlap where their candidates end, or with sweeps on the way there.
Nobody changes places with another one: who overlaps nobody at the end, and has passed somebody on
the way, has met as well. The normal is that where the paths end, with sweeps that where they meet;
where a pair has passed each other it is that where they met, else that at the end would draw them
through each other.
"""

from math import inf, sqrt
from typing import NamedTuple

from collision_sim.core.jit import entry, inlined, kernel
from collision_sim.core.lines import in_lines
from collision_sim.core.neighbours import LOW_BITS
from collision_sim.core.pair_memory import recall, resting_speed
from collision_sim.core.rules import NONE, ROUNDING
from collision_sim.core.threads import CLAIMED, ENTERED, fetch_add, LEFT
from collision_sim.core.vectors import (add_scaled, dot, largest, length, scaled, subtract)
import numpy as np

MOST_HITS = 10          # of a particle in a step
TOUCH = 2.0 ** -20      # share of the distance of two that touch by which they may be apart
FIRST, SECOND = 0, 1    # columns of the ends of a pair
# Columns of the states of particles: order of what comes first, what it takes part in, round in
# which it has collided last, how often it has, whether its colliders were looked at, rounding of
# its velocity that heavy neighbours leave [m/s], how far its path has been led away [m], its last
# pair as in `Meetings.behind`.
SOONEST, BUSY, MOVED, HITS, NEAR, BLUR, DRIFT, HEAD, STATES = range(9)


class Matter(NamedTuple):
    """Radius [m] and inverse mass [1/kg] of each particle, (N,); 0 for an infinite mass."""

    radius: np.ndarray
    inverse: np.ndarray


class PairRules(NamedTuple):
    """
    What pairs do.

    laws (C + 1, shapes.COLUMNS): laws of the colliders and, last, of pairs; dry, wet: whether
    pairs have such friction; slow [m/s]: what gravity does in a step, up to which who pressed
    on each other does not collide; part [-]: what the mean velocity gets of what a constant
    force gives to the end velocity; pull (3,) [m/s]: what gravity adds to that. Wind is left
    out: it is another one in another frame.
    """

    laws: np.ndarray
    dry: bool
    wet: bool
    slow: float
    part: float
    pull: tuple


class Meetings(NamedTuple):
    """
    The pairs that are near each other: scratch.

    ends (P, 2) int64: their particles; known (P,) int64: row of the memory, NONE for those that
    did not press; order (P,) float64: when or how deep they meet, inf for those that do not
    collide; normal (P, 3) [-]: from the second to the first; active (P,) int64: pairs that
    collide; looked (P,) int64: round in which a pair was looked at last, or a mark of piles.py;
    size (4,) int64: how many pairs there are, how many are active, how many particles have
    collided, and in this round; behind (P, 2) int64: for each end of a pair the one before of its
    particle, times two and with the end; struck, fresh (N,) int64: who has collided, and in this
    round; heat (N,) int8: of piles.py; states (N, STATES): of the
    particles, a cache line each, as they are looked up here and there.
    """

    ends: np.ndarray
    known: np.ndarray
    order: np.ndarray
    normal: np.ndarray
    active: np.ndarray
    looked: np.ndarray
    size: np.ndarray
    behind: np.ndarray
    struck: np.ndarray
    fresh: np.ndarray
    heat: np.ndarray
    states: np.ndarray


def make_meetings(pairs, count, old=None):
    """Allocate room for a number of pairs of `count` particles; what is of these is taken over."""
    each = old[8:] if old else (
        np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64),
        np.zeros(count, dtype=np.int8), _make_states(count))
    return Meetings(
        np.empty((pairs, 2), dtype=np.int64), np.empty(pairs, dtype=np.int64), np.empty(pairs),
        np.empty((pairs, 3)), np.empty(pairs, dtype=np.int64), np.empty(pairs, dtype=np.int64),
        np.zeros(4, dtype=np.int64), np.empty((pairs, 2), dtype=np.int64), *each)


def _make_states(count):
    """Allocate the states of particles that nothing has happened to."""
    states = in_lines(count * STATES).reshape(count, STATES)
    states[:] = 0.0
    states[:, SOONEST], states[:, MOVED], states[:, HEAD] = inf, NONE, NONE
    return states


@kernel
def column(table, i):
    """Column i of a table (3, N)."""
    return (table[0, i], table[1, i], table[2, i])


@kernel
def put(table, i, value):
    """Write column i of a table (3, N)."""
    table[0, i], table[1, i], table[2, i] = value


@inlined
def direction(r, v):
    """
    Length and unit vector of r [m] from the second to the first particle of a pair.

    Where the centres coincide it is opposite to their relative velocity v, so that they have met;
    where that is 0, too, it is along x.
    """
    distance = length(r)
    if distance > 0.0:
        return distance, (r[0] / distance, r[1] / distance, r[2] / distance)
    speed = length(v)
    if speed > 0.0:
        return 0.0, (-v[0] / speed, -v[1] / speed, -v[2] / speed)
    return 0.0, (1.0, 0.0, 0.0)


@inlined
def apart_at_end(dt, x, candidates, i, j):
    """Vector [m] from particle j to particle i where their candidates end."""
    r = subtract(column(x, i), column(x, j))
    return add_scaled(r, dt, subtract(column(candidates.u, i), column(candidates.u, j)))


@inlined
def meet_on_way(dt, size, x, v, candidates, i, j):
    """
    Share of the step after which two particles meet, inf if they do not, and the normal there.

    Who overlaps at the start meets there, and who touches to rounding and comes nearer: where the
    way only grazes, a square root would make much of rounding. Else, with the place m on the
    relative path d that is closest to touching centres, the path is inside for
    sqrt(size^2 - m^2) before it.
    """
    r = subtract(column(x, i), column(x, j))
    d = scaled(dt, subtract(column(candidates.u, i), column(candidates.u, j)))
    distance, n = direction(r, v)
    if distance < size:
        return 0.0, n
    way, along = length(d), dot(r, d)
    if not along < 0.0:
        return inf, n
    if distance - size <= ROUNDING * (largest(column(x, i)) + largest(column(x, j)) + size):
        return 0.0, n
    e = (d[0] / way, d[1] / way, d[2] / way)
    before = dot(r, e)
    m = add_scaled(r, -before, e)
    room = (size - length(m)) * (size + length(m))
    if not room > 0.0:
        return inf, n
    share = (-before - sqrt(room)) / way
    if share > 1.0:
        return inf, n
    return max(share, 0.0), direction(add_scaled(m, -sqrt(room), e), v)[1]


@inlined
def have_passed(x, end, i, j):
    """Whether two particles have changed places, for the vector between them at the end."""
    return dot(end, subtract(column(x, i), column(x, j))) < 0.0


@inlined
def end_normal(sweep, dt, size, x, v, candidates, i, j):
    """
    Gap [m] of two particles where their candidates end, along the normal to act on, and that.

    The normal is that at the end, unless they have passed each other, or with sweeps meet on the
    way only; the gap is then how far they are from where they have met.
    """
    end = apart_at_end(dt, x, candidates, i, j)
    distance, n = direction(end, v)
    if distance < size:
        met = have_passed(x, end, i, j)
    else:
        met = sweep
    if met:
        share, n_met = meet_on_way(dt, size, x, v, candidates, i, j)
        if share <= 1.0:
            return dot(end, n_met) - size, n_met
    return distance - size, n


@inlined
def _stands_before(x, v, i, j):
    """Whether particle i comes before j by its place, then by its velocity."""
    for d in range(3):
        if x[d, i] != x[d, j]:
            return x[d, i] < x[d, j]
    for d in range(3):
        if v[d, i] != v[d, j]:
            return v[d, i] < v[d, j]
    return False


@kernel
def _sink(x, v, particles, root, count):
    """Let an entry of a heap sink to where none below it comes after it."""
    while 2 * root + 1 < count:
        child = 2 * root + 1
        if child + 1 < count and _stands_before(x, v, particles[child], particles[child + 1]):
            child += 1
        if not _stands_before(x, v, particles[root], particles[child]):
            break
        particles[root], particles[child] = particles[child], particles[root]
        root = child


@kernel
def sort_by_place(x, v, particles, count):
    """Sort the first of some particles by place and velocity: their numbers mean nothing."""
    for root in range(count // 2 - 1, -1, -1):
        _sink(x, v, particles, root, count)
    for last in range(count - 1, 0, -1):
        particles[0], particles[last] = particles[last], particles[0]
        _sink(x, v, particles, 0, last)


@inlined
def meet(sweep, dt, size, x, v, candidates, i, j):
    """When or how deep two particles meet, inf if they do not, and the normal."""
    if sweep:
        return meet_on_way(dt, size, x, v, candidates, i, j)
    gap, n = end_normal(sweep, dt, size, x, v, candidates, i, j)
    return (gap if gap < 0.0 else inf), n


@inlined
def look_at(sweep, slow, dt, matter, memory, x, v, candidates, meetings, p):
    """Write when or how deep pair p collides, and its normal."""
    i, j = meetings.ends[p, FIRST], meetings.ends[p, SECOND]
    vi, vj = column(v, i), column(v, j)
    relative = subtract(vi, vj)
    order, n = meet(sweep, dt, matter.radius[i] + matter.radius[j], x, relative, candidates, i, j)
    speed = largest(vi) + largest(vj) + largest(column(candidates.u, i)) + largest(
        column(candidates.u, j))
    least = ROUNDING * speed + meetings.states[i, BLUR] + meetings.states[j, BLUR]
    if meetings.known[p] != NONE:
        least = max(least, resting_speed(memory, meetings.known[p], slow,
                                         matter.inverse[i] + matter.inverse[j]))
    if not dot(n, relative) < -least or is_spent(meetings, i) or is_spent(meetings, j):
        order = inf
    meetings.order[p] = order
    meetings.normal[p, 0], meetings.normal[p, 1], meetings.normal[p, 2] = n


@inlined
def is_spent(meetings, i):
    """Whether particle i has collided so often in a step that what is left is inelastic."""
    return meetings.states[i, HITS] >= MOST_HITS


@inlined
def can_meet(matter, i, j):
    """Whether two particles do anything to each other: not points, nor two infinite masses."""
    inverse, radius = matter.inverse, matter.radius
    return inverse[i] + inverse[j] > 0.0 and radius[i] + radius[j] > 0.0


@kernel
def _list_piece(sweep, slow, dt, matter, memory, cells, near, piece, first, x, v, candidates,
                meetings):
    """List the pairs that have been found in a piece, from row `first` on."""
    for k in range(near.count[piece]):
        i = cells.particle[near.found[piece, k] >> 32]
        j = cells.particle[near.found[piece, k] & LOW_BITS]
        p = first + k
        meetings.ends[p, FIRST], meetings.ends[p, SECOND] = i, j
        meetings.order[p], meetings.known[p] = inf, recall(memory, i, j)
        if can_meet(matter, i, j):
            look_at(sweep, slow, dt, matter, memory, x, v, candidates, meetings, p)


@entry
def list_meetings(posted, counters, sweep, slow, dt, matter, memory, cells, near, first, x, v,
                  candidates, meetings):
    """
    List the pairs that have been found near each other, and look at each.

    Parameters
    ----------
    posted, counters
        Of threads.share.
    sweep, matter, cells, near, x, v, candidates, meetings
        As in `pair_collisions.collide_all`.
    slow : float [m/s]
        Of PairRules.
    memory : pair_memory.Memory
        Of the last step.
    dt : float [s]
        Length of the step.
    first : (pieces,) int64
        Row at which the pairs of each piece begin.

    """
    fetch_add(posted, 0, 1)
    fetch_add(counters, ENTERED, 1)
    piece = fetch_add(counters, CLAIMED, 1)
    while piece < first.shape[0]:
        _list_piece(sweep, slow, dt, matter, memory, cells, near, piece, first[piece], x, v,
                    candidates, meetings)
        piece = fetch_add(counters, CLAIMED, 1)
    fetch_add(counters, LEFT, 1)
