"""The budget study of a case: a chain of answers taken apart, and the cheapest adequate model."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import nan
from statistics import median
from typing import Any

from verify.compare.body import AnyBody
from verify.compare.body_rule import rules
from verify.compare.errors import ErrorNorm, spread_of
from verify.compare.hooke import Law, hooke, law_of
from verify.compare.motion import ExactMotion, Motion, SolutionMotion
from verify.errors import InputError, UnsupportedSceneError
from verify.judge.cost import paid_times
from verify.judge.models import at_rest, coarsest, with_kinematics
from verify.judge.quantities import Measured, unit_of
from verify.judge.reference import ExactField, Reference, size_of
from verify.result import Status, Verdict
from verify.scene import Scene
from verify.solution import Solution
from verify.study.budget_chain import (
    JUDGED,
    Budget,
    Chain,
    Missing,
    Part,
    Solve,
    Times,
    distances,
    error_budget,
    make_chain,
    norm_names,
)
from verify.study.study import Finding, Solved, Study, held


@dataclass(frozen=True)
class Candidate:
    """A model that was tried.

    Parameters
    ----------
    kinematics : str
    choices : str
        What else was chosen (mass, scheme, analysis), in words; may be empty.
    level : int
    size : float
        Element size, m.
    unknowns : int
    error, low, high : float
        Relative error against the user's problem, and the interval in which it lies.
    seconds, fastest, slowest : float
        Wall time: median, least and most of the repetitions; one thread.
    reason : str
        Why there is no error: the solve failed or was refused; empty otherwise.
    analysis : str
        ``"static"`` or ``"dynamic"``.
    """

    kinematics: str
    choices: str
    level: int
    size: float = nan
    unknowns: int = 0
    error: float = nan
    low: float = nan
    high: float = nan
    seconds: float = nan
    fastest: float = nan
    slowest: float = nan
    reason: str = ""
    analysis: str = ""

    @property
    def title(self) -> str:
        """What it is, in words."""
        more = f", {self.choices}" if self.choices else ""
        return f"{self.kinematics}{more}, h = {self.size:.3g} m"


def cheapest_adequate(
    candidates: Sequence[Candidate], tolerance: float, metric: str, contended: str = ""
) -> tuple[Candidate | None, Finding]:
    """Return the fastest candidate whose error certainly is within `tolerance`, and say so.

    The verdict is UNDECIDED if another adequate candidate may be as fast: their times overlap, or
    differ by less than a factor of two on a loaded machine. It is UNDECIDED too if a faster one
    may be adequate: the interval of its error holds the tolerance.
    """
    known = [c for c in candidates if not c.reason]
    adequate = sorted((c for c in known if c.high <= tolerance), key=lambda c: c.seconds)
    wanted = f"{metric.replace('_', ' ')} within {100 * tolerance:.3g} %"
    topic = "cheapest adequate model"
    if not adequate:
        best = min(known, key=lambda c: c.high, default=None)
        text = f"None of the {len(candidates)} models tried is certain to be within the tolerance."
        if best is not None:
            said = f"{best.title}: {100 * best.error:.3g} % (to {100 * best.high:.3g})."
            text += f" The best is {said}"
        excluded = bool(known) and all(c.low > tolerance for c in known)
        return None, Finding(topic, text, wanted, Verdict.FAIL if excluded else Verdict.UNDECIDED)
    first = adequate[0]
    sentence = (
        f"{first.title}: {100 * first.error:.3g} % (at most {100 * first.high:.3g} %) in "
        f"{1e3 * first.seconds:.3g} ms with {first.unknowns} unknowns."
    )
    sentence += _of_the_others(first, adequate[1:], known, "kinematics")
    sentence += _of_the_others(first, adequate[1:], known, "analysis")
    room = 2.0 if contended else 1.0
    rivals = [c for c in adequate[1:] if c.fastest <= room * first.slowest]
    maybe = [c for c in known if c.low <= tolerance < c.high and c.seconds < first.seconds]
    if rivals:
        sentence += f" Its time cannot be told from that of {rivals[0].title}."
    if maybe:
        sentence += f" {maybe[0].title} is faster and may be adequate; the reference is too coarse."
    verdict = Verdict.UNDECIDED if rivals or maybe else Verdict.PASS
    return first, Finding(topic, sentence, wanted, verdict)


def _of_the_others(
    first: Candidate, adequate: Sequence[Candidate], known: Sequence[Candidate], axis: str
) -> str:
    """Say of the models that differ from the chosen one along an axis what they cost or lack."""
    rest = [c for c in known if getattr(c, axis) != getattr(first, axis)]
    if not rest:
        return ""
    other = next((c for c in adequate if c in rest), None)
    name = f" {getattr(other or rest[0], axis).capitalize()} {axis}"
    if other is not None:
        return f"{name} needs {1e3 * other.seconds:.3g} ms (h = {other.size:.3g} m) for the same."
    least = min(c.error for c in rest)
    return f"{name} is not adequate on any mesh tried ({100 * least:.3g} % at best)."


_STANDARD = "trapezoidal, consistent mass"
# in words, and the parameters of the solver; the last ones are left out by --quick
_MOTIONS: list[tuple[str, dict[str, Any]]] = [
    ("implicit Euler, consistent mass", {"scheme": "implicit_euler"}),
    ("central differences, side-wise mass", {"scheme": "central_differences"}),
    ("trapezoidal, side-wise mass", {"mass": "sidewise"}),
    ("energy–momentum, consistent mass", {"scheme": "energy_momentum"}),
]
_QUICK = 1


@dataclass(frozen=True)
class _Tried:
    kinematics: str
    choices: str
    analysis: str
    solved: Solved


def find_candidates(
    chain: Chain, times: Times, metric: str, solve: Solve, quick: bool = False
) -> list[Candidate]:
    """Solve a scene by other models, and measure the error of each on each mesh level.

    At rest these are the kinematics; in motion also schemes, masses, the fine time step, and
    the static answer, which is held against the motion at all times.

    Parameters
    ----------
    chain : Chain
    times : sequence of float or None
        Output times, s.
    metric : str
        Of the error.
    solve : Solve
    quick : bool
        Leave out some.
    """
    scene, asked = chain.scene, chain.asked
    if scene.analysis.kind == "static":
        tried = [_Tried(kind, "", "static", solved) for kind, solved in asked.items()]
        return _measured(tried, chain, times, metric)
    tried = [_Tried(kind, _STANDARD, "dynamic", solved) for kind, solved in asked.items()]
    kinds = [scene.analysis.kinematics] if quick else list(asked)
    scenes = [with_kinematics(scene, kind) for kind in kinds]
    for words, parameters in _MOTIONS[:_QUICK] if quick else _MOTIONS:
        place = "-".join(parameters.values())
        found = solve(scenes, place, (JUDGED,), {JUDGED: parameters}, timed=True)
        tried += [_Tried(k, words, "dynamic", s) for k, s in zip(kinds, found, strict=True)]
    own = scene.analysis.kinematics
    tried += [_Tried(own, words, "dynamic", s) for words, s in chain.fine]
    candidates = _measured(tried, chain, times, metric)
    try:
        still = solve([at_rest(s) for s in scenes], "static", (JUDGED,), timed=True)
    except (InputError, UnsupportedSceneError) as problem:
        failed = partial(Candidate, reason=str(problem), analysis="static")
        return [*candidates, *(failed(kind, "static", 0) for kind in kinds)]
    static = [_Tried(k, "static", "static", s) for k, s in zip(kinds, still, strict=True)]
    return candidates + _measured(static, chain, times, metric)


def _measured(tried: Sequence[_Tried], chain: Chain, times: Times, metric: str) -> list[Candidate]:
    found, law = [], hooke(chain.scene.material)
    for one in tried:
        model = partial(Candidate, one.kinematics, one.choices, analysis=one.analysis)
        for record in sorted(one.solved.result.solves, key=lambda r: r.level):
            if record.solver != JUDGED:
                continue
            solution = one.solved.solutions.get(JUDGED, {}).get(record.level)
            if record.status is not Status.SOLVED or solution is None:
                found.append(model(record.level, reason=record.reason or str(record.status)))
                continue
            error, width = _error(one, solution, chain.known, chain.body, metric, law, times)
            totals = paid_times(record) or [nan]
            found.append(model(
                record.level, size_of(solution), solution.unknowns, error, max(error - width, 0.0),
                error + width, median(totals), min(totals), max(totals),
            ))  # fmt: skip
    return found


def _error(
    tried: _Tried, solution: Solution, known: Reference, body: AnyBody, metric: str, law: Law,
    times: Times,
) -> tuple[float, float]:  # fmt: skip
    """Relative error against the user's problem, and its half-width."""
    if metric not in norm_names(times):
        scene, (value, width) = tried.solved.scene, known.quantities[metric]
        asked = next(q for q in scene.quantities if q.name == metric)
        found = Measured(solution, body, law_of(scene), scene).quantity(asked)
        return abs(found - value) / abs(value), width / abs(value)
    own: Motion = SolutionMotion(solution, body)
    if len(times) > 1 and tried.analysis == "static":
        own = ExactMotion(own.at())  # the same at all times
    family = rules(body, size_of(solution), 3 if len(times) == 1 else 2)
    values, scale = distances([known.motion.afresh(), own], [(1, 0)], times, family, law).of(metric)
    spread = spread_of([ErrorNorm(float(v), scale) for v in values[0]], body.dimension)
    error = spread.norm.relative
    return error, known.norms.get(metric, 0.0) / scale * (1 + error) + spread.integration_error


