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

"""Python processes beside this one, which run a module of the package."""

import os
import pickle
import subprocess
import sys


def start(module, work):
    """
    Start a process that runs a module on some work.

    Parameters
    ----------
    module : str
        Its full name; it reads the work from standard input, pickled, and writes lines.
    work : object
        What pickle can write.

    Returns
    -------
    process : subprocess.Popen
        Out of reach of signals to this process's group; its standard input is still open.

    """
    process = subprocess.Popen(
        [sys.executable, '-m', module], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, start_new_session=True,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})
    pickle.dump(work, process.stdin)
    process.stdin.flush()
    return process
