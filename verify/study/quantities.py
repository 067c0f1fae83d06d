"""Quantities of interest of a scene, measured on one field."""

from verify.compare.body import Body
from verify.compare.hooke import Hooke
from verify.compare.opening import opening
from verify.compare.point_displacement import point_displacement
from verify.compare.realised import field_of
from verify.compare.sampled import Sampled
from verify.compare.simplices import simplices
from verify.compare.strain_energy import strain_energy
from verify.scene.acceptance import DisplacementQuantity, OpeningQuantity, Quantity
from verify.solution import Solution

__all__ = ["Measured", "unit_of"]


class Measured:
    """A solution with its field, ready to be measured.

    Parameters
    ----------
    solution : Solution
    body : Body
    law : Hooke
    """

    def __init__(self, solution: Solution, body: Body, law: Hooke) -> None:
        self.solution, self.body, self.law = solution, body, law
        self.field = Sampled(field_of(solution, body))

    @property
    def coverage(self) -> float:
        """Volume of the cells over that of the body: 1, or something is missing or twice there."""
        shape = simplices(self.solution.points, self.solution.cells)
        return float(shape.volume.sum()) / self.body.area

    def quantity(self, asked: Quantity) -> float:
        """Value of a quantity of interest, in the unit that `unit_of` gives."""
        if isinstance(asked, DisplacementQuantity):
            return point_displacement(self.field, asked.point, asked.component)
        if isinstance(asked, OpeningQuantity):
            return opening(self.field, self.body, asked.cut, asked.at, asked.component)
        return strain_energy(self.solution, self.law)


def unit_of(asked: Quantity, dimension: int) -> str:
    """SI unit of a quantity; energies of plane scenes are per metre of thickness."""
    if asked.kind == "strain_energy":
        return "J/m" if dimension == 2 else "J"
    return "m"
