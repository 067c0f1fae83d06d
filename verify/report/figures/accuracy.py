"""Bounds of the errors of a reference over the time of each level."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeGuard

from verify.report.blocks import Drawing, Figure
from verify.report.curves import Curve, Point
from verify.report.figures.convergence import draw_curve
from verify.report.figures.style import Palette, drawing, legend, log_axis, log_range, panel
from verify.report.notation import is_error, number_text, seconds_text

__all__ = ["accuracy_figure"]

_COSTS = ("unknowns", "seconds")


def accuracy_figure(levels: Mapping[str, Mapping[str, Any]]) -> Figure | None:
    """Return the bounds of the relative errors over the wall time, or None if nothing was timed.

    Quantities in a panel of their own, before the norms of the field; both on the same axes.

    Parameters
    ----------
    levels : mapping of str to record
        As the record of a reference holds it under ``time_to_accuracy``: levels in their order,
        each with ``unknowns``, ``seconds`` and bounds by metric.
    """
    times = {
        place: float(seconds)
        for place, entry in enumerate(levels.values())
        if _can_be_drawn(seconds := entry.get("seconds"))
    }
    names = dict.fromkeys(n for entry in levels.values() for n in entry if n not in _COSTS)
    curves = [_curve(name, list(levels.values()), times) for name in names]
    if not (curves := [curve for curve in curves if curve.points]):
        return None
    ranges = (log_range(list(times.values())),
              log_range([point.value for curve in curves for point in curve.points]))  # fmt: skip
    marks = [(seconds, list(levels)[place]) for place, seconds in times.items()]
    panels = []
    for title, errors in (("of a quantity", False), ("of the field", True)):
        if group := [curve for curve in curves if is_error(curve.solver) == errors]:
            panels.append(_drawn(f"relative error {title}, bound", group, times, marks, ranges))
    said = (
        "Reference: bounds of its relative errors against the wall time of each level. "
        "Bounds of zero and levels that were not timed are in the table only."
    )
    return Figure(panels, said)


def _can_be_drawn(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and 1e-200 < value < 1e200


def _curve(name: str, levels: Sequence[Mapping[str, Any]], times: Mapping[int, float]) -> Curve:
    """Return the bounds of a metric on the levels that were timed; a gap is not bridged."""
    stretches: list[list[Point]] = [[]]
    for place, entry in enumerate(levels):
        if place in times and _can_be_drawn(bound := entry.get(name)):
            stretches[-1].append(Point(place, None, entry.get("unknowns"), bound, 0.0, None))
        else:
            stretches.append([])
    label = name.replace("_", " ").replace("l2", "L²")
    return Curve(label, name, [stretch for stretch in stretches if stretch], [], None)


def _drawn(
    title: str, curves: Sequence[Curve], times: Mapping[int, float],
    marks: Sequence[tuple[float, str]], ranges: tuple[tuple[float, float], tuple[float, float]],
) -> Drawing:  # fmt: skip
    palette = Palette()
    with panel(title, width=4.7) as (figure, axes):
        log_axis(axes, "x", ranges[0])
        log_axis(axes, "y", ranges[1])
        axes.set_xlabel("wall time (s)")
        for seconds, name in marks:
            axes.axvline(seconds, color="#e4e4e4", linewidth=0.8, gid="level")
            axes.annotate(name, (seconds, ranges[1][1]), (2, -7), textcoords="offset points",
                          fontsize=7, color="#8f8f8f")  # fmt: skip
        said = [f"{title}, against time."]
        for curve in curves:
            first, last = curve.points[0], curve.points[-1]
            draw_curve(axes, curve, palette[curve.label], lambda p: times[p.level], curve.label)
            said.append(
                f"{curve.label}: {number_text(first.value)} in {seconds_text(times[first.level])} "
                f"to {number_text(last.value)} in {seconds_text(times[last.level])}."
            )
        legend(axes)
        return drawing(figure, " ".join(said))
