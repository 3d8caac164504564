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

"""Springs: how a scene gives them, what is refused, the bound of the explicit solver, forces."""

from collision_sim import Scene, SceneError, Simulation
from collision_sim.core.springs import (direction, elastic_energy, lay_out, longest_substep,
                                        mode_bounds, tension)
from collision_sim.scene import load_scene
from collision_sim.springs import MOST_SUBSTEPS, SHARE
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest

RANDOM = np.random.default_rng(3)
LINE = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]]


def read(springs, particles=None, **sections):
    """Scene of three particles in a line with springs."""
    return Scene.from_dict({'particles': {'position': LINE, **(particles or {})},
                            'springs': springs, **sections})


def test_springs_as_given():
    springs = read({'pairs': [[0, 1], [2, 1]], 'stiffness': [3, 4], 'damping': 0.5}).springs
    assert springs.solver == 'explicit'
    assert_array_equal(springs.pairs, [[0, 1], [2, 1]])
    assert_array_equal(springs.laws, [[3, 1, 0.5], [4, 2, 0.5]])
    assert read({'pairs': [[0, 1]], 'stiffness': 1, 'rest_length': 0.2}).springs.laws[0, 1] == 0.2
    assert read(None).springs is None


def test_springs_in_parallel_are_allowed():
    """Two springs between the same particles act both."""
    springs = read({'pairs': [[0, 1], [1, 0]], 'stiffness': 50.0}).springs
    assert longest_substep(*mode_bounds(springs.pairs, springs.laws, np.ones(3))) == \
        pytest.approx(2 / np.sqrt(200.0))


@pytest.mark.parametrize('name', ['springs.npy', 'springs.csv'])
def test_files(tmp_path, name):
    pairs = np.array([[0, 2], [1, 2]])
    if name.endswith('.npy'):
        np.save(tmp_path / name, pairs)
    else:
        np.savetxt(tmp_path / name, pairs, fmt='%d', delimiter=',')
    scene = {'particles': {'position': LINE}, 'springs': {'file': name, 'stiffness': 1}}
    assert_array_equal(Scene.from_dict(scene, tmp_path).springs.pairs, pairs)
    if name.endswith('.csv'):
        (tmp_path / name).write_text('# springs\nfrom, to\n0,2 # long\n\n1,2\n')
        assert_array_equal(Scene.from_dict(scene, tmp_path).springs.pairs, pairs)
    (tmp_path / name).write_bytes(b'1,x')
    with pytest.raises(SceneError, match='springs.file.*pairs of indices'):
        Scene.from_dict(scene, tmp_path)


def test_grid():
    """A grid of r x c particles has r (c - 1) + (r - 1) c + 2 (r - 1) (c - 1) springs."""
    particles = {'grid': {'count': [3, 4], 'corner': [0, 0, 0], 'edges': [[2, 0, 0], [0, 3, 0]]}}
    scene = Scene.from_dict({'particles': particles, 'springs': {'grid': [3, 4], 'stiffness': 1}})
    assert_array_equal(scene.particles.position[5], [1, 1, 0])
    assert_array_equal(scene.particles.position[-1], [2, 3, 0])
    assert len(scene.springs.pairs) == 9 + 8 + 12
    assert_allclose(np.unique(scene.springs.rest_length), [1, np.sqrt(2)])
    string = read({'grid': [1, 3], 'stiffness': 1}).springs
    assert_array_equal(string.pairs, [[0, 1], [1, 2]])


GOOD = {'pairs': [[0, 1]], 'stiffness': 1.0}


@pytest.mark.parametrize('change, key, words', [
    ({'pairs': [[0, 3]]}, 'springs.pairs[0]', 'from 0 to 2'),
    ({'pairs': [[0, 1], [-1, 1]]}, 'springs.pairs[1]', 'from 0 to 2'),
    ({'pairs': [[1, 1]]}, 'springs.pairs[0]', 'different'),
    ({'pairs': [[0, 1, 2]]}, 'springs.pairs[0]', 'two whole numbers'),
    ({'pairs': [[0, 1.0]]}, 'springs.pairs[0]', 'two whole numbers'),
    ({'pairs': [[0, True]]}, 'springs.pairs[0]', 'two whole numbers'),
    ({'pairs': [[0, 2 ** 80]]}, 'springs.pairs[0]', 'two whole numbers'),
    ({'pairs': 'all'}, 'springs.pairs', 'list of pairs'),
    ({'grid': [1, 3]}, 'springs', 'exactly one of pairs, file, grid'),
    ({'pairs': None}, 'springs.pairs', 'list of pairs'),
    ({'stiffness': -1}, 'springs.stiffness', 'from 0 upwards'),
    ({'stiffness': np.inf}, 'springs.stiffness', 'finite'),
    ({'stiffness': [1, 2]}, 'springs.stiffness', 'each of the 1 springs'),
    ({'stiffness': [np.nan]}, 'springs.stiffness[0]', 'finite'),
    ({'damping': -1}, 'springs.damping', 'from 0 upwards'),
    ({'rest_length': -1}, 'springs.rest_length', 'from 0 upwards'),
    ({'rest_length': 'long'}, 'springs.rest_length', 'auto'),
    ({'rest_length': [1, 2]}, 'springs.rest_length', 'each of the 1 springs'),
    ({'solver': 'magic'}, 'springs.solver', 'explicit, implicit'),
    ({'stifness': 1}, 'springs.stifness', 'stiffness'),
], ids=str)
def test_refused(change, key, words):
    with pytest.raises(SceneError) as caught:
        read({**GOOD, **change})
    assert caught.value.key == key
    assert words in caught.value.allowed


