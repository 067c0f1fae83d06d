"""The page of a sliver study: what its numbers answer, its figure, then tables and curves.

If one solver takes part with many values of one number, the question is what that number does.
"""

import re
from collections.abc import Mapping, Sequence
from itertools import batched, groupby
from typing import Any

from verify.report.notation import (
    Drawing,
    Lead,
    Table,
    error_title,
    is_error,
    number,
    solver_title,
)
from verify.report.plots import Palette, Series, loglog

Records = Sequence[Mapping[str, Any]]

_STEP, _UNCUT = "critical explicit step", "critical explicit step, uncut"
_SCALED = "condition number scaled by the diagonal"
_FREQUENCY, _MEASURE = "lowest natural frequency", "conforming"
_UNKNOWNS = "unknowns of the system"
_ERRORS = {"displacement_l2": "displacement, L²", "energy_norm": "energy norm"}
_OF_SWEEPS = {**_ERRORS, "jump_l2": "jump across the cut, L²"}
_DRAWN = ("condition number", _SCALED, _STEP)
_KEPT = 0.9  # of the step, as in the findings: a tenth is what its safety factor takes
_ALIKE = 0.05  # by which errors differ with the position of a mesh: less is no difference
_FAR = 1.25  # as in the study's findings, times the error of the conforming mesh
_SWEPT = 4  # values of one number that make it the question
_SAME = 0.02  # by which curves differ that are drawn as one: less than the width of a line
_FEW = 6  # curves in a panel
_QUESTIONS = {"ghost": "Does a ghost penalty lock?"}


def sliver_lead(record: Mapping[str, Any]) -> Lead:
    """Return what the study answers: who keeps step and error, or what one number does to them."""
    measured = record["measurements"]
    swept = _swept(dict.fromkeys(m["solver"] for m in measured))
    if swept and (lead := _lead_of_sweep(measured, *swept)):
        return lead
    families = dict.fromkeys(m["family"] for m in measured)
    shares = {
        solver: _least([one for family in families for one in _shares(measured, family, solver)])
        for solver in dict.fromkeys(m["solver"] for m in measured)
    }
    drawn = {family: _steps(measured, family, Palette()) for family in families}
    family = next((name for name, panels in drawn.items() if panels), "")
    caption = f"{family}: ε falls to the right. A line ends where the cut moves onto nodes."
    return Lead(
        "Which way to cut keeps error and explicit step when a cut comes near a node?",
        [_said_of_steps(shares), _said_of_errors(measured, list(families))],
        drawn.get(family, []), caption if family else "",
    )  # fmt: skip


def _said_of_steps(shares: Mapping[str, tuple[float, float] | None]) -> str:
    known = {solver_title(name): least for name, least in shares.items() if least is not None}
    if not known:
        return "No explicit step was measured: no solver hands over its system."
    kept = [f"{name} ({number(v, 2)})" for name, (v, _) in known.items() if v >= _KEPT]
    lost = sorted((v, size, name) for name, (v, size) in known.items() if v < _KEPT)
    said = f"At least {_KEPT:g} of the uncut body's explicit step is left at every ε by "
    said += f"{_listed(kept)}." if kept else "nobody."
    if lost:
        words = [f"{name} ({number(v, 2)} at ε = {size:g})" for v, size, name in lost]
        said += f" It falls with {_listed(words)}."
    unknown = [solver_title(name) for name, least in shares.items() if least is None]
    return said + (f" Not measured: {_listed(unknown)}." if unknown else "")


def _said_of_errors(measured: Records, families: Sequence[str]) -> str:
    found = [
        (ratio, f"{solver_title(solver)}, {_ERRORS[error]}, {family}, ε = {size:g}", solver)
        for family in families
        for solver in dict.fromkeys(m["solver"] for m in measured)
        for error in _ERRORS
        for size, ratio in _ratios(measured, family, solver, error).items()
        if solver != _MEASURE
    ]
    if not found:
        return "Errors are not compared: the conforming mesh did not take part."
    worst, where, _ = max(found)
    if worst <= _FAR:
        return (
            f"No error grows: at every ε it is at most {worst:.2f} times that of a conforming mesh "
            f"of the same size (most: {where})."
        )
    bad = _listed([solver_title(s) for s in dict.fromkeys(s for r, _, s in found if r > _FAR)])
    return (
        f"More than {_FAR:g} times the error of a conforming mesh of the same size has {bad} "
        f"(most: {worst:.2f} times, {where})."
    )


