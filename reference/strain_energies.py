"""Densities of strain energy as UFL expressions of the deformation, in the plane and in space."""

from typing import Any

__all__ = [
    "ENERGIES",
    "VALUES",
    "corotated",
    "corotated_mixed",
    "corotated_value",
    "neo_hookean",
    "neo_hookean_mixed",
    "st_venant_kirchhoff",
]


def corotated(polar: Any, lam: Any, mu: Any) -> Any:
    """μ‖U−I‖² + ½λ tr²(U−I), the potential of corotational linear elasticity with polar rotations.

    The out-of-plane stretch is 1 in plane strain, and eliminated by λ in plane stress.

    Parameters
    ----------
    polar : PolarStretch or MembraneStretch
    lam, mu : ufl expressions
        Lamé constants, Pa.
    """
    import ufl

    d = polar.stretches
    return mu * (ufl.inner(polar.F, polar.F) - 2 * polar.s + d) + lam / 2 * (polar.s - d) ** 2


def corotated_value(polar: Any, lam: Any, mu: Any) -> Any:
    """Give the same energy as squares: right to round-off also where strains are small.

    `corotated` is a difference of numbers of size μ, but quicker to differentiate.
    """
    import ufl

    d, away = polar.stretches, polar.F - polar.R
    return mu * ufl.inner(away, away) + lam / 2 * (polar.s - d) ** 2


def corotated_mixed(state: Any, lam: Any, mu: Any) -> Any:
    """μ‖U−I‖² + p (tr U − d) − p² / 2λ: the same where the pressure is p = λ tr(U−I).

    Parameters
    ----------
    state : MixedStretch
    lam, mu : ufl expressions
        Lamé constants, Pa.
    """
    import ufl

    d = state.stretches
    shear = mu * (ufl.inner(state.F, state.F) - 2 * state.s + d)
    return shear + state.p * (state.s - d) - state.p**2 / (2 * lam)


def corotated_mixed_value(state: Any, lam: Any, mu: Any) -> Any:
    """Give the stored energy as squares, by the equation of the pressure: p² / 2λ is its share."""
    import ufl

    away = state.F - state.R
    return mu * ufl.inner(away, away) + state.p**2 / (2 * lam)


def neo_hookean(polar: Any, lam: Any, mu: Any) -> Any:
    """½μ (tr C − d − 2 ln J) + ½λ ln² J, compressible neo-Hookean; in the plane, plane strain."""
    import ufl

    d, J = len(polar.F[0, :]), ufl.det(polar.F)
    return mu / 2 * (ufl.inner(polar.F, polar.F) - d - 2 * ufl.ln(J)) + lam / 2 * ufl.ln(J) ** 2


def neo_hookean_mixed(state: Any, lam: Any, mu: Any) -> Any:
    """½μ (tr C − d − 2 ln J) + p ln J − p² / 2λ: the same where the pressure is p = λ ln J.

    Parameters
    ----------
    state : MixedDeformation
    lam, mu : ufl expressions
        Lamé constants, Pa.
    """
    import ufl

    d, J = len(state.F[0, :]), ufl.det(state.F)
    shear = mu / 2 * (ufl.inner(state.F, state.F) - d - 2 * ufl.ln(J))
    return shear + state.p * ufl.ln(J) - state.p**2 / (2 * lam)


def st_venant_kirchhoff(polar: Any, lam: Any, mu: Any) -> Any:
    """μ E:E + ½λ tr² E with E = ½ (C − I); softens when pressed, and has no barrier at J = 0."""
    import ufl

    E = 0.5 * (polar.F.T * polar.F - ufl.Identity(len(polar.F[0, :])))
    return mu * ufl.inner(E, E) + lam / 2 * ufl.tr(E) ** 2


ENERGIES = {
    "corotated": corotated,
    "corotated_mixed": corotated_mixed,
    "neo_hookean": neo_hookean,
    "neo_hookean_mixed": neo_hookean_mixed,
    "st_venant_kirchhoff": st_venant_kirchhoff,
}
# densities to evaluate, where they are not those to differentiate
VALUES = {
    **ENERGIES,
    "corotated": corotated_value,
    "corotated_mixed": corotated_mixed_value,
}
