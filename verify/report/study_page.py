"""The page of a study: findings as sentences, then tables and curves, then where it comes from."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from verify.errors import InputError
from verify.files import read_json, write_whole
from verify.printable import shown
from verify.report.iterations_page import iterations_lead, iterations_panels, substeps_panels
from verify.report.notation import (
    NORMS,
    ROUND_OFF,
    Cell,
    Drawing,
    Lead,
    Table,
    metric_title,
    number,
    scientific,
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
from verify.report.sliver_page import sliver_families, sliver_lead
from verify.report.sliver_values import listed

_ALL = "all"  # scenes together
_FEWEST = (6, 16)  # scenes and meshes of the protocol
_NORMS_IN_WORDS = {"displacement_l2": "displacement", "energy_norm": "energy norm"}


def positions_view(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return the answer, ratios to one solver as strips, and tables over all scenes and each."""
    measure, palette, short = record["measure"], Palette(), _short(record["scenes"])
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
            cells = [Cell(_ratio(known[place]), strong=known[place]["differs"])
                     if place in known else "–" for place in places]  # fmt: skip
            rows.append([solver_title(solver), *cells])
        heads = ["solver", *(short.get(place, place) for place in places)]
        tables.append(Table(title, heads, rows, "", True))
    tables += [_won(record), _errors(record, short)]
    levels = dict.fromkeys(record["scenes"].values())
    at = [
        f"level {level}: "
        + ", ".join(
            f"{short[name]} ({name})" for name, its in record["scenes"].items() if its == level
        )
        for level in levels
    ]
    scenes = f"Scenes, at {'; at '.join(at)}."
    return {"lead": positions_lead(record, panels), "scenes": scenes, "tables": tables}


def _won(record: Mapping[str, Any]) -> Table:
    """Return the table of meshes on which each solver errs less than the measure, and its worst."""
    measure, where = record["measure"], record["dimensions"]
    values = {
        (e["scene"], e["position"], e["solver"]): e["value"]
        for e in _displacements(record) if e["value"] > ROUND_OFF and e["low"] > 0.0
    }  # fmt: skip
    rows = []
    for solver in (name for name in record["solvers"] if name != measure):
        row: list[Cell | str] = [solver_title(solver)]
        for d in (2, 3):
            ratios = [
                values[place, number, solver] / values[place, number, measure]
                for place, number, name in values
                if name == solver and where[place] == d and (place, number, measure) in values
            ]
            better = sum(ratio < 1.0 for ratio in ratios)
            row += [f"{better} of {len(ratios)}", number(max(ratios), 3)] if ratios else ["–", "–"]
        rows.append(row)
    heads = ["solver", "plane: meshes with less error", "largest ratio",
             "space: meshes with less error", "largest ratio"]  # fmt: skip
    title = f"{metric_title('displacement_l2')}, mesh by mesh beside {solver_title(measure)}"
    return Table(title, heads, rows, "", True)


def _errors(record: Mapping[str, Any], short: Mapping[str, str]) -> Table:
    """Return the table of errors over the meshes of each scene: median, 95 %, largest."""
    rows = []
    for solver in record["solvers"]:
        row = [solver_title(solver)]
        for scene in record["scenes"]:
            own = [e["value"] for e in _displacements(record)
                   if (e["scene"], e["solver"]) == (scene, solver)]  # fmt: skip
            found = [*np.quantile(own, [0.5, 0.95, 1.0])] if own else []
            row.append(", ".join(number(float(value), 2) for value in found) or "–")
        rows.append(row)
    title = f"{metric_title('displacement_l2')}: median, 95 % and largest over meshes"
    return Table(title, ["solver", *(short[place] for place in record["scenes"])], rows, "", True)


