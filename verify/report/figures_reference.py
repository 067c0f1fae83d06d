"""How exact each level of a reference is for its time, quantity by quantity."""

from collections.abc import Mapping, Sequence
from itertools import batched
from textwrap import wrap
from typing import Any, TypeGuard

from verify.report.axes import Panel, log_range, text
from verify.report.curves import Curve, Point
from verify.report.marks import curve_names, drawn_curve, style_of
from verify.report.markup import Markup, joined, tag
from verify.report.notation import is_error, number_text, seconds_text

__all__ = ["accuracy_figure"]

_COSTS = ("unknowns", "seconds")
_TOGETHER = 4  # curves of a panel: as many as there are styles


def accuracy_figure(levels: Mapping[str, Mapping[str, Any]]) -> Markup | None:
    """Return the bounds of the relative errors over the wall time, or None if nothing was timed.

    Quantities in panels of their own, before the norms of the field; all on the same axes.

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
    curves = [curve for curve in curves if curve.points]
    if not curves:
        return None
    x_range = log_range(list(times.values()))
    y_range = log_range([point.value for curve in curves for point in curve.points])
    marks = [(seconds, list(levels)[place]) for place, seconds in times.items()]
    panels = []
    for title, errors in (("of a quantity", False), ("of the field", True)):
        group = [curve for curve in curves if is_error(curve.solver) == errors]
        for shown in batched(group, _TOGETHER):
            panel = Panel(x_range, y_range, "wall time (s)", f"relative error {title}, bound")
            panels.append(_drawn(panel, shown, times, marks))
    said = (
        "Reference: bounds of its relative errors against the wall time of each level. "
        "Bounds of zero and levels that were not timed are in the table only."
    )
    return tag("figure", tag("div", panels, class_="panels"), tag("figcaption", said))


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
    panel: Panel,
    curves: Sequence[Curve],
    times: Mapping[int, float],
    marks: Sequence[tuple[float, str]],
) -> Markup:
    styles = style_of(curves)
    content, names, said = [_marked(panel, marks)], [], [f"{panel.y_title}, against time."]
    for curve in curves:
        style, first, last = styles[curve.label], curve.points[0], curve.points[-1]
        content.append(drawn_curve(panel, curve, style, lambda point: times[point.level]))
        head, *rest = wrap(curve.label, 12)
        names.append((last.value, head, " ".join(rest), style))
        said.append(
            f"{curve.label}: {number_text(first.value)} in {seconds_text(times[first.level])} to "
            f"{number_text(last.value)} in {seconds_text(times[last.level])}."
        )
    content.append(curve_names(panel, names))
    return panel.drawn(" ".join(said), *content)


def _marked(panel: Panel, marks: Sequence[tuple[float, str]]) -> Markup:
    """Draw a line at the time of each level, its name on top."""
    parts = []
    for seconds, name in marks:
        x = panel.x.at(seconds)
        tip = tag("title", f"{name}: {seconds_text(seconds)}")
        line = f"M{x:.1f} {panel.y.start}V{panel.y.end}"
        parts.append(tag("path", tip, d=line, class_="grid level"))
        parts.append(text(x, panel.y.end - 5, name, class_="note", text_anchor="middle"))
    return joined(*parts)
