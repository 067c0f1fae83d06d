"""Declared dependencies are those that are imported, and the other way round."""

import ast
import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

# Distribution -> what it is imported as, where that is another name.
IMPORTED_AS = {
    "dolfinx-solver-real": {
        "dolfinx", "dolfinx_solver", "ufl", "basix", "ffcx", "petsc4py", "slepc4py", "mpi4py",
    },
    "pillow": {"PIL"},
    "pyvista": {"pyvista", "vtkmodules"},  # VTK is what it is an interface of
    "scikit-fem": {"skfem"},
    "import-linter": {"importlinter"},
}  # fmt: skip


def declared(*groups):
    """Return the import names of the base dependencies (``None``) or of extras."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    names = set()
    for group in groups:
        lines = project["optional-dependencies"][group] if group else project["dependencies"]
        for line in lines:
            distribution = re.match(r"[A-Za-z0-9._-]+", line).group()
            names |= IMPORTED_AS.get(distribution, {distribution.replace("-", "_")})
    return names - {"cutting_verification"}


def imported_by(file):
    """Return the top-level names that a Python file imports."""
    names = set()
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add(node.module.split(".")[0])
    return names


def imported(*folders):
    """Return the third-party top-level names that the Python files in the folders import."""
    # programs of foreign solvers are run by other Pythons, and tests import the parts they share
    guests = sorted((ROOT / "verify" / "foreign" / "programs").rglob("*.py"))
    names, own = set(), {"verify", "reference", *(file.stem for file in guests)}
    for folder in folders:
        for file in sorted({*(ROOT / folder).rglob("*.py")} - {*guests}):
            if folder == "tests":
                own.add(file.stem)  # tests import the modules beside them
            names |= imported_by(file)
    return names - own - set(sys.stdlib_module_names)


def test_framework_imports_only_its_base_dependencies():
    assert imported("verify") - {"pytest", "distributed"} <= declared(None)


def test_only_what_runs_on_a_cluster_imports_dask():
    importing = {f.name for f in (ROOT / "verify").rglob("*.py") if "distributed" in imported_by(f)}
    assert importing == {"cluster.py", "remote.py"}


def test_only_the_pytest_plugin_imports_pytest():
    # pytest loads it, so who needs it has it; nothing else may.
    files = (ROOT / "verify").rglob("*.py")
    importing = [
        f.name for f in files if re.search(r"^\s*(import|from) pytest", f.read_text(), re.M)
    ]
    assert importing == ["pytest_plugin.py"]


def test_reference_imports_only_the_base_and_the_fenicsx_extra():
    assert imported("reference") <= declared(None, "gmsh", "fenicsx")


def test_tests_import_only_what_is_declared():
    # pytest's own protocol has no public name; conftest.py repeats it
    names = imported("tests") - {"_pytest"}
    assert names <= declared(None, "gmsh", "fenicsx", "test", "dev")


def test_every_base_dependency_is_used():
    assert declared(None) <= imported("verify", "reference")


def test_programs_of_foreign_solvers_import_nothing_of_the_project():
    for file in (ROOT / "verify" / "foreign" / "programs").rglob("*.py"):
        assert not imported_by(file) & {"verify", "reference"}, file
