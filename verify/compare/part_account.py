"""Separated parts of a moving solution: motion, energy and momentum of each, and metrics.

No metric here needs a reference: energy and momentum of the parts, and of the body, are kept.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from verify.compare.hooke import Law, cell_strain_energies
from verify.compare.locate import SolutionField
from verify.compare.mass import (
    Kinetic,
    Part,
    density_of,
    kinetic,
    part_of,
    separated_parts,
)
from verify.compare.motion import SolutionMotion, step_at
from verify.compare.motion_account import (
    NO_VELOCITIES,
    SCHEME,
    SIGNS,
    MotionAccount,
    balance,
    energy_scale,
    total_energy,
    uniform_force,
)
from verify.compare.outer_work import boundary_nodes_of_facets, nodes_held
from verify.errors import InputError, UnsupportedSceneError
from verify.result import Metric, Notice, NoticeKind, PartRecord, SolveRecord
from verify.scene import BodyForce, Gravity, PartQuantity, Scene, Traction
from verify.scene.parts import pieces_on_part
from verify.solution import Solution

Array = NDArray[np.float64]


PART_METRICS = ("part_linear_momentum_drift", "part_angular_momentum_drift")
_AXES = "xyz"


def part_records(scene: Scene, solution: Solution, account: MotionAccount) -> list[PartRecord]:
    """Make the record of each part of an account."""
    held, free_from = _held(scene, solution), _all_open(scene)
    force = uniform_force(scene)
    if scene.contact.closed or any(
        not isinstance(load, Gravity | BodyForce | Traction) for load in scene.loads
    ):
        force = None  # parts that touch push each other; another load may act on any part
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
                drag = scene.analysis.damping[0]
                drift = _drift(account.times, motion, force, drag, free_from)
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
    """Measure the largest drift of the momenta of the free parts, or say why there is none."""
    drifts = [part.drift for part in parts if part.drift]
    if drifts:
        return [
            Metric(
                f"part_{name}_drift", max(drift[name] for drift in drifts), "1",
                source="velocities of the solution",
            )
            for name in ("linear_momentum", "angular_momentum")
        ], {}  # fmt: skip
    why = "no part is free of supports, tractions and contact at two output times and moves"
    return [], dict.fromkeys(PART_METRICS, why if account.motions else NO_VELOCITIES)


def momentum_components(linear: Array, angular: Array) -> dict[str, list[float]]:
    """Name the components of momenta (t, d) and (t, 1 or 3)."""
    axes = _AXES[-angular.shape[1] :]
    rows = {f"linear_momentum_{_AXES[k]}": row.tolist() for k, row in enumerate(linear.T)}
    return rows | {f"angular_momentum_{axes[k]}": row.tolist() for k, row in enumerate(angular.T)}


def _drift(
    times: Array, motion: Kinetic, force: Array, drag: float, start: float
) -> dict[str, float]:
    """Change of the momenta since `start`, s, over what they are small against when they cancel.

    Beside a force per mass (d,), and a drag (1/s) by which alone they would fall off in time.
    """
    since = np.flatnonzero(times >= start - 1e-9 * float(np.ptp(times)))
    if len(since) < 2 or motion.linear_scale == 0.0:
        return {}
    first, when = since[0], (times[since] - times[since[0]])[:, None]
    left = np.exp(-drag * when)
    impulse = motion.mass * (-np.expm1(-drag * when) / drag if drag else when) * force
    linear = motion.linear[since] - left * motion.linear[first] - impulse
    spin = motion.spin[since] - left * motion.spin[first]
    return {
        "linear_momentum": float(np.linalg.norm(linear, axis=1).max()) / motion.linear_scale,
        "angular_momentum": float(np.linalg.norm(spin, axis=1).max()) / motion.angular_scale,
    }


def _all_open(scene: Scene) -> float:
    """Return the time at which the last cut is open all through, s."""
    return max((float(getattr(cut, "ends_at", cut.opens_at)) for cut in scene.cuts), default=0.0)


def _held(scene: Scene, solution: Solution) -> NDArray[np.bool_]:
    """Tell whether nodes (n,) are held, or pulled at on the outer boundary."""
    points, acted = solution.points, np.zeros(len(solution.points), dtype=bool)
    try:
        held = nodes_held(scene, solution, [support.where for support in scene.supports])
    except InputError:  # of a body that is another one: of no part it is known
        return ~acted
    for nodes in held:
        acted[nodes] = True
    facets = boundary_nodes_of_facets(solution)
    corners = points[facets[:, : solution.cell_dimension]]
    for load in scene.loads:
        if isinstance(load, Traction):
            pulled = pieces_on_part(scene.geometry, load.where, corners).facet
            acted[facets[pulled]] = True
    return acted


def motion_history(account: MotionAccount) -> dict[str, list[float]]:
    """Return energies and momenta over time, by name, with ``time`` (s).

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


