"""Statics at finite rotation and strain: PETSc's Newton on the energy, in load steps that adapt."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from reference.boundary_conditions import RigidMotions
from reference.contact import TurningContact, pressures
from reference.deformation import MembraneStretch
from reference.inside_out import Orientation, OrientationCheck, place_text
from reference.law import ENERGIES, Law, quadrature
from reference.linear_solvers import (
    Cycle,
    answers_of,
    mean_stiffness,
    modes_not_positive,
    options,
    solve_directly,
)
from reference.space import ConformingSpace, LinearElements
from verify.scene import Material
from verify.solution import ContactPressure

Array = NDArray[np.float64]
_TOLERANCE = 1e-11  # of the force scale ‖K u‖: a Newton iteration that converges passes below it
_UNBALANCED = 0.25  # of the energy, between it and the trapezoidal rule for the work
# of stiffness times size squared, J; of stiffness times displacement, N: forces of a rigid motion,
# whose own scale ‖K u‖ is nothing else
_ROUND_OFF = 1e-14
_GOOD_ENOUGH = 1e-8  # of the force scale, where round-off does not let the residual fall further
_STAGNANT = 0.5  # of the residual of the iteration before, at round-off
_LASTING = 1e-2  # of the residual of the iteration before: its tangent serves once more
_DIVERGED = 1e4  # of the first residual or of the force scale
_MOST_ITERATIONS = 25
_MOST_TOUCHES, _SLOWLY = 60, 0.1  # of contact; residual over the last one, of an old factorisation
# unknowns in space up to which the tangent is factorised; more are solved by multigrid
_MOST_DIRECT = 40_000
# A flat membrane without tension has no stiffness across itself, so that its tangent is singular.
# Tangents, not forces, get a tension of so much μ more, falling with Newton's iterations.
_TENSION = (1.0, 0.1)
_LINEAR = 1e-6  # of the residual: what a linear solve by multigrid leaves
_SMALLEST_STEP = 1e-4
# of a path; one in smaller steps has met what no mesh resolves
_MOST = {"accepted steps": 100, "refused steps": 50, "Newton iterations": 1000}
_SHORT = 1 / 64  # step that is not halved because energy is lost: something has snapped through
_FINER = 2.7  # steps of a second path: another, but no multiple of the first
_NEAR = 0.25  # of the displacement: so close to linear elements it is the same equilibrium
_SAME = 1e-6  # of the energy, between two paths


class StrainEquations:
    """Residual and tangent of a strain energy, with the constrained rows taken out.

    Parameters
    ----------
    law : Law
    space : ConformingSpace
    held : (k,) int array
        Constrained nodal displacements.
    load : (n · d,) array or None
        Nodal forces of the dead loads, N.
    most_inverted : float
        Share of the body that may be inside out at singular places.
    closed : bool
        Whether faces of cuts press on each other.

    Attributes
    ----------
    solution : dolfinx.fem.Function
    pressure : (m,) array
        Of the `faces` in contact, Pa.
    orientation : OrientationCheck
        Of the solution.
    method : str
        Solvers of the nonlinear and of the linear systems.
    iterations : int
        Newton's so far.
    """

    def __init__(
        self,
        law: Law,
        space: ConformingSpace,
        held: NDArray[np.int32],
        load: Array | None,
        most_inverted: float,
        closed: bool = False,
    ) -> None:
        from dolfinx import fem
        from dolfinx.fem import petsc

        self._law, self._space, self.iterations = law, space, 0
        self.method = "PETSc SNES, MUMPS Cholesky"
        self._most_inverted = most_inverted
        self._unknowns, self.solution = law.unknowns, law.solution
        self._own, self._at = self._unknowns.own_unknowns(held)
        self._held = self._unknowns.indices(self._own)
        self._factor, self._is_membrane = 0.0, isinstance(law.state, MembraneStretch)
        self._motions = RigidMotions(space, held)
        self.orientation = OrientationCheck(space, held, law.state.J, quadrature_points(space))
        self._tension: Any = None
        if not self._is_membrane:
            self._tangent = law.stiffness_form
        else:
            self._tension = fem.Constant(space.function_space.mesh, 1.0)
            across = law.state.across(law.trial, law.test) * law.state.measure
            self._tangent = fem.form(law.stiffness + self._tension * law.mu * across)
        self._matrix: Any = petsc.create_matrix(self._tangent)
        self._vector = self.solution.x.petsc_vec.duplicate()
        self._increment, self._load = self._vector.duplicate(), self._vector.duplicate()
        self._load.array[:] = 0.0 if load is None else self._unknowns.own_part(load)
        self._turned: Any = None  # tangent of a body with faces in contact
        self._pushed = np.zeros(len(self._load.array))  # forces of the faces on this rank, N
        self.faces = TurningContact(space, held) if closed else None
        self.pressure = np.zeros(0 if self.faces is None else len(self.faces.weights))
        self._force = self._diagonal = 0.0
        self._first_residual = self._residual_before = self._contraction = np.inf
        self._cycle: Cycle | None = None
        self._solver = self._newton()
        self._unproven = self._solver.getKSP().getType() == "preonly"

    def advance(self, target: float, values: Array, is_short: bool = False) -> str:
        """Go to another load factor; say why not, or nothing.

        A state counts if its gain of energy is the work of reactions and loads, by the trapezoidal
        rule up to a quarter. A body that snaps through in a short step may store less, and so may
        one under dead loads.

        Parameters
        ----------
        target : float
        values : (k,) array
            Of the constrained unknowns there, m.
        is_short : bool
            Whether the step will not be halved for energy that is lost.

        Raises
        ------
        IllConditionedError
            If the first tangent was factorised, and its solution is lost in round-off.
        """
        x = self.solution.x.petsc_vec
        stored = self.energy()
        self._follow(values)
        moved, before = x.array.copy(), self._internal_force()
        rests = bool(np.abs(values[self._at] - moved[self._own]).max(initial=0.0) == 0.0)
        rests = bool(x.comm.tompi4py().allreduce(int(rests)) == x.comm.size)
        self._factor = target
        self._predict(values[self._at])
        if lost := self._solved() if self.faces is None else self._pressed(self.faces):
            return lost
        if lost := self.orientation.fault(self._most_inverted):
            return lost
        return self._imbalance(stored, before, moved, is_short or rests)

    def _solved(self) -> str:
        """Iterate by PETSc, or say why that failed."""
        solver, x = self._solver, self.solution.x.petsc_vec
        solver.solve(None, x)
        self._take(x)
        self.iterations += solver.getIterationNumber()
        reason = solver.getConvergedReason()
        if reason <= 0 and not solver.getFunctionNorm() <= self._round_off():
            from petsc4py import PETSc

            names = vars(PETSc.SNES.ConvergedReason)
            words = [n for n, value in names.items() if value == reason and n.isupper()]
            return f"SNES {words[0].lower() if words else reason}"
        return ""

    def _pressed(self, faces: TurningContact) -> str:
        """Iterate for displacements and pressures of faces together, or say why that failed.

        Changes of pressures are seen through the compliance of the last factorisation, which serves
        while the residual contracts.
        """
        x, step, left = self.solution.x.petsc_vec, self._increment, self._vector
        linear, last, compliance = self._solver.getKSP(), np.inf, None
        forces, solve = answers_of(linear, self._unknowns, self._own)
        before = x.array.copy()
        for _ in range(_MOST_TOUCHES):
            u = self.displacement().ravel()
            slopes = faces.slopes(u, u)
            self._pushed = forces(slopes.T @ self.pressure)
            self._assemble_residual(None, x, left)
            size = left.norm()
            if not size <= _DIVERGED * self._force:  # or none: inside out
                x.array[:] = 0.5 * (x.array + before)
                self._take(x)
                continue
            before = x.array.copy()
            if compliance is None:
                for turning in (True, False):  # a body that faces alone keep stable
                    linear.setOperators(self._held_tangent(turning))
                    compliance = faces.compliance(solve, slopes)
                    if _is_definite(compliance):
                        break
                else:
                    return "the tangent is not positive definite where faces touch"
            left.scale(-1.0)
            linear.solve(left, step)
            new = self._pressing(faces, compliance, u, step)
            left.array[:] = forces(slopes.T @ (new - self.pressure))
            size += left.norm()
            scale = max(self._force, float(np.linalg.norm(slopes.T @ new)))
            if size <= _TOLERANCE * scale:
                return ""
            if size > _STAGNANT * last and size <= max(_GOOD_ENOUGH * scale, self._round_off()):
                return ""
            x.axpy(1.0, step)
            linear.solve(left, step)
            x.axpy(1.0, step)
            self._take(x)
            self.pressure, self.iterations = new, self.iterations + 1
            if size > _SLOWLY * last:
                compliance = None
            last = size
        return f"contact not found: {size:.3g} N are left of forces of {self._force:.3g} N"

    def _pressing(self, faces: TurningContact, compliance: Array, u: Array, step: Any) -> Array:
        """Find the pressures (m,) that keep faces closed or apart after a step (a Vec) from u."""
        gaps = faces.opened(u + self._unknowns.everywhere(step.array).ravel())
        return pressures(compliance, gaps - compliance @ self.pressure)[0]

    def begin(self, displacement: Array, values: Array) -> str:
        """Find the equilibrium at load factor 1 near a displacement (n, d), or say why not."""
        x = self.solution.x.petsc_vec
        x.array[:] = self._unknowns.own_part(displacement)
        self._take(x)
        reactions, comm = self._internal_force()[self._own], x.comm.tompi4py()
        size = comm.allreduce(float(reactions @ reactions))
        self._force = float(np.sqrt(size)) + float(self._load.norm())
        self._factor = 1.0
        return self.advance(1.0, values)

    def _judge(self, _snes: Any, iteration: int, norms: tuple[float, float, float]) -> Any:
        """Give PETSc's reason to end the iterations: balance up to round-off, or divergence."""
        from petsc4py import PETSc

        reasons, residual, before = PETSc.SNES.ConvergedReason, norms[2], self._residual_before
        self._residual_before = residual
        if iteration == 0:
            self._first_residual, before = residual, np.inf
        self._contraction = residual / before if iteration else np.inf
        if residual <= _TOLERANCE * self._force:
            return reasons.CONVERGED_FNORM_ABS
        if residual > _STAGNANT * before and residual <= self._round_off():
            return reasons.CONVERGED_FNORM_ABS
        if residual > _DIVERGED * max(self._first_residual, self._force):
            return reasons.DIVERGED_DTOL
        return reasons.ITERATING

    def _round_off(self) -> float:
        """Compute the residual, in N, that may be left where round-off does not let it fall."""
        lost = _ROUND_OFF * abs(self._diagonal) * float(np.linalg.norm(self.displacement()))
        return max(_GOOD_ENOUGH * self._force, lost)

    def _imbalance(self, stored: float, before: Array, moved: Array, may_lose: bool) -> str:
        """Say that the energy is not what was stored and the work since a state; or nothing."""
        x = self.solution.x.petsc_vec
        forces = before + self._internal_force()
        forces[self._unknowns.pressures] = 0.0
        work = 0.5 * float(x.comm.tompi4py().allreduce(float(forces @ (x.array - moved))))
        energy = self.energy()
        excess = energy - stored - work
        size = float(np.ptp(self._space.node_points, axis=0).max())
        allowed = _UNBALANCED * max(energy, stored) + _ROUND_OFF * abs(self._diagonal) * size**2
        if excess > allowed or (excess < -allowed and not may_lose):
            return f"{energy:.4g} J stored, {energy - excess:.4g} J accounted for"
        return ""

    def _internal_force(self) -> Array:
        """Assemble the forces of the strain energy on the unknowns of this rank, N."""
        self._assemble_forces(self._vector)
        return np.array(self._vector.array, dtype=float)

    def negative_modes(self) -> int | None:
        """Count modes in which the energy does not grow; None if that is not known.

        By the inertia of a factorisation (Sylvester); one negative pivot for each pressure is the
        saddle's own. Membranes may be slack, and large tangents are not factorised.
        """
        linear = self._solver.getKSP()
        if self._is_membrane or linear.getType() != "preonly":
            return None
        matrix, comm = self._held_tangent(), self._space.function_space.mesh.comm
        return modes_not_positive(matrix) - int(comm.allreduce(len(self._unknowns.pressures)))

    def _held_tangent(self, turning: bool = True) -> Any:
        """Assemble the tangent with the supports, and what faces under pressure turn by."""
        self._assemble(self._matrix)
        matrix = self._matrix
        if turning and self.faces is not None:
            second = self.faces.turning(self.displacement().ravel(), self.pressure)
            self._turned, before = matrix.copy(), self._turned
            added = self._unknowns.distributed(second)
            self._turned.axpy(-1.0, added)
            for entry in (added, before):
                if entry is not None:
                    entry.destroy()
            matrix = self._turned
        matrix.zeroRowsColumns(self._held, self._diagonal)
        return matrix

    def displacement(self) -> Array:
        """Compute nodal displacements (n, d) on every rank, m."""
        return self._unknowns.everywhere(np.asarray(self.solution.x.array, dtype=float))

    def energy(self) -> float:
        """Return the stored energy, J (in the plane per metre)."""
        return self._law.stored()

    def destroy(self) -> None:
        """Free what PETSc holds."""
        for entry in (self._solver, self._matrix, self._vector, self._increment, self._load,
                      self._held, self._cycle, self._turned):  # fmt: skip
            if entry is not None:
                entry.destroy()

    def _assemble_residual(self, _snes: Any, x: Any, out: Any) -> None:
        self._take(x)
        self._assemble_forces(out)
        out.axpy(-self._factor, self._load)
        out.array[:] -= self._pushed
        out.array[self._own] = 0.0

    def _assemble_tangent(self, snes: Any, x: Any, matrix: Any, _preconditioner: Any) -> None:
        if self._tension is None and self._contraction < _LASTING:
            return
        self._take(x)
        self._assemble(matrix, snes.getIterationNumber())
        matrix.zeroRowsColumns(self._held, self._diagonal)
        self._renew_cycle()

    def _renew_cycle(self) -> None:
        """Let the multigrid cycle, if there is one, follow the tangent; make it of the first."""
        linear = self._solver.getKSP()
        if linear.getType() == "preonly":
            return
        if self._cycle is None:
            self._cycle = Cycle(self._matrix, self._space, definite=False)
            self._cycle.set(linear)
            self.method = f"PETSc SNES, GMRES with {self._cycle.name}"
        else:
            self._cycle.update(self._matrix)

    def _follow(self, values: Array) -> None:
        """Let pieces turn with their supports; the rest is left to the linear response."""
        displacement = self.displacement()
        moved = self._motions.follow(displacement, values)
        if moved is None:
            return
        x, increment, vector = self.solution.x.petsc_vec, self._increment, self._vector
        self._take(x)
        self._assemble(self._matrix)
        increment.array[:] = self._unknowns.own_part(moved - displacement)
        # forces of the linear response to the turn: a rigid one has none by which to judge others
        self._matrix.mult(increment, vector)
        self._force = max(self._force, float(vector.norm()))
        x.axpy(1.0, increment)
        self._take(x)

    def _predict(self, values: Array) -> None:
        """Add the linear response to the increments of the prescribed values and of the load."""
        x, increment, vector = self.solution.x.petsc_vec, self._increment, self._vector
        self._take(x)
        self._assemble(self._matrix)
        if not self._diagonal:
            self._diagonal = mean_stiffness(self._matrix)
        if (faces := self.faces) is not None:
            u = self.displacement().ravel()
            slopes = faces.slopes(u, u)
            forces, solve = answers_of(self._solver.getKSP(), self._unknowns, self._own)
            self._pushed = forces(slopes.T @ self.pressure)
        self._assemble_forces(vector)
        vector.scale(-1.0)
        vector.axpy(self._factor, self._load)
        vector.array[:] += self._pushed
        increment.set(0.0)
        increment.array[self._own] = values - x.array[self._own]
        loads = np.delete(vector.array, self._own)
        reactions = self._matrix.createSubMatrix(self._held)
        self._matrix.zeroRowsColumns(self._held, self._diagonal, increment, vector)
        linear = self._solver.getKSP()
        linear.setOperators(self._matrix)
        self._renew_cycle()
        if self._unproven:  # at rest: a body held too weakly shows as in linear statics
            solve_directly(linear, self._matrix, increment, vector)
            self._unproven = False
        else:
            linear.solve(vector, increment)
        if faces is not None and _is_definite(compliance := faces.compliance(solve, slopes)):
            new = self._pressing(faces, compliance, u, increment)
            pushed = solve((slopes.T @ (new - self.pressure))[:, None])
            increment.array[:] += self._unknowns.own_part(pushed.ravel())
            self.pressure = new
        # of the product of the tangent as it was with the increment
        at_supports = reactions.createVecLeft()
        reactions.mult(increment, at_supports)
        comm = x.comm.tompi4py()
        size = float(np.hypot(np.sqrt(comm.allreduce(float(loads @ loads))), at_supports.norm()))
        self._force = max(self._force, size, 1e-300)
        for entry in (reactions, at_supports):
            entry.destroy()
        x.axpy(1.0, increment)
        x.array[self._own] = values
        self._take(x)

    def _take(self, x: Any) -> None:
        mine = self.solution.x.petsc_vec
        if x.handle != mine.handle:
            x.copy(mine)
        self._law.update()

    def _assemble_forces(self, out: Any) -> None:
        """Assemble the forces of the strain energy on all unknowns."""
        from dolfinx.fem import petsc

        with out.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(out, self._law.work_form)
        out.ghostUpdate(addv=True, mode="reverse")

    def _assemble(self, matrix: Any, iteration: int = 0) -> None:
        from dolfinx.fem import petsc

        if self._tension is not None:
            first, fall = _TENSION
            self._tension.value = first * fall**iteration
        matrix.zeroEntries()
        petsc.assemble_matrix(matrix, self._tangent)
        matrix.assemble()

    def _newton(self) -> Any:
        from petsc4py import PETSc

        space, matrix = self._space, self._matrix
        solver = PETSc.SNES().create(matrix.comm)
        solver.setType("newtonls")
        # Turned by the linear response, a slender part is stretched by the square of the angle: the
        # residual rises by orders of magnitude before it falls, and a slack membrane is overshot.
        # By options: petsc4py knows the line search itself since 3.23 only.
        with options(solver, "whole_steps_", {"snes_linesearch_type": "basic"}):
            solver.setOptionsPrefix("")
        solver.setTolerances(max_it=_MOST_ITERATIONS)
        solver.setConvergenceTest(self._judge)
        solver.setFunction(self._assemble_residual, self._vector.duplicate())
        solver.setJacobian(self._assemble_tangent, matrix)
        linear = solver.getKSP()
        # symmetric, but a tangent at finite rotation need not be definite
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        few = space.mesh.cell_dimension == 2 or space.node_points.size <= _MOST_DIRECT
        alone = self._law.state.p is None and self.faces is None
        if few or not alone:  # multigrid is for displacements alone
            linear.setType("preonly")
            linear.getPC().setType("cholesky")
            linear.getPC().setFactorSolverType("mumps")
            return solver
        linear.setType("gmres")
        linear.setGMRESRestart(100)
        linear.setTolerances(rtol=_LINEAR, atol=0.0, max_it=400)
        return solver


