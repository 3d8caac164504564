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


"""The grid of cells finds the pairs that a search over all pairs finds, each once."""

import warnings

from collision_sim.core.candidates import make_candidates
from collision_sim.core.cells import cell_width, level_of, LEVELS, make_cells, MASK, slots_in
from collision_sim.core.flight import flight_coefficients
from collision_sim.core.ledger import NO_LEDGER
from collision_sim.core.neighbours import (BOUNDS, find_near, lay_out_cells, LOW_BITS, MOST_NEAR,
                                           Near, PHASES, PIECE)
from collision_sim.core.reference import refer
from collision_sim.core.stepping import BLOCK
from collision_sim.core.threads import share
import numpy as np
import pytest


def search(x, v, base, dt=0.01, sweep=False, threads=1):
    """Find near pairs: (P, 2) particles, how many runs were cut, centres, extents, the cells."""
    count = x.shape[1]
    many = sweep or len(set(base.tolist())) > 1
    cells, flight = make_cells(count, threads, many), flight_coefficients(
        (0.0, 0.0, 0.0), None, dt, 'ballistic')
    candidates = make_candidates(count)
    centre, extent = np.empty((3, count)), base.copy()
    pieces = -(-2 * count // PIECE)
    near = Near(np.empty((pieces, 200_000), dtype=np.int64), np.zeros(pieces, dtype=np.int64),
                np.zeros(pieces, dtype=np.int64))
    with warnings.catch_warnings():
        warnings.simplefilter('ignore', RuntimeWarning)     # places at 1e300 m, without a compiler
        share(lay_out_cells, threads, np.zeros(2 * PHASES + 1, dtype=np.int64), cells,
              np.zeros((threads, LEVELS), dtype=np.int64),
              np.full((-(-count // BLOCK), BOUNDS), base.max()), True, bool(sweep), flight,
              refer(NO_LEDGER), base, x, v, candidates, centre, extent)
        used = -(-int(cells.start[slots_in(cells.levels)]) // PIECE)
        share(find_near, threads, used, cells, near)
    found = np.concatenate([near.found[p, :near.count[p]] for p in range(used)])
    pairs = np.stack([cells.particle[found >> 32], cells.particle[found & LOW_BITS]], axis=1)
    return pairs, int(near.cut[:used].sum()), centre, extent, cells


def all_near(centre, extent):
    """Pairs that are near each other, by comparing all with all."""
    with np.errstate(over='ignore', invalid='ignore'):
        squares = np.square(centre[:, :, None] - centre[:, None]).sum(axis=0)
    near = np.triu(squares < np.square(extent[:, None] + extent), 1)
    return {tuple(pair) for pair in np.argwhere(near).tolist()}


def check(x, v, base, **keys):
    """Compare the grid with all pairs; the cells."""
    pairs, cut, centre, extent, cells = search(x, v, base, **keys)
    found = [tuple(sorted(pair)) for pair in pairs.tolist()]
    assert cut == 0
    assert len(found) == len(set(found)), 'some pair was found twice'
    assert set(found) == all_near(centre, extent)
    return cells


def places(kind, random, count):
    """Give some places of a kind, (3, N)."""
    x = random.uniform(-1.0, 1.0, (3, count))
    if kind == 'clustered':
        x[:, :count // 10] *= 0.1
    elif kind == 'far':
        x[:, ::7] += 1e9 * random.integers(-3, 4, (3, len(x[0, ::7])))
    elif kind == 'flat and at the end of the world':
        x[2] = 0.0
        x[:, ::20] *= 1e300
    elif kind == 'in a row':
        x[:2] = 0.0
    elif kind == 'on a lattice':
        x = np.round(x * 8) / 8
    return x


KINDS = ['random', 'clustered', 'far', 'flat and at the end of the world', 'in a row',
         'on a lattice']


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('sweep', [False, True])
def test_grid_finds_what_all_pairs_have(kind, sweep):
    """Radii over three decades, some of them 0, and equal radii."""
    random = np.random.default_rng(len(kind))
    for count in (2, 17, 90):
        x, v = places(kind, random, count), random.normal(size=(3, count))
        base = 0.3 * 10.0 ** random.uniform(-3.0, 0.0, count)
        base[random.random(count) < 0.1] = 0.0
        check(x, v, base, sweep=sweep)
        check(x, v, np.full(count, 0.1), sweep=sweep)


@pytest.mark.jit
@pytest.mark.parametrize('threads', [1, 3])
def test_grid_finds_what_all_pairs_have_of_many(threads):
    """As above, with several blocks, pieces and threads."""
    random = np.random.default_rng(threads)
    for kind in KINDS:
        count = 2000
        x, v = places(kind, random, count), random.normal(size=(3, count))
        check(x, v, 0.06 * 10.0 ** random.uniform(-3.0, 0.0, count), threads=threads)
        check(x, v, np.full(count, 0.02), threads=threads)
        check(x, v, np.full(count, 0.02), threads=threads, sweep=True, dt=0.003)


def test_empty_space_costs_no_memory():
    """Two clouds a light year apart: the slots are wrapped, and as many as without the second."""
    random = np.random.default_rng(0)
    x = random.uniform(-1.0, 1.0, (3, 60))
    x[0, :30] += 1e16
    cells = check(x, np.zeros_like(x), np.full(60, 0.1))
    assert cells.levels[0, MASK] == 127 and len(cells.start) < 400


def test_crowd_is_cut_and_counted():
    """Coincident particles do not list all their pairs."""
    count = 200
    pairs, cut, *_ = search(np.zeros((3, count)), np.zeros((3, count)), np.ones(count))
    assert len(pairs) <= count * MOST_NEAR
    assert cut == count - 1 - MOST_NEAR


def test_order_of_particles_does_not_matter():
    """The list of pairs is the same for permuted particles, in the same order."""
    random = np.random.default_rng(3)
    x, base = random.uniform(-1.0, 1.0, (3, 90)), 0.2 * 10.0 ** random.uniform(-2.0, 0.0, 90)
    order = random.permutation(90)
    pairs = search(x, np.zeros_like(x), base)[0]
    permuted = search(x[:, order].copy(), np.zeros_like(x), base[order])[0]
    assert np.array_equal(order[permuted], pairs)


def test_not_a_number_is_near_nobody():
    """A particle without a place does no harm."""
    x = np.random.default_rng(5).uniform(-1.0, 1.0, (3, 50))
    x[:, 7] = np.nan
    check(x, np.zeros_like(x), np.full(50, 0.2))


@pytest.mark.parametrize('extent, level', [(1.0, 0), (0.51, 0), (0.5, 1), (0.26, 1), (0.25, 2),
                                           (0.0, LEVELS - 1), (1e-300, LEVELS - 2)])
def test_level(extent, level):
    """Each level holds extents down to half of its largest."""
    assert level_of(extent, 1.0) == level


@pytest.mark.parametrize('far', [0.0, 1e8, 1e12, 1e300, np.inf])
def test_cells_hold_what_is_near(far):
    """A cell is wider than twice the extent, and a power of two where coordinates are rounded."""
    width = cell_width(0.1, far)
    assert 0.2 < width <= 0.4 if far > 1e8 else 0.2 < width < 0.2000003
    assert far <= 1e8 or np.frexp(width)[0] == 0.5
