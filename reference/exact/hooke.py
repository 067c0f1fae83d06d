"""Isotropic linear elasticity: the constants that exact solutions are written in."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.scene import Material


@dataclass(frozen=True)
class Hooke:
    """Hooke's law, in the plane or in space.

    In plane stress `lame` is that of the plane law, 2λμ/(λ+2μ), so that one set of formulas
    serves both states.

    Parameters
    ----------
    lame : float
        First Lamé constant λ, Pa.
    shear : float
        Shear modulus μ, Pa.
    dimension : {2, 3}
    density : float, optional
        kg/m³; what moves needs it.
    """

    lame: float
    shear: float
    dimension: int
    density: float | None = None

    @property
    def eta(self) -> float:
        """η = λ/(λ+2μ): lateral contraction that keeps a plane free of normal stress."""
        return self.lame / (self.lame + 2 * self.shear)

    @property
    def plane_modulus(self) -> float:
        """E' = 4μ(λ+μ)/(λ+2μ): E/(1−ν²) in plane strain, E in plane stress, Pa."""
        lame, shear = self.lame, self.shear
        return 4 * shear * (lame + shear) / (lame + 2 * shear)

    @property
    def kolosov(self) -> float:
        """κ = (λ+3μ)/(λ+μ): 3−4ν in plane strain, (3−ν)/(1+ν) in plane stress."""
        return (self.lame + 3 * self.shear) / (self.lame + self.shear)

    def stress(self, gradient: NDArray[np.float64]) -> NDArray[np.float64]:
        """Stress (…, d, d) in Pa of displacement gradients (…, d, d)."""
        strain = 0.5 * (gradient + gradient.swapaxes(-1, -2))
        trace = np.trace(strain, axis1=-2, axis2=-1)
        stress: NDArray[np.float64] = 2 * self.shear * strain
        stress += self.lame * trace[..., None, None] * np.eye(self.dimension)
        return stress


def hooke(material: Material) -> Hooke:
    """Hooke's law of a scene's material; in space where it names no plane state."""
    young, poisson = material.young, material.poisson
    shear = young / (2 * (1 + poisson))
    lame = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    if material.plane == "stress":
        lame = young * poisson / (1 - poisson**2)
    return Hooke(lame, shear, 3 if material.plane is None else 2, material.density)
