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
The response of one particle over one step: collision stage, contact stage, placing.

The candidate starts at x0 with velocity v0, moves with the mean velocity u to x1 = x0 + dt u and
ends with velocity w. Normals are those of the colliders at the END of the step, at x1; velocities
are relative to the material point of the collider. All methods are made of two stages:

- the collision stage (`collision_then_contact` only): elastic, on v0, the candidate is flown anew;
- the contact stage: on u. `single_pass` and `multi_pass` apply restitution here and add the change
  of u to w; `collision_then_contact` is inelastic here and applies the same law to w by itself, so
  that rest, stick and slide on planes are exact.

Then a particle that is still inside is placed outside. Who started inside a collider is repelled
from it instead. Of several colliders the one in which the particle is deepest acts first.
"""

from typing import NamedTuple, Optional

from collision_sim.core.flight import Flight, fly
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.laws import (CAPPED, dry_friction, EXPONENTIAL, normal_impulse, repulsion,
                                     wet_friction_capped, wet_friction_exponential,
                                     wet_friction_linear)
from collision_sim.core.motion import chord_velocity, END, ESTIMATED, point_velocity, START
from collision_sim.core.shapes import (KINETIC, Present, RESTITUTION, signed_distance, SIZE,
                                       STATIC, WET, WET_FORM)
from collision_sim.core.trajectory import first_hit, NEVER, path_velocity
from collision_sim.core.vectors import (add, add_scaled, dot, EPSILON, largest, length, origin,
                                        subtract)

COLLISION, SLIDE, STICK, REPULSION = 1, 2, 3, 4         # states of a contact
STATES = {COLLISION: 'collision', SLIDE: 'slide', STICK: 'stick', REPULSION: 'repulsion'}

COUNTERS = ('collisions', 'contacts', 'repulsions', 'fail_safes', 'unplaced', 'undecided')
N_COLLISION, N_CONTACT, N_REPULSION, N_FAIL_SAFE, N_UNPLACED, N_UNDECIDED = range(6)
N_LOGGED, ACCOUNTS = 6, 7   # columns of the accounts (blocks, ACCOUNTS): counters, rows of the log

# Columns of the log of contacts (blocks, rows, LOG), None when nobody wants it: particle,
# collider, state, point [m], normal, change of velocity [m/s]; and of the notes
# (blocks, NOTES, 3) on unplaced particles: particle, collider, other collider.
POINT, NORMAL, CHANGE, LOG = 3, 6, 9, 12
NOTES = 8
MOST_CONTACTS = 4           # colliders logged for one particle in one step

CHECKS = 3                  # most collisions of a particle in one step, as in the lecture
PUSHES = 12                 # times a particle is pushed to a surface before the fail-safe
PARALLEL = 1e-14            # square of the sine below which two normals are parallel
ROUNDING = 16.0 * EPSILON   # relative size of a velocity or depth that is only rounding
SAME_SIDE = 0.5             # cosine above which two normals belong to the same side of a surface
NONE = -1                   # no collider


class Rules(NamedTuple):
    """
    What a step does: numbers and, where a feature is absent, None; no arrays.

    present: the shapes; dry, wet: 1 if any collider has such friction; sweep: 1 if impacts are
    found along the path; checks: 1 if the method has a collision stage; passes: most passes of
    the contact stage; once: each collider at most once in turn (`single_pass`); share [-] and
    highest [m/s]: the repulsion.
    """

    flight: Flight
    present: Present
    dry: Optional[int]
    wet: Optional[int]
    sweep: Optional[int]
    checks: Optional[int]
    passes: int
    once: bool
    share: float
    highest: float


class Here(NamedTuple):
    """Step of this call, rows of poses at its start and end, block, particle and its radius."""

    step: int
    start: int
    end: int
    block: int
    particle: int
    radius: float


@kernel
def distance(rules, here, table, poses, row, c, point):
    """Signed distance [m] of the particle to a collider, with a row of poses."""
    return signed_distance(rules.present, table, poses, row, c, point)[0] - here.radius


class Touch(NamedTuple):
    """
    A collider to act on; NOTHING where there is none.

    collider, normal; obj [m/s]: velocity of its material point; point [m]: where the particle
    touches; v_n, target [m/s]: normal velocity, and the one that repulsion asks for, else 0; hit:
    whether to act on the velocity at the start of the step (collision stage).
    """

    collider: int
    normal: tuple
    obj: tuple
    point: tuple
    v_n: float
    target: float
    hit: bool


NOTHING = Touch(NONE, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, False)


@inlined
def rounding_depth(here, table, poses, c, x0):
    """Distance [m] to a collider at the start of the step that is only rounding."""
    return ROUNDING * (largest(x0) + largest(origin(poses, here.start, c)) + table[c, SIZE])


@inlined
def starts_inside(rules, here, table, poses, c, x0):
    """Depth [m] at which the particle starts the step inside a collider; 0 if only by rounding."""
    depth = -distance(rules, here, table, poses, here.start, c, x0)
    return depth if depth > rounding_depth(here, table, poses, c, x0) else 0.0


@kernel
def deepest(rules, here, table, poses, x0, x1):
    """
    Collider in which the particle ends deepest, of those it started outside of.

    Parameters
    ----------
    rules, here, table, poses
        As in `resolve`.
    x0, x1 : (3,) tuple of float [m]
        Start and end of the step.

    Returns
    -------
    c : int
        NONE if it ends outside all; equally deep: the first.
    phi : float [m]
        Signed distance, negative.
    n : (3,) tuple of float [-]

    """
    c, phi, n = NONE, 0.0, (0.0, 0.0, 1.0)
    for k in range(table.shape[0]):
        phi_k = distance(rules, here, table, poses, here.end, k, x1)
        if phi_k < phi and starts_inside(rules, here, table, poses, k, x0) == 0.0:
            c, phi = k, phi_k
            n = signed_distance(rules.present, table, poses, here.end, k, x1)[1]
    return c, phi, n


@inlined
def approach(v, obj, n):
    """Give the normal velocity [m/s] if it approaches by more than rounding, else 0."""
    v_n = dot(subtract(v, obj), n)
    return v_n if v_n < -ROUNDING * (largest(v) + largest(obj)) else 0.0


@inlined
def _dry_factor(dry, table, c, speed, dv_n):
    if dry is not None:
        if table[c, STATIC] * dv_n > 0.0:
            return dry_friction(speed, dv_n, table[c, STATIC], table[c, KINETIC])
    return 1.0


@inlined
def _wet_factor(wet, table, c, dv_n):
    if wet is not None:
        if table[c, WET_FORM] == EXPONENTIAL:
            return wet_friction_exponential(table[c, WET], dv_n)
        if table[c, WET_FORM] == CAPPED:
            return wet_friction_capped(table[c, WET], dv_n)
        return wet_friction_linear(table[c, WET], dv_n)
    return 1.0


@inlined
def respond(rules, table, c, v, obj, n, v_n, dv_n):
    """
    Velocity after a change dv_n along the normal and the friction that it causes.

    Parameters
    ----------
    rules, table, c
        As in `resolve`; which collider.
    v, obj, n : (3,) tuple of float [m/s], [-]
        Velocities of the particle and of the material point, and the normal.
    v_n, dv_n : float [m/s]
        Normal velocity before, and its change, not negative.

    Returns
    -------
    v : (3,) tuple of float [m/s]
        Where the particle sticks, exactly the velocity of the material point plus (v_n + dv_n) n.
    stuck : bool

    """
    relative = subtract(v, obj)
    tangential = add_scaled(relative, -dot(relative, n), n)
    factor = (_dry_factor(rules.dry, table, c, length(tangential), dv_n)
              * _wet_factor(rules.wet, table, c, dv_n))
    if factor == 0.0:
        return add_scaled(obj, v_n + dv_n, n), True
    after = add_scaled(v, dv_n, n)
    if factor == 1.0:
        return after, False
    return add_scaled(after, factor - 1.0, tangential), False


@inlined
def record(log, accounts, here, c, state, point, n, dv):
    """Log a contact, or add to that of the same particle and collider; nothing when off (None)."""
    if log is not None:
        b, i, rows = here.block, here.particle, accounts[here.block, N_LOGGED]
        for k in range(max(rows - MOST_CONTACTS, 0), rows):
            if log[b, k, 0] == i and log[b, k, 1] == c:
                for d in range(3):
                    log[b, k, CHANGE + d] += dv[d]
                return
        if rows >= MOST_CONTACTS and log[b, rows - MOST_CONTACTS, 0] == i or rows == log.shape[1]:
            return
        log[b, rows, 0], log[b, rows, 1], log[b, rows, 2] = i, c, state
        for d in range(3):
            log[b, rows, POINT + d], log[b, rows, NORMAL + d] = point[d], n[d]
            log[b, rows, CHANGE + d] = dv[d]
        accounts[b, N_LOGGED] = rows + 1


@inlined
def survey(rules, here, table, poses, motion, x0, x1, v0, u, collides):
    """
    Find the collider to act on next, of those that the particle ends inside of: the deepest.

    `collides` says whether the collision stage is still on. A collider approached with v0 then
    comes before those that are only approached with u, or not left fast enough.

    Returns
    -------
    touch : Touch
    inside : bool
        Whether the particle ends inside any collider.

    """
    touch, phi, inside, dt = NOTHING, 0.0, False, rules.flight.dt
    for k in range(table.shape[0]):
        phi_k = distance(rules, here, table, poses, here.end, k, x1)
        if phi_k >= 0.0:
            continue
        inside = True
        n = signed_distance(rules.present, table, poses, here.end, k, x1)[1]
        depth = starts_inside(rules, here, table, poses, k, x0)
        if collides and depth == 0.0 and (phi_k < phi or not touch.hit):
            v_n, obj = start_approach(rules.checks, here, poses, motion, k, n, x0, v0)
            if v_n < 0.0:
                touch, phi = Touch(k, n, obj, add_scaled(x1, -phi_k, n), v_n, 0.0, True), phi_k
        if not touch.hit and phi_k < phi:
            obj = chord_velocity(motion, poses, here.step, here.start, k, x0, dt)
            v_n, target = mean_approach(rules, depth, n, obj, u)
            if v_n < target:
                touch, phi = Touch(k, n, obj, add_scaled(x1, -phi_k, n), v_n, target, False), phi_k
    return touch, inside


@inlined
def start_approach(checks, here, poses, motion, k, n, x0, v0):
    """Give normal and material velocity of a collision on v0; 0 without that stage."""
    if checks is not None:
        obj = point_velocity(motion, poses, here.step, START, here.start, k, x0)
        return approach(v0, obj, n), obj
    return 0.0, (0.0, 0.0, 0.0)


@inlined
def mean_approach(rules, depth, n, obj, u):
    """Give the normal velocity of u, and the one to reach: 0, or the speed of repulsion."""
    if depth > 0.0:
        target = repulsion(depth, rules.flight.dt, rules.share, rules.highest)
        return dot(subtract(u, obj), n), target
    return approach(u, obj, n), 0.0


@inlined
def _impact(rules, here, table, poses, motion, accounts, k, depth, x0, x1):
    """
    Time, normal and arm of the impact with a collider on the path of the step.

    Where the particle touches at the start, and ends inside on the same side, the normal is that
    at the end, as without sweeps: on curved surfaces the normal at the start would let a slide
    gain energy. A collider that it started inside of counts as hit at the start if it ends inside.
    """
    end, n_end = signed_distance(rules.present, table, poses, here.end, k, x1)
    arm = subtract(x0, origin(poses, here.start, k))
    if depth > 0.0:
        return (0.0 if end < here.radius else NEVER), n_end, arm
    tau, n, arm, decided = first_hit(rules.present, table, poses, motion, here.step, here.start, k,
                                     here.radius, x0, subtract(x1, x0))
    accounts[here.block, N_UNDECIDED] += not decided
    if tau == 0.0 and end < here.radius and dot(n, n_end) > SAME_SIDE:
        n = n_end
    return tau, n, arm


@inlined
def survey_path(rules, here, table, poses, motion, accounts, x0, x1, v0, u, collides):
    """
    Find the collider to act on next, of those that the particle hits on its path: the earliest.

    As `survey`, with the normal at the hit; the material velocity there where the particle hits on
    its way, that of `survey` where it touches from the start.
    """
    touch, first, inside, dt = NOTHING, NEVER, False, rules.flight.dt
    for k in range(table.shape[0]):
        depth = starts_inside(rules, here, table, poses, k, x0)
        tau, n, arm = _impact(rules, here, table, poses, motion, accounts, k, depth, x0, x1)
        if tau > 1.0:
            continue
        inside = True
        point = add_scaled(x0, tau, subtract(x1, x0))
        there = path_velocity(motion, here.step, k, arm, dt)
        if collides and depth == 0.0 and (tau < first or not touch.hit):
            v_n, obj = start_approach(rules.checks, here, poses, motion, k, n, x0, v0)
            if tau > 0.0:
                v_n, obj = path_approach(rules.checks, v0, there, n), there
            if v_n < 0.0:
                touch, first = Touch(k, n, obj, point, v_n, 0.0, True), tau
        if not touch.hit and tau < first:
            obj = chord_velocity(motion, poses, here.step, here.start, k, x0, dt)
            v_n, target = mean_approach(rules, depth, n, obj, u)
            if v_n >= target and depth == 0.0:
                v_n, obj = approach(u, there, n), there
            if v_n < target:
                touch, first = Touch(k, n, obj, point, v_n, target, False), tau
    return touch, inside


@inlined
def path_approach(checks, v0, obj, n):
    """Give the normal velocity of a collision on v0; 0 without that stage."""
    if checks is not None:
        return approach(v0, obj, n)
    return 0.0


@inlined
def detect(sweep, rules, here, table, poses, motion, accounts, x0, x1, v0, u, collides):
    """Find the next collider to act on: along the path with `sweep`, else at the end."""
    if sweep is not None:
        return survey_path(rules, here, table, poses, motion, accounts, x0, x1, v0, u, collides)
    return survey(rules, here, table, poses, motion, x0, x1, v0, u, collides)


@inlined
def collide(rules, here, table, log, accounts, touch, v0):
    """Collision stage: velocity at the start of the step after an elastic collision."""
    c, n = touch.collider, touch.normal
    dv_n = normal_impulse(touch.v_n, table[c, RESTITUTION])
    after, _ = respond(rules, table, c, v0, touch.obj, n, touch.v_n, dv_n)
    record(log, accounts, here, c, COLLISION, touch.point, n, subtract(after, v0))
    accounts[here.block, N_COLLISION] += 1
    return after


@inlined
def _contact_target(checks, restitution, u_n, target, first):
    """Give the normal velocity [m/s] after a pass: elastic only without a collision stage."""
    if checks is not None:
        return target
    return u_n + normal_impulse(u_n, restitution) if first and target == 0.0 else target


@inlined
def _end_change(motion, rules, here, table, poses, c, x0, w_n, du_n):
    """
    Change of normal velocity that ends the approach of w.

    Where the velocity of the collider at the end is only estimated and the particle has been in
    contact from the start, the change is at most that of the constant force that moved it by
    dt du_n: a support that falls away does not drag it along or push it up.
    """
    if motion is not None:
        if motion[here.step, c, ESTIMATED] > 0.0:
            gap = distance(rules, here, table, poses, here.start, c, x0)
            if gap <= rounding_depth(here, table, poses, c, x0):
                return min(-w_n, 2.0 * du_n)
    return -w_n


@inlined
def _end_response(checks, rules, here, table, poses, motion, c, x0, x1, n, du, w, hit):
    """End velocity after a pass: by the law itself beside a collision stage, else by adding du."""
    if checks is not None:
        obj = point_velocity(motion, poses, here.step, END, here.end, c, x1)
        w_n = approach(w, obj, n)
        if w_n < 0.0:
            dw_n = -w_n if hit else _end_change(
                motion, rules, here, table, poses, c, x0, w_n, dot(du, n))
            return respond(rules, table, c, w, obj, n, w_n, dw_n)[0]
        return w
    return add(w, du)


@inlined
def press(rules, here, table, poses, motion, log, accounts, x0, touch, u, w, first, hit, lawful):
    """
    One pass of the contact stage against one collider.

    A particle that started inside is repelled: its approach ends, and the mean velocity gets the
    separating speed of laws.repulsion. That speed is not kept in the end velocity, so that nothing
    is shot out of a deep start: in that pass, and in later ones of the step (`lawful`), the end
    velocity gets the law by itself in every method.

    Returns
    -------
    u, w : (3,) tuple of float [m/s]
        Mean and end velocity after it.

    """
    c, n, repelled = touch.collider, touch.normal, touch.target > 0.0
    target = _contact_target(rules.checks, table[c, RESTITUTION], touch.v_n, touch.target, first)
    u_after, stuck = respond(rules, table, c, u, touch.obj, n, touch.v_n, target - touch.v_n)
    x1, du = add_scaled(x0, rules.flight.dt, u_after), subtract(u_after, u)
    if lawful or repelled:
        w_after = _end_response(1, rules, here, table, poses, motion, c, x0, x1, n, du, w, True)
    else:
        w_after = _end_response(rules.checks, rules, here, table, poses, motion, c, x0, x1, n, du,
                                w, hit)
    state, counter, point = (STICK if stuck else SLIDE), N_CONTACT, x1
    if target > 0.0:
        state, counter, point = COLLISION, N_COLLISION, touch.point
    if repelled:
        state, counter, point = REPULSION, N_REPULSION, x1
    record(log, accounts, here, c, state, point, n, subtract(w_after, w))
    accounts[here.block, counter] += 1
    return u_after, w_after


@inlined
def _joint_law(rules, table, one, two, obj1, obj2, v):
    """
    Velocity that approaches neither of two colliders, with the friction of both.

    It stays as it is where two closing colliders would squeeze the particle out faster than twice
    their speed.
    """
    n1, n2 = one.normal, two.normal
    v1, v2, k = dot(subtract(v, obj1), n1), dot(subtract(v, obj2), n2), dot(n1, n2)
    across = 1.0 - k * k
    if (v1 >= 0.0 and v2 >= 0.0) or across < PARALLEL:
        return v
    a, b = (k * v2 - v1) / across, (k * v1 - v2) / across
    if b <= 0.0:
        a, b = max(-v1, 0.0), 0.0
    elif a <= 0.0:
        a, b = 0.0, max(-v2, 0.0)
    after = add_scaled(add_scaled(v, a, n1), b, n2)
    if length(after) > length(v) + 2.0 * (length(obj1) + length(obj2)):
        return v
    for c, obj, dv_n in ((one.collider, obj1, a), (two.collider, obj2, b)):
        relative = subtract(after, obj)
        factor = (_dry_factor(rules.dry, table, c, length(relative), dv_n)
                  * _wet_factor(rules.wet, table, c, dv_n))
        after = add_scaled(after, factor - 1.0, relative)
    return after


@inlined
def _joint_end(checks, rules, here, table, poses, motion, one, two, x1, du, w):
    """End velocity after `press_jointly`, as in `_end_response`."""
    if checks is not None:
        obj1 = point_velocity(motion, poses, here.step, END, here.end, one.collider, x1)
        obj2 = point_velocity(motion, poses, here.step, END, here.end, two.collider, x1)
        return _joint_law(rules, table, one, two, obj1, obj2, w)
    return add(w, du)


@inlined
def press_jointly(rules, here, table, poses, motion, accounts, x0, one, two, u, w):
    """
    Contact with two colliders at once, for a particle that passes one by one leave approaching.

    In a groove of angle alpha a pass leaves cos(alpha)^2 of the approach of the pass before, which
    takes thousands of passes in an acute one. Here both impulses come from one linear system.

    Returns
    -------
    u, w : (3,) tuple of float [m/s]
        Mean and end velocity after it.

    """
    dt = rules.flight.dt
    obj1 = chord_velocity(motion, poses, here.step, here.start, one.collider, x0, dt)
    obj2 = chord_velocity(motion, poses, here.step, here.start, two.collider, x0, dt)
    u_after = _joint_law(rules, table, one, two, obj1, obj2, u)
    w_after = _joint_end(rules.checks, rules, here, table, poses, motion, one, two,
                         add_scaled(x0, dt, u_after), subtract(u_after, u), w)
    accounts[here.block, N_CONTACT] += 1
    return u_after, w_after


@kernel
def _free_part(n, a, b):
    """Give the part of normal n along the surfaces with normals a and b; zero: no such surface."""
    t = add_scaled(n, -dot(n, a), a)
    b = add_scaled(b, -dot(b, a), a)
    size = dot(b, b)
    if size > PARALLEL:
        t = add_scaled(t, -dot(t, b) / size, b)
    return t if dot(t, n) > PARALLEL else n


@kernel
def push_out(rules, here, table, poses, motion, x0, place):
    """
    Push a particle to the surfaces it is inside of, deepest first; a move, not an impulse.

    A push goes along the surfaces of the two colliders before it, so that a particle in a groove
    or a corner gets out in two or three pushes, however acute that is. Pushing ends where it leads
    further than the particle and the collider came.

    Returns
    -------
    place : (3,) tuple of float [m]
    c, other : int
        The last two colliders it was inside of; c is NONE where it is now outside all.

    """
    zero = (0.0, 0.0, 0.0)
    c1, c2, n1, n2, candidate = NONE, NONE, zero, zero, place
    for k in range(PUSHES):
        c, phi, n = deepest(rules, here, table, poses, x0, place)
        if c == NONE:
            return place, NONE, NONE
        a, b = n1, n2
        if c == c1 or c == c2:
            a, b = (n2 if c == c1 else n1), zero
        if c != c1:
            c2, n2 = c1, n1
        c1, n1 = c, n
        t = _free_part(n, a, b)
        rounding = EPSILON * (largest(place) + largest(origin(poses, here.end, c)) + here.radius)
        place = add_scaled(place, (k * rounding - phi) / dot(t, n), t)
        obj = chord_velocity(motion, poses, here.step, here.start, c, x0, rules.flight.dt)
        reach = length(subtract(candidate, x0)) + 2.0 * rules.flight.dt * length(obj)
        if length(subtract(place, candidate)) > reach + PUSHES * rounding:
            break
    return place, c1, c2


@kernel
def _retreat(rules, here, table, poses, motion, attempt, c, x0):
    """Where the fail-safe tries to place a particle: where it started, then carried by c."""
    if attempt == 0:
        return x0
    obj = chord_velocity(motion, poses, here.step, here.start, c, x0, rules.flight.dt)
    return add_scaled(x0, rules.flight.dt, obj)


@kernel
def is_path_clear(sweep, rules, here, table, poses, motion, x0, x1):
    """
    Whether no collider is hit on the way, with `sweep`; else the way does not matter.

    The way from one point of a round surface to the next is a chord inside it: leaving from a
    surface to the same side of it is clear.
    """
    if sweep is not None:
        dx = subtract(x1, x0)
        for k in range(table.shape[0]):
            if starts_inside(rules, here, table, poses, k, x0) > 0.0:
                continue
            tau, n, arm, _ = first_hit(rules.present, table, poses, motion, here.step, here.start,
                                       k, here.radius, x0, dx)
            n_end = signed_distance(rules.present, table, poses, here.end, k, x1)[1]
            slides = tau == 0.0 and dot(n, n_end) > SAME_SIDE
            obj = path_velocity(motion, here.step, k, arm, 1.0)
            if tau <= 1.0 and not slides and approach(dx, obj, n) < 0.0:
                return False
    return True


@kernel
def fail_safe(rules, here, table, poses, motion, accounts, notes, c, other, x0):
    """
    Place a particle that cannot be pushed out, with the velocity of a collider.

    It goes where it started, or else where one of the colliders would have carried it. Where all
    of that is inside something too, it rides along with collider c and is noted as unplaced.

    Returns
    -------
    x1, w : (3,) tuple of float [m], [m/s]

    """
    accounts[here.block, N_FAIL_SAFE] += 1
    for attempt in range(table.shape[0] + 1):
        carrier = (c + max(attempt - 1, 0)) % table.shape[0]
        place = _retreat(rules, here, table, poses, motion, attempt, carrier, x0)
        place, inside, _ = push_out(rules, here, table, poses, motion, x0, place)
        if inside == NONE and is_path_clear(rules.sweep, rules, here, table, poses, motion, x0,
                                            place):
            return place, point_velocity(motion, poses, here.step, END, here.end, carrier, place)
    note_unplaced(here, accounts, notes, c, other)
    place = _retreat(rules, here, table, poses, motion, 1, c, x0)
    return place, point_velocity(motion, poses, here.step, END, here.end, c, place)


@kernel
def note_unplaced(here, accounts, notes, c, other):
    """Count a particle that stays inside a collider, and note which one and what hems it in."""
    seat = accounts[here.block, N_UNPLACED]
    if seat < NOTES:
        notes[here.block, seat, 0], notes[here.block, seat, 1] = here.particle, c
        notes[here.block, seat, 2] = other
    accounts[here.block, N_UNPLACED] = seat + 1


@inlined
def resolve(rules, here, table, poses, motion, log, accounts, notes, x0, v0):
    """
    One step of a particle that may touch something.

    Parameters
    ----------
    rules, here : Rules, Here
        What to do, and where.
    table, poses, motion, log, accounts, notes
        Tables of shapes.py, motion.py and this module; the last three are written.
    x0, v0 : (3,) tuple of float [m], [m/s]
        State at the start of the step.

    Returns
    -------
    x1, v1 : (3,) tuple of float [m], [m/s]

    """
    u, w = fly(rules.flight, v0)
    hits, passes, lawful = 0, 0, False
    last, other = NOTHING, NOTHING
    while True:
        x1 = add_scaled(x0, rules.flight.dt, u)
        if passes == rules.passes:
            break
        touch, inside = detect(rules.sweep, rules, here, table, poses, motion, accounts, x0, x1,
                               v0, u, passes == 0 and hits < CHECKS)
        if not inside:
            return x1, w
        if touch.collider == NONE or (rules.once and touch.collider == last.collider):
            break
        if touch.hit:
            v0 = collide(rules, here, table, log, accounts, touch, v0)
            u, w = fly(rules.flight, v0)
            hits += 1
        else:
            u, w = press(rules, here, table, poses, motion, log, accounts, x0, touch, u, w,
                         passes == 0 or rules.once, hits > 0, lawful)
            lawful = lawful or touch.target > 0.0
            other = last if touch.collider != last.collider else other
            last, passes = touch, passes + 1
    if other.collider != NONE and not lawful:
        u, w = press_jointly(rules, here, table, poses, motion, accounts, x0, last, other, u, w)
        x1 = add_scaled(x0, rules.flight.dt, u)
    place, c, beside = push_out(rules, here, table, poses, motion, x0, x1)
    if c != NONE or not is_path_clear(rules.sweep, rules, here, table, poses, motion, x0, place):
        return fail_safe(rules, here, table, poses, motion, accounts, notes, max(c, 0), beside, x0)
    return place, w
