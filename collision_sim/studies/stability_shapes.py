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
Stability: high speeds, thin walls, far and tiny coordinates, wedges, corners, starts inside.

Colliders that do not move, against closed forms, and by what always holds: nobody gets through a
surface, and the kinetic energy does not grow where nothing feeds it.
"""

from functools import partial
import math

from collision_sim.studies.stability_cases import (at_most, box, build, Case, Check, EPSILON, G,
                                                   outside, plane, speed, sphere, track, wedge,
                                                   WEIGHTLESS)
import numpy as np

LOTTERY = ('a step that ends beyond the wall does not notice it: P(hit) = min(1, h / (v dt)); '
           'detection trajectory does')
PATHS_ONLY = {'exact': 'finds every impact along the path'}


def directions(count, seed=1):
    """Give unit vectors in all directions."""
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / speed(vectors)[:, np.newaxis]


def scatter(count, reach, seed=2):
    """Give places in a cube."""
    return np.random.default_rng(seed).uniform(-reach, reach, (count, 3))


def fast_hit(method, v, detection):
    """Hit obliquely, mu = 0.1 and eps = 1/2: v (3, 0, -4) / 5 becomes v (2.4, 0, 2) / 5."""
    sim = build(method, [plane()], (0.0, 0.0, 1.0), v * np.array((0.6, 0.0, -0.8)), eps=0.5,
                dry=0.1, gravity=WEIGHTLESS, detection=detection)
    while sim.counters['collisions'] == 0 and sim.time < 5.0 / v + sim.dt:
        sim.step()
    return [at_most('error of v / speed', np.abs(sim.velocity[0] / v - (0.48, 0.0, 0.4)),
                    16 * EPSILON),
            outside(sim.position, sim.clearance())]


def closed_room(method, v):
    """Fly in a hollow cube, 20 times its size a step, eps = 1: nobody gets out or faster."""
    sim = build(method, [box((2.0, 2.0, 2.0), inside=True)], scatter(200, 0.9),
                v * directions(200), gravity=WEIGHTLESS, eps=1.0, dt=40.0 / v)
    x, velocity, clear = track(sim, 200)
    return [at_most('speed gained / speed', np.diff(speed(velocity), axis=0) / v, 64 * EPSILON),
            outside(x, clear)]


def thin_wall(method, thickness, detection):
    """Fly 10 m a step at a wall, each from another distance, eps = 1: nobody gets through."""
    count, v, dt = 1000, 1e3, 1e-2
    start = np.zeros((count, 3))
    start[:, 2] = thickness / 2 + v * dt * (np.arange(count) + 0.5) / count
    sim = build(method, [box((9.0, 9.0, thickness))], start, (0.0, 0.0, -v), gravity=WEIGHTLESS,
                eps=1.0, dt=dt, detection=detection)
    sim.step(3)
    checks = [at_most('share that gets through', np.mean(sim.position[:, 2] < 0.0), 0.0)]
    if detection == 'trajectory':
        checks += [at_most('error of v / speed', np.abs(sim.velocity[:, 2] / v - 1.0),
                           4 * EPSILON),
                   Check('undecided paths', sim.counters['undecided'], 0)]
    return checks


def lottery(method, ratio):
    """Fly at a wall that is noticed at the end of the step only: P = h / (v dt)."""
    count, v, dt = 10_000, 10.0, 0.1
    start = np.zeros((count, 3))
    start[:, 0] = -5.0 - v * dt * (np.arange(count) + 0.5) / count
    sim = build(method, [box((ratio * v * dt, 9.0, 9.0))], start, (v, 0.0, 0.0),
                gravity=WEIGHTLESS, eps=1.0, dt=dt)
    sim.step(20)
    noticed = np.mean(np.abs(sim.position[:, 0] - start[:, 0] - v * sim.time) > 1e-9)
    return [Check('share noticed - h / (v dt)', abs(noticed - ratio), 2 / count)]


def thin_room(method, v, thickness=1e-9):
    """Fly between six thin walls, 2 m apart, eps = 0.9: nobody gets out or faster."""
    walls = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            size, place = np.full(3, 2.0 + 2.0 * thickness), np.zeros(3)
            size[axis], place[axis] = thickness, side * (1.0 + 0.5 * thickness)
            walls.append(box(size.tolist(), place.tolist(), f'wall_{len(walls)}'))
    sim = build(method, walls, scatter(100, 0.9), v * directions(100), gravity=WEIGHTLESS,
                eps=0.9, dry=0.1, detection='trajectory')
    x, velocity, clear = track(sim, 200)
    return [at_most('way out of the room / m', np.abs(x) - 1.0, 8 * EPSILON),
            at_most('speed gained / speed', np.diff(speed(velocity), axis=0) / v, 64 * EPSILON),
            outside(x, clear), Check('undecided paths', sim.counters['undecided'], 0)]


def far_rest(method, far):
    """Rest on a slope of 17 deg at coordinates where rounding is coarse."""
    place = (far, -far, far)
    slope = plane((-math.sin(0.3), 0.0, math.cos(0.3)), place)
    sim = build(method, [slope], place, dry=1.0)
    sim.step(10_000)
    return [Check('way / m', float(speed(sim.position[0] - place)), 0.0)]


def far_bounce(method, far):
    """Drop with eps = 1/2 at far coordinates: not through, no energy but that of rounding."""
    sim = build(method, [plane(point=(0.0, 0.0, far))], (far, -far, far + 1.0), eps=0.5)
    x, v, clear = track(sim, 1000)
    energy = 0.5 * np.square(v[:, 0]).sum(axis=1) + G * (x[:, 0, 2] - far)
    rounding = EPSILON * far
    return [at_most('energy gained / energy', energy / G - 1.0, 1000 * (EPSILON + rounding)),
            Check('depth inside / m', -float(np.min(clear)), 4 * rounding),
            Check('height in the end / m', x[-1, 0, 2] - far, 4 * G * sim.dt ** 2 + 64 * rounding)]


def tiny_speed(method, v):
    """Hit with a denormal velocity: v' = -v / 2 with eps = 1/2, to the last denormal."""
    sim = build(method, [plane()], (0.0, 0.0, 0.0), (0.0, 0.0, -v), gravity=WEIGHTLESS, eps=0.5,
                dt=1.0)
    sim.step()
    return [Check('error of v / 5e-324 m/s', abs(sim.velocity[0, 2] - 0.5 * v) / 5e-324, 1.0),
            outside(sim.position, sim.clearance())]


