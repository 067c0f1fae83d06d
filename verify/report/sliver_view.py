"""The sliver study: stability maps of one family, errors and systems of every solver."""

from collections.abc import Mapping, Sequence
from typing import Any

from verify.report.blocks import Cell, Drawing, Table
from verify.report.figures.plots import Series, loglog
from verify.report.figures.style import Palette
from verify.report.notation import error_title, is_error, number, solver_title

Records = Sequence[Mapping[str, Any]]

_GRADES = {"good": "●", "fair": "◐", "poor": "○", "bad": "✕"}
_NOTHING = Cell("–", grade="none")
_STEP, _UNCUT = "critical explicit step", "critical explicit step, uncut"
_SCALED = "condition number scaled by the diagonal"
_FREQUENCY, _MEASURE = "lowest natural frequency", "conforming"
_ERRORS = ("displacement_l2", "energy_norm")
_DRAWN = ("condition number", _SCALED, _STEP)
_LEAST = (0.9, 0.5, 0.1)  # of the step: what is good, fair and poor
_MOST = (1e3, 1e4, 1e6)  # of the condition number


def sliver_families(record: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return name, maps and curves of each family of scenes."""
    palette = Palette()
    families = []
    for family in dict.fromkeys(m["family"] for m in record["measurements"]):
        measured = listed(record["measurements"], family=family)
        growths = listed(record["growths"], family=family)
        curves = _curves(measured, growths, palette)
        maps = [*_worst(measured), *_maps(measured)]
        families.append({"name": family, "maps": maps, "curves": curves})
    return families


def graded(
    value: float | None, limits: Sequence[float], reason: str = "", most: bool = False
) -> Cell:
    """Grade a value by the first limit that it reaches (with `most`: does not exceed).

    It is written with so many digits that it is not rounded to a grade that it misses.
    """
    if value is None:
        return Cell("–", tip=reason, grade="none")

    def grade(found: float) -> str:
        reached = [found <= limit if most else found >= limit for limit in limits]
        return list(_GRADES)[(*reached, True).index(True)]

    own = grade(value)
    enough = (n for n in range(2, 9) if grade(float(f"{value:.{n - 1}e}")) == own)
    written = number(value, next(enough, 9))
    return Cell(f"{_GRADES[own]} {written}", tip=reason, grade=own)


def listed(records: Records, **fixed: Any) -> list[Mapping[str, Any]]:
    """Return the records in which all of these keys have these values."""
    return [r for r in records if all(r.get(key) == value for key, value in fixed.items())]


def _maps(measured: Records) -> list[tuple[Table, str]]:
    """Return the maps of one family with their legends."""
    steps = []
    for record in listed(measured, quantity=_STEP):
        uncut = listed(measured, quantity=_UNCUT, solver=record["solver"])
        whole = next((one["value"] for one in uncut if one["value"]), None)
        share = record["value"] / whole if record["value"] and whole else None
        reason = record["reason"] or ("" if share else "no step of the uncut body to compare with")
        steps.append((record, graded(share, _LEAST, reason)))
    conditions = [
        (one, graded(one["value"], _MOST, one["reason"], most=True))
        for one in listed(measured, quantity=_SCALED)
    ]
    maps = []
    for title, found, words, limits in (
        ("Critical explicit step over that of the uncut body", steps, "at least", _LEAST),
        ("Condition number, scaled by the diagonal", conditions, "at most", _MOST),
    ):
        if found:
            ends = [f"{words} {number(limit, 1)}" for limit in limits]
            last = "less" if limits is _LEAST else "more"
            legend = zip(_GRADES.values(), [*ends, last], strict=True)
            maps.append((_map(title, found), "; ".join(f"{sign} {end}" for sign, end in legend)))
    return maps


def _worst(measured: Records) -> list[tuple[Table, str]]:
    """Return the table of what is worst of each solver over ε, beside the conforming mesh."""

    def values(solver: str, quantity: str) -> dict[float, float]:
        own = listed(measured, solver=solver, quantity=quantity)
        return {m["size"]: m["value"] for m in own if m["value"] is not None}

    def ratios(solver: str, quantity: str, others: Mapping[float, float]) -> list[float]:
        own = values(solver, quantity)
        return [own[e] / others[e] for e in own if others.get(e)]

    rows = []
    solvers = list(dict.fromkeys(m["solver"] for m in measured))
    for solver in solvers if _MEASURE in solvers else ():
        whole = values(solver, _UNCUT)
        steps = [s / whole[e] for e, s in values(solver, _STEP).items() if whole.get(e)]
        errors = [ratios(solver, name, values(_MEASURE, name)) for name in _ERRORS]
        pitch = ratios(solver, _FREQUENCY, values(_MEASURE, _FREQUENCY))
        scaled = list(values(solver, _SCALED).values())
        off = max((ratio - 1.0 for ratio in pitch), key=abs, default=None)
        rows.append([
            solver_title(solver),
            _written(min(steps, default=None)),
            *(_written(max(one, default=None)) for one in errors),
            Cell("–") if off is None else Cell(f"{off:+.2%}"),
            _written(max(scaled, default=None)),
        ])  # fmt: skip
    heads = ["method", "least step over the uncut body's", "largest L² error over conforming",
             "largest energy-norm error over conforming", "lowest frequency off conforming",
             "largest scaled condition number"]  # fmt: skip
    legend = "errors are of the static field; a mass leaves them as they are and moves frequencies"
    return [(Table("Worst over ε", heads, rows, named=True), legend)] if rows else []


def _written(value: float | None) -> Cell:
    return _NOTHING if value is None else Cell(number(value, 3))


def _map(title: str, found: Sequence[tuple[Mapping[str, Any], Cell]]) -> Table:
    """Return a row per method and a column per size; the tint repeats the sign in each cell."""
    sizes = sorted({record["size"] for record, _ in found}, reverse=True)
    rows = []
    for solver in dict.fromkeys(record["solver"] for record, _ in found):
        own = {r["size"]: cell for r, cell in found if r["solver"] == solver}
        rows.append([solver_title(solver), *(own.get(size, _NOTHING) for size in sizes)])
    return Table(title, ["ε =", *(f"{size:g}" for size in sizes)], rows, "map", named=True)


def _curves(measured: Records, growths: Records, palette: Palette) -> list[Drawing | None]:
    names = dict.fromkeys(m["quantity"] for m in measured)
    shown = [n for n in names if is_error(n) or n.startswith(("relative", "deviation"))]
    panels = []
    for quantity in [*shown, *(n for n in _DRAWN if n in names)]:
        series = []
        for solver in dict.fromkeys(m["solver"] for m in measured):
            own = listed(measured, solver=solver, quantity=quantity)
            places = sorted(((m["size"], m["value"]) for m in own), key=lambda place: place[0])
            law = next(iter(listed(growths, solver=solver, quantity=quantity)), {})
            series.append(Series(solver_title(solver), places, _law_text(law)))
        title = error_title(quantity) if is_error(quantity) else quantity
        title += ", s" if quantity == _STEP else ""
        panels.append(loglog(title, "ε, in elements", series, palette))
    return panels


def _law_text(law: Mapping[str, Any]) -> str:
    if law.get("exponent") is None:
        return ""
    return f"∝ ε^{law['exponent'] + 0.0:.2f}".replace("-", "−").replace("−0.00", "0.00")
