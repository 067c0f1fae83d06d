"""The result of a case that could not be compared: its solves, and a verdict ERROR per check."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from verify.result import CaseResult, SolveRecord, Verdict, VerdictRecord
from verify.runner.job import load_record
from verify.scene import Scene, scene_hash

__all__ = ["limit_text", "unjudged_check", "unjudged_result"]


def unjudged_result(
    scene: Scene, folders: Sequence[Path], reason: str, provenance: dict[str, Any]
) -> CaseResult:
    """Return what is known of `scene` without a comparison.

    Parameters
    ----------
    scene : Scene
    folders : sequence of Path
        Folders of its solves.
    reason : str
        Why there is no comparison, in one sentence.
    provenance : dict
    """
    solves: list[SolveRecord] = [load_record(folder) for folder in folders]
    return CaseResult(
        case=scene.name,
        title=scene.title,
        requirement=scene.requirement,
        scene_hash=scene_hash(scene),
        scene=scene.model_dump(mode="json", by_alias=True),
        reference={},
        solves=solves,
        rates=[],
        verdicts=[unjudged_check(check, Verdict.ERROR, reason) for check in scene.acceptance],
        provenance=provenance,
    )


def unjudged_check(check: Any, verdict: Verdict, reason: str) -> VerdictRecord:
    """Return the verdict on an acceptance check that was not observed."""
    return VerdictRecord(
        check=check.check,
        solver=check.solver,
        metric=check.metric,
        verdict=verdict,
        observed=None,
        low=None,
        high=None,
        limit=limit_text(check),
        reason=reason,
    )


def limit_text(check: Any) -> str:
    """Say what an acceptance check demands."""
    said = check.model_dump(exclude={"check", "solver", "metric", "source"}, exclude_none=True)
    return ", ".join(f"{key} {value}" for key, value in said.items())
