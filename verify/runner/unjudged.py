"""The result of a case that could not be compared: its solves, and an ERROR per check."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from verify.judge.checks import applied_checks, unjudged
from verify.reference_record import ReferenceRecord
from verify.result import CaseResult, SolveRecord, Verdict
from verify.runner.job import load_record
from verify.scene import Scene, scene_hash


def unjudged_result(
    scene: Scene,
    folders: Sequence[Path],
    reason: str,
    provenance: dict[str, Any],
    judge_only: Sequence[str] = (),
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
    judge_only : sequence of str
        Solvers that are judged; empty: all that were asked and do not refuse the case.
    """
    solves: list[SolveRecord] = [load_record(folder) for folder in folders]
    return CaseResult(
        case=scene.name,
        title=scene.title,
        requirement=scene.requirement,
        scene_hash=scene_hash(scene),
        scene=scene.model_dump(mode="json", by_alias=True),
        reference=ReferenceRecord(),
        solves=solves,
        rates=[],
        verdicts=[
            unjudged(applied.check, Verdict.ERROR, reason)
            for applied in applied_checks(scene.acceptance, solves, judge_only)
        ],
        provenance=provenance,
        row=asdict(scene.row) if scene.row else None,
    )
