"""Internal forces of a moving body: linear, or of the corotated energy at finite rotation.

Both offer a step-averaged force, a discrete gradient of the energy: its work over a step is the
change of the stored energy, and it turns nothing, whatever the step (Simo & Tarnow, ZAMP 43,
1992; Gonzalez, CMAME 190, 2000). The linear one is the force at the mean displacement. The
corotated energy in the plane is a function of tr C and of

    q = (F₁₁ + F₂₂)² + (F₁₂ − F₂₁)² = tr C + 2 det F,

both quadratic in F and blind to rotations. So along the path on which they are linear the mean
stress is known in closed form: with s = √q, of which the energy is μ (tr C − 2 s + 2) +
½ λ (s − 2)², it is 2 μ F̄ + c ∂q/∂F(F̄), c = (½ λ (s₀ + s₁ − 4) − 2 μ) / (s₀ + s₁), where F̄ is
the mean of both deformation gradients.
"""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from reference.elasticity import lame, stiffness_form
from reference.space import ConformingSpace
from reference.strain_energies import corotated
from verify.scene import Material

__all__ = ["CorotatedLaw", "Law", "LinearLaw", "Matrix", "law_of"]

Array = NDArray[np.float64]


class Matrix:
    """A PETSc matrix that multiplies arrays."""

    def __init__(self, petsc_matrix: Any) -> None:
        self.petsc = petsc_matrix
        self._in, self._out = petsc_matrix.createVecs()

    def __matmul__(self, values: Array) -> Array:
        """Multiply an array (k,)."""
        self._in.array[:] = values
        self.petsc.mult(self._in, self._out)
        return np.array(self._out.array, dtype=float)


class Law(Protocol):
    """Forces (k,) and tangents (PETSc, to be destroyed by the caller) of displacements (k,)."""

    linear: bool

    def energy(self, u: Array) -> float:
        """Return the stored energy, J (in the plane per metre)."""
        ...

    def force(self, u: Array) -> Array:
        """Return the internal force, N."""
        ...

    def averaged(self, u: Array, later: Array) -> Array:
        """Return the mean force of a step: a discrete gradient of the energy."""
        ...

    def viscous(self, u: Array, v: Array) -> Array:
        """Product of the stiffness with a velocity, the rotations those of u."""
        ...

    def tangent(self, u: Array) -> Any:
        """Return the derivative of `force`."""
        ...

    def averaged_tangent(self, u: Array, later: Array) -> Any:
        """Return the derivative of `averaged` by the later displacement; not symmetric."""
        ...

    def viscous_tangent(self, u: Array) -> Any:
        """Return the derivative of `viscous` by the velocity."""
        ...


class LinearLaw:
    """Linear elasticity.

    Parameters
    ----------
    material : Material
    space : ConformingSpace
    """

    linear = True

    def __init__(self, material: Material, space: ConformingSpace) -> None:
        import ufl

        V = space.function_space
        form = stiffness_form(material, ufl.TrialFunction(V), ufl.TestFunction(V))
        self._stiffness = Matrix(_assembled(form))

    def energy(self, u: Array) -> float:
        """½ u·K u."""
        return 0.5 * float(u @ (self._stiffness @ u))

    def force(self, u: Array) -> Array:
        """K u."""
        return self._stiffness @ u

    def averaged(self, u: Array, later: Array) -> Array:
        """Return the force at the mean displacement."""
        return self._stiffness @ (0.5 * (u + later))

    def viscous(self, u: Array, v: Array) -> Array:
        """K v."""
        return self._stiffness @ v

    def tangent(self, u: Array) -> Any:
        """K."""
        return self._stiffness.petsc.copy()

    def averaged_tangent(self, u: Array, later: Array) -> Any:
        """½ K."""
        half = self.tangent(u)
        half.scale(0.5)
        return half

    def viscous_tangent(self, u: Array) -> Any:
        """K."""
        return self.tangent(u)


