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
Scenes whose answer is known in closed form, for the report of error against run time.

Each has many particles that differ in a speed, a height or an angle, so that their events fall on
all phases of a step. Numbers such as T39 are those of the project's list of reference cases.
"""

from math import inf, pi

from collision_sim.studies.case import (bounces, by_method, Case, columns, G, plane, scene, slide,
                                        spread)
from collision_sim.studies.pendulum import fall_time, swing
import numpy as np


def bounce(count):
    """T01: drops from different heights, several bounces."""
    height, eps = spread(count, 0.2, 0.4), 0.8

    def reference(times):
        z, v = bounces(times, height, eps)
        return columns(0.0, 0.0, z), columns(0.0, 0.0, v)
    return Case('bounce', 'Bounce train (T01), restitution 0.8',
                scene([plane()], columns(0.0, 0.0, height), restitution=eps), 1.2,
                reference, by_method(1.0), 'The time of a hit is wrong by O(dt).')


def incline_slide(count):
    """T14: down an incline of 30 degrees, from different speeds."""
    angle, mu, speed = pi / 6, 0.2, spread(count, 0.1, 1.0)
    down = np.array([-np.cos(angle), 0.0, -np.sin(angle)])
    pull = G * (np.sin(angle) - mu * np.cos(angle))

    def reference(times):
        t = times[:, None, None]
        path = speed[:, None] * t + 0.5 * pull * t ** 2
        return path * down, (speed[:, None] + pull * t) * down
    ramp = plane((-np.sin(angle), 0.0, np.cos(angle)))
    return Case('incline_slide', 'Slide down 30° (T14), µ = 0.2',
                scene([ramp], np.zeros((count, 3)), speed[:, None] * down, dry=mu), 1.1,
                reference, by_method(inf), 'Constant friction is integrated exactly; '
                'symplectic Euler falls with an error of O(dt).')


def incline_stick(count):
    """T16: held by friction on an incline, in spite of a restitution."""
    angle = pi / 6
    start = columns(0.0, spread(count, -1.0, 1.0), 0.0)

    def reference(times):
        return np.tile(start, (len(times), 1, 1)), np.zeros((len(times), count, 3))
    ramp = plane((-np.sin(angle), 0.0, np.cos(angle)))
    return Case('incline_stick', 'Rest on 30° (T16), µ = 1, restitution 0.5',
                scene([ramp], start, dry=1.0, restitution=0.5), 1.1, reference,
                by_method(inf, first_two=1.0, euler=inf),
                'The first two methods hop by O(dt²) a step, and creep by O(dt).')


def oblique(count):
    """T06, T07: thrown on the ground; some slide through the hit, some stick."""
    height, eps, mu = spread(count, 0.5, 1.0), 0.5, 0.3
    speed = spread(count, 0.5, 4.0, seed=1)
    fall = np.sqrt(2.0 * height / G)
    after = np.maximum(speed - mu * (1.0 + eps) * G * fall, 0.0)

    def reference(times):
        t = times[:, None]
        z, v = bounces(times, height, eps)
        hit = t > fall
        x = np.where(hit, speed * fall + after * (t - fall), speed * t)
        return columns(x, 0.0, z), columns(np.where(hit, after, speed), 0.0, v)
    return Case('oblique', 'Oblique hit with friction (T06, T07), µ = 0.3, restitution 0.5',
                scene([plane()], columns(0.0, 0.0, height), columns(speed, 0.0, 0.0), dry=mu,
                      restitution=eps), 0.62, reference, by_method(1.0),
                'The time of the hit is wrong by O(dt).')


def sphere_top(count):
    """T39: from rest down a ball without friction, off it, and through the air."""
    angle = spread(count, 0.1, 0.3)
    along = np.arccos(2.0 / 3.0 * np.cos(angle))
    leave = fall_time(angle, along)

    def reference(times):
        t = times[:, None]
        on, rate = swing(np.minimum(t, leave), np.cos(0.5 * angle), np.sin(0.5 * angle))
        on, rate, late = pi - on, -rate, np.maximum(t - leave, 0.0)
        v_x, v_z = rate * np.cos(on), -rate * np.sin(on) - G * late
        x = np.sin(on) + v_x * late
        return (columns(x, 0.0, np.cos(on) + v_z * late + 0.5 * G * late ** 2),
                columns(v_x, 0.0, v_z))
    ball = {'name': 'ball', 'shape': 'sphere', 'radius': 1.0}
    return Case('sphere_top', 'Off the top of a ball (T39), no friction',
                scene([ball], columns(np.sin(angle), 0.0, np.cos(angle))), 1.0, reference,
                by_method(1.0, second_order=2.0),
                'The normal turns by O(dt) during a step; `second_order_contact` takes both.')


def bowl(count):
    """T42: pendulums in a bowl without friction, all directions, different amplitudes."""
    angle, azimuth = spread(count, 0.6, 1.1), spread(count, 0.0, 2.0 * pi, seed=1)
    c, s = np.cos(azimuth), np.sin(azimuth)

    def reference(times):
        phi, rate = swing(times[:, None], np.sin(0.5 * angle), np.cos(0.5 * angle))
        out, speed = np.sin(phi), rate * np.cos(phi)
        return (columns(c * out, s * out, -np.cos(phi)),
                columns(c * speed, s * speed, rate * np.sin(phi)))
    start = columns(c * np.sin(angle), s * np.sin(angle), -np.cos(angle))
    shell = {'name': 'bowl', 'shape': 'sphere', 'radius': 1.0, 'inside': True}
    return Case('bowl', 'Swinging in a bowl (T42), no friction', scene([shell], start), 1.3,
                reference, by_method(1.0, second_order=2.0),
                'The normal turns by O(dt) during a step; `second_order_contact` takes both.')


def moving_wall(count):
    """T23: weightless, against a wall that oscillates: v' = V - eps (v - V)."""
    eps, amplitude, phase = 0.8, 0.05, 2.0 * pi * 1.3
    height, speed = spread(count, 0.4, 0.7), -2.0
    hit = np.full(count, 0.25)
    for _ in range(50):                 # Newton: h - 2 t = A sin(w t)
        gap = height + speed * hit - amplitude * np.sin(phase * hit)
        hit = hit - gap / (speed - amplitude * phase * np.cos(phase * hit))
    wall = amplitude * phase * np.cos(phase * hit)
    after = wall - eps * (speed - wall)

    def reference(times):
        t = times[:, None]
        late = np.maximum(t - hit, 0.0)
        z = height + speed * np.minimum(t, hit) + after * late
        return columns(0.0, 0.0, z), columns(0.0, 0.0, np.where(t > hit, after, speed))
    swings = {'oscillate': {'axis': [0, 0, 1], 'amplitude': amplitude, 'frequency': 1.3}}
    return Case('moving_wall', 'Wall that oscillates (T23), restitution 0.8',
                scene([plane(motion=swings)], columns(0.0, 0.0, height),
                      columns(0.0, 0.0, np.full(count, speed)), gravity=0.0, restitution=eps),
                0.5, reference, by_method(1.0), 'The time of the hit is wrong by O(dt).')


