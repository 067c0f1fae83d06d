"""One solve as a unit of work: what identifies it, its outcome, its record."""

import re
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.json_files import read_json, write_json
from verify.result import SolveRecord, Status
from verify.result_files import checked
from verify.runner.directory import LEVELS
from verify.runner.fingerprint import file_digest
from verify.solvers.interface import MOST_LEVELS


@dataclass(frozen=True)
class Job:
    """Solve `case` with `solver` on mesh `level`, in `folder`.

    `key` identifies what is computed: scene, solver, level, repetitions, parameters and the
    code of today. With a `model` it is not the case's own, but another that it is measured by.
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
    """Return the record of an earlier, solved run of this very job whose files are whole."""
    try:
        content = read_json(job.folder / "record.json")
        record = _stored(content, job.folder)
        files = content["files"]
        whole = files and all(file_digest(job.folder / n) == d for n, d in files.items())
    except (InputError, OSError, KeyError, TypeError, AttributeError):
        return None
    if content.get("key") == job.key and record.status is Status.SOLVED and whole:
        return record
    return None


def solution_files(folder: Path) -> list[Path]:
    """Return the files of the solution in `folder`: its JSON half and those that it names."""
    names = read_json(folder / "solution.json").get("files", [])
    if not isinstance(names, list) or not all(map(is_file_name, names)):
        raise InputError("names no files", str(folder / "solution.json"))
    return [folder / "solution.json", *(folder / name for name in names)]


def is_file_name(name: Any) -> bool:
    """Whether `name` is that of a file beside others, and nothing that leads elsewhere."""
    return isinstance(name, str) and re.fullmatch(r"[A-Za-z0-9_][\w.+-]{0,200}", name) is not None


def record_of(entry: Any, where: str) -> SolveRecord:
    """Make a record from its plain values.

    Raises
    ------
    InputError
        If they are not those of a record.
    """
    return checked(SolveRecord, entry, "record", where)


def _stored(content: dict[str, Any], folder: Path) -> SolveRecord:
    where = str(folder / "record.json")
    if "record" not in content:
        raise InputError("not a readable record ('record' is missing)", where)
    return record_of(content["record"], where)


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


def levels_told(job: Job) -> int:
    """Return how many levels a solver has that was asked for level 0; 0 if it has not said."""
    try:
        return min(int((job.folder / LEVELS).read_text()), MOST_LEVELS)
    except (OSError, ValueError):
        return 0
