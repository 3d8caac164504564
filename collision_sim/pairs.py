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


"""What particles of a scene do when they meet each other, and how that is read."""

from dataclasses import dataclass, replace

from collision_sim.checks import read_leaves, read_section, SceneError
from collision_sim.colliders import RESTITUTION
from collision_sim.friction import (FRICTION, Friction, friction_parameters, read_friction,
                                    with_friction)
import numpy as np


@dataclass(frozen=True)
class Pairs:
    """
    Laws of the collisions and contacts of particles with each other.

    Attributes
    ----------
    restitution : float or None [-]
    friction : Friction or None
        None: that of the scene.

    """

    restitution: float | None = None
    friction: Friction | None = None

    def restitution_in(self, scene) -> float:
        """Give the restitution, its own or the scene's."""
        return scene.restitution if self.restitution is None else self.restitution

    def friction_in(self, scene) -> Friction:
        """Give the friction, its own or the scene's."""
        return scene.friction if self.friction is None else self.friction

    def parameters(self, scene):
        """Give what may change while the simulation runs, by its path in the scene."""
        return {'pairs.restitution': RESTITUTION.parameter(self.restitution_in(scene)),
                **friction_parameters(self.friction_in(scene), 'pairs.friction')}

    def has(self, keys) -> bool:
        """Whether a parameter of these keys can be set."""
        return keys == ['restitution'] or (
            keys[:1] == ['friction'] and '.'.join(keys[1:]) in FRICTION)

    def with_parameter(self, scene, keys, value, path):
        """Give a copy in which the parameter of these keys has another value."""
        if keys == ['restitution']:
            return replace(self, restitution=RESTITUTION.read(value, path))
        friction = with_friction(self.friction_in(scene), keys[1:], value, path)
        return replace(self, friction=friction)


def read_pairs(value, particles, stepping) -> Pairs | None:
    """
    Read what particles do when they meet.

    Parameters
    ----------
    value : dict or None
        The section; an empty one, {}, takes all from the scene.
    particles, stepping : Particles, Stepping
        Of the scene.

    Returns
    -------
    Pairs or None
        None where there is no such section.

    Raises
    ------
    SceneError
        For the first value that is not allowed.

    """
    if value is None:
        return None
    section = read_section(value, 'pairs', ('restitution', 'friction'))
    pairs = Pairs(read_leaves(section, 'pairs', {'restitution': RESTITUTION}).get('restitution'),
                  read_friction(section.get('friction'), 'pairs.friction'))
    if len(particles.position) and not np.any(particles.radius):
        raise SceneError('particles.radius', 0.0, 'must be above 0 for some particles with pairs: '
                                                  'points never meet')
    return pairs
