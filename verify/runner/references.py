"""References that were solved before: kept in a folder that later runs look into, or in one file.

An entry of the cache is a folder named by a key that hashes all that the reference depends on: the
physics of the scene, the level, the parameters, the code of the reference and the versions of its
packages. Any change gives another key, so that an outdated entry is never found; it only takes up
room until it is removed.

::

    <root>/<key>/entry.json            what it is, where it comes from, digests of its files
                 solution.json|.vtu    as `verify.solution.write_solution` wrote them

A bundle is a zip file, to be committed, so that runs that judge by it need no FEniCSx:
``bundle.json`` with such entries, and ``<key>.xz`` for each (`verify.runner.packing`). A run is
given it by name (``--references``). Its entries are therefore found by the physics of the scene
alone, and the report states the code and the versions that made them. If the physics of a scene
has changed, that is an error.
"""

import json
import os
import re
import shutil
import tempfile
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from time import time
from typing import Any

from verify.errors import InputError
from verify.files import asked_place, parse_json, read_json, whole_file, write_json
from verify.printable import one_line, shown, words_of
from verify.provenance import provenance
from verify.result import REFERENCE, SolveRecord, Status, checked
from verify.runner.directory import Job, is_file_name, solution_files
from verify.runner.fingerprint import (
    bytes_digest,
    code_of_solver,
    digest_of,
    file_digest,
    reference_digest,
)
from verify.runner.packing import packed, unpacked
from verify.scene import Scene
from verify.scene.acceptance import FractureQuantity
from verify.solution import read_solution, write_solution

BESIDE = "references"  # folder beside a case in which its own bundle lies
ENTRY_SCHEMA = 1
_ENTRY = "entry.json"
_HOUR = 3600.0
BUNDLE_SCHEMA = 3
_CONTENTS = "bundle.json"
_PACKED = ".xz"
# limits for bundles of others
_LARGEST_CONTENTS, _LARGEST_FILE = 2**26, 2**28
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the same references give the same bytes


@dataclass(frozen=True)
class Entry:
    """A stored reference: one level of one scene.

    Parameters
    ----------
    key, physics, code : str
        Hashes of all that it depends on; of the scene; of the code and the versions.
    case : str
        Name of the case for which it was solved; for people only.
    level : int
    record : SolveRecord
    files : dict of str to str
        Digest of each file of the solution; in a bundle of the one that it is packed into.
    origin : dict
        Provenance of the solve.
    made : str
        Date, UTC.
    """

    key: str
    physics: str
    code: str
    case: str
    level: int
    record: SolveRecord
    files: dict[str, str]
    origin: dict[str, Any]
    made: str

    def as_json(self) -> dict[str, Any]:
        """Return it as plain values."""
        return {"schema": ENTRY_SCHEMA, **asdict(self)}

    @property
    def outdated(self) -> bool:
        """Whether the reference's code or versions are others today."""
        return self.code != code_of_solver(REFERENCE)

    def record_for(self, job: Job, words: str) -> SolveRecord:
        """Return its record for `job`, with a note in `words` on where it comes from."""
        code = "; the code of the reference has changed since" if self.outdated else ""
        by = f" with DOLFINx {self.dolfinx}" if self.dolfinx else ""
        said = f"{words}, solved {self.made}{by}{code}"
        notes = {**self.record.notes, "cache": said}
        return replace(self.record, case=job.case, notes=notes)

    @property
    def dolfinx(self) -> str | None:
        """Version of DOLFINx that solved it, if it is known."""
        versions = self.origin.get("versions")
        found = versions.get("dolfinx") if isinstance(versions, dict) else None
        return None if found is None else one_line(found, 40)


def current_key(scene: Scene, level: int, parameters: dict[str, Any]) -> str:
    """Return the key under which today's code keeps the reference of `scene`."""
    return digest_of([reference_digest(scene), level, parameters, code_of_solver(REFERENCE)])


