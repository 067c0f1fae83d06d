"""Body in motion, as a scene states it: mass, elasticity, loads, supports, and cuts that open.

When facets open, a group of tied nodes divides into several. On each node the tie force of before,
r = M a − f, goes on to act (f: loads less internal and viscous forces). It is multiplied by the
share of the cut in the node's support that is not swept yet. The sum over the group is zero, as its
forces were in balance: momentum is kept, and no acceleration jumps.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.boundary_conditions import load_forces, nodes_on_part
from reference.contact import FaceContact, TurningContact
from reference.inside_out import OrientationCheck
from reference.large_strain import quadrature_points, solve_large_strain
from reference.law import ENERGIES, energy_of, law_of, mass_matrix
from reference.linear_solvers import Kind
from reference.meshing import ConformingMesh, open_cut
from reference.nodal_algebra import NodalMatrix, NodalSolver, TiedSolver
from reference.space import ConformingSpace, TiedUnknowns
from verify.errors import InputError
from verify.geometry.simplices import nearest_cut
from verify.geometry.swept_shares import CutSimplices, SweptShares
from verify.scene import Gravity, Scene, ToolPathCut
from verify.scene.physics import CLOSE, PrescribedMotion, factor_at, first_factor

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
_SAME = 1e-6  # of a facet: points that are one
_ROUND_OFF = 1e-14  # of the accelerations
_MOST_ITERATIONS = 1000
_SMALL = 5000  # unknowns of a solid that are factorised in a tenth of a second


class FacetOpenings(NamedTuple):
    """When the pairs of nodes that face each other across each of `mesh.cut_facets` open.

    Attributes
    ----------
    times : (f, q) array
        From when on each is open, s.
    passed : (f, q) array
        When the blade has passed all of its facet, s.
    shares : SweptShares or None
        Of the places of nodes on the cut; None where facets are released at once.
    place : (n,) int array
        Number of the place of each node.
    cut : (f,) int array
        Number of the cut that each facet is of.
    """

    times: Array
    passed: Array
    shares: SweptShares | None
    place: Numbers
    cut: Numbers

    def parted(
        self, before: Numbers, after: Numbers, facing: Numbers, due: NDArray[np.bool_]
    ) -> tuple[Numbers, Numbers]:
        """Give the nodes of groups that have fallen apart, and the cut (k,) that has parted each.

        Parameters
        ----------
        before, after : (n,) int array
            The leader of each node's group.
        facing : (f, q, 2) int array
            Pairs of nodes that face each other across each facet.
        due : (f, q) bool array
            Pairs that have just opened. Where pairs of several cuts have, it is the first cut.
        """
        pairs = np.unique(np.column_stack([before, after]), axis=0)
        nodes = np.flatnonzero((np.bincount(pairs[:, 0], minlength=len(before)) > 1)[before])
        cut = np.full(len(before), len(self.cut))
        np.minimum.at(cut, before[facing[due][:, 0]], self.cut[np.nonzero(due)[0]])
        return nodes, cut[before[nodes]]


class Release(NamedTuple):
    """Forces (k, d) on nodes (k,), N, their factors (k,) from 1 to 0 at a time, and the cuts."""

    nodes: Numbers
    forces: Array
    factor: Callable[[float], Array]
    cut: Numbers


class TieForces:
    """Forces on all that has been released of a body.

    Parameters
    ----------
    shape : (n, d) tuple of int
        Of nodal arrays.
    cuts : int
        Number of cuts.
    """

    def __init__(self, shape: tuple[int, int], cuts: int) -> None:
        self._shape, self._releases = (cuts, *shape), list[Release]()

    def add(self, release: Release, time: float) -> None:
        """Add the forces of a release at a time, and drop forces that have faded."""
        self._releases = [one for one in self._releases if one.factor(time).any()]
        self._releases.append(release)

    def at(self, time: float) -> Array:
        """Return the forces (cuts, n · d) at what each cut has released, at a time, N."""
        total, shape = np.zeros(self._shape), self._shape
        for nodes, forces, factor, cut in self._releases:
            total[cut, nodes] += factor(time)[:, None] * forces
        return total.reshape(len(total), shape[1] * shape[2])


def facet_openings(
    scene: Scene,
    space: ConformingSpace,
    facing: Numbers,
    swept: bool,
    delay: float = 0.0,
) -> FacetOpenings:
    """Find when each facet of the cut opens.

    Facets of a cut open with it. A facet on a tool path opens when the blade has passed the last of
    its corners; if `swept`, at each node as the first facet there begins to be swept.

    Parameters
    ----------
    scene : Scene
    space : ConformingSpace
        With all final cuts open.
    facing : (f, q, 2) int array
        Of `reference.nodal_algebra.facing_nodes`.
    swept : bool
    delay : float
        By which facets on tool paths open late, s.
    """
    corners = space.mesh.realised_cut
    nearest = nearest_cut(corners, [cut.pieces() for cut in scene.final_cuts])
    _, place = np.unique(space.node_points, axis=0, return_inverse=True)
    shares = SweptShares(len(corners), by_node=True)
    times, passed = np.zeros((2, *facing.shape[:2]))
    for i, cut in enumerate(scene.cuts):
        mine = nearest == i
        if isinstance(cut, ToolPathCut):
            which, nodes = np.flatnonzero(mine), facing[mine, :, 0]
            shape = _weights(corners[mine], space.node_points[nodes])
            simplices = CutSimplices(corners[mine], which, place.ravel()[nodes], shape)
            found = shares.add(simplices, partial(_passed_at, cut, delay))
            times[mine], passed[mine] = found.begins, found.passed[mine, None]
        else:
            times[mine] = passed[mine] = cut.opens_at
    known = shares if swept and shares.used else None
    return FacetOpenings(times if known else passed, passed, known, place.ravel(), nearest)


def _passed_at(cut: ToolPathCut, delay: float, points: Array) -> Array:
    return cut.passed_at(points) + delay


def _weights(corners: Array, nodes: Array) -> Array:
    """Compute weights (f, d, q) of the nodes (f, q, d) of facets at their corners.

    A node at a corner has the hat of the corner. A node between two corners has both hats: as N
    over a segment except for the shape, and never negative.
    """
    away = np.linalg.norm(corners[:, :, None] - nodes[:, None], axis=3)
    size = away.max(axis=(1, 2), keepdims=True)
    at = away <= _SAME * size
    between = np.zeros_like(at)
    count = corners.shape[1]
    for a in range(count):
        for b in range(a + 1, count):
            middle = 0.5 * (corners[:, a] + corners[:, b])
            off = np.linalg.norm(middle[:, None] - nodes, axis=2) <= _SAME * size[:, 0]
            between[:, a] |= off
            between[:, b] |= off
    return np.asarray(at | between, dtype=float)


def partly_opened(mesh: ConformingMesh, opened: NDArray[np.bool_]) -> ConformingMesh:
    """Give a mesh with all cuts open again, with some facets open only; cells stay in order.

    Parameters
    ----------
    mesh : ConformingMesh
    opened : (f,) bool array
        Whether each of `mesh.cut_facets` is.
    """
    if opened.all():
        return mesh
    points = np.empty((int(mesh.parent.max()) + 1, mesh.dimension))
    points[mesh.parent] = mesh.points
    return open_cut(points, mesh.parent[mesh.cells], mesh.cut_facets[opened])


def inherit(closed: ConformingSpace, opened: ConformingSpace, field: Array) -> Array:
    """Carry nodal values (n, d) over to the same mesh with more of its cuts open.

    Every copy of a node starts with the value that the node had: nothing jumps when a cut
    opens, so energy and momentum go on.

    Raises
    ------
    InputError
        If the two are not the same cells.
    """
    same = closed.cell_nodes.shape == opened.cell_nodes.shape and np.allclose(
        closed.node_points[closed.cell_nodes],
        opened.node_points[opened.cell_nodes],
        rtol=0.0,
        atol=1e-12 * float(np.ptp(closed.node_points, axis=0).max()),
    )
    if not same:
        raise InputError("the opened mesh does not have the cells of the closed one")
    values = np.empty((len(opened.node_points), field.shape[1]))
    values[opened.cell_nodes] = field[closed.cell_nodes]
    return values


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
        For supports and loads that take the exact solution.
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
        Of all unknowns of the law: the closed part of the cut.
    held : (h,) int array
        Unknowns with a prescribed motion, ascending: also those that are tied to such.
    tie_forces : TieForces
        On nodes that the cut has released.
    contact : FaceContact or None
        Of a scene with contact.
    pressures : sequence of (m,) array
        On its faces in the last three steps, the last first, or in the initial equilibrium, Pa;
        NaN on faces that were tied then.

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
        of_kinematics = FaceContact if self.law.linear else TurningContact
        closed = scene.contact.closed and len(space.mesh.cut_facets) > 0
        self.contact = of_kinematics(space, self._own_held) if closed else None
        self.pressures = 3 * [np.zeros(0 if self.contact is None else len(self.contact.weights))]
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

    @cached_property
    def _orientation(self) -> OrientationCheck:
        held, points = self._own_held, quadrature_points(self.space)
        return OrientationCheck(self.space, held, self.law.state.J, points, opening=True)

    def orientation(self, displacement: Array) -> OrientationCheck:
        """Return the check of det F, at a displacement (k,)."""
        self.law.energy(displacement)
        return self._orientation

    def inside_out(self, displacement: Array) -> str:
        """Say where a displacement (k,) is inside out though it must not be; "" if nowhere."""
        if self.law.linear:
            return ""
        most = ENERGIES[energy_of(self.scene.material)].inverted
        return self.orientation(displacement).fault(most)

    def external(self, time: float) -> Array:
        """Return the forces of all loads and ties at a time, N; after a jump there."""
        total = self.weight + self.tie_forces.at(time).sum(axis=0)
        for forces, history in self._driven:
            total += factor_at(history, time) * forces
        for load in self._timed:
            total += factor_at(load.history, time) * self._forces(load, time)
        return total

    def prescribed(self, time: float, before: bool = False) -> tuple[Array, Array]:
        """Return displacements and velocities (h,) of held unknowns, m and m/s.

        After what jumps at a time, or before it.
        """
        values = [one.at(time, before) for one in self._supports]
        rates = [one.velocities(time, before) for one in self._supports]
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

        material = self.scene.material
        closed, energy = self.contact is not None, energy_of(material)
        found = solve_large_strain(
            material, self.space, self.held, prescribed, load, energy, closed=closed
        )
        if found.contact is not None:
            self.pressures = 3 * [found.contact.pressure[0]]
        return found.displacement.ravel()

    @property
    def moves(self) -> bool:
        """Whether a support moves."""
        return any(one.moves for one in self._supports)

    def held_accelerations(self, time: float) -> Array:
        """Return accelerations (k,) of supports, zero elsewhere; after a kink there."""
        found = np.zeros(self.space.node_points.size)
        if self.moves:
            duration = self.scene.analysis.duration
            assert duration is not None
            values = [one.accelerations(time, duration) for one in self._supports]
            found[self.held] = self._filled(values)
        return self.ties.spread(found)

    def accelerations(self, forces: Array, time: float | None = None) -> Array:
        """Solve M a = forces, where held with the accelerations of supports at a time.

        Without a time they have none.

        By conjugate gradients: scaled by its diagonal a consistent mass has a condition number of a
        few tens, whatever the mesh. A factorisation would last only until a facet opens.

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
        own = np.zeros_like(forces) if time is None else self.held_accelerations(time)
        forces = forces - self.mass @ own if own.any() else forces
        a, left = np.zeros_like(forces), free * ties.summed(forces)
        along = scale * left
        size = first = float(left @ along)
        for _ in range(_MOST_ITERATIONS):
            if size <= _ROUND_OFF**2 * first:
                return ties.spread(a) + own
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

        Matrices of solids are, unless they are small; with a pressure they are indefinite.
        """
        solid = self.space.mesh.cell_dimension == 3
        return bool(
            solid and self.law.unknowns is self.space and self.space.node_points.size > _SMALL
        )

    @property
    def planned(self) -> bool:
        """Whether one factorisation lasts while ties go."""
        return self._lasting is not None

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
        spare = matrix.copy()
        whole = NodalSolver(matrix, self.law.unknowns, self._own_held, kind, largest=1e-3)
        try:
            found = TiedSolver(whole, self.ties, self._lasting, self._own_held)
        except np.linalg.LinAlgError:  # a sliver beside ties: their compliance is lost in round-off
            whole.destroy()
            self._lasting = None
            return self.step_solver(spare, kind)
        spare.destroy()
        return found

    def _linear_equilibrium(self, factors: list[float], load: Array) -> Array:
        u = np.zeros_like(load)
        pairs = zip(self._supports, factors, strict=True)
        u[self.held] = self._filled([one.values(factor, 0.0) for one, factor in pairs])
        left = load - self.law.force(u)
        left[self.held] = 0.0
        matrix = self.ties.projected(self.law.tangent(u))
        solver = NodalSolver(matrix, self.ties, self.held, "symmetric")
        found = u + solver.solve(left)
        if (faces := self.contact) is not None:
            compliance = self.compliance(solver, faces.gaps)
            gaps = faces.opened(found)
            pressure = faces.pressed(gaps, compliance, self.ties.leader)
            self.pressures = 3 * [pressure]
            found += solver.solve(self.freed(faces.gaps.T @ pressure))
        solver.destroy()
        return found

    def freed(self, forces: Array) -> Array:
        """Sum forces (k,) over ties, and leave out the held unknowns."""
        right = self.ties.summed(forces).copy()
        right[self.held] = 0.0
        return right

    def compliance(self, solver: NodalSolver | TiedSolver, gaps: Any) -> Array:
        """Return weighted gaps (m, m) of the answers of a solver to unit pressures on faces."""
        assert self.contact is not None
        return self.contact.compliance(
            lambda columns: np.column_stack([solver.solve(self.freed(one)) for one in columns.T]),
            gaps,
        )

    def _first_loads(self) -> Array:
        """Sum the nodal forces (k,) of all loads with their first factors, N."""
        load = self.weight.copy()
        for forces, history in self._driven:
            load += first_factor(history) * forces
        for timed in self._timed:
            load += first_factor(timed.history) * self._forces(timed)
        return load

    def _forces(self, load: Any, time: float = 0.0) -> Array:
        """Compute nodal forces (k,) of a load at a time, N, without the factor of its history."""
        alone = self.scene.model_copy(update={"loads": [load]})
        alone._file, alone._name = self.scene.file, self.scene.name
        return load_forces(alone, self.space, self.exact, time)

    def _found(self) -> list[_Held]:
        """Find what each support holds."""
        space, duration = self.space, self.scene.analysis.duration
        assert duration is not None
        found = []
        for i, support in enumerate(self.scene.supports):
            key = f"supports[{i}].where"
            nodes, near = nodes_on_part(self.scene, space, support.where, key)
            held = list(support.held(space.dimension))
            exact = self.exact if support.displacement == "exact" else None
            place: Any = np.ix_(nodes, held)
            points, close = space.node_points[nodes], CLOSE * duration
            found.append(_Held(support, points, near, exact, place, close=close))
        return found

    def _filled(self, values: list[Array]) -> Array:
        """Collect values (h,) of held unknowns; a later support wins."""
        filled = np.zeros(self.space.node_points.shape)
        for one, value in zip(self._supports, values, strict=True):
            filled[one.place] = value
        return np.asarray(filled.ravel()[self._holder])
