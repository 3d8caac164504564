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

"""Surfaces of colliders for the event-driven method: gaps, normals and curvature."""

from typing import NamedTuple

from collision_sim.core import surfaces
from collision_sim.core.courses import AXIS, COURSE, LINEAR, SPIN
from collision_sim.core.flight import Flight
from collision_sim.core.rotation import rotation_matrix
from collision_sim.core.rules import Rules
from collision_sim.core.shapes import (BOX, CAPSULE, COLUMNS, CYLINDER, KIND, PLANE, Present, SIDE,
                                       signed_distance, SIZE, SPHERE)
from numba import njit
import numpy as np
from numpy.testing import assert_allclose
import pytest

SHAPES = {'plane': PLANE, 'sphere': SPHERE, 'box': BOX, 'capsule': CAPSULE, 'cylinder': CYLINDER}
RULES = Rules(Flight(1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), Present(),
              True, True, 1, True, 10, False, 0.1, 10.0)
HERE = surfaces.Spot(0, 0, 0, 0, 0, 0.0, None, None, None, 0.0)
SIZES, RADIUS = (0.7, 0.5, 0.9), 0.05
COUNTS = {PLANE: 1, SPHERE: 1, BOX: 6, CAPSULE: 1, CYLINDER: 3}
every_shape = pytest.mark.parametrize('shape', SHAPES)


class Colliders(NamedTuple):
    """What kernels ask of a World that has colliders only."""

    rules: Rules
    table: np.ndarray
    poses: np.ndarray


@njit(error_model='numpy')
def gap(table, poses, courses, face, side, radius, t, x):
    """Call a kernel, which has no entry from Python."""
    world = Colliders(RULES, table, poses)
    return surfaces.gap_to(world, HERE, courses, 0, face, side, radius, t, x)


@njit(error_model='numpy')
def bend(table, poses, courses, face, t, x, n, w):
    """Call a kernel, which has no entry from Python."""
    world = Colliders(RULES, table, poses)
    return surfaces.bend_of(world, HERE, courses, 0, face, t, x, n, w)


@njit(error_model='numpy')
def distance(table, poses, x):
    """Call a kernel, which has no entry from Python."""
    return signed_distance(RULES.present, table, poses, 0, 0, x)


@njit(error_model='numpy')
def beside(table, poses, courses, x, w):
    """Call a kernel, which has no entry from Python."""
    return surfaces.face_beside(Colliders(RULES, table, poses), HERE, courses, 0, 0.0, 0.0, x, w,
                                1e-14, 1e-14)


@njit(error_model='numpy')
def count(table, side):
    """Call a kernel, which has no entry from Python."""
    return surfaces.faces(table, 0, side)


def collider(shape, side, turned=True):
    """Table, poses and course of a collider that moves and turns."""
    table, poses, course = np.zeros((1, COLUMNS)), np.zeros((1, 1, 12)), np.zeros((1, 1, COURSE))
    table[0, KIND], table[0, SIDE] = SHAPES[shape], side
    table[0, SIZE:SIZE + 3] = SIZES if shape != 'plane' else 0.0
    q = np.array([(0.1, 0.5, -0.3, 0.8) if turned else (0.0, 0.0, 0.0, 1.0)])
    poses[0, 0, :9] = rotation_matrix(q / np.linalg.norm(q)).ravel()
    if turned:
        poses[0, 0, 9:] = (0.2, -0.1, 0.4)
        course[0, 0, LINEAR:LINEAR + 3] = (1.0, 2.0, -0.5)
        course[0, 0, AXIS:SPIN], course[0, 0, SPIN] = (0.6, 0.0, 0.8), 3.0
    return table, poses, course


def points(shape, side, many=100):
    """Random places outside (or in the cavity) of the collider, near and far."""
    rng = np.random.default_rng(SHAPES[shape])
    table, poses, _ = collider(shape, side)
    spread = 1.5 if side > 0.0 else 0.25
    x = poses[0, 0, 9:] + spread * rng.normal(size=(many, 3))
    return [tuple(y) for y in x if distance(table, poses, tuple(y))[0] > 2.0 * RADIUS]


@every_shape
def test_counts(shape):
    """One surface from outside; from inside one for every face."""
    table, _, _ = collider(shape, 1.0)
    assert count(table, 1.0) == 1
    assert count(table, -1.0) == COUNTS[SHAPES[shape]]


@every_shape
def test_from_outside_the_gap_is_the_distance(shape):
    """Less the radius; the normal is the same."""
    table, poses, course = collider(shape, 1.0)
    for x in points(shape, 1.0):
        g, slope, n = gap(table, poses, course, 0, 1.0, RADIUS, 0.0, x)
        phi, normal = distance(table, poses, x)
        assert (g, slope) == (pytest.approx(phi - RADIUS, abs=1e-15), 1.0)
        assert_allclose(n, normal, atol=1e-15)


