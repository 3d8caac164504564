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

"""Tests of the pose stream: exactness, smoothness, order, late, lost and refused poses."""

from math import cos, nan, pi, sin

from collision_sim.core.pose_play import CAPACITY, KEPT
from collision_sim.core.pose_stream import PoseError, PoseStream
import numpy as np
import pytest

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
STEP = 1.0 / 240.0


def product(p, q):
    px, py, pz, pw = p
    qx, qy, qz, qw = q
    return np.array([pw * qx + px * qw + py * qz - pz * qy, pw * qy - px * qz + py * qw + pz * qx,
                     pw * qz + px * qy - py * qx + pz * qw, pw * qw - px * qx - py * qy - pz * qz])


def turned(vector, start=UPRIGHT):
    """Orientation of `start` turned by a rotation vector in the world frame."""
    vector = np.asarray(vector, dtype=float)
    angle = np.linalg.norm(vector)
    if angle == 0.0:
        return np.array(start, dtype=float)
    axis = np.append(vector * sin(angle / 2.0) / angle, cos(angle / 2.0))
    return product(axis, start)


def jittered(rate, duration, seed=0, jitter=5e-3):
    rng = np.random.default_rng(seed)
    count = int(rate * duration)
    return np.arange(count) / rate + rng.uniform(-jitter, jitter, count)


def play(stream, stamps, pose, until, latency=2e-3, tick=4, begin=0.0):
    """Feed poses as they would arrive, sample each tick; times and track of all steps."""
    arrivals = list(zip(stamps + latency, stamps))
    times, tracks = [], []
    for k in range(int(round((until - begin) / (tick * STEP)))):
        now = begin + k * tick * STEP
        while arrivals and arrivals[0][0] <= now:
            stamp = arrivals.pop(0)[1]
            stream.add(stamp, *pose(stamp))
        if stream.newest is not None:
            times.append(now + STEP * np.arange(1 - tick, 1))
            tracks.append(stream.sample(times[-1]))
    return np.concatenate(times), [np.concatenate(part) for part in zip(*tracks)]


def along_x(function):
    return lambda time: ((function(time), 0.0, 0.0), UPRIGHT)


# --- exactness -------------------------------------------------------------------------------


@pytest.mark.parametrize('rate, spin', [(10, 9.0), (30, 0.0), (30, 13.0), (100, 90.0)])
def test_constant_twist_is_exact(rate, spin):
    velocity, axis = np.array([1.0, -2.0, 0.5]), np.array([0.36, 0.48, 0.8])
    tilted = turned((0.3, 0.2, -1.0))

    def pose(time):
        return velocity * time, turned(spin * time * axis, tilted)

    stream = PoseStream(delay=3.0 / rate)
    stamps = jittered(rate, 2.0, jitter=0.15 / rate)
    times, (position, orientation, twist, teleport) = play(stream, stamps, pose, 1.9)
    moving = times - stream.bounds.delay > stamps[0]
    times = times[moving] - stream.bounds.delay
    expected = np.array([pose(time)[1] for time in times])
    np.testing.assert_allclose(position[moving], np.outer(times, velocity), atol=1e-13)
    np.testing.assert_allclose(np.abs(np.einsum('ij,ij->i', orientation[moving], expected)), 1.0,
                               atol=1e-13)
    np.testing.assert_allclose(twist[moving], np.tile(np.append(velocity, spin * axis),
                                                      (len(times), 1)), rtol=1e-11, atol=1e-11)
    assert teleport.nonzero()[0].tolist() == [0]


def test_curve_goes_through_every_pose():
    def pose(time):
        return (sin(9 * time), cos(5 * time), time ** 2), turned((sin(6 * time), time, 0.3))

    stream, stamps = PoseStream(delay=0.0), jittered(30, 1.0)
    for stamp in stamps:
        stream.add(stamp, *pose(stamp))
    track = stream.sample(stamps)
    for k, stamp in enumerate(stamps):
        position, orientation = pose(stamp)
        np.testing.assert_allclose(track.position[k], position, atol=1e-14)
        assert abs(track.orientation[k] @ orientation) == pytest.approx(1.0, abs=1e-14)


