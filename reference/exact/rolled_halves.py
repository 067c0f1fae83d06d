"""Bending of either side of a straight cut to a circle, at any rotation: the sides peel apart."""

import numpy as np

from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import Array
from reference.exact.two_sided import Above, TwoSidedSolution, matrices, side
from verify.errors import InputError
from verify.scene import Scene


class RolledHalves(TwoSidedSolution):
    """Strips on both sides of a cut, each bent away from the other to a circle of its own.

    In the energy μ‖U − I‖² + ½ λ tr²(U − I) a strip |ξ| < h/2 takes the places
    (r cos cs, r sin cs) with r = A cosh cξ + B sinh cξ + b/c, b = 2(λ + μ)/(λ + 2μ): equilibrium
    without body force, free of traction at ξ = ±h/2. At s = 0 the middle lines stay where they are.

    Parameters ``thickness`` h (m) and ``curvature`` c (1/m, positive) per side; ``shift`` (m,
    normal to the cut) per side.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law, parameters)
        self._thickness = parameters.take("thickness", (2,))
        self._curvature = parameters.take("curvature", (2,))
        if (self._thickness <= 0.0).any() or (self._curvature <= 0.0).any():
            raise InputError("parameters: thickness and curvature; expected positive numbers")
        lame, shear = law.lame, law.shear
        stiff = lame + 2 * shear
        self._b = 2 * (lame + shear) / stiff
        spare = 2 * (lame + shear) - lame * self._b
        c, h = self._curvature, self._thickness
        self._sinh = spare * stiff / (c * np.cosh(0.5 * c * h) * (stiff**2 - lame**2))
        self._cosh = -lame * self._sinh / stiff

    def strain_energy(self, body: Array | Scene) -> float:
        """Refuse: at finite rotation the linear work on the surface is not the energy."""
        raise InputError("the strain energy at finite rotation is integrated over the body")

    def _radius(self, xi: Array, above: Above) -> tuple[Array, Array]:
        """Radius r (n,), m, and dr/dξ (n,)."""
        c = side(self._curvature, above)
        even, odd = side(self._cosh, above), side(self._sinh, above)
        r = even * np.cosh(c * xi) + odd * np.sinh(c * xi) + self._b / c
        return r, c * (even * np.sinh(c * xi) + odd * np.cosh(c * xi))

    def _local_displacement(self, s: Array, above: Above) -> Array:
        sign, middle = np.where(above, 1.0, -1.0), 0.5 * side(self._thickness, above)
        (x, t), c = s.T, side(self._curvature, above)
        r, _ = self._radius(middle - sign * t, above)
        at_middle = side(self._cosh, above) + self._b / c
        # ξ points away from the centre of the circle: towards the cut
        rise = sign * (middle + at_middle - r * np.cos(c * x))
        return np.column_stack([r * np.sin(c * x) - x, rise - t])

    def _local_gradient(self, s: Array, above: Above) -> Array:
        sign, middle = np.where(above, 1.0, -1.0), 0.5 * side(self._thickness, above)
        (x, t), c = s.T, side(self._curvature, above)
        r, slope = self._radius(middle - sign * t, above)
        cos, sin = np.cos(c * x), np.sin(c * x)
        return matrices([[c * r * cos - 1.0, -sign * slope * sin],
                         [sign * c * r * sin, slope * cos - 1.0]])  # fmt: skip
