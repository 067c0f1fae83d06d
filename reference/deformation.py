"""For forms: elastic moduli of a material, and deformations without eigenvalues, F = R U.

In the plane s = tr U is √((F₁₁+F₂₂)² + (F₁₂−F₂₁)²). In space it is the largest root of

    s⁴ − 2 I₁ s² − 8 J s + I₁² − 4 I₂ = 0,    I₁ = tr C, I₂ = ½ (I₁² − tr C²), J = det F

(Hoger & Carlson, Quart. Appl. Math. 42, 1984, have it for J > 0; where J < 0 the same root belongs
to the rotation next to F, and the least stretch is negative). Differentiated, it gives the rotation

    R = ∂s/∂F = ((s² + I₁) F + 2 s cof F − 2 F C) / (s³ − I₁ s − 2 J),

whose denominator is twice the product of all sums of two principal stretches. Newton's method finds
the numbers s at the quadrature points. They and this rational formula give a form and, by the chain
rule, its derivative.

On a membrane let P be the projection on the tangent plane of a triangle in space. F = P + ∇u with a
tangential gradient. The two stretches in the plane have J² = ½ (I₁² − tr C²), and

    s = √(I₁ + 2 J),    U = (C + J P) / s,    R = F U⁻¹,    U⁻¹ = (s P − U) / J.

R takes the tangent plane to the deformed one without stretch. There is no det F with a sign: a
membrane has no bending stiffness, and one folded over is as good as turned.

All of it is written in H = ∇u; terms that are 1 or I at rest are taken out by hand. Strains and
forces are right to round-off of H, and not of F. So a load of 1e-12 of Young's modulus is solved as
well as any other.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.scene import Material


def lame(material: Material) -> tuple[float, float]:
    """Compute Lamé constants (λ, μ) in Pa of one material; of a plane or thin body the reduced λ.

    That is so in plane stress and of membranes. Where materials differ by region, they are those
    outside the regions.
    """
    mu = material.young / (2 * (1 + material.poisson))
    lam = material.young * material.poisson / ((1 + material.poisson) * (1 - 2 * material.poisson))
    thin = material.plane == "stress" or material.thickness is not None
    return (2 * lam * mu / (lam + 2 * mu), mu) if thin else (lam, mu)


def lame_constants(material: Material, test: Any, factor: float = 1.0) -> tuple[Any, Any]:
    """Give λ and μ, times a factor, as UFL coefficients on the mesh of a test function.

    Constants, so that another material does not compile another form; where materials differ by
    region, functions that are constant in each cell, of the material at its centroid.

    Parameters
    ----------
    material : Material
    test : UFL expression
        Of arguments or functions of a space of DOLFINx.
    factor : float
    """
    rows = [tuple(factor * value for value in lame(one)) for one in material.each]
    return _by_cell(material, test, rows)


def density(material: Material, test: Any) -> Any:
    """Give the density in kg/m³, of a membrane in kg/m², as a UFL coefficient."""
    thickness = material.thickness or 1.0
    rows = [(thickness * float(one.density or 0.0),) for one in material.each]
    return _by_cell(material, test, rows)[0]


def wave_speed(material: Material) -> float:
    """Compute the speed of pressure waves in the quickest of the materials, m/s."""
    speeds = []
    for one in material.each:
        assert one.density is not None  # the scene has checked it
        e, nu = one.young, one.poisson
        modulus = e * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
        speeds.append(float(np.sqrt(modulus / one.density)))
    return max(speeds)


def _by_cell(material: Material, test: Any, rows: Sequence[tuple[float, ...]]) -> tuple[Any, ...]:
    """Compute coefficients of which each has one value per material (rows)."""
    from dolfinx import fem
    from ufl.algorithms import extract_arguments, extract_coefficients

    mesh = [*extract_arguments(test), *extract_coefficients(test)][0].ufl_function_space().mesh
    if material.is_uniform:
        return tuple(fem.Constant(mesh, np.asarray(value)) for value in rows[0])
    cellwise = fem.functionspace(mesh, ("DG", 0))
    # the one unknown of a cell lies at its centroid
    centroids = cellwise.tabulate_dof_coordinates()[:, : mesh.geometry.dim]
    number = material.number_at(centroids)
    found = []
    for values in np.array(rows, dtype=float).T:
        function = fem.Function(cellwise)
        function.x.array[:] = values[number]
        found.append(function)
    return tuple(found)


Array = NDArray[np.float64]
_MOST_ITERATIONS = 80  # a double root (an inverted cell without a nearest rotation) halves errors


class Deformation:
    """Gradient of a displacement, with the pressure that may be an unknown beside it.

    Parameters
    ----------
    solution : dolfinx.fem.Function
        Of a vector space on simplices: the displacement; or of a mixed space that has a pressure
        as its last component.
    degree : int, optional
        Of the quadrature of the forms, which must be measured by `measure`; default: UFL's.

    Attributes
    ----------
    F, H : ufl expressions (d, d)
        H = ∇u, F = I + H.
    J : ufl expression
        det F.
    p : ufl expression or None
        The pressure, Pa; positive in tension.
    measure : ufl.Measure
        dx with the quadrature of `degree`.
    """

    def __init__(self, solution: Any, degree: int | None = None) -> None:
        import ufl

        mesh = solution.function_space.mesh
        d = self._dimension = mesh.geometry.dim
        self._solution = solution
        self.p = solution[d] if len(solution) > d else None
        metadata = {} if degree is None else {"quadrature_degree": degree}
        self.measure = ufl.Measure("dx", domain=mesh, metadata=metadata)
        self.H = self.gradient(solution)
        self.F = ufl.Identity(d) + self.H
        self.J = ufl.det(self.F)

    def update(self) -> None:
        """Follow the solution; before a form is assembled."""

    def derivative(self, form: Any, direction: Any) -> Any:
        """Differentiate a form by the solution."""
        import ufl

        return ufl.derivative(form, self._solution, direction)

    def gradient(self, of: Any) -> Any:
        """Gradient of the displacement in a function or argument of the solution's space."""
        import ufl

        gradient, d = ufl.grad(of), self._dimension
        if len(of) == d:
            return gradient
        # not of a part split off: UFL does not differentiate it along its own direction
        return ufl.as_tensor([[gradient[i, j] for j in range(d)] for i in range(d)])


