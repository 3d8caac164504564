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

"""Interrupts: state and time stay together, and nothing that is heard gets lost."""

from contextlib import suppress
import os
from pathlib import Path
import signal
import subprocess
import sys
from threading import get_ident, Thread
import time

from collision_sim import cli
from collision_sim.core import interrupts
from collision_sim.listener import heard, Listener
import numpy as np
import pytest
from small_scenes import box, plane, simulate, sphere

ROOT = Path(__file__).resolve().parents[1]
PATIENCE = 120          # s
MOVED = sphere(0.2, (0.0, 0.0, 5.0), topic='ball/pose')
SCRIPTED = box(position=(9.0, 0.0, 0.0), motion={'linear_velocity': [0.1, 0.0, 0.0]})
SCENES = {
    'still': ([plane()], {}),
    'moving': ([plane(), SCRIPTED, MOVED], {}),
    'exact': ([plane(), SCRIPTED, MOVED], {'method': 'exact'}),
    'pairs': ([plane(), SCRIPTED], {'pairs': {}, 'particles': {'radius': 0.1}}),
    'springs': ([plane(), SCRIPTED],
                {'springs': {'pairs': [[0, 1]], 'stiffness': 2e5}, 'pairs': {},
                 'particles': {'radius': 0.1}}),
}


def scene(name):
    """Give a simulation of two particles that fall on the ground."""
    colliders, keys = SCENES[name]
    return simulate(colliders, [[0.0, 0.0, 0.3], [0.15, 0.0, 0.2]], (0.5, 0.0, 0.0), ledger=True,
                    **keys)


def state(sim):
    """Give all that a step changes but the ledger, as text."""
    return repr((sim.time, sim.position.tolist(), sim.velocity.tolist(), sim.counters,
                 sim.contacts, [sim.collider_pose(c.name) for c in sim.scene.colliders]))


class Interrupter:
    """Sends Ctrl-C to the main thread again and again while the block is done."""

    def __enter__(self):
        self._ended, main = False, get_ident()

        def interrupt():
            random = np.random.default_rng(1)
            while not self._ended:
                time.sleep(random.uniform(0.0, 0.01))
                if not self._ended:
                    signal.pthread_kill(main, signal.SIGINT)
        self._thread = Thread(target=interrupt)
        self._thread.start()

    def __exit__(self, *_):
        self._ended = True
        while self._thread.is_alive():
            with suppress(KeyboardInterrupt):
                self._thread.join()
        with suppress(KeyboardInterrupt):
            time.sleep(0)


