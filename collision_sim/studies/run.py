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

"""`collision_sim run`: run a scene, say what happened, and record it."""

import argparse
from contextlib import ExitStack
from functools import partial
import math
import os
from time import perf_counter

from collision_sim.checks import SceneError
from collision_sim.core.interrupts import held
from collision_sim.core.pose_stream import PoseStream
from collision_sim.listener import heard
from collision_sim.particles import read_shard
from collision_sim.recording import MESSAGES, Recording, Replay, require_rosbags
from collision_sim.scene import load_scene, shipped_scenes
from collision_sim.simulation import MOST_STEPS, Simulation
from collision_sim.studies.states import FORMATS, StatesCsv, StatesNpz, write_state
from tqdm import tqdm

DURATION = 5.0          # s
PARTS = 200             # of a run: how often the progress bar moves
ROUNDING = 1e-6         # of a step
EPILOG = """\
examples:
  collision_sim run demo --duration 10
  collision_sim run my.yaml --out state.npz                  # the state at the end
  collision_sim run my.yaml --out states.csv --every 0.01    # states over time
  collision_sim run demo --record demo.mcap      # for ros2 bag play, Foxglove, PlotJuggler
  collision_sim run demo --poses swing.mcap --record out.mcap --topics particles,colliders

Ctrl-C and SIGTERM end a run early; its files hold what there was by then.

shipped scenes: """


