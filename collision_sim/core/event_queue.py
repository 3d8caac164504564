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
The queue of events: one heap with a seat for each particle.

A particle keeps the first event that it knows of. Nothing is taken out where an event has become
void: who was to be met has got older then, which is seen when the event's turn comes.
"""

from math import inf

from collision_sim.core.event_state import END, ENDS, LEAVES, MEETS
from collision_sim.core.jit import inlined, kernel

BRANCHES = 4


@inlined
def _first_of(gas, i):
    """Time of the first event of a particle; infinite if there is none in the step."""
    states = gas.states
    t = min(states[i, MEETS], min(states[i, ENDS], states[i, LEAVES]))
    return t if t < gas.clock[END] else inf


@inlined
def _rise(gas, seat, t, i):
    """Let an event rise from a free seat to where it comes after the one above it."""
    keys, seats, seat_of = gas.heap.keys, gas.heap.seats, gas.heap.seat_of
    while seat > 0:
        above = (seat - 1) // BRANCHES
        if not t < keys[above]:
            break
        keys[seat], seats[seat] = keys[above], seats[above]
        seat_of[seats[seat]] = seat
        seat = above
    keys[seat], seats[seat], seat_of[i] = t, i, seat


@inlined
def _sink(gas, seat, t, i):
    """Let an event sink from a free seat to where none below it comes before it."""
    keys, seats, seat_of = gas.heap.keys, gas.heap.seats, gas.heap.seat_of
    count = keys.shape[0]
    while BRANCHES * seat + 1 < count:
        first = BRANCHES * seat + 1
        best = first
        for child in range(first + 1, min(first + BRANCHES, count)):
            if keys[child] < keys[best]:
                best = child
        if not keys[best] < t:
            break
        keys[seat], seats[seat] = keys[best], seats[best]
        seat_of[seats[seat]] = seat
        seat = best
    keys[seat], seats[seat], seat_of[i] = t, i, seat


@kernel
def seat_at(gas, i, t):
    """Give a particle the seat that belongs to a time [s]."""
    seat = gas.heap.seat_of[i]
    if t < gas.heap.keys[seat]:
        _rise(gas, seat, t, i)
    elif t > gas.heap.keys[seat]:
        _sink(gas, seat, t, i)


@inlined
def reseat(gas, i):
    """Give a particle the seat that belongs to its first event."""
    seat_at(gas, i, _first_of(gas, i))


@kernel
def seat_all(gas):
    """Put all particles into the heap."""
    keys, seats, seat_of = gas.heap.keys, gas.heap.seats, gas.heap.seat_of
    count = keys.shape[0]
    for i in range(count):
        keys[i], seats[i], seat_of[i] = _first_of(gas, i), i, i
    for seat in range((count - 2) // BRANCHES, -1, -1):
        _sink(gas, seat, keys[seat], seats[seat])
