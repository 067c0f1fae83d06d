"""The lock files pin all that the project asks for, by hash, and say nothing of where from."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FULL = ROOT / ".ci/requirements.lock"
WITHOUT_DOLFINX = ROOT / ".ci/requirements-system-dolfinx.lock"
DOCS = ROOT / ".ci/requirements-docs.lock"
EACH = pytest.mark.parametrize("lock", [FULL, WITHOUT_DOLFINX, DOCS], ids=lambda lock: lock.name)


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


def test_lock_covers_every_dependency():
    assert asked_for("gmsh", "fenicsx", "test", "dev") <= set(pinned(FULL))


def test_lock_for_a_system_dolfinx_covers_all_but_dolfinx():
    names = set(pinned(WITHOUT_DOLFINX))
    assert asked_for("gmsh", "test", "dev") <= names
    assert not names & {"dolfinx-solver-real", "fenics-basix", "fenics-ufl", "mpi4py", "mpich"}


def test_the_locks_agree_on_every_version():
    full = pinned(FULL)
    assert all(full[name] == entry for name, entry in pinned(WITHOUT_DOLFINX).items())
    assert all(full.get(name, entry) == entry for name, entry in pinned(DOCS).items())


def test_lock_of_the_documentation_covers_its_extra():
    assert asked_for("docs") - asked_for() <= set(pinned(DOCS))


@EACH
def test_every_pin_has_a_hash(lock):
    assert [name for name, (_, hashes) in pinned(lock).items() if hashes == 0] == []


@EACH
def test_lock_holds_no_address_option_or_path(lock):
    text = lock.read_text()
    assert "://" not in text
    assert not re.search(r"^\s*-(?!-hash=)", text, re.MULTILINE)
    assert "file:" not in text
    assert " @ " not in text


def test_every_direct_dependency_says_its_licence_in_the_guide():
    guide = (ROOT / "docs/guide/install.md").read_text()
    table = guide.split("\n## Licences\n")[1].split("\n## ")[0]
    first_column = " ".join(row.split("|")[1] for row in table.splitlines() if row.startswith("|"))
    words = {normal(word) for word in re.findall(r"[\w.-]+", first_column)}
    assert asked_for("gmsh", "fenicsx", "test", "dev", "docs") <= words
