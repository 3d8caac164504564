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


"""
Meshes against what they stand in for: planes, boxes and round shapes; T49, T50, T78 and T79.

A mesh keeps particles off by a skin of some roundings, so places agree to 1e-12, and velocities to
the last bit where the same law acts at the same normal.
"""

from collision_sim import Scene, SceneError
from collision_sim.checks import SceneWarning
import numpy as np
import pytest
import small_meshes
from small_scenes import box, G, order, plane, simulate, sphere

pytestmark = pytest.mark.jit
DETECTIONS = ('end_of_step', 'trajectory')
THIRTY = np.pi / 6.0


def mesh(shape, name='mesh', **keys):
    """Give a collider of (vertices, faces)."""
    vertices, faces = shape
    return {'name': name, 'shape': 'mesh', 'vertices': vertices, 'faces': faces, **keys}


def run(collider, position, velocity=(0.0, 0.0, 0.0), *, detection='end_of_step', radius=0.0,
        **keys):
    """Make a simulation with one collider."""
    return simulate([collider], position, velocity, particles={'radius': radius},
                    stepping={'detection': detection}, **keys)


def scattered(count, seed=1, low=(-1.5, -1.5, 0.0), high=(1.5, 1.5, 0.5)):
    """Places and velocities of particles above a floor; some of them right on its seams."""
    random = np.random.default_rng(seed)
    position = random.uniform(low, high, (count, 3))
    position[::3, 0] = np.round(position[::3, 0])
    position[::6, 1] = np.round(position[::6, 1])
    return position, 0.4 * random.normal(size=(count, 3))


@pytest.mark.parametrize('detection', DETECTIONS)
@pytest.mark.parametrize('radius', [0.0, 0.05])
@pytest.mark.parametrize('friction', [{}, {'dry': 0.3}, {'dry': 0.2, 'wet': 0.5}])
def test_a_floor_of_quads_is_a_plane(detection, radius, friction):
    """Bounce, slide and rest: the same velocities to the last bit, also on and across seams."""
    position, velocity = scattered(300)
    position[:100, 2] = 0.0
    both = [run(collider, position + [0, 0, radius], velocity, detection=detection, radius=radius,
                friction=friction, restitution=0.5)
            for collider in (mesh(small_meshes.grid(4, 20.0)), plane())]
    for _ in range(40):
        for one in both:
            one.step(20)
        assert np.array_equal(both[0].velocity, both[1].velocity)
        assert np.abs(both[0].position - both[1].position).max() < 1e-12
    assert both[0].counters == both[1].counters and both[0].counters['contacts'] > 0


@pytest.mark.parametrize('radius', [0.0, 0.05])
@pytest.mark.parametrize('across', [(1.0, 0.0), (0.6, 0.8), (0.0, 1.0)])
def test_no_bump_on_seams_in_ten_thousand_steps(radius, across):
    """T50: a frictionless slide over 100 seams keeps its velocity to the last bit."""
    sim = run(mesh(small_meshes.grid(200, 30.0)), [[-29.0, -29.0, radius]], [[*across, 0.0]],
              radius=radius, contacts=False)
    start = sim.velocity.copy()
    for _ in range(100):
        sim.step(100)
        assert np.array_equal(sim.velocity, start)
    assert sim.clearance()[0] >= 0.0 and sim.position[0, 2] - radius < 1e-12


@pytest.mark.parametrize('detection', DETECTIONS)
@pytest.mark.parametrize('radius', [0.0, 0.05])
def test_slide_down_a_tilted_floor(detection, radius):
    """T14 on a floor tilted by its pose and on one tilted by its vertices."""
    mu, time = 0.2, 1.0
    vertices, faces = small_meshes.grid(8, 4.0)
    cos, sin = np.cos(THIRTY), np.sin(THIRTY)
    turn = np.array([[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]])
    pose = [0, -np.sin(THIRTY / 2), 0, np.cos(THIRTY / 2)]
    start = radius * turn[:, 2] + turn @ [3.0, 0.3, 0.0]
    for collider in (mesh((vertices @ turn.T, faces)), mesh((vertices, faces), orientation=pose)):
        sim = run(collider, start + 1e-13 * turn[:, 2], detection=detection, radius=radius,
                  friction={'dry': mu}, dt=1 / 240)
        sim.advance(time)
        way = np.linalg.norm(sim.position[0] - start)
        assert way == pytest.approx(0.5 * G * (sin - mu * cos) * time ** 2, abs=1e-11)


