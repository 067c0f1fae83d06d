"""The budget study of a case: a chain of answers taken apart, and the choice among the models."""

from dataclasses import dataclass
from typing import Any

from verify.compare.hooke import hooke
from verify.errors import InputError, UnsupportedSceneError
from verify.judge.models import coarsest
from verify.judge.quantities import unit_of
from verify.judge.reference import ExactField
from verify.result import Verdict
from verify.scene import Scene
from verify.study.budget_chain import Chain, Missing, Solve, make_chain
from verify.study.budget_parts import Budget, Part, Times, error_budget, norm_names
from verify.study.candidates import Candidate, cheapest_adequate, find_candidates
from verify.study.study import Finding, Study, held

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