def _is_definite(compliance: Array) -> bool:
    return bool(np.linalg.eigvalsh(compliance).min(initial=1.0) > 0.0)


def quadrature_points(space: ConformingSpace) -> Array:
    """Find points (q, d) of the reference cell at which energies of `space` are integrated."""
    import basix

    plane = space.mesh.cell_dimension == 2
    cell = basix.CellType.triangle if plane else basix.CellType.tetrahedron
    return np.asarray(basix.make_quadrature(cell, quadrature(space))[0], dtype=float)


@dataclass(frozen=True)
class LargeStrainSolve:
    """A converged equilibrium.

    Attributes
    ----------
    displacement : (n, d) array
        At the nodes of the space, m; the same on every rank.
    strain_energy : float
        J; in the plane per metre of thickness.
    orientation : Orientation
        Least det F and where it is not positive: with the corotated energy, with a pressure or not,
        in at most 1e-3 of the body around singular places; nowhere with the others.
    method : str
        Solvers of the nonlinear and of the linear systems.
    iterations : int
        Newton iterations in all steps together.
    steps : int
        Load steps taken.
    refused_steps : list of str
        Why steps were taken again with half their size.
    negative_modes : int or None
        Modes of the tangent in which the energy does not grow; None for membranes and for tangents
        that are too large to be factorised.
    paths : int
        Paths that were followed: two if the first ended in a state that is not stable.
    dismissed : float or None
        Strain energy of the other path's end in J if it was another one.
    timings : dict of str to float
        Seconds.
    nested : bool
        Whether linear elements on the same mesh took the load steps.
    contact : ContactPressure or None
        Of faces that press on each other.
    """

    displacement: Array
    strain_energy: float
    orientation: Orientation
    method: str
    iterations: int
    steps: int
    refused_steps: list[str]
    negative_modes: int | None
    timings: dict[str, float]
    paths: int = 1
    dismissed: float | None = None
    nested: bool = False
    contact: ContactPressure | None = None