def test_signs_of_quaternions_do_not_matter():
    streams = PoseStream(delay=0.0), PoseStream(delay=0.0)
    for k in range(10):
        orientation = turned((0.0, 0.2 * k, 0.1))
        streams[0].add(k / 30.0, (0, 0, 0), orientation)
        streams[1].add(k / 30.0, (0, 0, 0), orientation * (-1) ** k)
    times = np.linspace(0.0, 0.3, 50)
    tracks = [stream.sample(times) for stream in streams]
    for one, other in zip(*tracks):
        np.testing.assert_array_equal(one, other)


# --- smoothness and order --------------------------------------------------------------------


def rocking(time):
    return ((sin(7 * time), 0.2 * cos(11 * time), 0.0),
            turned((0.8 * sin(5 * time), 0.4 * cos(8 * time), 2.0 * time)))


def test_twist_is_continuous_and_the_derivative_of_the_pose():
    stream, stamps = PoseStream(delay=0.0), jittered(30, 1.0)
    for stamp in stamps:
        stream.add(stamp, *rocking(stamp))
    tiny = 1e-7
    times = np.sort(np.concatenate([stamps[3:-3] - tiny, stamps[3:-3] + tiny]))
    _, _, twist, _ = stream.sample(times)
    assert np.abs(twist[1::2] - twist[::2]).max() < 1e-4        # 200 m/s^2 times 2 tiny

    other = PoseStream(delay=0.0)
    for stamp in stamps:
        other.add(stamp, *rocking(stamp))
    middle = np.linspace(0.2, 0.8, 40)
    h = 1e-5
    position, orientation, twist, _ = other.sample((middle[:, None] + (-h, 0.0, h)).ravel())
    np.testing.assert_allclose((position[2::3] - position[::3]) / (2 * h), twist[1::3, :3],
                               atol=1e-6)
    for a, b, angular in zip(orientation[::3], orientation[2::3], twist[1::3, 3:]):
        turn = product(b, a * (-1, -1, -1, 1))
        np.testing.assert_allclose(turn[:3] * np.sign(turn[3]) / h, angular, atol=1e-5)


def largest_errors(rate):
    stream = PoseStream(delay=3.0 / rate)
    times, (position, orientation, _, _) = play(
        stream, jittered(rate, 3.0, jitter=0.15 / rate), rocking, 2.8, latency=0.0, tick=1)
    late = times - stream.bounds.delay > 1.0
    expected = [rocking(time) for time in times[late] - stream.bounds.delay]
    shift = np.abs(position[late] - [pose[0] for pose in expected]).max()
    turn = max(np.linalg.norm(product(a, b[1] * (-1, -1, -1, 1))[:3])
               for a, b in zip(orientation[late], expected))
    return shift, 2.0 * turn


def test_fourth_order_in_the_time_between_stamps():
    coarse, fine = np.array(largest_errors(20)), np.array(largest_errors(80))
    order = np.log(coarse / fine) / np.log(4.0)
    assert (order > 3.5).all(), order


@pytest.mark.parametrize('frequency, bound', [(1.0, 0.02), (2.0, 0.04), (3.0, 0.10)])
def test_acceleration_of_an_oscillating_plate(frequency, bound):
    rate = 2.0 * pi * frequency
    pose = along_x(lambda time: 9.81 / rate ** 2 * sin(rate * time))
    worst = 0.0
    for seed in range(4):
        stream = PoseStream()
        times, (position, _, _, _) = play(stream, jittered(30, 5.0, seed), pose, 4.9)
        exact = np.array([pose(time)[0] for time in times - stream.bounds.delay])
        error = np.diff(position - exact, 2, axis=0)[240:] / STEP ** 2
        worst = max(worst, np.abs(error).max() / 9.81)
    assert worst < bound


