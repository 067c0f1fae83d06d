"""Metrics of a moving solution that need no reference: what is kept of energy and momentum."""

import numpy as np

from verify.assess.motion_account import NO_VELOCITIES, MotionAccount
from verify.assess.part_account import PART_METRICS
from verify.compare.ledger import balance, energy_scale, total_energy
from verify.result import Metric
from verify.scene import Scene

_ENERGIES = (
    "energy_drift", "energy_slope", "energy_oscillation", "energy_jump", "ledger_mismatch",
)  # fmt: skip
_MOMENTA = ("linear_momentum_drift", "angular_momentum_drift")
ACCOUNT = (*_ENERGIES, *_MOMENTA, *PART_METRICS, "released_mismatch")


def account_metrics(scene: Scene, account: MotionAccount) -> tuple[list[Metric], dict[str, str]]:
    """Measure what a moving solution keeps, all relative.

    Energies are those of the solution's own ledger, without what its time scheme dissipates, or
    else those of its fields; over the largest energy that moved from one form to another in the
    run (`energy_scale`). ``energy_drift`` is the largest change over the run; ``energy_slope``
    the secular change over the whole run (its uncertainty: two standard errors);
    ``energy_oscillation`` what is left beside trend and jumps; ``energy_jump`` the largest step
    at a cut. ``ledger_mismatch`` is the largest difference of the ledger's strain energy from
    that of the field, and of the ledger with the scheme's dissipation from its first value.
    Momenta are integrated from the velocities.

    Returns
    -------
    metrics : list of Metric
    notes : dict of str to str
        For what could not be measured, why.
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


def _energies(scene: Scene, account: MotionAccount) -> tuple[list[Metric], dict[str, str]]:
    ledger, times = account.ledger, account.times
    total, scale = total_energy(ledger), energy_scale(ledger)
    if total is None or len(times) < 2:
        why = account.lacking or "the solution has one output time"
        return [], dict.fromkeys(_ENERGIES, why)
    if scale == 0.0:
        return [], dict.fromkeys(_ENERGIES, "no energy moves")
    found = balance(times, total, [cut.opens_at for cut in scene.cuts])
    span = float(np.ptp(times))
    values = {
        "energy_drift": (found.drift, 0.0),
        "energy_slope": (abs(found.slope) * span, 2 * found.slope_error * span),
        "energy_oscillation": (found.oscillation, 0.0),
    }
    notes = {}
    if len(found.jumps):
        values["energy_jump"] = float(np.abs(found.jumps).max()), found.oscillation
    else:
        notes["energy_jump"] = "nothing is cut between the first and the last output time"
    if account.is_own_ledger:
        values["ledger_mismatch"] = _mismatch(account), 0.0
    else:
        notes["ledger_mismatch"] = "the solution has no ledger of its own"
    metrics = [
        Metric(name, value / scale, "1", None, width / scale, account.source)
        for name, (value, width) in values.items()
    ]
    return metrics, notes


def _mismatch(account: MotionAccount) -> float:
    """Largest disagreement of a ledger with the field and with itself, J."""
    off = [0.0]
    if "strain" in account.ledger:
        off.append(float(np.abs(account.strain_of_all - account.ledger["strain"]).max()))
    closed = total_energy(account.ledger, scheme=True)
    if "algorithmic" in account.ledger and closed is not None:
        off.append(float(np.abs(closed - closed[0]).max()))
    return max(off)