def read_entry(content: Any, where: str) -> Entry:
    """Make an entry from what `Entry.as_json` gave.

    Raises
    ------
    InputError
        If it is not one.
    """
    if not isinstance(content, dict):
        raise InputError(f"not a stored reference ({shown(content)})", where)
    if (found := content.get("schema")) != ENTRY_SCHEMA:
        text = f"a stored reference of schema {shown(found)}; expected {ENTRY_SCHEMA}"
        raise InputError(text, where)
    fields = {name: value for name, value in content.items() if name != "schema"}
    entry = checked(Entry, fields, "stored reference", where)
    if not re.fullmatch(r"[0-9a-f]{8,64}", entry.key):
        raise InputError(f"not a stored reference (key {shown(entry.key)})", where)
    if entry.level < 0 or not entry.files:
        raise InputError(f"not a stored reference (level {entry.level}, no solution)", where)
    for name in entry.files:
        if not is_file_name(name):
            raise InputError(f"not a stored reference (a file called {shown(name)})", where)
    return entry


class ReferenceCache:
    """The references kept in a folder, which many runs may use at the same time."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def levels(self, scene: Scene) -> int:
        """Return how many levels of the reference of `scene` a run begins with."""
        return scene.reference.levels

    def take(self, scene: Scene, job: Job) -> SolveRecord | None:
        """Copy the reference for `job` into its folder, if a whole one is kept.

        A damaged entry is removed, and the reference solved again.
        """
        folder = self.root / current_key(scene, job.level, job.parameters)
        if not folder.is_dir():
            return None
        try:
            entry = self._entry(folder)
            for name, digest in entry.files.items():
                with whole_file(job.folder / name) as copied:
                    shutil.copyfile(folder / name, copied)
                if file_digest(job.folder / name) != digest:
                    raise InputError("differs from what was stored", str(folder / name))
        except (FileNotFoundError, InputError):  # damaged, or removed while we looked
            self._remove(folder)
            return None
        return entry.record_for(job, "from the reference cache")

    def keep(self, scene: Scene, job: Job, record: SolveRecord) -> str:
        """Keep the solution in the folder of `job`; say what hindered it, if anything did.

        A full or unwritable disk is not a reason to stop a run whose own files are written.
        """
        if record.status is not Status.SOLVED:
            return ""
        key = current_key(scene, job.level, job.parameters)
        try:
            self.root.mkdir(parents=True, exist_ok=True)
            partial = Path(tempfile.mkdtemp(prefix=".partial-", dir=self.root))
            try:
                files = solution_files(job.folder)
                for file in files:
                    shutil.copyfile(file, partial / file.name)
                entry = Entry(
                    key=key,
                    physics=reference_digest(scene),
                    code=code_of_solver(REFERENCE),
                    case=scene.name,
                    level=job.level,
                    record=record,
                    files={file.name: file_digest(file) for file in files},
                    origin=provenance(),
                    made=datetime.now(UTC).isoformat(timespec="seconds"),
                )
                write_json(entry.as_json(), partial / _ENTRY)
                if not (self.root / key).exists():
                    # one step; if another run was quicker, the other's is as good as ours
                    os.rename(partial, self.root / key)
            finally:
                shutil.rmtree(partial, ignore_errors=True)
        except OSError as error:
            where = error.filename or self.root
            return f"not kept in the reference cache: {error.strerror} ({where})"
        return ""

    def entries(self) -> list[Entry]:
        """Return the entries by case, level and date; unreadable ones are not listed."""
        found = []
        for folder in self._folders():
            try:
                found.append(self._entry(folder))
            except InputError:
                continue
        return sorted(found, key=lambda e: (e.case, e.level, e.made))

    def size(self, entry: Entry) -> int:
        """Bytes that an entry takes up."""
        with suppress(OSError):  # another run may remove it
            return sum(f.stat().st_size for f in (self.root / entry.key).iterdir())
        return 0

    def find(self, scene: Scene) -> list[Entry]:
        """Return the current entries of `scene`, by level."""
        physics = reference_digest(scene)
        own = [e for e in self.entries() if e.physics == physics and not e.outdated]
        return sorted(own, key=lambda entry: entry.level)

    def remove(self, entries: Iterable[Entry]) -> None:
        """Remove entries."""
        for entry in entries:
            self._remove(self.root / entry.key)

    def remove_damaged(self) -> int:
        """Remove incomplete entries, and return how many there were.

        An unfinished entry counts as damaged after an hour; before, a run may still write it.
        """
        count = 0
        for folder in self._folders(_HOUR):
            try:
                entry = self._entry(folder)
                whole = all(file_digest(folder / n) == d for n, d in entry.files.items())
            except (InputError, OSError):
                whole = False
            if not whole:
                self._remove(folder)
                count += 1
        return count

    def _folders(self, older: float = float("inf")) -> list[Path]:
        """Folders of entries, and of unfinished ones that are `older` (s)."""
        if not self.root.is_dir():
            return []
        return [
            path
            for path in sorted(self.root.iterdir())
            if path.is_dir()
            and (not path.name.startswith(".") or time() - path.stat().st_mtime > older)
        ]

    def _entry(self, folder: Path) -> Entry:
        entry = read_entry(read_json(folder / _ENTRY), str(folder / _ENTRY))
        if entry.key != folder.name:
            raise InputError(f"is the entry of '{entry.key}'", str(folder))
        return entry

    def _remove(self, folder: Path) -> None:
        # out of sight in one step: a reader finds it whole or not at all
        doomed = folder.with_name(f".removed-{folder.name}-{os.getpid()}")
        try:
            os.rename(folder, doomed)
        except OSError:
            return
        shutil.rmtree(doomed, ignore_errors=True)


def write_bundle(path: Path, scenes: Sequence[Scene], cache: ReferenceCache) -> list[Entry]:
    """Write the references of `scenes` that are in `cache` into the file `path`, in one step.

    Raises
    ------
    InputError
        If a level of a scene's reference is not in the cache, the scene has none, or the file
        cannot be written there.
    OSError
        If the disk is full.
    """
    entries: list[tuple[Entry, bool]] = []
    for scene in scenes:
        if scene.judged_by_exact:
            raise InputError(f"'{scene.name}' is judged by its exact solution; it has no reference")
        own = cache.find(scene)
        # of a crack's factor alone the judge reads accelerations, a third of all numbers
        inertia = any(isinstance(asked, FractureQuantity) for asked in scene.quantities)
        if missing := set(range(scene.reference.levels)) - {entry.level for entry in own}:
            levels = ", ".join(map(str, sorted(missing)))
            raise InputError(
                f"level {levels} of the reference of '{scene.name}' is not in the cache "
                f"({cache.root}); `verify run` of the case puts it there"
            )
        entries += [(entry, inertia) for entry in own]
    with (
        asked_place(path),
        whole_file(path) as partial,
        zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive,
    ):
        files = {}
        for number, (entry, inertia) in enumerate(entries):
            solution = read_solution(cache.root / entry.key / "solution")
            name = entry.key + _PACKED
            files[name] = packed(solution, inertia)
            entries[number] = replace(entry, files={name: bytes_digest(files[name])}), inertia
        contents = {"schema": BUNDLE_SCHEMA, "entries": [entry.as_json() for entry, _ in entries]}
        text = json.dumps(contents, indent=1, sort_keys=True)
        archive.writestr(_member(_CONTENTS), text, zipfile.ZIP_DEFLATED)
        for name, data in files.items():
            archive.writestr(_member(name), data, zipfile.ZIP_STORED)
    return [entry for entry, _ in entries]


def _member(name: str) -> zipfile.ZipInfo:
    return zipfile.ZipInfo(name, _EPOCH)


class ReferenceBundle:
    """A bundle that a run takes its references from.

    Raises
    ------
    InputError
        If `path` is not a bundle.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        where = str(path)
        with _opened(path) as archive:
            contents = parse_json(_read(archive, _CONTENTS, _LARGEST_CONTENTS), where)
        self.digest = file_digest(path)
        if (schema := contents.get("schema")) != BUNDLE_SCHEMA:
            text = f"a bundle of references of schema {shown(schema)}; expected {BUNDLE_SCHEMA}"
            raise InputError(f"{text}, as `verify cache export` writes it", where)
        entries = contents.get("entries")
        if not isinstance(entries, list):
            raise InputError("not a bundle of references ('entries' is no list)", where)
        self._entries = [read_entry(entry, where) for entry in entries]

    def levels(self, scene: Scene) -> int:
        """Return how many levels of the reference of `scene` it holds, all of them whole.

        Raises
        ------
        InputError
            If there is none, or a file of it is damaged.
        """
        own = self._of(scene)
        for entry in own:
            self._read(entry)
        if not own:
            names = ", ".join(sorted({entry.case for entry in self._entries})) or "nothing"
            raise InputError(
                f"no reference for the physics of '{scene.name}' (it holds {names}); a scene that "
                "changed needs a new one: run it where FEniCSx is and `verify cache export`",
                str(self.path),
            )
        return len(own)

    def holds(self, scene: Scene) -> bool:
        """Whether a reference of the physics of a scene is in it."""
        return bool(self._of(scene))

    def key(self, scene: Scene, level: int) -> str:
        """Return what identifies the solve that `take` gives."""
        return digest_of([reference_digest(scene), level, self.digest])

    def take(self, scene: Scene, job: Job) -> SolveRecord:
        """Unpack the reference for `job` into its folder.

        Raises
        ------
        InputError
            If the bundle is damaged.
        """
        entry = self._of(scene)[job.level]
        try:
            solution = unpacked(self._read(entry))
        except InputError as error:
            raise InputError(f"'{entry.key}{_PACKED}': {error.what}", str(self.path)) from None
        write_solution(solution, job.folder / "solution", compression=None)
        return entry.record_for(job, f"from the bundle {self.path.name}")

    def _read(self, entry: Entry) -> bytes:
        """Return the packed solution of an entry, whole."""
        name = entry.key + _PACKED
        with _opened(self.path) as archive:
            data = _read(archive, name, _LARGEST_FILE)
        if bytes_digest(data) != entry.files.get(name):
            raise InputError(f"'{name}' is damaged", str(self.path))
        return data

    def _of(self, scene: Scene) -> list[Entry]:
        physics = reference_digest(scene)
        own = {entry.level: entry for entry in self._entries if entry.physics == physics}
        return [own[level] for level in sorted(own)]


