"""Strain energy: of a solution, exactly; of any field, by quadrature."""

import numpy as np

from verify.compare.hooke import Hooke
from verify.compare.locate import Field, SolutionField
from verify.compare.simplices import simplices
from verify.compare.slabs import Rule
from verify.solution import Solution

__all__ = ["field_strain_energy", "strain_energy"]

# barycentric points of rules that are exact for quadratic polynomials, equal weights
_QUADRATIC = {2: (1 / 6, 2 / 3), 3: ((5 - 5**0.5) / 20, (5 + 3 * 5**0.5) / 20)}


def strain_energy(solution: Solution, law: Hooke, step: int = -1) -> float:
    """½ ∫ σ:ε over the cells of the solution, J (2D: per metre), exact for its field.

    It needs no reference and no neutral quadrature: it is a functional of the field.
    """
    d = solution.dimension
    shape = simplices(solution.points, solution.cells)
    field = SolutionField(solution, step)
    every = np.arange(len(solution.cells))
    small, large = (1 / (d + 1),) * 2 if solution.order == 1 else _QUADRATIC[d]
    corners = range(1 if solution.order == 1 else d + 1)
    total = 0.0
    for k in corners:
        weights = np.full(d + 1, small)
        weights[k] = large
        points = np.einsum("k,mka->ma", weights, shape.corners)
        density = law.energy_density(field.in_cells(points, every)[1])
        total += float(shape.volume @ density) / len(corners)
    return total


def field_strain_energy(field: Field, rule: Rule, law: Hooke) -> float:
    """½ ∫ σ:ε over the body by quadrature, J (2D: per metre); for exact fields."""
    return float(rule.weights @ law.energy_density(field.gradient(rule.points, rule.points)))
