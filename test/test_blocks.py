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

"""The quick test of a block: it never misses a particle that is inside a collider."""

from math import sqrt

from collision_sim.core import blocks, shapes
from collision_sim.core.broad_phase import Grid
from collision_sim.core.jit import WORD
from collision_sim.core.rotation import rotation_matrix
from numba import njit
import numpy as np
import pytest

KINDS = [(shape, kind) for shape, kind in shapes.SHAPES.items() if shape != 'mesh']
TURN = rotation_matrix(np.array((0.1, 0.2, 0.3, sqrt(1.0 - 0.14))))


@njit
def touching(present, table, poses, radius, x):
    """Call kernels, which have no entry from Python: who may touch, and how deep all are."""
    all_of = np.arange(table.shape[0])
    count, clear = x.shape[1], np.ones(x.shape[1] + WORD)
    found, distance = np.empty(count, dtype=np.int64), np.empty(count)
    none, nowhere = np.empty(0, dtype=np.int64), (0.0, 0.0, 0.0)
    grid = Grid(nowhere, nowhere, nowhere, (0, 0, 0), none, none, all_of)
    blocks.clear_of_others(grid, present, table, poses, 0, blocks.NONE, radius, None,
                           np.zeros(all_of.size), x[0], x[1], x[2], clear[:count], clear, all_of)
    n = blocks.collect(clear, count, found, 0)
    for i in range(count):
        point = (x[0, i], x[1, i], x[2, i])
        distance[i] = shapes.signed_distance(present, table, poses, 0, 0, point)[0] - radius[i]
    return found[:n], distance


def near_surface(shape, kind, side, scale, gap, count=500):
    """Points beside the surface of a turned and moved shape, by a relative gap, in and out."""
    random = np.random.default_rng(11)
    table, poses = np.zeros((1, shapes.COLUMNS)), np.zeros((1, 1, 12))
    size = {'plane': (0.0, 0.0, 0.0), 'sphere': (1.0, 0.0, 0.0), 'box': (1.0, 0.5, 2.0)}
    table[0, :5] = (kind, side, *(scale * np.array(size.get(shape, (0.7, 1.0, 0.0)))))
    poses[0, 0] = (*TURN.ravel(), *(scale * np.array((0.3, -0.2, 0.1))))
    x = poses[0, 0, 9:] + scale * random.uniform(-2.5, 2.5, (count, 3))
    for i in range(count):
        for _ in range(3):      # down to the surface
            local = tuple(((x[i] - poses[0, 0, 9:]) @ TURN).tolist())
            distance, normal = getattr(shapes, shape)(local, *{
                'plane': (), 'sphere': (table[0, 2], ), 'box': (tuple(table[0, 2:5]), ),
            }.get(shape, (table[0, 2], table[0, 3])))
            x[i] -= distance * TURN @ normal
        x[i] += scale * gap * (-1.0) ** i * TURN @ normal
    return table, poses, x.T.copy()


@pytest.mark.parametrize(('shape', 'kind'), KINDS, ids=[shape for shape, _ in KINDS])
@pytest.mark.parametrize('side', [1.0, -1.0], ids=['outside', 'inside'])
@pytest.mark.parametrize('gap', [0.0, 1e-16, 1e-14, 1e-8, 0.1])
@pytest.mark.parametrize('radius', [0.0, 0.05])
def test_nobody_inside_is_missed(shape, kind, side, gap, radius):
    """Its sign agrees with the signed distance, or errs towards `may touch`."""
    for scale in (1e-3, 1.0, 1e4):
        table, poses, x = near_surface(shape, kind, side, scale, gap)
        found, distance = touching(shapes.Present(), table, poses,
                                   np.full(x.shape[1], scale * radius), x)
        assert set(np.flatnonzero(distance < 0.0)) <= set(found)
        assert (np.diff(found) > 0).all()
        if radius == 0.0:       # balls at an edge or a rim may be taken for touching
            assert (distance[found] < 1e-12 * scale).all()


@njit
def not_clear(x, new):
    """Call kernels, which have no entry from Python: who is not finite."""
    count, clear = x.shape[1], np.empty(x.shape[1] + WORD)
    found = np.empty(count, dtype=np.int64)
    blocks.clear_if_finite(x[0], x[1], x[2], clear[:count])
    for k in range(2):      # a shape that is far away
        for i in range(count):
            clear[i] = blocks._smaller(clear[i], new[k, i])
    return found[:blocks.collect(clear, count, found, 0)]


def test_places_that_are_not_finite_are_not_clear():
    """Whatever shapes are tested afterwards, and whatever they find."""
    x = np.ones((3, 7))
    x[0, 1], x[1, 3], x[2, 5], x[:2, 6] = np.nan, np.inf, -np.inf, (np.inf, -np.inf)
    new = np.array([[2.0] * 7, [3.0] * 7])
    assert not_clear(x, new).tolist() == [1, 3, 5, 6]
    new[1, 1] = np.nan
    assert not_clear(x, new).tolist() == [1, 3, 5, 6]
