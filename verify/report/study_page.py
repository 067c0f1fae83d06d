"""The page of a study: findings as sentences, then tables and curves, then where it comes from."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.files import read_json, write_whole
from verify.printable import shown
from verify.report.notation import (
    NORMS,
    Cell,
    Drawing,
    Table,
    error_title,
    is_error,
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

_STUDIES = ("slivers", "energy", "cost", "budget", "thesis", "calibration", "iterations",
            "positions")  # fmt: skip
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
    if form == "markdown":
        target = directory / f"{kind}.md"
        write_whole(target, as_markdown("study.j2", directory, f"{kind}-pictures", **view))
        return target
    page = directory / f"{kind}.html"
    write_whole(page, as_html("study.j2", **view))
    return print_page(page) if form == "pdf" else page


def study_view(kind: str, record: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the template of a study shows beside its record."""
    views: dict[str, Callable[[], dict[str, Any]]] = {
        "slivers": lambda: {"families": sliver_families(record)},
        "energy": lambda: {},
        "cost": lambda: {"running": _running(record), "precision": _precision(record)},
        "budget": lambda: {"bars": [_bars(budget) for budget in record["budgets"]]},
        "calibration": lambda: {"scatters": _scatters(record["trials"])},
        "thesis": lambda: _thesis(record),
        "iterations": lambda: {"panels": _iterations(record["settings"])},
        "positions": lambda: _positions(record),
    }
    return views[kind]()


def _iterations(settings: Sequence[Mapping[str, Any]]) -> list[Drawing | None]:
    """Return both errors over the time."""
    palette, panels = Palette(), []
    for key, title in (
        ("iteration_error", "error of the iterations"),
        ("whole_error", "error of the whole"),
    ):
        shown = [one for one in settings if one["iterations"] and one["seconds"] and one[key]]
        series = _series(shown, "substeps", "seconds", key, "{} per step".format)
        panels.append(loglog(title, "seconds", series, palette))
    return panels


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


def _series(
    records: Sequence[Mapping[str, Any]], by: str, x: str, y: str,
    named: Callable[[Any], str] = solver_title,
) -> list[Series]:  # fmt: skip
    """Return a curve for each value of the key `by`, of the keys `x` and `y`."""
    places: dict[Any, list[tuple[Any, Any]]] = {}
    for one in records:
        places.setdefault(one[by], []).append((one[x], one[y]))
    return [Series(named(value), own) for value, own in places.items()]


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


