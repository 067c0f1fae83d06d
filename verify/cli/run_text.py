"""Text of a run: the expected cost before anything is solved, the verdicts after."""

import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

from verify.printable import duration_text, memory_text, one_line
from verify.report.notation import observed_text
from verify.result import LOG, CaseResult, Notice, Status, Verdict, VerdictRecord
from verify.runner.cost import REFERENCE, LevelCost, case_cost
from verify.runner.plan import solvers_of, stored_beside
from verify.runner.selection import Options
from verify.scene import Scene

_HOPELESS = 10.0  # times the memory of the machine: the estimate is good to a factor of about 3
_START = 0.8  # s: half of what a run takes before and after its cases; comparing a small case


def costs_of(scene: Scene, options: Options) -> list[LevelCost]:
    """Estimate the solves that a run of `scene` plans; a reference stored beside it costs none."""
    solvers = solvers_of(scene, options)
    if REFERENCE in solvers and stored_beside(scene, options) is not None:
        solvers.remove(REFERENCE)
    return case_cost(scene, solvers, options.repetitions)


def case_lines(costs: Sequence[LevelCost]) -> list[str]:
    """Return a line per solver, and one for the whole; none without an estimate."""
    if not costs:
        return []
    lines = []
    order = list(dict.fromkeys(row.solver for row in costs))  # of a family of scenes, each as one
    of_solver = sorted(costs, key=lambda row: order.index(row.solver))
    for solver, group in groupby(of_solver, key=lambda row: row.solver):
        rows = list(group)
        unknowns = ", ".join(_unknowns(row) for row in rows)
        lines.append(f"{solver}: about {unknowns} unknowns, {_spent(rows)}")
    limit = duration_text(Options.timeout)
    lines += [
        f"level {row.level} of the reference may not end within {limit} (--timeout); expected a "
        "larger size in [reference] of the case, a longer --timeout, or --within"
        for row in [one for one in costs if one.seconds > Options.timeout][:1]
        if row.solver == REFERENCE
    ]
    return [*lines, f"in all {_spent(costs)}; rough, by mesh sizes"]


def memory_line(costs: Iterable[LevelCost]) -> str:
    """Warn of the first level that this machine cannot hold by far; empty if there is none."""
    available = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    for row in costs:
        if row.memory > _HOPELESS * available:
            return (
                f"level {row.level} of {row.solver} would take about "
                f"{memory_text(row.memory)}, and this machine has {memory_text(available)}; "
                "expected mesh sizes in metres that fit the body"
            )
    return ""


def run_line(costs: Sequence[tuple[Scene, Sequence[LevelCost]]], jobs: int) -> str:
    """Say in a line what a run will take, and which case takes most; empty if nobody knows."""
    if not (rows := [row for _, group in costs for row in group]):
        return ""
    most, group = max(costs, key=lambda one: _seconds(one[1]))
    share = _seconds(group) / _seconds(rows)
    spent = _seconds(rows) + _START * len(costs)
    at = f", {share:.0%} of it in {most.name}" if len(costs) > 1 else ""
    largest = max(rows, key=lambda row: row.at_most)
    memory = memory_text(max(row.memory for row in rows))
    return (
        f"expected (rough): {duration_text(2 * _START + spent / jobs)}{at}; about "
        f"{_unknowns(largest)} unknowns and {memory} a process at most"
    )


def suites_line(costs: Sequence[tuple[Scene, Sequence[LevelCost]]], jobs: int) -> str:
    """Say which suite comes first, with the cases and the rough time of each."""
    said = []
    for option, tag in (("-k demo", "demo"), ("--quick", "quick")):
        if suite := [rows for scene, rows in costs if tag in scene.tags]:
            spent = _START * (2 + len(suite) / jobs) + sum(map(_seconds, suite)) / jobs
            said.append(f"`verify run {option}` ({len(suite)} cases, {duration_text(spent)})")
    return f"which suite first: {', then '.join(said)}; rough" if said else ""


def _unknowns(row: LevelCost) -> str:
    """Return the number of unknowns, or its range with one digit each."""
    if row.unknowns == row.at_most:
        return f"{row.unknowns}"
    return " to ".join(f"{n:.0e}".replace("e+0", "e") for n in (row.unknowns, row.at_most))


def _spent(rows: Sequence[LevelCost]) -> str:
    return f"{duration_text(_seconds(rows))}, {memory_text(max(row.memory for row in rows))}"


def _seconds(rows: Iterable[LevelCost]) -> float:
    return sum(row.seconds for row in rows)


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
    observed = "not observed" if record.observed is None else observed_text(record)
    whose = record.solver or "nobody"
    return f"{record.check} of {record.metric} ({whose}): {observed}, wanted {record.limit}"