def solve_large_strain(
    material: Material,
    space: ConformingSpace,
    unknowns: NDArray[np.int32],
    prescribed: Callable[[float], Array],
    load: Array | None = None,
    energy: str = "corotated",
    pressure: bool = False,
    first_step: float = 0.25,
    closed: bool = False,
) -> LargeStrainSolve:
    """Find the equilibrium at load factor 1, from rest at load factor 0.

    In each step every piece follows the rigid motion of its supports first, then the linear
    response to the rest; PETSc's Newton with line search follows. A step is halved if it does not
    converge, inverts too much, or stores more energy than supports and loads supplied. An end whose
    tangent is not positive definite is sought again in smaller steps. The stable one of two ends
    counts. An unstable one counts only where inverted cells leave the energy without a tangent and
    both paths end there.

    Parameters
    ----------
    material : Material
    space : ConformingSpace
    unknowns : (k,) int array
        Constrained scalar unknowns.
    prescribed : callable
        Their values (k,) in m at a load factor in [0, 1].
    load : (n · d,) array, optional
        Nodal forces of the dead loads, N; scaled by the load factor.
    energy : str
        A name in `reference.law.ENERGIES`.
    pressure : bool
        Whether the pressure is an unknown, of quadratic elements, for nearly incompressible
        material.
    first_step : float
        First increment of the load factor.
    closed : bool
        Whether faces of cuts press on each other.

    Raises
    ------
    IllConditionedError
        If the body is held so weakly somewhere that the tangent at rest is lost in round-off.
    RuntimeError
        If steps below 1e-4, or the last of 100, do not converge; with the load factor reached and
        PETSc's reason. If neither of two paths ends in a stable state; with both energies.
    """
    problem = _Problem(material, space, unknowns, prescribed, load, energy, pressure, closed)
    if (nested := _nested(problem, first_step)) is not None:
        return nested
    one = problem.path(first_step)
    if not one.negative_modes:
        return one
    two = problem.path(first_step / _FINER)
    timings = {"solve": one.timings["solve"] + two.timings["solve"]}
    found = f"{one.strain_energy:.6g} J and {two.strain_energy:.6g} J"
    least = min(one.strain_energy, two.strain_energy)
    if abs(one.strain_energy - two.strain_energy) <= _SAME * abs(least):
        # where cells are inside out the energy has kinks, and a tangent says little
        if two.negative_modes and not two.orientation.share:
            raise RuntimeError(
                f"two paths end in an unstable equilibrium, of {found} with {two.negative_modes} "
                "modes in which the energy falls; a stable one is expected. Supports or loads that "
                "break a symmetry may lead there"
            )
        return replace(two, paths=2, timings=timings)
    if two.negative_modes:
        raise RuntimeError(
            f"two paths end in equilibria of {found}; both are unstable ({one.negative_modes} and "
            f"{two.negative_modes} modes in which the energy falls)"
        )
    return replace(two, paths=2, timings=timings, dismissed=one.strain_energy)