def tiny_lengths(method, gap):
    """Start at a denormal distance from the ground and from a ball's centre: finite, at rest."""
    ball = sphere(0.5, (0.0, 0.0, 0.5))
    sim = build(method, [plane(), ball],
                [(3.0, 0.0, gap), (gap, 0.0, 0.5), (-3.0, gap, 2.0 * gap)], dry=0.5)
    x, v, _ = track(sim, 500)
    return [at_most('places not finite', [np.count_nonzero(~np.isfinite(x)),
                                          np.count_nonzero(~np.isfinite(v))], 0),
            at_most('way of those at rest / m', np.abs(x[:, (0, 2)] - x[0, (0, 2)]), 2.0 * gap),
            at_most('speed / that of a fall from the ball', speed(v) / math.sqrt(2.0 * G),
                    1.0 + 1e-9)]


def fall_into_wedge(method, degrees, eps):
    """Fall into an acute wedge, mu = 0.1: not through, no energy gained."""
    half = math.radians(degrees) / 2
    sim = build(method, wedge(half), [(0.0, 0.0, 1.0), (0.9 * half, 0.1, 1.0)], eps=eps, dry=0.1)
    x, v, clear = track(sim, 2000)
    energy = 0.5 * np.square(v).sum(axis=2) + G * x[:, :, 2]
    return [at_most('energy gained / energy', energy / G - 1.0, 2000 * EPSILON),
            outside(x, clear),
            at_most('way down through the edge / m', -x[:, :, 2], 0.0),
            Check('unplaced', sim.counters['unplaced'], 0)]


def wedge_by_images(method, degrees):
    """
    Fly through a wedge with eps = 1: hits and exit direction by the method of images.

    The unfolded ray is straight and crosses the multiples of the angle of the wedge between the
    polar angles that it comes from and goes to.
    """
    angle, far = math.radians(degrees), 20.0
    start = 0.41 * angle
    incoming = start + math.pi - math.asin(1.0 / far)       # passes the edge at 1 m
    velocity = (math.cos(incoming), math.sin(incoming), 0.0)
    walls = [plane((0.0, 1.0, 0.0), name='floor'),
             plane((math.sin(angle), -math.cos(angle), 0.0), name='roof')]
    sim = build(method, walls, (far * math.cos(start), far * math.sin(start), 0.0), velocity,
                gravity=WEIGHTLESS, eps=1.0, dt=1e-2 * angle)
    sim.advance(2.0 * far)
    end = [far * math.cos(start) + 2.0 * far * velocity[0],
           far * math.sin(start) + 2.0 * far * velocity[1]]
    sector = int(math.atan2(end[1], end[0]) % (2.0 * math.pi) / angle)
    out = incoming - sector * angle if sector % 2 == 0 else (sector + 1) * angle - incoming
    exact = (math.cos(out), math.sin(out), 0.0)
    return [at_most('error of the exit direction', np.abs(sim.velocity[0] - exact),
                    16 * EPSILON * sector),
            Check(f'hits besides {sector}', abs(sim.counters['collisions'] - sector), 0)]


