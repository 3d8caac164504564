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

"""First time of collision on the paths of the event-driven method; order of its integrator."""

from math import cos, expm1, inf, sin, sqrt
from typing import NamedTuple

from collision_sim import Scene
from collision_sim.core import paths, shapes, surfaces
from collision_sim.core.courses import (AMPLITUDE, AXIS, COURSE, CUBE, LINEAR, PHASE, RATE, SPIN,
                                        SQUARE)
from collision_sim.core.extrapolation import ROWS
from collision_sim.core.flight import Flight
from collision_sim.core.meeting import NOBODY
from collision_sim.core.paths import Path
from collision_sim.core.rotation import rotation_matrix
from collision_sim.core.rules import ACCOUNTS, N_UNDECIDED, Rules
from collision_sim.core.shapes import (BOX, CAPSULE, COLUMNS, CYLINDER, KIND, PLANE, Present, SIDE,
                                       SIZE, SPHERE)
from collision_sim.core.sustained import FLIES
from collision_sim.tables import acting_forces
from numba import njit
import numpy as np
from numpy.testing import assert_allclose
import pytest
from small_scenes import EPSILON

SHAPES = {'plane': PLANE, 'sphere': SPHERE, 'box': BOX, 'capsule': CAPSULE, 'cylinder': CYLINDER}
RULES = Rules(Flight(1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), Present(),
              True, True, 1, True, 10, False, 0.1, 10.0)
FORCES = acting_forces(Scene.from_dict({'drag': {'linear': 1.0}}))     # a path has its own
COUNT, FINEST = 300, 1e-4       # queries, and finest step of the search by brute force
MOTIONS = ('rest', 'shift', 'swing', 'turn', 'spin', 'all')
every_shape = pytest.mark.parametrize(('shape', 'side'), [
    (shape, side) for shape in SHAPES for side in (1.0, -1.0) if shape != 'plane' or side > 0.0])
every_motion = pytest.mark.parametrize('motion', MOTIONS)


class Colliders(NamedTuple):
    """What kernels ask of a World that has colliders only."""

    rules: Rules
    table: np.ndarray
    poses: np.ndarray
    accounts: np.ndarray


@njit(error_model='numpy')
def first_times(rules, forces, table, poses, courses, radius, x, v, a, k):
    """
    First times in 0 ... 1 s at which particle i, v' = a - k v, comes to collider i; undecided.

    Of the faces of a shape around the particle the first.
    """
    times, accounts = np.full(x.shape[0], inf), np.zeros((1, ACCOUNTS), dtype=np.int64)
    work = np.empty((ROWS, 6))
    for i in range(x.shape[0]):
        here = surfaces.Spot(0, 0, 0, 0, 0, radius[i], None, None, None, 0.0)
        path = Path(FLIES, NOBODY, 0.0, (x[i, 0], x[i, 1], x[i, 2]), (v[i, 0], v[i, 1], v[i, 2]),
                    True, (a[i, 0], a[i, 1], a[i, 2]), k[i], 0.0, False)
        side = table[i, 0, SIDE]
        for face in range(surfaces.faces(table[i], 0, side)):
            times[i] = min(times[i], paths.first_time(
                Colliders(rules, table[i], poses[i], accounts), forces, here, courses[i], work,
                path, 0, face, side, radius[i], 0.0, 1.0, min(1.0, times[i])))
    return times, accounts[0, N_UNDECIDED]


