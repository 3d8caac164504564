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

"""What the page of the viewer says in words: readings of a simulation, and a legend."""

from collections import deque
from time import perf_counter

from collision_sim.appearance import SPEED_COLORS, STATE_COLORS
from collision_sim.core.rules import STATES

WINDOW = 1.0            # s over which the pace is measured
ROW = '<tr><td>{}</td><td style="text-align:right">{}</td></tr>'
DOT = '<span style="color:{}">&#9670;</span>&nbsp;{}'
STYLE = 'padding:0.3em 1em 0.6em;font-size:0.85em;font-variant-numeric:tabular-nums'


class Pace:
    """How fast a simulation goes, over the last second."""

    def __init__(self):
        """Begin."""
        self._notes = deque()           # of times: on the clock, of the simulation

    def note(self, simulation):
        """Take note of the time of the simulation now."""
        now = perf_counter()
        if self._notes and simulation.time < self._notes[-1][1]:
            self._notes.clear()         # a reset
        self._notes.append((now, simulation.time))
        while now - self._notes[0][0] > WINDOW and len(self._notes) > 2:
            self._notes.popleft()

    @property
    def real_time_factor(self):
        """Time of the simulation a time on the clock [-]."""
        (begin, start), (end, stop) = self._notes[0], self._notes[-1]
        return (stop - start) / (end - begin) if end > begin else 0.0


def readings(simulation, pace, paused):
    """
    Say in HTML how far and how fast the simulation is, and its counters that are not zero.

    Parameters
    ----------
    simulation : Simulation
        As it is now.
    pace : Pace
        Of that simulation.
    paused : bool
        Whether to say so.

    """
    factor, dt = pace.real_time_factor, simulation.dt
    rows = {
        'time': f'{simulation.time:.2f} s' + (' (paused)' if paused else ''),
        'steps per second': f'{factor / dt if dt else 0.0:.0f}',
        'real-time factor': f'{factor:.2f}',
        'particles': f'{len(simulation.position):,}',
    }
    rows |= {name.replace('_', ' '): f'{count:,}'
             for name, count in simulation.counters.items() if count}
    body = ''.join(ROW.format(name, value) for name, value in rows.items())
    return f'<div style="{STYLE}"><table style="width:100%">{body}</table></div>'


def legend(fastest):
    """
    Say in HTML what the colours mean.

    Parameters
    ----------
    fastest : float [m/s]
        Speed of the last colour of SPEED_COLORS.

    """
    stops = ','.join(_css(color) for color in SPEED_COLORS[::51])
    bar = f'<div style="height:0.7em;background:linear-gradient(to right,{stops})"></div>'
    ends = ('<div style="display:flex;justify-content:space-between">'
            f'<span>0</span><span>speed</span><span>{fastest:.3g} m/s</span></div>')
    states = ' '.join(DOT.format(_css(255 * STATE_COLORS[state, :3]), name)
                      for state, name in STATES.items())
    return f'<div style="{STYLE}">{bar}{ends}<div>{states}</div></div>'


def _css(color):
    return 'rgb({:.0f},{:.0f},{:.0f})'.format(*color)
