"""Fingerprints that decide whether a stored solve or verdict is still valid for today's code.

The dependencies of a module are read from its source: its imports, at the top or inside functions,
and theirs in turn. Of a package on the way to a module its ``__init__`` counts, and its imports if
names are imported from it. Imports by a name in a string are not seen: the caller names the module.
Comments, docstrings, positions in a file and imports for type checkers do not count. Data files
beside a module, and versions of other packages, do.
"""

import ast
import hashlib
import inspect
import json
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from importlib import metadata
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from verify.files import read_json, write_whole
from verify.provenance import DISTRIBUTIONS, versions
from verify.scene import MeshFile, Scene
from verify.solvers.interface import module_of, program_of

ROOT = Path(__file__).resolve().parent.parent.parent
_PACKAGES = ("verify", "reference")
_PROGRAMS = "verify.foreign.programs."
_WITH_DOCSTRING = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
_STORE = "sources.json"
_MOST = 5000  # files that are remembered
# what solves in a process of its own, and what judges in one
_SOLVING, _COMPARING = "verify.runner.solve", "verify.runner.judging"
# what a solver of somebody else may be built on
_OFFERED = ("solvers", "xfem", "accelerated", "methods", "exchange")


def digest_of(content: Any) -> str:
    """Return a short hash of plain values."""
    return bytes_digest(json.dumps(content, sort_keys=True).encode())


def bytes_digest(data: bytes) -> str:
    """Return the hash of some bytes, as `file_digest` does for a file."""
    return hashlib.sha256(data).hexdigest()[:24]


def file_digest(path: Path) -> str:
    """Return the hash of a file's bytes.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()[:24]


def physics_digest(scene: Scene) -> str:
    """Return the hash of what a solver sees: the scene without its words and its acceptance.

    Defaults are left out, so that a key that a later version adds does not make another scene
    of it; a default whose meaning changes needs another version of the schema.
    """
    words: dict[str, Any] = dict.fromkeys((*scene.words, "acceptance", "known_findings"), True)
    words["cuts"] = {"__all__": {"expected", "toughness"}}  # what no solve depends on
    physics = scene.model_dump(mode="json", by_alias=True, exclude=words, exclude_defaults=True)
    content: list[Any] = [scene.schema_, physics]
    if any(cut.on_the_way for cut in scene.cuts):
        # its default was another: what was stored under no word is what opened late
        content.append({"opening": scene.analysis.opening})
    if isinstance(scene.geometry, MeshFile):
        content.append(file_digest(scene.geometry.path))
    if scene.exact is not None:
        content += _registered_source(scene.exact.solution)
    return digest_of(content)


def reference_digest(scene: Scene) -> str:
    """Return the hash of what the reference sees: one for all positions of the mesh.

    Unless every cut is a triangle: these may be faces of the mesh, which the reference then keeps.
    """
    on_faces = scene.cuts and all(
        cut.kind == "polygon" and len(cut.points) == 3 for cut in scene.final_cuts
    )
    if scene.mesh.position and not on_faces:
        mesh = scene.mesh.model_copy(update={"position": 0})
        scene = scene.model_copy(update={"mesh": mesh})
    return physics_digest(scene)


def _registered_source(name: str) -> list[str]:
    """Digest of the module of an exact solution that another package registers, if it is one."""
    for point in entry_points(group="verify.exact_solutions", name=name):
        found = find_spec(point.module)
        if found is not None and found.origin is not None:
            return [file_digest(Path(found.origin))]
    return []


def code_of_solver(name: str) -> str:
    """Return the hash of all that a solver's answers depend on: its modules, data and versions.

    Of a solver that does not come with the project, all that it may be built on.
    """
    own, program = module_of(name), program_of(name)
    if own is None:
        return code_digest(
            _SOLVING, *(m for room in _OFFERED for m in modules_in(f"verify.{room}"))
        )
    return code_digest(_SOLVING, own, *([] if program is None else [program]))


def source_of(solver: Any) -> str:
    """Return the digest of the file that defines a solver, and of its attribute ``files``."""
    with suppress(OSError, TypeError):  # of no file, or of one that is not there
        source = inspect.getsourcefile(type(solver))
        files = [Path(source)] if source else []
        digests = [file_digest(path) for path in [*files, *getattr(solver, "files", ())]]
        return digests[0] if len(digests) == 1 else digest_of(digests) if digests else ""
    return ""


def code_of_comparison() -> str:
    """Return the hash of all that a verdict depends on, given the solutions."""
    return code_digest(_COMPARING)


class Source(NamedTuple):
    """A source file: the hash of its code, and the full names that it imports."""

    digest: str
    imports: list[str]


class Sources:
    """The sources below a folder, each read once.

    Parameters
    ----------
    root : Path
        Holds the packages.
    store : Path, optional
        File that keeps parsed sources by the hash of their bytes: parsing them takes seconds.
    """

    def __init__(self, root: Path = ROOT, store: Path | None = None) -> None:
        self.root, self.store = root, store
        self._known: dict[str, list] = {}
        self._read: dict[str, Source] = {}
        self._files: dict[str, Path | None] = {}
        self._new = False
        if store is not None and store.is_file():
            try:
                self._known = dict(read_json(store))
            except (ValueError, TypeError):  # damaged: read anew
                self._known = {}

    def digest(self, *modules: str) -> str:
        """Return the hash of all code, data and versions that modules depend on."""
        found = self.closure(*modules)
        outside = {name.partition(".")[0] for m in found for name in self._source(m).imports}
        content = [
            {name: self._source(name).digest for name in sorted(found)},
            {one.relative_to(self.root).as_posix(): file_digest(one) for one in self._data(found)},
            _versions(outside),
        ]
        self._remember()
        return digest_of(content)

    def closure(self, *modules: str) -> set[str]:
        """Return the modules that modules depend on, themselves included.

        Raises
        ------
        KeyError
            If one of `modules` is none.
        """
        if missing := [name for name in modules if self.file(name) is None]:
            raise KeyError(missing[0])
        found, waiting, passed = set[str](), list(modules), set[str]()
        while waiting:
            name = waiting.pop()
            if name in found:
                continue
            found.add(name)
            steps = name.split(".")
            above = (".".join(steps[:n]) for n in range(1, len(steps)))
            passed |= {package for package in above if self.file(package)}
            waiting += self._imported(name)
        return found | passed

    def file(self, name: str) -> Path | None:
        """Return the file of a module; None if there is none below the root."""
        if name not in self._files:
            place = self.root.joinpath(*name.split("."))
            files = (place / "__init__.py", place.with_name(f"{place.name}.py"))
            ours = name.partition(".")[0] in _PACKAGES
            self._files[name] = next((f for f in files if ours and f.is_file()), None)
        return self._files[name]

    def _imported(self, name: str) -> list[str]:
        """Modules that one imports: of a name in a module, that module."""
        whole = self._source(name).imports
        if name.startswith(_PROGRAMS):  # run by another Python, with their own folders as paths
            own = name.rpartition(".")[0]
            whole = [f"{place}.{n}" for n in whole for place in (own, _PROGRAMS.rstrip("."))]
        either = (n if self.file(n) else n.rpartition(".")[0] for n in whole)
        return [n for n in either if self.file(n) and n != name]

    def _source(self, name: str) -> Source:
        if name not in self._read:
            file = self.file(name)
            assert file is not None
            text = file.read_bytes()
            package = name if file.name == "__init__.py" else name.rpartition(".")[0]
            key = hashlib.sha256(f"{package} ".encode() + text).hexdigest()
            if key not in self._known:
                self._known[key], self._new = list(_parsed(text, package)), True
            self._read[name] = Source(*self._known[key])
        return self._read[name]

    def _data(self, modules: Iterable[str]) -> list[Path]:
        """Files that are no modules, in folders of modules and those below that hold no module."""
        folders = {file.parent for name in modules if (file := self.file(name)) is not None}
        found = {path for folder in folders for path in _data_files(folder)}
        return sorted(found)

    def _remember(self) -> None:
        if self._new and self.store is not None:
            self._new = False
            used = list(self._known.items())[-_MOST:]
            with suppress(OSError):  # else parsed again by the next process
                self.store.parent.mkdir(parents=True, exist_ok=True)
                write_whole(self.store, json.dumps(dict(used)))


@cache
def code_digest(*modules: str) -> str:
    """Return the hash of all that modules depend on, as it was when this process asked first."""
    return _own().digest(*modules)


def modules_in(package: str) -> list[str]:
    """Return all modules of a package."""
    place = ROOT.joinpath(*package.split("."))
    files = [path.relative_to(ROOT).with_suffix("") for path in place.rglob("*.py")]
    return [".".join(file.parts).removesuffix(".__init__") for file in sorted(files)]


def cache_folder() -> Path:
    """Return the folder of the cache: ``VERIFY_CACHE``, else below the user's cache folder."""
    if named := os.environ.get("VERIFY_CACHE"):
        return Path(named)
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "cutting-verification" / "references"


