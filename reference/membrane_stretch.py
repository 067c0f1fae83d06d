"""Rotation and stretch of a membrane's tangent planes, for forms.

With the projection P on the tangent plane of a triangle in space and F = P + ∇u, whose gradient is
tangential, the two stretches in the plane have I₁ = tr C and J² = ½ (I₁² − tr C²), C = Fᵀ F, and

    s = tr U = √(I₁ + 2 J),    U = (C + J P) / s,    R = F U⁻¹,    U⁻¹ = (s P − U) / J,

all written in ∇u, with what is 1 or P at rest taken out by hand, as in `PolarStretch`. R takes the
tangent plane to the deformed one without stretch. There is no det F with a sign: a membrane has no
bending stiffness, and one folded over is as good as turned.
"""

from typing import Any


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
    F, H, R : ufl expressions (3, 3)
        H = ∇u; F and R are of rank 2.
    away : ufl expression (3, 3)
        F − R.
    J, trace : ufl expressions
        Change of area; sum of the two stretches, less 2.
    normal : ufl expression (3, 3)
        Projection on the undeformed normals.
    measure : ufl.Measure
    """

    def __init__(self, displacement: Any, degree: int) -> None:
        import ufl

        mesh = displacement.function_space.mesh
        self._displacement = displacement
        self.measure = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": degree})
        plane = ufl.Jacobian(mesh) * ufl.JacobianInverse(mesh)
        self.normal = ufl.Identity(3) - plane
        H = self.H = self.gradient(displacement)
        F = self.F = plane + H
        G = plane * H + H.T * plane + H.T * H  # C − P
        g = ufl.tr(G)
        second = (g**2 - ufl.tr(G * G)) / 2
        self.J = ufl.sqrt(1 + g + second)
        swelling = (g + second) / (1 + self.J)  # J − 1
        s = ufl.sqrt(4 + g + 2 * swelling)
        self.trace = (g + 2 * swelling) / (s + 2)
        rest = self.trace - swelling
        less = ((G - rest * plane) / s - rest * plane) / self.J  # P − U⁻¹
        self.away = F * less
        self.R = F - self.away

    def update(self) -> None:
        """Do nothing: forms know the displacement."""

    def derivative(self, form: Any, direction: Any) -> Any:
        """Differentiate a form by the displacement."""
        import ufl

        return ufl.derivative(form, self._displacement, direction)

    def gradient(self, of: Any) -> Any:
        """Gradient of a displacement."""
        import ufl

        return ufl.grad(of)

    def across(self, trial: Any, test: Any) -> Any:
        """Stiffness of a unit tension in all directions across the undeformed tangent planes."""
        import ufl

        return ufl.inner(self.normal * ufl.grad(trial), ufl.grad(test))
