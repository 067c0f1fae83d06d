"""Internal forces of a moving body: linear, or of the corotated energy at finite rotation.

Both offer a step-averaged force, a discrete gradient of the energy: its work over a step is the
change of the stored energy, and it turns nothing, whatever the step (Simo & Tarnow, ZAMP 43,
1992; Gonzalez, CMAME 190, 2000). The linear one is the force at the mean displacement. The
corotated energy is μ (tr C − 2 s + d) + ½ λ (s − d)² with s = tr U, of which tr C is quadratic in
F, so that its mean stress is that of F̄, the mean of both deformation gradients. The rest is

    s₁ − s₀ = D : (F₁ − F₀),   D F̄ᵀ symmetric,

which leaves the stress 2 μ (F̄ − D) + ½ λ (s₀ + s₁ − 2 d) D. In the plane s² = q = tr C + 2 det F
is quadratic and blind to rotations: D = ∂q/∂F(F̄) / (s₀ + s₁). In space U₁² − U₀² =
Ū (U₁ − U₀) + (U₁ − U₀) Ū with the mean stretch Ū = ½ (U₀ + U₁), so that D = F̄ Ū⁻¹: exact, not 0/0
at rest, and without a quadrature over the step. It asks for a regular Ū: a cell that is pressed
through zero volume at a mean stretch of zero has no such mean force. On a membrane alike: there U
is the stretch within the tangent planes.
"""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from reference.elasticity import stiffness_form
from reference.linear_solvers import direct_solver
from reference.membrane_stretch import MembraneStretch
from reference.mixed_space import mixed_space
from reference.moduli import lame_constants
from reference.nearly_incompressible import saddle_form
from reference.nodal_algebra import (
    NodalMatrix,
    assembled_matrix,
    nodal_forces,
    nodal_integral,
)
from reference.polar_stretch import PolarStretch
from reference.space import ConformingSpace, SharedUnknowns
from reference.strain_energies import corotated, virtual_work
from verify.scene import Material

Array = NDArray[np.float64]


class Law(Protocol):
    """Forces (k,) and tangents (PETSc, to be destroyed by the caller) of displacements (k,).

    Attributes
    ----------
    linear : bool
    unknowns : SharedUnknowns
        Of the tangents: the displacements, and with them what the law eliminates.
    """

    linear: bool
    unknowns: SharedUnknowns

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

        self.unknowns: SharedUnknowns = space
        V = space.function_space
        form = stiffness_form(material, ufl.TrialFunction(V), ufl.TestFunction(V))
        self._stiffness = NodalMatrix(assembled_matrix(form), space)

    def energy(self, u: Array) -> float:
        """½ u·K u."""
        return 0.5 * float(u @ self.force(u))

    def force(self, u: Array) -> Array:
        """K u."""
        return self._stiffness @ u

    def averaged(self, u: Array, later: Array) -> Array:
        """Return the force at the mean displacement."""
        return self.force(0.5 * (u + later))

    def viscous(self, u: Array, v: Array) -> Array:
        """K v."""
        return self.force(v)

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


class MixedLaw(LinearLaw):
    """Linear elasticity with a pressure, so that nothing locks; its tangents are saddle points.

    The pressure has no inertia: p = C⁻¹ Bᵀ u follows the displacement, and leaves the stiffness
    K = A + B C⁻¹ Bᵀ: products solve for p, and its inverse is that of the saddle point.

    Parameters
    ----------
    material : Material
    space : ConformingSpace
        Of degree 2.
    """

    def __init__(self, material: Material, space: ConformingSpace) -> None:
        import ufl

        self.unknowns = mixed = mixed_space(space)
        W = mixed.function_space
        form = saddle_form(material, ufl.TrialFunctions(W), ufl.TestFunctions(W))
        self._saddle = assembled_matrix(form)
        self._x, self._product = self._saddle.createVecs()
        of_p = mixed.pressure_indices()
        self._of_p = of_p
        self._compliance = self._saddle.createSubMatrix(of_p, of_p)  # −C
        self._compliance.scale(-1.0)
        self._pressure = direct_solver(self._compliance)

    def force(self, u: Array) -> Array:
        """K u."""
        x, product = self._x, self._product
        x.array[:] = self.unknowns.own_part(u)
        self._saddle.mult(x, product)
        right = product.getSubVector(self._of_p)
        pressure = x.getSubVector(self._of_p)
        self._pressure.solve(right, pressure)
        product.restoreSubVector(self._of_p, right)
        x.restoreSubVector(self._of_p, pressure)
        self._saddle.mult(x, product)
        return self.unknowns.everywhere(product.array).ravel()

    def tangent(self, u: Array) -> Any:
        """Saddle point of A, B and C."""
        return self._saddle.copy()


