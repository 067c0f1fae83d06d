"""Provenance of numbers: commit, versions, machine, threads, day, and the meaning that they have.

Nothing is imported to find a version (DOLFINx would start MPI); the installed metadata says it.

A run and every number of a baseline keep the revision at which they were made of what is measured;
files from before revisions were kept have revision 1.
"""

import json
import os
import platform
import re
import subprocess
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import verify
from verify.result import SolveRecord

# what is reported -> the distributions that may carry it, the likelier first
DISTRIBUTIONS = {
    "numpy": ["numpy"],
    "scipy": ["scipy"],
    "numba": ["numba"],
    "qdldl": ["qdldl"],
    "dolfinx": ["dolfinx-solver-real", "dolfinx-solver", "fenics-dolfinx"],
    "petsc": ["petsc4py", "petsc"],
    "gmsh": ["gmsh"],
    "meshio": ["meshio"],
    "pyvista": ["pyvista"],
}


def provenance() -> dict[str, Any]:
    """Describe the code and the machine.

    Returns
    -------
    dict
        ``commit`` (str or None), ``dirty`` (bool or None if unknown), ``meaning`` (revision of
        what numbers mean, `verify.provenance`), ``versions``, ``cpu``,
        ``cores`` (usable by this process), ``memory`` (bytes), ``load`` (one-minute average
        when asked), ``threads`` (of a solving process), ``os`` and ``date`` (UTC, ISO 8601).
    """
    commit, dirty = _commit()
    return {
        "commit": commit,
        "dirty": dirty,
        "meaning": REVISION,
        "versions": dict(versions()),
        "cpu": _cpu(),
        "cores": len(os.sched_getaffinity(0)),
        "memory": os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"),
        "load": round(os.getloadavg()[0], 2),
        "threads": 1,
        "os": _system(),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
    }


@cache
def versions() -> dict[str, str]:
    """Return the versions of the project, of Python and of what the solvers stand on.

    Of what is installed when it is asked first; what is installed later has not been imported.
    """
    found = {"verify": verify.__version__, "python": platform.python_version()}
    for name, distributions in DISTRIBUTIONS.items():
        for distribution in distributions:
            try:
                found[name] = metadata.version(distribution)
                break
            except metadata.PackageNotFoundError:
                continue
    if "petsc" not in found and (bundled := _bundled_petsc()):
        found["petsc"] = bundled
    return found


def _bundled_petsc() -> str | None:
    """Read the version of the PETSc inside the DOLFINx wheel from its library's name."""
    for distribution in DISTRIBUTIONS["dolfinx"]:
        try:
            files = metadata.files(distribution) or []
        except metadata.PackageNotFoundError:
            continue
        for file in files:
            if match := re.fullmatch(r"libpetsc[^/]*\.so\.(\d[\d.]*)", file.name):
                return match.group(1)
    return None


def _commit() -> tuple[str | None, bool | None]:
    """Find the commit and whether files differ from it: by git, else by the metadata of pip."""
    root = Path(verify.__file__).resolve().parent.parent
    if (root / ".git").exists():  # a checkout of ours, not one that happens to be around us
        try:
            head = _git(root, "rev-parse", "HEAD").strip()
            return head, bool(_git(root, "status", "--porcelain", "--untracked-files=no").strip())
        except (OSError, subprocess.SubprocessError):
            return None, None
    try:
        text = metadata.distribution("cutting-verification").read_text("direct_url.json")
        return json.loads(text or "{}")["vcs_info"]["commit_id"], False
    except (metadata.PackageNotFoundError, KeyError, TypeError, ValueError):
        return None, None


def _git(root: Path, *arguments: str) -> str:
    # safe.directory: a checkout that belongs to another user (a container's volume) is read too
    command = ["git", "-c", f"safe.directory={root}", "-C", str(root), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    return done.stdout


def _cpu() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        text = ""
    match = re.search(r"^(?:model name|Model)\s*:\s*(.+)$", text, re.MULTILINE)
    return match.group(1).strip() if match else platform.processor() or platform.machine()


def _system() -> str:
    try:
        name = platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError):
        name = platform.system()
    return f"{name}, {platform.system()} {platform.release()} {platform.machine()}"


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
