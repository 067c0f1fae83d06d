"""Two runs side by side: which verdicts changed."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from verify.baseline.checking import changes_between
from verify.baseline.finished_run import FinishedRun, finest
from verify.provenance import WIDTHS
from verify.result import CaseResult, Verdict, VerdictRecord, worst


@dataclass(frozen=True)
class VerdictChange:
    """A check whose verdict differs between two runs; None where a run does not have it.

    `direction` is ``better``, ``worse``, ``gone`` or ``new``.
    """

    case: str
    check: str
    old: Verdict | None
    new: Verdict | None
    old_observed: float | None
    new_observed: float | None
    direction: str
    reason: str


def verdict_changes(old: FinishedRun, new: FinishedRun) -> list[VerdictChange]:
    """Return the checks whose verdicts differ, those that became worse first."""
    changes = []
    for case in dict.fromkeys([*old.results, *new.results]):
        before, after = _checks(old.results.get(case)), _checks(new.results.get(case))
        for check in dict.fromkeys([*before, *after]):
            a, b = before.get(check), after.get(check)
            if a is None or b is None or a.verdict is not b.verdict:
                changes.append(_change(case, check, a, b))
    order = ["worse", "gone", "new", "better"]
    return sorted(changes, key=lambda change: order.index(change.direction))


def any_worse(changes: Sequence[VerdictChange]) -> bool:
    """Whether a verdict became worse, or a check that passed is gone."""
    return any(
        change.direction == "worse" or (change.direction == "gone" and change.old is Verdict.PASS)
        for change in changes
    )


def meaning_lines(old: FinishedRun, new: FinishedRun) -> Iterator[str]:
    """Yield a line per change of meaning between two runs, with the numbers that it concerns."""
    found: dict[str, list[str]] = {}
    for case, result in new.results.items():
        for solve in finest(result):
            for metric in solve.metrics:
                key = f"{solve.solver}/{solve.level}/{metric.name}"
                if changed := changes_between(result, key, old.meaning, new.meaning):
                    found.setdefault(changed, []).append(f"{case}:{key}")
    for changed, numbers in found.items():
        more = f" and {len(numbers) - 3} more" if len(numbers) > 3 else ""
        yield f"meaning: {changed} ({', '.join(numbers[:3])}{more})"
    if (old.meaning < WIDTHS[0]) != (new.meaning < WIDTHS[0]):
        yield f"meaning: since revision {WIDTHS[0]} {WIDTHS[1]}"


def _checks(result: CaseResult | None) -> dict[str, VerdictRecord]:
    """Verdicts by what is checked; a check that a case makes twice is numbered."""
    if result is None:
        return {}
    found, times = {}, Counter[str]()
    for record in result.verdicts:
        name = f"{record.check} of {record.metric} ({record.solver})"
        times[name] += 1
        found[name if times[name] == 1 else f"{name} #{times[name]}"] = record
    return found


def _change(
    case: str, check: str, old: VerdictRecord | None, new: VerdictRecord | None
) -> VerdictChange:
    if old is None or new is None:
        direction = "new" if old is None else "gone"
    else:
        worse = worst([old.verdict, new.verdict]) is new.verdict
        direction = "worse" if worse else "better"
    return VerdictChange(
        case=case,
        check=check,
        old=old.verdict if old else None,
        new=new.verdict if new else None,
        old_observed=old.observed if old else None,
        new_observed=new.observed if new else None,
        direction=direction,
        reason=new.reason if new else "not in the new run",
    )
