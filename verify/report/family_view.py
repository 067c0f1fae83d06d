"""Families of scenes: each error against the parameter, a curve per solver."""

from dataclasses import dataclass, field

from verify.report.blocks import Drawing
from verify.report.curves import Point, error_curves, metric_names
from verify.report.figures.studies import Series, loglog
from verify.report.figures.style import Palette
from verify.report.notation import error_title
from verify.report.run_directory import Run
from verify.result import CaseResult


@dataclass(frozen=True)
class FamilyPart:
    """An error over the rows of a family: the finest point of each solver, by value and name."""

    title: str
    solvers: list[str]
    found: dict[float, dict[str, Point]]
    panel: Drawing | None


@dataclass
class FamilyView:
    """A family of scenes with a table and a figure for each error."""

    name: str
    parameter: str
    parts: list[FamilyPart] = field(default_factory=list)


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
        title, panel = error_title(metric), None
        if sum(x > 0 for x in found) > 1:
            series = [
                Series(label, [(x, one[label].value if label in one else None)
                               for x, one in sorted(found.items())])
                for label in solvers
            ]  # fmt: skip
            panel = loglog(title, view.parameter, series, palette)
        if solvers:
            view.parts.append(FamilyPart(title, solvers, found, panel))
    return view


def _value(result: CaseResult) -> float:
    assert result.row is not None
    return float(result.row["value"])


def _finest(result: CaseResult, metric: str) -> dict[str, Point]:
    """Return the last point of each curve of a row by its label."""
    return {curve.label: curve.points[-1] for curve in error_curves(result, metric)}
