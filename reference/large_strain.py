"""Statics at finite rotation and strain: SNES on the energy, with load steps that adapt."""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from reference.elasticity import lame
from reference.space import ConformingSpace
from reference.strain_energies import ENERGIES
from verify.scene import Material

__all__ = ["LargeStrainSolve", "solve_large_strain"]

Array = NDArray[np.float64]
_TOLERANCE = 1e-11  # of the force scale ‖K u‖: a Newton iteration that converges passes below it
_GOOD_ENOUGH = 1e-8  # of it, where round-off does not let the residual fall further
_SMALLEST_STEP = 1e-4
_MOST_ITERATIONS = 25
# share of the body that may be inside out: the corotated energy has no barrier, and at a tip or a
# clamped corner its strains are unbounded, so that a well graded mesh always has such cells there
_INVERTED = {"corotated": 1e-3, "neo_hookean": 0.0}


@dataclass(frozen=True)
class LargeStrainSolve:
    """A converged equilibrium.

    Attributes
    ----------
    displacement : (n, 2) array
        At the nodes of the space, m.
    strain_energy : float
        J per metre of thickness.
    smallest_jacobian : float
        Least det F at the quadrature points.
    inverted : float
        Share of the body's area where det F is not positive: at most 1e-3 with the corotated
        energy, none with the neo-Hookean one.
    iterations : int
        Newton iterations in all steps together.
    steps : int
        Load steps taken.
    refused_steps : list of str
        Why steps were taken again with half their size.
    timings : dict of str to float
        Seconds.
    """

    displacement: Array
    strain_energy: float
    smallest_jacobian: float
    inverted: float
    iterations: int
    steps: int
    refused_steps: list[str]
    timings: dict[str, float]


def solve_large_strain(
    material: Material,
    space: ConformingSpace,
    unknowns: NDArray[np.int32],
    prescribed: Callable[[float], Array],
    load: Any = None,
    energy: Literal["corotated", "neo_hookean"] = "corotated",
    first_step: float = 0.25,
) -> LargeStrainSolve:
    """Find the equilibrium at load factor 1, from rest at load factor 0.

    Each step starts with the linear response to its increment; then PETSc's Newton with line
    search. A step that does not converge, or turns too much inside out, is halved.

    Parameters
    ----------
    material : Material
    space : ConformingSpace
    unknowns : (k,) int array
        Constrained scalar unknowns.
    prescribed : callable
        Their values (k,) in m at a load factor in [0, 1].
    load : callable, optional
        Gives the linear form of the dead loads for a test function; scaled by the load factor.
    energy : {"corotated", "neo_hookean"}
        Density: μ‖U−I‖² + ½λ tr²(U−I), or compressible neo-Hookean (plane strain).
    first_step : float
        First increment of the load factor.

    Raises
    ------
    RuntimeError
        If steps below 1e-4 do not converge; with the load factor reached and PETSc's reason.
    """
    start = perf_counter()
    equations = _Equations(material, space, unknowns, load, ENERGIES[energy], _INVERTED[energy])
    solver = _newton(equations)
    factor, step, steps = 0.0, first_step, 0
    refused: list[str] = []
    x = equations.solution.x.petsc_vec
    while factor < 1.0:
        target = min(1.0, factor + step)
        if target > 1.0 - 1e-9:
            target = 1.0
        before = x.array.copy()
        reason = equations.advance(solver, target, prescribed(target))
        if not reason:
            factor, steps, step = target, steps + 1, 1.5 * step
            continue
        x.array[:] = before
        refused.append(f"at {target:.4g}: {reason}")
        step *= 0.5
        if step < _SMALLEST_STEP:
            raise RuntimeError(f"no equilibrium beyond load factor {factor:.4g}: {refused[-1]}")
    result = LargeStrainSolve(
        np.array(x.array, dtype=float).reshape(-1, 2),
        equations.energy(),
        *equations.jacobian(),
        equations.iterations,
        steps,
        refused,
        {"solve": perf_counter() - start},
    )
    solver.destroy()
    equations.destroy()
    return result


