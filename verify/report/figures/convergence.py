"""Error against element size, unknowns and time, on logarithmic axes."""

from collections.abc import Callable, Sequence

from matplotlib.axes import Axes

from verify.report.blocks import Drawing
from verify.report.curves import Curve, Point, floor, limits
from verify.report.figures.style import Palette, Style, drawing, legend, log_axis, log_range, panel
from verify.report.notation import number_text

_BAND, _BAND_EDGE = "#e2e2e2", "#8f8f8f"

Abscissa = Callable[[Point], float | None]


def _seconds(point: Point) -> float | None:
    return point.duration.median if point.duration and point.duration.median > 0 else None


# title, unit and place of what the error is drawn over
_OVER: dict[str, tuple[str, str, Abscissa]] = {
    "size": ("element size h (m)", " m", lambda point: point.size),
    "unknowns": ("unknowns", "", lambda point: point.unknowns),
    "time": ("wall time (s), median", " s", _seconds),
}


def error_range(curves: Sequence[Curve], sloped: bool) -> tuple[float, float] | None:
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


def error_panel(
    title: str, curves: Sequence[Curve], y_range: tuple[float, float], palette: Palette,
    over: str = "size", slope: tuple[float, str] | None = None,
) -> Drawing | None:  # fmt: skip
    """Return the error over the element size, the unknowns or the wall time.

    Parameters
    ----------
    title : str
    curves : sequence of Curve
    y_range : (float, float)
    palette : Palette
    over : {"size", "unknowns", "time"}
        Over time: the median without meshing, bars that span the repetitions, and a dotted line
        to the time with meshing. Over the size: crosses where levels failed.
    slope : (order, words), optional
        The required order of convergence.

    Returns
    -------
    Drawing or None
        None if nothing tells the abscissa.
    """
    x_title, unit, abscissa = _OVER[over]
    placed = [(x, p) for c in curves for x, p in _placed(c.points, abscissa)]
    if not placed:
        return None
    ends = {c.label: _places_of_ends(c, curves) if over == "size" else [] for c in curves}
    values = [x for x, _ in placed] + [x for own in ends.values() for x, _ in own]
    if over == "time":
        times = [p.duration for _, p in placed if p.duration]
        values += [t for d in times for t in (d.low, d.high, d.median + d.meshing) if t > 0]
    with panel(title) as (figure, axes):
        log_axis(axes, "x", log_range(values))
        log_axis(axes, "y", y_range)
        axes.set_xlabel(x_title)
        uncertainty_band(axes, floor(curves, abscissa))
        if slope is not None and len(set(values)) > 1:
            _required(axes, [p for _, p in placed], *slope)
        said = [f"{title} against {x_title}."]
        for curve in curves:
            style, own = palette[curve.label], _placed(curve.points, abscissa)
            name = _named(curve) if over == "size" else curve.label
            _draw(axes, curve, style, abscissa, name)
            _abandoned(axes, curve, style, ends[curve.label])
            if over == "time":
                _spans(axes, [point for _, point in own], style)
            if own:
                at = (
                    f"{number_text(p.value)} at {number_text(x)}{unit}"
                    for x, p in (own[0], *own[1:][-1:])
                )
                said.append(f"{curve.label}: {' to '.join(at)}.")
            said += [f"{curve.label} ended at level {level}: {how}." for level, how in curve.ends]
        legend(axes)
        return drawing(figure, " ".join(said))


def _placed(points: Sequence[Point], abscissa: Abscissa) -> list[tuple[float, Point]]:
    return [(x, p) for p in points if (x := abscissa(p)) is not None and p.value > 0]


def _draw(axes: Axes, curve: Curve, style: Style, abscissa: Abscissa, label: str) -> None:
    """Draw the lines, error bars and markers of a curve; stretches are not joined."""
    for stretch in curve.stretches:
        placed = _placed(stretch, abscissa)
        if not placed:
            continue
        axes.plot([x for x, _ in placed], [p.value for _, p in placed], label=label, **style.marked)
        label = "_again"
        barred = [(x, p) for x, p in placed if limits(p)]
        if barred:
            low = axes.get_ylim()[0]
            axes.vlines(
                [x for x, _ in barred], [max(p.value - p.uncertainty, low) for _, p in barred],
                [p.value + p.uncertainty for _, p in barred], color=style.colour, linewidth=1.0,
            )  # fmt: skip


