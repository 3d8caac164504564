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

"""The page of the viewer, as a client without a browser gets it, and who is a client."""

import socket
import sys
import time

import collision_sim as cs
from collision_sim.appearance import (contact_lines, LENGTH, LONGEST, SPEED_COLORS, speed_colors,
                                      STATE_COLORS)
from collision_sim.core.rules import COLLISION
from collision_sim.viewer import Viewer
from collision_sim.viewer_panel import Pace, readings
from collision_sim.viewer_solids import capsule
import numpy as np
import pytest

COLLIDERS = [
    {'name': 'ground', 'shape': 'plane', 'normal': [0, 0.6, 0.8]},
    {'name': 'ball', 'shape': 'sphere', 'radius': 0.5, 'position': [3, 0, 1]},
    {'name': 'box', 'shape': 'box', 'size': [1, 2, 3], 'position': [0, 5, 5], 'inside': True},
    {'name': 'pill', 'shape': 'capsule', 'radius': 0.2, 'length': 1, 'position': [0, 0, 3],
     'topic': 'pill/pose'},
    {'name': 'can', 'shape': 'cylinder', 'radius': 0.2, 'length': 1, 'position': [0, 0, 5]},
    {'name': 'tent', 'shape': 'mesh', 'position': [-3, 0, 2], 'faces': [[0, 1, 2]],
     'vertices': [[0, 0, 0], [1, 0, 0], [0, 1, 0]]},
]
GROUND = [{'name': 'ground', 'shape': 'plane'}]


def simulation(colliders=GROUND, **particles):
    particles = particles or {'position': [[0, 0, 8], [1, 0, 8], [2, 0, 9]],
                              'velocity': [[0, 0, 0], [1, 0, 0], [0, 2, 0]], 'radius': 0.1}
    return cs.Simulation(cs.Scene.from_dict(
        {'particles': particles, 'colliders': colliders, 'stepping': {'dt': 0.01}}))


@pytest.fixture
def show():
    """Give a function that makes a Viewer on a free port."""
    pytest.importorskip('viser', reason='needs viser')
    viewers = []

    def make(simulation, **options):
        viewers.append(Viewer(simulation, port=0, **options))
        return viewers[-1]

    yield make
    for viewer in viewers:
        viewer.close()


class Client:
    """What the page knows: props of the nodes by name, their poses, and parts of the panel."""

    def __init__(self, url, origin=None):
        from websockets.sync.client import connect
        import viser
        self.socket = connect(url.replace('http', 'ws'), origin=origin, max_size=None,
                              subprotocols=['viser-v' + viser.__version__])
        self.nodes, self.panel, self.kinds = {}, {}, []
        self.send('ViewerCameraMessage', wxyz=[1, 0, 0, 0], position=[0, 0, 1], fov=1.0, near=0.1,
                  far=9.0, look_at=[0, 0, 0], up_direction=[0, 0, 1], image_height=9,
                  image_width=9)        # viser listens to nobody who has not said this

    def send(self, kind, **values):
        import msgspec
        self.socket.send(msgspec.msgpack.encode({'type': kind, **values}))

    def wait(self, condition):
        while not condition():
            for message in _unpacked(self.socket.recv(timeout=20.0)):
                self._take(message)

    def _take(self, message):
        self.kinds.append(message['type'])
        if 'name' in message:
            node = self.nodes.setdefault(message['name'], {})
            node |= message.get('props', {}) | message.get('updates', {})
            node |= {key: message[key] for key in ('position', 'wxyz') if key in message}
        elif 'uuid' in message:
            part = self.panel.setdefault(message['uuid'], {'kind': message['type']})
            part |= message.get('props', {}) | message.get('updates', {})

    def node(self, name):
        self.wait(lambda: name in self.nodes)
        return self.nodes[name]

    def press(self, label):
        self.wait(lambda: any(part.get('label') == label for part in self.panel.values()))
        button = next(u for u, part in self.panel.items() if part.get('label') == label)
        self.send('GuiUpdateMessage', uuid=button, updates={'value': True})

    def words(self):
        return ' '.join(str(part.get('content', '')) for part in self.panel.values())


def _unpacked(data):
    """Messages of a packet: lengths, packed messages, and the arrays behind them."""
    import msgspec
    import zstandard
    size = int.from_bytes(data[8:16], 'little')
    packet = msgspec.msgpack.decode(zstandard.decompress(data[16:16 + size]))
    arrays, offset = [], 16 + size
    for length in packet['binaryBufferLengths']:
        offset += -offset % 8
        arrays.append(data[offset:offset + length])
        offset += length

    def filled(value):
        if isinstance(value, dict) and '__binary_index' in value:
            kind = np.dtype(value['dtype'])
            return np.frombuffer(arrays[value['__binary_index']], kind)
        if isinstance(value, dict):
            return {key: filled(part) for key, part in value.items()}
        return value

    return [filled(message) for message in packet['messages']]


