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

"""The two ways to step springs: explicit, on threads, and linearly implicit, with SciPy."""

from collision_sim.balances import finite_masses
from collision_sim.core.candidates import book_candidates, Candidates, fly_freely
from collision_sim.core.implicit_springs import assemble, write_equations
from collision_sim.core.springs import begin_steps, elastic_energy, end_steps, lay_out
from collision_sim.core.stepping import BLOCK
from collision_sim.core.threads import share
from collision_sim.springs import particle_masses
import numpy as np

FEW = 4                 # blocks; for fewer a second thread costs more than it brings
NARROW = 16             # particles; bandwidth up to which elimination is faster than iterations
ACCURACY = 1e-10        # of conjugate gradients: residual relative to the right-hand side
MOST_ITERATIONS = 8     # linearisations in a step
TOLERANCE = 1e-9        # relative: energy beyond which a linearisation is repeated


class ExplicitSprings:
    """
    Springs of a scene, stepped as core/springs.py says.

    Parameters
    ----------
    scene : Scene
        With springs.

    """

    def __init__(self, scene):
        springs, mass = scene.springs, particle_masses(scene.particles)
        self._springs = lay_out(springs.pairs, springs.laws, mass)
        self._reached, self._foreseen = np.empty((2, 3, len(mass)))

    def step(self, flight, ledger, x, v, candidates, threads):
        """
        Lay out the candidates of a step.

        Parameters
        ----------
        flight : flight.Flight
            Coefficients of the step.
        ledger : ledger.Ledger
            Written: flights and springs.
        x, v : (3, N) float64 [m], [m/s]
            State at the start of the step.
        candidates : candidates.Candidates
            Overwritten.
        threads : int
            Most threads to use.

        """
        threads = threads if v.shape[1] > FEW * BLOCK else 1
        scratch = candidates, self._reached, self._foreseen
        share(begin_steps, threads, self._springs, flight, ledger, x, v, *scratch)
        share(end_steps, threads, self._springs, flight.dt, ledger, *scratch)


class ImplicitSprings:
    """
    Springs of a scene, stepped by backward Euler as core/implicit_springs.py says.

    One linearisation at the start of the step is the method of Baraff and Witkin. Backward Euler
    itself cannot bring energy: v.(m dv) is at most what the springs lose. Where a linearisation
    does not keep to that, as where stiff springs turn, it is repeated at its result.
    Narrow networks (strings, ribbons) are solved by SuperLU, wide ones by conjugate gradients.

    Parameters
    ----------
    scene : Scene
        With springs.

    """

    def __init__(self, scene):
        self._pairs, self._laws = scene.springs.pairs, scene.springs.laws
        mass = particle_masses(scene.particles)
        springs = lay_out(self._pairs, self._laws, mass)
        self._equations, columns = write_equations(springs, mass)
        self._system = LinearSystem(self._equations, columns)

    def step(self, flight, ledger, x, v, candidates, threads):
        """
        Lay out the candidates of a step.

        Parameters
        ----------
        flight, ledger, x, v, candidates, threads
            As for the explicit solver; the assembly takes one thread.

        """
        fly_freely(flight, v, ledger, BLOCK, candidates)
        booked = len(ledger.rows) > 0
        before = Candidates(*(table.copy() for table in candidates)) if booked else None
        members = self._equations.members
        held = members[self._equations.mass == np.inf]
        candidates.w[:, held] = v[:, held]
        candidates.w[:, members] = self._end_velocity(flight.dt, x, candidates.w)[:, members]
        candidates.u[:, members] = candidates.w[:, members]
        if booked:
            book_candidates(ledger, BLOCK, flight.dt, before, candidates)

    def _end_velocity(self, dt, x, w):
        """Velocity at the end, (3, N), from that of the free flight."""
        members, start = self._equations.members, self._energy(x)
        mass = finite_masses(self._equations.mass)
        v, y = w.copy(), x
        for iteration in range(MOST_ITERATIONS):
            v[:, members] += self._system.solve(self._equations, y, v, w, dt, iteration == 0)
            y = x + dt * v
            impulse = mass * (v - w)[:, members]
            brought = np.vdot(v[:, members], impulse) + self._energy(y) - start
            scale = start + np.sum(np.abs(v[:, members] * impulse))
            if not brought > TOLERANCE * scale:
                break
        return v

    def _energy(self, x):
        return elastic_energy(self._pairs, self._laws, x.T)


