"""Statics of a cut body: linear, and Newton's method on its potential energy at finite rotation.

The matrix of Newton's method is K_ρ = K_R + ρ (K_C − K_R), of the rotation-fixed and the consistent
tangent; ρ, the `rotational` of arguments here, falls along `SHARES` until K_ρ is positive definite.
A line search then chooses the share of the correction.
"""

from dataclasses import dataclass
from functools import cached_property, partial
from time import perf_counter
from typing import Literal, NamedTuple

import numpy as np
from scipy.sparse import bsr_array

from verify.xfem.arrays import (
    Bools,
    Floats,
    Ints,
    NotConvergedError,
    SingularStiffnessError,
    check_choice,
    finite_array,
)
from verify.xfem.block_pattern import BlockPattern, body_pattern, constrain, held_entries
from verify.xfem.element import Material
from verify.xfem.internal_force import InternalForce, Penalty, inside_out
from verify.xfem.linear_solvers import PLAIN, Kernels, LinearSolver
from verify.xfem.loads_and_supports import Supports, check_bodies
from verify.xfem.phantom import PhantomMesh

Method = Literal["auto", "direct", "iterative"]

# nodes in space, from which iterations are faster, and from which those with a coarse space are
ITERATE_FROM, LARGE_FROM = 2000, 10_000  # (measured)
_ROUNDING = 1e-13  # relative residual that a factorisation leaves, too
_PHASES = ("analysis", "assembly", "factorisation", "solve")
_MOST = 10_000  # iterations, where no factorisation may follow


@dataclass(frozen=True)
class StaticSolution:
    """Equilibrium of a cut body with linear kinematics.

    Attributes
    ----------
    displacement : (N, d) float array
        At the dof nodes, in metres.
    strain_energy : float
        ½ uᵀKu, in joules (per metre of thickness in 2D).
    reaction : (N, d) float array
        Forces of the supports, in newtons; zero where not supported.
    residual : float
        Largest unbalanced force over the largest force in the body, or the largest entry of K times
        the largest of u if that is larger.
    timings : dict of str to float
        Wall seconds of ``analysis`` (sparsity and symbolic factorisation), ``assembly``,
        ``factorisation`` and ``solve``.
    penalty_energy : float
        Energy of a ghost penalty, not part of the strain energy.
    solver : {"direct", "iterative"}
        Which solver has found it.
    """

    displacement: Floats
    strain_energy: float
    reaction: Floats
    residual: float
    timings: dict[str, float]
    penalty_energy: float = 0.0
    solver: str = "direct"


def solve_static(
    phantom: PhantomMesh,
    material: Material,
    supports: Supports,
    load: Floats | None = None,
    solver: Method = "auto",
    ghost: Penalty | None = None,
    kernels: Kernels = PLAIN,
) -> StaticSolution:
    """Solve K u = f.

    Parameters
    ----------
    phantom : PhantomMesh
        With slivers as a policy of `verify.xfem.slivers` left them, or untreated.
    material : Material
    supports : Supports
    load : (N, d) float array, optional
        Nodal forces in newtons.
    solver : {"auto", "direct", "iterative"}
        Factorisation, or conjugate gradients down to the residual that a factorisation leaves.
        ``auto`` takes the faster one. For solids of 2000 nodes and more, without a ghost penalty,
        that is the solver of the kernels for steps, from 10 000 on their solver for large ones. If
        it does not converge, a factorisation follows.
    ghost : Penalty, optional
        A `verify.xfem.ghost_penalty`, added to the stiffness.
    kernels : Kernels
        Whose linear solvers are taken.

    Raises
    ------
    UnsupportedBodyError
        If a free body can move rigidly.
    SingularStiffnessError
        If the stiffness is not positive definite for another reason.
    XfemError
        If shapes do not match or a load is not finite.

    Examples
    --------
    Two halves that a cut leaves are pulled apart: both are rigid.

    >>> import verify.xfem as xfem
    >>> mesh = xfem.rectangle_mesh((4, 4))
    >>> phantom = xfem.cut_mesh(mesh, [xfem.Plane([0.6, 0.0], [1.0, 0.0])])
    >>> x = mesh.points[:, 0]
    >>> held = xfem.Supports.none(phantom).prescribe(phantom, x == 0.0)
    >>> held = held.prescribe(phantom, x == 1.0, [0.1, 0.0])
    >>> solution = xfem.solve_static(phantom, xfem.isotropic(1e4, 0.3, "plane strain"), held)
    >>> bool(solution.strain_energy < 1e-20), round(float(solution.displacement.max()), 12)
    (True, 0.1)
    """
    shape = phantom.node_points.shape
    force = finite_array(np.zeros(shape) if load is None else load, "load", shape)
    check_bodies(phantom, supports)
    check_choice(solver, Method, "solver")
    stiffness = InternalForce(phantom, material, "linear", kernels, ghost)
    clock = [perf_counter()]
    pattern = body_pattern(phantom, stiffness.couplings)
    inverse = StaticSolver(stiffness, pattern, supports.fixed, _ROUNDING, solver)
    clock.append(perf_counter())
    blocks = stiffness.stiffness(pattern)
    lifted = stiffness.evaluate(supports.values)[0] if supports.values.any() else 0.0
    right = np.where(supports.fixed, 0.0, force - lifted)
    stiffest = float(blocks.max())  # on the diagonal, as of every semidefinite matrix
    constrain(pattern, supports.fixed, blocks)
    clock.append(perf_counter())
    inverse.factorize(blocks)
    clock.append(perf_counter())
    displacement = inverse.solve(right) + supports.values
    clock.append(perf_counter())
    internal, energy = stiffness.evaluate(displacement)
    penalty = stiffness.penalty_energy(displacement)
    unbalanced = internal - force
    # in a rigid motion all forces are round-off of the products of which they are sums
    products = stiffest * np.abs(displacement).max()
    scale = max(np.abs(internal).max(), np.abs(force).max(), products, np.finfo(float).tiny)
    return StaticSolution(
        displacement=displacement,
        strain_energy=energy - penalty,
        reaction=np.where(supports.fixed, unbalanced, 0.0),
        residual=float(np.abs(unbalanced[~supports.fixed]).max(initial=0.0) / scale),
        timings=dict(zip(_PHASES, np.diff(clock).tolist(), strict=True)),
        penalty_energy=penalty,
        solver="direct" if "direct" in inverse.used else "iterative",
    )


