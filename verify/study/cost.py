"""The cost study: a cut grows, every solver follows it, and they are compared at equal accuracy."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.geometry.planar import arc_lengths, points_along
from verify.judge import cost
from verify.judge.cost import WorkPoint, pareto_front, time_at, work_points
from verify.judge.models import changed
from verify.result import REFERENCE, CaseResult, Status, Verdict, ranked_solvers
from verify.scene import PolylineCut, Scene
from verify.study.study import Finding, Study, held

_LEFT_OUT = ("case", "solver", "level", "status", "reason")
type _Times = tuple[float, float, float]  # median, least, most, s


@dataclass(frozen=True, kw_only=True)
class CostStudy(Study):
    """What the cost study found.

    Attributes
    ----------
    case, metric : str
    steps : list of dict
        Per step of the cut: the error at which the solvers are compared, and per solver the
        time that it takes (median, least, most; s), None if it does not reach the error.
    running : dict of str to list of (float, float, float)
        Time so far, per solver and step: the set-up, paid once, and the steps; None from the
        first step that a solver does not reach.
    points : list of dict
        Every solve of the last step.
    front : list of (str, int)
        Solver and level of the points that no other beats in time and error.
    left_out : list of dict
        Solves that failed or were refused, with reasons.
    contended : str
        Why times may be off, if they may.
    """

    case: str
    metric: str
    steps: list[dict[str, Any]]
    running: dict[str, list[_Times | None]]
    points: list[dict[str, Any]]
    front: list[tuple[str, int]]
    left_out: list[dict[str, Any]]
    contended: str

    def rows(self) -> list[dict[str, Any]]:
        """Return a line per solver and step, for a table."""
        return [
            {"step": step["step"], "error": step["error"], "solver": solver,
             "median_s": times[0] if times else "", "least_s": times[1] if times else "",
             "most_s": times[2] if times else ""}
            for step in self.steps
            for solver, times in step["times"].items()
        ]  # fmt: skip


def cost_study(case: str, results: Sequence[CaseResult], metric: str) -> CostStudy:
    """Compare the cost of the solvers over the steps of a growing cut.

    At each step the wanted error is the least that every solver reaches on some level; the time
    that it takes a solver is interpolated between its levels.

    Parameters
    ----------
    case : str
    results : sequence of CaseResult
        Of the steps, in order.
    metric : str
        The relative error that is held equal.
    """
    steps: list[dict[str, Any]] = []
    running: dict[str, list[_Times | None]] = {}
    for number, result in enumerate(results, start=1):
        own = [record for record in result.solves if record.solver != REFERENCE]
        points = _by_solver(work_points(own, metric))
        names = list(dict.fromkeys(record.solver for record in own))
        reached = [min(p.error for p in points[name]) for name in names if name in points]
        wanted = max(reached, default=float("nan"))
        times = {name: time_at(points.get(name, []), wanted) for name in names}
        once = {name: max((p.once for p in points.get(name, [])), default=0.0) for name in names}
        steps.append({"step": number, "error": wanted, "times": times})
        for name, step in times.items():
            _add(running.setdefault(name, []), step, once[name])
    last = [record for record in results[-1].solves if record.solver != REFERENCE]
    final = work_points(last, metric)
    contended = "; ".join(cost.why_times_are_no_sample(results, ranked_solvers(results)))
    unsolved = [r for result in results for r in result.solves if r.status is not Status.SOLVED]
    return CostStudy(
        case=case, metric=metric, steps=steps, running=running, contended=contended,
        points=[asdict(point) for point in final],
        front=[(p.solver, p.level) for p in pareto_front(final)],
        left_out=[{name: getattr(r, name) for name in _LEFT_OUT} for r in unsolved],
        findings=list(_findings(running, steps, metric, contended, final)),
    )  # fmt: skip


def _add(sums: list[_Times | None], step: _Times | None, once: float) -> None:
    """Add a step to the sums of a solver, the first with its set-up; None from then on."""
    before = sums[-1] if sums else (once, once, once)
    if before is None or step is None:
        sums.append(None)
    else:
        sums.append((before[0] + step[0], before[1] + step[1], before[2] + step[2]))


def _by_solver(points: Sequence[WorkPoint]) -> dict[str, list[WorkPoint]]:
    found: dict[str, list[WorkPoint]] = {}
    for point in points:
        found.setdefault(point.solver, []).append(point)
    return found


def _findings(
    running: Mapping[str, Sequence[_Times | None]],
    steps: Sequence[Mapping[str, Any]],
    metric: str,
    contended: str,
    final: Sequence[WorkPoint],
) -> Iterator[Finding]:
    ends = {name: sums[-1] for name, sums in running.items() if sums}
    own, said = ends.get("xfem"), f" Of the times: {contended}." if contended else ""
    for name, other in ends.items():
        if name == "xfem" or own is None or other is None:
            continue
        least, most = other[1] / own[2], other[2] / own[1]
        near = least < 2.0 and most > 0.5 if contended else least <= 1.0 <= most
        yield Finding(
            f"running cost over {len(steps)} steps, {name}",
            f"At equal {metric.replace('_', ' ')} ({steps[-1]['error']:.2g} at the last "
            f"step) {name} takes {other[0]:.3g} s and XFEM {own[0]:.3g} s: "
            f"{other[0] / own[0]:.3g} times as much (between {least:.3g} and {most:.3g} "
            f"over the repetitions).{said}",
            "XFEM is the cheaper, with all of the spread",
            held(None if near else least > 1.0),
        )
    for name, sums in running.items():
        if sums and sums[-1] is None:
            yield Finding(
                f"running cost, {name}",
                f"{name} has no time at step {1 + sums.index(None)}: none of its levels was "
                "solved, measured and accurate enough.",
                "a time at every step",
                Verdict.UNDECIDED,
            )
    if front := pareto_front(final):
        names = ", ".join(f"{p.solver} level {p.level}" for p in front)
        text = f"No other solve is both faster and more accurate than {names}."
        yield Finding("Pareto front at the last step", text, "shown, not judged", None)


def growing_scenes(scene: Scene, steps: int) -> list[Scene]:
    """Return `scene` with its first cut at 1/`steps`, 2/`steps`, …, all of its length.

    Parameters
    ----------
    scene : Scene
        Plane, static, judged by a conforming reference; its first cut is a polyline.
    steps : int
        At least 1.

    Returns
    -------
    list of Scene
        Named after the case with the step behind; without acceptance.

    Raises
    ------
    InputError
        If the scene has no such cut, or is judged by an exact solution (which holds for the
        whole cut only).
    """
    where = str(scene.file or scene.name)
    first = scene.cuts[0] if scene.cuts else None
    if not isinstance(first, PolylineCut):
        raise InputError("the first cut of the scene must be a polyline, which is grown", where)
    if scene.exact is not None:
        raise InputError("a scene with an exact solution has no shorter cuts", where)
    grown = []
    for step in range(1, steps + 1):
        points = _beginning(np.array(first.points, dtype=float), step / steps)
        content = [cut.model_dump(mode="json", by_alias=True) for cut in scene.cuts]
        expected = first.expected if step == steps else None
        content[0] |= {"points": points, "expected": expected}
        grown.append(changed(scene, str(step), {"cuts": content}))
    return grown


def _beginning(points: NDArray[np.float64], share: float) -> list[list[float]]:
    """Return the polyline's first part, by length."""
    if share >= 1.0:
        return [list(map(float, point)) for point in points]
    lengths = arc_lengths(points)
    whole = points[lengths < share * lengths[-1]]
    return [list(map(float, point)) for point in [*whole, points_along(points, share)]]
