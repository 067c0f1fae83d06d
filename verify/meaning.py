"""Meaning of measured numbers, by revision: what is measured otherwise than it was before.

A run and every number of a baseline keep the revision at which they were made; files from before
revisions were kept have revision 1.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

from verify.result import SolveRecord

Scene = Mapping[str, Any]  # content of a scene


@dataclass(frozen=True)
class Change:
    """A change of what numbers mean.

    Parameters
    ----------
    revision : int
        From which on.
    metrics : tuple of str
        Names or patterns of the metrics.
    why : str
        What is measured now.
    concerns : callable
        Whether a case and a solve of it are concerned.
    """

    revision: int
    metrics: tuple[str, ...]
    why: str
    concerns: Callable[[Scene, SolveRecord], bool]


def _moves(scene: Scene, solve: SolveRecord) -> bool:
    return (scene.get("analysis") or {}).get("kind") == "dynamic"


def _linear_motion(scene: Scene, solve: SolveRecord) -> bool:
    """Whether a reference judges that was integrated by the trapezoidal rule."""
    linear = (scene.get("analysis") or {}).get("kinematics", "linear") == "linear"
    blade = any(cut.get("kind") == "tool_path" for cut in scene.get("cuts") or [])
    return _moves(scene, solve) and linear and not blade and not scene.get("exact")


def _reference_in_linear_motion(scene: Scene, solve: SolveRecord) -> bool:
    return solve.solver == "reference" and _linear_motion(scene, solve)


def _opens_swept(scene: Scene, solve: SolveRecord) -> bool:
    blade = any(cut.get("kind") == "tool_path" for cut in scene.get("cuts") or [])
    return blade and (scene.get("analysis") or {}).get("opening", "swept") == "swept"


def _not_continued(scene: Scene, solve: SolveRecord) -> bool:
    return solve.cut is not None and not solve.cut.continued


def _has_a_region(scene: Scene, solve: SolveRecord) -> bool:
    """Whether a formula names a part of the boundary that is loaded or held."""
    parts = [*(scene.get("loads") or []), *(scene.get("supports") or [])]
    return any(set(str(part.get("where") or "")) & set("<>") for part in parts)


CHANGES = (
    Change(
        2,
        ("energy_drift", "energy_slope", "energy_oscillation", "energy_jump", "ledger_mismatch",
         "released_to_scheme", "released_to_damping", "released_mismatch"),
        "energies are those of the fields, with the mass that the solver declares; they were the "
        "solver's own account",
        _moves,
    ),
    Change(
        2,
        ("displacement_l2*", "displacement_max*", "energy_norm*", "jump_l2*", "opening_l2*",
         "opening_max*"),
        "the reference is integrated by generalised-α with the spectral radius 1/2; it was by the "
        "trapezoidal rule",
        _linear_motion,
    ),
    Change(
        2,
        ("*",),
        "it is integrated by generalised-α with the spectral radius 1/2, which dissipates; it was "
        "by the trapezoidal rule",
        _reference_in_linear_motion,
    ),
    Change(
        2,
        ("*",),
        "the field is not continued across a cut that the solver moved or cut off, so that this is "
        "in the error; it was continued",
        _not_continued,
    ),
    Change(
        2,
        ("*",),
        "loads and supports act on the part of the boundary that the formula names; they acted on "
        "whole facets or nodes of it",
        _has_a_region,
    ),
    Change(
        3,
        ("*",),
        "what a blade opens is held by forces that fade as it is swept, of the reference and of "
        "own solvers; it was let go at once when it was passed",
        _opens_swept,
    ),
)  # fmt: skip
REVISION = max(change.revision for change in CHANGES)
# of uncertainties, which no axis of a baseline holds against those of before
WIDTHS = (
    2,
    "half-widths of references come from another rule, and those of relative errors of quantities "
    "contain the reference that divides",
)


def changes_of(
    metric: str, scene: Scene, solve: SolveRecord, old: int, new: int = REVISION
) -> Iterator[Change]:
    """Yield what changed in the meaning of a metric of a solve between two revisions."""
    low, high = sorted((old, new))
    for change in CHANGES:
        named = any(fnmatchcase(metric, pattern) for pattern in change.metrics)
        if low < change.revision <= high and named and change.concerns(scene, solve):
            yield change