_UNITS = {
    "mass": "kg", "inertia": "kg m²", "linear_momentum": "N s", "angular_momentum": "N m s",
    "kinetic_energy": "J", "strain_energy": "J",
}  # fmt: skip


def part_quantity(
    scene: Scene, solution: Solution, motion: SolutionMotion, law: Law, asked: PartQuantity
) -> float:
    """Evaluate a quantity of a part (2D: per metre of thickness).

    Raises
    ------
    UnsupportedSceneError
        If the solution has no velocities, or not that output time.
    """
    density = density_of(scene, solution)
    part = _holding(solution, motion, density, asked)
    if asked.of == "mass":
        return part.mass
    if asked.of == "inertia":
        return float(part.inertia[_row(asked, len(part.inertia))])
    cells = part.cells
    step = step_at(solution, asked.time)
    if asked.of == "strain_energy":
        return float(cell_strain_energies(SolutionField(solution, step), law)[cells].sum())
    if solution.velocity is None:
        raise UnsupportedSceneError(NO_VELOCITIES)
    found = kinetic(solution, density, cells, slice(step, step + 1))
    if asked.of == "kinetic_energy":
        return float(found.energy[0])
    row = found.linear[0] if asked.of == "linear_momentum" else found.spin[0]
    return float(row[_row(asked, len(row))])


def part_unit(asked: PartQuantity, dimension: int) -> str:
    """Return the SI unit; plane scenes are per metre of thickness."""
    unit = _UNITS[asked.of]
    return unit if dimension == 3 else f"{unit}/m"


def _holding(
    solution: Solution,
    motion: SolutionMotion,
    density: float | NDArray[np.float64],
    asked: PartQuantity,
) -> Part:
    """Part that holds the point; without one the whole body, whatever it consists of."""
    if asked.point is None:
        return part_of(solution, density, np.arange(len(solution.cells)))
    at = np.array([asked.point], dtype=float)
    cell = int(motion.cells_at(at, at)[0])
    return next(p for p in separated_parts(solution, density) if cell in p.cells)


def _row(asked: PartQuantity, count: int) -> int:
    return "xyz".index(asked.component or "x") if count > 1 else 0


MISMATCH = "ledger_mismatch"
OF_ENERGY = ("energy_drift", "energy_slope", "energy_oscillation", "energy_jump")
_ENERGIES = (*OF_ENERGY, MISMATCH)
_MOMENTA = ("linear_momentum_drift", "angular_momentum_drift")
ACCOUNT = (*_ENERGIES, *_MOMENTA, *PART_METRICS, "released_mismatch")
_NAMED = 1e-6  # of the energy in play: what a ledger of single precision is off by
_WARNED = 0.01  # of the energy in play: what a spectator would see
_ABSOLUTE = ("kinetic", "strain")  # the others are potentials and work, counted from the start


def account_metrics(scene: Scene, account: MotionAccount) -> tuple[list[Metric], dict[str, str]]:
    """Measure drifts of energy and momentum of a moving solution, all relative.

    Energies are measured (`verify.compare.motion_account`), without what the time scheme
    dissipates, over the largest energy that moved from one form to another in the run
    (`energy_scale`). ``energy_drift`` is the largest change over the run; ``energy_slope`` the
    secular change over the whole run (its uncertainty: two standard errors). ``energy_oscillation``
    is the rest beside trend and jumps; ``energy_jump`` the largest step at a cut. All uncertainties
    include the intervals of the energies. ``ledger_mismatch`` compares the solver's own ledger with
    the measurement: the largest difference of a part, or change of its sum, with the dissipation of
    the scheme. Momenta are integrated from the velocities.

    Returns
    -------
    metrics : list of Metric
    notes : dict of str to str
        Reasons for metrics that could not be measured; entries that the solver states alone
        (``work_of_loads``, ``work_of_supports``); and where its ledger differs (``ledger``).
    """
    metrics, notes = _energies(scene, account)
    found = account.whole
    if found is None:
        return metrics, notes | dict.fromkeys(_MOMENTA, NO_VELOCITIES)
    for kind, momentum, scale in (
        ("linear", found.linear, found.linear_scale),
        ("angular", found.angular, found.angular_scale),
    ):
        name = f"{kind}_momentum_drift"
        if scale > 0.0:
            drift = float(np.linalg.norm(momentum - momentum[0], axis=1).max())
            metrics.append(Metric(name, drift / scale, "1", source="velocities of the solution"))
        else:
            notes[name] = "nothing moves"
    return metrics, notes


