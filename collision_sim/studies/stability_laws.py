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
Stability: friction, restitution, drag and the length of the step, up to their extremes.

One particle and planes, against closed forms. eps is the restitution, mu and D the coefficients of
dry and wet friction, v_N and v_T the normal and tangential velocity.
"""

from functools import partial
import math

from collision_sim.studies.stability_cases import (at_most, build, Case, Check, EPSILON, FIRST_TWO,
                                                   G, GAINS, HOPS, incline, outside, plane, speed,
                                                   track, WEIGHTLESS)
import numpy as np

MILLION = 1_000_000
OBLIQUE = (3.0, 0.0, -4.0)      # v_T = 3, v_N = -4: with eps = 1/2 the change of v_N is 6 m/s
WET_FACTORS = {'exponential': lambda s: math.exp(-s), 'capped': lambda s: max(0.0, 1.0 - s),
               'linear': lambda s: 1.0 - s}


def oblique_hit(method, **friction):
    """Give the velocity after an oblique hit with eps = 1/2, without gravity."""
    sim = build(method, [plane()], (0.0, 0.0, 1e-3), OBLIQUE, gravity=WEIGHTLESS, eps=0.5,
                **friction)
    sim.step()
    return sim.velocity[0]


def wet(method, form, strength):
    """Hit once with D |dv_N| = strength, and slide 100 steps with D g dt = strength."""
    after = oblique_hit(method, wet=strength / 6.0, form=form)[0]
    hit = 3.0 * WET_FACTORS[form](strength)
    steps, v0 = 100, 2.0
    sim = build(method, [plane()], (0.0, 0.0, 0.0), (v0, 0.0, 0.0), wet=strength * 240.0 / G,
                form=form)
    v = track(sim, steps)[1][:, 0, 0]
    with np.errstate(over='ignore', invalid='ignore'):
        wrong = [0.0, -after, after - 3.0, *-v, *np.diff(np.abs(v))]
    # the first step of some methods presses by half; 1 - s <= e^-s
    slowest = v0 * math.exp(-strength * (steps - 0.5))
    checks = [at_most('speed backwards or gained / (m/s)', wrong, 0.0),
              Check('error of v_T after a hit / (m/s)', abs(after - hit),
                    48 * EPSILON * max(1.0, abs(hit)))]
    if form != 'linear':
        checks.append(Check('v above v0 exp(-D g t) / (m/s)', v[-1] - slowest, 1e-13))
    return checks


def dry(method, mu):
    """Hit obliquely: it slides or sticks by the law; and straight: it does not slip."""
    after = oblique_hit(method, dry=mu)[0]
    sim = build(method, [plane()], (0.0, 0.0, 1e-3), (0.0, 0.0, -4.0), gravity=WEIGHTLESS,
                eps=0.5, dry=mu)
    sim.step()
    return [Check('error of v_T after a hit / (m/s)', abs(after - max(0.0, 3.0 - 6.0 * mu)),
                  0.0 if mu >= 0.5 else 48 * EPSILON),
            at_most('v_T of a straight hit / (m/s)', np.abs(sim.velocity[0, :2]), 0.0)]


def rest(method, angle, mu, eps, steps, gravity=G):
    """Release at rest on an incline that holds the particle: it never moves."""
    sim = build(method, [incline(angle)], (0.0, 0.0, 0.0), dry=mu, eps=eps,
                gravity=(0.0, 0.0, -gravity))
    sim.step(steps)
    return [Check('way / m', float(speed(sim.position[0])), 0.0)]


def knife_edge(method):
    """Release at mu = tan(30 deg) (1 +- 1e-9): sticks above, slides with g sin 1e-9 below."""
    angle, duration, ways = math.pi / 6, 10.0, []
    for mu in (math.tan(angle) * (1.0 + 1e-9), math.tan(angle) * (1.0 - 1e-9)):
        sim = build(method, [incline(angle)], (0.0, 0.0, 0.0), dry=mu)
        sim.advance(duration)
        ways.append(float(speed(sim.position[0])))
    exact = 0.5 * G * math.sin(angle) * 1e-9 * duration ** 2
    return [Check('way where it sticks / m', ways[0], 0.0),
            Check('relative error where it slides', abs(ways[1] / exact - 1.0), 1e-4)]


def slide_and_rest(method):
    """Slide with mu = 0.3: it stops after v0^2 / (2 mu g), then stays for 1e6 steps."""
    sim = build(method, [plane()], (0.0, 0.0, 0.0), (2.0, 0.0, 0.0), dry=0.3)
    sim.advance(1.0)
    stop = sim.position[0].copy()
    sim.step(MILLION)
    return [Check('way in 1e6 steps at rest / m', float(speed(sim.position[0] - stop)), 0.0),
            # the last step slides with at most mu g dt / 2 for dt
            Check('error of the stopping distance / m', abs(stop[0] - 0.679578661230037377),
                  0.3 * G * sim.dt ** 2 / 8)]


def no_friction(method):
    """Bounce without friction: v_T is bit-identical after 1e5 bounces."""
    sim = between_plates(method, 1.0, (0.1, 1 / 3, 60.0), 100_000)
    return [at_most('change of v_T / (m/s)', np.abs(sim.velocity[0, :2] - (0.1, 1 / 3)), 0.0)]


def between_plates(method, eps, velocity, bounces):
    """Bounce between two plates, 1 m apart, at least so many times; 5 steps for each at most."""
    lid = plane((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), name='lid')
    sim = build(method, [plane(), lid], (0.0, 0.0, 0.3), velocity, gravity=WEIGHTLESS, eps=eps)
    while sim.counters['collisions'] < bounces and sim.time / sim.dt < 5 * bounces:
        sim.step(bounces // 10)
    return sim


def many_bounces(method, eps):
    """Bounce 1e6 times between two plates: v0 eps^n, without a drift."""
    sim = between_plates(method, eps, (0.0, 0.0, 60.0), MILLION)
    count = sim.counters['collisions']
    exact = math.exp(count * math.log(eps))
    # each bounce rounds 1 + eps, its product with v, and the sum
    bound = 0.0 if eps == 1.0 else 3 * EPSILON * count
    return [Check('relative error of the speed', abs(abs(sim.velocity[0, 2]) / 60.0 - exact),
                  bound),
            Check('bounces short of 1e6', MILLION - count, 0)]


def inelastic(method, eps):
    """Bounce 1000 particles a thousand times: eps v each; and rest for 1e6 steps."""
    count = 1000
    velocity = np.linspace((0.0, 0.0, -1.0), (0.0, 0.0, -1e3), count)
    sim = build(method, [plane()], np.zeros((count, 3)), velocity, gravity=WEIGHTLESS, eps=eps)
    worst = []
    for _ in range(count):
        sim.position[:], sim.velocity[:] = (0.0, 0.0, 1e-3), velocity
        sim.step()
        worst.append(np.max(np.abs(sim.velocity[:, 2] / velocity[:, 2] + eps)))
    drop = build(method, [plane()], (0.0, 0.0, 1.0), eps=eps)
    drop.advance(1.0)
    place = drop.position[0].copy()
    drop.step(MILLION)
    return [at_most('error of the speed / speed', worst, 2 * EPSILON),
            Check('way in 1e6 steps at rest / m', float(speed(drop.position[0] - place)), 0.0),
            Check('gap at rest / m', abs(place[2]), G * drop.dt ** 2)]


def elastic_fall(method):
    """Bounce 1e6 times under gravity with eps = 1, three steps each: the energy stays."""
    steps = 3_500_000
    sim = build(method, [plane()], (0.0, 0.0, 1.3), eps=1.0, dt=0.3)
    energy = sim.energy()
    sim.step(steps)
    changes = []
    for _ in range(100):
        sim.step()
        changes.append(abs(sim.energy() / energy - 1.0))
    checks = [at_most('relative change of the energy', changes, steps * EPSILON)]
    if method not in FIRST_TWO:     # they bounce ever higher, and so less often
        checks.append(Check('bounces short of 1e6', MILLION - sim.counters['collisions'], 0))
    return checks


def bounces_die_out(method, eps):
    """Bounce until the end of all bounces at t1 (1 + eps) / (1 - eps): then it rests."""
    sim = build(method, [plane()], (0.0, 0.0, 1.0), eps=eps, dt=1e-2)
    sim.advance(1.1 * math.sqrt(2.0 / G) * (1.0 + eps) / (1.0 - eps))
    x, _, clear = track(sim, 100)
    return [Check('range of the height at rest / m', float(np.ptp(x[:, 0, 2])), 0.0),
            outside(x, clear)]


def step_length(method, dt):
    """Slide with mu = 0.3 at any dt: v0 t - mu g t^2 / 2, up to the stop."""
    v0, slower = 2.0, 0.3 * G
    sim = build(method, [plane()], (0.0, 0.0, 0.0), (v0, 0.0, 0.0), dry=0.3, dt=dt)
    sim.step(20_000)
    t = min(sim.time, v0 / slower)
    exact = v0 * t - 0.5 * slower * t * t
    # with v = f mu g dt at the start of the last step it slides f - 1/2, not f^2 / 2: 1/8 at most
    last = min(slower * dt ** 2 / 8, exact) if t < sim.time else 0.0
    rounding = 20_000 * 2 * EPSILON * exact
    return [Check('error of the way / m', abs(sim.position[0, 0] - exact), last + rounding),
            Check('way beyond the exact one / m', sim.position[0, 0] - exact, rounding),
            Check('speed backwards / (m/s)', -sim.velocity[0, 0], 0.0)]


def drop(method, dt):
    """Drop with eps = 1/2 at any dt: never more energy than at the start."""
    sim = build(method, [plane()], (0.0, 0.0, 1.0), eps=0.5, dt=dt)
    x, v, clear = track(sim, 1000)
    energy = 0.5 * np.square(v[:, 0]).sum(axis=1) + G * x[:, 0, 2]
    return [at_most('energy gained / energy', energy / G - 1.0, 1000 * EPSILON),
            outside(x, clear)]


def drag_fall(method, dt):
    """Fall with k = 1e9 /s: v = -(g / k) (1 - exp(-k t)) at any dt, and z by its integral."""
    k = 1e9
    sim = build(method, [plane(point=(0.0, 0.0, -10.0))], (0.0, 0.0, 0.0), dt=dt,
                drag={'linear': k})
    sim.step(5)
    t = sim.time
    exact = G / k * math.expm1(-k * t)
    way = -G / k * (t + math.expm1(-k * t) / k)
    return [Check('relative error of the speed', abs(sim.velocity[0, 2] / exact - 1.0), 1e-12),
            Check('error of the way / m', abs(sim.position[0, 2] - way), 1e-22 + 1e-12 * -way)]


def drag_bounce(method, speed_at_start):
    """Hit the ground with k = 1e9 /s, eps = 1: up to v / k; gravity feeds g / k at most."""
    sim = build(method, [plane()], (0.0, 0.0, 1e-10), (1.0, 0.0, -speed_at_start), eps=1.0,
                drag={'linear': 1e9})
    x, v, clear = track(sim, 300)
    return [at_most('speed gained in a step / (m/s)', np.diff(speed(v[:, 0])), 1.001 * G / 1e9),
            Check('error of the height / m', abs(x[1, 0, 2] - speed_at_start / 1e9), 1e-9),
            outside(x, clear)]


def cases():
    """Give the cases of this module."""
    found = []
    for form in WET_FACTORS:
        for strength in (1e-20, 1e-3, 1.0, 2.5, 1e3, 1e9):
            flaw = 'the explicit form reverses where D |dv_N| > 1 and grows where it is > 2' \
                if form == 'linear' and strength > 1.0 else ''
            found.append(Case(f'wet {form}, D|dv_N| = {strength:g}',
                              partial(wet, form=form, strength=strength), flaw))
    found += [Case(f'dry, mu = {mu:g}', partial(dry, mu=mu))
              for mu in (0.0, 1e-300, 0.1, 0.5, 1e9, 1e308)]
    found += [
        Case('dry, mu = 0: v_T over 1e5 bounces', no_friction),
        Case('dry, mu = tan(30 deg) (1 +- 1e-9)', knife_edge),
        Case('dry, slide to a stop, rest 1e6 steps', slide_and_rest),
        Case('rest 1e6 steps, incline 30 deg, eps 0',
             partial(rest, angle=math.pi / 6, mu=1.0, eps=0.0, steps=MILLION)),
        Case('rest 1e6 steps, incline 30 deg, eps 0.5',
             partial(rest, angle=math.pi / 6, mu=1.0, eps=0.5, steps=MILLION), HOPS, FIRST_TWO),
        Case('rest 1e6 steps, plane, eps 1',
             partial(rest, angle=0.0, mu=0.0, eps=1.0, steps=MILLION), HOPS, FIRST_TWO),
        Case('rest, incline 89 deg, mu = 1e308',
             partial(rest, angle=math.radians(89.0), mu=1e308, eps=0.0, steps=10_000)),
        Case('rest, incline 30 deg, g = 1e9 m/s^2',
             partial(rest, angle=math.pi / 6, mu=1.0, eps=0.0, steps=10_000, gravity=1e9)),
        *(Case(f'eps = {eps:g}, 1e6 bounces', partial(inelastic, eps=eps))
          for eps in (0.0, 1e-300)),
        Case('eps = 1 - 1e-12, 1e6 bounces', partial(many_bounces, eps=1.0 - 1e-12)),
        Case('eps = 1, 1e6 bounces', partial(many_bounces, eps=1.0)),
        Case('eps = 1, 1e6 bounces, gravity', elastic_fall, GAINS, FIRST_TWO)]
    found += [Case(f'eps = {eps:g}, bounces die out', partial(bounces_die_out, eps=eps),
                   GAINS, FIRST_TWO) for eps in (0.5, 0.999)]
    steps = (1e-9, 1e-6, 1e-3, 0.1, 10.0)
    found += [Case(f'dt = {dt:g} s, slide', partial(step_length, dt=dt)) for dt in steps]
    found += [Case(f'dt = {dt:g} s, drop with eps 0.5', partial(drop, dt=dt),
                   GAINS if dt > 1.0 else '', FIRST_TWO) for dt in steps]
    found += [Case(f'drag 1e9 /s, fall, dt = {dt:g} s', partial(drag_fall, dt=dt))
              for dt in (1e-9, 1 / 240, 10.0)]
    found += [Case(f'drag 1e9 /s, bounce, v = {v:g} m/s', partial(drag_bounce, speed_at_start=v))
              for v in (0.0, 1e8)]
    return found
