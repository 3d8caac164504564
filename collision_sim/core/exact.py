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
- Surfaces that a particle approaches at once answer at once (meeting.py: Moreau's law of impact);
  CHATTER collisions without time between them (acute corners) end in an inelastic one with all
  surfaces that are near. Where these close on the particle it is stuck, and noted as `unplaced`;
  so it is where they are so nearly parallel that it would have to leave between them at SQUEEZE
  times the speed at which they close: plates that close are never parallel but to rounding.
- A particle that starts a step inside a collider takes this step by `collision_then_contact`,
  which repels it.
- After EVENTS events in a step a particle stops where it is; the counter `undecided` says so.
"""

from math import inf

from collision_sim.core.broad_phase import radius_at
from collision_sim.core.courses import material_velocity
from collision_sim.core.events import next_event
from collision_sim.core.exact_ledger import book_friction, book_path
from collision_sim.core.extrapolation import ROWS
from collision_sim.core.flight import fly
from collision_sim.core.impulses import dry_factor, respond, wet_factor
from collision_sim.core.jit import entry, inlined, kernel
from collision_sim.core.laws import normal_impulse
from collision_sim.core.ledger import (book, book_collision, book_flight, book_impulse, book_shift,
                                       is_kept, kinetic, REPULSED, RESTITUTED)
from collision_sim.core.meeting import (BALANCED, facing, gather, least_push, MET, NEED,
                                        normal_forces, SPEED, square_up, surface_of, surfaces_of,
                                        turn_round, ZERO)
from collision_sim.core.mesh_way import ANSWERS
from collision_sim.core.paths import state_at
from collision_sim.core.placing import freeze, note_unplaced, push_out
from collision_sim.core.response import resolve
from collision_sim.core.rules import (CHANGE, COLLISION, N_COLLISION, N_CONTACT, N_FAIL_SAFE,
                                      N_LOGGED, N_UNDECIDED, NONE, NORMAL, POINT, ROUNDING, SLIDE,
                                      STICK, Touch)
from collision_sim.core.shapes import RESTITUTION, SIDE
from collision_sim.core.stepping import EVENT_BLOCK
from collision_sim.core.surfaces import as_here, FACES, faces, gap_to, Spot, touching_depth
from collision_sim.core.sustained import (choose_mode, FLIES, GLIDES, normal_at, onto_surfaces,
                                          opening, pull, resting_place, RESTS, SLIDES, smooth)
from collision_sim.core.threads import CLAIMED, ENTERED, fetch_add, LEFT
from collision_sim.core.vectors import (add, add_scaled, dot, EPSILON, is_finite, length, scaled,
                                        subtract)
import numpy as np

EVENTS = 100_000        # most events of a particle in a step
CHATTER = 800           # most collisions without time between them
DEEP = 8.0              # times the touching depth: inside, and not by rounding
HOP = 1e4 * EPSILON     # relative size of a hop that counts as no time between two collisions
SQUEEZE = 1e3           # times the speed at which surfaces close: fastest that they push one out
NEAR = 1e4              # times the touching depth: surfaces among which a particle hops


@inlined
def record(world, here, c, state, point, n, dv):
    """Log a contact, or add to that of the same particle and collider; nothing without room."""
    log, accounts = world.log, world.accounts
    if log.shape[1] > 0:
        b, row = here.block, accounts[here.block, N_LOGGED]
        for k in range(row - 1, -1, -1):
            if log[b, k, 0] != here.particle:
                break
            if log[b, k, 1] == c:
                for d in range(3):
                    log[b, k, CHANGE + d] += dv[d]
                return
        if row < log.shape[1]:
            log[b, row, 0], log[b, row, 1], log[b, row, 2] = here.particle, c, state
            for d in range(3):
                log[b, row, POINT + d], log[b, row, NORMAL + d] = point[d], n[d]
                log[b, row, CHANGE + d] = dv[d]
            accounts[b, N_LOGGED] = row + 1


@kernel
def _is_inside(world, here, courses, t, x):
    """Whether a particle is inside a collider, by more than rounding of its way."""
    table = world.table
    for c in range(table.shape[0]):
        side = table[c, SIDE]
        for face in range(faces(table, c, side)):
            gap, _, _ = gap_to(world, here, courses, c, face, side, here.radius, t, x)
            if gap < -DEEP * touching_depth(world, here, c, x):
                return True
    return False


@inlined
def _pressing(world, forces, here, courses, s, t, x, v):
    """Give the acceleration [m/s^2] towards a surface of a particle that it does not hold."""
    n = normal_at(world, here, courses, s, t, x)
    g, _ = opening(world, here, courses, s, t, x, v, n)
    return -(g + dot(n, pull(forces, v)))


@kernel
def _hop(world, forces, here, courses, s, duration, t, x, v):
    """Return how a surface presses [m/s^2], and the height of a hop that is only rounding [m]."""
    press = _pressing(world, forces, here, courses, s, t, x, v)
    rounding = 2.0 * touching_depth(world, here, s // FACES, x)
    return press, rounding + EPSILON * press * duration ** 2


@kernel
def _hold_back(world, forces, here, courses, met, count, duration, t, x, v):
    """Add rows that keep a particle on surfaces off which it would only hop by rounding."""
    rows = count
    for k in range(count):
        s = surface_of(met, k)
        obj = material_velocity(courses, world.poses, here, s // FACES, t, x)
        v_n = dot(subtract(v, obj), facing(met, k))
        if v_n > 0.0 and rows < count + 3:
            press, rounding = _hop(world, forces, here, courses, s, duration, t, x, v)
            if v_n * v_n <= 2.0 * press * rounding:
                rows = turn_round(met, k, rows)
    return rows


@kernel
def _demand(world, forces, here, courses, met, count, duration, t, x, v):
    """
    Write the change of normal velocity that each surface a particle approaches asks for.

    It is inelastic where the bounces that the collision starts are only rounding. Bounces from a
    speed u last 2 u / (p (1 - eps)) at an acceleration p towards the surface, the sum of a
    geometric series. Rounding is that of the place, or of the way in free fall in a step.

    Returns
    -------
    collides : bool
        Whether a particle does so and not only settles on a surface.
    elastic : bool
        Whether it bounces.

    """
    table, poses = world.table, world.poses
    collides, elastic = False, False
    for k in range(count):
        v_n, s = met[k, SPEED], surface_of(met, k)
        met[k, NEED] = -v_n
        if v_n < 0.0:
            c, n = s // FACES, facing(met, k)
            obj, eps = material_velocity(courses, poses, here, c, t, x), table[c, RESTITUTION]
            after, _ = respond(table, c, v, obj, n, v_n, -v_n)
            press, rounding = _hop(world, forces, here, courses, s, duration, t, x, after)
            falls = press > 0.0 and v_n * v_n <= 2.0 * press * rounding
            if not (press > 0.0 and (falls or (2.0 * eps * v_n) ** 2
                                     <= 2.0 * rounding * press * (1.0 - eps) ** 2)):
                met[k, NEED] = normal_impulse(v_n, eps)
                elastic = elastic or eps > 0.0
            collides = collides or not falls
    return collides, elastic


@inlined
def _push_one(world, here, courses, s, n, v_n, dv_n, t, x, v):
    """Push by one surface, with its friction."""
    c = s // FACES
    obj = material_velocity(courses, world.poses, here, c, t, x)
    after, _ = respond(world.table, c, v, obj, n, v_n, dv_n)
    record(world, here, c, COLLISION, x, n, subtract(after, v))
    book_collision(world, here, Touch(c, n, obj, x, v_n, 0.0, True, False), dv_n, v, after)
    return after


@kernel
def _push_jointly(world, here, courses, met, choice, parts, t, x, v):
    """
    Push by several surfaces at once; their friction acts along the edge of two, one by one.

    That of three has no direction left to act in.
    """
    table, ledger = world.table, world.ledger
    n0, n1 = facing(met, choice[0]), facing(met, choice[1])
    edge = square_up(n0, n1, n1, choice)[2] if choice[2] == NONE else ZERO
    for k in range(3):
        if choice[k] != NONE:
            s, n, u = surface_of(met, choice[k]), facing(met, choice[k]), v
            c, dv_n = s // FACES, parts[k]
            obj = material_velocity(courses, world.poses, here, c, t, x)
            slip = scaled(dot(subtract(v, obj), edge), edge)
            factor = (dry_factor(table, c, length(slip), dv_n)
                      * wet_factor(table, c, dv_n))
            w = add_scaled(v, dv_n, n)
            v = add_scaled(w, factor - 1.0, slip)
            dv = subtract(v, u)
            record(world, here, c, COLLISION, x, n, dv)
            book_impulse(ledger, here, c, dot(dv, obj), dv)
            book(ledger, here, RESTITUTED, kinetic(u, w) - dv_n * dot(n, obj))
            book_friction(world, here, c, length(slip), dv_n,
                          kinetic(w, v) - dot(subtract(v, w), obj))
    return v


@inlined
def _book_stop(ledger, here, account, c, obj, x, v, x1, v1):
    """Book an impulse of a collider and a shift whose energy goes to one account."""
    if is_kept(ledger):
        dv = subtract(v1, v)
        book_impulse(ledger, here, c, dot(dv, obj), dv)
        book(ledger, here, account, kinetic(v, v1) - dot(dv, obj))
        book_shift(ledger, here, account, subtract(x1, x))


@kernel
def _keep_out(world, here, courses, met, count, fast, t, x, v):
    """
    Push, without friction, so that a particle approaches no surface of the rows.

    What is left of a velocity is none where it is rounding of `fast` [m/s] and of the pushes.
    """
    poses = world.poses
    for k in range(count):
        s, n = surface_of(met, k), facing(met, k)
        obj = material_velocity(courses, poses, here, s // FACES, t, x)
        v_n = dot(subtract(v, obj), n)
        met[k, NEED] = -v_n if abs(v_n) > ROUNDING * (length(v) + length(obj)) else 0.0
    push, choice, parts = least_push(met, count)
    first = surface_of(met, max(choice[0], 0)) // FACES
    obj, after = material_velocity(courses, poses, here, first, t, x), add(v, push)
    if length(subtract(after, obj)) <= BALANCED * (fast + length(obj) + length(parts)):
        after = obj
    dv = subtract(after, v)
    for k in range(2, -1, -1):
        if k == 0 and length(dv) > 0.0 or choice[k] != NONE:
            row = max(choice[k], 0)
            s, n = surface_of(met, row), facing(met, row)
            change = dv if k == 0 else scaled(parts[k], n)
            dv, w = subtract(dv, change), add(v, change)
            obj = material_velocity(courses, poses, here, s // FACES, t, x)
            record(world, here, s // FACES, COLLISION, x, n, change)
            _book_stop(world.ledger, here, RESTITUTED, s // FACES, obj, x, v, x, w)
            v = w
    return after


@kernel
def _collide(world, forces, here, courses, met, count, duration, t, x, v):
    """
    Collision with all surfaces that a particle approaches: the least push that does it.

    Who does not bounce approaches none of those that it touches after that, whatever friction
    does: where that drags it into another one, a push without friction follows, which leaves it on
    those that have pushed.
    """
    fast = length(v)
    collides, elastic = _demand(world, forces, here, courses, met, count, duration, t, x, v)
    if elastic:
        for k in range(count):
            if met[k, SPEED] >= 0.0:
                met[k, NEED] = -inf
    if collides:
        world.accounts[here.block, N_COLLISION] += 1
    _, choice, parts = least_push(met, count)
    if choice[1] != NONE:
        v = _push_jointly(world, here, courses, met, choice, parts, t, x, v)
    elif choice[0] != NONE:
        s, n = surface_of(met, choice[0]), facing(met, choice[0])
        v = _push_one(world, here, courses, s, n, met[choice[0], SPEED], parts[0], t, x, v)
    fast += length(parts)
    if elastic or count == 1:
        return v
    rows = _hold_back(world, forces, here, courses, met, count, duration, t, x, v)
    for k in range(3):
        if choice[k] != NONE:
            rows = turn_round(met, choice[k], rows)
    return _keep_out(world, here, courses, met, rows, fast, t, x, v)


@inlined
def _approaches(met, count):
    """Whether a particle approaches any of the surfaces that it touches."""
    for k in range(count):
        if met[k, SPEED] < 0.0:
            return True
    return False


@kernel
def _is_squeezed(here, courses, poses, met, count, t, x, v):
    """Whether surfaces that close on a particle would have to throw it out, inelastic as it is."""
    for k in range(count):
        met[k, NEED] = -met[k, SPEED]
    push, choice, _ = least_push(met, count)
    if choice[1] == NONE:
        return False
    first = material_velocity(courses, poses, here, surface_of(met, choice[0]) // FACES, t, x)
    closing = 0.0
    for k in range(1, 3):
        if choice[k] != NONE:
            obj = material_velocity(courses, poses, here, surface_of(met, choice[k]) // FACES, t,
                                    x)
            closing = max(closing, length(subtract(obj, first)))
    before = length(subtract(v, first))
    return length(subtract(add(v, push), first)) > 2.0 * before + SQUEEZE * closing


@kernel
def _stop_jointly(world, here, courses, met, t, x, v):
    """
    End collisions without time between them: inelastic against all surfaces that are near.

    Returns
    -------
    x, v : (3,) tuple of float [m], [m/s]
        On the surfaces that push, and approaching none.

    """
    count = gather(world, here, courses, met, t, x, v, NEAR, True)
    for k in range(count):
        met[k, NEED] = -met[k, SPEED]
    _, choice, _ = least_push(met, count)
    place, _ = onto_surfaces(world, here, courses, surfaces_of(met, choice), t, x, v)
    book_shift(world.ledger, here, RESTITUTED, subtract(place, x))
    return place, _keep_out(world, here, courses, met, count, length(v), t, place, v)


@inlined
def _drag_change(linear, wind, h, dx, dv):
    """Change of velocity less that by linear drag."""
    if linear > 0.0:
        return add_scaled(add_scaled(dv, linear, dx), -linear * h, wind)
    return dv


@kernel
def _log_holds(forces, world, here, courses, path, v, t, x1, v1):
    """Log the impulses of the surfaces that held a particle on its path, from v to v1 at t."""
    h = t - path.since
    dv = add_scaled(subtract(v1, v), -h, forces.gravity)
    dv = _drag_change(forces.linear, forces.wind, h, subtract(x1, path.x), dv)
    holds, n = path.holds, normal_at(world, here, courses, path.holds[0], t, x1)
    n1, n2 = n, n
    if holds[1] != NONE:
        n1 = normal_at(world, here, courses, holds[1], t, x1)
    if holds[2] != NONE:
        n2 = normal_at(world, here, courses, holds[2], t, x1)
    state = STICK if path.mode == RESTS else SLIDE
    if holds[1] != NONE:
        p = normal_forces(holds, n, n1, n2, n, n1, n2, -dot(n, dv), -dot(n1, dv), -dot(n2, dv))
        if is_finite(p, p):
            record(world, here, holds[1] // FACES, state, x1, n1, scaled(p[1], n1))
            dv = add_scaled(dv, -p[1], n1)
            if holds[2] != NONE:
                record(world, here, holds[2] // FACES, state, x1, n2, scaled(p[2], n2))
                dv = add_scaled(dv, -p[2], n2)
    record(world, here, holds[0] // FACES, state, x1, n, dv)


@kernel
def _travel(world, forces, here, courses, work, mode, holds, t, duration, x, v, pace):
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
    if mode == GLIDES:
        mode, forces = SLIDES, smooth(forces)
    path, end, stopped, released, pace = next_event(world, forces, here, courses, work, mode,
                                                    holds, t, duration, x, v, pace)
    x1, v1 = state_at(world, forces, here, courses, work, path, end)
    if mode == SLIDES:
        x1, v1 = onto_surfaces(world, here, courses, path.holds, end, x1, v1)
    if stopped != NONE:
        v1 = material_velocity(courses, world.poses, here, stopped // FACES, end, x1)
    if mode != FLIES:
        _log_holds(forces, world, here, courses, path, v, end, x1, v1)
    book_path(world, forces, here, courses, work, path, end, x1, v1)
    return end, x1, v1, released, pace


@inlined
def _book_candidate(world, here, v):
    """Book the flight of a particle that is stepped as by `collision_then_contact`."""
    ledger, rules = world.ledger, world.rules
    if is_kept(ledger):
        u, w = fly(rules.flight, v)
        book_flight(ledger, here, rules.flight.dt, v, u, w, 1.0)


@inlined
def _jam(world, here, courses, s, n, t, duration, x, v):
    """Fail-safe of a particle that closing surfaces hold: it goes along with the first."""
    poses = world.poses
    c = s // FACES
    world.accounts[here.block, N_FAIL_SAFE] += 1
    note_unplaced(world, here, c, NONE)
    obj = material_velocity(courses, poses, here, c, t, x)
    x1, v1 = resting_place(courses, poses, here, c, x, t, duration)
    record(world, here, c, STICK, x1, n, subtract(v1, v))
    _book_stop(world.ledger, here, REPULSED, c, obj, x, v, x1, v1)
    return x1, v1


@kernel
def _settle(world, here, courses, met, duration, x0, x, v):
    """Take rounding out of a place at the end of a step; who is deeper is pushed and counted."""
    table, accounts = world.table, world.accounts
    count = gather(world, here, courses, met, duration, x, v, 1.0, True)
    for k in range(count):
        s = surface_of(met, k)
        c = s // FACES
        gap, slope, _ = gap_to(world, here, courses, c, s % FACES, table[c, SIDE], here.radius,
                               duration, x)
        shallow = gap >= -DEEP * touching_depth(world, here, c, x)
        met[k, NEED] = -gap / slope * (1.0 + DEEP * EPSILON) if shallow else -inf
    x = add(x, least_push(met, count)[0])
    if _is_inside(world, here, courses, duration, x):
        accounts[here.block, N_FAIL_SAFE] += 1
        x, c, other = push_out(world, here, x0, x)
        if c != NONE:
            note_unplaced(world, here, c, other)
    return x


@inlined
def _spot(here, forces, duration, v):
    """Return where a particle is, with its way in a step: at its highest velocity, and falling."""
    way = duration * (length(v) + duration * length(forces.gravity))
    return Spot(here.step, here.start, here.end, here.block, here.particle, here.radius,
                here.chosen, here.answers, here.only, max(here.way, way))


@inlined
def go_through(world, forces, here, courses, work, met, duration, x, v):
    """
    Take a particle that starts outside all colliders through the events of a step.

    Parameters
    ----------
    world, forces, here, courses, work, met
        As in `step_events`.
    duration : float [s]
        Of the step.
    x, v : (3,) tuple of float [m], [m/s]
        At the start of the step.

    Returns
    -------
    x, v : (3,) tuple of float [m], [m/s]

    """
    accounts = world.accounts
    t, last, rapid, released, pace, contacts, x0 = 0.0, -1.0, 0, NONE, duration, 0, x
    for _ in range(EVENTS):
        here = _spot(here, forces, duration, v)
        if t >= duration:
            place = _settle(world, here, courses, met, duration, x0, x, v)
            book_shift(world.ledger, here, REPULSED, subtract(place, x))
            return place, v
        count = gather(world, here, courses, met, t, x, v, 1.0, True)
        if _approaches(met, count):
            hop = (length(forces.gravity) * (t - last) + length(v)) * (t - last)
            rapid = rapid + 1 if t == last or hop <= HOP * (length(x) + here.way) else 0
            if count > 1 and _is_squeezed(here, courses, world.poses, met, count, t, x, v):
                return _jam(world, here, courses, surface_of(met, 0), facing(met, 0), t, duration,
                            x, v)
            if rapid <= CHATTER:
                v = _collide(world, forces, here, courses, met, count, duration, t, x, v)
            else:
                rapid = 0
                x, v = _stop_jointly(world, here, courses, met, t, x, v)
                count = gather(world, here, courses, met, t, x, v, 1.0, False)
                if _approaches(met, count):
                    return _jam(world, here, courses, surface_of(met, 0), facing(met, 0), t,
                                duration, x, v)
            last, released = t, NONE
            continue
        mode, holds = choose_mode(world, forces, here, courses, met, released, t, x, v)
        if mode != FLIES and contacts == 0:
            contacts = 1
            accounts[here.block, N_CONTACT] += 1
        t, x, v, released, pace = _travel(world, forces, here, courses, work, mode, holds, t,
                                          duration, x, v, pace)
    accounts[here.block, N_UNDECIDED] += 1
    return x, v


@inlined
def _step_particle(world, forces, spot, courses, work, met, duration, x0, v0):
    """Take one particle through a step; place and velocity."""
    accounts = world.accounts
    u, w = fly(world.rules.flight, v0)
    if not is_finite(add_scaled(x0, duration, u), w):
        return freeze(accounts, spot.block, x0)
    here, spot = as_here(spot), _spot(spot, forces, duration, v0)
    if _is_inside(world, spot, courses, 0.0, x0):
        _book_candidate(world, here, v0)
        x1, v1 = resolve(world, here, x0, v0)
    else:
        x1, v1 = go_through(world, forces, spot, courses, work, met, duration, x0, v0)
    return (x1, v1) if is_finite(x1, v1) else freeze(accounts, here.block, x0)


@entry
def step_events(posted, counters, world, forces, duration, steps, courses):
    """
    Take blocks of particles through the steps of a call, in place, until none is left.

    Parameters
    ----------
    posted, counters : (1,), (SHARED,) int64
        Of threads.share.
    world, steps
        As in stepping.step_blocks.
    forces : sustained.Forces
        What acts on a particle in flight.
    duration : float [s]
        Of a step.
    courses : (S, C, courses.COURSE) float64
        How the colliders move; no rows where none does.

    """
    table, accounts, x, v = world.table, world.accounts, world.x, world.v
    work, met = np.empty((ROWS, 6)), np.empty((FACES * table.shape[0] + 6, MET))
    everyone, answers = np.arange(table.shape[0]), np.empty((0, ANSWERS))
    rows, turns = world.poses.shape[0] - 1, world.motion.shape[0] - 1
    fetch_add(posted, 0, 1)
    fetch_add(counters, ENTERED, 1)
    block = fetch_add(counters, CLAIMED, 1)
    while block < accounts.shape[0]:
        for step in range(steps):
            accounts[block, N_LOGGED] = 0
            start, end = min(step, rows), min(step + 1, rows)
            for i in range(block * EVENT_BLOCK, min((block + 1) * EVENT_BLOCK, x.shape[1])):
                spot = Spot(min(step, turns), start, end, block, i, radius_at(world.radius, i),
                            everyone, answers, everyone[:0], 0.0)
                x0, v0 = (x[0, i], x[1, i], x[2, i]), (v[0, i], v[1, i], v[2, i])
                x1, v1 = _step_particle(world, forces, spot, courses, work, met, duration, x0, v0)
                x[0, i], x[1, i], x[2, i] = x1
                v[0, i], v[1, i], v[2, i] = v1
        block = fetch_add(counters, CLAIMED, 1)
    fetch_add(counters, LEFT, 1)
