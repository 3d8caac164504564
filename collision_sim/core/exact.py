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

from math import inf, log1p

from collision_sim.core.blocks import radius_at
from collision_sim.core.courses import (accelerates, frame_acceleration, is_uniform,
                                        material_velocity, quickest)
from collision_sim.core.extrapolation import integrate, ROWS, stiffness
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.laws import normal_impulse
from collision_sim.core.paths import first_time, Path, state_at, TOLERANCE
from collision_sim.core.placing import note_unplaced, push_out
from collision_sim.core.response import record, resolve, respond
from collision_sim.core.rules import (COLLISION, Here, N_COLLISION, N_CONTACT, N_FAIL_SAFE,
                                      N_LOGGED, N_UNDECIDED, NONE, SLIDE, STICK)
from collision_sim.core.shapes import KINETIC, RESTITUTION, SIDE, WET
from collision_sim.core.stepping import BLOCK
from collision_sim.core.surfaces import (face_of, FACES, faces, gap_to, is_end, is_flat,
                                         touching_depth)
from collision_sim.core.sustained import (at_rest, BALANCED, can_rest, choose_mode, FLIES, held,
                                          NOBODY, normal_at, normal_forces, onto_surfaces, opening,
                                          pull, pull_slack, resting_place, RESTS, SLIDES,
                                          square_up, touched, ZERO)
from collision_sim.core.threads import CLAIMED, ENTERED, fetch_add, LEFT
from collision_sim.core.vectors import add_scaled, cross, dot, EPSILON, length, subtract
from numba import njit
import numpy as np

EVENTS = 100_000        # most events of a particle in a step
CHATTER = 800           # most collisions without time between them
DEEP = 8.0              # times the touching depth: inside, and not by rounding
HOP = 1e3 * EPSILON     # relative size of a hop that counts as no time between two collisions
STOPPED = 1e-13         # share of its velocity at which a slide has come to a stop
STIFF = 4.0             # rate times step from which a step is stiff
HALVINGS = 80           # bisections for the time of an event


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


@kernel
def _pressing(rules, forces, here, table, poses, courses, s, t, x, v):
    """Give the acceleration [m/s^2] towards a surface of a particle that it does not hold."""
    n = normal_at(rules, here, table, poses, courses, s, t, x)
    g, _ = opening(rules, here, table, poses, courses, s, t, x, v, n)
    return -(g + dot(n, pull(forces, v)))


@kernel
def _collide(rules, forces, here, table, poses, courses, log, accounts, duration, s, v_n, t, x,
             v):
    """
    Collision with a surface, inelastic where the bounces it starts are only rounding.

    Bounces from a speed u last 2 u / (p (1 - eps)) at an acceleration p towards the surface, the
    sum of a geometric series. Rounding is that of the place, or of the way in free fall in a step.
    """
    c = s // FACES
    n = normal_at(rules, here, table, poses, courses, s, t, x)
    obj = material_velocity(courses, poses, here, c, t, x)
    eps = table[c, RESTITUTION]
    after, stuck = respond(rules, table, c, v, obj, n, v_n, -v_n)
    press = _pressing(rules, forces, here, table, poses, courses, s, t, x, after)
    rounding = 2.0 * touching_depth(table, poses, here, c, x) + EPSILON * press * duration ** 2
    falls = press > 0.0 and v_n * v_n <= 2.0 * press * rounding
    if not (press > 0.0 and (falls or (2.0 * eps * v_n) ** 2
                             <= 2.0 * rounding * press * (1.0 - eps) ** 2)):
        after, stuck = respond(rules, table, c, v, obj, n, v_n, normal_impulse(v_n, eps))
    if not falls:
        accounts[here.block, N_COLLISION] += 1
    record(log, accounts, here, c, COLLISION, x, n, subtract(after, v))
    return after


