"""A free body that vibrates, spins and drifts while it is cut in two steps, scheme by scheme."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.study.energy.drift import Drift, secular_drift
from verify.study.energy.pieces import PieceInertia, piece_inertias
from verify.xfem.corotation import InternalForce
from verify.xfem.critical_step import critical_step
from verify.xfem.cuts import Polyline
from verify.xfem.dynamics import (
    CentralDifferences,
    DynamicBody,
    EnergyMomentum,
    ForwardEuler,
    ImplicitEuler,
    Integrator,
    MotionState,
    RealTimeEuler,
    StepFailedError,
    SymplecticEuler,
    Trapezoidal,
    inherit_state,
)
from verify.xfem.dynamics.energy_ledger import EnergyLedger, Ledger
from verify.xfem.elasticity import isotropic
from verify.xfem.mass import side_wise_mass
from verify.xfem.stiffness import LinearStiffness
from verify.xfem.structured_meshes import rectangle_mesh
from verify.xfem.virtual import VirtualMesh, cut_mesh

__all__ = ["SCHEMES", "Jump", "Spin", "spin"]

_DENSITY = 1000.0
_SOFT = isotropic(1e4, 0.3, "plane strain")
_STRAIN = 0.02
_TURNING = 1.0  # 1/s
_SHARE = 0.5  # of the critical step of the cut body
_ENERGY_LIMIT = 1e12  # times that at the start: beyond it nothing is drawn

SCHEMES: dict[str, Callable[..., Integrator]] = {
    "central differences": CentralDifferences,
    "symplectic Euler": SymplecticEuler,
    "forward Euler": ForwardEuler,
    "linearised implicit Euler": RealTimeEuler,
    "implicit Euler": ImplicitEuler,
    "trapezoidal": Trapezoidal,
    "energy–momentum": EnergyMomentum,
}


@dataclass(frozen=True)
class Jump:
    """Change at the insertion of a cut, relative to the value before.

    Attributes
    ----------
    time : float
    energy, momentum, angular_momentum : float
    """

    time: float
    energy: float
    momentum: float
    angular_momentum: float


@dataclass(frozen=True)
class Spin:
    """The account of one scheme.

    Attributes
    ----------
    scheme : str
    step, period : float
        Time step and period of the slowest vibration of the uncut body, in s.
    scale : float
        Elastic energy at the start, in J: what drifts are relative to.
    drift : Drift or None
        Over the whole motion, cuts included; None if it ended before its time.
    jumps : list of Jump
    momentum_change, turning_change : float
        Largest change of linear and angular momentum in free flight, relative.
    balance : float
        What the ledger is off by, over the scale.
    pieces : list of PieceInertia
    failure : str
        Why it ended early.
    curves : dict of str to list of float
        Time, and the energies in J, thinned for drawing.
    """

    scheme: str
    step: float
    period: float
    scale: float
    drift: Drift | None
    jumps: list[Jump]
    momentum_change: float
    turning_change: float
    balance: float
    pieces: list[PieceInertia]
    failure: str
    curves: dict[str, list[float]]


def spin(scheme: str, periods: int = 20) -> Spin:
    """Vibrate uncut, half cut and cut through: a quarter, a quarter and a half of the periods."""
    mesh = rectangle_mesh((4, 4))
    # the cut grows straight on: a kink would change the level set of what is cut already
    half, through = ([[-1.0, 0.43], [x, 0.43 + 0.06 * (x + 1.0)]] for x in (0.55, 2.0))
    stages = [cut_mesh(mesh, cuts) for cuts in ([], [Polyline(half)], [Polyline(through)])]
    bodies = [_body(virtual) for virtual in stages]
    step = _SHARE * min(_critical(body) for body in bodies)
    period = _slowest_period(bodies[0])
    count = [int(np.ceil(share * periods * period / step)) for share in (0.25, 0.25, 0.5)]
    state = _start(bodies[0])
    ledgers: list[Ledger] = []
    failure = ""
    before: VirtualMesh | None = None
    for virtual, body, steps in zip(stages, bodies, count, strict=True):
        if before is not None:
            state = inherit_state(before, virtual, state)
        ledger, failure = _account(SCHEMES[scheme](body, step), body, state, steps)
        ledgers.append(ledger)
        before = virtual
        if failure:
            break
    scale = float(ledgers[0].strain[0])
    accounts = [(part.time, part.mechanical) for part in ledgers]
    complete = len(ledgers) == 3 and not failure
    return Spin(
        scheme=scheme,
        step=step,
        period=period,
        scale=scale,
        drift=secular_drift(accounts, period, scale) if complete else None,
        jumps=[_jump(a, b) for a, b in pairwise(ledgers)],
        momentum_change=max(_change(part.momentum) for part in ledgers),
        turning_change=max(_change(part.angular_momentum) for part in ledgers),
        balance=max(float(np.ptp(part.balance)) for part in ledgers) / scale,
        pieces=piece_inertias(stages[2], bodies[2].mass, _DENSITY),
        failure=failure,
        curves=_curves(ledgers),
    )


def _body(virtual: VirtualMesh) -> DynamicBody:
    return DynamicBody(InternalForce(virtual, _SOFT), side_wise_mass(virtual, _DENSITY))


def _stiffness(body: DynamicBody) -> Any:
    linear = LinearStiffness(body.force.virtual, _SOFT)
    return body.pattern.matrix(linear.assemble(body.pattern))


def _critical(body: DynamicBody) -> float:
    return critical_step(_stiffness(body), body.mass)


def _slowest_period(body: DynamicBody) -> float:
    assert body.mass.diagonal is not None
    root = np.repeat(np.sqrt(body.mass.diagonal), body.shape[1])
    values = np.linalg.eigvalsh(_stiffness(body).toarray() / np.outer(root, root))
    elastic = values[values > 1e-8 * values[-1]]
    return float(2.0 * np.pi / np.sqrt(elastic[0]))


def _start(body: DynamicBody) -> MotionState:
    """Stretched along x, turning about the centre, drifting."""
    state, X = body.rest(), body.force.virtual.node_points
    state.displacement[:, 0] = _STRAIN * (X[:, 0] - 0.5)
    state.velocity[:] = _TURNING * np.column_stack([0.5 - X[:, 1], X[:, 0] - 0.5]) + [0.1, 0.2]
    return state


def _account(
    scheme: Integrator, body: DynamicBody, state: MotionState, steps: int
) -> tuple[Ledger, str]:
    ledger = EnergyLedger(body, state)
    limit = _ENERGY_LIMIT * max(float(ledger.close().mechanical[0]), 1e-300)
    for _ in range(steps):
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                forces = scheme.step(state)
        except StepFailedError as failure:
            return ledger.close(), str(failure)
        ledger.record(state, forces)
        kinetic = 0.5 * float(np.sum(state.velocity * body.mass.apply(state.velocity)))
        if not kinetic < limit:
            return ledger.close(), f"energy beyond 1e12 times its start at {state.time:.3g} s"
    return ledger.close(), ""


def _jump(before: Ledger, after: Ledger) -> Jump:
    def off(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
        return float(np.linalg.norm(b - a) / np.linalg.norm(a))

    energy = float(before.mechanical[-1])
    return Jump(
        time=float(after.time[0]),
        energy=float(after.mechanical[0] - energy) / energy,
        momentum=off(before.momentum[-1], after.momentum[0]),
        angular_momentum=off(before.angular_momentum[-1], after.angular_momentum[0]),
    )


def _change(values: NDArray[np.float64]) -> float:
    return float(np.abs(values - values[0]).max() / np.linalg.norm(values[0]))


def _curves(ledgers: list[Ledger], most: int = 400) -> dict[str, list[float]]:
    columns = ("time", "kinetic", "strain", "mechanical", "algorithmic")
    whole = {name: np.concatenate([getattr(part, name) for part in ledgers]) for name in columns}
    lost = np.cumsum([0.0, *(float(part.algorithmic[-1]) for part in ledgers[:-1])])
    whole["algorithmic"] = np.concatenate(
        [part.algorithmic + start for part, start in zip(ledgers, lost, strict=True)]
    )
    chosen = np.unique(np.linspace(0, len(whole["time"]) - 1, most).astype(int))
    return {name: values[chosen].tolist() for name, values in whole.items()}
