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
The collision stage between particles: elastic, on the velocities at the start of the step.

Two particles collide if they overlap where their candidates end (with sweeps: meet on the way) and
approach each other. Who pressed on each other when the last step ended stays in contact, unless
they approach faster than gravity makes it in a step: what the sweeps of a pile have left of an
approach is no collision. Each gets its part, by the masses, of one change of their relative
velocity: restitution along the normal, friction along the surface. So the momentum of a pair is
conserved to rounding, and with restitution 1 and without friction its energy. Balls do not spin:
friction at their surfaces does not conserve angular momentum about their centres.

Of several collisions of one particle the deepest comes first (with sweeps: the earliest). In each
round the pairs respond that come first for both of their particles; their candidates are flown
anew, the pairs that they are part of are looked at again, and the next round follows until nobody
collides. A particle collides MOST_HITS times in a step; what is left is for the contact stage, in
piles.py. Ties go to the pair that was listed first, and the list is in the order of the places, so
that nothing depends on the order of the particles.
"""

from math import inf, sqrt
from typing import NamedTuple, Optional

from collision_sim.core.candidates import fly_anew
from collision_sim.core.impulses import dry_factor, wet_factor
from collision_sim.core.jit import entry, inlined, kernel, law
from collision_sim.core.laws import normal_impulse
from collision_sim.core.ledger import book, INTERNAL, kinetic
from collision_sim.core.neighbours import LOW_BITS
from collision_sim.core.pair_memory import recall
from collision_sim.core.rules import Here, N_PAIR_COLLISION, NONE, ROUNDING
from collision_sim.core.shapes import RESTITUTION
from collision_sim.core.stepping import BLOCK
from collision_sim.core.threads import CLAIMED, ENTERED, fetch_add, LEFT
from collision_sim.core.vectors import (add_scaled, dot, largest, length, scaled, subtract)
import numpy as np

MOST_HITS = 10          # of a particle in a step
FIRST, SECOND = 0, 1    # columns of the ends of a pair


class Matter(NamedTuple):
    """Radius [m] and inverse mass [1/kg] of each particle, (N,); 0 for an infinite mass."""

    radius: np.ndarray
    inverse: np.ndarray


class PairRules(NamedTuple):
    """
    What pairs do; absent friction is None.

    laws (C + 1, shapes.COLUMNS): laws of the colliders and, last, of pairs; dry, wet: 1 if pairs
    have such friction; slow [m/s]: what gravity does in a step, up to which who pressed on
    each other does not collide; part [-]: what the mean velocity gets of what a constant force
    gives to the end velocity.
    """

    laws: np.ndarray
    dry: Optional[int]
    wet: Optional[int]
    slow: float
    part: float


class Meetings(NamedTuple):
    """
    The pairs that are near each other: scratch.

    ends (P, 2) int32: their particles; known (P,) int32: row of the memory, NONE for those that
    did not press; order (P,) float64: which comes first, inf for those that do not collide; normal
    (P, 3) [-]: from the second to the first; first (N,) int32: the pair that comes first for a
    particle; moved, hits (N,) int32: the round in which it has collided last, and how often it
    has; struck (N,) int32: who has collided; before (3, N) [m/s]: its velocity before it has.
    """

    ends: np.ndarray
    known: np.ndarray
    order: np.ndarray
    normal: np.ndarray
    first: np.ndarray
    moved: np.ndarray
    hits: np.ndarray
    struck: np.ndarray
    before: np.ndarray


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
def _meet_at_end(dt, size, x, v, candidates, i, j):
    """Depth with a minus sign [m] where the candidates end, and the normal there."""
    distance, n = direction(apart_at_end(dt, x, candidates, i, j), v)
    return (distance - size if distance < size else inf), n


@inlined
def _meet_on_way(dt, size, x, v, candidates, i, j):
    """
    Share of the step after which two particles meet, inf if they do not, and the normal there.

    Who overlaps at the start meets there. Else, with the place m on the relative path d that is
    closest to touching centres, the path is inside for sqrt(size^2 - m^2) before it.
    """
    r = subtract(column(x, i), column(x, j))
    d = scaled(dt, subtract(column(candidates.u, i), column(candidates.u, j)))
    distance, n = direction(r, v)
    if distance < size:
        return 0.0, n
    way, along = length(d), dot(r, d)
    if not along < 0.0:
        return inf, n
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
def _meet(sweep, dt, size, x, v, candidates, i, j):
    """When or how deep two particles meet, inf if they do not, and the normal."""
    if sweep is not None:
        return _meet_on_way(dt, size, x, v, candidates, i, j)
    return _meet_at_end(dt, size, x, v, candidates, i, j)


@kernel
def look_at(sweep, slow, dt, matter, x, v, candidates, meetings, p):
    """Write when or how deep pair p collides, and its normal."""
    i, j = meetings.ends[p, FIRST], meetings.ends[p, SECOND]
    vi, vj = column(v, i), column(v, j)
    relative = subtract(vi, vj)
    order, n = _meet(sweep, dt, matter.radius[i] + matter.radius[j], x, relative, candidates, i, j)
    least = ROUNDING * (largest(vi) + largest(vj))
    if meetings.known[p] != NONE:
        least = max(least, slow)
    if not dot(n, relative) < -least or (
            max(meetings.hits[i], meetings.hits[j]) >= MOST_HITS):
        order = inf
    meetings.order[p] = order
    meetings.normal[p, 0], meetings.normal[p, 1], meetings.normal[p, 2] = n


@kernel
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
            put(meetings.before, i, column(v, i))
            put(meetings.before, j, column(v, j))
            look_at(sweep, slow, dt, matter, x, v, candidates, meetings, p)


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
        As in `collide_all`.
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


@inlined
def friction_factor(dry, wet, laws, c, slip, dv_n):
    """Factor of the friction in row c of the laws on a tangential velocity; 1 without friction."""
    if dry is None and wet is None:
        return 1.0
    return dry_factor(dry, laws, c, length(slip), dv_n) * wet_factor(wet, laws, c, dv_n)


@inlined
def relative_change(rules, relative, n):
    """Change of the relative velocity [m/s] of a pair in a collision along the normal n."""
    c = rules.laws.shape[0] - 1
    v_n = dot(relative, n)
    dv_n = normal_impulse(v_n, rules.laws[c, RESTITUTION])
    slip = add_scaled(relative, -v_n, n)
    factor = friction_factor(rules.dry, rules.wet, rules.laws, c, slip, dv_n)
    return add_scaled(scaled(dv_n, n), factor - 1.0, slip)


@inlined
def _change(flight, ledger, v, candidates, i, change):
    """Change the velocity of particle i at the start of the step, and fly it anew."""
    before = column(v, i)
    after = add_scaled(before, 1.0, change)
    here = Here(0, 0, 0, i // BLOCK, i, 0.0, None)
    u, w = fly_anew(candidates, ledger, here, flight, before, after, column(candidates.u, i),
                    column(candidates.w, i))
    book(ledger, here, INTERNAL, kinetic(before, after))
    put(v, i, after)
    put(candidates.u, i, u)
    put(candidates.w, i, w)


@kernel
def collide(rules, flight, matter, ledger, v, candidates, meetings, p):
    """Let the particles of pair p collide."""
    i, j = meetings.ends[p, FIRST], meetings.ends[p, SECOND]
    n = (meetings.normal[p, 0], meetings.normal[p, 1], meetings.normal[p, 2])
    dv = relative_change(rules, subtract(column(v, i), column(v, j)), n)
    total = matter.inverse[i] + matter.inverse[j]
    _change(flight, ledger, v, candidates, i, scaled(matter.inverse[i] / total, dv))
    _change(flight, ledger, v, candidates, j, scaled(-matter.inverse[j] / total, dv))


@kernel
def _choose(meetings, count):
    """Let each particle choose the pair that comes first; whether there is any."""
    found = False
    for p in range(count):
        if meetings.order[p] < inf:
            found = True
            for k in range(2):
                i = meetings.ends[p, k]
                if meetings.first[i] == NONE or (
                        meetings.order[p] < meetings.order[meetings.first[i]]):
                    meetings.first[i] = p
    return found


@inlined
def _note(meetings, i, turn, struck):
    """Note that a particle has collided in a round; how many have."""
    if meetings.hits[i] == 0:
        meetings.struck[struck] = i
        struck += 1
    meetings.moved[i] = turn
    meetings.hits[i] += 1
    return struck


@kernel
def _respond(rules, flight, matter, ledger, v, candidates, meetings, count, turn, struck):
    """Let the pairs collide that both of their particles have chosen; how many, and who has."""
    hits = 0
    for p in range(count):
        if meetings.order[p] < inf:
            i, j = meetings.ends[p, FIRST], meetings.ends[p, SECOND]
            if meetings.first[i] == p and meetings.first[j] == p:
                collide(rules, flight, matter, ledger, v, candidates, meetings, p)
                struck = _note(meetings, j, turn, _note(meetings, i, turn, struck))
                hits += 1
    return hits, struck


@kernel
def _forget(meetings, count):
    """Forget the choices."""
    for p in range(count):
        if meetings.order[p] < inf:
            meetings.first[meetings.ends[p, FIRST]] = NONE
            meetings.first[meetings.ends[p, SECOND]] = NONE


@law
def collide_all(sweep, rules, flight, matter, ledger, x, v, candidates, meetings, count,
                accounts):
    """
    Run the collision stage between particles.

    Parameters
    ----------
    sweep : int or None
        1: pairs meet on the way; None: where their candidates end.
    rules : PairRules
        What pairs do.
    flight, ledger, x, v, candidates
        As in candidates.py; v and the candidates are changed.
    matter : Matter
        Of the particles.
    meetings : Meetings
        Of `list_meetings`; written. `first` and `moved` are NONE, `hits` 0 before and after.
    count : int
        How many pairs are listed.
    accounts : (blocks, ACCOUNTS) int64
        Collisions are counted in the first row.

    """
    turn, struck = 0, 0
    while _choose(meetings, count):
        hits, struck = _respond(rules, flight, matter, ledger, v, candidates, meetings, count,
                                turn, struck)
        accounts[0, N_PAIR_COLLISION] += hits
        _forget(meetings, count)
        for p in range(count):
            i, j = meetings.ends[p, FIRST], meetings.ends[p, SECOND]
            if turn in (meetings.moved[i], meetings.moved[j]) and can_meet(matter, i, j):
                look_at(sweep, rules.slow, flight.dt, matter, x, v, candidates, meetings, p)
        turn += 1
    for k in range(struck):
        meetings.moved[meetings.struck[k]], meetings.hits[meetings.struck[k]] = NONE, 0
