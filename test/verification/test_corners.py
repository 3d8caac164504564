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

"""Corners, grooves, wedges, thin walls and starts inside, against closed forms."""

from math import ceil, cos, floor, pi, sin

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest
from small_scenes import (box, EPSILON, FAR, G, METHODS, order, plane, simulate,
                          sphere, UPRIGHT)

pytestmark = pytest.mark.plain

every_method = pytest.mark.parametrize('method', METHODS)
WEIGHTLESS = (0.0, 0.0, 0.0)


def groove(half_angle, **keys):
    """Two planes that make a groove along y, open upwards."""
    c, s = cos(half_angle), sin(half_angle)
    return [plane((c, 0.0, s), name='left', **keys), plane((-c, 0.0, s), name='right', **keys)]


def wedge(angle):
    """Two planes that leave free the polar angles 0 … angle about the z axis."""
    return [plane((0.0, 1.0, 0.0), name='floor'),
            plane((sin(angle), -cos(angle), 0.0), name='roof')]


@every_method
def test_right_corner_reverses(method):
    """T51: eps = 1: the velocity is reversed exactly after two hits, in a cube corner three."""
    walls = [plane((1.0, 0.0, 0.0), name='a'), plane((0.0, 1.0, 0.0), name='b'),
             plane((0.0, 0.0, 1.0), name='c')]
    velocity = np.array((-1.0, -0.7, 0.0))
    sim = simulate(walls[:2], (0.9, 0.4, 1.0), velocity, gravity=WEIGHTLESS, restitution=1.0,
                   method=method)
    sim.step(300)
    assert_array_equal(sim.velocity[0], -velocity)
    assert sim.counters['collisions'] == 2
    velocity = np.array((-1.0, -0.7, -0.3))
    sim = simulate(walls, (0.9, 0.4, 0.1), velocity, gravity=WEIGHTLESS, restitution=1.0,
                   method=method)
    sim.step(300)
    assert_array_equal(sim.velocity[0], -velocity)
    assert sim.counters['collisions'] == 3


def test_right_corner_in_one_step():
    """T51: the same where all three hits are in one step."""
    walls = [plane((1.0, 0.0, 0.0), name='a'), plane((0.0, 1.0, 0.0), name='b'),
             plane((0.0, 0.0, 1.0), name='c')]
    sim = simulate(walls, (0.01, 0.005, 0.001), (-20.0, -17.0, -13.0), gravity=WEIGHTLESS,
                   dt=1e-2, restitution=1.0)
    sim.step()
    assert_array_equal(sim.velocity[0], (20.0, 17.0, 13.0))
    assert sim.clearance()[0] >= 0.0


def unfolded(angle, direction, sector):
    """Direction [rad] of an unfolded ray in a wedge, folded back from a sector of it."""
    return direction - sector * angle if sector % 2 == 0 else (sector + 1) * angle - direction


@every_method
@pytest.mark.parametrize('degrees', [30, 7, 1])
@pytest.mark.jit
def test_wedge_by_images(method, degrees):
    """
    T52: eps = 1: the method of images gives the hits and the exit direction.

    The unfolded ray is straight and crosses the multiples of the angle of the wedge between the
    polar angles that it comes from and goes to; they are pi apart.
    """
    angle = np.radians(degrees)
    start, aside = 0.41 * angle, 1.0                # polar angle and distance from the edge
    far = 60.0                                      # it ends nearly in the direction of its flight
    incoming = start + pi - np.arcsin(aside / far)      # passes the edge at the distance 1
    dt = 1e-3 * aside * angle
    velocity = (cos(incoming), sin(incoming), 0.0)
    sim = simulate(wedge(angle), (far * cos(start), far * sin(start), 0.0), velocity,
                   gravity=WEIGHTLESS, restitution=1.0, method=method, dt=dt)
    sim.advance(2.0 * far)
    end = np.array((far * cos(start), far * sin(start))) + 2.0 * far * np.array(velocity[:2])
    polar = np.arctan2(end[1], end[0]) % (2.0 * pi)
    sector = floor(polar / angle)
    out = unfolded(angle, incoming, sector)
    assert sim.counters['collisions'] == sector <= ceil(pi / angle)
    assert_allclose(sim.velocity[0], (cos(out), sin(out), 0.0), atol=200 * 8 * EPSILON)


sharp_places = pytest.mark.parametrize('colliders', [
    groove(pi / 4), groove(0.1), [box(position=(0.0, 0.0, -0.5))],
    [box((1.0, 9.0, 1.0), (0.0, 0.0, -0.5 * 2.0 ** 0.5),
         orientation=(0.0, sin(pi / 8), 0.0, cos(pi / 8)))],
], ids=['right groove', 'acute groove', 'face', 'edge'])