class StaticSolver:
    """Iterations where they are quicker; a factorisation for a small body, or where they fail.

    Parameters
    ----------
    force : InternalForce
        Whose kernels are taken.
    pattern : BlockPattern
    fixed : (N, d) bool array
    tolerance : float
        Of the residual that iterations leave.
    method : {"auto", "direct", "iterative"}
        As for `solve_static`.

    Attributes
    ----------
    used : set of {"direct", "iterative"}
        Which solvers have solved systems so far.
    """

    def __init__(
        self,
        force: InternalForce,
        pattern: BlockPattern,
        fixed: Bools,
        tolerance: float,
        method: Method = "auto",
    ) -> None:
        kernels, block, phantom = force.kernels, fixed.shape[1], force.phantom
        held = fixed.all(axis=1)
        self._make_direct = partial(kernels.direct, pattern, block, held)
        nodes = phantom.node_count if phantom.mesh.dim == 3 and force.ghost is None else 0
        self._large: LinearSolver | None = None
        if method == "iterative":
            self._large = kernels.iterative(pattern, block, tolerance, _MOST)
        elif method == "auto" and kernels.large is not None and nodes >= LARGE_FROM:
            self._large = kernels.large(pattern, phantom.node_points, fixed, tolerance, _MOST)
        elif method == "auto" and nodes >= ITERATE_FROM:
            self._large = kernels.step(pattern, block, held, True, tolerance)
        self._insists = method == "iterative"
        self.used: set[str] = set()

    @cached_property
    def _direct(self) -> LinearSolver:
        return self._make_direct()

    def factorize(self, blocks: Floats) -> None:
        """Take the matrix with these nodal blocks; see `LinearSolver`."""
        self._blocks = blocks
        (self._large or self._direct).factorize(blocks)

    def solve(self, load: Floats) -> Floats:
        """Solve; by a factorisation where iterations that are optional do not converge."""
        if self._large is not None:
            try:
                found = self._large.solve(load)
                self.used.add("iterative" if self._large.is_iterative else "direct")
                return found
            except NotConvergedError:
                if self._insists:
                    raise
            self._direct.factorize(self._blocks)
        self.used.add("direct")
        return self._direct.solve(load)


ROUND_OFF = 256.0 * np.finfo(float).eps  # of positions, seen through the stiffness
UNSEEN = 1e-12  # of the energy: a fall that round-off hides
SHARES = (1.0, 0.5, 0.25, 0.125, 0.0)  # of the rotational tangent, until it is positive definite
_TOLERANCE = 1e-10  # of the residual, over the largest of load, reactions and internal force
_ITERATIONS = 60  # allowed per load step
_HALVINGS = 12  # of a correction
_ENOUGH = 1e-4  # of the fall of the energy that its slope promises (Armijo)
_INEXACT = 1e-6  # residual that conjugate gradients leave of a correction: Newton's method goes on


