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
The picture in README.md: paths of a few particles past a ball and a swinging paddle.

Run as `python -m collision_sim.studies.picture FILE`; needs matplotlib. It is demo.png of
collision_sim/docs/pictures.
"""

import sys

from collision_sim.core.rules import COLLISION
from collision_sim.scene import Scene
from collision_sim.simulation import Simulation
import numpy as np

DURATION = 2.6          # s
SWING, PERIOD = 0.35, 1.3   # m, s
BALL, PADDLE = 0.3, (0.08, 0.5, 0.55)   # m
COUNT = 22


def side_scene():
    """Particles in the plane y = 0 above ground, ball and paddle."""
    x = np.linspace(-1.25, 1.25, COUNT)
    z = 1.35 + 0.25 * np.cos(9.0 * x)
    return Scene.from_dict({
        'particles': {'position': np.stack([x, 0.0 * x, z], axis=1).tolist()},
        'restitution': 0.6, 'friction': {'dry': 0.3},
        'colliders': [
            {'name': 'ground', 'shape': 'plane', 'point': [0, 0, 0], 'normal': [0, 0, 1]},
            {'name': 'ball', 'shape': 'sphere', 'radius': BALL, 'position': [-0.5, 0, 0.3]},
            {'name': 'paddle', 'shape': 'box', 'size': list(PADDLE), 'position': [0.55, 0, 0.3]}],
        'stepping': {'dt': 1 / 480}})


def run(scene):
    """Positions and speeds of all steps, and the points of the collisions."""
    simulation, paths, speeds, hits = Simulation(scene), [], [], []
    while simulation.time < DURATION:
        end = simulation.time + simulation.dt
        x = 0.55 + SWING * np.sin(2.0 * np.pi * end / PERIOD)
        simulation.move_collider('paddle', [x, 0.0, 0.3], [0, 0, 0, 1])
        simulation.step()
        paths.append(simulation.position[:, ::2].copy())
        speeds.append(np.linalg.norm(simulation.velocity, axis=1))
        contacts = simulation.contacts
        hits.append(contacts.point[contacts.state == COLLISION][:, ::2])
    return np.array(paths), np.array(speeds), np.concatenate(hits)


def draw(path):
    """Write the picture to a file."""
    from matplotlib import pyplot
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Circle, Rectangle
    paths, speeds, hits = run(side_scene())
    figure, axes = pyplot.subplots(figsize=(10, 5.2), dpi=110)
    axes.axhspan(-0.12, 0, color='0.82')
    axes.add_patch(Circle((-0.5, 0.3), BALL, color='0.72'))
    for phase, shade in ((-1, '0.88'), (1, '0.88'), (0, '0.72')):
        corner = (0.55 + phase * SWING - PADDLE[0] / 2, 0.3 - PADDLE[2] / 2)
        axes.add_patch(Rectangle(corner, PADDLE[0], PADDLE[2], color=shade))
    segments = np.stack([paths[:-1], paths[1:]], axis=2).reshape(-1, 2, 2)
    lines = LineCollection(segments, cmap='viridis', linewidths=1.1, zorder=2)
    lines.set_array(speeds[1:].ravel())
    axes.add_collection(lines)
    axes.scatter(*hits.T, s=9, color='tab:red', zorder=3, label='collision')
    axes.scatter(*paths[-1].T, s=26, color='black', zorder=4,
                 label=f'after {DURATION:g} s')
    axes.annotate('', (0.55 + SWING, 0.68), (0.55 - SWING, 0.68),
                  arrowprops={'arrowstyle': '<->', 'color': '0.35'})
    axes.set(aspect='equal', xlim=(-2.0, 2.0), ylim=(-0.12, 1.75), xlabel='x [m]', ylabel='z [m]')
    axes.legend(loc='upper right', frameon=False)
    figure.colorbar(lines, label='speed [m/s]', shrink=0.7)
    figure.savefig(path, bbox_inches='tight')


if __name__ == '__main__':
    draw(sys.argv[1])
