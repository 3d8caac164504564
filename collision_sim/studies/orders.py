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
Order of convergence: what a line of errors over dt shows, beside what theory says.

The order is the slope of log(error) over log(dt) by regression over the errors that tell it:
those below COARSE times the size of the scene, where the leading term is all there is, and above
rounding and the error of the reference. Of these the finer ones, at least LEAST.
"""

from math import inf

import numpy as np

ROUNDING = 1e-10            # of the scene's size: errors that are all below are rounding
FLOOR = 1e-11               # of the scene's size: smaller errors hold too much rounding
COARSE = 0.02               # of the scene's size: larger errors hold higher terms
ABOVE_REFERENCE = 5.0       # times its error: smaller errors are those of the reference as well
LEAST = 3                   # points of a regression
DECADE = 20.0               # the finest points are used, over this ratio of dt


def fitted_order(dt, errors, scale=1.0, uncertainty=0.0):
    """
    Order of convergence.

    Parameters
    ----------
    dt : (M,) array [s]
        Lengths of the steps, in any order.
    errors : (M,) array [m]
        Theirs; what is not finite is left out.
    scale : float [m]
        Size of the scene.
    uncertainty : float [m]
        Error of the reference.

    Returns
    -------
    order : float or None
        inf: all errors are rounding; None: too few errors tell it.

    """
    dt, errors = np.asarray(dt, dtype=float), np.asarray(errors, dtype=float)
    if len(errors) and (errors < ROUNDING * scale).all():
        return inf
    floor = max(FLOOR * scale, ABOVE_REFERENCE * uncertainty)
    useful = (errors > floor) & (errors < COARSE * scale)
    if useful.any():
        finest = np.sort(dt[useful])
        most = max(finest[0] * DECADE, finest[min(LEAST, len(finest)) - 1])
        useful &= dt <= most
    if useful.sum() < LEAST:
        return None
    return float(np.polyfit(np.log(dt[useful]), np.log(errors[useful]), 1)[0])


def fits(cases, rows):
    """
    Give the orders of all lines in the rows.

    Parameters
    ----------
    cases : iterable of case.Case
        Those that the rows come from.
    rows : list of errors.Row
        Measurements.

    Returns
    -------
    orders : dict
        (name of the case, Setting) -> (order over time, order at the end), as fitted_order.

    """
    found = {}
    for case in cases:
        lines = {}
        for row in rows:
            if row.scene == case.name:
                lines.setdefault(row.setting, []).append(row)
        for setting, line in lines.items():
            sound = [row for row in line if not row.failure]
            dt = [row.dt for row in sound]
            found[case.name, setting] = tuple(
                fitted_order(dt, errors, case.scale, case.uncertainty) for errors in
                ([row.error for row in sound], [row.error_end for row in sound]))
    return found


def in_words(order):
    """Write an order for people."""
    return '–' if order is None else 'rounding' if order == inf else f'{order:.2f}'
