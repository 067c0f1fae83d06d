"""The page of a sliver study: what its numbers answer, its figure, then tables and curves.

If one solver takes part with many values of one number, the question is what that number does.
"""

from collections.abc import Mapping, Sequence
from itertools import batched
from math import log, nan
from typing import Any

from verify.report.notation import (
    Drawing,
    Lead,
    Table,
    error_title,
    is_error,
    number,
    signed,
    solver_title,
)
from verify.report.plots import Palette, Series, loglog
from verify.report.sliver_sweep import sweep_lead, swept_number
from verify.report.sliver_values import (
    FREQUENCY,
    ITERATIONS,
    LUMPED,
    MEASURE,
    SCALED,
    STEP,
    UNCUT,
    UNKNOWNS,
    Records,
    counts_of,
    listed,
    mass_of,
    ratios_of,
    shares_of,
    values_of,
    words_of,
)

_ERRORS = {
    "displacement_l2": "displacement, L²", "energy_norm": "energy norm", "jump_l2": "jump, L²",
    "opening_l2": "opening, L²", "opening_max": "largest error of the opening",
}  # fmt: skip
_TOGETHER = {  # errors that share a clause
    "displacement and energy norm": ("displacement_l2", "energy_norm"),
    "jump": ("jump_l2",), "opening": ("opening_l2", "opening_max"),
}  # fmt: skip
_DRAWN = ("condition number", SCALED, ITERATIONS)
_KEPT = 0.9  # of the step, as in the findings: a tenth is what its safety factor takes
_FALLS = 0.5  # exponent of ε: between a share that stays, 0, and one that falls like ε, 1
_BENDS = 0.25  # change of an exponent that ends a law, as in the study's fits
_FAR, _NEAR = 1.25, 1e-2  # as in the study's findings: error over a conforming mesh's, and ε
_SAME = 0.02  # by which curves differ that are drawn as one: less than the width of a line,
_LINE = 0.005  # which is at most twice this part of a logarithmic axis
_FEW = 6  # curves in a panel


def sliver_lead(record: Mapping[str, Any]) -> Lead:
    """Return what the study answers: who keeps step and error, or what one number does to them."""
    measured = record["measurements"]
    swept = swept_number(dict.fromkeys(m["solver"] for m in measured))
    if swept and (lead := sweep_lead(measured, *swept)):
        return lead
    families = list(dict.fromkeys(m["family"] for m in measured))
    drawn = {family: _steps(measured, family, UNCUT, Palette()) for family in families}
    family = next((name for name, panels in drawn.items() if panels), "")
    caption = (
        f"{family}: ε, the distance of the cut from the nearest nodes in elements, falls to the "
        "right. A line breaks where the cut moves onto nodes. Lumped or consistent is the mass of "
        "the uncut body."
    )
    return Lead(
        "Which way to cut keeps error and explicit step when a cut comes near a node?",
        [_said_of_steps(measured, families),
         f"{_said_of_frequencies(measured, families)}{_said_of_errors(measured, families)}"],
        drawn.get(family, []), caption if family else "",
    )  # fmt: skip


def _said_of_steps(measured: Records, families: Sequence[str]) -> str:
    """Say who keeps the uncut step of the same mass; and whose share falls, stays or recovers."""
    kept, falls, stays, far, unknown = [], [], [], [], []
    for solver in dict.fromkeys(m["solver"] for m in measured):
        shares = [shares_of(measured, family, solver) for family in families]
        title, mass = solver_title(solver), mass_of(measured, solver)
        own = min(filter(None, shares), key=lambda one: min(one.values()), default=None)
        if own is None:
            unknown.append(title)
            continue
        least = min(own.values())
        size = max(e for e, share in own.items() if share <= least * (1.0 + _SAME))
        beyond = [e for e in own if e > size]
        steps = [share for e, share in own.items() if 0.0 < e < size]
        said = f"{title} ({f'{mass}, ' * bool(mass)}{number(least, 2)}"
        if least >= _KEPT:
            kept.append(f"{said})")
        elif not beyond and steps and min(steps) >= _KEPT:
            far.append(f"{said} at ε = {size:g}, at least {number(min(steps), 2)} nearer)")
        elif beyond and size and log(own[min(beyond)] / least) > _FALLS * log(min(beyond) / size):
            falls.append(f"{said} at ε = {size:g})")
        else:
            stays.append(f"{said})")
    if not (kept or falls or stays or far):
        return "No explicit step was measured: no solver hands over its system."
    text = (
        f"At least {_KEPT:g} of the explicit step of the uncut body, with the same mass, is left "
    )
    text += f"at every ε by {words_of(kept) if kept else 'nobody'}."
    for lead, names in (
        ("It falls like ε, until the cut is on nodes, with", falls),
        ("A smaller share is left, however near, by", stays),
        ("Far from nodes alone less is left by", far),
        ("Not measured:", unknown),
    ):
        text += f" {lead} {words_of(names)}." if names else ""
    return text


