"""Rows of a family that are judged by other rows: they wait until those are compared."""

from collections.abc import Iterable, Sequence

from verify.result import CaseResult
from verify.scene import RatioCheck, Scene


class Families:
    """The scenes of a run, and which of them wait for which.

    Parameters
    ----------
    scenes : iterable of Scene
    judge_only : sequence of str
        Solvers that are judged; empty: all.
    """

    def __init__(self, scenes: Iterable[Scene], judge_only: Sequence[str] = ()) -> None:
        self._judge_only = judge_only
        self._scenes = {scene.name: scene for scene in scenes}
        self._rows: dict[str, dict[float, str]] = {}
        for name, scene in self._scenes.items():
            if scene.row is not None:
                self._rows.setdefault(scene.row.family, {})[scene.row.value] = name
        self._compared: dict[str, CaseResult] = {}
        self._waiting: dict[str, CaseResult] = {}

    def ready(self, result: CaseResult) -> list[CaseResult]:
        """Take a result of the comparison; return those that are judged in full by now."""
        self._compared[result.case] = self._waiting[result.case] = result
        done = []
        for name, waiting in list(self._waiting.items()):
            rows = self._needed(self._scenes[name])
            if all(row in self._compared for row in rows.values()):
                del self._waiting[name]
                others = {value: self._compared[row] for value, row in rows.items()}
                done.append(self._judged(name, waiting, others))
        return done

    def _needed(self, scene: Scene) -> dict[float, str]:
        """Names of the rows of this run that `scene` is compared with, by their value."""
        if scene.row is None:
            return {}
        rows = self._rows[scene.row.family]
        asked = {c.row for c in scene.acceptance if isinstance(c, RatioCheck) and c.row is not None}
        return {value: rows[value] for value in asked if value in rows}

    def _judged(self, name: str, result: CaseResult, others: dict[float, CaseResult]) -> CaseResult:
        scene = self._scenes[name]
        if not any(isinstance(c, RatioCheck) and c.row is not None for c in scene.acceptance):
            return result
        if result.reference.kind is None:  # its comparison failed, and its verdicts say so
            return result
        from verify.judge.verdict import with_verdicts  # loads the comparison: only where needed

        return with_verdicts(scene, result, self._judge_only, others)
