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


"""What somebody who has started the node may do next, in commands that run on this machine."""

from pathlib import Path
import shlex
import shutil
import sys

# Sets a parameter where there is no `ros2`: rclpy is there.
SET = ('import rclpy; from rclpy.parameter_client import AsyncParameterClient as A; rclpy.init(); '
       'n = rclpy.create_node("hand"); a = A(n, "%s"); a.wait_for_services(); '
       'f = a.set_parameters([rclpy.Parameter("restitution", value=0.9)]); '
       'rclpy.spin_until_future_complete(n, f); print(f.result())')


def advice(node, frame_id, moved):
    """
    Yield lines that say how to set parameters and move colliders.

    Parameters
    ----------
    node : str
        Full name of the node.
    frame_id : str
        Of the poses.
    moved : dict of (str, (3,) tuple of float [m])
        Topic and place of each collider that is moved by poses, by name.

    """
    has_ros2 = shutil.which('ros2') is not None
    yield 'parameters: topics %s/set/..., or %s' % (
        node, 'ros2 param set %s restitution 0.9' % node if has_ros2 else
        '%s -c %s' % (shlex.quote(sys.executable), shlex.quote(SET % node)))
    swing = 'ros2 run collision_sim swing_paddle' if has_ros2 else _swing_paddle()
    for name, (topic, (x, y, z)) in moved.items():
        line = "to move %s: %s --ros-args -p topic:=%s -p frame_id:=%s -p 'centre:=[%r, %r, %r]'" \
            % (name, swing, topic, shlex.quote(frame_id), x, y, z)
        if has_ros2:
            line += (', or ros2 topic pub -r 30 %s geometry_msgs/msg/PoseStamped "{header: '
                     '{frame_id: %s}, pose: {position: {x: %g, y: %g, z: %g}}}"' % (
                         topic, frame_id, x, y, z))
        yield line


def _swing_paddle():
    """Give the command without `ros2`: what pip has installed, or else the module."""
    script = Path(sys.executable).with_name('swing_paddle')
    if script.is_file():
        return shlex.quote(str(script))
    return shlex.quote(sys.executable) + ' -m collision_sim.ros.swing_paddle'
