"""Error against mesh size: curves, required slope, and the floor that the reference sets."""

from verify.report.axes import Panel, log_range
from verify.report.curves import Curve, Point, floor, limits
from verify.report.marks import (
    abandoned,
    band,
    curve_names,
    drawn_curve,
    slope_triangle,
    style_of,
)
from verify.report.markup import Markup
from verify.report.notation import number_text
from verify.result import CaseResult, Rate

__all__ = ["convergence_figure", "error_range", "required_slope"]


def error_range(curves: list[Curve], sloped: bool) -> tuple[float, float] | None:
    """Return the error axis that all figures of a metric share, or None if nothing is drawn.

    It holds every error, the tops of their error bars, and the floor where it `limits` them.
    """
    points = [point for curve in curves for point in curve.points if point.value > 0]
    if not points:
        return None
    values = [p.value for p in points] + [p.value + p.uncertainty for p in points]
    # half of it as well, so that the band below it can be seen
    values += [p.uncertainty / 2 for p in points if limits(p)]
    low, high = log_range(values)
    return (low / 2.2 if sloped else low), high


def required_slope(result: CaseResult, metric: str) -> tuple[float, str] | None:
    """Return the order of convergence that the case demands of `metric`, and how it says so."""
    for check in result.scene.get("acceptance") or []:
        if (
            isinstance(check, dict)
            and check.get("check") == "rate"
            and check.get("metric") == metric
        ):
            if isinstance(order := check.get("at_least"), int | float):
                return float(order), f"≥\N{NARROW NO-BREAK SPACE}{order:g}"
            if isinstance(order := check.get("equals"), int | float):
                return float(order), f"{order:g}"
    return None


def convergence_figure(
    result: CaseResult, metric: str, curves: list[Curve], y_range: tuple[float, float], title: str
) -> Markup | None:
    """Return the error over the element size, or None if no solve tells its size."""
    sizes = [p.size for c in curves for p in c.points if p.size is not None and p.value > 0]
    if not sizes:
        return None
    places = [_places_of_ends(curve, curves) for curve in curves]
    panel = Panel(
        log_range(sizes + [x for ends in places for x, _ in ends]),
        y_range,
        "element size h (m)",
        title,
    )
    styles = style_of(curves)
    content = [band(panel, floor(curves, lambda point: point.size))]
    slope = required_slope(result, metric)
    if slope is not None and len(set(sizes)) > 1:
        content.append(_triangle(panel, curves, *slope))
    names = []
    for curve, ends in zip(curves, places, strict=True):
        style = styles[curve.label]
        content.append(drawn_curve(panel, curve, style, lambda point: point.size))
        content.append(abandoned(panel, curve, style, ends))
        if drawn := [p for p in curve.points if p.size is not None and p.value > 0]:
            coarsest = max(drawn, key=lambda p: p.size or 0.0)
            names.append((coarsest.value, curve.label, _order(curve.rate), style))
    content.append(curve_names(panel, names))
    return panel.drawn(_described(title, curves), *content)


def _order(rate: Rate | None) -> str:
    if rate is None:
        return ""
    if rate.reason or rate.order is None:
        return rate.reason.replace("(", ":").split(":")[0].strip()[:16] or "no order"
    return f"order {rate.order:.2f}" + (
        f" ± {rate.uncertainty:.2f}" if rate.uncertainty >= 0.005 else ""
    )


def _places_of_ends(curve: Curve, curves: list[Curve]) -> list[tuple[float, float]]:
    """Return where the failed levels of `curve` would be: at the size others have there."""
    places = []
    for level, _ in curve.ends:
        nearest = min(curve.points, key=lambda p: (abs(p.level - level), p.level))
        sizes = [p.size for c in curves for p in c.points if p.level == level and p.size]
        guess = (nearest.size or 1.0) * 2.0 ** (nearest.level - level)
        places.append((sizes[0] if sizes else guess, nearest.value))
    return places


def _triangle(panel: Panel, curves: list[Curve], slope: float, name: str) -> Markup:
    """Place the slope below the lowest curve, over the middle of the axis."""
    low = panel.x.low * (panel.x.high / panel.x.low) ** 0.45
    high = panel.x.low * (panel.x.high / panel.x.low) ** 0.70
    drawn: list[Point] = [p for c in curves for p in c.points if p.size is not None and p.value > 0]
    # every point, carried along the required slope, must lie above the triangle's long side
    start = min(p.value * (low / (p.size or low)) ** slope for p in drawn)
    return slope_triangle(panel, low, high, max(start / 1.9, panel.y.low * 1.3), slope, name)


def _described(title: str, curves: list[Curve]) -> str:
    said = [f"{title} against element size."]
    for curve in curves:
        points = [p for p in curve.points if p.size is not None]
        if points:
            first, last = points[0], points[-1]
            said.append(
                f"{curve.label}: {number_text(first.value)} at h = {number_text(first.size)} m to "
                f"{number_text(last.value)} at h = {number_text(last.size)} m."
            )
        said += [f"{curve.label} ended at level {level}: {how}." for level, how in curve.ends]
    return " ".join(said)
