"""The report of a run as view data: cases, families of scenes, and the rankings with profiles.

The page and its Markdown are made of it by templates.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from verify.printable import words_of
from verify.report.blocks import Cell, Drawing, Figure, Table
from verify.report.case_view import CaseView
from verify.report.curves import Point, error_curves, metric_names
from verify.report.notation import error_title, metric_title, solver_title, with_interval
from verify.report.overview import origin_facts, overview
from verify.report.plots import Palette, Series, drawing, legend, log_axis, log_range, loglog, panel
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


def compared(ranking: Mapping[str, Any], question: str, title: str) -> list[Table]:
    """Return the table of a question, a row per solver, and that of what was left out."""
    comparisons = _merged(ranking[question])
    shown = [one for one in comparisons if one["standings"]]
    tables = []
    if shown:
        first = [s["solver"] for s in shown[0]["standings"]]
        order = first + [solver for solver in ranking["solvers"] if solver not in first]
        rows = [[solver_title(s), *(_standing(one, s) for one in shown)] for s in order]
        head = ["solver", *(_column(one) for one in shown)]
        tables.append(Table(f"{title}: rank, number [interval]", head, rows))
    if rest := _grouped(comparisons):
        head = ["case", "solver", "metric", "not in the numbers because"]
        tables.append(Table(f"{title}: left out", head, rest, "prose"))
    return tables


def _merged(comparisons: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Show two views of a metric as one where they are the same numbers."""
    merged: list[dict[str, Any]] = []
    for one in comparisons:
        before = merged[-1] if merged else None
        same = before is not None and before["metric"] == one["metric"] and one["standings"]
        if same and before is not None and before["standings"] == one["standings"]:
            before["view"] = f"{before['view']}, {one['view']}"
            before["left_out"] = one["left_out"]
        else:
            merged.append(dict(one))
    return merged


def _column(one: Mapping[str, Any]) -> Cell:
    quantities = one["metric"] == "quantities"
    name = "quantities of interest" if quantities else metric_title(one["metric"])
    return Cell(name, one["view"])


def _standing(one: Mapping[str, Any], solver: str) -> Cell:
    own = next((s for s in one["standings"] if s["solver"] == solver), None)
    if own is None or own["value"] is None:
        return Cell("–")
    few = f"{own['count']} of {one['items']}" if own["count"] < one["items"] else ""
    note = few + (f" ({own['where']})" if own["where"] else "")
    value = with_interval(own["value"], own["low"], own["high"])
    return Cell(f"{rank(own)}: {value}", note)


def rank(own: Mapping[str, Any]) -> str:
    """Return the rank of a standing, with a sign if it is shared."""
    return "–" if own["rank"] is None else f"{own['rank']}{'=' if own['tied'] else ''}"


def _grouped(comparisons: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """List what was left out, a reason that holds for several metrics once."""
    rows: dict[tuple[str, str, str], list[str]] = {}
    for one in comparisons:
        for entry in one["left_out"]:
            key = (entry["case"], entry["solver"], entry["reason"])
            rows.setdefault(key, []).append(metric_title(one["metric"]))
    return [
        [case, solver_title(solver) if solver else "all", ", ".join(dict.fromkeys(metrics)), reason]
        for (case, solver, reason), metrics in rows.items()
    ]


def profiles_figure(profiles: Sequence[Mapping[str, Any]]) -> Figure | None:
    """Return a panel for each profile of a ranking; None if no item was compared."""
    palette, panels = Palette(), []
    for one in profiles:
        steps: Mapping[str, Sequence[float]] = one["steps"]
        most = one.get("most") or float("inf")
        every = [value for own in steps.values() for value in own if 0.0 < value <= most]
        if one["items"] < 2 or not every:
            continue
        low, high = log_range(every)
        ends = 1.0 if min(every) >= 1.0 else low, high  # of ratios to the best
        with panel(one["quantity"], 5.6, 3.0) as (figure, axes):
            for solver, own in steps.items():
                label, shares = (
                    solver_title(solver),
                    [k / one["items"] for k in range(len(own) + 1)],
                )
                style = palette[label]
                axes.step(
                    [ends[0], *own, ends[1]], [*shares, shares[-1]], where="post", label=label,
                    color=style.colour, linestyle=style.dashes,
                )  # fmt: skip
            log_axis(axes, "x", ends)
            axes.set_ylim(0.0, 1.03)
            axes.set_xlabel(one["quantity"].partition(",")[0])
            axes.set_ylabel(f"share of {one['items']} cases")
            legend(axes)
            said = "; ".join(f"{name}: {len(own)}" for name, own in steps.items())
            panels.append(
                drawing(figure, f"{one['quantity']}, cases done of {one['items']}. {said}")
            )
    if not panels:
        return None
    said = (
        "Profiles: the share of the cases in which a solver stays within the number on the axis. "
        "Refused, failed and uncompared cases are never reached."
    )
    return Figure(panels, said)
