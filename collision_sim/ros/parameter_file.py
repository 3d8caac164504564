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
A YAML file of all parameters of the node with a scene, each with what it means.

`python3 -m collision_sim.ros.parameter_file SCENE` prints it; that of the scene demo is shipped as
config/parameters.yaml.
"""

import json
import sys
from textwrap import wrap

from collision_sim.ros.parameters import descriptor, FIXED_PARAMETERS
from collision_sim.ros.parameters import NODE_PARAMETERS, ros_value
from collision_sim.scene import load_scene, SceneError

HEAD = """\
# All parameters of collision_sim_node and what they are when nobody sets them, with the scene %s.
# Start from a copy: lines may be left out. What is commented out takes the value of the whole
# scene, and follows it when that changes.
# Written by: python3 -m collision_sim.ros.parameter_file %s
/**:
  ros__parameters:
"""


def parameter_file(name):
    """
    Give the text of the file.

    Parameters
    ----------
    name : str
        Of a scene, as load_scene takes it.

    """
    fixed = FIXED_PARAMETERS | {'scene': FIXED_PARAMETERS['scene']._replace(value=name)}
    scene = load_scene(name)
    entries = [_entry(*item, read_only=True) for item in fixed.items()]
    entries += [_entry(*item, read_only=False, follows=scene.follows(item[0]))
                for item in (NODE_PARAMETERS | scene.parameters()).items()]
    return HEAD % (name, name) + '\n'.join(entries)


def _entry(name, parameter, read_only, follows=False):
    """Give the lines of a parameter: meaning, unit, range and value."""
    notes = '; '.join(_notes(descriptor(parameter, read_only)))
    comment = ''.join(f'    # {line}\n' for line in wrap(notes, 90, break_on_hyphens=False))
    mark = '# ' if follows else ''
    return f'{comment}    {mark}{name}: {json.dumps(ros_value(parameter.value))}\n'


def _notes(described):
    """Say what a descriptor says."""
    yield described.description
    for limits in (*described.floating_point_range, *described.integer_range):
        yield f'{limits.from_value:g} to {limits.to_value:g}'
    if described.additional_constraints:
        yield described.additional_constraints
    if described.read_only:
        yield 'read-only'


def main():
    """Print the file of the scene that the command line names."""
    try:
        print(parameter_file(*sys.argv[1:] or ['demo']), end='')
    except (SceneError, TypeError) as error:
        sys.exit(f'parameter_file: {error}')


if __name__ == '__main__':
    main()
