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
What Fast DDS is told by its environment, so that large messages reach other processes.

Its defaults, 512 kB of shared memory, lose messages above half a megabyte between processes.
"""

import os
from pathlib import Path
import shutil

PROFILE = Path(__file__).resolve().parents[1] / 'config' / 'fast_dds.xml'
SEGMENT = 64 * 2 ** 20      # bytes of shared memory that the profile asks for
LARGE = 500_000             # bytes of a message that the defaults may lose
SHARED_MEMORY = '/dev/shm'
OURS = 'FASTRTPS_DEFAULT_PROFILES_FILE'
# Publishing does not wait until the copies for other processes are made.
ASYNCHRONOUS = 'RMW_FASTRTPS_PUBLICATION_MODE', 'ASYNCHRONOUS'
# What a user says who has decided on profiles or transports; files are taken where they lie.
USERS = (OURS, 'FASTDDS_DEFAULT_PROFILES_FILE', 'FASTDDS_BUILTIN_TRANSPORTS')
FILES = 'DEFAULT_FASTRTPS_PROFILES.xml', 'DEFAULT_FASTDDS_PROFILES.xml'


def prepare():
    """Set what the user has left open; has an effect before rclpy.init only."""
    os.environ.setdefault(*ASYNCHRONOUS)
    if not _is_decided() and _has_room():
        os.environ[OURS] = str(PROFILE)


def trouble():
    """Say why large messages may get lost; '' where they do not, or where the user has decided."""
    if _is_decided():
        return ''
    return 'Fast DDS has its defaults' if _has_room() else (
        'Fast DDS has its defaults, for want of room in ' + SHARED_MEMORY)


def _is_decided():
    """Whether the user or somebody else has chosen a profile, transports or another middleware."""
    middleware = os.environ.get('RMW_IMPLEMENTATION', '')
    return (not middleware.startswith('rmw_fastrtps') if middleware else False) or any(
        map(os.environ.get, USERS)) or any(map(os.path.exists, FILES))


def _has_room():
    try:
        return shutil.disk_usage(SHARED_MEMORY).free > 2 * SEGMENT
    except OSError:
        return False