@pytest.mark.parametrize('detection', DETECTIONS)
@pytest.mark.parametrize('radius', [0.0, 0.05])
def test_a_box_of_triangles_is_a_box(detection, radius):
    """T50: while particles hit the faces of a box, the mesh gives the same to rounding."""
    position, velocity = scattered(400, 2, (-0.7, -0.7, 0.6), (0.7, 0.7, 1.5))
    both = [run(collider, position, 0.5 * velocity, detection=detection, radius=radius,
                friction={'dry': 0.3}, restitution=0.5)
            for collider in (mesh(small_meshes.box()), box())]
    over = np.abs(position[:, :2]).max(axis=1) < 0.3
    for _ in range(10):
        for one in both:
            one.step(10)
        same = over & (np.abs(both[1].position[:, :2]).max(axis=1) < 0.49)
        assert np.abs(both[0].velocity - both[1].velocity)[same].max() < 1e-12
        assert np.abs(both[0].position - both[1].position)[same].max() < 1e-12
    assert both[0].counters['collisions'] > 100 and both[0].clearance().min() >= 0.0


def test_ball_on_edges_and_corners_of_a_box():
    """T78: at real edges and corners the normal points from the feature; the time is exact."""
    radius, speed = 0.2, 3.0
    starts = np.array([[0.6, 0.0, 2.0], [0.6, 0.6, 2.0], [0.0, 0.1, 2.0]])
    both = [run(collider, starts, [0, 0, -speed], detection='trajectory', radius=radius,
                gravity=(0, 0, 0), restitution=1.0)
            for collider in (mesh(small_meshes.box()), box())]
    for one in both:
        one.advance(1.0)
    assert np.abs(both[0].velocity - both[1].velocity).max() < 1e-12
    assert np.abs(both[0].position - both[1].position).max() < 1e-12
    normal = np.array([0.1, 0.0, np.sqrt(radius ** 2 - 0.01)]) / radius
    expected = [0, 0, -speed] + 2.0 * speed * normal[2] * normal
    assert np.abs(both[0].velocity[0] - expected).max() < 1e-12


@pytest.mark.parametrize('detection', DETECTIONS)
@pytest.mark.parametrize('winding', [1, -1])
@pytest.mark.parametrize('radius', [0.0, 0.1])
def test_an_open_mesh_stops_particles_on_both_sides(detection, winding, radius):
    """T78: two-sided, either winding; hits exactly on corners and edges of the triangles."""
    vertices, faces = small_meshes.grid(4, 2.0)
    faces = [face[::winding] for face in faces]
    place = np.array([[0, 0], [1, 1], [0.5, 0.5], [0, 0.3], [0.2, 0.7], [-1.5, 0.5]])
    starts = np.concatenate([np.c_[place, np.full(6, side)] for side in (-1.0, 1.0)])
    sim = run(mesh((vertices, faces)), starts, -100.0 * starts * [0, 0, 1], detection=detection,
              radius=radius, gravity=(0, 0, 0), restitution=0.5, dt=1 / 50)
    sim.step(3)
    assert np.array_equal(np.sign(sim.position[:, 2]), np.sign(starts[:, 2]))
    assert np.abs(sim.velocity[:, 2] - 50.0 * starts[:, 2]).max() < 1e-12
    assert np.abs(sim.velocity[:, :2]).max() < 1e-12


@pytest.mark.parametrize('detection', DETECTIONS)
@pytest.mark.parametrize('radius', [0.0, 0.03])
@pytest.mark.parametrize('speed', [1.0, 1e3, 1e6])
def test_nobody_gets_out_of_a_closed_mesh(detection, radius, speed):
    """T73, T78: through no face, edge or corner, at any speed, with the mesh at rest or moving."""
    vertices, faces = small_meshes.sphere(2)
    random = np.random.default_rng(3)
    position = random.uniform(-0.4, 0.4, (900, 3))
    aim = vertices[random.integers(0, len(vertices), 900)]
    aim[300:600] += vertices[random.integers(0, len(vertices), 300)]
    position[:300] = 0.0
    velocity = speed * np.where(np.arange(900)[:, None] < 600, aim - position,
                                random.normal(size=(900, 3)))
    for motion in ({}, {'motion': {'linear_velocity': [3, 1, 0], 'angular_velocity': [1, 5, 2]}}):
        sim = run(mesh((vertices, faces), inside=True, **motion), position, velocity,
                  detection=detection, radius=radius, restitution=0.9, friction={'dry': 0.2})
        sim.step(60)
        assert sim.clearance().min() >= -1e-12 and np.isfinite(sim.velocity).all()
        assert sim.counters['collisions'] > 20