def _listed(words: Sequence[str]) -> str:
    return ", ".join(words[:-1]) + " and " * (len(words) > 1) + words[-1]


def _least(shares: Sequence[tuple[float, float]]) -> tuple[float, float] | None:
    """Return the least share and its size; of equal ones the largest size."""
    return min(shares, key=lambda one: (one[0], -one[1]), default=None)


def _values(measured: Records, family: str, solver: str, quantity: str) -> dict[float, float]:
    own = listed(measured, family=family, solver=solver, quantity=quantity)
    return {m["size"]: m["value"] for m in own if m["value"] is not None}


def _shares(measured: Records, family: str, solver: str) -> list[tuple[float, float]]:
    """Return (share of the uncut step, ε) of each row."""
    whole = next(iter(_values(measured, family, solver, _UNCUT).values()), None)
    steps = _values(measured, family, solver, _STEP)
    return [(step / whole, size) for size, step in steps.items()] if whole else []


def _ratios(
    measured: Records, family: str, solver: str, quantity: str, rival: str = _MEASURE
) -> dict[float, float]:
    """Return values over the values of another solver, by ε."""
    own, others = (_values(measured, family, s, quantity) for s in (solver, rival))
    return {size: value / others[size] for size, value in own.items() if others.get(size)}


def _swept(solvers: Sequence[str] | dict[str, None]) -> tuple[str, dict[str, float]] | None:
    """Return the number that alone is varied, with its value in each label, if there is one."""
    found: dict[tuple[str, str], dict[str, float]] = {}
    for label in solvers:
        if match := re.fullmatch(r"(\S+) (\w+)=([-+.\de]+)", label):
            found.setdefault((match[1], match[2]), {})[label] = float(match[3])
    return next(((key[1], own) for key, own in found.items() if len(own) >= _SWEPT), None)


def _lead_of_sweep(measured: Records, name: str, values: Mapping[str, float]) -> Lead | None:
    """Return the largest error over ε against the number, over that at its least value."""
    families = dict.fromkeys(m["family"] for m in measured)
    worst: dict[str, dict[float, float]] = {error: {} for error in _OF_SWEEPS}
    labels = sorted(values, key=lambda label: values[label])

    def most(label: str, error: str, rival: str) -> float:
        own = [r for f in families for r in _ratios(measured, f, label, error, rival).values()]
        return max(own, default=0.0)

    for label in labels:
        for error, own in worst.items():
            if found := most(label, error, labels[0]):
                own[values[label]] = found
    worst = {error: own for error, own in worst.items() if len(own) >= _SWEPT}
    if not worst:
        return None
    first = f"{name} = {values[labels[0]]:g}"
    palette, title = Palette(), f"largest error over ε, over that at {first}"
    series = [Series(_OF_SWEEPS[error], list(own.items())) for error, own in worst.items()]
    beside = ", ".join(
        f"{_OF_SWEEPS[error]} {number(most(labels[0], error, _MEASURE), 3)}" for error in worst
    )
    question = _QUESTIONS.get(name, f"What does {name} do to the error?")
    return Lead(
        question, _said_of_sweep(name, worst), [loglog(title, name, series, palette)],
        f"{len(values)} values of {name} of {labels[0].split()[0]}; each point is the largest over "
        f"ε of {_listed(list(families))}. At {first}, over a conforming mesh of the same size, at "
        f"most: {beside}.",
    )  # fmt: skip


