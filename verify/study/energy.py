"""The energy study: what any solver keeps of energy, momenta and mass in motions."""

from collections.abc import Iterator, Sequence
from time import perf_counter

from verify.errors import InputError
from verify.result import Verdict
from verify.scene import Scene
from verify.study.measured_scenes import (
    AT_MOST,
    MeasuredStudy,
    Measurement,
    Variant,
    measured_families,
    measured_scene,
    missing_solutions,
)
from verify.study.record import Finding
from verify.study.solving import Making

_DRIFT = 1e-2  # of the energy in play: what a spectator would not see
_KEPT = 1e-8
# momenta are in the table: the supports of most scenes change them
_BESIDE = ("energy_slope", "energy_oscillation", "energy_jump", "ledger_mismatch")


def energy_study(
    scenes: Sequence[Scene],
    variants: Sequence[Variant],
    making: Making,
    quick: bool = False,
) -> MeasuredStudy:
    """Run every motion with every solver, and measure what is kept.

    Parameters
    ----------
    scenes : sequence of Scene
        Those that do not move are left out.
    variants : sequence of Variant
    making : Making
    quick : bool
        For the record.

    Raises
    ------
    InputError
        If no scene moves.
    """
    cases: dict[str, list[Scene]] = {}
    for scene in scenes:
        if scene.analysis.kind == "dynamic":
            name = scene.row.family if scene.row else scene.name
            cases.setdefault(name, []).append(scene)
    if not cases:
        raise InputError("no case with a dynamic analysis; see `verify list`")
    start = perf_counter()
    every = measured_families("energy", measured_scene, cases, variants, making)
    return MeasuredStudy(
        findings=list(_findings(every)), seconds=perf_counter() - start, quick=quick,
        measurements=every,
    )  # fmt: skip


def _findings(measured: Sequence[Measurement]) -> Iterator[Finding]:
    for case in dict.fromkeys(m.family for m in measured):
        for solver in dict.fromkeys(m.solver for m in measured if m.family == case):
            own = [m for m in measured if (m.family, m.solver) == (case, solver)]
            yield from missing_solutions(f"{case}, {solver}", own)
            yield from account_findings(f"{case}, {solver}", own)


def account_findings(topic: str, own: Sequence[Measurement]) -> Iterator[Finding]:
    """Judge what one solver keeps of its energy, and of the values that the case states."""
    drifts = _worst(own, "energy_drift")
    if drifts is not None:
        value, at = drifts
        grade = "is kept to round-off" if value <= _KEPT else "drifts"
        others = [f"{name} {found[0]:.2g}" for name in _BESIDE if (found := _worst(own, name))]
        text = f"The energy {grade}: {value:.3g} of the energy in play{at}"
        text += f" ({', '.join(others)})." if others else "."
        tops = {m.size: m.value or 0.0 for m in own if m.quantity == AT_MOST}
        values = {m.size: m.value or 0.0 for m in own if m.quantity == "energy_drift"}
        most = max([*tops.values(), value])
        least = max(2 * v - tops.get(size, v) for size, v in values.items())
        verdict = Verdict.PASS if most <= _DRIFT else Verdict.FAIL
        if least <= _DRIFT < most:
            verdict = Verdict.UNDECIDED
            text += f" Its interval reaches up to {most:.2g}."
        yield Finding(topic, text, f"at most {_DRIFT:g} over the run", verdict)
    for name in dict.fromkeys(m.quantity for m in own if m.quantity.startswith("deviation of")):
        found, limit = _worst(own, name), min(m.limit or 0.0 for m in own if m.quantity == name)
        if found is not None:
            value, at = found
            verdict = Verdict.PASS if value <= limit else Verdict.FAIL
            text = f"The {name} from the value that the case states is {value:.2g}{at}."
            yield Finding(topic, text, f"at most {limit:g}, as the case asks", verdict)


def _worst(own: Sequence[Measurement], quantity: str) -> tuple[float, str] | None:
    """Return the largest value of a quantity, and at which value of the parameter."""
    known = [m for m in own if m.quantity == quantity and m.value is not None]
    if not known:
        return None
    worst = max(known, key=lambda m: abs(m.value or 0.0))
    return abs(worst.value or 0.0), "" if worst.size is None else f" at {worst.size:g}"
