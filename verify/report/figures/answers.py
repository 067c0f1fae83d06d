"""The four panels of the first screen: error, energy, slivers and time, all solvers in each."""

from collections.abc import Callable, Iterator, Sequence

from matplotlib.axes import Axes

from verify.report.answers import (
    Answer,
    compared_curves,
    energy_curve,
    moving,
    sliver_curves,
)
from verify.report.blocks import Drawing
from verify.report.curves import Curve, Point, floor
from verify.report.figures.convergence import uncertainty_band
from verify.report.figures.style import (
    Palette,
    drawing,
    log_axis,
    log_range,
    panel,
    plain_axis,
)
from verify.report.notation import ROUND_OFF, number_text, solver_title
from verify.result import CaseResult

_WIDTH, _HEIGHT = 3.35, 2.4  # inches
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
    """Draw the error of one case over h or time, those of all others faintly below it."""

    def at(point: Point) -> float | None:
        if not over_time:
            return point.size
        time = point.duration
        return time.median + time.meshing if time and time.median > 0.0 else None

    drawn = {r.case: [(c, p) for c in compared_curves(r) if (p := _placed(c, at))] for r in results}
    if not drawn.get(example):
        return None
    every = [place for own in drawn.values() for _, places in own for place in places]
    title = "time with meshing, s" if over_time else "element size h, m"
    with panel("relative L² error of the displacement", _WIDTH, _HEIGHT, legend=False) as (
        figure,
        axes,
    ):
        own = [place for _, places in drawn[example] for place in places]
        _log_axes(axes, title, every, [*own, *_bars(drawn[example])])
        if not over_time:
            uncertainty_band(axes, floor([curve for curve, _ in drawn[example]], at))
        for case, curves in drawn.items():
            for curve, places in curves:
                style = palette[curve.label]
                look = style.marked if case == example else {"color": style.colour, "alpha": _FAINT}
                axes.plot(*zip(*places, strict=True), linewidth=1.5 if case == example else 0.8,
                          linestyle=style.dashes, zorder=3 if case == example else 1,
                          **look)  # fmt: skip
        said = "; ".join(
            f"{curve.label}: {number_text(places[0][1])} at {number_text(places[0][0])} to "
            f"{number_text(places[-1][1])} at {number_text(places[-1][0])}"
            for curve, places in drawn[example]
        )
        return drawing(figure, f"Error of the displacement over {title}, {example}. {said}.")


def _bars(curves: Sequence[tuple[Curve, Places]]) -> Iterator[tuple[float, float]]:
    """Yield places below the errors, as far as their uncertainty is worth a band."""
    for curve, places in curves:
        for point, (x, y) in zip(curve.points, places, strict=False):
            if point.uncertainty > y / 30:
                yield x, point.uncertainty / 1.5


def _placed(curve: Curve, at: Callable[[Point], float | None]) -> Places:
    return [
        (x, p.value)
        for p in curve.points
        if (x := at(p)) and p.value > max(p.uncertainty, ROUND_OFF)
    ]


def _energies(results: Sequence[CaseResult], palette: Palette) -> Drawing | None:
    """Draw the relative change of the total energy over the time of every case in motion."""
    curves = [(solve.solver, p) for _, solve in moving(results) if (p := energy_curve(solve))]
    curves = [(s, [(x, max(y, _LEAST)) for x, y in places]) for s, places in curves]
    if not curves:
        return None
    every = [place for _, places in curves for place in places]
    with panel("relative change of the total energy", _WIDTH, _HEIGHT, legend=False) as (
        figure,
        axes,
    ):
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
    with panel("over that at the largest ε", _WIDTH, _HEIGHT, legend=False) as (figure, axes):
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
