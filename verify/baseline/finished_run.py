"""A finished run directory, as a baseline reads it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from verify.errors import InputError
from verify.json_files import read_json
from verify.result import CaseResult
from verify.result_files import read_result
from verify.runner.fingerprint import digest_of
from verify.scene import Scene

_WORDS = {"title", "requirement", "tags", "acceptance", "known_findings", "contact"}


@dataclass(frozen=True)
class FinishedRun:
    """Results of a run by case, and where it comes from (commit, dirty, date, cpu)."""

    directory: Path
    results: dict[str, CaseResult]
    provenance: dict[str, Any]

    @property
    def origin(self) -> dict[str, Any]:
        """What a baseline keeps of the provenance: commit, dirty flag, date, meaning."""
        kept = {key: self.provenance.get(key) for key in ("commit", "dirty", "date")}
        return kept | {"meaning": self.meaning}

    @property
    def meaning(self) -> int:
        """Revision of what its numbers mean; 1 before revisions were kept."""
        found = self.provenance.get("meaning", 1)
        return found if isinstance(found, int) else 1


def read_run(directory: Path) -> FinishedRun:
    """Read a run that `verify run` or `verify import` has finished.

    Raises
    ------
    InputError
        If there is none, it has not finished, or a result is missing or damaged.
    """
    if not (directory / "run.json").is_file():
        raise InputError("not a run (it has no run.json)", str(directory))
    record = read_json(directory / "run.json")
    if not record.get("finished"):
        raise InputError("the run has not finished; its own command resumes it", str(directory))
    files = sorted((directory / "cases").glob("*/result.json"))
    results = [read_result(file) for file in files]
    by_case = {result.case: result for result in results}
    for name in record.get("cases", []):
        if name not in by_case:
            raise InputError(f"no result of '{name}'; run it again", str(directory))
    return FinishedRun(directory, by_case, record.get("provenance") or {})


def physics_of(result: CaseResult) -> str:
    """Digest of what was asked: the scene without its words and its acceptance.

    Defaults are left out, so that a key that the schema gains later changes nothing. A mesh file
    enters by the hash of the whole scene, which contains its bytes.

    Raises
    ------
    InputError
        If the scene in the result is not one of this version.
    """
    given = result.scene
    if all(cut.get("kind") != "tool_path" for cut in given.get("cuts") or []):
        analysis = {key: x for key, x in (given.get("analysis") or {}).items() if key != "opening"}
        given = {**given, "analysis": analysis}  # its default was another one
    try:
        scene = Scene.model_validate(given)
    except ValidationError:
        raise InputError("its scene is not of this version; run it again", result.case) from None
    content: list[Any] = [
        scene.model_dump(mode="json", by_alias=True, exclude=_WORDS, exclude_defaults=True)
    ]
    if result.scene.get("geometry", {}).get("kind") == "file":
        content.append(result.scene_hash)
    return digest_of(content)
