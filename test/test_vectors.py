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

"""Vectors as tuples: hand-computed values, extreme lengths, rotation by poses."""

from math import inf, nan, sqrt

from collision_sim.core import vectors
import numpy as np
from numpy.testing import assert_allclose
import pytest

A, B = (1.0, 2.0, 3.0), (-4.0, 5.0, 0.5)
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])      # a rotation


def pose_rows():
    """Two rows of poses of two colliders; the last one is turned and moved."""
    poses = np.zeros((2, 2, 12))
    poses[..., :9] = np.eye(3).ravel()
    poses[1, 1, :9], poses[1, 1, 9:] = TURN.ravel(), (7.0, 8.0, 9.0)
    return poses


def test_sums_and_products():
    assert vectors.add(A, B) == (-3.0, 7.0, 3.5)
    assert vectors.subtract(A, B) == (5.0, -3.0, 2.5)
    assert vectors.add_scaled(A, 2.0, B) == (-7.0, 12.0, 4.0)
    assert vectors.dot(A, B) == -4.0 + 10.0 + 1.5
    assert vectors.cross(A, B) == (2.0 * 0.5 - 15.0, -12.0 - 0.5, 5.0 + 8.0)
    assert vectors.largest(B) == 5.0
    assert vectors.largest((0.0, 0.0, 0.0)) == 0.0


@pytest.mark.parametrize('scale', [5e-324, 1e-310, 1e-300, 1e-155, 1e-145, 1.0, 1e145, 1e155,
                                   1e300, 3e307])
def test_length_at_any_scale(scale):
    """No square overflows or underflows; the smallest numbers have few digits."""
    expected = max(scale, 5e-324)
    assert vectors.length((scale, 0.0, 0.0)) == expected
    assert vectors.length((0.0, -scale, 0.0)) == expected
    if scale > 1e-309:
        relative = 1e-15 if scale > 1e-300 else 1e-9
        assert vectors.length((2 * scale, -scale, 2 * scale)) == pytest.approx(3 * scale, relative)


@pytest.mark.parametrize('limit', [vectors.SMALL_SQUARE, vectors.LARGE_SQUARE])
def test_length_is_continuous_where_scaling_begins(limit):
    for factor in (1.0 - 1e-12, 1.0, 1.0 + 1e-12):
        side = sqrt(limit / 3.0) * factor
        assert vectors.length((side, side, side)) == pytest.approx(side * sqrt(3.0), rel=1e-15)


def test_length_of_what_is_no_vector():
    assert vectors.length((0.0, 0.0, 0.0)) == 0.0
    assert vectors.length((inf, 1.0, 0.0)) == inf
    assert vectors.length((-inf, inf, 0.0)) == inf
    assert not vectors.length((nan, 1.0, 0.0)) < inf


def test_rotation_by_a_pose():
    poses = pose_rows()
    assert_allclose(vectors.rotate(poses, 1, 1, A), TURN @ A, rtol=1e-15)
    assert_allclose(vectors.rotate_back(poses, 1, 1, A), TURN.T @ A, rtol=1e-15)
    assert_allclose(vectors.rotate_back(poses, 1, 1, vectors.rotate(poses, 1, 1, A)), A,
                    rtol=1e-15)
    assert vectors.rotate(poses, 1, 0, A) == A
    assert vectors.origin(poses, 1, 1) == (7.0, 8.0, 9.0)
    assert vectors.origin(poses, 0, 1) == (0.0, 0.0, 0.0)