def _said_of_sweep(name: str, worst: Mapping[str, Mapping[float, float]]) -> list[str]:
    """Say up to which value no error grows, and what the larger ones do."""
    values = sorted({value for own in worst.values() for value in own})
    most = {v: max(own.get(v, 0.0) for own in worst.values()) for v in values}
    bad = [value for value in values if most[value] > 1.0 + _ALIKE]
    good = [value for value in values if not bad or value < bad[0]]
    if len(good) < 2:
        said = [f"Every {name} above the least, {values[0]:g}, adds more than {_ALIKE:.0%}."]
    else:
        off = max(most[value] for value in good) - 1.0
        said = [
            f"Up to {name} = {good[-1]:g} it adds no error: at every ε none is more than "
            f"{100 * max(off, 0.0):.1f} % above that at {values[0]:g}."
        ]
    if not bad:
        return [*said, f"Larger values were not tried: {values[-1]:g} is the last."]
    parts = [
        ", ".join(f"{_OF_SWEEPS[error]} {_times(own[at])}"
                  for error, own in worst.items() if own.get(at, 0.0) > 1.0 + _ALIKE)
        + f" at {at:g}"
        for at in dict.fromkeys((bad[0], values[-1]))
    ]  # fmt: skip
    locks = ", and it locks" if most[values[-1]] > 2.0 else ""
    level = next(v for v in values if all(
        max(own.values()) <= (1.0 + _ALIKE) * own.get(v, 0.0) for own in worst.values()
    ) or v == values[-1])  # fmt: skip
    end = f" Beyond {level:g} none grows by more than {_ALIKE:.0%}." if level < values[-1] else ""
    return [*said, f"From {bad[0]:g} on errors grow{locks}: {'; '.join(parts)}.{end}"]


def _times(ratio: float) -> str:
    return f"{100 * (ratio - 1.0):+.0f} %" if ratio < 2.0 else f"{number(ratio, 2)} times"


