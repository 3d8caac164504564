# Copyright 2026 collision_sim developers
#
# Licensed under the Apache License, Version 2.0
# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 face of the simulator; the only folder that imports rclpy or messages."""
