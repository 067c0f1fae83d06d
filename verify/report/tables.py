"""The tables of a case: checks, orders, numbers, times, reference, regularisations, failures."""

from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from verify.report.curves import duration, error_of, metric_names
from verify.report.notation import (
    NORMS,
    ROUND_OFF,
    Cell,
    Table,
    bytes_text,
    digits_beside,
    error_text,
    error_title,
    is_error,
    metric_title,
    number,
    observed_text,
    scientific,
    seconds_text,
    solver_title,
    spread_text,
)
from verify.result import (
    CRITICAL_STEP,
    CUT,
    REFERENCE,
    CaseResult,
    Metric,
    NoticeKind,
    ReferenceRecord,
    Regularisation,
    SolveRecord,
    Status,
    Verdict,
    VerdictRecord,
    finest_of,
)

MANY = 4  # solvers beyond which they stand side by side
_CHECKS = {"rate": "order of the", "error": "", "ratio": "worst ratio of the", "value": "",
           "excess": "excess of the"}  # fmt: skip


def case_tables(result: CaseResult) -> dict[str, Table | None]:
    """Return the tables of a case by their names in the template; None where there is no row."""
    return {
        "checks": _checks_table(result),
        "errors": _errors_table(result),
        "reasons": _reasons_table(result),
        "numbers": _numbers_table(result),
        "times": _times_table(result),
        "regularisations": _regularisations_table(result),
        "cuts": cuts_table(result),
    }


def check_text(record: VerdictRecord, named: bool = True) -> str:
    """Return what a check looks at in words, after whom it judges if `named`."""
    name = (metric_title if record.check in ("value", "excess") else error_title)(record.metric)
    what = f"{_CHECKS.get(record.check, record.check)} {name}".strip()
    return f"{solver_title(record.solver or 'nobody')}: {what}" if named else what


def check_row(record: VerdictRecord, unit: str = "") -> list[Any]:
    """Return the row of one check; a value is in `unit`."""
    observed, limit = observed_text(record), record.limit
    if record.check == "value" and record.observed is not None:
        unit = f" {unit}" if unit not in ("", "1") else ""
        observed = number(record.observed, _digits_to_judge(record)) + unit
        limit = limit.replace(" ±", f"{unit} ±", 1)
    known = f"Known finding: {record.known} ({record.reason})" if record.known else record.reason
    verdict = Cell(record.badge, scientific(known), verdict=str(record.verdict))
    return [check_text(record), observed, scientific(limit), verdict]


def _digits_to_judge(record: VerdictRecord) -> int:
    """Return the digits of a value that tell whether it is the one that its limit asks for."""
    try:
        wanted, tolerance = (float(word) for word in record.limit.split()[:3:2])
    except ValueError:
        return 4
    off = abs((record.observed or 0.0) - wanted)
    return max(digits_beside(wanted, max(off, abs(wanted) * tolerance), 10), 4)


def _units(result: CaseResult) -> dict[str, str]:
    return {m.name: m.unit for solve in result.solves for m in solve.metrics}


def _checks_table(result: CaseResult) -> Table | None:
    """Return the verdicts of a case: a row for each, or, for many solvers, one for each check."""
    if not result.verdicts:
        return None
    solvers = list(dict.fromkeys(record.solver for record in result.verdicts))
    units = _units(result)
    if len(solvers) <= MANY:
        return _rows_of("Verdicts", result.verdicts, units)
    checks: dict[tuple[str, str], dict[str | None, Cell]] = {}
    for record in result.verdicts:
        _, observed, limit, cell = check_row(record, units.get(record.metric, ""))
        shown = number(record.observed, 2) if "[" in observed else observed
        badge = f"{record.badge}; " if record.badge else ""
        cell = Cell(note=f"{badge}{shown}", tip=f"{observed}: {cell.note}", verdict=cell.verdict)
        checks.setdefault((check_text(record, named=False), limit), {})[record.solver] = cell
    across = [[Cell(what, limit), *(own.get(solver, "–") for solver in solvers)]
              for (what, limit), own in checks.items()]  # fmt: skip
    names = [solver_title(solver or "nobody") for solver in solvers]
    return Table("Verdicts", ["check, limit", *names], across, "many", named=True)