@kernel
def _stop_jointly(rules, here, table, poses, courses, t, x, v):
    """Inelastic collision with all surfaces that a particle touches and approaches, at once."""
    for _ in range(2):
        holds, seat = NOBODY, 0
        for count in range(3):
            s, _ = touched(rules, here, table, poses, courses, t, x, v, count)
            if s != NONE:
                holds = (s if count == 0 else holds[0], s if count == 1 else holds[1],
                         s if count == 2 else holds[2])
                seat += 1
        if seat == 0:
            return v
        if seat == 1:
            break
        c = holds[0] // FACES
        n0 = normal_at(rules, here, table, poses, courses, holds[0], t, x)
        n1 = normal_at(rules, here, table, poses, courses, holds[1], t, x)
        obj = material_velocity(courses, poses, here, c, t, x)
        along = square_up(n0, n1, n1, holds)[2]
        if seat == 3:
            return obj
        return add_scaled(obj, dot(subtract(v, obj), along), along)
    return onto_surfaces(rules, here, table, poses, courses, holds, t, x, v)[1]


@inlined
def _decay_rate(forces_linear, wet, coefficient, normal):
    """Rate k [1/s] at which drag and wet friction slow a straight slide."""
    k = 0.0
    if forces_linear is not None:
        k = forces_linear
    if wet is not None:
        k += coefficient * normal
    return k


@kernel
def _straight(rules, forces, here, table, poses, courses, holds, t, x, v):
    """
    Give the closed form of a slide, if there is one: on one flat surface, straight on or smooth.

    Returns
    -------
    path : Path
        Not closed where there is none.
    stop : float [s]
        When it comes to a stop; infinite if it does not.

    """
    a, normal = held(rules, forces, here, table, poses, courses, holds, t, x, v)
    curved = Path(SLIDES, holds, t, x, v, False, a, 0.0, 2.0 * length(a), False)
    s, c = holds[0], holds[0] // FACES
    flat = is_flat(table, c, s % FACES, table[c, SIDE])
    drag = forces.quadratic
    if holds[1] != NONE or not flat or not is_uniform(courses, here, c) or drag is not None:
        return curved, inf
    obj = material_velocity(courses, poses, here, c, t, x)
    w = subtract(v, obj)
    k = _decay_rate(forces.linear, rules.wet, table[c, WET], normal[0])
    if k > 0.0 and accelerates(courses, here, c):
        return curved, inf
    relative = subtract(a, frame_acceleration(courses, poses, here, c, t, x, ZERO))
    path = Path(SLIDES, holds, t, x, v, True, add_scaled(a, k, v), k, 0.0,
                False)
    if table[c, KINETIC] == 0.0:
        return path, inf
    speed, brake = length(w), length(relative)
    if speed == 0.0:
        return path, inf
    across = length(cross(w, relative))
    if across > BALANCED * speed * (length(pull(forces, v)) + normal[0]):
        return curved, inf
    if dot(w, relative) >= 0.0:
        return path, inf
    steady = brake - k * speed      # deceleration that is left at rest
    if steady <= 0.0:
        return path, inf
    if k == 0.0:
        return path, t + speed / brake
    return path, t + log1p(k * speed / steady) / k


@kernel
def _flight(forces, t, x, v):
    """Path of free flight."""
    if forces.quadratic is not None:
        return Path(FLIES, NOBODY, t, x, v, False, ZERO, 0.0, 0.0, False)
    k = _decay_rate(forces.linear, None, 0.0, 0.0)
    return Path(FLIES, NOBODY, t, x, v, True, add_scaled(forces.gravity, k, forces.wind), k, 0.0,
                False)


@kernel
def _stop_time(rules, here, table, poses, courses, holds, t, x, v, a):
    """Time until a slide comes to a stop if it goes on braking as now; infinite if it does not."""
    first = inf
    for k in range(3):
        c = holds[k] // FACES
        if holds[k] != NONE and table[c, KINETIC] > 0.0:
            w = subtract(v, material_velocity(courses, poses, here, c, t, x))
            brake = -dot(w, subtract(a, frame_acceleration(courses, poses, here, c, t, x, ZERO)))
            if brake > 0.0:
                first = min(first, dot(w, w) / brake)
    return first


