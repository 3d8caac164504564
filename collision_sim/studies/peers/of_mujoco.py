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

"""Work 1 in MuJoCo: each particle is a small sphere that does not turn."""

from collision_sim.studies.bench_works import (BALL, BLOCK, block_poses, DT, FRICTION, GRAVITY,
                                               WORKS)
from collision_sim.studies.peers.job import at_most, choose
import mujoco
import numpy as np

MOST = 10 ** 3
SMALL = 0.005                   # m
LIFT = (0.0, 0.0, SMALL)
SOFT, DAMPING = 0.02, 0.215     # time constant [s] and damping ratio of a contact: restores half


def words(numbers):
    """Give numbers as XML has them."""
    return ' '.join(map(repr, map(float, numbers)))


def model_of(position):
    """Give the model in MJCF: colliders, and bodies that collide with those only."""
    slides = ''.join(f'<joint type="slide" axis="{axis}"/>' for axis in ('1 0 0', '0 1 0',
                                                                         '0 0 1'))
    bodies = ''.join(f'<body pos="{words(place)}">{slides}<geom type="sphere" size="{SMALL}" '
                     'mass="1"/></body>' for place in position)
    still = 'contype="1" conaffinity="2"'
    half = words(entry / 2 for entry in BLOCK['size'])
    return f"""<mujoco><option timestep="{DT!r}" gravity="0 0 {-GRAVITY}" cone="elliptic"/>
        <size memory="2G"/>
        <default><geom contype="2" conaffinity="1" condim="3" friction="{FRICTION} 0 0"
          solref="{SOFT} {DAMPING}"/></default>
        <worldbody><geom type="plane" size="0 0 1" {still}/>
        <geom type="sphere" size="{BALL['radius']}" pos="{words(BALL['position'])}" {still}/>
        <body mocap="true" pos="{words(BLOCK['position'])}">
        <geom type="box" size="{half}" {still}/></body>{bodies}</worldbody></mujoco>"""


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
        self.model = mujoco.MjModel.from_xml_string(model_of(job.position + LIFT))
        self.data = mujoco.MjData(self.model)
        poses = block_poses(WORKS[job.work].steps)
        half = np.arctan2(poses[:, 4], poses[:, 3]) / 2
        self.places = poses[:, :3]
        self.turns = np.column_stack([np.cos(half), 0 * half, 0 * half, np.sin(half)])
        self.begin()

    def begin(self):
        """Go back to the start."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qvel[:] = self.job.velocity.ravel()

    def run(self, steps):
        """Take the steps."""
        for step in range(steps):
            self.data.mocap_pos[0] = self.places[step]
            self.data.mocap_quat[0] = self.turns[step]
            mujoco.mj_step(self.model, self.data)

    def state(self):
        """Give positions and velocities."""
        return (self.job.position + self.data.qpos.reshape(-1, 3),
                self.data.qvel.reshape(-1, 3))


def runner(job):
    """Give the way to do a job."""
    return choose(job, {'1': Bodies}, 'bodies, not particles')(job)