def bundle_of_case(scene: Scene) -> ReferenceBundle | None:
    """Return the bundle that comes with a case, ``references/<its name>.zip`` beside its file.

    None if there is none, or if the case has changed since: then its reference is solved.

    Raises
    ------
    InputError
        If there is a file that is not a bundle.
    """
    if scene.file is None or scene.judged_by_exact:
        return None
    path = scene.file.parent / BESIDE / f"{scene.file.stem}.zip"
    bundle = ReferenceBundle(path) if path.is_file() else None
    return bundle if bundle is not None and bundle.holds(scene) else None


@contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open a zip file; whatever is wrong with it is one error."""
    where = str(path)
    if not path.exists():
        raise InputError("no such file; expected a bundle of references", where)
    if not path.is_file():
        raise InputError("is no plain file; expected a bundle of references", where)
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive
    except InputError as error:
        raise error if error.where else InputError(error.what, where) from None
    except Exception as error:  # zipfile has a kind for each damaged field: struct.error, …
        raise InputError(f"not a bundle of references ({words_of(error)})", where) from None


def _read(archive: zipfile.ZipFile, name: str, largest: int) -> bytes:
    try:
        member = archive.getinfo(name)
    except KeyError:
        raise InputError(f"is damaged (there is no '{name}' in it)") from None
    if member.file_size > largest:
        text = f"'{name}' has {member.file_size / 1e6:.3g} MB; expected {largest / 1e6:.3g} at most"
        raise InputError(text)
    return archive.read(member)
