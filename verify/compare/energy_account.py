"""Metrics of a moving solution that need no reference: what is kept of energy and momentum."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from verify.compare.ledger import SIGNS, balance, energy_scale, total_energy
from verify.compare.motion_account import NO_VELOCITIES, MotionAccount
from verify.compare.part_account import PART_METRICS
from verify.result import Metric, Notice, NoticeKind, SolveRecord
from verify.scene import Scene

Array = NDArray[np.float64]

MISMATCH = "ledger_mismatch"
_ENERGIES = ("energy_drift", "energy_slope", "energy_oscillation", "energy_jump", MISMATCH)
_MOMENTA = ("linear_momentum_drift", "angular_momentum_drift")
ACCOUNT = (*_ENERGIES, *_MOMENTA, *PART_METRICS, "released_mismatch")
_NAMED = 1e-6  # of the energy in play: what a ledger of single precision is off by
_WARNED = 0.01  # of the energy in play: what a spectator would see
_ABSOLUTE = ("kinetic", "strain")  # the others are potentials and work, counted from the start


def account_metrics(scene: Scene, account: MotionAccount) -> tuple[list[Metric], dict[str, str]]:
    """Measure what a moving solution keeps, all relative.

    Energies are measured (`verify.compare.measured_energies`), without what the time scheme
    dissipates, over the largest energy that moved from one form to another in the run
    (`energy_scale`). ``energy_drift`` is the largest change over the run; ``energy_slope`` the
    secular change over the whole run (its uncertainty: two standard errors);
    ``energy_oscillation`` what is left beside trend and jumps; ``energy_jump`` the largest step at
    a cut. The uncertainty of all has that of the energies. ``ledger_mismatch`` is the largest
    difference of the solver's own ledger from what is measured, part by part, and of its sum, the
    scheme's dissipation included, from its first value. Momenta are integrated from the velocities.

    Returns
    -------
    metrics : list of Metric
    notes : dict of str to str
        For what could not be measured, why; what is the solver's word (``work_of_loads``,
        ``work_of_supports``), and where its ledger differs (``ledger``).
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
    """Warn of each solver whose own ledger is not that of its fields, on its finest such level."""
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
    notes = dict(energies.said)
    source = f"fields of the solution; kinetic energy by {notes.pop('kinetic_energy')}"
    if len(found.jumps):
        jump = float(np.abs(found.jumps).max())
        values["energy_jump"] = jump, found.oscillation + float(off.jumps.max())
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
        _relative(name, *value, scale, float(width.max()), source) for name, value in values.items()
    ], notes


def _relative(
    name: str, value: float, width: float, scale: float, scale_off: float, source: str
) -> Metric:
    """Make a metric of a value over the energy in play, which may be off too."""
    least = max(scale - scale_off, 1e-3 * scale)
    high = (value + width) / least
    return Metric(name, value / scale, "1", None, high - value / scale, source)


def _mismatch(account: MotionAccount, named: float) -> tuple[tuple[float, float], dict[str, float]]:
    """Largest difference of a ledger from what is measured, with its half-width, J.

    And by what more than `named` each part differs.
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