@dataclass(frozen=True)
class _Problem:
    """What `solve_large_strain` is asked."""

    material: Material
    space: ConformingSpace
    held: NDArray[np.int32]
    prescribed: Callable[[float], Array]
    load: Array | None
    energy: str
    pressure: bool
    closed: bool

    def equations(self) -> StrainEquations:
        law = Law(self.material, self.space, self.energy, self.pressure)
        most_inverted = ENERGIES[self.energy].inverted
        return StrainEquations(law, self.space, self.held, self.load, most_inverted, self.closed)

    def path(self, first_step: float) -> LargeStrainSolve:
        start = perf_counter()
        found = _follow(self.equations(), self.prescribed, first_step)
        return replace(found, timings={"solve": perf_counter() - start})

    def of_linear_elements(self, linear: LinearElements) -> "_Problem":
        held, which = linear.held(self.held)
        load = None if self.load is None else linear.forces(self.load)
        return replace(
            self, space=linear.space, held=held, load=load,
            prescribed=lambda factor: self.prescribed(factor)[which],
        )  # fmt: skip


def _nested(problem: _Problem, first_step: float) -> LargeStrainSolve | None:
    """Follow the path by linear elements on the same mesh, and begin at their end.

    A quadratic tangent costs some thirty times as much. None of membranes and mixed elements; and
    if the linear elements find no stable end, or the quadratic ones none close to it.
    """
    space, start = problem.space, perf_counter()
    if space.degree == 1 or problem.pressure or space.mesh.cell_dimension < space.dimension:
        return None
    linear = LinearElements(space)
    try:
        coarse = problem.of_linear_elements(linear).path(first_step)
        if coarse.negative_modes:
            return None
        equations = problem.equations()
        begin = linear.refined(coarse.displacement)
        if (touched := coarse.contact) is not None and equations.faces is not None:
            nearest = cKDTree(touched.points).query(equations.faces.points)[1]
            equations.pressure = touched.pressure[0, nearest]
        refused = equations.begin(begin, problem.prescribed(1.0))
    except RuntimeError:  # as the path of the quadratic elements will report
        return None
    found = _state(equations, coarse.steps, coarse.refused_steps)
    moved = np.linalg.norm(found.displacement - begin)
    if refused or found.negative_modes or moved > _NEAR * np.linalg.norm(found.displacement):
        return None
    return replace(found, nested=True, timings={"solve": perf_counter() - start})


