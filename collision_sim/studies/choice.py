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

"""Choose among measurements: the cheapest that meets an error, the best within a run time."""


def sound(rows):
    """Leave out failures, and what holds no number."""
    return [row for row in rows if not row.failure and row.error == row.error]


def cheapest(rows, error):
    """
    Choose the row of least run time whose error is small enough.

    Parameters
    ----------
    rows : list of errors.Row
        Of one scene.
    error : float [m]
        Largest that will do.

    Returns
    -------
    errors.Row or None
        None if no row meets it.

    """
    return min((row for row in sound(rows) if row.error <= error),
               key=lambda row: row.run_time, default=None)


def most_accurate(rows, run_time):
    """
    Choose the row of least error whose run time is short enough; of equal ones the cheapest.

    Parameters
    ----------
    rows : list of errors.Row
        Of one scene.
    run_time : float [s]
        Longest that will do, per particle and simulated second.

    Returns
    -------
    errors.Row or None
        None if no row meets it.

    """
    return min((row for row in sound(rows) if row.run_time <= run_time),
               key=lambda row: (row.error, row.run_time), default=None)
