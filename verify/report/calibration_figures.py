"""The page of the calibration study: stated against true, with the lines of 1 and of 10."""

from collections.abc import Mapping, Sequence
from typing import Any

from verify.report.axes import Panel, log_range, text
from verify.report.markup import Markup, joined, table, tag
from verify.report.notation import metric_title, number

__all__ = ["calibration_section"]

_COLOURS = ("#0067a5", "#c04a00", "#00785a", "#a3487b", "#8a6a00", "#5b4db5")
_WASTED = 10.0
_ROW, _FIRST_ROW = 18, 46


def calibration_section(record: Mapping[str, Any]) -> Markup:
    """Return the plots, one per degree, and the tables of all trials."""
    trials = record["trials"]
    counted = [t for t in trials if not t["left_out"]]
    degrees = sorted({t["degree"] for t in counted})
    figures = [
        tag("figure", _scatter([t for t in counted if t["degree"] == degree], degree))
        for degree in degrees
    ]
    said = (
        "Every mark is a number that a reference of three levels states its uncertainty of; above "
        "the line 1 the uncertainty covers the true error, above the line 10 it is wider than it "
        "need be. Open marks are quantities of interest: the error of a single number can vanish "
        "by chance, and then lies far above."
    )
    return tag(
        "section",
        tag("h2", "Stated uncertainty against true error"),
        tag("div", figures, class_="panels"),
        tag("p", said, class_="quiet"),
        _trials_table(trials),
    )


def _scatter(trials: Sequence[Mapping[str, Any]], degree: int) -> Markup:
    shown = [t for t in trials if t["stated"] > 0.0 and t["true"] > 0.0]
    if not shown:
        return tag("p", f"P{degree}: no mark can be drawn.")
    panel = Panel(
        log_range([t["true"] for t in shown]),
        log_range([t["stated"] for t in shown]),
        "true error, relative",
        f"P{degree}: stated uncertainty, relative",
    )
    marks = _marks(trials)
    parts = [_line(panel, 1.0), _line(panel, _WASTED)]
    parts += [_mark(panel, t, marks[t["family"]]) for t in shown]
    parts += [
        _legend(panel, row, t["family"], marks[t["family"]])
        for row, t in enumerate({t["family"]: t for t in shown}.values())
    ]
    below = sum(not t["covered"] for t in shown)
    label = (
        f"Stated uncertainty over true error, P{degree}: {len(shown)} marks, {below} not covered."
    )
    return panel.drawn(label, joined(*parts))


def _marks(trials: Sequence[Mapping[str, Any]]) -> dict[str, tuple[str, bool]]:
    """Give a colour to each family, and a square mark to those for which none is left."""
    families = dict.fromkeys(t["family"] for t in trials)
    n = len(_COLOURS)
    return {name: (_COLOURS[i % n], i >= n) for i, name in enumerate(families)}


def _legend(panel: Panel, row: int, family: str, mark: tuple[str, bool]) -> Markup:
    colour, square = mark
    y = _FIRST_ROW + _ROW * row
    shown = _shape(panel.gutter + 3, y - 4, square, fill=colour, stroke=colour)
    return joined(shown, text(panel.gutter + 12, y, family, class_="note", fill=colour))


def _line(panel: Panel, factor: float) -> Markup:
    """Draw stated = factor · true, clipped to the panel."""
    low = max(panel.x.low, panel.y.low / factor)
    high = min(panel.x.high, panel.y.high / factor)
    if high <= low:
        return joined()
    x0, x1 = panel.x.at(low), panel.x.at(high)
    y0, y1 = panel.y.at(low * factor), panel.y.at(high * factor)
    end = text(x1 + 3, y1 + 4, f"{factor:g}", class_="note")
    return joined(tag("path", d=f"M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}", class_="slope"), end)


def _mark(panel: Panel, trial: Mapping[str, Any], mark: tuple[str, bool]) -> Markup:
    colour, square = mark
    norm = trial["quantity"] in ("displacement_l2", "energy_norm", "jump_l2")
    tip = (
        f"{trial['family']}, scene {trial['scene']}, {metric_title(trial['quantity'])}: "
        f"stated {trial['stated']:.3g}, true {trial['true']:.3g}"
    )
    return _shape(
        panel.x.at(trial["true"]), panel.y.at(trial["stated"]), square, tag("title", tip),
        stroke=colour, fill=colour if norm else "#fff", class_="marker",
    )  # fmt: skip


def _shape(x: float, y: float, square: bool, *tip: Markup, **style: str) -> Markup:
    if not square:
        return tag("circle", *tip, cx=f"{x:.1f}", cy=f"{y:.1f}", r="3.4", **style)
    left, top = f"{x - 3.1:.1f}", f"{y - 3.1:.1f}"
    return tag("rect", *tip, x=left, y=top, width="6.2", height="6.2", **style)


def _trials_table(trials: Sequence[Mapping[str, Any]]) -> Markup:
    rows = [
        [
            t["family"], t["scene"], f"P{t['degree']}", t["level"], metric_title(t["quantity"]),
            number(t["stated"], 3), number(t["true"], 3),
            t["left_out"] or joined(number(t["ratio"], 3), "" if t["covered"] else " not covered"),
        ]
        for t in trials
    ]  # fmt: skip
    head = [
        "family",
        "scene",
        "degree",
        "finest level",
        "number",
        "stated",
        "true",
        "stated over true",
    ]
    return table(head, rows, "All trials, relative; with those that do not count, and why")
