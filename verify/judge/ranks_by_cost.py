"""Cost at equal error."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from verify.judge.intervals import Interval
from verify.judge.rates import ROUND_OFF
from verify.judge.standing import Item, compared_by_mean
from verify.judge.work import WorkPoint, time_at, work_points
from verify.ranking import Comparison, LeftOut, Standing
from verify.result import CaseResult

_METRICS = ("displacement_l2", "energy_norm")
_SAMPLE = 3  # repetitions: two have a range, but not one that says anything about a third


def cost_comparisons(results: Sequence[CaseResult], solvers: Sequence[str]) -> list[Comparison]:
    """Compare the time that each new cut costs, at the error that `common_error` finds.

    Where times are no sample (`why_times_are_no_sample`) nobody is certainly faster: all are tied.
    """
    comparisons, uncertain = [], bool(why_times_are_no_sample(results, solvers))
    for metric in _METRICS:
        items = [
            cost_item(result, metric, solvers)
            for result in results
            if any(s.metric(metric) for s in result.solves if s.solver in solvers)
        ]
        found = compared_by_mean(metric, "time at equal error", solvers, items)
        if found is not None and uncertain:
            found = replace(found, standings=_tied(found.standings))
        if found is not None:
            comparisons.append(found)
    return comparisons


def why_times_are_no_sample(results: Sequence[CaseResult], solvers: Sequence[str]) -> list[str]:
    """Say why the range of the repetitions does not bound the times, if it does not."""
    own = [s for r in results for s in r.solves if s.solver in solvers and s.timings]
    said = {s.notes["timing"] for s in own if s.notes.get("timing", "").startswith("contended")}
    fewest = min((max(map(len, s.timings.values())) for s in own), default=_SAMPLE)
    if fewest < _SAMPLE:
        said.add(f"solves that were timed fewer than {_SAMPLE} times have no interval ({fewest})")
    return sorted(f"{why}: by time all are tied" for why in said)


def _tied(standings: Sequence[Standing]) -> list[Standing]:
    ranked = sum(s.rank is not None for s in standings)
    return [
        s if s.rank is None else replace(s, rank=1, tied=ranked > 1, low=None, high=None)
        for s in standings
    ]


def common_error(points: Mapping[str, Sequence[WorkPoint]]) -> tuple[float, list[str]] | None:
    """Find the error at which most solvers can be compared; of several the smallest.

    A solver can be compared at an error that lies between those of its coarsest and of its best
    level: below it has no answer, above its time would be that of a mesh nobody would choose.

    Returns
    -------
    error : float
    solvers : list of str
        Those that are compared; None for fewer than two.
    """
    spans = {
        name: (min(p.error for p in own), max(p.error for p in own))
        for name, own in points.items()
        if own
    }
    room = 1 + 1e-9
    found: tuple[float, list[str]] | None = None
    for error in sorted(best for best, _ in spans.values()):
        able = [
            name for name, (best, worst) in spans.items() if best <= error * room <= worst * room**2
        ]
        if len(able) > (len(found[1]) if found else 1):
            found = error, able
    return found


def cost_item(result: CaseResult, metric: str, solvers: Sequence[str]) -> Item | LeftOut:
    """Take the times of a case at the error at which most solvers can be compared."""
    known = work_points([s for s in result.solves if s.solver in solvers], metric)
    # an error that cannot be told from none, by the reference or by round-off, buys nothing
    sure = [p for p in known if p.low > 0.0 and p.error > ROUND_OFF and p.seconds > 0.0]
    points = {name: [p for p in sure if p.solver == name] for name in solvers}
    common = common_error(points)
    if common is None:
        return LeftOut(result.case, "", "no error that two solvers reach and the reference tells")
    error, compared = common
    found, missing = {}, {}
    for name in solvers:
        times = time_at(points[name], error) if name in compared else None
        if times is None:
            missing[name] = _why_not(points[name], error)
        else:
            # time_at interpolates each of the three by itself: they may cross by round-off
            found[name] = Interval(times[0], min(times), max(times))
    return Item(f"{result.case}, error {error:.2e}", found, missing)


def _why_not(points: Sequence[WorkPoint], error: float) -> str:
    if not points:
        return "no level that is timed and whose error is known"
    best = min(point.error for point in points)
    if best > error:
        return f"does not reach this error: {best:.2e} at best"
    coarsest = max(points, key=lambda point: point.error)
    return (
        f"below this error on every level: {coarsest.error:.2e} already on level "
        f"{coarsest.level}, in {coarsest.seconds:.2e} s"
    )