def number(text):
    """Read a number of the command line; NaN for what is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def seconds(text):
    """Read a duration of the command line [s]."""
    value = number(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f'{text!r} is not a positive number of seconds')
    return value


def between(low, high):
    """Give what reads a number of the command line from one to another."""
    def read(text):
        value = number(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f'{text!r} is not a number from {low:g} to {high:g}')
        return value
    return read


def file_ending_in(*formats):
    """Give what reads the name of a file to be written."""
    def read(text):
        if os.path.splitext(text)[1] not in formats:
            raise argparse.ArgumentTypeError(f'{text!r} does not end in {" or ".join(formats)}')
        if not os.path.isdir(os.path.dirname(text) or '.'):
            raise argparse.ArgumentTypeError(f'the folder of {text!r} does not exist')
        return text
    return read


def topics(text):
    """Read a list of topics that are recorded."""
    names = text.split(',')
    for name in names:
        if name not in MESSAGES:
            raise argparse.ArgumentTypeError(f'{name!r} is none of {", ".join(MESSAGES)}')
    return names


def add_arguments(parser):
    """Declare the options."""
    parser.epilog = EPILOG + ', '.join(shipped_scenes())
    parser.add_argument('scene', help='a YAML file, or the name of a shipped scene')
    parser.add_argument('--duration', type=seconds, metavar='S',
                        help='simulated time in s (default 5; with --poses all of the poses)')
    parser.add_argument('--shard', default='1/1', metavar='K/N',
                        help='only the K-th of N slices of the particles (default 1/1, all)')
    parser.add_argument('--out', type=file_ending_in(*FORMATS), metavar='FILE',
                        help='.npz or .csv for positions and velocities at the end, or with '
                             '--every over time')
    parser.add_argument('--every', type=seconds, metavar='S',
                        help='simulated time between the states in --out')
    record = parser.add_argument_group('messages as the node publishes them (needs rosbags)')
    record.add_argument('--record', type=file_ending_in('.mcap'), metavar='FILE',
                        help='.mcap for the messages; stamps are simulated time')
    record.add_argument('--topics', type=topics, default='particles,contacts,colliders',
                        metavar='LIST',
                        help='of ' + ', '.join(MESSAGES) + ' (default %(default)s)')
    record.add_argument('--rate', type=between(0.1, 1000.0), default=60.0, metavar='HZ',
                        help='messages a simulated second (default 60, at most one a step)')
    record.add_argument('--frame-id', default='world', metavar='NAME',
                        help='frame of all messages, of --poses too (default world)')
    poses = parser.add_argument_group('recorded poses (needs rosbags)')
    usual = PoseStream().bounds
    poses.add_argument('--poses', metavar='BAG',
                       help='folder or file as of `ros2 bag record`: its PoseStamped topics move '
                            'the colliders that have these topics')
    poses.add_argument('--pose-delay', type=between(0.0, 10.0), default=usual.delay, metavar='S',
                       help='how late they are played back, as in the node (default %(default)s)')
    poses.add_argument('--pose-timeout', type=between(0.0, 60.0), default=usual.timeout,
                       metavar='S', help='how long a collider without new poses keeps its twist '
                                         '(default %(default)s)')


class Periodic:
    """
    Something that is done at the start of a run and then once a period, after whole steps.

    Parameters
    ----------
    action : callable
        What is done.
    period : float
        In steps; where it is shorter than one, it is one.

    Attributes
    ----------
    due : int
        After how many steps it is done next.

    """

    def __init__(self, action, period):
        self._action, self._period = action, max(period, 1.0)
        self._count = self.due = 0

    def do(self):
        """Do it, and say when it is due again."""
        self._action()
        soonest = math.ceil((self.due + 1 - ROUNDING) / self._period)
        self._count = max(self._count + 1, soonest)
        self.due = int(self._count * self._period + ROUNDING)


def do_what_is_due(periodic, done):
    """Do what is due after so many steps, whole whatever comes."""
    with held():
        for one in periodic:
            if one.due == done:
                one.do()


def go(total, periodic, step):
    """Take steps with a progress bar."""
    done, part = 0, max(total // PARTS, 1)
    with tqdm(total=total, unit='step', leave=False, disable=None) as bar:
        while done < total:
            do_what_is_due(periodic, done)
            count = min(total, done + part, *(one.due for one in periodic)) - done
            step(count)
            bar.update(count)
            done += count


def steps_in(duration, dt, every):
    """Give how many steps a run takes, with states once in so many seconds, if not None."""
    if dt == 0.0:
        return 0
    if not duration <= MOST_STEPS * dt:
        raise SceneError('--duration', duration, f'must be at most {MOST_STEPS * dt:g} s, '
                                                 f'{MOST_STEPS} steps of {dt:g} s')
    if every and every < dt * (1.0 - ROUNDING):
        raise SceneError('--every', every, f'must be at least a step, {dt:g} s')
    return round(duration / dt)


def steps_of(sim):
    """Give the steps that have been taken."""
    return round(sim.time / sim.dt) if sim.dt > 0.0 else 0


def stepper(sim, replay, add_contacts):
    """Give what takes a number of steps, with recorded poses or contacts if there are any."""
    def with_contacts():
        sim.step()
        add_contacts(sim.contacts)

    def one_by_one(count):
        for _ in range(count):
            with held():
                one()
    one = partial(replay.step, sim, 1, add_contacts) if replay else with_contacts
    return one_by_one if replay or add_contacts else sim.step


def outcome(sim, before, spent, replay):
    """Give lines about a run: time, speed, energy, counters, and poses of a replay."""
    steps = steps_of(sim)
    each = spent / max(steps * len(sim.position), 1)
    yield f'particles         {len(sim.position)}'
    yield f'simulated time    {sim.time:.6g} s in {steps} steps of {sim.dt:g} s'
    yield f'run time          {spent:.3g} s, {1e9 * each:.3g} ns per particle and step'
    yield f'real-time factor  {sim.time / spent if spent else 0.0:.4g}'
    yield f'energy            {sim.energy():.9g} J, {sim.energy() - before:+.3g} J since the start'
    for name, count in sim.counters.items():
        yield f'{name:17s} {count}'
    for name, count in replay.taken.items() if replay else ():
        reasons = ''.join(f', {dropped} dropped: {reason}'
                          for (whose, reason), dropped in replay.dropped.items() if whose == name)
        yield f'poses of {name:8s} {count} taken{reasons}'


def open_replay(arguments, scene):
    """Give the recorded poses, None if there are none."""
    if not arguments.poses:
        return None
    require_rosbags('--poses')
    return Replay(arguments.poses, scene, arguments.frame_id, arguments.pose_delay,
                  arguments.pose_timeout)


def open_recording(arguments, sim):
    """Give the recording of messages."""
    require_rosbags('--record')
    return Recording(arguments.record, sim, arguments.topics, arguments.rate, arguments.frame_id)


def open_states(path, sim):
    """Give the file of states over time."""
    return (StatesNpz if path.endswith('.npz') else StatesCsv)(path, sim)


def write_over_time(arguments, sim, total, replay):
    """Take the steps of a run and write its files; run time [s] and exit code."""
    periodic, add_contacts, dt, code = [], None, sim.dt or 1.0, 0
    with ExitStack() as files:
        if arguments.record:
            recording = files.enter_context(open_recording(arguments, sim))
            periodic.append(Periodic(recording.write, 1.0 / arguments.rate / dt))
            add_contacts = recording.messages.add_contacts if sim.record_contacts else None
        if arguments.every:
            states = files.enter_context(open_states(arguments.out, sim))
            periodic.append(Periodic(states.write, arguments.every / dt))
        began = perf_counter()
        try:
            go(total, periodic, stepper(sim, replay, add_contacts))
        except KeyboardInterrupt:
            code = heard()
        do_what_is_due(periodic, steps_of(sim))
        spent = perf_counter() - began
        if arguments.out and not arguments.every:
            write_state(arguments.out, sim)
    return spent, code


def run(arguments):
    """Run a scene; the exit code."""
    if arguments.every and not arguments.out:
        raise SceneError('--every', arguments.every, 'must come with --out')
    scene = load_scene(arguments.scene).shard(*read_shard(arguments.shard))
    replay = open_replay(arguments, scene)
    duration = arguments.duration or (replay.duration if replay else DURATION)
    contacts = bool(arguments.record) and 'contacts' in arguments.topics
    total = steps_in(duration, scene.stepping.dt, arguments.every)
    sim = Simulation(scene, contacts)
    sim.step()                          # compiles
    sim.reset()
    before = sim.energy()
    spent, code = write_over_time(arguments, sim, total, replay)
    print('\n'.join(outcome(sim, before, spent, replay)))
    return code
