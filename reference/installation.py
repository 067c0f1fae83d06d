"""FEniCSx and gmsh as installed: probes, versions' differences, cache of forms, MPI ranks.

``python -m reference.installation NAME`` probes one of them and prints one line of JSON: each probe
runs in a process of its own, because a broken installation may crash or hang instead of failing.

FFCx makes an empty file ``NAME.c``, compiles, and adds ``NAME.c.cached`` at the end. If it is
killed in between, every later process waits for the end and fails. Here the process that compiles
holds a lock on ``NAME.lock``, which the system releases when it dies.
"""

import fcntl
import json
import os
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError

_POLL = 0.05  # s
# s without a new file after which a program that takes no lock has been killed: DOLFINx itself
# waits for 10 s at most
_ABANDONED = 30.0
OLDEST = (0, 9)  # before, vectors and expressions are others
# direct solvers, preconditioners and orderings that PETSc may have been built with
_PACKAGES = ("mumps", "superlu_dist", "hypre", "metis", "parmetis", "ptscotch", "hdf5")


@cache
def guard_form_cache() -> Path:
    """Let FFCx compile under locks, in a folder that can be written; once per process.

    Returns
    -------
    Path
        The folder: DOLFINx's own, or one in the folder of temporary files, with a warning.

    Raises
    ------
    InputError
        If there is no such folder.
    """
    from dolfinx import jit
    from ffcx.codegeneration import jit as ffcx_jit

    try:
        options = jit.get_options()
    except OSError:  # a home that cannot be read has no options
        os.environ["XDG_CONFIG_HOME"] = str(Path(__file__).with_name("none"))
        options = jit.get_options()
    wanted = Path(options["cache_dir"])
    folder = wanted if _can_be_written(wanted) else _temporary(wanted)
    if folder != wanted:
        jit.get_options = _placed(jit.get_options, folder)
    ffcx_jit.get_cached_module = _locked(ffcx_jit.get_cached_module)
    return folder


