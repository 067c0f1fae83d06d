"""Energy-momentum scheme: the stress is averaged over the step.

The work of the average is the change of strain energy, exactly.

The potential is quadratic in F but for the trace of the stretch, t. Its discrete gradient needs
only a T with T : (F₁ − F₀) = t₁ − t₀ that is R in the limit and has T Fₘᵀ symmetric, so that
angular momentum is kept, Fₘ = (F₀ + F₁)/2. Then

    P = 2μ (Fₘ − T) + λ (½(t₀ + t₁) − d) T.

In the plane t R is linear in F, and T = (t₀ R₀ + t₁ R₁)/(t₀ + t₁). In space
U₁² − U₀² = ½[(U₁−U₀)(U₀+U₁) + (U₀+U₁)(U₁−U₀)], hence t₁ − t₀ = (U₀+U₁)⁻¹ : (C₁ − C₀) and
T = 2 Fₘ A⁻¹, A = U₀ + U₁. Neither has a quotient that is 0/0 at rest. Where an inverted element
makes A indefinite, T = R(Fₘ) plus a multiple of Fₘ (C₁ − C₀) takes its place (Gonzalez 2000), and
keeps it to the end of the step, so that Newton's method does not alternate between the two.

The derivative by the end of the step, with c = λ(½(t₀ + t₁) − d) − 2μ, is

    dP = μ dF + ½λ (R₁ : dF) T + c dT,   dT = (dF − T dU₁) A⁻¹,   dU₁ = R₁ᵀdF + dR₁ᵀF₁.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from verify.xfem.arrays import Bools, Floats
from verify.xfem.body import DynamicBody, StepForces
from verify.xfem.element import Elements, add_moduli, polar_slope, restricted
from verify.xfem.errors import XfemError
from verify.xfem.implicit import NewtonIntegrator
from verify.xfem.internal_force import TangentKind
from verify.xfem.linear_solvers import LinearSolver
from verify.xfem.polar import SPINS, adjugate, nearest_rotations

_REGULAR = 1e-6  # smallest pivot of A over its trace
_STILL = 1e-26  # square of a relative change of C that is round-off
_SINGULAR = 1e-18  # determinant over the cube of the trace: a rotation without a derivative
# after so many evaluations in a step, cells that have taken the substitute keep it
_FREE_EVALUATIONS = 8
# ∂(t R)/∂F in the plane: t R = [[a, −b], [b, a]], a = F₀₀ + F₁₁, b = F₁₀ − F₀₁
_IN_PLANE = np.einsum("kn,lm->knlm", np.eye(2), np.eye(2))
_IN_PLANE += np.einsum("akn,alm->knlm", SPINS[2], SPINS[2])


class StepEnds(NamedTuple):
    """Deformation gradients and rotations (p, d, d) at the start and at the end of a step."""

    F0: Floats
    F1: Floats
    R0: Floats
    R1: Floats

    def of(self, some: Bools) -> "StepEnds":
        """Return those of some elements."""
        return StepEnds(*(X[some] for X in self))

    @property
    def traces(self) -> tuple[Floats, Floats]:
        """Traces t (p,) of both stretches."""
        return _inner(self.R0, self.F0), _inner(self.R1, self.F1)


def averaged_stress(elements: Elements, ends: StepEnds, substituted: Bools) -> Floats:
    """Stress P (p, d, d) averaged over a step; elements that need the substitute are marked.

    Parameters
    ----------
    elements : Elements
    ends : StepEnds
    substituted : (p,) bool array
        Elements that have taken the substitute in this step; added to.
    """
    T = _secant(elements, ends, substituted)
    _, mu, factor = _factors(elements, ends)
    return mu * (ends.F0 + ends.F1) + factor * T


def averaged_moduli(elements: Elements, ends: StepEnds, substituted: Bools) -> Floats:
    """∂P/∂F₁ (p, d, d, d, d), the last two indices those of F₁; not symmetric.

    Arguments as the last call of `averaged_stress` left them.
    """
    T = _secant(elements, ends, substituted)
    if len(elements.axes) == 2:
        t0, t1 = ends.traces
        total = np.where(t0 + t1 > 0.0, t0 + t1, np.inf)[:, None, None, None, None]
        dT = (_IN_PLANE - np.einsum("pkn,plm->pknlm", T, ends.R1)) / total
    else:
        dT, some = np.empty((len(T), 3, 3, 3, 3)), ~substituted
        dT[some] = _plain_slope(elements, ends, T, some)
        if substituted.any():
            dT[substituted] = _substitute(ends.of(substituted))[1]
    lam, mu, factor = _factors(elements, ends)
    slope = factor[..., None, None] * dT
    slope += np.einsum("pkn,plm->pknlm", 0.5 * lam * T, ends.R1)
    identity = np.eye(len(elements.axes))
    return slope + mu[..., None, None] * np.einsum("kl,nm->knlm", identity, identity)


def _inner(A: Floats, B: Floats) -> Floats:
    return np.einsum("pkl,pkl->p", A, B)


def _factors(elements: Elements, ends: StepEnds) -> tuple[Floats, Floats, Floats]:
    """λ, μ and c, each (p, 1, 1)."""
    lam, mu = (x[elements.parent, None, None] for x in (elements.lam, elements.mu))
    t0, t1 = ends.traces
    dim = len(elements.corners) - 1
    return lam, mu, lam * (0.5 * (t0 + t1) - dim)[:, None, None] - 2.0 * mu


def _secant(elements: Elements, ends: StepEnds, substituted: Bools) -> Floats:
    """T (p, d, d); elements that need the substitute are marked."""
    t0, t1 = (t[:, None, None] for t in ends.traces)
    if len(elements.axes) == 2:
        defined = t0 + t1 > 0.0
        substituted[:] = ~defined[:, 0, 0]
        mean = (t0 * ends.R0 + t1 * ends.R1) / np.where(defined, t0 + t1, 1.0)
        return np.where(defined, mean, ends.R1)
    A, inverse, least = _mean_stretch(elements, ends)
    minor = A[:, 0, 0] * A[:, 1, 1] - A[:, 0, 1] ** 2
    determinant = np.linalg.det(A)
    regular = (A[:, 0, 0] > least) & (minor > least * A[:, 0, 0]) & (determinant > least * minor)
    substituted |= ~regular
    T = (ends.F0 + ends.F1) @ inverse
    if substituted.any():
        T[substituted] = _substitute(ends.of(substituted))[0]
    return T


def _mean_stretch(elements: Elements, ends: StepEnds) -> tuple[Floats, Floats, Floats]:
    """Return A (p, 3, 3), of membranes regular across their plane, its inverse, a threshold."""
    A = ends.R0.transpose(0, 2, 1) @ ends.F0 + ends.R1.transpose(0, 2, 1) @ ends.F1
    A = 0.5 * (A + A.transpose(0, 2, 1)) + 2.0 * (np.eye(3) - restricted(elements))
    cofactors, determinant = adjugate(A)
    inverse = cofactors / np.where(determinant == 0.0, 1.0, determinant)[:, None, None]
    return A, inverse, _REGULAR * np.einsum("pkk->p", A)


def _plain_slope(elements: Elements, ends: StepEnds, T: Floats, some: Bools) -> Floats:
    inverse = _mean_stretch(elements, ends)[1][some]
    R1, F1 = ends.R1[some], ends.F1[some]
    dR, _ = polar_slope(R1, F1, _SINGULAR)
    identity = np.eye(3)
    dU = np.einsum("plk,nm->pknlm", R1, identity) + np.einsum("paklm,pan->pknlm", dR, F1)
    change = np.einsum("kl,nm->knlm", identity, identity) - np.einsum(
        "pka,panlm->pknlm", T[some], dU
    )
    return np.einsum("pkblm,pbn->pknlm", change, inverse)


def _substitute(ends: StepEnds) -> tuple[Floats, Floats]:
    """T and dT of the substitute."""
    F0, F1, _, R1 = ends
    t0, t1 = ends.traces
    G = F0 + F1
    middle = nearest_rotations(G)
    dT, _ = polar_slope(middle, G, _SINGULAR)
    C1 = F1.transpose(0, 2, 1) @ F1
    change = C1 - F0.transpose(0, 2, 1) @ F0
    half = np.einsum("ma,plb->pablm", np.eye(3), F1)
    dC = half + half.transpose(0, 2, 1, 3, 4)
    square = _inner(change, change)
    moving = square > _STILL * _inner(C1, C1)
    square = np.where(moving, square, 1.0)[:, None, None]
    factor = np.where(moving, t1 - t0 - _inner(middle, F1 - F0), 0.0)[:, None, None] / square
    slope = R1 - middle - np.einsum("pknlm,pkn->plm", dT, F1 - F0)
    slope = (slope - 2.0 * factor * np.einsum("pab,pablm->plm", change, dC)) / square
    slope[~moving] = 0.0
    D = G @ change
    dT += np.einsum("plm,pkn->pknlm", slope, D)
    moved = np.einsum("kl,pmn->pknlm", np.eye(3), change) + np.einsum("pka,panlm->pknlm", G, dC)
    return middle + factor * D, dT + factor[..., None, None] * moved


class EnergyMomentum(NewtonIntegrator):
    """Conserves energy, linear and angular momentum of a free body at any amplitude and step.

    The internal force is a discrete gradient of the potential; the docstring of the module has the
    equations. Its stiffness is not symmetric, and differs from half of that at the end by the
    square of the turn in a step. Corrections take the latter, which is found in a tenth of the
    time, as long as each takes half of the residual off.

    Parameters
    ----------
    body : DynamicBody
    step_size : float
        In seconds.

    Attributes
    ----------
    substituted : (p,) bool array
        Pieces that, in the last step, were too inverted for the stress in its plain form.

    Raises
    ------
    XfemError
        If the body is one of springs, which have no stress to average, or the step is none.
    """

    rate = 2.0
    share = 0.5
    tolerance = 1e-12

    def __init__(self, body: DynamicBody, step_size: float) -> None:
        if not body.force.has_stress:
            raise XfemError("springs have no stress field; expected an integrator that needs none")
        super().__init__(body, step_size)
        self._first = body.force.rotations.copy()
        self._evaluations = 0
        self._takes_all = False  # of the derivative of the force
        self.substituted = np.zeros(len(self._first), dtype=bool)

    @cached_property
    def _general(self) -> LinearSolver:
        return self.body.force.kernels.general(self.body.pattern, self.body.shape[1])

    def _prepare(self) -> None:
        force = self.body.force
        if not force.has_one_pass:
            force.evaluate(self._start.displacement)
            self._first[:] = force.rotations
        self._evaluations = 0
        self._takes_all = False

    def _forces(self, displacement: Floats, velocity: Floats, time: float) -> StepForces:
        body, start = self.body, self._start
        internal = np.zeros(body.shape)
        if body.force.is_corotational:
            self._evaluations += 1
            if self._evaluations <= _FREE_EVALUATIONS:
                self.substituted[:] = False
            self._average(displacement, internal)
        else:
            mean = 0.5 * (start.displacement + displacement)
            body.force.add_tangent_product(mean, 1.0, internal)
        middle = start.time + 0.5 * self.step_size
        viscous = body.viscous(0.5 * (start.velocity + velocity))
        return StepForces(internal, body.external(middle), viscous)

    def _ends(self, displacement: Floats) -> StepEnds:
        """Both ends of the step, with the rotations of the last evaluation."""
        force = self.body.force
        F0 = force.deformation(self._start.displacement).copy()
        return StepEnds(F0, force.deformation(displacement), self._first, force.rotations)

    def _average(self, displacement: Floats, internal: Floats) -> None:
        """Write the force of a step that ends like this; substituted cells are updated."""
        force, before = self.body.force, self._start.displacement
        if force.has_one_pass:
            force.linearise_average(
                self.body.pattern, before, displacement, self.substituted, self._stiffness_share,
                internal, self._blocks, not self._solver.reads_half, self.share,
            )  # fmt: skip
            self._is_linearised = True
            return
        force.evaluate(displacement)
        P = averaged_stress(force.elements, self._ends(displacement), self.substituted)
        P *= force.elements.volumes[:, None, None]
        gradients = force.elements.gradients[force.elements.parent]
        internal[:] = force.nodal_force(gradients @ P.transpose(0, 2, 1))
        force.add_penalty(0.5 * (before + displacement), 1.0, internal)

    def _solved(self, displacement: Floats, residual: Floats, kind: TangentKind) -> Floats:
        self._takes_all |= self._is_slow and self.body.force.is_corotational
        if not self._takes_all:
            return super()._solved(displacement, residual, kind)
        self._is_linearised = False
        self._assemble(displacement, kind)
        self._general.factorize(self._blocks)
        return self._general.solve(residual)

    def _add_stiffness(self, displacement: Floats, kind: TangentKind) -> None:
        force = self.body.force
        if not self._takes_all:
            super()._add_stiffness(displacement, kind)
            return
        v, pattern = force.phantom, self.body.pattern
        if force.has_one_pass:
            force.evaluate(self._start.displacement)
            self._first[:] = force.rotations
            force.evaluate(displacement)
        added, elements = pattern.unfold(self._blocks), force.elements
        moduli = averaged_moduli(elements, self._ends(displacement), self.substituted)
        add_moduli(elements, moduli, 1.0, pattern.targets[: len(v.cells)], added)
        pattern.fold(added, self._blocks)
        if force.ghost is not None:
            force.ghost.add_stiffness(self.body.pattern, self._blocks, self.share)