class CorotatedLaw:
    """μ‖U−I‖² + ½λ tr²(U−I) at any rotation.

    Parameters
    ----------
    material : Material
    space : ConformingSpace
    """

    linear = False

    def __init__(self, material: Material, space: ConformingSpace) -> None:
        import ufl
        from dolfinx import fem

        self._space = space
        self.unknowns: SharedUnknowns = space
        V = space.function_space
        thickness = material.thickness or 1.0
        self._before, self._after, self._velocity = (fem.Function(V) for _ in range(3))
        v, w = ufl.TestFunction(V), ufl.TrialFunction(V)
        lam, mu = lame_constants(material, v, thickness)
        degree = 4 * space.degree - 2
        polar = MembraneStretch if space.mesh.cell_dimension < space.dimension else PolarStretch
        first, last = (polar(u, degree) for u in (self._before, self._after))
        self._first, self._last, dx = first, last, last.measure
        force = virtual_work("corotated", last, lam, mu, v)
        turn, away = _mean_turn(first, last)
        stress = 2 * mu * away + lam / 2 * (first.trace + last.trace) * turn
        averaged = ufl.inner(stress, ufl.grad(v)) * dx
        viscous = _turned_work(last.R, ufl.grad(self._velocity), ufl.grad(v), lam, mu) * dx
        damping = _turned_work(last.R, ufl.grad(w), ufl.grad(v), lam, mu) * dx
        self._energy = fem.form(corotated(last, lam, mu) * dx)
        self._force = fem.form(force)
        self._averaged, self._viscous = fem.form(averaged), fem.form(viscous)
        self._tangent = fem.form(last.derivative(force, w))
        self._averaged_tangent = fem.form(last.derivative(averaged, w))
        self._viscous_tangent = fem.form(damping)

    def energy(self, u: Array) -> float:
        """Integral of the energy density."""
        self._put(u)
        return nodal_integral(self._energy, self._space)

    def force(self, u: Array) -> Array:
        """Return the gradient of the energy."""
        self._put(u)
        return nodal_forces(self._force, self._space)

    def averaged(self, u: Array, later: Array) -> Array:
        """Return the mean force of a step; see the module."""
        self._put(later, u)
        return nodal_forces(self._averaged, self._space)

    def viscous(self, u: Array, v: Array) -> Array:
        """Return the force of the rate of strain, seen in the turned frame."""
        self._put(u)
        self._velocity.x.array[:] = self._space.local_part(v)
        return nodal_forces(self._viscous, self._space)

    def tangent(self, u: Array) -> Any:
        """Return the exact tangent."""
        self._put(u)
        return assembled_matrix(self._tangent)

    def averaged_tangent(self, u: Array, later: Array) -> Any:
        """Return the exact tangent of the mean force."""
        self._put(later, u)
        return assembled_matrix(self._averaged_tangent)

    def viscous_tangent(self, u: Array) -> Any:
        """Return the stiffness with the rotations of u."""
        self._put(u)
        return assembled_matrix(self._viscous_tangent)

    def _put(self, after: Array, before: Array | None = None) -> None:
        self._after.x.array[:] = self._space.local_part(after)
        self._last.update()
        if before is None:
            return
        values = self._space.local_part(before)
        if not np.array_equal(self._before.x.array, values):  # it stays the same within a step
            self._before.x.array[:] = values
            self._first.update()


def law_of(
    material: Material, space: ConformingSpace, kinematics: str, pressure: bool = False
) -> Law:
    """Make the law of the kinematics of a scene; a linear one with a pressure if that is wanted."""
    if kinematics != "linear":
        return CorotatedLaw(material, space)
    return (MixedLaw if pressure else LinearLaw)(material, space)


def _mean_turn(
    first: PolarStretch | MembraneStretch, last: PolarStretch | MembraneStretch
) -> tuple[Any, Any]:
    """D of the module, a discrete gradient of tr U; and F̄ − D without cancellation."""
    import ufl

    mean = 0.5 * (first.F + last.F)
    if len(mean[0, :]) == 2:
        H = 0.5 * (first.H + last.H)
        both = first.trace + last.trace
        along, skew = 2 * ufl.tr(H) - both, 2 * (H[0, 1] - H[1, 0])
        turn = ufl.as_tensor([[along, skew], [-skew, along]]) / (4 + both)  # D − I
        return ufl.Identity(2) + turn, H - turn
    # Ū − I, or within the tangent plane of a membrane Ū less its identity
    strain = 0.5 * sum(ufl.sym(state.R.T * state.away) for state in (first, last))
    turn = mean * ufl.inv(ufl.Identity(3) + strain)
    return turn, turn * strain


def _turned_work(turn: Any, rate: Any, test: Any, lam: Any, mu: Any) -> Any:
    """Linear elastic work of two gradients turned back by a rotation."""
    import ufl

    one, other = (ufl.sym(turn.T * gradient) for gradient in (rate, test))
    return 2 * mu * ufl.inner(one, other) + lam * ufl.tr(one) * ufl.tr(other)
