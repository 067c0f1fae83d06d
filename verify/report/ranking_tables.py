"""The rankings of a run: tables, profiles, and what was left out."""

from collections.abc import Mapping, Sequence
from typing import Any

from verify.report.blocks import Cell, Figure, Table
from verify.report.figures.style import Palette, drawing, legend, log_axis, log_range, panel
from verify.report.notation import metric_title, solver_title, with_interval


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
        ends = log_range(every)
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
