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
What a particle meets on its way through a mesh, and how far it is inside where the way ends.

Within a step the same question comes again: passes begin where the step began, and who is placed
is tested on the way that was followed last. The last answers of each collider are kept with their
questions, to the last bit: they are never out of date, and nothing depends on whether they were
kept. They are None where nobody keeps them.
"""

from math import inf
from typing import NamedTuple

from collision_sim.core.jit import inlined, kernel, law
from collision_sim.core.mesh import (FACE, feature_normal, is_in_front, is_inside, nearest,
                                     NONE, normal_towards, SURE)
from collision_sim.core.mesh_cells import EXTENT
from collision_sim.core.mesh_path import meet
from collision_sim.core.rules import STRAIGHT
from collision_sim.core.vectors import dot, largest, length, scaled, subtract
import numpy as np

# Columns of the answers (C, ANSWERS), NaN at first: a place, and whether it is inside; a way from
# and to, radius and skin, and what was met on it.
PLACE, INSIDE, FROM, TO, SIZES, WAY, ANSWERS = 0, 3, 4, 7, 10, 12, 20


class Way(NamedTuple):
    """
    What is met on a way, in the frame of the mesh.

    tau, n: first time, from 0 to 1 or mesh_path.UNMET, and the normal there; phi [m], end: signed
    distance less radius and skin where the way ends, infinity if nothing is met, and the normal.
    """

    tau: float
    n: tuple
    phi: float
    end: tuple


@law
def keep_answers(meshes, table):
    """Return room for the last answers of each collider; none where there are no meshes."""
    if meshes.heads.shape[0] > 0:
        return np.full((table.shape[0], ANSWERS), np.nan)
    return np.empty((0, ANSWERS))


@inlined
def _is_at(answers, c, k, p):
    """Whether a point was asked about, in the columns from k on."""
    return answers[c, k] == p[0] and answers[c, k + 1] == p[1] and answers[c, k + 2] == p[2]


@inlined
def _keep(answers, c, k, a):
    """Write a vector to the columns from k on."""
    answers[c, k], answers[c, k + 1], answers[c, k + 2] = a


@inlined
def _kept(answers, c, k):
    """Read a vector from the columns from k on."""
    return answers[c, k], answers[c, k + 1], answers[c, k + 2]


@inlined
def is_within(answers, meshes, c, m, p):
    """Whether a point is inside closed mesh m, that of collider c."""
    if answers.shape[0] > 0:
        if not _is_at(answers, c, PLACE, p):
            _keep(answers, c, PLACE, p)
            answers[c, INSIDE] = 1.0 if is_inside(meshes, m, p) else 0.0
        return answers[c, INSIDE] > 0.0
    return is_inside(meshes, m, p)


@inlined
def follow(answers, meshes, c, m, side, a, b, radius, skin):
    """
    Follow a particle on its way from a to b through mesh m, that of collider c.

    Parameters
    ----------
    answers : (C, ANSWERS) float64
        Of `keep_answers`; written. Without rows nobody keeps them.
    meshes, m, side, a, b, radius, skin
        As in mesh_path.meet.
    c : int
        Which collider.

    Returns
    -------
    Way

    """
    if answers.shape[0] > 0:
        if not (_is_at(answers, c, FROM, a) and _is_at(answers, c, TO, b)
                and answers[c, SIZES] == radius and answers[c, SIZES + 1] == skin):
            _keep(answers, c, FROM, a)
            _keep(answers, c, TO, b)
            answers[c, SIZES], answers[c, SIZES + 1] = radius, skin
            way = _follow(meshes, m, side, a, b, radius, skin)
            answers[c, WAY], answers[c, WAY + 1] = way.tau, way.phi
            _keep(answers, c, WAY + 2, way.n)
            _keep(answers, c, WAY + 5, way.end)
        return Way(answers[c, WAY], _kept(answers, c, WAY + 2), answers[c, WAY + 1],
                   _kept(answers, c, WAY + 5))
    return _follow(meshes, m, side, a, b, radius, skin)


@kernel
def _follow(meshes, m, side, a, b, radius, skin):
    """
    Follow a way as `follow`.

    The nearest point of the surface where it ends counts if that is part of the surface that was
    met: as the triangles get smaller, all is as with a smooth shape. Else it is the plane at which
    the particle was met.
    """
    tau, phi, n, crossings, met = meet(meshes, m, side, a, b, radius, skin)
    if tau > 1.0:
        return Way(tau, n, inf, n)
    if crossings > 1:
        return Way(tau, n, phi, n)
    rest, rho = scaled(1.0 - tau, subtract(b, a)), radius + skin
    d, t, feature, q = nearest(meshes, m, b, (length(rest) + rho) * (1.0 + SURE), met)
    if t == NONE or (crossings == 1 and is_on_rim(meshes, t, feature)):
        return Way(tau, n, phi, n)
    front = is_in_front(meshes, t, feature, q, b)
    end = normal_towards(meshes, t, feature, q, b, d, front, SURE * meshes.heads[m, EXTENT])
    behind = -1.0 if crossings == 1 else 1.0
    end, phi_end = scaled(behind, end), behind * d - rho
    if phi_end < 0.0 and dot(n, end) > STRAIGHT:
        return Way(tau, n, phi_end, end)
    return Way(tau, n, phi, n)


@inlined
def is_on_rim(meshes, t, feature):
    """Whether a feature lies on the rim of an open mesh, where it has no normal of its own."""
    return feature != FACE and largest(feature_normal(meshes, t, feature)) == 0.0
