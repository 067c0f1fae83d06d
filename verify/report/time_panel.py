"""Curves over time on linear axes, as SVG."""

import math
from collections.abc import Sequence

from verify.report.axes import HEIGHT, WIDTH, text
from verify.report.markup import Markup, tag

__all__ = ["time_panel"]

_LEFT, _RIGHT, _TOP, _BOTTOM = 52, 96, 34, 40
_COLOURS = ("#c04a00", "#0067a5", "#00785a", "#4d4d4d", "#7a3e9d")
_DASHES = (None, "6 3", "2 2", "8 2 2 2", "1 4")

_DRAWABLE = 1e200  # what is larger, or no number, leaves a gap


def time_panel(
    title: str,
    time: Sequence[float],
    curves: Sequence[tuple[str, Sequence[float]]],
    marks: Sequence[float] = (),
    x_title: str = "time, s",
    band: tuple[Sequence[float], Sequence[float]] | None = None,
) -> Markup:
    """Return a figure of several curves over a common time.

    Parameters
    ----------
    title : str
        Quantity and unit; stands on top.
    time : sequence of float
        In s, ascending.
    curves : sequence of (name, values)
        At most five; they differ in dashes as well as in colour.
    marks : sequence of float
        Instants to be marked by a vertical line.
    x_title : str
        What the curves are drawn over, if not time.
    band : (values, values), optional
        Lower and upper edge of a grey band below the curves.
    """
    drawn = [curve for _, curve in curves] + list(band or ())
    values = [v for curve in drawn for v in curve if abs(v) < _DRAWABLE]
    low, high = min([0.0, *values]), max([*values, 0.0])
    room = 0.04 * (high - low) or 1.0
    low, high = low - room, high + room
    x0, x1, y0, y1 = _LEFT, WIDTH - _RIGHT, HEIGHT - _BOTTOM, _TOP
    length = (time[-1] - time[0]) or 1.0

    def x(t: float) -> float:
        return x0 + (t - time[0]) / length * (x1 - x0)

    def y(v: float) -> float:
        return y0 + (v - low) / (high - low) * (y1 - y0)

    parts: list[Markup] = []
    for tick in _ticks(low, high):
        parts.append(tag("path", d=f"M{x0} {y(tick):.1f}H{x1}", class_="grid"))
        label = f"{tick:g}".replace("-", "−")
        parts.append(text(x0 - 6, y(tick) + 4, label, text_anchor="end"))
    for tick in _ticks(time[0], time[-1]):
        parts.append(tag("path", d=f"M{x(tick):.1f} {y0}v4", class_="frame"))
        parts.append(text(x(tick), y0 + 17, f"{tick:g}", text_anchor="middle"))
    if band is not None:
        low_edge, high_edge = (
            [(x(t), y(v)) for t, v in zip(time, edge, strict=True) if math.isfinite(v)]
            for edge in band
        )
        around = "L".join(f"{a:.1f} {b:.1f}" for a, b in [*low_edge, *reversed(high_edge)])
        parts.append(tag("path", tag("title", "uncertainty"), d=f"M{around}Z", class_="floor"))
    for mark in marks:
        line = f"M{x(mark):.1f} {y0}V{y1}"
        parts.append(tag("path", tag("title", f"cut at {mark:.3g} s"), d=line, class_="floor-edge"))
    for (name, curve), colour, dash in zip(curves, _COLOURS, _DASHES, strict=False):
        known = [(x(t), y(v)) for t, v in zip(time, curve, strict=True) if abs(v) < _DRAWABLE]
        nodes = "L".join(f"{a:.1f} {b:.1f}" for a, b in known)
        parts.append(
            tag("path", tag("title", name), d=f"M{nodes}", class_="curve", stroke=colour,
                stroke_dasharray=dash)
        )  # fmt: skip
    for row, ((name, _), colour, dash) in enumerate(zip(curves, _COLOURS, _DASHES, strict=False)):
        at = _TOP + 14 + 20 * row
        sample = f"M{x1 + 8} {at - 4}h18"
        parts.append(tag("path", d=sample, class_="curve", stroke=colour, stroke_dasharray=dash))
        parts.append(text(x1 + 30, at, name, class_="note", fill=colour))
    parts.append(tag("path", d=f"M{x0} {y1}V{y0}H{x1}", class_="frame"))
    parts.append(text((x0 + x1) / 2, y0 + 34, x_title, class_="axis", text_anchor="middle"))
    parts.append(text(2, 12, title, class_="axis"))
    ends = "; ".join(f"{name}: {curve[0]:.4g} to {curve[-1]:.4g}" for name, curve in curves)
    label = f"{title} over {x_title}, {length:.3g}. {ends}"
    return tag(
        "svg", tag("title", label), *parts, viewBox=f"0 0 {WIDTH} {HEIGHT}", class_="time",
        role="img", aria_label=label,
    )  # fmt: skip


def _ticks(low: float, high: float) -> list[float]:
    """Return four to eight round numbers."""
    rough = (high - low) / 5.0 or 1.0
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= rough)
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]