@kernel
def _stopped_on(here, table, poses, courses, holds, t, x, v, x1, v1, t1, slow):
    """
    Surface relative to which a particle has come to a stop, `slow`, in a step from t to t1.

    Returns
    -------
    surface : int
        NONE if there is none.
    reversed : bool
        Whether the step went past a stop.

    """
    for k in range(3):
        c = holds[k] // FACES
        if holds[k] != NONE and table[c, KINETIC] > 0.0:
            w = subtract(v, material_velocity(courses, poses, here, c, t, x))
            w1 = subtract(v1, material_velocity(courses, poses, here, c, t1, x1))
            if length(w) > 0.0 and length(w1) <= max(STOPPED * length(w), slow):
                return holds[k], False
            if dot(w, w1) < 0.0:
                return NONE, True
    return NONE, False


@kernel
def _integrated(rules, forces, here, table, poses, courses, work, path, t, duration, pace):
    """
    How far one integrator step from the start of a path is accurate, but not past a stop.

    Returns
    -------
    end, pace : float [s]
        Until when, and a guess for the next step.
    bend : float [m/s^2]
        Bound on the acceleration.
    stiff : bool
        Which rule integrates it.
    stopped : int
        Surface on which the particle is then at rest, or NONE.

    """
    x, v = path.x, path.v
    a, normal = held(rules, forces, here, table, poses, courses, path.holds, t, x, v)
    _, _, rates = stiffness(rules, forces, here, table, poses, courses, path.holds, t, x, v,
                            normal)
    h, rate = min(pace, duration - t), 0.0
    for c in range(table.shape[0]):
        rate = max(rate, quickest(courses, here, c))
    if rate > 0.0:
        h = min(h, 0.5 / rate)
    halting = _stop_time(rules, here, table, poses, courses, path.holds, t, x, v, a)
    h = min(h, halting)
    for _ in range(HALVINGS):
        stiff = h * rates[2] > STIFF
        x1, v1, error = integrate(rules, forces, here, table, poses, courses, work, stiff,
                                  path.holds, t, x, v, h)
        stopped, past = _stopped_on(here, table, poses, courses, path.holds, t, x, v, x1, v1,
                                    t + h, STOPPED * duration * length(a))
        if error <= TOLERANCE and not past:
            break
        h *= 0.5 if error <= 1e3 * TOLERANCE or past else 0.25
    b, _ = held(rules, forces, here, table, poses, courses, path.holds, t + h, x1, v1)
    pace = h * (2.0 if error <= 1e-3 * TOLERANCE else 1.0) if h < halting else pace
    end = duration if h == duration - t else t + h
    return end, max(pace, h), 2.0 * max(length(a), length(b)), stiff, stopped


@kernel
def _pulls(rules, forces, here, table, poses, courses, holds, t, x, v):
    """Surface that would have to pull to hold a particle, or NONE."""
    a, normal = held(rules, forces, here, table, poses, courses, holds, t, x, v)
    for k in range(3):
        if holds[k] != NONE and not normal[k] >= -pull_slack(forces, a):
            return holds[k]
    return NONE


@kernel
def _lift_off(rules, forces, here, table, poses, courses, work, path, end):
    """
    First time on a slide at which a surface would have to pull.

    Returns
    -------
    time : float [s]
        `end` if it never does.
    surface : int
        Which one, or NONE.

    """
    x, v = state_at(rules, forces, here, table, poses, courses, work, path, end)
    s = _pulls(rules, forces, here, table, poses, courses, path.holds, end, x, v)
    low, high = path.since, end
    if s != NONE:
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            x, v = state_at(rules, forces, here, table, poses, courses, work, path, middle)
            other = _pulls(rules, forces, here, table, poses, courses, path.holds, middle, x, v)
            if other == NONE:
                low = middle
            else:
                high, s = middle, other
    return high, s


@kernel
def _breakaway(rules, forces, here, table, poses, courses, work, path, end):
    """First time at which friction does not hold a resting particle any more, at most `end`."""
    c = path.holds[0] // FACES
    if is_uniform(courses, here, c) and not accelerates(courses, here, c):
        return end
    count = 8 + int(8.0 * quickest(courses, here, c) * (end - path.since))
    low = path.since
    for k in range(count):
        high = path.since + (end - path.since) * (k + 1) / count
        x, _ = state_at(rules, forces, here, table, poses, courses, work, path, high)
        if not can_rest(rules, forces, here, table, poses, courses, path.holds, high, x):
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                if not low < middle < high:
                    break
                x, _ = state_at(rules, forces, here, table, poses, courses, work, path, middle)
                if can_rest(rules, forces, here, table, poses, courses, path.holds, middle, x):
                    low = middle
                else:
                    high = middle
            return high
        low = high
    return end


