"""Sentences of the front page: templates with thresholds, held against the numbers of the runs.

`QUESTIONS` lists the sentences, `answer` evaluates them. A threshold stands beside its reason.
Some were chosen when earlier results were known: docs/theory/history.md.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from verify.errors import InputError
from verify.report.evidence import MEASURE, Beside, Evidence, beside, is_solid, moves
from verify.report.notation import number
from verify.result import REFERENCE, CaseResult, finest_of

# The cases C3 and C8 grant it to a method that cuts through elements.
QUARTER = 1.25
# Solves that share a core with others may take up to twice as long: no smaller factor is claimed.
TWICE = 2.0
# As in `verify study slivers`: a tenth is what a smaller safety factor would cost anyway.
KEPT = 0.9
# A step ten times smaller is lost: no explicit scheme is chosen then.
LOST = 0.1
# The limit of C7: the square of the angle turned in a step, a few times over.
STILL = 5e-6
# A ratio of fewer scenes is theirs: as many as the protocol asks of programs that are one.
FEWEST = 3
FRAME = 1 / 60  # s: the slowest screen in use; each step of a simulator has to fit


@dataclass(frozen=True)
class Found:
    """A sentence with its numbers: `needs` is the threshold in words, `holds` what came of it."""

    text: str
    numbers: str
    needs: str
    holds: bool
    source: str = "arena"


@dataclass(frozen=True)
class Sentence:
    """A template: `of` returns None where the runs have no numbers for it."""

    name: str
    lacks: str
    of: Callable[[Evidence], Found | None]


@dataclass(frozen=True)
class Answer:
    """A question with its sentences by name, and what the runs do not show."""

    question: str
    found: dict[str, Found]
    lacking: list[str]


def answer(evidence: Evidence) -> list[Answer]:
    """Fill in all sentences.

    Raises
    ------
    InputError
        If the numbers do not support one; with its name, its numbers, and what to do.
    """
    answers, wrong = [], []
    for question, sentences in QUESTIONS.items():
        found = {one.name: one.of(evidence) for one in sentences}
        told = {name: one for name, one in found.items() if one is not None}
        wrong += [
            f"  {name}: {one.text}\n    numbers: {one.numbers}\n    needed: {one.needs}"
            for name, one in told.items()
            if not one.holds
        ]
        lacking = [one.lacks for one in sentences if found[one.name] is None]
        answers.append(Answer(question, told, lacking))
    if wrong:
        raise InputError(
            "the numbers of this run do not support:\n" + "\n".join(wrong) + "\nRewrite these "
            "sentences so that they say what the numbers show, or remove them from QUESTIONS. Do "
            "not move a threshold without a row in docs/theory/history.md",
            "verify/report/conclusions.py",
        )
    return answers


def _claimed(
    evidence: Evidence, kind: str, metric: str, solver: str, rival: str = MEASURE
) -> Beside | None:
    """Hold a solver against another; None where they have fewer than `FEWEST` scenes in common."""
    own = beside(evidence, kind, metric, solver, rival)
    return own if own is not None and own.count >= FEWEST else None


def _close(
    evidence: Evidence, kind: str, template: str, least: float = 0.0, most: float = QUARTER
) -> Found | None:
    """Claim that XFEM's error over the measure's lies between two numbers."""
    own = _claimed(evidence, kind, "displacement_l2", "xfem")
    if own is None:
        return None
    bounds = [f"at least {least:g}"] * (least > 0.0) + [f"at most {most:g}"]
    text = template.format(number(own.ratio, 2))
    if own.scatter is not None:
        text += f"{own.over_positions}."
    return Found(text, own.written, f"medians {', '.join(bounds)}", own.within(least, most))


def _weighed(
    evidence: Evidence, kind: str, metric: str, solver: str, rival: str, factor: float,
    words: Sequence[str],
) -> Found | None:  # fmt: skip
    """Say which of two is better from `factor` on: words for less, for no difference, for more.

    A difference of errors has to show over positions of the mesh (protocol), in motion where they
    were studied; else they are not told apart. A run and a study that contradict each other
    support nothing.
    """
    own = _claimed(evidence, kind, metric, solver, rival)
    if own is None:
        return None
    side = (own.ratio >= factor) - (own.ratio <= 1 / factor)
    shown = own.shown
    if side and own.scatter is None and kind != "motion" and metric != "time":
        return None
    if own.scatter is not None and shown != -side:
        side = shown and side
    needs = f"a difference of {factor:g}, to the same side over positions of the mesh if studied"
    won, tied, lost = own.outcomes
    text = words[side + 1].format(
        own.over_scenes if own.scatter is None else number(own.ratio, 2),
        won=won, lost=lost, scenes=won + tied + lost,
    )  # fmt: skip
    if own.scatter is not None:
        untold = "" if len(own.by_scene) > 1 else ", not told apart"
        untold = "; the scene decides" if own.contradicted else untold
        text += f"{own.over_positions}{'' if shown else untold}."
    return Found(text, own.written, needs, not side or shown in (0, side))


def _tip_functions(evidence: Evidence) -> Found | None:
    own = _claimed(evidence, "tip", "energy_norm", "getfem tip=functions")
    if own is None or own.scatter is None:
        return None
    text = (
        f"GetFEM's tip functions have {number(own.ratio, 2)} of a conforming mesh's energy-norm "
        f"error, over positions {number(own.scatter[0], 2)}."
    )
    return Found(text, own.written, f"at most {1 / QUARTER:g}; scatter wholly below 1",
                 own.ratio <= 1 / QUARTER and own.scatter[2] < 1.0)  # fmt: skip


def _in_solids(
    results: Sequence[CaseResult], by: Callable[[str], bool], words: str, source: str
) -> Found | None:
    """Say how large a solver's error is in cut solids in motion; a slab of one layer is none."""
    found = [
        (one.value, one.uncertainty, solve.unknowns, result.case)
        for result in results
        if moves(result) and result.scene["cuts"] and is_solid(result.scene)
        for solve in finest_of(s for s in result.solves if s.metric("displacement_l2")).values()
        if by(solve.solver) and solve.unknowns and (one := solve.metric("displacement_l2"))
    ]
    told = [error for error, half, _, _ in found if error > half]
    if len(told) < FEWEST:
        return None
    least, most = (number(100 * v, 2) for v in (min(told), max(told)))
    text = words.format(len(told), f"{least} to {most} %")
    doubted = ", ".join(
        f"{name} below {number(100 * (error + half), 2)} %"
        for error, half, _, name in found if error <= half
    )  # fmt: skip
    text += f"; {doubted}." if doubted else "."
    numbers = ", ".join(
        f"{name} {number(error, 2)} ± {number(half, 1)} at {number(unknowns)} unknowns"
        for error, half, unknowns, name in found
    )
    needs = f"at least {FEWEST} errors larger than the half-width of their reference"
    return Found(text, numbers, needs, True, source)


