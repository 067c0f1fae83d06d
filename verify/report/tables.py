"""The tables of a case: orders, numbers, times, reference, regularisations, failures."""

from collections.abc import Sequence
from statistics import median
from typing import Any

from verify.report.curves import duration, metric_names
from verify.report.figures_reference import accuracy_figure
from verify.report.markup import Markup, joined, tag
from verify.report.notation import (
    bytes_text,
    error_title,
    gap,
    metric_title,
    number,
    seconds_text,
    solver_title,
)
from verify.report.notices import unavailable_rows
from verify.result import CaseResult, Metric, SolveRecord, Status

__all__ = [
    "failures_table",
    "numbers_table",
    "orders_table",
    "reference_record",
    "regularisations_table",
    "table",
    "times_table",
]


def table(
    head: Sequence[Any],
    rows: Sequence[Sequence[Any]],
    caption: str,
    more: Sequence[Markup] = (),
    **marks: str,
) -> Markup:
    """Return a table that scrolls sideways where the page is too narrow for it.

    `more` are rows that are elements already, for the end of the table.
    """
    cells = [tag("tr", [tag("td", cell) for cell in row]) for row in rows]
    whole = tag(
        "table",
        tag("caption", caption),
        tag("thead", tag("tr", [tag("th", title, scope="col") for title in head])),
        tag("tbody", cells, more),
    )
    class_ = f"scroll {marks.get('class_', '')}".strip()
    return tag("div", whole, class_=class_, tabindex="0", role="region", aria_label=caption)


def numbers_table(result: CaseResult) -> Markup | None:
    """Return every measured number of every solve with its uncertainty."""
    names = metric_names(result)
    if not result.solves:
        return None
    titles = [joined(metric_title(name), _common_reference(result, name)) for name in names]
    head = ["solver", "level", "h (m)", "unknowns", *titles]
    rows = [
        [
            solver_title(solve.solver),
            solve.level,
            number(solve.size),
            number(solve.unknowns),
            *(_measured(solve, name, result) for name in names),
        ]
        for solve in _ordered(result)
    ]
    more = unavailable_rows(result, len(head))
    return table(head, rows, "Numbers: value ± uncertainty", more)


def times_table(result: CaseResult) -> Markup | None:
    """Return the wall time of every phase: median, and smallest to largest repetition."""
    phases = list(dict.fromkeys(name for solve in result.solves for name in solve.timings))
    if not phases:
        return None
    iterative = any(solve.iterations for solve in result.solves)
    head = ["solver", "level", *phases, "total without meshing", "process", "memory"]
    head += ["iterations"] if iterative else []
    rows = []
    for solve in _ordered(result):
        if not solve.timings:
            continue
        whole = duration(solve)
        iterations = ", ".join(f"{name} {count}" for name, count in solve.iterations.items())
        rows.append(
            [
                solver_title(solve.solver),
                solve.level,
                *(_spread(solve.timings.get(phase, [])) for phase in phases),
                seconds_text(whole.median) if whole else "–",
                seconds_text(solve.wall),
                bytes_text(solve.peak_memory),
                *([iterations or "–"] if iterative else []),
            ]
        )
    caption = "Wall times: median (smallest to largest repetition)"
    return table(head, rows, caption)


def orders_table(result: CaseResult) -> Markup | None:
    """Return the observed orders, or why there is none."""
    if not result.rates:
        return None
    rows = [
        [
            solver_title(rate.solver),
            error_title(rate.metric),
            f"{rate.order:.3f} ± {rate.uncertainty:.3f}" if rate.order is not None else "–",
            ", ".join(f"{slope:.2f}" for slope in rate.pairwise) or "–",
            rate.reason or "–",
        ]
        for rate in result.rates
    ]
    head = ["solver", "error", "order", "between successive levels", "reservation"]
    return table(head, rows, "Observed orders of convergence")


def regularisations_table(result: CaseResult) -> Markup | None:
    """Return all that the solvers dropped, snapped, clamped, scaled or floored."""
    groups: dict[tuple[str, str], list[tuple[int, dict[str, Any]]]] = {}
    for solve in _ordered(result):
        for entry in solve.regularisations:
            key = (solve.solver, str(entry.get("kind", "–")))
            groups.setdefault(key, []).append((solve.level, entry))
    if not groups:
        return None
    rows = []
    for (solver, kind), found in groups.items():
        sizes = [e["size"] for _, e in found if isinstance(e.get("size"), int | float)]
        unit = found[0][1].get("unit", "")
        counts = _separated([joined(number(e.get("count")), f" (level {n})") for n, e in found])
        largest = joined(number(float(max(sizes)), 2), " ", unit) if sizes else "–"
        rows.append([solver_title(solver), kind, joined(*counts), largest])
    head = ["solver", "what was done", "how often", "largest contribution"]
    return table(head, rows, "Regularisations", class_="prose")


def failures_table(solves: Sequence[SolveRecord]) -> Markup | None:
    """Return the solves that did not end well, with their reasons."""
    rows = [
        [
            solver_title(solve.solver),
            solve.level,
            str(solve.status),
            solve.reason or "no reason given",
            seconds_text(solve.wall),
        ]
        for solve in solves
        if solve.status is not Status.SOLVED
    ]
    if not rows:
        return None
    head = ["solver", "level", "ended", "reason", "after"]
    return table(head, rows, "Solves that did not end well", class_="prose")


