"""Densities of strain energy as UFL expressions of the deformation, in the plane and in space."""

from typing import Any


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

    return mu * ufl.inner(polar.away, polar.away) + lam / 2 * polar.trace**2


def corotated_stress(polar: Any, lam: Any, mu: Any) -> Any:
    """Give its derivative by F, 2μ (F − R) + λ tr(U−I) R: quicker than differentiated."""
    return 2 * mu * polar.away + lam * polar.trace * polar.R


def corotated_mixed(state: Any, lam: Any, mu: Any) -> Any:
    """Give the same energy of a pressure p = λ tr(U−I), p² / 2λ being its share.

    Parameters
    ----------
    state : MixedStretch
    lam, mu : ufl expressions
        Lamé constants, Pa.
    """
    import ufl

    return mu * ufl.inner(state.away, state.away) + state.p**2 / (2 * lam)


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

    E = 0.5 * (polar.H + polar.H.T + polar.H.T * polar.H)
    return mu * ufl.inner(E, E) + lam / 2 * ufl.tr(E) ** 2


def virtual_work(energy: str, state: Any, lam: Any, mu: Any, test: Any) -> Any:
    """First variation of an energy, for a residual whose derivative is the tangent.

    Parameters
    ----------
    energy : str
        A name in `ENERGIES`.
    state : PolarStretch, MembraneStretch, MixedStretch or MixedDeformation
    lam, mu : ufl expressions
        Lamé constants, Pa.
    test : ufl argument
        In the space of the solution that `state` is of.

    Returns
    -------
    ufl form
        Measured by ``state.measure``. With a pressure it is that of the saddle point
        μ‖U−I‖² + p tr(U−I) − p² / 2λ, or of `neo_hookean_mixed`.
    """
    import ufl

    if energy == "corotated":
        stress = corotated_stress(state, lam, mu)
        return ufl.inner(stress, state.gradient(test)) * state.measure
    if energy == "corotated_mixed":
        stress = 2 * mu * state.away + state.p * state.R
        work = ufl.inner(stress, state.gradient(test))
        work += (state.trace - state.p / lam) * test[len(state.F[0, :])]
        return work * state.measure
    return state.derivative(ENERGIES[energy](state, lam, mu) * state.measure, test)


ENERGIES = {
    "corotated": corotated,
    "corotated_mixed": corotated_mixed,
    "neo_hookean": neo_hookean,
    "neo_hookean_mixed": neo_hookean_mixed,
    "st_venant_kirchhoff": st_venant_kirchhoff,
}
