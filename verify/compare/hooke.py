"""Isotropic linear elasticity as the comparison needs it: stress and energy of a gradient."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.scene import Material

__all__ = ["Hooke", "hooke"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Hooke:
    """Lamé constants (Pa), those of the plane problem in plane stress."""

    lame: float
    shear: float

    def energy_density(self, gradient: Array) -> Array:
        """½ σ:ε (n,) in J/m³ of displacement gradients (n, d, d)."""
        strain = 0.5 * (gradient + np.swapaxes(gradient, 1, 2))
        trace = np.trace(strain, axis1=1, axis2=2)
        square = np.einsum("nij,nij->n", strain, strain)
        density: Array = 0.5 * self.lame * trace**2 + self.shear * square
        return density


def hooke(material: Material) -> Hooke:
    """Lamé constants of a scene's material."""
    shear = material.young / (2 * (1 + material.poisson))
    lame = 2 * shear * material.poisson / (1 - 2 * material.poisson)
    if material.plane == "stress":
        lame = 2 * lame * shear / (lame + 2 * shear)
    return Hooke(lame, shear)
