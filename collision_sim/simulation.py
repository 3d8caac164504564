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
What happens in a scene: particles, colliders and time.

`Simulation.step` owns the order of things; the arithmetic is in `core`.
"""

from copy import deepcopy
from dataclasses import replace
import math
from numbers import Integral, Real
from time import perf_counter
from typing import NamedTuple

from collision_sim.balances import Books, finite_masses
from collision_sim.checks import SceneError
from collision_sim.core.candidates import NOBODY
from collision_sim.core.interrupts import held, hold, let_in, release
from collision_sim.core.ledger import NO_LEDGER
from collision_sim.core.lines import in_lines
from collision_sim.core.modules import no_modules
from collision_sim.core.opening import open_meshes, open_modules
from collision_sim.core.reference import refer
from collision_sim.core.rules import (ACCOUNTS, CHANGE, COUNTERS, LOG, MOST_CONTACTS, N_LOGGED,
                                      N_STEP, NONE, NORMAL, NOTES, OF_STEP, POINT)
from collision_sim.core.shapes import distances, Present
from collision_sim.core.stepping import BLOCK, block_size, EVENT_BLOCK, step_blocks
from collision_sim.core.threads import Crew, share
from collision_sim.core.world import refer_world, World
from collision_sim.kinematics import Kinematics
from collision_sim.tables import acting_forces, collider_table, mesh_tables, step_rules
import numba
import numpy as np

MOST_STEPS = 10 ** 15   # of a call; time, a number of steps times dt, is exact to rounding as far
MOST_THREADS = 10 ** 4
PIECE = 0.1             # s; steps that are taken at once, if one does not take longer


class Contacts(NamedTuple):
    """
    Contacts of the last step, M of them, ordered by particle.

    Attributes
    ----------
    particle, collider : (M,) int64
        Indices.
    point : (M, 3) float64 [m]
    normal : (M, 3) float64 [-]
        Out of the collider.
    impulse : (M, 3) float64 [N s]
        On the particle, over the step, friction included.
    state : (M,) int64
        COLLISION, SLIDE, STICK or REPULSION of core.rules.

    """

    particle: np.ndarray
    collider: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    impulse: np.ndarray
    state: np.ndarray


class Simulation:
    """
    Particles and colliders of a scene, stepped in time.

    Parameters
    ----------
    scene : Scene
    contacts : bool
        Whether to record the contacts of each step.
    threads : int or None
        Most threads to use; None: as many as Numba would now. Results do not depend on it.
    ledger : bool
        Whether to keep the accounts of energy and momentum (`ledger`).

    Attributes
    ----------
    scene : Scene
        As it is now, parameter changes included.
    record_contacts : bool
        May be changed between steps.

    """

    def __init__(self, scene, contacts=True, threads=None, ledger=False):
        try:
            self._begin(scene, contacts, threads, ledger)
        except MemoryError as error:
            raise SceneError('particles', len(scene.particles.position),
                             f'must fit into memory: {error}') from None

    def _begin(self, scene, contacts, threads, ledger):
        """Make room for the state, and begin with that of the scene."""
        self.record_contacts = bool(contacts)
        if threads is not None and not _is_whole(threads, 1, MOST_THREADS):
            raise SceneError('threads', threads, f'must be a whole number from 1 to {MOST_THREADS}'
                                                 ', or None')
        self._threads = int(threads or numba.get_num_threads())
        self._colliders = Kinematics(scene)
        self._present = Present(refer(mesh_tables(scene)), no_modules())
        self._x, self._v = (_laid_in_lines(table.T) for table in (
            scene.particles.position, scene.particles.velocity))
        self._block = self._size_of_blocks(scene)
        blocks = -(-self._x.shape[1] // self._block)
        self._accounts = np.zeros((blocks, ACCOUNTS), dtype=np.int64)
        self._notes = np.zeros((blocks, NOTES, 3), dtype=np.int64)
        self._log, self._logs = np.zeros((blocks, 0, LOG)), False
        self._books = Books(blocks, len(scene.colliders)) if ledger else None
        self._radius = _radii(scene.particles.radius)
        exact = scene.stepping.method == 'exact'
        self._event_pairs = _event_pairs(scene) if scene.pairs and exact else None
        self._coupling = None
        if (scene.pairs or scene.springs) and not exact:
            self._coupling = _coupling(scene)
        self._adopt(scene)
        self._reset()

    @staticmethod
    def _size_of_blocks(scene):
        """Particles of a block."""
        if scene.stepping.method == 'exact':
            return 1 if scene.pairs else EVENT_BLOCK
        if scene.pairs or scene.springs:
            return BLOCK
        return block_size(len(scene.particles.position))

    def _adopt(self, scene):
        """Take a scene whose values may differ from those of the scene before."""
        self._table = collider_table(scene)
        if self._coupling:
            self._coupling.adopt(scene)
        self._rules = step_rules(self._part(scene), self._table, self._present)
        if self._coupling:
            self._coupling.adopt_rules(self._part(scene), self._rules)
        self._forces = acting_forces(scene) if scene.stepping.method == 'exact' else None
        if self._event_pairs:
            self._event_pairs.adopt(scene, self._forces)
        self._ledger = refer(self._books.ledger(scene) if self._books else NO_LEDGER)
        self._nobody = refer(NOBODY)
        self._planned = None        # for which layout of the colliders there is a crew
        self._opened = False        # whether what these rules need is
        self.scene = scene

    def _part(self, scene):
        """Give the scene of a substep: dt and the share of repulsion are parts of a step's."""
        if not self._coupling or self._coupling.parts == 1:
            return scene
        parts, stepping = self._coupling.parts, scene.stepping
        return replace(scene, stepping=replace(
            stepping, dt=stepping.dt / parts,
            repulsion=1.0 - (1.0 - stepping.repulsion) ** (1.0 / parts)))

    def reset(self):
        """Go back to the start: particles, colliders, time and counters; parameters stay."""
        with held():
            self._reset()

    def _reset(self):
        self._x[:] = self.scene.particles.position.T
        self._v[:] = self.scene.particles.velocity.T
        self._since, self._count = 0.0, 0
        self._accounts[:] = 0
        self._colliders.reset()
        if self._coupling:
            self._coupling.reset()
        if self._event_pairs:
            self._event_pairs.forget()
        if self._books:
            self._books.clear()

    # ------------------------------------------------------------------ copies

    def __getstate__(self):
        """Give what a copy goes on from; threads are not taken along."""
        return {**vars(self), '_crew': None, '_planned': None, '_opened': False}

    def __setstate__(self, state):
        vars(self).update(state)
        self._x, self._v = (_laid_in_lines(table) for table in (self._x, self._v))

    def __copy__(self):
        """As deepcopy: a copy goes on by itself."""
        return deepcopy(self)

    def __deepcopy__(self, memo):
        """Copy what changes; scenes do not, so the copy has the same one."""
        memo |= {id(each): each for each in (self.scene, self.scene.springs)}
        memo[id(self)] = other = type(self).__new__(type(self))
        with held():
            other.__setstate__(deepcopy(self.__getstate__(), memo))
        return other

    # ------------------------------------------------------------------ state

    @property
    def time(self):
        """Time since the start [s]."""
        return self._since + self._count * self.dt

    @property
    def dt(self):
        """Length of a step [s]."""
        return self.scene.stepping.dt

    @property
    def position(self):
        """Positions of the particles, (N, 3) float64 [m]; a view that may be written to."""
        return self._x.T

    @property
    def velocity(self):
        """Velocities of the particles, (N, 3) float64 [m/s]; a view that may be written to."""
        return self._v.T

    @property
    def counters(self):
        """Events since the start or the last reset, as a dict of int."""
        totals = self._accounts[:, :len(COUNTERS)].sum(axis=0)
        return dict(zip(COUNTERS, totals.tolist()))

    @property
    def ledger(self):
        """
        Where energy and momentum came from and went to, as balances.Balances; None if not asked.

        Of the last call of `step`, and since the start or the last reset.
        """
        return self._books.balances() if self._books else None

    @property
    def unplaced(self):
        """
        Particles that were left inside a collider, as (particle, collider name, reason) tuples.

        At most NOTES for every block of particles since the start; the counter counts all.
        """
        names = [collider.name for collider in self.scene.colliders]
        found = []
        for account, notes in zip(self._accounts, self._notes):
            for particle, c, other in notes[:account[COUNTERS.index('unplaced')]].tolist():
                reason = f'hemmed in by {names[other]}' if other != NONE else 'no free place'
                found.append((particle, names[c], reason))
        return found

    @property
    def contacts(self):
        """Contacts of the last step; none where `record_contacts` was off."""
        return self._every_contact(1)

    def some_contacts(self, most):
        """
        Choose some of the contacts of the last step, evenly; all of them where they are few.

        Parameters
        ----------
        most : int
            How many at most; at least 1.

        Returns
        -------
        Contacts

        """
        if not _is_whole(most, 1, math.inf):
            raise SceneError('some_contacts', most, 'must be a whole number from 1 on')
        count = int(self._accounts[:, N_LOGGED].sum())
        return self._every_contact(max(1, -(-count // int(most))))

    def _every_contact(self, stride):
        """Return Contacts of every first, second, ... row of the logs of all blocks."""
        counts = self._accounts[:, N_LOGGED]
        first = (counts - np.cumsum(counts)) % stride
        rows = [rows[start:n:stride] for rows, start, n in zip(
            self._logged(), first, counts)] if self._logs else []
        log = np.concatenate(rows) if rows else np.empty((0, LOG))
        log = log[np.argsort(log[:, 0], kind='stable')]
        particle, collider, state = log[:, :POINT].T.astype(np.int64)
        mass = np.broadcast_to(self.scene.particles.mass, self._x.shape[1:])[particle]
        return Contacts(particle, collider, log[:, POINT:NORMAL], log[:, NORMAL:CHANGE],
                        _times(mass[:, None], log[:, CHANGE:]), state)

    def _logged(self):
        """Give the rows of the log that were written in the last step, of each block."""
        if self._coupling is None:
            return self._log
        stamps = self._log[:, :, 2] // OF_STEP
        logs = [log[stamp == account[N_STEP]] for log, stamp, account in zip(
            self._log, stamps, self._accounts)]
        for log in logs:
            log[:, 2] %= OF_STEP
        return logs

    def collider_pose(self, name):
        """
        Pose of a collider now.

        Returns
        -------
        position, orientation : (3,), (4,) float64 [m], [-]
            Quaternion x, y, z, w.

        """
        return self._colliders.pose(name)

    def clearance(self):
        """Signed distance from each particle to its nearest collider, (N,) float64 [m]."""
        if len(self._present.meshes.heads):
            open_meshes(self._present, self._table, self._colliders.poses, self._colliders.motion)
        clear = np.full(self._x.shape[1], np.inf)
        distances(self._present, self._table, self._colliders.now, self._x, clear)
        return clear - self.scene.particles.radius

    def energy(self):
        """
        Energy of the particles [J]: kinetic, in the gravity field and in the springs.

        That in the gravity field is zero at the origin. With springs, particles of infinite mass
        are left out.
        """
        specific = 0.5 * np.square(self._v).sum(axis=0) - np.array(self.scene.gravity) @ self._x
        if self.scene.springs is None:
            return float(np.sum(_times(self.scene.particles.mass, specific)))
        energy = np.sum(finite_masses(self.scene.particles.mass) * specific)
        return float(energy) + self._coupling.elastic_energy(self._x)

    def momentum(self):
        """Momentum of all particles, (3,) float64 [N s]."""
        return _times(self.scene.particles.mass, self._v).sum(axis=1)

    # ------------------------------------------------------------------ time

    def step(self, n=1):
        """
        Take n steps of dt.

        Parameters
        ----------
        n : int
            Not negative.

        """
        if not _is_whole(n, 0, MOST_STEPS):
            raise SceneError('step', n, f'must be a whole number from 0 to {MOST_STEPS}')
        self._go_on(int(n), 0.0)

    def advance(self, duration):
        """
        Go on for a duration.

        The exact method lands on the time itself, by a shorter step at the end; the others take
        the nearest whole number of steps.

        Parameters
        ----------
        duration : float [s]
            Not negative.

        Returns
        -------
        steps : int
            How many, a shorter one included.

        """
        if not (isinstance(duration, Real) and 0.0 <= duration < math.inf):
            raise SceneError('advance', duration, 'must be a finite number that is not negative')
        duration = float(duration)
        if duration > MOST_STEPS * self.dt > 0.0:
            raise SceneError('advance', duration, f'must be at most {MOST_STEPS * self.dt:g} s, '
                                                  f'{MOST_STEPS} steps of {self.dt:g} s')
        steps = round(duration / self.dt) if self.dt > 0.0 else 0
        rest = duration - steps * self.dt
        if self._forces is None or self.dt == 0.0 or abs(rest) <= self._blur():
            self.step(steps)
            return steps
        if rest < 0.0:
            steps, rest = steps - 1, rest + self.dt
        self._go_on(steps, rest)
        return steps + 1

    def _blur(self):
        """Give the rounding of the time now [s]."""
        return 8.0 * np.spacing(self.time + self.dt)

    def _go_on(self, n, rest):
        """Take n steps of dt and, if that is more than 0, one of the duration `rest` [s]."""
        hold()
        try:
            if self._books:
                self._books.begin(self._x, self._v)
            try:
                self._take(n)
                if rest > 0.0:
                    self._take_one_of(rest)
            finally:
                if self._books:
                    self._books.end(self.scene, self._x, self._v)
        finally:
            release()

    def _take(self, n):
        """
        Take n steps of dt, in pieces that are not to last longer than PIECE.

        Between them signals are handled. They change nothing else, as calls with fewer steps do.
        """
        dt, colliders, most = self.scene.stepping.dt, self._colliders, 1
        while n > 0 and dt > 0.0:
            first = self._count if self._since == 0.0 else self.time / dt
            began = perf_counter() if n > 1 else 0.0
            steps = colliders.lay_out(min(n, most), first, dt)
            for part in [1] * steps if self._coupling else [steps]:
                self._move_particles(part, dt, self._rules)
                colliders.go_on(part)
                self._count += part
            n -= steps
            if n > 0:
                let_in()
                most = max(int(steps * PIECE / (perf_counter() - began)), 1)

    def _take_one_of(self, duration):
        """Take a step of another duration than dt [s]."""
        stepping = replace(self.scene.stepping, dt=duration)
        rules = step_rules(replace(self.scene, stepping=stepping), self._table, self._present)
        self._colliders.lay_out(1, self.time / duration, duration)
        self._move_particles(1, duration, rules)
        self._colliders.go_on(1)
        self._since, self._count = self.time + duration, 0

    def _move_particles(self, steps, dt, rules):
        """Run the kernels over all blocks of particles."""
        self._open()
        if self.record_contacts != self._logs:
            self._lay_out_log()
        colliders = self._colliders
        if self._event_pairs is not None:
            self._event_pairs.step(dt, steps, self._world(rules), colliders.courses)
        elif self._forces is not None:
            from collision_sim.core.exact import step_events    # takes a while
            share(step_events, self._threads if len(self._accounts) > 1 else 1,
                  refer_world(self._world(rules)), self._forces, dt, steps, colliders.courses)
        elif self._coupling is not None:
            self._coupling.step(self._world(rules), colliders.row, self._threads)
        else:
            if self._planned != colliders.laid_out:
                self._crew = Crew(step_blocks, refer_world(self._world(rules)))
                self._planned = colliders.laid_out
            self._crew.run(self._threads, len(self._accounts), steps, colliders.row)

    def _open(self):
        """Open the modules that this scene needs, once its rules are new."""
        if not self._opened:
            open_modules(self._world(self._rules))
            self._opened = True

    def _lay_out_log(self):
        """Make room for the contacts of a step, by events of all colliders, or need none."""
        most = len(self._table)
        most = most if self._forces is not None else min(most, MOST_CONTACTS)
        rows = most * self._block if self.record_contacts else 0
        self._log, self._logs = np.zeros((len(self._accounts), rows, LOG)), self.record_contacts
        self._planned = None

    def _world(self, rules):
        """Return what the kernels work on in the steps that are laid out."""
        colliders = self._colliders
        return World(rules, self._table, colliders.poses, colliders.motion, self._radius,
                     self._log, self._accounts, self._notes, self._x, self._v, self._ledger,
                     self._nobody, colliders.grid, self._block)

    # ------------------------------------------------------------------ changes from outside

    def set_parameter(self, path, value):
        """
        Change a value of the scene from the next step on.

        Parameters
        ----------
        path : str
            Such as 'restitution' (default of all colliders) or 'colliders.ground.friction.dry'.
        value : float, int or sequence of 3 float
            SI units.

        Raises
        ------
        SceneError
            Unknown path, or value out of range; nothing has changed then.

        """
        self.set_parameters([(path, value)])

    def set_parameters(self, changes):
        """
        Change several values of the scene from the next step on, or none.

        Parameters
        ----------
        changes : list of (str, object)
            Paths and values as of `set_parameter`; those that hold only together in any order.

        Raises
        ------
        SceneError
            As `set_parameter`.

        """
        scene = self.scene.with_parameters(changes)
        with held():
            self._adopt(scene)

    def move_collider(self, name, position, orientation, twist=None):
        """
        Move a collider over the next step, or over several.

        Parameters
        ----------
        name : str
            Of a collider without a script.
        position : (3,) or (S, 3) float [m]
            At the END of the next step, or at the ends of the next S steps; the steps sweep from
            the pose before. Afterwards the collider stands still.
        orientation : (4,) or (S, 4) float [-]
            Quaternion x, y, z, w.
        twist : (6,) or (S, 6) float, optional
            Linear [m/s] and angular velocity [rad/s] at those ends, where they are known; else
            they are estimated from the poses (core.motion.end_twists).

        Raises
        ------
        SceneError
            Unknown or scripted collider, value not finite, orientation not of unit norm.

        """
        self.move_colliders([name], [position], [orientation], None if twist is None else [twist])

    def move_colliders(self, names, positions, orientations, twists=None):
        """
        Move several colliders over the next step, or over several; cheaper than one by one.

        Parameters
        ----------
        names : sequence of str
            K of them, each once.
        positions, orientations, twists : (K, S, 3), (K, S, 4), (K, S, 6) float
            For each collider as in `move_collider`; arrays are taken as they are.

        Raises
        ------
        SceneError
            As `move_collider`; none has moved then.

        """
        hold()
        try:
            self._colliders.move(names, positions, orientations, twists, self.dt)
        finally:
            release()

    def place_collider(self, name, position, orientation):
        """
        Teleport a collider: new pose, no velocity, no sweep.

        Parameters
        ----------
        name : str
            Of a collider without a script.
        position, orientation : (3,), (4,) float [m], [-]
            From now on.

        Raises
        ------
        SceneError
            As `move_collider`.

        """
        with held():
            self._colliders.place(name, position, orientation)


def _is_whole(value, low, high):
    """Whether a value is a whole number, of whatever type, from one to another."""
    return isinstance(value, Integral) and not isinstance(value, bool) and low <= value <= high


def _radii(radius):
    """Radii (N,) [m], or (1,) where all are the same."""
    radii = np.atleast_1d(np.asarray(radius, dtype=np.float64))
    if (radii == radii[:1]).all():
        return radii[:1].copy() if radii.size else np.zeros(1)
    return radii.copy()


def _laid_in_lines(table):
    """Copy a table of three rows so that it begins with a cache line."""
    lines = in_lines(table.size).reshape(table.shape)
    lines[:] = table
    return lines


def _coupling(scene):
    """Give what couples the particles; it is imported only where something does."""
    from collision_sim.coupling import Coupling
    return Coupling(scene)


def _event_pairs(scene):
    """Give what takes particles from collision to collision; imported only where needed."""
    from collision_sim.event_pairs import EventPairs
    return EventPairs(scene)


def _times(mass, amount):
    """Multiply by a mass that may be infinite: nothing of an infinite mass is nothing."""
    with np.errstate(invalid='ignore'):
        return np.where(amount == 0.0, 0.0, mass * amount)
