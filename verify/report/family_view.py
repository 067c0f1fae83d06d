"""Families of scenes: each error against the parameter, a curve per solver."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from verify.report.blocks import Figure, Table, plain_table
from verify.report.curves import Curve, Point, error_curves, metric_names
from verify.report.figures.convergence import convergence_panel, error_range
from verify.report.figures.style import Palette
from verify.report.notation import error_title, number
from verify.report.run_directory import Run
from verify.result import CaseResult

__all__ = ["FamilyView", "family_views"]


@dataclass
class FamilyView:
    """A family of scenes with tables and figures, on the finest level of each row."""

    name: str
    parameter: str
    parts: list[tuple[Table, Figure | None]] = field(default_factory=list)


def family_views(run: Run, palette: Palette) -> list[FamilyView]:
    """Return the families of a run that have more than one row."""
    families: dict[str, list[CaseResult]] = {}
    for result in run.results:
        if result.row is not None:
            families.setdefault(result.row["family"], []).append(result)
    return [_family(name, rows, palette) for name, rows in families.items() if len(rows) > 1]


def _family(name: str, results: list[CaseResult], palette: Palette) -> FamilyView:
    rows = sorted(results, key=lambda result: -_value(result))
    assert rows[0].row is not None
    view = FamilyView(name, rows[0].row["parameter"])
    for metric in dict.fromkeys(metric for row in rows for metric in metric_names(row)):
        found = {_value(row): _finest(row, metric) for row in rows}
        solvers = list(dict.fromkeys(label for one in found.values() for label in one))
        if not solvers:
            continue
        curves = [c for label in solvers if (c := _curve(label, found)).points]
        title = error_title(metric)
        table = _table(title, view.parameter, solvers, found)
        view.parts.append((table, _figure(title, view.parameter, curves, palette)))
    return view


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
                points.append(Point(point.level, value, None, point.value, 0.0, None))
    return Curve(label, solver, [points] if points else [], [], None)


def _table(
    title: str, parameter: str, solvers: Sequence[str],
    found: dict[float, dict[str, tuple[str, Point]]],
) -> Table:  # fmt: skip
    rows = [
        [f"{value:g}", *(number(one[s][1].value) if s in one else "–" for s in solvers)]
        for value, one in found.items()
    ]
    return plain_table(title, [f"{parameter} =", *solvers], rows, named=True)


def _figure(title: str, parameter: str, curves: Sequence[Curve], palette: Palette) -> Figure | None:
    places = {point.size for curve in curves for point in curve.points}
    y_range = error_range(curves, sloped=False)
    if len(places) < 2 or y_range is None:
        return None
    panel = convergence_panel(title, curves, y_range, palette, x_title=parameter)
    return Figure([panel]) if panel else None
