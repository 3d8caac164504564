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
When two particles meet on their paths.

Of free flights the relative path r + s w is straight, with s the time, or with linear drag k the
stretched time (1 - e^(-k h)) / k: they meet at distance d where

    s = (r^2 - d^2) / (-r.w + sqrt(w^2 d^2 - |r x w|^2)),

a form in which nothing cancels. Of other paths the distance bends down no faster than the relative
acceleration: steps of the time for which it is sure to stay above d end where they meet, and miss
nothing.
"""

from math import inf, log1p, sqrt

from collision_sim.core.courses import frame_acceleration, largest_jerk, spin_rate
from collision_sim.core.event_cells import cell_number, enter, exit_time, leave
from collision_sim.core.event_state import (ACCELERATION, AGE, AT, BEAT, BEND, CLOSED, DECAY, END,
                                            ENDS, FREE, HOLDS, KIND, LEAVES, MEETS, MODE,
                                            NEXT_BEST, OTHER, OTHER_AGE, PRESSES, RADIUS, SETTLES,
                                            SINCE, spot_at, state_of, three, V, X)
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.meeting import ZERO
from collision_sim.core.pairs import direction
from collision_sim.core.paths import safe_time
from collision_sim.core.rules import N_UNDECIDED, NONE, ROUNDING
from collision_sim.core.surfaces import FACES
from collision_sim.core.sustained import RESTS
from collision_sim.core.vectors import add_scaled, cross, dot, EPSILON, largest, length, subtract

TIE = 1e-10             # share of their distance: who is as close touches
QUIET = 1e-6            # share of what gravity does in a beat: slower, those that press do not hit
SOON = 1e-6             # share of a beat that is left to the next one
NEARLY = 1e-6           # share of the square of a distance: farther apart, nobody touches
SEARCH = 10_000         # most looks at a pair before the search is given up as undecided


@inlined
def closing_noise(vi, vj):
    """Speed [m/s] of two particles towards each other that is only rounding."""
    return ROUNDING * (largest(vi) + largest(vj))


@inlined
def least_closing(gas, i, j, vi, vj):
    """Speed [m/s] of two particles towards each other up to which they do not collide."""
    noise = closing_noise(vi, vj)
    if not gas.simple:
        if gas.links[i, KIND] == PRESSES or gas.links[j, KIND] == PRESSES:
            noise = max(noise, QUIET * gas.clock[BEAT] * length(gas.forces.gravity))
    return noise


@inlined
def reach(gas, size, xi, xj, vi, vj):
    """Distance [m] of two particles up to which they touch."""
    way = 4.0 * EPSILON * gas.clock[END] * (largest(vi) + largest(vj))
    return size + TIE * size + ROUNDING * (largest(xi) + largest(xj)) + way


@inlined
def _meet_straight(gas, size, blur, xi, vi, xj, vj):
    """Time [s] until two particles in free flight meet; infinite if they do not."""
    r, w = subtract(xi, xj), subtract(vi, vj)
    b, square = dot(r, w), dot(r, r)
    c = square - size * size
    if b >= 0.0 and square > 0.0:
        return inf
    if c <= size * (NEARLY * size + blur):
        near = reach(gas, size, xi, xj, vi, vj)
        if square <= near * near:
            _, n = direction(r, w)
            if not dot(n, w) < -closing_noise(vi, vj):
                return inf
            if c <= 0.0:
                return 0.0
    ww = dot(w, w)
    room = b * b - ww * c
    if not room > -1e-9 * b * b:
        return inf
    turn = cross(r, w)
    room = ww * size * size - dot(turn, turn)
    if not room > 0.0:
        return inf
    s = max(c, 0.0) / (sqrt(room) - b)
    k = gas.forces.linear
    if k > 0.0:
        return -log1p(-k * s) / k if k * s < 1.0 else inf
    return s


@kernel
def bend_of_path(gas, i, t, v):
    """Give the acceleration [m/s^2] of a particle, and a bound on how fast it may change it."""
    if gas.links[i, KIND] == FREE:
        f = gas.forces
        a = add_scaled(f.gravity, -f.linear, subtract(v, f.wind))
        return a, f.linear * length(a) * (gas.clock[END] - t)
    ways, h = gas.ways, gas.clock[END] - t
    if int(ways[i, MODE]) == RESTS:
        here, c = spot_at(gas, i), int(ways[i, HOLDS]) // FACES
        x, _ = state_of(gas, i, t)
        a = frame_acceleration(gas.courses, gas.world.poses, here, c, t, x, ZERO)
        spin = spin_rate(gas.courses, here, c)
        return a, (largest_jerk(gas.courses, here, c) + spin * length(a)) * h + (
            2.0 * spin * length(v) * spin)
    if ways[i, CLOSED] > 0.0:
        k = ways[i, DECAY]
        a = add_scaled(three(ways, i, ACCELERATION), -k, v)
        return a, k * length(a) * h
    return ZERO, ways[i, BEND]


@kernel
def _meet_bent(gas, i, j, t, end):
    """Time [s] at which two particles meet of which not both fly freely; infinite if not."""
    size, slow = gas.states[i, RADIUS] + gas.states[j, RADIUS], 0.0
    both = gas.links[i, KIND] == PRESSES and gas.links[j, KIND] == PRESSES
    soon = end - SOON * gas.clock[BEAT]
    if both:
        slow = 2.0 * gas.clock[BEAT] * length(gas.forces.gravity)
    for _ in range(SEARCH):
        xi, vi = state_of(gas, i, t)
        xj, vj = state_of(gas, j, t)
        r, w = subtract(xi, xj), subtract(vi, vj)
        distance, n = direction(r, w)
        gap, rate = distance - size, dot(n, w)
        fine = ROUNDING * (largest(xi) + largest(xj) + size)
        above = max(gap, 0.0)
        if gap <= fine:
            if rate < -least_closing(gas, i, j, vi, vj):
                return t
            above, rate = above + fine, max(rate, 0.0)
        a, change = bend_of_path(gas, i, t, vi)
        b, other = bend_of_path(gas, j, t, vj)
        step = safe_time(above, rate, length(subtract(a, b)) + change + other)
        if not t + step < end or (both and t + step >= soon and rate * rate <= slow * slow):
            return inf
        t += max(step, EPSILON * end)
    gas.world.accounts[i, N_UNDECIDED] += 1
    return t


@inlined
def _meet(gas, i, j, t, blur, xi, vi):
    """Time [s] at which particle i, at xi with vi now, meets j; infinite if it does not."""
    states = gas.states
    size = states[i, RADIUS] + states[j, RADIUS]
    if gas.simple or (gas.links[i, KIND] == FREE and gas.links[j, KIND] == FREE):
        xj, vj = state_of(gas, j, t)
        return t + _meet_straight(gas, size, blur, xi, vi, xj, vj)
    end = min(gas.clock[END], min(states[i, ENDS], states[j, ENDS]))
    if gas.links[i, KIND] == PRESSES or gas.links[j, KIND] == PRESSES:
        end = min(end, gas.clock[SETTLES])
    return _meet_bent(gas, i, j, t, end)


@inlined
def can_meet(gas, i, j):
    """Whether two particles do anything to each other: not points, nor two infinite masses."""
    states, inverse = gas.states, gas.matter.inverse
    return inverse[i] + inverse[j] > 0.0 and states[i, RADIUS] + states[j, RADIUS] > 0.0


@inlined
def _blur_of(gas, xi, vi):
    """Distance [m] that is only rounding of the place of a particle and of those near it."""
    return 4.0 * ROUNDING * (largest(xi) + 4.0 * gas.grid.size + gas.clock[END] * largest(vi))


@inlined
def _look_into(gas, states, links, after, i, t, blur, xi, vi, first, found):
    """
    Look at whom particle i meets in a cell.

    Parameters
    ----------
    gas, states, links, after
        Those of event_state.Gas, and what of it is looked at most.
    i, t, blur, xi, vi
        Which particle, now, what is only rounding, and its state.
    first : int
        First particle in the cell.
    found : tuple
        When it meets somebody first, and somebody else, and whom, so far.

    Returns
    -------
    found : tuple

    """
    (best, second, other), j, g = found, first, gas.forces.gravity
    simple, quick = gas.simple, gas.forces.linear == 0.0
    fast = quick and (simple or links[i, KIND] == FREE)
    while j != NONE:
        if j != i:
            if fast and (simple or links[j, KIND] == FREE):
                h = t - states[j, SINCE]
                half = 0.5 * h * h
                xj = (states[j, X] + (h * states[j, V] + half * g[0]),
                      states[j, X + 1] + (h * states[j, V + 1] + half * g[1]),
                      states[j, X + 2] + (h * states[j, V + 2] + half * g[2]))
                vj = (states[j, V] + h * g[0], states[j, V + 1] + h * g[1],
                      states[j, V + 2] + h * g[2])
                time = t + _meet_straight(gas, states[i, RADIUS] + states[j, RADIUS], blur, xi,
                                          vi, xj, vj)
            else:
                time = _meet(gas, i, j, t, blur, xi, vi)
            if time < second:
                if can_meet(gas, i, j) and (simple or time <= min(states[i, ENDS],
                                                                  states[j, ENDS])):
                    if time < best:
                        best, second, other = time, best, j
                    else:
                        second = time
        j = after[j]
    return best, second, other


@inlined
def _keep(gas, i, found):
    """Keep when a particle meets somebody."""
    states, links = gas.states, gas.links
    if found[0] < states[i, MEETS]:
        links[i, OTHER], links[i, OTHER_AGE] = found[2], links[found[2], AGE]
    states[i, MEETS], states[i, NEXT_BEST] = found[0], found[1]


@kernel
def predict(gas, i, t):
    """Find whom particle i meets first from now on, and when it leaves its cell."""
    states, links, head, after = gas.states, gas.links, gas.grid.head, gas.grid.after
    xi, vi = state_of(gas, i, t)
    blur = _blur_of(gas, xi, vi)
    states[i, MEETS], found = inf, (inf, inf, NONE)
    a, b, c = links[i, AT], links[i, AT + 1], links[i, AT + 2]
    rows, lines, planes = gas.grid.counts[0], gas.grid.counts[1], gas.grid.counts[2]
    for p in range(a - 1, a + 2):
        for q in range(b - 1, b + 2):
            line = ((p & (rows - 1)) * lines + (q & (lines - 1))) * planes
            for s in range(c - 1, c + 2):
                found = _look_into(gas, states, links, after, i, t, blur, xi, vi,
                                   head[line + (s & (planes - 1))], found)
    _keep(gas, i, found)
    _find_exit(gas, i, t, xi, vi)


@inlined
def _find_exit(gas, i, t, xi, vi):
    """Find when particle i leaves its cell."""
    bend = 0.0
    if not gas.simple and gas.links[i, KIND] != FREE:
        a, change = bend_of_path(gas, i, t, vi)
        bend = length(a) + change
    gas.states[i, LEAVES] = exit_time(gas, i, t, xi, vi, bend)


@kernel
def predict_all(gas):
    """
    Find whom each particle meets first, of those that come before it, and when it leaves its cell.

    One of two knows when they meet: that is enough.
    """
    for i in range(gas.states.shape[0]):
        xi, _ = state_of(gas, i, 0.0)
        enter(gas, i, xi)
        predict(gas, i, 0.0)


@kernel
def change_cell(gas, i, t):
    """Let particle i change to the cell where it is, and look at those that are near it now."""
    states, links, head, after = gas.states, gas.links, gas.grid.head, gas.grid.after
    xi, vi = state_of(gas, i, t)
    blur = _blur_of(gas, xi, vi)
    a, b, c = links[i, AT], links[i, AT + 1], links[i, AT + 2]
    leave(gas, i)
    enter(gas, i, xi)
    x, y, z = links[i, AT], links[i, AT + 1], links[i, AT + 2]
    if x != a or y != b or z != c:
        found = (states[i, MEETS], states[i, NEXT_BEST], links[i, OTHER])
        for p in range(x - 1, x + 2):
            for q in range(y - 1, y + 2):
                for s in range(z - 1, z + 2):
                    if abs(p - a) > 1 or abs(q - b) > 1 or abs(s - c) > 1:
                        found = _look_into(gas, states, links, after, i, t, blur, xi, vi,
                                           head[cell_number(gas, p, q, s)], found)
        _keep(gas, i, found)
    _find_exit(gas, i, t, xi, vi)
