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

"""Kernels that are called by their addresses: the value they return, and what is refused."""

from typing import NamedTuple

from collision_sim.core.jit import by_address, entry, kernel, open_kernel
from collision_sim.core.modules import no_modules
from numba.core.errors import TypingError
import numpy as np
import pytest

pytestmark = pytest.mark.jit

KERNEL = 3


class Scales(NamedTuple):
    """Something to hand over."""

    table: np.ndarray
    turned: bool


@kernel
def stretch(scales, k, x):
    """Length and components of a vector, scaled by row k of a table."""
    y = (x[0] * scales.table[k, 0], x[1] * scales.table[k, 1], x[2] * scales.table[k, 2])
    return np.sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2), y if scales.turned else x


@entry
def open_stretch(modules, scales, x):
    """Open the kernel."""
    open_kernel(modules, KERNEL, stretch, (0.0, x), (scales, 0, x))


@entry
def stretched(modules, scales, k, x):
    """Call the kernel."""
    return by_address(modules, KERNEL, stretch, (0.0, x), (scales, k, x))


@entry
def stretched_rows(modules, table, x):
    """Call the kernel with something else than it is opened for."""
    return by_address(modules, KERNEL, stretch, (0.0, x), ((table, 1), 0, x))


@pytest.mark.parametrize('turned', [False, True])
def test_called_by_address(turned):
    """A kernel that is called by its address returns what it does when called by its name."""
    random, modules = np.random.default_rng(3), no_modules()
    scales = Scales(random.normal(size=(5, 3)), turned)
    open_stretch(modules, scales, (0.0, 0.0, 0.0))
    for k in range(5):
        x = tuple(random.normal(size=3))
        y = scales.table[k] * x
        size, z = stretched(modules, scales, k, x)
        assert size == pytest.approx(np.linalg.norm(y), rel=1e-15)
        np.testing.assert_array_equal(z, y if turned else x)


def test_closed_kernel():
    """A kernel that is not open is not called."""
    scales = Scales(np.ones((1, 3)), True)
    with pytest.raises(RuntimeError, match='stretch is not open for what it is handed'):
        stretched(no_modules(), scales, 0, (1.0, 2.0, 3.0))


def test_open_for_other_types():
    """A kernel is not called with other types than those that it was opened for."""
    modules, scales = no_modules(), Scales(np.ones((1, 3)), True)
    open_stretch(modules, scales, (0.0, 0.0, 0.0))
    with pytest.raises(RuntimeError, match='stretch is not open'):
        stretched_rows(modules, scales.table, (1.0, 2.0, 3.0))


@pytest.mark.parametrize('table', [np.ones((3, 2)).T, np.ones((1, 6))[:, ::2]])
def test_what_cannot_be_handed_over(table):
    """Arrays with gaps, which compiled code may take for whole ones, are refused."""
    with pytest.raises(TypingError, match='cannot be handed to a function by its address'):
        stretched(no_modules(), Scales(table, True), 0, (1.0, 2.0, 3.0))
