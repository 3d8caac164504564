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
The works that `collision_sim bench` measures: scenes of any number of particles.

The constants here are all that a peer needs to know to do the same work with its own means.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from collision_sim.scene import Scene
import numpy as np

DT, GRAVITY, RESTITUTION, FRICTION = 1 / 240, 9.81, 0.5, 0.3
BALL = {'name': 'ball', 'shape': 'sphere', 'radius': 0.5, 'position': [-1.0, 0.0, 0.5]}
BLOCK_SPIN, BLOCK_SPEED = 2.0, (0.2, 0.0, 0.1)      # rad/s about z, m/s
BLOCK = {'name': 'block', 'shape': 'box', 'size': [1.0, 1.0, 0.2], 'position': [0.75, 0.0, 0.7],
         'motion': {'linear_velocity': list(BLOCK_SPEED),
                    'angular_velocity': [0.0, 0.0, BLOCK_SPIN]}}
GROUND = {'name': 'ground', 'shape': 'plane'}
SIDE, TOP = 4.0, 5.0            # m; of the space that the points of work 1 fall from
MARGIN = 0.01                   # m; between points and colliders at the start
SLIDING = 5.0                   # m/s; slides on for a second: FRICTION * GRAVITY is 2.9 m/s^2

RADIUS, PACKING, BOUNCE = 0.05, 0.2, 0.9            # work 2
SPEED = 0.7                     # m/s; 0.036 pairs touch a particle-step

RING, TUBE, FACES = 1.0, 0.4, 50                    # work 3: radii [m], 2 * 50 * 50 triangles
RING_HEIGHT = 0.9               # m; of the centre of the torus
RAIN = (1.4, 1.35, 3.3)         # m; half the side, bottom and top of where its points start
NEAR = 0.02                     # m; a particle is near the torus within this of its bounding box


class Work(NamedTuple):
    """
    A scene to measure.

    Attributes
    ----------
    title : str
        For the reader.
    steps : int
        Of dt; one run. All runs begin at the start of the scene.
    sections : callable
        From the number of particles and a folder, which it may write files to, to the scene.
    moved : int
        Bytes that a step has to move for a particle, at least, in float64.
    why : str
        What these bytes are.
    band : float
        Relative difference of means over the particles up to which a result is the same.

    """

    title: str
    steps: int
    sections: Callable
    moved: int
    why: str
    band: float

    def scene(self, count, folder):
        """Give the scene of so many particles; `folder` holds its files."""
        return Scene.from_dict(self.sections(count, Path(folder)), folder)


def fall(count, folder):
    """Give work 1: points fall on the ground, a ball and a box that moves and turns."""
    return _work_1(_scattered(count))


def rest(count, folder):
    """Give work 1 with every point at rest on the ground."""
    return _work_1(_spread(count, 0.0))


def slide(count, folder):
    """Give work 1 with every point sliding on the ground."""
    return _work_1(_spread(count, 0.0), [SLIDING, 0.0, 0.0])


def _work_1(position, velocity=(0.0, 0.0, 0.0)):
    return {'gravity': [0.0, 0.0, -GRAVITY],
            'particles': {'position': position, 'velocity': velocity},
            'restitution': RESTITUTION, 'friction': {'dry': FRICTION},
            'colliders': [GROUND, BALL, BLOCK], 'stepping': {'dt': DT}}


def moves(work):
    """Tell whether a collider moves in a work, by its key: the box of work 1."""
    return work.partition('-')[0] == '1'


def _spread(count, height):
    """Put points where nothing else is: on the far side of the ball and the box, and beyond."""
    random = np.random.default_rng(1)
    return random.uniform((3.0, -SIDE, height), (3.0 + SIDE, SIDE, height), (count, 3))


def _scattered(count):
    """Draw points above the ground that are outside the ball and the box."""
    random = np.random.default_rng(0)
    points = np.empty((0, 3))
    while len(points) < count:
        drawn = random.uniform((-SIDE / 2, -SIDE / 2, MARGIN), (SIDE / 2, SIDE / 2, TOP),
                               (count, 3))
        points = np.concatenate([points, drawn[_is_free(drawn)]])
    return points[:count]


def _is_free(points):
    to_ball = np.linalg.norm(points - BALL['position'], axis=1) - BALL['radius']
    beyond = np.abs(points - BLOCK['position']) - np.array(BLOCK['size']) / 2
    return (to_ball > MARGIN) & (beyond.max(axis=1) > MARGIN)


def block_poses(steps):
    """
    Pose of the box of work 1 at the ends of its steps, the start first.

    Parameters
    ----------
    steps : int
        Of DT.

    Returns
    -------
    poses : (steps + 1, 5) float64
        Position [m], cosine and sine of its angle about z.

    """
    time = DT * np.arange(steps + 1)
    angle = BLOCK_SPIN * time
    position = BLOCK['position'] + time[:, None] * np.array(BLOCK_SPEED)
    return np.column_stack([position, np.cos(angle), np.sin(angle)])


