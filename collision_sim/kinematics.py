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
Where the colliders of a simulation are, and how they move over the next steps.

Colliders follow their scripts, or the poses they are given with `move`; what the kernels read is
laid out here, a row for each step. Scripts are laid out ahead, so that most steps find their row
ready.
"""

from copy import deepcopy
from math import isfinite
from typing import NamedTuple, Union

from collision_sim.checks import SceneError
from collision_sim.core.broad_phase import Cover, in_grid, no_grid
from collision_sim.core.motion import fill_turns, MOTION, POSE, script_poses, START, TURN, TWIST
from collision_sim.core.moves import (bring_to_unit_norm, CHORD, lay_out_move, MOVE, NONE,
                                      NORM_TOLERANCE, PAST)
from collision_sim.core.reference import refer
from collision_sim.core.rotation import quaternions
from collision_sim.tables import collider_table, frames, pose_rows, scripts
import numpy as np

MOST_AHEAD, AHEAD = 1024, 128   # steps that are laid out at once: most, and where they are scripts
MANY_AHEAD = 32                 # and most with a grid, which holds the colliders at all of them
NO_TWISTS, NO_PLACE = np.empty((0, 0, TWIST)), np.empty((0, 4))


class Track(NamedTuple):
    """
    Steps to come of K colliders that are moved.

    which: indices of the colliders; columns: the same, as tables are indexed; rows (S, K, MOVE):
    of core.moves.
    """

    which: list
    columns: Union[slice, list]
    rows: np.ndarray

    def after(self, steps):
        """Give the steps that come later."""
        return self._replace(rows=self.rows[steps:])

    def without(self, which):
        """Give that of the other colliders."""
        others = [n for n, k in enumerate(self.which) if k not in which]
        left = [self.which[n] for n in others]
        return Track(left, _columns(left), self.rows[:, others])


class Kinematics:
    """
    Poses and motion of the colliders of a scene.

    Parameters
    ----------
    scene : Scene
        Whose colliders they are.

    Attributes
    ----------
    poses : (S + 1, C, 12) float64
        Laid out; one row where nothing moves.
    motion : (S, C, MOTION) float64
        One row of zeros where nothing moves.
    courses : (S, C, courses.COURSE) float64
        For the event-driven method; no rows where nothing moves, or for others.
    row : int
        Row of `poses` that is now, and of `motion` that is the next step.
    grid : broad_phase.Grid
        Over the colliders that are laid out; without cells where they are few.
    laid_out : int
        Changes whenever other arrays than before are laid out.

    """

    def __init__(self, scene):
        self._exact = scene.stepping.method == 'exact'
        self._indices = {collider.name: k for k, collider in enumerate(scene.colliders)}
        self._frames = frames(scene)
        self._scripts, self._scripted = scripts(scene)
        self._follows_script = np.isin(np.arange(len(self._indices)), self._scripted)
        self._base = pose_rows(
            self._frames,
            np.array([c.position for c in scene.colliders], dtype=np.float64).reshape(1, -1, 3),
            np.array([c.orientation for c in scene.colliders], dtype=np.float64).reshape(1, -1, 4)
        )[0]
        self._may_move = any(collider.moving for collider in scene.colliders)
        table = collider_table(scene)
        which = in_grid(table)
        self._many = not self._exact and len(which) > 0
        self._cover = Cover(which, table, np.max(scene.particles.radius, initial=0))
        self.laid_out, self._compiled = 0, False
        self.reset()

    def reset(self):
        """Go back to the start."""
        self.poses, self.row = self._base[None].copy(), 0
        count = len(self._indices)
        self.motion, self.courses = np.zeros((1, count, MOTION)), np.empty((0, count, 0))
        self._tracks = []                               # of the steps to come, by `move`
        self._past = np.full((PAST, count, MOVE), np.nan)   # the rows before them; NaN: not moved
        self._still = np.full((count, MOVE), np.nan)    # row of a step without a move
        self._moves = self._may_move
        self._renew()

    def _renew(self):
        """Note that poses have been laid out anew, and lay out the grid over them."""
        self.laid_out += 1
        self.grid = refer(self._cover.lay_out(self.poses, self.motion, self._any_moved)
                          if self._many else no_grid(len(self._indices)))

    @property
    def _any_moved(self):
        """Whether some collider is moved, or has been, since it was placed."""
        return (self._still == 0.0).any()

    @property
    def now(self):
        """Poses now, (1, C, 12) float64."""
        return self.poses[self.row:self.row + 1]

    def pose(self, name):
        """Position (3,) [m] and orientation (4,) of a collider now."""
        k = self.index(name)
        return self.poses[self.row, k, 9:].copy(), self._orientations(slice(k, k + 1))[0]

    def _orientations(self, columns):
        """Orientations (K, 4) of some colliders now."""
        frames = self._frames[columns]
        matrices = self.poses[self.row, columns, :9].reshape(frames.shape)
        return quaternions(matrices @ frames.swapaxes(1, 2))

    # ------------------------------------------------------------------ time

    def lay_out(self, most, first, dt):
        """
        Make sure that poses and motion of the next steps are laid out.

        Parameters
        ----------
        most : int
            How many steps are wanted.
        first : float
            Number of the first of them; it starts at first * dt.
        dt : float [s]
            Length of a step.

        Returns
        -------
        steps : int
            How many are laid out, at most `most`.

        """
        if not self._moves:
            return most
        ahead = len(self.poses) - 1 - self.row
        if self._tracks or ahead == 0:
            if not self._compiled:      # an interrupt meanwhile leaves everything as it is
                deepcopy(self)._lay_out(1, first, dt)
                self._compiled = True
            ahead = self._lay_out(most, first, dt)
        return min(most, ahead)

    def go_on(self, steps):
        """Take some of the steps that are laid out as done."""
        if self._moves:
            self.row += steps

    def _lay_out(self, most, first, dt):
        """Lay out steps from now on; how many."""
        tracks, self._tracks = self._tracks, []
        if not (tracks or self._exact or self._any_moved):
            most = max(most, AHEAD)
        steps = min([most, MANY_AHEAD if self._many else MOST_AHEAD,
                     *(len(track.rows) for track in tracks)])
        now, self.row = self.poses[self.row], 0
        new = len(self.poses) != steps + 1 or len(self.motion) != steps
        if new:
            self.poses = np.empty((steps + 1, *now.shape))
            self.motion = np.empty((steps, len(now), MOTION))
        self.poses[0] = now
        self.poses[1:] = self.poses[0]
        self.motion[:] = 0.0
        if len(self._scripted):
            script_poses(self._scripted, self._base, self._scripts, first, dt, self.poses,
                         self.motion, np.empty(TWIST))
        self._past[0] = self._past[1] if steps == 1 else self._still
        self._past[1] = self._still
        for track in tracks:
            self._follow(track, steps)
        fill_turns(self.poses, self.motion)
        if new or self._many and not self._cover.holds(self.poses, self.motion):
            self._renew()
        if self._exact:
            from collision_sim.core.courses import fill_courses     # takes a while
            self.courses = fill_courses(self.poses, self.motion, self._scripted, self._scripts,
                                        first, dt)
        return steps

    def _follow(self, track, steps):
        """Lay out the steps of colliders that are moved, and keep those that come later."""
        columns, rows, last = track.columns, track.rows[:steps], min(steps, PAST)
        self.poses[1:, columns] = rows[:, :, :POSE]
        self.motion[:, columns, START:TURN] = rows[:, :, POSE:CHORD]
        self._past[-last:, columns] = rows[-last:]
        self._still[columns] = 0.0
        if len(track.rows) > steps:
            self._tracks.append(track.after(steps))

    # ------------------------------------------------------------------ changes from outside

    def move(self, names, positions, orientations, twists, dt):
        """Move colliders over the next steps, as Simulation.move_colliders."""
        which = [self._movable(name, 'move_collider') for name in names]
        if not which:
            return
        if len(set(which)) < len(which):
            raise SceneError('colliders', list(names), 'must be given once each')
        p = _tables('position', names, positions, 3)
        q = _units(names, _tables('orientation', names, orientations, 4, len(p)))
        v = NO_TWISTS if twists is None else _tables('twist', names, twists, TWIST, len(p))
        columns = _columns(which)
        start = self._orientations(columns) if twists is None else NO_PLACE
        rows = np.empty((PAST + len(p), len(which), MOVE))
        rows[:PAST] = self._past[:, columns]
        rows[PAST - 1, :, :POSE] = self.poses[self.row, columns]
        lay_out_move(rows, self._frames[columns], start, p, q, v, dt or 1.0)
        self._drop_tracks(which)
        self._tracks.append(Track(which, columns, rows[PAST:]))
        self._moves = True

    def _drop_tracks(self, which):
        """Forget the steps to come of some colliders."""
        which = set(which)
        self._tracks = [track if which.isdisjoint(track.which) else track.without(which)
                        for track in self._tracks if not which.issuperset(track.which)]

    def place(self, name, position, orientation):
        """Teleport a collider, as Simulation.place_collider."""
        k = self._movable(name, 'place_collider')
        p = _tables('position', [name], [position], 3, 1)
        q = _units([name], _tables('orientation', [name], [orientation], 4, 1))
        self.poses, self.row = self.now.copy(), 0
        self.poses[0, k] = pose_rows(self._frames[[k]], p, q)[0, 0]
        self._renew()
        self._drop_tracks([k])
        self._past[:, k] = self._still[k] = np.nan

    def _movable(self, name, call):
        """Index of a collider without a script."""
        k = self.index(name)
        if self._follows_script[k]:
            raise SceneError(f'colliders.{name}', call, 'it follows its own script')
        return k

    def index(self, name):
        """Index of a collider, by its name."""
        if name not in self._indices:
            allowed = 'must be one of ' + (', '.join(self._indices) or '(no colliders)')
            raise SceneError('collider', name, allowed)
        return self._indices[name]


def _columns(which):
    """Return indices as a slice where they follow each other, which NumPy is faster with."""
    first, end = which[0], which[0] + len(which)
    return slice(first, end) if which == list(range(first, end)) else which


def _rows(key, value, columns, count=None):
    """Value as finite rows of `columns` numbers, `count` of them if that is given."""
    try:
        rows = np.array(value, dtype=np.float64)
        rows = rows if rows.ndim > 1 else rows.reshape(1, -1)
    except (TypeError, ValueError, OverflowError):
        rows = np.empty((0, 0))
    if rows.ndim != 2 or rows.shape[1] != columns or len(rows) not in (count or len(rows), ) \
            or not len(rows) or not np.isfinite(rows).all():
        many = '' if count is None else f' in {count} row(s)'
        raise SceneError(key, value, f'must be {columns} finite numbers{many}')
    return rows


def _tables(what, names, values, columns, count=None):
    """Values of several colliders as finite rows of numbers, (S, K, columns); S may be given."""
    try:
        table = np.array(values, dtype=np.float64, order='C')
    except (TypeError, ValueError, OverflowError):
        table = NO_TWISTS       # not all of one length, or not numbers
    if table.ndim == 3:
        table = np.ascontiguousarray(table.swapaxes(0, 1))
    elif table.ndim == 2:
        table = table[None]
    if table.shape == (count or len(table), len(names), columns) and _is_finite(table):
        return table
    if len(values) != len(names):
        raise SceneError('colliders', list(names), f'must have a {what} each, not {len(values)}')
    rows = []
    for name, value in zip(names, values):
        rows.append(_rows(f'colliders.{name}.{what}', value, columns, count))
        count = len(rows[0])
    return np.ascontiguousarray(np.stack(rows, axis=1))


def _is_finite(table):
    """Whether there are numbers in a table, and all are finite."""
    line = table.ravel()
    return len(line) > 0 and (isfinite(line.dot(line)) or np.isfinite(line).all())


def _units(names, orientations):
    """Bring the quaternions of several colliders, (S, K, 4), to unit norm."""
    wrong = bring_to_unit_norm(orientations)
    if wrong != NONE:
        raise SceneError(f'colliders.{names[wrong]}.orientation', orientations[:, wrong],
                         f'must have norm 1 within {NORM_TOLERANCE}')
    return orientations
