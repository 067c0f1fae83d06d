"""The benchmark's table of scenes and discretisations, and its plots of time against error."""

from collections.abc import Sequence
from pathlib import Path
from statistics import median

import numpy as np

from verify.files import write_whole
from verify.report.evidence import (
    JUDGED,
    MEASURE,
    MISSING,
    Evidence,
    benchmark_scenes,
    mesh_ratios,
    misses_material,
    pair_in,
)
from verify.report.notation import Drawing, number, solver_title
from verify.report.plots import Palette, Series, loglog
from verify.report.rendering import Beside
from verify.result import REFERENCE, CaseResult, SolveRecord, Status, repeated_totals

METRIC = "displacement_l2"
PICTURES = "benchmark-pictures"
_NAMED = 6  # curves of a plot; further ones are grey
_FIRST = ("xfem", MEASURE, "conforming mesh=remeshed")  # of the named ones
_LEGEND = (
    "Relative L² error of the displacement over the least error of the scene, at equal element "
    "size, on the finest level. **Bold**: the interval overlaps that of the best. After the "
    "semicolon: median and 90 % range of the ratio over positions of the mesh on level 1, where "
    "they were studied; where orders differ, ratios grow with the level. – refused with a reason; "
    "× asked, and not solved; blank: not asked. ≈ the reference cannot tell the error from none. "
    "Several members of a scene (C5, C8) count by their median. Programs in one row agree to 10⁻⁶. "
    "C8 motion: the norm hardly sees the small corner; its fall is judged (verdicts). "
    f"{MISSING} A part of the body is missing, which is softer; linear elements are stiffer, and "
    "the errors can cancel: it is never the least."
)


