# Copyright 2026 collision_sim developers
#
# Licensed under the Apache License, Version 2.0
# SPDX-License-Identifier: Apache-2.0
"""
Starts and ends the node.

Apart from the node, so that signals are taken care of before anything is imported that takes long.
"""

import signal

STOP = (signal.SIGINT, signal.SIGTERM)


def main(args=None):
    """Run the node until SIGINT or SIGTERM, which may come at any time and more than once."""
    stopped = []
    for number in STOP:
        signal.signal(number, lambda received, frame: stopped.append(received))
    try:
        from collision_sim.ros.node import run
        return 0 if stopped else run(args, stopped)
    finally:
        for number in STOP:     # the interpreter would restore the default on its way out
            signal.signal(number, signal.SIG_IGN)
