"""The tables of a case: checks, orders, numbers, times, reference, regularisations, failures."""

from collections.abc import Sequence
from statistics import median
from typing import Any

from verify.records import ReferenceRecord, Regularisation
from verify.report.blocks import Cell, Table
from verify.report.curves import duration, metric_names
from verify.report.notation import (
    bytes_text,
    error_text,
    error_title,
    is_error,
    metric_title,
    number,
    seconds_text,
    solver_title,
    spread_text,
    with_interval,
)
from verify.result import (
    CRITICAL_STEP,
    CUT,
    CaseResult,
    Metric,
    NoticeKind,
    SolveRecord,
    Status,
    Verdict,
    VerdictRecord,
)

MANY = 4  # solvers beyond which they stand side by side
_CHECKS = {"rate": "order of the", "error": "", "ratio": "worst ratio of the", "value": ""}


def case_tables(result: CaseResult) -> dict[str, Table | None]:
    """Return the tables of a case by their names in the template; None where there is no row."""
    return {
        "checks": _checks_table(result),
        "reasons": _reasons_table(result),
        "numbers": _numbers_table(result),
        "times": _times_table(result),
        "regularisations": _regularisations_table(result),
        "cuts": cuts_table(result),
    }


def check_text(record: VerdictRecord, named: bool = True) -> str:
    """Return what a check looks at in words, after whom it judges if `named`."""
    name = metric_title(record.metric) if record.check == "value" else error_title(record.metric)
    what = f"{_CHECKS.get(record.check, record.check)} {name}".strip()
    return (
        f"{solver_title(record.solver) if record.solver else 'nobody'}: {what}" if named else what
    )


def check_row(record: VerdictRecord) -> list[Any]:
    """Return the row of one check."""
    observed = _observed(record)
    if record.check == "value":  # as many digits as the limit has beside it
        observed = number(record.observed, 10)
    known = f"Known finding: {record.known} ({record.reason})" if record.known else record.reason
    return [
        check_text(record),
        observed,
        record.limit,
        Cell(record.badge, known, verdict=str(record.verdict)),
    ]


def _observed(record: VerdictRecord) -> str:
    """Return an observed value with its interval; an error that may be 0, as what it is below."""
    value, low, high = record.observed, record.low, record.high
    if record.check in ("error", "ratio") and low == 0.0 and value is not None and high is not None:
        return error_text(value, high - value)
    return with_interval(value, low, high)


def _checks_table(result: CaseResult) -> Table | None:
    """Return the verdicts of a case: a row for each, or, for many solvers, one for each check."""
    if not result.verdicts:
        return None
    solvers = list(dict.fromkeys(record.solver for record in result.verdicts))
    if len(solvers) <= MANY:
        head = ["check", "observed [interval]", "limit", "verdict"]
        rows = [check_row(record) for record in result.verdicts]
        return Table("Verdicts", head, rows, "verdicts")
    checks: dict[tuple[str, str], dict[str | None, Cell]] = {}
    for record in result.verdicts:
        observed = _observed(record)
        shown = number(record.observed, 2) if "[" in observed else observed
        badge = f"{record.badge}; " if record.badge else ""
        cell = Cell(note=f"{badge}{shown}", tip=f"{observed}: {record.reason}",
                    verdict=str(record.verdict))  # fmt: skip
        checks.setdefault((check_text(record, named=False), record.limit), {})[record.solver] = cell
    across = [[Cell(what, limit), *(own.get(solver, "–") for solver in solvers)]
              for (what, limit), own in checks.items()]  # fmt: skip
    names = [solver_title(solver or "nobody") for solver in solvers]
    return Table("Verdicts", ["check, limit", *names], across, "many", named=True)


def _reasons_table(result: CaseResult) -> Table | None:
    """Return, for many solvers, why checks did not pass."""
    few = len({record.solver for record in result.verdicts}) <= MANY
    rows = [check_row(r) for r in result.verdicts if not few and r.verdict is not Verdict.PASS]
    head = ["check", "observed [interval]", "limit", "verdict"]
    return Table("Not passed", head, rows, "verdicts") if rows else None