class _Equations:
    """Residual and tangent of the energy, with the constrained rows taken out."""

    def __init__(
        self,
        material: Material,
        space: ConformingSpace,
        unknowns: NDArray[np.int32],
        load: Any,
        density: Any,
        most_inverted: float,
    ) -> None:
        import ufl
        from dolfinx import fem
        from dolfinx.fem import petsc

        V = space.function_space
        self.unknowns, self.iterations, self._most_inverted = unknowns, 0, most_inverted
        self.solution = fem.Function(V)
        self.factor = fem.Constant(V.mesh, 0.0)
        lam, mu = (fem.Constant(V.mesh, value) for value in lame(material))
        dx = ufl.Measure("dx", domain=V.mesh, metadata={"quadrature_degree": 4 * space.degree - 2})
        F = ufl.Identity(2) + ufl.grad(self.solution)
        total = density(F, lam, mu) * dx
        v = ufl.TestFunction(V)
        residual = ufl.derivative(total, self.solution, v)
        if load is not None:
            residual -= self.factor * load(v)
        tangent = ufl.derivative(residual, self.solution, ufl.TrialFunction(V))
        self._energy, self._residual = fem.form(total), fem.form(residual)
        self._tangent = fem.form(tangent)
        self.matrix: Any = petsc.create_matrix(self._tangent)
        self.vector = self.solution.x.petsc_vec.duplicate()
        self._increment = self.vector.duplicate()
        self.force = 0.0
        points = self._quadrature_points(space.degree)
        self._jacobian = fem.Expression(ufl.det(F), points)
        corner = space.mesh.points[space.mesh.cells]
        u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        self._areas = np.empty(len(corner))
        self._areas[space.dolfinx_cell] = 0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
        self._cells = np.arange(V.mesh.topology.index_map(2).size_local, dtype=np.int32)

    @staticmethod
    def _quadrature_points(degree: int) -> Array:
        import basix

        points, _ = basix.make_quadrature(basix.CellType.triangle, 4 * degree - 2)
        return np.asarray(points, dtype=float)

    def residual(self, _snes: Any, x: Any, out: Any) -> None:
        from dolfinx.fem import petsc

        self._take(x)
        with out.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(out, self._residual)
        out.array[self.unknowns] = 0.0

    def tangent(self, _snes: Any, x: Any, matrix: Any, _preconditioner: Any) -> None:
        self._take(x)
        self._assemble(matrix)
        matrix.zeroRowsColumns(self.unknowns, 1.0)

    def advance(self, solver: Any, target: float, values: Array) -> str:
        """Go to another load factor; say why not, or nothing."""
        self.factor.value = np.asarray(target)
        self._predict(solver.getKSP(), values)
        x = self.solution.x.petsc_vec
        # no step so small that it would count as converged: a line search that fails takes such
        limit = _TOLERANCE * self.force
        solver.setTolerances(atol=limit, rtol=0.0, stol=0.0, max_it=_MOST_ITERATIONS)
        solver.solve(None, x)
        self.iterations += solver.getIterationNumber()
        reason = solver.getConvergedReason()
        if reason <= 0 and not solver.getFunctionNorm() <= _GOOD_ENOUGH * self.force:
            from petsc4py import PETSc

            names = vars(PETSc.SNES.ConvergedReason)
            words = [n for n, value in names.items() if value == reason and n.isupper()]
            return f"SNES {words[0].lower() if words else reason}"
        least, inverted = self.jacobian()
        if not inverted <= self._most_inverted:
            return f"{inverted:.2g} of the area turned inside out (least det F {least:.2g})"
        return ""

    def _predict(self, linear: Any, values: Array) -> None:
        """Add the linear response to the increments of the prescribed values and of the load."""
        from dolfinx.fem import petsc

        x = self.solution.x.petsc_vec
        self._assemble(self.matrix)
        with self.vector.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(self.vector, self._residual)
        self.vector.scale(-1.0)
        self._increment.set(0.0)
        self._increment.array[self.unknowns] = values - x.array[self.unknowns]
        self.matrix.zeroRowsColumns(self.unknowns, 1.0, self._increment, self.vector)
        linear.setOperators(self.matrix)
        linear.solve(self.vector, self._increment)
        self._assemble(self.matrix)
        self.matrix.mult(self._increment, self.vector)
        self.force = max(self.force, float(self.vector.norm()), 1e-300)
        x.axpy(1.0, self._increment)
        x.array[self.unknowns] = values

    def _take(self, x: Any) -> None:
        mine = self.solution.x.petsc_vec
        if x.handle != mine.handle:
            x.copy(mine)

    def _assemble(self, matrix: Any) -> None:
        from dolfinx.fem import petsc

        matrix.zeroEntries()
        petsc.assemble_matrix(matrix, self._tangent)
        matrix.assemble()

    def energy(self) -> float:
        from dolfinx import fem

        return float(np.real(fem.assemble_scalar(self._energy)))

    def jacobian(self) -> tuple[float, float]:
        """Give the least det F, and the share of the area where it is not positive."""
        values = self._jacobian.eval(self.solution.function_space.mesh, self._cells)
        share = np.count_nonzero(~(values > 0), axis=1) / values.shape[1]
        return float(values.min()), float(share @ self._areas / self._areas.sum())

    def destroy(self) -> None:
        for entry in (self.matrix, self.vector, self._increment):
            entry.destroy()


def _newton(equations: _Equations) -> Any:
    from petsc4py import PETSc

    solver = PETSc.SNES().create(equations.matrix.comm)
    solver.setType("newtonls")  # with backtracking, unless told otherwise
    solver.setFunction(equations.residual, equations.vector.duplicate())
    solver.setJacobian(equations.tangent, equations.matrix)
    linear = solver.getKSP()
    linear.setType("preonly")
    # symmetric, but a tangent at finite rotation need not be definite
    equations.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    linear.getPC().setType("cholesky")
    linear.getPC().setFactorSolverType("mumps")
    return solver
