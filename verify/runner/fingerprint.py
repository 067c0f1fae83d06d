"""Fingerprints that decide whether a stored solve or verdict is still that of today's code."""

import hashlib
import json
from collections.abc import Iterable
from functools import cache
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import verify
from verify.provenance import versions
from verify.scene import MeshFile, Scene, mesh_path
from verify.solvers.interface import is_built_in
from verify.solvers.named import solver_in

_PACKAGE = Path(verify.__file__).resolve().parent
# what can change any solution, and those of solvers that are built on our own methods
_SOLVING = (
    "errors.py", "scene", "solution.py", "handed_over.py", "system.py", "solvers",
    "runner/solve.py", "calibration.py",
)  # fmt: skip
_METHODS = ("xfem", "accelerated", "methods")
# what programs are handed, and those that come with the project
_PROGRAMS = ("exchange", "foreign")
_KINDS = (".py", ".toml", ".lock")
# the layers forbid them to import our methods, so that these do not make them solve again
_INDEPENDENT = ("conforming", "reference")
# what can change a verdict, given the solutions
_COMPARING = ("result.py", "compare", "assess", "verdict.py", "runner/assess.py")


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


@cache
def code_of_solver(name: str) -> str:
    """Return the hash of the sources and of the versions that a solver's answers depend on."""
    parts = _SOLVING if solver_in(name) in _INDEPENDENT else (*_SOLVING, *_METHODS)
    if not is_built_in(name):
        parts = (*parts, *_PROGRAMS)
    return digest_of([versions(), _sources(parts, _PACKAGE.parent / "reference")])


@cache
def code_of_comparison() -> str:
    """Return the hash of the sources that a verdict depends on, given the solutions."""
    reference = _PACKAGE.parent / "reference"
    folders = (reference / "exact", reference / "fracture")  # stress intensities are measured
    return digest_of([versions(), _sources(_COMPARING, *folders)])


def _sources(parts: Iterable[str], *folders: Path) -> list[tuple[str, str]]:
    files: set[Path] = set()
    for place in (*(_PACKAGE / part for part in parts), *folders):
        found = (path for path in place.rglob("*") if path.suffix in _KINDS)
        files |= {place} if place.is_file() else set(found)
    return [
        (path.relative_to(_PACKAGE.parent).as_posix(), file_digest(path)) for path in sorted(files)
    ]