def write_benchmark(evidence: Evidence, folder: Path) -> None:
    """Write ``index.md`` with its pictures into `folder`, which is made if it is not there.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    beside = Beside(folder / PICTURES)
    scenes = benchmark_scenes(evidence.results)
    drawn = [plot for label, own in scenes.items() if (plot := time_plot(label, own))]
    figures = [f"![{plot.alt}]({beside.drawing(plot)})" for plot in drawn]
    lines = [
        "# Benchmark: the table of the whole", "",
        "[Scenes, to set up from one page each](../../benchmark/index.md)", "",
        *whole_table(evidence), "", " ".join([_LEGEND, *_without_row(evidence)]), "",
        "## Time against error", "",
        "Wall time of what each cut costs anew, from the coarsest level to the finest; lower left "
        "is better. C5 and C8 show the middle of their members. Grey: the other discretisations.",
        "", "\n".join(figures), "",
        "<details><summary>Commands</summary>", "",
        *(f"- `{evidence.commands[name]}`" for name in JUDGED
          if name in evidence.commands), "", "</details>",
    ]  # fmt: skip
    write_whole(folder / "index.md", "\n".join(lines) + "\n")


def discretisations(evidence: Evidence) -> list[list[str]]:
    """Return the solvers that have an answer, programs that agree together."""
    groups = {own[0]: list(own) for own in evidence.groups}
    confirming = {name for own in groups.values() for name in own[1:]}
    answered = {s.solver for r in evidence.results for s in r.solves if s.metrics}
    rows = [groups.get(name, [name]) for name in evidence.solvers if name not in confirming]
    return [row for row in rows if answered.intersection(row)]


def _without_row(evidence: Evidence) -> list[str]:
    """Name the solvers that were asked and have no answer, with their reasons."""
    answered = {name for row in discretisations(evidence) for name in row}
    reasons: dict[str, dict[str, None]] = {}
    for result in evidence.results:
        for solve in result.solves:
            if solve.solver not in {*answered, REFERENCE}:
                reasons.setdefault(solve.solver, {})[solve.reason] = None
    return [f"No row: {solver_title(name)} ({' · '.join(own)})." for name, own in reasons.items()]


def title_of(group: Sequence[str]) -> str:
    """Return the name of a discretisation, and whose programs confirm each other."""
    first, *rest = map(solver_title, group)
    return f"{first} (= {', '.join(rest)})" if rest else first


def whole_table(evidence: Evidence) -> list[str]:
    """Return the lines of the table: discretisations down, scenes across, the least errors last."""
    scenes, rows = benchmark_scenes(evidence.results), discretisations(evidence)
    best = {label: _best(own, [name for row in rows for name in row])
            for label, own in scenes.items()}  # fmt: skip
    lines = [
        f"| discretisation | {' | '.join(scenes)} |",
        f"| --- |{' --- |' * len(scenes)}",
    ]
    for row in rows:
        cells = [_cell(evidence, label, own, row, best[label]) for label, own in scenes.items()]
        lines.append(f"| {title_of(row)} | {' | '.join(cells)} |")
    least = [_least(own, best[label]) for label, own in scenes.items()]
    return [*lines, f"| *least error* | {' | '.join(least)} |"]


def _cell(
    evidence: Evidence, label: str, members: Sequence[CaseResult], group: Sequence[str],
    best: str | None,
) -> str:  # fmt: skip
    """Return error over the least one of a discretisation in a scene, or why there is none."""
    for name in group:
        solves = [s for r in members for s in r.solves if s.solver == name]
        if best is None or not any(_error(s) for s in solves):
            continue
        if name == best or best in group:
            return "**1**"
        found = pair_in(evidence.pairs.get(label, ()), METRIC, name, best)
        if found is None:
            return "other size"
        scatter = _scatter(evidence, members, name, best)
        if found.ratio is None:
            return "≈" if found.ties else "not exact"
        text = number(found.ratio, 2)
        if scatter:
            middle, low, high = (number(value, 2) for value in scatter)
            text += f"; {middle} [{low}, {high}]"
        text += MISSING * misses_material(members, name)
        return f"**{text}**" if found.ties >= max(found.wins, found.losses) else text
    statuses = {s.status for r in members for s in r.solves if s.solver in group}
    return "" if not statuses else "–" if statuses == {Status.REFUSED} else "×"


def _error(solve: SolveRecord) -> float | None:
    measured = solve.metric(METRIC)
    if solve.status is not Status.SOLVED or measured is None:
        return None
    return measured.value if np.isfinite(measured.value) else None


def _finest(members: Sequence[CaseResult], name: str) -> list[float]:
    """Return the error of a solver on its finest level, of each member that it answered."""
    found = []
    for result in members:
        errors = {s.level: e for s in result.solves
                  if s.solver == name and (e := _error(s)) is not None}  # fmt: skip
        found += [errors[max(errors)]] if errors else []
    return found


def _best(members: Sequence[CaseResult], names: Sequence[str]) -> str | None:
    """Return the solver of the least error among those that answered most members, in full."""
    whole = [name for name in names if not misses_material(members, name)]
    found = {name: own for name in whole if (own := _finest(members, name))}
    most = max(map(len, found.values()), default=0)
    full = {name: median(own) for name, own in found.items() if len(own) == most}
    return min(full, key=lambda name: full[name], default=None)


def _least(members: Sequence[CaseResult], best: str | None) -> str:
    return "" if best is None else number(median(_finest(members, best)), 2)


def _scatter(
    evidence: Evidence, members: Sequence[CaseResult], name: str, best: str
) -> list[float] | None:
    """Return median and 90 % range of a ratio over positions of the mesh, if it was studied."""
    cases = {result.case for result in members}
    rows = evidence.benchmark_positions
    by_scene = mesh_ratios(rows, METRIC, name, best, cases.__contains__)
    ratios = [ratio for own in by_scene.values() for ratio in own]
    if not ratios:
        return None
    return [float(value) for value in np.quantile(ratios, [0.5, 0.05, 0.95])]


def time_plot(label: str, members: Sequence[CaseResult]) -> Drawing | None:
    """Draw time against error of the middle member: six discretisations by name, others grey."""
    result = members[len(members) // 2]
    curves: dict[str, list[tuple[float, float]]] = {}
    for solve in sorted(result.solves, key=lambda one: one.level):
        error, times = _error(solve), repeated_totals(solve.paid)
        if solve.solver != REFERENCE and error and times:
            curves.setdefault(solve.solver, []).append((median(times), error))
    least = {name: places[-1][1] for name, places in curves.items()}
    ordered = [name for name in _FIRST if name in curves]
    ordered += sorted((n for n in curves if n not in ordered), key=lambda name: least[name])
    named: list[str] = []
    for name in ordered:  # of those with one error, the first
        same = any(abs(least[name] - least[n]) <= 1e-6 * least[n] for n in named)
        named += [] if same or len(named) == _NAMED else [name]
    series = [Series(solver_title(name), curves[name]) for name in ordered]
    shown = [s for s, name in zip(series, ordered, strict=True) if name in named]
    grey = [s for s, name in zip(series, ordered, strict=True) if name not in named]
    title = f"{label}: relative L² error of the displacement"
    return loglog(title, "seconds", shown, Palette(), grey=grey)
