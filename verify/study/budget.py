"""The budget study of a case: a chain of answers taken apart, and the choice among the models.

Ends of cuts: linear elements without tip functions are too stiff at the end of a cut. Away from it
their error is, to first order, the change of the displacement when the end is moved. The answer
thus belongs to a cut with other ends. Their shift in elements depends only on where the end falls
among the nodes. It was measured on a Griffith crack (docs/guide/studies.md). For an end realised on
an edge whose hindmost node lies `behind` it: two thirds of `behind`, and a third of an element
more. An end that is made a node costs that third alone.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import Body
from verify.compare.cut_deviation import polylines_of
from verify.compare.hooke import hooke
from verify.errors import InputError, UnsupportedSceneError
from verify.geometry.simplices import feet
from verify.judge.models import coarsest
from verify.judge.quantities import unit_of
from verify.judge.reference import ExactField
from verify.result import Verdict
from verify.scene import Scene
from verify.solvers.body_of_scene import background_mesh
from verify.study.budget_chain import JUDGED, Chain, Missing, Solve, make_chain
from verify.study.budget_parts import Budget, Part, Times, error_budget, norm_names
from verify.study.candidates import Candidate, cheapest_adequate, find_candidates
from verify.study.study import Finding, Study, held

Array = NDArray[np.float64]

_BEHIND, _STIFF, _SPREAD = 2 / 3, 0.355, 0.22  # of elements; holds for 95 % of 264 ends
_REACH = 2.0  # elements: an end farther off than that is not the same end
_ON = 1e-9  # elements


@dataclass(frozen=True)
class CutEnd:
    """An end of a cut inside the body; lengths in elements, positive beyond the end as asked.

    Attributes
    ----------
    place : (float, float)
        As asked, m.
    moved : float
        How far out the end is realised.
    nodes : float
        Place of the hindmost node, along the cut, of the element edge on which it is realised.
        The nodes of that edge are not enriched, so that the cut does not open there.
    acts : float
        Expected place of the end of the cut whose answer this is, half-width `uncertainty`.
    uncertainty : float
    """

    place: tuple[float, float]
    moved: float
    nodes: float
    acts: float
    uncertainty: float


def cut_ends(
    body: Body,
    facets: Array,
    points: Array,
    cells: NDArray[np.int64],
    size: float,
    at_nodes: bool = False,
) -> list[CutEnd]:
    """Find the ends of cuts inside a plane body, as realised.

    Parameters
    ----------
    body : Body
        With the cuts as asked.
    facets : (f, 2, 2) array
        ``Solution.cut_facets``, m.
    points, cells : (n, 2) and (m, 3) arrays
        Background mesh that was cut, m.
    size : float
        Its element size, m.
    at_nodes : bool
        Whether the solver has made the ends nodes: the cut then opens up to them.

    Returns
    -------
    list of CutEnd
        Those with a realised end within two elements: a cut shorter than an element has none.
    """
    lines = [line for line in polylines_of(facets) if not np.array_equal(line[0], line[-1])]
    free = np.array([line[k] for line in lines for k in (0, -1)]).reshape(-1, 2)
    apart = np.linalg.norm(free[:, None] - free[None], axis=2)
    free = free[(apart <= _ON * size).sum(axis=1) == 1]  # where cuts meet none of them ends
    edges = np.unique(
        np.sort(np.concatenate([np.roll(cells, k, axis=1)[:, :2] for k in range(3)])), axis=0
    )
    found = []
    for tip in body.tips:
        off = np.linalg.norm(free - tip, axis=1)
        if not len(off) or off.min() > _REACH * size:
            continue
        end, outwards = free[off.argmin()], _outwards(body, tip)
        moved = float((end - tip) @ outwards) / size
        closed = end[None] if at_nodes else _closed(points, edges, end, size)
        nodes = float((closed - tip).dot(outwards).min()) / size
        acts = moved - _BEHIND * (moved - min(nodes, moved)) - _STIFF
        found.append(CutEnd((float(tip[0]), float(tip[1])), moved, nodes, acts, _SPREAD))
    return found


def _outwards(body: Body, tip: Array) -> Array:
    """Direction (2,) in which the cut would go on past `tip`."""
    ways = [
        (np.linalg.norm(part.piece.point(np.array([t]))[0] - tip), part, t, sign)
        for part in body.parts
        for t, sign in ((part.start, -1.0), (part.end, 1.0))
    ]
    _, part, t, sign = min(ways, key=lambda way: way[0])
    return np.asarray(sign * part.piece.tangent(np.array([t]))[0])


def _closed(points: Array, edges: NDArray[np.int64], end: Array, size: float) -> Array:
    """Nodes (1 or 2, 2) at which a cut with this end does not open."""
    foot = feet(end, points[edges[:, 0]], points[edges[:, 1]])
    both: Array = points[edges[np.linalg.norm(foot - end, axis=1).argmin()]]
    at = np.linalg.norm(both - end, axis=1) <= _ON * size
    return both[at] if at.any() else both


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
    ends : list of CutEnd
        Where the ends of cuts in the plane are realised, and where the answer has them.
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
    ends: list[CutEnd]
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
    scene: Scene,
    level: int | None,
    tolerance: float,
    metric: str | None,
    exact: ExactField | None,
    solve: Solve,
    quick: bool = False,
) -> BudgetStudy:
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
        case=scene.name,
        level=level,
        tolerance=tolerance,
        metric=metric,
        chain=[answer.name for answer in chain.answers],
        budgets=budgets,
        candidates=candidates,
        findings=[choice, *(_finding(budget) for budget in budgets)],
        missing=chain.missing,
        notes=chain.notes,
        ends=_ends(chain, level),
        quick=quick,
    )


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


def _ends(chain: Chain, level: int) -> list[CutEnd]:
    """Find the ends of cuts, in the plane."""
    if not isinstance(chain.body, Body) or not len(chain.body.tips):
        return []
    mesh, _ = background_mesh(chain.scene, level)
    solution = chain.asked[chain.scene.analysis.kinematics].solution(JUDGED, level)
    at_nodes = solution.notes["tip"] == "partial"
    return cut_ends(chain.body, solution.cut_facets, mesh.points, mesh.cells, chain.size, at_nodes)


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
    return f"{_percent(part.value)} ± {_percent(part.uncertainty)}"


def _percent(value: float) -> str:
    return f"{100 * value:.3g} %".replace("-", "−")
