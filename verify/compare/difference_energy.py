"""Energy of what a moving solution has beside an exact field, or above a frequency."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.compare.hooke import Law
from verify.compare.locate import SolutionField
from verify.compare.simplex_rule import simplex_rule
from verify.errors import InputError
from verify.solution import Solution

Array = NDArray[np.float64]
Density = float | Array
_ORDER = 3  # points per direction: the exact field may be singular in a cell


def difference_energy(
    solution: Solution, step: int, exact: Any, law: Law, density: Density
) -> tuple[float, float]:
    """Kinetic and strain energy of the difference at an output time, J (2D: per metre).

    Parameters
    ----------
    solution : Solution
        Of linear kinematics, with velocities; integrated over its own cells.
    step : int
        Number of the output time.
    exact : object with ``gradient`` and ``velocity``
        The field at that time.
    law : Law
    density : float or (m,) array
        kg/m³, of each cell.

    Raises
    ------
    InputError
        If the solution has no velocities.
    """
    if solution.velocity is None:
        raise InputError("the solution has no velocities")
    field = SolutionField(solution, step)
    moving = field.with_nodal(solution.velocity[step])
    every = np.arange(len(solution.cells))
    near = field.shape.corners.mean(axis=1)
    kinetic = strain = 0.0
    for weights, share in zip(*simplex_rule(solution.cell_dimension, _ORDER), strict=True):
        points = np.einsum("k,mka->ma", weights, field.shape.corners)
        measure = share * field.shape.volume
        off = field.in_cells(points, every)[1] - exact.gradient(points, near)
        strain += float(measure @ law.at(points).energy_density(off))
        slip = moving.in_cells(points, every)[0] - exact.velocity(points, near)
        kinetic += 0.5 * float((density * measure) @ np.sum(slip**2, axis=1))
    return kinetic, strain


def short_wave_energy(solution: Solution, period: float, density: Density) -> float:
    """Kinetic energy in motions faster than a period at the end, J (2D: per metre).

    That of the velocity less its mean over the last period, averaged over that period. A motion
    of that period, or a whole part of it, counts in full; one of a period P times longer by
    about (π/P)²/3 of itself.

    Raises
    ------
    InputError
        If there are no velocities, or less than four output times in a period, or no whole one.
    """
    times = solution.times
    if solution.velocity is None:
        raise InputError("the solution has no velocities")
    last = np.flatnonzero(times > times[-1] - period * (1 + 1e-9))
    if len(last) < 5 or last[0] == 0:
        apart = float(np.diff(times).max(initial=0.0))
        raise InputError(
            f"output times are {apart:.3g} s apart; motions of periods up to {period:.3g} s need a "
            f"quarter of that"
        )
    last = last[1:] if times[last[0]] <= times[-1] - period * (1 - 1e-9) else last
    velocity = solution.velocity[last]
    fast = velocity - velocity.mean(axis=0)
    field, energy = SolutionField(solution), 0.0
    every = np.arange(len(solution.cells))
    order = 2 if solution.order == 1 else 3
    for weights, share in zip(*simplex_rule(solution.cell_dimension, order), strict=True):
        points = np.einsum("k,mka->ma", weights, field.shape.corners)
        for one in fast:
            slip = field.with_nodal(one).in_cells(points, every)[0]
            mass = density * share * field.shape.volume
            energy += 0.5 * float(mass @ np.sum(slip**2, axis=1))
    return energy / len(fast)