# ------------------------------------------------------------------------ what is shown


def test_particles_are_where_they_are_and_coloured_by_speed(show):
    sim = simulation()
    viewer = show(sim)
    sim.step(7)
    viewer.update(sim)
    client = Client(viewer.url)
    node = client.node('/particles')
    client.wait(lambda: np.size(node['points']) == 9)
    points = np.reshape(node['points'], (-1, 3))
    np.testing.assert_array_equal(points, sim.position.astype(np.float32))
    colors = np.reshape(node['colors'], (-1, 3)).tolist()
    assert colors[2] == SPEED_COLORS[-1].tolist() and colors[0] != colors[1] != colors[2]
    assert node['point_size'] == pytest.approx(0.1)


@pytest.mark.filterwarnings('error')
def test_a_particle_that_is_not_finite_is_left_out(show):
    sim = simulation(position=[[0, 0, z] for z in (8, 9, 10, 11, 12)])
    sim.position[1] = np.nan, 0.0, 0.0
    sim.position[2] = 1e30, 0.0, 0.0
    sim.velocity[3] = 0.0, np.inf, 0.0
    sim.velocity[4] = 0.0, 1e200, 0.0
    viewer = show(sim)
    node = Client(viewer.url).node('/particles')
    np.testing.assert_array_equal(node['points'], [0.0, 0.0, 8.0])
    np.testing.assert_array_equal(node['colors'], SPEED_COLORS[0])


def test_every_collider_is_a_solid_that_moves_along(show):
    sim = simulation(COLLIDERS)
    viewer = show(sim)
    client = Client(viewer.url)
    for collider in COLLIDERS:
        client.node('/colliders/%s/solid' % collider['name'])
    assert client.nodes['/colliders/box/solid']['dimensions'] == [1, 2, 3]
    assert client.nodes['/colliders/box/solid']['opacity'] < 0.5
    assert client.nodes['/colliders/ball/solid']['opacity'] is None
    sim.place_collider('pill', [4, 1, 2], [0.6, 0, 0, 0.8])
    viewer.update(sim)
    node = client.node('/colliders/pill')
    client.wait(lambda: np.allclose(node['position'], [4, 1, 2]))
    client.wait(lambda: np.allclose(node['wxyz'], [0.8, 0.6, 0, 0]))


def test_contacts_by_state(show):
    """A ball on each side hits the ground: points below it, lines up, in the colour of a hit."""
    sim = simulation(position=[[-1, 0, 0.101], [1, 0, 0.101], [0, 0, 9]], radius=0.1,
                     velocity=[0, 0, -1])
    viewer = show(sim)
    client = Client(viewer.url)
    sim.step()
    assert (sim.contacts.state == COLLISION).tolist() == [True, True]
    viewer.update(sim)
    points, lines = client.node('/contacts/points'), client.node('/contacts/normals')
    client.wait(lambda: np.size(points['points']) == 6 and np.size(lines['points']) == 12)
    np.testing.assert_allclose(np.reshape(points['points'], (-1, 3))[:, 0], [-1, 1], atol=1e-6)
    direction = np.diff(np.reshape(lines['points'], (-1, 2, 3)), axis=1)
    assert (direction[:, 0, 2] > 0.01).all() and np.abs(direction[..., :2]).max() < 1e-6
    np.testing.assert_array_equal(np.reshape(points['colors'], (-1, 3))[0],
                                  (255 * STATE_COLORS[COLLISION, :3]).astype(np.uint8))


def test_words(show):
    sim = simulation()
    viewer = show(sim)
    client = Client(viewer.url)
    client.wait(lambda: '0.00 s' in client.words() and 'repulsion' in client.words())
    assert 'real-time factor' in client.words()


@pytest.mark.parametrize('colliders', [[], GROUND], ids=['nothing', 'plane'])
def test_a_scene_of_next_to_nothing(show, colliders):
    """One particle, and what has no size: the page opens all the same."""
    client = Client(show(simulation(colliders, position=[[0, 0, 1]])).url)
    client.wait(lambda: '0.00 s' in client.words())
    assert client.node('/particles')['point_size'] > 0.0


def test_what_stands_still_is_not_sent_again(show):
    sim = simulation()
    viewer = show(sim)
    client = Client(viewer.url)
    client.wait(lambda: 'ReplayDoneMessage' in client.kinds)
    known = len(client.kinds)
    for _ in range(3):
        viewer.update(sim, paused=True)
    sim.step()
    viewer.update(sim)
    node, before = client.nodes['/particles'], client.nodes['/particles']['points']
    client.wait(lambda: not np.array_equal(node['points'], before))
    assert 'SetPositionMessage' not in client.kinds[known:]


# ------------------------------------------------------------------------ who may do what


