"""Bounds of the errors of a reference over the time of each level."""

from collections.abc import Mapping
from typing import Any

from verify.report.blocks import Figure
from verify.report.figures.studies import Series, loglog
from verify.report.figures.style import Palette
from verify.report.notation import is_error

__all__ = ["accuracy_figure"]

_COSTS = ("unknowns", "seconds")


def accuracy_figure(levels: Mapping[str, Mapping[str, Any]]) -> Figure | None:
    """Return the bounds of the relative errors over the wall time, or None if nothing was timed.

    Quantities in a panel of their own, before the norms of the field.

    Parameters
    ----------
    levels : mapping of str to record
        As the record of a reference holds it under ``time_to_accuracy``: levels in their order,
        each with ``unknowns``, ``seconds`` and bounds by metric.
    """
    names = dict.fromkeys(n for entry in levels.values() for n in entry if n not in _COSTS)
    palette, panels = Palette(), []
    for title, errors in (("of a quantity", False), ("of the field", True)):
        series = [
            Series(name.replace("_", " ").replace("l2", "L²"),
                   [(e.get("seconds"), e.get(name)) for e in levels.values()])
            for name in names
            if is_error(name) == errors
        ]  # fmt: skip
        panels.append(loglog(f"relative error {title}, bound", "wall time (s)", series, palette))
    said = (
        "Reference: bounds of its relative errors against the wall time of each level. "
        "Bounds of zero and levels that were not timed are in the table only."
    )
    drawn = [panel for panel in panels if panel is not None]
    return Figure(drawn, said) if drawn else None
