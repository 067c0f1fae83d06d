"""Body in motion, as a scene states it: mass, elasticity, damping, loads and supports over time."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.boundary_values import nodes_on_part
from reference.dynamics_cuts import TieForces
from reference.large_strain import solve_large_strain
from reference.law import law_of, mass_matrix
from reference.linear_solvers import Kind
from reference.loads import load_forces
from reference.nodal_algebra import NodalMatrix, NodalSolver, TiedSolver
from reference.space import ConformingSpace, TiedUnknowns
from verify.scene import Gravity, Scene
from verify.scene.physics import PrescribedMotion, factor_at, first_factor

Array = NDArray[np.float64]
_ROUND_OFF = 1e-14  # of the accelerations
_MOST_ITERATIONS = 1000
_SMALL = 5000  # unknowns of a solid that are factorised in a tenth of a second


@dataclass(frozen=True)
class _Held(PrescribedMotion):
    """Motion that a support prescribes, and where: nodes and components."""

    place: tuple[NDArray[np.int64], NDArray[np.int64]]


class MovingBody:
    """A body of a dynamic scene on one mesh. Arrays (k,), of nodes × components, are on all ranks.

    Parameters
    ----------
    scene : Scene
    space : ConformingSpace
    exact : ExactSolution or None
        For supports and loads that are said to be exact.
    pressure : bool
        Whether a linear law has the pressure as an unknown.

    Attributes
    ----------
    law : Law
    mass : NodalMatrix
        Consistent.
    inertia : PETSc Mat
        The same, of all unknowns of the law.
    weight : (k,) array
        Dead load of gravity, N.
    ties : TiedUnknowns
        Of all unknowns of the law: what of the cut is still closed.
    held : (h,) int array
        Unknowns with a prescribed motion, ascending: also those that are tied to such.
    tie_forces : TieForces
        On what the cut has released.

    Raises
    ------
    InputError
        If there is no density, or a support or load acts nowhere.
    """

    def __init__(
        self, scene: Scene, space: ConformingSpace, exact: Any, pressure: bool = False
    ) -> None:
        self.scene, self.space, self.exact = scene, space, exact
        self.inertia = mass_matrix(scene.material, space, str(scene.file or ""))
        self.mass = NodalMatrix(self.inertia, space)
        self.law = law_of(scene.material, space, scene.analysis.kinematics, pressure)
        if self.law.unknowns is not space:
            self.inertia = mass_matrix(scene.material, self.law.unknowns)
        self.weight = np.zeros(space.node_points.size)
        self._driven: list[tuple[Array, Any]] = []
        self._timed: list[Any] = []  # loads that are another field at every time
        for load in scene.loads:
            forces = self._forces(load)
            if isinstance(load, Gravity):
                self.weight += forces
            elif load.timed or (load.exact and exact.moves):
                self._timed.append(load)
            else:
                self._driven.append((forces, load.history))
        self._supports = self._found()
        mark = np.zeros(space.node_points.shape, dtype=bool)
        for one in self._supports:
            mark[one.place] = True
        self._own_held = np.flatnonzero(mark.ravel()).astype(np.int32)
        self.ties = TiedUnknowns(self.law.unknowns)
        self.tie_forces = TieForces(space.node_points.shape, len(scene.cuts))
        self._lasting: NDArray[np.int64] | None = None
        diagonal = self.mass.petsc.getDiagonal()
        self._mass_diagonal = space.everywhere(diagonal.array).ravel()
        diagonal.destroy()
        self.tie(np.zeros((0, 2), dtype=np.int64))

    def tie(self, pairs: NDArray[np.int64]) -> None:
        """Tie the nodes of pairs (p, 2) to each other, and no others.

        A support that holds one node of a group holds all; of several the lowest number decides.
        """
        self.ties.tie(pairs)
        self.held = self.ties.all_tied_to(self._own_held)
        d = self.space.dimension
        node, component = np.divmod(self._own_held, d)
        leading = self.ties.leader[node] * d + component
        found, first = np.unique(leading, return_index=True)
        node, component = np.divmod(self.held, d)
        at = np.searchsorted(found, self.ties.leader[node] * d + component)
        self._holder = self._own_held[first[at]]

    def external(self, time: float) -> Array:
        """Return the forces of all loads and ties at a time, N; after a jump there."""
        total = self.weight + self.tie_forces.at(time).sum(axis=0)
        for forces, history in self._driven:
            total += factor_at(history, time) * forces
        for load in self._timed:
            total += factor_at(load.history, time) * self._forces(load, time)
        return total

    def prescribed(self, time: float) -> tuple[Array, Array]:
        """Displacements and velocities (h,) of what is held, m and m/s."""
        values, rates = [], []
        for one in self._supports:
            values.append(one.values(factor_at(one.support.history, time), time))
            rates.append(one.velocities(time))
        return self._filled(values), self._filled(rates)

    def equilibrium(self) -> Array:
        """Find the static equilibrium (k,) under the first factors of all histories, m.

        Every piece must be held. At finite rotation nothing may be tied.

        Raises
        ------
        RuntimeError
            If it is not found.
        """
        factors = [first_factor(one.support.history) for one in self._supports]
        load = self._first_loads()
        if self.scene.analysis.kinematics == "linear":
            return self._linear_equilibrium(factors, load)

        def prescribed(share: float) -> Array:
            pairs = zip(self._supports, factors, strict=True)
            return self._filled([one.values(share * factor, 0.0) for one, factor in pairs])

        found = solve_large_strain(self.scene.material, self.space, self.held, prescribed, load)
        return found.displacement.ravel()

    def accelerations(self, forces: Array) -> Array:
        """Solve M a = forces, with a = 0 where held.

        By conjugate gradients: over its diagonal a consistent mass has a condition of a few tens,
        whatever the mesh, and no factorisation lasts longer than until a facet opens.

        Raises
        ------
        RuntimeError
            If they do not converge.
        """
        ties, d = self.ties, self.space.dimension
        free = np.ones(len(forces))
        free[self.held] = 0.0
        free.reshape(-1, d)[ties.followers] = 0.0
        scale = 1.0 / np.where(free > 0.0, ties.summed(self._mass_diagonal), 1.0)
        a, left = np.zeros_like(forces), free * ties.summed(forces)
        along = scale * left
        size = first = float(left @ along)
        for _ in range(_MOST_ITERATIONS):
            if size <= _ROUND_OFF**2 * first:
                return ties.spread(a)
            product = free * ties.summed(self.mass @ ties.spread(along))
            share = size / float(along @ product)
            a += share * along
            left -= share * product
            before, size = size, float(left @ (scale * left))
            along = scale * left + size / before * along
        raise RuntimeError("the accelerations are not found: the mass has an element without any")

    @property
    def iterates(self) -> bool:
        """Whether symmetric systems of a step begin by conjugate gradients.

        Those of solids, unless they are small; with a pressure they are indefinite.
        """
        solid = self.space.mesh.cell_dimension == 3
        return bool(
            solid and self.law.unknowns is self.space and self.space.node_points.size > _SMALL
        )

    def plan(self, lasting: NDArray[np.int64] | None) -> None:
        """Take ties (p, 2) of `lasting_ties` for all that will ever be tied; see `step_solver`."""
        self._lasting = lasting

    def step_solver(self, matrix: Any, kind: Kind) -> NodalSolver | TiedSolver:
        """Make the solver with a matrix of all unknowns, which is destroyed with it.

        What a solve misses the next iteration of a step corrects, if it is little. It is good
        until a tie goes; of linear laws with a plan also then.
        """
        if self._lasting is None:
            ties = self.ties
            iterates = self.iterates and kind == "symmetric"
            few = ties.projected(matrix)
            return NodalSolver(few, ties, self.held, kind, largest=1e-3, iterates=iterates)
        whole = NodalSolver(matrix, self.law.unknowns, self._own_held, kind, largest=1e-3)
        return TiedSolver(whole, self.ties, self._lasting, self._own_held)

    def _linear_equilibrium(self, factors: list[float], load: Array) -> Array:
        u = np.zeros_like(load)
        pairs = zip(self._supports, factors, strict=True)
        u[self.held] = self._filled([one.values(factor, 0.0) for one, factor in pairs])
        left = load - self.law.force(u)
        left[self.held] = 0.0
        matrix = self.ties.projected(self.law.tangent(u))
        solver = NodalSolver(matrix, self.ties, self.held, "symmetric")
        found = u + solver.solve(left)
        solver.destroy()
        return found

    def _first_loads(self) -> Array:
        """Sum the nodal forces (k,) of all loads with their first factors, N."""
        load = self.weight.copy()
        for forces, history in self._driven:
            load += first_factor(history) * forces
        for timed in self._timed:
            load += first_factor(timed.history) * self._forces(timed)
        return load

    def _forces(self, load: Any, time: float = 0.0) -> Array:
        """Nodal forces (k,) of a load at a time, N, without the factor of its history."""
        alone = self.scene.model_copy(update={"loads": [load]})
        alone._file, alone._name = self.scene.file, self.scene.name
        return load_forces(alone, self.space, self.exact, time)

    def _found(self) -> list[_Held]:
        """Find what each support holds."""
        space = self.space
        found = []
        for i, support in enumerate(self.scene.supports):
            key = f"supports[{i}].where"
            nodes, near = nodes_on_part(self.scene, space, support.where, key)
            held = list(support.held(space.dimension))
            exact = self.exact if support.displacement == "exact" else None
            place: Any = np.ix_(nodes, held)
            found.append(_Held(support, space.node_points[nodes], near, exact, place))
        return found

    def _filled(self, values: list[Array]) -> Array:
        """Values (h,) of what is held; a later support wins."""
        filled = np.zeros(self.space.node_points.shape)
        for one, value in zip(self._supports, values, strict=True):
            filled[one.place] = value
        return np.asarray(filled.ravel()[self._holder])
