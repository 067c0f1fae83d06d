"""Differences between versions of DOLFINx and of the petsc4py below it, in one place."""

from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.form_cache import guard_form_cache
from verify.errors import InputError

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