@pytest.mark.parametrize('detection', DETECTIONS)
def test_thin_sheets_of_a_moving_mesh_are_not_passed(detection):
    """T23, T73: a sheet that moves at V against particles: v' = V - eps (v - V)."""
    push = {'motion': {'linear_velocity': [0, 0, 50.0]}}
    sim = run(mesh(small_meshes.grid(3, 2.0, -1.0), **push), [[0.1, 0.2, 0.0], [0.0, 0.0, 0.3]],
              [0, 0, -7.0], detection=detection, gravity=(0, 0, 0), restitution=0.5, dt=1 / 10)
    sim.step(2)
    assert np.abs(sim.velocity[:, 2] - (50.0 + 0.5 * 57.0)).max() < 1e-12


def test_hit_of_a_turning_blade():
    """T74: eight turns in a step; the elastic hit is where the angles say, by both its sides."""
    blade = [[0, 0, -1.0], [2, 0, -1], [2, 0, 1], [0, 0, 1]], [[0, 1, 2, 3]]
    for rate, angle in ((50.0, 2.0), (-50.0, 2.0)):
        place = [np.cos(angle), np.sin(angle), 0.0]
        sim = run(mesh(blade, motion={'angular_velocity': [0, 0, rate]}), [place],
                  detection='trajectory', gravity=(0, 0, 0), dt=1.0, restitution=1.0)
        sim.step()
        normal = np.sign(rate) * np.array([-np.sin(angle), np.cos(angle), 0.0])
        assert np.abs(sim.velocity[0] - 100.0 * normal).max() < 1e-5


@pytest.mark.parametrize('radius', [0.0, 0.05])
def test_rest_in_a_groove_of_one_mesh(radius):
    """Two faces of the same collider: rest in the corner between them, to the fall of a step."""
    groove = ([[0, -5, 0], [0, 5, 0], [5, -5, 4], [5, 5, 4], [-5, -5, 4], [-5, 5, 4]],
              [[0, 2, 3, 1], [1, 5, 4, 0]])
    random = np.random.default_rng(4)
    position = random.uniform([-1, -1, 1.2], [1, 1, 2.0], (200, 3))
    position[::4, 0] = 0.0
    sim = run(mesh(groove), position, restitution=0.5, friction={'dry': 0.3}, radius=radius)
    sim.step(2000)
    x, _, z = sim.position.T
    assert np.abs(sim.velocity).max() < 1e-9 and sim.clearance().min() >= 0.0
    assert np.abs(x).max() < G / 240 ** 2 and (z < 0.1).all() and (z > 0.8 * np.abs(x)).all()
    assert sim.counters['fail_safes'] == 0


def test_who_starts_inside_a_closed_mesh_is_repelled():
    """T80: the depth decays as (1 - share)^n, as with the box."""
    for detection in DETECTIONS:
        sim = run(mesh(small_meshes.box()), [[0.1, 0.2, 0.4]], detection=detection,
                  gravity=(0, 0, 0))
        sim.step(20)
        assert sim.clearance()[0] == pytest.approx(-0.1 * 0.9 ** 20, rel=1e-9)


@pytest.mark.parametrize('radius', [0.0, 0.05])
def test_a_finer_sphere_converges_to_the_sphere(radius):
    """T49: places after a bounce, as the triangles get smaller, at the same step."""
    random = np.random.default_rng(5)
    position = np.c_[random.uniform(-0.4, 0.4, (300, 2)), np.full(300, 1.5)]
    smooth = run(sphere(), position, detection='trajectory', radius=radius, restitution=0.5)
    smooth.step(120)
    errors = []
    for level in (1, 2, 3, 4):
        sim = run(mesh(small_meshes.sphere(level)), position, detection='trajectory',
                  radius=radius, restitution=0.5)
        sim.step(120)
        errors.append(np.sqrt(np.mean(np.square(sim.position - smooth.position))))
    assert errors[-1] < 0.03
    assert order(2.0 ** -np.arange(4), errors) > 0.85      # the normal of a face is off by O(h)


