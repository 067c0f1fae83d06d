"""Record of what the solvers of a case were judged by."""

from dataclasses import dataclass, fields
from typing import Any


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
