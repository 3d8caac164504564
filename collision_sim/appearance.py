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

"""What things look like, wherever they are shown: colours of states, colliders and speeds."""

from collision_sim.core.rules import COLLISION, REPULSION, SLIDE, STICK
import numpy as np

LENGTH = 0.1            # m of a line for an impulse of 1 N s
LONGEST = 0.5           # m

# Red, green, blue and opacity from 0 to 1.
STATE_COLORS = np.zeros((5, 4), '<f4')      # a row a state of a contact
STATE_COLORS[COLLISION] = 1.0, 0.2, 0.1, 1.0
STATE_COLORS[SLIDE] = 1.0, 0.8, 0.0, 1.0
STATE_COLORS[STICK] = 0.1, 0.8, 0.2, 1.0
STATE_COLORS[REPULSION] = 0.7, 0.2, 1.0, 1.0
_FIXED, _MOVING = (0.55, 0.58, 0.62, 0.8), (0.2, 0.5, 0.9, 0.9)
_INSIDE = 0.12          # opacity of a collider that keeps the particles inside

# Viridis, perceptually uniform: S. van der Walt and N. Smith, 2015 (CC0), at every eighth.
_VIRIDIS = np.array([(68, 1, 84), (71, 44, 122), (59, 81, 139), (44, 113, 142), (33, 144, 141),
                     (39, 173, 129), (92, 200, 99), (170, 220, 50), (253, 231, 37)])
SPEED_COLORS = np.stack(
    [np.interp(np.linspace(0, 8, 256), range(9), channel) for channel in _VIRIDIS.T],
    axis=1).round().astype(np.uint8)    # (256, 3), from rest to the greatest speed


def collider_color(collider):
    """Give red, green, blue and opacity of a collider."""
    color = _MOVING if collider.moving else _FIXED
    return (*color[:3], _INSIDE) if collider.inside else color


def turn_to(normal):
    """Give the quaternion x, y, z, w that turns the z axis to a unit normal."""
    x, y, z = normal
    if z < -1.0 + 1e-12:
        return (1.0, 0.0, 0.0, 0.0)
    w = ((1.0 + z) / 2.0) ** 0.5
    return (-y / (2.0 * w), x / (2.0 * w), 0.0, w)


def speed_colors(speed, greatest):
    """
    Give the colours of speeds.

    Parameters
    ----------
    speed : (N,) float [m/s]
        Those above the greatest get its colour.
    greatest : float [m/s]
        0 where everything rests.

    Returns
    -------
    colors : (N, 3) uint8
        Red, green, blue.

    """
    scale = (len(SPEED_COLORS) - 1) / greatest if greatest > 0.0 else 0.0
    rows = np.minimum(scale * speed, len(SPEED_COLORS) - 1).astype(np.intp)
    return SPEED_COLORS.take(rows, axis=0)      # an index takes four times as long


def contact_lines(contacts, most):
    """
    Lines from points of contact along the normals, as long as the impulses ask for.

    Parameters
    ----------
    contacts : list of Contacts
        What is not finite is left out.
    most : int
        Lines; of more contacts every second, third, ... is taken.

    Returns
    -------
    start, end : (M, 3) float64 [m]
    state : (M,) int64
        Of core.rules.

    """
    if not contacts:
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0, dtype=np.int64)
    every = 1 + sum(len(one.state) for one in contacts) // most
    point, normal, impulse, state = (
        np.concatenate([getattr(one, name) for one in contacts])[::every]
        for name in ('point', 'normal', 'impulse', 'state'))
    with np.errstate(over='ignore'):
        size = np.minimum(LENGTH * np.sqrt(np.square(impulse).sum(axis=1)), LONGEST)
    end = point + size[:, None] * normal
    finite = np.isfinite(point).all(axis=1) & np.isfinite(end).all(axis=1)
    return point[finite], end[finite], state[finite]
