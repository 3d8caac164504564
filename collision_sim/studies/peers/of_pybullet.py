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

"""Work 1 in PyBullet: each particle is a small sphere, a body."""

from collision_sim.studies.bench_works import (BALL, BLOCK, block_poses, BLOCK_SPEED, BLOCK_SPIN,
                                               DT, FRICTION, GRAVITY, RESTITUTION, WORKS)
from collision_sim.studies.peers.job import at_most, choose
import numpy as np
import pybullet as bullet

MOST = 10 ** 3
SMALL = 0.005                   # m
LIFT = (0.0, 0.0, SMALL)
STILL, MOVING = 1, 2            # groups of collisions


class Bodies:
    """
    Work 1.

    Parameters
    ----------
    job : job.Job
        What to do.

    """

    precision, threads = 'f64', 1

    def __init__(self, job):
        at_most(job, MOST, 'particles are bodies')
        self.job = job
        bullet.connect(bullet.DIRECT)
        bullet.setGravity(0.0, 0.0, -GRAVITY)
        bullet.setPhysicsEngineParameter(fixedTimeStep=DT, numSubSteps=1,
                                         restitutionVelocityThreshold=0.0)
        half = [entry / 2 for entry in BLOCK['size']]
        self._collider(bullet.GEOM_PLANE, planeNormal=[0, 0, 1])
        self._collider(bullet.GEOM_SPHERE, BALL['position'], radius=BALL['radius'])
        self.block = self._collider(bullet.GEOM_BOX, BLOCK['position'], halfExtents=half)
        shape = bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=SMALL)
        self.bodies = [self._body(shape, place, 1.0, MOVING, STILL) for place in job.position]
        poses = block_poses(WORKS[job.work].steps)
        turn = np.arctan2(poses[:, 4], poses[:, 3])
        self.poses = [(row[:3], bullet.getQuaternionFromEuler([0.0, 0.0, angle]))
                      for row, angle in zip(poses.tolist(), turn)]
        self.begin()

    def _collider(self, kind, place=(0.0, 0.0, 0.0), **size):
        shape = bullet.createCollisionShape(kind, **size)
        return self._body(shape, place, 0.0, STILL, MOVING)

    def _body(self, shape, place, mass, group, others):
        restitution = 1.0 if mass else RESTITUTION       # those of two bodies are multiplied
        body = bullet.createMultiBody(mass, shape, basePosition=place)
        bullet.changeDynamics(body, -1, restitution=restitution, linearDamping=0.0,
                              lateralFriction=1.0 if mass else FRICTION, angularDamping=0.0)
        bullet.setCollisionFilterGroupMask(body, -1, group, others)
        return body

    def begin(self):
        """Go back to the start."""
        for body, place, speed in zip(self.bodies, self.job.position + LIFT, self.job.velocity):
            bullet.resetBasePositionAndOrientation(body, place, [0.0, 0.0, 0.0, 1.0])
            bullet.resetBaseVelocity(body, speed, [0.0, 0.0, 0.0])

    def run(self, steps):
        """Take the steps."""
        for step in range(steps):
            bullet.resetBasePositionAndOrientation(self.block, *self.poses[step])
            bullet.resetBaseVelocity(self.block, BLOCK_SPEED, [0.0, 0.0, BLOCK_SPIN])
            bullet.stepSimulation()

    def state(self):
        """Give positions and velocities."""
        places = [bullet.getBasePositionAndOrientation(body)[0] for body in self.bodies]
        speeds = [bullet.getBaseVelocity(body)[0] for body in self.bodies]
        return np.array(places) - LIFT, np.array(speeds)


def runner(job):
    """Give the way to do a job."""
    return choose(job, {'1': Bodies}, 'bodies, not particles')(job)
