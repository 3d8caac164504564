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
The tables that the kernels read, made from a scene.

A row for each collider: shape and laws (shapes.py), pose at the start, script of its motion
(motion.py). Done when a simulation starts and when a parameter changes, never in a step.
"""

from collision_sim.colliders import check_method
from collision_sim.core.flight import flight_coefficients
from collision_sim.core.laws import WET_FORMS
from collision_sim.core.mesh import NO_MESHES
from collision_sim.core.mesh_build import joined, mesh_arrays
from collision_sim.core.motion import SCRIPT
from collision_sim.core.reference import refer
from collision_sim.core.rotation import rotated_frames
from collision_sim.core.rules import Rules
from collision_sim.core.shapes import COLUMNS, KIND, PLANE, RESTITUTION, SHAPES, SIZE
from collision_sim.scene import Drag
import numpy as np

INSIDE, OUTSIDE = -1.0, 1.0


def collider_table(scene):
    """Shapes and laws of the colliders, (C, COLUMNS)."""
    table = np.zeros((len(scene.colliders), COLUMNS))
    meshes = 0
    for row, collider in zip(table, scene.colliders):
        friction = scene.friction_of(collider)
        row[:] = (SHAPES[collider.shape], INSIDE if collider.inside else OUTSIDE, *collider.size,
                  scene.restitution_of(collider), friction.static or 0.0, friction.kinetic or 0.0,
                  friction.wet or 0.0, WET_FORMS[friction.wet_form])
        if collider.mesh:
            row[SIZE:SIZE + 2] = 4.0 * collider.mesh.extent, meshes     # roundings; row of heads
            meshes += 1
    return table


def pair_row(scene):
    """Laws of pairs, as a row of the table of colliders."""
    friction, row = scene.pairs.friction_in(scene), np.zeros(COLUMNS)
    row[RESTITUTION:] = (scene.pairs.restitution_in(scene), friction.static or 0.0,
                         friction.kinetic or 0.0, friction.wet or 0.0,
                         WET_FORMS[friction.wet_form])
    return row


def mesh_tables(scene):
    """Return the meshes of a scene as mesh.Meshes."""
    check_method(scene.colliders, scene.stepping.method)
    meshes = [mesh_arrays(collider.mesh.vertices, collider.mesh.faces, collider.mesh.closed)
              for collider in scene.colliders if collider.mesh]
    return joined(meshes) if meshes else NO_MESHES


def step_rules(scene, table, present):
    """Say what a step does in this scene, with shapes.Present, as rules.Rules by reference."""
    stepping, frictions = scene.stepping, [scene.friction_of(c) for c in scene.colliders]
    flight = flight_coefficients(scene.gravity, scene.drag, stepping.dt, stepping.flight)
    planes = bool((table[:, KIND] == PLANE).any())
    return refer(Rules(
        flight, present, dry=any(f.static is not None for f in frictions),
        wet=any(f.wet is not None for f in frictions),
        sweep=stepping.detection == 'trajectory' or stepping.method == 'exact',
        checks=stepping.method not in ('single_pass', 'multi_pass'),
        passes=stepping.iterations, once=stepping.method == 'single_pass',
        share=float(stepping.repulsion), highest=float(stepping.repulsion_speed),
        second=stepping.method == 'second_order_contact',
        planes=planes and stepping.method == 'collision_then_contact'
        and stepping.detection == 'end_of_step' and not scene.pairs and not scene.springs))


def acting_forces(scene):
    """Give what acts on a particle in flight, as sustained.Forces."""
    from collision_sim.core.sustained import BLINK, Forces      # takes a while
    drag = scene.drag or Drag()
    return Forces(scene.gravity, drag.wind, float(drag.linear or 0.0),
                  float(drag.quadratic or 0.0), BLINK * scene.stepping.dt)


def plane_frame(normal):
    """Rotation matrix (3, 3) whose third column is a unit normal, exactly."""
    n = np.array(normal)
    first = np.cross(np.eye(3)[np.argmin(np.abs(n))], n)
    first /= np.linalg.norm(first)
    if np.array_equal(n, (0.0, 0.0, 1.0)):
        return np.eye(3)
    return np.stack([first, np.cross(n, first), n], axis=1)


def frames(scene):
    """Rotation of each shape in the frame of its collider, (C, 3, 3): planes have a normal."""
    return np.array([plane_frame(c.normal) if c.shape == 'plane' else np.eye(3)
                     for c in scene.colliders]).reshape(-1, 3, 3)


def pose_rows(frames, positions, orientations):
    """Rows of the table of poses (S, C, 12), from frames (C, 3, 3), (S, C, 3) and (S, C, 4)."""
    return np.concatenate([rotated_frames(orientations, frames), positions], axis=2)


def scripts(scene):
    """Scripts of the colliders' motion, (C, SCRIPT), and which colliders have one."""
    table = np.zeros((len(scene.colliders), SCRIPT))
    for row, collider in zip(table, scene.colliders):
        if collider.motion:
            row[:3], row[3:6] = collider.motion.linear_velocity, collider.motion.angular_velocity
            swing = collider.motion.oscillate
            if swing:
                row[6:9] = np.multiply(swing.axis, swing.amplitude)
                row[9] = swing.frequency
    which = [k for k, collider in enumerate(scene.colliders) if collider.motion]
    return table, np.array(which, dtype=np.int64)
