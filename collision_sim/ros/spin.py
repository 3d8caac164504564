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

"""The loop in which a node lives."""

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor


def spin(node, stopped):
    """Serve the node until `stopped` is not empty; no request and no message ends it."""
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while rclpy.ok() and not stopped:
        try:
            executor.spin_once(timeout_sec=0.1)
        except ExternalShutdownException:
            break
        except Exception as error:
            node.get_logger().error('%s: %s' % (type(error).__name__, error),
                                    throttle_duration_sec=1.0)
