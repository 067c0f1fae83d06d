"""Curves over time or arc length on linear axes."""

import math
from collections.abc import Sequence

from verify.report.blocks import Drawing
from verify.report.figures.style import Palette, Style, drawing, legend, panel, plain_axis

_DRAWABLE = 1e200  # what is larger, or no number, leaves a gap
_PARTS = tuple(
    Style(colour, "", dashes=dashes)
    for colour, dashes in (("#c04a00", "-"), ("#0067a5", (0, (5, 2))), ("#00785a", (0, (2, 1.5))),
                           ("#4d4d4d", (0, (8, 2, 2, 2))), ("#7a3e9d", (0, (1, 2))),
                           ("#8a6a00", (0, (3, 1, 1, 1))))
)  # fmt: skip


def profile_panel(
    title: str,
    along: Sequence[float],
    curves: Sequence[tuple[str, Sequence[float]]],
    palette: Palette | None = None,
    marks: Sequence[float] = (),
    x_title: str = "time, s",
    band: tuple[Sequence[float], Sequence[float]] | None = None,
) -> Drawing:
    """Return a figure of several curves over a common abscissa.

    Parameters
    ----------
    title : str
        Quantity and unit; stands on top.
    along : sequence of float
        Ascending.
    curves : sequence of (name, values)
    palette : Palette, optional
        Where curves are solvers; else they have colours of their own.
    marks : sequence of float
        Instants to be marked by a vertical line.
    x_title : str
    band : (values, values), optional
        Lower and upper edge of a grey band below the curves.
    """
    drawn = [curve for _, curve in curves] + list(band or ())
    values = [v for curve in drawn for v in curve if abs(v) < _DRAWABLE]
    low, high = min([0.0, *values]), max([*values, 0.0])
    room = 0.06 * (high - low) or 1.0
    with panel(title) as (figure, axes):
        length = (along[-1] - along[0]) or 1.0
        plain_axis(axes, "x", (along[0], along[0] + length))
        plain_axis(axes, "y", (low - room, high + room))
        axes.set_xlabel(x_title)
        if band is not None:
            axes.fill_between(along, _gaps(band[0]), _gaps(band[1]), color="#d9d9d9", linewidth=0,
                              label="uncertainty")  # fmt: skip
        for mark in marks:
            axes.axvline(mark, color="#8f8f8f", linewidth=0.8, linestyle=(0, (4, 2)))
        for k, (name, curve) in enumerate(curves):
            style = _PARTS[k % len(_PARTS)] if palette is None else palette[name]
            axes.plot(along, _gaps(curve), color=style.colour, linestyle=style.dashes, label=name)
        legend(axes)
        ends = "; ".join(f"{name}: {curve[0]:.4g} to {curve[-1]:.4g}" for name, curve in curves)
        cuts = f" A cut opens at {', '.join(f'{m:.3g} s' for m in marks)}." if marks else ""
        return drawing(figure, f"{title} over {x_title}, {length:.3g}. {ends}.{cuts}", "profile")


def _gaps(curve: Sequence[float]) -> list[float]:
    return [v if abs(v) < _DRAWABLE else math.nan for v in curve]
