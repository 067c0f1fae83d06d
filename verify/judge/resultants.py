"""Resultants of stress, of the field of any solution: reactions, section forces, means in a ball.

A reaction is the residual of the weak form, r = M (a + α v) + f(u) + f_v(v) − p, tested with a
rigid motion of the nodes that a support holds. It is conjugate to the work of the support, so that
all reactions balance the loads to round-off where a solution is in equilibrium with every motion of
its nodes. A motion of the nodes that are held alone ends in one layer of elements, so it is the
stress there that counts and not what is known of the loads elsewhere. Where a cut meets that layer
the motion ends smoothly farther away.

The force in a section is that of a rigid motion of all nodes on one side of it. What the loads do
on the layer of elements that the section runs through is integrated up to the section.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import cg
from scipy.spatial import cKDTree

from verify.compare.hooke import Corotated, Law, stress_power, viscous_power
from verify.compare.locate import ROUND_OFF, Field, SolutionField
from verify.compare.mass import (
    assembled,
    consistent_mass,
    density_of,
    inertia_of,
    kinetic,
    separated_parts,
)
from verify.compare.motion import step_at
from verify.compare.outer_work import (
    PrescribedNodes,
    nodal_forces,
    nodes_held,
    prescribed_nodes,
    spread,
    taken_up,
)
from verify.compare.simplices import EDGES, cells_of
from verify.errors import InputError, UnsupportedSceneError
from verify.geometry.simplices import measures
from verify.scene import BodyForce, CutFaces, Gravity, Scene, Traction
from verify.scene.acceptance import Quantity, ReactionQuantity, SectionQuantity, StressQuantity
from verify.scene.parts import Pieces, clipped
from verify.scene.physics import CLOSE, factor_at, jumps
from verify.scene.placement import on_unit_sphere
from verify.solution import Solution

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

_REACH = 0.25  # of the body's diagonal
_ON = 10 * ROUND_OFF  # of it: nodes so near a cut or the plane of a section are on it
_MOMENT = 1e-6  # of the duration: over which accelerations of supports are taken


@dataclass(frozen=True)
class WeakForm:
    """Forces at the nodes of a solution.

    Parameters
    ----------
    scene : Scene
    solution : Solution
    law : Law
    """

    scene: Scene
    solution: Solution
    law: Law

    @cached_property
    def field(self) -> SolutionField:
        """Field of the cells."""
        return SolutionField(self.solution)

    @cached_property
    def mass(self) -> csr_array:
        """Mass (n, n) of the nodes, kg: as declared, if it can be that of the body."""
        density = density_of(self.scene, self.solution)
        if self.solution.velocity is None:
            return consistent_mass(self.solution, density)
        parts = separated_parts(self.solution, density)
        whole = kinetic(self.solution, density)
        return inertia_of(self.solution, density, whole, parts).matrix

    @cached_property
    def on_cut(self) -> Bools:
        """Whether nodes (n,) are on the realised cut."""
        points, facets = self.solution.points, self.solution.cut_facets
        if not facets.size:
            return np.zeros(len(points), dtype=bool)
        away = cKDTree(facets.reshape(-1, points.shape[1])).query(points)[0]
        return np.asarray(away <= _ON * self.field.scale)

    @cached_property
    def owners(self) -> NDArray[np.int64]:
        """Number (n, d) of the support that holds each component of each node; −1 of those free."""
        supports = self.scene.supports
        owners = np.full(self.solution.points.shape, -1, dtype=np.int64)
        held = nodes_held(self.scene, self.solution, [one.where for one in supports])
        for i, (nodes, one) in enumerate(zip(held, supports, strict=True)):
            owners[np.ix_(nodes, list(one.held(self.scene.dimension)))] = i
        return owners

    def internal(self, step: int, w: Array) -> float:
        """Power of the stresses of an output time on nodal velocities w (n, d), W."""
        test, u = self.field.with_nodal(w), self.field.with_nodal(self.solution.displacement[step])
        power = self._mixed(step, w) if self._has_pressure else stress_power(test, u, self.law)
        if damping := self.scene.analysis.damping[1]:
            moving = self.field.with_nodal(self._in_motion("velocity")[step])
            power += damping * viscous_power(test, moving, u, self.law)
        return power

    @property
    def _has_pressure(self) -> bool:
        from reference.fracture.cells import MIXED

        return self.solution.notes.get("unknowns") == MIXED

    def _mixed(self, step: int, w: Array) -> float:
        """Power of the stresses of a solution with a pressure of its own."""
        from reference.exact.solution import hooke
        from reference.fracture.cells import cell_gradients, stress_of

        if self.scene.analysis.kinematics != "linear":
            raise UnsupportedSceneError(
                "the stress of a solution with a pressure is known in linear kinematics"
            )
        every = np.arange(len(self.solution.cells))
        at = cell_gradients(self.solution, every, step, 2)
        law = hooke(self.scene.material.each[0])
        stress = stress_of(self.solution, law, step)(every, at)
        hats = cell_gradients(
            Solution(self.solution.points, self.solution.cells, w[None], order=self.solution.order),
            every, 0, 2,
        )  # fmt: skip
        return float(np.einsum("mqij,mqij,mq->", stress, hats.gradient, at.weights))

    def loads(self, step: int, side: "_Side | None" = None) -> Array:
        """Nodal forces (n, d) of loads at an output time, N; perhaps of those on one side alone.

        Gravity pulls at the mass of the nodes. Faces of cuts bear loads in balance.

        Raises
        ------
        UnsupportedSceneError
            If a load follows an exact field, or jumps then: of accelerations solvers say those of
            before or of after.
        """
        time, found = float(self.solution.times[step]), np.zeros_like(self.solution.points)
        close = CLOSE * float(np.ptp(self.solution.times))
        for load in self.scene.loads:
            if isinstance(load, Gravity):
                pulled = np.asarray(load.acceleration)
                if side is None:
                    found += np.multiply.outer(np.asarray(self.mass.sum(axis=1)).ravel(), pulled)
                else:
                    found += side.inertia(self, np.tile(pulled, (len(found), 1)))
            elif isinstance(load, CutFaces):
                continue
            else:
                assert isinstance(load, BodyForce | Traction)
                if load.exact:
                    raise UnsupportedSceneError("a load follows an exact field")
                if time > close and any(abs(time - t) <= close for t in jumps(load.history)):
                    what = f"a load jumps at {time:.6g} s, and with it accelerations"
                    raise UnsupportedSceneError(f"{what}; expected another output time")
                clip = None if side is None else side.part_of
                forces = nodal_forces(self.scene, load, self.solution, time, clip)
                found += factor_at(load.history, time) * forces
        return found

    def rates(self, step: int) -> Array | None:
        """Accelerations with the drag (n, d) of a solution in motion, m/s².

        Held nodes have those that supports prescribe, after a kink and at the end before it.
        """
        if self.scene.analysis.kind == "static":
            return None
        rates = self._in_motion("acceleration")[step]
        if any(one.timed or one.history for one in self.scene.supports):
            nodes, times = self._prescribed, self.solution.times
            near = _MOMENT * float(np.ptp(times))
            near = -near if step == len(times) - 1 else near
            first, second = (nodes.velocities(times[step] + k * near) for k in (1, 2))
            rates = taken_up(self.mass, nodes.held, rates, (second - first) / near)
        if drag := self.scene.analysis.damping[0]:
            rates = rates + drag * self._in_motion("velocity")[step]
        return rates

    @cached_property
    def _prescribed(self) -> PrescribedNodes:
        try:
            return prescribed_nodes(self.scene, self.solution)
        except InputError as problem:
            raise UnsupportedSceneError(str(problem)) from None

    def _in_motion(self, name: str) -> Array:
        found: Array | None = getattr(self.solution, name)
        if found is None:
            which = {"velocity": "velocities", "acceleration": "accelerations"}[name]
            raise UnsupportedSceneError(f"the solution carries no {which}")
        return found

    def rigid(self, asked: ReactionQuantity | SectionQuantity, step: int) -> Array:
        """Rigid motion (n, d) that a force or moment works on; of the body as it is deformed."""
        at, d = self.solution.points, self.solution.dimension
        axis = asked.direction(d)
        if asked.of == "force":
            return np.broadcast_to(axis, at.shape)
        if self.scene.analysis.kinematics == "corotational":
            at = at + self.solution.displacement[step]
        arm = at - np.asarray(asked.about)
        if d == 2:
            return np.column_stack([-arm[:, 1], arm[:, 0]])
        return np.cross(axis, arm)


def reaction(form: WeakForm, asked: ReactionQuantity) -> float:
    """Force or moment of a support on the body, N or N m (2D: per metre).

    What several supports hold is the last one's.

    Raises
    ------
    UnsupportedSceneError
        If a load follows an exact field, or a solution in motion has no accelerations.
    """
    step = step_at(form.solution, asked.time)
    owners = form.owners
    own = [i for i, one in enumerate(form.scene.supports) if one.where == asked.where]
    w = _extended(form, np.isin(owners, own), owners >= 0) * form.rigid(asked, step)
    force, rates = -form.loads(step), form.rates(step)
    if rates is not None:
        force += form.mass @ rates
    return form.internal(step, w) + float(np.sum(force * w))


def _extended(form: WeakForm, own: Bools, held: Bools) -> Array:
    """Extend 1 (n, d) at components of nodes that a support holds: by 0, or smoothly.

    Where a cut meets the elements in which it would fall to 0, that is no test function of solvers
    whose elements go on beyond a cut. There it ends as smoothly as the body is large, as if the cut
    were closed; or on each face by itself, if another support begins at it.

    Raises
    ------
    UnsupportedSceneError
        If it ends on each face by itself, and faces of cuts bear loads or press on each other.
    """
    found, solution = own.astype(float), form.solution
    nodes = own.any(axis=1)
    if not _meets_cut(form, nodes):
        return found
    away = cKDTree(solution.points[nodes]).query(solution.points)[0]
    share = np.minimum(away / (_REACH * form.field.scale), 1.0)
    smooth = (1.0 - share) ** 2 * (1.0 + 2.0 * share)
    others = (held & ~own)[:, own.any(axis=0)].any(axis=1) & (share < 1.0)
    if not _meets_cut(form, others):
        return np.where(held, found, smooth[:, None])
    scene = form.scene
    if scene.contact.closed or any(isinstance(load, CutFaces) for load in scene.loads):
        raise UnsupportedSceneError(
            "another support begins at a cut whose faces bear loads; expected one for both sides"
        )
    return _harmonic(form, own, held | (share == 1.0)[:, None])


def _meets_cut(form: WeakForm, nodes: Bools) -> bool:
    """Tell whether a cut meets the elements at some nodes (n,)."""
    cells = form.solution.cells
    return bool(form.on_cut[cells[nodes[cells].any(axis=1)]].any())


def _harmonic(form: WeakForm, own: Bools, fixed: Bools) -> Array:
    """Extend 1 (n, d) at own and 0 at other fixed components of nodes, with cuts open.

    From s, of which each component is harmonic on the corners of cells, to 3s² − 2s³, which begins
    and ends smoothly. It need not be accurate.
    """
    solution, found = form.solution, own.astype(float)
    corners = solution.cells[:, : solution.cell_dimension + 1]
    shape = cells_of(solution)
    local = shape.gradients @ np.swapaxes(shape.gradients, 1, 2)
    stiffness = assembled(shape.volume[:, None, None] * local, corners, len(found))
    diagonal = stiffness.diagonal()
    for s, held in zip(found.T, fixed.T, strict=True):
        free = ~held & (diagonal > 0.0)
        if s.any() and free.any():
            scale = diags_array(diagonal[free] ** -0.5)
            scaled = scale @ stiffness[free][:, free] @ scale
            s[free] = scale @ cg(scaled.tocsr(), -(scale @ (stiffness[free] @ s)), rtol=1e-6)[0]
    if solution.order == 2:
        ends = np.array(EDGES[solution.cell_dimension])
        middles = solution.cells[:, solution.cell_dimension + 1 :]
        mean = found[corners[:, ends]].mean(axis=2)
        found[middles] = np.where(fixed[middles], found[middles], mean)
    found = np.clip(found, 0.0, 1.0)
    return found**2 * (3.0 - 2.0 * found)


@dataclass(frozen=True)
class _Side:
    """The side of a plane to which its normal points."""

    point: Array
    normal: Array
    near: float  # m: a node so near is on the plane, and not beyond it

    def level(self, points: Array) -> Array:
        """Height (…) of points (…, d) over the plane, m; 0 on it."""
        height = (points - self.point) @ self.normal
        return np.where(np.abs(height) <= self.near, 0.0, height)

    def part_of(self, pieces: Pieces, corners: Array) -> Pieces:
        """Pieces of simplices (q, k, d) on this side."""
        parts = clipped(pieces, self.level(pieces.places(corners)))
        return parts[self.level(parts.places(corners).mean(axis=1)) > 0.0]

    def inertia(self, form: WeakForm, rates: Array) -> Array:
        """Nodal forces (n, d) of the consistent mass on this side times rates (n, d) of nodes."""
        solution, k = form.solution, form.solution.cell_dimension
        corners = solution.points[solution.cells[:, : k + 1]]
        pieces = self.part_of(Pieces.whole(np.arange(len(corners)), k + 1), corners)
        density = np.broadcast_to(density_of(form.scene, solution), len(corners))
        own = rates[solution.cells]

        def force(_points: Array, hats: Array, cells: NDArray[np.int64]) -> Array:
            return density[cells, None, None] * np.einsum("mqn,mnd->mqd", hats, own[cells])

        return spread(solution, solution.cells, k, pieces, force)


def section(form: WeakForm, asked: SectionQuantity) -> float:
    """Force or moment in a section of what lies beyond it on the rest, N or N m (2D: per metre).

    In tension its part along the normal is positive.

    Raises
    ------
    UnsupportedSceneError
        If the plane misses the body, meets a cut or a support of what is asked for, or as of
        `reaction`.
    """
    solution, step = form.solution, step_at(form.solution, asked.time)
    normal = np.asarray(asked.normal) / np.linalg.norm(asked.normal)
    side = _Side(np.asarray(asked.point, dtype=float), normal, _ON * form.field.scale)
    beyond = side.level(solution.points) > 0.0
    rigid = form.rigid(asked, step)
    _check_section(form, beyond, rigid)
    w = np.where(beyond[:, None], rigid, 0.0)
    found = form.internal(step, w) - float(np.sum(form.loads(step) * w))
    found += float(np.sum(form.loads(step, side) * rigid))
    rates = form.rates(step)
    if rates is not None:
        found += float(np.sum((form.mass @ rates) * w))
        found -= float(np.sum(side.inertia(form, rates) * rigid))
    return found


def _check_section(form: WeakForm, beyond: Bools, rigid: Array) -> None:
    """Refuse a section that misses the body, or meets a cut or a support that bears on `rigid`."""
    solution = form.solution
    sides = beyond[solution.cells]
    crossed = solution.cells[sides.any(axis=1) & ~sides.all(axis=1)]
    if not len(crossed):
        raise UnsupportedSceneError("the plane of the section misses the body")
    if form.on_cut[crossed].any():
        raise UnsupportedSceneError(
            "the section runs through elements that a cut meets; expected uncut material"
        )
    bears = (form.owners >= 0) & (np.abs(rigid) > ROUND_OFF * np.abs(rigid).max())
    for held in np.moveaxis(bears[crossed], 2, 0):
        both = (held & beyond[crossed]).any(axis=1) & (held & ~beyond[crossed]).any(axis=1)
        if both.any():
            x = ", ".join(f"{c:.4g}" for c in solution.points[crossed[both][0]].mean(axis=0))
            raise UnsupportedSceneError(
                f"the section meets a support near ({x}) m that bears a part of it; expected a "
                "plane beside it, or a component that is not held"
            )


def resultants_over_time(form: WeakForm, asked: Sequence[Quantity]) -> dict[str, list[float]]:
    """Values of reactions and sections at all output times, as ``quantity_NAME``.

    NaN at a time at which there is none; of those that are had at some.
    """
    found = {}
    for one in asked:
        if isinstance(one, ReactionQuantity | SectionQuantity):
            row = []
            for time in form.solution.times:
                at = one.model_copy(update={"time": float(time)})
                row.append(np.nan)
                with suppress(InputError, UnsupportedSceneError):
                    if isinstance(at, ReactionQuantity):
                        row[-1] = reaction(form, at)
                    else:
                        row[-1] = section(form, at)
            if not np.isnan(row).all():
                found[f"quantity_{one.name}"] = row
    return found


def mean_stress(field: Field, law: Law, asked: StressQuantity) -> float:
    """Mean of a stress component over a ball on one side of all cuts, in one material, Pa.

    The mean gradient is (d/r) times the mean of u ⊗ n over its surface: displacements, which are
    continuous whatever elements the ball meets, are all that counts. The samples of the surface
    miss up to 1e-4 of it on linear elements as large as half the ball. At finite rotation it is the
    Cauchy stress P Fᵀ/det F of that gradient; the ball is one of the undeformed body.
    """
    centre = np.array([asked.point], dtype=float)
    d = centre.shape[1]
    normals, weights = on_unit_sphere(d)
    u = field.displacement(centre + asked.radius * normals, np.repeat(centre, len(normals), axis=0))
    gradient = d / asked.radius * np.einsum("q,qi,qj->ij", weights, u, normals)
    stress = law.at(centre).piola(gradient[None])[0]
    if isinstance(law, Corotated):
        deformation = np.eye(d) + gradient
        stress = stress @ deformation.T / np.linalg.det(deformation)
    row, column = ("xyz".index(axis) for axis in asked.component)
    return float(stress[row, column])


def scale_of(form: WeakForm, asked: ReactionQuantity | SectionQuantity | StressQuantity) -> float:
    """Bound what a strain of 1e-10 of the largest displacement over the body's size makes of it."""
    points, u = form.solution.points, form.solution.displacement
    size = float(np.ptp(points, axis=0).max())
    stress = 1e-10 * float(np.abs(u).max(initial=0.0)) / size
    stress *= float(np.max(form.law.lame) + 2 * np.max(form.law.shear))
    if isinstance(asked, StressQuantity):
        return stress
    corners = points[form.solution.cells[:, : form.solution.cell_dimension + 1]]
    area = float(measures(corners).sum()) / size
    return stress * area * (size if asked.of == "moment" else 1.0)
