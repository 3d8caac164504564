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

"""Colliders moved by pose topics act on particles as the law says, jitter or not."""

from math import cos, pi, sin

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from harness import Driver, jittered_stamps  # noqa: E402, I100

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
G = 9.81
SEEDS = [0, 1, 2]


def scene(collider, position, gravity=(0.0, 0.0, 0.0), **laws):
    return {'gravity': list(gravity), 'particles': {'position': [list(position)]},
            'colliders': [{'name': 'moved', 'shape': 'box', 'topic': 'moved/pose', **collider}],
            **laws}


def stamps(duration, seed):
    return jittered_stamps(Driver.START, Driver.START + duration, seed=seed)


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('speed', [0.2, 2.0, 8.0])
def test_paddle_hits_a_resting_particle(drive, speed, seed):
    driver = drive(scene({'size': [0.1, 1.0, 1.0]}, (1.0, 0.0, 0.0), restitution=0.5))

    def pose(stamp):
        return (speed * (stamp - driver.START) - 0.1, 0.0, 0.0), UPRIGHT

    driver.run(0.5 + 1.3 / speed, {'moved': pose}, stamps(1.0 + 1.3 / speed, seed))
    velocity = driver.simulation.velocity[0]
    np.testing.assert_allclose(velocity, (1.5 * speed, 0.0, 0.0), rtol=0.01, atol=1e-9)
    assert driver.simulation.counters['collisions'] == 1


@pytest.mark.parametrize('seed', SEEDS)
def test_turning_paddle_hits_with_the_speed_at_its_tip(drive, seed):
    """A blade turns about z at 4 rad/s; a particle at 1 m is hit at right angles at 4 m/s."""
    driver = drive(scene({'size': [2.4, 0.02, 1.0]}, (0.0, 1.0, 0.0), restitution=0.5))

    def pose(stamp):
        angle = 4.0 * (stamp - driver.START)
        return (0.0, 0.0, 0.0), (0.0, 0.0, sin(angle / 2.0), cos(angle / 2.0))

    driver.run(0.6, {'moved': pose}, stamps(1.0, seed))
    velocity = driver.simulation.velocity[0]
    assert np.linalg.norm(velocity) == pytest.approx(6.0, rel=0.01)
    assert velocity[0] < -5.9


@pytest.mark.parametrize('seed', SEEDS)
def test_belt_carries_a_particle(drive, seed):
    speed = 0.5
    driver = drive(scene({'size': [40.0, 1.0, 0.2], 'position': [0.0, 0.0, -0.1]},
                         (0.0, 0.0, 0.0), (0.0, 0.0, -G), friction={'dry': 0.1}))

    def pose(stamp):
        return (speed * (stamp - driver.START), 0.0, -0.1), UPRIGHT

    driver.run(0.4, {'moved': pose}, all_stamps := stamps(5.0, seed))
    slipping = driver.simulation.velocity[0, 0]
    assert 0.0 < slipping < 0.9 * speed
    rest = [stamp for stamp in all_stamps if stamp + driver.LATENCY > driver.now]
    driver.run(2.0, {'moved': pose}, rest)
    velocity = driver.simulation.velocity[0]
    np.testing.assert_allclose(velocity, (speed, 0.0, 0.0), rtol=0.01, atol=1e-9)
    assert driver.simulation.position[0, 2] == pytest.approx(0.0, abs=1e-9)


def plate_gaps(driver, frequency, peak, seed):
    """Gap between the plate and the particle on it over some periods of a full swing [m]."""
    rate = 2.0 * pi * frequency
    amplitude = peak * G / rate ** 2

    def pose(stamp):
        time = stamp - driver.START
        swell = 0.5 - 0.5 * cos(pi * min(time / 3.0, 1.0))
        return (0.0, 0.0, swell * amplitude * sin(rate * time) - 0.1), UPRIGHT

    gaps = []

    def measure():
        plate, _ = driver.simulation.collider_pose('moved')
        gaps.append(driver.simulation.position[0, 2] - plate[2] - 0.1)

    driver.run(3.5, {'moved': pose}, all_stamps := stamps(8.0, seed))
    rest = [stamp for stamp in all_stamps if stamp + driver.LATENCY > driver.now]
    driver.run(4.0, {'moved': pose}, rest, measure)
    return np.array(gaps)


