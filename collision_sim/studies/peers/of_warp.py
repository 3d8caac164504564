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

"""The works in Warp, on the CPU, where it has one thread."""

from collision_sim.studies.bench_works import (BALL, BLOCK, block_poses, BLOCK_SPEED, BLOCK_SPIN,
                                               BOUNCE, DT, FRICTION, GRAVITY, RADIUS, RESTITUTION,
                                               RING_HEIGHT, torus, WORKS)
from collision_sim.studies.peers.job import at_most, choose, one_by_one
import numpy as np
import warp as wp

wp.config.quiet = True
wp.init()
BALL_X, BALL_Y, BALL_Z = (wp.constant(wp.float64(entry)) for entry in BALL['position'])
BALL_R = wp.constant(wp.float64(BALL['radius']))
HALF_X, HALF_Y, HALF_Z = (wp.constant(wp.float64(entry / 2)) for entry in BLOCK['size'])
SPEED_X, SPEED_Y, SPEED_Z = (wp.constant(wp.float64(entry)) for entry in BLOCK_SPEED)
SPIN, FALL, STEP = (wp.constant(wp.float64(entry)) for entry in (BLOCK_SPIN, GRAVITY * DT, DT))
EPS, MU = wp.constant(wp.float64(RESTITUTION)), wp.constant(wp.float64(FRICTION))
ZERO, ONE, TINY = (wp.constant(wp.float64(entry)) for entry in (0.0, 1.0, 1e-300))
STEP_32, FALL_32, EPS_32, MU_32 = (wp.constant(float(entry)) for entry in (
    DT, GRAVITY * DT, RESTITUTION, FRICTION))
R_32, BOUNCE_32 = wp.constant(float(RADIUS)), wp.constant(float(BOUNCE))
OFF = wp.constant(1e-5)         # m; off the mesh, so that the next segment does not begin on it
TINY_32 = wp.constant(1e-30)


@wp.func
def respond(v: wp.vec3d, surface: wp.vec3d, normal: wp.vec3d):
    """Give the velocity after a collision, with friction."""
    relative = v - surface
    v_n = wp.dot(relative, normal)
    if v_n >= ZERO:
        return v
    tangential = relative - v_n * normal
    speed = wp.length(tangential)
    loss = wp.min(-MU * (ONE + EPS) * v_n, speed)
    return surface + tangential * (ONE - loss / wp.max(speed, TINY)) - EPS * v_n * normal


@wp.kernel
def fall(first: int, last: int, poses: wp.array2d(dtype=wp.float64),
         tops: wp.array(dtype=wp.float64), position: wp.array(dtype=wp.vec3d),
         velocity: wp.array(dtype=wp.vec3d)):
    """Take the steps of work 1 from `first` to `last`."""
    i = wp.tid()
    x = position[i]
    v = velocity[i]
    for s in range(first, last):
        v = wp.vec3d(v[0], v[1], v[2] - FALL)
        x = x + v * STEP
        if x[2] < tops[s]:
            if x[2] < ZERO:
                x = wp.vec3d(x[0], x[1], ZERO)
                v = respond(v, wp.vec3d(ZERO, ZERO, ZERO), wp.vec3d(ZERO, ZERO, ONE))
            centre = wp.vec3d(BALL_X, BALL_Y, BALL_Z)
            offset = x - centre
            if wp.dot(offset, offset) < BALL_R * BALL_R:
                normal = wp.normalize(offset)
                x = centre + BALL_R * normal
                v = respond(v, wp.vec3d(ZERO, ZERO, ZERO), normal)
            middle = wp.vec3d(poses[s, 0], poses[s, 1], poses[s, 2])
            c = poses[s, 3]
            r = poses[s, 4]
            away = x - middle
            local = wp.vec3d(c * away[0] + r * away[1], c * away[1] - r * away[0], away[2])
            dx = wp.abs(local[0]) - HALF_X
            dy = wp.abs(local[1]) - HALF_Y
            dz = wp.abs(local[2]) - HALF_Z
            if wp.max(dx, wp.max(dy, dz)) < ZERO:
                out = wp.vec3d(ZERO, ZERO, wp.sign(local[2]))
                depth = -dz
                if dx > dy and dx > dz:
                    out = wp.vec3d(wp.sign(local[0]) * c, wp.sign(local[0]) * r, ZERO)
                    depth = -dx
                elif dy > dz:
                    out = wp.vec3d(-wp.sign(local[1]) * r, wp.sign(local[1]) * c, ZERO)
                    depth = -dy
                x = x + depth * out
                away = x - middle
                v = respond(v, wp.vec3d(SPEED_X - SPIN * away[1], SPEED_Y + SPIN * away[0],
                                        SPEED_Z), out)
    position[i] = x
    velocity[i] = v


