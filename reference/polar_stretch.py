"""Rotation and stretch of a deformation gradient F = R U for forms, without eigenvalues.

In the plane s = tr U is √((F₁₁+F₂₂)² + (F₁₂−F₂₁)²). In space it is the largest root of

    s⁴ − 2 I₁ s² − 8 J s + I₁² − 4 I₂ = 0,    I₁ = tr C, I₂ = ½ (I₁² − tr C²), J = det F

(Hoger & Carlson, Quart. Appl. Math. 42, 1984, have it for J > 0; where J < 0 the same root belongs
to the rotation next to F, and the least stretch is negative). Differentiated, it gives the rotation

    R = ∂s/∂F = ((s² + I₁) F + 2 s cof F − 2 F C) / (s³ − I₁ s − 2 J),

whose denominator is twice the product of all sums of two principal stretches. So the numbers s at
the quadrature points, found by Newton's method, and this rational formula do for a form and, by the
chain rule, for its derivative.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["PolarStretch", "stretch_sum"]

Array = NDArray[np.float64]
_MOST_ITERATIONS = 80  # a double root (an inverted cell without a nearest rotation) halves errors


class PolarStretch:
    """Deformation gradient of a displacement, with the factors of its polar decomposition.

    Parameters
    ----------
    solution : dolfinx.fem.Function
        Of a vector space on triangles or tetrahedra: the displacement.
    degree : int
        Of the quadrature of the forms; they must be measured by `measure`.

    Attributes
    ----------
    F, R : ufl expressions (d, d)
    J : ufl expression
        det F.
    s : ufl expression
        tr U; less than the sum of the singular values of F where det F < 0.
    stretches : int
        Number of principal stretches: d.
    measure : ufl.Measure
        dx with the quadrature of `degree`.
    """

    def __init__(self, solution: Any, degree: int) -> None:
        import basix
        import basix.ufl
        import ufl
        from dolfinx import fem

        mesh = solution.function_space.mesh
        d = mesh.geometry.dim
        self._solution = solution
        self._stretch: Any = None
        self.measure = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": degree})
        F = self.F = ufl.Identity(d) + self._gradient(solution)
        self.J, self.stretches = ufl.det(F), d
        if d == 2:
            self.s = ufl.sqrt((F[0, 0] + F[1, 1]) ** 2 + (F[0, 1] - F[1, 0]) ** 2)
            self.R = (F + ufl.cofac(F)) / self.s
            return
        element = basix.ufl.quadrature_element("tetrahedron", value_shape=(), degree=degree)
        space = fem.functionspace(mesh, element)
        self._stretch = self.s = fem.Function(space)
        points, _ = basix.make_quadrature(basix.CellType.tetrahedron, degree)
        self._deformation = fem.Expression(F, np.array(points, dtype=float))
        cells = mesh.topology.index_map(3)
        self._cells = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
        self._dofs = np.asarray(space.dofmap.list).ravel()
        C = F.T * F
        above = (self.s**2 + ufl.tr(C)) * F + 2 * self.s * ufl.cofac(F) - 2 * F * C
        self.R = above / (self.s**3 - ufl.tr(C) * self.s - 2 * ufl.det(F))
        self.update()

    def update(self) -> None:
        """Follow the displacement; before a form is assembled."""
        if self._stretch is not None:
            mesh = self._stretch.function_space.mesh
            gradients = np.asarray(self._deformation.eval(mesh, self._cells), dtype=float)
            self._stretch.x.array[self._dofs] = stretch_sum(gradients.reshape(-1, 3, 3))

    def derivative(self, form: Any, direction: Any) -> Any:
        """Differentiate a form by the solution: R is the derivative of s."""
        import ufl

        total = ufl.derivative(form, self._solution, direction)
        if self._stretch is None:
            return total
        along = ufl.inner(self.R, self._gradient(direction))
        return total + ufl.derivative(form, self._stretch, along)

    def _gradient(self, of: Any) -> Any:
        """Gradient of the displacement in a function or argument of the solution's space."""
        import ufl

        return ufl.grad(of)


def stretch_sum(F: Array) -> Array:
    """Find tr(Rᵀ F) with the rotation R next to each F.

    Parameters
    ----------
    F : (n, 3, 3) array

    Returns
    -------
    (n,) array
        Sum of the singular values, the least one with the sign of det F.
    """
    C = np.einsum("nki,nkj->nij", F, F)
    one = np.einsum("nii->n", C)
    two = 0.5 * (one**2 - np.einsum("nij,nij->n", C, C))
    J = np.linalg.det(F)
    s = np.sqrt(3 * one)  # an upper bound: all roots are real, so Newton's steps only descend
    going = np.flatnonzero(s > 0)
    for _ in range(_MOST_ITERATIONS):
        a, b, c, x = one[going], two[going], J[going], s[going]
        slope = 4 * (x**3 - a * x - 2 * c)
        value = x**4 - 2 * a * x**2 - 8 * c * x + a**2 - 4 * b
        step = np.divide(value, slope, out=np.zeros_like(x), where=slope > 0)
        s[going] = x - step
        going = going[step > 1e-16 * x]
        if not len(going):
            break
    return s
