"""A page on one program of others beside two solvers of the project, from a run of its own."""

from collections.abc import Sequence
from pathlib import Path
from statistics import median

from verify.files import write_whole
from verify.report.benchmark_page import METRIC, time_plot
from verify.report.evidence import moves, pair_in
from verify.report.notation import digits_beside, number, solver_title
from verify.report.rendering import Beside
from verify.result import CaseResult, Pair, SolveRecord, Status, repeated_totals

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


def _error(solve: SolveRecord) -> float | None:
    measured = solve.metric(METRIC)
    return None if solve.status is not Status.SOLVED or measured is None else measured.value


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