@every_method
@sharp_places
@pytest.mark.parametrize('eps', [0.0, 1.0])
def test_exactly_into_a_corner(method, colliders, eps):
    """T53: a ray into an apex, a face centre or an edge: finite, outside, the same each time."""
    states = []
    for _ in range(2):
        sim = simulate(colliders + FAR, (0.0, 0.0, 0.25), (0.0, 0.0, -2.0), gravity=WEIGHTLESS,
                       restitution=eps, method=method, dt=1 / 64)
        sim.step(64)
        assert np.isfinite(sim.position).all() and np.isfinite(sim.velocity).all()
        assert sim.clearance()[0] >= 0.0
        assert np.linalg.norm(sim.velocity[0]) <= 2.0 * (1.0 + 1e-14)
        states.append(sim.position.tobytes() + sim.velocity.tobytes())
    assert states[0] == states[1]
    assert sim.velocity[0, 2] >= -1.0 - 1e-14       # beside an edge it slides down a face


@every_method
def test_along_an_edge(method):
    """T53: who flies exactly along an edge, or in a face, is outside and is not stopped."""
    for start in ((0.5, 0.5, 2.0), (0.5, 0.1, 2.0)):
        sim = simulate([box(), *FAR], start, (0.0, 0.0, -1.0), gravity=WEIGHTLESS, method=method,
                       friction={'dry': 1.0})
        sim.step(960)
        assert_array_equal(sim.velocity[0], (0.0, 0.0, -1.0))
        assert sim.position[0, 2] == pytest.approx(-2.0, abs=1e-12)


@every_method
@pytest.mark.parametrize('degrees', [0.5, 0.01, 1e-4])
@pytest.mark.parametrize('eps', [0.0, 0.5, 0.9])
@pytest.mark.jit
def test_falling_into_an_acute_wedge(method, degrees, eps):
    """T54: gravity into a wedge: nobody gets through, nor faster than in free fall."""
    half = np.radians(degrees)
    sim = simulate(groove(half), [(0.0, 0.0, 1.0), (0.9 * half, 0.1, 1.0)], restitution=eps,
                   method=method, friction={'dry': 0.1})
    for _ in range(40):
        sim.step(50)
        assert (sim.clearance() >= 0.0).all()
        assert (sim.position[:, 2] <= 1.01).all()
        assert (sim.position[:, 2] >= 0.0).all()
    assert sim.counters['unplaced'] == 0
    assert (np.linalg.norm(sim.velocity, axis=1) < G * sim.time).all()


@every_method
@pytest.mark.parametrize('degrees', [5.0, 0.5])
@pytest.mark.jit
def test_rest_in_an_acute_groove(method, degrees):
    """
    T54: a particle comes to rest in a groove and stays, with no speed left but that of a step.

    As on a plane it rests where its fall ended: within g dt^2 of the surfaces, here of the bottom.
    """
    half = np.radians(degrees)
    sim = simulate(groove(half), (0.9 * half, 0.1, 1.0), method=method, friction={'dry': 0.1})
    sim.step(2000)
    rest = sim.position[0].copy()
    assert 0.0 <= rest[2] < 2.0 * G * sim.dt ** 2
    assert np.linalg.norm(sim.velocity[0]) <= G * sim.dt
    sim.step(2000)
    assert_allclose(sim.position[0], rest, rtol=0.0, atol=1e-15)
    assert np.linalg.norm(sim.velocity[0]) <= G * sim.dt


@every_method
@pytest.mark.parametrize(('half_angle', 'mu'), [(pi / 4, 0.3), (pi / 6, 0.05)])
@pytest.mark.parametrize('aside', (0.0, 0.7))
@pytest.mark.jit
def test_sliding_in_a_groove(method, half_angle, mu, aside):
    """
    T55, fact 6: slows at mu g / sin(half angle), also with a gravity that pulls aside.

    To first order with the deepest collider first; to rounding where both are answered at once,
    which is so with second order, and with gravity along the middle plane: both are equally deep.
    """
    steps, errors = np.array([0.0101, 0.00503, 0.00251, 0.001253]), []
    for dt in steps:
        sim = simulate(groove(half_angle), (0.0, 0.0, 0.0), (0.0, 3.0, 0.0), dt=dt, method=method,
                       friction={'dry': mu}, gravity=(aside, 0.0, -G))
        sim.advance(0.3)
        slower = (3.0 - sim.velocity[0, 1]) / sim.time
        errors.append(abs(slower - mu * G / sin(half_angle)))
        assert abs(sim.position[0, 0]) < 1e-14 + aside * dt ** 2
    assert errors[-1] < 0.01 * mu * G
    if method == 'second_order_contact' or (method == 'collision_then_contact' and not aside):
        assert max(errors) < 1e-12
    else:
        assert order(steps, errors) == pytest.approx(1.0, abs=0.25)


