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
A user's scene as a case of the report: its answer is the exact method, or a converged run.

Colliders that follow a topic stand still.
"""

from math import inf
from pathlib import Path

from collision_sim.checks import read_yaml, SceneError
from collision_sim.scene import load_scene, METHODS, scene_path
from collision_sim.studies.case import Case
from collision_sim.studies.errors import dt_of, SAMPLES, Setting, simulation
import numpy as np

FINER = 8               # steps of the converged run for one of the finest refinement
MOST = 256              # particles; of more, as many evenly chosen ones
EXACT = Setting('exact', 'end_of_step', 'ballistic')
BEST = ('second_order_contact', 'collision_then_contact')


def read(name):
    """
    Read a scene as a mapping with at most MOST particles.

    Parameters
    ----------
    name : str
        A YAML file or a shipped scene.

    Returns
    -------
    mapping : dict
        As in a file.
    scene : scene.Scene
        With all particles.

    """
    scene = load_scene(name)
    mapping = read_yaml(scene_path(name))
    particles = scene.particles
    count = len(particles.position)
    chosen = np.unique(np.linspace(0, count - 1, min(count, MOST)).round().astype(int)) \
        if count else slice(0)
    mass, radius = (np.broadcast_to(value, count)[chosen]
                    for value in (particles.mass, particles.radius))
    mapping['particles'] = {
        'position': particles.position[chosen], 'velocity': particles.velocity[chosen],
        'mass': mass.tolist(), 'radius': radius.tolist()}
    return mapping, scene


def states(case, setting, steps):
    """Positions and velocities (SAMPLES, N, 3) of a run with so many steps between samples."""
    sim = simulation(case, setting, dt_of(case, steps))
    found = []
    for _ in range(SAMPLES):
        sim.step(steps)
        found.append((sim.position.copy(), sim.velocity.copy()))
    return tuple(np.array(part) for part in zip(*found))


def apart(one, other):
    """Distance of two runs [m], RMS over particles and times."""
    return float(np.sqrt(np.mean(np.square(one[0] - other[0]).sum(axis=2)))) if one[0].size \
        else 0.0


def exact_answer(case):
    """Give the answer of the exact method and its rounding [m]; None where it refuses."""
    if EXACT.method not in METHODS:
        return None
    try:
        answer = states(case, EXACT, 1)
        rounding = apart(answer, states(case, EXACT, 3))
    except SceneError:
        return None
    return (answer, rounding) if np.isfinite(answer[0]).all() else None


def converged_answer(case, finest):
    """Give the answer of a fine run, its error [m] by half as many steps, and its setting."""
    method = next(method for method in BEST if method in METHODS)
    setting, steps = Setting(method, 'trajectory', 'ballistic'), finest * FINER
    answer = states(case, setting, steps)
    return answer, apart(answer, states(case, setting, steps // 2)), setting


def own_case(name, duration, finest):
    """
    Make a case of a user's scene.

    Parameters
    ----------
    name : str
        A YAML file or a shipped scene.
    duration : float [s]
        To compare over.
    finest : int
        Most steps of the refinement between two times of comparison.

    Returns
    -------
    case : case.Case
        Of at most MOST particles.
    scene : scene.Scene
        With all particles.

    """
    mapping, scene = read(name)
    title = Path(name).stem
    case = Case(title, title, mapping, duration, None, lambda setting: None, '', lost=inf)
    found = exact_answer(case)
    if found:
        answer, uncertainty = found
        why = 'The reference is the exact method'
    else:
        answer, uncertainty, setting = converged_answer(case, finest)
        why = f'The reference is a converged run ({setting.label}, ' \
              f'dt = {dt_of(case, finest * FINER):.2g} s)'
    path = np.linalg.norm(answer[0] - mapping['particles']['position'], axis=2)
    scale = float(np.sqrt(np.mean(np.square(path)))) if path.any() else 1.0
    why += f', itself wrong by about {uncertainty:.1e} m.'
    return case._replace(reference=lambda times: answer, why=why, scale=scale,
                         uncertainty=uncertainty), scene