def conveyor(count):
    """T29: thrown on a belt in all directions; they slip until they ride along."""
    mu, belt = 0.4, np.array([1.0, 0.0, 0.0])
    slip, azimuth = spread(count, 0.5, 2.0), spread(count, 0.0, 2.0 * pi, seed=1)
    relative = slip[:, None] * columns(np.cos(azimuth), np.sin(azimuth), 0.0)
    start = np.zeros((count, 3))
    ground = plane(motion={'linear_velocity': belt.tolist()})
    return Case('conveyor', 'Belt of 1 m/s (T29), µ = 0.4',
                scene([ground], start, relative + belt, dry=mu), 0.6,
                slide(start, relative, mu * G, belt), by_method(2.0),
                'Slip and ride are exact, but in the step of the change the slip of µ g dt is '
                'wrong for less than dt.')


def turntable(count):
    """T31: riders on a turntable within mu g / omega^2, which all stick."""
    omega, mu = 2.0, 0.5
    radius, azimuth = spread(count, 0.1, 1.1), spread(count, 0.0, 2.0 * pi, seed=1)

    def reference(times):
        turn = azimuth + omega * times[:, None]
        c, s = radius * np.cos(turn), radius * np.sin(turn)
        return columns(c, s, 0.0), columns(-omega * s, omega * c, 0.0)
    start, velocity = (part[0] for part in reference(np.zeros(1)))
    table = plane(motion={'angular_velocity': [0.0, 0.0, omega]})
    return Case('turntable', 'Riding a turntable (T31), µ = 0.5',
                scene([table], start, velocity, dry=mu), 1.2, reference,
                by_method(inf, euler=inf), 'Friction takes riders along the chord of the step.')


