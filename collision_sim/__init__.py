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
Particles that collide with, slide on and rest on fixed and moving colliders.

Importing this package imports no ROS, and nothing that takes long before it is used: the node can
take care of signals before Numba is loaded.
"""

from importlib import import_module

_HOMES = {'Scene': 'scene', 'SceneError': 'scene', 'Simulation': 'simulation',
          'load_scene': 'scene'}

__all__ = ['Scene', 'SceneError', 'Simulation', 'load_scene']


def __getattr__(name):
    """Import a public name when it is first asked for (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    globals()[name] = getattr(import_module(f'{__name__}.{_HOMES[name]}'), name)
    return globals()[name]


def __dir__():
    return sorted({*globals(), *__all__})
