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
Stability: colliders that move fast, turn many times in a step, close on a particle or teleport.

V is the velocity of a collider; what it gives to a particle is bounded by that.
"""

from functools import partial
import math

from collision_sim.studies.stability_cases import (at_most, box, build, Case, Check, EPSILON,
                                                   outside, plane, speed, sphere, track, UPRIGHT,
                                                   WEIGHTLESS)
import numpy as np

TURN = 50.0             # rad in a step
ANSWERS = 14            # most collisions and contacts of a particle in a step


def drifting(velocity, **keys):
    """Give the ground with a constant velocity."""
    return plane(motion={'linear_velocity': list(velocity)}, **keys)


def turning(rate):
    """Motion about the z axis [rad/s]."""
    return {'angular_velocity': [0.0, 0.0, rate]}


def together(method, v):
    """Move particle and wall at the same speed, 1 mm apart: nothing touches."""
    sim = build(method, [drifting((0.0, 0.0, v))], (0.0, 0.0, 1e-3), (0.0, 0.0, v),
                gravity=WEIGHTLESS, dt=1e-3)
    sim.step(1000)
    return [Check('answers', sum(sim.counters.values()), 0),
            Check('change of v / (m/s)', abs(sim.velocity[0, 2] - v), 0.0),
            Check('change of the gap / m', abs(sim.clearance()[0] - 1e-3), 1000 * EPSILON * v)]


def fast_wall(method, v, eps):
    """Hit a particle at rest by a wall with V: v' = (1 + eps) V."""
    sim = build(method, [drifting((0.0, 0.0, v))], (0.0, 0.0, 1.0), gravity=WEIGHTLESS, eps=eps)
    sim.step(3 + int(1.0 / (v * sim.dt)))
    return [Check('error of v / V', abs(sim.velocity[0, 2] / v - 1.0 - eps), 8 * EPSILON),
            outside(sim.position, sim.clearance())]


def jump(method, way):
    """Let a pose jump in one step: a fast wall that nobody gets through, v = way / dt."""
    sim = build(method, [plane(point=(0.0, 0.0, -0.5 * way))], (0.0, 0.0, 0.0),
                gravity=WEIGHTLESS)
    sim.move_collider('ground', (0.0, 0.0, 0.5 * way), UPRIGHT)
    sim.step()
    return [Check('relative error of v', abs(sim.velocity[0, 2] * sim.dt / way - 1.0), 1e-12),
            outside(sim.position, sim.clearance())]


def squeeze(method, v, steps):
    """Close two plates on a particle: outside of both until they touch, then noted."""
    lid = plane((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), name='lid',
                motion={'linear_velocity': [0.0, 0.0, -v]})
    sim = build(method, [drifting((0.0, 0.0, v)), lid], (0.0, 0.0, 0.4), gravity=WEIGHTLESS,
                dry=0.4, dt=0.5 / v / steps)
    noted = []

    def note(step):
        noted.append(sim.counters['unplaced'])
    x, velocity, clear = track(sim, int(2 * steps) + 2, note)
    before = noted.count(0)     # states before the step in which it is noted
    return [at_most('speed / that of the plates', speed(velocity) / v, 1.0 + 1e-12),
            outside(x[:before], clear[:before]),
            Check('steps from the touch to the note', abs(before - steps), 2),
            at_most('places not finite', np.count_nonzero(~np.isfinite(x)), 0)]


def teleports(method, reach):
    """Put a ball somewhere else before each step, often over the particle: no speed."""
    sim = build(method, [sphere(0.5, (0.0, 0.0, 9.0))], (0.0, 0.0, 0.0), gravity=WEIGHTLESS,
                eps=1.0, dry=0.5)
    random = np.random.default_rng(4)

    def place(step):
        far = reach if step % 2 else 0.4
        sim.place_collider('ball', sim.position[0] + random.uniform(-far, far, 3), UPRIGHT)
    x, v, _ = track(sim, 1000, place)
    return [at_most('speed / (m/s)', speed(v), 0.0),
            at_most('way in a step / (10 m/s dt)', speed(np.diff(x[:, 0], axis=0)) / sim.dt / 10.0,
                    1.0 + 1e-6),
            Check('steps with repulsion short of 100', 100 - sim.counters['repulsions'], 0)]


def blade(method):
    """
    Turn a blade by 50 rad in a step: it hits where it first comes, not turns later.

    A particle at rest at the polar angle a is hit when the blade, h thick, has turned to
    a - asin(h / 2 rho), by angle arithmetic.
    """
    dt, thickness, rho, errors = 0.1, 1e-3, 0.5, []
    for polar in (0.4, 2.0, 3.5, 6.0):
        start = (rho * math.cos(polar), rho * math.sin(polar), 0.0)
        sim = build(method, [box((2.0, thickness, 1.0), motion=turning(TURN / dt))], start,
                    gravity=WEIGHTLESS, eps=1.0, dt=dt, detection='trajectory')
        sim.step()
        at_hit = polar % math.pi - math.asin(0.5 * thickness / rho)
        normal = np.array((-math.sin(at_hit), math.cos(at_hit), 0.0))
        found = sim.contacts.normal[:1] * (1.0 if polar < math.pi else -1.0)
        errors.append(np.max(np.abs(found - normal), initial=0.0 if len(found) else math.inf))
    return [at_most('error of the first normal', errors, 1e-9),
            Check('undecided paths', sim.counters['undecided'], 0)]


