"""Energy-momentum scheme: the stress is averaged over the step.

The work of the average is the change of strain energy, exactly.

Per volume the potential is, with t the trace of the stretch and d the dimension of the simplex
(2 of a membrane),

    W = μ (‖F‖² − 2t + d) + ½λ (t − d)²,

quadratic in F but for t. Let Fₘ = (F₀ + F₁)/2. The discrete gradient of W needs a T with T : (F₁ −
F₀) = t₁ − t₀ that is R in the limit. T Fₘᵀ must be symmetric, so that angular momentum is kept.
Then

    P = 2μ (Fₘ − T) + λ (½(t₀ + t₁) − d) T.

In the plane t R is linear in F, and T = (t₀ R₀ + t₁ R₁)/(t₀ + t₁). In space
U₁² − U₀² = ½[(U₁−U₀)(U₀+U₁) + (U₀+U₁)(U₁−U₀)], hence t₁ − t₀ = (U₀+U₁)⁻¹ : (C₁ − C₀) and
T = 2 Fₘ A⁻¹, A = U₀ + U₁. Neither has a quotient that is 0/0 at rest. Where an inverted element
makes A indefinite, a substitute takes its place (Gonzalez 2000),

    T = R(Fₘ) + α D,  D = 2Fₘ (C₁ − C₀),  α = (t₁ − t₀ − R(Fₘ) : (F₁ − F₀)) / ‖C₁ − C₀‖²,

as D : (F₁ − F₀) = ‖C₁ − C₀‖². After the first evaluations of a step (`_FREE_EVALUATIONS`) elements
keep it once they take it, so that Newton's method does not alternate between the two. In the plane
T = R₁ stands in where t₀ + t₁ is not positive, and nothing is kept.

The derivative by the end of the step, with c = λ(½(t₀ + t₁) − d) − 2μ, is

    dP = μ dF + ½λ (R₁ : dF) T + c dT,   dT = (dF − T dU₁) A⁻¹,   dU₁ = R₁ᵀdF + dR₁ᵀF₁.

That is Hooke's law at finite rotation; `verify.xfem.hyperelastic` averages the others.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from verify.xfem.arrays import Bools, Floats, XfemError
from verify.xfem.body import DynamicBody, StepForces
from verify.xfem.element import Elements, add_moduli, polar_slope, restricted
from verify.xfem.hyperelastic import Law, averages, moduli_of_averages
from verify.xfem.implicit import NewtonIntegrator, Resistance
from verify.xfem.internal_force import Configuration, TangentKind
from verify.xfem.linear_solvers import LinearSolver, OnePass
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
        """Return the ends of some elements."""
        return StepEnds(*(X[some] for X in self))

    @property
    def traces(self) -> tuple[Floats, Floats]:
        """Traces t (p,) of both stretches."""
        return _inner(self.R0, self.F0), _inner(self.R1, self.F1)


def averaged_stress(elements: Elements, ends: StepEnds, substituted: Bools) -> Floats:
    """Average the stress P (p, d, d) over a step; mark elements that need the substitute.

    Parameters
    ----------
    elements : Elements
    ends : StepEnds
    substituted : (p,) bool array
        Elements that have taken the substitute in this step: added to, in the plane overwritten.
    """
    T = _secant(elements, ends, substituted)
    _, mu, factor = _factors(elements, ends)
    return mu * (ends.F0 + ends.F1) + factor * T


def averaged_moduli(elements: Elements, ends: StepEnds, substituted: Bools) -> Floats:
    """Differentiate P by F₁: (p, d, d, d, d), the last two indices of F₁; not symmetric.

    Arguments as the last call of `averaged_stress` left them: `substituted` is read, too.
    """
    T = _secant(elements, ends, substituted)
    if len(elements.axes) == 2:
        t0, t1 = ends.traces
        total = np.where(t0 + t1 > 0.0, t0 + t1, np.inf)[:, None, None, None, None]
        # dT = (d(t₁ R₁) − T dt₁)/(t₀ + t₁), dt₁ = R₁ : dF
        dT = (_IN_PLANE - np.einsum("pkn,plm->pknlm", T, ends.R1)) / total
    else:
        dT, some = np.empty((len(T), 3, 3, 3, 3)), ~substituted
        dT[some] = _plain_slope(elements, ends, T, some)
        if substituted.any():
            dT[substituted] = _substitute(ends.of(substituted))[1]
    lam, mu, factor = _factors(elements, ends)
    # dP = μ dF + ½λ (R₁ : dF) T + c dT
    slope = factor[..., None, None] * dT
    slope += np.einsum("pkn,plm->pknlm", 0.5 * lam * T, ends.R1)
    identity = np.eye(len(elements.axes))
    return slope + mu[..., None, None] * np.einsum("kl,nm->knlm", identity, identity)


def _inner(A: Floats, B: Floats) -> Floats:
    return np.einsum("pkl,pkl->p", A, B)


def _factors(elements: Elements, ends: StepEnds) -> tuple[Floats, Floats, Floats]:
    """Compute λ, μ and c, each (p, 1, 1)."""
    lam, mu = (x[elements.parent, None, None] for x in (elements.lam, elements.mu))
    t0, t1 = ends.traces
    dim = len(elements.corners) - 1
    return lam, mu, lam * (0.5 * (t0 + t1) - dim)[:, None, None] - 2.0 * mu


def _secant(elements: Elements, ends: StepEnds, substituted: Bools) -> Floats:
    """Compute T (p, d, d); mark elements that need the substitute."""
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
    # dU₁ = R₁ᵀdF + dR₁ᵀF₁, dT = (dF − T dU₁) A⁻¹
    dU = np.einsum("plk,nm->pknlm", R1, identity) + np.einsum("paklm,pan->pknlm", dR, F1)
    change = np.einsum("kl,nm->knlm", identity, identity) - np.einsum(
        "pka,panlm->pknlm", T[some], dU
    )
    return np.einsum("pkblm,pbn->pknlm", change, inverse)


def _substitute(ends: StepEnds) -> tuple[Floats, Floats]:
    """Compute T and dT of the substitute."""
    F0, F1, _, R1 = ends
    t0, t1 = ends.traces
    G = F0 + F1
    middle = nearest_rotations(G)
    dT, _ = polar_slope(middle, G, _SINGULAR)
    C1 = F1.transpose(0, 2, 1) @ F1
    change = C1 - F0.transpose(0, 2, 1) @ F0
    # dC₁ = dFᵀF₁ + F₁ᵀdF
    half = np.einsum("ma,plb->pablm", np.eye(3), F1)
    dC = half + half.transpose(0, 2, 1, 3, 4)
    square = _inner(change, change)
    moving = square > _STILL * _inner(C1, C1)
    square = np.where(moving, square, 1.0)[:, None, None]
    factor = np.where(moving, t1 - t0 - _inner(middle, F1 - F0), 0.0)[:, None, None] / square
    # T = Rₘ + α D, D = 2Fₘ (C₁ − C₀), α = (t₁ − t₀ − Rₘ : (F₁ − F₀))/|C₁ − C₀|²; slope = dα,
    # dT = dRₘ + D dα + α dD, dD = dF (C₁ − C₀) + 2Fₘ dC₁
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
    equations. Its stiffness is not symmetric. It differs from half the stiffness at the end of the
    step by the square of the turn in a step. Corrections take this half, which is found in a tenth
    of the time. After a correction that leaves more than half of the residual they take the full
    derivative.

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

    Examples
    --------
    A plate that turns, is stretched by it and swings, in steps of a tenth of a radian:

    >>> import verify.xfem as xfem
    >>> phantom = xfem.cut_mesh(xfem.rectangle_mesh((4, 4)), [xfem.Plane([0.6, 0.0], [1.0, 0.0])])
    >>> force = xfem.InternalForce(phantom, xfem.isotropic(1e4, 0.3, "plane strain"))
    >>> body = xfem.DynamicBody(force, xfem.side_wise_mass(phantom, 1.0))
    >>> state = body.rest()
    >>> state.velocity[:] = (phantom.node_points - 0.5) @ [[0.0, 1.0], [-1.0, 0.0]]
    >>> energies = xfem.run(xfem.EnergyMomentum(body, 0.1), body, state, 20)
    >>> bool(energies.drift < 1e-9), float(energies.angular_momentum.std()) < 1e-12
    (True, True)
    """

    rate = 2.0
    share = 0.5
    tolerance = 1e-12

    def __init__(self, body: DynamicBody, step_size: float) -> None:
        if not body.force.has_stress:
            raise XfemError("springs have no stress field; expected an integrator that needs none")
        super().__init__(body, step_size)
        self._before: Configuration | None = None  # at the start, once it is needed
        elements = body.force.elements
        lam, mu = (x[elements.parent] for x in (elements.lam, elements.mu))
        self._law = Law(lam, mu, body.force.law == "stable_neo_hookean")
        self._evaluations = 0
        self._takes_all = False  # of the derivative of the force
        self.substituted = np.zeros(len(body.force.phantom.cells), dtype=bool)

    @cached_property
    def _general(self) -> LinearSolver:
        return self.body.force.kernels.general(self.body.pattern, self.body.shape[1])

    def _prepare(self) -> None:
        self._before, self._evaluations, self._takes_all = None, 0, False

    def _resistance(self, displacement: Floats) -> Resistance:
        """Average the resistance over the step; `substituted` belongs to this evaluation."""
        body, force, start = self.body, self.body.force, self._start.displacement
        found = np.zeros(body.shape)
        if not force.is_corotational:
            at = force.configuration(displacement)
            force.add_tangent_product(at, 0.5 * (start + displacement), 1.0, found)
            return Resistance(displacement, found, at)
        self._evaluations += 1
        if self._evaluations <= _FREE_EVALUATIONS:
            self.substituted[:] = False
        if force.has_one_pass:
            return self._by_one_pass(displacement, self._averaged_in_one_pass(displacement))
        at = force.configuration(displacement)
        ends = self._ends(at)
        if force.law == "hooke":
            P = averaged_stress(force.elements, ends, self.substituted)
        else:
            P = averages(self._law, ends.F0, ends.F1).stress
        P *= force.elements.volumes[:, None, None]
        gradients = force.elements.gradients[force.elements.parent]
        found += force.nodal_force(gradients @ P.transpose(0, 2, 1))  # f_i = w P b_i
        force.add_penalty(0.5 * (start + displacement), 1.0, found)
        return Resistance(displacement, found, at)

    def _averaged_in_one_pass(self, displacement: Floats) -> Floats:
        """Average the force (N, 3); write the stiffness at the end to the blocks."""
        force, before = self.body.force, self._start.displacement
        start, end = force.phantom.extend(before), force.phantom.extend(displacement)
        scale, found = self._stiffness_share, np.empty(self.body.shape)

        def run(one: OnePass, f: Floats, K: Floats, whole: bool) -> None:
            one.average(start, end, scale, self.share, self.substituted, f, K, whole)

        reads_all = not self._solver.reads_half
        force.in_one_pass(self.body.pattern, run, found, self._blocks, reads_all)
        if force.ghost is not None:
            force.add_penalty(0.5 * (before + displacement), 1.0, found)
            force.ghost.add_stiffness(self.body.pattern, self._blocks, scale)
        return found

    def _forces(self, end: Resistance, velocity: Floats, time: float) -> StepForces:
        middle = self._start.time + 0.5 * self.step_size
        mean = 0.5 * (self._start.velocity + velocity)
        viscous = self.body.viscous(mean, end.configuration)
        return StepForces(end.force, self._load(middle), viscous, loaded_at=((0.5, 1.0),))

    def _ends(self, after: Configuration) -> StepEnds:
        """Return both ends of the step."""
        if self._before is None:
            self._before = self.body.force.configuration(self._start.displacement)
        return StepEnds(self._before.F, after.F, self._before.R, after.R)

    def _linear_solve(
        self, end: Resistance, residual: Floats, kind: TangentKind, is_slow: bool
    ) -> Floats:
        self._takes_all |= is_slow and self.body.force.is_corotational
        if not self._takes_all:
            return super()._linear_solve(end, residual, kind, is_slow)
        self._assemble(end._replace(blocks=None), kind)
        self._general.factorize(self._blocks)
        return self._general.solve(residual)

    def _add_stiffness(self, end: Resistance, kind: TangentKind) -> None:
        if not self._takes_all:
            super()._add_stiffness(end, kind)
            return
        force, pattern = self.body.force, self.body.pattern
        added, ends = pattern.unfold(self._blocks), self._ends(self._configuration(end))
        if force.law == "hooke":
            moduli = averaged_moduli(force.elements, ends, self.substituted)
        else:
            moduli = moduli_of_averages(self._law, ends.F0, ends.F1)
        add_moduli(force.elements, moduli, 1.0, pattern.targets[: len(moduli)], added)
        pattern.fold(added, self._blocks)
        if force.ghost is not None:
            force.ghost.add_stiffness(pattern, self._blocks, self.share)
