"""The figures of the sliver study: one family of scenes, errors and systems of every solver."""

from collections.abc import Mapping, Sequence
from typing import Any

from verify.report.axes import Panel, log_range
from verify.report.curves import Curve, Point
from verify.report.marks import Style, curve_names, drawn_curve
from verify.report.markup import Markup, joined, tag
from verify.report.notation import error_title, is_error
from verify.report.stability_map import Cell, graded, listed, size_text, stability_map

__all__ = ["sliver_curves", "sliver_maps"]

Records = Sequence[Mapping[str, Any]]

_STYLES = (
    Style("#c04a00", "disc"),
    Style("#0067a5", "square"),
    Style("#00785a", "triangle"),
    Style("#a3487b", "cross"),
    Style("#4d4d4d", "diamond"),
    Style("#8a6a00", "disc"),
    Style("#5b4db5", "square"),
    Style("#7a3b00", "triangle"),
)
_STEP, _UNCUT = "critical explicit step", "critical explicit step, uncut"
_SCALED = "condition number scaled by the diagonal"
_DRAWN = ("condition number", _SCALED, _STEP)
_STEP_LEGEND = {
    "good": "at least 0.9",
    "fair": "at least 0.5",
    "poor": "at least 0.1",
    "bad": "less: it vanishes",
}
_FAIR = ((0.9, "good"), (0.5, "fair"), (0.1, "poor"))
_CONDITION_LEGEND = {"good": "up to 10³", "fair": "up to 10⁴", "poor": "up to 10⁶", "bad": "more"}
_CONDITION = ((1e3, "good"), (1e4, "fair"), (1e6, "poor"))


def sliver_maps(measured: Records) -> Markup:
    """Return the maps of one family: the critical step and the scaled condition number."""
    steps = []
    for record in listed(measured, quantity=_STEP):
        uncut = listed(measured, quantity=_UNCUT, solver=record["solver"])
        whole = next((one["value"] for one in uncut if one["value"]), None)
        share = record["value"] / whole if record["value"] and whole else None
        reason = record["reason"] or ("" if share else "no step of the uncut body to compare with")
        steps.append((record, graded(share, _FAIR, reason)))
    conditions = [(one, _condition(one)) for one in listed(measured, quantity=_SCALED)]
    return joined(
        _map("Critical explicit step over that of the uncut body", _STEP_LEGEND, steps),
        _map("Condition number, scaled by the diagonal", _CONDITION_LEGEND, conditions),
    )


def sliver_curves(measured: Records, growths: Records) -> Markup:
    """Return the curves of one family, with their exponents beside them."""
    names = dict.fromkeys(m["quantity"] for m in measured)
    shown = [n for n in names if is_error(n) or n.startswith(("relative", "deviation"))]
    figures = []
    for quantity in [*shown, *(n for n in _DRAWN if n in names)]:
        curves = []
        for solver in dict.fromkeys(m["solver"] for m in measured):
            series = listed(measured, solver=solver, quantity=quantity)
            (law, *_) = [*listed(growths, solver=solver, quantity=quantity), {}]
            curves.append((solver, series, _law_text(law)))
        unit = ", s" if quantity == _STEP else ""
        title = error_title(quantity) if is_error(quantity) else f"{quantity}{unit}"
        if drawn := _figure(title, curves):
            figures.append(tag("figure", drawn))
    return tag("div", figures, class_="panels")


def _condition(record: Mapping[str, Any]) -> Cell:
    value, reason = record["value"], record["reason"]
    if value is None:
        return ("none", "", reason)
    grade = next((g for most, g in _CONDITION if value <= most), "bad")
    return (grade, f"{value:.0f}" if value < 9999.5 else f"{value:.0e}", reason)


def _map(
    title: str, legend: Mapping[str, str], graded_records: list[tuple[Mapping[str, Any], Cell]]
) -> Markup | None:
    if not graded_records:
        return None
    sizes = sorted({record["size"] for record, _ in graded_records}, reverse=True)
    rows = []
    for solver in dict.fromkeys(record["solver"] for record, _ in graded_records):
        cells = {r["size"]: cell for r, cell in graded_records if r["solver"] == solver}
        rows.append((solver, [cells.get(size) for size in sizes]))
    return stability_map(title, legend, sizes, rows)


def _law_text(law: Mapping[str, Any]) -> str:
    if law.get("exponent") is None:
        return ""
    return f"∝ ε^{law['exponent'] + 0.0:.2f}".replace("-", "−").replace("−0.00", "0.00")


def _figure(title: str, curves: Sequence[tuple[str, Records, str]]) -> Markup | None:
    drawn = []
    for name, series, law in curves:
        points = [
            Point(level, m["size"], None, m["value"], 0.0, None)
            for level, m in enumerate(sorted(series, key=lambda m: m["size"]))
            if m["size"] > 0.0 and m["value"]
        ]
        if points:
            drawn.append((Curve(name, name, [points], [], None), law))
    if not drawn:
        return None
    every = [p for curve, _ in drawn for p in curve.points]
    panel = Panel(
        log_range([p.size for p in every if p.size]), log_range([p.value for p in every]),
        "ε, in elements", title,
    )  # fmt: skip
    parts, names = [], []
    for (curve, law), style in zip(drawn, _STYLES, strict=False):
        parts.append(drawn_curve(panel, curve, style, lambda p: p.size))
        names.append((curve.points[0].value, curve.label, law, style))
    described = "; ".join(
        f"{c.label}: {c.points[0].value:.3g} at ε = {size_text(c.points[0].size or 0.0)} "
        f"to {c.points[-1].value:.3g} at {size_text(c.points[-1].size or 0.0)}"
        for c, _ in drawn
    )
    return panel.drawn(f"{title}. {described}", *parts, curve_names(panel, names))