def _reasons_table(result: CaseResult) -> Table | None:
    """Return, for many solvers, why checks did not pass."""
    few = len({record.solver for record in result.verdicts}) <= MANY
    bad = [r for r in result.verdicts if not few and r.verdict is not Verdict.PASS]
    return _rows_of("Not passed", bad, _units(result)) if bad else None


def _rows_of(title: str, records: Sequence[VerdictRecord], units: Mapping[str, str]) -> Table:
    rows = [check_row(record, units.get(record.metric, "")) for record in records]
    return Table(title, ["check", "observed [interval]", "limit", "verdict"], rows, "verdicts")


def _errors_table(result: CaseResult) -> Table | None:
    """Return the errors of every solver on its finest level, side by side."""
    solved = (s for s in result.solves if s.status is Status.SOLVED and s.solver != REFERENCE)
    solves = list(finest_of(solved).values())
    head = [
        Cell(solver_title(s.solver), f"level {s.level}, h {number(s.size, 3)} m, "
             f"{number(s.unknowns)} unknowns") for s in solves
    ]  # fmt: skip
    names = [n for n in metric_names(result) if n in NORMS or not is_error(n)]
    rows = [[error_title(n), *(_error_of(s.metric(n)) for s in solves)] for n in names]
    rows = [[cell or "–" for cell in row] for row in rows if any(row[1:])]
    caption = "Errors on the finest level ± uncertainty"
    return Table(caption, ["error", *head], rows, "errors", named=True) if rows else None


def _error_of(metric: Metric | None) -> str:
    """Return an error, or the relative error of a quantity that has a reference; else nothing."""
    if metric is None or not (is_error(metric.name) or metric.reference):
        return ""
    value, half = error_of(metric)
    if value + half < ROUND_OFF:
        return f"round-off ({number(value, 2)})" if value else number(value)
    return error_text(value, half)


def _numbers_table(result: CaseResult) -> Table | None:
    """Return every measured number of every solve with its uncertainty."""
    names = metric_names(result)
    if not result.solves:
        return None
    titles = [Cell(metric_title(name), _common_reference(result, name)) for name in names]
    head = ["solver", "level", "h, m", "unknowns", *titles]
    rows: list[list[Any]] = [
        [*_named(solve), solve.size, solve.unknowns, *(_measured(solve, n, result) for n in names)]
        for solve in _ordered(result)
    ]
    for notice in result.notices:
        if notice.kind is NoticeKind.UNAVAILABLE:
            whose = solver_title(notice.solver) if notice.solver else "every solver"
            said = f"{metric_title(notice.about)} is not available: {notice.text}"
            rows.append([whose, Cell("", said, span=len(head) - 1)])
    return Table("Numbers: value ± uncertainty", head, rows, "numbers")


def _times_table(result: CaseResult) -> Table | None:
    """Return the wall time of every phase: median, and smallest to largest repetition."""
    phases = list(dict.fromkeys(name for solve in result.solves for name in solve.timings))
    if not phases:
        return None
    iterative = any(solve.iterations for solve in result.solves)
    stepping = any(CRITICAL_STEP in solve.notes for solve in result.solves)
    head = ["solver", "level", *phases, "for each cut", "process", "memory"]
    head += ["iterations"] if iterative else []
    head += ["critical step"] if stepping else []
    rows = []
    for solve in _ordered(result):
        if not solve.timings:
            continue
        whole = duration(solve)
        iterations = ", ".join(f"{name} {count}" for name, count in solve.iterations.items())
        rows.append([
            *_named(solve), *(_spread(solve.timings.get(phase, [])) for phase in phases),
            seconds_text(whole.median) if whole else "–", seconds_text(solve.wall),
            bytes_text(solve.peak_memory), *([iterations or "–"] if iterative else []),
            *([solve.notes.get(CRITICAL_STEP, "–")] if stepping else []),
        ])  # fmt: skip
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
        rows.append([
            *_named(solve), _in_elements(cut.asked_to_realised, solve),
            _in_elements(cut.realised_to_asked, solve),
            *(f"{number(amount, 2)} {of_ends}" for amount in (cut.missing, cut.surplus)),
            f"{number(cut.swept, 2)} {of_swept}", judged,
            number(cut.errors.get("displacement_l2"), 2),
        ])  # fmt: skip
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
    near, overlap = reference.near or {}, reference.overlap or {}
    suffices = {True: "yes", False: "no"}.get(bool(reference.suffices))
    said = [
        ("reference", reference.source or reference.kind),
        ("why there is none", reference.reason),
        ("suffices", f"{suffices}: {why}" if (why := reference.suffices_reason) else ""),
        ("near a tip", f"within {number(near['radius'], 2)} m: {near.get('reason')}"
         if near.get("radius") else ""),
        ("material of the exact solution lies in other material",
         f"by {number(overlap['depth'], 2)} m" if overlap.get("depth") else ""),
        *((metric_title(name), why) for name, why in (reference.missing or {}).items()),
    ]  # fmt: skip
    return [(name, scientific(str(words))) for name, words in said if words]


