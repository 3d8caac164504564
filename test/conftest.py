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

"""Strictness for every test; it has to be set before Numba and the messages are imported."""

import gc
import os
from pathlib import Path

from hypothesis import settings
import pytest
from signatures import (pytest_sessionfinish, pytest_terminal_summary,  # noqa: F401
                        pytest_testnodedown)

ROOT = Path(__file__).resolve().parents[1]


# To compile makes millions of objects that stay; to look through them again and again for garbage
# takes a tenth of the time.
gc.set_threshold(50000, 20, 100)

# Without it a message takes a value of a wrong type and sends 5e-324 in its place.
os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'

if os.access(ROOT, os.W_OK):
    os.environ.setdefault('NUMBA_CACHE_DIR', str(ROOT / '.pytest_cache' / 'numba'))


# Files whose tests are marked `quick`, apart from those that are slow.
QUICK = {
    'ros/test_serialized.py', 'studies/test_drafts.py', 'studies/test_grid.py',
    'studies/test_journal.py', 'test_copyright.py', 'test_docs.py', 'test_flake8.py',
    'test_flight.py', 'test_layers.py', 'test_laws.py', 'test_lines.py',
    'test_mesh_dialects.py', 'test_messages.py', 'test_motion.py', 'test_package.py',
    'test_pep257.py', 'test_pose_stream.py', 'test_rotation.py', 'test_scene.py',
    'test_shapes.py', 'test_vectors.py'}


def pytest_addoption(parser):
    parser.addoption('--long', action='store_true',
                     help='many runs of the tests of signals and of the soak, for hours')


@pytest.hookimpl(tryfirst=True)     # before tests are chosen by their markers
def pytest_collection_modifyitems(items):
    """
    Mark what is quick, and leave out, where Numba compiles, what is worth it only without.

    What is marked `jit` or `slow`, too, is left out there, so it stays.
    """
    quick = {ROOT / 'test' / name for name in QUICK}
    for item in items:
        if item.path in quick and not item.get_closest_marker('slow'):
            item.add_marker('quick')
    if os.environ.get('NUMBA_DISABLE_JIT', '0') == '0':
        skip = pytest.mark.skip(reason='runs without the compiler: see the last tests of .ci/run')
        for item in items:
            named = {marker.name for marker in item.iter_markers()}
            if 'plain' in named and not named & {'jit', 'slow'}:
                item.add_marker(skip)


settings.register_profile('dev', deadline=None)
settings.register_profile('ci', deadline=None, derandomize=True, print_blob=True)
settings.load_profile('ci' if os.environ.get('CI') else 'dev')