def closing_plates(method, friction):
    """Two plates that close on a particle with 1 m/s each, after half a second."""
    plates = [plane(motion={'linear_velocity': [0.0, 0.0, 1.0]}),
              plane((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), name='lid',
                    motion={'linear_velocity': [0.0, 0.0, -1.0]})]
    return simulate(plates, (0.0, 0.0, 0.4), gravity=WEIGHTLESS, method=method, dt=1 / 256,
                    friction={'dry': friction})


@every_method
@pytest.mark.parametrize('friction', [0.0, 0.4])
def test_squeezed_between_plates(method, friction):
    """T58: outside both plates until these touch, then noted as unplaced."""
    sim, closed = closing_plates(method, friction), None
    for _ in range(200):
        sim.step()
        assert np.isfinite(sim.position).all() and np.isfinite(sim.velocity).all()
        if closed is None and sim.counters['unplaced']:
            closed = sim.time
        assert sim.clearance()[0] >= 0.0 or closed
    assert closed == pytest.approx(0.5, abs=2 * sim.dt)        # gap 1 - 2 t
    particle, name, reason = sim.unplaced[0]
    assert particle == 0
    assert (name, reason) in (('ground', 'hemmed in by lid'), ('lid', 'hemmed in by ground'))


@every_method
def test_squeezed_particles_are_not_faster_than_the_plates(method):
    """T58: no speed above that of the plates, whatever is pressed against what."""
    sim = closing_plates(method, 0.4)
    for _ in range(200):
        sim.step()
        assert np.linalg.norm(sim.velocity[0]) <= 1.0 + 1e-12


@every_method
@pytest.mark.parametrize('ratio', [0.1, 0.5, 0.9, 1.3])
@pytest.mark.jit
def test_thin_wall_is_a_lottery(method, ratio):
    """
    T73: a wall of thickness h is noticed with P = min(1, h / (v dt)).

    The face that was crossed answers: a particle that ends beyond the middle comes back, too.
    """
    count, speed, dt = 10_000, 10.0, 0.1
    thickness = ratio * speed * dt
    start = np.zeros((count, 3))
    start[:, 0] = -5.0 - speed * dt * (np.arange(count) + 0.5) / count
    sim = simulate([box((thickness, 9.0, 9.0)), *FAR], start, (speed, 0.0, 0.0),
                   gravity=WEIGHTLESS, restitution=1.0, dt=dt, method=method)
    sim.step(20)
    free = start[:, 0] + speed * sim.time
    noticed = np.mean(np.abs(sim.position[:, 0] - free) > 1e-9)
    turned = np.mean(sim.velocity[:, 0] < 0.0)
    assert noticed == pytest.approx(min(1.0, ratio), abs=2 / count)
    assert turned == pytest.approx(min(1.0, ratio), abs=2 / count)


@every_method
@pytest.mark.parametrize('depth', [1e-9, 1e-3, 0.4, 1.0])
@pytest.mark.parametrize('gravity', [0.0, G])
def test_repulsion(method, depth, gravity):
    """T80: the depth falls by a tenth a step, at no more than 10 m/s; the velocity is not kept."""
    sim = simulate([plane()], (0.0, 0.0, -depth), gravity=(0.0, 0.0, -gravity), method=method,
                   restitution=1.0)
    left = depth
    for _ in range(60):
        sim.step()
        left -= min(0.1 * left, 10.0 * sim.dt)
        assert -sim.clearance()[0] == pytest.approx(left, rel=1e-9)
        assert_allclose(sim.velocity[0], 0.0, atol=gravity * sim.dt)


@every_method
@pytest.mark.parametrize('place', [(0.3, 0.0, 0.0), (0.0, -0.4, 0.1), (0.0, 0.0, 0.0)])
def test_repulsion_leaves_by_the_nearest_face(method, place):
    """T80: never through the far side, also from the centre, and without speed."""
    sim = simulate([box(), *FAR], place, gravity=WEIGHTLESS, method=method)
    nearest = np.argmax(np.abs(place))
    side = -1.0 if place[nearest] < 0.0 else 1.0
    sim.step(400)
    assert side * sim.position[0, nearest] == pytest.approx(0.5, abs=1e-9)
    assert_array_equal(np.delete(sim.position[0], nearest), np.delete(place, nearest))
    assert_array_equal(sim.velocity[0], 0.0)


