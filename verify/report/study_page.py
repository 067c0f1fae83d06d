"""The page of a study: findings as sentences, then tables and curves, then where it comes from."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.files import read_json, write_whole
from verify.printable import shown
from verify.report.iterations_page import iterations_lead, iterations_panels
from verify.report.notation import (
    NORMS,
    Cell,
    Drawing,
    Table,
    metric_title,
    number,
    solver_title,
)
from verify.report.page import origin_facts
from verify.report.plots import (
    Bar,
    Palette,
    Series,
    Strip,
    bars,
    loglog,
    profile_panel,
    scatter,
    strips,
)
from verify.report.rendering import as_html, as_markdown, print_page
from verify.report.sliver_page import listed, sliver_families, sliver_lead
from verify.report.thesis_page import thesis_view

_STUDIES = ("slivers", "energy", "cost", "budget", "thesis", "calibration", "iterations",
            "positions", "claims")  # fmt: skip
_SCHEMA = 1
_ALL = "all"  # scenes, of a study of positions


def studies_in(directory: Path) -> list[str]:
    """Return the kinds of the studies whose records lie in `directory`."""
    return [kind for kind in _STUDIES if (directory / f"{kind}.json").is_file()]


def render_study(directory: Path, kind: str, form: str = "html") -> Path:
    """Write ``<kind>.html`` from ``<kind>.json``, or what `form` asks for: markdown or pdf.

    Raises
    ------
    InputError
        If the record is not there, is no record of this kind, or has another schema version;
        if PDF is wanted and no browser prints.
    OSError
        If the page cannot be written.
    """
    source = directory / f"{kind}.json"
    if not source.exists():
        raise InputError(f"no {kind}.json: the {kind} study has not run", str(directory))
    record = read_json(source)
    expected = {"schema": _SCHEMA, "kind": f"{kind} study"}
    for key, value in expected.items():
        if (found := record.get(key)) != value:
            raise InputError(f"{key} is {shown(found)}; expected {value!r}", str(source))
    view = {
        "kind": kind,
        "record": record,
        "counts": Counter(finding["verdict"] or "SHOWN" for finding in record["findings"]),
        "origin": origin_facts(record),
        "answer": record.get("answer", []),
        **study_view(kind, record),
    }
    template = "claims.j2" if kind == "claims" else "study.j2"
    if form == "markdown":
        target = directory / f"{kind}.md"
        write_whole(target, as_markdown(template, directory, f"{kind}-pictures", **view))
        return target
    page = directory / f"{kind}.html"
    write_whole(page, as_html(template, **view))
    return print_page(page) if form == "pdf" else page


def study_view(kind: str, record: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the template of a study shows beside its record."""
    views: dict[str, Callable[[], dict[str, Any]]] = {
        "slivers": lambda: {
            "lead": sliver_lead(record),
            "families": sliver_families(record),
        },
        "energy": lambda: {},
        "claims": lambda: {},
        "cost": lambda: {"running": _running(record), "precision": _precision(record)},
        "budget": lambda: {"bars": [_bars(budget) for budget in record["budgets"]]},
        "calibration": lambda: {"scatters": _scatters(record["trials"])},
        "thesis": lambda: thesis_view(record),
        "iterations": lambda: {
            "lead": iterations_lead(record),
            "panels": iterations_panels(record["settings"], "iteration_error"),
        },
        "positions": lambda: _positions(record),
    }
    return {"lead": None, **views[kind]()}