def _thesis(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures of the thesis with ours beside them."""
    face, steps, delays = record["face"], record["steps"], record["delays"]
    cuts = [0.0, *(float(row["asked"]) for row in face)]
    added = {
        "thesis, XFEM": ("thesis", "xfem"),
        "thesis, S + S": ("thesis", "snapping_subdivision"),
        "XFEM": ("added", "xfem"),
        "S + S, 0.02": ("added", "snapping_subdivision 0.02"),
        "S + S, 0.2": ("added", "snapping_subdivision 0.2"),
    }
    nodes = [
        (name, [0.0, *(row[part][method] for row in face)])
        for name, (part, method) in added.items()
    ]
    asked = [float(cut) for cut in dict.fromkeys(row["asked_cuts"] for row in steps)]
    sizes = [float(size) for size in dict.fromkeys(row["tetrahedra"] for row in delays)]

    def grouped(rows: Any, by: str, key: str, factor: float = 1.0) -> list[Any]:
        return [
            (f"{name} tets" if isinstance(name, int) else name,
             [factor * row[key] for row in rows if row[by] == name])
            for name in dict.fromkeys(row[by] for row in rows)
        ]  # fmt: skip

    def over_cuts(title: str, key: str, factor: float = 1.0) -> Drawing:
        curves = grouped(steps, "asked_tetrahedra", key, factor)
        return profile_panel(title, asked, curves, x_title="cuts")

    def over_sizes(title: str, key: str) -> Drawing:
        return profile_panel(title, sizes, grouped(delays, "speed_name", key), x_title="tetrahedra")

    return {
        "unknowns": [profile_panel("nodes added", cuts, nodes, x_title="cut elements")],
        "times": [
            over_cuts("thesis: s per simulated s", "thesis_per_second"),
            over_cuts("here: ms per simulated s", "per_second", 1e3),
            over_cuts("here: nodes", "nodes"),
            over_cuts("thesis: nodes", "thesis_nodes"),
        ],
        "delays": [
            over_sizes("thesis: delay, s", "thesis"),
            over_sizes("size over speed: delay, s", "delay"),
        ],
        "slivers": _thesis_slivers(record["slivers"]),
    }


def _thesis_slivers(slivers: Sequence[Mapping[str, Any]]) -> list[Drawing | None]:
    palette, panels = Palette(), []
    for dimension in dict.fromkeys(row["dimension"] for row in slivers):
        own = listed(slivers, dimension=dimension)
        title = f"critical step over uncut, {dimension}D"
        x_title = "distance of cut and nodes, element sizes"
        panels.append(loglog(title, x_title, _series(own, "method", "size", "ratio"), palette))
    return panels


Records = Sequence[Mapping[str, Any]]

_GRADES = {"good": "●", "fair": "◐", "poor": "○", "bad": "✕"}
_NOTHING = Cell("–", grade="none")
_STEP, _UNCUT = "critical explicit step", "critical explicit step, uncut"
_SCALED = "condition number scaled by the diagonal"
_FREQUENCY, _MEASURE = "lowest natural frequency", "conforming"
_ERRORS = ("displacement_l2", "energy_norm")
_DRAWN = ("condition number", _SCALED, _STEP)
_LEAST = (0.9, 0.5, 0.1)  # of the step: good, fair, poor
_MOST = (1e3, 1e4, 1e6)  # of the condition number


def sliver_families(record: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return name, maps and curves of each family of scenes."""
    palette = Palette()
    families = []
    for family in dict.fromkeys(m["family"] for m in record["measurements"]):
        measured = listed(record["measurements"], family=family)
        growths = listed(record["growths"], family=family)
        curves = _curves(measured, growths, palette)
        maps = [*_worst(measured), *_maps(measured)]
        families.append({"name": family, "maps": maps, "curves": curves})
    return families


def graded(
    value: float | None, limits: Sequence[float], reason: str = "", most: bool = False
) -> Cell:
    """Grade a value by the first limit that it reaches (with `most`: does not exceed).

    It is written with so many digits that it is not rounded to a grade that it misses.
    """
    if value is None:
        return Cell("–", tip=reason, grade="none")

    def grade(found: float) -> str:
        reached = [found <= limit if most else found >= limit for limit in limits]
        return list(_GRADES)[(*reached, True).index(True)]

    own = grade(value)
    enough = (n for n in range(2, 9) if grade(float(f"{value:.{n - 1}e}")) == own)
    written = number(value, next(enough, 9))
    return Cell(f"{_GRADES[own]} {written}", tip=reason, grade=own)


def listed(records: Records, **fixed: Any) -> list[Mapping[str, Any]]:
    """Return the records in which all of these keys have these values."""
    return [r for r in records if all(r.get(key) == value for key, value in fixed.items())]


def _maps(measured: Records) -> list[tuple[Table, str]]:
    """Return the maps of one family with their legends."""
    steps = []
    for record in listed(measured, quantity=_STEP):
        uncut = listed(measured, quantity=_UNCUT, solver=record["solver"])
        whole = next((one["value"] for one in uncut if one["value"]), None)
        share = record["value"] / whole if record["value"] and whole else None
        reason = record["reason"] or ("" if share else "no step of the uncut body to compare with")
        steps.append((record, graded(share, _LEAST, reason)))
    conditions = [
        (one, graded(one["value"], _MOST, one["reason"], most=True))
        for one in listed(measured, quantity=_SCALED)
    ]
    maps = []
    for title, found, words, limits in (
        ("Critical explicit step over that of the uncut body", steps, "at least", _LEAST),
        ("Condition number, scaled by the diagonal", conditions, "at most", _MOST),
    ):
        if found:
            ends = [f"{words} {number(limit, 1)}" for limit in limits]
            last = "less" if limits is _LEAST else "more"
            legend = zip(_GRADES.values(), [*ends, last], strict=True)
            maps.append((_map(title, found), "; ".join(f"{sign} {end}" for sign, end in legend)))
    return maps


def _worst(measured: Records) -> list[tuple[Table, str]]:
    """Return the table of the worst value of each solver over ε, beside the conforming mesh."""

    def values(solver: str, quantity: str) -> dict[float, float]:
        own = listed(measured, solver=solver, quantity=quantity)
        return {m["size"]: m["value"] for m in own if m["value"] is not None}

    def ratios(solver: str, quantity: str, others: Mapping[float, float]) -> list[float]:
        own = values(solver, quantity)
        return [own[e] / others[e] for e in own if others.get(e)]

    rows = []
    solvers = list(dict.fromkeys(m["solver"] for m in measured))
    for solver in solvers if _MEASURE in solvers else ():
        whole = values(solver, _UNCUT)
        steps = [s / whole[e] for e, s in values(solver, _STEP).items() if whole.get(e)]
        errors = [ratios(solver, name, values(_MEASURE, name)) for name in _ERRORS]
        pitch = ratios(solver, _FREQUENCY, values(_MEASURE, _FREQUENCY))
        scaled = list(values(solver, _SCALED).values())
        off = max((ratio - 1.0 for ratio in pitch), key=abs, default=None)
        rows.append([
            solver_title(solver),
            _written(min(steps, default=None)),
            *(_written(max(one, default=None)) for one in errors),
            Cell("–") if off is None else Cell(f"{off:+.2%}"),
            _written(max(scaled, default=None)),
        ])  # fmt: skip
    heads = ["method", "least step over the uncut body's", "largest L² error over conforming",
             "largest energy-norm error over conforming", "lowest frequency off conforming",
             "largest scaled condition number"]  # fmt: skip
    legend = "errors are of the static field; a mass leaves them as they are and moves frequencies"
    return [(Table("Worst over ε", heads, rows, named=True), legend)] if rows else []


def _written(value: float | None) -> Cell:
    return _NOTHING if value is None else Cell(number(value, 3))


def _map(title: str, found: Sequence[tuple[Mapping[str, Any], Cell]]) -> Table:
    """Return a row per method and a column per size; the tint repeats the sign in each cell."""
    sizes = sorted({record["size"] for record, _ in found}, reverse=True)
    rows = []
    for solver in dict.fromkeys(record["solver"] for record, _ in found):
        own = {r["size"]: cell for r, cell in found if r["solver"] == solver}
        rows.append([solver_title(solver), *(own.get(size, _NOTHING) for size in sizes)])
    return Table(title, ["ε =", *(f"{size:g}" for size in sizes)], rows, "map", named=True)


def _curves(measured: Records, growths: Records, palette: Palette) -> list[Drawing | None]:
    names = dict.fromkeys(m["quantity"] for m in measured)
    shown = [n for n in names if is_error(n) or n.startswith(("relative", "deviation"))]
    panels = []
    for quantity in [*shown, *(n for n in _DRAWN if n in names)]:
        series = []
        for solver in dict.fromkeys(m["solver"] for m in measured):
            own = listed(measured, solver=solver, quantity=quantity)
            places = sorted(((m["size"], m["value"]) for m in own), key=lambda place: place[0])
            law = next(iter(listed(growths, solver=solver, quantity=quantity)), {})
            series.append(Series(solver_title(solver), places, _law_text(law)))
        title = error_title(quantity) if is_error(quantity) else quantity
        title += ", s" if quantity == _STEP else ""
        panels.append(loglog(title, "ε, in elements", series, palette))
    return panels


def _law_text(law: Mapping[str, Any]) -> str:
    if law.get("exponent") is None:
        return ""
    return f"∝ ε^{law['exponent'] + 0.0:.2f}".replace("-", "−").replace("−0.00", "0.00")
