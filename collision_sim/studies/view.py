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

from collision_sim.listener import heard
from collision_sim.scene import load_scene, shipped_scenes
from collision_sim.simulation import Simulation
from collision_sim.studies.run import seconds
from collision_sim.viewer import BUTTONS, EVERY_CONTACT, PORT, RATE, Viewer

SHOWING = 0.25          # of a frame; the rest is for steps
STEPPING = 0.5          # of a frame; steps get as much even if frames come late
LAG = 0.2               # s; what the simulation is late by, up to this, is made up
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
        self._contacts = []             # of the frame that is shown; None: of the last step
        self._due = perf_counter()      # when the next frame is to begin
        self._begin()

    def _begin(self):
        """Let the clock show the time of the simulation."""
        self._zero = perf_counter() - self._simulation.time

    def show(self, until):
        """Take the steps of a frame, none beyond a time [s], and show it."""
        begin = perf_counter()
        self._due += self._frame
        for name in self._viewer.pressed():
            {'pause': self._pause, 'step': self._step, 'reset': self._reset}[name]()
        if self._paused or not self._simulation.dt:
            self._begin()
        else:
            self._run(until, max(self._due - SHOWING * self._frame,
                                 begin + STEPPING * self._frame))
        self._viewer.update(self._simulation, self._contacts, self._paused)
        now = perf_counter()
        self._due = max(self._due, now - self._frame)   # as late as this frames are made up
        sleep(max(self._due - now, 0.0))

    def _run(self, until, deadline):
        """Catch up with the clock, or until the deadline; what is late by too much is left out."""
        simulation = self._simulation
        contacts = [] if len(simulation.position) <= EVERY_CONTACT else None
        target = min(perf_counter() - self._zero, until) + ROUNDING * simulation.dt
        while simulation.time + simulation.dt <= target:
            simulation.step()
            if contacts is not None:
                contacts.append(simulation.contacts)
            self._contacts = contacts
            now = perf_counter()
            if now > deadline:
                self._zero = max(self._zero, now - simulation.time - LAG)
                break

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
        heard()
    finally:
        viewer.close()
    return 0