def _moving_in_space(evidence: Evidence) -> Found | None:
    words = "In {} cut solids in motion XFEM's error is {}"
    beside = _in_solids(evidence.results, lambda name: name == MEASURE, "{1}", "arena")
    if beside is not None:
        words += f", a conforming mesh's {beside.text.partition(';')[0].removesuffix('.')}"
    found = _in_solids(evidence.results, lambda name: name == "xfem", words, "arena")
    if found is None or beside is None:
        return found
    return replace(found, numbers=f"xfem: {found.numbers}; {MEASURE}: {beside.numbers}")


def _by_frames(evidence: Evidence) -> Found | None:
    """Say how wrong the step of the real-time engine is at 60 steps a second."""
    return _in_solids(
        evidence.frames, lambda name: "scheme=real_time" in name,
        "There the engine's step of 1/60 s is wrong by {1}", "frames",
    )  # fmt: skip


def _real_time(evidence: Evidence) -> Found | None:
    hand = evidence.hand
    if not hand:
        return None
    slowest = sorted(float(one["slowest"]) for one in hand.get("runs") or [hand])
    cells, worst = int(hand["tetrahedra"]), slowest[-1]
    cuts = "cuts" if worst <= FRAME else "does not cut"
    busy = hand.get("contended") and worst > FRAME
    how = [f"{len(slowest)} runs"] * (len(slowest) > 1) + ["busy machine"] * bool(busy)
    took = " to ".join(dict.fromkeys(number(1e3 * one, 2) for one in (slowest[0], worst)))
    does = "Whether XFEM's engine cuts" if busy else f"XFEM's engine {cuts}"
    untold = " is undecided" if busy else ""
    text = (
        f"{does} a hand of {number(cells)} tetrahedra at 60 frames a second{untold}: slowest step "
        f"{took} ms of processor time, {number(1e3 * FRAME, 3)} allowed"
        f"{f' ({told})' if (told := ', '.join(how)) else ''}."
    )
    numbers = (
        f"{hand['steps']} steps, {hand['cuts']} elements cut, slowest "
        f"{', '.join(f'{one:.4f}' for one in slowest)} s; calibration "
        f"kernel {number(1e3 * float(hand['kernel']), 2)} ms"
    )
    return Found(text, numbers, "every step within 1/60 s; the sentence tells", True, "thesis")


