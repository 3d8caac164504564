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
Checks 1: nobody is deeper than the stated bound, and nobody passes through.

All look at the run itself; distances come from distances.py. A check gives None where it holds,
else what is wrong.
"""

from itertools import combinations

from cases import each, method, stepping
from distances import crossings, distance
import numpy as np

EPSILON = 2.0 ** -52
# Rounding of a distance: that of a place, of the place of the collider, and of a turn about it.
SLACK = 256 * EPSILON
# Rounding of a place that the event-driven method finds: its roots are found to 1e-12 of a length.
EVENT_SLACK = 1e-9
OPPOSITE = 0.1      # -cos of the angle of normals from which surfaces press from two sides
OVERLAP = 0.01      # of the smaller radius, that balls may overlap by
ASIDE = 1e-8 * np.array([(0, 0, 0), (1, 2, -1), (-1, -2, 1), (2, -1, 1), (-2, 1, -1)])     # m
ASKED = 2.0 ** -20  # m, how far around a point is looked whether it is free on any side
EXCUSES = ('unplaced', 'undecided', 'frozen')
AROUND = np.random.default_rng(0).standard_normal((64, 3))
AROUND /= np.linalg.norm(AROUND, axis=1, keepdims=True)
ALL_AROUND = np.random.default_rng(1).standard_normal((4000, 3))
ALL_AROUND /= np.linalg.norm(ALL_AROUND, axis=1, keepdims=True)


def slack(case, step, c):
    """Bound of the rounding of distances (N,) to collider c [m]."""
    collider = step.scene.colliders[c]
    size = sum(collider.size) + (collider.mesh.extent if collider.mesh else 0.0)
    far = np.maximum(np.abs(step.x0).max(axis=1), np.abs(step.x).max(axis=1))
    reach = 1.0 + far + np.abs(step.poses[c][0]).max() + np.abs(step.poses0[c][0]).max() + size
    return (EVENT_SLACK if method(case) == 'exact' else SLACK) * reach


def is_excused(step):
    """Whether a counter says that somebody could not be placed, or was given up."""
    return any(step.counters[key] for key in EXCUSES)


def stays_outside(case, run, random):
    """
    Who starts a step outside of all colliders ends it outside, to rounding, or is counted.

    (Who starts inside of one may be pushed into another one. Inside is also who starts walled in
    in the seam of two that lie face to face: on the surfaces of both.)
    """
    for k, step in enumerate(run):
        if is_excused(step):
            continue
        solid = [c for c, collider in enumerate(step.scene.colliders)
                 if not (collider.mesh and not collider.mesh.closed)]
        free = np.all([step.gaps[c, 0] >= -slack(case, step, c) for c in solid], axis=0)
        for c in solid:
            collider, (before, after) = step.scene.colliders[c], step.gaps[c]
            bad = np.flatnonzero(free & ~(after >= -2.0 * slack(case, step, c)))
            bad = [i for i in bad if not buried(case, step, i, step.poses0, step.x0,
                                                ALL_AROUND) > 0.0]
            if bad:
                i = bad[0]
                return (f'step {k}: particle {i} goes from {before[i]:.3g} m outside of '
                        f'{collider.name} to {-after[i]:.3g} m inside')


def buried(case, step, i, poses, x, around):
    """Least depth [m] over all sides of a point in the union of all colliders; <= 0: free."""
    points, radius = x[i] + ASKED * around, each(case, 'radius', 0.0)[i]
    depth = np.full(len(points), -np.inf)
    for collider, pose in zip(step.scene.colliders, poses):
        if not (collider.mesh and not collider.mesh.closed):
            depth = np.maximum(depth, radius - distance(collider, pose, points))
    return depth.min()


def stays_out_of_all(case, run, random):
    """
    Who starts a step outside, with free space on some side, does not end it walled in all around.

    That is the bound for the union of colliders side by side: a point in the seam of two tiles is
    on the surface of both, and yet inside. Radii count; the rounding of a distance is far below
    ASKED. Of colliders that move as one; plates that close may leave no space at all.
    """
    for k, step in enumerate(run):
        if is_excused(step):
            continue
        for i in _between(step):
            limit = 0.002 * ASKED
            if (_starts_outside(case, step, i)
                    and buried(case, step, i, step.poses, step.x, AROUND) > limit
                    and buried(case, step, i, step.poses0, step.x0, ALL_AROUND) < -0.05 * ASKED
                    and buried(case, step, i, step.poses, step.x, ALL_AROUND) > 0.0):
                return f'step {k}: particle {i} ends walled in at {step.x[i].tolist()}'


def _starts_outside(case, step, i, but=None):
    """Whether a particle starts a step outside of all colliders, or all but one, to rounding."""
    return all(step.gaps[c, 0, i] >= -slack(case, step, c)[i]
               for c in range(len(step.gaps)) if c != but)


def passes_nothing(case, run, random):
    """
    Nobody passes through: along the chord of a step nobody is inside, where paths are searched.

    That is with `trajectory`: the place where a step ends is right only if the way there is free
    (response.resolve), but for the sag d^2 / 8 R of a slide by d on a round surface or round an
    edge, and for the fall g dt^2 / 2 of one who slides over an edge. Only for colliders that do
    not turn in the step, with which the chord is straight. Meshes are never passed through,
    whatever the detection: the chord has no crossing with them, unless another collider pushes a
    particle that starts inside of it.
    """
    for k, step in enumerate(run):
        if is_excused(step) or has_no_place(case, step):
            continue
        for c, collider in enumerate(step.scene.colliders):
            if collider.mesh:
                problem = _crosses(case, step, c)
            elif stepping(case, 'detection', '') == 'trajectory' and method(case) != 'exact':
                problem = _cuts(case, step, c)
            else:
                problem = None
            if problem:
                return f'step {k}: {problem}'


def _crosses(case, step, c):
    """
    Crossings of a mesh that does not turn in the step; at both ends away from it.

    Of chords beside each other the one that crosses least: one along a face may cross its edges.
    """
    collider, (p0, q0), (p1, q1) = step.scene.colliders[c], step.poses0[c], step.poses[c]
    if np.abs(np.subtract(q0, q1)).max() > 1e-12:
        return None
    for i in range(len(step.x)):
        if not _starts_outside(case, step, i, but=c):
            continue
        count = min((crossings(collider, (p0, q0), (p1, q1), step.x0[i] + aside, step.x[i] + aside)
                     for aside in ASIDE), key=lambda crossed: (crossed % 2, crossed))
        ends = np.abs([distance(collider, (p0, q0), step.x0[i:i + 1])[0],
                       distance(collider, (p1, q1), step.x[i:i + 1])[0]])
        inside = collider.mesh.closed and step.gaps[c][0][i] < -slack(case, step, c)[i]
        if count and (ends > 1e-9).all() and not inside and count % 2 + (
                count > 0 and not collider.mesh.closed):
            return f'particle {i} goes through {collider.name}'
    return None


def _cuts(case, step, c):
    """
    Whether a chord cuts a collider that does not turn by more than rounding.

    Who starts walled in in a seam starts inside, as `stays_outside` says.
    """
    collider, (p0, q0), (p1, q1) = step.scene.colliders[c], step.poses0[c], step.poses[c]
    if np.abs(np.subtract(q0, q1)).max() > 1e-12:
        return None
    before, after = step.gaps[c]
    blur, radius = slack(case, step, c), each(case, 'radius', 0.0)
    tau = np.linspace(0.0, 1.0, 65)[:, None]
    for i in np.flatnonzero((before >= -blur) & (after >= -blur)):
        chord = (1.0 - tau) * (step.x0[i] - p0) + tau * (step.x[i] - p1)
        depth = (radius[i] - distance(collider, (np.zeros(3), q0), chord)).max()
        fall = 0.5 * np.linalg.norm(step.scene.gravity) * step.scene.stepping.dt ** 2
        limit = 1e-9 + 4.0 * blur[i] + fall
        if depth > limit and depth > limit + 1.001 * _sag(collider, q0, radius[i], chord[0],
                                                          chord[-1], blur[i]) and not (
                buried(case, step, i, step.poses0, step.x0, ALL_AROUND) > 0.0):
            return f'particle {i} goes {depth:.3g} m deep through {collider.name}'
    return None


def _sag(collider, turn, radius, start, end, blur):
    """
    How deep the chord of a slide may cut a round surface, or what a ball rounds at an edge [m].

    A convex shape is behind the planes that touch it where the slide starts and where it ends: so
    nothing of the chord is deeper than it is behind one of them. The core takes no step for a
    slide in which the normal turns by more than 60 degrees (rules.SAME_SIDE), or that does not
    begin on the surface.
    """
    if distance(collider, (np.zeros(3), turn), start[None])[0] - radius > 1e-9 + blur:
        return 0.0
    n0, n1 = (_normal(collider, turn, place) for place in (start, end))
    down, up = n0 @ (start - end), n1 @ (end - start)
    return down * up / (down + up) if n0 @ n1 > 0.5 and down > 0.0 and up > 0.0 else 0.0


def _normal(collider, turn, place):
    """Return the normal at a place beside a collider, from how the distance to it grows."""
    places = place + 1e-7 * np.concatenate([np.eye(3), -np.eye(3)])
    gaps = distance(collider, (np.zeros(3), turn), places)
    n = gaps[:3] - gaps[3:]
    return n / max(np.linalg.norm(n), 1e-300)


def inner_room(collider):
    """
    Radius [m] of the largest ball inside a collider; infinite where particles are outside.

    Of a mesh: of the largest one in the box around it, at least.
    """
    if not collider.inside or collider.shape == 'plane':
        return np.inf
    if collider.shape == 'mesh':
        return 0.5 * np.ptp(collider.mesh.vertices, axis=0).min()
    if collider.shape in ('sphere', 'capsule'):
        return collider.size[0]
    return min(half for half in collider.size if half > 0.0)


def has_no_place(case, step):
    """Whether a particle starts inside a collider whose cavity it fills, or that is too small."""
    return any((step.gaps[c][0][each(case, 'radius', 0.0) >= inner_room(collider)] < 0.0).any()
               for c, collider in enumerate(step.scene.colliders))


def balls_keep_apart(case, run, random):
    """
    Balls that do not overlap do not come to overlap by more than 1 % of the smaller radius.

    And none goes through another one: with `trajectory` their centres pass each other at no less
    than nine tenths of the sum of the radii, on the relative chord of a step, which is their way
    unless they are thrown to and fro in it. Balls that hang
    together and that colliders press on from two sides have no other place. Nothing that
    a ball does moves one of infinite mass: two of these do not collide, and a collider that pushes
    one pushes it through others.
    """
    if 'pairs' not in case['scene'] or 'springs' in case['scene']:
        return None
    radius = each(case, 'radius', 0.0)
    for k, step in enumerate(run):
        if is_excused(step):
            continue
        hits = step.counters['collisions'] + step.counters['pair_collisions']
        for i in range(len(radius)):
            for j in range(i):
                if not (radius[i] > 0.0 and radius[j] > 0.0):
                    continue
                together, least = radius[i] + radius[j], min(radius[i], radius[j])
                before, after = step.x0[i] - step.x0[j], step.x[i] - step.x[j]
                if np.linalg.norm(before) < together - OVERLAP * least:
                    continue
                overlap, problem = together - np.linalg.norm(after), None
                if overlap > 1.5 * OVERLAP * least:
                    problem = f'come to overlap by {overlap / least:.3g} of the radius'
                elif stepping(case, 'detection', '') == 'trajectory' and hits <= 2 * len(radius):
                    way = after - before
                    tau = np.clip(-(before @ way) / max(way @ way, 1e-300), 0.0, 1.0)
                    if np.linalg.norm(before + tau * way) < 0.9 * together:
                        problem = 'pass through each other'
                if problem and _have_room(case, step, i, j):
                    return f'step {k}: balls {j} and {i} {problem}'


def _have_room(case, step, i, j):
    """
    Whether two balls can keep apart: not both of infinite mass, and not held from two sides.

    They are where two surfaces near those that hang together with them press on these from two
    sides, or two balls of infinite mass, or one of each, or where one of these starts buried in a
    collider.
    """
    mass, size, balls = each(case, 'mass', 1.0), each(case, 'radius', 0.0), cluster(
        case, step, (i, j))
    if np.isinf(mass[[i, j]]).all() or _is_press(case, step, balls):
        return False
    normals = [_away(step.x[ball] - step.x[heavy]) for heavy in balls if np.isinf(mass[heavy])
               for ball in balls if np.isfinite(mass[ball]) and np.linalg.norm(
                   step.x[ball] - step.x[heavy]) < size[heavy] + 1.5 * size[ball]]
    for c, collider in enumerate(step.scene.colliders):
        before, after = step.gaps[c]
        near = [ball for ball in balls if after[ball] < 0.5 * size[ball]]
        if near and inner_room(collider) < 3.0 * max(size[ball] for ball in balls) or any(
                before[ball] < -size[ball] for ball in balls):
            return False
        place, turn = step.poses[c]
        normals += [_normal(collider, turn, step.x[ball] - place) for ball in near]
    return all(one @ other > -OPPOSITE for one, other in combinations(normals, 2))


def _away(vector):
    """Return the direction of a vector, 0 without length."""
    return vector / max(np.linalg.norm(vector), 1e-300)


def cluster(case, step, balls):
    """Balls that hang together with some, by gaps below half of a radius."""
    radius = each(case, 'radius', 0.0)
    found, queue = set(balls), list(balls)
    while queue:
        i = queue.pop()
        for x in (step.x0, step.x):
            gaps = np.linalg.norm(x - x[i], axis=1) - radius - radius[i]
            for j in np.flatnonzero(gaps < 0.5 * np.minimum(radius, radius[i])):
                if j not in found:
                    found.add(int(j))
                    queue.append(int(j))
    return sorted(found)


def _is_press(case, step, balls):
    """Whether some balls are between a collider and one of them that nothing moves."""
    mass, radius = each(case, 'mass', 1.0)[balls], each(case, 'radius', 0.0)[balls]
    return bool(np.isinf(mass).any()) and any(
        (gaps[:, balls] < 0.5 * radius).any() for gaps in step.gaps)


def _between(step):
    """Particles that end on the surfaces of two colliders or more, and not far out."""
    near = step.gaps.min(axis=1) < ASKED + np.linalg.norm(step.x - step.x0, axis=1)
    moves = np.array([np.concatenate([np.subtract(after[0], before[0]), after[1] - before[1]])
                      for before, after in zip(step.poses0, step.poses)])
    return [i for i in np.flatnonzero((near.sum(axis=0) > 1) & (np.abs(step.x).max(axis=1) < 1e3))
            if np.ptp(moves[near[:, i]], axis=0).max() < 1e-12]


CHECKS = (stays_outside, stays_out_of_all, passes_nothing, balls_keep_apart)