def ledger_notices(records: Sequence[SolveRecord]) -> list[Notice]:
    """Warn of each solver whose own ledger differs from its fields, on its finest such level."""
    worst = {}
    for record in sorted(records, key=lambda one: one.level):
        found = record.metric(MISMATCH)
        if found is not None and found.value - found.uncertainty > _WARNED:
            worst[record.solver] = record.notes["ledger"]
    return [Notice(NoticeKind.WARNING, "energies", name, text) for name, text in worst.items()]


def _energies(scene: Scene, account: MotionAccount) -> tuple[list[Metric], dict[str, str]]:
    energies, times = account.energies, account.times
    total, scale = total_energy(energies.parts), energy_scale(energies.parts)
    if total is None or len(times) < 2:
        why = energies.lacking or "the solution has one output time"
        return [], dict.fromkeys(_ENERGIES, why)
    if scale == 0.0:
        return [], dict.fromkeys(_ENERGIES, "no energy moves")
    width = energies.width
    found = balance(times, total, [cut.opens_at for cut in scene.cuts], width)
    off, span = found.off, float(np.ptp(times))
    assert off is not None
    values = {
        "energy_drift": (found.drift, off.drift),
        "energy_slope": (abs(found.slope) * span, (2 * found.slope_error + off.slope) * span),
        "energy_oscillation": (found.oscillation, off.oscillation),
    }
    notes = dict(energies.sources)
    from_of = dict.fromkeys([*values, "energy_jump", MISMATCH], energies.width_from)
    if 2 * found.slope_error > off.slope:
        from_of["energy_slope"] = "a line through energies that oscillate"
    source = f"fields of the solution; kinetic energy by {notes.pop('kinetic_energy')}"
    if len(found.jumps):
        jump = float(np.abs(found.jumps).max())
        values["energy_jump"] = jump, found.oscillation + float(off.jumps.max())
        if found.oscillation > off.jumps.max():
            from_of["energy_jump"] = "a step between energies that oscillate"
    else:
        notes["energy_jump"] = "nothing is cut between the first and the last output time"
    if account.stated:
        values[MISMATCH], differing = _mismatch(account, _NAMED * scale)
        if differing:
            shares = ", ".join(f"{name} by {off / scale:.2g}" for name, off in differing.items())
            notes["ledger"] = (
                f"the solver's own energies differ from those measured: {shares} of the energy in "
                "play"
            )
    else:
        notes[MISMATCH] = "the solution has no ledger of its own"
    return [
        replace(
            _relative(name, *value, scale, float(width.max()), source), width_from=from_of[name]
        )
        for name, value in values.items()
    ], notes


def _relative(
    name: str, value: float, width: float, scale: float, scale_off: float, source: str
) -> Metric:
    """Make a metric of a value over the energy in play, which may be off too."""
    least = max(scale - scale_off, 1e-3 * scale)
    high = (value + width) / least
    return Metric(name, value / scale, "1", None, high - value / scale, source)


def _mismatch(account: MotionAccount, named: float) -> tuple[tuple[float, float], dict[str, float]]:
    """Find the largest difference of a ledger from the measurement, with its half-width, J.

    Return also each part that differs by more than `named`.
    """
    stated, energies = account.stated, account.energies
    still = np.zeros_like(account.times)
    off: dict[str, tuple[float, float]] = {}
    for name in SIGNS:
        if name not in stated:
            continue
        gap = stated[name] - energies.parts.get(name, still)
        gap = np.abs(gap if name in _ABSOLUTE else gap - gap[0])
        width = energies.widths.get(name, still)
        at = int(np.argmax(gap - width))
        off[name.replace("_", " ")] = float(gap[at]), float(width[at])
    closed = total_energy(stated, scheme=True)
    if "algorithmic" in stated and closed is not None:
        off["their sum"] = float(np.abs(closed - closed[0]).max()), 0.0
    worst = max(off.values(), key=lambda one: one[0] - one[1], default=(0.0, 0.0))
    return worst, {name: a for name, (a, w) in off.items() if a - w > named}
