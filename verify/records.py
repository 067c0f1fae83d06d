"""Records that solutions and results share: what a solver dropped, its cut, its reference."""

from dataclasses import dataclass, field, fields
from typing import Any


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


@dataclass(frozen=True)
class CutRecord:
    """The realised cut of a solve beside the cut as asked.

    Parameters
    ----------
    dimension : int
        Of the cells, 2 or 3.
    asked_to_realised, realised_to_asked : float
        Largest distance of a point of one from the other, m, where the nearest point is no end.
    missing, surplus : float
        Of the cut as asked beyond the ends of the realised one, and the reverse: a length, m; of
        surfaces in space an area, m².
    swept : float
        Between the two over their common part: an area, m², in space a volume, m³.
    element : float
        Largest longest edge of the cells at the realised cut, m.
    limit : float
        Lateral deviation of a facet up to which fields are continued across it, m.
    radius : float or None
        Least radius of curvature of the cuts as asked, m; None if all are straight or plane.
    errors : dict of str to float
        Relative errors that are not judged, by metric: without any continuation if those judged
        are with it everywhere, else with it everywhere. Empty where both are the same.
    """

    dimension: int
    asked_to_realised: float
    realised_to_asked: float
    missing: float
    surplus: float
    swept: float
    element: float
    limit: float
    radius: float | None
    errors: dict[str, float] = field(default_factory=dict)

    @property
    def lateral(self) -> float:
        """Larger of both lateral deviations, m."""
        return max(self.asked_to_realised, self.realised_to_asked)

    @property
    def continued(self) -> bool:
        """Whether what is judged is continued across all of the realised cut."""
        return self.lateral <= self.limit

    @property
    def under_resolved(self) -> bool:
        """Whether an arc is of less than two elements in radius."""
        return self.radius is not None and self.radius < 2.0 * self.element


@dataclass(frozen=True)
class ReferenceRecord:
    """What a result says about its reference; None where it says nothing.

    Parameters
    ----------
    kind : {"exact", "conforming", "none"} or None
        None: the comparison failed.
    source : str
        What it is, in words.
    reason : str
        Why there is none.
    near : dict
        ``radius`` (m) within which errors are near a tip, and its ``reason``.
    levels : list of dict
        ``level``, ``size`` (m) and ``unknowns`` of each conforming level.
    time_to_accuracy : dict of str to dict
        By level: ``unknowns``, ``seconds``, and bounds of the relative errors by metric.
    metrics : dict of str to dict
        ``values`` by level, ``extrapolated``, ``uncertainty``, ``order``, ``reason``; ``second``, a
        second estimate, and its ``disagreement`` over the uncertainties.
    missing : dict of str to str
        Why it does not have a quantity of interest.
    suffices : bool
        Whether its uncertainty is at most a tenth of each error that it judges.
    suffices_reason : str
    judged_errors : dict of str to dict
        The errors that it judges, largest share of uncertainty first.
    overlap : dict
        ``depth`` (m) and ``place`` of material of an exact solution that lies in other material.
    """

    kind: str | None = None
    source: str | None = None
    reason: str | None = None
    near: dict[str, Any] | None = None
    levels: list[dict[str, Any]] | None = None
    time_to_accuracy: dict[str, dict[str, Any]] | None = None
    metrics: dict[str, dict[str, Any]] | None = None
    missing: dict[str, str] | None = None
    suffices: bool | None = None
    suffices_reason: str | None = None
    judged_errors: dict[str, dict[str, Any]] | None = None
    overlap: dict[str, Any] | None = None

    def said(self) -> dict[str, Any]:
        """Return what it says, by name."""
        entries = {one.name: getattr(self, one.name) for one in fields(self)}
        return {name: entry for name, entry in entries.items() if entry is not None}
