"""Growth exponents: q ∝ ε^p over the decades of small ε, with what speaks against a power law."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

_SMALL = 1e-3  # larger slivers are not in the asymptotic range
_CONFIDENCE = 0.95
_WANDERING = 0.25  # half the spread of local slopes above which there is no single exponent


@dataclass(frozen=True)
class Growth:
    """Exponent p of q ∝ ε^p.

    Attributes
    ----------
    exponent : float or None
        Slope of the regression of log q on log ε.
    uncertainty : float
        The larger of the regression's 95 % half-width and half the spread of the slopes between
        neighbouring points: the first knows scatter, the second knows a bend.
    points : int
        Points fitted.
    reason : str
        Why there is no exponent, or what was left out.
    """

    exponent: float | None
    uncertainty: float
    points: int
    reason: str = ""


def growth(sizes: Sequence[float], values: Sequence[float | None], below: float = _SMALL) -> Growth:
    """Fit the exponent of a quantity over sliver sizes in (0, `below`].

    Sizes without a value are left out of the fit and counted in the reason.
    """
    pairs = [(s, v) for s, v in zip(sizes, values, strict=True) if 0.0 < s <= below * (1 + 1e-9)]
    bad = [s for s, v in pairs if v is None or not np.isfinite(v) or v <= 0.0]
    good = sorted((s, v) for s, v in pairs if v is not None and np.isfinite(v) and v > 0.0)
    if len(good) < 3:
        text = f"{len(good)} positive values at ε ≤ {below:g}; a fit with its uncertainty needs 3"
        return Growth(None, 0.0, len(good), text)
    x, y = np.log(np.array(good)).T
    centred = x - x.mean()
    slope = float(centred @ y / (centred @ centred))
    residual = y - y.mean() - slope * centred
    free = len(x) - 2
    scatter = np.sqrt(residual @ residual / free / (centred @ centred))
    width = float(student.ppf(0.5 + 0.5 * _CONFIDENCE, free) * scatter)
    local = np.diff(y) / np.diff(x)
    spread = 0.5 * float(np.ptp(local))
    if spread > _WANDERING:
        text = f"no single exponent: local slopes from {local.min():.2f} to {local.max():.2f}"
        return Growth(None, spread, len(good), text)
    note = f"without a value at ε = {', '.join(f'{s:g}' for s in bad)}" if bad else ""
    return Growth(slope, max(width, spread), len(good), note)