@njit(error_model='numpy')
def distance(table, pose, course, radius, x, v, a, k, t):
    """Signed distance less radius at time t, each term written out."""
    e1, e2 = (t, 0.5 * t * t) if k == 0.0 else (-expm1(-k * t) / k,
                                                (t + expm1(-k * t) / k) / k)
    swing = sin(course[PHASE] + course[RATE] * t) - sin(course[PHASE])
    arm, spun = np.empty(3), np.empty(3)
    for d in range(3):
        arm[d] = (x[d] + e1 * v[d] + e2 * a[d] - pose[9 + d] - course[LINEAR + d] * t
                  - course[SQUARE + d] * t ** 2 - course[CUBE + d] * t ** 3
                  - course[AMPLITUDE + d] * swing)
    axis, c, s = course[AXIS:SPIN], cos(course[SPIN] * t), -sin(course[SPIN] * t)
    along = (1.0 - c) * (axis[0] * arm[0] + axis[1] * arm[1] + axis[2] * arm[2])
    for d in range(3):
        e, f = (d + 1) % 3, (d + 2) % 3
        spun[d] = c * arm[d] + s * (axis[e] * arm[f] - axis[f] * arm[e]) + along * axis[d]
    q = (pose[0] * spun[0] + pose[3] * spun[1] + pose[6] * spun[2],
         pose[1] * spun[0] + pose[4] * spun[1] + pose[7] * spun[2],
         pose[2] * spun[0] + pose[5] * spun[1] + pose[8] * spun[2])
    kind, phi = table[KIND], 0.0
    if kind == PLANE:
        phi = q[2]
    elif kind == SPHERE:
        phi = shapes.sphere(q, table[SIZE])[0]
    elif kind == BOX:
        phi = shapes.box(q, (table[SIZE], table[SIZE + 1], table[SIZE + 2]))[0]
    elif kind == CAPSULE:
        phi = shapes.capsule(q, table[SIZE], table[SIZE + 1])[0]
    else:
        phi = shapes.cylinder(q, table[SIZE], table[SIZE + 1])[0]
    return table[SIDE] * phi - radius


@njit(error_model='numpy')
def size(a):
    """Length of a vector."""
    return sqrt(a[0] ** 2 + a[1] ** 2 + a[2] ** 2)


@njit(error_model='numpy')
def first_inside(table, poses, courses, radius, x, v, a, k, finest):
    """
    First multiple of `finest` at which each particle is inside its collider, or infinity.

    Only those multiples are left out at which it cannot be inside, by the highest speed of both.
    """
    times = np.full(x.shape[0], inf)
    for i in range(x.shape[0]):
        course = courses[i, 0, 0]
        speed = (size(v[i]) + size(a[i] - k[i] * v[i]) + size(course[LINEAR:])
                 + 2.0 * size(course[SQUARE:]) + 3.0 * size(course[CUBE:])
                 + course[RATE] * size(course[AMPLITUDE:]))
        speed += course[SPIN] * (size(x[i] - poses[i, 0, 0, 9:]) + speed)
        n = 0
        while n * finest <= 1.0:
            f = distance(table[i, 0], poses[i, 0, 0], course, radius[i], x[i], v[i], a[i], k[i],
                         n * finest)
            if f < 0.0:
                times[i] = n * finest
                break
            n += max(1, int(0.999 * f / (speed * finest)))
    return times


@njit(error_model='numpy')
def distances(table, poses, courses, radius, x, v, a, k, times):
    """Signed distances less radius, one row of times (N, K) for each particle."""
    f = np.empty(times.shape)
    for i in range(times.shape[0]):
        for n in range(times.shape[1]):
            f[i, n] = distance(table[i, 0], poses[i, 0, 0], courses[i, 0, 0], radius[i], x[i],
                               v[i], a[i], k[i], times[i, n])
    return f


def unit(rng, count):
    """Random directions."""
    n = rng.normal(size=(count, 3))
    return n / np.linalg.norm(n, axis=1)[:, np.newaxis]


def courses_of(motion, count, rng):
    """Courses (N, 1, 1, COURSE) of random colliders."""
    courses = np.zeros((count, 1, 1, COURSE))
    rows = courses[:, 0, 0]
    if motion in ('shift', 'all'):
        rows[:, LINEAR:AMPLITUDE] = rng.normal(size=(count, 9)) * np.repeat((1.0, 1.0, 0.3), 3)
    if motion in ('swing', 'all'):
        rows[:, AMPLITUDE:PHASE] = unit(rng, count) * rng.uniform(0.01, 0.3, (count, 1))
        rows[:, PHASE] = rng.uniform(0.0, 100.0, count)
        rows[:, RATE] = 10.0 ** rng.uniform(0.0, 2.0, count)
    if motion in ('turn', 'spin', 'all'):
        rows[:, AXIS:SPIN] = unit(rng, count)
        rows[:, SPIN] = 50.0 if motion == 'spin' else 10.0 ** rng.uniform(-1.0, 1.0, count)
    return courses


