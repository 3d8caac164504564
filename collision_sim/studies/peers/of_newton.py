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

"""The works in Newton, with two of its solvers, on the CPU."""

from collision_sim.studies.bench_works import (BALL, BLOCK, block_poses, BLOCK_SPEED, BLOCK_SPIN,
                                               DT, FRICTION, GRAVITY, RADIUS, RESTITUTION,
                                               RING_HEIGHT, torus, WORKS)
from collision_sim.studies.peers.job import at_most, choose, Unable
import newton
import numpy as np
import warp as wp

wp.config.quiet = True
MOST = 10 ** 5
STIFFNESS, DAMPING, SLIP = 1e4, 90.0, 1e3    # N/m, N s/m, N s/m; of the contacts of forces
UPRIGHT = wp.quat(0.0, 0.0, 0.0, 1.0)


class Particles:
    """
    Particles of a model that a solver steps; colliders are added by the subclasses.

    Parameters
    ----------
    job : job.Job
        What to do.

    """

    precision, threads = 'f32', 1
    radius, gravity = 0.0, (0.0, 0.0, -GRAVITY)

    def __init__(self, job):
        at_most(job, MOST, 'it takes too long')
        self.job = job
        builder = newton.ModelBuilder(up_axis=newton.Axis.Z, gravity=self.gravity)
        self.material = newton.ModelBuilder.ShapeConfig(
            ke=STIFFNESS, kd=DAMPING, kf=SLIP, mu=FRICTION, restitution=RESTITUTION)
        self.add_colliders(builder)
        each = [1.0] * job.count
        builder.add_particles(pos=job.position.tolist(), vel=job.velocity.tolist(), mass=each,
                              radius=[self.radius] * job.count)
        self.model = builder.finalize(device='cpu')
        self.model.soft_contact_mu = FRICTION
        self.model.soft_contact_restitution = RESTITUTION
        self.model.soft_contact_ke, self.model.soft_contact_kd = STIFFNESS, DAMPING
        self.model.soft_contact_kf = SLIP
        self.solver = newton.solvers.SolverSemiImplicit(self.model) \
            if job.variant == 'semi-implicit' else \
            newton.solvers.SolverXPBD(self.model, enable_restitution=True)
        self.pipeline = newton.CollisionPipeline(self.model, broad_phase='explicit')
        self.contacts = self.pipeline.contacts()
        self.begin()

    def begin(self):
        """Go back to the start."""
        self.now, self.next = self.model.state(), self.model.state()

    def move(self, step):
        """Place what moves, at the start of a step."""

    def run(self, steps):
        """Take the steps."""
        for step in range(steps):
            self.move(step)
            self.now.clear_forces()
            self.pipeline.collide(self.now, self.contacts)
            self.solver.step(self.now, self.next, None, self.contacts, DT)
            self.now, self.next = self.next, self.now

    def state(self):
        """Give positions and velocities."""
        return self.now.particle_q.numpy(), self.now.particle_qd.numpy()


class Points(Particles):
    """Work 1."""

    def add_colliders(self, builder):
        """Add the ground, the ball and the box."""
        poses = block_poses(WORKS[self.job.work].steps)
        half = np.arctan2(poses[:, 4], poses[:, 3]) / 2
        zero = np.zeros_like(half)
        rows = np.column_stack([poses[:, :3], zero, zero, np.sin(half), np.cos(half)])
        self.poses = wp.array(rows, dtype=wp.transform, device='cpu')
        self.twist = wp.array([[*BLOCK_SPEED, 0.0, 0.0, BLOCK_SPIN]], dtype=wp.spatial_vector,
                              device='cpu')
        builder.add_ground_plane(cfg=self.material)
        builder.add_shape_sphere(-1, xform=wp.transform(wp.vec3(*BALL['position']), UPRIGHT),
                                 radius=BALL['radius'], cfg=self.material)
        body = builder.add_body(xform=wp.transform(wp.vec3(*BLOCK['position']), UPRIGHT),
                                mass=1.0, is_kinematic=True)
        x, y, z = (entry / 2 for entry in BLOCK['size'])
        builder.add_shape_box(body, hx=x, hy=y, hz=z, cfg=self.material)

    def move(self, step):
        """Place the box."""
        wp.copy(self.now.body_q, self.poses, src_offset=step, count=1)
        wp.copy(self.now.body_qd, self.twist)


class Balls(Particles):
    """Work 2; collisions of particles have no restitution."""

    radius, gravity = RADIUS, (0.0, 0.0, 0.0)

    def add_colliders(self, builder):
        """Add the walls."""
        if self.job.variant == 'semi-implicit':
            raise Unable('its contacts of particles are forces')
        for axis, half in enumerate(self.job.scene.colliders[0].size):
            for sign in (-1.0, 1.0):
                normal = np.zeros(3)
                normal[axis] = sign
                turn = wp.quat_between_vectors(wp.vec3(0.0, 0.0, 1.0), wp.vec3(*normal)) \
                    if (axis, sign) != (2, -1.0) else wp.quat(1.0, 0.0, 0.0, 0.0)
                builder.add_shape_plane(xform=wp.transform(wp.vec3(*(-half * normal)), turn),
                                        width=0.0, length=0.0, cfg=self.material)


class Rain(Particles):
    """Work 3."""

    def add_colliders(self, builder):
        """Add the ground and the torus."""
        points, triangles = torus()
        mesh = newton.Mesh(points.astype(np.float32), triangles.ravel().astype(np.int32))
        builder.add_ground_plane(cfg=self.material)
        builder.add_shape_mesh(-1, mesh=mesh, cfg=self.material,
                               xform=wp.transform(wp.vec3(0.0, 0.0, RING_HEIGHT), UPRIGHT))


def runner(job):
    """Give the way to do a job."""
    return choose(job, {'1': Points, '2': Balls, '3': Rain}, 'not written')(job)
