"""Front pages of the results and of the ranked run: answers and figures."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

from verify.files import write_whole
from verify.report.benchmark_page import discretisations, time_plot, title_of
from verify.report.conclusions import STILL, Answer, drifts, steps_kept
from verify.report.evidence import (
    MEASURE,
    MISSING,
    Beside,
    Evidence,
    benchmark_scenes,
    beside,
    dimension_of,
    ends_inside,
    misses_material,
    moves,
)
from verify.report.notation import Drawing, number, solver_title
from verify.report.plots import Bar, Palette, Ranged, Series, bars, loglog, ranges
from verify.report.rendering import Beside as Pictures
from verify.report.rendering import in_markdown
from verify.result import CaseResult, Status, Verdict

PICTURES = "front-pictures"
_STEPS = (
    "xfem", "snapping_subdivision", "xfem mass=gevs", "xfem mass=consistent", "subdivision",
    MEASURE,
)  # fmt: skip
_FAR = 10.0  # ratios beyond it, or below its inverse, would press the others onto one line
_RISE = 10.0  # of a step from one ε to the next: another mesh
_CONTROLS = ("uncut", "mass_spring")
_OF_THE_ARENA = ("Accuracy at rest", "Accuracy at a tip", "A moving body, a blade, real time",
                 "Why (not) remesh?", "What it costs")  # fmt: skip
_RATIOS = {"Accuracy at rest": "through", "Accuracy at a tip": "tip",
           "A moving body, a blade, real time": "motion"}  # fmt: skip
_SCENES = {"through": "Cuts that go through", "tip": "Cuts that end inside", "motion": "In motion"}


def write_front(
    evidence: Evidence, answers: Sequence[Answer], folder: Path, head: str, links: Sequence[str]
) -> None:
    """Write ``index.md`` with its pictures into `folder`.

    Parameters
    ----------
    evidence : Evidence
    answers : sequence of Answer
    folder : Path
    head : str
        What stands below the title: where the numbers come from.
    links : sequence of str
        Lines that lead to the other pages.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    pictures = _pictures(folder, figures(evidence))
    lines = ["# Which way to cut?", "", head, ""]
    for own in answers:
        lines += [*_answered(evidence, own), *pictures.get(own.question, [])]
        if kind := _RATIOS.get(own.question):
            lines += _differences(evidence, kind)
    lines += ["## All results", "", " · ".join(links)]
    write_whole(folder / "index.md", "\n".join(lines) + "\n")


def arena_head(evidence: Evidence, answers: Sequence[Answer], folder: Path) -> list[str]:
    """Return the first lines of the page of the ranked run: answers, coverage, kinds of scenes."""
    shown = _pictures(folder, coverage(evidence))
    lines: list[str] = []
    for own in answers:
        if own.question in _OF_THE_ARENA:
            told = " ".join(one.text for one in own.found.values() if one.source == "arena")
            lines += [f"- **{own.question}**: {told}"] if told else []
    verdicts = [v for result in evidence.results for v in result.verdicts]
    failed = [v.solver for v in verdicts if v.verdict is Verdict.FAIL]
    counts = Counter(str(v.verdict) for v in verdicts if v.solver == "xfem")
    long = ", C7's among them" if evidence.long_run else ""
    others = Counter(name for name in failed if name not in _CONTROLS).most_common()
    lines.append(
        f"- **Verdicts of XFEM**: of {counts.total()} checks{long}, {counts['FAIL']} "
        f"[failed](verdicts.md) and {counts['UNDECIDED']} are undecided. Of all {len(failed)} "
        f"failures {sum(name in _CONTROLS for name in failed)} are of the controls "
        f"{' and '.join(_CONTROLS)}; of the others "
        f"{', '.join(f'{solver_title(name)} {count}' for name, count in others) or 'none'}."
    )
    pictures = " ".join(figure[0] for figure in shown.values())
    return [*lines, "", pictures, "", *answered(evidence), "", *combined(evidence)]


def combined(evidence: Evidence) -> list[str]:
    """Return the lines of a table of what scenes combine."""
    lines = ["Scenes by what they combine, a sweep counted once; **none**: not tested:", "",
             f"| scenes | {' | '.join(_KINDS)} |", "|---" * (len(_KINDS) + 1) + "|"]  # fmt: skip
    for where, dimension in _WHERE.items():
        for mechanics in _MECHANICS:
            own = [
                r
                for r in evidence.results
                if dimension_of(r.scene) == dimension and _mechanics(r) == mechanics
            ]
            found = [{_sweep(r) for r in own if of(r)} for of in _KINDS.values()]
            cells = [str(len(names)) if names else "**none**" for names in found]
            lines.append(f"| {where}, {mechanics} | {' | '.join(cells)} |")
    return lines