@kernel
def _face_end(rules, forces, here, table, poses, courses, work, accounts, path, end):
    """
    When a particle on a face of a box or cylinder reaches its end.

    Returns
    -------
    time : float [s]
        Infinite if not before `end`.
    collider : int
        Whose face it is, or NONE.

    """
    first, collider = inf, NONE
    for k in range(3):
        c, face = path.holds[k] // FACES, path.holds[k] % FACES - 1
        if path.mode != SLIDES or path.holds[k] == NONE or face < 0 or table[c, SIDE] < 0.0:
            continue
        for edge in range(faces(table, c, -1.0)):
            if is_end(table, c, face, edge):
                time = first_time(rules, forces, here, table, poses, courses, work, accounts, path,
                                  c, edge, -1.0, 0.0, path.since, min(end, first))
                if time < first:
                    first, collider = time, c
    return first, collider


@inlined
def _holds(holds, c, face, side):
    """Whether a surface is among some; any face of a solid from outside counts as that solid."""
    for k in range(3):
        if holds[k] == FACES * c + face or (side > 0.0 and holds[k] != NONE
                                            and holds[k] // FACES == c):
            return True
    return False


@inlined
def _whole(table, s):
    """Give the surface by which a particle meets a solid that it was on a face of."""
    return FACES * (s // FACES) if s != NONE and table[s // FACES, SIDE] > 0.0 else s


@kernel
def _first_hit(rules, forces, here, table, poses, courses, work, accounts, path, end):
    """When a particle comes to a surface that does not hold it; `end` if not before."""
    for c in range(table.shape[0]):
        side = table[c, SIDE]
        if path.mode == RESTS and c == path.holds[0] // FACES:
            continue
        for face in range(faces(table, c, side)):
            if not _holds(path.holds, c, face, side):
                end = min(end, first_time(rules, forces, here, table, poses, courses, work,
                                          accounts, path, c, face, side, here.radius, path.since,
                                          end))
    return end


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
def _faces_under(rules, here, table, poses, courses, holds, t, x, v):
    """Give the faces of boxes and cylinders for the surfaces that hold a particle."""
    a, b, c = holds
    a = face_of(rules, here, table, poses, courses, a, t, x, v)
    if b != NONE:
        b = face_of(rules, here, table, poses, courses, b, t, x, v)
    if c != NONE:
        c = face_of(rules, here, table, poses, courses, c, t, x, v)
    return a, b, c


@kernel
def _travel(rules, forces, here, table, poses, courses, work, log, accounts, mode, holds, t,
            duration, x, v, pace):
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
    end, stop, stopped, released = duration, inf, NONE, NONE
    if mode == FLIES:
        path = _flight(forces, t, x, v)
    elif mode == RESTS:
        path = Path(RESTS, holds, t, x, v, False, ZERO, 0.0, 0.0, False)
        end = _breakaway(rules, forces, here, table, poses, courses, work, path, end)
    else:
        if at_rest(courses, poses, here, holds[0] // FACES, t, x, v):
            v = material_velocity(courses, poses, here, holds[0] // FACES, t, x)
        holds = _faces_under(rules, here, table, poses, courses, holds, t, x, v)
        path, stop = _straight(rules, forces, here, table, poses, courses, holds, t, x, v)
        if stop <= end:
            end, stopped = stop, holds[0]
    if mode != RESTS and not path.closed:
        end, pace, bend, stiff, stopped = _integrated(
            rules, forces, here, table, poses, courses, work, path, t, duration, pace)
        path = Path(mode, path.holds, t, x, v, False, ZERO, 0.0, bend, stiff)
    last = end
    edge, left = _face_end(rules, forces, here, table, poses, courses, work, accounts, path, end)
    end = min(edge, end)
    end = _first_hit(rules, forces, here, table, poses, courses, work, accounts, path, end)
    if mode == SLIDES and not path.closed:
        end, released = _lift_off(rules, forces, here, table, poses, courses, work, path, end)
    x1, v1 = state_at(rules, forces, here, table, poses, courses, work, path, end)
    if mode == SLIDES:
        x1, v1 = onto_surfaces(rules, here, table, poses, courses, holds, end, x1, v1)
    if mode != FLIES:
        _log_holds(rules, forces, here, table, poses, courses, log, accounts, path, end, x1, v1)
    if end == last and stopped != NONE:
        v1 = material_velocity(courses, poses, here, stopped // FACES, end, x1)
    elif end == edge and here.radius == 0.0:
        released = FACES * left
    return end, x1, v1, _whole(table, released), pace


@kernel
def _approached(rules, here, table, poses, courses, t, x, v):
    """First surface that a particle touches and approaches, and the normal velocity, or NONE."""
    for count in range(FACES * table.shape[0]):
        s, v_n = touched(rules, here, table, poses, courses, t, x, v, count)
        if s == NONE or v_n < 0.0:
            return s, v_n
    return NONE, 0.0


@kernel
def _jam(here, courses, poses, accounts, notes, c, t, duration, x):
    """Fail-safe of a particle that cannot leave two surfaces: it goes along with the first."""
    accounts[here.block, N_FAIL_SAFE] += 1
    note_unplaced(here, accounts, notes, c, NONE)
    return resting_place(courses, poses, here, c, x, t, duration)


@kernel
def go_through(rules, forces, here, table, poses, motion, courses, work, log, accounts, notes,
               duration, x, v):
    """
    Take a particle that starts outside all colliders through the events of a step.

    Parameters
    ----------
    rules, forces, here, table, poses, motion, courses, work, log, accounts, notes
        As in `step_events`.
    duration : float [s]
        Of the step.
    x, v : (3,) tuple of float [m], [m/s]

    Returns
    -------
    x, v : (3,) tuple of float [m], [m/s]

    """
    t, last, rapid, released, pace, contacts, x0 = 0.0, -1.0, 0, NONE, duration, 0, x
    for _ in range(EVENTS):
        if t >= duration:
            return push_out(rules, here, table, poses, motion, x0, x)[0], v     # of rounding
        s, v_n = _approached(rules, here, table, poses, courses, t, x, v)
        if s != NONE:
            hop = (length(forces.gravity) * (t - last) - v_n) * (t - last)
            rapid = rapid + 1 if t == last or hop <= HOP * length(x) else 0
            if rapid <= CHATTER:
                v = _collide(rules, forces, here, table, poses, courses, log, accounts, duration,
                             s, v_n, t, x, v)
            else:
                v, rapid = _stop_jointly(rules, here, table, poses, courses, t, x, v), 0
                if _approached(rules, here, table, poses, courses, t, x, v)[0] != NONE:
                    return _jam(here, courses, poses, accounts, notes, s // FACES, t, duration, x)
            last, released = t, NONE
            continue
        mode, holds = choose_mode(rules, forces, here, table, poses, courses, released, t, x, v)
        if mode != FLIES and contacts == 0:
            contacts = 1
            accounts[here.block, N_CONTACT] += 1
        t, x, v, released, pace = _travel(rules, forces, here, table, poses, courses, work, log,
                                          accounts, mode, holds, t, duration, x, v, pace)
    accounts[here.block, N_UNDECIDED] += 1
    return x, v


@njit(cache=True, error_model='numpy', nogil=True)
def step_events(posted, counters, rules, forces, duration, steps, table, poses, motion, courses,
                radius, log, accounts, notes, x, v):
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
            for i in range(block * BLOCK, min((block + 1) * BLOCK, x.shape[1])):
                here = Here(step, start, end, block, i, radius_at(radius, i))
                x0, v0 = (x[0, i], x[1, i], x[2, i]), (v[0, i], v[1, i], v[2, i])
                if _is_inside(rules, forces, here, table, poses, courses, duration, x0, v0):
                    x0, v0 = resolve(rules, here, table, poses, motion, log, accounts, notes, x0,
                                     v0)
                else:
                    x0, v0 = go_through(rules, forces, here, table, poses, motion, courses, work,
                                        log, accounts, notes, duration, x0, v0)
                x[0, i], x[1, i], x[2, i] = x0
                v[0, i], v[1, i], v[2, i] = v0
        block = fetch_add(counters, CLAIMED, 1)
    fetch_add(counters, LEFT, 1)
