"""DOLFINx as it is installed: its versions' differences, its cache of forms, its MPI ranks.

FFCx makes an empty file ``NAME.c``, compiles, and adds ``NAME.c.cached`` at the end. If it is
killed in between, every later process waits for the end and fails. Here whoever compiles holds a
lock on ``NAME.lock``, which the system releases when it dies.
"""

import fcntl
import os
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


@cache
def guard_form_cache() -> Path:
    """Have FFCx compile under locks, in a folder that can be written; once per process.

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
    """Have DOLFINx's options name another folder, unless a caller does."""

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
    """Whether nobody compiles a module of which there is no end, its lock being free."""
    if os.fstat(lock.fileno()).st_size:
        return True  # who did, did so under the lock
    changes = [path.stat().st_mtime for path in stem.parent.glob(f"{stem.name}.*c")]
    changes += [path.stat().st_mtime for path in stem.parent.glob(f"{stem.name}.*o")]
    return time.time() - max(changes, default=0.0) > _ABANDONED


def all_ranks() -> tuple[Any, str]:
    """Return the communicator of all MPI ranks that find each other, and whose MPI it is."""
    from mpi4py import MPI

    return MPI.COMM_WORLD, MPI.get_vendor()[0]


OLDEST = (0, 9)  # before, vectors and expressions are others


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
