"""The page of an iterations study: how many iterations suffice, and whether substeps pay."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from verify.report.notation import Drawing, Lead, number
from verify.report.plots import Palette, Series, loglog

Settings = Sequence[Mapping[str, Any]]

_NEARER = 0.8  # of the other error: less than a fifth apart is no difference that one would pay for


def iterations_lead(record: Mapping[str, Any]) -> Lead:
    """Return what the study answers, its work counted in iterations in a step of a case."""
    settings = record["settings"]
    cases = list(dict.fromkeys(one["case"] for one in settings))
    return Lead(
        f"How many iterations does {record['solver']} need on a cut body, and do substeps help?",
        [_said_of_iterations(record, cases), _said_of_substeps(settings, cases)],
        iterations_panels(settings, "whole_error"),
        "Distance from the smallest steps, solved, over the largest displacement (RMS over nodes), "
        "against iterations in a step of the case: those of all its substeps.",
    )


def iterations_panels(settings: Settings, error: str) -> list[Drawing | None]:
    """Return a panel per case: an error over the work, a line for each number of substeps."""
    palette, panels = Palette(), []
    for case, own in _by_case(settings):
        places: dict[int, list[tuple[Any, Any]]] = {}
        for one in own:
            if one["iterations"]:
                place = one["iterations"] * one["substeps"], one[error]
                places.setdefault(one["substeps"], []).append(place)
        series = [
            Series(f"{count} substep{'s' if count > 1 else ''}", curve)
            for count, curve in places.items()
        ]
        title = f"{case}: {error.replace('_', ' ')}, relative"
        panels.append(loglog(title, "iterations in a step of the case", series, palette))
    return panels


def _by_case(settings: Settings) -> Iterator[tuple[str, Settings]]:
    for case in dict.fromkeys(one["case"] for one in settings):
        yield case, [one for one in settings if one["case"] == case]


def _said_of_iterations(record: Mapping[str, Any], cases: Sequence[str]) -> str:
    """Say the least work with which the same steps are met, for each case."""
    tolerance, met, missed = record["tolerance"], [], []
    for case, own in _by_case(record["settings"]):
        tried = [(one["iterations"] * one["substeps"], one) for one in own if one["iterations"]]
        good = [
            (work, one["iterations"], one["substeps"])
            for work, one in tried
            if one["iteration_error"] is not None and one["iteration_error"] <= tolerance
        ]
        if good:
            work, count, parts = min(good)
            each = f", {count} in each of {parts} substeps" if parts > 1 else ""
            met.append(f"{work} ({case}{each})")
        elif tried:
            missed.append(f"{max(work for work, _ in tried)} are not enough on {case}")
    within = f"within {100 * tolerance:.2g} % of its own steps, solved"
    if not met:
        return f"Not {within}, on any of {len(cases)} cut cases: {'; '.join(missed)}."
    said = f"To be {within}, it takes so many iterations in a step: {', '.join(met)}"
    return f"{said}; {'; '.join(missed)}." if missed else f"{said}."


def _said_of_substeps(settings: Settings, cases: Sequence[str]) -> str:
    """Compare the fewest and the most substeps at the largest work that both had."""
    better: list[str] = []
    worse: list[str] = []
    level: list[str] = []
    for case, own in _by_case(settings):
        errors = {
            (one["substeps"], one["iterations"] * one["substeps"]): one["whole_error"]
            for one in own
            if one["iterations"] and one["whole_error"] is not None
        }
        few, many = min((s for s, _ in errors), default=1), max((s for s, _ in errors), default=1)
        common = {w for s, w in errors if s == few} & {w for s, w in errors if s == many}
        if few == many or not common:
            continue
        work = max(common)
        one, other = errors[few, work], errors[many, work]
        text = (
            f"{case}, {work} iterations: {number(other, 2)} with {many} substeps, "
            f"{number(one, 2)} with {few}"
        )
        chosen = better if other < _NEARER * one else worse if one < _NEARER * other else level
        chosen.append(text)
    compared = len(better) + len(worse) + len(level)
    if not compared:
        return "No two settings have the same work with different substeps: nothing is compared."
    shown = "; ".join([*better, *worse, *level])
    if len(better) == compared:
        said = f"Substeps pay at equal work, on all {compared} cases"
    elif not better:
        said = f"Substeps do not pay at equal work on any of {compared} cases"
    else:
        said = f"Substeps pay at equal work on {len(better)} of {compared} cases"
    return f"{said}. Error of the whole: {shown}."
