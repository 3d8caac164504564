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
Checks 2: energy and momentum come from where the ledger and the contacts say.

All look at the run itself. Energies are compared with the largest energy that took part in the
step, momenta with the largest momentum.
"""

from bounds import cluster, is_excused
from cases import each, method, stepping
import numpy as np

ROUNDING = 1e-11    # of what takes part: some 1e5 operations of a step, each of 1e-16
EULER = 'symplectic_euler'
LOSSES = ('restitution', 'dry', 'wet')
MOST_CONTACTS = 4   # of a particle that are recorded in a step


def weights(case):
    """Masses of the particles, 0 for infinite ones, (N,) [kg]."""
    mass = each(case, 'mass', 1.0)
    return np.where(np.isfinite(mass), mass, 0.0)


def _mass_ratio(case):
    """Ratio of the largest and the smallest mass of balls that meet."""
    mass = weights(case)[weights(case) > 0.0]
    return mass.max() / mass.min() if 'pairs' in case['scene'] and len(mass) else 0.0


def scale(case, step):
    """Energy that takes part in a step [J]: of motion, of a fall over the step and the place."""
    mass, g, speed = weights(case), np.linalg.norm(step.scene.gravity), top_speed(step)
    return float(mass @ (np.square(speed) + g * np.abs(step.x).max(axis=1)))


def top_speed(step):
    """Speed that takes part in a step, of each particle and what may hit it (N,) [m/s]."""
    speed = np.maximum(np.linalg.norm(step.v0, axis=1), np.linalg.norm(step.v, axis=1))
    dt = step.scene.stepping.dt
    speed = (speed + np.linalg.norm(step.scene.gravity) * dt
             + np.linalg.norm(step.x - step.x0, axis=1) / (dt or 1.0))
    speed += max((collider_speed(step, c) for c in range(len(step.poses))), default=0.0)
    if step.scene.drag:
        speed += np.linalg.norm(step.scene.drag.wind)
    return speed


def collider_speed(step, c):
    """Bound of the speed of the surface of a collider near the particles [m/s]."""
    (p0, q0), (p1, q1) = step.poses0[c], step.poses[c]
    dt = step.scene.stepping.dt or 1.0
    arm = np.abs(step.x0 - p0).max() + np.abs(step.x - p1).max()
    turn = 2.0 * min(np.linalg.norm(np.subtract(q0, q1)), np.linalg.norm(np.add(q0, q1)))
    motion = step.scene.colliders[c].motion
    spin = np.linalg.norm(motion.angular_velocity) if motion else 0.0
    return np.linalg.norm(np.subtract(p1, p0)) / dt + arm * max(turn / dt, spin)


def is_still(step):
    """Whether no collider moves in a step."""
    return all(collider.motion is None for collider in step.scene.colliders) and all(
        np.array_equal(before, after) for one, other in zip(step.poses0, step.poses)
        for before, after in zip(one, other))


def is_uncapped(step):
    """
    Whether wet friction of the linear form may reverse and drive (laws.md) in a step.

    It does where D dv_N > 2. The change of normal velocity is at most twice what takes part.
    """
    scene = step.scene
    laws = [scene.friction, *(collider.friction for collider in scene.colliders),
            scene.pairs.friction if scene.pairs else None]
    most = max((law.wet for law in laws if law and law.wet and law.wet_form == 'linear'),
               default=0.0)
    return bool(most * 2.0 * top_speed(step).max(initial=0.0) > 1.0)


def is_driven(case, step):
    """Whether a ball of infinite mass moves, which is a source of energy as a collider is."""
    heavy = np.isinf(each(case, 'mass', 1.0))
    return bool(np.any(step.v0[heavy]) or np.any(step.x[heavy] != step.x0[heavy]))


def turns(step):
    """Whether a collider turns in a step."""
    return any(np.any(before[1] != after[1])
               for before, after in zip(step.poses0, step.poses, strict=True))


def overlap(case, step):
    """Whether balls that may collide overlap before a step; to part them is a source."""
    if step.scene.pairs is None:
        return False
    radius = each(case, 'radius', 0.0)
    apart = np.linalg.norm(step.x0[:, None] - step.x0, axis=2)
    np.fill_diagonal(apart, np.inf)
    return bool((apart < (radius[:, None] + radius) * (1.0 - ROUNDING)).any())


def ledger_closes(case, run, random):
    """See that the accounts of energy and momentum leave rounding: promise.md says 1e-15."""
    for k, step in enumerate(run):
        if step.balance is None or is_excused(step):
            continue
        size = scale(case, step)
        if not abs(step.balance.residual) <= ROUNDING * size:
            return f'step {k}: residual {step.balance.residual:.3g} J of {size:.3g} J'
        push = np.sqrt(size * weights(case).sum())
        rest = np.abs(step.balance.momentum.residual).max()
        if 'pairs' not in case['scene'] and 'springs' not in case['scene'] \
                and not rest <= ROUNDING * push:
            return f'step {k}: residual of momentum {rest:.3g} N s of {push:.3g} N s'


def losses_are_losses(case, run, random):
    """
    Restitution and friction only take; drag without wind, too; still colliders do no work.

    Losses of an impulse are told apart from the work of a collider by its velocity, which is not
    the same over a step where it turns or its twist is estimated: so only among still ones. And
    those of pairs, where none turns that may press one ball onto another. What presses at once
    does its work on the way from the velocities before all to those after: so a ball may bring
    to another what a collider has taken from it, and what is held, what drag has taken on the way
    it does not go. Balls that slide round each other are lifted by that: `_lift_of_slides`.

    Not asked of `single_pass`, `multi_pass` and `symplectic_euler`, which book the error of their
    order there, too. Nor of friction on springs: what they do on the shift that a contact brings
    is of second order in the step, and not told apart from the contact. So it is with what one of
    two surfaces does on the shift that the friction of the other one brings: m (g dt)^2.
    """
    if method(case) in ('single_pass', 'multi_pass') or stepping(case, 'flight', '') == EULER:
        return None
    for k, step in enumerate(run):
        if step.balance is None or is_excused(step) or is_uncapped(step):
            continue
        limit = ROUNDING * scale(case, step)
        losses = LOSSES[:1] if 'springs' in case['scene'] else LOSSES
        gravity = np.array(step.scene.gravity)
        order = float(weights(case) @ is_between(step)) * (
            gravity @ gravity) * step.scene.stepping.dt ** 2
        for name in losses if is_still(step) else ():
            gain = getattr(step.balance, name)
            if name != 'restitution':   # told apart from the contact to the order of the method
                gain += min(step.balance.contact, 0.0) - order
            if not gain <= limit:
                return f'step {k}: {name} brings {gain:.3g} J'
        if not (step.scene.drag and any(step.scene.drag.wind)) and not step.balance.drag <= limit:
            return f'step {k}: drag brings {step.balance.drag:.3g} J'
        gain = (step.balance.internal + min(step.balance.contact, 0.0)
                + min(step.balance.drag, 0.0))
        if not ('springs' in case['scene'] or overlap(case, step) or is_driven(case, step)
                or turns(step) or step.counters['repulsions']
                or gain <= limit + _lift_of_slides(case, step)):
            return f'step {k}: pairs bring {gain:.3g} J'
        if is_still(step) and not np.abs(step.balance.colliders).max(initial=0.0) <= limit:
            return f'step {k}: colliders that stand still work {step.balance.colliders.tolist()} J'


def is_between(step):
    """Whether each particle is where two surfaces may hold it (N,), or closer than a fall."""
    near = 1e-6 + np.linalg.norm(step.scene.gravity) * step.scene.stepping.dt ** 2
    surfaces = np.array([2 if collider.shape in ('box', 'cylinder', 'mesh') else 1
                         for collider in step.scene.colliders], dtype=int)
    return surfaces @ (step.gaps.min(axis=1) < near) > 1


def energy_has_a_source(case, run, random):
    """
    Energy does not grow where nothing moves, nothing blows and nobody starts inside.

    Kinetic energy without gravity: whatever the shapes and the method, each answer shrinks a
    velocity, and repulsion gives none. With gravity kinetic and potential energy together, on
    planes, where the methods with a collision stage are exact; on curved surfaces they have the
    error of their order, and so between two planes, where it comes and goes: m (g dt)^2. A plane
    is answered from the height of a fall g dt^2 over it, where particles come to rest. Balls that
    slide round each other have it as well: `_lift_of_slides`. Where balls press on each other, the
    ratio of their masses amplifies rounding.
    """
    if 'springs' in case['scene']:
        return None
    rounding = ROUNDING + np.finfo(float).eps * _mass_ratio(case)
    mass, gains = weights(case), method(case) in ('single_pass', 'multi_pass')
    for k, step in enumerate(run):
        gravity = np.array(step.scene.gravity)
        if (is_excused(step) or not is_still(step) or is_uncapped(step) or is_driven(case, step)
                or step.scene.drag and any(step.scene.drag.wind)
                or gravity.any() and (gains or step.scene.stepping.flight == EULER)):
            continue
        flat = all(collider.shape == 'plane' for collider in step.scene.colliders)
        if gravity.any() and (not flat or step.counters['repulsions'] or step.scene.drag):
            continue
        size, fall = scale(case, step), (gravity @ gravity) * step.scene.stepping.dt ** 2
        between = is_between(step)
        gain = float(mass @ (0.5 * np.square(step.v).sum(axis=1) - step.x @ gravity
                             - 0.5 * np.square(step.v0).sum(axis=1) + step.x0 @ gravity))
        if gravity.any() and overlap(case, step):
            if step.counters['collisions'] or step.counters['pair_collisions']:
                continue
            between, gain = True, _work_of_contacts(step, mass)
        order = float(mass @ (between * fall * np.ones_like(mass))) + _lift_of_slides(case, step)
        if not gain <= rounding * size + order:
            return f'step {k}: energy grows by {gain:.3g} J, of {size:.3g} J that take part'


def _lift_of_slides(case, step):
    """
    Energy that balls that slide round each other may gain in a step [J]: M g s^2 / 2 D.

    Who slides by s round a ball, at a distance D of the centres, is put on it and is s^2 / 2 D
    above the chord; what gravity then does is told apart from what holds him to first order
    (promise.md). M is the mass of all that hang together with the two: others may lie on them.
    """
    radius, g = each(case, 'radius', 0.0), np.linalg.norm(step.scene.gravity)
    near, lift = 1e-6 + g * step.scene.stepping.dt ** 2, 0.0
    for i in range(len(radius) if step.counters['pair_contacts'] else 0):
        for j in range(i):
            before, after = step.x0[i] - step.x0[j], step.x[i] - step.x[j]
            apart = np.linalg.norm(after)
            if apart - radius[i] - radius[j] < near and apart > 0.0:
                slide = np.cross(after - before, after / apart)
                lift += weights(case)[cluster(case, step, (i, j))].sum() * g * (
                    slide @ slide) / (2.0 * apart)
    return float(lift)


def _work_of_contacts(step, mass):
    """
    Work of the impulses of a step on the mean velocities [J].

    To part balls that overlap shifts them, and lifts some, but gives no velocity. Impulses of
    contacts only brake: they end an approach.
    """
    impulse = step.v - step.v0 - step.scene.stepping.dt * np.array(step.scene.gravity)
    return float(mass @ (0.5 * (step.v + step.v0) * impulse).sum(axis=1))


def contacts_are_impulses(case, run, random):
    """
    See that the impulses of contacts are the changes of momentum that colliders bring.

    Of each particle where particles do not act on each other, else of all together. Where drag
    depends on the velocity, its impulse does, too, and only the ledger could say it. A particle
    with as many contacts as are recorded may have had more.
    """
    scene = case['scene']
    if 'springs' in scene or not np.isfinite(each(case, 'mass', 1.0)).all():
        return None
    mass = each(case, 'mass', 1.0)
    for k, step in enumerate(run):
        if step.contacts is None or is_excused(step) or step.scene.drag and (
                step.scene.drag.linear or step.scene.drag.quadratic):
            continue
        dt = step.scene.stepping.dt
        change = mass[:, None] * (step.v - step.v0 - dt * np.array(step.scene.gravity))
        told = np.zeros_like(change)
        np.add.at(told, step.contacts.particle, step.contacts.impulse)
        if np.bincount(step.contacts.particle, minlength=1).max() >= MOST_CONTACTS:
            continue
        size = np.sqrt(scale(case, step) * mass.sum())
        if 'pairs' in scene:
            told, change = told.sum(axis=0)[None], change.sum(axis=0)[None]
        missing = told - change
        if not np.abs(missing).max() <= 1e-9 * size:
            i = int(np.abs(missing).max(axis=1).argmax())
            return (f'step {k}: particle {i}, or all with pairs: contacts say {told[i].tolist()} '
                    f'N s, the momentum changes by {change[i].tolist()} N s')


def pairs_keep_momentum(case, run, random):
    """Balls without colliders keep their momentum, but for gravity; drag is left out."""
    mass = weights(case)
    if 'pairs' not in case['scene'] or 'springs' in case['scene'] or not np.isfinite(
            each(case, 'mass', 1.0)).all():
        return None
    for k, step in enumerate(run):
        if is_excused(step) or step.scene.drag or any(
                step.counters[key] for key in ('collisions', 'contacts', 'repulsions',
                                               'fail_safes')):
            continue
        change = mass @ (step.v - step.v0 - step.scene.stepping.dt * np.array(step.scene.gravity))
        size = np.sqrt(scale(case, step) * mass.sum())
        if not np.abs(change).max() <= ROUNDING * size:
            return f'step {k}: momentum of all balls changes by {change.tolist()} N s'


CHECKS = (ledger_closes, losses_are_losses, energy_has_a_source, contacts_are_impulses,
          pairs_keep_momentum)
