"""Cost: work against precision, and time at equal error."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from verify import result
from verify.judge.convergence import ROUND_OFF
from verify.judge.intervals import Interval, error_interval
from verify.result import CaseResult, SolveRecord, Status, Times, repeated_totals

_SAMPLE = 3  # repetitions: two have a range, but not one that says anything about a third


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

    @property
    def times(self) -> Times:
        """Median, least and most, s."""
        return self.seconds, self.fastest, self.slowest


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


def time_at(points: Sequence[WorkPoint], error: float) -> Times | None:
    """Return the time that `error` takes: median, least, most (s); see `verify.result`."""
    ordered = sorted(points, key=lambda p: p.level)
    return result.time_at([(p.error, p.times) for p in ordered if p.error > 0], error)


def pareto_front(points: Sequence[WorkPoint]) -> list[WorkPoint]:
    """Return the points that no other beats in both time and error, fast to slow.

    A point whose error cannot be told from a faster one's (their intervals overlap) stays.
    """
    return [
        p
        for p in sorted(points, key=lambda p: p.seconds)
        if not any(q.slowest < p.fastest and q.high < p.low for q in points if q is not p)
    ]


def why_times_are_no_sample(results: Sequence[CaseResult], solvers: Sequence[str]) -> list[str]:
    """Say why the range of the repetitions does not bound the times, if it does not."""
    own = [s for r in results for s in r.solves if s.solver in solvers and s.timings]
    said = {s.notes["timing"] for s in own if s.notes.get("timing", "").startswith("contended")}
    fewest = min((max(map(len, s.timings.values())) for s in own), default=_SAMPLE)
    if fewest < _SAMPLE:
        said.add(f"solves that were timed fewer than {_SAMPLE} times have no interval ({fewest})")
    return sorted(said)


def times_at_equal_error(
    one: Sequence[WorkPoint], other: Sequence[WorkPoint]
) -> tuple[Interval, Interval] | None:
    """Return the times of two solvers at the smallest error that both reach, s.

    An error that cannot be told from none, by the reference or by round-off, buys nothing.
    """
    both = [
        [(p.error, p.times) for p in points
         if p.low > 0.0 and p.error > ROUND_OFF and p.seconds > 0.0]
        for points in (one, other)
    ]  # fmt: skip
    if (found := result.times_at_equal_error(*both)) is None:
        return None
    # each of the three is interpolated by itself: they may cross by round-off
    first, second = (Interval(times[0], min(times), max(times)) for times in found)
    return first, second