def answered(evidence: Evidence) -> list[str]:
    """Return the lines of two tables, plane and space: scenes answered of asked, by solver.

    They are counted as in `Evidence.coverage`, the sum of a row without its last three columns.
    """
    columns: dict[str, Callable[[CaseResult], bool]] = dict(_KINDS)
    columns |= {m: partial(_combines, mechanics=m) for m in list(_MECHANICS)[:-1]}
    lines = ["Answered of asked, however wrong; the last three columns pick out of the others:"]
    for where, dimension in _WHERE.items():
        own = [r for r in evidence.results if dimension_of(r.scene) == dimension]
        lines += ["", f"| {where} | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
        for solver in (name for name in evidence.solvers if name not in _CONTROLS):
            cells = [_share([r for r in own if of(r)], solver) for of in columns.values()]
            lines.append(f"| {solver_title(solver)} | {' | '.join(cells)} |")
    return lines


def _share(results: Sequence[CaseResult], solver: str) -> str:
    """Count the scenes that a solver answered of those that it was asked; a dash if of none."""
    members: dict[str, list[bool]] = {}
    for result in results:
        if own := [s for s in result.solves if s.solver == solver]:
            done = any(s.status is Status.SOLVED and s.metrics for s in own)
            members.setdefault(_sweep(result), []).append(done)
    answers = sum(2 * sum(each) > len(each) for each in members.values())
    return f"{answers} of {len(members)}" if members else "–"


def _sweep(result: CaseResult) -> str:
    return result.case.partition("[")[0]


def _mechanics(result: CaseResult) -> str:
    return next(name for name, of in _MECHANICS.items() if of(result.scene))


def _combines(result: CaseResult, mechanics: str) -> bool:
    return _mechanics(result) == mechanics


def _asks(scene: Mapping[str, Any], table: str, key: str) -> str:
    return str((scene.get(table) or {}).get(key) or "")


def _opens_by_a_blade(result: CaseResult) -> bool:
    return any(cut.get("kind") == "tool_path" for cut in result.scene.get("cuts") or [])


_WHERE = {"plane": 2, "space": 3}
_KINDS: dict[str, Callable[[CaseResult], bool]] = {
    "at rest, cut through": lambda r: not moves(r) and not ends_inside(r.scene),
    "at rest, cut ends inside": lambda r: not moves(r) and ends_inside(r.scene),
    "in motion, opened at once": lambda r: moves(r) and not _opens_by_a_blade(r),
    "in motion, by a blade": lambda r: moves(r) and _opens_by_a_blade(r),
}
_MECHANICS: dict[str, Callable[[Mapping[str, Any]], bool]] = {
    "faces that close": lambda s: _asks(s, "contact", "expected") == "closed",
    "neo-Hookean": lambda s: "neo" in _asks(s, "material", "model"),
    "turning far": lambda s: _asks(s, "analysis", "kinematics") not in ("", "linear"),
    "none of these": lambda s: True,
}


def figures(evidence: Evidence) -> dict[str, Drawing | None]:
    """Return the figures of the front page by question; None where a run has no numbers for it."""
    first = next(iter(benchmark_scenes(evidence.results).items()), None)
    long_run = [Ranged(solver_title(n), v) for n, v in drifts(evidence).items() if v > 0.0]
    return {
        **{question: _ratios(evidence, kind) for question, kind in _RATIOS.items()},
        "Explicit steps with slivers": loglog(
            "Critical explicit step over the uncut body's, each with its own mass",
            "distance ε of the cut from nodes, in elements",
            [Series(solver_title(name), _until_moved(steps_kept(evidence, name)))
             for name in _STEPS],
            Palette(), falling=True),
        "Long runs without drift": ranges(
            "Energy drift over the 10 000 steps of C7, and its limit", "relative", long_run,
            Palette(), STILL),
        "What it costs": time_plot(*first) if first else None,
    }  # fmt: skip


def _until_moved(steps: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return steps up to the ε from which on a cut is moved onto the nodes: they rise at once."""
    ends = [i for i, (a, b) in enumerate(pairwise(steps), 1) if b[1] > _RISE * a[1]]
    return list(steps[: ends[0]] if ends else steps)


def _compared(evidence: Evidence, kind: str) -> Iterator[tuple[str, Beside]]:
    """Yield each discretisation beside the measure."""
    for group in discretisations(evidence):
        if MEASURE not in group:
            found = (beside(evidence, kind, "displacement_l2", name) for name in group)
            if (own := next((one for one in found if one is not None), None)) is not None:
                gone = any(misses_material(evidence.results, name) for name in group)
                yield title_of(group) + MISSING * gone, own


def _ratios(evidence: Evidence, kind: str) -> Drawing | None:
    """Draw errors over the measure's, over positions of the mesh or else over scenes."""
    found = list(_compared(evidence, kind))
    studied = any(own.scatter for _, own in found)
    rows = [
        Ranged(name + ("*" if studied and not own.scatter else ""),
               *(own.scatter or (own.ratio, own.low, own.high)))
        for name, own in found if 1 / _FAR <= _middle(own) <= _FAR
    ]  # fmt: skip
    rows.sort(key=lambda row: row.value)
    over = "90 % over mesh positions (* over scenes)" if studied else "range over scenes"
    if any(MISSING in row.name for row in rows):
        over += f"; {MISSING} a part is missing"
    title = f"{_SCENES[kind]}: error over a conforming mesh's"
    return ranges(title, f"median, {over}", rows, Palette(), 1.0, (1 / _FAR, _FAR))


def _middle(own: Beside) -> float:
    return own.scatter[0] if own.scatter else own.ratio


def _differences(evidence: Evidence, kind: str) -> list[str]:
    """Say which differences positions of the mesh show, and which ratios are off the scale.

    Without the controls, which are far off by design.
    """
    found = list(_compared(evidence, kind))
    shown = {
        "less accurate": [n for n, own in found if own.scatter and own.scatter[1] > 1.0],
        "more accurate": [n for n, own in found if own.scatter and own.scatter[2] < 1.0],
        "off the axis": [f"{n} {number(_middle(own), 2)}" for n, own in found
                         if not 1 / _FAR <= _middle(own) <= _FAR and n not in _CONTROLS],
    }  # fmt: skip
    told = [f"{what}: {', '.join(names)}" for what, names in shown.items() if names]
    text = "; ".join(told)
    return [f"*{text[0].upper()}{text[1:]}.*", ""] if told else []


def coverage(evidence: Evidence) -> dict[str, Drawing | None]:
    """Return a figure for scenes at rest and one for those in motion: answered of asked."""
    found = evidence.coverage
    drawn: dict[str, Drawing | None] = {}
    for kind, words in (("rest", "at rest"), ("motion", "in motion")):
        rows = [(n, own[kind][0], own[kind][1]) for n, own in found.items() if own[kind][1]]
        rows.sort(key=lambda row: -row[1] / row[2])
        parts = [Bar(solver_title(name), done / asked, 0.0, f"{done} of {asked}")
                 for name, done, asked in rows]  # fmt: skip
        title = f"Scenes {words}: answered of asked"
        said = ", ".join(f"{part.name} {part.written}" for part in parts)
        drawn[words] = bars(title, parts, f"{title}. {said}.") if parts else None
    return drawn


def _pictures(folder: Path, drawn: dict[str, Drawing | None]) -> dict[str, list[str]]:
    written = Pictures(folder / PICTURES)
    return {
        question: [f"![{in_markdown(one.alt)}]({written.drawing(one)})", ""]
        for question, one in drawn.items() if one is not None
    }  # fmt: skip


def _answered(evidence: Evidence, own: Answer) -> list[str]:
    """Return a question, its sentences, the parts not shown, and folded the numbers."""
    lines = [f"## {own.question}", ""]
    if told := " ".join(one.text for one in own.found.values()):
        lines += [told, ""]
    if own.lacking:
        lines += [f"*Not shown by this run: {'; '.join(own.lacking)}.*", ""]
    if own.found:
        lines += ["<details><summary>Numbers and command</summary>", ""]
        lines += [f"- **{name}**: {one.numbers}. Needed: {one.needs}."
                  for name, one in own.found.items()]  # fmt: skip
        sources = dict.fromkeys(one.source for one in own.found.values())
        lines += [f"- `{evidence.commands[n]}`" for n in sources if n in evidence.commands]
        lines += ["", "</details>", ""]
    return lines