def _said_of_frequencies(measured: Records, families: Sequence[str]) -> str:
    """Say what each kind of mass shifts most; empty where it is not known."""
    found: dict[str, list[tuple[float, str]]] = {}
    for family in families:
        for solver in dict.fromkeys(m["solver"] for m in measured if m["solver"] != MEASURE):
            for ratio in ratios_of(measured, family, solver, FREQUENCY).values():
                where = f"{solver_title(solver)}, {family}"
                found.setdefault(mass_of(measured, solver), []).append((ratio - 1.0, where))
    most = {
        mass: max(own, key=lambda one: round(abs(one[0]), 3)) for mass, own in found.items() if mass
    }
    if "lumped" not in most:
        return ""
    said = [f"{signed(100 * off, '.1f')} % with {mass} masses ({where})"
            for mass, (off, where) in sorted(most.items(), reverse=True)]  # fmt: skip
    return (
        "A lumped mass has a price: the lowest frequency, beside that of a conforming mesh with "
        f"its consistent mass, is off by up to {words_of(said)}. "
    )


def _said_of_errors(measured: Records, families: Sequence[str]) -> str:
    """Say the largest errors over a conforming mesh's: far from nodes by ε, then nearer."""
    found: dict[str, dict[float, tuple[float, str]]] = {}
    for words, errors in _TOGETHER.items():
        own = found.setdefault(words, {})
        for family in families:
            for solver in dict.fromkeys(m["solver"] for m in measured if m["solver"] != MEASURE):
                for error in errors:
                    for size, ratio in ratios_of(measured, family, solver, error).items():
                        at = size if size > _NEAR else 0.0
                        own[at] = max(own.get(at, (0.0, "")), (ratio, solver))
    found = {words: own for words, own in found.items() if own}
    if not found:
        return "Errors are not compared: the conforming mesh did not take part."
    sizes = sorted({size for own in found.values() for size in own}, reverse=True)
    near = {words: own[0.0] for words, own in found.items() if own.get(0.0, (0.0, ""))[0] > _FAR}
    if near:
        said = [f"{words} ({solver_title(s)}, {ratio:.2f} times)"
                for words, (ratio, s) in near.items()]  # fmt: skip
        text = f"Near nodes, ε ≤ {_NEAR:g}, an error grows beyond {_FAR:g} times a conforming "
        text += f"mesh's: {words_of(said)}. "
    else:
        text = "No error grows as the cut comes near nodes. "
    heads = [f"{size:g}" for size in sizes if size] + ["nearer"] * (0.0 in sizes)
    text += "Largest errors over those of a conforming mesh of the same size, at ε = "
    text += f"{words_of(heads)}: "
    text += "; ".join(
        f"{words} {', '.join(f'{own[e][0]:.2f}' if e in own else '–' for e in sizes)}"
        for words, own in found.items()
    )
    if any(own[e][0] > _FAR for own in found.values() for e in own if e):
        text += ". Far from nodes a conforming mesh is the finer one there: it has nodes on the cut"
    return f"{text}."


