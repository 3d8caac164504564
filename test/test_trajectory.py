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

"""First time of impact along the path of a step, against sampling and closed forms."""

from math import acos, atan2, cos, hypot, inf, pi, sin, sqrt

from collision_sim.core import trajectory
from collision_sim.core.motion import MOTION, SHIFT, TURN
from collision_sim.core.rotation import rotation_matrix
from collision_sim.core.shapes import (BOX, CAPSULE, COLUMNS, CYLINDER, KIND, PLANE, Present, SIDE,
                                       SIZE, SPHERE)
from collision_sim.core.trajectory import NEVER
from numba import njit
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import EPSILON

SHAPES = {'plane': PLANE, 'sphere': SPHERE, 'box': BOX, 'capsule': CAPSULE, 'cylinder': CYLINDER}
PRESENT = Present()
COUNT = 2000
SAMPLES = 3000                  # on a path, to find what first_hit misses
FINER = 2000                    # between two of them, to find what sampling misses
UNTURNED = (0.0, 0.0, 0.0)
every_shape = pytest.mark.parametrize(('shape', 'side'), [
    (shape, side) for shape in SHAPES for side in (1.0, -1.0) if shape != 'plane' or side > 0.0])
every_turn = pytest.mark.parametrize('turn', [0.0, 0.3, 5.0, 50.0])


@njit(error_model='numpy')
def safe_step(f, slope, bend, touching):
    """Call that of trajectory.py, which only compiled code can."""
    return trajectory.safe_step(f, slope, bend, touching)


@njit(error_model='numpy')
def first_hits(present, table, poses, motion, radius, x0, dx):
    """Give times, normals, arms and whether decided, of particle i and collider i, all i."""
    count = x0.shape[0]
    tau, n, arm = np.empty(count), np.empty((count, 3)), np.empty((count, 3))
    decided = np.empty(count, dtype=np.bool_)
    for i in range(count):
        tau[i], n_i, arm_i, decided[i] = trajectory.first_hit(
            present, table, poses, motion, 0, 0, i, radius[i], (x0[i, 0], x0[i, 1], x0[i, 2]),
            (dx[i, 0], dx[i, 1], dx[i, 2]))
        for d in range(3):
            n[i, d], arm[i, d] = n_i[d], arm_i[d]
    return tau, n, arm, decided


@njit(error_model='numpy')
def distance(present, table, poses, motion, radius, x0, dx, i, tau):
    """Signed distance less radius of particle i on its path."""
    move, axis, angle = trajectory.relative_motion(motion, 0, i, (dx[i, 0], dx[i, 1], dx[i, 2]))
    arm = (x0[i, 0] - poses[0, i, 9], x0[i, 1] - poses[0, i, 10], x0[i, 2] - poses[0, i, 11])
    return trajectory.path_distance(present, table, poses, 0, i, radius[i], arm, move, axis,
                                    angle, tau)[0]


@njit(error_model='numpy')
def sampled_hits(present, table, poses, motion, radius, x0, dx, samples):
    """First of some times in 0 … 1 at which each particle is inside its collider, or NEVER."""
    tau = np.full(x0.shape[0], NEVER)
    for i in range(x0.shape[0]):
        for k in range(samples + 1):
            if distance(present, table, poses, motion, radius, x0, dx, i, k / samples) < 0.0:
                tau[i] = k / samples
                break
    return tau


@njit(error_model='numpy')
def distances(present, table, poses, motion, radius, x0, dx, times):
    """Signed distances less radius, one row of times (N, K) for each particle."""
    f = np.empty(times.shape)
    for i in range(times.shape[0]):
        for k in range(times.shape[1]):
            f[i, k] = distance(present, table, poses, motion, radius, x0, dx, i, times[i, k])
    return f


@njit(error_model='numpy')
def margin(sweep, motion, table):
    """Call a kernel, which has no entry from Python."""
    return trajectory.sweep_margin(sweep, motion, 0, table, 0)


