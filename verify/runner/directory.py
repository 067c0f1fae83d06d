"""The run directory: who may write into it, where things lie in it, and the solves that do.

::

    DIR/.lock                              held while a run writes
    DIR/run.json                           command, options, cases, provenance
    DIR/cases/<case, / as __>/scene.json   the case as it was run
                              result.json  its `CaseResult`
                              <solver>-<level>/solution.json|.vtu, record.json, levels, log.txt
"""

import errno
import fcntl
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.files import asked_place, read_json, write_json
from verify.result import SolveRecord, Status, checked, folder_of_case
from verify.runner.fingerprint import file_digest
from verify.solvers.interface import MOST_LEVELS

RUN_SCHEMA = 1
# files that outlive a process: the solve that a comparison is at, and the number of levels of a
# solver that accepts the case
JUDGING, MEASURED, LEVELS = "judging", "measured", "levels"
_IDENTITY = ("cases", "options_of_result")


class RunDirectory:
    """Paths inside a run directory."""

    def __init__(self, root: Path) -> None:
        self.root = root

    @property
    def run_file(self) -> Path:
        """Record of the run as a whole."""
        return self.root / "run.json"

    def case_folder(self, case: str) -> Path:
        """Folder of a case."""
        return self.root / "cases" / folder_of_case(case)

    def solve_folder(self, case: str, solver: str, level: int) -> Path:
        """Folder of one solve."""
        return self.case_folder(case) / f"{folder_name(solver)}-{level}"

    def solves(self, case: str, solver: str) -> list[Path]:
        """Folders of the solves of a solver that have a record, by level."""
        levels = (self.solve_folder(case, solver, level) for level in range(MOST_LEVELS))
        return [folder for folder in levels if (folder / "record.json").is_file()]


def folder_name(solver: str) -> str:
    """Return the name of a solver as part of the name of a file."""
    return re.sub(r"[^A-Za-z0-9_.+-]", "_", solver)


@contextmanager
def claimed(root: Path, identity: dict[str, Any]) -> Iterator[RunDirectory]:
    """Hold `root` for one run, new or resumed; nothing is touched if that must not be.

    Parameters
    ----------
    root : Path
        The run directory; created if it does not exist.
    identity : dict
        ``cases`` and ``options_of_result``: what a run that is resumed must have in common.

    Raises
    ------
    InputError
        If `root` is a file, holds something else or a run with other cases or options, or is held
        by another run.
    """
    found = _contents(root)
    if found - {".lock", "run.json.partial"} and "run.json" not in found:
        raise InputError("not empty and not a run; give --out a new directory", str(root))
    try:
        with asked_place(root):
            root.mkdir(parents=True, exist_ok=True)
            # inheritable would let an orphaned solver keep the lock; Python's default is not to
            lock = os.open(root / ".lock", os.O_RDWR | os.O_CREAT, 0o644)
    except InputError as error:
        raise InputError(f"{error}; give --out a folder that can be") from None
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno not in (errno.EWOULDBLOCK, errno.EACCES):
                raise InputError(f"cannot be locked ({error.strerror})", str(root)) from None
            raise InputError(
                "another run is writing into it; wait, or give --out another", str(root)
            ) from None
        _check_same_run(root, identity)
        yield RunDirectory(root)
    finally:
        os.close(lock)


def emptied(folder: Path, kept: tuple[str, ...] = ()) -> None:
    """Make `folder`, or remove all that is in it but files that are `kept`."""
    folder.mkdir(parents=True, exist_ok=True)
    for leftover in folder.iterdir():
        if leftover.name in kept:
            continue
        if leftover.is_dir() and not leftover.is_symlink():
            shutil.rmtree(leftover)
        else:
            leftover.unlink()


def write_run(directory: RunDirectory, record: dict[str, Any]) -> None:
    """Write ``run.json``."""
    write_json({"schema": RUN_SCHEMA, **record}, directory.run_file)


def _contents(root: Path) -> set[str]:
    try:
        return {path.name for path in root.iterdir()}
    except FileNotFoundError:
        return set()
    except NotADirectoryError:
        raise InputError("is a file; expected a directory for the run", str(root)) from None
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", str(root)) from None


def _check_same_run(root: Path, identity: dict[str, Any]) -> None:
    file = root / "run.json"
    if not file.exists():
        return
    before = read_json(file)
    if before.get("schema") != RUN_SCHEMA:
        raise InputError(f"not a run of schema {RUN_SCHEMA}; give --out a new directory", str(file))
    if changed := [key for key in _IDENTITY if before.get(key) != identity[key]]:
        what = {"cases": "cases", "options_of_result": "solvers, repetitions or parameters"}
        words = " and ".join(what[key] for key in changed)
        raise InputError(
            f"holds a run with other {words}; its own command resumes it "
            f"({before.get('command', 'unknown')}), or give --out a new directory",
            str(root),
        )


