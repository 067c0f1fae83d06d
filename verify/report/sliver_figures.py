"""The figures of the sliver study: stability maps, and curves against the sliver's size."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from verify.report.axes import Panel, log_range
from verify.report.curves import Curve, Point
from verify.report.marks import Style, curve_names, drawn_curve
from verify.report.markup import Markup, joined, tag
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
)
_PLACE = "along faces"
_STEP_LEGEND = {
    "good": "at least 0.9",
    "fair": "at least 0.5",
    "poor": "at least 0.1",
    "bad": "less: it vanishes",
}
_CONDITION_LEGEND = {"good": "up to 10³", "fair": "up to 10⁴", "poor": "up to 10⁶", "bad": "more"}
_FAIR = ((0.9, "good"), (0.5, "fair"), (0.1, "poor"))


def sliver_maps(measured: Records, dimension: int) -> Markup:
    """Return the maps of one dimension, of the cut along faces."""
    every = listed(measured, dimension=dimension)
    uncut = _number(listed(every, placement="uncut", quantity="critical step"))
    here = listed(every, placement=_PLACE)

    def step(record: Mapping[str, Any]) -> Cell:
        value = record["value"]
        share = None if value is None or not uncut else value / uncut
        return graded(share, _FAIR, record["reason"])

    def condition(record: Mapping[str, Any]) -> Cell:
        value, reason = record["value"], record["reason"]
        if value is None:
            return ("none", "", reason)
        limits = ((1e3, "good"), (1e4, "fair"), (1e6, "poor"))
        grade = next((g for most, g in limits if value <= most), "bad")
        return (grade, f"{value:.0f}" if value < 9999.5 else f"{value:.0e}", reason)

    scaled = [m for m in here if m["variant"].endswith(", Jacobi")]
    return joined(
        _map(
            f"{dimension}D: explicit step over that of the uncut body", here, "critical step", step,
            _STEP_LEGEND,
        ),
        _map(
            f"{dimension}D: linear runs at 0.9 of the uncut step", here,
            "steps to blow-up, explicit", _course,
            {"good": "ran through", "bad": "blew up after so many steps"},
        ),
        _map(
            f"{dimension}D: condition number, scaled by its diagonal", scaled, "condition number",
            condition,
            _CONDITION_LEGEND,
        ),
        _map(
            f"{dimension}D: most pieces inside out at once, explicit from 15 % strain", here,
            "inverted pieces", _inverted, {"good": "none", "poor": "so many"},
        ),
        _map(
            f"{dimension}D: implicit from 15 % strain, ten times the uncut step", here,
            "steps to blow-up, implicit", _course,
            {"good": "ran through", "bad": "ended after so many steps"},
        ),
        _map(
            f"{dimension}D: explicit step over that of the uncut body, wherever cut",
            _by_placement(every, "side-wise"), "critical step", step, _STEP_LEGEND,
        ),
        _map(
            f"{dimension}D: condition number, scaled by its diagonal, wherever cut",
            _by_placement(every, "side-wise, Jacobi"), "condition number", condition,
            _CONDITION_LEGEND,
        ),
        _map(
            f"{dimension}D: linear runs at 0.9 of the uncut step, small features",
            _by_placement(every, "side-wise"), "steps to blow-up, explicit", _course,
            {"good": "ran through", "bad": "blew up after so many steps"},
        ),
        _map(
            f"{dimension}D: most pieces inside out at once, explicit at 0.9, small features",
            _by_placement(every, "side-wise, 0.9 of its step"), "inverted pieces", _inverted,
            {"good": "none", "poor": "so many"},
        ),
    )  # fmt: skip


def sliver_curves(measured: Records, growths: Records, dimension: int) -> Markup:
    """Return the curves of one dimension, with their exponents beside them."""
    here = listed(measured, dimension=dimension)
    laws = listed(growths, dimension=dimension)
    bases = ("side-wise", "shifted", "heaviside")
    lumpings = ("side-wise", "thesis", "consistent", "row sum", "HRZ")
    raw = "along faces" if dimension == 2 else "through vertices"
    shown = [
        (f"condition number, unscaled, {raw}", "condition number", raw,
         [(b, "keep", f"{b}, raw") for b in bases]),
        ("condition number, scaled by its diagonal", "condition number", _PLACE,
         [*((b, "keep", f"{b}, Jacobi") for b in bases),
          ("conforming", "conforming", "side-wise, Jacobi"),
          ("snapped", "snapped", "side-wise, Jacobi")]),
        ("critical step in s, slivers kept", "critical step", _PLACE,
         [(name, "keep", name) for name in lumpings]),
        ("critical step in s, side-wise or lumped", "critical step", _PLACE,
         [(t, t, "side-wise")
          for t in ("keep", "drop", "merge", "ghost penalty", "conforming", "snapped")]),
        ("compliance of the smallest piece in m/N", "compliance", _PLACE,
         [(t, t, "") for t in ("keep", "drop", "merge", "conforming", "snapped")]),
        ("compliance of a strip between two cuts in m/N", "compliance", "two cuts apart",
         [(t, t, "") for t in ("keep", "conforming", "ghost penalty")]),
        ("relative L² error of the displacement", "displacement error", _PLACE,
         [(t, t, "") for t in ("keep", "drop", "merge", "ghost penalty", "conforming")]),
        ("iterations of conjugate gradients, nodal blocks", "CG iterations", _PLACE,
         [*((b, "keep", f"{b}, nodal blocks") for b in bases),
          ("conforming", "conforming", "side-wise, nodal blocks")]),
    ]  # fmt: skip
    figures = []
    for title, quantity, placement, wanted in shown:
        fixed = {"quantity": quantity, "placement": placement}
        curves = []
        for name, treatment, variant in wanted:
            series = listed(here, treatment=treatment, variant=variant, **fixed)
            (law, *_) = [*listed(laws, treatment=treatment, variant=variant, **fixed), {}]
            curves.append((name, series, _law_text(law)))
        if drawn := _figure(title, curves):
            figures.append(tag("figure", drawn))
    return tag("div", figures, class_="panels")


def _number(records: Records) -> float | None:
    return records[0]["value"] if records else None


def _by_placement(measured: Records, variant: str) -> Records:
    """One row per placement and treatment of a single variant; along faces has maps of its own."""
    return [
        {**m, "variant": m["placement"]}
        for m in listed(measured, variant=variant)
        if m["placement"] not in ("uncut", _PLACE)
    ]


def _course(record: Mapping[str, Any]) -> Cell:
    if record["value"] is not None:
        return ("bad", f"{record['value']:.0f}", record["reason"])
    return ("good" if record["reason"].startswith("none in") else "none", "", record["reason"])


def _inverted(record: Mapping[str, Any]) -> Cell:
    count = record["value"]
    if count is None:
        return ("none", "", record["reason"])
    return ("poor", f"{count:.0f}", record["reason"]) if count else ("good", "", record["reason"])


def _map(
    title: str,
    measured: Records,
    quantity: str,
    cell: Callable[[Mapping[str, Any]], Cell],
    legend: Mapping[str, str],
) -> Markup | None:
    chosen = listed(measured, quantity=quantity)
    if not chosen:
        return None
    sizes = sorted({m["size"] for m in chosen}, reverse=True)
    names = list(dict.fromkeys((m["variant"], m["treatment"]) for m in chosen))
    variants = list(dict.fromkeys(variant for variant, _ in names))
    names.sort(key=lambda name: variants.index(name[0]))
    rows = []
    for variant, treatment in names:
        by_size = {m["size"]: m for m in listed(chosen, variant=variant, treatment=treatment)}
        cells = [cell(by_size[s]) if s in by_size else None for s in sizes]
        rows.append((f"{variant.removesuffix(', Jacobi')}: {treatment}", cells))
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
        "sliver size ε, in elements", title,
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
