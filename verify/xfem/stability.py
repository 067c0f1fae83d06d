"""Stability of an equilibrium, and the way out of an unstable one."""

import numpy as np

from verify.xfem.arrays import Floats
from verify.xfem.errors import SingularStiffnessError
from verify.xfem.static_newton import SHARES, UNSEEN, Newton, Place

_INVERSE_ITERATIONS = 12
_FIRST_WAY_OUT = 0.1  # of the size of the body, along the softest mode
_HALVINGS = 24  # of it


def is_stable(newton: Newton, displacement: Floats) -> bool:
    """Whether the consistent tangent at a displacement (N, d) is positive definite.

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
    """Mode (N, d) of negative curvature, its largest entry one; None if there is none.

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
