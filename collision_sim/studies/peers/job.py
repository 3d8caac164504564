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

"""What a worker is asked to do."""

from typing import NamedTuple

from collision_sim.scene import Scene


class Unable(Exception):
    """A toolkit that cannot do a work; says why."""


class Job(NamedTuple):
    """
    A work for a runner.

    Attributes
    ----------
    work : str
        A key of bench_works.WORKS.
    scene : Scene
        Its scene.
    threads : int
        Most threads to use.
    variant : str
        Which way to do it, where a toolkit has several.

    """

    work: str
    scene: Scene
    threads: int
    variant: str

    @property
    def position(self):
        """Positions at the start, (N, 3) float64 [m]."""
        return self.scene.particles.position

    @property
    def velocity(self):
        """Velocities at the start, (N, 3) float64 [m/s]."""
        return self.scene.particles.velocity

    @property
    def count(self):
        """Tell the number of particles."""
        return len(self.position)


def at_most(job, most, reason):
    """Refuse more particles than a toolkit takes in a reasonable time."""
    if job.count > most:
        raise Unable(f'{reason}: {most:g} particles at most')


def one_by_one(job):
    """Refuse to do several steps in one call, for works whose particles meet each other."""
    if job.variant == 'fused':
        raise Unable('the particles of a step depend on each other')


def choose(job, ways, reason):
    """
    Give the way to do the work of a job.

    Parameters
    ----------
    job : Job
        Whose work it is.
    ways : dict of str to type
        By work; '1' is also for '1-rest' and '1-slide'.
    reason : str
        Why the others are missing.

    """
    kind = job.work.partition('-')[0]
    if kind not in ways:
        raise Unable(reason)
    return ways[kind]
