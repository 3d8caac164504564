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
from typing import NamedTuple, Optional

from collision_sim.checks import SceneError
from collision_sim.core.broad_phase import in_grid, make_grid, no_grid
from collision_sim.core.motion import (chord_twists, DOUBT, END, end_twists, fill_turns, MOTION,
                                       script_poses, START, TURN, TWIST)
from collision_sim.core.rotation import quaternion
from collision_sim.core.vectors import EPSILON
from collision_sim.tables import collider_table, frames, pose_rows, scripts
import numpy as np

MOST_AHEAD, AHEAD = 1024, 128   # steps that are laid out at once: most, and where they are scripts
MANY_AHEAD = 32                 # and most with a grid, which holds the colliders at all of them
NORM_TOLERANCE = 1e-3           # how far from 1 the norm of an orientation may be


class Tracks(NamedTuple):
    """
    Poses (S, K, 12) of colliders at the ends of the next S steps; twists at both ends (S, K, 6).

    which (K,): the colliders; chords and their changes (S, K, 6) where the twists are estimated
    from the poses, None where they were given.
    """

    which: np.ndarray
    poses: np.ndarray
    starts: np.ndarray
    ends: np.ndarray
    chords: Optional[np.ndarray]
    changes: Optional[np.ndarray]

    def part(self, which, columns=slice(None), steps=slice(None)):
        """Give those of some colliders, or some of the steps."""
        return Tracks(which, *(None if table is None else table[steps, columns]
                               for table in self[1:]))

    def after(self, steps):
        """Give the steps that come later."""
        return self.part(self.which, steps=slice(steps, None))

    def without(self, which):
        """Give those of the other colliders."""
        others = np.isin(self.which, which, invert=True)
        return self.part(self.which[others], others)


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
        self._table, self._reach = collider_table(scene), np.max(scene.particles.radius, initial=0)
        self._in_grid = in_grid(self._table)
        self._many = not self._exact and len(self._in_grid) > 0
        self.laid_out, self._compiled = 0, False
        self.reset()

    def reset(self):
        """Go back to the start."""
        self.poses, self.row = self._base[None].copy(), 0
        count = len(self._indices)
        self.motion, self.courses = np.zeros((1, count, MOTION)), np.empty((0, count, 0))
        self._tracks = []                           # Tracks of the steps to come, by `move`
        self._moved = np.zeros(count, dtype=bool)   # by `move`, at any time
        self._chords = np.full((2, count, TWIST), np.nan)   # of the last steps; NaN: none
        self._given = np.full((count, TWIST), np.nan)       # twists that the last steps ended with
        self._moves = self._may_move
        self._renew()

    def _renew(self):
        """Note that poses have been laid out anew, and lay out the grid over them."""
        self.laid_out += 1
        self.grid = make_grid(self._in_grid, self._table, self.poses, self.motion, self._reach) \
            if self._many else no_grid(len(self._table))

    @property
    def now(self):
        """Poses now, (1, C, 12) float64."""
        return self.poses[self.row:self.row + 1]

    def pose(self, name):
        """Position (3,) [m] and orientation (4,) of a collider now."""
        return self._pose(self.index(name))

    def _pose(self, k):
        row = self.poses[self.row, k]
        return row[9:].copy(), quaternion(row[:9].reshape(3, 3) @ self._frames[k].T)

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
        if not (tracks or self._moved.any() or self._exact):
            most = max(most, AHEAD)
        steps = min([most, MANY_AHEAD if self._many else MOST_AHEAD,
                     *(len(some.poses) for some in tracks)])
        now, self.row = self.now.copy(), 0
        new = len(self.poses) != steps + 1 or len(self.motion) != steps
        if new:
            self.poses = np.empty((steps + 1, *now.shape[1:]))
            self.motion = np.empty((steps, now.shape[1], MOTION))
        self.poses[:] = now
        self.motion[:] = 0.0
        script_poses(self._scripted, self._base, self._scripts, first, dt, self.poses, self.motion,
                     np.empty(TWIST))
        resting = self._moved.copy()
        for some in tracks:
            self._follow(some, steps)
            resting[some.which] = False
        self._remember(resting, np.zeros((min(steps, 2), resting.sum(), TWIST)))
        fill_turns(self.poses, self.motion)
        if new or self._many:
            self._renew()
        if self._exact:
            from collision_sim.core.courses import fill_courses     # takes a while
            self.courses = fill_courses(self.poses, self.motion, self._scripted, self._scripts,
                                        first, dt)
        return steps

    def _follow(self, tracks, steps):
        """Lay out the steps of colliders that are moved, and keep those that come later."""
        which, chords = tracks.which, tracks.chords
        self.poses[1:, which] = tracks.poses[:steps]
        self.motion[:, which, START:END] = tracks.starts[:steps]
        self.motion[:, which, END:DOUBT] = tracks.ends[:steps]
        if chords is not None:
            self.motion[:, which, DOUBT:TURN] = tracks.changes[:steps]
        if len(tracks.poses) > steps:
            self._tracks.append(tracks.after(steps))
        self._moved[which] = True
        if chords is None:
            self._given[which], self._chords[:, which] = tracks.ends[steps - 1], np.nan
        else:
            self._remember(which, chords[:steps])

    def _remember(self, which, chords):
        """Keep what the twists of the next move are estimated from: the last chords."""
        self._chords[:, which] = np.concatenate([self._chords[:, which], chords])[-2:]
        self._given[which] = np.nan

    # ------------------------------------------------------------------ changes from outside

    def move(self, names, positions, orientations, twists, dt):
        """Move colliders over the next steps, as Simulation.move_colliders."""
        which = np.array([self._movable(name, 'move_collider') for name in names], dtype=np.int64)
        if not len(which):
            return
        if len(set(names)) < len(names):
            raise SceneError('colliders', list(names), 'must be given once each')
        p = _tables('position', names, positions, 3)
        q = _units(names, _tables('orientation', names, orientations, 4, p.shape[1]))
        poses = pose_rows(self._frames[which], p.swapaxes(0, 1), q.swapaxes(0, 1))
        rests = _keep_where_at_rest(self.now[0, which], poses)
        if twists is None:
            chords = np.stack([self._chords_to(k, p[i], q[i], dt or 1.0)
                               for i, k in enumerate(which)], axis=1)
            chords[rests] = 0.0
            starts, ends, changes = end_twists(chords, self._chords[:, which])
        else:
            ends = _tables('twist', names, twists, TWIST, p.shape[1]).swapaxes(0, 1)
            before, chords, changes = self._given[which], None, None
            starts = np.concatenate([np.where(np.isnan(before), ends[0], before)[None], ends[:-1]])
        self._drop_tracks(which)
        self._tracks.append(Tracks(which, poses, starts, ends, chords, changes))
        self._moves = True

    def _chords_to(self, k, positions, orientations, dt):
        """Twists (S, 6) that lead a collider from where it is now to each of the next poses."""
        p, q = self._pose(k)
        return chord_twists(np.vstack([p, positions]), np.vstack([q, orientations]), dt)

    def _drop_tracks(self, which):
        """Forget the steps to come of some colliders."""
        rest = [tracks.without(which) for tracks in self._tracks]
        self._tracks = [tracks for tracks in rest if len(tracks.which)]

    def place(self, name, position, orientation):
        """Teleport a collider, as Simulation.place_collider."""
        k = self._movable(name, 'place_collider')
        p = _rows(f'colliders.{name}.position', position, 3, 1)
        q = _units([name], _rows(f'colliders.{name}.orientation', orientation, 4, 1)[None])
        self.poses, self.row = self.now.copy(), 0
        self.poses[0, k] = pose_rows(self._frames[[k]], p[None], q)[0, 0]
        self._renew()
        self._drop_tracks([k])
        self._moved[k], self._chords[:, k], self._given[k] = False, np.nan, np.nan

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


