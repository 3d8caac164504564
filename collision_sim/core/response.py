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

- the collision stage (`collision_then_contact` and `second_order_contact`): elastic, on v0, the
  candidate is flown anew;
- the contact stage: on u. `single_pass` and `multi_pass` apply restitution here and add the change
  of u to w; `collision_then_contact` is inelastic here and applies the same law to w by itself, so
  that rest, stick and slide on planes are exact. `second_order_contact` takes the normals where
  the surface is met, and answers a contact as second_order.py says.

Then a particle that is still inside is placed outside. Who started inside a collider is repelled
from it instead. Of several colliders the one in which the particle is deepest acts first; two in
which it is equally deep act at once (ties.py).
"""

from collision_sim.core.candidates import candidate_of, fly_anew, is_settled
from collision_sim.core.detection import (approach, blocker, detect, distance, foremost,
                                          is_same_surface, next_rival, rivals, rounding_depth)
from collision_sim.core.impulses import (doubtful_change, joint_law, law_at_once, respond,
                                         two_parts)
from collision_sim.core.jit import by_address, inlined, kernel
from collision_sim.core.laws import normal_impulse
from collision_sim.core.ledger import (book, book_at_once, book_collision, book_contact,
                                       book_impulse, book_joint, book_placing, book_pull,
                                       book_shift, CONTACT, kinetic, lost_in_pass, REPULSED,
                                       RESTITUTED)
from collision_sim.core.modules import TO_BOTH_SURFACES, TO_SURFACE
from collision_sim.core.motion import chord_velocity, DOUBT, END, point_velocity
from collision_sim.core.nearby import chosen_within, reach_of
from collision_sim.core.placing import fail_safe, push_out
from collision_sim.core.rules import (CHANGE, CHECKS, COLLISION, MOST_CONTACTS, N_COLLISION,
                                      N_CONTACT, N_LOGGED, N_REPULSION, N_ROWS, N_STEP, NONE,
                                      NORMAL, NOTHING, OF_STEP, PARALLEL, POINT, REPULSION, SLIDE,
                                      STICK)
from collision_sim.core.second_order import to_both_surfaces, to_surface
from collision_sim.core.shapes import RESTITUTION
from collision_sim.core.vectors import add, add_scaled, dot, length, scaled, subtract

SLIGHT = 1e-6           # share of a radius: no deeper is who only rests where pairs have led him


@inlined
def _write_row(log, b, row, i, c, state, point, n, dv):
    """Write a contact to a row of the log."""
    log[b, row, 0], log[b, row, 1], log[b, row, 2] = i, c, state
    for d in range(3):
        log[b, row, POINT + d], log[b, row, NORMAL + d] = point[d], n[d]
        log[b, row, CHANGE + d] = dv[d]


@kernel
def _record_by_particle(world, here, c, state, point, n, dv):
    """Log a contact as `record`, where other particles are logged between those of a particle."""
    log, accounts = world.log, world.accounts
    b, rows = here.block, accounts[here.block, N_ROWS]
    stamp = OF_STEP * accounts[b, N_STEP]
    first = (here.particle - b * (log.shape[1] // rows)) * rows
    for k in range(first, first + rows):
        if not stamp <= log[b, k, 2] < stamp + OF_STEP:
            _write_row(log, b, k, here.particle, c, stamp + state, point, n, dv)
            accounts[b, N_LOGGED] += 1
            return
        if log[b, k, 1] == c:
            for d in range(3):
                log[b, k, CHANGE + d] += dv[d]
            return


@inlined
def record(world, here, c, state, point, n, dv):
    """Log a contact, or add to that of the same particle and collider; nothing without room."""
    log, accounts = world.log, world.accounts
    if log.shape[1] > 0:
        if accounts[here.block, N_ROWS] > 0:
            _record_by_particle(world, here, c, state, point, n, dv)
            return
        b, i, rows, own = here.block, here.particle, accounts[here.block, N_LOGGED], 0
        for k in range(max(rows - MOST_CONTACTS, 0), rows):
            if log[b, k, 0] == i:
                own += 1
                if log[b, k, 1] == c:
                    for d in range(3):
                        log[b, k, CHANGE + d] += dv[d]
                    return
        if own == MOST_CONTACTS or rows == log.shape[1]:
            return
        _write_row(log, b, rows, i, c, state, point, n, dv)
        accounts[b, N_LOGGED] = rows + 1


@inlined
def record_jointly(world, here, one, two, state, point, dv):
    """Log what two colliders do at once: the part along each normal, and its share of the rest."""
    k = dot(one.normal, two.normal)
    if 1.0 - k * k >= PARALLEL:
        dv1, _, _ = two_parts(one.normal, two.normal, dv)
        record(world, here, one.collider, state, point, one.normal, dv1)
        record(world, here, two.collider, state, point, two.normal, subtract(dv, dv1))
    else:
        record(world, here, one.collider, state, point, one.normal, dv)


@inlined
def collide(world, here, touch, v0):
    """Collision stage: velocity at the start of the step after an elastic collision."""
    table = world.table
    c, n = touch.collider, touch.normal
    dv_n = normal_impulse(touch.v_n, table[c, RESTITUTION])
    after, _ = respond(table, c, v0, touch.obj, n, touch.v_n, dv_n)
    record(world, here, c, COLLISION, touch.point, n, subtract(after, v0))
    book_collision(world, here, touch, dv_n, v0, after)
    world.accounts[here.block, N_COLLISION] += 1
    return after


@inlined
def collide_with_both(world, here, one, two, eps, v0):
    """
    Collision stage with two colliders at once, of which none comes before the other (ties.py).

    Both ask for the mean of their restitutions, eps: with one of its own each, two that are at an
    acute angle could bring energy.

    Returns
    -------
    v0 : (3,) tuple of float [m/s]
        Velocity after it.
    answered : bool
        Whether both push, and are answered.

    """
    c1, n1, c2, n2 = one.collider, one.normal, two.collider, two.normal
    after, a, _ = law_at_once(world.table, c1, n1, one.obj, c2, n2, two.obj, -eps * one.v_n, v0)
    if a > 0.0:
        record_jointly(world, here, one, two, COLLISION, one.point, subtract(after, v0))
        book_at_once(world, here, one, two, one.obj, two.obj, v0, v0, v0, after, 0.0, RESTITUTED,
                     False)
        world.accounts[here.block, N_COLLISION] += 2
    return after, a > 0.0


@inlined
def _contact_target(checks, restitution, u_n, target, first):
    """Give the normal velocity [m/s] after a pass: elastic only without a collision stage."""
    if checks:
        return target
    return u_n + normal_impulse(u_n, restitution) if first and target == 0.0 else target


@inlined
def _end_change(world, here, c, x0, x1, n, w_n, most):
    """
    Change of normal velocity that ends the approach of w.

    Where the velocity of the collider at the end is estimated and the particle has been in contact
    from the start, the change is at most `most` [m/s], that of the constant force that moved it in
    this step: a support that falls away does not drag it along or push it up. But what is left of
    the approach is no more than the estimate may be off by.
    """
    off = abs(dot(point_velocity(world.motion, world.poses, here.step, DOUBT, here.end, c, x1), n))
    if off > 0.0:
        gap = distance(world, here, here.start, c, x0)
        if gap <= rounding_depth(world, here, c, x0):
            return doubtful_change(w_n, most, off)
    return -w_n


@inlined
def _end_response(checks, world, here, c, x0, x1, n, du, most, w, hit):
    """End velocity after a pass: by the law itself beside a collision stage, else by adding du."""
    if checks:
        obj = point_velocity(world.motion, world.poses, here.step, END, here.end, c, x1)
        w_n = approach(w, obj, n)
        if w_n < 0.0:
            dw_n = -w_n if hit else _end_change(world, here, c, x0, x1, n, w_n, most)
            return respond(world.table, c, w, obj, n, w_n, dw_n)[0]
        return w
    return add(w, du)


@inlined
def _pressed(world, here, x0, v0, touch, u, w, target, hit, lawful):
    """Mean and end velocity, place and normal after a pass, and whether the particle sticks."""
    rules = world.rules
    c, n, most = touch.collider, touch.normal, 0.0
    if touch.stays and not lawful:
        u_after, x1, n, stuck = by_address(rules.present.modules, TO_SURFACE, to_surface,
                                           (u, u, u, False), (world, here, x0, v0, touch, u))
        du = subtract(u_after, u)
        w_after = _end_response(True, world, here, c, x0, x1, n, du, dot(du, touch.normal),
                                add(w, du), hit)
        return u_after, w_after, x1, n, stuck
    u_after, stuck = respond(world.table, c, u, touch.obj, n, touch.v_n, target - touch.v_n)
    x1, du = add_scaled(x0, rules.flight.dt, u_after), subtract(u_after, u)
    most = 2.0 * dot(du, n)
    if lawful or touch.target > 0.0:
        w_after = _end_response(True, world, here, c, x0, x1, n, du, most, w, True)
    else:
        w_after = _end_response(rules.checks, world, here, c, x0, x1, n, du, most, w, hit)
    return u_after, w_after, x1, n, stuck


@inlined
def press(world, here, x0, v0, touch, u, w, first, hit, lawful):
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
    rules, table, accounts = world.rules, world.table, world.accounts
    c, repelled = touch.collider, touch.target > 0.0
    target = _contact_target(rules.checks, table[c, RESTITUTION], touch.v_n, touch.target, first)
    u_after, w_after, x1, n, stuck = _pressed(world, here, x0, v0, touch, u, w, target, hit,
                                              lawful)
    state, counter, point = (STICK if stuck else SLIDE), N_CONTACT, x1
    if target > 0.0:
        state, counter, point = COLLISION, N_COLLISION, touch.point
    if repelled:
        state, counter, point = REPULSION, N_REPULSION, x1
    record(world, here, c, state, point, touch.normal, subtract(w_after, w))
    book_contact(world, here, touch, n, x0, u, u_after, w, w_after,
                 lost_in_pass(table, touch, target), lawful)
    accounts[here.block, counter] += 1
    return u_after, w_after


@inlined
def _joint_end(checks, world, here, one, two, x1, du, w):
    """End velocity after `press_jointly`, as in `_end_response`."""
    poses, motion = world.poses, world.motion
    if checks:
        obj1 = point_velocity(motion, poses, here.step, END, here.end, one.collider, x1)
        obj2 = point_velocity(motion, poses, here.step, END, here.end, two.collider, x1)
        return joint_law(world.table, one.collider, one.normal, obj1, two.collider, two.normal,
                         obj2, w)
    return add(w, du)


@inlined
def are_both_kept(one, two):
    """Whether two colliders are to be answered at once, as contacts of second order."""
    if one.stays and two.stays and one.collider != two.collider:
        k = dot(one.normal, two.normal)
        return 1.0 - k * k >= PARALLEL
    return False


@inlined
def press_jointly(world, here, x0, one, two, u, w):
    """
    Contact with two colliders at once, for a particle that passes one by one leave approaching.

    In a groove of angle alpha a pass leaves cos(alpha)^2 of the approach of the pass before, which
    takes thousands of passes in an acute one. Here both impulses come from one linear system.

    Returns
    -------
    u, w : (3,) tuple of float [m/s]
        Mean and end velocity after it.

    """
    rules, poses, motion = world.rules, world.poses, world.motion
    dt = rules.flight.dt
    obj1 = chord_velocity(motion, poses, here.step, here.start, one.collider, x0, dt)
    obj2 = chord_velocity(motion, poses, here.step, here.start, two.collider, x0, dt)
    u_after = joint_law(world.table, one.collider, one.normal, obj1, two.collider, two.normal,
                        obj2, u)
    x1 = add_scaled(x0, dt, u_after)
    w_after = _joint_end(rules.checks, world, here, one, two, x1, subtract(u_after, u), w)
    record_jointly(world, here, one, two, SLIDE, x1, subtract(w_after, w))
    book_joint(world, here, one, two, x0, u, u_after, w, w_after)
    world.accounts[here.block, N_CONTACT] += 1
    return u_after, w_after


@inlined
def press_on_both(world, here, x0, one, two, eps, u, w, first, lawful):
    """
    One pass of the contact stage against two colliders, of which none comes before the other.

    As `press` and `collide_with_both`.

    Returns
    -------
    u, w : (3,) tuple of float [m/s]
        Mean and end velocity after it.
    answered : bool
        Whether both push, and are answered.

    """
    rules, poses, motion = world.rules, world.poses, world.motion
    c1, n1, c2, n2, dt = one.collider, one.normal, two.collider, two.normal, rules.flight.dt
    target = _contact_target(rules.checks, eps, one.v_n, one.target, first)
    u_after, a, b = law_at_once(world.table, c1, n1, one.obj, c2, n2, two.obj, target, u)
    if not a > 0.0:
        return u, w, False
    x1, du = add_scaled(x0, dt, u_after), subtract(u_after, u)
    if lawful or one.target > 0.0:
        w_after = _joint_end(True, world, here, one, two, x1, du, w)
    else:
        w_after = _joint_end(rules.checks, world, here, one, two, x1, du, w)
    state, counter, account, lost = SLIDE, N_CONTACT, CONTACT, 0.0
    if one.target > 0.0:
        state, counter, account = REPULSION, N_REPULSION, REPULSED
    elif target > 0.0:
        state, counter = COLLISION, N_COLLISION
        lost = a * one.v_n + b * two.v_n + 0.5 * (a * a + b * b) + a * b * dot(n1, n2)
    record_jointly(world, here, one, two, state, x1, subtract(w_after, w))
    obj1 = chord_velocity(motion, poses, here.step, here.start, c1, x0, dt)
    obj2 = chord_velocity(motion, poses, here.step, here.start, c2, x0, dt)
    book_at_once(world, here, one, two, obj1, obj2, u, u_after, w, w_after, lost, account, lawful)
    world.accounts[here.block, counter] += 2
    return u_after, w_after, True


@kernel
def meet_all(world, here, x0, x1, v0, touch, tied, push, eps, u, w, first, lawful):
    """
    Collision or contact with more than two colliders at once, of which none comes before another.

    Who lacks as much of all of them lacks it along `push`, the sum of their normals (`rivals`),
    and does not slip: each does the same share. Else as `collide_with_both` and `press_on_both`.

    Returns
    -------
    u, w : (3,) tuple of float [m/s]
        Mean and end velocity after it; of a collision both are the velocity v0 after it.
    answered : bool
        Whether all push, and are answered.

    """
    rules, poses, motion = world.rules, world.poses, world.motion
    accounts, ledger = world.accounts, world.ledger
    n, along = touch.normal, dot(push, touch.normal)
    if not along > 0.0:
        return u, w, False
    target, v, end = -eps * touch.v_n, v0, v0
    state, counter, account, pull, lost = COLLISION, N_COLLISION, RESTITUTED, 0.0, 0.0
    if not touch.hit:
        target, v, end = _contact_target(rules.checks, eps, touch.v_n, touch.target, first), u, w
        state, counter, account = SLIDE, N_CONTACT, CONTACT
    a = (target - touch.v_n) / along
    after = add_scaled(v, a, push) if target > 0.0 else touch.obj
    w_after, b = after, a
    if not touch.hit:
        if touch.target > 0.0:
            state, counter, account = REPULSION, N_REPULSION, REPULSED
        elif target > 0.0:
            state, counter, square = COLLISION, N_COLLISION, dot(push, push)
            lost = a * touch.v_n * square / along + 0.5 * a * a * square
        pull = book_pull(ledger, here, rules.flight.dt, subtract(after, u), lawful)
        w_after = add(w, subtract(after, u))
        if rules.checks or lawful or touch.target > 0.0:
            obj = point_velocity(motion, poses, here.step, END, here.end, touch.collider, x1)
            b = -approach(w, obj, n) / along
            w_after = obj if b > 0.0 else w
    work, other, m = 0.0, touch, 0
    while other.collider != NONE:
        share = scaled(b, other.normal)
        record(world, here, other.collider, state, x1, other.normal, share)
        book_impulse(ledger, here, other.collider, dot(share, touch.obj), share)
        work += dot(share, touch.obj)
        accounts[here.block, counter] += 1
        other, m = next_rival(world, here, touch, tied, x0, x1, v0, u, m)
    book(ledger, here, RESTITUTED, lost)
    book(ledger, here, account, kinetic(end, w_after) - work - pull - lost)
    return after, w_after, True


@inlined
def press_both(world, here, x0, v0, one, two, new, free, passed):
    """
    Contact of second order with two colliders at once, in place of passes against each.

    new: how many of the two have not been counted yet; free, passed: mean and end velocity of the
    candidate, and after the pass against one of the colliders that has been recorded.

    Returns
    -------
    u, w : (3,) tuple of float [m/s]
        Mean and end velocity after it.

    """
    rules = world.rules
    u, w = by_address(rules.present.modules, TO_BOTH_SURFACES, to_both_surfaces, passed,
                      (world, here, x0, v0, one, two, free[0], free[1]))
    record_jointly(world, here, one, two, SLIDE, add_scaled(x0, rules.flight.dt, u),
                   subtract(w, passed[1]))
    book_joint(world, here, one, two, x0, passed[0], u, passed[1], w)
    world.accounts[here.block, N_CONTACT] += new
    return u, w


@kernel
def rest_where_led(world, here, x0, u):
    """
    Place where pairs have led a particle (`candidates.settled`), and whether it may stay there.

    It may where it ends in no collider, or in one by so little that it is only put on the surface:
    what pairs have left it of its velocity is right as it is.
    """
    x1 = add_scaled(x0, world.rules.flight.dt, u)
    place, c, _ = push_out(world, here, x0, x1)
    shift = subtract(place, x1)
    stays = c == NONE and length(shift) <= SLIGHT * here.radius and blocker(world, here, x0,
                                                                            place) == NONE
    if stays:
        book_shift(world.ledger, here, REPULSED, shift)
    return place, stays


@inlined
def _reaching(around, world, here, x0, x1, reach):
    """
    Choose more colliders where a particle comes further than those were chosen for.

    A collider that is fast, or a deep start, may send it away further than it came.
    """
    if around is not None:
        needed = reach_of(here.radius, around.move, x0, x1)
        if needed > reach:
            return chosen_within(around, world, here, x0, 2.0 * needed), 2.0 * needed
    return here, reach


@inlined
def resolve(world, here, x0, v0, around=None, reach=0.0):
    """
    One step of a particle that may touch something.

    Parameters
    ----------
    world, here : World, Here
        What to do and with what, and where. In the ledger, if it is kept, the flight is booked
        already.
    x0, v0 : (3,) tuple of float [m], [m/s]
        State at the start of the step.
    around : nearby.Around or None
        What the colliders of `here` are chosen from; None where they are all.
    reach : float [m]
        They are those that the particle may touch within this distance of x0.

    Returns
    -------
    x1, v1 : (3,) tuple of float [m], [m/s]

    """
    rules, table, ledger, candidates = world.rules, world.table, world.ledger, world.candidates
    u, w = candidate_of(candidates, rules.flight, here.particle, v0)
    free = u, w
    settled = is_settled(candidates, here.particle)
    if settled:
        place, stays = rest_where_led(world, here, x0, u)
        if stays:
            return place, w
    hits, passes, lawful = 0, 0, settled
    last, other = NOTHING, NOTHING
    while True:
        x1 = add_scaled(x0, rules.flight.dt, u)
        here, reach = _reaching(around, world, here, x0, x1, reach)
        if passes == rules.passes:
            break
        touch, inside = detect(world, here, x0, x1, v0, u,
                               passes == 0 and hits < CHECKS and not settled)
        if not inside and other.collider == NONE:
            return x1, w
        two, more, push, eps, at_once = NOTHING, False, NOTHING.obj, 0.0, False
        tied = 0.0, 0.0, 0.0
        if inside > 1:
            touch, tau, phi, blur = foremost(world, here, touch, x0, x1, v0, u)
            tied = tau, phi, blur
            two, more, push, eps = rivals(world, here, touch, tied, x0, x1, v0, u)
        if touch.collider == NONE or (rules.once and touch.collider == last.collider):
            break
        elastic = (passes == 0 or rules.once) and not settled
        if touch.hit:
            after = v0
            if more:
                after, _, at_once = meet_all(world, here, x0, x1, v0, touch, tied, push, eps, u, w,
                                             False, False)
            elif two.collider != NONE:
                after, at_once = collide_with_both(world, here, touch, two, eps, v0)
            if not at_once:
                after = collide(world, here, touch, v0)
            u, w = fly_anew(world, here, rules.flight, v0, after, u, w)
            v0, free = after, (u, w)
            hits += 1
            continue
        if more:
            u, w, at_once = meet_all(world, here, x0, x1, v0, touch, tied, push, eps, u, w,
                                     elastic, lawful)
        elif two.collider != NONE and not lawful and are_both_kept(touch, two):
            u, w = press_both(world, here, x0, v0, touch, two, 2, free, (u, w))
            at_once = True
        elif two.collider != NONE:
            u, w, at_once = press_on_both(world, here, x0, touch, two, eps, u, w, elastic, lawful)
        if at_once:
            lawful = lawful or touch.target > 0.0
            last, other, passes = touch, NOTHING, passes + 1
        elif passes == 1 and not lawful and are_both_kept(last, touch):
            u, w = press_both(world, here, x0, v0, last, touch, 1, free, (u, w))
            last, other, passes = touch, last, 2
        else:
            u, w = press(world, here, x0, v0, touch, u, w, elastic, hits > 0, lawful)
            lawful = lawful or touch.target > 0.0
            same = is_same_surface(table, touch.collider, touch.normal, last.collider, last.normal)
            other = other if same else last
            last, passes = touch, passes + 1
    joined = passes == 2 and are_both_kept(other, last)
    if other.collider != NONE and not lawful and not joined:
        u, w = press_jointly(world, here, x0, last, other, u, w)
        x1 = add_scaled(x0, rules.flight.dt, u)
        here, reach = _reaching(around, world, here, x0, x1, reach)
    place, c, beside = push_out(world, here, x0, x1)
    if c == NONE:
        c = blocker(world, here, x0, place)
    if c != NONE:
        place, w1, carrier = fail_safe(world, here, c, beside, x0)
        record(world, here, carrier, STICK, place, NOTHING.normal, subtract(w1, w))
        book_placing(world, here, carrier, x0, x1, place, w, w1)
        return place, w1
    book_shift(ledger, here, REPULSED, subtract(place, x1))
    return place, w
