"""Isotropic linear elasticity: Lamé parameters of plane strain, plane stress and solids."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from verify.xfem.arrays import Floats, check_choice, finite_array, real_array
from verify.xfem.errors import XfemError

State = Literal["plane strain", "plane stress", "solid"]


@dataclass(frozen=True)
class Material:
    """σ = λ tr(ε) I + 2 μ ε, with the λ that suits the state.

    There is no seam for another law. This one is written out in `verify.xfem.element`, `membrane`,
    `energy_momentum` (for it alone), `critical_step`, `ghost_penalty`, and the kernels of
    `verify.accelerated`. That K is constant in linear kinematics is relied on by `solve_static` and
    `implicit`; that P is linear in E, by every product with the rotation-fixed tangent.

    Attributes
    ----------
    lam, mu : (m,) or () float array
        Lamé parameters in pascal (of membranes times the thickness, in N/m), for all cells of the
        uncut mesh or one for each.
    """

    lam: Floats
    mu: Floats

    def of_cells(self, count: int) -> tuple[Floats, Floats]:
        """λ and μ (m,) of so many cells of the uncut mesh, in pascal.

        Raises
        ------
        XfemError
            If there is neither one value nor one for each, one is not finite, or a change of shape
            or of size in the plane stores no energy (μ ≤ 0, λ ≤ -μ).
        """
        for name, values in (("λ", self.lam), ("μ", self.mu)):
            finite_array(values, name, (), (count,))
        if not ((self.mu > 0.0) & (self.lam + self.mu > 0.0)).all():
            raise XfemError(
                f"Lamé parameters λ down to {np.min(self.lam):g} and μ down to "
                f"{np.min(self.mu):g} Pa; expected μ > 0 and λ > -μ"
            )
        lam, mu = (np.broadcast_to(values, count).astype(float) for values in (self.lam, self.mu))
        return lam, mu


def isotropic(young: ArrayLike, poisson: ArrayLike, state: State) -> Material:
    """Lamé parameters from Young's modulus and Poisson's ratio.

    Parameters
    ----------
    young : float or (m,) array_like
        Young's modulus in pascal.
    poisson : float or (m,) array_like
        Poisson's ratio, in (−1, ½); in plane stress in (−1, 1).
    state : {"plane strain", "plane stress", "solid"}
        In plane stress λ becomes 2λμ/(λ + 2μ) = Eν/(1 − ν²).

    Raises
    ------
    XfemError
        If a parameter is outside its bounds, shapes do not match or the state is unknown.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> round(float(xfem.isotropic(2.6e3, 0.3, "plane strain").mu), 9)
    1000.0
    """
    E, nu = real_array(young, "Young's modulus"), real_array(poisson, "Poisson's ratio")
    check_choice(state, State, "state")
    if not (np.isfinite(E).all() and (E > 0.0).all()):
        raise XfemError(f"Young's modulus {E.min():g} Pa; expected positive and finite")
    bound = 1.0 if state == "plane stress" else 0.5
    if not ((nu > -1.0) & (nu < bound)).all():
        worst = nu.flat[int(np.argmax(np.abs(nu)))]
        raise XfemError(f"Poisson's ratio {worst:g}; expected within (-1, {bound:g}) in {state}")
    if E.shape != nu.shape and () not in (E.shape, nu.shape):
        raise XfemError(f"Young's modulus of shape {E.shape}, Poisson's ratio of {nu.shape}")
    mu = E / (2.0 * (1.0 + nu))
    if state == "plane stress":
        return Material(E * nu / (1.0 - nu**2), mu)
    return Material(E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), mu)
