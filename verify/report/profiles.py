"""Curves of a case over time and along its cuts: errors, balances, openings, pressures."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from verify.report.notation import (
    Cell,
    Drawing,
    Figure,
    Table,
    error_text,
    metric_title,
    number,
    solver_title,
)
from verify.report.plots import Palette, profile_panel
from verify.result import (
    REFERENCE,
    CaseResult,
    OpeningCurve,
    OpeningProfile,
    SolveRecord,
    Status,
    finest_of,
)

BALANCE_METRICS = (
    "energy_drift", "energy_slope", "energy_oscillation", "energy_jump", "ledger_mismatch",
    "linear_momentum_drift", "angular_momentum_drift",
    "part_linear_momentum_drift", "part_angular_momentum_drift", "released_mismatch",
)  # fmt: skip
_SHOWN = 3
# parts of an energy balance, the ones that tell most first; the first that are not zero are drawn
_WORDS = {
    "kinetic": "kinetic energy",
    "strain": "strain energy",
    "algorithmic": "energy that the time scheme took",
    "gravity": "potential energy of gravity",
    "work_of_loads": "work of the loads",
    "work_of_supports": "work of the supports",
    "damping": "energy that damping took",
    "cut_work": "energy that the released cut took",
    "projection": "energy lost where a state is projected",
}
Curve = tuple[str, list[float], list[float]]  # solver, times, values
Band = tuple[list[float], list[float], list[float]]  # times, lower edge, upper edge

_MOMENTA = (("linear_momentum", "N s"), ("angular_momentum", "N m s"))
_OF_MOMENTA = ("linear_momentum_drift", "angular_momentum_drift")


@dataclass(frozen=True)
class MotionView:
    """The panels over time of a case, of every solver its finest level."""

    panels: list[Drawing]
    cuts: str
    unresolved: str
    released: Table | None
    drifts: Table | None
    solves: list[SolveRecord]


def motion_view(result: CaseResult, palette: Palette) -> MotionView | None:
    """Return the panels over time of a case, or None if nothing in it moves."""
    solved = (s for s in result.solves if s.status is Status.SOLVED and (s.account or s.series))
    moving = list(finest_of(solved).values())
    if not moving:
        return None
    cuts = _cuts(result.scene)
    unit = "J/m" if any("linear_momentum_z" not in s.account for s in moving) else "J"
    hidden = _hidden(moving)
    panels = [panel for title, curves, band in _over_time(result, moving, hidden, unit)
              for panel in _panels(title, curves, band, cuts, palette)]  # fmt: skip
    if not panels:
        return None
    shown = ", ".join(f"{time:.4g} s" for time in cuts)
    unresolved = "; ".join(f"{metric_title(name)}: {', '.join(map(solver_title, whose))}"
                           for name, whose in hidden.items() if whose)  # fmt: skip
    return MotionView(panels, shown, unresolved, released_table(moving),
                      _drifts_table(result, moving), moving)  # fmt: skip


def _cuts(scene: dict[str, Any]) -> list[float]:
    """Return the instants at which cuts open after the start, s."""
    times = [cut.get("opens_at") for cut in scene.get("cuts") or [] if isinstance(cut, dict)]
    return sorted({float(t) for t in times if isinstance(t, int | float) and 0.0 < t < math.inf})


def _hidden(solves: Sequence[SolveRecord]) -> dict[str, list[str]]:
    """Return by error the solvers whose largest over time is not above its uncertainty."""
    largest = {name: [(s.solver, s.metric(f"{name}_max")) for s in solves if name in s.series]
               for name in ("displacement_l2", "energy_norm", "jump_l2")}  # fmt: skip
    return {name: [solver for solver, m in of if m is not None and m.value <= m.uncertainty]
            for name, of in largest.items()}  # fmt: skip


def _over_time(
    result: CaseResult, solves: Sequence[SolveRecord], hidden: dict[str, list[str]], unit: str
) -> Iterator[tuple[str, list[Curve], Band | None]]:
    """Yield title, curves and band of each panel: errors, energies, forces, momenta."""
    for name, below in hidden.items():
        shown = [s for s in solves if name in s.series and s.solver not in below]
        halves = [m.uncertainty for s in shown if (m := s.metric(f"{name}_max")) is not None]
        times = shown[0].series["time"] if shown else []
        band = (times, [0.0] * len(times), [max(halves)] * len(times)) if halves else None
        curves = [(s.solver, s.series["time"], s.series[name]) for s in shown]
        yield metric_title(name), curves, band
    levels = [s for s in result.solves if s.solver == REFERENCE and s.status is Status.SOLVED]
    levels = sorted(levels, key=lambda s: s.level)[-2:]

    def panel(title: str, of: Callable[[SolveRecord], list[float]]) -> Any:
        curves = [(s.solver, s.account["time"], own) for s in solves if (own := of(s))]
        return title, curves, _between([(s.account["time"], of(s)) for s in levels if of(s)])

    parts = [name for name in _WORDS if any(any(s.account.get(name, [])) for s in solves)]
    for name in parts[:_SHOWN]:
        yield panel(f"{_WORDS[name]}, {unit}", partial(_part, name))
    yield panel(f"change of the total energy, {unit}", _change)
    for title, name in _blade_forces(solves):
        yield panel(f"{title}, {unit.replace('J', 'N')}", partial(_part, name))
    for metric in {m.name: m for s in solves for m in s.metrics}.values():
        if any(f"quantity_{metric.name}" in s.account for s in solves):
            yield panel(f"{metric.name}, {metric.unit}", partial(_part, f"quantity_{metric.name}"))
    for name, unit_ in _MOMENTA:
        yield panel(f"magnitude of the {name.replace('_', ' ')}, {unit_}", partial(_size, name))


def _part(name: str, solve: SolveRecord) -> list[float]:
    return list(solve.account.get(name, []))


def _change(solve: SolveRecord) -> list[float]:
    total = solve.account.get("total", [])
    return [value - total[0] for value in total]


def _size(name: str, solve: SolveRecord) -> list[float]:
    rows = [row for key, row in solve.account.items() if key.startswith(name)]
    return [math.hypot(*at) for at in zip(*rows, strict=True)]


def _between(levels: Sequence[tuple[list[float], list[float]]]) -> Band | None:
    """Return the last level ± its difference from the one before, at the same times."""
    if len(levels) < 2 or levels[0][0] != levels[1][0]:
        return None
    (_, coarse), (times, fine) = levels
    halves = [abs(a - b) for a, b in zip(coarse, fine, strict=True)]
    return (times, *_edges(fine, halves))


def _edges(middle: Sequence[float], half: Sequence[float]) -> tuple[list[float], list[float]]:
    low, high = ([v + s * w for v, w in zip(middle, half, strict=True)] for s in (-1, 1))
    return low, high


def _blade_forces(solves: Sequence[SolveRecord]) -> Iterator[tuple[str, str]]:
    """Yield title and name of the forces on each blade: driving it, and left of the toughness."""
    names = dict.fromkeys(name for s in solves for name in s.account)
    for prefix, words in (
        ("driving_force_", "driving force of the blade"),
        ("resistance_", "resistance against the blade"),
    ):
        for name in names:
            if name.startswith(prefix):
                yield f"{words} of {name.removeprefix(prefix)}, over two outputs", name


def _panels(
    title: str, curves: Sequence[Curve], band: Band | None, cuts: list[float], palette: Palette
) -> Iterator[Drawing]:
    """Draw one curve per solver, those with common times together."""
    groups: dict[tuple[float, ...], list[tuple[str, list[float]]]] = {}
    for solver, time, values in curves:
        groups.setdefault(tuple(time), []).append((solver_title(solver), values))
    for times, own in groups.items():
        inside = [cut for cut in cuts if times[0] < cut <= times[-1]]
        edges = band[1:] if band and tuple(band[0]) == times else None
        yield profile_panel(title, times, own, palette, inside, band=edges)


def _drifts_table(result: CaseResult, solves: Sequence[SolveRecord]) -> Table | None:
    """Return the drifts of energy and momenta, and what the case says about them."""
    judged = {(v.solver, v.metric): v for v in result.verdicts if v.metric in BALANCE_METRICS}
    free = not (result.scene.get("loads") or result.scene.get("supports"))
    asked = {metric for _, metric in judged}
    # what loads and supports change is no drift
    names = [n for n in BALANCE_METRICS if any(s.metric(n) for s in solves)
             and (n in asked or free or n not in _OF_MOMENTA)]  # fmt: skip
    if not names:
        return None
    rows = []
    for solve in solves:
        row: list[str | Cell] = [solver_title(solve.solver), str(solve.level)]
        for name in names:
            measured, verdict = solve.metric(name), judged.get((solve.solver, name))
            value = error_text(measured.value, measured.uncertainty) if measured else "–"
            said, limit = (str(verdict.verdict), verdict.limit) if verdict else ("", "")
            row.append(Cell(value, limit, verdict=said))
        rows.append(row)
    head = ["solver", "level", *(metric_title(name) for name in names)]
    caption = "Drifts of energy and momenta, with the verdicts of the case"
    return Table(caption, head, rows, "prose")


_PARTS = {
    "released_to_cut": "taken at the cut",
    "released_to_scheme": "dissipated by the scheme",
    "released_to_damping": "by damping",
    "released_to_kinetic": "kinetic energy beside the exact field",
    "released_to_strain": "strain energy beside it",
    "released_to_short_waves": "kinetic energy of waves shorter than four elements",
}


def released_table(solves: Sequence[SolveRecord]) -> Table | None:
    """Return where the energy went, per unit advance of the blade; None if no blade advances."""
    cells = [(solve, {name: _cell(solve, name) for name in _PARTS}) for solve in solves]
    shown = [name for name in _PARTS if any(own[name] for _, own in cells)]
    rows = []
    for solve, own in cells:
        whole = solve.metric("released")
        released = "–" if whole is None else number(whole.value, 3)
        if any(own.values()):
            parts = [own[name] or "–" for name in shown]
            rows.append([solver_title(solve.solver), released, *parts])
    head = ["solver", "released", *(_PARTS[name] for name in shown)]
    caption = "Energy released per unit advance of the blade, J/m², and what became of it"
    return Table(caption, head, rows, "prose") if rows else None


def _cell(solve: SolveRecord, name: str) -> Cell | None:
    """Return a part in J/m², or as a share of what was released; or why there is none."""
    if why := solve.notes.get(name):
        return Cell("unavailable", why)
    part, whole = solve.metric(name), solve.metric("released")
    if part is None:
        return None
    if whole is None or not whole.value:
        return Cell(number(part.value, 3))
    # round-off of nothing is nothing
    return Cell(f"{round(100 * part.value / whole.value) + 0:d} %")


_FAR = 20.0  # times the reference's largest jump, and longer than the cut: it would hide the others
_NOTHING = 1e-12  # of the length of the line: jumps below are round-off


def opening_figures(result: CaseResult, palette: Palette) -> list[Figure]:
    """Return the profiles along every cut; a figure without panels is a sentence."""
    return [f for profile in result.openings for f in _figures(profile, result, palette)]


def _figures(profile: OpeningProfile, result: CaseResult, palette: Palette) -> Iterator[Figure]:
    curves = [c for c in profile.curves if len(c.normal) == len(profile.arc) > 1]
    if not curves:
        return
    when = "" if profile.time is None else f", at {profile.time:.4g} s ({profile.why})"
    place = f"{profile.cut}{when}"
    length = profile.arc[-1] - profile.arc[0]
    reference = next((c for c in curves if c.solver == REFERENCE), None)
    largest = max(map(_largest, curves))
    scale = _largest(reference) if reference else min(map(_largest, curves))
    far = [c for c in curves if c is not reference and _largest(c) > max(_FAR * scale, length)]
    others = [c for c in curves if c is not reference and c not in far]
    left_out = ", ".join(f"{_name(c)} (up to {_largest(c):.2g} m)" for c in far)
    pressures = _panel(profile, "pressure", reference, others, 0.0, palette)
    if largest <= _NOTHING * length:
        said = f"{place}: the jump is zero along the whole cut, to round-off."
        yield Figure([pressures] if pressures else [], said)
        return
    panels = [
        panel
        for part in ("normal", "tangential")
        if (panel := _panel(profile, part, reference, others, _NOTHING * length, palette))
    ]
    panels += [pressures] if pressures else []
    said = f"{place}: {profile.where}. {_band_text(reference, result)}"
    yield Figure(panels, said + (f" Off the scale, and left out: {left_out}." if far else ""))


def _largest(curve: OpeningCurve) -> float:
    """Return the largest jump of a curve, m; infinite if it has one that is not finite."""
    values = [abs(v) for v in (*curve.normal, *curve.tangential)]
    return max(values, default=0.0) if all(map(math.isfinite, values)) else math.inf


def _panel(
    profile: OpeningProfile, part: str, reference: OpeningCurve | None,
    others: Sequence[OpeningCurve], nothing: float, palette: Palette,
) -> Drawing | None:  # fmt: skip
    shown = [*([reference] if reference else []), *others]
    curves = [(_name(c), values) for c in shown if (values := getattr(c, part))]
    if all(abs(v) <= nothing for _, values in curves for v in values if math.isfinite(v)):
        return None
    band = None
    if reference is not None and any(half := getattr(reference, f"{part}_band")):
        band = _edges(getattr(reference, part), half)
    title = f"{profile.cut}: {'pressure, Pa' if part == 'pressure' else f'{part} jump, m'}"
    return profile_panel(title, profile.arc, curves, palette, x_title="arc length, m", band=band)


def _name(curve: OpeningCurve) -> str:
    if curve.solver == REFERENCE:
        return "exact" if curve.level is None else "reference"
    return solver_title(curve.solver)


def _band_text(reference: OpeningCurve | None, result: CaseResult) -> str:
    if reference is None:
        return "There is no reference to draw."
    source = result.reference.source or "unnamed"
    if reference.level is None:
        return f"The reference ({source}) has no uncertainty."
    if not reference.normal_band:
        return f"The reference ({source}) has too few levels for a band of uncertainty."
    widest = max(reference.normal_band)
    return (
        f"Grey band: uncertainty of the reference ({source}) from the differences of its levels, "
        f"at most {widest:.2g} m of the normal jump."
    )