def reference_tables(reference: ReferenceRecord, units: Mapping[str, str]) -> list[Table]:
    """Return the levels of a reference, what it knows of each metric, and the errors it judges."""
    tables = (_levels_table(reference), _known_table(reference.metrics or {}, units),
              _judged_table(reference.judged_errors or {}))  # fmt: skip
    return [table for table in tables if table.rows]


def _levels_table(reference: ReferenceRecord) -> Table:
    """Return what each level of a reference cost and bounds of its errors, levels side by side."""
    levels = reference.time_to_accuracy or {}
    rows: list[list[Any]] = []
    sizes = [one.get("size") for one in reference.levels or []]
    if levels and len(sizes) == len(levels):
        rows.append(["h, m", *(number(size, 3) for size in sizes)])
    for name in dict.fromkeys(name for entry in levels.values() for name in entry):
        found = [entry.get(name) for entry in levels.values()]
        if name in _COSTS:
            rows.append([_COSTS[name][0], *map(_COSTS[name][1], found)])
        elif name in NORMS or not is_error(name):
            rows.append([error_title(name), *(number(value, 2) for value in found)])
    caption = "Reference: levels, and bounds of their errors that the finest gives"
    return Table(caption, ["", *(name.replace("_", " ") for name in levels)], rows)


_COSTS: dict[str, tuple[str, Any]] = {
    "unknowns": ("unknowns", number),
    "seconds": ("wall time", seconds_text),
}


def _known_table(metrics: Mapping[str, Mapping[str, Any]], units: Mapping[str, str]) -> Table:
    """Return the value of each quantity, and the uncertainty that an error has from it."""
    rows = []
    for name, own in metrics.items():
        half, value = own.get("uncertainty"), own.get("extrapolated")
        value = (own.get("values") or [None])[-1] if value is None else value
        unit = "" if is_error(name) or units.get(name, "1") == "1" else f" {units[name]}"
        digits = 4
        if isinstance(half, float) and isinstance(value, float):
            digits = digits_beside(value, half, 8)
        rows.append([
            metric_title(name),
            "–" if is_error(name) else f"{number(value, digits)}{unit}",
            "–" if half is None else f"{number(half, 2)}{unit}" if half else "none",
            number(own.get("disagreement"), 2),
            scientific(str(own.get("reason") or "–")),
        ])  # fmt: skip
    head = ["", "value", "uncertainty", "second estimate, off by uncertainties", "by"]
    return Table("Reference: what it knows", head, rows, "prose")


def _judged_table(errors: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return the errors that a reference judges, those first of which it knows least."""
    rows = []
    for name, own in errors.items():
        metric, _, whose = name.partition(" of ")
        if own.get("ratio") is not None:
            cells = (number(own.get(key), 2) for key in ("error", "uncertainty", "ratio"))
            rows.append([f"{solver_title(whose)}: {metric_title(metric)}", *cells])
    head = ["error judged", "size", "uncertainty", "ratio"]
    return Table("Reference: its uncertainty over the errors that it judges", head, rows)


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
        return Cell(f"{error_text(metric.value, metric.uncertainty)}{unit}")
    value = number(metric.value, digits_beside(metric.value, metric.uncertainty, 8))
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
