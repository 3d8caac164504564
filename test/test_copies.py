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

"""Copies of a simulation: at any time, by themselves, to the same bits."""

from copy import copy, deepcopy
import pickle

import numpy as np
import pytest
from small_scenes import box, plane, simulate, sphere

WAYS = {'copy': copy, 'deepcopy': deepcopy, 'pickle': lambda sim: pickle.loads(pickle.dumps(sim))}
SCENES = {
    'points': {}, 'exact': {'method': 'exact'},
    'pairs': {'pairs': {}, 'particles': {'radius': 0.1}},
    'explicit': {'springs': {'pairs': [[0, 1]], 'stiffness': 2e5},
                 'pairs': {}, 'particles': {'radius': [0.1, 0.2]}},
    'implicit': {'springs': {'pairs': [[0, 1]], 'stiffness': 100.0, 'solver': 'implicit'}}}
TETRAHEDRON = """OFF
4 4 6
0 0 0
1 0 0
0 1 0
0 0 1
3 0 2 1
3 0 1 3
3 1 2 3
3 0 3 2
"""


def start(name, tmp_path):
    """Give a simulation on ground, a moved ball, a scripted box and, without springs, a mesh."""
    (tmp_path / 'mesh.off').write_text(TETRAHEDRON)
    keys = SCENES[name]
    colliders = [plane(), sphere(0.2, topic='ball/pose'),
                 box(position=(3.0, 0.0, 0.0), motion={'linear_velocity': [0.1, 0.0, 0.0]})]
    if name == 'points':
        colliders.append({'name': 'mesh', 'shape': 'mesh', 'file': str(tmp_path / 'mesh.off'),
                          'position': [0.3, 0.0, 0.0]})
    return simulate(colliders, [[0.0, 0.0, 0.4], [0.15, 0.0, 0.4]], (0.3, 0.0, 0.0), ledger=True,
                    threads=2, **keys)


def seen(sim):
    """Give all that can be seen of a simulation, as text."""
    return repr((sim.time, sim.position.tolist(), sim.velocity.tolist(), sim.counters, sim.ledger,
                 sim.contacts, sim.energy(), sim.clearance(), sim.unplaced,
                 [sim.collider_pose(each.name) for each in sim.scene.colliders]))


@pytest.mark.parametrize('before', [0, 1, 30])
@pytest.mark.parametrize('name', SCENES)
@pytest.mark.parametrize('way', WAYS)
def test_a_copy_goes_on(way, name, before, tmp_path):
    """With the same bits, moves that were to come included; then each goes its own way."""
    if name == 'implicit':
        pytest.importorskip('scipy')
    sim = start(name, tmp_path)
    sim.step(before)
    sim.move_collider('ball', [[0.0, 0.0, 0.01 * k] for k in range(9)], [[0, 0, 0, 1]] * 9)
    sim.step(2)
    other = WAYS[way](sim)
    assert seen(other) == seen(sim)
    for each in (other, sim):
        each.step(20)
        each.set_parameter('restitution', 0.5)
        each.step(20)
    assert seen(other) == seen(sim)
    after = seen(sim)
    assert not np.shares_memory(sim.position, other.position)
    other.position[:] += 1.0
    other.set_parameter('restitution', 0.9)
    other.step(5)
    assert seen(sim) == after
    other.reset()
    sim.set_parameter('restitution', 0.9)
    sim.reset()
    for each in (other, sim):
        each.step(3)
    assert seen(other) == seen(sim)
