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
Triangles without area, taken out of a mesh without leaving a gap.

A triangle two of whose corners are the same goes away by itself: its two other edges are one. One
whose corners lie on a line has a corner on the edge between the others. It hands that corner to
its neighbour across that edge, which becomes two triangles.
"""

import numpy as np

MOST_ROUNDS = 10        # times as many corners may be handed over as there are needles


def triangle_heights(corners):
    """Smallest height [m] of triangles (T, 3, 3), (T,); 0 where corners fall together."""
    edges = np.roll(corners, -1, axis=1) - corners
    longest = np.sqrt(np.square(edges).sum(axis=2)).max(axis=1)
    area = np.sqrt(np.square(np.cross(edges[:, 0], edges[:, 1])).sum(axis=1))
    return np.divide(area, longest, out=np.zeros_like(area), where=longest > 0.0)


def without_needles(vertices, faces, thin):
    """
    Take out the triangles without area.

    Parameters
    ----------
    vertices : (V, 3) float64 [m]
        All different.
    faces : (T, 3) int64
        Triangles.
    thin : float [m]
        Greatest height of a triangle without area.

    Returns
    -------
    faces : (T', 3) int64
        The others, some of them divided. They close what they closed before, unless a needle has
        an edge with three or more triangles.

    """
    needles = triangle_heights(vertices[faces]) <= thin
    if not needles.any():
        return faces
    long = needles & (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)
    keys = edges[..., 0] * (faces.max() + 1) + edges[..., 1]
    near = np.flatnonzero(np.isin(keys, keys[long]).any(axis=1) & (long | ~needles))
    there = {t: tuple(face) for t, face in zip(near.tolist(), faces[near].tolist())}
    needles[near] = True        # they are replaced by what becomes of them
    divided = _divided(vertices, there, np.flatnonzero(long).tolist(), thin)
    return np.concatenate([faces[~needles], np.reshape(divided, (-1, 3)).astype(np.int64)])


def _divided(vertices, there, todo, thin):
    """Let needles, numbers `todo` of triangles `there`, hand over; give those with an area."""
    at, needles, most = {}, set(), max(there, default=0) + MOST_ROUNDS * len(todo)
    count = max(there, default=0)

    def enter(t, face):
        there[t] = face
        for edge in _edges(face):
            at.setdefault(edge, set()).add(t)
        if triangle_heights(vertices[[face]])[0] <= thin:
            needles.add(t)

    def remove(t):
        for edge in _edges(there.pop(t)):
            at[edge].discard(t)
        needles.discard(t)

    for t, face in list(there.items()):
        enter(t, face)
    while todo and count < most:
        t = todo.pop()
        if t not in needles:
            continue
        a, b, c = _long_edge_first(vertices, there[t])
        others = at[frozenset((a, b))] - {t}
        if len(others) != 1:
            continue
        other, = others
        first, last, apex = _from_edge(there[other], a, b)
        if apex == c or (other in needles and apex != _long_edge_first(
                vertices, there[other])[2]):
            continue        # it will be looked at again once that one has handed over
        remove(t)
        remove(other)
        for face in ((first, c, apex), (c, last, apex)):
            count += 1
            enter(count, face)
            todo += [k for edge in _edges(face) for k in at[edge] if k in needles]
    return [face for t, face in there.items() if t not in needles]


def _edges(face):
    a, b, c = face
    return frozenset((a, b)), frozenset((b, c)), frozenset((c, a))


def _long_edge_first(vertices, face):
    """Give the corners of a triangle, the same way round, the ends of its longest edge first."""
    turns = [face[k:] + face[:k] for k in range(3)]
    return max(turns, key=lambda turn: np.square(vertices[turn[1]] - vertices[turn[0]]).sum())


def _from_edge(face, a, b):
    """Give the corners of a triangle, the same way round, beginning with its edge a b or b a."""
    return next(turn for turn in (face[k:] + face[:k] for k in range(3))
                if turn[2] not in (a, b))
