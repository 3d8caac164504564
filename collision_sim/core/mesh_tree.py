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
The tree over the triangles of a mesh, in the order of a descent.

Done once when a simulation starts.
"""

from collision_sim.core.jit import kernel, law
from collision_sim.core.mesh import COUNT, HIGH, LOW, NEXT, NODE
import numpy as np

LEAF = 4                # most triangles in a leaf


@kernel
def _select(order, keys, first, last, middle):
    """Sort order[first:last] as far as the place `middle` divides smaller keys from larger."""
    last -= 1
    while first < last:
        pivot, i, j = keys[order[(first + last) // 2]], first, last
        while i <= j:
            while keys[order[i]] < pivot:
                i += 1
            while keys[order[j]] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i, j = i + 1, j - 1
        if middle <= j:
            last = j
        elif middle >= i:
            first = i
        else:
            return


@law
def tree(lows, highs):
    """
    Tree over boxes by halving them along the longest axis of their centres.

    Parameters
    ----------
    lows, highs : (3, T) float64 [m]
        Corners of the boxes.

    Returns
    -------
    order : (T,) int64
        Boxes in the order of the leaves.
    nodes : (K, mesh.NODE) float64

    """
    count = lows.shape[1]
    order, nodes = np.arange(count), np.zeros((2 * count, NODE))
    todo, top, size = np.empty((64, 2), dtype=np.int64), 1, 0
    todo[0, 0], todo[0, 1] = 0, count
    centres = lows + highs
    while top > 0:
        top -= 1
        first, last = todo[top, 0], todo[top, 1]
        axis, widest = 0, -1.0
        for k in range(3):
            low, high, left, right = np.inf, -np.inf, np.inf, -np.inf
            for i in order[first:last]:
                low, high = min(low, lows[k, i]), max(high, highs[k, i])
                left, right = min(left, centres[k, i]), max(right, centres[k, i])
            nodes[size, LOW + k], nodes[size, HIGH + k] = low, high
            if right - left > widest:
                axis, widest = k, right - left
        if last - first <= LEAF:
            nodes[size, COUNT], nodes[size, NEXT] = last - first, first
        else:
            middle = (first + last) // 2
            _select(order, centres[axis], first, last, middle)
            todo[top, 0], todo[top, 1] = middle, last
            todo[top + 1, 0], todo[top + 1, 1] = first, middle
            top += 2
        size += 1
    _skip_subtrees(nodes, size)
    return order, nodes[:size].copy()


@kernel
def _skip_subtrees(nodes, size):
    """Write to each inner node the one to go on at after its subtree."""
    for i in range(size - 1, -1, -1):
        if nodes[i, COUNT] == 0.0:
            right = i + 2 if nodes[i + 1, COUNT] > 0.0 else int(nodes[i + 1, NEXT])
            nodes[i, NEXT] = right + 1 if nodes[right, COUNT] > 0.0 else nodes[right, NEXT]