@pytest.mark.parametrize('shape', [shape for shape in SHAPES if shape != 'plane'])
def test_from_inside_the_nearest_face_is_the_distance(shape):
    """A round gap g is (R^2 - rho^2) / (2 R): the distance is R - sqrt(R^2 - 2 R g)."""
    table, poses, course = collider(shape, -1.0)
    space = SIZES[0] - RADIUS
    for x in points(shape, -1.0):
        nearest = []
        for face in range(count(table, -1.0)):
            g, slope, n = gap(table, poses, course, face, -1.0, RADIUS, 0.0, x)
            if shape != 'box' and face == 0:
                nearest.append(space - np.sqrt(space ** 2 - 2.0 * space * g))
                assert slope == pytest.approx(np.sqrt(space ** 2 - 2.0 * space * g) / space)
            else:
                nearest.append(g)
                assert slope == 1.0
        assert min(nearest) == pytest.approx(distance(table, poses, x)[0] - RADIUS, abs=1e-14)


def every_surface():
    """All surfaces: shape, side of the table, side and number of the face."""
    for shape, kind in SHAPES.items():
        yield shape, 1.0, 1.0, 0
        for face in range(COUNTS[kind] if shape != 'plane' else 0):
            yield shape, -1.0, -1.0, face
    for shape in ('box', 'cylinder'):
        for face in range(COUNTS[SHAPES[shape]]):
            yield shape, 1.0, 1.0, face + 1


@pytest.mark.parametrize(('shape', 'own', 'side', 'face'), list(every_surface()))
def test_gap_changes_as_told(shape, own, side, face):
    """The gap grows by slope times the velocity along the normal, at a later time, too."""
    table, poses, course = collider(shape, own)
    h, t = 1e-6, 0.05
    for x in points(shape, own)[:20]:
        _, slope, n = gap(table, poses, course, face, side, RADIUS, t, x)
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-15)
        for d in range(3):
            ends = [gap(table, poses, course, face, side, RADIUS, t,
                        tuple(x[k] + sign * h * (k == d) for k in range(3)))[0]
                    for sign in (1.0, -1.0)]
            assert (ends[0] - ends[1]) / (2.0 * h) == pytest.approx(slope * n[d], abs=1e-6)


@pytest.mark.parametrize(('shape', 'own'), [
    (shape, own) for shape in SHAPES for own in (1.0, -1.0) if shape != 'plane' or own > 0.0])
def test_curvature(shape, own):
    """
    The second difference of the distance along a tangent is the curvature term, per velocity^2.

    At surface 0; within a plane facing the solid it is that of the nearest point.
    """
    table, poses, course = collider(shape, own)
    course[:] = 0.0
    h, rng, seen = 1e-4, np.random.default_rng(1), 0
    for x in points(shape, own, 300):
        n = np.array(distance(table, poses, x)[1])
        g, slope, m = gap(table, poses, course, 0, own, 0.0, 0.0, x)
        if not np.allclose(m, n):
            continue            # another face is nearer
        w = np.cross(n, rng.normal(size=3))
        ends = [distance(table, poses, tuple(np.array(x) + s * h * w)) for s in (-1.0, 0.0, 1.0)]
        if any(np.dot(end[1], n) < 0.9 for end in ends):
            continue
        second = (ends[0][0] - 2.0 * ends[1][0] + ends[2][0]) / h ** 2
        told = bend(table, poses, course, 0, 0.0, x, m, tuple(w))
        assert told == pytest.approx(second, rel=1e-3, abs=1e-5)
        seen += 1
    assert seen > 10


def test_beside_an_edge():
    """At an edge, who goes along one of its faces, or away from it, is beside the solid."""
    table, poses, course = collider('box', 1.0, turned=False)
    edge = (-SIZES[0], 0.1, SIZES[2])
    for w, face in (((1.0, 0.2, 0.0), True), ((1.0, 0.0, 0.3), True), ((0.0, 0.0, -1.0), True),
                    ((1.0, 0.0, -1.0), False), ((1.0, 0.0, -1e-6), False)):
        assert (beside(table, poses, course, edge, w) > 0) == face
    assert beside(table, poses, course, (0.0, 0.0, SIZES[2]), (0.0, 0.0, -1.0)) == 0
    table, poses, course = collider('cylinder', 1.0, turned=False)
    rim = (-SIZES[0], 0.0, SIZES[1])
    assert beside(table, poses, course, rim, (1.0, 0.0, 0.0)) > 0
    assert beside(table, poses, course, rim, (0.0, 0.0, -1.0)) > 0
    assert beside(table, poses, course, rim, (1.0, 0.0, -1.0)) == 0
    table, poses, course = collider('sphere', 1.0, turned=False)
    assert beside(table, poses, course, (SIZES[0], 0.0, 0.0), (-1.0, 0.0, 0.0)) == 0
