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

"""`collision_sim view`: in step with the clock, buttons, and how it ends."""

import signal
import subprocess
import sys

from collision_sim import cli
from collision_sim.scene import Scene
from collision_sim.simulation import Simulation
from collision_sim.studies import view
import pytest

FRAME = 0.05


class Clock:
    """A clock that goes on when somebody sleeps, or a step is taken."""

    def __init__(self, monkeypatch, seconds_a_step):
        self.now = 100.0
        monkeypatch.setattr(view, 'perf_counter', lambda: self.now)
        monkeypatch.setattr(view, 'sleep', self.go_on)
        step = Simulation.step

        def timed(simulation, n=1):
            step(simulation, n)
            self.go_on(n * seconds_a_step)
        monkeypatch.setattr(Simulation, 'step', timed)

    def go_on(self, duration):
        self.now += duration


class Page:
    """In the place of a Viewer: notes what it is to show, and presses buttons."""

    def __init__(self):
        self.presses, self.times, self.contacts, self.paused = [], [], [], False

    def pressed(self):
        presses, self.presses = self.presses, []
        return presses

    def update(self, simulation, contacts, paused):
        self.times.append(simulation.time)
        self.contacts, self.paused = contacts, paused


@pytest.fixture
def play(monkeypatch):
    """Give a function that makes a Player of a falling particle, its page and its clock."""
    def make(seconds_a_step=1e-4, dt=0.004, until=1e9):
        scene = Scene.from_dict({'particles': {'position': [[0, 0, 1]]}, 'stepping': {'dt': dt},
                                 'colliders': [{'name': 'ground', 'shape': 'plane'}]})
        clock, page = Clock(monkeypatch, seconds_a_step), Page()
        player = view.Player(Simulation(scene), page, FRAME)

        def frames(count):
            for _ in range(count):
                player.show(until)
        return frames, page, clock
    return make


def test_in_step_with_the_clock(play):
    """Each frame shows what the clock says, to a step, and all contacts since the one before."""
    frames, page, clock = play()
    begin = clock.now
    frames(20)
    assert clock.now - begin == pytest.approx(20 * FRAME)
    late = [FRAME * k - time for k, time in enumerate(page.times)]
    assert 0.0 <= min(late) and max(late) < 0.005
    assert len(page.contacts) in (12, 13)


def test_sleeps_that_last_too_long_are_made_up(play, monkeypatch):
    """The rate is the one that was asked for; a frame is late, not all that follow as well."""
    frames, _, clock = play()
    monkeypatch.setattr(view, 'sleep', lambda duration: clock.go_on(duration + 0.003))
    begin = clock.now
    frames(100)
    assert clock.now - begin == pytest.approx(100 * FRAME + 0.003)


def test_frames_that_come_late_are_made_up(play, monkeypatch):
    """Every tenth takes too long to show; neither frames nor time of the simulation are lost."""
    frames, page, clock = play()
    update = page.update

    def slow_at_times(*args):
        update(*args)
        clock.go_on(0.09 if len(page.times) % 10 == 5 else 0.001)
    monkeypatch.setattr(page, 'update', slow_at_times)
    begin = clock.now
    frames(100)
    assert clock.now - begin == pytest.approx(100 * FRAME)
    assert page.times[-1] == pytest.approx(99 * FRAME, abs=0.005)


def test_a_slow_step_is_made_up(play, monkeypatch):
    """One step takes 0.09 s; a few frames later the simulation shows what the clock does."""
    frames, page, clock = play()
    frames(10)
    step = Simulation.step

    def slow_once(simulation):
        monkeypatch.setattr(Simulation, 'step', step)
        step(simulation)
        clock.go_on(0.09)
    monkeypatch.setattr(Simulation, 'step', slow_once)
    begin = clock.now
    frames(10)
    assert page.times[10] == pytest.approx(page.times[9] + 0.004)
    assert clock.now - begin == pytest.approx(10 * FRAME)
    assert page.times[-1] == pytest.approx(19 * FRAME, abs=0.005)


def test_slower_than_the_clock(play):
    """What there is no time for is left out; the page is still shown at its rate."""
    frames, page, clock = play(seconds_a_step=0.01)
    begin = clock.now
    frames(20)
    assert clock.now - begin == pytest.approx(20 * FRAME, rel=0.05)
    steps = round(page.times[-1] / 0.004)
    assert 19 * 3 <= steps <= 20 * 5


def test_not_beyond_the_duration(play):
    frames, page, _ = play(until=0.5)
    frames(20)
    assert page.times[-1] == pytest.approx(0.5)


def test_a_scene_without_steps(play):
    frames, page, _ = play(dt=0.0)
    frames(3)
    assert page.times == [0.0, 0.0, 0.0]


def test_buttons(play):
    """Pause holds, step goes on by one step while paused only, reset begins again."""
    frames, page, _ = play()
    frames(10)
    page.presses = ['step', 'pause']
    frames(5)
    held = page.times[-1]
    assert page.paused and len(set(page.times[-5:])) == 1
    page.presses = ['step']
    frames(2)
    assert page.times[-1] == pytest.approx(held + 0.004) and len(page.contacts) == 1
    page.presses = ['reset']
    frames(1)
    assert page.times[-1] == 0.0 and page.contacts == []
    page.presses = ['pause']
    frames(10)
    assert not page.paused and page.times[-1] == pytest.approx(10 * FRAME, abs=0.005)


@pytest.mark.parametrize('words', [['--port', '70000'], ['--port', '-1'], ['--rate', '0'],
                                   ['--rate', 'nan'], ['--duration', '0']])
def test_words_that_are_refused(words, capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main(['view', 'demo', *words])
    assert stop.value.code == 2
    assert words[1] in capsys.readouterr().err


def test_without_viser(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, 'viser', None)
    assert cli.main(['view', 'incline']) == 2
    assert "pip install 'collision_sim[viewer]'" in capsys.readouterr().err


def test_ends_by_itself(capsys):
    pytest.importorskip('viser', reason='needs viser')
    assert cli.main(['view', 'incline', '--duration', '0.1', '--port', '0']) == 0
    assert capsys.readouterr().out.startswith('collision_sim: incline is at http://127.0.0.1:')


def test_ctrl_c():
    """The usual end: exit code 0, and nothing on stderr."""
    pytest.importorskip('viser', reason='needs viser')
    process = subprocess.Popen(
        [sys.executable, '-m', 'collision_sim.cli', 'view', 'incline', '--port', '0'],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert 'http://127.0.0.1:' in process.stdout.readline()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60.0)
    assert (process.returncode, out, err) == (0, '', '')