@dataclass(frozen=True)
class Job:
    """Solve `case` with `solver` on mesh `level`, in `folder`.

    `key` is a hash of scene, solver, level, repetitions, parameters and today's code. With a
    `model` the job solves another model of the case, for its adequacy.
    """

    case: str
    solver: str
    level: int
    repetitions: int
    key: str
    folder: Path
    parameters: dict[str, Any] = field(default_factory=dict)
    model: str = ""

    @property
    def label(self) -> str:
        """What a progress line calls it."""
        whose = f"{self.solver} (other {self.model})" if self.model else self.solver
        return f"{self.case} · {whose} · level {self.level}"

    def blank(self, status: Status, reason: str) -> SolveRecord:
        """Return a record of this solve without numbers."""
        return SolveRecord(
            self.case, self.solver, self.level, status, reason, parameters=self.parameters
        )


def store_record(job: Job, record: SolveRecord) -> None:
    """Store `record`, with the digests of the solution's files, in one step."""
    files = solution_files(job.folder) if record.status is Status.SOLVED else []
    content = {
        "key": job.key,
        "record": asdict(record),
        "files": {path.name: file_digest(path) for path in files},
    }
    write_json(content, job.folder / "record.json")


def load_record(folder: Path) -> SolveRecord:
    """Read the record of a solve.

    Raises
    ------
    InputError
        If it is missing or damaged.
    """
    return _stored(read_json(folder / "record.json"), folder)


def check_files(folder: Path) -> None:
    """Raise `InputError` if a file of the solution in `folder` is not as it was stored."""
    where = folder / "record.json"
    files = read_json(where).get("files", {})
    if not isinstance(files, dict) or not all(map(is_file_name, files)):
        raise InputError("names no files", str(where))
    for name, digest in files.items():
        try:
            same = file_digest(folder / name) == digest
        except OSError as error:
            raise InputError(f"cannot be read ({error.strerror})", str(folder / name)) from None
        if not same:
            raise InputError("was changed after it was stored", str(folder / name))


def stored_record(job: Job) -> SolveRecord | None:
    """Return the record of an earlier run of this very job: solved, its files whole, or refused.

    The same code refuses the same scene again. What died, ran out of time or was left out for want
    of it (without a ``wall``) may do better.
    """
    try:
        content = read_json(job.folder / "record.json")
        record = _stored(content, job.folder)
        check_files(job.folder)
    except InputError:
        return None
    refused = record.status is Status.REFUSED and record.wall is not None
    whole = refused or (record.status is Status.SOLVED and content.get("files"))
    return record if content.get("key") == job.key and whole else None


def solution_files(folder: Path) -> list[Path]:
    """Return the files of the solution in `folder`: its JSON half and those that it names."""
    names = read_json(folder / "solution.json").get("files", [])
    if not isinstance(names, list) or not all(map(is_file_name, names)):
        raise InputError("names no files", str(folder / "solution.json"))
    return [folder / "solution.json", *(folder / name for name in names)]


def is_file_name(name: Any) -> bool:
    """Whether `name` names a file in the same folder, and is no path that leads elsewhere."""
    return isinstance(name, str) and re.fullmatch(r"[A-Za-z0-9_][\w.+-]{0,200}", name) is not None


def _stored(content: dict[str, Any], folder: Path) -> SolveRecord:
    where = str(folder / "record.json")
    if "record" not in content:
        raise InputError("not a readable record ('record' is missing)", where)
    return checked(SolveRecord, content["record"], "record", where)


def outcome_in(folder: Path) -> dict[str, Any] | None:
    """Return what a solve left in `folder` as fields of a record, with ``peak_memory``.

    None if it left nothing, or something else.
    """
    try:
        outcome = read_json(folder / "outcome.json")
        blank = {"case": "", "solver": "", "level": 0}
        record = checked(SolveRecord, {**blank, **outcome}, "outcome", str(folder))
    except InputError:
        return None
    return {name: getattr(record, name) for name in outcome}


def reported_levels(job: Job) -> int:
    """Return the number of levels that a solver reported with level 0; 0 if it has not."""
    try:
        return min(int((job.folder / LEVELS).read_text()), MOST_LEVELS)
    except (OSError, ValueError):
        return 0