class PolarStretch(Deformation):
    """Deformation with the factors of its polar decomposition, in the plane or in space.

    Attributes
    ----------
    R : ufl expression (d, d)
    away : ufl expression (d, d)
        F − R = R (U − I).
    trace : ufl expression
        tr(U − I); where det F < 0 the least stretch is negative.
    """

    def __init__(self, solution: Any, degree: int) -> None:
        import ufl

        super().__init__(solution, degree)
        self._trace: Any = None
        mesh, d = solution.function_space.mesh, self._dimension
        turn = self._in_plane() if d == 2 else self._in_space(mesh, degree)
        self.R, self.away = ufl.Identity(d) + turn, self.H - turn
        self.update()

    def _in_plane(self) -> Any:
        """Set the trace; give R − I."""
        import ufl

        H, widening = self.H, ufl.tr(self.H)
        skew = H[0, 1] - H[1, 0]
        s = ufl.sqrt((2 + widening) ** 2 + skew**2)
        self.trace = (widening * (4 + widening) + skew**2) / (s + 2)
        along = widening - self.trace
        return ufl.as_tensor([[along, skew], [-skew, along]]) / s

    def _in_space(self, mesh: Any, degree: int) -> Any:
        """Make the trace a function at the quadrature points; give R − I."""
        import basix
        import basix.ufl
        import ufl
        from dolfinx import fem

        element = basix.ufl.quadrature_element("tetrahedron", value_shape=(), degree=degree)
        space = fem.functionspace(mesh, element)
        self._trace = self.trace = e = fem.Function(space)
        points, _ = basix.make_quadrature(basix.CellType.tetrahedron, degree)
        self._deformation = fem.Expression(self.H, np.array(points, dtype=float))
        cells = mesh.topology.index_map(3)
        self._cells = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
        self._dofs = np.asarray(space.dofmap.list).ravel()
        # numerator and denominator of R are 16 I and 16 at rest
        H, identity = self.H, ufl.Identity(3)
        G = H + H.T + H.T * H  # C − I
        cofactors = ufl.tr(H) * identity - H.T + ufl.cofac(H)  # cof F − I
        swelling = ufl.tr(H) + ufl.tr(ufl.cofac(H)) + ufl.det(H)  # J − 1
        g = ufl.tr(G)
        above = 12 * H + (6 * e + e**2 + g) * self.F + 6 * cofactors
        above += 2 * e * (identity + cofactors) - 2 * (H + G + H * G)
        below = 24 * e + 9 * e**2 + e**3 - (3 + e) * g - 2 * swelling
        return (above - below * identity) / (16 + below)

    def update(self) -> None:
        """Find the traces at the quadrature points in space."""
        if self._trace is not None:
            mesh = self._trace.function_space.mesh
            gradients = np.asarray(self._deformation.eval(mesh, self._cells), dtype=float)
            self._trace.x.array[self._dofs] = stretch_trace(gradients.reshape(-1, 3, 3))

    def derivative(self, form: Any, direction: Any) -> Any:
        """Differentiate a form by the solution: R is the derivative of the trace."""
        import ufl

        total = super().derivative(form, direction)
        if self._trace is None:
            return total
        along = ufl.inner(self.R, self.gradient(direction))
        return total + ufl.derivative(form, self._trace, along)


