"""The look of all figures (styles of solvers, axes, SVG that a page can hold) and its plots."""

import io
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from textwrap import wrap
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullLocator
from matplotlib.transforms import Bbox

from verify.report.notation import RAISED, Drawing, printable

_MOST = 300.0  # powers of ten that a number holds, with room for a tick beyond
_GRID = "#e4e4e4"
_MARGIN = 0.02  # inches around what lies beyond a figure
_LETTERS = 23  # in a line of a name
_LEFT, _ASIDE = 0.52, 2.0  # inches left of the axes, and with those right of them for a legend
_RC = {
    "svg.fonttype": "none", "svg.hashsalt": "report", "text.parse_math": False, "font.size": 9,
    "axes.linewidth": 0.7, "axes.spines.top": False, "axes.spines.right": False,
    "axes.axisbelow": True, "lines.linewidth": 1.3, "lines.markersize": 5.5,
    "lines.markeredgewidth": 1.1, "axes.unicode_minus": True, "path.simplify_threshold": 0.2,
}  # fmt: skip


@dataclass(frozen=True)
class Style:
    """Colour, marker and dashes of a solver; a hollow marker shows what lies below it."""

    colour: str
    marker: str
    hollow: bool = False
    dashes: str | tuple[int, tuple[float, ...]] = "-"

    @property
    def marked(self) -> dict[str, Any]:
        """What matplotlib draws a curve of the solver with, apart from its dashes."""
        face = "white" if self.hollow else self.colour
        return {"color": self.colour, "marker": self.marker, "markerfacecolor": face}


# 16 colours, 11 markers, 13 dashes: without a common factor, so that no pair of colour and marker
# comes twice in 176 slots, nor one of colour and dashes
_COLOURS = (
    "#00785a", "#a3487b", "#8a6a00", "#5b4db5", "#1b8fb8", "#b0003a", "#4a7c00", "#7a3b00",
    "#d0378f", "#1f2f6f", "#111111", "#00a0a0", "#777777", "#d4a000", "#b487ff", "#00a832",
)  # fmt: skip
_MARKERS = "^PvXphd*8HD"
_DASHES = (
    (7, 2, 1.5, 2), (3, 1.5), (2, 2), (9, 3), (4, 1.5, 1, 1.5, 1, 1.5), (6, 1.5), (1, 3),
    (8, 2, 2, 2), (3, 3), (5, 1, 1, 1), (12, 2), (10, 1.5, 1, 1.5), (2, 4),
)  # fmt: skip