def test_start_and_stop_overshoot_little():
    stream = PoseStream()
    _, (position, _, _, _) = play(stream, np.arange(60) / 30.0,
                                  along_x(lambda time: min(max(time - 0.5, 0.0), 0.5)), 1.9)
    step = 1.0 / 30.0
    assert position.min() > -0.06 * step and position.max() < 0.5 + 0.16 * step
    np.testing.assert_allclose(position[-10:, 0], 0.5, atol=1e-15)


# --- late, lost, back ------------------------------------------------------------------------


def test_stands_at_the_first_pose_until_its_stamp():
    stream = PoseStream()
    stream.add(1.0, (1, 2, 3), UPRIGHT)
    track = stream.sample(np.array([0.9, 1.0, 1.05]))
    np.testing.assert_array_equal(track.position, np.tile([1.0, 2.0, 3.0], (3, 1)))
    assert not track.twist.any()
    assert track.teleport.tolist() == [True, False, False]


def test_goes_on_with_the_last_twist_then_stands_still():
    stream = PoseStream(delay=0.1, timeout=0.5)
    for k in range(10):
        stream.add(k / 30.0, (k / 30.0, 0, 0), turned((0, 0, k / 10.0)))
    last = 9 / 30.0
    times = np.arange(0.0, 2.0, STEP)
    track = stream.sample(times)
    played = times - 0.1
    going = (played > 0.0) & (played < last + 0.5)
    still = played > last + 0.5
    np.testing.assert_allclose(track.position[going, 0], played[going], atol=1e-13)
    np.testing.assert_allclose(track.twist[going][:, [0, 5]], [[1.0, 3.0]] * going.sum())
    np.testing.assert_allclose(track.position[still, 0], last + 0.5, atol=1e-13)
    assert not track.twist[still].any()


def test_catches_up_without_a_jump_after_late_poses():
    """Poses of 1.0 to 1.2 s are lost; the plate has slowed down meanwhile."""
    stamps = np.arange(0.0, 3.0, 1.0 / 30.0)
    stamps = stamps[(stamps < 1.0) | (stamps > 1.2)]
    pose = along_x(lambda time: time - 0.5 * max(time - 1.0, 0.0))
    times, (position, _, twist, teleport) = play(PoseStream(), stamps, pose, 2.9)
    assert teleport.nonzero()[0].tolist() == [0]
    speed = np.diff(position[:, 0])[24:] / STEP
    assert speed.min() > -1.0 and speed.max() < 1.2
    late = times > 1.5
    np.testing.assert_allclose(position[late, 0], [pose(time - 0.1)[0][0] for time in times[late]],
                               atol=1e-12)


def test_latency_beyond_the_delay_stays_continuous():
    stamps = jittered(30, 3.0)
    pose = along_x(lambda time: 0.3 * sin(4.0 * time))
    times, (position, _, twist, teleport) = play(PoseStream(), stamps, pose, 2.9, latency=0.15)
    assert teleport.nonzero()[0].tolist() == [0]
    speed = np.abs(np.diff(position[:, 0])) / STEP
    assert speed.max() < 5.0 and speed[24:].max() < 2.0
    exact = [pose(time - 0.1)[0][0] for time in times]
    assert np.abs(position[:, 0] - exact)[60:].max() < 0.06


def test_ten_hertz_with_jitter():
    pose = along_x(lambda time: 0.3 * sin(4.0 * time))
    times, (position, _, _, teleport) = play(PoseStream(), jittered(10, 5.0, 3), pose, 4.8)
    exact = [pose(time - 0.1)[0][0] for time in times]
    assert teleport.sum() == 1
    assert np.abs(position[:, 0] - exact)[120:].max() < 0.01


