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

"""The works in Taichi and in Quadrants, which came of it and has the same words."""

from importlib import import_module

from collision_sim.studies.bench_works import (BALL, BLOCK, block_poses, BLOCK_SPEED, BLOCK_SPIN,
                                               BOUNCE, DT, FRICTION, GRAVITY, RADIUS, RESTITUTION,
                                               WORKS)
from collision_sim.studies.peers.job import choose, one_by_one
import numpy as np

HALF = tuple(entry / 2 for entry in BLOCK['size'])
REACH = 2.0 * RADIUS


def falling(ti, count, poses, tops, x, v):
    """Compile a kernel that takes the steps of work 1 from `first` to `last`."""
    @ti.func
    def respond(velocity, surface, normal):
        relative = velocity - surface
        v_n = relative.dot(normal)
        after = velocity
        if v_n < 0.0:
            tangential = relative - v_n * normal
            speed = tangential.norm()
            loss = ti.min(-FRICTION * (1.0 + RESTITUTION) * v_n, speed)
            after = surface + tangential * (1.0 - loss / ti.max(speed, 1e-300)) \
                - RESTITUTION * v_n * normal
        return after

    @ti.kernel
    def fall(first: ti.i32, last: ti.i32):
        for i in range(count):
            place = x[i]
            speed = v[i]
            for s in range(first, last):
                speed[2] -= GRAVITY * DT
                place += speed * DT
                if place[2] < tops[s]:
                    if place[2] < 0.0:
                        place[2] = 0.0
                        speed = respond(speed, ti.Vector([0.0, 0.0, 0.0]),
                                        ti.Vector([0.0, 0.0, 1.0]))
                    centre = ti.Vector([BALL['position'][0], BALL['position'][1],
                                        BALL['position'][2]])
                    offset = place - centre
                    if offset.norm_sqr() < BALL['radius'] ** 2:
                        normal = offset.normalized()
                        place = centre + BALL['radius'] * normal
                        speed = respond(speed, ti.Vector([0.0, 0.0, 0.0]), normal)
                    c = poses[s, 3]
                    r = poses[s, 4]
                    middle = ti.Vector([poses[s, 0], poses[s, 1], poses[s, 2]])
                    away = place - middle
                    local = ti.Vector([c * away[0] + r * away[1], c * away[1] - r * away[0],
                                       away[2]])
                    depth = abs(local) - ti.Vector([HALF[0], HALF[1], HALF[2]])
                    if depth.max() < 0.0:
                        out = ti.Vector([0.0, 0.0, ti.math.sign(local[2])])
                        far = -depth[2]
                        if depth[0] > depth[1] and depth[0] > depth[2]:
                            out = ti.math.sign(local[0]) * ti.Vector([c, r, 0.0])
                            far = -depth[0]
                        elif depth[1] > depth[2]:
                            out = ti.math.sign(local[1]) * ti.Vector([-r, c, 0.0])
                            far = -depth[1]
                        place += far * out
                        away = place - middle
                        surface = ti.Vector([BLOCK_SPEED[0] - BLOCK_SPIN * away[1],
                                             BLOCK_SPEED[1] + BLOCK_SPIN * away[0],
                                             BLOCK_SPEED[2]])
                        speed = respond(speed, surface, out)
            x[i] = place
            v[i] = speed
    return fall


class Points:
    """
    Work 1: one step a call, or all of them if `fused`.

    Parameters
    ----------
    ti : module
        The toolkit.
    job : job.Job
        What to do.

    """

    precision = 'f64'

    def __init__(self, ti, job):
        self.ti, self.job, self.threads = ti, job, job.threads
        poses = block_poses(WORKS[job.work].steps)[1:]
        top = np.maximum(BALL['position'][2] + BALL['radius'], poses[:, 2] + HALF[2])
        self.x, self.v = (ti.Vector.field(3, ti.f64, job.count, layout=ti.Layout.SOA)
                          for _ in range(2))
        table, tops = ti.field(ti.f64, poses.shape), ti.field(ti.f64, top.shape)
        table.from_numpy(poses)
        tops.from_numpy(top)
        self.kernel = falling(ti, job.count, table, tops, self.x, self.v)
        self.begin()

    def begin(self):
        """Go back to the start."""
        self.x.from_numpy(self.job.position)
        self.v.from_numpy(self.job.velocity)

    def run(self, steps):
        """Take the steps."""
        if self.job.variant == 'fused':
            self.kernel(0, steps)
        else:
            for step in range(steps):
                self.kernel(step, step + 1)
        self.ti.sync()

    def state(self):
        """Give positions and velocities."""
        return self.x.to_numpy(), self.v.to_numpy()


