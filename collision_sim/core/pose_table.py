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
The curves of many pose streams in one table: a call takes all poses of a while, or plays all.

Row k of each array of such a Curve belongs to stream k.
"""

from math import isfinite

from collision_sim.core.jit import counted, law
from collision_sim.core.pose_play import add_pose, Curve, KEPT, new_curve, play_curve, STAMP
from collision_sim.core.pose_stream import FARTHEST, PoseStream, UNIT
import numpy as np


def new_curves(count):
    """Give a Curve that is a table for so many streams, all of them without poses."""
    return Curve(*(np.zeros((count, *part.shape), part.dtype) for part in new_curve()))


def streams_of(curves):
    """Give a PoseStream for each row, which keeps its poses there."""
    return [PoseStream(curve=Curve(*row)) for row in zip(*curves)]


@counted
def _curve(curves, k):
    """Curve of stream k, a view."""
    return Curve(curves.poses[k], curves.counts[k], curves.knot[k], curves.times[k],
                 curves.cubic[k], curves.base[k])


@law
def add_poses(curves, bounds, first, which, stamps, periods, poses, lengths):
    """
    Take poses one after the other, up to one that PoseStream.add would refuse.

    Parameters
    ----------
    curves : Curve
        The table.
    bounds : Bounds
        Of all streams.
    first : int
        Poses before this one are left out.
    which : (n,) int64
        Streams.
    stamps, periods : (n,) float64, (n, 2) float64 [s]
        A stamp has to be within its period, from the earliest to the latest.
    poses, lengths : (n, 7) float64 [m], [-], (n,) float64 [-]
        Position and orientation, and length of the orientation.

    Returns
    -------
    refused : int
        The first pose that is not taken; n if there is none.

    """
    orientation = np.empty(4)
    for i in range(first, len(which)):
        curve = _curve(curves, which[i])
        if not (periods[i, 0] <= stamps[i] <= periods[i, 1] and _can_be(poses[i], lengths[i])
                and _is_later(curve, stamps[i])):
            return i
        for k in range(4):
            orientation[k] = poses[i, 3 + k] / lengths[i]
        add_pose(curve, bounds, stamps[i], poses[i, :3], orientation)
    return len(which)


@counted
def _can_be(pose, length):
    """Whether numbers are a pose, as pose_stream.checked_pose says."""
    return (abs(pose[0]) <= FARTHEST and abs(pose[1]) <= FARTHEST and abs(pose[2]) <= FARTHEST
            and abs(length - 1.0) <= UNIT)


@counted
def _is_later(curve, stamp):
    """Whether a stamp is later than that of the newest pose, if there is one."""
    n = curve.counts[KEPT]
    return isfinite(stamp) and (n == 0 or stamp > curve.poses[n - 1, STAMP])


@law
def play_curves(curves, bounds, which, times, out, teleport):
    """
    Play some curves at the same times.

    Parameters
    ----------
    curves, bounds
        As in `add_poses`.
    which : (m,) int64
        Streams, each with a pose.
    times : (n,) float64 [s]
        As in play_curve.
    out, teleport : (m, 13, n) float64, (m, n) bool
        As in play_curve, for each of them.

    """
    for j in range(len(which)):
        play_curve(_curve(curves, which[j]), bounds, times, out[j], teleport[j])


def prepare():
    """Compile what streams are played with, or load it; the first pose would wait for it."""
    curves = new_curves(1)
    stream, = streams_of(curves)
    times, which = np.array([0.0, 0.15, 0.4]), np.zeros(3, dtype=np.int64)  # on it, and coasting
    periods = np.tile([-np.inf, np.inf], (3, 1))
    for k in range(3):
        stream.add(0.1 * k, (0.01 * k, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    stream.sample(times)
    add_poses(curves, stream.bounds, 0, which, 1.0 + times, periods, np.eye(3, 7), np.ones(3))
    play_curves(curves, stream.bounds, which[:1], 1.0 + times, np.empty((1, 13, 3)),
                np.zeros((1, 3), dtype=bool))
