"""Errors of all solvers in one figure: over element size, unknowns, time; the first screen."""

from collections.abc import Callable, Sequence
from functools import partial

from matplotlib.axes import Axes

from verify.report.answers import Answer, compared_curves, energy_curve, moving, sliver_curves
from verify.report.curves import Curve, Point, floor, limits
from verify.report.notation import ROUND_OFF, Drawing, number_text, solver_title
from verify.report.plots import (
    Palette,
    Style,
    drawing,
    legend,
    log_axis,
    log_range,
    panel,
    plain_axis,
)
from verify.result import CaseResult

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
        Over time: the median of what a cut costs anew, and bars that span the repetitions. Over the
        size: crosses where levels failed.
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
        values += [t for d in times for t in (d.low, d.high) if t > 0]
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
    """Draw the spread of the repetitions."""
    for point in points:
        if (time := point.duration) and time.high > 1.05 * time.low > 0:
            axes.hlines(point.value, time.low, time.high, color=style.colour, linewidth=1.0)


_small = partial(panel, width=3.35, height=2.4, legend=False)
_ACROSS = 6  # solvers in a row of the legend
_FAINT = 0.3  # opacity of the cases beside the one that is drawn whole
_LEAST = 1e-16  # of a relative change of the energy: below is nothing

Places = list[tuple[float, float]]


def answer_panels(
    results: Sequence[CaseResult], answers: Sequence[Answer], palette: Palette
) -> list[Drawing | None]:
    """Return the panel of each answer; None where the run has nothing to draw."""
    of_error, _, _, of_time = answers
    return [
        _errors(results, of_error.example, palette, over_time=False),
        _energies(results, palette),
        _slivers(results, palette),
        _errors(results, of_time.example, palette, over_time=True),
    ]


def key(names: Sequence[str], palette: Palette) -> Drawing:
    """Return one legend for all panels."""
    across = min(len(names), _ACROSS)
    with panel("", 1.45 * across, 0.25, legend=False) as (figure, axes):
        axes.set_axis_off()
        axes.set_position((0.0, 0.0, 1.0, 1.0))
        handles = [
            axes.plot([], [], label=name, linestyle=palette[name].dashes, **palette[name].marked)[0]
            for name in names
        ]
        rows = -(-len(handles) // across)
        figure.set_figheight(0.22 * rows + 0.03)
        axes.legend(handles=handles, loc="upper left", frameon=False, ncols=across, fontsize=9,
                    borderaxespad=0.0, bbox_to_anchor=(0.0, 1.0), columnspacing=1.4)  # fmt: skip
        return drawing(figure, f"Solvers: {', '.join(names)}.", "key")


def _errors(
    results: Sequence[CaseResult], example: str, palette: Palette, over_time: bool
) -> Drawing | None:
    """Draw the error of one case over h or time, all others faintly below it."""
    at = _OVER["time" if over_time else "size"][2]

    def told(curve: Curve) -> list[tuple[float, Point]]:
        return [(x, p) for x, p in _placed(curve.points, at)
                if p.value > max(p.uncertainty, ROUND_OFF)]  # fmt: skip

    drawn = {r.case: [(c, own) for c in compared_curves(r) if (own := told(c))] for r in results}
    if not drawn.get(example):
        return None
    every = [(x, p.value) for own in drawn.values() for _, places in own for x, p in places]
    own = [place for _, places in drawn[example] for place in places]
    title = "time of a cut, s" if over_time else "element size h, m"
    with _small("relative L² error of the displacement") as (figure, axes):
        # room for the band below errors whose half-width is wide enough for one
        bars = [(x, p.uncertainty / 1.5) for x, p in own if limits(p)]
        _log_axes(axes, title, every, [*((x, p.value) for x, p in own), *bars])
        if not over_time:
            uncertainty_band(axes, floor([curve for curve, _ in drawn[example]], at))
        for case, curves in drawn.items():
            for curve, places in curves:
                style = palette[curve.label]
                look = style.marked if case == example else {"color": style.colour, "alpha": _FAINT}
                axes.plot([x for x, _ in places], [p.value for _, p in places],
                          linewidth=1.5 if case == example else 0.8, linestyle=style.dashes,
                          zorder=3 if case == example else 1, **look)  # fmt: skip
        said = "; ".join(
            f"{curve.label}: {number_text(first.value)} at {number_text(x)} to "
            f"{number_text(last.value)} at {number_text(y)}"
            for curve, places in drawn[example]
            for (x, first), (y, last) in [(places[0], places[-1])]
        )
        return drawing(figure, f"Error of the displacement over {title}, {example}. {said}.")


def _energies(results: Sequence[CaseResult], palette: Palette) -> Drawing | None:
    """Draw the relative change of the total energy over the time of every case in motion."""
    curves = [(solve.solver, p) for _, solve in moving(results) if (p := energy_curve(solve))]
    curves = [(s, [(x, max(y, _LEAST)) for x, y in places]) for s, places in curves]
    if not curves:
        return None
    every = [place for _, places in curves for place in places]
    with _small("relative change of the total energy") as (figure, axes):
        log_axis(axes, "y", log_range([y for _, y in every]))
        plain_axis(axes, "x", (0.0, 1.0))
        axes.set_xlabel("time over duration")
        for name, places in curves:
            style = palette[solver_title(name)]
            axes.plot(*zip(*places, strict=True), color=style.colour, linestyle=style.dashes,
                      linewidth=1.0)  # fmt: skip
        worst = {name: max(y for n, p in curves if n == name for _, y in p) for name, _ in curves}
        said = "; ".join(f"{solver_title(n)}: at most {number_text(y)}" for n, y in worst.items())
        return drawing(figure, f"Relative change of the total energy over time. {said}.")


def _slivers(results: Sequence[CaseResult], palette: Palette) -> Drawing | None:
    """Draw error and critical step over ε, as shares of those at the largest ε."""
    curves = sliver_curves(results)
    if not curves:
        return None
    every = [place for curve in curves for place in curve.places]
    with _small("over that at the largest ε") as (figure, axes):
        _log_axes(axes, "ε, in elements", every, every)
        for curve in curves:
            style = palette[solver_title(curve.solver)]
            dashes = "-" if curve.measure == "error" else ":"
            axes.plot(*zip(*curve.places, strict=True), linestyle=dashes, **style.marked)
        drawn = {curve.measure for curve in curves}
        handles = [
            axes.plot([], [], color="#333", linestyle=dashes, label=measure)[0]
            for measure, dashes in (("error", "-"), ("critical step", ":"))
            if measure in drawn
        ]
        axes.legend(handles=handles, frameon=False, fontsize=8, loc="best")
        said = "; ".join(
            f"{solver_title(c.solver)}, {c.family}, {c.measure}: {number_text(c.places[-1][1])} "
            f"at ε = {number_text(c.places[-1][0])}" for c in curves
        )  # fmt: skip
        return drawing(figure, f"Error and critical step over ε. {said}.")


def _log_axes(axes: Axes, title: str, across: Places, up: Places) -> None:
    log_axis(axes, "x", log_range([x for x, _ in across]))
    log_axis(axes, "y", log_range([y for _, y in [*across, *up]]))
    axes.set_xlabel(title)