class LinearSystem:
    """
    The linear equations of the implicit solver, with a pattern that never changes.

    Parameters
    ----------
    equations : implicit_springs.Equations
        Rows of 3 x 3 blocks.
    columns : (B,) int64
        Column of each block.

    """

    def __init__(self, equations, columns):
        from scipy import sparse
        size, widths = len(equations.members), np.diff(equations.blocks)
        own = np.repeat(np.arange(size), widths)
        pattern = sparse.csr_matrix((np.ones(len(columns)), columns, equations.blocks),
                                    (size, size))
        order = sparse.csgraph.reverse_cuthill_mckee(pattern, symmetric_mode=True)
        place = np.argsort(order)
        self._narrow = np.max(np.abs(place[own] - place[columns]), initial=0) <= NARROW
        rows = [np.repeat(3 * columns[first:last], 3) + np.tile(np.arange(3), last - first)
                for first, last in zip(equations.blocks[:-1], equations.blocks[1:])]
        entries = np.concatenate([np.tile(row, 3) for row in rows] + [[]]).astype(np.int32)
        starts = np.concatenate([[0], np.cumsum(np.repeat(3 * widths, 3))]).astype(np.int32)
        kind = sparse.csc_matrix if self._narrow else sparse.csr_matrix     # it is symmetric
        self._matrix = kind((np.zeros(len(entries)), entries, starts), (3 * size, 3 * size))
        self._right = np.empty(3 * size)
        self._corners = 9 * equations.blocks[:-1] + 3 * equations.diagonal
        self._strides = 3 * widths
        _, self._body = sparse.csgraph.connected_components(pattern, directed=False)
        self._mass = finite_masses(equations.mass)
        self._total = np.bincount(self._body, equations.mass)

    def solve(self, equations, y, v, w, dt, first):
        """
        Solve for the change of velocity of the particles with springs.

        Parameters
        ----------
        equations, y, v, w, dt, first
            As for implicit_springs.assemble.

        Returns
        -------
        dv : (3, A) float64 [m/s]
            The momentum of a body that no pin holds is that of its free flight to rounding.

        """
        assemble(equations, y, v, w, dt, first, self._matrix.data, self._right)
        solve = self._eliminate if self._narrow else self._iterate
        dv = solve().reshape(-1, 3).T
        for each, change in zip(dv, (v - w)[:, equations.members]):
            lost = np.bincount(self._body, self._mass * (each + change)) / self._total
            each -= lost[self._body]
        return dv

    def _eliminate(self):
        """Solve by elimination."""
        from scipy.sparse.linalg import splu
        return splu(self._matrix, permc_spec='MMD_AT_PLUS_A', diag_pivot_thresh=0.0,
                    options={'SymmetricMode': True}).solve(self._right)

    def _iterate(self):
        """Solve by conjugate gradients, preconditioned by the blocks on the diagonal."""
        from scipy.sparse.linalg import cg, LinearOperator
        row, column = np.mgrid[:3, :3]
        places = (self._corners[:, None, None] + row * self._strides[:, None, None] + column)
        blocks = np.linalg.inv(self._matrix.data[places])
        conditioner = LinearOperator(self._matrix.shape, lambda r: np.einsum(
            'nij,nj->ni', blocks, r.reshape(-1, 3)).ravel())
        return cg(self._matrix, self._right, rtol=ACCURACY, M=conditioner)[0]
