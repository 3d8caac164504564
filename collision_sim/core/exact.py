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
The event-driven method: each particle goes from event to event, whatever the length of the step.

Between events a particle flies, slides on up to three surfaces or rests on a collider; paths.py
says where it is. Events are collisions, the end of a slide, lift-off, and the end of a face. What
is left to a rule:

- Bounces that would all end within a time in which nothing moves by more than rounding (Zeno) are
  taken as one inelastic collision; then friction of the bounces left out equals that of contact
  over their time, up to the momentum of the last bounce, which the inelastic collision accounts
  for.
- Of several surfaces met at once the first in the order of colliders answers first; CHATTER
  collisions without time between them (acute corners) end in a joint inelastic collision.
- A particle that starts a step inside a collider takes this step by `collision_then_contact`,
  which repels it.
- After EVENTS events in a step a particle stops where it is; the counter `undecided` says so.
"""

from collision_sim.core.blocks import radius_at
from collision_sim.core.courses import material_velocity
from collision_sim.core.events import next_event
from collision_sim.core.exact_ledger import book_path
from collision_sim.core.extrapolation import ROWS
from collision_sim.core.flight import fly
from collision_sim.core.impulses import respond
from collision_sim.core.jit import entry, inlined, kernel
from collision_sim.core.laws import normal_impulse
from collision_sim.core.ledger import (book, book_collision, book_flight, book_impulse, book_shift,
                                       kinetic, REPULSED, RESTITUTED)
from collision_sim.core.paths import state_at
from collision_sim.core.placing import freeze, note_unplaced, push_out
from collision_sim.core.response import record, resolve
from collision_sim.core.rules import (COLLISION, Here, N_COLLISION, N_CONTACT, N_FAIL_SAFE,
                                      N_LOGGED, N_UNDECIDED, NONE, SLIDE, STICK, Touch)
from collision_sim.core.shapes import RESTITUTION, SIDE
from collision_sim.core.stepping import EVENT_BLOCK
from collision_sim.core.surfaces import FACES, faces, gap_to, touching_depth
from collision_sim.core.sustained import (choose_mode, FLIES, NOBODY, normal_at, normal_forces,
                                          onto_surfaces, opening, pull, resting_place, RESTS,
                                          SLIDES, square_up, touched, ZERO)
from collision_sim.core.threads import CLAIMED, ENTERED, fetch_add, LEFT
from collision_sim.core.vectors import add, add_scaled, dot, EPSILON, is_finite, length, subtract
import numpy as np

EVENTS = 100_000        # most events of a particle in a step
CHATTER = 800           # most collisions without time between them
DEEP = 8.0              # times the touching depth: inside, and not by rounding
HOP = 1e4 * EPSILON     # relative size of a hop that counts as no time between two collisions


@kernel
def _is_inside(rules, forces, here, table, poses, courses, duration, x, v):
    """Whether a particle starts the step inside a collider, by more than rounding of its way."""
    way = duration * (length(v) + duration * length(forces.gravity))
    for c in range(table.shape[0]):
        side = table[c, SIDE]
        for face in range(faces(table, c, side)):
            gap, _, _ = gap_to(rules, here, table, poses, courses, c, face, side, here.radius,
                               0.0, x)
            if gap < -DEEP * (touching_depth(table, poses, here, c, x) + EPSILON * way):
                return True
    return False


@inlined
def _pressing(rules, forces, here, table, poses, courses, s, t, x, v):
    """Give the acceleration [m/s^2] towards a surface of a particle that it does not hold."""
    n = normal_at(rules, here, table, poses, courses, s, t, x)
    g, _ = opening(rules, here, table, poses, courses, s, t, x, v, n)
    return -(g + dot(n, pull(forces, v)))


@kernel
def _collide(rules, forces, here, table, poses, courses, log, accounts, ledger, duration, s, v_n,
             t, x, v):
    """
    Collision with a surface, inelastic where the bounces it starts are only rounding.

    Bounces from a speed u last 2 u / (p (1 - eps)) at an acceleration p towards the surface, the
    sum of a geometric series. Rounding is that of the place, or of the way in free fall in a step.
    """
    c = s // FACES
    n = normal_at(rules, here, table, poses, courses, s, t, x)
    obj = material_velocity(courses, poses, here, c, t, x)
    eps = table[c, RESTITUTION]
    dv_n = -v_n
    after, _ = respond(rules, table, c, v, obj, n, v_n, dv_n)
    press = _pressing(rules, forces, here, table, poses, courses, s, t, x, after)
    rounding = 2.0 * touching_depth(table, poses, here, c, x) + EPSILON * press * duration ** 2
    falls = press > 0.0 and v_n * v_n <= 2.0 * press * rounding
    if not (press > 0.0 and (falls or (2.0 * eps * v_n) ** 2
                             <= 2.0 * rounding * press * (1.0 - eps) ** 2)):
        dv_n = normal_impulse(v_n, eps)
        after, _ = respond(rules, table, c, v, obj, n, v_n, dv_n)
    if not falls:
        accounts[here.block, N_COLLISION] += 1
    record(log, accounts, here, c, COLLISION, x, n, subtract(after, v))
    book_collision(ledger, rules, here, table, Touch(c, n, obj, x, v_n, 0.0, True, False), dv_n, v,
                   after)
    return after


@kernel
def _approached(rules, here, table, poses, courses, t, x, v):
    """First surface that a particle touches and approaches, and the normal velocity, or NONE."""
    for count in range(FACES * table.shape[0]):
        s, v_n = touched(rules, here, table, poses, courses, t, x, v, count)
        if s == NONE or v_n < 0.0:
            return s, v_n
    return NONE, 0.0


@kernel
def _stop_jointly(rules, here, table, poses, courses, t, x, v):
    """Collide inelastically with all surfaces that a particle touches and would approach."""
    holds, n0, n1 = NOBODY, (0.0, 0.0, 1.0), (0.0, 0.0, 1.0)
    for seat in range(4):
        s, _ = _approached(rules, here, table, poses, courses, t, x, v)
        if s == NONE:
            break
        obj = material_velocity(courses, poses, here, s // FACES, t, x)
        if seat >= 2:
            return obj
        n = normal_at(rules, here, table, poses, courses, s, t, x)
        n0, n1 = (n, n) if seat == 0 else (n0, n)
        holds = (s, NONE, NONE) if seat == 0 else (holds[0], s, NONE)
        d0, d1, _ = square_up(n0, n1, n1, holds)
        w = subtract(v, obj)
        w = add_scaled(w, -dot(w, d0), d0)
        v = add(obj, add_scaled(w, -dot(w, d1), d1))
    return v


@inlined
def _drag_change(linear, wind, h, dx, dv):
    """Change of velocity less that by linear drag."""
    if linear is not None:
        return add_scaled(add_scaled(dv, linear, dx), -linear * h, wind)
    return dv


@kernel
def _log_holds(rules, forces, here, table, poses, courses, log, accounts, path, t, x, v):
    """Log the impulses of the surfaces that held a particle on its path until t."""
    h = t - path.since
    dv = add_scaled(subtract(v, path.v), -h, forces.gravity)
    dv = _drag_change(forces.linear, forces.wind, h, subtract(x, path.x), dv)
    holds, n = path.holds, normal_at(rules, here, table, poses, courses, path.holds[0], t, x)
    n1, n2 = n, n
    if holds[1] != NONE:
        n1 = normal_at(rules, here, table, poses, courses, holds[1], t, x)
    if holds[2] != NONE:
        n2 = normal_at(rules, here, table, poses, courses, holds[2], t, x)
    state = STICK if path.mode == RESTS else SLIDE
    if holds[1] != NONE:
        p = normal_forces(holds, n, n1, n2, n, n1, n2, -dot(n, dv), -dot(n1, dv), -dot(n2, dv))
        if holds[2] != NONE:
            record(log, accounts, here, holds[2] // FACES, state, x, n2,
                   add_scaled(ZERO, p[2], n2))
            dv = add_scaled(dv, -p[2], n2)
        record(log, accounts, here, holds[1] // FACES, state, x, n1, add_scaled(ZERO, p[1], n1))
        dv = add_scaled(dv, -p[1], n1)
    record(log, accounts, here, holds[0] // FACES, state, x, n, dv)


@kernel
def _travel(rules, forces, here, table, poses, courses, work, log, accounts, ledger, mode, holds,
            t, duration, x, v, pace):
    """
    Go on to the next event, or to the end of the step.

    Returns
    -------
    t : float [s]
    x, v : (3,) tuple of float [m], [m/s]
    released : int
        Surface that has let go of the particle, or NONE.
    pace : float [s]
        Guess for the next step of the integrator.

    """
    path, end, stopped, released, pace = next_event(
        rules, forces, here, table, poses, courses, work, accounts, mode, holds, t, duration, x,
        v, pace)
    x1, v1 = state_at(rules, forces, here, table, poses, courses, work, path, end)
    if mode == SLIDES:
        x1, v1 = onto_surfaces(rules, here, table, poses, courses, path.holds, end, x1, v1)
    if mode != FLIES:
        _log_holds(rules, forces, here, table, poses, courses, log, accounts, path, end, x1, v1)
    if stopped != NONE:
        v1 = material_velocity(courses, poses, here, stopped // FACES, end, x1)
    book_path(ledger, rules, forces, here, table, poses, courses, work, path, end, x1, v1)
    return end, x1, v1, released, pace


@kernel
def _book_stop(ledger, here, courses, poses, account, c, t, x, v, x1, v1):
    """Book an impulse of a collider and a shift whose energy goes to one account."""
    if ledger is not None:
        dv, obj = subtract(v1, v), material_velocity(courses, poses, here, c, t, x)
        book_impulse(ledger, here, c, dot(dv, obj), dv)
        book(ledger, here, account, kinetic(v, v1) - dot(dv, obj))
        book_shift(ledger, here, account, subtract(x1, x))


@inlined
def _book_candidate(ledger, rules, here, v):
    """Book the flight of a particle that is stepped as by `collision_then_contact`."""
    if ledger is not None:
        u, w = fly(rules.flight, v)
        book_flight(ledger, here, rules.flight.dt, v, u, w, 1.0)


@inlined
def _jam(here, courses, poses, accounts, notes, ledger, c, t, duration, x, v):
    """Fail-safe of a particle that cannot leave two surfaces: it goes along with the first."""
    accounts[here.block, N_FAIL_SAFE] += 1
    note_unplaced(here, accounts, notes, c, NONE)
    x1, v1 = resting_place(courses, poses, here, c, x, t, duration)
    _book_stop(ledger, here, courses, poses, REPULSED, c, t, x, v, x1, v1)
    return x1, v1


@inlined
def go_through(rules, forces, here, table, poses, motion, courses, work, log, accounts, notes,
               ledger, duration, x, v):
    """
    Take a particle that starts outside all colliders through the events of a step.

    Parameters
    ----------
    rules, forces, here, table, poses, motion, courses, work, log, accounts, notes, ledger
        As in `step_events`.
    duration : float [s]
        Of the step.
    x, v : (3,) tuple of float [m], [m/s]
        At the start of the step.

    Returns
    -------
    x, v : (3,) tuple of float [m], [m/s]

    """
    t, last, rapid, released, pace, contacts, x0 = 0.0, -1.0, 0, NONE, duration, 0, x
    recent, other = NONE, NONE
    for _ in range(EVENTS):
        if t >= duration:
            place = push_out(rules, here, table, poses, motion, x0, x)[0]       # of rounding
            book_shift(ledger, here, REPULSED, subtract(place, x))
            return place, v
        s, v_n = _approached(rules, here, table, poses, courses, t, x, v)
        if s != NONE:
            hop = (length(forces.gravity) * (t - last) - v_n) * (t - last)
            rapid = rapid + 1 if t == last or hop <= HOP * length(x) else 0
            if rapid == 0:
                other = NONE
            elif s != recent:
                other = recent
            recent = s
            if rapid <= CHATTER:
                v = _collide(rules, forces, here, table, poses, courses, log, accounts, ledger,
                             duration, s, v_n, t, x, v)
            else:
                before, rapid = (x, v), 0
                x, v = onto_surfaces(rules, here, table, poses, courses, (s, other, NONE), t, x, v)
                v = _stop_jointly(rules, here, table, poses, courses, t, x, v)
                obj = material_velocity(courses, poses, here, s // FACES, t, x)
                if length(subtract(v, obj)) <= EPSILON * duration * length(forces.gravity):
                    v = obj
                _book_stop(ledger, here, courses, poses, RESTITUTED, s // FACES, t, *before, x, v)
                if _approached(rules, here, table, poses, courses, t, x, v)[0] != NONE:
                    return _jam(here, courses, poses, accounts, notes, ledger, s // FACES, t,
                                duration, x, v)
            last, released = t, NONE
            continue
        mode, holds = choose_mode(rules, forces, here, table, poses, courses, released, t, x, v)
        if mode != FLIES and contacts == 0:
            contacts = 1
            accounts[here.block, N_CONTACT] += 1
        t, x, v, released, pace = _travel(
            rules, forces, here, table, poses, courses, work, log, accounts, ledger, mode, holds,
            t, duration, x, v, pace)
    accounts[here.block, N_UNDECIDED] += 1
    return x, v


@inlined
def _step_particle(rules, forces, here, table, poses, motion, courses, work, log, accounts, notes,
                   ledger, duration, x0, v0):
    """Take one particle through a step; place and velocity."""
    u, w = fly(rules.flight, v0)
    if not is_finite(add_scaled(x0, duration, u), w):
        return freeze(accounts, here.block, x0)
    if _is_inside(rules, forces, here, table, poses, courses, duration, x0, v0):
        _book_candidate(ledger, rules, here, v0)
        x1, v1 = resolve(rules, here, table, poses, motion, log, accounts, notes, x0, v0, ledger)
    else:
        x1, v1 = go_through(rules, forces, here, table, poses, motion, courses, work, log,
                            accounts, notes, ledger, duration, x0, v0)
    return (x1, v1) if is_finite(x1, v1) else freeze(accounts, here.block, x0)


@entry
def step_events(posted, counters, rules, forces, duration, steps, table, poses, motion, courses,
                radius, log, accounts, notes, x, v, ledger):
    """
    Take blocks of particles through the steps of a call, in place, until none is left.

    Parameters
    ----------
    posted, counters, rules, steps, table, poses, motion, radius, log, accounts, notes, x, v
        As in stepping.step_blocks.
    forces : sustained.Forces
        What acts on a particle in flight.
    duration : float [s]
        Of a step.
    courses : (S, C, courses.COURSE) float64 or None
        How the colliders move; None where none does.
    ledger : ledger.Ledger or None
        Written; None for no ledger.

    """
    work = np.empty((ROWS, 6))
    rows = poses.shape[0] - 1
    fetch_add(posted, 0, 1)
    fetch_add(counters, ENTERED, 1)
    block = fetch_add(counters, CLAIMED, 1)
    while block < accounts.shape[0]:
        for step in range(steps):
            accounts[block, N_LOGGED] = 0
            start, end = min(step, rows), min(step + 1, rows)
            for i in range(block * EVENT_BLOCK, min((block + 1) * EVENT_BLOCK, x.shape[1])):
                here = Here(step, start, end, block, i, radius_at(radius, i), None, None)
                x0, v0 = (x[0, i], x[1, i], x[2, i]), (v[0, i], v[1, i], v[2, i])
                x1, v1 = _step_particle(rules, forces, here, table, poses, motion, courses, work,
                                        log, accounts, notes, ledger, duration, x0, v0)
                x[0, i], x[1, i], x[2, i] = x1
                v[0, i], v[1, i], v[2, i] = v1
        block = fetch_add(counters, CLAIMED, 1)
    fetch_add(counters, LEFT, 1)