def sorting(ti, count, cells, half):
    """Compile the kernel that sorts particles into cells, by counting."""
    wide, deep, high = cells

    @ti.func
    def cell_of(place):
        cell = ti.Vector([0, 0, 0])
        for axis in ti.static(range(3)):
            most = ti.static(cells[axis] - 1)
            cell[axis] = ti.min(ti.max(ti.cast((place[axis] + half[axis]) / REACH, ti.i32), 0),
                                most)
        return cell

    @ti.kernel
    def sort(x: ti.template(), v: ti.template(), sorted_x: ti.template(), sorted_v: ti.template(),
             starts: ti.template(), places: ti.template()):
        for k in starts:
            starts[k] = 0
        for i in range(count):
            cell = cell_of(x[i])
            row = (cell[2] * deep + cell[1]) * wide + cell[0]
            places[i] = ti.Vector([row, ti.atomic_add(starts[row + 1], 1)])
        ti.loop_config(serialize=True)
        for k in range(wide * deep * high):
            starts[k + 1] += starts[k]
        for i in range(count):
            to = starts[places[i][0]] + places[i][1]
            sorted_x[to] = x[i]
            sorted_v[to] = v[i]
    return sort, cell_of


def colliding(ti, count, cells, half, cell_of):
    """Compile the kernel of a step of work 2, of particles sorted into cells."""
    wide, deep, high = cells

    @ti.kernel
    def collide(x: ti.template(), v: ti.template(), new_x: ti.template(), new_v: ti.template(),
                starts: ti.template()):
        for i in range(count):
            own_x = x[i]
            own_v = v[i]
            kick = ti.Vector([0.0, 0.0, 0.0])
            push = ti.Vector([0.0, 0.0, 0.0])
            cell = cell_of(own_x)
            low = ti.max(cell[0] - 1, 0)
            top = ti.min(cell[0] + 1, wide - 1)
            for layer in range(ti.max(cell[2] - 1, 0), ti.min(cell[2] + 2, high)):
                for line in range(ti.max(cell[1] - 1, 0), ti.min(cell[1] + 2, deep)):
                    row = (layer * deep + line) * wide
                    for j in range(starts[row + low], starts[row + top + 1]):
                        offset = own_x - x[j]
                        square = offset.norm_sqr()
                        if square < REACH * REACH and j != i:
                            distance = ti.sqrt(square)
                            normal = offset / distance
                            push += 0.5 * (REACH - distance) * normal
                            v_n = ti.min((own_v - v[j]).dot(normal), 0.0)
                            kick -= 0.5 * (1.0 + BOUNCE) * v_n * normal
            own_x += push
            own_v += kick
            for axis in ti.static(range(3)):
                wall = ti.static(half[axis] - RADIUS)
                if abs(own_x[axis]) > wall:
                    if own_x[axis] * own_v[axis] > 0.0:
                        own_v[axis] *= -BOUNCE
                    own_x[axis] = ti.min(ti.max(own_x[axis], -wall), wall)
            new_v[i] = own_v
            new_x[i] = own_x + own_v * DT
    return collide


class Balls:
    """
    Work 2: particles sorted into cells by counting, impulses from the state before.

    Parameters
    ----------
    ti : module
        The toolkit.
    job : job.Job
        What to do.

    """

    precision = 'f32'

    def __init__(self, ti, job):
        one_by_one(job)
        self.ti, self.job, self.threads = ti, job, job.threads
        half = tuple(job.scene.colliders[0].size)
        cells = tuple(max(int(2.0 * entry / REACH), 1) for entry in half)
        self.x, self.v, self.other_x, self.other_v = (
            ti.Vector.field(3, ti.f32, job.count) for _ in range(4))
        self.starts = ti.field(ti.i32, cells[0] * cells[1] * cells[2] + 1)
        self.places = ti.Vector.field(2, ti.i32, job.count)
        self.sort, cell_of = sorting(ti, job.count, cells, half)
        self.collide = colliding(ti, job.count, cells, half, cell_of)
        self.begin()

    def begin(self):
        """Go back to the start."""
        self.x.from_numpy(self.job.position.astype(np.float32))
        self.v.from_numpy(self.job.velocity.astype(np.float32))

    def run(self, steps):
        """Take the steps."""
        for _ in range(steps):
            self.sort(self.x, self.v, self.other_x, self.other_v, self.starts, self.places)
            self.collide(self.other_x, self.other_v, self.x, self.v, self.starts)
        self.ti.sync()

    def state(self):
        """Give positions and velocities."""
        return self.x.to_numpy(), self.v.to_numpy()


def toolkit(name, job):
    """Start a toolkit for a job."""
    ti = import_module(name)
    wanted = ti.f32 if job.work == '2' else ti.f64
    ti.init(arch=ti.cpu, default_fp=wanted, cpu_max_num_threads=job.threads, log_level=ti.ERROR)
    return ti


def runner(job, name='taichi'):
    """Give the way to do a job."""
    way = choose(job, {'1': Points, '2': Balls}, 'no queries of meshes')
    return way(toolkit(name, job), job)
