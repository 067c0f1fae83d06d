"""Separated parts of a moving solution: what each is, how it moves, and what it keeps."""

import numpy as np
from numpy.typing import NDArray

from verify.compare.kinetic import Kinetic
from verify.compare.ledger import SCHEME, total_energy
from verify.compare.motion_account import NO_VELOCITIES, MotionAccount, uniform_force
from verify.compare.separated import boundary_nodes
from verify.result import Metric, PartRecord
from verify.scene import BodyForce, Gravity, Scene, Traction
from verify.scene.parts import on_part
from verify.solution import Solution

Array = NDArray[np.float64]

PART_METRICS = ("part_linear_momentum_drift", "part_angular_momentum_drift")
_AXES = "xyz"


def part_records(scene: Scene, solution: Solution, account: MotionAccount) -> list[PartRecord]:
    """Make the record of each part of an account."""
    held, free_from = _held(scene, solution), _all_open(scene)
    force = uniform_force(scene)
    if any(not isinstance(load, Gravity | BodyForce | Traction) for load in scene.loads):
        force = None  # a load that this does not know may act on any part
    found = []
    for k, part in enumerate(account.parts):
        free = force is not None and not held[solution.cells[part.cells]].any()
        motion = account.motions[k] if account.motions else None
        series = {"strain": account.strain[:, k].tolist()}
        drift: dict[str, float] = {}
        if motion is not None:
            series |= {"kinetic": motion.energy.tolist()}
            series |= momentum_components(motion.linear, motion.spin)
            if free and force is not None:
                drift = _drift(account.times, motion, force, free_from)
        found.append(
            PartRecord(
                part.mass, part.centre.tolist(), part.inertia.tolist(),
                free_from if free else None, drift, series,
            )
        )  # fmt: skip
    return found


def part_metrics(
    parts: list[PartRecord], account: MotionAccount
) -> tuple[list[Metric], dict[str, str]]:
    """Largest drift of the momenta of the free parts, or why there is none."""
    drifts = [part.drift for part in parts if part.drift]
    if drifts:
        return [
            Metric(
                f"part_{name}_drift", max(drift[name] for drift in drifts), "1",
                source="velocities of the solution",
            )
            for name in ("linear_momentum", "angular_momentum")
        ], {}  # fmt: skip
    why = "no part is free of supports and tractions at two output times and moves"
    return [], dict.fromkeys(PART_METRICS, why if account.motions else NO_VELOCITIES)


def momentum_components(linear: Array, angular: Array) -> dict[str, list[float]]:
    """Momenta (t, d) and (t, 1 or 3) by name and component."""
    axes = _AXES[-angular.shape[1] :]
    rows = {f"linear_momentum_{_AXES[k]}": row.tolist() for k, row in enumerate(linear.T)}
    return rows | {f"angular_momentum_{axes[k]}": row.tolist() for k, row in enumerate(angular.T)}


def _drift(times: Array, motion: Kinetic, force: Array, start: float) -> dict[str, float]:
    """Change of the momenta since `start`, s, over what they are small against when they cancel."""
    since = np.flatnonzero(times >= start - 1e-9 * float(np.ptp(times)))
    if len(since) < 2 or motion.linear_scale == 0.0:
        return {}
    first, when = since[0], times[since]
    impulse = motion.mass * (when - when[0])[:, None] * force
    linear = motion.linear[since] - motion.linear[first] - impulse
    spin = motion.spin[since] - motion.spin[first]
    return {
        "linear_momentum": float(np.linalg.norm(linear, axis=1).max()) / motion.linear_scale,
        "angular_momentum": float(np.linalg.norm(spin, axis=1).max()) / motion.angular_scale,
    }


def _all_open(scene: Scene) -> float:
    """When the last cut is open all through, s."""
    return max((float(getattr(cut, "ends_at", cut.opens_at)) for cut in scene.cuts), default=0.0)


def _held(scene: Scene, solution: Solution) -> NDArray[np.bool_]:
    """Whether nodes (n,) of the outer boundary are held, or pulled at."""
    boundary = np.flatnonzero(boundary_nodes(solution))
    held = np.zeros(len(solution.points), dtype=bool)
    size = float(np.linalg.norm(np.ptp(solution.points, axis=0)))
    acting = [s.where for s in scene.supports]
    acting += [load.where for load in scene.loads if isinstance(load, Traction)]
    for where in acting:
        held[boundary] |= on_part(scene.geometry, where, solution.points[boundary], size)
    return held


def motion_history(account: MotionAccount) -> dict[str, list[float]]:
    """Return what moves, by name, with ``time`` (s).

    Energies are those measured (J, in 2D per metre), with what the solver states of its scheme;
    ``total`` is the sum that physics keeps constant. ``linear_momentum_x`` … (N s) and
    ``angular_momentum_z`` (in space also x, y; N m s, about the origin) are integrated from the
    velocities, if there are any. Empty for a single output time.
    """
    if len(account.times) < 2:
        return {}
    own = {name: row for name, row in account.stated.items() if name in SCHEME}
    rows = {"time": account.times, **own, **account.energies.parts}
    total = total_energy(account.energies.parts)
    if total is not None:
        rows["total"] = total
    found = {name: [float(value) for value in row] for name, row in rows.items()}
    if account.whole is not None:
        found |= momentum_components(account.whole.linear, account.whole.angular)
    return found
