"""Unstable equilibria, and slack membranes.

An equilibrium that is not stable is left along its softest mode. A membrane that is slack has next
to no stiffness: its tangent gets a tension that falls to nothing.
"""

import numpy as np

from verify.xfem.arrays import Bools, Floats, SingularStiffnessError
from verify.xfem.internal_force import InternalForce
from verify.xfem.statics import SHARES, UNSEEN, Newton, Place

_INVERSE_ITERATIONS = 12
_FIRST_WAY_OUT = 0.1  # of the size of the body, along the softest mode
_HALVINGS = 24  # of it
# of a slack membrane: tension over μ at first, below which the consistent tangent is tried, and the
# least; the factor by which a full step lets it fall
_TAUT, _SLACK, _LEAST, _FALL = 1.0, 1e-3, 1e-6, 0.1


def is_stable(newton: Newton, displacement: Floats) -> bool:
    """Tell whether the consistent tangent at a displacement (N, d) is positive definite.

    A factorisation without pivoting exists only then; conjugate gradients, from forces in all
    directions, meet a negative curvature among the first extreme ones that they find.
    """
    newton.linearise(displacement, 1.0)
    try:
        newton.inverse().solve(_random_force(newton))
    except SingularStiffnessError:
        return False
    return True


def way_out(newton: Newton, place: Place, load: Floats) -> Place | None:
    """Place of less potential energy along the softest mode of an unstable equilibrium.

    None if the curvature is not negative there: the stiffness is then singular, not indefinite.
    """
    mode = _softest_mode(newton, place.displacement)
    if mode is None:
        return None
    reach = float(np.ptp(newton.force.phantom.mesh.points, axis=0).max())
    for halving in range(_HALVINGS):
        step = _FIRST_WAY_OUT * 0.5**halving * reach * mode
        trials = [newton.place(place.displacement + sign * step, load) for sign in (1.0, -1.0)]
        best = min(trials, key=lambda trial: trial.energy)
        if best.energy < place.energy - UNSEEN * abs(place.energy):
            return best
    return None


def _softest_mode(newton: Newton, displacement: Floats) -> Floats | None:
    """Compute the mode (N, d) of negative curvature, its largest entry one; None if there is none.

    By inverse iterations with as much of the rotational tangent as leaves it positive definite.
    """
    for rotational in SHARES[1:]:
        newton.linearise(displacement, rotational)
        mode = _random_force(newton)
        try:
            inverse = newton.inverse()
            for _ in range(_INVERSE_ITERATIONS):
                mode = inverse.solve(mode)
                mode[newton.fixed] = 0.0
                mode /= np.abs(mode).max()
        except SingularStiffnessError:
            continue
        tangent = newton.linearise(displacement, 1.0)
        if mode.ravel() @ (tangent @ mode.ravel()) < 0.0:
            return mode
    return None


def _random_force(newton: Newton) -> Floats:
    forces = np.random.default_rng(0).standard_normal(newton.fixed.shape)
    return np.where(newton.fixed, 0.0, forces)


class Descent(Newton):
    """Newton's method down the potential energy of a membrane.

    Tangents, not forces, have a least tension; it falls as long as full steps lower the energy. The
    consistent tangent follows where it is positive definite.
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
