"""What moves: errors, energies and momenta over time, with the instants of the cuts."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

from verify.report.markup import Markup, tag
from verify.report.notation import metric_title, number, solver_title, with_interval
from verify.report.released_line import released_lines
from verify.report.summary import badge
from verify.report.tables import table
from verify.report.time_panel import time_panel
from verify.result import CaseResult, SolveRecord, Status

__all__ = ["ACCOUNT_METRICS", "motion_section"]

ACCOUNT_METRICS = (
    "energy_drift", "energy_slope", "energy_oscillation", "energy_jump", "ledger_mismatch",
    "linear_momentum_drift", "angular_momentum_drift",
    "part_linear_momentum_drift", "part_angular_momentum_drift", "released_mismatch",
)  # fmt: skip
_PER_PANEL = 4
# parts of a ledger, the ones that tell most first; a panel has room for four
_PARTS = ("kinetic", "strain", "total", "algorithmic", "gravity", "work_of_loads",
          "work_of_supports", "damping")  # fmt: skip
_MOMENTA = (("linear_momentum", "N s"), ("angular_momentum", "N m s"))


def motion_section(result: CaseResult) -> Markup | None:
    """Return the panels over time of a case, or None if nothing in it moves."""
    moving = _finest(result.solves)
    if not moving:
        return None
    cuts = _cuts(result.scene)
    unit = "J/m" if any("linear_momentum_z" not in s.account for s in moving) else "J"
    panels = [*_errors(moving, cuts), *_energies(moving, cuts, unit),
              *_totals(moving, cuts, unit), *_momenta(moving, cuts)]  # fmt: skip
    if not panels:
        return None
    said = "Of every solver its finest level."
    if cuts:
        shown = ", ".join(f"{time:.4g} s" for time in cuts)
        said += f" Dashed vertical lines: a cut opens ({shown})."
    said += (
        " Energies are those of the solver's own ledger, or of its fields if it has none; total is "
        "what physics keeps constant, without what the time scheme takes (algorithmic). Momenta "
        "are integrated from the velocities, about the origin."
    )
    return tag(
        "div",
        tag("h3", "Over time"),
        tag("div", panels, class_="panels"),
        tag("p", said, class_="quiet"),
        *released_lines(moving),
        _kept_table(result, moving),
        _parts_table(moving),
    )


def _finest(solves: Sequence[SolveRecord]) -> list[SolveRecord]:
    """Return the finest solved level of each solver that has anything over time."""
    finest: dict[str, SolveRecord] = {}
    for solve in sorted(solves, key=lambda solve: solve.level):
        if solve.status is Status.SOLVED and (solve.account or solve.series):
            finest[solve.solver] = solve
    return list(finest.values())


def _cuts(scene: dict[str, Any]) -> list[float]:
    """Return the instants at which cuts open after the start, s."""
    cuts = scene.get("cuts")
    times = (
        [c.get("opens_at") for c in cuts if isinstance(c, dict)] if isinstance(cuts, list) else []
    )
    return sorted({float(t) for t in times if isinstance(t, int | float) and 0.0 < t < math.inf})


def _errors(solves: Sequence[SolveRecord], cuts: list[float]) -> Iterator[Markup]:
    names = dict.fromkeys(n for s in solves for n in s.series if n != "time")
    for name in [n for n in names if n in ("displacement_l2", "energy_norm", "jump_l2")]:
        curves = [(s, s.series["time"], s.series[name]) for s in solves if name in s.series]
        yield from _several(f"{metric_title(name)}", curves, cuts)


def _energies(solves: Sequence[SolveRecord], cuts: list[float], unit: str) -> Iterator[Markup]:
    for solve in solves:
        found = [
            (name, solve.account[name])
            for name in _PARTS
            if any(value for value in solve.account.get(name, []))
        ][:_PER_PANEL]
        if found:
            title = f"{solver_title(solve.solver)}: energies, {unit}"
            yield _figure(title, solve.account["time"], found, cuts)


def _totals(solves: Sequence[SolveRecord], cuts: list[float], unit: str) -> Iterator[Markup]:
    curves = [
        (s, s.account["time"], [v - s.account["total"][0] for v in s.account["total"]])
        for s in solves
        if "total" in s.account
    ]
    yield from _several(f"change of the total energy, {unit}", curves, cuts)


def _momenta(solves: Sequence[SolveRecord], cuts: list[float]) -> Iterator[Markup]:
    for name, unit in _MOMENTA:
        curves = []
        for solve in solves:
            parts = [row for key, row in solve.account.items() if key.startswith(name)]
            if parts:
                size = [math.hypot(*at) for at in zip(*parts, strict=True)]
                curves.append((solve, solve.account["time"], size))
        title = f"magnitude of the {name.replace('_', ' ')}, {unit}"
        yield from _several(title, curves, cuts)


def _several(
    title: str, curves: Sequence[tuple[SolveRecord, list[float], list[float]]], cuts: list[float]
) -> Iterator[Markup]:
    """Draw one curve per solver: those with common times together, at most four in a panel."""
    groups: dict[tuple[float, ...], list[tuple[str, list[float]]]] = {}
    for solve, time, values in curves:
        groups.setdefault(tuple(time), []).append((solver_title(solve.solver), values))
    for time_, own in groups.items():
        for first in range(0, len(own), _PER_PANEL):
            yield _figure(title, list(time_), own[first : first + _PER_PANEL], cuts)


def _figure(
    title: str, time: list[float], curves: Sequence[tuple[str, list[float]]], cuts: list[float]
) -> Markup:
    inside = [cut for cut in cuts if time[0] < cut <= time[-1]]
    return tag("figure", time_panel(title, time, curves, inside))


def _kept_table(result: CaseResult, solves: Sequence[SolveRecord]) -> Markup | None:
    """Return what is kept of energy and momenta, and what the case says about it."""
    names = [n for n in ACCOUNT_METRICS if any(s.metric(n) for s in solves)]
    if not names:
        return None
    judged = {(v.solver, v.metric): v for v in result.verdicts if v.metric in ACCOUNT_METRICS}
    rows = []
    for solve in solves:
        row: list[Any] = [solver_title(solve.solver), solve.level]
        for name in names:
            measured, verdict = solve.metric(name), judged.get((solve.solver, name))
            value = number(measured.value) if measured else "–"
            if measured and measured.uncertainty > 0:
                low = max(0.0, measured.value - measured.uncertainty)
                value = with_interval(measured.value, low, measured.value + measured.uncertainty)
            mark = [" ", badge(verdict.verdict), " ", verdict.limit] if verdict else None
            row.append([value, mark])
        rows.append(row)
    head = ["solver", "level", *(metric_title(name) for name in names)]
    return table(head, rows, "What is kept of energy and momenta, with the verdicts of the case",
                 class_="prose")  # fmt: skip


def _parts_table(solves: Sequence[SolveRecord]) -> Markup | None:
    """Return the separated parts of every solver, with what each keeps once it is free."""
    rows = []
    for solve in solves:
        for k, part in enumerate(solve.parts):
            kinetic, strain = part.series.get("kinetic", []), part.series.get("strain", [])
            rows.append([
                solver_title(solve.solver), k + 1, number(part.mass), _numbers(part.centre),
                _numbers(part.inertia),
                number(kinetic[-1]) if kinetic else "–", number(strain[-1]) if strain else "–",
                f"{part.free_from:.4g}" if part.free_from is not None else "held",
                *(number(part.drift[name]) if name in part.drift else "–"
                  for name in ("linear_momentum", "angular_momentum")),
            ])  # fmt: skip
    if not rows:
        return None
    head = [
        "solver", "part", "mass, kg", "centre, m", "inertia about its own centre, kg m²",
        "kinetic energy at the end, J", "strain energy at the end, J", "free from, s",
        "drift of its momentum", "drift of its spin",
    ]  # fmt: skip
    return table(head, rows, "Separated parts, from the top down (plane scenes: per metre)",
                 class_="prose")  # fmt: skip


def _numbers(values: Sequence[float]) -> str:
    return ", ".join(number(value) for value in values)
