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
The ledger of the event-driven method: what a path between two events brings and takes.

Gravity's work is exact. Work of drag and of the colliders, and the powers of dry and wet friction,
are integrals over the path, by Gauss and Legendre's rule with four nodes; what remains of the
change of energy is the loss to friction, so that the accounts add up whatever the integrals.
"""

from math import sqrt

from collision_sim.core.courses import frame_acceleration, material_velocity
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.ledger import (book, book_impulse, book_loss, CONTACT, DRAG,
                                       DRAG_IMPULSE, DRY_LOSS, dry_share, FLIGHT, GRAVITY,
                                       GRAVITY_IMPULSE, is_kept, kinetic, RESTITUTED, weight_of,
                                       WET_LOSS)
from collision_sim.core.meeting import ZERO
from collision_sim.core.paths import state_at
from collision_sim.core.rules import NONE
from collision_sim.core.shapes import KINETIC, WET
from collision_sim.core.surfaces import FACES
from collision_sim.core.sustained import held, normal_at, pull, RESTS
from collision_sim.core.vectors import add_scaled, dot, length, subtract

# Nodes and weights of the rule on (0, 1).
OUTER, INNER = sqrt(3.0 / 7.0 + 2.0 / 7.0 * sqrt(6.0 / 5.0)), sqrt(3.0 / 7.0 - 2.0 / 7.0 * sqrt(
    6.0 / 5.0))
NODES = (0.5 - 0.5 * OUTER, 0.5 - 0.5 * INNER, 0.5 + 0.5 * INNER, 0.5 + 0.5 * OUTER)
LIGHT, HEAVY = (18.0 - sqrt(30.0)) / 72.0, (18.0 + sqrt(30.0)) / 72.0
WEIGHTS = (LIGHT, HEAVY, HEAVY, LIGHT)


@kernel
def _book_momentum(ledger, here, gravity, drag):
    """Book changes of velocity [m/s] by gravity and by drag."""
    weight = weight_of(ledger.weight, here.particle)
    for d in range(3):
        ledger.rows[here.block, GRAVITY_IMPULSE + d] += weight * gravity[d]
        ledger.rows[here.block, DRAG_IMPULSE + d] += weight * drag[d]


@inlined
def book_friction(world, here, c, slip, dv_n, loss):
    """Book the loss [J/kg] to friction of a collision that changes a slip [m/s]."""
    ledger = world.ledger
    if is_kept(ledger):
        book_loss(ledger, here, dry_share(world.table, c, slip, dv_n), loss, RESTITUTED)


@kernel
def _powers(world, forces, here, courses, path, t, x, v):
    """
    Accelerations and powers of what acts on a particle in contact.

    Returns
    -------
    drag, first, second, third : (3,) tuple of float [m/s^2]
        By drag, and by the surfaces that hold it.
    dry, wet : float [W/kg]
        Losses to friction.

    """
    table, poses = world.table, world.poses
    a, normal = held(world, forces, here, courses, path.holds, t, x, v)
    c = path.holds[0] // FACES
    if path.mode == RESTS:
        a, normal = frame_acceleration(courses, poses, here, c, t, x, ZERO), ZERO
    f = pull(forces, v)
    first, second, third, dry, wet = subtract(a, f), ZERO, ZERO, 0.0, 0.0
    for k in range(3):
        s = path.holds[k]
        if s != NONE and normal[k] > 0.0:
            w = subtract(v, material_velocity(courses, poses, here, s // FACES, t, x))
            speed = length(w)
            dry -= table[s // FACES, KINETIC] * normal[k] * speed
            wet -= table[s // FACES, WET] * normal[k] * speed * speed
            if k > 0:
                n = normal_at(world, here, courses, s, t, x)
                push = add_scaled(ZERO, normal[k], n)
                first = subtract(first, push)
                second, third = (push, third) if k == 1 else (second, push)
    return subtract(f, forces.gravity), first, second, third, dry, wet


@kernel
def book_path(world, forces, here, courses, work, path, t, x, v):
    """
    Book what happens on a path until an event.

    Parameters
    ----------
    world, forces, here, courses, work
        As in exact.py.
    path : paths.Path
        The way from the last event.
    t : float [s]
        When it ends.
    x, v : (3,) tuple of float [m], [m/s]
        Where and how fast it ends.

    """
    ledger, poses = world.ledger, world.poses
    if is_kept(ledger):
        h, dv = t - path.since, subtract(v, path.v)
        gain, fall = kinetic(path.v, v), dot(forces.gravity, subtract(x, path.x))
        fell = add_scaled(ZERO, h, forces.gravity)
        book(ledger, here, GRAVITY, fall)
        if path.holds[0] == NONE:
            book(ledger, here, DRAG if ledger.drags else FLIGHT, gain - fall)
            _book_momentum(ledger, here, fell, subtract(dv, fell))
            return
        slowed, second, third, dry, wet = ZERO, ZERO, ZERO, 0.0, 0.0
        drag, one, two, three = 0.0, 0.0, 0.0, 0.0
        for node in range(4):
            time, part = path.since + NODES[node] * h, WEIGHTS[node] * h
            y, u = state_at(world, forces, here, courses, work, path, time)
            by_drag, f1, f2, f3, dry_power, wet_power = _powers(world, forces, here, courses, path,
                                                                time, y, u)
            slowed = add_scaled(slowed, part, by_drag)
            second, third = add_scaled(second, part, f2), add_scaled(third, part, f3)
            dry, wet = dry + part * dry_power, wet + part * wet_power
            drag += part * dot(by_drag, u)
            one += part * dot(f1, material_velocity(courses, poses, here,
                                                    path.holds[0] // FACES, time, y))
            if path.holds[1] != NONE:
                two += part * dot(f2, material_velocity(courses, poses, here,
                                                        path.holds[1] // FACES, time, y))
            if path.holds[2] != NONE:
                three += part * dot(f3, material_velocity(courses, poses, here,
                                                          path.holds[2] // FACES, time, y))
        _book_momentum(ledger, here, fell, slowed)
        book(ledger, here, DRAG, drag)
        first = subtract(subtract(subtract(subtract(dv, fell), slowed), second), third)
        book_impulse(ledger, here, path.holds[0] // FACES, one, first)
        if path.holds[1] != NONE:
            book_impulse(ledger, here, path.holds[1] // FACES, two, second)
        if path.holds[2] != NONE:
            book_impulse(ledger, here, path.holds[2] // FACES, three, third)
        rest = gain - fall - drag - one - two - three
        if dry + wet < 0.0:
            book(ledger, here, DRY_LOSS, rest * dry / (dry + wet))
            book(ledger, here, WET_LOSS, rest * wet / (dry + wet))
        else:
            book(ledger, here, CONTACT, rest)
