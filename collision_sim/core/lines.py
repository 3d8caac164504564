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
Arrays that begin with a cache line.

A vector that lies across two lines takes two turns to load, and two threads that write to one line
wait for each other.
"""

from numba.extending import register_jitable
import numpy as np

LINE = 8                # numbers of 8 bytes in a cache line


@register_jitable
def in_lines(count):
    """Give an array (count,) of float64, with any values, that begins with a cache line."""
    room = np.empty(count + LINE)
    first = (-(room.ctypes.data // 8)) % LINE
    return room[first:first + count]
