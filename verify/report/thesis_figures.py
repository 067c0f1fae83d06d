"""Tables and figures of the thesis beside the thesis' own numbers."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from verify.report.axes import Panel, log_range
from verify.report.markup import Markup, joined, tag
from verify.report.notation import number, seconds_text, solver_title
from verify.report.time_panel import time_panel

__all__ = ["thesis_section"]

_COLOURS = ("#c04a00", "#0067a5", "#00785a", "#4d4d4d", "#7a3e9d", "#8a6d00")
_Rows = Sequence[Mapping[str, Any]]


def thesis_section(record: Mapping[str, Any]) -> Markup:
    """Return the figures and tables of the record of the study of the thesis."""
    return joined(
        _unknowns(record),
        _times(record["steps"]),
        _delays(record["delays"]),
        _real_time(record["hand"], record["contended"]),
        _methods(record["methods"]),
        _slivers(record["slivers"]),
        tag("p", f"Numbers of the thesis: {record['published']['source']}.", class_="quiet"),
    )


def _unknowns(record: Mapping[str, Any]) -> Markup:
    face: _Rows = record["face"]
    cuts = [0.0, *(float(row["asked"]) for row in face)]
    two = "snapping_subdivision 0.02"
    curves = [
        ("thesis, XFEM", [0.0, *(row["thesis"]["xfem"] for row in face)]),
        ("thesis, S + S", [0.0, *(row["thesis"]["snapping_subdivision"] for row in face)]),
        ("XFEM", [0.0, *(row["added"]["xfem"] for row in face)]),
        ("S + S, 0.02", [0.0, *(row["added"][two] for row in face)]),
        ("S + S, 0.2", [0.0, *(row["added"]["snapping_subdivision 0.2"] for row in face)]),
    ]
    columns: dict[str, Callable[[Mapping[str, Any]], Any]] = {
        "cut elements": lambda row: row["cuts"],
        "strokes": lambda row: row["strokes"],
        "thesis, XFEM": lambda row: row["thesis"]["xfem"],
        "thesis, S + S": lambda row: row["thesis"]["snapping_subdivision"],
    }
    for name in face[0]["added"]:
        columns[_short(name)] = partial(_added, name)
    steps: dict[str, Callable[[Mapping[str, Any]], Any]] = {
        "cut elements": lambda row: row["cuts"],
        **{_short(name): partial(_step, name) for name in face[0]["step"]},
    }
    return tag(
        "section",
        tag("h2", "Unknowns: Table 4.3 and Figure 4.11"),
        _said(
            "Nodes added on the face. S + S is snapping and subdivision; the number is the "
            "threshold, in edges, below which a node is moved onto the cut instead of the edge "
            "being divided. The thesis does not say which it had."
        ),
        tag("div", _figure(time_panel("nodes added", cuts, curves, (), "cut elements")),
            class_="panels"),
        _table("Nodes added by growing incisions", columns, face),
        _table("Critical explicit step over that of the uncut face, as a free sheet", steps, face),
    )  # fmt: skip


def _added(name: str, row: Mapping[str, Any]) -> int:
    added: int = row["added"][name]
    return added


def _step(name: str, row: Mapping[str, Any]) -> str:
    return number(row["step"][name], 2)


def _short(name: str) -> str:
    return solver_title(name.replace("snapping_subdivision", "S + S").replace("xfem ", "XFEM "))


def _times(steps: _Rows) -> Markup:
    cuts = list(dict.fromkeys(row["asked_cuts"] for row in steps))
    sizes = list(dict.fromkeys(row["asked_tetrahedra"] for row in steps))

    def curves(key: str, factor: float) -> list[tuple[str, list[float]]]:
        return [
            (f"{size} tets", [factor * r[key] for r in steps if r["asked_tetrahedra"] == size])
            for size in sizes
        ]

    at = [float(cut) for cut in cuts]
    panels = [
        time_panel("thesis: s per simulated s", at, curves("thesis_per_second", 1.0), (), "cuts"),
        time_panel("here: ms per simulated s", at, curves("per_second", 1e3), (), "cuts"),
        time_panel("here: nodes", at, curves("nodes", 1.0), (), "cuts"),
        time_panel("thesis: nodes", at, curves("thesis_nodes", 1.0), (), "cuts"),
    ]
    columns: dict[str, Callable[[Mapping[str, Any]], Any]] = {
        "tetrahedra": lambda row: row["tetrahedra"],
        "cuts": lambda row: row["cuts"],
        "nodes": lambda row: row["nodes"],
        "nodes, thesis": lambda row: row["thesis_nodes"],
        "a step": lambda row: seconds_text(row["step"]),
        "a simulated second": lambda row: seconds_text(row["per_second"]),
        "thesis": lambda row: f"{row['thesis_per_second']:g} s",
        "times less": lambda row: f"{row['thesis_per_second'] / row['per_second']:.0f}",
    }
    return tag(
        "section",
        tag("h2", "Time of a simulated second: Tables 4.4, 4.5 and Figure 4.25"),
        _said(
            "Two steps of 0.5 s, as in the thesis, with inner surface, mapping and collision; "
            "processor time of one thread here, wall time on a laptop of 2009 there. Cuts count "
            "twice where two strokes split an element."
        ),
        tag("div", [_figure(panel) for panel in panels], class_="panels"),
        _table("After the cuts; median of the steps", columns, steps),
    )


def _delays(delays: _Rows) -> Markup:
    sizes = [float(size) for size in dict.fromkeys(row["tetrahedra"] for row in delays)]
    names = list(dict.fromkeys(row["speed_name"] for row in delays))

    def curves(key: str) -> list[tuple[str, list[float]]]:
        return [(n, [row[key] for row in delays if row["speed_name"] == n]) for n in names]

    columns: dict[str, Callable[[Mapping[str, Any]], Any]] = {
        "tetrahedra": lambda row: row["tetrahedra"],
        "speed": lambda row: f"{row['speed_name']}, {1e3 * row['speed']:.1f} mm/s",
        "elements crossed": lambda row: row["elements"],
        "mean edge, mm": lambda row: f"{1e3 * row['edge']:.2f}",
        "delay, s": lambda row: f"{row['delay']:.4f}",
        "on the screen, s": lambda row: f"{row['seen']:.4f}",
        "thesis, s": lambda row: f"{row['thesis']:.4f}",
        "delay × speed / edge": lambda row: f"{row['delay'] * row['speed'] / row['edge']:.3f}",
    }
    panels = [
        time_panel("thesis: delay, s", sizes, curves("thesis"), (), "tetrahedra"),
        time_panel("size over speed: delay, s", sizes, curves("delay"), (), "tetrahedra"),
    ]
    return tag(
        "section",
        tag("h2", "Delay of crossing an element: Table 4.6 and Figure 4.26"),
        _said(
            "Speeds are not in the thesis: each is the one that gives its delay on the coarsest "
            "mesh, so that the first row agrees by construction and all others are predictions."
        ),
        tag("div", [_figure(panel) for panel in panels], class_="panels"),
        _table("Mean over the elements that three strokes cross", columns, delays),
    )


def _real_time(hand: Mapping[str, Any], contended: str) -> Markup:
    rows = [
        {"phase": name, "resting": hand["resting"][name], "cutting": hand["cutting"][name]}
        for name in hand["resting"]
    ]
    columns: dict[str, Callable[[Mapping[str, Any]], Any]] = {
        "phase": lambda row: row["phase"],
        "steps that do not cut": lambda row: seconds_text(row["resting"]),
        "steps that cut": lambda row: seconds_text(row["cutting"]),
    }
    shares = ", ".join(
        f"within {name} {share:.1%} ({hand['within_wall'][name]:.1%} in wall time; "
        f"{hand['within_spread'][name]:.1%} with the work of a cut spread over steps)"
        for name, share in hand["within"].items()
    )
    return tag(
        "section",
        tag("h2", "Real time: the hand"),
        _said(
            f"{hand['tetrahedra']} tetrahedra, {hand['cuts']} cut, {hand['unknowns']} unknowns, "
            f"{hand['steps']} steps of 1/60 s of which {hand['cutting_steps']} cut. Steps "
            f"{shares}." + (f" Note: {contended}." if contended else "")
        ),
        _table("Median processor time of a step", columns, rows),
    )


def _methods(methods: _Rows) -> Markup:
    columns: dict[str, Callable[[Mapping[str, Any]], Any]] = {
        "method": lambda row: solver_title(row["solver"]),
        "level": lambda row: row["level"],
        "unknowns": lambda row: row["unknowns"],
        "displacement": lambda row: _first(row["displacement"]),
        "energy norm": lambda row: _first(row["energy_norm"]),
        "jump": lambda row: _first(row["jump"]),
        "strain energy": lambda row: _signed(row["energy"]),
        "critical step": lambda row: _first([row["critical_step"]]),
        "time": lambda row: seconds_text(row["seconds"]),
    }
    if any(row["reason"] for row in methods):
        columns["why not"] = lambda row: row["reason"][:120]
    tables = [
        _table(case, columns, [row for row in methods if row["case"] == case])
        for case in dict.fromkeys(row["case"] for row in methods)
    ]
    return tag(
        "section",
        tag("h2", "All methods against the same answers"),
        _said(
            "Relative errors; the strain energy with its sign. Critical explicit steps over that "
            "of the uncut mesh, masses lumped; none for a mesh of its own and for springs. Wall "
            "time of what each cut costs anew."
        ),
        *tables,
    )


def _slivers(slivers: _Rows) -> Markup:
    figures = []
    for dimension in dict.fromkeys(row["dimension"] for row in slivers):
        own = [row for row in slivers if row["dimension"] == dimension]
        panel = Panel(
            log_range([row["size"] for row in own]), log_range([row["ratio"] for row in own]),
            "distance of cut and nodes, element sizes", f"critical step over uncut, {dimension}D",
        )  # fmt: skip
        content = []
        names = list(dict.fromkeys(row["method"] for row in own))
        for place, (name, colour) in enumerate(zip(names, _COLOURS, strict=False)):
            points = [(row["size"], row["ratio"]) for row in own if row["method"] == name]
            way = "L".join(f"{panel.x.at(x):.1f} {panel.y.at(y):.1f}" for x, y in points)
            content.append(tag("path", d=f"M{way}", class_="curve", stroke=colour))
            radius = f"{6.5 - 0.8 * place:.1f}"  # of curves on each other all are seen
            content += [
                tag("circle", tag("title", f"{name}, {x:g}: {y:.3g}"), r=radius, fill=colour,
                    cx=f"{panel.x.at(x):.1f}", cy=f"{panel.y.at(y):.1f}")
                for x, y in points
            ]  # fmt: skip
            y = panel.y.end + 12 + 17 * place
            content.append(tag("text", _method(name), x=f"{panel.gutter:.0f}", y=f"{y:.0f}",
                               class_="note", fill=colour))  # fmt: skip
        ends = "; ".join(f"{r['method']} {r['size']:g}: {r['ratio']:.3g}" for r in own)
        figures.append(_figure(panel.drawn(f"critical step against size of slivers. {ends}",
                                           *content)))  # fmt: skip
    return tag(
        "section", tag("h2", "Slivers"), tag("div", figures, class_="panels"),
    )  # fmt: skip


def _method(name: str) -> str:
    return {
        "xfem, consistent mass": "XFEM, consistent",
        "snapping_subdivision": "S + S, 0.2",
        "virtual_node": "virtual nodes",
    }.get(name, solver_title(name))


def _first(values: Sequence[float] | None) -> Any:
    return number(values[0] if values else None, 3)


def _signed(value: float | None) -> Any:
    return "–" if value is None else f"{value:+.2e}".replace("-", "−")


def _said(words: str) -> Markup:
    return tag("p", words, class_="quiet")


def _figure(panel: Markup) -> Markup:
    return tag("figure", panel)


def _table(
    caption: str,
    columns: Mapping[str, Callable[[Mapping[str, Any]], Any]],
    rows: Iterable[Mapping[str, Any]],
) -> Markup:
    """Return a table whose first column names its rows."""
    lines = []
    for row in rows:
        cells = [_cell(value(row)) for value in columns.values()]
        lines.append(tag("tr", tag("th", cells[0], scope="row"), [tag("td", c) for c in cells[1:]]))
    head = tag("tr", [tag("th", title, scope="col") for title in columns])
    table = tag(
        "table", tag("caption", caption), tag("thead", head), tag("tbody", lines), class_="map"
    )
    return tag("div", table, class_="scroll", tabindex="0", role="region", aria_label=caption)


def _cell(value: Any) -> Any:
    if value is None:
        return "–"
    return number(value) if isinstance(value, int) else value