_QUICK_LEVELS = 2


@dataclass(frozen=True, kw_only=True)
class BudgetStudy(Study):
    """What the budget study found.

    Attributes
    ----------
    case : str
    level : int
        Mesh level that is taken apart.
    tolerance : float
        Wanted relative error.
    metric : str
        Of the tolerance.
    chain : list of str
        The links, in words.
    budgets : list of Budget
    candidates : list of Candidate
    missing : list of Missing
        Links that could not be made, with their reasons.
    notes : list of str
    quick : bool
    """

    case: str
    level: int
    tolerance: float
    metric: str
    chain: list[str]
    budgets: list[Budget]
    candidates: list[Candidate]
    missing: list[Missing]
    notes: list[str]
    quick: bool

    def rows(self) -> list[dict[str, Any]]:
        """Return a line per part, for a table."""
        return [
            {"metric": b.metric, "source": part.source, "relative": part.value,
             "uncertainty": part.uncertainty, "scale": b.scale, "unit": b.unit}
            for b in self.budgets
            for part in [*b.parts, b.total]
        ]  # fmt: skip


def budget_study(
    scene: Scene, level: int | None, tolerance: float, metric: str | None,
    exact: ExactField | None, solve: Solve, quick: bool = False,
) -> BudgetStudy:  # fmt: skip
    """Take the answer of level `level` apart, and find the cheapest adequate model.

    Parameters
    ----------
    scene : Scene
    level : int, optional
        Default: the finest.
    tolerance : float
    metric : str, optional
        A norm of `norm_names`, or the name of a quantity; default: displacement (L2), in motion
        its mean over time.
    exact : ExactField or None
        What judges the scene, if an exact solution does.
    solve : Solve
        Runs scenes.
    quick : bool
        The two coarsest mesh levels only, and fewer models.

    Raises
    ------
    InputError
        If `level` or `metric` is none of the scene, the scene is played and not solved, or a
        solve that the budget needs failed.
    """
    if scene.played_only:
        raise InputError(scene.played_only, str(scene.file or scene.name))
    if quick:
        scene = coarsest(scene, _QUICK_LEVELS)
    dynamic = scene.analysis.kind == "dynamic"
    times: Times = scene.analysis.output_times if dynamic else (None,)
    level, metric = _asked_for(scene, level, metric, times)
    try:
        chain = make_chain(scene, level, exact, solve, quick)
    except UnsupportedSceneError as refusal:
        raise InputError(str(refusal), str(scene.file or scene.name)) from None
    law = hooke(scene.material)
    units = {q.name: unit_of(q, scene.dimension) for q in scene.quantities}
    budgets = error_budget(chain.answers, chain.body, chain.size, law, units, times)
    if metric not in {budget.metric for budget in budgets}:
        raise InputError(f"'{metric}' is zero, or not measured on every link", "--metric")
    candidates = find_candidates(chain, times, metric, solve, quick)
    _, choice = cheapest_adequate(candidates, tolerance, metric, _contention(chain))
    return BudgetStudy(
        case=scene.name, level=level, tolerance=tolerance, metric=metric, budgets=budgets,
        chain=[answer.name for answer in chain.answers], candidates=candidates,
        findings=[choice, *(_finding(budget) for budget in budgets)],
        missing=chain.missing, notes=chain.notes, quick=quick,
    )  # fmt: skip