def _positions(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return the ratios to one solver as strips, and tables of them, over all scenes and each."""
    measure, palette = record["measure"], Palette()
    panels, tables = [], []
    for metric in dict.fromkeys(pair["metric"] for pair in record["pairs"]):
        own = listed(record["pairs"], metric=metric, rival=measure)
        strip = []
        for pair in listed(own, scene=_ALL):
            (found,) = listed(record["ratios"], metric=metric, solver=pair["solver"])
            ends = pair["ratio"], pair["low"], pair["high"]
            strip.append(Strip(solver_title(pair["solver"]), found["ratios"], *ends))
        title = f"{metric_title(metric)}, over that of {solver_title(measure)}"
        panels.append(strips(title, strip, palette) if strip else None)
        places = [_ALL, *record["scenes"]]
        rows = []
        for solver in dict.fromkeys(pair["solver"] for pair in own):
            known = {pair["scene"]: pair for pair in listed(own, solver=solver)}
            cells = [_ratio(known[place]) if place in known else "–" for place in places]
            rows.append([solver_title(solver), *cells])
        heads = [
            "solver",
            *(f"{p}, level {record['scenes'][p]}" if p != _ALL else p for p in places),
        ]
        said = "median (90 % of the ratios); bold where that range excludes 1"
        tables.append(Table(f"{title}: {said}", heads, rows, "", True))
    return {"panels": panels, "tables": tables}


def _ratio(pair: Mapping[str, Any]) -> Cell:
    text = f"{pair['ratio']:.3g} ({pair['low']:.3g} to {pair['high']:.3g})"
    return Cell(text, strong=pair["differs"])


def _running(record: Mapping[str, Any]) -> list[Drawing]:
    steps = [0.0, *(float(step["step"]) for step in record["steps"])]
    curves = [
        (solver_title(name), [0.0, *(float("nan") if at is None else at[0] for at in sums)])
        for name, sums in record["running"].items()
    ]
    return [profile_panel("time so far, s", steps, curves, Palette(), x_title="step of the cut")]


def _precision(record: Mapping[str, Any]) -> list[Drawing | None]:
    """Return the error over time and over unknowns; what no other solve beats is ringed."""
    points = [p for p in record["points"] if p["error"] > 0 and p["seconds"] > 0]
    front = {(solver, level) for solver, level in record["front"]}
    palette, panels = Palette(), []
    for x_title, key in (("wall time (s), median", "seconds"), ("unknowns", "unknowns")):
        series = []
        for name in record["running"]:
            own = sorted((p for p in points if p["solver"] == name), key=lambda p: p["level"])
            places = [(p[key], p["error"]) for p in own]
            ringed = [(p[key], p["error"]) for p in own if (name, p["level"]) in front and p[key]]
            series.append(Series(solver_title(name), places, ringed=ringed))
        panels.append(loglog(metric_title(record["metric"]), x_title, series, palette))
    return panels


def _bars(budget: Mapping[str, Any]) -> Drawing:
    """Return a bar for each source of an error, and one for the whole."""
    parts = [
        Bar(part["source"], part["value"], part["uncertainty"],
            "round-off" if part.get("round_off") else f"{number(100 * part['value'], 3)} %",
            total=part is budget["total"])
        for part in [*budget["parts"], budget["total"]]
    ]  # fmt: skip
    title = metric_title(budget["metric"])
    title = title if title.startswith("relative") else f"{title}, relative"
    said = "; ".join(f"{bar.name} {bar.value:.3g} ± {bar.half:.2g}" for bar in parts)
    return bars(title, parts, f"{title}: {said}.")


def _scatters(trials: Sequence[Mapping[str, Any]]) -> list[tuple[int, Drawing | None]]:
    """Return the stated uncertainty over the true error for each degree; norms are filled."""
    counted = [t for t in trials if not t["left_out"]]
    palette, found = Palette(), []
    for name in dict.fromkeys(t["family"] for t in trials):
        palette[name]  # the same style in every panel
    for degree in sorted({t["degree"] for t in counted}):
        own = [t for t in counted if t["degree"] == degree]
        shown = [t for t in own if t["stated"] > 0.0 and t["true"] > 0.0]
        marks = [(t["family"], t["true"], t["stated"], t["quantity"] in NORMS) for t in shown]
        missed = sum(not t["covered"] for t in shown)
        title = f"{f'P{degree}' if degree else 'series'}: stated uncertainty, relative"
        said = f"{title}, over the true error: {len(shown)} marks, {missed} not covered."
        found.append((degree, scatter(title, "true error, relative", marks, (1.0, 10.0), palette,
                                      said) if shown else None))  # fmt: skip
    return found
