"""Cost: work against precision, time at equal error, performance and data profiles.

Profiles are those of Dolan and Moré (2002) and of Moré and Wild (2009).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import median

from verify.judge.convergence import ROUND_OFF
from verify.judge.intervals import Interval, error_interval
from verify.judge.standing import Item, compared_by_mean, item_at_equal_size
from verify.result import (
    CaseResult,
    Comparison,
    LeftOut,
    Profile,
    SolveRecord,
    Standing,
    Status,
    repeated_totals,
)

_METRICS = ("displacement_l2", "energy_norm")
_SAMPLE = 3  # repetitions: two have a range, but not one that says anything about a third
_METRIC = "displacement_l2"
_FAR = 100.0  # times the least error: of no use, however much more it is
_ERRORS = (0.1, 0.01)  # what a simulator needs, and what a verification does


@dataclass(frozen=True)
class WorkPoint:
    """One solve: what it cost and how far off it is.

    Parameters
    ----------
    solver : str
    level : int
    unknowns : int
    error, low, high : float
        Relative error and the interval in which it lies, given the reference's uncertainty.
    seconds, fastest, slowest : float
        Wall time of the phases that each cut costs anew: median, least and most of the
        repetitions.
    once : float
        Wall time of the phases that are paid once, s.
    phases : dict of str to float
        Median of each phase, s.
    memory : float
        Peak of the solving process, bytes.
    """

    solver: str
    level: int
    unknowns: int
    error: float
    low: float
    high: float
    seconds: float
    fastest: float
    slowest: float
    once: float
    phases: dict[str, float]
    memory: float


def work_points(records: Sequence[SolveRecord], metric: str) -> list[WorkPoint]:
    """Take the work and the precision of every solve that has both; coarse to fine."""
    points = []
    for record in sorted(records, key=lambda r: (r.solver, r.level)):
        measured = record.metric(metric)
        if record.status is not Status.SOLVED or measured is None or not record.timings:
            continue
        totals = paid_times(record)
        if not totals:
            continue
        error, paid = error_interval(measured), record.paid
        points.append(
            WorkPoint(
                solver=record.solver,
                level=record.level,
                unknowns=record.unknowns or 0,
                error=error.value,
                low=error.low,
                high=error.high,
                seconds=median(totals),
                fastest=min(totals),
                slowest=max(totals),
                once=sum(median(t) for name, t in record.timings.items() if name not in paid),
                phases={name: median(times) for name, times in record.timings.items()},
                memory=record.peak_memory or 0.0,
            )
        )
    return points


def paid_times(record: SolveRecord) -> list[float]:
    """Return the wall time of what each cut costs anew, s, by repetition."""
    return repeated_totals(record.paid)


def time_at(points: Sequence[WorkPoint], error: float) -> tuple[float, float, float] | None:
    """Return the time that `error` takes: median, least, most (s).

    Interpolated between the levels, log against log; None if the levels of `points` (of one
    solver) do not reach the error, and where they all stay below it, the time of the coarsest.
    """
    ordered = [p for p in sorted(points, key=lambda p: p.level) if p.error > 0]
    if not ordered or min(p.error for p in ordered) > error * (1 + 1e-9):
        return None
    if ordered[0].error <= error:
        first = ordered[0]
        return first.seconds, first.fastest, first.slowest
    for a, b in pairwise(ordered):
        if b.error <= error * (1 + 1e-9):
            share = math.log(a.error / error) / math.log(a.error / b.error)
            share = min(share, 1.0)
            one, two, three = (
                math.exp((1 - share) * math.log(s) + share * math.log(t))
                for s, t in (
                    (a.seconds, b.seconds), (a.fastest, b.fastest), (a.slowest, b.slowest),
                )
            )  # fmt: skip
            return one, two, three
    return None


def pareto_front(points: Sequence[WorkPoint]) -> list[WorkPoint]:
    """Return the points that no other beats in both time and error, fast to slow.

    A point whose error cannot be told from a faster one's (their intervals overlap) stays.
    """
    return [
        p
        for p in sorted(points, key=lambda p: p.seconds)
        if not any(q.slowest < p.fastest and q.high < p.low for q in points if q is not p)
    ]


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
    return sorted(said)


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


def times_at_equal_error(
    one: Sequence[WorkPoint], other: Sequence[WorkPoint]
) -> tuple[Interval, Interval] | None:
    """Return the times of two solvers at the smallest error that both reach, s.

    None where that error lies below the coarsest level of either: its time would be that of a mesh
    nobody would choose. An error that cannot be told from none, by the reference or by round-off,
    buys nothing.
    """
    both = [
        [p for p in points if p.low > 0.0 and p.error > ROUND_OFF and p.seconds > 0.0]
        for points in (one, other)
    ]
    if not all(both):
        return None
    error = max(min(p.error for p in points) for points in both)
    if any(max(p.error for p in points) * (1 + 1e-9) < error for points in both):
        return None
    found = []
    for points in both:
        if (times := time_at(points, error)) is None:
            return None
        # time_at interpolates each of the three by itself: they may cross by round-off
        found.append(Interval(times[0], min(times), max(times)))
    return found[0], found[1]


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


def performance_profile(results: Sequence[CaseResult], solvers: Sequence[str]) -> Profile:
    """Ratios of each solver's displacement error to the least one, at equal element size.

    An error that is round-off counts as `ROUND_OFF`, so that exact solvers tie.
    """
    items = [item_at_equal_size(result, _METRIC, solvers) for result in results]
    compared = [item for item in items if isinstance(item, Item) and len(item.found) > 1]
    steps: dict[str, list[float]] = {name: [] for name in solvers}
    for item in compared:
        least = max(min(own.value for own in item.found.values()), ROUND_OFF)
        for name, own in item.found.items():
            steps[name].append(max(own.value, ROUND_OFF) / least)
    quantity = "error over the least error, at equal element size"
    return replace(_profile(quantity, len(compared), steps), most=_FAR)


def data_profiles(results: Sequence[CaseResult], solvers: Sequence[str]) -> list[Profile]:
    """Least seconds in which each solver has brought each case below an error, on any level."""
    found = []
    for error in _ERRORS:
        steps: dict[str, list[float]] = {name: [] for name in solvers}
        for result in results:
            points = [p for p in work_points(result.solves, _METRIC) if p.solver in solvers]
            good = [p for p in points if p.error <= error]
            for name in {p.solver for p in good}:
                steps[name].append(min(p.seconds for p in good if p.solver == name))
        found.append(_profile(f"seconds to a relative error of {error:g}", len(results), steps))
    return found


def _profile(quantity: str, items: int, steps: dict[str, list[float]]) -> Profile:
    return Profile(quantity, items, {name: sorted(own) for name, own in steps.items()})
