"""One solve as a unit of work: what identifies it, how its record is stored and found again."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.json_files import read_json, write_json
from verify.result import Metric, SolveRecord, Status
from verify.runner.fingerprint import file_digest

__all__ = ["Job", "load_record", "record_of", "solution_files", "store_record", "stored_record"]


@dataclass(frozen=True)
class Job:
    """Solve `case` with `solver` on mesh `level`, in `folder`.

    `key` identifies what is computed: scene, solver, level, repetitions, parameters and the
    code of today.
    """

    case: str
    solver: str
    level: int
    repetitions: int
    key: str
    folder: Path
    parameters: dict[str, Any] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """What a progress line calls it."""
        return f"{self.case} · {self.solver} · level {self.level}"

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
    return [folder / "solution.json", *(folder / name for name in names)]


def record_of(entry: dict[str, Any], where: str) -> SolveRecord:
    """Make a record from its plain values.

    Raises
    ------
    InputError
        If they are not those of a record.
    """
    try:
        status, metrics = Status(entry["status"]), [Metric(**m) for m in entry["metrics"]]
        return SolveRecord(**{**entry, "status": status, "metrics": metrics})
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"not a readable record ({error})", where) from None


def _stored(content: dict[str, Any], folder: Path) -> SolveRecord:
    where = str(folder / "record.json")
    if "record" not in content:
        raise InputError("not a readable record ('record' is missing)", where)
    return record_of(content["record"], where)