def _displacements(record: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    return listed(record["errors"], metric="displacement_l2")


def _short(scenes: Iterable[str]) -> dict[str, str]:
    """Return a head for the column of each scene: C2 of the benchmark's, else without the folder.

    Where two would share it, all keep their names.
    """
    short = {name: re.sub(r"^benchmark/c(\d+)_.*", r"C\1", name).split("/")[-1] for name in scenes}
    return short if len({*short.values()}) == len(short) else {name: name for name in short}


def positions_lead(record: Mapping[str, Any], panels: Sequence[Drawing | None] = ()) -> Lead:
    """Return which solvers differ wherever the mesh lies: of all pairs, and beside the measure."""
    scenes, positions, measure = record["scenes"], record["positions"], record["measure"]
    over_all = listed(record["pairs"], scene=_ALL)
    counts = []
    for metric, words in _NORMS_IN_WORDS.items():  # each pair stands there both ways
        every = [p for p in listed(over_all, metric=metric) if p["solver"] < p["rival"]]
        differ = sum(pair["differs"] for pair in every)
        counts.append(f"{differ} of {len(every)} differ in the error of the {words}")
    count = f"{len(scenes)} scene{'s' * (len(scenes) != 1)}"
    first = f"Of all pairs of solvers, over {count} on {positions} meshes each, "
    first += f"{' and '.join(counts)}."
    if len(scenes) < _FEWEST[0] or positions < _FEWEST[1]:
        first += f" Nothing is claimed from fewer than {_FEWEST[0]} scenes on {_FEWEST[1]} meshes."
    own, said = listed(over_all, metric="displacement_l2", rival=measure), []
    for differ, words in ((True, "these differ"), (False, "these are not told apart")):
        names = [
            f"{solver_title(p['solver'])} {_ratio(p)}{'' if differ else _apart(record, p)}"
            for p in listed(own, differs=differ)
        ]
        if names:
            said.append(f"{words}: {', '.join(names)}")
    second = f"From {solver_title(measure)}, by the displacement (median ratio, range of 90 %), "
    second += "; ".join(said) or "no solver has a ratio"
    kinds = {name.split("/")[0] for name in scenes}
    where = f"{count} of {len(kinds)} kinds" if len(kinds) > 1 else f"scenes of {min(kinds)}"
    where = "the benchmark's scenes" if kinds == {"benchmark"} else where
    return Lead(
        f"Which solvers differ wherever the mesh lies, in {where}?", [first, f"{second}."], panels,
        f"A point is one scene on one mesh: error over error of {solver_title(measure)} on that "
        "mesh; left of 1 is better. Dot and line are the median and the range of 90 % of the "
        "points. Solvers differ where that range excludes 1.",
    )  # fmt: skip


def _apart(record: Mapping[str, Any], pair: Mapping[str, Any]) -> str:
    """Say in how many scenes a pair differs that does not over all of them."""
    keys = "metric", "solver", "rival"
    own = [p for p in listed(record["pairs"], **{key: pair[key] for key in keys})
           if p["scene"] != _ALL]  # fmt: skip
    differ = sum(one["differs"] for one in own)
    return f", apart in {differ} of {len(own)} scenes" if differ and len(own) > 1 else ""


def _ratio(pair: Mapping[str, Any]) -> str:
    """Write a ratio with its range; ends beside 1 are not written as 1 if the range excludes it."""

    def end(value: float) -> str:
        texts = [f"{value:.{digits}g}" for digits in range(3, 9 if pair["differs"] else 4)]
        return next((text for text in texts if text != "1"), texts[0])

    return f"{pair['ratio']:.3g} ({end(pair['low'])} to {end(pair['high'])})"


_SCHEMA = 1


def studies_in(directory: Path) -> list[str]:
    """Return the kinds of the studies whose records lie in `directory`."""
    return [kind for kind in _VIEWS if (directory / f"{kind}.json").is_file()]


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
        "lead": None,
        **_VIEWS[kind](record),
    }
    template = "claims.j2" if kind == "claims" else "study.j2"
    if form == "markdown":
        target = directory / f"{kind}.md"
        write_whole(target, as_markdown(template, directory, f"{kind}-pictures", **view))
        return target
    page = directory / f"{kind}.html"
    write_whole(page, as_html(template, **view))
    return print_page(page) if form == "pdf" else page


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


