"""Provenance of numbers: the commit, the versions, the machine, the threads, the day.

Nothing is imported to find a version (DOLFINx would start MPI); the installed metadata says it.
"""

import json
import os
import platform
import re
import subprocess
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import verify
from verify.meaning import REVISION

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
        what numbers mean, `verify.meaning`), ``versions``, ``cpu``,
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
