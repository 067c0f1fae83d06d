"""Densities of strain energy in the plane, as UFL expressions of the deformation gradient."""

from typing import Any

__all__ = ["ENERGIES", "corotated", "neo_hookean"]


def corotated(F: Any, lam: Any, mu: Any) -> Any:
    """μ‖U−I‖² + ½λ tr²(U−I), the potential of corotational linear elasticity with polar rotations.

    In the plane tr U = √((F₁₁+F₂₂)² + (F₁₂−F₂₁)²), so that no eigenvalues are needed. The
    out-of-plane stretch is 1 in plane strain, and eliminated by λ in plane stress.
    """
    import ufl

    stretch = ufl.sqrt((F[0, 0] + F[1, 1]) ** 2 + (F[0, 1] - F[1, 0]) ** 2)
    return mu * (ufl.inner(F, F) - 2 * stretch + 2) + lam / 2 * (stretch - 2) ** 2


def neo_hookean(F: Any, lam: Any, mu: Any) -> Any:
    """½μ (tr C − 2 − 2 ln J) + ½λ ln² J, compressible neo-Hookean in plane strain."""
    import ufl

    J = ufl.det(F)
    return mu / 2 * (ufl.inner(F, F) - 2 - 2 * ufl.ln(J)) + lam / 2 * ufl.ln(J) ** 2


ENERGIES = {"corotated": corotated, "neo_hookean": neo_hookean}
