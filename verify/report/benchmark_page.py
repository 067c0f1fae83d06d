"""Tables of errors and plots of time against them: of the whole benchmark, of one engine beside it.

An engine that is no package is recorded beside the compact solver, on pages of its own.
"""

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
    moves,
    pair_in,
)
from verify.report.notation import Drawing, digits_beside, number, solver_title
from verify.report.plots import Palette, Series, loglog
from verify.report.rendering import Beside
from verify.result import REFERENCE, CaseResult, Pair, SolveRecord, Status, repeated_totals

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
    busy = [label for label, own in scenes.items() if _shared(own)]
    drawn = [plot for label, own in scenes.items()
             if label not in busy and (plot := time_plot(label, own))]  # fmt: skip
    figures = [f"![{plot.alt}]({beside.drawing(plot)})" for plot in drawn]
    tables = [line for label, own in scenes.items()
              for line in _every_level(label, own, label not in busy)]  # fmt: skip
    lines = [
        "# Benchmark: the table of the whole", "",
        "[Scenes, to set up from one page each](../../benchmark/index.md)", "",
        *whole_table(evidence), "",
        " ".join([_LEGEND, *_opened_late(evidence), *_without_row(evidence)]), "",
        "## Time against error", "",
        "Wall time of what each cut costs anew, from the coarsest level to the finest; lower left "
        "is better. C5 and C8 show the middle of their members. Grey: the other discretisations."
        + (f" Not drawn, timed beside other programs: {', '.join(busy)}." if busy else ""),
        "", "\n".join(figures), "",
        "<details><summary>Errors and seconds of all, level by level</summary>", *tables, "",
        "</details>", "",
        "<details><summary>Commands</summary>", "",
        *(f"- `{evidence.commands[name]}`" for name in JUDGED
          if name in evidence.commands), "", "</details>",
    ]  # fmt: skip
    write_whole(folder / "index.md", "\n".join(lines) + "\n")


def _shared(members: Sequence[CaseResult]) -> bool:
    """Tell whether most solves of a scene shared the machine: their times are no result."""
    notes = [s.notes.get("timing", "") for r in members for s in r.solves if s.metrics]
    return 2 * sum("contended" in note for note in notes) > len(notes)


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


def _opened_late(evidence: Evidence) -> list[str]:
    """Name the solvers whose facets open behind a blade, beside others that open as it sweeps."""
    said = []
    for label, members in benchmark_scenes(evidence.results).items():
        late = {s.solver: None for r in members for s in r.solves
                if s.metrics and "has passed" in s.notes.get("a tool path opens", "")}  # fmt: skip
        if late:
            names = ", ".join(map(solver_title, late))
            said.append(f"{label}: facets of {names} open when the blade has passed them, others "
                        "as it sweeps them: an error of its own.")  # fmt: skip
    return said


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


