"""One check of a solver: its claim, and what became of it; most of all that of a known field.

`EXACT`, 1e-7: answers that lie in the solver's space are found up to the residual at which its
linear solver stops. Direct solvers reach 1e-13 on these meshes; an iterative one that stops at a
relative residual of 1e-9 loses up to two digits to the condition number (about 1e2 for 5 × 4
cells). What is wrong in the method shows at 1e-3 and more: half an element of a wrong side, a
missing factor, a swapped sign.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from verify.compare.hooke import Hooke, hooke, strain_energy
from verify.compare.locate import SolutionField
from verify.compare.realised import cut_deviation
from verify.compare.simplices import simplices
from verify.conformance.scenes import YOUNG, Field
from verify.conformance.trials import Outcome, Trial
from verify.result import Status
from verify.scene import PolylineCut, Scene
from verify.solution import Solution


class State(StrEnum):
    """What became of a check."""

    PASS = "pass"
    FAIL = "fail"
    ERROR = "error"  # the solver crashed, hung or raised on a scene that it did not refuse
    # off, by what a regularisation that it states and the place of its cut explain
    STATED = "stated"
    REFUSED = "refused"  # the solver does not do such scenes, or gives no such number


@dataclass(frozen=True)
class Finding:
    """A number that must not exceed `limit`; `note` says what else was seen.

    `limit` None: there was nothing to measure, for the reason in `note`. `stated`: what is above
    the limit is explained by what the solver states.
    """

    observed: float
    limit: float | None
    note: str = ""
    stated: bool = False


@dataclass(frozen=True)
class Check:
    """A claim, the trials that decide it, and how.

    `judge` gets the solutions by the name of their trials, all of them solved. If
    `judge_outcomes` is given it gets the outcomes instead, however they ended, and returns what
    is wrong, or an empty text.
    """

    name: str
    claim: str
    trials: Sequence[Trial]
    judge: Callable[[Mapping[str, Solution]], Finding] | None = None
    judge_outcomes: Callable[[Mapping[str, Outcome]], str] | None = None
    separate: tuple[str, ...] = ()  # trials that need a process of their own


@dataclass(frozen=True)
class CheckResult:
    """The result of a check, as `verify conform --json` prints it."""

    name: str
    claim: str
    state: State
    observed: float | None = None
    limit: float | None = None
    reason: str = ""


def evaluate(check: Check, outcomes: Mapping[str, Outcome]) -> CheckResult:
    """Decide `check` on the outcomes of its trials."""
    if check.judge_outcomes is not None:
        wrong = check.judge_outcomes(outcomes)
        state = State.FAIL if wrong else State.PASS
        return CheckResult(check.name, check.claim, state, reason=wrong)
    solutions = {}
    for name, outcome in outcomes.items():
        if outcome.status is Status.REFUSED:
            return CheckResult(check.name, check.claim, State.REFUSED, reason=outcome.reason)
        if outcome.solution is None:
            reason = f"{name}: {outcome.reason}"
            return CheckResult(check.name, check.claim, State.ERROR, reason=reason)
        solutions[name] = outcome.solution
    assert check.judge is not None
    found = check.judge(solutions)
    if found.limit is None:
        return CheckResult(check.name, check.claim, State.REFUSED, reason=found.note)
    # `not <=`, so that a number that is not finite breaks the check
    state = State.PASS if found.observed <= found.limit else State.FAIL
    state = State.STATED if found.stated else state
    return CheckResult(check.name, check.claim, state, found.observed, found.limit, found.note)


EXACT = 1e-7
_LOOKED_AT = 5000  # points of a body: a smallest cell holds several
Solutions = Mapping[str, Solution]


def is_field(
    name: str, claim: str, scene: Scene, field: Field, energy: float | None = None
) -> Check:
    """Make a check that an answer is `field`; the strain energy of the answer is `energy`."""
    law = hooke(scene.material)

    def judge(solutions: Solutions) -> Finding:
        (solution,) = solutions.values()
        if (gap := covered(solution)) > EXACT:
            return Finding(gap, EXACT, "the cells do not cover the body once")
        off = nodal_deviation(solution, field)
        if not off <= EXACT:
            return Finding(off, EXACT, f"displacement off by {off:.2e}{_moved(scene, solution)}")
        found = strain_energy(solution, law)
        if energy is None:
            return Finding(off, EXACT)
        # E·(u/L)² is the energy of strains as large as the displacements; an error of EXACT in
        # the displacements is one of EXACT · u / h in the strains, and its square in the energy
        largest = float(np.abs(solution.displacement).max())
        allowed = 2 * EXACT * energy + 400 * EXACT**2 * YOUNG * largest**2
        note = f"strain energy {found:.6g}, expected {energy:.6g}"
        if not abs(found - energy) <= allowed:
            return Finding(abs(found - energy), allowed, note)
        return Finding(off, EXACT)

    return Check(name, claim, [Trial(scene.name, scene)], judge)


def _moved(scene: Scene, solution: Solution) -> str:
    """Say by how much the realised cut deviates from the one asked for, if it does."""
    from verify.compare.body import body_of

    if scene.dimension != 2 or not scene.cuts:
        return ""
    off = cut_deviation(solution, body_of(scene))
    return f"; its realised cut is off by {off:.2e} m" if off > EXACT else ""


Array = NDArray[np.float64]


def nodal_deviation(solution: Solution, expected: Field) -> float:
    """Largest deviation from `expected` at the nodes of the cells, relative to its largest value.

    Each cell is held against the side on which its centroid lies, so that a cell that reaches
    across the cut deviates by the jump.
    """
    corners = solution.points[solution.cells]
    d = solution.dimension
    near = np.repeat(corners[:, : d + 1].mean(axis=1), corners.shape[1], axis=0)
    wanted = expected(corners.reshape(-1, d), near)
    found = solution.displacement[-1][solution.cells].reshape(-1, d)
    return float(np.abs(found - wanted).max() / np.abs(wanted).max())


def covered(solution: Solution) -> float:
    """Largest of the deviation of the volume of the cells from 1, and the share of points in none.

    Every body of the suite is a unit square or cube: the box around the nodes.
    """
    off = abs(float(simplices(solution.points, solution.cells).volume.sum()) - 1.0)
    low, size = solution.points.min(axis=0), np.ptp(solution.points, axis=0)
    points = low + size * np.random.default_rng(0).random((_LOOKED_AT, len(low)))
    return max(off, SolutionField(solution).missing(points, np.ones(_LOOKED_AT)))


def distance(one: Solution, other: Solution, scene: Scene, swap: bool = False) -> float:
    """Relative L2 distance of two solutions at 400 points of the body that lie off its cuts.

    Parameters
    ----------
    one, other : Solution
    scene : Scene
        Of `one`.
    swap : bool
        Whether `other` is the answer to the scene mirrored at the diagonal.
    """
    points = np.random.default_rng(7).uniform(0.001, 0.999, (400, scene.dimension))
    for cut in scene.cuts:
        assert isinstance(cut, PolylineCut)
        (ax, ay), (bx, by) = cut.points[0], cut.points[-1]
        height = (bx - ax) * (points[:, 1] - ay) - (by - ay) * (points[:, 0] - ax)
        # where the cut is moved by round-off, a point off it keeps its side
        points = points[np.abs(height) > 1e-6]
    u = SolutionField(one).displacement(points)
    other_points = points[:, ::-1] if swap else points
    v = SolutionField(other).displacement(np.ascontiguousarray(other_points))
    if swap:
        v = v[:, ::-1]
    scale = np.linalg.norm(u)
    return float(np.linalg.norm(u - v) / scale) if scale else float(np.linalg.norm(v))


def weight_imbalance(solution: Solution, weight: Array, law: Hooke) -> float:
    """|2 W − ∫ f·u| / ∫ f·u for a body at rest under its weight `weight` = ρ g, N/m³.

    Clapeyron's theorem; a Galerkin method keeps it on every mesh, since u_h may be its own test
    function where the supports prescribe 0.
    """
    shape = simplices(solution.points, solution.cells)
    u = solution.displacement[-1][solution.cells]
    corners = solution.dimension + 1
    # mean of a field on a simplex: of its corners (P1), or of its mid-nodes in the plane (P2)
    mean = u.mean(axis=1) if solution.order == 1 else _quadratic_mean(u, corners)
    work = float(np.einsum("m,mi,i->", shape.volume, mean, weight))
    return abs(2 * strain_energy(solution, law) - work) / abs(work) if work else float("inf")


def _quadratic_mean(u: Array, corners: int) -> Array:
    if corners == 3:
        return u[:, 3:].mean(axis=1)
    return -u[:, :4].sum(axis=1) / 20 + u[:, 4:].sum(axis=1) / 5
