"""Rotation and stretch of a membrane's tangent planes, for forms.

With the projection P on the tangent plane of a triangle in space and F = P + ∇u, whose gradient is
tangential, the two stretches in the plane have I₁ = tr C and J² = ½ (I₁² − tr C²), C = Fᵀ F, and

    s = tr U = √(I₁ + 2 J),    R = ∂s/∂F = (s F − (F C + J F) / s) / J.

R takes the tangent plane to the deformed one without stretch. There is no det F with a sign: a
membrane has no bending stiffness, and one folded over is as good as turned.
"""

from typing import Any

__all__ = ["MembraneStretch"]


class MembraneStretch:
    """Like `PolarStretch`, of a displacement on triangles in space.

    Parameters
    ----------
    displacement : dolfinx.fem.Function
        Of a vector space on triangles in space.
    degree : int
        Of the quadrature.

    Attributes
    ----------
    F, R : ufl expressions (3, 3)
        Of rank 2.
    J, s : ufl expressions
        Change of area; sum of the two stretches.
    stretches : int
        2.
    normal : ufl expression (3, 3)
        Projection on the undeformed normals.
    measure : ufl.Measure
    """

    def __init__(self, displacement: Any, degree: int) -> None:
        import ufl

        mesh = displacement.function_space.mesh
        self._displacement, self.stretches = displacement, 2
        self.measure = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": degree})
        plane = ufl.Jacobian(mesh) * ufl.JacobianInverse(mesh)
        self.normal = ufl.Identity(3) - plane
        F = self.F = plane + ufl.grad(displacement)
        C = F.T * F
        self.J = ufl.sqrt((ufl.tr(C) ** 2 - ufl.tr(C * C)) / 2)
        self.s = ufl.sqrt(ufl.tr(C) + 2 * self.J)
        self.R = (self.s * F - (F * C + self.J * F) / self.s) / self.J

    def update(self) -> None:
        """Do nothing: forms know the displacement."""

    def derivative(self, form: Any, direction: Any) -> Any:
        """Differentiate a form by the displacement."""
        import ufl

        return ufl.derivative(form, self._displacement, direction)

    def across(self, trial: Any, test: Any) -> Any:
        """Stiffness of a unit tension in all directions across the undeformed tangent planes."""
        import ufl

        return ufl.inner(self.normal * ufl.grad(trial), ufl.grad(test))