@wp.kernel
def collide(grid: wp.uint64, half: wp.vec3, x: wp.array(dtype=wp.vec3),
            v: wp.array(dtype=wp.vec3), new_x: wp.array(dtype=wp.vec3),
            new_v: wp.array(dtype=wp.vec3)):
    """Take a step of work 2: all impulses from the state before, then the walls, then the way."""
    i = wp.hash_grid_point_id(grid, wp.tid())
    own_x = x[i]
    own_v = v[i]
    kick = wp.vec3()
    push = wp.vec3()
    for j in wp.hash_grid_query(grid, own_x, 2.0 * R_32):
        offset = own_x - x[j]
        square = wp.dot(offset, offset)
        if square < 4.0 * R_32 * R_32 and j != i:
            distance = wp.sqrt(square)
            normal = offset / distance
            push += (R_32 - 0.5 * distance) * normal
            kick -= 0.5 * (1.0 + BOUNCE_32) * wp.min(wp.dot(own_v - v[j], normal), 0.0) * normal
    own_v += kick
    own_x += push
    for axis in range(3):
        if wp.abs(own_x[axis]) > half[axis]:
            if own_x[axis] * own_v[axis] > 0.0:
                own_v[axis] = -BOUNCE_32 * own_v[axis]
            own_x[axis] = wp.clamp(own_x[axis], -half[axis], half[axis])
    new_v[i] = own_v
    new_x[i] = own_x + own_v * STEP_32


@wp.func
def respond_32(v: wp.vec3, normal: wp.vec3):
    """Give the velocity after a collision with what stands still, in float32."""
    v_n = wp.min(wp.dot(v, normal), 0.0)
    tangential = v - v_n * normal
    speed = wp.length(tangential)
    loss = wp.min(-MU_32 * (1.0 + EPS_32) * v_n, speed)
    return tangential * (1.0 - loss / wp.max(speed, TINY_32)) - EPS_32 * v_n * normal


@wp.kernel
def rain(first: int, last: int, mesh: wp.uint64, position: wp.array(dtype=wp.vec3),
         velocity: wp.array(dtype=wp.vec3)):
    """Take the steps of work 3 from `first` to `last`; the way of a step is a ray."""
    i = wp.tid()
    x = position[i]
    v = velocity[i]
    for _ in range(first, last):
        v = wp.vec3(v[0], v[1], v[2] - FALL_32)
        way = v * STEP_32
        length = wp.length(way)
        if length > 0.0:
            ray = wp.mesh_query_ray(mesh, x, way / length, length)
            if ray.result:
                normal = wp.normalize(ray.normal)
                if wp.dot(way, normal) > 0.0:
                    normal = -normal
                x = x + way * (ray.t / length) + OFF * normal
                v = respond_32(v, normal)
            else:
                x = x + way
        if x[2] < 0.0:
            x = wp.vec3(x[0], x[1], 0.0)
            v = respond_32(v, wp.vec3(0.0, 0.0, 1.0))
    position[i] = x
    velocity[i] = v


class Particles:
    """
    Particles as arrays of vectors.

    Parameters
    ----------
    job : job.Job
        What to do.
    kind : type
        Of the vectors.

    """

    threads = 1

    def __init__(self, job, kind):
        self.job, self.kind = job, kind
        self.begin()

    def begin(self):
        """Go back to the start."""
        with wp.ScopedDevice('cpu'):
            self.x = wp.array(self.job.position, dtype=self.kind)
            self.v = wp.array(self.job.velocity, dtype=self.kind)

    def state(self):
        """Give positions and velocities."""
        return self.x.numpy(), self.v.numpy()


class Stepped(Particles):
    """A kernel that takes steps by number: one a call, or all of them if `fused`."""

    def run(self, steps):
        """Take the steps."""
        command = wp.launch(self.kernel, dim=self.job.count, device='cpu', record_cmd=True,
                            inputs=[0, steps, *self.tables, self.x, self.v])
        if self.job.variant == 'fused':
            command.launch()
            return
        for step in range(steps):
            command.set_param_at_index(0, step)
            command.set_param_at_index(1, step + 1)
            command.launch()


class Points(Stepped):
    """Work 1."""

    precision = 'f64'

    def __init__(self, job):
        poses = block_poses(WORKS[job.work].steps)[1:]
        top = np.maximum(BALL['position'][2] + BALL['radius'],
                         poses[:, 2] + BLOCK['size'][2] / 2)
        self.kernel, self.tables = fall, [wp.array(table, dtype=wp.float64, device='cpu')
                                          for table in (poses, top)]
        super().__init__(job, wp.vec3d)


class Rain(Stepped):
    """Work 3."""

    precision = 'f32'

    def __init__(self, job):
        points, triangles = torus()
        self.mesh = wp.Mesh(
            wp.array(points + (0.0, 0.0, RING_HEIGHT), dtype=wp.vec3, device='cpu'),
            wp.array(triangles.ravel(), dtype=wp.int32, device='cpu'))
        self.kernel, self.tables = rain, [self.mesh.id]
        super().__init__(job, wp.vec3)


class Balls(Particles):
    """Work 2, with the hash grid of Warp."""

    precision = 'f32'

    def __init__(self, job):
        one_by_one(job)
        at_most(job, 10 ** 5, 'its grid takes too long')
        self.half = np.array(job.scene.colliders[0].size) - RADIUS
        cells = np.ceil(self.half / RADIUS).astype(int) + 1
        self.grid = wp.HashGrid(*cells.tolist(), device='cpu')
        super().__init__(job, wp.vec3)

    def run(self, steps):
        """Take the steps."""
        new_x, new_v = wp.empty_like(self.x), wp.empty_like(self.v)
        for _ in range(steps):
            self.grid.build(self.x, 2.0 * RADIUS)
            wp.launch(collide, dim=self.job.count, device='cpu', inputs=[
                self.grid.id, wp.vec3(*self.half), self.x, self.v, new_x, new_v])
            self.x, self.v, new_x, new_v = new_x, new_v, self.x, self.v


def runner(job):
    """Give the way to do a job."""
    return choose(job, {'1': Points, '2': Balls, '3': Rain}, 'not written')(job)
