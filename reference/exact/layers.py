"""Two materials that meet along a line which a straight cut crosses: linear on each of four parts.

Tension S along the cut, another on each side, leaves the cut free and is in equilibrium with
itself across the interface. Its strains are those of each material; they fit together where both
materials strain alike along the interface, τ·ε τ: at one angle for two given materials. The rest
of the jump, which shears, is a rotation of the second material.
"""

import numpy as np

from reference.exact.hooke import Hooke, hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import Array
from reference.exact.two_sided import Above, TwoSidedSolution, line_axes, side
from verify.errors import InputError
from verify.scene import Material

_FITS = 1e-9  # of the strains: how well they must agree along the interface
_BESIDE = 1e-4, 1e-7  # m: how far along the interface and beside it materials are looked at
_QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])


class Layers(TwoSidedSolution):
    """Uniform stress S s⊗s on each side of the cut, in two materials.

    ``point`` is where the interface crosses the cut.

    Parameters
    ----------
    material : Material
        With one region, whose interface it is.
    parameters : Parameters
        ``point``, ``slope`` or ``angle`` of the cut, ``shift``; ``interface_slope`` or
        ``interface_angle`` (degrees), and ``stress`` S (Pa) above and below the cut.

    Raises
    ------
    InputError
        If the strains do not fit together along the interface, or the regions of the scene have
        no such interface.
    """

    def __init__(self, material: Material, parameters: Parameters) -> None:
        super().__init__(hooke(material), parameters)
        self._stress = parameters.take("stress", (2,))
        along = line_axes(parameters, "interface_")[0] @ self._axes.T  # in the axes of the cut
        self._normal = _QUARTER @ along
        laws = self._laws_beside(material, along @ self._axes)
        # per unit of stress: (left, right) of the interface
        strains = [np.diag([1.0, -one.eta]) / one.plane_modulus for one in laws]
        jump = strains[1] - strains[0]
        if abs(along @ jump @ along) > _FITS * float(np.abs(strains).max()):
            raise InputError(
                f"parameters: along the interface the materials strain by "
                f"{along @ strains[0] @ along:.6g} and {along @ strains[1] @ along:.6g} per Pa of "
                "tension along the cut; expected the same"
            )
        spin = -(self._normal @ jump @ along)
        self._gradients = np.array([strains[0], strains[1] + spin * _QUARTER])

    def stress(self, points: Array, near: Array | None = None) -> Array:
        """Stress (n, 2, 2), Pa; that of each point's material."""
        _, above = self._local(points, near)
        unit = np.outer(self._axes[0], self._axes[0])
        return np.asarray(side(self._stress, above)[:, None, None] * unit)

    def kinks(self, start: Array, end: Array) -> list[float]:
        """Parameters in (0, 1) at which a segment crosses the interface."""
        a, b = ((point - self._origin) @ self._axes.T @ self._normal for point in (start, end))
        return [float(a / (a - b))] if a * b < 0 else []

    def _laws_beside(self, material: Material, along: Array) -> list[Hooke]:
        """Laws to the left and to the right of the interface, as the scene has them."""
        steps = [(step, aside) for aside in (1.0, -1.0) for step in (1.0, -1.0)]
        beside = self._origin + np.array(
            [
                step * _BESIDE[0] * along + aside * _BESIDE[1] * (_QUARTER @ along)
                for step, aside in steps
            ]
        )
        number = material.number_at(beside)
        if number[0] != number[1] or number[2] != number[3] or number[0] == number[2]:
            raise InputError(
                "'layers' expects material.regions that differ across the interface through the "
                "point, and not along it"
            )
        return [hooke(material.each[k]) for k in number[[0, 2]]]

    def _local_displacement(self, s: Array, above: Above) -> Array:
        return np.asarray(np.einsum("nij,nj->ni", self._local_gradient(s, above), s))

    def _local_gradient(self, s: Array, above: Above) -> Array:
        second = s @ self._normal < 0.0
        return side(self._stress, above)[:, None, None] * self._gradients[second.astype(int)]
