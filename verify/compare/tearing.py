"""Stress intensity of mode III at a front that moves, from the jump behind it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody
from verify.compare.cut_line import CutRule
from verify.compare.error_norm import displacement_jump
from verify.compare.locate import Field
from verify.compare.opening import cut_place
from verify.scene import Material

Array = NDArray[np.float64]
_NEAREST, _PLACES = 0.25, 12  # first place over the radius, number of places


@dataclass(frozen=True)
class BladeFront:
    """A straight front in space at an instant.

    Parameters
    ----------
    point : (3,) array
        In the middle of what of it lies in the body, m.
    ahead : (3,) array
        Unit vector of its advance.
    blade : (3,) array
        Unit vector along it; the positive side of the cut is that of ahead × blade.
    speed : float
        m/s.
    """

    point: Array
    ahead: Array
    blade: Array
    speed: float

    @property
    def along(self) -> Array:
        """Third axis: K_III is positive where the positive face slides along it."""
        return np.cross(self.ahead, np.cross(self.ahead, self.blade))


def tearing_intensity(
    field: Field, body: AnyBody, cut: str, front: BladeFront, radius: float, material: Material
) -> float:
    """K_III in Pa √m by displacement correlation, extrapolated to the front.

    Near a front that advances at v the jump is (4 K/(μ g)) √(r/2π) (1 + k r), g² = 1 − ρv²/μ, with
    r the distance behind it. K and k are fitted by least squares at places from a quarter of the
    radius to the radius, evenly spaced in √r.

    Parameters
    ----------
    field : Field
        At that time.
    body : Body or SolidBody
    cut : str
        Its name.
    front : BladeFront
    radius : float
        m; within it the cut is plane and open, and nothing else disturbs the field.
    material : Material
        With a density, if the front moves.
    """
    root = np.linspace(np.sqrt(_NEAREST * radius), np.sqrt(radius), _PLACES)
    places = [cut_place(body, cut, (front.point - r * front.ahead).tolist()) for r in root**2]
    rule = CutRule.joined(places, 3)
    jump = displacement_jump(field, rule) @ front.along
    columns = np.column_stack([root, root**3])
    first = np.linalg.lstsq(columns, jump, rcond=None)[0][0]
    shear = material.young / (2 * (1 + material.poisson))
    contraction = np.sqrt(1.0 - front.speed**2 * (material.density or 0.0) / shear)
    return float(first * shear * contraction * np.sqrt(2 * np.pi) / 4)
