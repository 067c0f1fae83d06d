"""Provenance of numbers: commit, versions, machine and its speed, threads, day, and their meaning.

Nothing is imported to find a version (DOLFINx would start MPI); the installed metadata says it.

A run and every number of a baseline keep the revision of the measurement with which they were made;
files from before revisions were kept have revision 1.

Times have two yardsticks: a fixed piece of work beside every solve, and the time of compilation.
The kernel is the unit in which slow-downs are measured. Seconds of two runs differ because the
machine does (another clock, a neighbour, a laptop on battery). The ratio of a solve to this kernel,
both timed in the same process a moment apart, differs much less. The kernel is half arithmetic in
cache, half memory traffic, as the solvers are. It takes no memory while it is timed: one that did
took twice as long wherever the allocator had given its pages back to the system in between.
Compilation is numba's. Its seconds are processor time and exclusive: a kernel compiled while
another is being compiled counts for itself only.
"""

import json
import os
import platform
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from functools import cache
from importlib import metadata
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import verify
from verify.result import SolveRecord

# reported name -> the distributions that may carry it, the likelier first
DISTRIBUTIONS = {
    "numpy": ["numpy"],
    "scipy": ["scipy"],
    "numba": ["numba"],
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
        ``commit`` (str or None); ``dirty`` (bool or None if unknown); ``meaning`` (revision of
        what numbers mean, `verify.provenance`); ``versions``; ``cpu``;
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

    As installed at the first call; a package that is installed later has not been imported.
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
            # who solves a bundle of references anew has moved the old one aside
            where = ("--", ".", ":(exclude)cases/*/references/*")
            changed = _git(root, "status", "--porcelain", "--untracked-files=no", *where)
            return head, bool(changed.strip())
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
        The measurement of today.
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


def _support_may_jolt(scene: Scene, solve: SolveRecord) -> bool:
    """Whether a support is drawn by a history or a formula in time, which may have a kink."""
    drawn = (
        one.get("history") or re.search(r"\bt\b", str(one.get("displacement")))
        for one in scene.get("supports") or []
    )
    return _moves(scene, solve) and any(drawn)


def _left_a_piece(scene: Scene, solve: SolveRecord) -> bool:
    """Whether a piece within round-off went to the other half; virtual nodes do not state it."""
    stated = any("left to its neighbour" in one.kind for one in solve.regularisations)
    return stated or solve.solver.startswith("virtual_node")


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
    Change(
        4,
        ("jump_*", "opening_*"),
        "a piece that the solver left to the other half is read on that half; it was read on the "
        "side of the cut where it lies",
        _left_a_piece,
    ),
    Change(
        5,
        ("energy_drift", "energy_slope", "energy_oscillation", "energy_jump", "ledger_mismatch"),
        "what material takes up at once where the speed of a support jumps between outputs is "
        "apart from the integral of its work; it was in it",
        _support_may_jolt,
    ),
)  # fmt: skip
REVISION = max(change.revision for change in CHANGES)
# of half-widths, which no axis of a baseline compares with earlier ones
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


KERNEL = 2  # another number when the work changes: ratios of different kernels do not compare
_REPETITIONS = 5


def kernel_seconds(
    repetitions: int = _REPETITIONS, clock: Callable[[], float] = perf_counter
) -> list[float]:
    """Time the kernel, after one call that is not counted.

    Parameters
    ----------
    repetitions : int
    clock : callable
        Wall time in s, or `time.thread_time` for processor time.

    Returns
    -------
    list of float
        Seconds, about 0.01 each.
    """
    import numpy as np

    rng = np.random.default_rng(0)
    matrix = rng.standard_normal((128, 128)) / 128
    values = rng.standard_normal(200_000)
    places = rng.permutation(len(values))
    product, next_product = np.empty_like(matrix), np.empty_like(matrix)
    total, gathered = np.empty_like(values), np.empty_like(values)
    seconds = []
    for repetition in range(repetitions + 1):
        start = clock()
        product[:] = matrix
        for _ in range(30):
            np.matmul(product, matrix, out=next_product)
            product, next_product = next_product, product
        total[:] = values
        for _ in range(10):
            np.take(total, places, out=gathered, mode="clip")  # "raise" would take memory
            np.add(gathered, values, out=total)
            total *= 0.5
        total += product[0, 0]
        total.sort()
        if repetition:
            seconds.append(clock() - start)
    return seconds


def calibration_note() -> str:
    """Time the kernel and write that down as a note of a solve."""
    return f"kernel {KERNEL}: {' '.join(f'{seconds:.6g}' for seconds in kernel_seconds())}"


def seconds_of_note(note: str) -> list[float] | None:
    """Read what `calibration_note` wrote; None if it is of another kernel or unreadable."""
    head, _, rest = note.partition(": ")
    if head != f"kernel {KERNEL}":
        return None
    try:
        return [float(word) for word in rest.split()] or None
    except ValueError:
        return None


@dataclass
class CompileTimes:
    """Processor seconds of compilation by kernel, each without what it had compiled.

    Attributes
    ----------
    seconds : dict
        By ``module:kernel``, over all argument types that were compiled.
    kernels : int
        Compilations; those found in the cache are none.
    """

    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    kernels: int = 0

    @property
    def whole(self) -> float:
        """Seconds of all kernels."""
        return sum(self.seconds.values())


@contextmanager
def compile_times() -> Iterator[CompileTimes]:
    """Measure compilation in the block; nothing if numba has not been imported by its end."""
    times = CompileTimes()
    if sys.modules.get("numba") is None:  # what does not need it is not to wait for its import
        yield times
        return
    from numba.core import event

    under_way: list[list[float]] = []  # start of each kernel, and what it has had compiled

    class Listener(event.Listener):
        def on_start(self, event_: Any) -> None:
            under_way.append([process_time(), 0.0])

        def on_end(self, event_: Any) -> None:
            start, inner = under_way.pop()
            spent = process_time() - start
            kernel = event_.data["dispatcher"].py_func
            times.seconds[f"{kernel.__module__}:{kernel.__name__}"] += spent - inner
            times.kernels += 1
            if under_way:
                under_way[-1][1] += spent

    with event.install_listener("numba:compile", Listener()):
        yield times
