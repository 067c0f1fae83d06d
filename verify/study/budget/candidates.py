"""The models that are tried for a scene, and how far each is from the user's problem."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

from verify.assess.changed_scenes import at_rest, with_kinematics
from verify.assess.quantities import Measured
from verify.assess.reference import Reference, size_of
from verify.compare.body import AnyBody
from verify.compare.error_norm import ErrorNorm
from verify.compare.hooke import Law, hooke, law_of
from verify.compare.integration import rules, spread_of
from verify.compare.motion import ExactMotion, Motion, SolutionMotion
from verify.errors import InputError, UnsupportedSceneError
from verify.result import SolveRecord, Status
from verify.scene import Scene
from verify.solution import Solution
from verify.study.budget.cheapest import Candidate
from verify.study.budget.distances import Times, distances, norm_names
from verify.study.budget.links import Chain
from verify.study.budget.solved import JUDGED, Solve, Solved

_NONE = float("nan")
_STANDARD = "trapezoidal, side-wise mass"
# in words, and the parameters of the solver; what is left out by --quick comes last
_MOTIONS: list[tuple[str, dict[str, Any]]] = [
    ("implicit Euler, side-wise mass", {"scheme": "implicit_euler"}),
    ("central differences, side-wise mass", {"scheme": "central_differences"}),
    ("trapezoidal, consistent mass", {"mass": "consistent"}),
    ("energy–momentum, side-wise mass", {"scheme": "energy_momentum"}),
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
        return [*candidates, *(_without(k, "static", "static", 0, str(problem)) for k in kinds)]
    static = [_Tried(k, "static", "static", s) for k, s in zip(kinds, still, strict=True)]
    return candidates + _measured(static, chain, times, metric)


def _measured(tried: Sequence[_Tried], chain: Chain, times: Times, metric: str) -> list[Candidate]:
    found = []
    law = hooke(chain.scene.material)
    for one in tried:
        for record in sorted(one.solved.result.solves, key=lambda r: r.level):
            if record.solver != JUDGED:
                continue
            solution = one.solved.solutions.get(JUDGED, {}).get(record.level)
            if record.status is not Status.SOLVED or solution is None:
                reason = record.reason or str(record.status)
                found.append(
                    _without(one.kinematics, one.choices, one.analysis, record.level, reason)
                )
                continue
            error = _error(one, solution, chain.known, chain.body, metric, law, times)
            found.append(_candidate(one, record, solution, error))
    return found


def _without(kinematics: str, choices: str, analysis: str, level: int, reason: str) -> Candidate:
    return Candidate(
        kinematics, choices, level, _NONE, 0, _NONE, _NONE, _NONE, _NONE, _NONE, _NONE, reason,
        analysis,
    )  # fmt: skip


def _candidate(
    one: _Tried, record: SolveRecord, solution: Solution, error: tuple[float, float]
) -> Candidate:
    value, width = error
    # the background mesh is there before the cut is
    phases = [times for name, times in record.timings.items() if name != "meshing"]
    totals = [sum(times) for times in zip(*phases, strict=False)] or [_NONE]
    return Candidate(
        one.kinematics, one.choices, record.level, size_of(solution), solution.unknowns, value,
        max(value - width, 0.0), value + width, median(totals), min(totals), max(totals),
        analysis=one.analysis,
    )  # fmt: skip


def _error(
    tried: _Tried,
    solution: Solution,
    known: Reference,
    body: AnyBody,
    metric: str,
    law: Law,
    times: Times,
) -> tuple[float, float]:
    """Relative error against the user's problem, and its half-width."""
    scene = tried.solved.scene
    if metric not in norm_names(times):
        return _error_of_quantity(scene, solution, known, body, metric)
    own: Motion = SolutionMotion(solution, body)
    if len(times) > 1 and tried.analysis == "static":
        own = ExactMotion(own.at())  # the same at all times
    family = rules(body, size_of(solution), 3 if len(times) == 1 else 2)
    values, scale = distances([known.motion.afresh(), own], [(1, 0)], times, family, law).of(metric)
    found = spread_of([ErrorNorm(float(v), scale) for v in values[0]], body.dimension)
    error = found.norm.relative
    return error, known.norms.get(metric, 0.0) / scale * (1 + error) + found.integration_error


def _error_of_quantity(
    scene: Scene, solution: Solution, known: Reference, body: AnyBody, metric: str
) -> tuple[float, float]:
    value, width = known.quantities[metric]
    asked = next(q for q in scene.quantities if q.name == metric)
    one = Measured(solution, body, law_of(scene), scene)
    return abs(one.quantity(asked) - value) / abs(value), width / abs(value)
