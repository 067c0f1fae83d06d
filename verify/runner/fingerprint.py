"""Fingerprints that decide whether a stored solve or verdict is still that of today's code."""

import hashlib
import json
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from verify.scene import MeshFile, Scene, mesh_path
from verify.solvers.interface import module_of, program_of
from verify.source_digest import code_digest, modules_in

# what solves in a process of its own, and what judges in one
_SOLVING, _COMPARING = "verify.runner.solve", "verify.runner.judging"
# what a solver of somebody else may be built on
_OFFERED = ("solvers", "xfem", "accelerated", "methods", "exchange")


def digest_of(content: Any) -> str:
    """Return a short hash of plain values."""
    text = json.dumps(content, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def bytes_digest(data: bytes) -> str:
    """Return the hash of some bytes, as `file_digest` does for those of a file."""
    return hashlib.sha256(data).hexdigest()[:24]


def file_digest(path: Path) -> str:
    """Return the hash of a file's bytes.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()[:24]


def physics_digest(scene: Scene) -> str:
    """Return the hash of what a solver sees: the scene without its words and its acceptance.

    Defaults are left out, so that a key that a later version adds does not make another scene
    of it; a default whose meaning changes needs another version of the schema.
    """
    words: dict[str, Any] = dict.fromkeys(
        ("title", "requirement", "tags", "acceptance", "known_findings", "contact", "adequacy"),
        True,
    )
    words["cuts"] = {"__all__": {"expected"}}
    physics = scene.model_dump(mode="json", by_alias=True, exclude=words, exclude_defaults=True)
    content: list[Any] = [scene.schema_, physics]
    if isinstance(scene.geometry, MeshFile):
        content.append(file_digest(mesh_path(scene)))
    if scene.exact is not None:
        content += _registered_source(scene.exact.solution)
    return digest_of(content)


def _registered_source(name: str) -> list[str]:
    """Digest of the module of an exact solution that another package registers, if it is one."""
    for point in entry_points(group="verify.exact_solutions", name=name):
        found = find_spec(point.module)
        if found is not None and found.origin is not None:
            return [file_digest(Path(found.origin))]
    return []


def code_of_solver(name: str) -> str:
    """Return the hash of all that a solver's answers depend on: its modules, data and versions.

    Of a solver that does not come with the project, all that it may be built on.
    """
    own, program = module_of(name), program_of(name)
    if own is None:
        return code_digest(
            _SOLVING, *(m for room in _OFFERED for m in modules_in(f"verify.{room}"))
        )
    return code_digest(_SOLVING, own, *([] if program is None else [program]))


def code_of_comparison() -> str:
    """Return the hash of all that a verdict depends on, given the solutions."""
    return code_digest(_COMPARING)