def thesis_view(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures of the thesis with ours beside them."""
    face, steps, delays = record["face"], record["steps"], record["delays"]
    cuts = [0.0, *(float(row["asked"]) for row in face)]
    added = {
        "thesis, XFEM": ("thesis", "xfem"), "thesis, S + S": ("thesis", "snapping_subdivision"),
        "XFEM": ("added", "xfem"), "S + S, 0.02": ("added", "snapping_subdivision 0.02"),
        "S + S, 0.2": ("added", "snapping_subdivision 0.2"),
    }  # fmt: skip
    nodes = [(name, [0.0, *(row[part][method] for row in face)])
             for name, (part, method) in added.items()]  # fmt: skip

    def over(
        rows: Any, x: str, x_title: str, by: str, title: str, key: str, factor: float = 1.0
    ) -> Drawing:
        curves = [
            (f"{name} tets" if isinstance(name, int) else name,
             [factor * row[key] for row in rows if row[by] == name])
            for name in dict.fromkeys(row[by] for row in rows)
        ]  # fmt: skip
        along = [float(place) for place in dict.fromkeys(row[x] for row in rows)]
        return profile_panel(title, along, curves, x_title=x_title)

    over_cuts = partial(over, steps, "asked_cuts", "cuts", "asked_tetrahedra")
    over_sizes = partial(over, delays, "tetrahedra", "tetrahedra", "speed_name")
    unknowns = [profile_panel("nodes added", cuts, nodes, x_title="cut elements")]
    caption = (
        "Nodes added as cuts grow. S + S: snapping and subdivision, with its threshold in edges."
    )
    question, said = "Which claims of the thesis hold?", _said(record["findings"])
    return {
        "lead": Lead(question, said, unknowns, caption),
        "times": [
            over_cuts("thesis: s per simulated s", "thesis_per_second"),
            over_cuts("here: ms per simulated s", "per_second", 1e3),
            over_cuts("here: nodes", "nodes"), over_cuts("thesis: nodes", "thesis_nodes"),
        ],
        "delays": [over_sizes("thesis: delay, s", "thesis"),
                   over_sizes("size over speed: delay, s", "delay")],
    }  # fmt: skip


def _said(findings: Sequence[Mapping[str, Any]]) -> list[str]:
    """Say whose claims hold and whose fail, each by what it demands and what was found.

    What was found is a finding's sentence up to its first semicolon.
    """
    said = []
    for whose in ("the thesis", "this project"):
        own = listed(findings, whose=whose)
        if not own:
            continue
        held = len(listed(own, verdict="PASS"))
        text = f"Of {len(own)} claims of {whose} {held} hold."
        for verdict, lead in (("FAIL", "Failed"), ("UNDECIDED", "Undecided")):
            rest = [
                f"{one['expected']} ({one['sentence'].partition(';')[0]})"
                for one in listed(own, verdict=verdict)
            ]
            text += f" {lead}: {'; '.join(rest)}." if rest else ""
        said.append(text)
    return said or ["No claim was judged."]


_IDENTIFIER = re.compile(r",? (10\.\d{4,}/\S+?|arXiv \S+?)(?=[;)\s]|$)")


def _claim(one: Mapping[str, Any]) -> dict[str, Any]:
    """Return a claim with its authors, and the numbers that decide.

    They are two that break limits, or whose intervals may, else the first. If the claim holds in
    part the first that keeps its limit follows, then the first that is shown without one.
    """
    bounds = [
        scientific(" and ".join(
            f"{words} {limit[key]:g}"
            for key, words in (("at_least", "at least"), ("at_most", "at most"))
            if limit[key] is not None
        ))
        for limit in one["claim"]["limits"]
    ]  # fmt: skip
    rows = list(zip(one["claim"]["limits"], one["numbers"], bounds, strict=True))
    states: dict[bool | None, list[str]] = {True: [], False: [], None: []}
    for limit, found, bound in rows:
        if bound:
            states[_kept(limit, found)].append(_told(limit, found, bound))
    kept, missed = states[True], states[False] + states[None]
    beside = [_told(*row) for row in rows if not row[2]][:1]
    decide = missed[:2] or kept[:1] or beside
    parts = [*decide]
    if len(missed) > 2:
        parts.append(f"{len(missed) - 2} more")
    if missed and kept:
        parts.append(f"kept: {kept[0]}")
    parts += [f"beside: {told}" for told in beside if told not in decide]
    authors = _IDENTIFIER.sub("", one["claim"]["who"])
    return {
        **one, "bounds": bounds, "authors": authors,
        "answer": "; ".join(decide), "decides": "; ".join(parts),
    }  # fmt: skip


def _told(limit: Mapping[str, Any], found: Mapping[str, Any], bound: str) -> str:
    value = number(found["value"], 3)
    if found["value"] is not None and found["low"] < found["high"]:
        value += f" [{number(found['low'], 3)}, {number(found['high'], 3)}]"
    return f"{limit['number']} = {value}" + (f" ({bound})" if bound else "")


def _kept(limit: Mapping[str, Any], found: Mapping[str, Any]) -> bool | None:
    """Say whether all of a number's interval keeps a limit (True) or breaks it (False)."""
    if found["value"] is None:
        return None
    least, most = (
        end if limit[key] is None else limit[key]
        for key, end in (("at_least", -float("inf")), ("at_most", float("inf")))
    )
    if least <= found["low"] and found["high"] <= most:
        return True
    return False if found["high"] < least or most < found["low"] else None


_VIEWS: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
    "slivers": lambda r: {"lead": sliver_lead(r), "families": sliver_families(r)},
    "energy": lambda r: {},
    "cost": lambda r: {"running": _running(r), "precision": _precision(r)},
    "budget": lambda r: {"bars": [_bars(budget) for budget in r["budgets"]]},
    "thesis": thesis_view,
    "calibration": lambda r: {"scatters": _scatters(r["trials"])},
    "iterations": lambda r: {
        "lead": iterations_lead(r),
        "panels": [
            *iterations_panels(r["settings"], "iteration_error"), *substeps_panels(r["settings"]),
        ],
    },
    "positions": positions_view,
    "claims": lambda r: {"judged": [_claim(one) for one in r["judged"]]},
}  # fmt: skip
