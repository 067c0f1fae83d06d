"""Record of something that a solver dropped, snapped, clamped, scaled or floored."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Regularisation:
    """Something the solver dropped, snapped, clamped, scaled or floored.

    Parameters
    ----------
    kind : str
        What was done, e.g. ``"zero-volume piece dropped"``.
    count : int
        How often.
    size : float or None
        Its largest contribution, in the unit of `unit`; None as read from JSON, which has no word
        for what is not finite.
    unit : str
        Unit of `size`, e.g. ``"volume fraction"``.
    """

    kind: str
    count: int
    size: float | None
    unit: str
