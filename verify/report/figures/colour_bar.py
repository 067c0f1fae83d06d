"""Scale of the colours of a row of pictures."""

import math

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from verify.report.blocks import Drawing
from verify.report.figures.style import drawing
from verify.report.notation import RAISED
from verify.report.view import View

_LEAST = 1e-300  # below, numbers lose their digits


def colour_bar(view: View, title: str) -> Drawing:
    """Return the scale of `view`'s colours with round numbers below it."""
    high = view.limits[1]
    drawable = math.isfinite(high) and high > _LEAST
    power = math.floor(math.log10(high)) if drawable else 0
    power = 0 if -3 <= power < 4 else power
    top = high / 10.0**power if drawable else 1.0
    with rc_context({"font.size": 9}):
        figure = Figure(figsize=(4.2, 0.55))
        FigureCanvasSVG(figure)
        axes = figure.add_axes((0.06, 0.42, 0.88, 0.2))
        axes.imshow(np.linspace(0, 1, 64)[None], aspect="auto", cmap=view.colours,
                    extent=(0.0, top, 0.0, 1.0), interpolation="nearest")  # fmt: skip
        if view.beyond:  # an arrow of the last colour
            tip = [(1.0, 0.0), (1.04, 0.5), (1.0, 1.0)]
            axes.add_patch(Polygon(tip, transform=axes.transAxes, clip_on=False,
                                   color=colormaps[view.colours](1.0)))  # fmt: skip
        axes.set_yticks([])
        axes.set_xticks(_ticks(top) if drawable else [], [f"{v:.4g}" for v in _ticks(top)]
                        if drawable else [])  # fmt: skip
        unit = f"10{str(power).translate(RAISED)} m" if power else "m"
        axes.set_title(f"{title} ({unit})", fontsize=9, pad=3)
        beyond = " and above" if view.beyond else ""
        words = f"Colours: {title} from 0 to {high:.3g} m{beyond}"
        return drawing(figure, words, "colour-bar")


def _ticks(high: float) -> list[float]:
    """Return four to six round values from 0 to `high`."""
    power = 10.0 ** math.floor(math.log10(high / 4))
    step = next(m * power for m in (1, 2, 2.5, 5, 10) if high / (m * power) <= 5.5)
    return [i * step for i in range(int(high / step * (1 + 1e-9)) + 1)]