def centres(poses, courses, t):
    """Positions of colliders at times t (N, 1)."""
    phase, rate = courses[:, PHASE, np.newaxis], courses[:, RATE, np.newaxis]
    swing = np.sin(phase + rate * t) - np.sin(phase)
    return (poses[:, 9:] + courses[:, LINEAR:SQUARE] * t + courses[:, SQUARE:CUBE] * t ** 2
            + courses[:, CUBE:AMPLITUDE] * t ** 3 + courses[:, AMPLITUDE:PHASE] * swing)


def queries(shape, side, motion, count=COUNT, seed=0):
    """Random colliders on random courses, and parabolic or damped paths that start outside."""
    rng = np.random.default_rng([SHAPES[shape], int(side > 0.0), MOTIONS.index(motion), seed])
    table, poses = np.zeros((count, 1, COLUMNS)), np.zeros((count, 1, 1, 12))
    table[:, 0, KIND], table[:, 0, SIDE] = SHAPES[shape], side
    table[:, 0, SIZE:SIZE + 3] = 10.0 ** rng.uniform(-2.0, 0.3, (count, 3))
    if side < 0.0:
        table[:, 0, SIZE:SIZE + 3] += 0.2       # else hardly anybody starts in the cavity
    q = rng.normal(size=(count, 4))
    q /= np.linalg.norm(q, axis=1)[:, np.newaxis]
    poses[:, 0, 0, :9] = rotation_matrix(q).reshape(count, 9)
    poses[:, 0, 0, 9:] = rng.normal(size=(count, 3))
    courses = courses_of(motion, count, rng)
    x = poses[:, 0, 0, 9:] + rng.normal(size=(count, 3)) * (2.0 if side > 0.0 else 0.2)
    a = 10.0 * unit(rng, count) * rng.integers(0, 2, (count, 1))
    k = np.where(rng.random(count) < 0.5, 0.0, 10.0 ** rng.uniform(-3.0, 2.0, count))
    v = rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-2.0, 1.0, (count, 1))
    when = rng.uniform(0.2, 1.5, (count, 1))
    goal = centres(poses[:, 0, 0], courses[:, 0, 0], when) + 0.2 * rng.normal(size=(count, 3))
    aimed = (goal - x) / when - 0.5 * a * when      # by one half, as without drag
    v[::2] = aimed[::2]
    radius = np.where(rng.random(count) < 0.5, 0.0, 1e-3)
    query = (table, poses, courses, radius, x, v, a, k)
    free = distances(*query, np.zeros((count, 1)))[:, 0] > 1e-9
    return tuple(part[free] for part in query)


@every_shape
@every_motion
@pytest.mark.jit
def test_first_time_by_brute_force(shape, side, motion):
    """No collision is missed or late; none is told where the particle does not come inside."""
    query = queries(shape, side, motion)
    times, undecided = first_times(RULES, FORCES, *query)
    inside = first_inside(*query, FINEST)
    assert undecided == 0
    assert (inside < inf).sum() > 20                            # these queries are worth it
    assert (times <= inside + 1e-12).all()
    hit = times < inf
    early = hit & (inside > times + 1.001 * FINEST)             # short: no sample in them
    near = np.concatenate([np.geomspace(1e-12, 1e-5, 200), np.linspace(1e-5, 1.001 * FINEST, 500)])
    some = tuple(part[early] for part in query)
    assert (distances(*some, times[early][:, np.newaxis] + near) < 0.0).any(axis=1).all()
    on = distances(*(part[hit] for part in query), times[hit][:, np.newaxis])[:, 0]
    assert_allclose(on, 0.0, atol=64.0 * EPSILON * 60.0)