def _keep_where_at_rest(now, poses):
    """
    Let colliders keep their pose now (K, 12) where poses (S, K, 12) differ by rounding only.

    An orientation that was read and is given back has been a matrix meanwhile.

    Returns
    -------
    rests : (S, K) bool
        Where that is so.

    """
    rests = np.empty(poses.shape[:2], dtype=bool)
    for s, later in enumerate(poses):
        rests[s] = (later[:, 9:] == now[:, 9:]).all(axis=1) & (
            np.abs(later[:, :9] - now[:, :9]).max(axis=1) <= 4.0 * EPSILON)
        later[rests[s]] = now[rests[s]]
        now = later
    return rests


def _rows(key, value, columns, count=None):
    """Value as finite rows of `columns` numbers, `count` of them if that is given."""
    try:
        rows = np.array(value, dtype=np.float64)
        rows = rows if rows.ndim > 1 else rows.reshape(1, -1)
    except (TypeError, ValueError):
        rows = np.empty((0, 0))
    if rows.ndim != 2 or rows.shape[1] != columns or len(rows) not in (count or len(rows), ) \
            or not len(rows) or not np.isfinite(rows).all():
        many = '' if count is None else f' in {count} row(s)'
        raise SceneError(key, value, f'must be {columns} finite numbers{many}')
    return rows


def _tables(what, names, values, columns, count=None):
    """Values of several colliders as finite rows of numbers, (K, S, columns); S may be given."""
    if isinstance(values, np.ndarray) and values.ndim == 3 and values.size \
            and values.shape == (len(names), count or values.shape[1], columns) \
            and np.isfinite(values).all():
        return np.array(values, dtype=np.float64)
    if len(values) != len(names):
        raise SceneError('colliders', list(names), f'must have a {what} each, not {len(values)}')
    rows = []
    for name, value in zip(names, values):
        rows.append(_rows(f'colliders.{name}.{what}', value, columns, count))
        count = len(rows[0])
    return np.stack(rows)


def _units(names, quaternions):
    """Bring the quaternions of several colliders, (K, S, 4), to unit norm."""
    rows = quaternions.reshape(-1, 4)
    norms = np.sqrt(np.einsum('ij,ij->i', rows, rows)).reshape(*quaternions.shape[:2], 1)
    wrong = ~(np.abs(norms - 1.0) <= NORM_TOLERANCE).all(axis=(1, 2))
    if wrong.any():
        k = wrong.argmax()
        raise SceneError(f'colliders.{names[k]}.orientation', quaternions[k],
                         f'must have norm 1 within {NORM_TOLERANCE}')
    return np.where(norms == 1.0, quaternions, quaternions / norms)