@every_method
@pytest.mark.parametrize('gravity', [0.0, G])
def test_repulsion_ends(method, gravity):
    """T80: what is left of a depth, down to rounding, is a place to stay, never a dead end."""
    depths = EPSILON * np.arange(200)
    places = [(depth - 0.5, 0.01 * i - 0.4, 3e-5) for i, depth in enumerate(depths)]
    wall = box(name='wall')
    sim = simulate([plane(), wall], places, gravity=(0.0, 0.0, -gravity), method=method)
    sim.step(100)
    assert sim.counters['unplaced'] == sim.counters['fail_safes'] == 0
    assert sim.clearance().min() > -depths[-1]
    assert_allclose(sim.position, places, atol=depths[-1] + (gravity > 0.0) * 3e-5)


@every_method
def test_start_inside_and_fast(method):
    """T80: a fast one inside is stopped on its way in, and may leave on its way out."""
    for speed in (-3.0, 3.0):
        sim = simulate([plane()], (0.0, 0.0, -0.5), (0.0, 0.0, speed), gravity=WEIGHTLESS,
                       restitution=1.0, method=method, dt=0.05)
        sim.step()
        assert sim.velocity[0, 2] == (0.0 if speed < 0.0 else speed)
        assert sim.position[0, 2] > -0.5


@every_method
def test_seam_between_two_boxes(method):
    """T50: over the seam of two flush boxes: no bump; the same as on one box, bit for bit."""
    def slide(colliders):
        sim = simulate(colliders + FAR, (-0.5, 0.0, 0.0), (2.0, 0.1, 0.0), friction={'dry': 0.01},
                       method=method)
        sim.step(120)
        return sim.position[0].copy(), sim.velocity[0].copy()
    two = slide([box((2.0, 4.0, 1.0), (-1.0, 0.0, -0.5), 'left'),
                 box((2.0, 4.0, 1.0), (1.0, 0.0, -0.5), 'right')])
    one = slide([box((4.0, 4.0, 1.0), (0.0, 0.0, -0.5))])
    assert one[0][0] > 0.4
    assert_array_equal(two[1], one[1])
    assert_array_equal(two[0], one[0])


@every_method
def test_corner_of_a_box_and_a_ball(method):
    """A particle that falls between a ball and a wall comes to rest outside both."""
    sim = simulate([plane(), sphere(0.5, (0.0, 0.0, 0.5)), *FAR,
                    plane((-1.0, 0.0, 0.0), (0.55, 0.0, 0.0), name='wall')],
                   (0.4, 0.0, 1.5), friction={'dry': 0.2}, method=method, restitution=0.3)
    sim.step(1000)
    assert sim.clearance()[0] >= 0.0
    assert np.linalg.norm(sim.velocity[0]) < 0.2


def test_plates_that_open_again_let_go():
    """T58: after the plates part, the particle is outside both again, and slow."""
    sim = simulate([plane(), plane((0.0, 0.0, -1.0), (0.0, 0.0, 0.1), name='lid')],
                   (0.0, 0.0, 0.05), gravity=WEIGHTLESS)
    for height in (-0.1, 0.2):
        sim.move_collider('lid', np.linspace((0.0, 0.0, 0.1), (0.0, 0.0, height), 48),
                          np.tile(UPRIGHT, (48, 1)))
        sim.step(48)
    sim.step(240)
    assert sim.clearance()[0] >= -1e-6
    assert np.linalg.norm(sim.velocity[0]) <= 2.0


@pytest.mark.parametrize('degrees', (5, 15, 25, 44))
@pytest.mark.parametrize('detection', ('end_of_step', 'trajectory'))
@pytest.mark.parametrize('method', [*METHODS, 'exact'])
def test_an_acute_groove_of_boxes_holds(method, detection, degrees):
    """Where a box leans on another one it does not cover its face: nobody falls in between."""
    walls = []
    for side in (1.0, -1.0):
        n = np.array((side * cos(np.radians(degrees)), 0.0, sin(np.radians(degrees))))
        along, turn = np.array((-side * n[2], 0.0, abs(n[0]))), 0.5 * np.arctan2(n[0], n[2])
        walls.append(box((2.0, 2.0, 0.2), (0.6 * along - 0.1 * n).tolist(),
                         'left' if side > 0.0 else 'right',
                         orientation=[0.0, sin(turn), 0.0, cos(turn)]))
    sim = simulate(walls, [(0.001, 0.1, 0.1), (0.0, 0.0, 0.05), (0.003, -0.2, 0.15)],
                   method=method, stepping={'detection': detection}, friction={'dry': 0.1},
                   dt=1 / 120)
    sim.step(90)
    assert (sim.clearance() >= -1e-12).all() and (sim.position[:, 2] >= -1e-9).all()
    assert np.abs(sim.position[:, (0, 2)]).max() < 0.01
