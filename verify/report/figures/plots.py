"""Curves on linear or logarithmic axes, scattered marks, and bars of a budget."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import Any

from matplotlib.axes import Axes

from verify.report.blocks import Drawing
from verify.report.figures.style import (
    Palette,
    Style,
    drawing,
    legend,
    log_axis,
    log_range,
    panel,
    plain_axis,
)

_TOTAL, _PART = "#4d4d4d", "#0067a5"
_DRAWABLE = 1e200  # what is larger, or no number, leaves a gap


@dataclass(frozen=True)
class Series:
    """A curve, whose places that cannot be drawn are gaps.

    `second` stands below its name; `ringed` are those of its places that stand out.
    """

    name: str
    places: Sequence[tuple[Any, Any]]
    second: str = ""
    ringed: Sequence[tuple[float, float]] = ()


@dataclass(frozen=True)
class Bar:
    """A part of a whole with the half-width of its interval, and what is written beside it."""

    name: str
    value: float
    half: float
    written: str
    total: bool = False


def loglog(title: str, x_title: str, series: Sequence[Series], palette: Palette) -> Drawing | None:
    """Return curves on logarithmic axes, or None if there is nothing positive."""
    drawn = [(s, [place for place in s.places if _can_be_drawn(place)]) for s in series]
    drawn = [(s, places) for s, places in drawn if places]
    if not drawn:
        return None
    with panel(title) as (figure, axes):
        _logarithmic(axes, x_title, [place for _, places in drawn for place in places])
        said = [f"{title} against {x_title}."]
        for s, places in drawn:
            style = palette[s.name]
            gaps = [place if _can_be_drawn(place) else (math.nan, math.nan) for place in s.places]
            label = f"{s.name}\n{s.second}".strip()
            axes.plot(*zip(*gaps, strict=True), label=label, **style.marked)
            if s.ringed:
                axes.plot(*zip(*s.ringed, strict=True), color=style.colour, marker="o",
                          markersize=11, markerfacecolor="none", linestyle="none")  # fmt: skip
            said.append(f"{s.name}: " + ", ".join(f"{y:.3g} at {x:.3g}" for x, y in places) + ".")
        legend(axes)
        return drawing(figure, " ".join(said))


def scatter(
    title: str, x_title: str, marks: Sequence[tuple[str, float, float, bool]],
    factors: Sequence[float], palette: Palette, said: str,
) -> Drawing:  # fmt: skip
    """Return marks (name, x, y, filled) and the lines y = factor · x on logarithmic axes."""
    with panel(title, width=5.2, height=3.4) as (figure, axes):
        _logarithmic(axes, x_title, [(x, y) for _, x, y, _ in marks])
        (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        for factor in factors:
            low, high = max(left, bottom / factor), min(right, top / factor)
            if low < high:
                axes.plot([low, high], [factor * low, factor * high], color="#333", linewidth=0.8)
                axes.annotate(f"{factor:g}", (high, factor * high), (-7, -2), ha="right",
                              va="top", textcoords="offset points", fontsize=8)  # fmt: skip
        for name in dict.fromkeys(name for name, *_ in marks):
            style, label = palette[name], name
            for filled in (True, False):
                own = [(x, y) for n, x, y, full in marks if n == name and full == filled]
                if own:
                    axes.plot(*zip(*own, strict=True), color=style.colour, marker=style.marker,
                              markerfacecolor=style.colour if filled else "white", markersize=4,
                              linestyle="none", label=label)  # fmt: skip
                    label = "_named already"
        legend(axes)
        return drawing(figure, said)


def bars(title: str, parts: Sequence[Bar], said: str) -> Drawing:
    """Return horizontal bars with their intervals, the first on top."""
    with panel(title, height=0.5 + 0.3 * len(parts)) as (figure, axes):
        width, height = figure.get_size_inches()
        axes.set_position((1.75 / width, 0.05 / height, 1.9 / width, (height - 0.37) / height))
        axes.set_title(title, loc="left", x=-1.7 / 1.9, fontsize=9)
        rows = range(len(parts))
        axes.barh(rows, [p.value for p in parts], xerr=[p.half for p in parts], height=0.6,
                  color=[_TOTAL if p.total else _PART for p in parts],
                  error_kw={"elinewidth": 1.0, "capsize": 3})  # fmt: skip
        axes.axvline(0.0, color="#333", linewidth=0.8)
        axes.set_yticks(rows, ["\n".join(wrap(p.name, 26)) for p in parts], fontsize=8)
        axes.set_xticks([])
        axes.grid(False)
        axes.invert_yaxis()
        axes.spines[:].set_visible(False)
        axes.tick_params(length=0)
        for row, part in enumerate(parts):
            axes.annotate(part.written, (max(part.value + part.half, 0.0), row), (5, 0),
                          textcoords="offset points", va="center", fontsize=8,
                          annotation_clip=False)  # fmt: skip
        return drawing(figure, said)


def _can_be_drawn(place: tuple[Any, Any]) -> bool:
    return all(isinstance(v, int | float) and 1 / _DRAWABLE < v < _DRAWABLE for v in place)


def _logarithmic(axes: Axes, x_title: str, places: Sequence[tuple[float, float]]) -> None:
    log_axis(axes, "x", log_range([x for x, _ in places]))
    log_axis(axes, "y", log_range([y for _, y in places]))
    axes.set_xlabel(x_title)


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