class MembraneStretch(Deformation):
    """Deformation of triangles in space, with its rotation and stretch in the tangent planes.

    F, R and `away` are of rank 2, otherwise as in `PolarStretch`; F = P + H.

    Attributes
    ----------
    J, trace : ufl expressions
        Change of area; sum of the two stretches, less 2.
    """

    def __init__(self, solution: Any, degree: int) -> None:
        import ufl

        super().__init__(solution, degree)
        mesh, H = solution.function_space.mesh, self.H
        plane = ufl.Jacobian(mesh) * ufl.JacobianInverse(mesh)
        self._normal = ufl.Identity(3) - plane
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

    def across(self, trial: Any, test: Any) -> Any:
        """Stiffness of a unit tension in all directions across the undeformed tangent planes."""
        import ufl

        return ufl.inner(self._normal * ufl.grad(trial), ufl.grad(test))


def stretch_trace(H: Array) -> Array:
    """Find tr(Rᵀ F − I) of F = I + H with the rotation R next to each F.

    Parameters
    ----------
    H : (n, 3, 3) array

    Returns
    -------
    (n,) array
        Sum of the singular values of F, the least one with the sign of det F, less 3; right to
        round-off of H.
    """
    parts = np.ascontiguousarray(np.reshape(H, (-1, 9)).T).reshape(3, 3, -1)
    e = _stretch_sum(parts + np.eye(3)[:, :, None]) - 3
    # one more of Newton's steps, on the quartic in e = s − 3: there nothing cancels. The slope is
    # 64 at rest; where it is small H is not
    G = _right(parts) + parts + parts.swapaxes(0, 1)
    g, k = _first(G), _second(G)
    j = _first(parts) + _second(parts) + _third(parts)  # J − 1
    value = e * (64 + e * (48 + e * (12 + e))) - e * (g * (12 + 2 * e) + 8 * j)
    value += g * g - 4 * k - 20 * g - 24 * j
    slope = 64 + e * (96 + e * (36 + 4 * e)) - g * (12 + 4 * e) - 8 * j
    return e - np.divide(value, slope, out=np.zeros_like(e), where=slope > 1.0)


def _stretch_sum(F: Array) -> Array:
    """Sum (n,) of the singular values of F (3, 3, n), the least one with the sign of det F."""
    C = _right(F)
    one, two, J = _first(C), _second(C), _third(F)
    s = np.sqrt(3 * one)  # an upper bound: all roots are real, so Newton's steps only descend
    going = np.flatnonzero(s > 0)
    for _ in range(_MOST_ITERATIONS):
        a, b, c, x = one[going], two[going], J[going], s[going]
        square = x * x
        slope = 4 * (x * (square - a) - 2 * c)
        value = square * (square - 2 * a) - 8 * c * x + a * a - 4 * b
        step = np.divide(value, slope, out=np.zeros_like(x), where=slope > 0)
        s[going] = x - step
        going = going[step > 1e-16 * x]
        if not len(going):
            break
    return s


# Invariants of matrices (3, 3, n), entry by entry: less than half of the time of einsum and det.


def _right(F: Array) -> Array:
    """Compute Fᵀ F."""
    C = np.empty_like(F)
    for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        C[i, j] = F[0, i] * F[0, j] + F[1, i] * F[1, j] + F[2, i] * F[2, j]
        C[j, i] = C[i, j]
    return C


def _first(A: Array) -> Array:
    return np.asarray(A[0, 0] + A[1, 1] + A[2, 2])


def _second(A: Array) -> Array:
    minors = [A[i, i] * A[j, j] - A[i, j] * A[j, i] for i, j in ((0, 1), (0, 2), (1, 2))]
    return np.asarray(minors[0] + minors[1] + minors[2])


def _third(A: Array) -> Array:
    return np.asarray(np.sum(A[0] * np.cross(A[1], A[2], axis=0), axis=0))