def _middle(members: Sequence[CaseResult]) -> CaseResult:
    """Return the member of a scene that stands for it."""
    return members[len(members) // 2]


def _levels(result: CaseResult) -> dict[str, list[tuple[float | None, float]]]:
    """Return seconds, None if they were not measured, and error by solver, coarse to fine."""
    found: dict[str, list[tuple[float | None, float]]] = {}
    for solve in sorted(result.solves, key=lambda one: one.level):
        error, times = _error(solve), repeated_totals(solve.paid)
        if solve.solver != REFERENCE and error:
            found.setdefault(solve.solver, []).append((median(times) if times else None, error))
    return found


def _every_level(label: str, members: Sequence[CaseResult], timed: bool) -> list[str]:
    """Return the lines of a table: errors, and seconds if `timed`, from coarse to fine."""
    result = _middle(members)
    lines = ["", f"**{label}**, {result.case}", "",
             "| solver | relative L² error | seconds |", "| --- | --- | --- |"]  # fmt: skip
    for name, points in _levels(result).items():
        errors = ", ".join(number(error, 3) for _, error in points)
        seconds = ", ".join("–" if t is None or not timed else number(t, 2) for t, _ in points)
        title = solver_title(name) + MISSING * misses_material([result], name)
        lines.append(f"| {title} | {errors} | {seconds} |")
    return lines


def time_plot(label: str, members: Sequence[CaseResult]) -> Drawing | None:
    """Draw time against error of the middle member: six discretisations by name, others grey."""
    curves = {
        name: [(seconds, error) for seconds, error in points if seconds is not None]
        for name, points in _levels(_middle(members)).items()
    }
    curves = {name: points for name, points in curves.items() if points}
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


RIVALS = ("xfem", "conforming")
_SAID = {"rest": "At rest", "motion": "In motion"}


def write_engine(
    results: Sequence[CaseResult],
    pairs: Sequence[Pair],
    command: str,
    commit: str,
    folder: Path,
    engine: str,
    drawn: Sequence[str],
) -> None:
    """Write ``index.md`` with its pictures into `folder`, which is made if it is not there.

    Parameters
    ----------
    results : sequence of CaseResult
        Of a run of `engine` and `RIVALS`; what the engine did not answer has no row.
    pairs : sequence of Pair
        Of the engine and `RIVALS` in it.
    command, commit : str
        That made them, and of which version.
    folder : Path
    engine : str
    drawn : sequence of str
        Cases of which time is drawn against error.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    asked = list(results)
    results = [r for r in asked if any(_error(s) is not None for s in _of(r, engine))]
    beside = Beside(folder / f"{engine}-pictures")
    plots = [plot for r in results if r.case in drawn and (plot := time_plot(r.case, [r]))]
    name, titles = solver_title(engine), [solver_title(one) for one in RIVALS]
    notes = next((s.notes for r in results for s in _of(r, engine)), {})
    refused = {s.reason: r.case for r in asked for s in _of(r, engine)
               if s.status is Status.REFUSED}  # fmt: skip
    lines = [
        f"# {name} beside the compact solver", "",
        *(f"- {line}" for line in _answers(pairs, engine)), "",
        f"{name} {notes.get('version', '')}: {notes.get('scheme', '')}, mass "
        f"{notes.get('mass', '')}, on the mesh with the cut imprinted, whose making is charged, "
        "as is building the body anew where a cut opens. "
        "Recorded: the engine is no package, so `make results` makes these rows again only where "
        "it is installed.", "",
        *_turns(results, engine), *_late(results, engine),
        f"Relative L² error of the displacement on the finest level; seconds for each cut, in "
        f"motion milliseconds for each step, of {name}, {titles[0]}, {titles[1]}. ≈ the reference "
        f"cannot tell the error from none.{_timed_once(results)}", "",
        f"| scene | {' | '.join(f'{t}: error' for t in (name, *titles))} | "
        f"{' | '.join(f'{t}: time' for t in (name, *titles))} |",
        f"| --- |{' --- |' * 6}",
        *(_row(result, (engine, *RIVALS)) for result in sorted(results, key=moves)), "",
        *(f"![{plot.alt}]({beside.drawing(plot)})" for plot in plots), "",
        "<details><summary>Refused, and the command</summary>", "",
        *(f"- {reason} ({case})" for reason, case in refused.items()),
        f"- at commit {commit[:8]}: `{command}`", "", "</details>",
    ]  # fmt: skip
    write_whole(folder / "index.md", "\n".join(lines) + "\n")


def _of(result: CaseResult, name: str) -> list[SolveRecord]:
    return sorted((s for s in result.solves if s.solver == name), key=lambda s: s.level)


def _answers(pairs: Sequence[Pair], engine: str) -> list[str]:
    """Say what the pairs of the run say, at rest and in motion: error and time of `xfem`."""
    name, own = solver_title(engine), RIVALS[0]
    lines = []
    for kind, said in _SAID.items():
        some = [pair for pair in pairs if pair.kind == kind]
        texts = []
        for metric, words in ((METRIC, "error"), ("time", "time at equal error")):
            pair = pair_in(some, metric, own, engine)
            if pair is not None and pair.ratio is not None:
                texts.append(
                    f"the {words} is {number(pair.ratio, 2)} [{number(pair.low, 2)}, "
                    f"{number(pair.high, 2)}] times {name}'s over {pair.count} "
                    f"scene{'s' if pair.count != 1 else ''} "
                    f"({pair.wins} won, {pair.ties} tied, {pair.losses} lost)"
                )
        if texts:
            lines.append(f"**{said}**, of {solver_title(own)}: {'; '.join(texts)}.")
    return lines


def _timed_once(results: Sequence[CaseResult]) -> str:
    counts = {len(repeated_totals(s.paid)) for r in results for s in _of(r, RIVALS[0])}
    return " Each solve was timed once: no time is won or lost." if counts == {1} else ""


def _turns(results: Sequence[CaseResult], engine: str) -> list[str]:
    """Say by which rotations the engine's law is corotational, where the scenes' is."""
    found: dict[str, list[str]] = {}
    for result in results:
        kinematics = result.scene.get("analysis", {}).get("kinematics", "linear")
        note = next((s.notes["rotation"] for s in _of(result, engine) if "rotation" in s.notes), "")
        if note and kinematics != "linear":
            found.setdefault(note, []).append(result.case)
    said = "; ".join(f"{note} ({', '.join(cases)})" for note, cases in found.items())
    law = "The scenes' law has the polar decomposition of the deformation gradient"
    return [f"{law}. {solver_title(engine)} has the {said}.", ""] if said else []


def _late(results: Sequence[CaseResult], engine: str) -> list[str]:
    """Say that programs which are handed facets open them late, where a blade cuts."""
    blades = [
        result.case
        for result in results
        if any(cut.get("kind") == "tool_path" for cut in result.scene.get("cuts") or [])
    ]
    text = (
        f"Where a blade cuts ({', '.join(blades)}), {solver_title(engine)}'s facets open when it "
        f"has passed them, {' and '.join(map(solver_title, RIVALS))}'s as it sweeps them."
    )
    return [text, ""] if blades else []


def _row(result: CaseResult, names: Sequence[str]) -> str:
    errors, times = [], []
    for name in names:
        last = next((s for s in reversed(_of(result, name)) if _error(s) is not None), None)
        errors.append("–" if last is None else _written(last))
        times.append("–" if last is None else _duration(last))
    return f"| {result.case} | {' | '.join(errors)} | {' | '.join(times)} |"


def _written(solve: SolveRecord) -> str:
    measured = solve.metric(METRIC)
    assert measured is not None
    value, half = measured.value, measured.uncertainty or 0.0
    return "≈" if half >= value else number(value, digits_beside(value, half, 3))


def _duration(solve: SolveRecord) -> str:
    totals = repeated_totals(solve.paid)
    if not totals:
        return "–"
    steps = (solve.iterations or {}).get("steps")
    if steps:
        return f"{number(1e3 * median(totals) / steps, 2)}\N{NO-BREAK SPACE}ms"
    return f"{number(median(totals), 2)}\N{NO-BREAK SPACE}s"