def queries(shape, side, turn, count=COUNT):
    """Random colliders that move and turn, and particles that start outside of them."""
    rng = np.random.default_rng([SHAPES[shape], int(side > 0.0), int(10.0 * turn)])
    table, poses, motion = np.zeros((count, COLUMNS)), np.zeros((1, count, 12)), \
        np.zeros((1, count, MOTION))
    table[:, KIND], table[:, SIDE] = SHAPES[shape], side
    table[:, SIZE:SIZE + 3] = 10.0 ** rng.uniform(-2.0, 0.3, (count, 3))
    if side < 0.0:
        table[:, SIZE:SIZE + 3] += 0.2      # else hardly anybody starts in the cavity
    q = rng.normal(size=(count, 4))
    q /= np.linalg.norm(q, axis=1)[:, np.newaxis]
    poses[0, :, :9] = rotation_matrix(q).reshape(count, 9)
    poses[0, :, 9:] = rng.normal(size=(count, 3))
    shift = rng.normal(size=(count, 3)) * rng.integers(0, 2, (count, 1))
    axis = rng.normal(size=(count, 3))
    motion[0, :, SHIFT:SHIFT + 3] = shift
    motion[0, :, TURN:] = turn * axis / np.linalg.norm(axis, axis=1)[:, np.newaxis]
    arm = rng.normal(size=(count, 3)) * (2.0 if side > 0.0 else 0.2)
    radius = np.where(rng.random(count) < 0.5, 0.0, 1e-3)
    # one half somewhere, one half towards the collider, so that many hit
    dx = rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-2.0, 1.0, (count, 1))
    aimed = shift - arm * rng.uniform(0.3, 2.0, (count, 1)) + 0.2 * rng.normal(size=(count, 3))
    dx[::2] = aimed[::2]
    x0 = poses[0, :, 9:] + arm
    start = distances(PRESENT, table, poses, motion, radius, x0, dx, np.zeros((count, 1)))[:, 0]
    free = start > 0.0
    return (PRESENT, table[free], np.ascontiguousarray(poses[:, free]),
            np.ascontiguousarray(motion[:, free]), radius[free], x0[free], dx[free])


def pick(query, which):
    """Give the same query for some of its particles."""
    present, table, poses, motion, radius, x0, dx = query
    return (present, table[which], np.ascontiguousarray(poses[:, which]),
            np.ascontiguousarray(motion[:, which]), radius[which], x0[which], dx[which])


@every_shape
@every_turn
@pytest.mark.jit
def test_against_sampling(shape, side, turn):
    """No hit is missed or late; none is told where finer sampling beside it finds none."""
    query = queries(shape, side, turn)
    tau, n, arm, decided = first_hits(*query)
    sampled = sampled_hits(*query, SAMPLES)
    assert (sampled <= 1.0).sum() > 50                          # these queries are worth it
    assert (tau <= sampled + 1e-12).all()
    hit = decided & (tau <= 1.0)
    early = hit & (sampled - tau > 1.001 / SAMPLES)             # short hits: no sample in them
    some = pick(query, early)
    near = np.linspace(0.0, 1.001 / SAMPLES, FINER)
    assert (distances(*some, tau[early][:, np.newaxis] + near) < 0.0).any(axis=1).all()
    # the place of a hit is on the surface, up to where Newton's method stops
    on = distances(*pick(query, hit), tau[hit][:, np.newaxis])[:, 0]
    assert_allclose(on, 0.0, atol=8.0 * EPSILON * 60.0)
    assert_allclose(np.linalg.norm(n[hit], axis=1), 1.0, rtol=8.0 * EPSILON)
    assert decided.all() or side < 0.0 and turn == 50.0
    assert decided.mean() > 0.75


@every_shape
@pytest.mark.jit
def test_undecided_is_stopped_before_a_hit(shape, side):
    """Where evaluations run out, the time that was reached is before any sampled hit."""
    query = queries(shape, side, 50.0)
    tau, _, _, decided = first_hits(*query)
    late = sampled_hits(*pick(query, ~decided), SAMPLES)
    assert (tau[~decided] <= late).all()
    assert (tau[~decided] >= 0.0).all()


@every_shape
@every_turn
@pytest.mark.jit
def test_normal_is_the_gradient(shape, side, turn):
    """Normal at the hit: the distance grows along it as fast as the particle moves."""
    query = pick(queries(shape, side, turn), slice(0, 500))
    tau, n, _, decided = first_hits(*query)
    hit = decided & (tau <= 1.0)
    h = 1e-6
    for d in range(3):
        ends = []
        for sign in (1.0, -1.0):
            present, table, poses, motion, radius, x0, dx = pick(query, hit)
            x0 = x0.copy()
            x0[:, d] += sign * h
            ends.append(distances(present, table, poses, motion, radius, x0, dx,
                                  tau[hit][:, np.newaxis])[:, 0])
        error = np.abs((ends[0] - ends[1]) / (2.0 * h) - n[hit, d])
        # but for the few that hit beside an edge, or small round sizes
        assert np.median(error) < 1e-7 if error.size else True
        assert np.mean(error < 1e-3) > 0.98


