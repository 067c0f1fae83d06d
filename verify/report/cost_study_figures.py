"""Figures of a cost study: work against precision, and the running cost of a growing cut."""

from collections.abc import Mapping, Sequence
from typing import Any

from verify.report.axes import Panel, log_range
from verify.report.markup import Markup, joined, tag
from verify.report.notation import metric_title, number, solver_title
from verify.report.time_panel import time_panel

__all__ = ["cost_section"]

_COLOURS = ("#c04a00", "#0067a5", "#00785a", "#4d4d4d", "#7a3e9d", "#8a6d00", "#a3195b", "#3b7ea1")


def cost_section(record: Mapping[str, Any]) -> Markup:
    """Return the figures and tables of the record of a cost study."""
    return joined(
        tag(
            "section",
            tag("h2", "Over the growing cut"),
            tag(
                "p",
                "Time so far at equal error: what is paid once (a background mesh) and, at every "
                "step, what the new cut costs. The error of a step is the least that all solvers "
                "reach.",
                class_="quiet",
            ),
            tag("div", _running(record), class_="panels"),
            tag("div", _steps(record), class_="scroll"),
        ),
        tag(
            "section",
            tag("h2", "Work against precision, last step"),
            tag(
                "p",
                "Ringed: no other solve is faster and more accurate at the same time. Without "
                "what is paid once.",
                class_="quiet",
            ),
            tag("div", _precision(record), class_="panels"),
            tag("div", _phases(record), class_="scroll"),
        ),
        _left_out(record),
    )


def _names(record: Mapping[str, Any]) -> dict[str, str]:
    return dict(zip(record["running"], _COLOURS * 3, strict=False))


def _running(record: Mapping[str, Any]) -> Markup:
    """Linear axes, four solvers a figure at most."""
    steps = [float(step["step"]) for step in record["steps"]]
    names = list(record["running"])
    figures = []
    for first in range(0, len(names), 4):
        shown = []
        for name in names[first : first + 4]:
            sums = record["running"][name]
            values = [float("nan") if entry is None else entry[0] for entry in sums]
            shown.append((solver_title(name), [0.0, *values]))
        panel = time_panel("time so far, s", [0.0, *steps], shown, (), "step of the cut")
        figures.append(tag("figure", panel))
    return joined(*figures)


def _steps(record: Mapping[str, Any]) -> Markup:
    names = list(record["running"])
    head = tag(
        "tr", [tag("th", t, scope="col") for t in ("step", "error", *map(solver_title, names))]
    )
    rows = [
        tag(
            "tr",
            tag("th", str(step["step"]), scope="row"),
            tag("td", number(step["error"])),
            [tag("td", _seconds(step["times"].get(name))) for name in names],
        )
        for step in record["steps"]
    ]
    caption = "Seconds of each step at equal error: median (least to most of the repetitions)"
    return tag(
        "table", tag("caption", caption), tag("thead", head), tag("tbody", rows), class_="map"
    )


def _seconds(times: Sequence[float] | None) -> str:
    if times is None:
        return "not reached"
    return f"{times[0]:.3g} ({times[1]:.3g} to {times[2]:.3g})"


def _precision(record: Mapping[str, Any]) -> Markup:
    points = [p for p in record["points"] if p["error"] > 0 and p["seconds"] > 0]
    if not points:
        return tag("p", "Nothing was both timed and measured.")
    front = {(solver, level) for solver, level in record["front"]}
    title = metric_title(record["metric"])
    times = [t for p in points for t in (p["fastest"], p["slowest"])]
    errors = log_range([p["error"] for p in points])
    figures = []
    for x_title, key, values in (
        ("wall time (s), median", "seconds", times),
        ("unknowns", "unknowns", [float(p["unknowns"]) for p in points if p["unknowns"]]),
    ):
        if not values:
            continue
        panel = Panel(log_range(values), errors, x_title, title)
        content = []
        for row, (name, colour) in enumerate(_names(record).items()):
            own = sorted((p for p in points if p["solver"] == name), key=lambda p: p["level"])
            if not own:
                continue
            at = [(panel.x.at(float(p[key])), panel.y.at(p["error"])) for p in own]
            way = "L".join(f"{x:.1f} {y:.1f}" for x, y in at)
            content.append(tag("path", d=f"M{way}", class_="curve", stroke=colour))
            for (x, y), p in zip(at, own, strict=True):
                tip = f"{solver_title(name)} level {p['level']}: {p[key]:.3g}, {p['error']:.3g}"
                circle = {"cx": f"{x:.1f}", "cy": f"{y:.1f}", "fill": colour}
                content.append(tag("circle", tag("title", tip), r="3.5", **circle))
                if (name, p["level"]) in front:
                    ring = {**circle, "fill": "none", "stroke": colour, "stroke_width": "1.5"}
                    content.append(tag("circle", r="7", **ring))
            y = panel.y.end + 12 + 17 * row
            label = tag("text", solver_title(name), x=f"{panel.gutter:.0f}", y=f"{y:.0f}",
                        class_="note", fill=colour)  # fmt: skip
            content.append(label)
        said = "; ".join(f"{p['solver']} {p[key]:.3g}: {p['error']:.3g}" for p in points)
        figures.append(tag("figure", panel.drawn(f"{title} against {x_title}. {said}", *content)))
    return joined(*figures)


def _phases(record: Mapping[str, Any]) -> Markup:
    phases = list(dict.fromkeys(name for p in record["points"] for name in p["phases"]))
    titles = ("solver", "level", "unknowns", "error", "peak memory, MB", *phases)
    head = tag("tr", [tag("th", title, scope="col") for title in titles])
    rows = [
        tag(
            "tr",
            tag("th", solver_title(p["solver"]), scope="row"),
            tag("td", str(p["level"])),
            tag("td", str(p["unknowns"])),
            tag("td", number(p["error"])),
            tag("td", f"{p['memory'] / 1e6:.0f}" if p["memory"] else ""),
            [tag("td", f"{1e3 * p['phases'][n]:.3g}" if n in p["phases"] else "") for n in phases],
        )
        for p in record["points"]
    ]
    caption = "Phases in milliseconds, median of the repetitions; one thread"
    return tag(
        "table", tag("caption", caption), tag("thead", head), tag("tbody", rows), class_="map"
    )


def _left_out(record: Mapping[str, Any]) -> Markup:
    if not record["left_out"]:
        return joined()
    rows = [
        tag("li", f"{one['case']}, {one['solver']}, level {one['level']}: {one['status']}: "
            f"{one['reason']}")
        for one in record["left_out"]
    ]  # fmt: skip
    return tag("section", tag("h2", "Left out, and why"), tag("ul", rows))
