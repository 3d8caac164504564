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


"""What the executables take beside ROS arguments: --help and --version."""

import argparse
from importlib.metadata import PackageNotFoundError, version
import sys


def read_own_arguments(name, description, args=None):
    """
    Take --help and --version, which end the process; anything else that is not ROS's is refused.

    Parameters
    ----------
    name : str
        Of the executable.
    description : str
        What it does.
    args : list of str or None
        As of the command line; None: those of this process.

    """
    parser = argparse.ArgumentParser(
        prog=name, description=description, formatter_class=argparse.RawDescriptionHelpFormatter,
        usage=f'{name} [--help] [--version] [--ros-args -p name:=value ...]')
    parser.add_argument('--version', action='version', version=_version())
    parser.parse_args(_without_ros(sys.argv[1:] if args is None else args))


def _without_ros(args):
    """Leave out what is from --ros-args on to the next --, or to the end."""
    own, of_ros = [], False
    for word in args:
        if word == '--ros-args':
            of_ros = True
        elif of_ros:
            of_ros = word != '--'
        else:
            own.append(word)
    return own


def _version():
    try:
        return version('collision_sim')
    except PackageNotFoundError:        # run from its sources
        return 'unknown'