def slope_triangle(axes: Axes, low: float, high: float, y: float, slope: float, name: str) -> None:
    """Draw a triangle of `slope` over the abscissa from `low` to `high`, starting at `y`."""
    top = y * (high / low) ** slope
    axes.plot([low, high, high, low], [y, y, top, y], color="#333333", linewidth=0.8,
              scalex=False, scaley=False)  # fmt: skip
    axes.annotate(name, (high, (y * top) ** 0.5), (3, 0), textcoords="offset points", fontsize=8,
                  va="center")  # fmt: skip


def _named(curve: Curve) -> str:
    """Return the name of a curve with its observed order, or why there is none."""
    rate = curve.rate
    if rate is None:
        return curve.label
    if rate.reason or rate.order is None:
        why = rate.reason.replace("(", ":").split(":")[0].strip()[:16] or "no order"
        return f"{curve.label}\n{why}"
    plus = f" ± {rate.uncertainty:.2f}" if rate.uncertainty >= 0.005 else ""
    return f"{curve.label}\norder {rate.order:.2f}{plus}"


def uncertainty_band(axes: Axes, places: Sequence[tuple[float, float]]) -> None:
    """Draw the band below the uncertainty of the comparison, given as (x, uncertainty)."""
    low = axes.get_ylim()[0]
    if not any(u > low for _, u in places):
        return
    left, right = axes.get_xlim()
    xs = [left, *(x for x, _ in places), right]
    ys = [max(u, low) for u in (places[0][1], *(u for _, u in places), places[-1][1])]
    axes.fill_between(xs, ys, low, color=_BAND, linewidth=0, label="uncertainty of\nthe comparison")
    axes.plot(xs, ys, color=_BAND_EDGE, linewidth=0.8, linestyle=(0, (4, 2)))


def _required(axes: Axes, drawn: Sequence[Point], slope: float, name: str) -> None:
    """Place the slope below the lowest curve, over the middle of the axis."""
    x0, x1 = axes.get_xlim()
    low, high = x0 * (x1 / x0) ** 0.45, x0 * (x1 / x0) ** 0.70
    # every point, carried along the required slope, must lie above the triangle's long side
    start = min(p.value * (low / (p.size or low)) ** slope for p in drawn)
    slope_triangle(axes, low, high, max(start / 1.9, axes.get_ylim()[0] * 1.3), slope, name)


def _places_of_ends(curve: Curve, curves: Sequence[Curve]) -> list[tuple[float, float]]:
    """Return where the failed levels of `curve` would be: at the size others have there."""
    places = []
    for level, _ in curve.ends:
        nearest = min(curve.points, key=lambda p: (abs(p.level - level), p.level))
        sizes = [p.size for c in curves for p in c.points if p.level == level and p.size]
        guess = (nearest.size or 1.0) * 2.0 ** (nearest.level - level)
        places.append((sizes[0] if sizes else guess, nearest.value))
    return [(x, y) for x, y in places if y > 0]


def _abandoned(
    axes: Axes, curve: Curve, style: Style, places: Sequence[tuple[float, float]]
) -> None:
    """Draw a cross at each of `places`, where a solve failed and the curve ends."""
    for (x, y), (_, how) in zip(places, curve.ends, strict=False):
        axes.plot([x], [y], marker="x", color=style.colour, markersize=7, linestyle="none")
        axes.annotate(how, (x, y), (0, 6), textcoords="offset points", fontsize=8, ha="center",
                      color=style.colour)  # fmt: skip


def _spans(axes: Axes, points: Sequence[Point], style: Style) -> None:
    """Draw the spread of the repetitions, and the way to the time with meshing."""
    for point in points:
        if (time := point.duration) is None:
            continue
        if time.high > 1.05 * time.low > 0:
            axes.hlines(point.value, time.low, time.high, color=style.colour, linewidth=1.0)
        if time.meshing > 0:
            axes.plot([time.median, time.median + time.meshing], [point.value] * 2, marker="|",
                      markevery=[1], color=style.colour, linestyle=":", linewidth=1.0)  # fmt: skip
