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

from typing import NamedTuple, Optional

from collision_sim.checks import SceneError
from collision_sim.core.broad_phase import in_grid, make_grid
from collision_sim.core.motion import (chord_twists, END, end_twists, ESTIMATED, fill_turns,
                                       MOTION, POSE, script_poses, START, TWIST)
from collision_sim.core.rotation import quaternion
from collision_sim.tables import collider_table, frames, pose_rows, scripts
import numpy as np

NO_CHORDS = np.full((2, TWIST), np.nan)     # of a collider that has not moved
MOST_AHEAD, AHEAD = 1024, 32    # steps that are laid out at once: most, and where they are scripts
NORM_TOLERANCE = 1e-3           # how far from 1 the norm of an orientation may be


class Track(NamedTuple):
    """
    Poses (S, 12) of a collider at the ends of the next S steps; twists at both ends (S, 6).

    chords (S, 6) where the twists are estimated from the poses, None where they were given.
    """

    poses: np.ndarray
    starts: np.ndarray
    ends: np.ndarray
    chords: Optional[np.ndarray]

    def part(self, rows):
        """Give some of the steps."""
        return Track(*(None if table is None else table[rows] for table in self))


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
    motion : (S, C, MOTION) float64 or None
        None where nothing moves.
    courses : (S, C, courses.COURSE) float64 or None
        For the event-driven method.
    row : int
        Row of `poses` that is now, and of `motion` that is the next step.
    grid : broad_phase.Grid or None
        Over the colliders that are laid out; None where they are few.
    laid_out : int
        Changes whenever other arrays than before are laid out.

    """

    def __init__(self, scene):
        self._exact = scene.stepping.method == 'exact'
        self._indices = {collider.name: k for k, collider in enumerate(scene.colliders)}
        self._frames = frames(scene)
        self._scripts, self._scripted = scripts(scene)
        self._base = np.array([
            pose_rows(frame, [collider.position], [collider.orientation])
            for frame, collider in zip(self._frames, scene.colliders)]).reshape(-1, POSE)
        self._may_move = any(collider.moving for collider in scene.colliders)
        self._table, self._reach = collider_table(scene), np.max(scene.particles.radius, initial=0)
        self._many = not self._exact and len(in_grid(self._table)) > 0
        self.laid_out = 0
        self.reset()

    def reset(self):
        """Go back to the start."""
        self.poses, self.row = self._base[None].copy(), 0
        self.motion = self.courses = None
        self._tracks = {}
        self._chords = {}
        self._given = {}
        self._moves = self._may_move
        self._renew()

    def _renew(self):
        """Note that poses have been laid out anew, and lay out the grid over them."""
        self.laid_out += 1
        self.grid = make_grid(self._table, self.poses, self.motion, self._reach) \
            if self._many else None

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
            ahead = self._lay_out(most, first, dt)
        return min(most, ahead)

    def go_on(self, steps):
        """Take some of the steps that are laid out as done."""
        if self._moves:
            self.row += steps

    def _lay_out(self, most, first, dt):
        """Lay out steps from now on; how many."""
        tracks, self._tracks = self._tracks, {}
        if not (tracks or self._chords or self._exact):
            most = max(most, AHEAD)
        steps = min([most, AHEAD if self._many else MOST_AHEAD,
                     *(len(track.poses) for track in tracks.values())])
        now, self.row = self.now.copy(), 0
        new = len(self.poses) != steps + 1 or self.motion is None
        if new:
            self.poses = np.empty((steps + 1, *now.shape[1:]))
            self.motion = np.empty((steps, now.shape[1], MOTION))
        self.poses[:] = now
        self.motion[:] = 0.0
        script_poses(self._scripted, self._base, self._scripts, first, dt, self.poses, self.motion,
                     np.empty(TWIST))
        for k, track in tracks.items():
            self._follow(k, track, steps)
        self._rest(tracks, steps)
        fill_turns(self.poses, self.motion)
        if new or self._many:
            self._renew()
        if self._exact:
            from collision_sim.core.courses import fill_courses     # takes a while
            self.courses = fill_courses(self.poses, self.motion, self._scripted, self._scripts,
                                        first, dt)
        return steps

    def _follow(self, k, track, steps):
        """Lay out the steps of a collider that is moved, and keep those that come later."""
        self.poses[1:, k] = track.poses[:steps]
        self.motion[:, k, START:END] = track.starts[:steps]
        self.motion[:, k, END:ESTIMATED] = track.ends[:steps]
        self.motion[:, k, ESTIMATED] = track.chords is not None
        if len(track.poses) > steps:
            self._tracks[k] = track.part(slice(steps, None))
        self._remember(k, track.part(slice(steps)))

    def _remember(self, k, track):
        """Keep what the twists of the next move depend on: the last chords, or the last twist."""
        if track.chords is None:
            self._given[k], self._chords[k] = track.ends[-1:], NO_CHORDS
        else:
            before = self._chords.get(k, NO_CHORDS)
            self._chords[k] = np.concatenate([before, track.chords])[-2:]
            self._given.pop(k, None)

    def _rest(self, tracks, steps):
        """Colliders that were moved before and are not now stand still from here on."""
        still = np.zeros((min(steps, 2), TWIST))
        for k in self._chords.keys() - tracks.keys():
            self._remember(k, Track(None, None, None, still))

    # ------------------------------------------------------------------ changes from outside

    def move(self, name, position, orientation, twist, dt):
        """Move a collider over the next steps, as Simulation.move_collider."""
        k = self._movable(name, 'move_collider')
        p = _rows(f'colliders.{name}.position', position, 3)
        q = _unit(f'colliders.{name}.orientation', orientation, len(p))
        if twist is None:
            before_p, before_q = self._pose(k)
            chords = chord_twists(np.vstack([before_p, p]), np.vstack([before_q, q]), dt or 1.0)
            starts, ends = end_twists(chords, self._chords.get(k, NO_CHORDS))
        else:
            ends = _rows(f'colliders.{name}.twist', twist, TWIST, len(p))
            starts, chords = np.concatenate([self._given.get(k, ends[:1]), ends[:-1]]), None
        self._tracks[k] = Track(pose_rows(self._frames[k], p, q), starts, ends, chords)
        self._moves = True

    def place(self, name, position, orientation):
        """Teleport a collider, as Simulation.place_collider."""
        k = self._movable(name, 'place_collider')
        p = _rows(f'colliders.{name}.position', position, 3, 1)
        q = _unit(f'colliders.{name}.orientation', orientation, 1)
        self.poses, self.row = self.now.copy(), 0
        self.poses[0, k] = pose_rows(self._frames[k], p, q)[0]
        self._renew()
        for history in (self._tracks, self._chords, self._given):
            history.pop(k, None)

    def _movable(self, name, call):
        """Index of a collider without a script."""
        k = self.index(name)
        if k in self._scripted:
            raise SceneError(f'colliders.{name}', call, 'it follows its own script')
        return k

    def index(self, name):
        """Index of a collider, by its name."""
        if name not in self._indices:
            allowed = 'must be one of ' + (', '.join(self._indices) or '(no colliders)')
            raise SceneError('collider', name, allowed)
        return self._indices[name]


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


def _unit(key, value, count):
    """Rows of unit quaternions."""
    rows = _rows(key, value, 4, count)
    norms = np.sqrt(np.einsum('ij,ij->i', rows, rows))[:, None]
    if not np.abs(norms - 1.0).max() <= NORM_TOLERANCE:
        raise SceneError(key, value, f'must have norm 1 within {NORM_TOLERANCE}')
    return np.where(norms == 1.0, rows, rows / norms)
