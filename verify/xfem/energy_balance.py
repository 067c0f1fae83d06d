"""Energy balance of a motion, step by step, for any integration scheme.

A step is p = f_ext − f_int − f_visc + r with the reactions r at the supports. The inertia p is M
Δv/h unless the scheme says otherwise. Multiplied by Δu this is an identity for the forces of any
scheme; with T the kinetic and W the strain energy:

    ΔT + ΔW − Δu·f_ext − Δu·r + Δu·f_visc + D = − Δu·(residual at free components),

    D = (Δu·p − v̄·M Δv) + (Δu·f_int − ΔW),   v̄ = ½ (v₀ + v₁).

D is the energy that the scheme itself dissipates (negative: produces). At components held by moving
supports the first part of D is work of the supports, which may change their velocity at once. The
right-hand side is the work of the residual; if it is not round-off, the forces do not belong to the
motion.
"""

from dataclasses import dataclass

import numpy as np

from verify.xfem.arrays import Floats, XfemError
from verify.xfem.body import DynamicBody, Integrator, MotionState, StepForces


@dataclass(frozen=True)
class EnergyBalance:
    """Energies and momenta at the instants 0…n, all (n + 1,) or (n + 1, components).

    Attributes
    ----------
    time : in s
    kinetic, strain : in J
    gravity : potential −weight·u of the dead load, in J
    load_work, support_work : done on the body since the start, in J
    damping, algorithmic : dissipated since the start by C, and by the scheme, in J
    unbalanced : energy gained because steps were left unsolved, since the start, in J
    cut_work : taken since the start by the tie forces of what a cut releases, in J
    momentum : (n + 1, d) linear momentum, in kg m/s
    angular_momentum : (n + 1, 1 or 3), about the origin, in kg m²/s
    impulse : (n + 1, d) of external, viscous and support forces since the start, in N s; by a
        scheme with an inertia p of its own the momentum differs from it by Σ (M Δv − h p)
    penalty : share of a ghost penalty, or of contact, in the strain energy, in J
    cut_turn : (n + 1, 1 or 3) angular impulse of the tie forces since the start, in N m s
    """

    time: Floats
    kinetic: Floats
    strain: Floats
    gravity: Floats
    load_work: Floats
    support_work: Floats
    damping: Floats
    algorithmic: Floats
    unbalanced: Floats
    cut_work: Floats
    momentum: Floats
    angular_momentum: Floats
    impulse: Floats
    penalty: Floats
    cut_turn: Floats

    @property
    def mechanical(self) -> Floats:
        """Kinetic, strain and gravity energy: constant in a conservative motion."""
        return self.kinetic + self.strain + self.gravity

    @property
    def balance(self) -> Floats:
        """All other columns together: less `unbalanced`, constant to round-off for every scheme."""
        taken = self.damping + self.algorithmic + self.cut_work
        return self.mechanical - self.load_work - self.support_work + taken

    @property
    def drift(self) -> float:
        """Largest change of the mechanical energy over the largest energy in play."""
        scale = max(self.kinetic.max(), np.ptp(self.strain), np.ptp(self.gravity))
        if scale == 0.0:
            return 0.0
        return float(np.abs(self.mechanical - self.mechanical[0]).max() / scale)


