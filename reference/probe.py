"""Probe of FEniCSx and gmsh: what is here, and does it work: ``python -m reference.probe NAME``.

Prints one line of JSON. Each probe runs in a process of its own, because what is half installed
may crash or hang instead of failing.
"""

import json
import sys
import tempfile
import warnings
from collections.abc import Callable

import numpy as np

from reference.dolfinx_versions import guard_form_cache, import_dolfinx

# direct solvers, preconditioners and orderings that PETSc may have been built with
_PACKAGES = ("mumps", "superlu_dist", "hypre", "metis", "parmetis", "ptscotch", "hdf5")


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
    """Where compiled forms are kept; in a folder of temporary files, the reason."""
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
