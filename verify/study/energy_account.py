"""Metrics of a moving solution that need no reference: what is kept of energy and momentum."""

import numpy as np

from verify.compare.hooke import Law
from verify.compare.kinetic import kinetic
from verify.compare.ledger import balance, energy_scale, total_energy
from verify.compare.locate import SolutionField
from verify.compare.strain_energy import nodal_strain_energy
from verify.result import Metric
from verify.scene import Scene
from verify.solution import Solution

__all__ = ["ACCOUNT", "account_metrics"]

ACCOUNT = (
    "energy_drift", "energy_slope", "energy_oscillation", "energy_jump", "ledger_mismatch",
    "linear_momentum_drift", "angular_momentum_drift",
)  # fmt: skip


def account_metrics(
    scene: Scene, solution: Solution, law: Law
) -> tuple[list[Metric], dict[str, str]]:
    """Measure what a moving solution keeps, all relative.

    Energies are those of the solution's own ledger, without what its time scheme dissipates, over
    the largest energy that moved: ``energy_drift``, the largest change; ``energy_slope``, the
    secular change over the whole time (its uncertainty: two standard errors);
    ``energy_oscillation``, what is left beside trend and jumps; ``energy_jump``, the largest step
    at a cut. ``ledger_mismatch`` is the largest difference of the ledger's strain energy from
    that of the field, and of the ledger with the scheme's dissipation from its first value.
    Momenta are integrated from the velocities.

    Returns
    -------
    metrics : list of Metric
    notes : dict of str to str
        For what could not be measured, why.
    """
    metrics, notes = _energies(scene, solution, law)
    if solution.velocity is None or scene.material.density is None:
        why = "the solution has no velocities"
        return metrics, notes | {name: why for name in ACCOUNT if "momentum" in name}
    thickness = scene.material.thickness or 1.0  # of a membrane
    found = kinetic(solution, thickness * scene.material.density)
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


def _energies(scene: Scene, solution: Solution, law: Law) -> tuple[list[Metric], dict[str, str]]:
    ledger, times = solution.ledger, solution.times
    total, scale = total_energy(ledger), energy_scale(ledger)
    names = [name for name in ACCOUNT if "momentum" not in name]
    if total is None or len(times) < 2:
        return [], dict.fromkeys(names, "the solution has no ledger of energies over time")
    if scale == 0.0:
        return [], dict.fromkeys(names, "no energy moves")
    cuts = [cut.opens_at for cut in scene.cuts]
    found = balance(times, total, cuts)
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
    values["ledger_mismatch"] = _mismatch(solution, law), 0.0
    source = "ledger of the solution"
    metrics = [
        Metric(name, value / scale, "1", None, width / scale, source)
        for name, (value, width) in values.items()
    ]
    return metrics, notes


def _mismatch(solution: Solution, law: Law) -> float:
    """Largest disagreement of a ledger with the field and with itself, J."""
    off = [0.0]
    if "strain" in solution.ledger:
        field = SolutionField(solution)
        for u, stated in zip(solution.displacement, solution.ledger["strain"], strict=True):
            off.append(abs(nodal_strain_energy(field.with_nodal(u), law) - float(stated)))
    closed = total_energy(solution.ledger, scheme=True)
    if "algorithmic" in solution.ledger and closed is not None:
        off.append(float(np.abs(closed - closed[0]).max()))
    return max(off)