def into_features(method, eps):
    """Fly exactly at edges, vertices, face centres and axes: outside, not faster."""
    turned = (0.0, math.sin(math.pi / 8), 0.0, math.cos(math.pi / 8))
    shapes = [box(position=(0.0, 0.0, -0.5)),
              box(position=(10.0, 0.0, -math.sqrt(0.5)), name='edge', orientation=turned),
              sphere(1.0, (20.0, 0.0, -1.0)),
              {'name': 'can', 'shape': 'cylinder', 'radius': 1, 'length': 1,
               'position': [30.0, 0.0, -0.5]},
              {'name': 'pill', 'shape': 'capsule', 'radius': 0.5, 'length': 1,
               'position': [40.0, 0.0, -1.0]}]
    start = [(x + dx, dy, 0.25) for x in (0.0, 10.0, 20.0, 30.0, 40.0)
             for dx, dy in ((0.0, 0.0), (0.5, 0.5), (0.5, 0.0), (1.0, 0.0))]
    sim = build(method, shapes, start, (0.0, 0.0, -2.0), gravity=WEIGHTLESS, eps=eps, dt=1 / 64)
    x, v, clear = track(sim, 64)
    return [outside(x, clear), at_most('speed gained / speed', speed(v) / 2.0 - 1.0, 64 * EPSILON)]


def start_inside(method, shape, place):
    """Start inside: a tenth of the depth a step, at most 10 m/s, is removed; no speed stays."""
    sim = build(method, [shape], place, gravity=WEIGHTLESS, eps=1.0)
    x, v, clear = track(sim, 400)
    left = [-clear[0, 0]]
    for _ in range(400):
        left.append(left[-1] - min(0.1 * left[-1], 10.0 * sim.dt))
    error = np.abs(clear[:, 0] + left)
    return [at_most('error of the depth / depth', error / left[0], 400 * 2 * EPSILON),
            at_most('speed that is kept / (m/s)', speed(v), 0.0),
            at_most('way in a step / (10 m/s dt)', speed(np.diff(x[:, 0], axis=0)) / sim.dt / 10.0,
                    1.0 + 1e-6)]


def bowl(method):
    """Swing in a bowl of 1 m for 20 s without friction: the energy does not grow."""
    sim = build(method, [sphere(inside=True)], (math.sin(1.0), 0.0, -math.cos(1.0)))
    x, v, clear = track(sim, 4800)
    energy = 0.5 * np.square(v[:, 0]).sum(axis=1) + G * (x[:, 0, 2] + 1.0)
    # the first two methods keep the speed N dt / 2m with which a step presses, N < 1.92 m g
    press = 0.5 * (1.92 * G * sim.dt / 2.0) ** 2
    return [at_most('energy gained / energy', energy / energy[0] - 1.0, press / energy[0]),
            outside(x, clear)]


def cases():
    """Give the cases of this module."""
    found = [Case(f'speed {v:g} m/s, oblique hit, {detection}',
                  partial(fast_hit, v=v, detection=detection))
             for v in (1e3, 1e8) for detection in ('end_of_step', 'trajectory')]
    found += [
        Case('speed 1e8 m/s, hollow cube of 2 m', partial(closed_room, v=1e8)),
        *(Case(f'wall of {h:g} m, 10 m a step, trajectory',
               partial(thin_wall, thickness=h, detection='trajectory')) for h in (1e-3, 1e-9)),
        *(Case(f'wall of {h:g} m, 10 m a step, end_of_step',
               partial(thin_wall, thickness=h, detection='end_of_step'), LOTTERY,
               absent=PATHS_ONLY) for h in (1e-3, 1e-9)),
        *(Case(f'wall of {ratio:g} v dt: noticed by chance', partial(lottery, ratio=ratio),
               absent=PATHS_ONLY) for ratio in (0.1, 0.5)),
        *(Case(f'room of 1e-9 m walls, {v:g} m/s, trajectory', partial(thin_room, v=v))
          for v in (1.0, 1e6)),
        *(Case(f'coordinates {far:g} m, rest', partial(far_rest, far=far)) for far in (1e6, 1e12)),
        *(Case(f'coordinates {far:g} m, drop', partial(far_bounce, far=far))
          for far in (1e6, 1e12)),
        *(Case(f'denormal speed {v:g} m/s', partial(tiny_speed, v=v)) for v in (1e-310, 1e-322)),
        *(Case(f'denormal lengths {gap:g} m', partial(tiny_lengths, gap=gap))
          for gap in (1e-310, 5e-324)),
        *(Case(f'wedge of {degrees:g} deg, gravity, eps {eps:g}',
               partial(fall_into_wedge, degrees=degrees, eps=eps))
          for degrees in (5.0, 0.5) for eps in (0.0, 0.5)),
        *(Case(f'wedge of {degrees:g} deg, eps 1, by images',
               partial(wedge_by_images, degrees=degrees)) for degrees in (7.0, 0.5)),
        *(Case(f'edges, vertices, axes, eps {eps:g}', partial(into_features, eps=eps))
          for eps in (0.0, 1.0)),
        *(Case(f'start {depth:g} m below a plane',
               partial(start_inside, shape=plane(), place=(0.0, 0.0, -depth)))
          for depth in (1e-9, 1.0, 1e6)),
        *(Case(f'start in the centre of a {name}',
               partial(start_inside, shape=shape, place=(0.0, 0.0, 0.0)))
          for name, shape in (('ball', sphere()), ('box', box()))),
        Case('bowl, 20 s without friction', bowl)]
    return found
