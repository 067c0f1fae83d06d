"""Families of scenes in the report: each error against the parameter, a curve per solver."""

import math
from collections.abc import Sequence

from verify.report.axes import Panel, log_range
from verify.report.curves import Curve, Point, error_curves, metric_names
from verify.report.marks import curve_names, drawn_curve, style_of
from verify.report.markup import Markup, tag
from verify.report.notation import error_title, number, number_text
from verify.report.run_directory import Run
from verify.result import CaseResult

__all__ = ["family_section"]


def family_section(run: Run) -> Markup | None:
    """Return the families of a run; None if it has none of more than one row."""
    families: dict[str, list[CaseResult]] = {}
    for result in run.results:
        if result.row is not None:
            families.setdefault(result.row["family"], []).append(result)
    shown = [_family(name, rows) for name, rows in families.items() if len(rows) > 1]
    if not shown:
        return None
    return tag("section", tag("h2", "Families of scenes"), shown, id="families")


def _family(name: str, results: list[CaseResult]) -> Markup:
    rows = sorted(results, key=lambda result: -_value(result))
    assert rows[0].row is not None
    parameter = rows[0].row["parameter"]
    metrics = list(dict.fromkeys(metric for row in rows for metric in metric_names(row)))
    parts: list[Markup | None] = []
    for metric in metrics:
        found = {_value(row): _finest(row, metric) for row in rows}
        solvers = list(dict.fromkeys(label for one in found.values() for label in one))
        if not solvers:
            continue
        curves = [_curve(label, found) for label in solvers]
        title = error_title(metric)
        parts.append(_table(title, parameter, solvers, found))
        parts.append(_figure(title, parameter, [curve for curve in curves if curve.points]))
    said = f"On the finest level of each row. The row {parameter} = 0 stands in the tables only."
    return tag("div", tag("h3", name), tag("p", said, class_="quiet"), parts)


def _value(result: CaseResult) -> float:
    assert result.row is not None
    return float(result.row["value"])


def _finest(result: CaseResult, metric: str) -> dict[str, tuple[str, Point]]:
    """Return solver and last point of each curve of a row by its label."""
    curves = error_curves(result, metric)
    return {curve.label: (curve.solver, curve.points[-1]) for curve in curves}


def _curve(label: str, found: dict[float, dict[str, tuple[str, Point]]]) -> Curve:
    """Return one solver over the parameter, which stands where the mesh size does elsewhere."""
    points, solver = [], label
    for value in sorted(found):
        if label in found[value] and value > 0.0:
            solver, point = found[value][label]
            if math.isfinite(point.value) and point.value > 0.0:
                points.append(Point(point.level, value, None, point.value, point.uncertainty, None))
    return Curve(label, solver, [points] if points else [], [], None)


def _table(
    title: str,
    parameter: str,
    solvers: Sequence[str],
    found: dict[float, dict[str, tuple[str, Point]]],
) -> Markup:
    head = [tag("th", f"{parameter} =", scope="col"), *(tag("th", s, scope="col") for s in solvers)]
    body = [
        tag(
            "tr",
            tag("th", f"{value:g}", scope="row"),
            [tag("td", number(one[s][1].value) if s in one else "–", class_="number")
             for s in solvers],
        )
        for value, one in found.items()
    ]  # fmt: skip
    table = tag("table", tag("caption", title), tag("thead", tag("tr", head)), tag("tbody", body))
    return tag("div", table, class_="scroll", tabindex="0", role="region", aria_label=title)


def _figure(title: str, parameter: str, curves: list[Curve]) -> Markup | None:
    every = [point for curve in curves for point in curve.points]
    sizes = [point.size for point in every if point.size]
    if len(set(sizes)) < 2:
        return None
    panel = Panel(log_range(sizes), log_range([p.value for p in every]), parameter, title)
    styles = style_of(curves)
    lines = [drawn_curve(panel, c, styles[c.label], lambda point: point.size) for c in curves]
    names = [(c.points[-1].value, c.label, "", styles[c.label]) for c in curves]
    said = "; ".join(
        f"{c.label}: {number_text(c.points[0].value)} at {parameter} = {c.points[0].size:g} to "
        f"{number_text(c.points[-1].value)} at {c.points[-1].size:g}"
        for c in curves
    )
    return tag("figure", panel.drawn(f"{title}. {said}", *lines, curve_names(panel, names)))