@pytest.fixture
def ctrl_c():
    """Let Ctrl-C raise KeyboardInterrupt, as in a program, and restore what it did."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize('name', SCENES)
def test_the_state_is_that_of_its_time(name, ctrl_c):
    """Whenever a call of step is interrupted, the state is that of whole steps, to the bit."""
    sim, interruptions = scene(name), 0
    sim.step()
    with suppress(KeyboardInterrupt), Interrupter():
        while interruptions < 10:
            try:
                sim.step(10 ** 12)
            except KeyboardInterrupt:
                interruptions += 1
    steps = round(sim.time / sim.dt)
    other = scene(name)
    other.step(steps)
    assert state(sim) == state(other)
    assert sim.ledger.total.residual == pytest.approx(0.0, abs=1e-9)
    assert sim.ledger.total.change == pytest.approx(other.ledger.total.change)
    sim.step(3)
    other.step(3)
    assert state(sim) == state(other)


@pytest.mark.parametrize('name', SCENES)
def test_pieces_of_a_call_change_no_bit(name, monkeypatch):
    """Whether a call is one piece, a piece a step, or anything between."""
    found = set()
    for piece in (1e9, 0.0, 3e-3):
        monkeypatch.setattr('collision_sim.simulation.PIECE', piece)
        sim = scene(name)
        sim.step(2)
        if any(collider.name == 'ball' for collider in sim.scene.colliders):
            sim.move_collider('ball', [[0, 0, 5.0 + 0.01 * k] for k in range(7)],
                              [[0, 0, 0, 1]] * 7)
        sim.step(40)
        found.add(state(sim) + repr(sim.ledger))
    assert len(found) == 1


def test_a_handler_that_raises_nothing_ends_nothing(monkeypatch):
    """A signal that a program only notes does not cut a call of step short."""
    monkeypatch.setattr('collision_sim.simulation.PIECE', 0.0)
    noted, sim = [], scene('still')
    before = signal.signal(signal.SIGINT, lambda *_: noted.append(sim.time))
    try:
        move = sim._move_particles

        def interrupted(*arguments):
            if round(sim.time / sim.dt) == 5:
                signal.raise_signal(signal.SIGINT)
            move(*arguments)
        monkeypatch.setattr(sim, '_move_particles', interrupted)
        sim.step(20)
    finally:
        signal.signal(signal.SIGINT, before)
    assert sim.time == 20 * sim.dt and noted == [6 * sim.dt]


def test_what_waits_is_raised_once(ctrl_c):
    """At the end of the outermost block, whatever the inner ones hold."""
    done = []
    with pytest.raises(KeyboardInterrupt):
        with interrupts.held():
            with interrupts.held():
                signal.raise_signal(signal.SIGINT)
                signal.raise_signal(signal.SIGINT)
                done.append(1)
            done.append(2)
    with interrupts.held():
        done.append(3)
    assert done == [1, 2, 3] and not interrupts.is_held()


def test_aside_is_heard_at_once(ctrl_c):
    """While another thread works on something, held or not; what it raises arrives."""
    assert interrupts.aside(max, 3, 4) == 4
    with pytest.raises(ZeroDivisionError):
        interrupts.aside(divmod, 1, 0)
    main = get_ident()

    def work():
        signal.pthread_kill(main, signal.SIGINT)
        time.sleep(1.0)
        ended.append(1)
    ended = []
    with pytest.raises(KeyboardInterrupt), interrupts.held():
        interrupts.aside(work)
    assert not ended and not interrupts.is_held()


class Careless:
    """Gets an interrupt while it is deleted, where Python swallows it."""

    def __del__(self):
        signal.raise_signal(signal.SIGINT)
        sum(range(10))


def caught():
    """Catch whatever comes, as some libraries do."""
    with suppress(BaseException):
        signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize('lose', [Careless, caught])
def test_an_interrupt_that_is_swallowed_comes_again(lose, capsys):
    """Once it is lost in a callback, or caught by somebody, and without a word."""
    def command():
        lose()
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            time.sleep(0.01)

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), Listener(last=False):
        command()
    assert signal.getsignal(signal.SIGINT) is before
    assert capsys.readouterr().err == ''


def test_an_interrupt_does_not_break_what_it_has_begun():
    """It is not raised again while a `finally` works, nor after the command has said it heard."""
    done = []
    with Listener(last=False) as listener:
        try:
            try:
                signal.raise_signal(signal.SIGTERM)
            finally:
                time.sleep(0.5)
                signal.raise_signal(signal.SIGINT)
                done.append('tidied')
        except KeyboardInterrupt:
            code = heard()
        signal.raise_signal(signal.SIGINT)
        time.sleep(0.5)
        done.append('written')
    assert done == ['tidied', 'written'] and code == 143 and listener.number == signal.SIGTERM


def test_an_error_that_was_made_of_an_interrupt(monkeypatch, capsys):
    """Libraries make ImportErrors of interrupts; the command was interrupted nevertheless."""
    def parse(words):
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise ImportError('numpy is broken') from None
    monkeypatch.setattr(cli, 'parse', parse)
    assert cli.main(['run', 'demo']) == 130
    assert capsys.readouterr().err == 'collision_sim: interrupted\n'


@pytest.mark.parametrize('words', [
    ['run', 'demo', '--duration', '1e6'], ['view', 'demo', '--port', '0'], ['report'],
    ['advise', 'demo', '--error', '1e-3'], ['bench'], ['stability'],
    ['sweep', 'demo', '--vary', 'restitution=0:1:9', '--duration', '100', '--out', 'a.csv']],
    ids=lambda words: words[0])
def test_ctrl_c_at_any_time(words, tmp_path):
    """Exit code 130 (0 for view) and no traceback, however early it comes once it listens."""
    program = 'from collision_sim import cli; import sys; print(flush=True); sys.exit(cli.main())'
    for delay in (0.05, 0.4, 1.5):
        process = subprocess.Popen(
            [sys.executable, '-c', program, *words], cwd=tmp_path, start_new_session=True,
            env={**os.environ, 'PYTHONPATH': str(ROOT)}, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        process.stdout.readline()
        time.sleep(delay)
        os.killpg(process.pid, signal.SIGINT)
        _, error = process.communicate(timeout=PATIENCE)
        assert process.returncode in (130, 0 if words[0] == 'view' else 130), error
        assert 'Traceback' not in error and 'ignored' not in error


EACH_ONCE = """
import sys
sys.path.insert(0, 'test')
from collision_sim.core import jit
from test_interrupts import scene, state

aside, seen = jit.aside, set()

def interrupted(compile_here, signature):
    key = compile_here, signature
    if key not in seen:
        seen.add(key)
        raise KeyboardInterrupt
    return aside(compile_here, signature)

jit.aside = interrupted
interruptions, before = 0, []
while not before:
    try:
        sim = scene(sys.argv[1])
        before = [state(sim)]
    except KeyboardInterrupt:
        pass
while sim.time < 60 * sim.dt:
    try:
        sim.step()
        before.append(state(sim))
    except KeyboardInterrupt:
        interruptions += 1
        assert state(sim) == before[-1]
jit.aside = aside
other = scene(sys.argv[1])
for expected in before:
    assert state(other) == expected
    other.step()
print(interruptions)
"""


@pytest.mark.jit
@pytest.mark.parametrize('name', ['moving', 'pairs', 'springs'])
def test_an_interrupt_of_each_compilation(name):
    """Each kernel that a step needs is interrupted once: the step is not taken, then it is."""
    done = subprocess.run([sys.executable, '-c', EACH_ONCE, name], cwd=ROOT, text=True,
                          env={**os.environ, 'PYTHONPATH': str(ROOT)}, capture_output=True)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 0