@pytest.mark.parametrize('grid', [[2, 2], [3], 'all', [0, 3], [1.5, 2]], ids=str)
def test_refused_grids(grid):
    with pytest.raises(SceneError) as caught:
        read({'grid': grid, 'stiffness': 1})
    assert caught.value.key == 'springs.grid'


def test_stiffness_is_required():
    with pytest.raises(SceneError, match='springs.stiffness: missing'):
        read({'pairs': [[0, 1]]})


def test_exact_is_refused():
    with pytest.raises(SceneError, match='stepping.method.*take collision_then_contact'):
        read(GOOD, stepping={'method': 'exact'})


def test_implicit_needs_scipy(monkeypatch):
    monkeypatch.setattr('collision_sim.springs.find_spec', lambda name: None)
    with pytest.raises(SceneError, match=r'springs.solver.*collision_sim\[springs\]'):
        read({**GOOD, 'solver': 'implicit'})


def test_bound_of_one_spring():
    """T70: k = 1e9, m = 1 on a pin: 2 / w, in the message to 1e-12."""
    with pytest.raises(SceneError) as caught:
        read({'pairs': [[0, 1]], 'stiffness': 1e9}, {'mass': [np.inf, 1, 1]},
             stepping={'dt': 1.0})
    assert caught.value.key == 'springs.stiffness'
    figure = float(caught.value.allowed.split('stable up to ')[1].split(' s')[0])
    assert figure == pytest.approx(6.32455532033675866e-5, rel=1e-12)
    assert 'solver: implicit' in caught.value.allowed


