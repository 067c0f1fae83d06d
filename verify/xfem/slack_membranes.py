"""Newton's method for membranes, which have next to no stiffness where they are slack."""

from verify.xfem.arrays import Bools, Floats
from verify.xfem.errors import SingularStiffnessError
from verify.xfem.internal_force import InternalForce
from verify.xfem.static_newton import Newton, Place

# tensions over μ: at first, below which the consistent tangent is tried, the least; and the factor
# by which a full step lets it fall
_TAUT, _SLACK, _LEAST, _FALL = 1.0, 1e-3, 1e-6, 0.1


class Descent(Newton):
    """Newton's method down the potential energy of a membrane.

    Tangents, not forces, are those of a tension that is at least so much; it falls as long as full
    steps lower the energy. The consistent tangent follows where it is positive definite.
    """

    def __init__(self, force: InternalForce, fixed: Bools) -> None:
        super().__init__(force, fixed)
        self._least = _TAUT

    def _spread(self, start: Place, change: Floats) -> Floats:
        """Respond linearly to a prescribed change, as a taut membrane does."""
        self._least = _TAUT
        return self._solve(start, change, 0.0, self._least)

    def _next(self, place: Place, load: Floats) -> Place:
        """Go down the energy; where no correction does, raise the least tension and stay."""
        correction = self._downhill(place)
        share = self._share_downhill(place, correction, load)
        if share == 0.0:
            self._least = max(self._least, _SLACK) / _FALL
            return place
        self._least *= _FALL if share == 1.0 else 1.0
        return self.place(place.displacement + share * correction, load)

    def _downhill(self, place: Place) -> Floats:
        """Solve for a correction along which the energy falls."""
        if self._least < _SLACK:
            try:
                return self._solve(place, None, 1.0)
            except SingularStiffnessError:
                pass
        return self._solve(place, None, 0.0, max(self._least, _LEAST))