def _state(equations: StrainEquations, steps: int, refused: list[str]) -> LargeStrainSolve:
    """Give the end of a path, and free the equations."""
    faces, contact = equations.faces, None
    if faces is not None:
        contact = ContactPressure(faces.points, faces.weights, equations.pressure[None])
    found = LargeStrainSolve(
        equations.displacement(),
        equations.energy(),
        equations.orientation(),
        equations.method,
        equations.iterations,
        steps,
        refused,
        equations.negative_modes(),
        {},
        contact=contact,
    )
    equations.destroy()
    return found


def _follow(
    equations: StrainEquations, prescribed: Callable[[float], Array], first_step: float
) -> LargeStrainSolve:
    """Go from load factor 0 to 1 in steps that adapt."""
    factor, step, steps = 0.0, first_step, 0
    refused: list[str] = []
    x = equations.solution.x.petsc_vec
    while factor < 1.0:
        target = min(1.0, factor + step)
        if target > 1.0 - 1e-9:
            target = 1.0
        before, pressed = x.array.copy(), equations.pressure
        reason = equations.advance(target, prescribed(target), step <= _SHORT)
        if not reason:
            factor, steps, step = target, steps + 1, 1.5 * step
            continue
        x.array[:], equations.pressure = before, pressed
        equations.solution.x.scatter_forward()
        refused.append(f"at {target:.4g}: {reason}")
        step *= 0.5
        counts = (steps, len(refused), equations.iterations)
        spent = any(count >= most for count, most in zip(counts, _MOST.values(), strict=True))
        if spent or step < _SMALLEST_STEP:
            state = equations.orientation()
            of = ", ".join(
                f"{n} of {m} {w}" for n, (w, m) in zip(counts, _MOST.items(), strict=True)
            )
            raise RuntimeError(
                f"no equilibrium beyond load factor {factor:.4g}: {refused[-1]}. "
                f"{'A limit of the path is reached' if spent else 'Steps get no smaller'}: {of}. "
                f"Before that, det F is {state.least:.3g} or more, least at "
                f"{place_text(state.place)}"
            )
    return _state(equations, steps, refused)
