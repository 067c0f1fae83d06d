"""Dependencies of the tree: imports, locks, layers, sources."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

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


@cache
def imported_by(file):
    """Return the top-level names that a Python file imports."""
    names, nodes = set(), [ast.parse(file.read_bytes())]
    while nodes:  # statements alone: most nodes are of expressions, which hold none
        node = nodes.pop()
        nodes += [n for n in ast.iter_child_nodes(node) if not isinstance(n, ast.expr)]
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


@pytest.mark.parametrize(
    ("folder", "groups", "besides"),
    [
        ("verify", [None, "xfem", "pictures"], {"pytest", "distributed", "h5py"}),
        ("reference", [None, "gmsh", "fenicsx"], set()),
        # pytest's own protocol has no public name; conftest.py repeats it
        ("tests", [None, "xfem", "pictures", "gmsh", "fenicsx", "test", "dev"], {"_pytest"}),
    ],
)
def test_a_package_imports_only_what_is_declared_for_it(folder, groups, besides):
    assert imported(folder) - besides <= declared(*groups)


@pytest.mark.parametrize(
    ("name", "files"),
    [("distributed", {"engines.py"}), ("pytest", {"pytest_plugin.py"})],
)
def test_what_only_some_have_is_imported_by_its_own_modules_alone(name, files):
    assert {f.name for f in (ROOT / "verify").rglob("*.py") if name in imported_by(f)} == files


def test_every_base_dependency_is_used():
    assert declared(None) <= imported("verify", "reference")


def test_programs_of_foreign_solvers_import_nothing_of_the_project():
    for file in (ROOT / "verify" / "foreign" / "programs").rglob("*.py"):
        assert not imported_by(file) & {"verify", "reference"}, file


FULL = ROOT / ".ci/requirements.lock"
WITHOUT_DOLFINX = ROOT / ".ci/requirements-system-dolfinx.lock"
DOCS = ROOT / ".ci/requirements-docs.lock"


def normal(name):
    return re.sub(r"[-_.]+", "-", name).lower()


def pinned(lock):
    """Return name -> (version, number of hashes) of each entry."""
    entries = re.split(r"\n(?=\S)", lock.read_text().strip())
    found = {}
    for entry in entries:
        name, version = re.match(r"([A-Za-z0-9._-]+)==([^\s;\\]+)", entry).groups()
        found[normal(name)] = (version, len(re.findall(r"--hash=sha256:[0-9a-f]{64}\b", entry)))
    return found


def asked_for(*extras):
    """Return the names in pyproject.toml: the base, the extras and the build back end."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    lines = [*project["project"]["dependencies"], *project["build-system"]["requires"]]
    for extra in extras:
        lines += project["project"]["optional-dependencies"][extra]
    names = {normal(re.match(r"[A-Za-z0-9._-]+", line).group()) for line in lines}
    return names - {normal(project["project"]["name"])}


@pytest.mark.parametrize(
    ("lock", "covered"),
    [
        (FULL, asked_for("gmsh", "fenicsx", "test", "dev")),
        (WITHOUT_DOLFINX, asked_for("gmsh", "test", "dev")),
        (DOCS, asked_for("docs") - asked_for()),
    ],
    ids=["full", "without DOLFINx", "docs"],
)
def test_a_lock_covers_every_dependency_in_the_versions_of_the_full_one(lock, covered):
    found, full = pinned(lock), pinned(FULL)
    assert covered <= set(found)
    assert all(full.get(name, entry) == entry for name, entry in found.items())
    of_dolfinx = {"dolfinx-solver-real", "fenics-basix", "fenics-ufl", "mpi4py", "mpich"}
    assert lock is not WITHOUT_DOLFINX or not of_dolfinx & set(found)


@pytest.mark.parametrize("lock", [FULL, WITHOUT_DOLFINX, DOCS], ids=lambda lock: lock.name)
def test_every_pin_has_a_hash_and_no_address_option_or_path(lock):
    assert [name for name, (_, hashes) in pinned(lock).items() if hashes == 0] == []
    text = lock.read_text()
    assert not [word for word in ("://", "file:", " @ ") if word in text]
    assert not re.search(r"^\s*-(?!-hash=)", text, re.MULTILINE)


def test_every_direct_dependency_says_its_licence_in_the_guide():
    guide = (ROOT / "docs/guide/install.md").read_text()
    table = guide.split("\n## Licences\n")[1].split("\n## ")[0]
    first_column = " ".join(row.split("|")[1] for row in table.splitlines() if row.startswith("|"))
    words = {normal(word) for word in re.findall(r"[\w.-]+", first_column)}
    assert asked_for("gmsh", "fenicsx", "test", "dev", "docs") <= words


LINT = "from importlinter.cli import lint_imports_command; lint_imports_command()"


def lint(place):
    return subprocess.run(
        [sys.executable, "-c", LINT, "--no-cache"],
        cwd=place,
        env=os.environ | {"PYTHONPATH": str(place), "COLUMNS": "200"},
        capture_output=True,
        text=True,
        timeout=120,
    )


def test_every_contract_is_kept_and_a_forbidden_import_is_caught(root, tmp_path):
    done = lint(root)
    assert done.returncode == 0, done.stdout
    for package in ("verify", "reference"):
        shutil.copytree(
            root / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    shutil.copy(root / "pyproject.toml", tmp_path)
    trespasses = {
        "verify/xfem": ("import reference", "The compact solvers share no code"),
        "reference": ("import verify.xfem", "The reference shares no code"),
        "verify/compare": ("import verify.solvers", "No solver grades itself"),
        "verify/report": ("import verify.compare", "The report reads results"),
    }
    for place, (statement, _) in trespasses.items():
        (tmp_path / place / "trespasser.py").write_text(statement + "\n")
    done = lint(tmp_path)
    assert done.returncode == 1, done.stdout
    broken = [line for line in done.stdout.splitlines() if "BROKEN" in line]
    for _, contract in trespasses.values():
        assert any(line.startswith(contract) for line in broken), contract


def compiled_functions():
    """Yield file and function of everything that numba compiles."""
    texts = {file: file.read_bytes() for file in (ROOT / "verify").rglob("*.py")}
    for file, text in texts.items():
        for node in ast.walk(ast.parse(text if b"jit" in text else "")):
            if isinstance(node, ast.FunctionDef) and any(
                "jit" in ast.dump(decorator) for decorator in node.decorator_list
            ):
                yield file, node


def test_no_kernel_asserts():
    """The package has a pytest plugin: pytest rewrites its asserts, which numba cannot compile."""
    found = [
        f"{file.name}:{node.lineno}"
        for file, function in compiled_functions()
        for node in ast.walk(function)
        if isinstance(node, ast.Assert)
    ]
    assert found == []


def test_no_two_modules_of_the_tests_have_one_name():
    """Their folders are no packages: the second of two modules of one name is not collected."""
    names = Counter(file.name for file in (ROOT / "tests").rglob("*.py"))
    assert [name for name, count in names.items() if count > 1] == ["conftest.py"]