def _can_be_written(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _temporary(wanted: Path) -> Path:
    """Make a folder of this user's own where temporary files are."""
    where = f"the cache of compiled forms {wanted} cannot be written"
    try:
        folder = Path(tempfile.gettempdir()) / f"verify-forms-{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        state = folder.lstat()
        if state.st_uid != os.getuid() or state.st_mode & 0o077 or not _can_be_written(folder):
            folder = Path(tempfile.mkdtemp(prefix="verify-forms-"))  # of somebody else
    except OSError as error:
        raise InputError(
            f"{where}, nor can temporary files ({error}); expected a folder for them: set "
            "XDG_CACHE_HOME or TMPDIR"
        ) from None
    warnings.warn(f"{where}; forms are kept in {folder}", RuntimeWarning, stacklevel=2)
    return folder


def _placed(options: Callable[..., Any], folder: Path) -> Callable[..., Any]:
    """Let DOLFINx's options name another folder, unless a caller does."""

    def get_options(priority_options: Any = None) -> Any:
        return options({"cache_dir": folder, **(priority_options or {})})

    return get_options


def _locked(look_up: Callable[..., Any]) -> Callable[..., Any]:
    """Have FFCx's look-up of a module wait for a compilation that runs, and for no other."""
    held: list[IO[str]] = []  # of the module that this process compiles now

    def get_cached_module(module_name: str, names: Any, cache_dir: Any, timeout: int) -> Any:
        while held:  # what was compiled before is done
            held.pop().close()
        stem = Path(cache_dir) / module_name
        stem.parent.mkdir(parents=True, exist_ok=True)
        ready = stem.with_suffix(".c.cached")
        lock = None
        while not ready.exists():
            lock = lock or stem.with_suffix(".lock").open("a+")
            try:
                free = _is_free(lock)
            except OSError:  # no locks on this file system
                break
            if free and _is_abandoned(stem, lock):
                if ready.exists():
                    break
                for suffix in (".c", ".o"):
                    stem.with_suffix(suffix).unlink(missing_ok=True)
                lock.truncate(0)
                lock.write("compiled under this lock")
                lock.flush()
                held.append(lock)
                return look_up(module_name, names, cache_dir, timeout)
            time.sleep(_POLL)
        if lock is not None:
            lock.close()
        return look_up(module_name, names, cache_dir, timeout)

    return get_cached_module


def _is_free(lock: IO[str]) -> bool:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _is_abandoned(stem: Path, lock: IO[str]) -> bool:
    """Tell whether nobody compiles a module of which there is no end, its lock being free."""
    if os.fstat(lock.fileno()).st_size:
        return True  # who did, did so under the lock
    changes = [path.stat().st_mtime for path in stem.parent.glob(f"{stem.name}.*c")]
    changes += [path.stat().st_mtime for path in stem.parent.glob(f"{stem.name}.*o")]
    return time.time() - max(changes, default=0.0) > _ABANDONED


def all_ranks() -> tuple[Any, str]:
    """Return the communicator of all MPI ranks that find each other, and whose MPI it is."""
    from mpi4py import MPI

    return MPI.COMM_WORLD, MPI.get_vendor()[0]


def import_dolfinx() -> ModuleType:
    """Import DOLFINx; the PyPI wheel wants ``dolfinx_solver`` first.

    Raises
    ------
    ImportError
        With its ``name`` set, if DOLFINx is not installed.
    InputError
        If it is older than `OLDEST`, or compiled forms have no folder that can be written.
    """
    try:
        import_module("dolfinx_solver")
    except ModuleNotFoundError as error:
        if error.name != "dolfinx_solver":
            raise
    dolfinx = import_module("dolfinx")
    if _version() < OLDEST:
        oldest = ".".join(map(str, OLDEST))
        raise InputError(
            f"DOLFINx {dolfinx.__version__} is too old: the reference needs {oldest} or newer"
        )
    guard_form_cache()
    return dolfinx


def create_simplex_mesh(
    points: NDArray[np.float64], cells: NDArray[np.int64], comm: Any = None
) -> Any:
    """Make a DOLFINx mesh of straight triangles, in the plane or in space, or tetrahedra.

    ``mesh.topology.original_cell_index`` maps its cells to rows of `cells`.

    Parameters
    ----------
    points : (n, d) array
    cells : (m, k + 1) array
    comm : MPI communicator, optional
        Over which the cells are distributed, from its rank 0: what other ranks give is not used.
        Default: each rank by itself.
    """
    import_dolfinx()
    import basix.ufl
    import ufl
    from dolfinx import mesh
    from mpi4py import MPI

    comm = comm or MPI.COMM_SELF
    d = points.shape[1]
    cell = "triangle" if cells.shape[1] == 3 else "tetrahedron"
    if comm.rank > 0:
        points, cells = points[:0], cells[:0]
    domain = ufl.Mesh(basix.ufl.element("Lagrange", cell, 1, shape=(d,)))
    if _version() >= (0, 10):
        return mesh.create_mesh(comm, cells, domain, points)
    create: Any = mesh.create_mesh  # its last arguments were the other way round before
    return create(comm, cells, points, domain)


def _version() -> tuple[int, int]:
    parts = import_module("dolfinx").__version__.split(".")
    return int(parts[0]), int(parts[1])


def _dolfinx() -> str:
    dolfinx = import_dolfinx()
    import basix
    import ufl

    return f"{dolfinx.__version__} (basix {basix.__version__}, ufl {ufl.__version__})"


def _petsc() -> str:
    import_dolfinx()
    from petsc4py import PETSc

    version = ".".join(map(str, PETSc.Sys.getVersion()))
    scalar = "real" if np.dtype(PETSc.ScalarType).kind == "f" else "complex"
    if scalar != "real":
        raise RuntimeError(f"PETSc {version} is built for complex numbers; real ones are needed")
    built = [name for name in _PACKAGES if PETSc.Sys.hasExternalPackage(name)]
    if "mumps" not in built:
        raise RuntimeError(f"PETSc {version} is built without MUMPS ({', '.join(built)})")
    return f"{version}, real, with {', '.join([*built, 'gamg'])}"


def _slepc() -> str:
    import_dolfinx()
    from slepc4py import SLEPc

    return ".".join(map(str, SLEPc.Sys.getVersion()))


def _mpi() -> str:
    import_dolfinx()
    from mpi4py import MPI

    name, version = MPI.get_vendor()
    return f"{name} {'.'.join(map(str, version))}"


def _forms() -> str:
    """Compile forms anew and assemble them: needs a C compiler, Python.h, PETSc's library."""
    with tempfile.TemporaryDirectory() as folder:
        return _compiled(folder)


def _compiled(folder: str) -> str:
    import_dolfinx()
    import ufl
    from dolfinx import fem, mesh
    from dolfinx.fem.petsc import assemble_matrix  # looks for the library when it is imported
    from mpi4py import MPI

    anew = {"cache_dir": folder}
    square = mesh.create_unit_square(MPI.COMM_SELF, 2, 2)
    x = ufl.SpatialCoordinate(square)
    value = fem.assemble_scalar(fem.form(6.0 * x[0] * ufl.dx(square), jit_options=anew))
    if abs(value - 3.0) > 1e-12:
        raise RuntimeError(f"the integral of 6x over the unit square came out as {value}")
    V = fem.functionspace(square, ("Lagrange", 1))
    product = ufl.TrialFunction(V) * ufl.TestFunction(V) * ufl.dx
    mass = assemble_matrix(fem.form(product, jit_options=anew))
    mass.assemble()
    ones = mass.createVecRight()
    ones.set(1.0)
    area = ones.dot(mass * ones)
    if abs(area - 1.0) > 1e-12:
        raise RuntimeError(f"the area of the unit square by its mass matrix came out as {area}")
    return "compiled, assembled, right"


def _cache() -> str:
    """Find where compiled forms are kept; in a folder of temporary files, the reason."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        import_dolfinx()
        folder = guard_form_cache()
    reasons = [str(one.message) for one in said if issubclass(one.category, RuntimeWarning)]
    return reasons[0] if reasons else str(folder)


def _gmsh() -> str:
    import gmsh

    gmsh.initialize(["-v", "0"], interruptible=False)
    try:
        gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(2)
        version: str = gmsh.option.getString("General.Version")
    finally:
        gmsh.finalize()
    return version


PROBES: dict[str, Callable[[], str]] = {
    "dolfinx": _dolfinx,
    "petsc": _petsc,
    "slepc": _slepc,
    "mpi": _mpi,
    "forms": _forms,
    "cache": _cache,
    "gmsh": _gmsh,
}


def main(name: str) -> None:
    """Run a probe and print what it found."""
    print(json.dumps({"found": PROBES[name]()}))


if __name__ == "__main__":
    main(sys.argv[1])
