# Copyright 2026 collision_sim developers
#
# Licensed under the Apache License, Version 2.0
# SPDX-License-Identifier: Apache-2.0
"""The form of docstrings that ROS packages share; without an installed ROS, run pydocstyle."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.linter
@pytest.mark.pep257
def test_pep257():
    ament_pep257 = pytest.importorskip(
        'ament_pep257.main', reason='ament_pep257 comes with an installed ROS only')
    paths = [str(ROOT / name) for name in ('collision_sim', 'test')]
    assert ament_pep257.main(argv=paths) == 0, 'Found code style errors'
