"""What accuracy costs: error against the number of unknowns and against time."""

from collections.abc import Callable

from verify.report.axes import Panel, log_range
from verify.report.curves import Curve, Point, floor
from verify.report.marks import Style, band, curve_names, drawn_curve, style_of
from verify.report.markup import Markup, joined, tag
from verify.report.notation import number_text

__all__ = ["time_figure", "unknowns_figure"]


def unknowns_figure(curves: list[Curve], y_range: tuple[float, float], title: str) -> Markup | None:
    """Return the error over the number of unknowns, or None if no solve tells it."""
    found = [p.unknowns for c in curves for p in c.points if p.unknowns and p.value > 0]
    if not found:
        return None
    panel = Panel(log_range([float(n) for n in found]), y_range, "unknowns", title)
    return _figure(panel, curves, lambda p: float(p.unknowns) if p.unknowns else None, "", [])


def time_figure(curves: list[Curve], y_range: tuple[float, float], title: str) -> Markup | None:
    """Return the work–precision diagram, or None if nothing was timed.

    The marker is at the median without meshing, the bar spans the repetitions, and a dotted
    line leads to the time with meshing.
    """
    points = [p for c in curves for p in c.points if _seconds(p) is not None and p.value > 0]
    if not points:
        return None
    times = [t for p in points if p.duration for t in (p.duration.low, p.duration.high) if t > 0]
    times += [p.duration.median + p.duration.meshing for p in points if p.duration]
    panel = Panel(log_range(times), y_range, "wall time (s), median", title)
    styles = style_of(curves)
    spans = [
        _span(panel, point, styles[curve.label])
        for curve in curves
        for point in curve.points
        if _seconds(point) is not None and point.value > 0
    ]
    return _figure(panel, curves, _seconds, " s", spans)


def _figure(
    panel: Panel,
    curves: list[Curve],
    abscissa: Callable[[Point], float | None],
    unit: str,
    under: list[Markup],
) -> Markup:
    styles = style_of(curves)
    content = [band(panel, floor(curves, abscissa)), *under]
    names, said = [], [f"{panel.y_title} against {panel.x_title}."]
    for curve in curves:
        content.append(drawn_curve(panel, curve, styles[curve.label], abscissa))
        placed = [(x, p) for p in curve.points if (x := abscissa(p)) is not None and p.value > 0]
        if placed:
            x, point = max(placed, key=lambda entry: entry[0])
            names.append((point.value, curve.label, "", styles[curve.label]))
            said.append(
                f"{curve.label}: {number_text(point.value)} with {number_text(x)}{unit} "
                f"on level {point.level}."
            )
    content.append(curve_names(panel, names, height=15.0))
    return panel.drawn(" ".join(said), *content)


def _seconds(point: Point) -> float | None:
    return point.duration.median if point.duration and point.duration.median > 0 else None


def _span(panel: Panel, point: Point, style: Style) -> Markup:
    """Draw the spread of the repetitions, and the way to the time with meshing."""
    if point.duration is None:
        return joined()
    y = panel.y.at(point.value)
    time = point.duration
    low, high = panel.x.at(time.low), panel.x.at(time.high)
    parts = []
    if high - low > 7:
        spread = f"M{low:.1f} {y - 3:.1f}v6m0 -3H{high:.1f}m0 -3v6"
        parts.append(tag("path", d=spread, class_="bar", stroke=style.colour))
    if time.meshing > 0:
        end = panel.x.at(time.median + time.meshing)
        way = f"M{panel.x.at(time.median):.1f} {y:.1f}H{end:.1f}"
        foot = f"M{end:.1f} {y - 4:.1f}v8"
        parts.append(tag("path", d=way, class_="meshing", stroke=style.colour))
        parts.append(tag("path", d=foot, class_="bar", stroke=style.colour))
    return joined(*parts)
