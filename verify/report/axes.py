"""Log–log axes as SVG.

Drawn here rather than by a plotting library: a report has hundreds of panels, and as plain SVG
each is 4 kB of text in the page's own typeface, has a tip on every point, and is the same at
every rendering.
"""

import math
from dataclasses import dataclass

from verify.report.markup import Markup, joined, tag

__all__ = ["HEIGHT", "WIDTH", "Axis", "Panel", "log_range", "text"]

WIDTH, HEIGHT = 372, 268
_MOST = 300.0  # powers of ten that a number holds, with room for a tick beyond
_LEFT, _RIGHT, _TOP, _BOTTOM = 46, 106, 34, 40


def log_range(values: list[float], room: float = 0.08) -> tuple[float, float]:
    """Return a range around positive `values`, at least a factor of two wide."""
    low, high = math.log10(min(values)), math.log10(max(values))
    widen = max(room * (high - low), (math.log10(2) - (high - low)) / 2, 0.04)
    return 10 ** max(low - widen, -_MOST), 10 ** min(high + widen, _MOST)


@dataclass(frozen=True)
class Axis:
    """A logarithmic axis from value `low` at pixel `start` to value `high` at pixel `end`."""

    low: float
    high: float
    start: float
    end: float

    def at(self, value: float) -> float:
        """Return the pixel of `value`; values beyond the ends are drawn at the ends."""
        share = math.log(max(value, self.low) / self.low) / math.log(self.high / self.low)
        return self.start + min(share, 1.0) * (self.end - self.start)

    def ticks(self) -> tuple[list[float], list[float]]:
        """Return the values of labelled and of unlabelled ticks."""
        first, last = math.floor(math.log10(self.low)), math.ceil(math.log10(self.high))
        decades = [d for d in range(first, last + 1) if self._has(10.0**d)]
        if len(decades) >= 2:
            step = -(-len(decades) // 6)
            labelled = [10.0**d for d in decades if d % step == 0]
            fine = [m * 10.0**d for d in range(first, last + 1) for m in range(1, 10)]
            fine = fine if len(decades) <= 7 else [10.0**d for d in decades]
            return labelled, [v for v in fine if self._has(v)]
        for mantissas in ([1, 2, 5], [1, 2, 3, 4, 6, 8], range(1, 10)):
            labelled = [m * 10.0**d for d in range(first, last + 1) for m in mantissas]
            labelled = [v for v in labelled if self._has(v)]
            if len(labelled) >= 2:
                break
        fine = [m * 10.0**d for d in range(first, last + 1) for m in range(1, 10)]
        return labelled, [v for v in fine if self._has(v)]

    def _has(self, value: float) -> bool:
        return self.low * (1 - 1e-9) <= value <= self.high * (1 + 1e-9)


class Panel:
    """The frame of one figure; the caller draws into it between the axes.

    Parameters
    ----------
    x_range, y_range : (float, float)
    x_title, y_title : str
        `y_title` stands on top, where it can be read without turning one's head.
    """

    def __init__(
        self,
        x_range: tuple[float, float],
        y_range: tuple[float, float],
        x_title: str,
        y_title: str,
    ) -> None:
        self.x = Axis(*x_range, _LEFT, WIDTH - _RIGHT)
        self.y = Axis(*y_range, HEIGHT - _BOTTOM, _TOP)
        self.x_title, self.y_title = x_title, y_title

    @property
    def gutter(self) -> float:
        """Pixel right of the axes where the curves' names begin."""
        return self.x.end + 14

    def drawn(self, label: str, *content: Markup) -> Markup:
        """Return the whole figure; `label` is its alternative text."""
        return tag(
            "svg",
            tag("title", label),
            self._grid(),
            *content,
            self._frame(),
            viewBox=f"0 0 {WIDTH} {HEIGHT}",
            class_="panel",
            role="img",
            aria_label=label,
        )

    def _grid(self) -> Markup:
        lines = [
            tag("path", d=f"M{self.x.start} {self.y.at(v):.1f}H{self.x.end}", class_="grid")
            for v in self.y.ticks()[0]
        ]
        return joined(*lines)

    def _frame(self) -> Markup:
        x0, x1, y0, y1 = self.x.start, self.x.end, self.y.start, self.y.end
        labelled_x, fine_x = self.x.ticks()
        labelled_y, fine_y = self.y.ticks()
        marks = [f"M{x0} {y1}V{y0}H{x1}"]
        marks += [f"M{self.x.at(v):.1f} {y0}v3" for v in fine_x]
        marks += [f"M{self.x.at(v):.1f} {y0}v5" for v in labelled_x]
        marks += [f"M{x0} {self.y.at(v):.1f}h-3" for v in fine_y]
        marks += [f"M{x0} {self.y.at(v):.1f}h-5" for v in labelled_y]
        as_powers = [any(not 0.009 < v < 9999 for v in ticks) for ticks in (labelled_x, labelled_y)]
        labels = [_tick(v, self.x.at(v), y0 + 17, "middle", as_powers[0]) for v in labelled_x]
        labels += [_tick(v, x0 - 8, self.y.at(v) + 4, "end", as_powers[1]) for v in labelled_y]
        titles = [
            text((x0 + x1) / 2, y0 + 34, self.x_title, class_="axis", text_anchor="middle"),
            text(2, 12, self.y_title, class_="axis"),
        ]
        return joined(tag("path", d="".join(marks), class_="frame"), *labels, *titles)


def text(x: float, y: float, *content: str, **attributes: str) -> Markup:
    """Return a text at a pixel."""
    return tag("text", *content, x=f"{x:.1f}", y=f"{y:.1f}", **attributes)


def _tick(value: float, x: float, y: float, anchor: str, as_power: bool) -> Markup:
    exponent = math.floor(math.log10(value) + 1e-9)
    mantissa = round(value / 10.0**exponent)
    if not as_power:
        return text(x, y, f"{value:.{max(-exponent, 0)}f}", text_anchor=anchor)
    power = tag("tspan", str(exponent).replace("-", "−"), class_="power", dy="-5")
    return text(x, y, "10" if mantissa == 1 else f"{mantissa}·10", power, text_anchor=anchor)
