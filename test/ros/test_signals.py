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

"""Check 4 of ten, signals: at any moment and twice, the node ends with status 0; `--long`."""

from pathlib import Path
import random
import re
import signal
import subprocess
import sys
import time

import collision_sim
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from geometry_msgs.msg import PoseArray  # noqa: E402, I100
from harness import DEADLINE, moved  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

LONG = 20               # runs of each with --long
SOON = 20.0             # s; a node ends sooner than its kernels are compiled
NODE = '/collision_sim'
SIGNALS = [(signal.SIGINT,), (signal.SIGTERM,), (signal.SIGINT, signal.SIGINT),
           (signal.SIGINT, signal.SIGTERM)]
# Every tick is full: more steps are asked for than there is time for.
LOAD = {'particles': {'count': 20_000, 'box': {'min': [-1, -1, 0], 'max': [1, 1, 2]}},
        'friction': {'dry': 0.3}, 'colliders': [{'name': 'ground', 'shape': 'plane'}],
        'stepping': {'dt': 1e-5}}
IDLE = {'particles': {'position': [[0, 0, 1e5]]},
        'colliders': [{'name': 'ground', 'shape': 'plane'}]}
RICH = {'particles': {'count': 100, 'box': {'min': [-1, -1, 0.1], 'max': [1, 1, 2]},
                      'radius': 0.02},
        'friction': {'dry': 0.3}, 'restitution': 0.5, 'drag': {'quadratic': 0.1},
        'pairs': {'friction': {'dry': 0.1}}, 'stepping': {'detection': 'trajectory'},
        'colliders': [{'name': 'ground', 'shape': 'plane'},
                      {'name': 'moved', 'shape': 'box', 'size': [1, 1, 1], 'topic': 'moved/pose',
                       'position': [3, 0, 0]}]}
START = """
import sys, types
package = types.ModuleType('collision_sim')
package.__path__ = sys.argv[1:2]
sys.modules['collision_sim'] = package      # without what the package itself imports
from collision_sim.ros.start import main
print('ready', flush=True)
sys.exit(main([]))
"""


LOADING = """
import os, signal, sys
from collision_sim.ros import parameters, start
def load(name):
    os.kill(os.getpid(), getattr(signal, sys.argv[1]))
    os.kill(os.getpid(), signal.SIGINT)
    [None for _ in range(1000)]
    print('went on')
parameters.load_scene = load
sys.exit(start.main([]))
"""


@pytest.fixture
def runs(request):
    return range(LONG if request.config.getoption('--long') else 1)


def names(signals):
    return '+'.join(number.name for number in signals)


def shared_memory():
    """Segments of Fast DDS in shared memory; those of ports serve many processes."""
    return {path for path in Path('/dev/shm').glob('fastrtps_*')
            if re.fullmatch('fastrtps_[0-9a-f]+', path.name)}


def mapped(process):
    """Segments that another process has mapped, its own and those of its peers."""
    maps = Path('/proc/%d/maps' % process.pid).read_text()
    return {Path(path) for path in re.findall(r'/dev/shm/fastrtps_[0-9a-f]+', maps)}


def end(process, signals, pause, deadline=DEADLINE):
    """Send the signals [s] apart, and check that the node ends well; gives what it printed."""
    for number in signals:
        process.send_signal(number)
        time.sleep(pause)
    printed, _ = process.communicate(timeout=deadline)
    assert process.returncode == 0 and 'Traceback' not in printed, printed
    return printed


@pytest.mark.parametrize('signals', SIGNALS, ids=names)
@pytest.mark.parametrize('scene', [IDLE, LOAD], ids=['idle', 'full load'])
def test_signals_end_the_node(run_node, peer, runs, scene, signals):
    messages = peer.subscribe(PoseArray, NODE + '/particles', raw=True)
    for run in runs:
        peer.spin_for(0.3)      # what the node of the run before has sent
        messages.clear()
        before = shared_memory()
        process = run_node(scene)
        peer.spin_until(lambda: moved(messages))
        files = mapped(process) - before
        assert files
        end(process, signals, random.Random(run).uniform(0.0, 0.01))
        assert not any(path.exists() for path in files)


@pytest.mark.parametrize('number', ['SIGINT', 'SIGTERM'])
def test_signals_end_the_loading_of_a_scene(number):
    """Such as one with meshes of millions of faces."""
    done = subprocess.run([sys.executable, '-c', LOADING, number], timeout=DEADLINE, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert done.returncode == 0 and 'went on' not in done.stdout, done.stdout
    assert 'Traceback' not in done.stdout


def test_what_a_scene_warns_of_is_logged(run_node, peer):
    """Faces without area are left out and counted."""
    scene = {'colliders': [{'name': 'bunny', 'shape': 'mesh', 'faces': [[0, 1, 2], [0, 1, 1]],
                            'vertices': [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}]}
    messages = peer.subscribe(PoseArray, NODE + '/particles', raw=True)
    process = run_node(scene)
    peer.spin_until(lambda: messages)
    assert '1 faces without area are left out; the first is 1' in end(process, [signal.SIGINT], 0)


@pytest.mark.parametrize('pause', [0.0, 0.1, 0.3, 0.6, 0.9])
@pytest.mark.parametrize('signals', SIGNALS[:3], ids=names)
def test_signals_while_starting(runs, signals, pause):
    folder = Path(collision_sim.__file__).parent
    for run in runs:
        process = subprocess.Popen([sys.executable, '-c', START, str(folder)], text=True,
                                   stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        process.stdout.readline()
        time.sleep(0.01 + pause + 0.1 * run / LONG)
        end(process, signals, random.Random(run).uniform(0.0, 0.01))


@pytest.mark.parametrize('signals', SIGNALS[:3], ids=names)
def test_signals_while_the_kernels_compile(run_node, peer, runs, monkeypatch, tmp_path, signals):
    """The node serves meanwhile, and ends long before they are ready."""
    for run in runs:
        monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / f'numba{run}'))
        before = shared_memory()
        process = run_node(RICH)
        answer = peer.call(Trigger, NODE + '/step', Trigger.Request())
        assert not answer.success and 'compiled' in answer.message
        time.sleep(2.0 + 0.5 * run)
        files = mapped(process) - before
        printed = end(process, signals, random.Random(run).uniform(0.0, 0.01), SOON)
        assert 'compiling the kernels' in printed and NODE + ' publishes' not in printed
        assert files and not any(path.exists() for path in files)
