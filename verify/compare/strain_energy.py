"""Strain energy: of a solution, exactly; of any field, by quadrature."""

import numpy as np
from numpy.typing import NDArray

from verify.compare.hooke import Corotated, Law
from verify.compare.locate import Field, SolutionField
from verify.compare.simplex_rule import simplex_rule
from verify.compare.simplices import in_frames, triangle_frames
from verify.compare.slabs import Rule
from verify.solution import Solution

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
    solution, shape = field.solution, field.shape
    order = 1 if solution.order == 1 else _FINE if isinstance(law, Corotated) else 2
    every = np.arange(len(solution.cells))
    found = np.zeros(len(solution.cells))
    membrane = solution.cell_dimension < solution.dimension
    frames = triangle_frames(shape.corners) if membrane else None
    for weights, share in zip(*simplex_rule(solution.cell_dimension, order), strict=True):
        points = np.einsum("k,mka->ma", weights, shape.corners)
        gradient = field.in_cells(points, every)[1]
        if frames is not None:
            gradient = in_frames(gradient, frames)
        found += share * shape.volume * law.at(points).energy_density(gradient)
    return found


def field_strain_energy(field: Field, rule: Rule, law: Law) -> float:
    """Energy of the body by quadrature, J (2D: per metre); for exact fields."""
    return float(rule.weights @ law.at(rule.points).energy_density(rule.gradient(field)))
