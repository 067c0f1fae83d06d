"""Position of the realised cut of a solve, and the errors that are not judged because of it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from verify.compare.body import AnyBody
from verify.compare.cut_deviation import RealisedCut, realised_cut
from verify.compare.errors import COARSER, Rules, error_history
from verify.compare.hooke import Law
from verify.compare.locate import ROUND_OFF
from verify.compare.motion import Motion, SolutionMotion
from verify.judge.quantities import Measured
from verify.result import CUT, CutRecord, Regularisation, SolveRecord
from verify.solution import Solution

MIXED = "mixed: some levels are judged without continuation across parts of the realised cut"


def measured_cut(solution: Solution, body: AnyBody, rules: Rules) -> RealisedCut | None:
    """Measure the realised cut of a solution; None if nothing is cut."""
    rule = rules.on_cuts()
    return None if rule is None else realised_cut(solution, body, rule)


def with_cut(
    record: SolveRecord, one: Measured, rules: Rules
) -> tuple[SolveRecord, SolutionMotion | None]:
    """Enter where the cut is, and say so in a note where it is not as asked.

    Returned with it is the field that is not judged: without any continuation across the realised
    cut if that judged is with it, else with it everywhere; None if both are the same.
    """
    if one.cut is None:
        return record, None
    cut, other = one.cut.record, None
    same = ROUND_OFF * one.body.size
    if cut.lateral > same:
        plain, whole = one.continued(False), one.motion
        other = plain
        if not cut.continued:
            other = whole = one.continued(True)
        rule = rules.one("body", COARSER[0])
        swept = rule.weights[whole.differs(plain, rule.points)].sum()
        cut = replace(cut, swept=float(swept))
    said, done = _said(cut, same)
    notes = {**record.notes, CUT: "; ".join(said)} if said else record.notes
    entries = [*record.regularisations, *done]
    return replace(record, cut=cut, notes=notes, regularisations=entries), other


def with_other_errors(
    record: SolveRecord, other: SolutionMotion | None, reference: Motion,
    times: Sequence[float | None], rules: Rules, law: Law,
) -> SolveRecord:  # fmt: skip
    """Enter the errors of the field that is not judged, by the first rule that is asked."""
    if record.cut is None or other is None:
        return record
    found = error_history(other, reference, times, rules, law, COARSER[:1]).reported()
    errors = {name: norms[0].relative for name, norms in found.items()}
    kept = {name: value for name, value in errors.items() if np.isfinite(value)}
    return replace(record, cut=replace(record.cut, errors=kept))


def are_mixed(records: Sequence[SolveRecord]) -> bool:
    """Whether some levels are continued across all of the realised cut, and others are not."""
    differing = [record.cut for record in records if record.cut is not None and record.cut.errors]
    return len({cut.continued for cut in differing}) > 1


def _said(cut: CutRecord, same: float) -> tuple[list[str], list[Regularisation]]:
    """Say where a cut is not as asked; what is more than facets is stated as any change is."""
    said, done = [], []
    if cut.lateral > same:
        how = "with" if cut.continued else "there without"
        said.append(
            f"up to {cut.lateral:.3g} m ({cut.lateral / cut.element:.2g} of an element) beside the "
            f"cut as asked: errors are {how} continuation across it"
        )
    if not cut.continued:
        done.append(Regularisation("cut beside where it was asked", 1, cut.lateral, "m"))
    if cut.under_resolved:
        assert cut.radius is not None
        said.append(f"under-resolved: radius {cut.radius / cut.element:.2g} elements")
    unit, least = ("m", same) if cut.dimension == 2 else ("m²", 1e-9 * cut.element**2)
    for what, amount in (("missing", cut.missing), ("too much", cut.surplus)):
        if amount > least:
            said.append(f"{amount:.3g} {unit} of it {what}")
            done.append(Regularisation(f"cut {what} at ends", 1, amount, unit))
    return said, done
