"""Check of what the solvers stand on: is it here, does it work, and if not, what brings it.

Nothing is believed because a package is listed as installed: each thing is tried, in a process
of its own, so that a library that crashes or hangs is a finding and not the end.
"""

import json
import os
import platform
import re
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from verify.printable import memory_text
from verify.processes import ONE_THREAD
from verify.provenance import provenance

_SECONDS = 120.0
_FENICSX = (
    'python -m pip install "dolfinx-solver-real>=0.11", or the fenics-dolfinx of conda-forge, '
    "or apt-get install -y python3-dolfinx (Debian 13)"
)

# what the loader says is missing -> Debian package
DEBIAN_PACKAGES = {
    "libGLU.so.1": "libglu1-mesa",
    "libGL.so.1": "libgl1",
    "libXrender.so.1": "libxrender1",
    "libXcursor.so.1": "libxcursor1",
    "libXft.so.2": "libxft2",
    "libXinerama.so.1": "libxinerama1",
    "libgomp.so.1": "libgomp1",
    "libEGL.so.1": "libegl1",
}

_NUMBA = """
import numba, numpy
@numba.njit
def total(values):
    s = 0.0
    for v in values:
        s += v
    return s
assert total(numpy.ones(3)) == 3.0
said = numba.__version__
"""

_PICTURE = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(64, 64))
plotter.add_mesh(pyvista.Sphere(), color="white")
image = plotter.screenshot(return_img=True)
assert image.std() > 1.0, "the picture is blank"
window = type(plotter.render_window).__name__
said = f"pyvista {pyvista.__version__}, VTK {pyvista.vtk_version_info}, {window}"
"""

_MODULE = "import {0}; said = getattr({0}, '__version__', 'present')"


@dataclass(frozen=True)
class Finding:
    """One thing that was examined.

    Parameters
    ----------
    name : str
    works : bool
    found : str
        What was found, or what went wrong.
    needed : bool
        Whether a full run needs it.
    cure : str
        The line that installs it, or what to do.
    """

    name: str
    works: bool
    found: str
    needed: bool = True
    cure: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return it as plain values."""
        return asdict(self)


def examine() -> list[Finding]:
    """Try everything that a full run needs.

    Returns
    -------
    list of Finding
        The machine first, then the compact solver's needs, the reference's, the report's.
    """
    machine = provenance()
    memory = memory_text(machine["memory"])
    found = [
        Finding("verify", True, f"{machine['versions']['verify']} ({_commit(machine)})"),
        _python(),
        Finding("machine", True, f"{machine['cpu']}, {machine['cores']} cores, {memory}"),
        Finding("system", True, machine["os"]),
    ]
    for module in ("numpy", "scipy", "pydantic", "meshio", "matplotlib"):
        cure = f"python -m pip install {module}"
        found.append(_tried(module, _script(_MODULE.format(module)), cure))
    found += [
        _tried("numba", _script(_NUMBA), "python -m pip install numba"),
        _tried("gmsh", _probe("gmsh"), 'python -m pip install "gmsh>=4.13"'),
        _tried("DOLFINx", _probe("dolfinx"), _FENICSX),
        _tried("PETSc", _probe("petsc"), f"{_FENICSX} (both have MUMPS and real numbers)"),
        _tried("SLEPc", _probe("slepc"), f"{_FENICSX}; only eigenfrequencies need it", False),
        _tried("MPI", _probe("mpi"), _FENICSX),
        *examine_forms(),
        _tried("off-screen VTK", _script(_PICTURE), _vtk_line()),
    ]
    return found


def examine_forms() -> tuple[Finding, Finding]:
    """Try the compiler of forms, and the folder that keeps them."""
    return (
        _tried("DOLFINx forms", _probe("forms"), _compiler_line()),
        _tried("cache of forms", _probe("cache"), _FENICSX),
    )


def _python() -> Finding:
    said = f"{platform.python_version()} ({sys.executable})"
    return Finding("Python", sys.version_info >= (3, 12), said, True, "Python 3.12 or newer")


def _commit(machine: dict[str, Any]) -> str:
    commit = machine["commit"]
    if not commit:
        return "no commit known"
    return f"commit {commit[:12]}{', with changes' if machine['dirty'] else ''}"


def _compiler_line() -> str:
    version = f"python3.{sys.version_info.minor}"
    return f"apt-get install -y gcc libc6-dev {version}-dev (a C compiler and Python.h)"


def _vtk_line() -> str:
    if find_spec("pyvista") is None:
        return "python -m pip install pyvista"
    return "apt-get install -y libegl1 (or libosmesa6)"


def _script(code: str) -> list[str]:
    return ["-c", f"import json\n{code}\nprint(json.dumps({{'found': str(said)}}))"]


def _probe(name: str) -> list[str]:
    return ["-m", "reference.installation", name]


def _tried(name: str, arguments: list[str], cure: str, needed: bool = True) -> Finding:
    root = str(Path(__file__).resolve().parent.parent)  # `reference` of a checkout
    paths = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = {**os.environ, **ONE_THREAD, "PYTHONPATH": paths}
    try:
        with tempfile.TemporaryDirectory(prefix="verify-doctor-") as folder:
            done = subprocess.run(
                [sys.executable, "-X", "faulthandler", *arguments],
                capture_output=True,
                text=True,
                timeout=_SECONDS,
                env=environment,
                cwd=folder,  # a stray numpy.py where the user is does not count
                check=False,
            )
    except subprocess.TimeoutExpired:
        return Finding(name, False, f"no answer within {_SECONDS:g} s", needed, cure)
    if done.returncode == 0 and (said := _last_json(done.stdout)) is not None:
        return Finding(name, True, said, needed)
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    if done.returncode < 0:
        crash = f"crashes (signal {-done.returncode})"
        return Finding(name, False, crash, needed, cure)
    text = lines[-1].strip() if lines else f"exit code {done.returncode}"
    return Finding(name, False, text, needed, _apt_line(text) or _cache_line(text) or cure)


def _last_json(text: str) -> str | None:
    for line in reversed(text.splitlines()):
        try:
            return str(json.loads(line)["found"])
        except (ValueError, KeyError, TypeError):
            continue
    return None


def _apt_line(text: str) -> str:
    match = re.search(r"(lib\S+\.so[.\d]*): cannot open shared object file", text)
    package = DEBIAN_PACKAGES.get(match.group(1)) if match else None
    return f"apt-get install -y {package}" if package else ""


def _cache_line(text: str) -> str:
    cure = "set XDG_CACHE_HOME, or TMPDIR, to a folder that can be written"
    return cure if "cannot be written" in text else ""