def _numbers_table(result: CaseResult) -> Table | None:
    """Return every measured number of every solve with its uncertainty."""
    names = metric_names(result)
    if not result.solves:
        return None
    titles = [Cell(metric_title(name), _common_reference(result, name)) for name in names]
    head = ["solver", "level", "h (m)", "unknowns", *titles]
    rows: list[list[Any]] = [
        [*_named(solve), solve.size, solve.unknowns, *(_measured(solve, n, result) for n in names)]
        for solve in _ordered(result)
    ]
    for notice in result.notices:
        if notice.kind is NoticeKind.UNAVAILABLE:
            whose = solver_title(notice.solver) if notice.solver else "every solver"
            said = f"{metric_title(notice.about)} is not available: {notice.text}"
            rows.append([whose, Cell("", said, span=len(head) - 1)])
    return Table("Numbers: value ± uncertainty", head, rows)


def _times_table(result: CaseResult) -> Table | None:
    """Return the wall time of every phase: median, and smallest to largest repetition."""
    phases = list(dict.fromkeys(name for solve in result.solves for name in solve.timings))
    if not phases:
        return None
    iterative = any(solve.iterations for solve in result.solves)
    stepping = any(CRITICAL_STEP in solve.notes for solve in result.solves)
    head = ["solver", "level", *phases, "total without meshing", "process", "memory"]
    head += ["iterations"] if iterative else []
    head += ["critical step"] if stepping else []
    rows = []
    for solve in _ordered(result):
        if not solve.timings:
            continue
        whole = duration(solve)
        iterations = ", ".join(f"{name} {count}" for name, count in solve.iterations.items())
        rows.append(
            [
                *_named(solve),
                *(_spread(solve.timings.get(phase, [])) for phase in phases),
                seconds_text(whole.median) if whole else "–",
                seconds_text(solve.wall),
                bytes_text(solve.peak_memory),
                *([iterations or "–"] if iterative else []),
                *([solve.notes.get(CRITICAL_STEP, "–")] if stepping else []),
            ]
        )
    return Table("Wall times: median (smallest to largest repetition)", head, rows)


def _regularisations_table(result: CaseResult) -> Table | None:
    """Return all that the solvers dropped, snapped, clamped, scaled or floored."""
    groups: dict[tuple[str, str], list[tuple[int, Regularisation]]] = {}
    for solve in _ordered(result):
        for entry in solve.regularisations:
            groups.setdefault((solve.solver, entry.kind), []).append((solve.level, entry))
    rows = []
    for (solver, kind), found in groups.items():
        sizes = [entry.size for _, entry in found if entry.size is not None]
        counts = ", ".join(f"{number(entry.count)} (level {n})" for n, entry in found)
        largest = f"{number(max(sizes), 2)} {found[0][1].unit}" if sizes else "–"
        rows.append([solver_title(solver), kind, counts, largest])
    head = ["solver", "what was done", "how often", "largest contribution"]
    return Table("Regularisations", head, rows, "prose") if rows else None


def cuts_table(result: CaseResult) -> Table | None:
    """Return where realised cuts are not as asked, and the errors that are not judged for that."""
    rows = []
    for solve in _ordered(result):
        cut = solve.cut
        if cut is None or CUT not in solve.notes:
            continue
        of_ends, of_swept = ("m", "m²") if cut.dimension == 2 else ("m²", "m³")
        judged = f"{'with' if cut.continued else 'partly without'} continuation"
        judged += ", under-resolved" if cut.under_resolved else ""
        rows.append(
            [
                *_named(solve),
                _in_elements(cut.asked_to_realised, solve),
                _in_elements(cut.realised_to_asked, solve),
                *(f"{number(amount, 2)} {of_ends}" for amount in (cut.missing, cut.surplus)),
                f"{number(cut.swept, 2)} {of_swept}",
                judged,
                number(cut.errors.get("displacement_l2"), 2),
            ]
        )
    head = [
        "solver", "level", "beside it: as asked", "as realised", "missing", "too much", "swept",
        "judged", "L² error that is not",
    ]  # fmt: skip
    return Table("Cuts that are not where they were asked", head, rows) if rows else None


def _named(solve: SolveRecord) -> list[str]:
    return [solver_title(solve.solver), str(solve.level)]


def _in_elements(length: float, solve: SolveRecord) -> str:
    size = f" ({number(length / solve.size, 2)} h)" if solve.size else ""
    return f"{number(length, 2)} m{size}"


def reference_facts(reference: ReferenceRecord) -> list[tuple[str, str]]:
    """Return name and value of what the record of a reference says in single values."""
    return [(_words(k), _value(v)) for k, v in _said(reference).items() if not isinstance(v, dict)]


