# Copyright 2026 collision_sim developers
#
# Licensed under the Apache License, Version 2.0
# SPDX-License-Identifier: Apache-2.0
"""The style that ROS packages share; without an installed ROS, run plain flake8."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.flake8
@pytest.mark.linter
def test_flake8():
    ament_flake8 = pytest.importorskip(
        'ament_flake8.main', reason='ament_flake8 comes with an installed ROS only')
    paths = [str(ROOT / name) for name in ('collision_sim', 'test', 'setup.py')]
    status, errors = ament_flake8.main_with_errors(argv=paths)
    assert status == 0, '\n'.join([f'Found {len(errors)} errors', *errors])
