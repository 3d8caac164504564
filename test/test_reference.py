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

"""What compiled code is handed by reference: the same values, for as long as they are used."""

from copy import deepcopy
import gc
import pickle
from typing import NamedTuple
import weakref

from collision_sim.core.jit import entry, kernel
from collision_sim.core.reference import refer
import numpy as np
import pytest
from small_scenes import plane, simulate

pytestmark = pytest.mark.jit


class Inner(NamedTuple):
    """A part of what is handed over."""

    scale: float
    on: bool
    places: tuple
    table: np.ndarray


class Outer(NamedTuple):
    """What is handed over."""

    x: float
    inner: Inner
    off: bool
    count: int
    row: np.ndarray


@kernel
def read(value, i):
    """Something of all fields."""
    if value.inner.on and not value.off:
        return value.row[i] * value.inner.scale + value.inner.table[i, 1] + value.count
    return value.x + value.inner.places[2]


@entry
def total(value):
    """Sum over the rows."""
    s = 0.0
    for i in range(value.row.shape[0]):
        s += read(value, i)
    value.row[0] = s
    return s


def outer(on):
    """Return something to hand over."""
    return Outer(0.5, Inner(3.0, on, (1.0, 2.0, 4.0), np.arange(8.0).reshape(4, 2)), False, 7,
                 np.array([1.0, 10.0, 100.0, 1000.0]))


@pytest.mark.parametrize('on', [False, True])
def test_same_as_the_value(on):
    """A reference is read and written as the value is, and so are its copies."""
    expected = 3.0 * 1111.0 + 1 + 3 + 5 + 7 + 4 * 7 if on else 4 * 4.5
    for change in (refer, lambda v: deepcopy(refer(v)), lambda v: pickle.loads(pickle.dumps(
            refer(v)))):
        value = change(outer(on))
        assert total(value) == expected == value.row[0]
        assert value.inner.on is on
    assert total(refer(outer(on))._replace(off=True)) == 4 * 4.5
    assert total(outer(on)) == expected


def test_helpers_outlive_the_simulation():
    """What threads still work with is there when nobody else has the simulation."""
    sim = simulate([plane()], (0.0, 0.0, 1.0))
    sim.step()
    crew, rules = sim._crew, weakref.ref(sim._rules)
    del sim
    gc.collect()
    assert rules() is not None and rules().present.meshes.heads.shape[0] == 0
    del crew
    gc.collect()
    assert rules() is None
