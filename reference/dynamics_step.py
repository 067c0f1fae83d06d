"""One implicit step of a body in motion, and its energy balance, whatever the scheme.

A step balances M a_α + f_visc + f_int − f_ext = r with the reactions r. Multiplied by Δu this is
an identity, whatever scheme chose the forces:

    ΔT + ΔW − Δu·f_ext − Δu·r + Δu·f_visc + D = 0,   D = (Δu·M a_α − ΔT) + (Δu·f_int − ΔW).

D is what the scheme itself dissipates (negative: produces). What the step leaves unsolved at
free unknowns is kept apart: if it is not round-off, the sum of all is not constant.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.dynamics_body import MovingBody
from reference.inside_out import place_text
from reference.nodal_algebra import NodalSolver, TiedSolver
from verify.errors import InputError

Array = NDArray[np.float64]

_TOLERANCE = 1e-11  # of the largest force that the residual balances
_GOOD_ENOUGH = 1e-8  # of it, where round-off does not let the residual fall further
# of the force that would stop a body within a step: of one that flies freely all forces are the
# round-off of its displacement
_FLIGHT = 1e-4
_MOST_ITERATIONS = 40
_SHORTEST = 1e-2  # share of a correction
_MOST_LEAPS = 3
_SLOW = 0.1  # a factorisation that contracts the residual by less is made anew
_NUDGE = 1e-4  # of the way of a step: a difference quotient
_JUST = 1e-12  # of the step: loads are taken that much inside of it, on their side of a jump


@dataclass(frozen=True)
class Scheme:
    """Parameters of one-step schemes with one unknown acceleration a₊.

    M a_{n+1−α_m} + C v_{n+1−α_f} + K u_{n+1−α_f} = f, where n+1−α is (1−α)·new + α·old. The ends
    are: u₊ = u + Δt v + Δt² (β₀ a + β a₊) and v₊ = v + Δt (γ₀ a + γ a₊).
    """

    alpha_m: float
    alpha_f: float
    beta_old: float
    beta: float
    gamma_old: float
    gamma: float


def generalised_alpha(spectral_radius: float = 1.0) -> Scheme:
    """Make the generalised-α scheme of a spectral radius at infinite frequency.

    Of second order (Chung & Hulbert, J. Appl. Mech. 60, 1993). At 1 it is the midpoint form of
    the trapezoidal rule and dissipates nothing.
    """
    rho = spectral_radius
    if not 0.0 <= rho <= 1.0:
        raise InputError(f"spectral radius {rho}; expected 0 to 1")
    alpha_m, alpha_f = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
    beta, gamma = (1 - alpha_m + alpha_f) ** 2 / 4, 0.5 - alpha_m + alpha_f
    return Scheme(alpha_m, alpha_f, 0.5 - beta, beta, 1 - gamma, gamma)


def implicit_euler() -> Scheme:
    """Make implicit Euler: u₊ = u + Δt v₊, v₊ = v + Δt a₊.

    Of first order; an amplitude is multiplied by 1/√(1+(ωΔt)²) per step.
    """
    return Scheme(0.0, 0.0, 0.0, 1.0, 0.0, 1.0)


@dataclass
class State:
    """Displacement, velocity, acceleration (k,) at a time."""

    displacement: Array
    velocity: Array
    acceleration: Array
    time: float

    def copy(self) -> "State":
        """Return an independent copy."""
        u, v, a = self.displacement, self.velocity, self.acceleration
        return State(u.copy(), v.copy(), a.copy(), self.time)


@dataclass(frozen=True)
class StepForces:
    """Forces (k,) that a step balances, N; at free unknowns the sum of all is the residual."""

    external: Array
    internal: Array
    viscous: Array
    inertia: Array
    tie: Array  # (cuts, k) of the external ones, those on what each cut has released
    contact: Array | float = 0.0  # part of the external forces: between faces in contact

    @property
    def residual(self) -> Array:
        """External less all others: at held unknowns, minus the reactions."""
        return self.external - self.internal - self.viscous - self.inertia


class Stepper:
    """Steps of one size of M a + f_visc + f_int = f_ext; a at α_m, forces at α_f of `Scheme`.

    Parameters
    ----------
    body : MovingBody
    scheme : Scheme
    averaged : bool
        Whether the internal force is the mean over the step (energy–momentum) and other forces are
        taken in its middle. The scheme must then have spectral radius 1. Otherwise all are weighted
        means of the forces at its ends.
    size : float
        Δt, s.

    Attributes
    ----------
    solves : int
        Linear solves so far.
    """

    def __init__(self, body: MovingBody, scheme: Scheme, averaged: bool, size: float) -> None:
        self.body, self.scheme, self.averaged, self.size = body, scheme, averaged, size
        self.solves = 0
        self._solver: NodalSolver | TiedSolver | None = None
        self._flight = 0.0  # least force that a residual is held against, N
        self._before = np.zeros(0)  # internal and viscous force at the start of the step
        self._load = self._tie = np.zeros(0)
        self._travelled: Array | None = None  # in the last step
        self._compliance: Array | None = None  # of the faces of cuts, by the factorisation

    def step(self, state: State) -> StepForces:
        """Advance a state in place; give the forces of the step.

        Raises
        ------
        RuntimeError
            If Newton's iteration does not converge.
        """
        start = state.copy()
        momenta = float(np.linalg.norm(self.body.mass @ start.velocity))
        self._flight = _FLIGHT * momenta / self.size
        if not self.averaged:
            self._before = self._resisting(start.displacement, start.velocity)
        self._load = self._over_step(self.body.external, start.time)
        self._tie = self._over_step(self.body.tie_forces.at, start.time)
        a, forces = self._solved(start, self._first(start))
        if self.body.contact is not None:
            a, forces = self._pressed(start, a, forces)
        state.displacement, state.velocity = self._end(start, a)
        state.acceleration, state.time = a, start.time + self.size
        self._travelled = state.displacement - start.displacement
        return forces

    def _pressed(self, start: State, a: Array, forces: StepForces) -> tuple[Array, StepForces]:
        """Add the pressures at the end of the step that keep faces from overlapping there.

        Their work over the step is p·(g₊ − g) with p·g₊ = 0, and g is not negative: contact never
        adds energy, whatever the step (C. Kane, E. A. Repetto, M. Ortiz, J. E. Marsden, Comput.
        Methods Appl. Mech. Engrg. 180, 1999).

        If the law is not linear these are iterations of Newton's method. The compliance belongs to
        the factorisation. Only changes of pressures are seen through it: an old one does while it
        contracts the residual.
        """
        body, faces = self.body, self.body.contact
        assert faces is not None
        share, load = self.size**2 * self.scheme.beta, self._load
        pressure, contact, last = np.zeros(len(faces.weights)), np.zeros_like(load), np.inf
        if faces.opened(self._end(start, a)[0]).min(initial=0.0) == 0.0:  # none overlap
            body.pressures = [pressure, *body.pressures[:2]]
            return a, forces
        for _ in range(_MOST_ITERATIONS):
            u = self._end(start, a)[0]
            slopes = faces.slopes(start.displacement, u)
            if self._solver is None:
                self._factorise(start.displacement, u)
            assert self._solver is not None
            if self._compliance is None:
                self._compliance = share * body.compliance(self._solver, slopes)
            contact = slopes.T @ pressure
            self._load = load + contact
            forces, residual, norm = self._residual(start, a)
            more = 0.0 if body.law.linear else self._solver.solve(residual)
            gaps = faces.opened(self._end(start, a + more)[0]) - self._compliance @ pressure
            new = faces.pressed(gaps, self._compliance, body.ties.leader)
            change = body.freed(slopes.T @ (new - pressure))
            left, scale = norm + float(np.linalg.norm(change)), self._scale(forces)
            stuck = left > 0.1 * last
            if left <= _TOLERANCE * scale or (stuck and left <= _GOOD_ENOUGH * scale):
                break
            a, pressure = a + more + self._solver.solve(change), new
            if body.law.linear:
                contact = slopes.T @ pressure
                self._load = load + contact
                forces = self._residual(start, a)[0]
                break
            if left > _SLOW * last:
                self.close()
            last = left
        else:
            raise RuntimeError(
                f"contact in the step from {start.time:.6g} s by {self.size:.6g} s is not found: "
                f"{left:.3g} N are left of forces of {scale:.3g} N; a smaller analysis.time_step "
                "may help"
            )
        body.pressures = [pressure, *body.pressures[:2]]
        return a, replace(forces, contact=contact)

    def restart(self, state: State, forces: Array) -> None:
        """Give a state, of which something has jumped, an acceleration to go on with.

        The acceleration that balances the forces is c/m v in a mode whose damping c, of the
        stiffness, is suddenly out of balance. If c Δt ≫ m the mode has long settled within the
        step; a scheme that weighs the old acceleration by itself (α_m ≠ α_f) throws it by Δt² c/m
        v, the more the finer the mesh. The matrix of the step, (1 − α_m) M + (1 − α_f)(γ Δt C + β
        Δt² K), replaces (1 − α_m) M. In a resolved mode both agree to O(Δt), so that the order
        stays; in others the acceleration is bounded by v/Δt.

        Parameters
        ----------
        state : State
            Its acceleration is replaced.
        forces : (k,) array
            Loads less internal and viscous forces, N.
        """
        if self._solver is None:
            self._factorise(state.displacement, state.displacement)
        assert self._solver is not None
        right = self.body.ties.summed(forces).copy()
        right[self.body.held] = 0.0
        state.acceleration = (1 - self.scheme.alpha_m) * self._solver.solve(right)

    def _first(self, start: State, share: float = 1.0, far: Array | float | None = None) -> Array:
        """Acceleration at which Newton's method starts: the body travels on as in the last step.

        Or as `far` as asked. Supports go where they are prescribed; of all, a `share`.

        Not by Δt v: stiff modes ring, their velocity changes sign with every step and cancels in
        the mean over one. Nor by the acceleration, which a jump of the loads leaves behind:
        elements smaller than Δt² a would begin inside out.
        """
        scheme, h = self.scheme, self.size
        if far is None:
            far = h * start.velocity if self._travelled is None else self._travelled
        still = self._end(start, 0.0 * start.acceleration)[0]
        guess = start.displacement + far
        guess[self.body.held] = self.body.prescribed(start.time + h, before=True)[0]
        guess = start.displacement + share * (guess - start.displacement)
        return np.asarray((guess - still) / (h**2 * scheme.beta))

    def _spread(self, start: State) -> Array:
        """Compute the acceleration at which Newton's method starts where `_first` leads inside out.

        What the supports move by is spread over the body by the tangent at the start.
        """
        (_, still, _), (_, nudged, _) = (
            self._residual(start, self._first(start, share)) for share in (0.0, _NUDGE)
        )
        self._factorise(start.displacement, start.displacement)
        assert self._solver is not None
        return self._first(start) + self._solver.solve(still + (nudged - still) / _NUDGE)

    def _inside_out(self, start: State, a: Array) -> str:
        """Say where the end of a step is inside out, so that it has no energy."""
        found = self.body.orientation(self._end(start, a)[0])()
        return (
            f"the step from {start.time:.6g} s by {self.size:.6g} s is not solved: it would end "
            f"with det F = {found.least:.2g} at {place_text(found.place)}, inside out, where "
            "the energy is not defined; a smaller analysis.time_step may help"
        )

    def _end(self, start: State, a: Array) -> tuple[Array, Array]:
        """Compute displacement and velocity at the end of a step that ends with an acceleration."""
        scheme, h = self.scheme, self.size
        reach = scheme.beta_old * start.acceleration + scheme.beta * a
        u = start.displacement + h * start.velocity + h**2 * reach
        return u, start.velocity + h * (scheme.gamma_old * start.acceleration + scheme.gamma * a)

    def _solved(self, start: State, a: Array) -> tuple[Array, StepForces]:
        """Newton's method for the acceleration at the end, with factorisations kept while good."""
        body = self.body
        forces, residual, norm = self._residual(start, a)
        if np.isnan(norm):  # what the supports have moved by has turned elements inside out
            a = self._spread(start)
            forces, residual, norm = self._residual(start, a)
        if np.isnan(norm):  # what travels fast in small elements: the body begins where it was
            a = self._first(start, far=0.0)
            forces, residual, norm = self._residual(start, a)
        last, leaps = np.inf, 0
        for _ in range(_MOST_ITERATIONS):
            scale = self._scale(forces)
            if np.isnan(norm):
                break
            stuck = norm > 0.1 * last
            if norm <= _TOLERANCE * scale or (stuck and norm <= _GOOD_ENOUGH * scale):
                return a, forces
            fresh = self._solver is None or (norm > _SLOW * last and not body.law.linear)
            if fresh:
                self._factorise(start.displacement, self._end(start, a)[0])
            assert self._solver is not None
            correction, last = self._solver.solve(residual), norm
            self.solves += 1
            best = self._residual(start, a + correction)
            share = 1.0
            search = fresh or np.isnan(best[2])
            while search and not best[2] < last and share > _SHORTEST:
                share *= 0.5
                best = self._residual(start, a + share * correction)
            if fresh and not best[2] < last:  # a dead end, and not a root: leap over it
                share, leaps = 1.0, leaps + 1
                best = self._residual(start, a + correction)
            a = a + share * correction
            forces, residual, norm = best
            if not np.isfinite(norm) or leaps > _MOST_LEAPS:
                break
        if np.isnan(norm):
            raise RuntimeError(self._inside_out(start, a))
        worst = int(np.argmax(np.abs(np.nan_to_num(residual, nan=np.inf))))
        node = body.space.node_points[worst // body.space.dimension]
        raise RuntimeError(
            f"the step from {start.time:.6g} s by {self.size:.6g} s is not solved: residual "
            f"{norm:.3g} N against forces of {self._scale(forces):.3g} N, most of it around "
            f"({', '.join(f'{x:.4g}' for x in node)}); a smaller analysis.time_step may help"
        )

    def _residual(self, start: State, a: Array) -> tuple[StepForces, Array, float]:
        """Give the forces of a step that ends like this, what they leave, and its norm."""
        forces = self._forces(start, *self._end(start, a), a)
        residual = self.body.ties.summed(forces.residual)
        residual[self.body.held] = 0.0
        return forces, residual, float(np.linalg.norm(residual))

    def close(self) -> None:
        """Free what PETSc holds; a step that follows factorises anew."""
        if self._solver is not None:
            self._solver.destroy()
            self._solver = self._compliance = None

    def _over_step(self, forces: Callable[[float], Array], time: float) -> Array:
        h = self.size
        if self.averaged:
            return forces(time + 0.5 * h)
        old = self.scheme.alpha_f
        later = (1 - old) * forces(time + h * (1 - _JUST))
        return later + old * forces(time + h * _JUST) if old else later

    def _forces(self, start: State, u: Array, v: Array, a: Array) -> StepForces:
        body, scheme, external = self.body, self.scheme, self._load
        mean = (1 - scheme.alpha_m) * a + scheme.alpha_m * start.acceleration
        inertia = body.mass @ mean
        if self.averaged:
            internal = body.law.averaged(start.displacement, u)
            middle = 0.5 * (start.displacement + u), 0.5 * (start.velocity + v)
            viscous = self._viscous(*middle)
            return StepForces(external, internal, viscous, inertia, self._tie)
        keep = 1 - scheme.alpha_f
        internal, viscous = keep * self._resisting(u, v) + scheme.alpha_f * self._before
        return StepForces(external, internal, viscous, inertia, self._tie)

    def _resisting(self, u: Array, v: Array) -> Array:
        """Return internal and viscous force (2, k)."""
        return np.array([self.body.law.force(u), self._viscous(u, v)])

    def _viscous(self, u: Array, v: Array) -> Array:
        mass, stiffness = self.body.scene.analysis.damping
        force = mass * (self.body.mass @ v) if mass else np.zeros_like(v)
        return force + stiffness * self.body.law.viscous(u, v) if stiffness else force

    def _factorise(self, before: Array, u: Array) -> None:
        """Factorise the derivative of minus the residual by the new acceleration."""
        self.close()
        body, scheme, h = self.body, self.scheme, self.size
        mass, stiffness = body.scene.analysis.damping
        keep = 0.5 if self.averaged else 1 - scheme.alpha_f
        if self.averaged:
            matrix = body.law.averaged_tangent(before, u)
            matrix.scale(h**2 * scheme.beta)
        else:
            matrix = body.law.tangent(u)
            matrix.scale(keep * h**2 * scheme.beta)
        if stiffness:
            damping = body.law.viscous_tangent(0.5 * (before + u) if self.averaged else u)
            matrix.axpy(keep * h * scheme.gamma * stiffness, damping)
            damping.destroy()
        matrix.axpy(1 - scheme.alpha_m + keep * h * scheme.gamma * mass, body.inertia)
        symmetric = body.law.linear or not self.averaged
        kind: Any = "symmetric" if symmetric else "general"
        self._solver = body.step_solver(matrix, kind)

    def _scale(self, forces: StepForces) -> float:
        """Compute the norm of the largest of the forces, without those inside that ties pass on.

        Loads count in full: those on the faces of a closed cut leave the round-off of their sum.
        """
        parts = (forces.internal, forces.viscous, forces.inertia)
        norms = [float(np.linalg.norm(self.body.ties.summed(part))) for part in parts]
        norms.append(float(np.linalg.norm(forces.external)))
        norms.append(self._flight)
        return max(norms) or 1.0


DONE = ("work_of_loads", "work_of_supports", "damping", "algorithmic", "unbalanced", "cut_work")


class Ledger:
    """The account of a motion, from its start on.

    Attributes
    ----------
    done : dict of str to float
        What was done since then by the names in `DONE`, J (in the plane per metre).
    work_by_cut : (cuts,) array or float
        Share of what each cut has released in ``cut_work``, J.
    turned : (1 or 3,) array or float
        Angular impulse since then of the forces on what the cut has released, N m s.
    """

    def __init__(self) -> None:
        self.done = dict.fromkeys(DONE, 0.0)
        self.work_by_cut: Array | float = 0.0
        self.turned: Array | float = 0.0
        self._kinetic = self._strain = 0.0

    def open(self, body: MovingBody, state: State) -> None:
        """Begin with a state. When a cut opens nothing changes."""
        self._kinetic, self._strain = _energies(body, state)

    def started(self, body: MovingBody, state: State) -> None:
        """Enter what supports did that took up another velocity at once."""
        kinetic = self._kinetic
        self._kinetic, self._strain = _energies(body, state)
        self.done["work_of_supports"] += self._kinetic - kinetic

    def record(self, body: MovingBody, before: State, state: State, forces: StepForces) -> None:
        """Enter one step."""
        change = state.displacement - before.displacement
        reaction = np.zeros_like(change)
        reaction[body.held] = -forces.residual[body.held]
        kinetic, strain = _energies(body, state)
        slip = change @ forces.inertia - (kinetic - self._kinetic)
        done = self.done
        tie = forces.tie.sum(axis=0)
        loads = forces.external - body.weight - tie - forces.contact
        done["work_of_loads"] += float(change @ loads)
        done["cut_work"] -= float(change @ tie)
        self.work_by_cut = self.work_by_cut - forces.tie @ change
        d = body.space.dimension
        middle = 0.5 * (before.displacement + state.displacement).reshape(-1, d)
        turning = _turning(body.space.node_points + middle, tie.reshape(-1, d))
        self.turned = self.turned + (state.time - before.time) * turning
        done["work_of_supports"] += float(change @ reaction)
        done["damping"] += float(change @ forces.viscous)
        lost = slip + change @ (forces.internal - forces.contact) - (strain - self._strain)
        done["algorithmic"] += float(lost)
        done["unbalanced"] -= float(change @ (forces.residual + reaction))
        self._kinetic, self._strain = kinetic, strain

    def state(self, body: MovingBody, state: State) -> dict[str, float]:
        """Compute energies of the state that was entered last, J."""
        gravity = -float(body.weight @ state.displacement)
        return {"kinetic": self._kinetic, "strain": self._strain, "gravity": gravity}


class ShortWaves:
    """Kinetic energy of motions of periods up to 4h/c at the end, c the speed of shear waves.

    `verify.compare.hooke.short_wave_energy` defines it, and has the same from output times.
    """

    def __init__(self, body: MovingBody, size: float) -> None:
        material = body.scene.material
        assert material.density is not None
        shear = material.young / (2 * (1 + material.poisson))
        self.body, self.period = body, 4.0 * size / float(np.sqrt(shear / material.density))
        self._recent: deque[tuple[float, Array]] = deque()

    def enter(self, state: State) -> None:
        """Take the velocity at the end of a step, and forget earlier periods."""
        self._recent.append((state.time, state.velocity))
        while self._recent[0][0] <= state.time - self.period * (1 - 1e-9):
            self._recent.popleft()

    def found(self) -> dict[str, float]:
        """Return it as ``short_wave_energy``, J; nothing where steps are longer than h/c."""
        velocities = np.array([velocity for _, velocity in self._recent])
        if len(velocities) < 4:
            return {}
        space, energy = self.body.space, 0.0
        part = space.piece_of_node
        mass = np.bincount(part, (self.body.mass @ np.ones_like(velocities[0]))[:: space.dimension])
        for fast in velocities - velocities.mean(axis=0):
            momenta = self.body.mass @ fast
            energy += 0.5 * float(fast @ momenta)
            for along in momenta.reshape(-1, space.dimension).T:
                energy -= 0.5 * float(np.sum(np.bincount(part, along) ** 2 / mass))
        return {"short_wave_energy": energy / len(velocities)}


def momenta_of(body: MovingBody, state: State) -> tuple[Array, Array]:
    """Compute the linear (d,) and angular momentum (1 or 3,) of a state, kg m/s and kg m²/s."""
    d = body.space.dimension
    momenta = (body.mass @ state.velocity).reshape(-1, d)
    places = body.space.node_points + state.displacement.reshape(-1, d)
    return momenta.sum(axis=0), _turning(places, momenta)


def _energies(body: MovingBody, state: State) -> tuple[float, float]:
    kinetic = 0.5 * float(state.velocity @ (body.mass @ state.velocity))
    return kinetic, body.law.energy(state.displacement)


def _turning(places: Array, momenta: Array) -> Array:
    if places.shape[1] == 2:
        return np.array([np.sum(places[:, 0] * momenta[:, 1] - places[:, 1] * momenta[:, 0])])
    turning: Array = np.cross(places, momenta).sum(axis=0)
    return turning
