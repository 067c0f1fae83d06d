"""Is energy kept? A ledger's total over time: drift, trend, oscillation, jumps at cuts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ROUND_OFF = 1e-12  # of the largest energy: a sum of energies is not known better
# Parts of a ledger and the sign with which they enter what stays constant: what is stored and
# what dampers take count, what loads and supports have put in is taken off.
SIGNS = {
    "kinetic": 1.0, "strain": 1.0, "gravity": 1.0, "damping": 1.0, "work_of_loads": -1.0,
    "work_of_supports": -1.0,
}  # fmt: skip
# what the time scheme itself takes, the tie forces of a cut that is released, and what goes with
# material that is removed or a state that is projected: only where it is asked about
SCHEME = {"algorithmic": 1.0, "cut_work": 1.0, "projection": 1.0, "removed_energy": 1.0}


@dataclass(frozen=True)
class Balance:
    """What a total does over time, in its own unit.

    Parameters
    ----------
    drift : float
        Largest distance from the first value.
    slope : float
        Secular change per second: least squares, together with the jumps.
    slope_error : float
        Its standard error, 1/s; zero if nothing is left to estimate it from.
    oscillation : float
        Largest distance from trend and jumps: what stays bounded if the slope is zero.
    jumps : (c,) array
        Step at each cut beside the trend.
    off : Balance or None
        By how much each of these may be off, of a total that is not known to round-off.
    """

    drift: float
    slope: float
    slope_error: float
    oscillation: float
    jumps: Array
    off: "Balance | None" = None


def total_energy(ledger: Mapping[str, Array], scheme: bool = False) -> Array | None:
    """Sum (t,) of a ledger's parts that physics keeps constant; None without any of them.

    The solver's own ``total`` is not read. With `scheme`, what the time scheme dissipates and what
    was removed is added: then it is an identity of the solver's steps, and its changes are errors
    of account.
    """
    signs = {**SIGNS, **(SCHEME if scheme else {})}
    parts = [sign * np.asarray(ledger[name]) for name, sign in signs.items() if name in ledger]
    return np.sum(parts, axis=0) if parts else None


def energy_scale(ledger: Mapping[str, Array]) -> float:
    """Energy that drifts are measured against, J: the largest that moved from part to part.

    The largest kinetic or strain energy, or change of any other part: a potential has no zero.
    It is 0 if that is round-off of the largest part.
    """
    stored = [np.abs(ledger[name]).max() for name in ("kinetic", "strain") if name in ledger]
    moved = [np.ptp(ledger[name]) for name in SIGNS if name in ledger]
    largest = max((np.abs(ledger[name]).max() for name in SIGNS if name in ledger), default=0.0)
    scale = float(max([*stored, *moved], default=0.0))
    return scale if scale > _ROUND_OFF * largest else 0.0


def balance(
    times: Array, total: Array, cuts: Sequence[float] = (), width: Array | None = None
) -> Balance:
    """Separate trend, jumps and oscillation of a total.

    Parameters
    ----------
    times : (t,) array
        s.
    total : (t,) array
    cuts : sequence of float
        Times at which something was cut; those not inside the range of `times` count not. A
        value at the time of a cut is taken as before it.
    width : (t,) array, optional
        Half-widths of the intervals of `total`.
    """
    inner = sorted({cut for cut in cuts if times[0] <= cut < times[-1]})
    steps = [(times > cut).astype(float) for cut in inner]
    span = max(float(np.ptp(times)), 1e-300)
    columns = np.column_stack([np.ones_like(times), (times - times[0]) / span, *steps])
    start = total - total[0]  # a potential may be large: its zero is of no interest
    solved, _, rank, _ = np.linalg.lstsq(columns, start, rcond=None)
    rest = start - columns @ solved
    spare = len(times) - rank
    error = 0.0
    if spare > 0:
        inverse = np.linalg.pinv(columns.T @ columns)
        error = float(np.sqrt(rest @ rest / spare * inverse[1, 1]))
    return Balance(
        float(np.abs(start).max()), float(solved[1] / span), error / span,
        float(np.abs(rest).max()), np.asarray(solved[2:]),
        None if width is None else _off(columns, width, span),
    )  # fmt: skip


def _off(columns: Array, width: Array, span: float) -> Balance:
    """Largest change of a balance by changes of its total up to `width`."""
    fit = np.linalg.pinv(columns)
    solved = np.abs(fit) @ width
    rest = np.abs(np.eye(len(width)) - columns @ fit) @ width
    drift = float((width[1:] + width[0]).max(initial=0.0))
    return Balance(drift, float(solved[1] / span), 0.0, float(rest.max()), solved[2:])
