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
Starts and ends the node.

Apart from the node, so that signals are taken care of before anything is imported that takes long.
"""

from contextlib import contextmanager
import os
import signal
import sys
import threading

from collision_sim.ros.own_arguments import read_own_arguments

HELP = """\
Steps a scene in time with the clock: poses of colliders and values of parameters in, particles,
contacts and diagnostics out.

Some parameters: scene (path of a YAML file, or a shipped one such as demo or rain), frame_id,
publish_rate, viewer (true: a page in the browser), and every value of the scene that may change:
  collision_sim_node --ros-args -p scene:=rain -p restitution:=0.9
All of them, with what they mean: python3 -m collision_sim.ros.parameter_file SCENE"""
STOP = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def interruptible():
    """Let the first SIGINT or SIGTERM raise KeyboardInterrupt meanwhile, in the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in STOP}

    def restore():
        for number in STOP:
            signal.signal(number, before[number])

    def interrupt(number, frame):
        restore()
        raise KeyboardInterrupt

    try:
        for number in STOP:
            signal.signal(number, interrupt)
        yield
    finally:
        restore()


def main(args=None):
    """Run the node until SIGINT or SIGTERM, which may come at any time and more than once."""
    stopped = []
    for number in STOP:
        signal.signal(number, lambda received, frame: stopped.append(received))
    try:
        read_own_arguments('collision_sim_node', HELP, args)
        from collision_sim.ros.node import run
        status = 0 if stopped else run(args, stopped)
        _leave_the_compiler(status)
        return status
    finally:
        for number in STOP:     # the interpreter would restore the default on its way out
            signal.signal(number, signal.SIG_IGN)


def _leave_the_compiler(status):
    """End the process here if a thread is still compiling: the interpreter would crash on it."""
    from collision_sim.ros.warm_up import at_work
    if at_work():
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