def test_return_after_the_time_out_is_a_teleport():
    stamps = np.concatenate([np.arange(0.0, 1.0, 1 / 30.0), np.arange(2.0, 3.0, 1 / 30.0)])
    pose = along_x(lambda time: time)
    times, (position, _, twist, teleport) = play(PoseStream(), stamps, pose, 2.9)
    flagged = teleport.nonzero()[0]
    assert len(flagged) == 2
    assert times[flagged[1]] - 0.1 == pytest.approx(2.0, abs=2 * STEP)
    ways = np.abs(np.diff(position[:, 0]))
    ways[flagged[1] - 1] = 0.0
    assert ways.max() < 1.01 * STEP


def test_poses_staler_than_the_time_out_are_placed():
    stamps = np.arange(0.0, 2.0, 1 / 30.0)
    _, (position, _, twist, teleport) = play(PoseStream(), stamps, along_x(lambda time: time),
                                             2.5, latency=0.9)
    assert not twist[1:].any() and teleport.sum() > 20
    still = ~teleport[1:]
    assert not np.diff(position[:, 0])[still].any()


@pytest.mark.parametrize('shift, angle, expected', [
    (0.4, 0.0, 1), (0.6, 0.0, 2), (-3.0, 0.0, 2), (0.0, 1.9, 1), (0.0, 2.1, 2)])
def test_teleport_bounds(shift, angle, expected):
    def pose(time):
        after = time > 0.49
        return (time + shift * after, 0.0, 0.0), turned((0.0, 0.0, angle * after))

    times, (position, _, twist, teleport) = play(PoseStream(), np.arange(60) / 30.0, pose, 1.9)
    assert teleport.sum() == expected
    if expected == 2:
        index = teleport.nonzero()[0][1]
        assert times[index] - 0.1 == pytest.approx(0.5, abs=2 * STEP)
        assert np.abs(twist[:, 0]).max() < 1.0 + 1e-12
        np.testing.assert_allclose(position[index:, 0], times[index:] - 0.1 + shift, atol=1e-12)


def test_small_jump_in_no_time_is_a_teleport():
    stream = PoseStream()
    stream.add(0.0, (0, 0, 0), UPRIGHT)
    stream.sample(np.array([0.11]))
    stream.add(0.001, (0.1, 0, 0), UPRIGHT)
    track = stream.sample(np.array([0.2]))
    assert track.teleport[0] and track.position[0, 0] == 0.1 and not track.twist.any()


def test_fast_but_steady_motion_is_no_teleport():
    stream = PoseStream(delay=0.3)
    speeds = np.concatenate([np.linspace(0.0, 40.0, 30), np.full(30, 40.0)])
    for k, place in enumerate(np.cumsum(speeds) / 10.0):
        stream.add(k / 10.0, (place, 0, 0), UPRIGHT)
    assert stream.sample(np.arange(0.1, 6.0, STEP)).teleport.sum() == 1


def test_poses_that_follow_at_once_replace_each_other():
    stream = PoseStream()
    for k in range(2001):
        stream.add(k * 1e-4, (k * 1e-4, 0, 0), UPRIGHT)
    assert stream._curve.counts[KEPT] <= 103
    track = stream.sample(np.array([0.2, 0.25, 0.3]))
    np.testing.assert_allclose(track.position[:, 0], [0.1, 0.15, 0.2], atol=1e-13)


def test_restart_begins_anew_at_the_present():
    stream = PoseStream()
    for k in range(60):
        stream.add(k / 30.0, (k / 30.0, 0, 0), UPRIGHT)
    stream.sample(np.array([0.5]))
    stream.restart()
    track = stream.sample(np.array([1.5, 1.5 + STEP]))
    np.testing.assert_allclose(track.position[:, 0], [1.4, 1.4 + STEP])
    assert track.teleport.tolist() == [True, False]


