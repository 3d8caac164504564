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

"""Figures of the report: error against run time, a line for each way to step."""

from importlib.util import find_spec
from math import inf
import sys

from collision_sim.studies.orders import fits, in_words

# Okabe and Ito: told apart by the colour-blind, too.
COLOURS = {'single_pass': '#E69F00', 'multi_pass': '#56B4E9', 'collision_then_contact': '#D55E00',
           'second_order_contact': '#009E73', 'exact': '#000000'}
MARKERS = {'single_pass': 'v', 'multi_pass': '^', 'collision_then_contact': 'o',
           'second_order_contact': 's', 'exact': 'D'}
LEAST = 1e-17               # m; an error of 0 is drawn there


def require():
    """End the program with a clear message where matplotlib is not installed."""
    if find_spec('matplotlib') is None:
        sys.exit("collision_sim: drawing needs matplotlib: pip install 'collision_sim[report]'")


def label(setting, orders):
    """Give the words of the legend: method, detection and fitted order."""
    order = in_words(orders[0])
    if setting.method == 'exact':
        return f'exact: {order}'
    return f'{setting.method}, {setting.detection}: {order}'


def line(axes, setting, rows, words):
    """Draw one way to step; failures as crosses."""
    rows = sorted(rows, key=lambda row: row.dt, reverse=True)
    dashed = setting.detection == 'trajectory'
    colour = COLOURS.get(setting.method, '0.5')
    x = [1e6 * row.run_time for row in rows]
    y = [max(row.error, LEAST) for row in rows]
    axes.plot(x, y, color=colour, marker=MARKERS.get(setting.method, '.'), markersize=5,
              linewidth=1.3, linestyle='--' if dashed else '-',
              markerfacecolor='white' if dashed else colour, label=words)
    for row, x_row, y_row in zip(rows, x, y):
        if row.failure and y_row < inf:
            axes.plot(x_row, y_row, marker='x', color='black', markersize=9, markeredgewidth=1.8,
                      zorder=5)
        elif row.failure:       # not a number: at the upper edge
            axes.plot(x_row, 0.98, marker='x', color=colour, markersize=9, markeredgewidth=1.8,
                      transform=axes.get_xaxis_transform(), zorder=5)


def slopes(axes):
    """Draw what order 1 and 2 look like, from the lower left corner of the points."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    for order, style in ((1, '-'), (2, ':')):
        end = min(right, left * (high / low) ** (1.0 / order))
        axes.plot([left, end], [high, high * (end / left) ** -order], color='0.75', linewidth=1.0,
                  linestyle=style, zorder=0, label=f'slope of order {order}')
    axes.set(xlim=(left, right), ylim=(low, high))


def draw(path, case, rows):
    """
    Draw the error of a scene against run time.

    Parameters
    ----------
    path : path
        Of the PNG.
    case : case.Case
        The scene.
    rows : list of errors.Row
        Its measurements.

    """
    require()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    orders = fits([case], rows)
    flights = list(dict.fromkeys(row.flight for row in rows))
    figure = Figure(figsize=(5.6 * len(flights), 5.2), dpi=110, layout='constrained')
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(flights), sharex=True, sharey=True, squeeze=False)[0]
    for axes, flight in zip(panels, flights):
        for (_, setting), order in orders.items():
            if setting.flight == flight or setting.method == 'exact':
                own = [row for row in rows if row.setting == setting]
                line(axes, setting, own, label(setting, order))
        axes.set(xscale='log', yscale='log', title=flight)
        axes.grid(alpha=0.25)
    for axes in panels:
        slopes(axes)
        axes.set_xlabel('run time [µs per particle and simulated second]')
        axes.legend(loc='upper center', bbox_to_anchor=(0.5, -0.15), fontsize=7.5, frameon=False,
                    ncols=2, columnspacing=1.0, title='with the fitted order; × failed',
                    title_fontsize=7.5)
    panels[0].set_ylabel('error of the position, RMS [m]')
    figure.suptitle(case.title)
    figure.savefig(path, format='png')