def _style(slot: int) -> Style:
    hollow = bool((slot + slot // len(_COLOURS)) % 2)
    dashes = (0, _DASHES[slot % len(_DASHES)])
    return Style(_COLOURS[slot % len(_COLOURS)], _MARKERS[slot % len(_MARKERS)], hollow, dashes)


# the solvers of the protocol, in an order in which no two of one figure share a colour
_SLOTS = (
    "mass_spring", "snapping", "removal", "virtual_node", "uncut", "conforming P1 mesh=remeshed",
    "subdivision", "snapping_subdivision", "getfem", "ngsxfem", "SOFA", "XFEM tip=inside",
    "kratos", "akantu", "getfem tip=functions", "vbd", "virtual_node_arbitrary weights=raised",
    "XFEM mass=consistent", "XFEM mass=evs", "XFEM mass=gevs", "XFEM slivers=merge",
    "XFEM slivers=penalise",
)  # fmt: skip
_KNOWN = {
    "XFEM": Style("#c04a00", "o"),
    "conforming P1": Style("#0067a5", "s", True, (0, (5, 2))),
    "reference": Style("#4d4d4d", "D", True, (0, (1, 1.5))),
    "exact": Style("#4d4d4d", "D", True, (0, (1, 1.5))),
    **{name: _style(slot) for slot, name in enumerate(_SLOTS)},
}
_BESIDE_NAME = re.compile(r" \(= .*|[*†]+$")  # programs that agree, marks of a note


class Palette(dict[str, Style]):
    """Styles by label: of a known solver the same everywhere, of others in order, none twice."""

    @classmethod
    def of(cls, labels: Iterable[str]) -> "Palette":
        """Return a palette in which `labels` have their styles already, in this order."""
        palette = cls()
        for label in labels:
            palette[label]
        return palette

    def __missing__(self, label: str) -> Style:
        known = _KNOWN.get(_BESIDE_NAME.sub("", label))
        others = sum(name not in _KNOWN for name in self)
        self[label] = known or _style(len(_SLOTS) + others)
        return self[label]


@contextmanager
def panel(
    title: str, width: float = 4.5, height: float = 2.75, legend: bool = True
) -> Iterator[tuple[Figure, Axes]]:
    """Give a figure of one panel in the style of the report, sizes in inches; its title on top.

    The axes leave room on the right for a `legend`.
    """
    aside = _ASIDE if legend else _LEFT + 0.1
    across = width - aside
    with rc_context(_RC):  # type: ignore[arg-type]
        figure = Figure(figsize=(width, height))
        FigureCanvasSVG(figure)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        _place(axes, aside)
        axes.set_title(printable(title), loc="left", x=-0.42 / across, fontsize=9, pad=9)
        axes.grid(True, axis="y", color=_GRID, linewidth=0.7)
        yield figure, axes


def _place(axes: Axes, aside: float = _ASIDE) -> None:
    """Leave room for the labels of the axes and, on the right, for a legend."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    width, height = figure.get_size_inches()
    axes.set_position((_LEFT / width, 0.48 / height, (width - aside) / width,
                       (height - 0.78) / height))  # fmt: skip


def drawing(figure: Figure, alt: str, kind: str = "panel") -> Drawing:
    """Return a figure as SVG, without what only a file of its own needs.

    It is as wide and high as the figure, or more where a name would be cut off.
    """
    buffer = io.StringIO()
    with rc_context(_RC):  # type: ignore[arg-type]
        none = dict.fromkeys(("Date", "Creator", "Format", "Type"))
        whole = Bbox.union([figure.bbox_inches, figure.get_tightbbox().padded(_MARGIN)])
        figure.savefig(buffer, format="svg", transparent=True, metadata=none, bbox_inches=whole)
    text = buffer.getvalue()
    body = text[text.index(">", text.index("<svg")) + 1 : text.rindex("</svg>")]
    body = re.sub(
        r"<metadata>.*?</metadata>|<style.*?</style>|<!--.*?-->", "", body, flags=re.DOTALL
    )
    used = set(re.findall(r'(?:href="#|url\(#)([^")]+)', body))
    body = re.sub(r' id="([^"]*)"', lambda m: m[0] if m[1] in used else "", body)
    # the page's own typeface
    body = re.sub(r'(<text style="[^"]*?)font-family: [^;"]*(?:; )?', r"\1", body)
    # places to a hundredth of a point; only in paths, never in text
    body = re.sub(r' d="[^"]*"', lambda m: re.sub(r"(\.\d\d)\d+", r"\1", m[0]), body)
    body = re.sub(r">\s+<", "><", re.sub(r"\s*\n\s*", " ", body)).strip()
    return Drawing(body, (72.0 * whole.width, 72.0 * whole.height), alt, kind)


def _lines(label: str) -> list[str]:
    return [s for line in printable(label).split("\n") for s in wrap(line, _LETTERS) or [""]]


def legend(axes: Axes) -> None:
    """Name the curves right of the axes, long names in several lines; many make room for all."""
    handles, found = axes.get_legend_handles_labels()
    labels = ["\n".join(_lines(label)) for label in found]
    if not handles:
        return
    axes.legend(handles, labels, loc="upper left", bbox_to_anchor=(1.0, 1.04), frameon=False,
                fontsize=8, handlelength=2.1, borderaxespad=0.4, labelspacing=0.45,
                handletextpad=0.5)  # fmt: skip
    lines = sum(label.count("\n") + 1 for label in labels)
    needed = (9.8 * lines + 3.6 * len(labels)) / 72 + 0.45  # inches
    figure = axes.get_figure(root=True)
    if figure is not None and needed > figure.get_figheight():
        figure.set_figheight(needed)
        _place(axes)


_FEW = 6  # curves that are named at their ends
_NAMES = 2.3  # as `_ASIDE`, for 23 letters without the samples of a legend
_LINE, _GAP = 9.8, 3.6  # points that a line of a name takes, and a name beyond its lines


def _named(axes: Axes) -> None:
    """Name the curves at their ends, or in a legend if they are many or an area is among them."""
    handles, labels = axes.get_legend_handles_labels()
    curves = [(handle, label) for handle, label in zip(handles, labels, strict=True)
              if isinstance(handle, Line2D)]  # fmt: skip
    if len(curves) < len(handles) or len(curves) > _FEW:
        legend(axes)
        return
    names = [_lines(label) for _, label in curves]
    figure = axes.get_figure(root=True)
    assert figure is not None
    needed = sum(_LINE * len(lines) + _GAP for lines in names) / 72 + 0.78  # inches
    figure.set_figheight(max(needed, figure.get_figheight()))
    _place(axes, _NAMES)
    height = 72.0 * axes.get_position().height * figure.get_figheight()  # points
    within = axes.transData + axes.transAxes.inverted()
    ends = []
    for (handle, _), lines in zip(curves, names, strict=True):
        end = _end_of(handle.get_xydata())
        colour = handle.get_color()
        ends.append((within.transform(end)[1] * height, end, lines, colour))
    ends.sort(key=lambda one: one[0])
    sizes = [_LINE * len(lines) + _GAP for _, _, lines, _ in ends]
    places = _spread([at for at, *_ in ends], sizes, height)
    for place, (_, end, lines, colour) in zip(places, ends, strict=True):
        axes.text(1.05, place / height, "\n".join(lines), transform=axes.transAxes, fontsize=8,
                  va="center", color=colour)  # fmt: skip
        (x, y), to = within.transform(end), (1.04, place / height)
        figure.add_artist(Line2D((x, to[0]), (y, to[1]), transform=axes.transAxes, zorder=-1,
                                 linewidth=0.5, color=colour))  # fmt: skip


def _end_of(places: Any) -> tuple[float, float]:
    """Return the last place of the longest stretch without a gap; of equal ones, of the last."""
    longest, stretch = 0, 0
    end = (math.nan, math.nan)
    for x, y in places:
        stretch = stretch + 1 if math.isfinite(x) and math.isfinite(y) else 0
        if stretch and stretch >= longest:
            longest, end = stretch, (float(x), float(y))
    return end


def _spread(wanted: Sequence[float], sizes: Sequence[float], height: float) -> list[float]:
    """Return places near those that are `wanted`, ascending, whose sizes do not overlap.

    They lie in (0, `height`) if there is room.
    """
    places = list(wanted)
    for k in range(1, len(places)):  # upwards, then down from the top
        places[k] = max(places[k], places[k - 1] + (sizes[k - 1] + sizes[k]) / 2.0)
    most = height
    for k in range(len(places) - 1, -1, -1):
        places[k] = min(places[k], most - sizes[k] / 2.0)
        most = places[k] - sizes[k] / 2.0
    return places


def log_range(values: Sequence[float], room: float = 0.08) -> tuple[float, float]:
    """Return a range around positive `values`, at least a factor of two wide."""
    low, high = math.log10(min(values)), math.log10(max(values))
    widen = max(room * (high - low), (math.log10(2) - (high - low)) / 2, 0.04)
    return 10 ** max(low - widen, -_MOST), 10 ** min(high + widen, _MOST)


def log_axis(axes: Axes, which: str, ends: tuple[float, float]) -> None:
    """Make an axis logarithmic over `ends`, with two to nine labelled ticks."""
    axis = getattr(axes, f"{which}axis")
    getattr(axes, f"set_{which}scale")("log")
    getattr(axes, f"set_{which}lim")(*ends)
    labelled = log_ticks(*ends)
    axis.set_major_locator(FixedLocator(labelled))
    axis.set_minor_locator(NullLocator())
    as_power = any(not 0.009 < value < 9999 for value in labelled)
    axis.set_major_formatter(FuncFormatter(lambda value, _: _tick(value, as_power)))


def plain_axis(axes: Axes, which: str, ends: tuple[float, float]) -> None:
    """Make an axis linear over `ends`, with a few round ticks; a power of ten stands at its end."""
    getattr(axes, f"set_{which}lim")(*ends)
    axis = getattr(axes, f"{which}axis")
    axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    power = math.floor(math.log10(max(map(abs, ends)) or 1.0))
    power = 0 if -3 <= power < 5 else power
    unit = 10.0**power or 1.0
    axis.set_major_formatter(FuncFormatter(lambda v, _: f"{v / unit:.4g}".replace("-", "−")))
    if power:
        place, move = ((0.0, 1.0), (3, -7)) if which == "y" else ((1.0, 0.0), (4, -2))
        axes.annotate(f"×10{str(power).translate(RAISED)}", place, move, fontsize=8,
                      xycoords="axes fraction", textcoords="offset points")  # fmt: skip


def log_ticks(low: float, high: float) -> list[float]:
    """Return the values of labelled ticks: decades, or more where there are less than two."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    start, end = low * (1 - 1e-9), high * (1 + 1e-9)
    decades = [d for d in range(first, last + 1) if start <= 10.0**d <= end]
    if len(decades) >= 2:
        step = -(-len(decades) // 6)
        found = [10.0**d for d in decades if d % step == 0]
        return found if len(found) >= 2 else [10.0 ** decades[0], 10.0 ** decades[-1]]
    tried = [m * 10.0**d for d in range(first, last + 1) for m in (1, 2, 5)]
    round_ones = MaxNLocator(3, steps=[1, 2, 5, 10]).tick_values(low, high)
    for ticks in (tried, round_ones):
        inside = [float(v) for v in ticks if start <= v <= end]
        if len(inside) >= 2:
            return inside
    return [low * 1.02, high * 0.98]


def _tick(value: float, as_power: bool) -> str:
    if not as_power:
        return f"{value:.4g}"
    exponent = math.floor(math.log10(value) + 1e-9)
    mantissa, power = f"{value / 10.0**exponent:.3g}", str(exponent).translate(RAISED)
    return f"10{power}" if mantissa == "1" else f"{mantissa}·10{power}"


_TOTAL, _PART = "#4d4d4d", "#0067a5"
_MARKED = 15  # places of a curve up to which each has its marker
_DRAWABLE = 1e200  # larger values, and not-a-number, leave a gap


@dataclass(frozen=True)
class Series:
    """A curve, whose places that cannot be drawn are gaps.

    `second` stands below its name; `ringed` are places that stand out.
    """

    name: str
    places: Sequence[tuple[Any, Any]]
    second: str = ""
    ringed: Sequence[tuple[float, float]] = ()


@dataclass(frozen=True)
class Bar:
    """A part of a whole with the half-width of its interval, and its label."""

    name: str
    value: float
    half: float
    written: str
    total: bool = False


def loglog(
    title: str, x_title: str, series: Sequence[Series], palette: Palette, falling: bool = False,
    grey: Sequence[Series] = (), ticks: Sequence[float] = (),
) -> Drawing | None:  # fmt: skip
    """Return curves on logarithmic axes, or None if there is nothing positive.

    Up to six are named at their ends, more in a legend; those in `grey` have no names. The abscissa
    falls to the right if asked, and has its `ticks` where they are given.
    """
    drawn = [(s, [place for place in s.places if _can_be_drawn(place)]) for s in series]
    drawn = [(s, places) for s, places in drawn if places]
    if not drawn:
        return None
    with panel(title) as (figure, axes):
        nameless = [[place for place in s.places if _can_be_drawn(place)] for s in grey]
        every = [*(places for _, places in drawn), *nameless]
        _logarithmic(axes, x_title, [place for places in every for place in places])
        if falling:
            axes.invert_xaxis()
        if ticks:
            axes.xaxis.set_major_locator(FixedLocator(list(ticks)))
        for places in filter(None, nameless):
            axes.plot(*zip(*places, strict=True), color="#c2c2c2", linewidth=0.8, marker=".",
                      markersize=3)  # fmt: skip
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
        _named(axes)
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
        axes.barh(rows, [p.value for p in parts], height=0.6,
                  xerr=[p.half or math.nan for p in parts],  # no caps where there is none
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


@dataclass(frozen=True)
class Strip:
    """Ratios of one row of a figure, their median, and a range of them."""

    name: str
    ratios: Sequence[float]
    median: float
    low: float
    high: float


def strips(title: str, rows: Sequence[Strip], palette: Palette) -> Drawing:
    """Return a row of points for each strip on one logarithmic axis, the first on top.

    The median and the range are drawn over the points, which are spread across the row.
    """
    with panel(title, width=5.4, height=0.75 + 0.34 * len(rows)) as (figure, axes):
        width, height = figure.get_size_inches()
        axes.set_position((1.85 / width, 0.3 / height, 3.4 / width, (height - 0.62) / height))
        axes.set_title(title, loc="left", x=-1.8 / 3.4, fontsize=9)
        log_axis(axes, "x", log_range([1.0, *(one for row in rows for one in row.ratios)]))
        axes.axvline(1.0, color="#333", linewidth=0.8)
        for place, row in enumerate(rows):
            style, golden = palette[row.name], 0.618034
            across = [place + 0.6 * ((i * golden) % 1.0 - 0.5) for i in range(len(row.ratios))]
            axes.plot(row.ratios, across, color=style.colour, marker="o", markersize=2.8,
                      markeredgewidth=0.0, alpha=0.4, linestyle="none")  # fmt: skip
            axes.plot([row.low, row.high], [place, place], color="#111", linewidth=1.6)
            axes.plot([row.median], [place], color="#111", marker="o", markersize=5)
        axes.set_yticks(range(len(rows)), ["\n".join(wrap(row.name, 26)) for row in rows],
                        fontsize=8)  # fmt: skip
        axes.set_ylim(len(rows) - 0.5, -0.5)
        axes.grid(False, axis="y")
        axes.tick_params(axis="y", length=0)
        said = "; ".join(f"{r.name} {r.median:.3g} ({r.low:.3g} to {r.high:.3g})" for r in rows)
        return drawing(figure, f"{title}: {said}.")


def _can_be_drawn(place: tuple[Any, Any]) -> bool:
    return all(isinstance(v, int | float) and 1 / _DRAWABLE < v < _DRAWABLE for v in place)


def _logarithmic(axes: Axes, x_title: str, places: Sequence[tuple[float, float]]) -> None:
    log_axis(axes, "x", log_range([x for x, _ in places]))
    log_axis(axes, "y", log_range([y for _, y in places]))
    axes.set_xlabel(x_title)


def profile_panel(
    title: str, along: Sequence[float], curves: Sequence[tuple[str, Sequence[float]]],
    palette: Palette | None = None, marks: Sequence[float] = (), x_title: str = "time, s",
    band: tuple[Sequence[float], Sequence[float]] | None = None,
) -> Drawing:  # fmt: skip
    """Return a figure of several curves over a common abscissa.

    Parameters
    ----------
    title : str
        Quantity and unit; stands on top.
    along : sequence of float
        Ascending.
    curves : sequence of (name, values)
    palette : Palette, optional
        Where the curves of a page share one; each place of few has its marker then.
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
        styles = Palette() if palette is None else palette
        for name, curve in curves:
            style = styles[name]
            few = style.marked if len(along) <= _MARKED and palette is not None else {}
            axes.plot(along, _gaps(curve), label=name, linestyle=style.dashes,
                      **{"color": style.colour, **few})  # fmt: skip
        _named(axes)
        ends = "; ".join(f"{name}: {curve[0]:.4g} to {curve[-1]:.4g}" for name, curve in curves)
        cuts = f" A cut opens at {', '.join(f'{m:.3g} s' for m in marks)}." if marks else ""
        return drawing(figure, f"{title} over {x_title}, {length:.3g}. {ends}.{cuts}", "profile")


def _gaps(curve: Sequence[float]) -> list[float]:
    return [v if abs(v) < _DRAWABLE else math.nan for v in curve]


@dataclass(frozen=True)
class Ranged:
    """A number with its range, None where it has none."""

    name: str
    value: float
    low: float | None = None
    high: float | None = None


def ranges(
    title: str, x_title: str, rows: Sequence[Ranged], palette: Palette, line: float,
    within: tuple[float, float] = (0.0, math.inf),
) -> Drawing | None:  # fmt: skip
    """Return numbers with their ranges on a logarithmic axis, the first on top; `line` is marked.

    The axis ends at `within`; a range that goes on has an arrow head there. None if there is
    nothing positive.
    """
    drawn = [row for row in rows if _can_be_drawn((row.value, row.value))]
    if not drawn:
        return None
    with panel(title, 5.6, 0.95 + 0.24 * len(drawn)) as (figure, axes):
        width, height = figure.get_size_inches()
        axes.set_position((1.9 / width, 0.48 / height, 2.9 / width, (height - 0.8) / height))
        axes.set_title(printable(title), loc="left", x=-1.8 / 2.9, fontsize=9, pad=9)
        ends = [v for row in drawn for v in (row.low, row.value, row.high) if v is not None]
        shown = [min(max(v, within[0]), within[1]) for v in (*ends, line)]
        log_axis(axes, "x", log_range([v for v in shown if _can_be_drawn((v, v))]))
        axes.set_xlabel(x_title)
        axes.grid(True, axis="x", color=_GRID, linewidth=0.7)
        axes.axvline(line, color="#333", linewidth=0.9)
        left, right = axes.get_xlim()
        for place, row in enumerate(drawn):
            style = palette[row.name]
            if row.low is not None and row.high is not None:
                low, high = max(row.low, left), min(row.high, right)
                axes.plot([low, high], [place, place], color=style.colour,
                          linewidth=2.2, solid_capstyle="butt")  # fmt: skip
                for end, head, cut in ((low, "<", row.low < left), (high, ">", row.high > right)):
                    if cut:
                        axes.plot([end], [place], color=style.colour, marker=head, markersize=6,
                                  clip_on=False)  # fmt: skip
            axes.plot([row.value], [place], **style.marked)
            axes.annotate(_tick_text(row.value), (1.0, place), (9, 0), fontsize=8, va="center",
                          xycoords=("axes fraction", "data"), textcoords="offset points",
                          annotation_clip=False)  # fmt: skip
        axes.set_yticks(range(len(drawn)), [row.name for row in drawn], fontsize=8)
        axes.set_ylim(len(drawn) - 0.5, -0.5)
        axes.tick_params(axis="y", length=0)
        said = "; ".join(_range_text(row) for row in drawn)
        return drawing(figure, f"{title}, {x_title}: {said}.")


def _tick_text(value: float) -> str:
    return _tick(float(f"{value:.3g}"), not 0.009 < value < 9999)


def _range_text(row: Ranged) -> str:
    beyond = "" if row.low is None else f" ({row.low:.3g} to {row.high:.3g})"
    return f"{row.name} {row.value:.3g}{beyond}"
