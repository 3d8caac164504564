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
What colliders do to particles that also collide with each other: as in exact.py, path by path.

A path of a particle ends early where another one hits it; what has happened up to there is logged
and booked then.
"""

from math import inf

from collision_sim.core.courses import material_velocity
from collision_sim.core.event_state import (AFTER, BOUND, COUNTED, END, ENDS, FREE, FREED, FROZEN,
                                            GLIDING, keep_path, KIND, LATEST, PACE, path_of,
                                            PRESSES, put_three, RAPID, RELEASED, SINCE, spot_at,
                                            state_of, STOPPED, three, V, X)
from collision_sim.core.events import next_event
from collision_sim.core.exact import (_approaches, _book_candidate, _book_stop, _collide,
                                      _is_inside, _is_squeezed, _log_holds, _settle, _stop_jointly,
                                      CHATTER, HOP)
from collision_sim.core.exact_ledger import book_path
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.ledger import book, book_shift, INTERNAL, is_kept, kinetic, REPULSED
from collision_sim.core.meeting import gather, NOBODY, surface_of, ZERO
from collision_sim.core.paths import Path, state_at
from collision_sim.core.placing import note_unplaced
from collision_sim.core.response import resolve
from collision_sim.core.rules import N_CONTACT, N_FAIL_SAFE, NONE
from collision_sim.core.surfaces import as_here, FACES
from collision_sim.core.sustained import (choose_mode, FLIES, GLIDES, onto_surfaces, RESTS, SLIDES,
                                          smooth)
from collision_sim.core.vectors import length, scaled, subtract


@inlined
def _forces_of(gas, i):
    """Give the forces that act on a particle on its path."""
    return smooth(gas.forces) if gas.ways[i, GLIDING] > 0.0 else gas.forces


@kernel
def _end_bound_path(gas, i, t):
    """
    End the path of a particle at a time, with what it logs and books; its state is that then.

    Parameters
    ----------
    gas : event_state.Gas
        The step.
    i : int
        Which particle.
    t : float [s]
        Not after the path ends by itself.

    """
    here, path, forces, states = spot_at(gas, i), path_of(gas, i), _forces_of(gas, i), gas.states
    x, v = state_at(gas.world, forces, here, gas.courses, gas.work, path, t)
    kind = gas.links[i, KIND]
    if path.mode == SLIDES:
        x, v = onto_surfaces(gas.world, here, gas.courses, path.holds, t, x, v)
    gas.links[i, RELEASED] = NONE
    if t >= states[i, ENDS]:
        stopped = int(gas.ways[i, STOPPED])
        gas.links[i, RELEASED] = int(gas.ways[i, FREED])
        if stopped != NONE:
            v = material_velocity(gas.courses, gas.world.poses, here, stopped // FACES, t, x)
    if kind == PRESSES:
        book_shift(gas.world.ledger, here, INTERNAL, subtract(x, path.x))
    elif kind == FROZEN and path.mode == FLIES:
        v = three(gas.ways, i, AFTER)
        book_shift(gas.world.ledger, here, REPULSED, scaled(t - gas.clock[END], path.v))
    elif kind == FROZEN:
        _book_held(gas, i, path, t, x, v)
    else:
        if path.mode != FLIES:
            _log_holds(forces, gas.world, here, gas.courses, path, v, t, x, v)
        book_path(gas.world, forces, here, gas.courses, gas.work, path, t, x, v)
    put_three(states, i, X, x)
    put_three(states, i, V, v)
    states[i, SINCE] = t


@kernel
def _book_held(gas, i, path, t, x, v):
    """Book the way of a particle that goes along with a collider that holds it."""
    if is_kept(gas.world.ledger):
        here = spot_at(gas, i)
        book_shift(gas.world.ledger, here, REPULSED, subtract(x, path.x))
        book(gas.world.ledger, here, REPULSED, kinetic(path.v, v))


@inlined
def bring_up(gas, i, t):
    """Let the path of a particle end at a time."""
    if gas.simple and not is_kept(gas.world.ledger):
        x, v = state_of(gas, i, t)
        put_three(gas.states, i, X, x)
        put_three(gas.states, i, V, v)
        gas.states[i, SINCE] = t
    else:
        _bring_up_booked(gas, i, t)


@kernel
def _bring_up_booked(gas, i, t):
    if not gas.simple:
        _end_bound_path(gas, i, t)
        return
    x, v = state_of(gas, i, t)
    states, f = gas.states, gas.forces
    path = Path(FLIES, NOBODY, states[i, SINCE], three(states, i, X), three(states, i, V), True,
                f.gravity, f.linear, 0.0, False)
    book_path(gas.world, f, spot_at(gas, i), gas.courses, gas.work, path, t, x, v)
    put_three(states, i, X, x)
    put_three(states, i, V, v)
    states[i, SINCE] = t


@kernel
def gather_walls(gas, i, t):
    """Gather the colliders that a particle touches and does not leave; how many, in gas.met."""
    return gather(gas.world, spot_at(gas, i), gas.courses, gas.met, t, three(gas.states, i, X),
                  three(gas.states, i, V), 1.0, True)


@kernel
def begin_bound_path(gas, i, t):
    """
    Find how a particle goes on, and when that ends.

    That is at once for who approaches a collider: it takes part in the next round.

    Parameters
    ----------
    gas : event_state.Gas
        The step.
    i : int
        Which particle.
    t : float [s]
        Now; its state is that then.

    """
    here, states, links, ways = spot_at(gas, i), gas.states, gas.links, gas.ways
    x, v = three(states, i, X), three(states, i, V)
    if _approaches(gas.met, gather_walls(gas, i, t)):
        _wait(gas, i, t)
        return
    mode, holds = choose_mode(gas.world, gas.forces, here, gas.courses, gas.met,
                              links[i, RELEASED], t, x, v)
    ways[i, GLIDING] = mode == GLIDES
    if mode != FLIES and links[i, COUNTED] == 0:
        links[i, COUNTED] = 1
        gas.world.accounts[i, N_CONTACT] += 1
    path, end, stopped, released, pace = next_event(gas.world, _forces_of(gas, i), here,
                                                    gas.courses, gas.work,
                                                    SLIDES if mode == GLIDES else mode, holds, t,
                                                    gas.clock[END], x, v, states[i, PACE])
    put_three(states, i, V, path.v)
    states[i, ENDS], states[i, PACE] = end, pace
    ways[i, STOPPED], ways[i, FREED] = stopped, released
    keep_path(gas, i, path)
    links[i, KIND] = FREE if path.mode == FLIES and path.closed else BOUND


@kernel
def _wait(gas, i, t):
    """Let a particle wait for the next round."""
    x, v = three(gas.states, i, X), three(gas.states, i, V)
    keep_path(gas, i, Path(FLIES, NOBODY, t, x, v, True, gas.forces.gravity, 0.0, 0.0, False))
    gas.states[i, ENDS], gas.links[i, KIND] = t, BOUND
    gas.ways[i, STOPPED] = gas.ways[i, FREED] = NONE
    gas.ways[i, GLIDING] = 0.0


@kernel
def freeze_to(gas, i, s, t):
    """Fail-safe of a particle that closing surfaces hold: it goes along with one of them."""
    here, c, states = spot_at(gas, i), s // FACES, gas.states
    x, v = three(states, i, X), three(states, i, V)
    gas.world.accounts[i, N_FAIL_SAFE] += 1
    note_unplaced(gas.world, here, c, NONE)
    obj = material_velocity(gas.courses, gas.world.poses, here, c, t, x)
    _book_stop(gas.world.ledger, here, REPULSED, c, obj, x, v, x, obj)
    put_three(states, i, V, obj)
    keep_path(gas, i, Path(RESTS, (s, NONE, NONE), t, x, obj, False, ZERO, 0.0, 0.0, False))
    states[i, ENDS], gas.links[i, KIND] = inf, FROZEN
    gas.ways[i, STOPPED] = gas.ways[i, FREED] = NONE
    gas.ways[i, GLIDING] = 0.0


@kernel
def answer_walls(gas, i, t):
    """
    Let a particle collide with the colliders that it approaches, if any, and with nobody else.

    Parameters
    ----------
    gas, i, t
        As in `begin_bound_path`.

    """
    states, links, met = gas.states, gas.links, gas.met
    count, here = gather_walls(gas, i, t), spot_at(gas, i)
    if not _approaches(met, count):
        return
    x, v = three(states, i, X), three(states, i, V)
    last = states[i, LATEST]
    hop = (length(gas.forces.gravity) * (t - last) + length(v)) * (t - last)
    rapid = t == last or hop <= HOP * (length(x) + here.way)
    links[i, RAPID] = links[i, RAPID] + 1 if rapid else 0
    states[i, LATEST], links[i, RELEASED] = t, NONE
    if count > 1 and _is_squeezed(here, gas.courses, gas.world.poses, met, count, t, x, v):
        freeze_to(gas, i, surface_of(met, 0), t)
        return
    if links[i, RAPID] <= CHATTER:
        v = _collide(gas.world, gas.forces, here, gas.courses, met, count, gas.clock[END], t, x, v)
    else:
        links[i, RAPID] = 0
        x, v = _stop_jointly(gas.world, here, gas.courses, met, t, x, v)
        put_three(states, i, X, x)
        count = gather(gas.world, here, gas.courses, met, t, x, v, 1.0, False)
        if _approaches(met, count):
            freeze_to(gas, i, surface_of(met, 0), t)
            return
    put_three(states, i, V, v)


@kernel
def start_bound(gas, i):
    """Begin the step of a particle: who is inside a collider is pushed out, as by fixed steps."""
    here, states = spot_at(gas, i), gas.states
    x, v, end = three(states, i, X), three(states, i, V), gas.clock[END]
    states[i, PACE] = end
    gas.links[i, RELEASED] = NONE
    if not _is_inside(gas.world, here, gas.courses, 0.0, x):
        gas.links[i, KIND] = BOUND
        return
    _book_candidate(gas.world, as_here(here), v)
    x1, v1 = resolve(gas.world, as_here(here), x, v)
    way = scaled(1.0 / end, subtract(x1, x))
    put_three(states, i, V, way)
    put_three(gas.ways, i, AFTER, v1)
    keep_path(gas, i, Path(FLIES, NOBODY, 0.0, x, way, True, ZERO, 0.0, 0.0, False))
    states[i, ENDS], gas.links[i, KIND] = inf, FROZEN
    gas.ways[i, STOPPED] = gas.ways[i, FREED] = NONE
    gas.ways[i, GLIDING] = 0.0


@kernel
def settle_walls(gas, i, x0):
    """Take rounding out of a place at the end of a step; who is deeper is pushed and counted."""
    here, states = spot_at(gas, i), gas.states
    x, v = three(states, i, X), three(states, i, V)
    place = _settle(gas.world, here, gas.courses, gas.met, gas.clock[END], x0, x, v)
    book_shift(gas.world.ledger, here, REPULSED, subtract(place, x))
    put_three(states, i, X, place)
