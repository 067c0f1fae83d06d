"""The singular field at the straight front of a plane crack in space, all three modes."""

import numpy as np

from reference.exact.crack_tip import CrackTip
from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.plane_cut import axes_of
from reference.exact.solution import Array, ExactSolution, Plane
from verify.errors import InputError
from verify.scene import Scene


class StraightFrontField(ExactSolution):
    """Plane strain of modes I and II across a straight front, antiplane shear along it.

    In the axes ahead of the front, normal to the crack, and along the front (ahead × normal),
    with z = x + iy: the plane field of `CrackTip`, and u_3 = (2 K_III/μ) Im √(z/2π)
    (M. L. Williams, J. Appl. Mech. 24, 1957). The faces, behind the front, are free of traction.

    Parameters ``point`` of the front (m), ``normal`` of the crack towards its positive side,
    ``axis``, the direction ahead, projected onto its plane, and ``intensity`` (K_I, K_II, K_III),
    Pa·√m.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        self._origin = parameters.take("point", (3,))
        ahead, _, normal = axes_of(parameters)
        self._axes = np.stack([ahead, normal, np.cross(ahead, normal)])
        self._k = parameters.take("intensity", (3,))
        self._plane = _tip(law, self._k[:2])
        self._unit = _tip(law, np.array([1.0, 0.0]))  # its potential is √(z/2π)

    @property
    def stress_intensity(self) -> tuple[float, float, float]:
        """K_I, K_II and K_III, Pa·√m, in the axes ahead, normal, ahead × normal."""
        k_1, k_2, k_3 = self._k
        return float(k_1), float(k_2), float(k_3)

    @property
    def cut_plane(self) -> Plane | None:
        """Point of the front, and the normal of the crack."""
        return self._origin, self._axes[1]

    def strain_energy(self, body: Array | Scene) -> float:
        """Refuse: the front is where the quadrature of `ExactSolution` would need its own rule."""
        raise InputError("the strain energy around a straight front is not computed")

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Displacement (n, 3), m; see `ExactSolution`."""
        x, beside = self._local(points), None if near is None else self._local(near)
        third = 2 * self._k[2] / self.law.shear * self._unit.potentials(x, beside).phi.imag
        return np.column_stack([self._plane.displacement(x, beside), third]) @ self._axes

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, 3, 3), nan at the front. See `ExactSolution`."""
        x, beside = self._local(points), None if near is None else self._local(near)
        slope = 2 * self._k[2] / self.law.shear * self._unit.potentials(x, beside).phi_1
        local = np.zeros((len(x), 3, 3))
        local[:, :2, :2] = self._plane.gradient(x, beside)
        local[:, 2, 0], local[:, 2, 1] = slope.imag, slope.real
        turned: Array = self._axes.T @ local @ self._axes
        return turned

    def _local(self, points: Array) -> Array:
        """Places (n, 2) ahead of the front and across the crack, m."""
        return (np.asarray(points, dtype=float) - self._origin) @ self._axes[:2].T


def _tip(law: Hooke, intensity: Array) -> CrackTip:
    return CrackTip(law, Parameters("tip", {"tip": [0.0, 0.0], "intensity": intensity}))
