"""Statics at finite rotation and strain: SNES on the energy, with load steps that adapt."""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from reference.space import ConformingSpace
from reference.strain_equations import StrainEquations
from verify.scene import Material

__all__ = ["Energy", "LargeStrainSolve", "solve_large_strain"]

Array = NDArray[np.float64]
Energy = Literal[
    "corotated", "corotated_mixed", "neo_hookean", "neo_hookean_mixed", "st_venant_kirchhoff"
]
_SMALLEST_STEP = 1e-4


@dataclass(frozen=True)
class LargeStrainSolve:
    """A converged equilibrium.

    Attributes
    ----------
    displacement : (n, d) array
        At the nodes of the space, m; the same on every rank.
    strain_energy : float
        J; in the plane per metre of thickness.
    smallest_jacobian : float
        Least det F at the quadrature points.
    inverted : float
        Share of the body where det F is not positive: at most 1e-3 with the corotated energy,
        with a pressure or not, none with the others.
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
    energy: Energy = "corotated",
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
    energy : Energy
        Density: μ‖U−I‖² + ½λ tr²(U−I), or one of those in plane strain or in space. Mixed: with
        the pressure as an unknown, of quadratic elements, for nearly incompressible material.
    first_step : float
        First increment of the load factor.

    Raises
    ------
    IllConditionedError
        If the body is held so weakly somewhere that the tangent at rest is lost in round-off.
    RuntimeError
        If steps below 1e-4 do not converge; with the load factor reached and PETSc's reason.
    """
    start = perf_counter()
    equations = StrainEquations(material, space, unknowns, load, energy)
    factor, step, steps = 0.0, first_step, 0
    refused: list[str] = []
    x = equations.solution.x.petsc_vec
    while factor < 1.0:
        target = min(1.0, factor + step)
        if target > 1.0 - 1e-9:
            target = 1.0
        before = x.array.copy()
        reason = equations.advance(target, prescribed(target))
        if not reason:
            factor, steps, step = target, steps + 1, 1.5 * step
            continue
        x.array[:] = before
        equations.solution.x.scatter_forward()
        refused.append(f"at {target:.4g}: {reason}")
        step *= 0.5
        if step < _SMALLEST_STEP:
            raise RuntimeError(f"no equilibrium beyond load factor {factor:.4g}: {refused[-1]}")
    result = LargeStrainSolve(
        equations.displacement(),
        equations.energy(),
        *equations.jacobian(),
        equations.iterations,
        steps,
        refused,
        {"solve": perf_counter() - start},
    )
    equations.destroy()
    return result