class NotInEquilibriumError(RuntimeError):
    """No equilibrium of a load step was found, or none that a second path agrees with."""


class Place(NamedTuple):
    """An iterate of Newton's method: displacement (N, d) in m, residual (N, d) in N, measures."""

    displacement: Floats
    residual: Floats
    norm: float  # of the residual, N
    scale: float  # to which the norm compares, N
    energy: float  # potential, J


class Newton:
    """Newton's method of one load step, with a line search on the potential energy.

    Parameters
    ----------
    force : InternalForce
    fixed : (N, d) bool array
    inexact : float
        Residual that conjugate gradients may leave of a correction.

    Attributes
    ----------
    force, fixed
        As given.
    """

    def __init__(self, force: InternalForce, fixed: Bools, inexact: float = _INEXACT) -> None:
        self.force, self.fixed = force, fixed
        self._pattern = body_pattern(force.phantom, force.couplings)
        space = fixed.shape[1]
        self._blocks = np.zeros((len(self._pattern.columns), space, space))
        self._internal = np.empty(fixed.shape)
        self._held = held_entries(self._pattern, fixed)
        self._solver = StaticSolver(force, self._pattern, fixed, inexact)
        self._inverted: Floats | None = None  # blocks that were factorised last

    @property
    def solvers(self) -> frozenset[str]:
        """Solvers of the linear systems so far: "direct", "iterative" or both."""
        return frozenset(self._solver.used)

    @property
    def largest_stiffness(self) -> float:
        """Largest entry of the tangent assembled last, in N/m; with supports if it was inverted."""
        return float(np.abs(self._blocks).max(initial=0.0))

    def solve(self, displacement: Floats, change: Floats, load: Floats) -> tuple[Floats, int]:
        """Find the equilibrium after a change of the fixed components, and count the solves.

        The first correction, for the load and the change, is taken whole. Of the others, a whole
        one by K_C counts if the residual falls; else the energy must fall.

        Parameters
        ----------
        displacement, change : (N, d) float array
            Where the load step starts; what the supports add, zero at free components. In metres.
        load : (N, d) float array
            At the end of the load step, in newtons.

        Raises
        ------
        NotInEquilibriumError
            If the iterations do not suffice, or no correction leads on.
        SingularStiffnessError
            If even the tangent with rotations held is not positive definite.
        """
        start = self.place(displacement, load)
        place = self.place(displacement + self._spread(start, change), load)
        count = 1
        while not self._is_small(place):
            if count == _ITERATIONS or not np.isfinite(place.norm):
                raise self._failure(place, f"after {count} iterations")
            place = self._next(place, load)
            count += 1
        return place.displacement, count

    def _failure(self, place: Place, where: str) -> NotInEquilibriumError:
        return NotInEquilibriumError(
            f"residual {place.norm:.3g} N against forces of {place.scale:.3g} N {where}; "
            f"expected {_TOLERANCE:g} of them. {self._why(place)}"
        )

    def _why(self, place: Place) -> str:
        """Explain why the iterations failed, where cells that have collapsed are the reason."""
        if self.force.law == "neo_hookean":
            inverted = inside_out(self.force, place.displacement)
            if inverted:
                return f"{inverted}. More load steps may help"
        collapsed = collapsed_cells(self.force, place.displacement)
        if len(collapsed) == 0:
            return "More load steps may help"
        return (
            f"{len(collapsed)} of {len(self.force.phantom.cells)} pieces have collapsed, the "
            f"first number {collapsed[0]}: the force is not continuous there (a strip is so thin "
            "at a stretch of 1 + 1/ν), so that there may be no equilibrium"
        )

    def place(self, displacement: Floats, load: Floats) -> Place:
        """Evaluate the equilibrium of a displacement (N, d) under a load (N, d)."""
        internal, energy = self.force.evaluate(displacement)
        scale = max(float(np.linalg.norm(internal)), float(np.linalg.norm(load)))
        potential = energy - float(np.vdot(load, displacement))
        residual = np.where(self.fixed, 0.0, load - internal)
        return Place(displacement, residual, float(np.linalg.norm(residual)), scale, potential)

    def _spread(self, start: Place, change: Floats) -> Floats:
        """Respond linearly to a prescribed change, and to the residual at the start."""
        try:
            return self._solve(start, change, 1.0)
        except SingularStiffnessError:
            return self._solve(start, change, 0.0)

    def _next(self, place: Place, load: Floats) -> Place:
        """Take a correction that lowers the residual, else part of one that lowers the energy."""
        leap = None
        for rotational in SHARES:
            try:
                correction = self._solve(place, None, rotational)
            except SingularStiffnessError:
                if rotational == 0.0:
                    raise
                continue
            if rotational == 1.0:
                trial = self.place(place.displacement + correction, load)
                if trial.norm < place.norm:
                    return trial
                leap = trial
            share = self._share_downhill(place, correction, load)
            if share > 0.0:
                return self.place(place.displacement + share * correction, load)
        if leap is None:
            raise self._failure(place, "where no correction lowers the potential energy")
        # no energy falls, as in round-off or beside a collapsed cell, whose force jumps: go on from
        # the whole correction by K_C, although its residual is larger
        return leap

    def _share_downhill(self, place: Place, correction: Floats, load: Floats) -> float:
        """Share of a correction that lowers the potential energy as its slope says; 0 if none."""
        fall = float(np.vdot(place.residual, correction))
        for halving in range(_HALVINGS):
            share = 0.5**halving
            trial = self.place(place.displacement + share * correction, load)
            # below the round-off of the energy
            unseen = share * fall < UNSEEN * abs(place.energy)
            falls = trial.energy <= place.energy - _ENOUGH * share * fall
            if falls or (unseen and trial.norm < place.norm):
                return share
        return 0.0

    def _is_small(self, place: Place) -> bool:
        """Tell whether a residual is within tolerance, or what round-off of positions leaves."""
        reach = np.abs(self.force.phantom.node_points + place.displacement).max()
        round_off = ROUND_OFF * self.largest_stiffness * reach
        return place.norm <= max(_TOLERANCE * place.scale, round_off)

    def _solve(
        self, place: Place, change: Floats | None, rotational: float, least: float = 0.0
    ) -> Floats:
        """Correct for the residual r, and for a change c of the fixed components.

        The free components of K_ρ (δ + c) are r. The free components of c and the fixed ones of δ
        are zero.
        """
        matrix = self.linearise(place.displacement, rotational, least)
        load = place.residual.copy()  # the product comes before `inverse`, which spoils the matrix
        if change is not None:
            load -= (matrix @ change.ravel()).reshape(change.shape)
            load[self.fixed] = 0.0
        correction = self.inverse().solve(load)
        return correction if change is None else correction + change

    def linearise(self, displacement: Floats, rotational: float, least: float = 0.0) -> bsr_array:
        """Assemble the tangent K_ρ (N d, N d) at a displacement, without supports.

        It is in the memory of this object: until the next call, or until `inverse` constrains it.

        Parameters
        ----------
        displacement : (N, d) float array
        rotational : float
            Share of what the consistent tangent has beyond the rotation-fixed one.
        least : float
            Without the rotational part membranes have their geometric stiffness, of a tension that
            is this at least, over μ.
        """
        force, pattern, blocks, at = self.force, self._pattern, self._blocks, displacement
        force.linearise(pattern, at, at, 0.0, 1.0, self._internal, blocks, rotational=rotational)
        if rotational == 0.0 and force.is_membrane:
            found = force.configuration(displacement)
            force.add_stiffness(found, pattern, blocks, 1.0, "tension", least)
        return pattern.matrix(blocks)

    def inverse(self) -> StaticSolver:
        """Factorise the tangent that was assembled last, with the supports.

        Raises
        ------
        SingularStiffnessError
            If the tangent is found not to be positive definite, here or when it solves.
        """
        constrain(self._pattern, self.fixed, self._blocks, self._held)
        # of a linear body the same again tells whether it is stable
        if self._inverted is None or not np.array_equal(self._inverted, self._blocks):
            self._inverted = None
            self._solver.factorize(self._blocks)
            self._inverted = self._blocks.copy()
        return self._solver


def collapsed_cells(force: InternalForce, displacement: Floats, ratio: float = 1e-3) -> Ints:
    """Find pieces (k,) whose rotation, and with it the force, is not unique, or nearly so.

    In a plane cell the two principal stretches cancel (of an inverted cell the smallest is
    negative). In space the two smallest cancel. A membrane has shrunk to a line.

    Parameters
    ----------
    force : InternalForce
    displacement : (N, d) float array
    ratio : float
        A cell counts if the sum of the two is less than this share of the largest stretch.
    """
    F = force.deformation(displacement)
    stretches = np.linalg.svd(F, compute_uv=False)
    left = stretches[:, 1]
    if not force.is_membrane:
        left = np.abs(stretches[:, -2] + np.sign(np.linalg.det(F)) * stretches[:, -1])
    return np.flatnonzero(left <= ratio * stretches[:, 0])
