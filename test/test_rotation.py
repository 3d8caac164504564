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

"""Quaternions, rotation vectors and matrices: round trips, directions, degenerate angles."""

from math import cos, pi, sin, sqrt

from collision_sim.core import rotation
import numpy as np
from numpy.testing import assert_allclose
import pytest

RANDOM = np.random.default_rng(7)
QUARTER = (0.0, 0.0, sqrt(0.5), sqrt(0.5))      # a quarter turn about z
ANGLES = [0.0, 1e-300, 1e-160, 1e-9, 1e-4, 0.5, 3.0, pi - 1e-9, pi]


def units(count=50):
    """Random unit quaternions."""
    q = RANDOM.normal(size=(count, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def test_matrix_of_a_quarter_turn():
    assert_allclose(rotation.rotation_matrix(QUARTER), [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
                    atol=1e-15)
    assert_allclose(rotation.rotation_matrix((0.0, 0.0, 0.0, 1.0)), np.eye(3), atol=0.0)


def test_matrix_and_quaternion():
    """There and back, up to the sign; matrices are orthogonal."""
    for q in units():
        matrix = rotation.rotation_matrix(q)
        assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-15)
        assert np.linalg.det(matrix) == pytest.approx(1.0)
        back = rotation.quaternions(matrix[None])[0]
        assert_allclose(back * np.sign(back @ q), q, atol=1e-15)


@pytest.mark.parametrize('q', [(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1),
                               (0.6, 0.8, 0, 0), (0, -0.6, 0.8, 0), (0.5, 0.5, 0.5, 0.5)])
def test_quaternion_of_half_turns(q):
    """No component that vanishes is divided by."""
    back = rotation.quaternions(rotation.rotation_matrix(np.array([q], dtype=float)))[0]
    assert_allclose(back * np.sign(back @ q), q, atol=1e-15)


def test_matrices_multiply_like_quaternions():
    """In the product p q, q acts first."""
    for p, q in zip(units(), units()):
        product = rotation.product(p, q)
        assert_allclose(rotation.rotation_matrix(product),
                        rotation.rotation_matrix(p) @ rotation.rotation_matrix(q), atol=1e-14)


@pytest.mark.parametrize('angle', ANGLES)
def test_exponential_and_logarithm(angle):
    """A rotation vector of up to half a turn comes back."""
    axis = np.array((0.48, -0.6, 0.64))
    q, _, _ = rotation.exponential(angle * axis)
    assert_allclose(q, (*(axis * sin(angle / 2)), cos(angle / 2)), rtol=1e-14, atol=1e-199)
    assert_allclose(rotation.logarithm(q), angle * axis, rtol=1e-14, atol=1e-15)


def test_logarithm_takes_the_shortest_way():
    """Either sign of a quaternion is the same turn, of at most half a turn."""
    for q in units():
        vectors = rotation.logarithm(q), rotation.logarithm(-q)
        assert_allclose(vectors[0], vectors[1], atol=1e-15)
        assert np.linalg.norm(vectors[0]) <= pi * (1.0 + 1e-15)


def test_turn_between():
    """It leads from the start to the end, in the world frame."""
    for start, end in zip(units(), units()):
        turn = rotation.turn_between(start, end)
        q, _, _ = rotation.exponential(turn)
        led = rotation.rotation_matrix(q) @ rotation.rotation_matrix(start)
        assert_allclose(led, rotation.rotation_matrix(end), atol=1e-14)
    assert_allclose(rotation.turn_between(np.array((0.0, 0.0, 0.0, 1.0)), np.array(QUARTER)),
                    (0.0, 0.0, pi / 2), rtol=1e-15)
    same = rotation.turn_between(units()[0], units()[0])
    assert np.linalg.norm(rotation.turn_between(np.array(QUARTER), np.array(QUARTER))) < 1e-15
    assert same.shape == (3, )


def test_rates_of_rotation_vectors():
    """Angular velocity of a changing rotation vector, by differences, and the way back."""
    vector, rate, h = np.array((0.3, -0.7, 1.1)), np.array((0.2, 0.5, -0.4)), 1e-6
    q = [rotation.exponential(vector + k * h * rate)[0] for k in (-1, 1)]
    angular = rotation.turn_between(*q) / (2.0 * h)
    _, a, b = rotation.exponential(vector)
    across = np.cross(vector, rate)
    assert_allclose(rate + a * across + b * np.cross(vector, across), angular, atol=1e-9)
    assert_allclose(rotation.vector_rate(vector, angular), rate, atol=1e-9)


@pytest.mark.parametrize('size', [0.0, 1e-12, 1e-5, 1e-3, 1.0, 6.0])
def test_vector_rate_is_the_inverse(size):
    """Also where the formula goes over to its limit."""
    vector, rate = size * np.array((0.48, -0.6, 0.64)), np.array((0.2, 0.5, -0.4))
    _, a, b = rotation.exponential(vector)
    across = np.cross(vector, rate)
    angular = rate + a * across + b * np.cross(vector, across)
    assert_allclose(rotation.vector_rate(vector, angular), rate, rtol=0.0, atol=1e-9)


def test_cross():
    a, b = RANDOM.normal(size=(2, 3))
    assert_allclose(rotation.cross(a, b), np.cross(a, b), atol=1e-15)
