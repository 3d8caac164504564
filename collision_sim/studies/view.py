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

"""`collision_sim view`: run a scene in real time and show it in the browser."""

import argparse
import math
from time import perf_counter, sleep

from collision_sim.scene import load_scene, shipped_scenes
from collision_sim.simulation import Simulation
from collision_sim.studies.run import seconds
from collision_sim.viewer import BUTTONS, EVERY_CONTACT, PORT, RATE, Viewer

STEPPING = 0.75         # most of a frame that goes into steps; the rest is for showing
ROUNDING = 1e-6         # of a step


def port(text):
    """Read a port of the command line."""
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f'{text!r} is not a port from 0 to 65535')
    return int(text)


def frames_a_second(text):
    """Read the rate of the command line [Hz]."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.1 <= value <= 60.0:
        raise argparse.ArgumentTypeError(f'{text!r} is not a rate from 0.1 to 60 Hz')
    return value


def add_arguments(parser):
    """Declare the options."""
    parser.epilog = ('examples:\n  collision_sim view demo\n'
                     '  collision_sim view my.yaml --control --port 9000\n\n'
                     'The page is for browsers of this machine only. Ctrl-C ends it.\n\n'
                     'shipped scenes: ' + ', '.join(shipped_scenes()))
    parser.add_argument('scene', help='a YAML file, or the name of a shipped scene')
    parser.add_argument('--port', type=port, default=PORT, metavar='N',
                        help=f'of the page, 0 for a free one (default {PORT})')
    parser.add_argument('--duration', type=seconds, default=math.inf, metavar='S',
                        help='simulated time in s after which it ends (default: Ctrl-C)')
    parser.add_argument('--rate', type=frames_a_second, default=RATE, metavar='HZ',
                        help=f'frames a second (default {RATE:g})')
    parser.add_argument('--control', action='store_true',
                        help=f'give the page buttons: {", ".join(BUTTONS)}')


class Player:
    """
    A simulation in step with the clock, or as fast as it can be, and shown frame by frame.

    Parameters
    ----------
    simulation : Simulation
    viewer : Viewer
    frame : float [s]
        From one frame to the next.

    """

    def __init__(self, simulation, viewer, frame):
        self._simulation, self._viewer, self._frame = simulation, viewer, frame
        self._paused = False
        self._contacts = []             # of the frame that is shown
        self._due = perf_counter()      # when the next frame is to begin
        self._begin()

    def _begin(self):
        """Let the clock show the time of the simulation."""
        self._zero = perf_counter() - self._simulation.time

    def show(self, until):
        """Take the steps of a frame, none beyond a time [s], and show it."""
        begin = perf_counter()
        for name in self._viewer.pressed():
            {'pause': self._pause, 'step': self._step, 'reset': self._reset}[name]()
        if self._paused or not self._simulation.dt:
            self._begin()
        else:
            self._run(until, begin + STEPPING * self._frame)
        self._viewer.update(self._simulation, self._contacts, self._paused)
        now = perf_counter()
        self._due = max(self._due + self._frame, now)   # whatever a sleep is too long is made up
        sleep(self._due - now)

    def _run(self, until, deadline):
        """Catch up with the clock; what there is no time for until the deadline is left out."""
        simulation, contacts = self._simulation, []
        every = len(simulation.position) <= EVERY_CONTACT
        target = min(perf_counter() - self._zero, until) + ROUNDING * simulation.dt
        while simulation.time + simulation.dt <= target:
            simulation.step()
            contacts += [simulation.contacts] if every else []
            self._contacts = contacts
            if perf_counter() > deadline:
                self._begin()
                break
        if not every:
            self._contacts = [simulation.contacts]

    def _pause(self):
        self._paused = not self._paused

    def _step(self):
        if self._paused:
            self._simulation.step()
            self._contacts = [self._simulation.contacts]

    def _reset(self):
        self._simulation.reset()
        self._contacts = []
        self._begin()


def run(arguments):
    """Run and show a scene; the exit code."""
    scene = load_scene(arguments.scene)
    simulation = Simulation(scene)
    viewer = Viewer(simulation, arguments.port, arguments.control)
    try:
        print(f'collision_sim: {arguments.scene} is at {viewer.url}; Ctrl-C ends it', flush=True)
        simulation.step()               # compiles
        simulation.reset()
        player = Player(simulation, viewer, 1.0 / arguments.rate)
        while simulation.time + simulation.dt <= arguments.duration:
            player.show(arguments.duration)
    except KeyboardInterrupt:
        pass
    finally:
        viewer.close()
    return 0
