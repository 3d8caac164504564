# Copyright 2026 collision_sim developers
#
# Licensed under the Apache License, Version 2.0
# SPDX-License-Identifier: Apache-2.0
"""
Particles that collide with, slide on and rest on fixed and moving colliders.

Importing this package imports no ROS.
"""

from collision_sim.scene import load_scene, Scene, SceneError
from collision_sim.simulation import Simulation

__all__ = ['Scene', 'SceneError', 'Simulation', 'load_scene']