def sliver_families(record: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return name, tables and curves of each family of scenes."""
    palette = Palette.of(solver_title(m["solver"]) for m in record["measurements"])
    families = []
    for family in dict.fromkeys(m["family"] for m in record["measurements"]):
        measured = listed(record["measurements"], family=family)
        solvers = list(dict.fromkeys(m["solver"] for m in measured))
        steps = {s: {size: v for v, size in _shares(measured, family, s)} for s in solvers}
        scaled = {s: _values(measured, family, s, _SCALED) for s in solvers}
        tables = [_worst(measured, family, solvers),
                  _over_sizes("Critical explicit step over that of the uncut body", steps),
                  _over_sizes("Condition number, scaled by the diagonal", scaled)]  # fmt: skip
        curves = _curves(measured, listed(record["growths"], family=family), palette)
        families.append({"name": family, "tables": tables, "curves": curves})
    return families


def _over_sizes(title: str, values: Mapping[str, Mapping[float, float]]) -> Table:
    """Return a row for each solver that has a value, and a column for each size."""
    sizes = sorted({size for own in values.values() for size in own}, reverse=True)
    rows = [[solver_title(solver), *(number(own.get(size), 2) for size in sizes)]
            for solver, own in values.items() if own]  # fmt: skip
    return Table(title, ["ε =", *(f"{size:g}" for size in sizes)], rows, named=True)


def listed(records: Records, **fixed: Any) -> list[Mapping[str, Any]]:
    """Return the records in which all of these keys have these values."""
    return [r for r in records if all(r.get(key) == value for key, value in fixed.items())]


def _worst(measured: Records, family: str, solvers: Sequence[str]) -> Table:
    """Return the table of the worst value of each solver over ε, beside the conforming mesh."""
    rows = []
    for solver in solvers if _MEASURE in solvers else ():
        least = _least(_shares(measured, family, solver))
        errors = [_ratios(measured, family, solver, name).values() for name in _ERRORS]
        pitch = _ratios(measured, family, solver, _FREQUENCY).values()
        off = max((ratio - 1.0 for ratio in pitch), key=abs, default=None)
        scaled = _values(measured, family, solver, _SCALED).values()
        rows.append([
            solver_title(solver),
            number(least and least[0], 3),
            *(number(max(one, default=None), 3) for one in errors),
            "–" if off is None else f"{off:+.2%}",
            number(max(scaled, default=None), 3),
        ])  # fmt: skip
    heads = ["method", "least step over the uncut body's", "largest L² error over conforming",
             "largest energy-norm error over conforming", "lowest frequency off conforming",
             "largest scaled condition number"]  # fmt: skip
    return Table("Worst over ε", heads, rows, named=True)


def _curves(measured: Records, growths: Records, palette: Palette) -> list[Drawing | None]:
    names = dict.fromkeys(m["quantity"] for m in measured)
    shown = [n for n in names if is_error(n) or n.startswith(("relative", "deviation"))]
    panels = []
    for quantity in [*shown, *(n for n in _DRAWN if n in names)]:
        series = {}
        for solver in dict.fromkeys(m["solver"] for m in measured):
            law = next(iter(listed(growths, solver=solver, quantity=quantity)), {})
            places = _places(measured, solver, quantity)
            series[solver] = Series(solver_title(solver), places, _law_text(law))
        title = error_title(quantity) if is_error(quantity) else quantity
        title += ", s" if quantity == _STEP else ""
        panels += _panels(title, series, palette)
    return panels


def _steps(measured: Records, family: str, palette: Palette) -> list[Drawing | None]:
    """Return the share of the uncut step against ε."""
    own, series = listed(measured, family=family), {}
    for solver in dict.fromkeys(m["solver"] for m in own):
        if whole := next(iter(_values(own, family, solver, _UNCUT).values()), None):
            places = _places(own, solver, _STEP)
            over = [(size, step and step / whole) for size, step in places]
            series[solver] = Series(solver_title(solver), over)
    return _panels("explicit step over that of the uncut body", series, palette)


def _places(measured: Records, solver: str, quantity: str) -> list[tuple[Any, Any]]:
    """Return a curve over falling ε, with a gap where the number of unknowns changes."""
    own = listed(measured, solver=solver)
    unknowns = {m["size"]: m["value"] for m in own if m["quantity"] == _UNKNOWNS}
    found = sorted(
        ((m["size"], m["value"]) for m in own if m["quantity"] == quantity and m["size"]),
        key=lambda place: -place[0],
    )
    curve: list[tuple[Any, Any]] = []
    for _, stretch in groupby(found, lambda place: unknowns.get(place[0])):
        curve += [*([(None, None)] if curve else []), *stretch]
    return curve


def _panels(title: str, series: Mapping[str, Series], palette: Palette) -> list[Drawing | None]:
    """Return a panel for few curves; for more, the variants of a solver apart from the others."""
    joined = _joined(series)
    for label, one in joined.items():
        palette.setdefault(one.name, palette[solver_title(label)])
    variants: dict[str, list[str]] = {}
    for label in joined:
        variants.setdefault(label.split()[0], []).append(label)
    many = max(variants.values(), key=len, default=[])
    groups = {title: list(joined)}
    if len(joined) > _FEW and 1 < len(many) < len(joined):
        name = solver_title(many[0].split()[0])
        others = [label for label in joined if label not in many[1:]]
        groups = {f"{title}: variants of {name}": many, f"{title}: {name} beside others": others}
    return [
        loglog(f"{words}, {part} of {-(-len(group) // _FEW)}" if len(group) > _FEW else words,
               "ε, in elements", [joined[label] for label in own], palette, falling=True)
        for words, group in groups.items()
        for part, own in enumerate(batched(group, _FEW), 1)
    ]  # fmt: skip


def _joined(series: Mapping[str, Series]) -> dict[str, Series]:
    """Return the curves with a name, those that nobody can tell apart as one with all names."""
    found: dict[str, Series] = {}
    for label, one in series.items():
        if not any(y for _, y in one.places):
            continue
        for other, kept in found.items():
            if _coincide(one, kept):
                program, _, given = one.name.partition(" ")
                name = given if given and program in kept.name.split(", ")[0] else one.name
                found[other] = Series(f"{kept.name}, {name}", kept.places, kept.second)
                break
        else:
            found[label] = one
    return found


def _coincide(one: Series, other: Series) -> bool:
    if [x for x, _ in one.places] != [x for x, _ in other.places]:
        return False
    pairs = [(y, z) for (_, y), (_, z) in zip(one.places, other.places, strict=True)]
    return all(
        (y is None) == (z is None) and (y is None or abs(y - z) <= _SAME * abs(z)) for y, z in pairs
    )


def _law_text(law: Mapping[str, Any]) -> str:
    if law.get("exponent") is None:
        return ""
    return f"∝ ε^{law['exponent'] + 0.0:.2f}".replace("-", "−").replace("−0.00", "0.00")