def sliver_families(record: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return name, tables and curves of each family, errors without a table, failed solutions."""
    palette = Palette.of(solver_title(m["solver"]) for m in record["measurements"])
    families = []
    for family in dict.fromkeys(m["family"] for m in record["measurements"]):
        measured = listed(record["measurements"], family=family)
        solvers = list(dict.fromkeys(m["solver"] for m in measured))
        tables = [_worst_errors(measured, family, solvers),
                  _worst_systems(measured, family, solvers)]  # fmt: skip
        alike, drawn = [], [name for name in _DRAWN if listed(measured, quantity=name)]
        for error in _errors_in(measured):
            ratios = {s: ratios_of(measured, family, s, error) for s in solvers}
            if len(solvers) < 2 or not ratios.get(MEASURE):
                drawn.append(error)
            elif all(_alike(v, 1.0) for own in ratios.values() for v in own.values()):
                alike.append(_title(error))
            else:
                title = f"{_title(error)}: error over that of a conforming mesh"
                tables.append(_over_sizes(title, ratios, 3))
        for title, own, digits in (
            ("Critical explicit step over that of the uncut body with the same mass",
             {s: shares_of(measured, family, s) for s in solvers}, 2),
            ("Condition number, scaled by the diagonal",
             {s: values_of(measured, family, s, SCALED) for s in solvers}, 2),
            ("Iterations of conjugate gradients, preconditioned by the diagonal, to 1e-8 of a "
             "uniform body force",
             {s: counts_of(measured, family, s) for s in solvers}, 3),
        ):  # fmt: skip
            tables.append(_over_sizes(title, own, digits))
        failed = [m for m in measured if m["quantity"] == "solution" and m["value"] is None]
        without = [
            f"{solver_title(s)} at ε = {', '.join(f'{m["size"]:g}' for m in rows)}"
            for s in solvers if (rows := listed(failed, solver=s))
        ]  # fmt: skip
        growths = listed(record["growths"], family=family)
        families.append({
            "name": family, "alike": alike, "without": without,
            # a row or curve alone compares nothing
            "tables": [table for table in tables if len(table.rows) >= min(len(solvers), 2)],
            "curves": [*_curves(measured, growths, drawn, palette),
                       *_steps(measured, family, LUMPED, palette)],
        })  # fmt: skip
    return families


def _errors_in(measured: Records) -> list[str]:
    """Return the errors that are not a largest one, and relative errors of quantities."""
    return [
        name
        for name in dict.fromkeys(m["quantity"] for m in measured)
        if (is_error(name) and not name.endswith("_max"))
        or name.startswith(("relative", "deviation"))
    ]


def _title(error: str) -> str:
    title = _ERRORS.get(error, error_title(error) if is_error(error) else error)
    return title.removeprefix("relative error of ").replace("_", " ")


def _over_sizes(
    title: str, values: Mapping[str, Mapping[float, float | int]], digits: int = 2
) -> Table:
    """Return a row for each solver that has a value, or for equal ones, a column for each size."""
    sizes = sorted({size for own in values.values() for size in own}, reverse=True)
    rows = [(solver_title(solver), [number(own.get(size), digits) for size in sizes])
            for solver, own in values.items() if own]  # fmt: skip
    return Table(title, ["ε =", *(f"{size:g}" for size in sizes)], _grouped(rows), named=True)


def _grouped(rows: Sequence[tuple[str, list[str]]]) -> list[list[str]]:
    """Return rows with their heads, equal cells under one."""
    found: dict[tuple[str, ...], str] = {}
    for name, cells in rows:
        found[*cells] = _beside(found.get((*cells,), ""), name)
    return [[name, *cells] for cells, name in found.items()]


def _beside(names: str, name: str) -> str:
    """Add a name, of a variant of the first one without its program."""
    program, _, given = name.partition(" ")
    short = given if given and program == names.split(", ")[0].split(" ")[0] else name
    return f"{names}, {short}" if names else name


def _worst_errors(measured: Records, family: str, solvers: Sequence[str]) -> Table:
    """Return the table of the largest errors over ε, beside the conforming mesh, and at which ε."""
    rows = []
    for solver in solvers if MEASURE in solvers else ():
        found = [ratios_of(measured, family, solver, error) for error in _ERRORS]
        if any(found):
            worst = [max(own.items(), key=lambda one: (round(one[1], 3), one[0]), default=None)
                     for own in found]  # fmt: skip
            cells = ["–" if one is None else number(one[1], 3)
                     + f" at {one[0]:g}" * (not _alike(one[1], 1.0)) for one in worst]  # fmt: skip
            rows.append((solver_title(solver), cells))
    return Table("Worst over ε: errors over those of a conforming mesh of the same size",
                 ["method", *_ERRORS.values()], _grouped(rows), named=True)  # fmt: skip


def _worst_systems(measured: Records, family: str, solvers: Sequence[str]) -> Table:
    """Return the table of the worst step, frequency and condition over ε."""
    rows = []
    for solver in solvers:
        uncut = next(iter(values_of(measured, family, solver, UNCUT).values()), None)
        if uncut is None:
            continue
        least = [min(shares_of(measured, family, solver, whole).values(), default=None)
                 for whole in (UNCUT, LUMPED)]  # fmt: skip
        pitch = ratios_of(measured, family, solver, FREQUENCY).values()
        off = max((ratio - 1.0 for ratio in pitch), key=abs, default=None)
        scaled = max(values_of(measured, family, solver, SCALED).values(), default=None)
        count = max(counts_of(measured, family, solver).values(), default=None)
        rows.append([
            solver_title(solver), mass_of(measured, solver) or "–", number(uncut, 3),
            *(number(share, 3) for share in least),
            "–" if off is None else f"{signed(100 * off)} %", number(scaled, 3), number(count),
        ])  # fmt: skip
    heads = ["method", "mass of the uncut body", "uncut step, s", "least step over it",
             "least step over the uncut one with a lumped mass", "lowest frequency off conforming",
             "largest scaled condition number", "most iterations"]  # fmt: skip
    return Table("Worst over ε: explicit step and system", heads, rows, named=True)


def _curves(
    measured: Records, growths: Records, drawn: Sequence[str], palette: Palette
) -> list[Drawing | None]:
    """Return the panels of some quantities; none for a single curve among several solvers."""
    solvers = list(dict.fromkeys(m["solver"] for m in measured))
    panels = []
    for quantity in drawn:
        series = {}
        for solver in solvers:
            law = next(iter(listed(growths, solver=solver, quantity=quantity)), {})
            places = _places(measured, solver, quantity)
            series[solver] = Series(solver_title(solver), places, _law_text(law))
        joined = _joined(series)
        if len(joined) >= min(len(solvers), 2):
            title = error_title(quantity) if is_error(quantity) else quantity
            panels += _panels(title, joined, palette)
    return panels


def _steps(measured: Records, family: str, whole: str, palette: Palette) -> list[Drawing | None]:
    """Return the share of an uncut step against ε."""
    own, series = listed(measured, family=family), {}
    solvers = list(dict.fromkeys(m["solver"] for m in own))
    for solver in solvers:
        if uncut := next(iter(values_of(own, family, solver, whole).values()), None):
            places = _places(own, solver, STEP)
            over = [(size, step and step / uncut) for size, step in places]
            series[solver] = Series(solver_title(solver), over)
    joined, title = _joined(series), "explicit step over the uncut"
    if len(joined) < min(len(solvers), 2):
        return []
    title += " one with a lumped mass" if whole == LUMPED else " one"
    return _panels(title, joined, palette)


def _places(measured: Records, solver: str, quantity: str) -> list[tuple[Any, Any]]:
    """Return a curve over falling ε.

    It has a gap where the number of unknowns changes and its law with it, a power of ε.
    """
    own = listed(measured, solver=solver)
    unknowns = {m["size"]: m["value"] for m in own if m["quantity"] == UNKNOWNS}
    found = {m["size"]: m["value"] for m in own if m["quantity"] == quantity and m["size"]}
    curve: list[tuple[Any, Any]] = []
    last, before, power = None, None, 0.0
    for size in sorted(found, reverse=True):
        value = found[size]
        risen = log(value / before) / log(size / last) if value and before and last else nan
        goes_on = _alike(value, before) or abs(risen - power) < _BENDS
        if last and unknowns.get(size) != unknowns.get(last) and not goes_on:
            curve.append((None, None))
        curve.append((size, value))
        last, before, power = size, value, risen
    return curve


def _alike(one: float | None, other: float | None, most: float = _SAME) -> bool:
    if not one or not other:
        return one == other
    return abs(one - other) <= most * abs(other)


def _panels(title: str, joined: Mapping[str, Series], palette: Palette) -> list[Drawing | None]:
    """Return a panel for few curves; for more, the variants of a solver apart from the others."""
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
    values = [y for one in series.values() for _, y in one.places if y]
    within = max(_SAME, _LINE * log(max(values) / min(values))) if values else _SAME
    found: dict[str, Series] = {}
    for label, one in series.items():
        if not any(y for _, y in one.places):
            continue
        for other, kept in found.items():
            if _coincide(one, kept, within):
                names = _beside(kept.name, one.name)
                found[other] = Series(names, kept.places, kept.second)
                break
        else:
            found[label] = one
    return found


def _coincide(one: Series, other: Series, within: float) -> bool:
    """Whether a curve lies on another one, which may go on where it has no values."""
    own, rest = (
        {x: y for x, y in places if y is not None} for places in (one.places, other.places)
    )
    if own.keys() == rest.keys() and [x for x, _ in one.places] != [x for x, _ in other.places]:
        return False  # their gaps differ
    return own.keys() <= rest.keys() and all(_alike(y, rest[x], within) for x, y in own.items())


def _law_text(law: Mapping[str, Any]) -> str:
    if law.get("exponent") is None:
        return ""
    return f"∝ ε^{law['exponent'] + 0.0:.2f}".replace("-", "−").replace("−0.00", "0.00")