class CorotatedLaw:
    """μ‖U−I‖² + ½λ tr²(U−I) in the plane, at any rotation.

    Parameters
    ----------
    material : Material
    space : ConformingSpace
        In the plane.
    """

    linear = False

    def __init__(self, material: Material, space: ConformingSpace) -> None:
        import ufl
        from dolfinx import fem

        V = space.function_space
        lam, mu = (fem.Constant(V.mesh, value) for value in lame(material))
        dx = ufl.Measure("dx", domain=V.mesh, metadata={"quadrature_degree": 4 * space.degree - 2})
        self._before, self._after, self._velocity = (fem.Function(V) for _ in range(3))
        v, w = ufl.TestFunction(V), ufl.TrialFunction(V)
        first, last = (ufl.Identity(2) + ufl.grad(u) for u in (self._before, self._after))
        total = corotated(last, lam, mu) * dx
        force = ufl.derivative(total, self._after, v)
        mean = 0.5 * (first + last)
        reach = _stretch(first) + _stretch(last)
        share = (lam / 2 * (reach - 4) - 2 * mu) / reach
        stress = 2 * mu * mean + share * _slope(mean)
        averaged = ufl.inner(stress, ufl.grad(v)) * dx
        viscous = _turned_work(last, ufl.grad(self._velocity), ufl.grad(v), lam, mu) * dx
        damping = _turned_work(last, ufl.grad(w), ufl.grad(v), lam, mu) * dx
        self._energy, self._force = fem.form(total), fem.form(force)
        self._averaged, self._viscous = fem.form(averaged), fem.form(viscous)
        self._tangent = fem.form(ufl.derivative(force, self._after, w))
        self._averaged_tangent = fem.form(ufl.derivative(averaged, self._after, w))
        self._viscous_tangent = fem.form(damping)

    def energy(self, u: Array) -> float:
        """Integral of the energy density."""
        from dolfinx import fem

        self._after.x.array[:] = u
        return float(np.real(fem.assemble_scalar(self._energy)))

    def force(self, u: Array) -> Array:
        """Return the gradient of the energy."""
        self._after.x.array[:] = u
        return self._vector(self._force)

    def averaged(self, u: Array, later: Array) -> Array:
        """Return the mean force of a step; see the module."""
        self._before.x.array[:], self._after.x.array[:] = u, later
        return self._vector(self._averaged)

    def viscous(self, u: Array, v: Array) -> Array:
        """Return the force of the rate of strain, seen in the turned frame."""
        self._after.x.array[:], self._velocity.x.array[:] = u, v
        return self._vector(self._viscous)

    def tangent(self, u: Array) -> Any:
        """Return the exact tangent."""
        self._after.x.array[:] = u
        return _matrix(self._tangent)

    def averaged_tangent(self, u: Array, later: Array) -> Any:
        """Return the exact tangent of the mean force."""
        self._before.x.array[:], self._after.x.array[:] = u, later
        return _matrix(self._averaged_tangent)

    def viscous_tangent(self, u: Array) -> Any:
        """Return the stiffness with the rotations of u."""
        self._after.x.array[:] = u
        return _matrix(self._viscous_tangent)

    @staticmethod
    def _vector(form: Any) -> Array:
        from dolfinx import fem

        return np.array(fem.assemble_vector(form).array, dtype=float)


def law_of(material: Material, space: ConformingSpace, kinematics: str) -> Law:
    """Make the law of the kinematics of a scene."""
    return (LinearLaw if kinematics == "linear" else CorotatedLaw)(material, space)


def _stretch(F: Any) -> Any:
    """√q = tr U."""
    import ufl

    return ufl.sqrt((F[0, 0] + F[1, 1]) ** 2 + (F[0, 1] - F[1, 0]) ** 2)


def _slope(F: Any) -> Any:
    """∂q/∂F, linear in F."""
    import ufl

    trace, skew = 2 * (F[0, 0] + F[1, 1]), 2 * (F[0, 1] - F[1, 0])
    return ufl.as_matrix([[trace, skew], [-skew, trace]])


def _turned_work(F: Any, rate: Any, test: Any, lam: Any, mu: Any) -> Any:
    """Linear elastic work of two gradients turned back by the rotation of F."""
    import ufl

    c, s = (F[0, 0] + F[1, 1]) / _stretch(F), (F[1, 0] - F[0, 1]) / _stretch(F)
    back = ufl.as_matrix([[c, s], [-s, c]])
    one, other = (ufl.sym(back * gradient) for gradient in (rate, test))
    return 2 * mu * ufl.inner(one, other) + lam * ufl.tr(one) * ufl.tr(other)


def _assembled(form: Any) -> Any:
    from dolfinx import fem

    return _matrix(fem.form(form))


def _matrix(form: Any) -> Any:
    from dolfinx.fem import petsc

    matrix = petsc.assemble_matrix(form)
    matrix.assemble()
    return matrix
