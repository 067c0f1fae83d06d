"""Energies: of a solution, of a field, of a difference from an exact field, above a frequency."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.compare.body_rule import Rule
from verify.compare.hooke import Corotated, Law
from verify.compare.inertia import separated_parts
from verify.compare.locate import Field, SolutionField
from verify.compare.simplices import in_frames, simplex_rule, triangle_frames
from verify.errors import InputError
from verify.solution import Solution

Array = NDArray[np.float64]
Density = float | Array
# points per direction where the density is no polynomial of the gradient
_FINE = 4


def strain_energy(solution: Solution, law: Law, step: int = -1) -> float:
    """Energy of the cells of the solution, J (2D: per metre), exact for its field.

    It needs no reference and no neutral quadrature: it is a functional of the field. Only the
    corotated energy of a quadratic field is no polynomial: there the rule is of degree 7. A cell
    across an interface of materials is integrated by that rule too, each point in its own.
    """
    return nodal_strain_energy(SolutionField(solution, step), law)


def nodal_strain_energy(field: SolutionField, law: Law) -> float:
    """Energy of the cells of a solution's field, J (2D: per metre)."""
    return float(cell_strain_energies(field, law).sum())


def cell_strain_energies(field: SolutionField, law: Law) -> NDArray[np.float64]:
    """Energy (m,) of each cell of a solution's field, J (2D: per metre)."""
    return _integrated(field, lambda at, gradient: law.at(at).energy_density(gradient(field)), law)


def stress_power(rate: SolutionField, displacement: SolutionField, law: Law) -> float:
    """Power of the stresses of a displacement on a velocity, ∫ P:∇w, W (2D: per metre)."""

    def density(at: Array, gradient: Callable[[SolutionField], Array]) -> Array:
        return law.at(at).power_density(gradient(displacement), gradient(rate))

    return float(_integrated(rate, density, law).sum())


def viscous_power(
    rate: SolutionField, velocity: SolutionField, displacement: SolutionField, law: Law
) -> float:
    """w·Kv of two velocities, of which `cell_dissipation` has the square."""
    total = velocity.nodal + rate.nodal, velocity.nodal - rate.nodal
    more, less = (cell_dissipation(rate.with_nodal(v), displacement, law).sum() for v in total)
    return 0.25 * float(more - less)


def cell_dissipation(
    velocity: SolutionField, displacement: SolutionField, law: Law
) -> NDArray[np.float64]:
    """v·Kv (m,) of each cell, J/s² (2D: per metre), K the stiffness that turns with the body.

    Twice the linear energy of the velocity gradient in the frame of the displacement: what damping
    proportional to the stiffness takes, over its factor.
    """

    def density(at: Array, gradient: Callable[[SolutionField], Array]) -> Array:
        return 2.0 * law.at(at).error_density(gradient(velocity), gradient(displacement))

    return _integrated(velocity, density, law)


def _integrated(
    field: SolutionField,
    density: Callable[[Array, Callable[[SolutionField], Array]], Array],
    law: Law,
) -> NDArray[np.float64]:
    """Integrate over each cell a density of points and of gradients of fields there."""
    solution, shape = field.solution, field.shape
    order = 1 if solution.order == 1 else _FINE if isinstance(law, Corotated) else 2
    every, found = np.arange(len(solution.cells)), np.zeros(len(solution.cells))
    membrane = solution.cell_dimension < solution.dimension
    frames = triangle_frames(shape.corners) if membrane else None
    for points, measure in _points_of_cells(field, order):

        def gradient(of: SolutionField, points: Array = points) -> Array:
            value = of.in_cells(points, every)[1]
            return value if frames is None else in_frames(value, frames)

        found += measure * density(points, gradient)
    return found


def _points_of_cells(field: SolutionField, order: int) -> Iterator[tuple[Array, Array]]:
    """Yield a point (m, d) in each cell and the measure (m,) that it stands for."""
    shape = field.shape
    rule = simplex_rule(field.solution.cell_dimension, order)
    for weights, share in zip(*rule, strict=True):
        yield np.einsum("k,mka->ma", weights, shape.corners), share * shape.volume


def field_strain_energy(field: Field, rule: Rule, law: Law) -> float:
    """Energy of the body by quadrature, J (2D: per metre); for exact fields."""
    return float(rule.weights @ law.at(rule.points).energy_density(rule.gradient(field)))


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
    for points, measure in _points_of_cells(field, _ORDER):
        off = field.in_cells(points, every)[1] - exact.gradient(points, near)
        strain += float(measure @ law.at(points).energy_density(off))
        slip = moving.in_cells(points, every)[0] - exact.velocity(points, near)
        kinetic += 0.5 * float((density * measure) @ np.sum(slip**2, axis=1))
    return kinetic, strain


def short_wave_energy(solution: Solution, period: float, density: Density) -> float:
    """Kinetic energy in motions faster than a period at the end, J (2D: per metre).

    That of the velocity less its mean over the last period, and less the mean of that over each
    part of the body, which falls or swings as a whole; averaged over that period. A motion
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
    every, parts = np.arange(len(solution.cells)), separated_parts(solution, density)
    momenta = np.zeros((len(parts), *fast.shape[::2]))
    order = 2 if solution.order == 1 else 3
    for points, measure in _points_of_cells(field, order):
        weights = density * measure
        for k, one in enumerate(fast):
            slip = field.with_nodal(one).in_cells(points, every)[0]
            energy += 0.5 * float(weights @ np.sum(slip**2, axis=1))
            for part, momentum in zip(parts, momenta, strict=True):
                momentum[k] += weights[part.cells] @ slip[part.cells]
    for part, momentum in zip(parts, momenta, strict=True):
        energy -= 0.5 * float(np.sum(momentum**2)) / part.mass
    return energy / len(fast)
