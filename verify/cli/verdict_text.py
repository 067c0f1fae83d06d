"""Verdicts as lines of text."""

from collections import Counter
from collections.abc import Iterator, Sequence

from verify.printable import one_line
from verify.result import LOG, CaseResult, Notice, Status, Verdict, VerdictRecord


def verdict_lines(results: Sequence[CaseResult]) -> Iterator[str]:
    """Yield a line per case, one per notice, per check that is not a PASS, per bad end."""
    width = max((len(result.case) for result in results), default=0)
    for result in results:
        counts = Counter(record.verdict for record in result.verdicts)
        said = ", ".join(f"{counts[verdict]} {verdict}" for verdict in Verdict if counts[verdict])
        verdict = result.verdict if result.verdicts else "NOT JUDGED"
        if result.badge:
            said += f" [{result.badge}]"
        yield f"{result.case:<{width}}  {verdict:<10} {said}"
        yield from (f"    {notice_text(notice)}" for notice in result.notices)
        for record in result.verdicts:
            if record.verdict is not Verdict.PASS:
                known = f" (known finding: {record.known})" if record.known else ""
                badge = f" [{record.badge}]" if record.badge else ""
                said = f"{record.verdict}{badge}: {_check(record)}: {record.reason}{known}"
                yield f"    {one_line(said)}"
        for solve in result.solves:
            if solve.status is not Status.SOLVED:
                said = f"{solve.solver}, level {solve.level}: {solve.status}: {solve.reason}"
                where = f" (see {one_line(solve.notes[LOG])})" if LOG in solve.notes else ""
                yield f"    {one_line(said)}{where}"


def notice_text(notice: Notice) -> str:
    """Return a notice as one line."""
    whose = f" ({notice.solver})" if notice.solver else ""
    return f"{notice.kind.upper()}: {notice.about}{whose}: {notice.text}"


def _check(record: VerdictRecord) -> str:
    observed = "not observed" if record.observed is None else f"{record.observed:.6g}"
    whose = record.solver or "nobody"
    return f"{record.check} of {record.metric} ({whose}): {observed}, wanted {record.limit}"
