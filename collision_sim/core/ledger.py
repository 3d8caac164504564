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
The ledger: where the energy and the momentum of the particles come from and go to.

Every change of a velocity or a place is booked where it happens, per unit mass times the mass of
the particle, to one of the accounts below. The kernels get a `Ledger`, or None, for which nothing
is compiled. Particles of infinite mass are left out.

- A change of velocity from v to v' brings the kinetic energy (v' - v).(v + v')/2, exactly.
- A shift dx of the place is a work g.dx of gravity, taken from the potential energy.
- An impulse of a collider does the work impulse.v_obj; what remains of the energy that it brings
  is that of the velocity relative to the collider, along the normal and along the surface.

In the contact stage a force acts over the whole step. There v_obj is the mean velocity of the
material point, and the energy of an impulse is taken together with the work of gravity on the
shift that it causes: together they are exact on planes, for friction too.
"""

from math import nan
from typing import NamedTuple

from collision_sim.core.impulses import dry_factor, two_parts, wet_factor
from collision_sim.core.jit import by_address, inlined, kernel
from collision_sim.core.laws import normal_impulse
from collision_sim.core.modules import BOOK_PASS, BOOK_TWO
from collision_sim.core.motion import chord_velocity
from collision_sim.core.shapes import RESTITUTION
from collision_sim.core.vectors import add, add_scaled, dot, length, scaled, subtract
import numpy as np

# Columns of the rows (blocks, columns): energies [J], then momenta [N s], then for each collider
# its work and its impulse.
ENERGIES = ('gravity', 'drag', 'flight', 'restitution', 'dry', 'wet', 'contact', 'repulsion',
            'internal')
GRAVITY, DRAG, FLIGHT, RESTITUTED, DRY_LOSS, WET_LOSS, CONTACT, REPULSED, INTERNAL = range(9)
GRAVITY_IMPULSE, DRAG_IMPULSE, COLLIDERS, PER_COLLIDER = 9, 12, 15, 4


class Ledger(NamedTuple):
    """
    What the kernels book with.

    rows (blocks, columns): written, none where no ledger is kept; weight (N,) or (1,): mass of
    each particle, or of all; gravity [m/s^2]; drags: whether there is drag; euler: whether the
    flight is symplectic Euler.
    """

    rows: np.ndarray
    weight: np.ndarray
    gravity: tuple
    drags: bool
    euler: bool


NO_LEDGER = Ledger(np.empty((0, COLLIDERS)), np.ones(1), (0.0, 0.0, 0.0), False, False)


@inlined
def is_kept(ledger):
    """Whether a ledger is kept."""
    return ledger.rows.shape[0] > 0


def columns(colliders):
    """How many columns the rows of a ledger have, for a number of colliders."""
    return COLLIDERS + PER_COLLIDER * colliders


@kernel
def weight_of(weight, i):
    """Mass [kg] that is booked for particle i; a single one is that of all."""
    return weight[i] if weight.shape[0] > 1 else weight[0]


@inlined
def book(ledger, here, account, amount):
    """Book an energy per unit mass [J/kg] of the particle to an account."""
    if is_kept(ledger):
        ledger.rows[here.block, account] += weight_of(ledger.weight, here.particle) * amount


@inlined
def book_impulse(ledger, here, c, work, dv):
    """Book the work [J/kg] and the change of velocity dv [m/s] that a collider brings."""
    if is_kept(ledger):
        weight, first = weight_of(ledger.weight, here.particle), COLLIDERS + PER_COLLIDER * c
        ledger.rows[here.block, first] += weight * work
        for d in range(3):
            ledger.rows[here.block, first + 1 + d] += weight * dv[d]


@inlined
def kinetic(before, after):
    """Kinetic energy per unit mass [J/kg] that a change of velocity brings."""
    return 0.5 * dot(subtract(after, before), add(before, after))


@inlined
def _flight_parts(ledger, dt, v, dx, w):
    """Work of gravity and of drag, error of the flight [J/kg], and the impulse of drag [m/s]."""
    g, dv = ledger.gravity, subtract(w, v)
    work = dot(g, dx)
    rest = 0.5 * dot(dv, add(v, w)) - work
    if not ledger.drags:
        return work, 0.0, rest, (0.0, 0.0, 0.0)
    impulse = add_scaled(dv, -dt, g)
    drag = 0.5 * dot(impulse, add(v, w)) if ledger.euler else rest
    return work, drag, rest - drag, impulse


@inlined
def book_flight(ledger, here, dt, v, u, w, sign):
    """
    Book a flight over a step, or take it back.

    Parameters
    ----------
    ledger, here : Ledger, Here
        Where to book; whose flight.
    dt : float [s]
        Length of the step.
    v, u, w : (3,) tuple of float [m/s]
        Velocity at its start, mean velocity, velocity at its end.
    sign : float
        1, or -1 to take it back.

    """
    if is_kept(ledger):
        work, drag, error, impulse = _flight_parts(ledger, dt, v, scaled(dt, u), w)
        weight, b = sign * weight_of(ledger.weight, here.particle), here.block
        ledger.rows[b, GRAVITY] += weight * work
        ledger.rows[b, DRAG] += weight * drag
        ledger.rows[b, FLIGHT] += weight * error
        for d in range(3):
            ledger.rows[b, GRAVITY_IMPULSE + d] += weight * (w[d] - v[d] - impulse[d])
            ledger.rows[b, DRAG_IMPULSE + d] += weight * impulse[d]


@kernel
def book_flights(ledger, dt, block, first, x, y, z, vx, vy, vz, new):
    """Book the flights of a block, to the candidates in `new` (6, BLOCK)."""
    if is_kept(ledger):
        work = drag = error = px = py = pz = qx = qy = qz = 0.0
        for i in range(x.shape[0]):
            v, w = (vx[i], vy[i], vz[i]), (new[3, i], new[4, i], new[5, i])
            dx = (new[0, i] - x[i], new[1, i] - y[i], new[2, i] - z[i])
            one, two, three, impulse = _flight_parts(ledger, dt, v, dx, w)
            m = weight_of(ledger.weight, first + i)
            work, drag, error = work + m * one, drag + m * two, error + m * three
            px, py, pz = px + m * (w[0] - v[0]), py + m * (w[1] - v[1]), pz + m * (w[2] - v[2])
            qx, qy, qz = qx + m * impulse[0], qy + m * impulse[1], qz + m * impulse[2]
        rows = ledger.rows
        rows[block, GRAVITY] += work
        rows[block, DRAG] += drag
        rows[block, FLIGHT] += error
        rows[block, GRAVITY_IMPULSE] += px - qx
        rows[block, GRAVITY_IMPULSE + 1] += py - qy
        rows[block, GRAVITY_IMPULSE + 2] += pz - qz
        rows[block, DRAG_IMPULSE] += qx
        rows[block, DRAG_IMPULSE + 1] += qy
        rows[block, DRAG_IMPULSE + 2] += qz


@inlined
def dry_share(table, c, speed, dv_n):
    """Share of dry friction in the loss of a slip [m/s] to both kinds; NaN without loss."""
    dry = dry_factor(table, c, speed, dv_n)
    wet = wet_factor(table, c, dv_n)
    lost = 1.0 - dry * dry * wet * wet
    return (1.0 - dry * dry) / lost if lost != 0.0 else nan


@inlined
def book_loss(ledger, here, share, loss, otherwise):
    """Book a loss to dry and wet friction by their shares, or to an account without friction."""
    if share >= 0.0 or share < 0.0:
        book(ledger, here, DRY_LOSS, share * loss)
        book(ledger, here, WET_LOSS, loss - share * loss)
    else:
        book(ledger, here, otherwise, loss)


@inlined
def book_collision(world, here, touch, dv_n, before, after):
    """Book a collision that changes the velocity at the start of the step."""
    ledger = world.ledger
    if is_kept(ledger):
        c, n, obj = touch.collider, touch.normal, touch.obj
        dv, v_n = subtract(after, before), touch.v_n
        lost = 0.5 * dv_n * (2.0 * v_n + dv_n)
        slip = length(add_scaled(subtract(before, obj), -v_n, n))
        book_impulse(ledger, here, c, dot(dv, obj), dv)
        book(ledger, here, RESTITUTED, lost)
        book_loss(ledger, here, dry_share(world.table, c, slip, dv_n),
                  kinetic(before, after) - dot(dv, obj) - lost, RESTITUTED)


@inlined
def book_shift(ledger, here, account, dx):
    """Book a shift of the place [m]: gravity works, and an account takes it up."""
    if is_kept(ledger):
        work = dot(ledger.gravity, dx)
        book(ledger, here, GRAVITY, work)
        book(ledger, here, account, -work)


@inlined
def book_pull(ledger, here, dt, du, lawful):
    """Book the work of gravity that a change of the mean velocity brings; the contact's part."""
    if is_kept(ledger):
        pull = dt * dot(ledger.gravity, du)
        book(ledger, here, GRAVITY, pull)
        if not lawful:
            return pull
        book(ledger, here, REPULSED, -pull)
    return 0.0


@inlined
def book_contact(world, here, touch, n_end, x0, u, u1, w, w1, lost, lawful):
    """Book a pass of the contact stage as `book_pass`, where a ledger is kept."""
    if is_kept(world.ledger):
        by_address(world.rules.present.modules, BOOK_PASS, book_pass, True,
                   (world, here, touch, n_end, x0, u, u1, w, w1, lost, lawful))


@kernel
def book_pass(world, here, touch, n_end, x0, u, u1, w, w1, lost, lawful):
    """
    Book a pass of the contact stage.

    Parameters
    ----------
    world, here, x0
        As in `response.resolve`.
    touch, n_end : Touch, (3,) tuple of float
        The collider, and the normal along which the second half of a contact of second order
        acts; else that of the touch.
    u, u1, w, w1 : (3,) tuple of float [m/s]
        Mean velocity before and after, end velocity before and after.
    lost : float [J/kg]
        Of that, what restitution takes.
    lawful : bool
        Whether a repulsion came before: the mean velocity is only where it pushes the particle,
        and what gravity does on the way is its work.

    """
    ledger = world.ledger
    c, dt = touch.collider, world.rules.flight.dt
    obj = chord_velocity(world.motion, world.poses, here.step, here.start, c, x0, dt)
    dw, du = subtract(w1, w), subtract(u1, u)
    middle = add(touch.normal, n_end)
    n = scaled(1.0 / length(middle), middle)
    work, pull = dot(dw, obj), book_pull(ledger, here, dt, du, lawful)
    book_impulse(ledger, here, c, work, dw)
    rest = kinetic(w, w1) - pull - work
    if touch.target > 0.0:
        book(ledger, here, REPULSED, rest)
        return True
    relative = subtract(scaled(0.5, add(w, w1)), obj)
    along = dot(dw, n) * dot(relative, n)
    if not lawful:
        along -= dt * dot(ledger.gravity, n) * dot(du, n)
    slip = add_scaled(relative, -dot(relative, n), n)
    book(ledger, here, RESTITUTED, lost)
    book(ledger, here, CONTACT, along - lost)
    book_loss(ledger, here, dry_share(world.table, c, length(slip), abs(dot(dw, n))),
              rest - along, CONTACT)
    return True


@inlined
def lost_in_pass(table, touch, target):
    """Energy [J/kg] that restitution takes in the first pass of a method without collisions."""
    if target > 0.0 and touch.target == 0.0:
        v_n = touch.v_n
        dv_n = normal_impulse(v_n, table[touch.collider, RESTITUTION])
        return 0.5 * dv_n * (2.0 * v_n + dv_n)
    return 0.0


@inlined
def book_joint(world, here, one, two, x0, u, u1, w, w1):
    """Book a contact with two colliders at once, as `book_contact`."""
    poses, motion = world.poses, world.motion
    if is_kept(world.ledger):
        dt = world.rules.flight.dt
        obj1 = chord_velocity(motion, poses, here.step, here.start, one.collider, x0, dt)
        obj2 = chord_velocity(motion, poses, here.step, here.start, two.collider, x0, dt)
        book_at_once(world, here, one, two, obj1, obj2, u, u1, w, w1, 0.0, CONTACT, False)


@inlined
def book_at_once(world, here, one, two, obj1, obj2, u, u1, w, w1, lost, otherwise, lawful):
    """Book what two colliders do at once as `book_two`, where a ledger is kept."""
    if is_kept(world.ledger):
        by_address(world.rules.present.modules, BOOK_TWO, book_two, True,
                   (world, here, one, two, obj1, obj2, u, u1, w, w1, lost, otherwise, lawful))


@kernel
def book_two(world, here, one, two, obj1, obj2, u, u1, w, w1, lost, otherwise, lawful):
    """
    Book what two colliders do at once.

    Parameters
    ----------
    world, here
        As in `response.resolve`.
    one, two : Touch
        The colliders and their normals.
    obj1, obj2 : (3,) tuple of float [m/s]
        Velocities of their material points, which do the work.
    u, u1, w, w1 : (3,) tuple of float [m/s]
        Mean velocity before and after, end velocity before and after.
    lost : float [J/kg]
        What restitution takes.
    otherwise : int
        Account of what is left along the normals.
    lawful : bool
        As in `book_pass`.

    """
    ledger = world.ledger
    dt, n1, n2 = world.rules.flight.dt, one.normal, two.normal
    dw, du, mean = subtract(w1, w), subtract(u1, u), scaled(0.5, add(w, w1))
    first, a, b = two_parts(n1, n2, dw)
    _, au, bu = two_parts(n1, n2, du)
    second, g = subtract(dw, first), ledger.gravity
    work1, work2 = dot(first, obj1), dot(second, obj2)
    pull = book_pull(ledger, here, dt, du, lawful)
    book_impulse(ledger, here, one.collider, work1, first)
    book_impulse(ledger, here, two.collider, work2, second)
    along = a * dot(subtract(mean, obj1), n1) + b * dot(subtract(mean, obj2), n2)
    if not lawful:
        along -= dt * (au * dot(g, n1) + bu * dot(g, n2))
    book(ledger, here, RESTITUTED, lost)
    book(ledger, here, otherwise, along - lost)
    slip = subtract(mean, obj1)
    slip = add_scaled(slip, -dot(slip, n1), n1)
    book_loss(ledger, here, dry_share(world.table, one.collider, length(slip), abs(a)),
              kinetic(w, w1) - pull - work1 - work2 - along, otherwise)
    return True


@inlined
def book_placing(world, here, c, x0, x1, x2, w, w1):
    """Book a push from x1 to x2, and with a fail-safe of collider c a change of velocity."""
    ledger, rules, poses, motion = world.ledger, world.rules, world.poses, world.motion
    if is_kept(ledger):
        obj = chord_velocity(motion, poses, here.step, here.start, c, x0, rules.flight.dt)
        dw = subtract(w1, w)
        book_shift(ledger, here, REPULSED, subtract(x2, x1))
        book_impulse(ledger, here, c, dot(dw, obj), dw)
        book(ledger, here, REPULSED, kinetic(w, w1) - dot(dw, obj))
