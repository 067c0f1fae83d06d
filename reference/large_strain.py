"""Statics at finite rotation and strain: SNES on the energy, with load steps that adapt."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from reference.inside_out import Orientation, place_text
from reference.law import ENERGIES, Law
from reference.space import ConformingSpace
from reference.strain_equations import StrainEquations
from verify.scene import Material

Array = NDArray[np.float64]
_SMALLEST_STEP = 1e-4
# of a path; one in smaller steps has met what no mesh resolves
_MOST = {"accepted steps": 100, "refused steps": 50, "Newton iterations": 1000}
_SHORT = 1 / 64  # step that is not halved because energy is lost: something has snapped through
_FINER = 2.7  # steps of a second path: another, but no multiple of the first
_SAME = 1e-6  # of the energy, between two paths


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


def solve_large_strain(
    material: Material,
    space: ConformingSpace,
    unknowns: NDArray[np.int32],
    prescribed: Callable[[float], Array],
    load: Array | None = None,
    energy: str = "corotated",
    pressure: bool = False,
    first_step: float = 0.25,
) -> LargeStrainSolve:
    """Find the equilibrium at load factor 1, from rest at load factor 0.

    In each step every piece follows the rigid motion of its supports first, and then the linear
    response to what is left; then PETSc's Newton with line search. A step that does not converge,
    turns too much inside out, or stores what neither its supports nor its loads could have paid for
    is halved. An end whose tangent is not positive definite is sought again in smaller steps; the
    stable one of two ends counts, and an unstable one only where cells inside out leave the energy
    without a tangent and both paths end there.

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

    Raises
    ------
    IllConditionedError
        If the body is held so weakly somewhere that the tangent at rest is lost in round-off.
    RuntimeError
        If steps below 1e-4, or the last of 100, do not converge; with the load factor reached and
        PETSc's reason. If neither of two paths ends in a stable state; with both energies.
    """

    def path(step: float) -> LargeStrainSolve:
        start = perf_counter()
        law, inverted = Law(material, space, energy, pressure), ENERGIES[energy].inverted
        equations = StrainEquations(law, space, unknowns, load, inverted)
        found = _follow(equations, prescribed, step)
        return replace(found, timings={"solve": perf_counter() - start})

    one = path(first_step)
    if not one.negative_modes:
        return one
    two = path(first_step / _FINER)
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
        before = x.array.copy()
        reason = equations.advance(target, prescribed(target), step <= _SHORT)
        if not reason:
            factor, steps, step = target, steps + 1, 1.5 * step
            continue
        x.array[:] = before
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
    result = LargeStrainSolve(
        equations.displacement(),
        equations.energy(),
        equations.orientation(),
        equations.method,
        equations.iterations,
        steps,
        refused,
        equations.negative_modes(),
        {},
    )
    equations.destroy()
    return result
