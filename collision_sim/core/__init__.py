# Copyright 2026 collision_sim developers
#
# Licensed under the Apache License, Version 2.0
# SPDX-License-Identifier: Apache-2.0
"""Numerical core: arrays and numbers only; no files, no clock, no ROS."""
