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
Friction of a few contacts that touch each other.

It acts along the surface of each contact, with a bound by its normal impulse. Contacts that stay
within it stick: one linear system for all of them; a sweep there and back over all contacts then
finds who slides. Such turns find friction where contacts are well apart: where a light body lies
between heavy ones, or where friction and what presses depend on each other, they take thousands.
There the laws are linearised, as they are now, for all contacts at once: those that push keep
their normal velocity, and the friction of each is what its law makes of the slip without it and of
its normal impulse. Laws have kinks, so this is the semi-smooth method of Newton (Alart and Curnier
1991): whether it has led nearer is for the next turn to see.

Impulses are in units of the square roots of the effective masses, so that neither masses nor units
matter.
"""

from math import inf, sqrt

from collision_sim.core.contact_solver import (at, END_BOUND, ENDING, IMPULSE, INVERSE, LAW_ROW,
                                               MASS, NORMAL, push, put_at)
from collision_sim.core.impulses import wet_factor
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.laws import dry_friction, EXPONENTIAL
from collision_sim.core.pairs import FIRST, SECOND
from collision_sim.core.rules import ROUNDING
from collision_sim.core.shapes import KINETIC, STATIC, WET, WET_FORM
from collision_sim.core.vectors import add_scaled, cross, dot, length, scaled, subtract

HELD = 1e-8             # on a diagonal of ones: redundant contacts share what they bear
LEFT_OVER = 0.1         # of a slip, that wet friction leaves where surfaces ask for what cannot be
# Rows of the vectors of joint.Room: normal impulses, and those that bound friction.
FORCE, PRESSING = 1, 3
# Row of its state that says which coefficient of friction a contact has, and what it says: that of
# rest up to where it slides, else that of motion; only the one, or only the other.
MARK, BY_LAW, MAY_STICK, SLIDES = 2, -1, 0, 1
# Normal impulses are found with friction; or are, but for its bounds; or are not changed by it; in
# BOUNDED and AGAIN wet friction leaves something.
JOINTLY, BOUNDED, ALONE, AGAIN = 0, 1, 2, 3


@inlined
def shared_mass(pile, c, d):
    """Find what an impulse of contact d brings to the relative velocity at contact c [1/kg]."""
    bodies, ends = pile.bodies, pile.ends
    a, b, shared = ends[c, FIRST], ends[c, SECOND], 0.0
    for end, sign in ((FIRST, 1.0), (SECOND, -1.0)):
        if ends[d, end] == a:
            shared += sign * bodies[a, INVERSE]
        if ends[d, end] == b:
            shared -= sign * bodies[b, INVERSE]
    return shared


@inlined
def across(n):
    """Find two unit vectors along the surface with the normal n."""
    x, y, z = abs(n[0]), abs(n[1]), abs(n[2])
    axis = (1.0, 0.0, 0.0) if x <= y and x <= z else (
        (0.0, 1.0, 0.0) if y <= z else (0.0, 0.0, 1.0))
    one = cross(n, axis)
    one = scaled(1.0 / length(one), one)
    return one, cross(n, one)


@inlined
def approach_at_end(pile, c):
    """Relative velocity [m/s] of the bodies of contact c at the end."""
    return subtract(at(pile.bodies, pile.ends[c, FIRST], ENDING),
                    at(pile.bodies, pile.ends[c, SECOND], ENDING))


@inlined
def friction_of(pile, c):
    """Impulse [N s] of contact c along its surface."""
    n, impulse = at(pile.contacts, c, NORMAL), at(pile.contacts, c, IMPULSE)
    return add_scaled(impulse, -dot(impulse, n), n)


@inlined
def shift_friction(pile, c, change):
    """Add to the friction of contact c [N s]."""
    push(pile.bodies, pile.ends[c, FIRST], pile.ends[c, SECOND], ENDING, change)
    put_at(pile.contacts, c, IMPULSE, add_scaled(at(pile.contacts, c, IMPULSE), 1.0, change))


@inlined
def _coefficients(laws, row, mark):
    """Give the static and the kinetic coefficient of a contact."""
    static, kinetic = laws[row, STATIC], laws[row, KINETIC]
    return kinetic if mark == SLIDES else static, static if mark == MAY_STICK else kinetic


@inlined
def _wet_factor(laws, row, dv_n, mode):
    """
    Factor of wet friction on a slip.

    Two surfaces that slide past each other cannot both end the slip of a body between them. With
    something left of each there is an answer: between them, by the masses.
    """
    factor = wet_factor(laws, row, dv_n)
    if mode == BOUNDED or mode == AGAIN:
        return LEFT_OVER if 0.0 <= factor < LEFT_OVER else factor
    return factor


@inlined
def _factor(dry, laws, row, speed, dv_n, mark, mode):
    """Factor of friction on a slip [m/s]."""
    factor = 1.0
    if dry:
        static, kinetic = _coefficients(laws, row, mark)
        if static * dv_n > 0.0:
            factor = dry_friction(speed, dv_n, static, kinetic)
    return factor * _wet_factor(laws, row, dv_n, mode)


@inlined
def _slip_without(pile, c, along):
    """Slip [m/s] at contact c without the impulse [N s] of its own friction."""
    n, relative = at(pile.contacts, c, NORMAL), approach_at_end(pile, c)
    slip = add_scaled(relative, -dot(relative, n), n)
    return add_scaled(slip, -1.0 / pile.contacts[c, MASS], along)


@inlined
def _rub(dry, laws, pile, first, k, room, mode):
    """Give a contact the friction that its law asks for; the change of velocity [m/s]."""
    c = pile.member[first + k]
    mass, along, after = pile.contacts[c, MASS], friction_of(pile, c), (0.0, 0.0, 0.0)
    dv_n = room.vectors[PRESSING, k] / sqrt(mass)
    if dv_n > 0.0:
        slip = _slip_without(pile, c, along)
        factor = _factor(dry, laws, pile.ends[c, LAW_ROW], length(slip), dv_n,
                         room.state[MARK, k], mode)
        after = scaled(mass * (factor - 1.0), slip)
    change = subtract(after, along)
    shift_friction(pile, c, change)
    return length(change) / mass


@kernel
def rub_all(dry, laws, pile, first, count, room, mode, holds):
    """
    Give all contacts their friction, there and back; the largest change of velocity [m/s].

    `holds` says whether the slip of those that stick is ended at once before.
    """
    fastest = 0.0
    if mode == JOINTLY:
        for k in range(count):
            room.vectors[PRESSING, k] = room.vectors[FORCE, k]
    if count > 1 and holds:
        _hold(dry, laws, pile, first, count, room)
    for turn in range(2 if count > 1 else 1):
        for m in range(count):
            k = m if turn == 0 else count - 1 - m
            fastest = max(fastest, _rub(dry, laws, pile, first, k, room, mode))
    return fastest


@kernel
def mark_sliding(dry, laws, pile, first, count, room):
    """Mark those that slide although they could stick; whether there are more of them."""
    more = False
    if dry:
        for k in range(count):
            c, row = pile.member[first + k], pile.ends[pile.member[first + k], LAW_ROW]
            if room.state[MARK, k] == MAY_STICK and laws[row, KINETIC] < laws[row, STATIC]:
                bound = laws[row, STATIC] * room.vectors[PRESSING, k] / sqrt(
                    pile.contacts[c, MASS])
                if bound > 0.0 and length(_slip_without(pile, c, friction_of(pile, c))) > bound:
                    room.state[MARK, k], more = SLIDES, True
    return more


@kernel
def _list_holding(dry, laws, pile, first, count, room):
    """List the directions and bounds of those that stick; how many contacts there are of them."""
    size = 0
    if dry:
        for k in range(count):
            c = pile.member[first + k]
            static, _ = _coefficients(laws, pile.ends[c, LAW_ROW], room.state[MARK, k])
            bound = static * sqrt(pile.contacts[c, MASS]) * room.vectors[PRESSING, k]
            if length(friction_of(pile, c)) < bound * (1.0 - ROUNDING):
                one, other = across(at(pile.contacts, c, NORMAL))
                put_at(room.along, 2 * size, 0, one)
                put_at(room.along, 2 * size + 1, 0, other)
                room.pushed[size], room.kept[size, 0] = c, bound
                size += 1
    return size


@kernel
def _factorise(pile, size, room):
    """Factorise the matrix of those that are to be held."""
    factor, along, contacts, pushed = room.holding, room.along, pile.contacts, room.pushed
    for a in range(2 * size):
        c = pushed[a // 2]
        for b in range(a + 1):
            d = pushed[b // 2]
            entry = 1.0 + HELD if a == b else 0.0
            if c != d:
                shared = shared_mass(pile, c, d)
                if shared != 0.0:
                    entry = shared * sqrt(contacts[c, MASS] * contacts[d, MASS]) * dot(
                        at(along, a, 0), at(along, b, 0))
            for k in range(b):
                entry -= factor[a, k] * factor[b, k]
            factor[a, b] = sqrt(max(entry, 0.5 * HELD)) if a == b else entry / factor[b, b]


@kernel
def _hold(dry, laws, pile, first, count, room):
    """End the slip of all those at once that stick."""
    size, factor, slips, along = _list_holding(dry, laws, pile, first, count, room), (
        room.holding), room.slips, room.along
    contacts, pushed = pile.contacts, room.pushed
    _factorise(pile, size, room)
    for a in range(2 * size):
        c = pushed[a // 2]
        value = -sqrt(contacts[c, MASS]) * dot(approach_at_end(pile, c), at(along, a, 0))
        for b in range(a):
            value -= factor[a, b] * slips[b]
        slips[a] = value / factor[a, a]
    for a in range(2 * size - 1, -1, -1):
        value = slips[a]
        for b in range(a + 1, 2 * size):
            value -= factor[b, a] * slips[b]
        slips[a] = value / factor[a, a]
    for a in range(size):
        c, kept = pushed[a], friction_of(pile, pushed[a])
        root, bound = sqrt(contacts[c, MASS]), room.kept[a, 0]
        after = add_scaled(add_scaled(kept, root * slips[2 * a], at(along, 2 * a, 0)),
                           root * slips[2 * a + 1], at(along, 2 * a + 1, 0))
        if length(after) > bound:       # walls that slide past each other cannot both hold
            after = scaled(bound / length(after), after)
        shift_friction(pile, c, subtract(after, kept))


@inlined
def _frame(pile, c):
    """Give the normal of contact c and two directions along its surface."""
    n = at(pile.contacts, c, NORMAL)
    one, other = across(n)
    return n, one, other


@inlined
def _slopes(dry, wet, laws, row, speed, dv_n, mark, mode):
    """Factor of friction on a slip [m/s], its slope times that, and that by the normal change."""
    factor, by_speed, by_normal = 1.0, 0.0, 0.0
    if dry:
        static, kinetic = _coefficients(laws, row, mark)
        if static * dv_n > 0.0:
            factor = 0.0
            if speed > static * dv_n:
                by_speed, by_normal = kinetic * dv_n / speed, -kinetic / speed
                factor = 1.0 - by_speed
    if wet:
        left, slope = _wet_factor(laws, row, dv_n, mode), -laws[row, WET]
        if laws[row, WET_FORM] == EXPONENTIAL:
            slope *= left
        elif left == 0.0:
            slope = 0.0
        by_normal = by_normal * left + factor * slope
        factor, by_speed = factor * left, by_speed * left
    return factor, by_speed, by_normal


@kernel
def _write_blocks(pile, first, count, table, k, factor, by_speed, by_normal, slip):
    """Write the rows of contact k that pushes; `slip` is without its own friction."""
    c = pile.member[first + k]
    root, speed = sqrt(pile.contacts[c, MASS]), length(slip)
    n, one, other = _frame(pile, c)
    u, v = dot(slip, one), dot(slip, other)
    x, y = (u / speed, v / speed) if speed > 0.0 else (0.0, 0.0)
    for m in range(count):
        d = pile.member[first + m]
        shared = shared_mass(pile, c, d)
        if m != k and shared != 0.0:
            shared *= root * sqrt(pile.contacts[d, MASS])
            directions = _frame(pile, d)
            for e in range(3):
                p, q = shared * dot(one, directions[e]), shared * dot(other, directions[e])
                along = by_speed * (x * p + y * q)
                table[3 * k, 3 * m + e] = shared * dot(n, directions[e])
                table[3 * k + 1, 3 * m + e] = (1.0 - factor) * p - along * x
                table[3 * k + 2, 3 * m + e] = (1.0 - factor) * q - along * y
    table[3 * k + 1, 3 * k], table[3 * k + 2, 3 * k] = -by_normal * u, -by_normal * v


@kernel
def _write_normal(pile, c, k, last, room, mode):
    """Write the row of contact k for its normal impulse."""
    table = room.table
    if mode >= ALONE:
        for b in range(last):
            table[3 * k, b] = 1.0 * (b == 3 * k)
    else:
        v_n, shift = dot(approach_at_end(pile, c), at(pile.contacts, c, NORMAL)), room.shift[1]
        table[3 * k, last] = sqrt(pile.contacts[c, MASS]) * (pile.contacts[c, END_BOUND] - v_n)
        if shift > HELD:        # impulses that do not bring all that is wanted
            table[3 * k, 3 * k] = 1.0 + shift
            table[3 * k, last] -= shift * room.vectors[FORCE, k]


@kernel
def _linearise(dry, wet, laws, pile, first, count, room, mode):
    """Write the equations for the changes of all impulses, the right-hand sides last."""
    contacts, last, table = pile.contacts, 3 * count, room.table
    for k in range(count):
        c = pile.member[first + k]
        n, one, other = _frame(pile, c)
        for a in range(3 * k, 3 * k + 3):
            for b in range(last + 1):
                table[a, b] = 0.0
            table[a, a] = 1.0 + HELD
        mass, along = contacts[c, MASS], friction_of(pile, c)
        dv_n, target = room.vectors[PRESSING, k] / sqrt(mass), scaled(-1.0, along)
        if max(dv_n, room.vectors[FORCE, k]) > 0.0:
            slip = _slip_without(pile, c, along)
            factor, by_speed, by_normal = _slopes(dry, wet, laws, pile.ends[c, LAW_ROW],
                                                  length(slip), dv_n, room.state[MARK, k], mode)
            if mode == BOUNDED:
                by_normal = 0.0
            _write_blocks(pile, first, count, table, k, factor, by_speed, by_normal, slip)
            target = add_scaled(target, mass * (factor - 1.0), slip)
        if room.vectors[FORCE, k] > 0.0:
            _write_normal(pile, c, k, last, room, mode)
        else:
            for b in range(last):
                table[3 * k, b] = 1.0 * (b == 3 * k)
        table[3 * k + 1, last] = dot(target, one) / sqrt(mass)
        table[3 * k + 2, last] = dot(target, other) / sqrt(mass)


@kernel
def _eliminate(table, size):
    """Solve linear equations by elimination; the solution comes last. False if there is none."""
    for a in range(size):
        best = a
        for b in range(a + 1, size):
            if abs(table[b, a]) > abs(table[best, a]):
                best = b
        if not abs(table[best, a]) > 0.0:
            return False
        if best != a:
            for d in range(a, size + 1):
                table[a, d], table[best, d] = table[best, d], table[a, d]
        for b in range(a + 1, size):
            factor = table[b, a] / table[a, a]
            if factor != 0.0:
                for d in range(a + 1, size + 1):
                    table[b, d] -= factor * table[a, d]
    for a in range(size - 1, -1, -1):
        for d in range(a + 1, size):
            table[a, size] -= table[a, d] * table[d, size]
        table[a, size] /= table[a, a]
    return True


@inlined
def _bound(dry, wet, laws, row, mark, pressing):
    """Most [N s] that friction can be with a normal impulse [N s]: none has a bound when wet."""
    most = 0.0
    if dry:
        static, _ = _coefficients(laws, row, mark)
        most = static * pressing
    if wet:
        if laws[row, WET] > 0.0:
            most = inf
    return most


@kernel
def take_back(pile, first, count, room):
    """Give contacts the friction that was kept."""
    for k in range(count):
        c = pile.member[first + k]
        shift_friction(pile, c, subtract(at(room.kept, k, 0), friction_of(pile, c)))


@kernel
def slide_at_once(dry, wet, laws, pile, first, count, room, mode):
    """
    Lead the friction of some contacts to where the laws, linearised, say that it is.

    Parameters
    ----------
    dry, wet, laws, pile, first, count, room
        As in joint.settle_group; friction is changed, and the velocities of the bodies, and what
        it was is kept in `room`.
    mode : int
        JOINTLY, BOUNDED, ALONE or AGAIN.

    """
    size, table = 3 * count, room.table
    for k in range(count):
        put_at(room.kept, k, 0, friction_of(pile, pile.member[first + k]))
    _linearise(dry, wet, laws, pile, first, count, room, mode)
    if _eliminate(table, size):
        for k in range(count):
            c = pile.member[first + k]
            n, one, other = _frame(pile, c)
            root = sqrt(pile.contacts[c, MASS])
            after = add_scaled(add_scaled(at(room.kept, k, 0), root * table[3 * k + 1, size], one),
                               root * table[3 * k + 2, size], other)
            pressing = room.vectors[PRESSING, k]
            if mode == JOINTLY:
                pressing = max(pressing + table[3 * k, size], 0.0)
            bound = _bound(dry, wet, laws, pile.ends[c, LAW_ROW], room.state[MARK, k],
                           root * pressing)
            if length(after) > bound:
                after = scaled(bound / length(after), after)
            shift_friction(pile, c, subtract(after, at(room.kept, k, 0)))
