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

"""The works in NumPy: arithmetic on all particles, responses on the few by their indices."""

from collision_sim.studies.bench_works import (BALL, BLOCK, block_poses, BLOCK_SPEED, BLOCK_SPIN,
                                               BOUNCE, DT, FRICTION, GRAVITY, RADIUS, RESTITUTION,
                                               WORKS)
from collision_sim.studies.peers.job import at_most, choose, Unable
import numpy as np

CHUNK = 16384               # particles; those and their velocities stay in the cache
HALF = np.array(BLOCK['size']) / 2
REACH = np.hypot(HALF[0], HALF[1])      # m; of the box, however it is turned
BALL_CENTRE = np.array(BALL['position'])


def respond(v, surface, normal):
    """Give the velocities (M, 3) after a collision, with friction."""
    relative = v - surface
    v_n = np.minimum(np.einsum('ij,ij->i', relative, normal), 0.0)[:, None]
    tangential = relative - v_n * normal
    speed = np.sqrt(np.einsum('ij,ij->i', tangential, tangential))[:, None]
    loss = np.minimum(-FRICTION * (1.0 + RESTITUTION) * v_n, speed)
    kept = 1.0 - loss / np.maximum(speed, 1e-300)
    return surface + tangential * kept - RESTITUTION * v_n * normal


def put(x, v, rows, out, surface, normal):
    """Project particles out of a collider and change their velocities."""
    x[:, rows] = out.T
    v[:, rows] = respond(v[:, rows].T, surface, normal).T


def near(x, rows, centre, reach):
    """Give those rows whose particles are in a cube about a place."""
    for place, middle in zip(x, centre):
        rows = rows[np.abs(place[rows] - middle) < reach]
    return rows


def hit_ground(x, v):
    """Answer what is below the ground: as `respond`, whose normal is (0, 0, 1) here."""
    rows = np.flatnonzero(x[2] < 0.0)
    v_x, v_y, v_n = v[0][rows], v[1][rows], np.minimum(v[2][rows], 0.0)
    speed = np.sqrt(v_x * v_x + v_y * v_y)
    loss = np.minimum(-FRICTION * (1.0 + RESTITUTION) * v_n, speed)
    kept = 1.0 - loss / np.maximum(speed, 1e-300)
    x[2][rows] = 0.0
    v[0][rows], v[1][rows] = kept * v_x, kept * v_y
    v[2][rows] -= (1.0 + RESTITUTION) * v_n


def hit_ball(x, v, low):
    """Answer what is inside the ball, among the rows that are low enough."""
    low = near(x, low, BALL_CENTRE, BALL['radius'])
    offset = x[:, low].T - BALL_CENTRE
    distance = np.sqrt(np.einsum('ij,ij->i', offset, offset))
    inside = distance < BALL['radius']
    if inside.any():
        normal = offset[inside] / distance[inside, None]
        put(x, v, low[inside], BALL_CENTRE + BALL['radius'] * normal, np.zeros(3), normal)


def hit_block(x, v, low, pose):
    """Answer what is inside the box at a pose, among the rows that are low enough."""
    centre, (cosine, sine) = pose[:3], pose[3:]
    low = near(x, low, centre, REACH)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    local = (x[:, low].T - centre) @ turn
    depth = np.abs(local) - HALF
    inside = (depth < 0.0).all(axis=1)
    if not inside.any():
        return
    local, axis = local[inside], depth[inside].argmax(axis=1)
    each = np.arange(axis.size)
    normal = np.zeros_like(local)
    normal[each, axis] = np.sign(local[each, axis])
    local[each, axis] = normal[each, axis] * HALF[axis]
    offset = local @ turn.T
    surface = BLOCK_SPEED + BLOCK_SPIN * np.column_stack([-offset[:, 1], offset[:, 0],
                                                          np.zeros(axis.size)])
    put(x, v, low[inside], centre + offset, surface, normal @ turn.T)


class Columns:
    """
    Particles as columns (3, N) of float64.

    Parameters
    ----------
    job : job.Job
        What to do.

    """

    precision, threads = 'f64', 1

    def __init__(self, job):
        self.job = job
        self.x, self.v = np.empty((2, 3, job.count))
        self.begin()

    def begin(self):
        """Go back to the start."""
        self.x[:], self.v[:] = self.job.position.T, self.job.velocity.T

    def state(self):
        """Give positions and velocities."""
        return self.x.T, self.v.T


class Points(Columns):
    """Work 1."""

    def __init__(self, job):
        super().__init__(job)
        self.poses = block_poses(WORKS[job.work].steps)
        self._way = np.empty(CHUNK)

    def run(self, steps):
        """Take the steps, each a chunk of particles after the other."""
        for step in range(steps):
            for first in range(0, self.job.count, CHUNK):
                rows = slice(first, first + CHUNK)
                self._step(self.x[:, rows], self.v[:, rows], self.poses[step + 1])

    def _step(self, x, v, pose):
        v[2] -= GRAVITY * DT
        for place, speed in zip(x, v):
            place += np.multiply(speed, DT, out=self._way[:len(speed)])
        top = max(BALL_CENTRE[2] + BALL['radius'], pose[2] + HALF[2])
        low = np.flatnonzero(x[2] < top)
        if low.size:
            hit_ground(x, v)
            hit_ball(x, v, low)
            hit_block(x, v, low, pose)


class Balls(Columns):
    """Work 2, with the tree of SciPy."""

    def __init__(self, job):
        at_most(job, 10 ** 5, 'a tree a step')
        super().__init__(job)
        try:
            from scipy.spatial import cKDTree
        except ImportError:
            raise Unable('SciPy is not installed') from None
        self._tree = cKDTree
        self.half = np.array(job.scene.colliders[0].size)[:, None] - RADIUS

    def run(self, steps):
        """Take the steps."""
        for _ in range(steps):
            self.x += DT * self.v
            self._collide()
            self._hit_walls()

    def _collide(self):
        tree = self._tree(self.x.T, balanced_tree=False, compact_nodes=False)
        a, b = tree.query_pairs(2.0 * RADIUS, output_type='ndarray').T
        offset = self.x[:, a] - self.x[:, b]
        distance = np.sqrt(np.einsum('ij,ij->j', offset, offset))
        normal = offset / distance
        v_n = np.minimum(np.einsum('ij,ij->j', self.v[:, a] - self.v[:, b], normal), 0.0)
        kick = -0.5 * (1.0 + BOUNCE) * v_n * normal
        push = (RADIUS - 0.5 * distance) * normal
        for axis in range(3):
            for state, change in ((self.v, kick), (self.x, push)):
                state[axis] += np.bincount(a, change[axis], self.job.count)
                state[axis] -= np.bincount(b, change[axis], self.job.count)

    def _hit_walls(self):
        leaving = (np.abs(self.x) > self.half) & (self.x * self.v > 0.0)
        self.v[leaving] *= -BOUNCE
        np.clip(self.x, -self.half, self.half, out=self.x)


def runner(job):
    """Give the way to do a job."""
    return choose(job, {'1': Points, '2': Balls}, 'NumPy has no queries of meshes')(job)
