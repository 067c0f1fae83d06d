"""Where the realised cut of a solve is, and the errors that are not judged for that."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from verify.assess.error_history import error_history
from verify.assess.quantities import Measured
from verify.assess.reference import Reference
from verify.compare.body import AnyBody
from verify.compare.cut_deviation import cut_record
from verify.compare.errors import Rules
from verify.compare.locate import ROUND_OFF
from verify.cut_record import CutRecord
from verify.regularisation import Regularisation
from verify.result import CUT, SolveRecord
from verify.solution import Solution

MIXED = "mixed: some levels are judged with, some without continuation across the realised cut"


def measured_cut(solution: Solution, body: AnyBody, rules: Rules) -> CutRecord | None:
    """Measure the realised cut of a solution; None if nothing is cut."""
    rule = rules.finest("cut")
    return None if rule is None else cut_record(solution, body, rule)


def with_cut(record: SolveRecord, one: Measured, rules: Rules) -> SolveRecord:
    """Enter where the cut is, and say so in a note where it is not as asked."""
    if one.cut is None:
        return record
    cut, rule, other = one.cut, rules.finest("body"), one.other_motion
    if other is not None:
        swept = rule.weights[one.motion.differs(other, rule.points)].sum()
        cut = replace(cut, swept=float(swept))
    said, done = _said(cut, ROUND_OFF * one.body.size)
    notes = {**record.notes, CUT: "; ".join(said)} if said else record.notes
    return replace(record, cut=cut, notes=notes, regularisations=[*record.regularisations, *done])


def with_other_errors(
    record: SolveRecord, one: Measured, reference: Reference, times: Sequence[float | None],
    rules: Rules,
) -> SolveRecord:  # fmt: skip
    """Enter the errors with continuation where those without are judged, and the reverse."""
    if record.cut is None or (other := one.other_motion) is None:
        return record
    found = error_history(other, reference.motion, times, rules, one.law, 1).reported()
    errors = {name: norms[0].relative for name, norms in found.items()}
    kept = {name: value for name, value in errors.items() if np.isfinite(value)}
    return replace(record, cut=replace(record.cut, errors=kept))


def are_mixed(records: Sequence[SolveRecord]) -> bool:
    """Whether levels are judged with and without continuation, and that makes a difference."""
    differing = [record.cut for record in records if record.cut is not None and record.cut.errors]
    return len({cut.continued for cut in differing}) > 1


def _said(cut: CutRecord, same: float) -> tuple[list[str], list[Regularisation]]:
    """Say where a cut is not as asked; what is more than facets is stated as any change is."""
    said, done = [], []
    if cut.lateral > same:
        how = "with" if cut.continued else "without"
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
