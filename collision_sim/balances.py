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
The ledger of a simulation as people read it: balances of energy and momentum.

core/ledger.py says what is booked to which account.
"""

from typing import NamedTuple

from collision_sim.core.ledger import (COLLIDERS, columns, DRAG_IMPULSE, ENERGIES,
                                       GRAVITY_IMPULSE, Ledger, PER_COLLIDER)
import numpy as np


class Momenta(NamedTuple):
    """Momentum by account [N s]: (3,), (3,), (C, 3); and the change of the particles' (3,)."""

    gravity: np.ndarray
    drag: np.ndarray
    colliders: np.ndarray
    change: np.ndarray

    @property
    def residual(self):
        """Rest that no account explains: rounding."""
        return self.change - self.gravity - self.drag - self.colliders.sum(axis=0)


class Balance(NamedTuple):
    """
    Energy of the particles by account, over some steps; positive: gained.

    Attributes
    ----------
    gravity : float [J]
        Work of gravity: what the potential energy has lost.
    drag : float [J]
        Work of drag and wind.
    flight : float [J]
        Truncation of the flight: 0 to rounding for `ballistic`.
    colliders : (C,) float64 [J]
        Work of each collider on the particles; 0 where it does not move.
    restitution : float [J]
        Loss of collisions along the normal, (1 - eps^2) m v_N^2 / 2 each.
    dry, wet : float [J]
        Loss to friction, relative to the colliders.
    contact : float [J]
        What the contact stage takes or brings along the normal: inelastic landings, and the error
        of the method where surfaces are curved.
    repulsion : float [J]
        What repulsion, pushes to a surface and fail-safes bring or take.
    internal : float [J]
        What springs and pairs, the forces between particles, bring or take.
    change : float [J]
        Of the kinetic energy and the potential energy in the gravity field.
    momentum : Momenta

    """

    gravity: float
    drag: float
    flight: float
    colliders: np.ndarray
    restitution: float
    dry: float
    wet: float
    contact: float
    repulsion: float
    internal: float
    change: float
    momentum: Momenta

    @property
    def residual(self):
        """Change of energy that no account explains [J]: rounding; gravity is inside `change`."""
        return self.change - float(np.sum(self.colliders)) - sum(
            (self.drag, self.flight, self.restitution, self.dry, self.wet, self.contact,
             self.repulsion, self.internal))


class Balances(NamedTuple):
    """Balance of the last call of `step`, and of all since the start or the reset."""

    last: Balance
    total: Balance


def balance(row, energy, momentum):
    """
    Balance of some steps.

    Parameters
    ----------
    row : (columns,) float64
        Sum of the rows of the ledger.
    energy : float [J]
        Change of kinetic and potential energy.
    momentum : (3,) float64 [N s]
        Change of momentum.

    Returns
    -------
    Balance

    """
    named = dict(zip(ENERGIES, row.tolist()))
    each = row[COLLIDERS:].reshape(-1, PER_COLLIDER)
    return Balance(
        **named, colliders=each[:, 0].copy(), change=float(energy), momentum=Momenta(
            row[GRAVITY_IMPULSE:DRAG_IMPULSE].copy(), row[DRAG_IMPULSE:COLLIDERS].copy(),
            each[:, 1:].copy(), np.array(momentum)))


class Books:
    """
    The ledger of a simulation: begun before the steps of a call, ended after them.

    Parameters
    ----------
    blocks, colliders : int
        How many of them there are.

    """

    def __init__(self, blocks, colliders):
        self._rows = np.zeros((blocks, columns(colliders)))
        self.clear()

    def clear(self):
        """Begin anew, with nothing booked."""
        nothing = (np.zeros(self._rows.shape[1]), 0.0, np.zeros(3))
        self._last = self._total = nothing

    def begin(self, x, v):
        """Begin with the steps of a call, from a state (3, N) and (3, N)."""
        self._rows[:] = 0.0
        self._before = x.copy(), v.copy()

    def ledger(self, scene):
        """Give what the kernels book with, in this scene."""
        mass, drag = np.asarray(scene.particles.mass), scene.drag
        return Ledger(
            self._rows, finite_masses(mass).copy() if mass.ndim else np.ones(1),
            tuple(map(float, scene.gravity)),
            bool(drag and (drag.linear or drag.quadratic)),
            scene.stepping.flight == 'symplectic_euler')

    def end(self, scene, x, v):
        """End with the steps of a call, in a state (3, N) and (3, N)."""
        mass, (x0, v0) = finite_masses(np.asarray(scene.particles.mass)), self._before
        dv = v - v0
        energy = 0.5 * (dv * (v + v0)).sum(axis=0) - np.array(scene.gravity) @ (x - x0)
        booked = self._rows.sum(axis=0) * (1.0 if mass.ndim else mass)
        self._last = booked, np.sum(mass * energy), (mass * dv).sum(axis=1)
        self._total = tuple(a + b for a, b in zip(self._total, self._last))

    def balances(self):
        """Give the balances of the last call, and of all of them."""
        return Balances(balance(*self._last), balance(*self._total))


def finite_masses(mass):
    """Masses [kg], with 0 for infinite ones."""
    return np.where(np.isfinite(mass), mass, 0.0)
