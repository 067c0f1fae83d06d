"""Name what this machine lacks, and the apt line that brings it.

    python system_requirements.py [--system-dolfinx]

Prints one line per missing thing and, last, the apt line (Debian 12 and 13, Ubuntu 24.04).
Exit code 0: nothing is missing; 1: apt has it all; 3: something that apt cannot bring.

The dynamic loader is asked, not the package database: a library that somebody built by hand
counts, and a package whose file is gone does not.
"""

import ctypes
import importlib.util
import platform
import shutil
import sys
import sysconfig
from collections.abc import Callable, Iterable
from pathlib import Path

# What the loader must find -> Debian package, who asks for it.
LIBRARIES = {
    "libGLU.so.1": ("libglu1-mesa", "gmsh"),
    "libGL.so.1": ("libgl1", "gmsh"),
    "libXrender.so.1": ("libxrender1", "gmsh"),
    "libXcursor.so.1": ("libxcursor1", "gmsh"),
    "libXft.so.2": ("libxft2", "gmsh"),
    "libXinerama.so.1": ("libxinerama1", "gmsh"),
    "libgomp.so.1": ("libgomp1", "gmsh"),
    "libEGL.so.1": ("libegl1", "off-screen pictures (VTK crashes without)"),
}
APT_PREFIX = "apt-get install -y --no-install-recommends"
OLDEST_GLIBC = (2, 34)  # of the DOLFINx wheel


def missing(
    load: Callable[[str], object] = ctypes.CDLL,
    which: Callable[[str], str | None] = shutil.which,
    include: Path | None = None,
    has_module: Callable[[str], bool] = lambda name: importlib.util.find_spec(name) is not None,
) -> dict[str, str]:
    """Return Debian package -> sentence about what is missing; empty if all is there.

    The arguments stand for the machine: how a library is loaded, where a program is, where
    this Python keeps its headers, whether a standard module is there.
    """
    found: dict[str, str] = {}
    for library, (package, reason) in LIBRARIES.items():
        try:
            load(library)
        except OSError:
            found[package] = f"{library} is missing, needed by {reason}"

    if which("cc") is None and which("gcc") is None:
        found["gcc"] = "no C compiler, needed by DOLFINx to compile forms"
    if not _compiles_against_libc(which):
        found["libc6-dev"] = "no C library headers, needed by DOLFINx to compile forms"

    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    include = Path(sysconfig.get_path("include")) if include is None else include
    if not (include / "Python.h").exists():
        found[f"{version}-dev"] = (
            f"{include}/Python.h is missing, needed by DOLFINx to compile forms"
        )
    if not (has_module("ensurepip") and has_module("venv")):
        found[f"{version}-venv"] = f"{sys.executable} cannot make virtual environments"
    return found


def missing_beyond_apt(
    libc: tuple[str, str] | None = None, prefix: str = sys.base_prefix, packages: Iterable[str] = ()
) -> list[str]:
    """Return a sentence for each thing that no package of this release repairs.

    ``libc`` is the C library's name and version, ``prefix`` where Python lives, ``packages``
    what `missing` names.
    """
    sentences = []
    name, number = platform.libc_ver() if libc is None else libc
    parts = tuple(int(part) for part in number.split(".")[:2] if part.isdigit())
    if name != "glibc" or parts < OLDEST_GLIBC:
        sentences.append(
            f"the DOLFINx wheel needs glibc >= 2.34, this system has {name or 'no glibc'} {number}"
            " (Debian 12 or Ubuntu 22.04 or newer have it; or use DOLFINX=system)"
        )
    if prefix != "/usr":
        sentences += [
            f"{package.removeprefix('python')}: the Python in {prefix} did not come from apt;"
            " reinstall it with headers and ensurepip, or name another: VERIFY_PYTHON=…"
            for package in packages
            if package.startswith("python")
        ]
    return sentences


def apt_line(packages: Iterable[str]) -> str:
    """Return the command that installs the packages, in a stable order."""
    return f"{APT_PREFIX} {' '.join(sorted(packages))}"


def _compiles_against_libc(which: Callable[[str], str | None]) -> bool:
    """Without a compiler there is nothing to ask: only the usual place of stdio.h counts."""
    triplet = sysconfig.get_config_var("MULTIARCH") or ""
    places = [Path("/usr/include"), Path("/usr/include") / triplet]
    if which("cc") is None and which("gcc") is None:
        return any((place / "stdio.h").exists() for place in places)
    # A compiler that is not Debian's (conda's, a toolchain in /opt) brings headers of its own.
    compiler = which("cc") or which("gcc") or ""
    return not compiler.startswith("/usr/bin/") or any((p / "stdio.h").exists() for p in places)


def main(arguments: list[str]) -> int:
    """Print what is missing; see the module's docstring."""
    packages = missing()
    hopeless = missing_beyond_apt(packages=packages)
    if "--system-dolfinx" in arguments:
        hopeless = [sentence for sentence in hopeless if "glibc" not in sentence]
    for sentence in hopeless:
        print(sentence)
    if hopeless:
        return 3
    for sentence in packages.values():
        print(sentence)
    if packages:
        print(apt_line(packages))
    return 1 if packages else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
