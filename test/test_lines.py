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

"""Arrays begin with a cache line, and so does what each thread writes of the accounts."""

from collision_sim import Scene, Simulation
from collision_sim.core.lines import in_lines, LINE
from collision_sim.core.rules import ACCOUNTS, N_LOGGED
import pytest
from small_scenes import plane


@pytest.mark.parametrize('count', [1, 7, 8, 1000])
def test_an_array_begins_with_a_cache_line(count):
    """Whatever its size, from Python as in compiled code."""
    for _ in range(20):
        array = in_lines(count)
        assert array.shape == (count, ) and array.ctypes.data % (8 * LINE) == 0
        assert array.flags.c_contiguous and array.flags.writeable


def test_the_state_of_the_particles_begins_with_a_cache_line():
    """Vectors of it do not lie across two lines then."""
    sim = Simulation(Scene.from_dict({
        'particles': {'position': [[0.0, 0.0, 1.0]] * 24}, 'colliders': [plane()]}))
    for state in (sim.position, sim.velocity):
        assert all(row.ctypes.data % (8 * LINE) == 0 for row in state.T)


def test_accounts_of_two_blocks_are_not_in_one_cache_line():
    """However the table begins: it is a multiple of 16 bytes into a line."""
    for start in range(0, 8 * LINE, 16):
        last, following = start + 8 * N_LOGGED, start + 8 * ACCOUNTS
        assert last // (8 * LINE) < following // (8 * LINE)