def one(kind, size=(0.0, 0.0, 0.0), side=1.0, shift=UNTURNED, turn=UNTURNED, x0=UNTURNED,
        dx=UNTURNED, radius=0.0, position=UNTURNED, still=False):
    """First hit of one particle with one collider that is not rotated at the start."""
    table, poses = np.zeros((1, COLUMNS)), np.zeros((1, 1, 12))
    table[0, KIND], table[0, SIDE], table[0, SIZE:SIZE + 3] = SHAPES[kind], side, size
    poses[0, 0, :9], poses[0, 0, 9:] = np.eye(3).ravel(), position
    motion = np.zeros((1, 1, MOTION))
    if not still:
        motion[0, 0, SHIFT:SHIFT + 3], motion[0, 0, TURN:] = shift, turn
    tau, n, arm, decided = first_hits(PRESENT, table, poses, motion, np.array([radius]),
                                      np.array([x0]), np.array([dx]))
    assert decided[0]
    return tau[0], n[0], arm[0]


@pytest.mark.parametrize('still', [True, False])
@pytest.mark.parametrize('radius', [0.0, 0.25])
def test_plane(still, radius):
    """Time (z - r) / way; never where the way ends before, or leads away or along."""
    for z in (0.5, 1.0, 3.7):
        way = -2.0
        tau, n, arm = one('plane', x0=(3.0, 1.0, z), dx=(1.0, 0.5, way), radius=radius,
                          still=still)
        exact = (z - radius) / 2.0
        assert tau == (pytest.approx(exact, abs=4 * EPSILON) if exact < 1.0 else NEVER)
        assert_array_equal(n, (0.0, 0.0, 1.0))
        if exact < 1.0:
            assert_allclose(arm, (3.0 + exact, 1.0 + 0.5 * exact, radius), atol=8 * EPSILON)
    for dx in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 1e-300), (0.0, 0.0, 0.0)):
        assert one('plane', x0=(0.0, 0.0, 1.0), dx=dx, radius=radius, still=still)[0] == NEVER


@pytest.mark.parametrize('scale', [1e-9, 1.0, 1e6])
def test_sphere(scale):
    """Time of impact of a ray, from a quadratic: outside the first root, inside the second."""
    rng = np.random.default_rng(3)
    hits = 0
    for _ in range(200):
        x0, radius = rng.normal(size=3), rng.uniform(0.1, 1.5)
        dx = rng.normal(size=3) * 3.0 - (x0 if rng.random() < 0.5 else 0.0)
        a, b, c = dx @ dx, x0 @ dx, x0 @ x0 - radius ** 2
        square = b * b - a * c
        side = 1.0 if c > 0.0 else -1.0
        root = inf if square < 0.0 else (-b - side * sqrt(square)) / a
        if 0.0 <= root <= 1.0 and square < 1e-3:
            continue                                            # grazes: ill-conditioned
        expected = root if 0.0 <= root <= 1.0 else NEVER
        tau, n, _ = one('sphere', (scale * radius, 0.0, 0.0), side, x0=tuple(scale * x0),
                        dx=tuple(scale * dx))
        assert tau == pytest.approx(expected, abs=1e-12)
        if tau <= 1.0:
            hits += 1
            assert_allclose(n, side * (x0 + tau * dx) / radius, atol=1e-11)
    assert hits > 50


@pytest.mark.parametrize('angle', [1.0, 50.0, -50.0, 5000.0])
@pytest.mark.parametrize('thickness', [1e-3, 1e-6])
def test_blade(angle, thickness):
    """T74: a blade turns up to 800 times in a step: it hits where its face meets the particle."""
    for place in (0.3, 1.7, 3.0, 5.9):
        rho = 0.5
        x0 = (rho * cos(place), rho * sin(place), 0.0)
        tau, n, arm = one('box', (1.0, 0.5 * thickness, 1.0), turn=(0.0, 0.0, angle), x0=x0)
        # the blade reaches to both sides; half its thickness is a little way before it
        before = np.arcsin(0.5 * thickness / rho)
        way = (place if angle > 0.0 else -place) % pi
        exact = (way - before) / abs(angle)
        if exact > 1.0:
            assert tau == NEVER
            continue
        assert tau == pytest.approx(exact, rel=1e-9, abs=1e-12)
        assert_allclose(arm, x0)
        normal = np.array((-sin(angle * tau), cos(angle * tau), 0.0))
        comes = angle * np.array((-x0[1], x0[0], 0.0))          # either face, of either wing
        assert_allclose(n, np.sign(normal @ comes) * normal, atol=1e-9)


