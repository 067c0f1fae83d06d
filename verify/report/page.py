"""The report of a run as view data: the page and its Markdown are made of it by templates."""

from dataclasses import dataclass, field
from typing import Any

from verify.printable import words_of
from verify.report.blocks import Drawing
from verify.report.case_view import CaseView
from verify.report.curves import Point, error_curves, metric_names
from verify.report.figures.plots import Series, loglog
from verify.report.figures.style import Palette
from verify.report.notation import error_title
from verify.report.overview import origin_facts, overview
from verify.report.ranking_tables import compared, profiles_figure
from verify.report.run_directory import Run
from verify.result import CaseResult

_QUESTIONS = (("accuracy", "Accuracy"), ("energy", "Energy"), ("cost", "Cost"))


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


def page_view(
    run: Run, cases: list[CaseView], palette: Palette, notes: list[str], short: bool = False
) -> dict[str, Any]:
    """Return what ``report.j2`` shows.

    Parameters
    ----------
    run : Run
    cases : list of CaseView
        One for each of the run's entries.
    palette : Palette
        By which they are drawn.
    notes : list of str
        What has to be said about the pictures of all cases.
    short : bool
        Whether cases, families and the reading aid are left out.
    """
    families: list[FamilyView] = []
    ranking: dict[str, Any] | None = None
    try:
        families = family_views(run, palette)
    except Exception as error:
        notes = [*notes, f"the families of scenes cannot be shown: {words_of(error)}."]
    try:
        ranking = _ranking(run.ranking)
    except Exception as error:
        notes = [*notes, f"the ranking cannot be shown: {words_of(error)}."]
    started = run.record.get("started")
    return {
        "short": short,
        "when": f"Run of {started}" if started else "Run of unknown date",
        "command": run.record.get("command") or "",
        "top": overview(run, cases, palette),
        "cases": cases,
        "families": families,
        "ranking": ranking,
        "notes": notes,
        "origin": origin_facts(run.record),
    }


def _ranking(ranking: dict[str, Any] | None) -> dict[str, Any] | None:
    """Return the tables of the ranking; None for a run of one solver or from before rankings."""
    if not ranking or len(ranking.get("solvers", [])) < 2:
        return None
    tables = {question: compared(ranking, question, title) for question, title in _QUESTIONS}
    figure = profiles_figure(ranking.get("profiles") or [])
    return {**ranking, "figure": figure, "tables": tables}


def family_views(run: Run, palette: Palette) -> list[FamilyView]:
    """Return the families of a run that have more than one row."""
    families: dict[str, list[CaseResult]] = {}
    for result in run.results:
        if result.row is not None:
            families.setdefault(result.row["family"], []).append(result)
    return [_family(name, rows, palette) for name, rows in families.items() if len(rows) > 1]


def _family(name: str, results: list[CaseResult], palette: Palette) -> FamilyView:
    rows = sorted(results, key=lambda result: -_row_value(result))
    assert rows[0].row is not None
    view = FamilyView(name, rows[0].row["parameter"])
    for metric in dict.fromkeys(metric for row in rows for metric in metric_names(row)):
        found = {_row_value(row): _finest(row, metric) for row in rows}
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


def _row_value(result: CaseResult) -> float:
    assert result.row is not None
    return float(result.row["value"])


def _finest(result: CaseResult, metric: str) -> dict[str, Point]:
    """Return the last point of each curve of a row by its label."""
    return {curve.label: curve.points[-1] for curve in error_curves(result, metric)}