def _sofa(evidence: Evidence) -> Found | None:
    rows = [r for r in evidence.speed if r["what"] == "step in real time, uncut"]
    if not rows:
        return None
    ratios = [float(row["ratio"]) for row in rows]
    text = (
        f"Uncut, its step takes {number(min(ratios), 2)} to {number(max(ratios), 2)} of "
        "SOFA's recorded time."
    )
    numbers = "scaled by memory bandwidth: " + ", ".join(
        f"{row['ratio']} at {row['size']}" for row in rows
    )
    return Found(text, numbers, "at most 1", max(ratios) <= 1.0, "speed")


def steps_kept(evidence: Evidence, solver: str) -> list[tuple[float, float]]:
    """Return ε and the critical step over the uncut body's, the worst family, largest ε first."""
    steps: dict[tuple[str, str], dict[str, float]] = {}
    for row in evidence.slivers:
        if row["solver"] == solver and row["value"] and float(row["size"]) > 0.0:
            own = steps.setdefault((row["family"], row["size"]), {})
            own[row["quantity"]] = float(row["value"])
    least: dict[float, float] = {}
    for (_, size), own in steps.items():
        cut, whole = own.get("critical explicit step"), own.get("critical explicit step, uncut")
        if cut and whole:
            least[float(size)] = min(cut / whole, least.get(float(size), np.inf))
    return sorted(least.items(), reverse=True)


def _flattened(evidence: Evidence, solver: str) -> float | None:
    """Return by which share the lowest frequency is off a conforming mesh's, at most over ε."""
    pitch = {
        (row["family"], row["size"], row["solver"]): float(row["value"])
        for row in evidence.slivers
        if row["quantity"] == "lowest natural frequency" and row["value"]
    }
    off = [pitch[at] / pitch[*at[:2], MEASURE] - 1.0 for at in pitch
           if at[2] == solver and (*at[:2], MEASURE) in pitch]  # fmt: skip
    return max(off, key=abs, default=None)


def _step_kept(evidence: Evidence) -> Found | None:
    found = steps_kept(evidence, "xfem")
    if not found:
        return None
    size, least = min(found, key=lambda place: place[1])
    moved = [
        float(row["value"]) for row in evidence.claims
        if row["claim"] == "uncut_step" and row["number"].startswith("bodies with moved nodes")
    ]  # fmt: skip
    text = (
        f"With a mass lumped on each side of the cut XFEM keeps {number(least, 3)} of the uncut "
        "body's step, however close to nodes"
    )
    text += f", {number(min(moved), 2)} on meshes with moved nodes" if moved else ""
    text += ", [less at ends of cuts](../theory/xfem.md)"
    if off := _flattened(evidence, "xfem"):
        text += (
            f"; the lowest frequency is up to {number(100 * abs(off), 2)} % too "
            f"{'high' if off > 0.0 else 'low'}"
        )
    text += "."
    return Found(text, f"least at ε = {size:g}", f"at least {KEPT:g}", least >= KEPT, "slivers")


def _step_lost(evidence: Evidence) -> Found | None:
    mass, split = (dict(steps_kept(evidence, n)) for n in ("xfem mass=consistent", MEASURE))
    common = [size for size in mass if size in split]
    if not common:
        return None
    at = min(common, key=lambda size: max(mass[size], split[size]))
    text = (
        f"At ε = {number(at, 1)} a consistent mass leaves {number(mass[at], 2)} of its own, on a "
        f"conforming mesh {number(split[at], 2)}."
    )
    numbers = ", ".join(
        f"{name}: least {min(own.values()):.2e} at ε = {min(own, key=lambda s: own[s]):g}"
        for name, own in (("xfem mass=consistent", mass), (MEASURE, split))
    )
    numbers += "; drawn up to the ε from which on the cut moves onto nodes"
    most = max(mass[at], split[at])
    return Found(text, numbers, f"both at most {LOST:g}", most <= LOST, "slivers")


def drifts(evidence: Evidence) -> dict[str, float]:
    """Return the relative energy drift over the long run, of each solver its finest level."""
    result = evidence.long_run
    own = [s for s in (result.solves if result else []) if s.solver != REFERENCE]
    found = finest_of(s for s in own if s.metric("energy_drift"))
    return {
        name: metric.value
        for name, solve in found.items()
        if (metric := solve.metric("energy_drift")) is not None
    }


def _still(evidence: Evidence) -> Found | None:
    result, found = evidence.long_run, drifts(evidence)
    if result is None or "xfem" not in found:
        return None
    analysis = result.scene["analysis"]
    count = round(analysis["duration"] / analysis["time_step"])
    above = [f"{name} ({number(d, 2)})" for name, d in found.items() if d > STILL]
    held = len(found) - len(above)
    text = (
        f"In {number(count)} steps of C7 XFEM's energy drifts by "
        f"{number(found['xfem'], 2)}; {held} of {len(found)} solvers "
        f"stay below {number(STILL, 1)}{', not ' if above else ''}{', '.join(above)}."
    )
    numbers = ", ".join(f"{name} {number(drift, 2)}" for name, drift in found.items())
    source = "long" if "long" in evidence.commands else "arena"
    needs = f"XFEM at most {number(STILL, 1)}"
    return Found(text, numbers, needs, found["xfem"] <= STILL, source)