def _asked_for(
    scene: Scene, level: int | None, metric: str | None, times: Times
) -> tuple[int, str]:
    """Return level and metric, the default where none is given; refuse what there is not."""
    count = scene.mesh.count
    level = count - 1 if level is None else level
    if not 0 <= level < count:
        raise InputError(f"level {level}; expected 0..{count - 1}", "--level")
    names = [*norm_names(times), *(quantity.name for quantity in scene.quantities)]
    metric = metric or names[0 if len(times) == 1 else 1]
    if metric not in names:
        raise InputError(f"no budget of '{metric}'; there is one of {', '.join(names)}", "--metric")
    return level, metric


def _contention(chain: Chain) -> str:
    """Return what the runs say of the machine, if they had to share it."""
    records = [record for solved in chain.asked.values() for record in solved.result.solves]
    return next((r.notes["timing"] for r in records if r.notes.get("timing")), "")


def _finding(budget: Budget) -> Finding:
    total = budget.total
    topic = f"budget of {budget.metric.replace('_', ' ')}"
    expected = (
        "the parts add up to the total" if budget.unit != "1"
        else "the total is at most the sum of the parts"
    )  # fmt: skip
    if budget.is_round_off:
        return Finding(topic, "every part and the total are round-off.", expected, Verdict.PASS)
    parts = [f"{part.source} {_said(part)}" for part in budget.parts]
    known = total.round_off or total.uncertainty < 0.1 * abs(total.value)
    return Finding(
        topic,
        f"{'; '.join(parts)}; total {_said(total)}. Most of it: {budget.largest.source}.",
        expected,
        held(budget.closes if known or not budget.closes else None),
    )


def _said(part: Part) -> str:
    if part.round_off:
        return "round-off"
    return f"{100 * part.value:.3g} % ± {100 * part.uncertainty:.3g} %".replace("-", "−")
