"""Marks in a panel: curves with error bars, their names, bands and slope triangles."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from verify.report.axes import Panel, text
from verify.report.curves import Curve, Point
from verify.report.markup import Markup, joined, tag
from verify.report.notation import number_text

__all__ = ["Style", "abandoned", "band", "curve_names", "drawn_curve", "slope_triangle", "style_of"]

_NAME_OF_BAND = 140  # pixels that the name of the band takes, and some more

# Okabe and Ito's palette, darkened to stay legible as text; markers differ as well
_FIRST = {
    "xfem": ("#c04a00", "disc"),
    "conforming": ("#0067a5", "square"),
    "reference": ("#4d4d4d", "diamond"),
}
_OTHERS = [
    ("#00785a", "triangle"),
    ("#a3487b", "cross"),
    ("#8a6a00", "disc"),
    ("#5b4db5", "square"),
]


@dataclass(frozen=True)
class Style:
    """Colour and marker of a solver."""

    colour: str
    marker: str


def style_of(curves: Sequence[Curve]) -> dict[str, Style]:
    """Return the style of each curve by its label; a solver looks the same in every figure."""
    styles: dict[str, Style] = {}
    taken: set[str] = set()
    others = 0
    for curve in curves:
        if curve.solver in _FIRST and curve.solver not in taken:
            taken.add(curve.solver)
            styles[curve.label] = Style(*_FIRST[curve.solver])
        else:
            styles[curve.label] = Style(*_OTHERS[others % len(_OTHERS)])
            others += 1
    return styles


def drawn_curve(
    panel: Panel, curve: Curve, style: Style, abscissa: Callable[[Point], float | None]
) -> Markup:
    """Return the lines, error bars and markers of a curve."""
    parts: list[Markup | None] = []
    for stretch in curve.stretches:
        placed = [(p, x) for p in stretch if (x := abscissa(p)) is not None and p.value > 0]
        if not placed:
            continue
        nodes = [f"{panel.x.at(x):.1f} {panel.y.at(p.value):.1f}" for p, x in placed]
        parts.append(tag("path", d="M" + "L".join(nodes), class_="curve", stroke=style.colour))
        for point, x in placed:
            parts.append(_error_bar(panel, point, panel.x.at(x), style))
            parts.append(_marker(panel.x.at(x), panel.y.at(point.value), style, _tip(curve, point)))
    return joined(*parts)


def abandoned(
    panel: Panel, curve: Curve, style: Style, places: Sequence[tuple[float, float]]
) -> Markup:
    """Return a cross at each of `places` (values), where a solve failed and the curve ends."""
    parts = []
    known = {p.level: (panel.x.at(p.size), panel.y.at(p.value)) for p in curve.points if p.size}
    for (x_value, y_value), (level, how) in zip(places, curve.ends, strict=True):
        x, y = panel.x.at(x_value), panel.y.at(y_value)
        if level - 1 in known:
            x0, y0 = known[level - 1]
            lead = f"M{x0:.1f} {y0:.1f}L{x:.1f} {y:.1f}"
            parts.append(tag("path", d=lead, class_="meshing", stroke=style.colour))
        cross = f"M{x - 4:.1f} {y - 4:.1f}l8 8m0 -8l-8 8"
        tip = tag("title", f"{curve.label}, level {level}: {how}")
        parts.append(tag("path", tip, d=cross, class_="abandoned", stroke=style.colour))
        parts.append(text(x - 4, y - 9, how, class_="note", fill=style.colour))
    return joined(*parts)


def curve_names(
    panel: Panel, names: Sequence[tuple[float, str, str, Style]], height: float = 27.0
) -> Markup:
    """Return the curves' names beside their ends, moved apart where they would overlap.

    Parameters
    ----------
    names : sequence of (y value, name, second line, Style)
    """
    ordered = sorted(names, key=lambda entry: panel.y.at(entry[0]))
    wanted = [panel.y.at(entry[0]) for entry in ordered]
    places = _spread(wanted, height, panel.y.end, panel.y.start - height / 2)
    parts = []
    for (_, name, second, style), anchor, y in zip(ordered, wanted, places, strict=True):
        x = panel.gutter
        lead = f"M{panel.x.end + 2:.1f} {anchor:.1f}L{x - 5:.1f} {y:.1f}"
        parts.append(tag("path", d=lead, class_="lead", stroke=style.colour))
        parts.append(_marker(x, y, style, name))
        parts.append(text(x + 8, y + 4, _shortened(name), class_="name", fill=style.colour))
        parts.append(text(x + 8, y + 16, second, class_="note", fill=style.colour))
    return joined(*parts)


def band(panel: Panel, floor: Sequence[tuple[float, float]]) -> Markup:
    """Return the band below the uncertainty of the comparison, given as (x, uncertainty)."""
    if not any(u > panel.y.low for _, u in floor):
        return joined()
    inside = [(panel.x.at(x), panel.y.at(u)) for x, u in sorted(floor)]
    nodes = [(panel.x.start, inside[0][1]), *inside, (panel.x.end, inside[-1][1])]
    line = "L".join(f"{x:.1f} {y:.1f}" for x, y in nodes)
    # the name stands where the band is higher, below all of its edge that it reaches
    left = inside[0][1] <= inside[-1][1]
    x, anchor = (panel.x.start + 5, "start") if left else (panel.x.end - 4, "end")
    reach = x + _NAME_OF_BAND if left else x - _NAME_OF_BAND
    edge = float(np.interp(reach, [at for at, _ in nodes], [y for _, y in nodes]))
    top = max([edge, *(y for at, y in nodes if (at <= reach) == left)])
    name = text(x, top + 12, "uncertainty of the comparison", class_="note", text_anchor=anchor)
    return joined(
        tag("path", d=f"M{line}V{panel.y.start}H{panel.x.start}Z", class_="floor"),
        tag("path", d=f"M{line}", class_="floor-edge"),
        name if panel.y.start - top > 14 else None,
    )


def slope_triangle(
    panel: Panel, low: float, high: float, y: float, slope: float, name: str
) -> Markup:
    """Return a triangle of `slope` over the abscissa from `low` to `high`, starting at `y`."""
    x0, x1 = panel.x.at(low), panel.x.at(high)
    y0, y1 = panel.y.at(y), panel.y.at(y * (high / low) ** slope)
    return joined(
        tag("path", d=f"M{x0:.1f} {y0:.1f}H{x1:.1f}V{y1:.1f}Z", class_="slope"),
        text((x0 + x1) / 2, y0 + 12, "1", class_="note", text_anchor="middle"),
        text(x1 + 4, (y0 + y1) / 2 + 4, name, class_="note"),
    )


def _error_bar(panel: Panel, point: Point, x: float, style: Style) -> Markup | None:
    if point.uncertainty <= 0:
        return None
    top = panel.y.at(point.value + point.uncertainty)
    low = max(point.value - point.uncertainty, panel.y.low)
    bottom = panel.y.at(low)
    if bottom - top < 3:  # hidden behind the marker; the tip and the table have it
        return None
    feet = f"M{x - 3:.1f} {top:.1f}h6" + (
        f"M{x - 3:.1f} {bottom:.1f}h6" if low > panel.y.low else ""
    )
    return tag(
        "path", d=f"{feet}M{x:.1f} {top:.1f}V{bottom:.1f}", class_="bar", stroke=style.colour
    )


def _marker(x: float, y: float, style: Style, tip: str) -> Markup:
    shapes = {
        "disc": f"M{x - 2.8:.1f} {y:.1f}a2.8 2.8 0 1 0 5.6 0a2.8 2.8 0 1 0 -5.6 0Z",
        "square": f"M{x - 4:.1f} {y - 4:.1f}h8v8h-8Z",
        "diamond": f"M{x:.1f} {y - 5.2:.1f}l5.2 5.2l-5.2 5.2l-5.2 -5.2Z",
        "triangle": f"M{x:.1f} {y - 4.2:.1f}l4 7.2h-8Z",
        "cross": f"M{x - 4:.1f} {y:.1f}h8M{x:.1f} {y - 4:.1f}v8",
    }
    filled = style.marker in ("disc", "triangle")
    fill = style.colour if filled else "#fff"
    return tag(
        "path",
        tag("title", tip),
        d=shapes[style.marker],
        class_="marker",
        stroke=style.colour,
        fill=fill,
    )


def _tip(curve: Curve, point: Point) -> str:
    said = [f"{curve.label}, level {point.level}: {number_text(point.value)}"]
    if point.uncertainty > 0:
        said.append(f"± {number_text(point.uncertainty, 2)}")
    return " ".join(said)


def _spread(wanted: Sequence[float], gap: float, low: float, high: float) -> list[float]:
    """Return ascending places near `wanted`, `gap` apart, inside [low, high] if they fit."""
    places: list[float] = []
    for place in wanted:
        places.append(max(place, places[-1] + gap) if places else max(place, low))
    for i in range(len(places) - 1, -1, -1):
        limit = high if i == len(places) - 1 else places[i + 1] - gap
        places[i] = min(places[i], limit)
    return places


def _shortened(name: str) -> str:
    return name if len(name) <= 15 else name[:14] + "…"
