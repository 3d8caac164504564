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
Steps of particles that collide with each other, event by event.

Events are that two particles meet, that the path of one ends (exact.py: it comes to a collider,
stops, is let go of), and that one changes cells. Each particle keeps the first event it knows of
in one heap; an event of two is known to one of them. After an event only those that it is about
look for what comes next, in 27 cells, so its cost does not depend on how many particles there are.

What is answered how: event_rounds.py. Who presses on whom: event_presses.py.
"""

from math import inf

from collision_sim.core.event_meetings import change_cell, predict, predict_all
from collision_sim.core.event_presses import find_pressed, settle_pressed
from collision_sim.core.event_queue import reseat, seat_all
from collision_sim.core.event_rounds import bring_up, is_void, play_round
from collision_sim.core.event_state import (AGE, BEAT, BOUND, COUNTED, END, ENDS, FREE, HITS, KIND,
                                            LAST, LATEST, LEAVES, MEETS, PRESSING, put_three,
                                            RAPID, RELEASED, ROUND, ROUNDS, SETTLES, SINCE, STEP,
                                            three, V, X)
from collision_sim.core.event_walls import begin_bound_path, settle_walls, start_bound
from collision_sim.core.jit import entry, inlined, kernel
from collision_sim.core.pairs import column, put
from collision_sim.core.placing import freeze
from collision_sim.core.rules import N_LOGGED, NONE
from collision_sim.core.vectors import is_finite

BEATS = 8               # of a step, in which those that press on each other go straight on


@inlined
def _begin_particle(gas, i):
    """Begin the step of a particle."""
    states, links = gas.states, gas.links
    put_three(states, i, X, column(gas.world.x, i))
    put_three(states, i, V, column(gas.world.v, i))
    states[i, SINCE], states[i, LATEST] = 0.0, -1.0
    states[i, MEETS] = states[i, ENDS] = states[i, LEAVES] = inf
    links[i, AGE] = links[i, RAPID] = links[i, HITS] = links[i, COUNTED] = 0
    links[i, ROUND], links[i, KIND], links[i, RELEASED] = NONE, FREE, NONE


@kernel
def _begin(gas):
    """Begin a step: paths, cells and the queue."""
    gas.numbers[ROUNDS] = gas.numbers[PRESSING] = 0
    gas.clock[BEAT], gas.clock[SETTLES] = gas.clock[END] / BEATS, inf
    gas.clock[LAST] = gas.clock[END] * (1.0 - 1e-9)
    gas.grid.head[:] = NONE
    for i in range(gas.states.shape[0]):
        _begin_particle(gas, i)
        if not gas.simple:
            gas.world.accounts[i, N_LOGGED] = 0
            start_bound(gas, i)
            if gas.links[i, KIND] == BOUND:
                begin_bound_path(gas, i, 0.0)
    predict_all(gas)
    seat_all(gas)
    if not gas.simple:
        find_pressed(gas)


@kernel
def _end(gas):
    """End a step: all paths are followed up to then."""
    end = gas.clock[END]
    for i in range(gas.states.shape[0]):
        x0 = column(gas.world.x, i)
        bring_up(gas, i, end)
        if not gas.simple:
            settle_walls(gas, i, x0)
        x, v = three(gas.states, i, X), three(gas.states, i, V)
        if not is_finite(x, v):
            x, v = freeze(gas.world.accounts, i, x0)
        put(gas.world.x, i, x)
        put(gas.world.v, i, v)


@kernel
def _run(gas):
    """Go through the events of a step."""
    keys, seats, states = gas.heap.keys, gas.heap.seats, gas.states
    while keys[0] < inf or gas.clock[SETTLES] < gas.clock[LAST]:
        i, t = seats[0], keys[0]
        if gas.clock[SETTLES] < gas.clock[LAST] and gas.clock[SETTLES] <= t:
            settle_pressed(gas, gas.clock[SETTLES])
        elif states[i, LEAVES] <= t:
            change_cell(gas, i, t)
            reseat(gas, i)
        elif states[i, MEETS] <= states[i, ENDS] and is_void(gas, i):
            predict(gas, i, t)
            reseat(gas, i)
        else:
            play_round(gas, i, t)


@entry
def step_gas(gas, duration, steps):
    """
    Take all particles through some steps, in place.

    Parameters
    ----------
    gas : event_state.Gas
        By reference.
    duration : float [s]
        Of a step.
    steps : int
        How many.

    """
    gas.clock[END] = duration
    if gas.states.shape[0] > 0:
        for step in range(steps):
            gas.numbers[STEP] = step
            _begin(gas)
            _run(gas)
            _end(gas)