def groove(count):
    """T55: along a groove of 60 degrees, whose two walls press 1 / sin(30 deg) times as much."""
    mu, half = 0.2, pi / 6
    speed = spread(count, 1.0, 3.0)
    start, velocity = np.zeros((count, 3)), columns(0.0, speed, 0.0)
    c, s = np.cos(half), np.sin(half)
    walls = [plane((c, 0.0, s), 'left'), plane((-c, 0.0, s), 'right')]
    return Case('groove', 'Along a groove of 60° (T55), µ = 0.2',
                scene(walls, start, velocity, dry=mu), 1.0,
                slide(start, velocity, mu * G / s), by_method(2.0),
                'Walls that are equally deep are answered together, and then as on the belt.')


def drag(count):
    """T68: drops that linear drag slows, bouncing."""
    k, eps, height = 2.0, 0.7, spread(count, 0.3, 0.6)
    wind = G / k

    def place(s, z, v):
        e = -np.expm1(-k * s) / k
        return z + (v + wind) * e - wind * s, (v + wind) * (1.0 - k * e) - wind

    def reference(times):
        t = times[:, None]
        start, z0, v0 = np.zeros(count), height, np.zeros(count)
        z, v = place(t, z0, v0)
        while (start < times[-1]).any():
            s = (z0 + (v0 + wind) / k) / wind + 1e-3        # below the ground: drag is over
            for _ in range(60):                             # Newton from there, z'' < 0
                depth, rate = place(s, z0, v0)
                s = s - depth / rate
            start, z0, v0 = start + s, np.zeros(count), -eps * rate
            later = place(np.maximum(t - start, 0.0), z0, v0)
            z, v = (np.where(t > start, new, old) for new, old in zip(later, (z, v)))
        return columns(0.0, 0.0, z), columns(0.0, 0.0, v)
    return Case('drag', 'Bounces with linear drag (T68), 2 /s, restitution 0.7',
                scene([plane()], columns(0.0, 0.0, height), restitution=eps,
                      drag={'linear': k}), 0.9, reference, by_method(1.0),
                'The time of a hit is wrong by O(dt).')


def small_ball(count):
    """Fast particles against a ball that they cross in 5 to 25 ms, as a thin wall (T73)."""
    radius, distance, eps = 0.05, 0.6, 0.9
    speed = spread(count, 4.0, 8.0)
    aside = radius * spread(count, -0.7, 0.7, seed=1)
    depth = np.sqrt(radius ** 2 - aside ** 2)
    hit = (distance - depth) / speed
    normal = columns(-depth, aside, 0.0) / radius
    before = columns(speed, 0.0, 0.0)
    after = before + (1.0 + eps) * (speed * depth / radius)[:, None] * normal

    def reference(times):
        t = times[:, None, None]
        first = np.minimum(t, hit[:, None])
        x = columns(-distance, aside, 0.0) + before * first + after * (t - first)
        return x, np.where(t > hit[:, None], after, before)
    ball = {'name': 'ball', 'shape': 'sphere', 'radius': radius}
    return Case('small_ball', 'Fast against a small ball (T73), restitution 0.9',
                scene([ball], columns(-distance, aside, 0.0), before, gravity=0.0,
                      restitution=eps), 0.3, reference, by_method(1.0),
                'Time and normal of the hit are wrong by O(dt); `end_of_step` misses the ball '
                'where a step is longer than the ball.', lost=0.5)


FLYING = (bounce, oblique, moving_wall, drag, small_ball)
TOUCHING = (incline_slide, incline_stick, sphere_top, bowl, conveyor, turntable, groove)
SLOWER = 4                  # a particle in contact takes more run time than one that flies


def all_cases(count):
    """
    Make all cases.

    Parameters
    ----------
    count : int
        Particles that fly; of those that are mostly in contact there are SLOWER times less.

    Returns
    -------
    list of Case

    """
    return [make(count) for make in FLYING] + [make(count // SLOWER) for make in TOUCHING]
