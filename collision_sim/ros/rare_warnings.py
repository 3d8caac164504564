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

"""Warnings that come in floods are given from time to time."""

import time

PERIOD = 5.0        # s between warnings for the same reason


class RareWarnings:
    """
    Warns of a thing at once, and then not again for a while.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose logger is used.

    """

    def __init__(self, node):
        """Start with nothing warned of."""
        self._logger = node.get_logger()
        self._warned = {}

    def __call__(self, key, text):
        """Give a text, unless one for the same key, one of few, was given just now."""
        now = time.monotonic()
        if now - self._warned.get(key, -PERIOD) >= PERIOD:
            self._warned[key] = now
            self._logger.warning(text)