class BalanceRecorder:
    """Record of the energy balance of a body in motion.

    Parameters
    ----------
    body : DynamicBody
    state : MotionState
        Where the record starts.

    Attributes
    ----------
    strain : float
        Strain energy at the last entry, J.
    """

    def __init__(self, body: DynamicBody, state: MotionState) -> None:
        self.body = body
        self._last = state.copy()
        self._momenta = body.mass.apply(state.velocity)
        self.strain, self._penalty = self._stored(state)
        space = body.shape[1]
        self._work = np.zeros(6)  # load, support, damping, algorithmic, unbalanced, cut
        self._impulse = np.zeros(space)
        self._turn = np.zeros(1 if space == 2 else 3)
        self._rows = [self._row(state)]

    def record(self, state: MotionState, forces: StepForces) -> None:
        """Enter one step, from the state of the last entry to this one.

        Raises
        ------
        XfemError
            If no time has passed in between.
        """
        body, last = self.body, self._last
        h = state.time - last.time
        if h == 0.0:
            raise XfemError(f"no time has passed since the last entry, t = {state.time:g} s")
        change = state.displacement - last.displacement
        before, self._momenta = self._momenta, body.mass.apply(state.velocity)
        gained = self._momenta - before
        inertia = gained / h if forces.inertia is None else forces.inertia
        residual = inertia - forces.external + forces.internal + forces.viscous
        reaction = np.where(body.fixed, residual, 0.0)
        strain, self._penalty = self._stored(state, forces.strain)
        # the two parts nearly cancel: what they differ by is taken first
        slips = (change / h - 0.5 * (last.velocity + state.velocity)) * gained
        slip = slips.sum()
        # supports that take up another velocity at once do that work, whatever step they do it in
        taken = np.sum(slips[body.fixed]) if body.moving else 0.0
        if forces.inertia is not None:
            slip += np.vdot(change, inertia - gained / h)
        assert body.weight is not None
        tie = np.zeros(body.shape)
        if body.tie is not None:
            tie = sum((w * body.tie(last.time + s * h) for s, w in forces.loaded_at), tie)
            middle = 0.5 * (last.displacement + state.displacement)
            self._turn = self._turn + h * _cross(body.force.phantom.node_points + middle, tie)
        self._work += [
            np.vdot(change, forces.external - body.weight - tie),
            np.vdot(change, reaction) - taken,
            np.vdot(change, forces.viscous),
            slip - taken + np.vdot(change, forces.internal) - (strain - self.strain),
            np.vdot(change, residual - reaction),
            -np.vdot(change, tie),
        ]
        self._impulse = self._impulse + h * (forces.external - forces.viscous + reaction).sum(
            axis=0
        )
        self._last, self.strain = state.copy(), strain
        self._rows.append(self._row(state))

    def take_up(self, velocity: Floats, again: bool) -> None:
        """Enter that supports have taken up a velocity (N, d) at once: work of theirs.

        Parameters
        ----------
        velocity : (N, d) float array
            Of the body after that.
        again : bool
            Whether the last entry shall be of after that.
        """
        last = self._last
        before, self._momenta = self._momenta, self.body.mass.apply(velocity)
        gained = self._momenta - before
        self._work[1] += 0.5 * np.sum((velocity + last.velocity) * gained)
        self._impulse = self._impulse + gained.sum(axis=0)
        self._last = MotionState(last.displacement, velocity.copy(), last.time)
        if again:
            self._rows[-1] = self._row(self._last)

    def _stored(self, state: MotionState, strain: float | None = None) -> tuple[float, float]:
        """Compute the strain energy, and the share of a ghost penalty or of contact in it."""
        force = self.body.force
        if strain is None:
            _, strain = force.evaluate(state.displacement)
        penalty, contact = force.penalty_energy(state.displacement), self.body.contact
        pressed = 0.0 if contact is None else contact.energy(state.displacement)
        return strain + pressed, penalty + pressed

    def _row(self, state: MotionState) -> Floats:
        body = self.body
        assert body.weight is not None
        momenta = self._momenta
        position = body.force.phantom.node_points + state.displacement
        energies = [
            state.time,
            0.5 * np.vdot(state.velocity, momenta),
            self.strain,
            -np.vdot(body.weight, state.displacement),
        ]
        angular = _cross(position, momenta)
        vectors = (momenta.sum(axis=0), angular, self._impulse)
        return np.concatenate([energies, self._work, *vectors, self._turn, [self._penalty]])

    def close(self) -> EnergyBalance:
        """Return the balance so far."""
        table = np.array(self._rows).T
        space = self.body.shape[1]
        turns = 1 if space == 2 else 3
        vectors = np.split(table[10:-1].T, np.cumsum([space, turns, space]), axis=1)
        momentum, angular, impulse, turn = vectors
        return EnergyBalance(*[*table[:10], momentum, angular, impulse, table[-1], turn])


def _cross(position: Floats, momenta: Floats) -> Floats:
    """Sum cross products: what the sum of tensor products has off its diagonal."""
    S = position.T @ momenta
    turns = S - S.T
    return turns[:1, 1] if len(S) == 2 else np.array([turns[1, 2], turns[2, 0], turns[0, 1]])


def run(integrator: Integrator, body: DynamicBody, state: MotionState, steps: int) -> EnergyBalance:
    """Take a number of steps and return their energy balance; the state is changed in place.

    Raises
    ------
    StepFailedError
        From the step that failed; the state is left as the last good step ended.
    XfemError
        If the number of steps is negative.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> phantom = xfem.cut_mesh(xfem.rectangle_mesh((4, 4)), [])
    >>> force = xfem.InternalForce(phantom, xfem.isotropic(1e4, 0.3, "plane strain"))
    >>> mass = xfem.side_wise_mass(phantom, 1000.0)
    >>> body = xfem.DynamicBody(force, mass, mass.weight([0.0, -10.0]))
    >>> state = body.rest()
    >>> energies = xfem.run(xfem.CentralDifferences(body, 1e-3), body, state, 100)
    >>> float(energies.kinetic[-1].round(6)), bool(energies.drift < 1e-10)
    (500.0, True)
    """
    if steps < 0:
        raise XfemError(f"{steps} steps; expected none or more")
    recorder = BalanceRecorder(body, state)
    for _ in range(steps):
        forces = integrator.step(state)
        recorder.record(state, forces)
    return recorder.close()