def _cost(evidence: Evidence) -> Found | None:
    found = {name: _claimed(evidence, "rest", "time", "xfem", name) for name in _CUTTERS}
    told = {name: one for name, one in found.items() if one is not None}
    if not told:
        return None
    written = " and ".join(f"{o.over_scenes} of {t}'s" for t, o in told.items())
    text = f"At rest, at equal error XFEM takes {written} time"
    fitted = _claimed(evidence, "rest", "time", "xfem")
    if fitted is not None:
        text += f", and {fitted.over_scenes} times a conforming mesh's, that mesh's making included"
    moved = _claimed(evidence, "motion", "time", "xfem")
    if fitted is not None and moved is not None:
        text += f"; in motion {moved.over_scenes}"
    numbers = "; ".join(f"{name}: {one.written}" for name, one in told.items())
    return Found(f"{text}.", numbers, f"at most {1 / TWICE:g} of each",
                 all(one.ratio <= 1 / TWICE for one in told.values()))  # fmt: skip


_CUTTERS = ("ngsxfem", "getfem")  # programs that cut through elements, as XFEM does

_REMESHED = "conforming mesh=remeshed"
_RUN_BOTH = "XFEM beside a conforming mesh on three such scenes"
QUESTIONS: dict[str, tuple[Sentence, ...]] = {
    "Accuracy at rest": (
        Sentence("through", _RUN_BOTH, partial(
            _close, kind="through", least=1 / QUARTER, template="Where cuts go through, XFEM's "
            "error is {} times a conforming mesh's.")),
    ),
    "Accuracy at a tip": (
        Sentence("tip", _RUN_BOTH, partial(
            _close, kind="tip", template="Where cuts end inside elements, XFEM's error is {} times "
            "a conforming mesh's, whose node is the tip.")),
        Sentence("tip functions", "tip functions, on several positions of the mesh",
                 _tip_functions),
    ),
    "A moving body, a blade, real time": (
        Sentence("motion", _RUN_BOTH, partial(
            _weighed, kind="motion", metric="displacement_l2", solver="xfem", rival=MEASURE,
            factor=QUARTER, words=3 * (
             "In motion XFEM's error, without a new mesh, is {} times a conforming mesh's.",))),
        Sentence("motion, remeshed", "XFEM beside remeshing on three such scenes", partial(
            _weighed, kind="motion", metric="displacement_l2", solver="xfem", rival=_REMESHED,
            factor=QUARTER, words=(
             "Beside a mesh made for its cuts it is more accurate, {} times its error.",
             "Beside a mesh made for its cuts it is {} times.",
             "Beside a mesh made for its cuts it is less accurate, {} times its error."))),
        Sentence("motion in space", "errors of XFEM on three moving scenes in space",
                 _moving_in_space),
        Sentence("frames", "errors of the engine's step in such scenes", _by_frames),
        Sentence("real time", "a blade in real time (`verify study thesis`)", _real_time),
        Sentence("sofa", "real time beside SOFA (`make bench`)", _sofa),
    ),
    "Explicit steps with slivers": (
        Sentence("step kept", "XFEM's critical step (`verify study slivers`)", _step_kept),
        Sentence("step lost", "critical steps of other masses and meshes", _step_lost),
    ),
    "Long runs without drift": (
        Sentence("drift", "10 000 steps (C7)", _still),
    ),
    "Why (not) remesh?": (
        Sentence("remeshed", "remeshing, on several positions of the mesh", partial(
            _weighed, kind="rest", metric="displacement_l2", solver=_REMESHED, rival="xfem",
            factor=QUARTER, words=tuple(
                f"{lead}: the error is {{}} times XFEM's."
                for lead in (
                    "Remesh for accuracy at rest",
                    "Remeshing gains accuracy in {won} of {scenes} scenes at rest, loses it in "
                    "{lost}", "Remeshing loses accuracy at rest")))),
        Sentence("remeshing time", "times of remeshing", partial(
            _weighed, kind="rest", metric="time", solver=_REMESHED, rival="xfem", factor=TWICE,
            words=("At equal error remeshing takes only {} times XFEM's time.",
             "At equal error remeshing takes {} times XFEM's time, too close to call.",
             "At equal error remeshing takes {} times XFEM's time."))),
    ),
    "What it costs": (
        Sentence("cost", "times of ngsxfem and GetFEM", _cost),
    ),
}  # fmt: skip
