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
A page in the browser that shows a simulation: particles, contacts and colliders, while it runs.

The page is served on 127.0.0.1 only, and only to itself: what another web page asks for is refused
by its Origin. It has buttons if they are asked for; else it only shows. Needs viser.
"""

from contextlib import contextmanager
from functools import partial
from queue import SimpleQueue
import socket
from time import perf_counter

from collision_sim.appearance import contact_lines, speed_colors, STATE_COLORS
from collision_sim.checks import SceneError
from collision_sim.viewer_panel import legend, Pace, readings
from collision_sim.viewer_solids import add_solid
import numpy as np

HOST, PORT = '127.0.0.1', 8080
RATE = 20.0             # frames a second
BUTTONS = ('pause', 'step', 'reset')
EVERY_CONTACT = 20_000  # particles whose contacts are worth showing after every step
MOST_LINES = 10_000     # shown in one frame
TEXT_PERIOD = 0.25      # s between two readings, so that they can be read
SAMPLE = 10_000         # particles whose speeds say what is fast
SMALLEST = 2e-3         # size of a particle without a radius, of the size of the scene
FOV = 0.7               # rad, vertical
VIEW = np.array([0.55, -1.0, 0.55])     # from the middle of the scene towards the camera
FAR = 1e15              # m; what is farther away is not shown


class Viewer:
    """
    A page that shows a simulation.

    Parameters
    ----------
    simulation : Simulation
        As it is at the start; its scene says what colliders there are.
    port : int
        Of the page; 0 takes a free one.
    control : bool
        Whether the page has buttons; who can open the page can press them.

    Attributes
    ----------
    url : str
        Of the page.

    Raises
    ------
    SceneError
        If viser is not installed, or another program has the port.

    """

    def __init__(self, simulation, port=PORT, control=False):
        self._presses = SimpleQueue()
        self._pace = Pace()
        self._fastest = 0.0
        self._text_due = 0.0
        self._server = _serve(port)
        self.url = f'http://{HOST}:{self._server.get_port()}'
        middle, size = _extent(simulation)
        self._look_at(middle, size)
        self._add_panel(control)
        self._solids = [add_solid(self._server.scene, collider, size)
                        for collider in simulation.scene.colliders]
        self._poses = [None] * len(self._solids)
        self._add_particles(simulation, size)
        self.update(simulation)

    def _look_at(self, middle, size):
        """Point the camera that a new page starts with."""
        camera = self._server.initial_camera
        camera.fov = FOV
        camera.near, camera.far = size / 100.0, size * 100.0
        camera.look_at = middle
        camera.position = middle + 1.15 * size * VIEW / np.sqrt(VIEW @ VIEW)

    def _add_panel(self, control):
        gui = self._server.gui
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.set_panel_label('collision_sim')
        if control:
            for name in BUTTONS:
                gui.add_button(name).on_click(lambda _, name=name: self._presses.put(name))
        self._readings = gui.add_html('')
        self._legend = gui.add_html('')

    def _add_particles(self, simulation, size):
        radius = float(np.mean(simulation.scene.particles.radius)) or SMALLEST * size
        scene = self._server.scene
        point = {'points': np.zeros((1, 3)), 'colors': np.zeros((1, 3), np.uint8),
                 'precision': 'float32', 'visible': False}      # viser cannot show none
        self._particles = scene.add_point_cloud(
            '/particles', point_size=radius, point_shape='circle', **point)
        self._points = scene.add_point_cloud(
            '/contacts/points', point_size=0.8 * radius, point_shape='diamond',
            point_shading='flat', **point)
        self._normals = scene.add_line_segments(
            '/contacts/normals', np.zeros((1, 2, 3)), np.zeros((1, 2, 3), np.uint8),
            thickness=1.5, thickness_units='screen', visible=False)

    # ------------------------------------------------------------------ while it runs

    def update(self, simulation, contacts=None, paused=False):
        """
        Show the simulation as it is now.

        Parameters
        ----------
        simulation : Simulation
            The one of the start.
        contacts : list of Contacts, optional
            To be shown; those of the last step if absent, or some of them if they are many.
        paused : bool
            Whether to say so.

        """
        contacts = [simulation.some_contacts(MOST_LINES)] if contacts is None else contacts
        self._pace.note(simulation)
        with self._server.atomic():
            self._show_particles(simulation)
            self._show_contacts(contacts)
            self._place_solids(simulation)
            self._show_text(simulation, paused)

    def pressed(self):
        """Give the names of the BUTTONS that were pressed since the last call."""
        return [self._presses.get() for _ in range(self._presses.qsize())]

    def close(self):
        """Stop serving the page."""
        self._server.stop()

    def _show_particles(self, simulation):
        position = simulation.position
        with np.errstate(over='ignore'):
            speed = np.sqrt(np.square(simulation.velocity).sum(axis=1))
        shown = (np.abs(position).max(axis=1) <= FAR) & np.isfinite(speed)  # False for NaN
        if not shown.all():
            position, speed = position[shown], speed[shown]
        if simulation.time == 0.0:
            self._fastest = 0.0
        if len(speed):
            some = speed[::1 + len(speed) // SAMPLE]
            self._fastest = max(self._fastest, float(np.quantile(some, 0.99)))
        points = position.astype(np.float32, order='C')     # whose copies by viser are fast
        _replace(self._particles, points, speed_colors(speed, self._fastest))

    def _show_contacts(self, contacts):
        start, end, state = contact_lines(contacts, MOST_LINES)
        colors = (255.0 * STATE_COLORS[state, :3]).astype(np.uint8)
        _replace(self._points, start, colors)
        _replace(self._normals, np.stack([start, end], axis=1),
                 np.repeat(_linear(colors)[:, None], 2, axis=1))

    def _place_solids(self, simulation):
        for k, (collider, solid) in enumerate(zip(simulation.scene.colliders, self._solids)):
            pose = np.concatenate(simulation.collider_pose(collider.name))
            if self._poses[k] is None or not np.array_equal(pose, self._poses[k]):
                self._poses[k] = pose
                solid.position, solid.wxyz = pose[:3], pose[[6, 3, 4, 5]]

    def _show_text(self, simulation, paused):
        now = perf_counter()
        if now >= self._text_due:
            self._text_due = now + TEXT_PERIOD
            self._readings.content = readings(simulation, self._pace, paused)
            self._legend.content = legend(self._fastest)


def _replace(handle, points, colors):
    """Show other points or lines; none of them is not shown at all."""
    handle.visible = len(points) > 0
    if len(points):
        handle.points, handle.colors = points, colors


def _linear(colors):
    """Give colours as the lines of viser take them: their light, not their code in sRGB."""
    return (255.0 * (colors / 255.0) ** 2.2).astype(np.uint8)


def _extent(simulation):
    """Middle (3,) [m] and size [m] of what there is to see at the start."""
    points = simulation.position[np.isfinite(simulation.position).all(axis=1)]
    corners = list(np.quantile(points, [0.01, 0.99], axis=0)) if len(points) else []
    for collider in simulation.scene.colliders:
        if collider.shape != 'plane' and not collider.inside:
            reach = collider.mesh.extent if collider.mesh \
                else np.sqrt(np.square(collider.size).sum())
            middle = simulation.collider_pose(collider.name)[0]
            corners += [middle - reach, middle + reach]
    low, high = (np.min(corners, axis=0), np.max(corners, axis=0)) if corners else np.zeros((2, 3))
    return 0.5 * (low + high), float(np.sqrt(np.square(high - low).sum())) or 1.0


# ---------------------------------------------------------------------- the server


def _serve(port):
    """Start the server of viser, on this machine and for its own page only."""
    try:
        import rich
        import viser
    except ImportError:
        raise SceneError('viewer', True,
                         "needs viser: pip install 'collision_sim[viewer]'") from None

    class Server(viser.ViserServer):

        def request_share_url(self, verbose=True):
            """Refuse the tunnel by which viser would show the page to the whole internet."""

    rich.reconfigure(quiet=True)        # viser prints in a frame what our users print in a line
    port = _free_port(port)
    with _own_pages_only([f'http://{host}:{port}' for host in (HOST, 'localhost')]):
        server = Server(host=HOST, port=port, verbose=False)
    if server.get_port() != port:       # viser takes another one, which its page may not talk to
        server.stop()
        raise SceneError('port', port, 'is in use')
    return server


def _free_port(port):
    """Give the port if it is free, or a free one in the place of 0."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except (OSError, OverflowError) as error:
            raise SceneError('port', port, f'must be a free port: {error}') from None
        return probe.getsockname()[1]


@contextmanager
def _own_pages_only(origins):
    """
    Have websockets refuse the pages of other origins in servers that start meanwhile.

    viser would let every page that is open in some browser of this machine look on and press
    buttons, and has no option against it. Programs that are no browser send no origin.
    """
    from websockets.asyncio import server
    serve = server.serve
    server.serve = partial(serve, origins=[None, *origins])
    try:
        yield
    finally:
        server.serve = serve