def reference_record(reference: dict[str, Any]) -> Markup | None:
    """Return what the case was judged against, whatever the record holds."""
    if not reference:
        return None
    said = {key: value for key, value in reference.items() if value not in ([], {}, None, "")}
    plain = {key: value for key, value in said.items() if not isinstance(value, dict)}
    nested = {key: value for key, value in said.items() if isinstance(value, dict)}
    parts: list[Markup] = []
    if plain:
        entries = [
            (tag("dt", _words(key)), tag("dd", _value(value))) for key, value in plain.items()
        ]
        parts.append(tag("dl", [joined(*entry) for entry in entries], class_="record"))
    for key, value in nested.items():
        if key == "time_to_accuracy":
            parts.append(joined(accuracy_figure(value), _levels_table(value)))
        else:
            parts.append(_nested(key, value))
    return joined(*parts)


def _levels_table(levels: dict[str, dict[str, Any]]) -> Markup:
    """Return what each level of a reference cost and bounds of its errors, levels side by side."""
    costs = {"unknowns": number, "seconds": seconds_text}
    names = dict.fromkeys(name for entry in levels.values() for name in entry)
    rows = [
        [
            "wall time" if name == "seconds" else name,
            *(costs[name](entry.get(name)) for entry in levels.values()),
        ]
        for name in names
        if name in costs
    ]
    rows += [
        [error_title(name), *(number(entry.get(name), 2) for entry in levels.values())]
        for name in names
        if name not in costs
    ]
    caption = "Reference: time to accuracy; of errors, bounds that the finest level gives"
    return table(["", *(_words(level) for level in levels)], rows, caption)


def _nested(key: str, record: dict[str, Any]) -> Markup:
    """Return a table with one row per entry, if the entries are records; else name and value."""
    caption = f"Reference: {_words(key)}"
    if all(isinstance(entry, dict) for entry in record.values()):
        columns = list(dict.fromkeys(name for entry in record.values() for name in entry))
        rows = [
            [metric_title(name), *(_value(entry.get(column)) for column in columns)]
            for name, entry in record.items()
        ]
        head = ["", *(_words(column) for column in columns)]
        return table(head, rows, caption, class_="prose")
    rows = [[_words(name), _value(value)] for name, value in record.items()]
    return table(["", "value"], rows, caption)


def _value(value: Any) -> Markup:
    if isinstance(value, bool):
        return joined("yes" if value else "no")
    if isinstance(value, list | tuple):
        return joined(*_separated([_value(entry) for entry in value])) if value else joined("–")
    if isinstance(value, dict):
        said = [joined(_words(name), " ", _value(entry)) for name, entry in value.items()]
        return joined(*_separated(said))
    if isinstance(value, float):
        return number(value, _digits(value))
    return number(value) if value is None or isinstance(value, int) else joined(str(value))


def _digits(value: float, most: int = 7) -> int:
    """Return how many significant digits `value` needs, up to `most`."""
    whole = float(f"{value:.{most}g}")
    return next((n for n in range(2, most) if float(f"{value:.{n}g}") == whole), most)


def _separated(parts: list[Markup]) -> list[Any]:
    return [piece for part in parts for piece in (", ", part)][1:]


def _words(key: str) -> str:
    return key.replace("_", " ")


def _ordered(result: CaseResult) -> list[SolveRecord]:
    """Return the solves with each solver's levels together, solvers as they first appear."""
    solvers = list(dict.fromkeys(solve.solver for solve in result.solves))
    return sorted(result.solves, key=lambda solve: (solvers.index(solve.solver), solve.level))


def _references(result: CaseResult, name: str) -> set[tuple[float, str]]:
    found = [metric for solve in result.solves if (metric := solve.metric(name)) is not None]
    return {(m.reference, m.unit) for m in found if m.reference is not None}


def _common_reference(result: CaseResult, name: str) -> Markup | None:
    """Return the reference value of a quantity, if all solves are held against the same one."""
    if len(references := _references(result, name)) != 1:
        return None
    ((value, unit),) = references
    words = ["reference ", number(value, 8), "" if unit == "1" else f" {unit}"]
    return tag("div", words, class_="quiet")


def _measured(solve: SolveRecord, name: str, result: CaseResult) -> Any:
    metric: Metric | None = solve.metric(name)
    if metric is None:
        return "–" if solve.status is Status.SOLVED else str(solve.status)
    value = number(metric.value, 5 if metric.reference is None else 8)
    unit = "" if metric.unit == "1" else f" {metric.unit}"
    plus = joined(gap(), "± ", number(metric.uncertainty, 2)) if metric.uncertainty > 0 else None
    own = None
    if metric.reference is not None and len(_references(result, name)) > 1:
        own = tag("div", "reference ", number(metric.reference, 8), unit, class_="quiet")
    return joined(value, plus, unit, own)


def _spread(values: Sequence[float]) -> Markup:
    if not values:
        return joined("–")
    middle, low, high = median(values), min(values), max(values)
    if len(values) == 1:
        return joined(seconds_text(middle), gap(), "(once)")
    between = f"({seconds_text(low, middle)}–{seconds_text(high, middle)})"
    return joined(seconds_text(middle), gap(), between)
