"""Laws of elasticity: an energy in UFL, whose derivatives are forces and tangents.

The density is μ S + ½ λ θ², of a measure S of the shape and θ of the volume. With the pressure p =
λ θ as an unknown it is μ S + p θ − p² / 2λ, stationary in p. With quadratic displacements and
linear pressures the error is bounded uniformly in λ. Source: Brezzi & Fortin, Mixed and Hybrid
Finite Element Methods, 1991, VI. Statics and motions use the same law.

A step-averaged force of the energy–momentum scheme is a discrete gradient of the energy: its work
over a step is the change of the stored energy, and it turns nothing, whatever the step (Simo &
Tarnow, ZAMP 43, 1992; Gonzalez, CMAME 190, 2000). The linear one is the force at the mean
displacement. The corotated density is μ (tr C − 2 s + d) + ½ λ (s − d)² with s = tr U. As tr C is
quadratic in F, its mean stress is the stress of F̄, the mean of both deformation gradients. The
rest is

    s₁ − s₀ = D : (F₁ − F₀),   D F̄ᵀ symmetric,

which leaves the stress 2 μ (F̄ − D) + ½ λ (s₀ + s₁ − 2 d) D. In the plane s² = q = tr C + 2 det F
is quadratic and invariant to rotations: D = ∂q/∂F(F̄) / (s₀ + s₁). In space U₁² − U₀² = Ū (U₁ − U₀)
+ (U₁ − U₀) Ū with the mean stretch Ū = ½ (U₀ + U₁). So D = F̄ Ū⁻¹: exact, not 0/0 at rest, and
without a quadrature over the step. It needs a regular Ū: a cell that is pressed through zero volume
at a mean stretch of zero has no such mean force. On a membrane alike: there U is the stretch within
the tangent planes.

The neo-Hookean density is ½ μ (tr C − d) + H(J): μ F̄ + (H₁ − H₀)/(J₁ − J₀) D, and D as above of J
in place of s. In the plane J is quadratic: D = cof F̄. In space J² = det C is cubic in C: D =
2 F̄ K / (J₀ + J₁), K Simpson's mean of cof C over the step.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.deformation import (
    Deformation,
    MembraneStretch,
    PolarStretch,
    density,
    lame_constants,
)
from reference.linear_solvers import factorised
from reference.nodal_algebra import assembled_matrix, compiled, nodal_forces
from reference.space import ConformingSpace, Unknowns, mixed_unknowns
from verify.errors import InputError
from verify.scene import Material

Array = NDArray[np.float64]


class Strain(NamedTuple):
    """Measures of a deformation that an energy is made of (ufl expressions).

    Attributes
    ----------
    shape, volume : scalars
        S and θ.
    slopes : pair of (d, d) tensors, optional
        Derivatives of both by F, where those that UFL finds are slow or lose digits.
    """

    shape: Any
    volume: Any
    slopes: tuple[Any, Any] | None = None


def linear(state: Deformation) -> Strain:
    """Set up linear elasticity: ε : ε and tr ε."""
    import ufl

    strain = ufl.sym(state.H)
    return Strain(ufl.inner(strain, strain), ufl.tr(strain))


def corotated(state: Any) -> Strain:
    """Set up corotational elasticity with polar rotations: ‖U − I‖² and tr (U − I).

    The out-of-plane stretch is 1 in plane strain, and eliminated by λ in plane stress.
    """
    import ufl

    return Strain(ufl.inner(state.away, state.away), state.trace, (2 * state.away, state.R))


def neo_hookean(state: Deformation) -> Strain:
    """Compressible neo-Hookean material, in plane strain or space: ½ (tr C − d) − ln J and ln J."""
    import ufl

    d, log = len(state.F[0, :]), ufl.ln(state.J)
    return Strain((ufl.inner(state.F, state.F) - d) / 2 - log, log)


def stable_neo_hookean(state: Deformation) -> Strain:
    """½ (tr C − d) − (J − 1) + ½ (J − 1)² and J − 1: finite where J ≤ 0 (Macklin & Müller 2021).

    That is ½ μ (tr C − d) − μ (J − 1) + ½ (λ + μ) (J − 1)².
    """
    import ufl

    d, away = len(state.F[0, :]), state.J - 1
    return Strain((ufl.inner(state.F, state.F) - d) / 2 - away + away**2 / 2, away)


@dataclass(frozen=True)
class Energy:
    """Properties of an energy.

    Attributes
    ----------
    strain : callable
        Gives its measures of a deformation.
    kind : type
        Of the deformation.
    inverted : float
        Share of the body that may be inside out at singular places.
    """

    strain: Callable[[Any], Strain]
    kind: Any = Deformation
    inverted: float = 0.0


ENERGIES = {
    "linear": Energy(linear),
    "corotated": Energy(corotated, PolarStretch, 1e-3),
    "neo_hookean": Energy(neo_hookean),
    "stable_neo_hookean": Energy(stable_neo_hookean),
}


class Law:
    """Energy of a body, with its forces (k,) and tangents (PETSc, destroyed by the caller).

    Parameters
    ----------
    material : Material
    space : ConformingSpace
        Of degree 2, if there is a pressure.
    energy : str
        A name in `ENERGIES`.
    pressure : bool
        Whether the pressure is an unknown.

    Attributes
    ----------
    unknowns : Unknowns
        Of the tangents: the displacements, or these and pressures.
    solution : dolfinx.fem.Function
        Of `unknowns`: where forms are assembled, after `update`.
    state : Deformation
        Of the solution.
    mu : ufl expression
        Times the thickness of a membrane.
    work : ufl form
        Virtual work of the internal forces; with a pressure, of the saddle point.
    stiffness : ufl form
        Its derivative.
    test, trial : ufl arguments

    Raises
    ------
    InputError
        If a membrane is to have another energy than the corotated.
    """

    def __init__(
        self, material: Material, space: ConformingSpace, energy: str, pressure: bool = False
    ) -> None:
        import ufl

        self.unknowns: Unknowns = mixed_unknowns(space) if pressure else space
        V = self.unknowns.function_space
        self._kind = kind = ENERGIES[energy].kind
        if space.mesh.cell_dimension < space.dimension:
            if energy != "corotated":
                raise InputError(f"energy '{energy}' of a membrane; expected 'corotated'")
            self._kind = kind = MembraneStretch
        self.linear, self._energy = energy == "linear", energy
        self._degree = None if self.linear else quadrature(space)
        self.solution = self._function()
        self.state = state = kind(self.solution, self._degree)
        self.test, self.trial = v, w = ufl.TestFunction(V), ufl.TrialFunction(V)
        self._lam, self.mu = lam, mu = lame_constants(material, v, material.thickness or 1.0)
        strain, p = ENERGIES[energy].strain(state), state.p
        volume = lam / 2 * strain.volume**2
        if p is not None:
            volume = p * strain.volume - p**2 / (2 * lam)
        self._stored = (mu * strain.shape + volume) * state.measure
        if strain.slopes is None:
            self.work = state.derivative(self._stored, v)
        else:
            of_shape, of_volume = strain.slopes
            stress = mu * of_shape + (lam * strain.volume if p is None else p) * of_volume
            self.work = ufl.inner(stress, state.gradient(v)) * state.measure
            if p is not None:
                self.work += (strain.volume - p / lam) * v[space.dimension] * state.measure
        self.stiffness = state.derivative(self.work, w)
        self._start = np.zeros(0)  # displacements of `_before`

    # ----------------------------------------------------------------------- of the solution

    def update(self) -> None:
        """Follow the solution on this rank: share it, and find what forms need."""
        self.solution.x.scatter_forward()
        self.state.update()

    def stored(self) -> float:
        """Return the energy of the solution, J (in the plane per metre)."""
        from dolfinx import fem

        comm = self.unknowns.function_space.mesh.comm
        return float(comm.allreduce(float(np.real(fem.assemble_scalar(self._stored_form)))))

    @cached_property
    def work_form(self) -> Any:
        """Virtual work, compiled."""
        return compiled(self.work)

    @cached_property
    def stiffness_form(self) -> Any:
        """Stiffness, compiled."""
        return compiled(self.stiffness)

    @cached_property
    def _stored_form(self) -> Any:
        return compiled(self._stored)

    # ---------------------------------------------------------------- of nodal displacements

    def energy(self, u: Array) -> float:
        """Return the stored energy, J (in the plane per metre)."""
        self._put(u)
        return self.stored()

    def force(self, u: Array) -> Array:
        """Return the internal force, N: the gradient of the energy."""
        self._put(u)
        return nodal_forces(self.work_form, self.unknowns)

    def tangent(self, u: Array) -> Any:
        """Return the derivative of `force`."""
        self._put(u)
        return assembled_matrix(self.stiffness_form)

    def averaged(self, u: Array, later: Array) -> Array:
        """Return the mean force of a step: a discrete gradient of the energy."""
        self._put(later, u)
        return nodal_forces(self._mean_forms[0], self.unknowns)

    def averaged_tangent(self, u: Array, later: Array) -> Any:
        """Return the derivative of `averaged` by the later displacement; not symmetric."""
        self._put(later, u)
        return assembled_matrix(self._mean_forms[1])

    def viscous(self, u: Array, v: Array) -> Array:
        """Product of the stiffness at rest, turned by the rotations of u, with a velocity."""
        self._put(u)
        self._fill(self._velocity, v)
        return nodal_forces(self._viscous_forms[0], self.unknowns)

    def viscous_tangent(self, u: Array) -> Any:
        """Return the derivative of `viscous` by the velocity."""
        self._put(u)
        return assembled_matrix(self._viscous_forms[1])

    def _function(self) -> Any:
        from dolfinx import fem

        return fem.Function(self.unknowns.function_space)

    def _fill(self, function: Any, values: Array) -> None:
        function.x.array[: len(self.unknowns.nodal)] = self.unknowns.own_part(values)
        function.x.scatter_forward()

    def _put(self, after: Array, before: Array | None = None) -> None:
        self._fill(self.solution, after)
        self.state.update()
        if before is not None and not np.array_equal(self._start, before):  # the same in a step
            self._start = before.copy()
            self._fill(self._before, before)
            self._first.update()

    @cached_property
    def _before(self) -> Any:
        """Displacement at the start of a step."""
        return self._function()

    @cached_property
    def _velocity(self) -> Any:
        return self._function()

    @cached_property
    def _first(self) -> Any:
        """Deformation at the start of a step."""
        return self._kind(self._before, self._degree)

    @cached_property
    def _mean_forms(self) -> tuple[Any, Any]:
        """Work of the mean force of a step, and its derivative; see the module."""
        import ufl

        first, last = self._first, self.state
        if self._energy in ("neo_hookean", "stable_neo_hookean"):
            slope = _mean_slope(self._energy, self._lam, self.mu, first.J, last.J)
            mean = (first.F + last.F) / 2
            stress = self.mu * mean + slope * _mean_cofactors(mean, first, last)
        else:
            turn, away = _mean_turn(first, last)
            stress = 2 * self.mu * away + self._lam / 2 * (first.trace + last.trace) * turn
        work = ufl.inner(stress, ufl.grad(self.test)) * last.measure
        return compiled(work), compiled(last.derivative(work, self.trial))

    @cached_property
    def _viscous_forms(self) -> tuple[Any, Any]:
        return compiled(self._turned(self._velocity)), compiled(self._turned(self.trial))

    def _turned(self, rate: Any) -> Any:
        """Linear elastic work of a velocity, turned back by the rotations of the solution."""
        import ufl

        R = self.state.R
        one, other = (ufl.sym(R.T * ufl.grad(of)) for of in (rate, self.test))
        shape, volume = ufl.inner(one, other), ufl.tr(one) * ufl.tr(other)
        return (2 * self.mu * shape + self._lam * volume) * self.state.measure


class LinearLaw(Law):
    """Linear elasticity: its tangent is assembled once.

    A pressure has no inertia: p = C⁻¹ Bᵀ u follows the displacement, and leaves the stiffness
    K = A + B C⁻¹ Bᵀ: products solve for p, and the tangent is the saddle point of A, B and C.

    Parameters
    ----------
    material, space, pressure
        As for `Law`.
    """

    def __init__(self, material: Material, space: ConformingSpace, pressure: bool = False) -> None:
        super().__init__(material, space, "linear", pressure)
        self._matrix = assembled_matrix(self.stiffness_form)
        self._x, self._product = self._matrix.createVecs()
        self._pressure: Any = None
        if pressure:
            self._of_p = of_p = self.unknowns.indices(self.unknowns.pressures)
            self._compliance = self._matrix.createSubMatrix(of_p, of_p)  # −C
            self._compliance.scale(-1.0)
            self._pressure = factorised(self._compliance)

    def energy(self, u: Array) -> float:
        """Compute ½ u·K u."""
        return 0.5 * float(u @ self.force(u))

    def force(self, u: Array) -> Array:
        """Compute K u."""
        x, product = self._x, self._product
        x.array[:] = self.unknowns.own_part(u)
        self._matrix.mult(x, product)
        if self._pressure is not None:
            right = product.getSubVector(self._of_p)
            pressure = x.getSubVector(self._of_p)
            self._pressure.solve(right, pressure)
            product.restoreSubVector(self._of_p, right)
            x.restoreSubVector(self._of_p, pressure)
            self._matrix.mult(x, product)
        return self.unknowns.everywhere(product.array).ravel()

    def tangent(self, u: Array) -> Any:
        """Compute K, or the saddle point."""
        return self._matrix.copy()

    def averaged(self, u: Array, later: Array) -> Array:
        """Return the force at the mean displacement."""
        return self.force(0.5 * (u + later))

    def averaged_tangent(self, u: Array, later: Array) -> Any:
        """Compute ½ K."""
        half = self.tangent(u)
        half.scale(0.5)
        return half

    def viscous(self, u: Array, v: Array) -> Array:
        """Compute K v."""
        return self.force(v)

    def viscous_tangent(self, u: Array) -> Any:
        """Compute K."""
        return self.tangent(u)


def law_of(
    material: Material, space: ConformingSpace, kinematics: str, pressure: bool = False
) -> Law:
    """Make the law of the kinematics of a scene."""
    if kinematics == "linear":
        return LinearLaw(material, space, pressure)
    return Law(material, space, energy_of(material), pressure)


def energy_of(material: Material) -> str:
    """Return the name in `ENERGIES` of a material at finite rotation."""
    return "corotated" if material.model == "hooke" else material.model


def mass_matrix(material: Material, unknowns: Unknowns, where: str = "") -> Any:
    """Assemble the consistent mass (PETSc), kg; pressures have none.

    Raises
    ------
    InputError
        If there is no density; `where` names the case file.
    """
    import ufl

    if material.density is None:
        raise InputError("material.density is missing: motion and vibration need it", where)
    V, d = unknowns.function_space, unknowns.shape[1]
    u, v = (
        ufl.as_vector([of[i] for i in range(d)]) if len(of) > d else of
        for of in (ufl.TrialFunction(V), ufl.TestFunction(V))
    )
    return assembled_matrix(density(material, v) * ufl.inner(u, v) * ufl.dx)


def quadrature(space: ConformingSpace) -> int:
    """Compute the degree of the rule by which energies at finite rotation are integrated."""
    return 4 * space.degree - 2


def _mean_turn(first: Any, last: Any) -> tuple[Any, Any]:
    """Compute D of the module, a discrete gradient of tr U; and F̄ − D without cancellation."""
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


def _mean_slope(energy: str, lam: Any, mu: Any, before: Any, after: Any) -> Any:
    """Return (H₁ − H₀)/(J₁ − J₀) of a neo-Hookean energy, from J₀ `before` to J₁ `after`."""
    import ufl

    both = before + after
    if energy == "stable_neo_hookean":
        return (lam + mu) * (both / 2 - 1) - mu
    # ln J₁ − ln J₀ = 2 artanh x; below 0.01 what the series leaves out is round-off
    x = (after - before) / both
    near = 1 + x**2 / 3 + x**4 / 5 + x**6 / 7
    far = ufl.ln((1 + x) / (1 - x)) / (2 * x)
    mean = 2 * ufl.conditional(ufl.lt(abs(x), 0.01), near, far) / both
    return mean * (lam / 2 * ufl.ln(before * after) - mu)


def _mean_cofactors(mean: Any, first: Any, last: Any) -> Any:
    """Compute D of the module, a discrete gradient of J, with the mean F̄ of both gradients."""
    import ufl

    def cofactors(A: Any) -> Any:
        return ufl.det(A) * ufl.inv(A).T

    if len(mean[0, :]) == 2:
        return cofactors(mean)
    one, two = (state.F.T * state.F for state in (first, last))
    simpson = (cofactors(one) + 4 * cofactors((one + two) / 2) + cofactors(two)) / 6
    return 2 * mean * simpson / (first.J + last.J)
