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

"""The page of the viewer in a real browser: its picture, its words, its buttons."""

from browser import Browser
import collision_sim as cs
from collision_sim.appearance import SPEED_COLORS
from collision_sim.viewer import Viewer
import numpy as np
import pytest

SCENE = {
    'gravity': [0, 0, 0],
    'particles': {'position': [[x, y, z] for x in (-1, 0, 1) for y in (-1, 1) for z in (1, 2)],
                  'velocity': [[0, 0, 0]] * 6 + [[0, 0, -1e-9]] * 6, 'radius': 0.2},
    'colliders': [
        {'name': 'ground', 'shape': 'plane'},
        {'name': 'slab', 'shape': 'box', 'size': [0.5, 0.5, 0.5], 'position': [0, 0, 0.5],
         'topic': 'slab/pose'}],
}


@pytest.fixture(scope='module')
def page():
    """Give a simulation, its viewer and a browser that shows it."""
    pytest.importorskip('viser', reason='needs viser')
    browser = Browser()
    simulation = cs.Simulation(cs.Scene.from_dict(SCENE))
    viewer = Viewer(simulation, port=0, control=True)
    try:
        browser.visit(viewer.url)
        browser.wait(lambda: near(shown(browser), SPEED_COLORS[0]).any())
        yield simulation, viewer, browser
    finally:
        browser.close()
        viewer.close()


def shown(browser):
    """Picture of the middle, between a warning of slow drawing and the panel."""
    return browser.picture()[:, 300:670]


def near(picture, color, distance=40):
    """Where a picture has a colour, or nearly so."""
    return np.abs(picture - np.asarray(color, dtype=np.int64)).sum(axis=2) < distance


def test_particles_are_seen_in_their_colours(page):
    """Half of the balls rest, half are the fastest."""
    _, _, browser = page
    picture = shown(browser)
    assert near(picture, SPEED_COLORS[0]).sum() > 100
    assert near(picture, SPEED_COLORS[-1]).sum() > 100


def test_a_collider_that_moves_is_seen_to_move(page):
    simulation, viewer, browser = page
    before = shown(browser)
    still = shown(browser)
    assert (before == still).all()
    simulation.place_collider('slab', [-0.6, -0.6, 0.8], [0, 0, 0, 1])
    viewer.update(simulation)
    browser.wait(lambda: (shown(browser) != before).any(axis=2).sum() > 500)


def test_buttons_and_words(page):
    simulation, viewer, browser = page
    assert 'real-time factor' in browser.text()
    for name in ('pause', 'step', 'reset'):
        browser.click(name)
        pressed = []
        browser.wait(lambda: pressed.extend(viewer.pressed()) or pressed)
        assert pressed == [name]


def test_the_page_is_at_peace(page):
    """No errors in the console, and everything came from the page's own address."""
    _, viewer, browser = page
    assert [line for line in browser.driver.get_log('browser') if line['level'] == 'SEVERE'] == []
    names = browser.driver.execute_script(
        'return performance.getEntriesByType("resource").map(entry => entry.name)')
    assert [name for name in names if not name.startswith((viewer.url, 'data:', 'blob:'))] == []