def block_moves(steps):
    """
    Poses of the box of work 1 at the ends of its steps, to hand over one by one.

    Parameters
    ----------
    steps : int
        Of DT.

    Returns
    -------
    moves : list of (list, list)
        Position [m] and orientation, a quaternion x, y, z, w.

    """
    poses = block_poses(steps)[1:]
    half = 0.5 * np.arctan2(poses[:, 4], poses[:, 3])
    turns = np.column_stack([np.zeros((steps, 2)), np.sin(half), np.cos(half)])
    return list(zip(poses[:, :3].tolist(), turns.tolist()))


def pack(count):
    """
    Balls of work 2: a jittered lattice that fills a box to PACKING.

    Parameters
    ----------
    count : int
        Of the balls.

    Returns
    -------
    position, velocity : (count, 3) float64 [m], [m/s]
        No two balls overlap; velocities of SPEED in all directions.
    size : (3,) float64 [m]
        Edge lengths of the box, which is centred at the origin.

    """
    random = np.random.default_rng(2)
    pitch = RADIUS * (4.0 / 3.0 * np.pi / PACKING) ** (1 / 3)
    wide = int(np.ceil(round(count ** (1 / 3), 6)))
    layers = -(-count // wide ** 2)
    size = pitch * np.array([wide, wide, count / wide ** 2])
    step = size / (wide, wide, layers)
    sites = np.indices((layers, wide, wide)).reshape(3, -1)[::-1, :count].T
    jitter = random.uniform(-0.5, 0.5, (count, 3)) * (step - 2.0 * RADIUS)
    direction = random.standard_normal((count, 3))
    velocity = SPEED * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    return (sites + 0.5) * step - size / 2 + jitter, velocity, size


def collide(count, folder):
    """Give work 2: equal balls collide with each other in a box, without gravity."""
    position, velocity, size = pack(count)
    walls = {'name': 'walls', 'shape': 'box', 'size': size, 'inside': True}
    return {'gravity': [0.0, 0.0, 0.0],
            'particles': {'position': position, 'velocity': velocity, 'radius': RADIUS},
            'restitution': BOUNCE, 'pairs': {'restitution': BOUNCE}, 'colliders': [walls],
            'stepping': {'dt': DT}}


def torus():
    """
    Surface of work 3, closed and lying flat, FACES quadrangles around and along the tube.

    Returns
    -------
    points : (FACES**2, 3) float64 [m]
        About the centre of the torus.
    triangles : (2 * FACES**2, 3) int64
        Rows of points, counter-clockwise seen from outside.

    """
    turn = 2.0 * np.pi * np.arange(FACES) / FACES
    around, tube = (angle.ravel() for angle in np.meshgrid(turn, turn, indexing='ij'))
    reach = RING + TUBE * np.cos(tube)
    points = np.column_stack([reach * np.cos(around), reach * np.sin(around),
                              TUBE * np.sin(tube)])
    i, j = np.indices((FACES, FACES)).reshape(2, -1)
    a, b = FACES * i + j, FACES * ((i + 1) % FACES) + j
    c, d = FACES * ((i + 1) % FACES) + (j + 1) % FACES, FACES * i + (j + 1) % FACES
    return points, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def write_torus(path):
    """Write the torus to an OBJ file."""
    points, triangles = torus()
    lines = [*('v {!r} {!r} {!r}'.format(*point) for point in points.tolist()),
             *('f {} {} {}'.format(*triangle) for triangle in (triangles + 1).tolist())]
    Path(path).write_text('\n'.join(lines) + '\n')


def rain(count, folder):
    """Give work 3: points fall on a torus of triangles and a floor."""
    write_torus(folder / 'torus.obj')
    side, bottom, top = RAIN
    drops = {'count': count, 'seed': 3,
             'box': {'min': [-side, -side, bottom], 'max': [side, side, top]}}
    mesh = {'name': 'torus', 'shape': 'mesh', 'file': 'torus.obj',
            'position': [0.0, 0.0, RING_HEIGHT]}
    return {'gravity': [0.0, 0.0, -GRAVITY], 'particles': drops, 'restitution': RESTITUTION,
            'friction': {'dry': FRICTION}, 'colliders': [GROUND, mesh],
            'stepping': {'dt': DT, 'detection': 'trajectory'}}


def is_near_torus(points):
    """Tell which points are near the torus of work 3: in its bounding box, NEAR wider."""
    reach = np.array([RING + TUBE, RING + TUBE, TUBE]) + NEAR
    return (np.abs(points - (0.0, 0.0, RING_HEIGHT)) < reach).all(axis=1)


STATE = 'position and velocity, read and written'
LOOSE, CLOSE = 0.25, 0.1    # bands: where answers to a contact differ, and where they do not
WORKS = {
    '1': Work('Work 1: points, ground, ball, moving and turning box; contacts sparse', 240, fall,
              96, STATE, LOOSE),
    '1-rest': Work('Work 1, every point at rest on the ground', 240, rest, 96, STATE, CLOSE),
    '1-slide': Work('Work 1, every point sliding on the ground', 240, slide, 96, STATE, CLOSE),
    '2': Work(f'Work 2: equal balls, packing {PACKING}', 60, collide, 192,
              STATE + ', twice: they are sorted into cells', CLOSE),
    '3': Work(f'Work 3: points fall on a torus of {2 * FACES ** 2} triangles and a floor', 240,
              rain, 96, STATE, LOOSE),
}