def free_gap(frequency, peak):
    """Largest gap of a particle that leaves the plate when its acceleration passes g [m]."""
    rate = 2.0 * pi * frequency
    amplitude = peak * G / rate ** 2
    time = np.linspace(0.0, 0.5 / frequency, 20001) + np.arcsin(1.0 / peak) / rate
    start = time[0]
    flight = (amplitude * sin(rate * start) + amplitude * rate * cos(rate * start) * (time - start)
              - 0.5 * G * (time - start) ** 2)
    return (flight - amplitude * np.sin(rate * time)).max()


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('frequency', [1.0, 2.0, 3.0])
@pytest.mark.parametrize('peak', [0.9, 1.1])
def test_particle_lifts_off_a_plate_beyond_g_only(drive, frequency, peak, seed):
    driver = drive(scene({'size': [1.0, 1.0, 0.2], 'position': [0.0, 0.0, -0.1]},
                         (0.0, 0.0, 0.0), (0.0, 0.0, -G)))
    gaps = plate_gaps(driver, frequency, peak, seed)
    assert gaps.min() > -1e-9
    if peak < 1.0:
        assert gaps.max() < 1e-6
    else:
        assert gaps.max() == pytest.approx(free_gap(frequency, peak), rel=0.5)


def test_teleport_has_no_impulse(drive):
    driver = drive(scene({'size': [0.2, 1.0, 1.0]}, (1.0, 0.0, 0.0), restitution=1.0))

    def pose(stamp):
        return (0.0 if stamp < driver.START + 0.5 else 2.0, 0.0, 0.0), UPRIGHT

    driver.run(1.0, {'moved': pose}, stamps(1.5, 0))
    assert not driver.simulation.velocity.any()
    assert driver.simulation.collider_pose('moved')[0][0] == 2.0


def test_returning_collider_flings_nothing(drive):
    """Poses stop for 2 s while the paddle comes nearer; then it is back beyond the particle."""
    driver = drive(scene({'size': [0.2, 1.0, 1.0]}, (2.0, 0.0, 0.0), restitution=1.0))

    def pose(stamp):
        time = stamp - driver.START
        return (0.5 * min(time, 1.0) + 2.0 * (time > 2.0), 0.0, 0.0), UPRIGHT

    times = [stamp for stamp in stamps(4.0, 0) if not 1.0 < stamp - driver.START < 3.0]
    fastest = 0.0

    def measure():
        nonlocal fastest
        fastest = max(fastest, np.linalg.norm(driver.simulation.velocity[0]))

    driver.run(4.0, {'moved': pose}, times, measure)
    assert fastest == 0.0


def test_a_stall_of_the_node_changes_little(drive):
    """The steps and poses of 0.4 s without a tick are played afterwards."""
    driver = drive(scene({'size': [0.1, 1.0, 1.0]}, (0.5, 0.0, 0.0), restitution=0.5))

    def pose(stamp):
        return (2.0 * (stamp - driver.START) - 0.1, 0.0, 0.0), UPRIGHT

    driver.run(0.2, {'moved': pose}, all_stamps := stamps(2.0, 0))
    rest = [stamp for stamp in all_stamps if stamp + driver.LATENCY > driver.now]
    time = driver.now
    driver.set_clock(time + 0.4)
    driver.run(0.4, {'moved': pose}, rest)
    np.testing.assert_allclose(driver.simulation.velocity[0, 0], 3.0, rtol=0.01)
    assert driver.simulation.time == pytest.approx(driver.now - driver.START, abs=0.01)