def test_a_finer_bowl_converges_to_the_bowl():
    """T49: a quarter of the swing in a bowl, at the same step."""
    start, steps = [[np.sin(1.0), 0.02, -np.cos(1.0)]], 128
    start = np.array(start) / np.linalg.norm(start)
    smooth = run(sphere(inside=True), 0.999999 * start, dt=0.5348 / steps)
    smooth.step(steps)
    errors = []
    for level in (2, 3, 4, 5):
        bowl = mesh(small_meshes.sphere(level, 1.0), inside=True)
        sim = run(bowl, 0.99 ** (4.0 ** (2 - level)) * start, dt=0.5348 / steps)
        sim.step(steps)
        errors.append(np.linalg.norm(sim.position - smooth.position))
    assert errors[-1] < 0.02 and order(2.0 ** -np.arange(4), errors) > 0.8


def test_bad_meshes_are_refused_with_the_index():
    """T79: missing corner, NaN vertex; the scene is not touched. No area: left out, and said."""
    vertices, faces = small_meshes.box()
    scene = {'colliders': [mesh((vertices.tolist(), faces))]}
    good = Scene.from_dict(scene)
    scene['colliders'][0]['faces'] = [*faces, [0, 1, 1]]
    with pytest.warns(SceneWarning, match='1 faces without area are left out; the first is 6'):
        assert Scene.from_dict(scene).colliders[0].mesh.closed
    for where, bad, words in (('faces', [*faces, [0, 1, 8]], 'face 6: corner 8 is out of range'),
                              ('vertices', [*vertices.tolist(), [0, 0, np.nan]],
                               r'vertices\[8\]')):
        scene['colliders'][0] = {**mesh((vertices.tolist(), faces)), where: bad}
        with pytest.raises(SceneError, match=words):
            Scene.from_dict(scene)
    assert good.colliders[0].mesh.closed


def test_ledger_and_contacts_of_a_mesh():
    """The accounts close, and contacts are recorded with the normals of the faces."""
    position, velocity = scattered(100)
    sim = run(mesh(small_meshes.grid(4, 20.0)), position, velocity, ledger=True, restitution=0.5,
              friction={'dry': 0.3})
    for _ in range(200):
        sim.step()
        assert (sim.contacts.normal == [0, 0, 1]).all() and (sim.contacts.collider == 0).all()
    balance, other = sim.ledger, run(plane(), position, velocity, ledger=True, restitution=0.5,
                                     friction={'dry': 0.3})
    other.step(200)
    assert repr(balance) is not None and sim.counters == other.counters


def test_threads_and_steps_at_once_change_no_bit():
    position, velocity = scattered(3000, 6, (-2, -2, 1.6), (2, 2, 3.0))
    ends = []
    for threads, calls in ((1, 1), (2, 1), (1, 240)):
        sim = run(mesh(small_meshes.torus(24), position=[0, 0, 1.0]), position, velocity,
                  detection='trajectory', restitution=0.5, friction={'dry': 0.3}, threads=threads)
        for _ in range(calls):
            sim.step(240 // calls)
        ends.append(np.concatenate([sim.position, sim.velocity]))
    assert np.array_equal(ends[0], ends[1]) and np.array_equal(ends[0], ends[2])


def test_a_mesh_that_nobody_meets_changes_no_bit():
    """A mesh far away, and a scene without it, give the same."""
    position, velocity = scattered(200)
    far = mesh(small_meshes.sphere(1), name='far', position=[0, 0, 1e6])
    ends = []
    for colliders in ([plane(), box()], [plane(), box(), far]):
        sim = simulate(colliders, position + [0, 0, 1], velocity, restitution=0.5,
                       friction={'dry': 0.3})
        sim.step(240)
        ends.append(np.concatenate([sim.position, sim.velocity]))
    assert np.array_equal(*ends)
