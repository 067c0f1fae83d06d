"""Keeping up with the clock: the step size after a cut (thesis, 4.4.4).

A cut adds unknowns, a step then takes longer, and the simulation falls behind. The thesis names two
ways to choose the step anew at each cut: from the times that the clock and the simulation have
taken since the cut before, or as n × DOFtime, a constant step per unknown. Between cuts the step
stays what it is. Both are for implicit schemes; an explicit one must stay below its critical step,
which `largest` can hold it to.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from verify.xfem.errors import XfemError

__all__ = ["MeasuredPace", "StepLimits", "StepPerUnknown"]


@dataclass
class StepLimits:
    """Bounds of the step, and how often they were needed.

    Attributes
    ----------
    smallest, largest : float
        In seconds.
    limited : int
        How many steps asked for were outside: the simulation then is not in real time (too large
        a step asked for), or idles (too small).

    Raises
    ------
    XfemError
        Unless 0 ≤ smallest ≤ largest, largest > 0.
    """

    smallest: float = 0.0
    largest: float = float("inf")
    limited: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        if not (0.0 <= self.smallest <= self.largest and self.largest > 0.0):
            raise XfemError(
                f"step limits {self.smallest:g} to {self.largest:g} s; expected an ascending, "
                "positive range"
            )

    def apply(self, step_size: float) -> float:
        """Bring a step size between the limits."""
        limited = min(max(step_size, self.smallest), self.largest)
        self.limited += limited != step_size
        return limited


@dataclass
class StepPerUnknown:
    """Step size n × DOFtime for n unknowns: the second way, which the thesis prefers.

    It reads no clock while it runs, so that a simulation can be repeated to the last digit.

    Attributes
    ----------
    seconds : float
        DOFtime, in seconds per unknown.
    limits : StepLimits

    Raises
    ------
    XfemError
        If the time per unknown is not positive and finite.
    """

    seconds: float
    limits: StepLimits = field(default_factory=StepLimits)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.seconds) and self.seconds > 0.0):
            raise XfemError(f"{self.seconds!r} s per unknown; expected positive and finite")

    @staticmethod
    def measured(
        step: Callable[[], object],
        unknowns: int,
        repetitions: int = 11,
        clock: Callable[[], float] = perf_counter,
        limits: StepLimits | None = None,
    ) -> "StepPerUnknown":
        """Measure DOFtime: the median wall time of a step over the unknowns of the body.

        Parameters
        ----------
        step : callable
            Takes one step; on a copy of the state, and once before, so that compilation is over.
        unknowns : int
            Scalar unknowns of the body.
        repetitions : int
        clock : callable
            In seconds.
        limits : StepLimits, optional

        Raises
        ------
        XfemError
            If there is nothing to measure.
        """
        if unknowns < 1 or repetitions < 1:
            raise XfemError(f"{repetitions} steps of {unknowns} unknowns; expected at least one")
        ticks = [clock()]
        for _ in range(repetitions):
            step()
            ticks.append(clock())
        seconds = float(np.median(np.diff(ticks))) / unknowns
        return StepPerUnknown(seconds, limits or StepLimits())

    def after_cut(self, unknowns: int) -> float:
        """Step size in seconds for a body with that many scalar unknowns."""
        return self.limits.apply(unknowns * self.seconds)


class MeasuredPace:
    """Step size from the clock: the first way, which needs no calibration.

    With Δw of wall time for Δs of simulated time since the last cut, a step of h has cost
    h Δw/Δs: that is the step with which the simulation goes as fast as the clock.

    Parameters
    ----------
    time : float
        Simulated time at the start, in seconds.
    clock : callable
        In seconds; never goes back.
    limits : StepLimits, optional
    """

    def __init__(
        self,
        time: float = 0.0,
        clock: Callable[[], float] = perf_counter,
        limits: StepLimits | None = None,
    ) -> None:
        self.limits = limits or StepLimits()
        self._clock = clock
        self._start = self._last = (clock(), time)

    def lag(self, time: float) -> float:
        """By how much the simulation is behind the clock since the start, in seconds."""
        wall, simulated = self._start
        return (self._clock() - wall) - (time - simulated)

    def after_cut(self, step_size: float, time: float) -> float:
        """Step size in seconds from now on.

        Parameters
        ----------
        step_size : float
            That since the last cut.
        time : float
            Simulated time. If it or the clock has not moved since the last cut the step stays.

        Raises
        ------
        XfemError
            If simulated or wall time went back.
        """
        wall = self._clock()
        passed, simulated = wall - self._last[0], time - self._last[1]
        if passed < 0.0 or simulated < 0.0:
            raise XfemError(
                f"{passed:g} s of wall and {simulated:g} s of simulated time since the last cut; "
                "expected neither to go back"
            )
        if simulated == 0.0 or passed == 0.0:
            return self.limits.apply(step_size)
        self._last = (wall, time)
        return self.limits.apply(step_size * passed / simulated)