@cache
def _own() -> Sources:
    return Sources(store=cache_folder() / _STORE)


def _parsed(text: bytes, package: str) -> Source:
    """Read a source file of a package."""
    tree = ast.parse(text)
    for node in [tree, *_statements(tree)]:
        if isinstance(node, _WITH_DOCSTRING) and ast.get_docstring(node, clean=False) is not None:
            del node.body[0]
    imports = sorted(set(_imports(tree, package)))
    return Source(bytes_digest(ast.dump(tree).encode()), imports)


def _below(node: ast.AST) -> Iterator[ast.AST]:
    """Statements in the blocks of one, and what holds blocks itself: no expression holds any."""
    for block in ("body", "handlers", "cases", "orelse", "finalbody"):
        yield from getattr(node, block, ())


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    for one in _below(node):
        yield one
        yield from _statements(one)


def _imports(tree: ast.AST, package: str) -> Iterator[str]:
    """Full names of imports, but for type checkers alone."""
    for node in _below(tree):
        if isinstance(node, ast.If) and _is_type_checking(node.test):
            for other in node.orelse:
                yield from _imports(ast.Module([other], []), package)
        elif isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            steps = package.split(".")
            above = ".".join(steps[: len(steps) - node.level + 1]) if node.level else ""
            base = ".".join(filter(None, [above, node.module]))
            yield from (f"{base}.{name.name}" for name in node.names)
        else:
            yield from _imports(node, package)


def _is_type_checking(test: ast.expr) -> bool:
    return "TYPE_CHECKING" in (getattr(test, "id", ""), getattr(test, "attr", ""))


def _data_files(folder: Path) -> Iterator[Path]:
    for path in folder.iterdir():
        if path.is_dir():
            if path.name != "__pycache__" and not any(path.rglob("*.py")):
                yield from _data_files(path)
        elif path.suffix not in (".py", ".pyc"):
            yield path


def _versions(names: Iterable[str]) -> dict[str, str]:
    """Return the versions of Python and of the installed ones of these packages."""
    known = versions()
    found = {"python": known["python"]}
    for name in sorted(set(names) - set(_PACKAGES) - sys.stdlib_module_names):
        carried = [key for key, own in DISTRIBUTIONS.items() if name == key or name in own]
        found |= {key: known[key] for key in carried if key in known}
        if not carried:
            with suppress(metadata.PackageNotFoundError):
                found[name] = metadata.version(name)
    return found
