"""A colour bar as SVG, in the page's typeface."""

import math

from matplotlib import colormaps
from matplotlib.colors import to_hex

from verify.report.axes import text
from verify.report.markup import Markup, tag
from verify.report.view import View

__all__ = ["colour_bar"]

_LEAST = 1e-300  # below, numbers lose their digits
_WIDTH, _BAR, _SIDE, _STRIPES = 300, 9, 26, 60


def colour_bar(view: View, title: str) -> Markup:
    """Return the scale of `view`'s colours with round numbers below it."""
    low, high = view.limits
    colours = colormaps[view.colours]
    inside = _WIDTH - 2 * _SIDE
    stripes = [
        tag(
            "rect",
            x=f"{_SIDE + inside * i / _STRIPES:.2f}",
            y=16,
            width=f"{inside / _STRIPES + 0.4:.2f}",
            height=_BAR,
            fill=to_hex(colours((i + 0.5) / _STRIPES)),
        )
        for i in range(_STRIPES)
    ]
    drawable = math.isfinite(high) and high > _LEAST
    power = math.floor(math.log10(high)) if drawable else 0
    shown = 0 if -3 <= power < 4 else power
    unit = f"{title} (m)" if not shown else f"{title} ("
    head = [unit]
    parts = []
    if shown:
        exponent = tag("tspan", str(shown).replace("-", "−"), class_="power", dy="-5")
        parts = [exponent, tag("tspan", " m)", dy="5")]
        head = [f"{title} (10"]
    ticks = []
    for value in _ticks(high) if drawable else []:
        x = _SIDE + inside * (value - low) / (high - low)
        label = f"{value / 10.0**shown:.4g}"
        ticks.append(text(x, 16 + _BAR + 16, label, text_anchor="middle"))
        ticks.append(tag("path", d=f"M{x:.1f} {16 + _BAR}v4", class_="frame"))
    return tag(
        "svg",
        tag("title", f"Colours: {title} from 0 to {high:.3g} m"),
        *stripes,
        *ticks,
        text(_WIDTH / 2, 11, *head, *parts, class_="axis", text_anchor="middle"),
        viewBox=f"0 0 {_WIDTH} {16 + _BAR + 22}",
        class_="colour-bar",
        role="img",
    )


def _ticks(high: float) -> list[float]:
    """Return four to six round values from 0 to `high`."""
    power = 10.0 ** math.floor(math.log10(high / 4))
    step = next(m * power for m in (1, 2, 2.5, 5, 10) if high / (m * power) <= 5.5)
    return [i * step for i in range(int(high / step * (1 + 1e-9)) + 1)]