@pytest.mark.parametrize('angle', [0.3, 5.0, 50.0])
def test_particle_meets_a_turning_wheel(angle):
    """A turning ball or a wheel about its own axis is hit like one that stands."""
    for kind, size in (('sphere', (0.5, 0.0, 0.0)), ('cylinder', (0.5, 1.0, 0.0)),
                       ('capsule', (0.5, 1.0, 0.0))):
        tau, n, _ = one(kind, size, turn=(0.0, 0.0, angle), x0=(2.0, 0.3, 0.0),
                        dx=(-3.0, 0.0, 0.0))
        assert tau == pytest.approx((2.0 - 0.4) / 3.0, abs=1e-13)
        assert_allclose(n, (0.8, 0.6, 0.0), atol=1e-12)


TOUCHING = [
    ('plane', (0.0, 0.0, 0.0), 1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ('sphere', (0.5, 0.0, 0.0), 1.0, (0.0, 0.0, 0.5), (0.0, 0.0, 1.0)),
    ('sphere', (0.5, 0.0, 0.0), -1.0, (0.0, 0.0, 0.5), (0.0, 0.0, -1.0)),
    ('box', (0.5, 0.3, 0.7), 1.0, (0.1, 0.1, 0.7), (0.0, 0.0, 1.0)),
    ('box', (0.5, 0.3, 0.7), -1.0, (0.1, 0.1, 0.7), (0.0, 0.0, -1.0)),
    ('capsule', (0.5, 0.3, 0.0), 1.0, (0.5, 0.0, 0.1), (1.0, 0.0, 0.0)),
    ('capsule', (0.5, 0.3, 0.0), -1.0, (0.5, 0.0, 0.1), (-1.0, 0.0, 0.0)),
    ('cylinder', (0.5, 0.3, 0.0), 1.0, (0.1, 0.1, 0.3), (0.0, 0.0, 1.0)),
    ('cylinder', (0.5, 0.3, 0.0), -1.0, (0.1, 0.1, 0.3), (0.0, 0.0, -1.0)),
]


@pytest.mark.parametrize('moving', [(0.0, 0.0, 0.0), (0.3, -0.4, 0.2)])
@pytest.mark.parametrize('way', [1e-6, 1e-2, 0.2])
@pytest.mark.parametrize(('kind', 'size', 'side', 'place', 'normal'), TOUCHING)
def test_touching_at_the_start(kind, size, side, place, normal, way, moving):
    """Who touches hits at 0 if it approaches, and never if it leaves or goes along."""
    n, shift = np.array(normal), np.array(moving)

    def hit(dx):
        return one(kind, size, side, shift=moving, x0=place, dx=tuple(dx + shift))
    tau, found, _ = hit(-way * n)
    assert tau <= 8 * EPSILON / way
    assert_allclose(found, normal, atol=1e-14)
    assert hit(way * n)[0] == NEVER
    along = np.array((0.0, 1.0, 0.0)) if normal[0] != 0.0 else np.array((1.0, 0.0, 0.0))
    if not (side < 0.0 and kind in ('sphere', 'capsule')):     # there it goes through the wall
        assert hit(0.1 * way * along)[0] == NEVER
        assert hit(0.1 * way * (along + n))[0] == NEVER


@pytest.mark.parametrize(('kind', 'size', 'side', 'place', 'normal'), TOUCHING)
def test_moving_together(kind, size, side, place, normal):
    """T77: both at the same velocity, however large: no hit, touching or not."""
    for speed in (1.0, 1e3, 1e8):
        shift = (speed, -0.7 * speed, 0.3 * speed)
        for gap in (0.0, 1e-9, 1e-3):
            x0 = tuple(np.array(place) + gap * np.array(normal))
            assert one(kind, size, side, shift=shift, x0=x0, dx=shift)[0] == NEVER


@pytest.mark.parametrize('angle', [0.1, 3.0, 50.0])
def test_riding_along_on_a_turntable(angle):
    """Who rests on a turning box and stays where it is slides along the face: no hit."""
    for place in ((0.3, 0.0, 0.5), (0.0, 0.0, 0.5), (-0.2, 0.1, 0.5)):
        for kind, size in (('box', (0.6, 0.6, 0.5)), ('plane', (0.0, 0.0, 0.0)),
                           ('cylinder', (0.6, 0.5, 0.0))):
            x0 = place if kind != 'plane' else (*place[:2], 0.0)
            assert one(kind, size, turn=(0.0, 0.0, angle), x0=x0)[0] == NEVER
            assert one(kind, size, turn=(0.0, 0.0, angle), x0=x0, dx=(0.1, 0.1, 0.0))[0] == NEVER
            tau, n, _ = one(kind, size, turn=(0.0, 0.0, angle), x0=x0, dx=(0.1, 0.1, -0.1))
            assert tau <= 1e-13
            assert_allclose(n, (0.0, 0.0, 1.0), atol=1e-13)


def test_swept_over_by_a_swinging_bar():
    """A bar that swings about a center far away: angle arithmetic again."""
    # position on a circle is a straight shift here, so the bar turns about its own center
    tau, n, _ = one('capsule', (0.01, 1.0, 0.0), turn=(0.0, 4.0, 0.0), x0=(0.7, 0.0, 0.0))
    # axis along z turns towards x by pi / 2; it touches 0.01 / 0.7 before
    assert tau == pytest.approx((0.5 * pi - np.arcsin(0.01 / 0.7)) / 4.0, rel=1e-12)
    assert n[0] == pytest.approx(sin(np.arcsin(0.01 / 0.7)), rel=1e-6)
    assert acos(min(1.0, hypot(n[0], n[2]))) == pytest.approx(0.0, abs=1e-7)
    assert atan2(n[2], n[0]) < 0.0      # it comes from +z, the particle is below it


def test_way_out_while_the_room_turns():
    """A particle flies straight out of a drum or a room that turns about its center."""
    for turn in (0.3, 5.0, 40.0):
        tau, n, _ = one('cylinder', (0.5, 0.5, 0.0), -1.0, turn=(0.0, 0.0, turn),
                        x0=(0.1, 0.0, 0.0), dx=(2.0, 0.0, 0.0))
        assert tau == pytest.approx(0.2, abs=1e-14)
        assert_allclose(n, (-1.0, 0.0, 0.0), atol=1e-13)
    tau, _, _ = one('box', (0.5, 0.5, 0.5), -1.0, turn=(0.0, 0.0, 0.25 * pi), dx=(0.5, 0.0, 0.0))
    assert tau == NEVER             # it would touch at tau = 1 but the corner has come round
    tau, _, _ = one('box', (0.5, 0.5, 0.5), -1.0, turn=(0.0, 0.0, 0.5 * pi), dx=(0.6, 0.0, 0.0))
    # x = 0.6 tau meets the face at 0.5 / cos(angle) or, after a quarter, the next face
    assert 0.6 * tau * cos(0.5 * pi * (1.0 - tau)) == pytest.approx(0.5, abs=1e-9)


def table_of(kind, size):
    """Table of one collider."""
    table = np.zeros((1, COLUMNS))
    table[0, KIND], table[0, SIDE], table[0, SIZE:SIZE + 3] = SHAPES[kind], 1.0, size
    return table


def test_sweep_margin():
    """How far a surface comes: its shift, and what its turn adds; 0 without sweeps or motion."""
    ball, bar = table_of('sphere', (0.5, 0.0, 0.0)), table_of('box', (1.0, 0.1, 0.1))
    ground, motion = table_of('plane', (0.0, 0.0, 0.0)), np.zeros((1, 1, MOTION))
    motion[0, 0, SHIFT:SHIFT + 3] = (3.0, 0.0, 4.0)
    assert margin(1, motion, ball) == margin(1, motion, ground) == 5.0
    assert margin(None, motion, ball) == 0.0
    still = np.zeros((1, 1, MOTION))
    assert margin(1, still, ball) == margin(1, still, ground) == 0.0
    motion[0, 0, TURN:] = (0.0, 0.0, 0.2)
    assert margin(1, motion, ground) == inf
    # a corner of the bar goes at most by the chord of its circle
    for angle in (0.01, 0.2, 3.0, 50.0):
        motion[0, 0, TURN:] = (0.0, 0.0, angle)
        corner = np.array((1.0, 0.1))
        angles = np.linspace(0.0, angle, 500)
        way = np.abs(2.0 * np.sin(0.5 * angles)).max() * np.linalg.norm(corner)
        assert 5.0 + way <= margin(1, motion, bar) <= 5.0 + 2.0 * 1.2


@pytest.mark.parametrize('bend', [0.0, 1e-300, 1e-40, 1e-17, 1e-16, 3e-16, 1e-8, 2.0])
@pytest.mark.parametrize('slope', [-1.0, -0.3, 0.0, 0.4])
def test_safe_step_where_next_to_nothing_bends(slope, bend):
    """It is the root of f + slope h - bend h^2 / 2, of which a small bend loses no digits."""
    f, step = 0.25, safe_step(0.25, slope, bend, 0.0)
    if bend == 0.0 and slope >= 0.0:
        assert step == NEVER
    elif step < 1e100:
        assert f + slope * step - 0.5 * bend * step * step == pytest.approx(0.0, abs=1e-14 * (
            f + abs(slope) * step))
