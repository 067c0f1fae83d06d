"""References in one file, to be committed: runs that judge by them need no FEniCSx.

A bundle is a zip file: ``bundle.json`` with the entries of `verify.runner.reference_cache`, and
the files of their solutions below ``<key>/``. It is given to a run by name (``--references``),
so that, other than in the cache, an entry is found by the physics of the scene alone: the code
and the versions that made it are those that it says, and the report repeats them. A scene whose
physics changed is not found, which is an error and not a reason to compute something else.
"""

import json
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from verify.errors import InputError
from verify.json_files import parse_json
from verify.printable import words_of
from verify.result import SolveRecord
from verify.runner.fingerprint import bytes_digest, digest_of, file_digest, physics_digest
from verify.runner.job import Job
from verify.runner.reference_cache import Entry, ReferenceCache, read_entry
from verify.scene import Scene
from verify.whole_files import asked_place, whole_file, write_whole

BUNDLE_SCHEMA = 1
_CONTENTS = "bundle.json"
# what is read of others: a bundle of ours unpacks to some ten times its size
_LARGEST_CONTENTS, _LARGEST_FILE, _MOST_TIMES = 2**26, 2**31, 200
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the same references give the same bytes


def write_bundle(path: Path, scenes: Sequence[Scene], cache: ReferenceCache) -> list[Entry]:
    """Write the references of `scenes` that are in `cache` into the file `path`, in one step.

    Raises
    ------
    InputError
        If a level of a scene's reference is not in the cache, the scene has none, or the file
        cannot be written where it is asked for.
    OSError
        If the disk is full.
    """
    entries: list[Entry] = []
    for scene in scenes:
        if scene.judged_by_exact:
            raise InputError(f"'{scene.name}' is judged by its exact solution; it has no reference")
        own = cache.find(scene)
        missing = set(range(scene.reference.levels)) - {entry.level for entry in own}
        if missing:
            levels = ", ".join(map(str, sorted(missing)))
            raise InputError(
                f"level {levels} of the reference of '{scene.name}' is not in the cache "
                f"({cache.root}); `verify run` of the case puts it there"
            )
        entries += own
    with (
        asked_place(path),
        whole_file(path) as partial,
        zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive,
    ):
        contents = {
            "schema": BUNDLE_SCHEMA,
            "entries": [entry.as_json() for entry in entries],
        }
        text = json.dumps(contents, indent=1, sort_keys=True)
        archive.writestr(_member(_CONTENTS), text, zipfile.ZIP_DEFLATED)
        for entry in entries:
            for name in sorted(entry.files):
                data = (cache.root / entry.key / name).read_bytes()
                archive.writestr(_member(f"{entry.key}/{name}"), data, zipfile.ZIP_DEFLATED)
    return entries


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
            unpacked = sum(member.file_size for member in archive.infolist())
        if unpacked > _MOST_TIMES * path.stat().st_size + _LARGEST_CONTENTS:
            text = f"unpacks to {unpacked / 1e6:.3g} MB, more than {_MOST_TIMES} times its size"
            raise InputError(f"not a bundle of references ({text})", where)
        self.digest = file_digest(path)
        if contents.get("schema") != BUNDLE_SCHEMA:
            raise InputError(f"not a bundle of schema {BUNDLE_SCHEMA}", where)
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
            for name in entry.files:
                self._read(entry, name)
        if not own:
            names = ", ".join(sorted({entry.case for entry in self._entries})) or "nothing"
            raise InputError(
                f"no reference for the physics of '{scene.name}' (it holds {names}); a scene that "
                "changed needs a new one: run it where FEniCSx is and `verify cache export`",
                str(self.path),
            )
        return len(own)

    def key(self, scene: Scene, level: int) -> str:
        """Return what identifies the solve that `take` gives."""
        return digest_of([physics_digest(scene), level, self.digest])

    def take(self, scene: Scene, job: Job) -> SolveRecord:
        """Unpack the reference for `job` into its folder.

        Raises
        ------
        InputError
            If the bundle is damaged.
        """
        entry = self._of(scene)[job.level]
        for name in entry.files:
            write_whole(job.folder / Path(name).name, self._read(entry, name))
        return entry.taken_by(job, f"from the bundle {self.path.name}")

    def _read(self, entry: Entry, name: str) -> bytes:
        member = f"{entry.key}/{name}"
        with _opened(self.path) as archive:
            data = _read(archive, member, _LARGEST_FILE)
        if bytes_digest(data) != entry.files[name]:
            raise InputError(f"'{member}' is damaged", str(self.path))
        return data

    def _of(self, scene: Scene) -> list[Entry]:
        physics = physics_digest(scene)
        own = {entry.level: entry for entry in self._entries if entry.physics == physics}
        return [own[level] for level in sorted(own)]


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