def rotor(method, detection):
    """Turn a blade by 50 rad in a step among particles: outside, no faster than it makes."""
    random, dt = np.random.default_rng(5), 1 / 240
    start = random.uniform(-1.5, 1.5, (30, 3)) * (1.0, 1.0, 0.3)
    start = start[np.abs(start[:, 1]) > 0.06]
    sim = build(method, [box((2.0, 0.1, 1.0), motion=turning(TURN / dt))], start,
                random.normal(size=start.shape), gravity=WEIGHTLESS, eps=0.5, dry=0.3, dt=dt,
                detection=detection)
    x, v, clear = track(sim, 30)
    tip = TURN / dt * math.hypot(1.0, 0.05)
    gained = np.diff(speed(v), axis=0)
    return [at_most('speed gained in a step / most', gained / (2.0 * ANSWERS * tip), 1.0),
            outside(x, clear)]


def drum(method):
    """Turn a drum by 50 rad in a step: nobody gets faster than rim and start together."""
    random, dt, radius = np.random.default_rng(6), 1 / 240, 1.0
    start = random.uniform(-0.6, 0.6, (30, 3))
    velocity = 10.0 * random.normal(size=start.shape)
    hollow = {'name': 'drum', 'shape': 'cylinder', 'radius': radius, 'length': 2.0,
              'inside': True, 'motion': turning(TURN / dt)}
    sim = build(method, [hollow], start, velocity, gravity=WEIGHTLESS, eps=0.5, dry=0.5, dt=dt)
    x, v, clear = track(sim, 50)
    most = np.hypot(speed(velocity), TURN / dt * radius)
    return [at_most('speed / most', speed(v) / most, 1.0 + 1e-9), outside(x, clear)]


def turntable(method, turn, steps):
    """Stick to a turntable: the radius is kept, to rounding a step."""
    sim = build(method, [plane(motion=turning(240.0 * turn))], (0.5, 0.0, 0.0),
                (0.0, 0.5 * 240.0 * turn, 0.0), dry=1e308)
    sim.step(steps)
    radius = math.hypot(*sim.position[0, :2])
    return [Check('change of the radius / m', abs(radius - 0.5), steps * 2 * EPSILON),
            outside(sim.position, sim.clearance())]


def belt(method):
    """Stick to a belt for 1e6 steps: its way to rounding a step, its velocity to rounding."""
    steps = 1_000_000
    sim = build(method, [drifting((1.0, 0.0, 0.0))], (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), dry=0.4,
                dt=1 / 256)
    sim.step(steps)
    return [Check('way on the belt / m', abs(sim.position[0, 0] - sim.time),
                  steps * EPSILON * sim.time),
            Check('speed on the belt / (m/s)', abs(sim.velocity[0, 0] - 1.0), 1e-12),
            Check('height / m', abs(sim.position[0, 2]), 0.0)]


def shaker(method):
    """Shake a plate by 1 mm at 10 kHz, many times a step: outside, no faster than it."""
    frequency, amplitude = 1.00123e4, 1e-3
    swing = {'axis': [0, 0, 1], 'amplitude': amplitude, 'frequency': frequency}
    sim = build(method, [plane(motion={'oscillate': swing})], (0.0, 0.0, 2e-3), eps=0.5)
    x, v, clear = track(sim, 2000)
    most = 2.0 * math.pi * frequency * amplitude
    gained = np.diff(speed(v), axis=0)
    return [at_most('speed gained in a step / most', gained / (2.0 * ANSWERS * most), 1.0),
            outside(x, clear)]


def galilean(method, v):
    """Add a velocity to everything: the same relative places, to rounding a step."""
    steps, places = 480, [(0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.5, 0.0, 0.3)]
    velocities = np.array([(1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 1.0, -2.0)])
    rest = build(method, [drifting((0.0, 0.0, 0.0))], places, velocities, eps=0.5, dry=0.3)
    copy = build(method, [drifting((v, 0.0, 0.0))], places, velocities + (v, 0.0, 0.0), eps=0.5,
                 dry=0.3)
    rest.step(steps)
    copy.step(steps)
    moved = copy.position - (v * copy.time, 0.0, 0.0)
    return [at_most('difference of a place / m', np.abs(moved - rest.position),
                    1e-14 + 2 * steps * EPSILON * v * copy.time)]


def cases():
    """Give the cases of this module."""
    return [
        Case('wall and particle together at 1e8 m/s', partial(together, v=1e8)),
        *(Case(f'wall of 1e8 m/s, eps {eps:g}', partial(fast_wall, v=1e8, eps=eps))
          for eps in (0.0, 1.0)),
        *(Case(f'pose jumps {way:g} m in a step', partial(jump, way=way)) for way in (1.0, 1e6)),
        Case('plates close at 1 m/s', partial(squeeze, v=1.0, steps=128)),
        Case('plates close at 1e6 m/s', partial(squeeze, v=1e6, steps=128)),
        Case('plates close in half a step', partial(squeeze, v=1.0, steps=0.5)),
        *(Case(f'ball teleports {reach:g} m', partial(teleports, reach=reach))
          for reach in (1.0, 1e12)),
        Case('blade turns 50 rad a step, trajectory', blade),
        *(Case(f'rotor turns 50 rad a step, {detection}', partial(rotor, detection=detection))
          for detection in ('end_of_step', 'trajectory')),
        Case('drum turns 50 rad a step', drum),
        Case('turntable, 50 rad a step', partial(turntable, turn=50.0, steps=10_000)),
        Case('turntable, rest 1e6 steps', partial(turntable, turn=0.01, steps=1_000_000)),
        Case('belt, rest 1e6 steps', belt),
        Case('plate shakes at 10 kHz', shaker),
        Case('everything carried at 1e6 m/s', partial(galilean, v=1e6))]
