"""What differs between versions of DOLFINx, in one place."""

from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["create_triangle_mesh", "import_dolfinx"]


def import_dolfinx() -> ModuleType:
    """Import DOLFINx; the PyPI wheel wants ``dolfinx_solver`` first.

    Raises
    ------
    ImportError
        With its ``name`` set, if DOLFINx is not installed.
    """
    try:
        import_module("dolfinx_solver")
    except ModuleNotFoundError as error:
        if error.name != "dolfinx_solver":
            raise
    return import_module("dolfinx")


def create_triangle_mesh(points: NDArray[np.float64], cells: NDArray[np.int64]) -> Any:
    """Make a serial DOLFINx mesh of straight triangles.

    ``mesh.topology.original_cell_index`` maps its cells to rows of `cells`.
    """
    import_dolfinx()
    import basix.ufl
    import ufl
    from dolfinx import mesh
    from mpi4py import MPI

    domain = ufl.Mesh(basix.ufl.element("Lagrange", "triangle", 1, shape=(2,)))
    major, minor = _version()
    if (major, minor) >= (0, 10):
        return mesh.create_mesh(MPI.COMM_SELF, cells, domain, points)
    create: Any = mesh.create_mesh  # its last arguments were the other way round before
    return create(MPI.COMM_SELF, cells, points, domain)


def _version() -> tuple[int, int]:
    parts = import_module("dolfinx").__version__.split(".")
    return int(parts[0]), int(parts[1])