def reference_tables(reference: ReferenceRecord) -> list[Table]:
    """Return the nested parts of the record of a reference as tables."""
    return [
        _levels_table(record) if key == "time_to_accuracy" else _nested(key, record)
        for key, record in _said(reference).items()
        if isinstance(record, dict)
    ]


def _said(reference: ReferenceRecord) -> dict[str, Any]:
    return {key: value for key, value in reference.said().items() if value not in ([], {}, "")}


def _levels_table(levels: dict[str, dict[str, Any]]) -> Table:
    """Return what each level of a reference cost and bounds of its errors, levels side by side."""
    costs = {"unknowns": number, "seconds": seconds_text}
    names = dict.fromkeys(name for entry in levels.values() for name in entry)
    rows = [
        ["wall time" if name == "seconds" else name]
        + [costs[name](entry.get(name)) for entry in levels.values()]
        for name in names
        if name in costs
    ]
    rows += [
        [error_title(name), *(number(entry.get(name), 2) for entry in levels.values())]
        for name in names
        if name not in costs
    ]
    caption = "Reference: time to accuracy; of errors, bounds that the finest level gives"
    return Table(caption, ["", *map(_words, levels)], rows)


def _nested(key: str, record: dict[str, Any]) -> Table:
    """Return a table with one row per entry, if the entries are records; else name and value."""
    caption = f"Reference: {_words(key)}"
    if all(isinstance(entry, dict) for entry in record.values()):
        columns = list(dict.fromkeys(name for entry in record.values() for name in entry))
        rows = [
            [metric_title(name), *(_value(entry.get(column)) for column in columns)]
            for name, entry in record.items()
        ]
        return Table(caption, ["", *map(_words, columns)], rows, "prose")
    rows = [[_words(name), _value(value)] for name, value in record.items()]
    return Table(caption, ["", "value"], rows)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list | tuple):
        return ", ".join(map(_value, value)) if value else "–"
    if isinstance(value, dict):
        return ", ".join(f"{_words(name)} {_value(entry)}" for name, entry in value.items())
    if isinstance(value, float):
        return number(value, _digits(value))
    return number(value) if value is None or isinstance(value, int) else str(value)


def _digits(value: float, most: int = 7) -> int:
    """Return how many significant digits `value` needs, up to `most`."""
    whole = float(f"{value:.{most}g}")
    return next((n for n in range(2, most) if float(f"{value:.{n}g}") == whole), most)


def _words(key: str) -> str:
    return key.replace("_", " ")


def _ordered(result: CaseResult) -> list[SolveRecord]:
    """Return the solves with each solver's levels together, solvers as they first appear."""
    solvers = list(dict.fromkeys(solve.solver for solve in result.solves))
    return sorted(result.solves, key=lambda solve: (solvers.index(solve.solver), solve.level))


def _references(result: CaseResult, name: str) -> set[tuple[float, str]]:
    found = [metric for solve in result.solves if (metric := solve.metric(name)) is not None]
    return {(m.reference, m.unit) for m in found if m.reference is not None}


def _common_reference(result: CaseResult, name: str) -> str:
    """Return the reference value of a quantity, if all solves are held against the same one."""
    if len(references := _references(result, name)) != 1:
        return ""
    ((value, unit),) = references
    return f"reference {number(value, 8)}{'' if unit == '1' else f' {unit}'}"


def _measured(solve: SolveRecord, name: str, result: CaseResult) -> Cell:
    metric: Metric | None = solve.metric(name)
    if metric is None:
        return Cell("–" if solve.status is Status.SOLVED else str(solve.status))
    unit = "" if metric.unit == "1" else f" {metric.unit}"
    if is_error(name):
        return Cell(f"{error_text(metric.value, metric.uncertainty, 5)}{unit}")
    value = number(metric.value, 5 if metric.reference is None else 8)
    plus = f" ± {number(metric.uncertainty, 2)}" if metric.uncertainty > 0 else ""
    own = ""
    if metric.reference is not None and len(_references(result, name)) > 1:
        own = f"reference {number(metric.reference, 8)}{unit}"
    return Cell(f"{value}{plus}{unit}", own)


def _spread(values: Sequence[float]) -> str:
    if not values:
        return "–"
    if len(values) == 1:
        return f"{seconds_text(values[0])} (once)"
    return spread_text(median(values), min(values), max(values))