def random_network(count=12, springs=30):
    """Random springs, masses and unit vectors, with M^-1/2 K M^-1/2 and the same for damping."""
    pairs = RANDOM.integers(count, size=(springs, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    laws = 10.0 ** RANDOM.uniform(-2, 2, (len(pairs), 3))
    mass = 10.0 ** RANDOM.uniform(-2, 2, count)
    n = RANDOM.normal(size=(len(pairs), 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    matrices = np.zeros((2, 3 * count, 3 * count))
    for (i, j), law, axis in zip(pairs, laws, n):
        rod = np.zeros(3 * count)
        rod[3 * i:3 * i + 3], rod[3 * j:3 * j + 3] = axis, -axis
        rod /= np.sqrt(np.repeat(mass, 3))
        matrices += np.array([law[0], law[2]])[:, None, None] * np.outer(rod, rod)
    return pairs, laws, mass, *matrices


def growth(stiffness, damping, h):
    """Spectral radius of an explicit step, the linear map of (x, v)."""
    one, w, g = np.eye(len(stiffness)), h * h * stiffness, h * damping
    half = np.block([[one, 0 * one], [-w / 2, one - g / 2]])
    x1 = np.hstack([one, 0 * one]) + half[len(one):]
    foreseen = np.hstack([-w, one - g])
    v1 = half[len(one):] - 0.5 * (w @ x1 + g @ foreseen)
    return np.abs(np.linalg.eigvals(np.vstack([x1, v1]))).max()


def test_bound_is_safe():
    """
    Of random networks: nothing grows below the bound.

    Free motion has double eigenvalues 1, which come out with the root of the rounding.
    """
    for _ in range(60):
        pairs, laws, mass, stiffness, damping = random_network()
        square, rate = mode_bounds(pairs, laws, mass)
        assert np.linalg.eigvalsh(stiffness)[-1] <= square.max() * (1 + 1e-12)
        assert np.linalg.eigvalsh(damping)[-1] <= rate.max() * (1 + 1e-12)
        limit = longest_substep(square, rate)
        for share in (SHARE, 0.99):
            assert growth(stiffness, damping, share * limit) <= 1 + 1e-6


def test_bound_is_sharp():
    """A long straight string, stretched along itself, grows 0.1 % above its bound."""
    count, k, m = 200, 7.0, 0.3
    pairs = np.stack([np.arange(count - 1), np.arange(1, count)], axis=1)
    laws = np.tile([k, 1.0, 0.0], (count - 1, 1))
    limit = longest_substep(*mode_bounds(pairs, laws, np.full(count, m)))
    rods = np.eye(count)[pairs[:, 0]] - np.eye(count)[pairs[:, 1]]
    stiffness = k / m * rods.T @ rods
    assert growth(stiffness, 0 * stiffness, 1.001 * limit) > 1.01
    assert growth(stiffness, 0 * stiffness, limit) <= 1 + 1e-6


def test_bound_of_damping_alone():
    """2 / g, and infinite without springs that do anything."""
    laws = np.array([[0.0, 1.0, 3.0]])
    bounds = mode_bounds(np.array([[0, 1]]), laws, np.array([1.0, 2.0]))
    assert longest_substep(*bounds) == pytest.approx(2 / 4.5)
    assert read({'pairs': [[0, 1]], 'stiffness': 0.0}).springs.substeps(
        read(GOOD).particles, 1.0) == 1


def test_substeps():
    """As many as SHARE of the bound asks for, at most MOST_SUBSTEPS."""
    scene = read({'pairs': [[0, 1]], 'stiffness': 1e4}, stepping={'dt': 0.01})
    assert scene.springs.substeps(scene.particles, 0.01) == \
        int(np.ceil(0.01 / (SHARE * 2 / np.sqrt(2e4))))
    most = MOST_SUBSTEPS * SHARE * 2 / np.sqrt(2e4)
    read({'pairs': [[0, 1]], 'stiffness': 1e4}, stepping={'dt': 0.999 * most})
    with pytest.raises(SceneError, match='substeps'):
        read({'pairs': [[0, 1]], 'stiffness': 1e4}, stepping={'dt': 1.001 * most})


@pytest.mark.parametrize('key, value', [('stiffness', 1e300), ('damping', 1e300)])
@pytest.mark.parametrize('solver', ['explicit', 'implicit'])
def test_hopeless_stiffness_is_refused(key, value, solver):
    with pytest.raises(SceneError, match='substeps' if solver == 'explicit' else 'condition'):
        read({**GOOD, key: value, 'solver': solver})


def test_parameters():
    """Scalars may change, under the same checks; lists may not."""
    scene = read({'pairs': [[0, 1]], 'stiffness': [1.0], 'damping': 0.0})
    assert [key for key in scene.parameters() if 'springs' in key] == ['springs.damping']
    with pytest.raises(SceneError):
        scene.with_parameter('springs.stiffness', 1.0)
    scene = read(GOOD)
    assert scene.with_parameter('springs.stiffness', 2.0).springs.laws[0, 0] == 2.0
    for value in (-1.0, np.nan, 1e14):
        with pytest.raises(SceneError) as caught:
            scene.with_parameter('springs.stiffness', value)
        assert caught.value.key == 'springs.stiffness'
    sim = Simulation(scene)
    with pytest.raises(SceneError):
        sim.set_parameter('springs.damping', 1e12)
    assert sim.scene is scene


def test_direction_of_nothing():
    """Coincident ends: along x, opposite at the two ends, no NaN."""
    assert direction((0.0, 0.0, 0.0), True) == (0.0, (1.0, 0.0, 0.0))
    assert direction((0.0, 0.0, 0.0), False) == (0.0, (-1.0, 0.0, 0.0))
    assert tension(2.0, 1.0, 3.0, 1.5, 0.1) == pytest.approx(1.3)


def test_layout_keeps_the_order():
    pairs = np.array([[0, 1], [2, 1], [1, 0]])
    laws = np.arange(9.0).reshape(3, 3)
    springs = lay_out(pairs, laws, np.array([1.0, 2.0, np.inf]))
    assert_array_equal(springs.start, [0, 2, 5, 6])
    assert_array_equal(springs.other, [1, 1, 0, 2, 0, 1])
    assert_array_equal(springs.law[2:5, 0], [0, 3, 6])
    assert_array_equal(springs.inverse, [1.0, 0.5, 0.0])


def test_elastic_energy():
    laws = np.array([[4.0, 0.5, 0.0]])
    assert elastic_energy(np.array([[0, 2]]), laws, np.array(LINE)) == pytest.approx(12.5)


def test_shipped_cloth():
    scene = load_scene('cloth')
    assert len(scene.particles.position) == 900
    assert len(scene.springs.pairs) == 2 * 30 * 29 + 2 * 29 * 29