@pytest.mark.parametrize('origin', ['https://example.com', 'http://127.0.0.1:1', 'null'])
def test_pages_of_others_are_refused(show, origin):
    from websockets.exceptions import InvalidStatus
    viewer = show(simulation(), control=True)
    with pytest.raises(InvalidStatus, match='403'):
        Client(viewer.url, origin)
    client = Client(viewer.url, viewer.url)
    client.node('/particles')


def test_other_addresses_are_not_served(show):
    port = int(show(simulation()).url.rsplit(':', 1)[1])
    with socket.create_connection(('127.0.0.1', port), timeout=20.0):
        pass
    with pytest.raises(OSError):        # one of this machine too, that 0.0.0.0 would answer at
        socket.create_connection(('127.0.0.2', port), timeout=20.0)


def test_nobody_can_make_the_page_public(show, monkeypatch):
    asked = []
    monkeypatch.setattr('viser._viser.ViserTunnel', lambda *address: asked.append(address))
    viewer = show(simulation(), control=True)
    client = Client(viewer.url)
    client.send('ShareUrlRequest')
    client.press('pause')               # so that the one before has been answered, too
    assert pressed(viewer) == ['pause']
    viewer._server.request_share_url()
    assert asked == []


def pressed(viewer):
    """Give the buttons that were pressed, as soon as there are any."""
    end = time.monotonic() + 20.0
    while time.monotonic() < end:
        if names := viewer.pressed():
            return names
        time.sleep(0.01)
    return []


def test_buttons_on_request_only(show):
    viewer = show(simulation())
    client = Client(viewer.url)
    client.wait(lambda: 'ReplayDoneMessage' in client.kinds)
    assert client.words() and 'GuiButtonMessage' not in client.kinds
    viewer = show(simulation(), control=True)
    client = Client(viewer.url)
    for name in ('step', 'reset', 'pause'):
        client.press(name)
        assert pressed(viewer) == [name]
    assert viewer.pressed() == []


# ------------------------------------------------------------------------ what is refused


def test_without_viser(monkeypatch):
    monkeypatch.setitem(sys.modules, 'viser', None)
    with pytest.raises(cs.SceneError, match=r"needs viser: pip install 'collision_sim\[viewer\]'"):
        Viewer(simulation())


def test_a_port_that_is_taken(show):
    with socket.create_server(('127.0.0.1', 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(cs.SceneError, match=f'port: {port}: must be a free port'):
            Viewer(simulation(), port=port)


# ------------------------------------------------------------------------ parts


@pytest.mark.filterwarnings('error')
def test_contact_lines_are_no_longer_than_shown():
    """Whatever the impulse; without one they have no length."""
    contacts = simulation().contacts._replace(
        point=np.zeros((3, 3)), normal=np.tile([0.0, 0.0, 1.0], (3, 1)),
        impulse=np.array([[0, 0, 0], [0, 0.3, 0.4], [0, 0, 1e300]]), state=np.ones(3, int))
    _, end, _ = contact_lines([contacts], 10)
    np.testing.assert_allclose(end[:, 2], [0.0, 0.5 * LENGTH, LONGEST])


def test_speed_colors_go_from_dark_to_light():
    colors = speed_colors(np.linspace(0.0, 3.0, 50), 2.0)
    light = colors @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(light[:33]) > 0.0).all()
    assert (colors[34:] == SPEED_COLORS[-1]).all()
    assert (speed_colors(np.ones(2), 0.0) == SPEED_COLORS[0]).all()


@pytest.mark.parametrize('half', [0.0, 0.7])
def test_capsule(half):
    """All vertices are on the surface, and all triangles turn left as seen from outside."""
    vertices, faces = capsule(0.3, half)
    axis = np.stack([0 * vertices[:, 0], 0 * vertices[:, 0],
                     np.clip(vertices[:, 2], -half, half)], axis=1)
    np.testing.assert_allclose(np.linalg.norm(vertices - axis, axis=1), 0.3, rtol=1e-6)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    volume = np.einsum('ij,ij->i', a, np.cross(b, c)).sum() / 6.0
    exact = np.pi * 0.3 ** 2 * (2 * half + 4 / 3 * 0.3)
    assert volume == pytest.approx(exact, rel=0.01) and volume < exact


def test_pace(monkeypatch):
    """Half as fast as the clock, then a reset."""
    sim, pace, now = simulation(), Pace(), [0.0]
    monkeypatch.setattr('collision_sim.viewer_panel.perf_counter', lambda: now[0])
    pace.note(sim)
    assert pace.real_time_factor == 0.0
    for _ in range(100):
        sim.step()
        now[0] += 2 * sim.dt
        pace.note(sim)
    assert pace.real_time_factor == pytest.approx(0.5)
    assert '<td style="text-align:right">50</td>' in readings(sim, pace, paused=False)
    assert '1.00 s (paused)' in readings(sim, pace, paused=True)
    sim.reset()
    now[0] += 1.0
    pace.note(sim)
    assert pace.real_time_factor == 0.0
