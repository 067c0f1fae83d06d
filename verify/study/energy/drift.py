"""Secular drift against bounded oscillation of an energy that should be constant.

The energy is averaged over whole periods, which removes the oscillation and most of the
correlation between neighbouring values; a line through the means has a slope with an uncertainty.
A motion that is cut has several stages: they share the slope, but each has a level of its own,
because the energy that a symplectic scheme keeps in truth differs from the mechanical one by an
amount that a cut changes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from verify.errors import InputError

__all__ = ["Drift", "secular_drift"]

_Floats = NDArray[np.float64]
_FEWEST = 5  # periods: a slope and its scatter from fewer means little
_CONFIDENCE = 0.95
_TREND = 2.58  # standard deviations of Kendall's statistic: 1 % of trends are chance
_ROUND_OFF = 1e-10  # of the scale: what Newton's tolerance and round-off may leave


@dataclass(frozen=True)
class Drift:
    """Drift of an energy, relative to a scale.

    Attributes
    ----------
    per_period : float
        Slope of the period means, per period.
    uncertainty : float
        95 % half-width of that slope.
    oscillation : float
        Largest distance from the line, over all instants.
    periods : int
        Whole periods fitted.
    kind : {"kept", "bounded oscillation", "secular loss", "secular gain"}
        Secular if zero lies outside the interval of the slope, or if the period means rise or
        fall in a row (a decay that is not a line); kept if slope and oscillation are round-off.
    is_line : bool
        Whether zero lies outside the interval of the slope; where it does not, what is secular
        is so by the order of the period means.
    """

    per_period: float
    uncertainty: float
    oscillation: float
    periods: int
    kind: str
    is_line: bool = True


def secular_drift(stages: Sequence[tuple[_Floats, _Floats]], period: float, scale: float) -> Drift:
    """Fit the drift of an energy.

    Parameters
    ----------
    stages : sequence of (time, energy)
        Each (n,) float array, in s and J; one pair if nothing is cut.
    period : float
        Of the slowest oscillation, in s.
    scale : float
        Energy to which the drift is relative, in J.

    Raises
    ------
    InputError
        If there are fewer than five whole periods, fewer than two in a stage or two instants in
        a period, or the period or the scale is not positive.
    """
    if not (np.isfinite(period) and period > 0.0 and np.isfinite(scale) and scale > 0.0):
        raise InputError(f"period {period:g} s, energy scale {scale:g} J; expected positive ones")
    parts = [_period_means(time, energy / scale, period) for time, energy in stages]
    count = sum(len(at) for at, _ in parts)
    free = count - len(parts) - 1
    if count < _FEWEST or free < 2 or min(len(at) for at, _ in parts) < 2:
        raise InputError(
            f"{count} whole periods in {len(parts)} stages; a drift needs {_FEWEST}, and 2 in each"
        )
    centred = np.concatenate([at - at.mean() for at, _ in parts])
    off = np.concatenate([means - means.mean() for _, means in parts])
    slope = float(centred @ off / (centred @ centred))
    scatter = np.sqrt(np.sum((off - slope * centred) ** 2) / free / (centred @ centred))
    width = float(student.ppf(0.5 + 0.5 * _CONFIDENCE, free) * scatter)
    oscillation = max(
        float(np.abs(energy / scale - means.mean() - slope * (time / period - at.mean())).max())
        for (time, energy), (at, means) in zip(stages, parts, strict=True)
    )
    is_line, trend = abs(slope) > width, _trend([means for _, means in parts])
    if max(abs(slope), oscillation) <= _ROUND_OFF:
        kind = "kept"
    elif (way := slope if is_line else trend) and (is_line or abs(trend) > _TREND):
        kind = "secular gain" if way > 0.0 else "secular loss"
    else:
        kind = "bounded oscillation"
    return Drift(slope, width, oscillation, count, kind, is_line)


def _trend(stages: Sequence[_Floats]) -> float:
    """Kendall's statistic of a trend within the stages, in standard deviations of chance."""
    signs = [np.sign(means[None, :] - means[:, None]) for means in stages]
    rising = sum(float(np.triu(sign).sum()) for sign in signs)
    counts = np.array([len(means) for means in stages])
    spread = np.sqrt(np.sum(counts * (counts - 1) * (2 * counts + 5)) / 18.0)
    return float(np.sign(rising) * max(abs(rising) - 1.0, 0.0) / spread)


def _period_means(time: _Floats, share: _Floats, period: float) -> tuple[_Floats, _Floats]:
    """Mean time, in periods, and mean energy of each whole period."""
    turn = (time - time[0]) / period
    count = int(np.floor(turn[-1] + 1e-9))
    number = np.floor(turn + 1e-9).astype(int)
    inside = number < count
    filled = np.bincount(number[inside], minlength=count)
    if count and filled.min() < 2:
        raise InputError("fewer than two instants in a period; a drift needs smaller steps")
    # a period holds a varying number of instants: the mean of their times, not its middle
    at = np.bincount(number[inside], time[inside] / period, minlength=count) / filled
    return at, np.bincount(number[inside], share[inside], minlength=count) / filled
