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

"""Colliders as solids on the page of the viewer, in their own frames."""

from collision_sim.appearance import collider_color, turn_to
import numpy as np

AROUND = 48             # corners of what is round
PLANE_SIZE = 4.0        # of the size of the scene


def add_solid(scene, collider, size):
    """
    Put a collider on the page.

    Parameters
    ----------
    scene : viser.SceneApi
        Of the page.
    collider : Collider
        Its pose is not used.
    size : float [m]
        Of the whole scene.

    Returns
    -------
    handle : viser.SceneNodeHandle
        To be placed.

    """
    name = '/colliders/' + collider.name
    handle = scene.add_frame(name, show_axes=False)
    if collider.shape == 'plane':
        _add_plane(scene, name, collider, size)
        return handle
    *color, opacity = collider_color(collider)
    look = {'color': tuple(color), 'side': 'double'}
    if collider.inside:
        look |= {'opacity': opacity, 'cast_shadow': False, 'receive_shadow': False}
    a, b, c = collider.size
    name += '/solid'
    if collider.shape == 'box':
        scene.add_box(name, dimensions=(2 * a, 2 * b, 2 * c), **look)
    elif collider.shape == 'cylinder':
        scene.add_cylinder(name, radius=a, height=2 * b, radial_segments=AROUND, **look)
    elif collider.shape == 'mesh':
        scene.add_mesh_simple(name, collider.mesh.vertices, collider.mesh.faces,
                              flat_shading=True, **look)
    else:
        scene.add_mesh_simple(name, *capsule(a, b), **look)
    return handle


def _add_plane(scene, name, collider, size):
    """Show a square of a plane, with a grid whose cells are of a round length."""
    x, y, z, w = turn_to(collider.normal)
    cell = 0.5 * 10.0 ** np.floor(np.log10(size / 2.0))
    width, thickness = PLANE_SIZE * size, 1e-3 * size
    scene.add_frame(name + '/solid', show_axes=False, wxyz=(w, x, y, z))
    scene.add_box(name + '/solid/slab', dimensions=(width, width, thickness),
                  position=(0.0, 0.0, -thickness), color=(172, 177, 186), cast_shadow=False)
    scene.add_grid(name + '/solid/grid', width=width, height=width, cell_size=cell,
                   section_size=2 * cell, cell_color=(155, 160, 170),
                   section_color=(130, 135, 146), shadow_opacity=0.0, fade_distance=8 * size)


def capsule(radius, half):
    """
    Make a mesh of a capsule along z, of a sphere where its half length is 0.

    Parameters
    ----------
    radius, half : float [m]
        Half: of the line between the centres of the caps.

    Returns
    -------
    vertices : (V, 3) float32 [m]
    faces : (T, 3) int64
        Their corners turn left as seen from outside.

    """
    polar = np.linspace(0.0, np.pi, AROUND // 2 + 2)
    polar = np.insert(polar, len(polar) // 2, polar[len(polar) // 2])
    shift = np.where(np.arange(len(polar)) < len(polar) // 2, half, -half)
    around = np.arange(AROUND) * 2.0 * np.pi / AROUND
    vertices = np.empty((len(polar), AROUND, 3))
    vertices[:, :, 0] = radius * np.sin(polar)[:, None] * np.cos(around)
    vertices[:, :, 1] = radius * np.sin(polar)[:, None] * np.sin(around)
    vertices[:, :, 2] = (radius * np.cos(polar) + shift)[:, None]
    here = np.arange((len(polar) - 1) * AROUND).reshape(-1, AROUND)
    right, below = np.roll(here, -1, axis=1), here + AROUND
    faces = np.stack([here, below, right, right, below, np.roll(below, -1, axis=1)], axis=-1)
    return vertices.reshape(-1, 3).astype(np.float32), faces.reshape(-1, 3)