def test_times_that_go_back_begin_anew():
    stream = PoseStream()
    for k in range(10):
        stream.add(k / 30.0, (k / 30.0, 0, 0), UPRIGHT)
    stream.sample(np.array([0.3]))
    track = stream.sample(np.array([0.25]))
    assert track.teleport[0] and np.isfinite(track.position).all()


# --- refused poses ---------------------------------------------------------------------------


@pytest.mark.parametrize('stamp, position, orientation, reason', [
    (1.0, (nan, 0, 0), UPRIGHT, 'not_finite'),
    (1.0, (0, float('inf'), 0), UPRIGHT, 'not_finite'),
    (nan, (0, 0, 0), UPRIGHT, 'not_finite'),
    (1.0, (0, 0, 0), (0, nan, 0, 1), 'not_finite'),
    (1.0, (1e300, 0, 0), UPRIGHT, 'too_far'),
    (1.0, (0, 0, 0), (0, 0, 0, 0), 'zero_quaternion'),
    (1.0, (0, 0, 0), (0, 0, 0, 2), 'not_unit'),
    (1.0, (0, 0, 0), (0, 0, 1e300, 1e300), 'not_unit'),
    (1.0, (0, 0, 0), (0, 0, 0, 1.0011), 'not_unit'),
    (0.4, (0, 0, 0), UPRIGHT, 'backwards'),
    (0.5, (0, 0, 0), UPRIGHT, 'repeated')])
def test_refused_poses_change_nothing(stamp, position, orientation, reason):
    streams = PoseStream(), PoseStream()
    for stream in streams:
        stream.add(0.4, (1, 0, 0), UPRIGHT)
        stream.add(0.5, (1.1, 0, 0), UPRIGHT)
    with pytest.raises(PoseError) as refused:
        streams[0].add(stamp, position, orientation)
    assert refused.value.reason == reason
    times = np.arange(0.5, 0.9, STEP)
    for one, other in zip(*[stream.sample(times) for stream in streams]):
        np.testing.assert_array_equal(one, other)


def test_nearly_unit_quaternions_are_normalised():
    stream = PoseStream()
    stream.add(0.0, (0, 0, 0), (0, 0, 0.6009, 0.8))
    assert np.linalg.norm(stream.sample(np.array([0.2])).orientation) == pytest.approx(1.0)


def test_playing_nothing_is_an_error():
    with pytest.raises(PoseError) as refused:
        PoseStream().sample(np.array([0.0]))
    assert refused.value.reason == 'no_pose'


# --- determinism and memory ------------------------------------------------------------------


def test_same_poses_same_track_bit_for_bit():
    tracks = [play(PoseStream(), jittered(30, 2.0), rocking, 1.9)[1] for _ in range(2)]
    for one, other in zip(*tracks):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize('tick', [1, 3, 8])
def test_the_size_of_ticks_does_not_matter(tick):
    stamps = jittered(30, 2.0)
    expected = play(PoseStream(), stamps, rocking, 1.9, tick=1)
    times, track = play(PoseStream(), stamps, rocking, 1.9, tick=tick)
    _, left, right = np.intersect1d(np.round(expected[0] / STEP), np.round(times / STEP),
                                    return_indices=True)
    assert len(left) > 100
    for one, other in zip(expected[1][:3], track[:3]):
        np.testing.assert_allclose(one[left], other[right], atol=1e-12)


def test_memory_is_bounded():
    stream = PoseStream()
    times, _ = play(stream, jittered(100, 20.0, jitter=1e-3), rocking, 19.9)
    assert stream._curve.counts[KEPT] < 20
    for k in range(3 * CAPACITY):
        stream.add(20.0 + k / 100.0, (k / 100.0, 0, 0), UPRIGHT)
    assert stream._curve.counts[KEPT] <= CAPACITY
    track = stream.sample(np.array([20.1 + 3 * CAPACITY / 100.0]))
    assert track.teleport[0] and np.isfinite(track.position).all()
